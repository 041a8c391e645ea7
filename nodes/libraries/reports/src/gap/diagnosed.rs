//! A diagnosis with what was read for it.

use anyhow::Result;
use gap_diagnosis::Diagnosis;
use gap_diagnosis::report::{GapReport, MadeWith};
use replayer::Reading;

use super::simulated::Simulated;
use crate::loss;

/// Whether a simulated machine has what a cause names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InPlant {
    /// `yes`, `no`, or `not stated`.
    pub has_it: &'static str,
    /// Key and value of the part that makes it, or empty.
    pub part: String,
}

/// A diagnosis of bags, with what could not be used of them.
pub struct Diagnosed {
    /// What was found.
    pub diagnosis: Diagnosis,
    /// What of the runs could not be used, in words.
    pub omitted: Vec<String>,
    /// What was left out and is no loss, in words.
    pub remarks: Vec<String>,
    /// What of each bag was read, lost and left out.
    pub readings: Vec<Reading>,
    /// Defaults of the machine file that the diagnosis uses, as `axes.X.lead_mm = 10.0`.
    pub defaults: Vec<String>,
    /// The simulator that the machine was compared with, where it is not the machine file's own.
    pub simulated: Option<Simulated>,
    /// What the simulated machine has of each cause, in the order of the report; empty where the machine is a real one.
    pub in_plant: Vec<InPlant>,
    /// Ids of effects that were not considered.
    pub without: Vec<String>,
    /// Ids of rules that were switched off.
    pub ablated: Vec<String>,
}

impl Diagnosed {
    /// What was lost or left out, in words.
    pub fn losses(&self) -> Vec<String> {
        let mut lines = loss::lines(&self.readings);
        lines.extend(self.omitted.iter().cloned());
        lines
    }

    /// The report as JSON, with what is known beside the diagnosis: losses, defaults in use, the simulator, what was not considered.
    ///
    /// # Errors
    /// When a number has no place in JSON.
    pub fn json(&self) -> Result<serde_json::Value> {
        let is_whole = self.losses().is_empty();
        let of_runs = (!self.omitted.is_empty()).then(
            || serde_json::json!({ "places": [], "left_out": [], "omitted_of_runs": self.omitted }),
        );
        let is_limited = !(self.without.is_empty() && self.ablated.is_empty());
        let simulated = self.simulated.as_ref().map(serde_json::to_value);
        let report = GapReport {
            loss: if is_whole {
                vec![]
            } else {
                let bags = self.readings.iter().map(loss::as_json);
                bags.chain(of_runs).collect()
            },
            machine_defaults: self.defaults.clone(),
            simulated: simulated.transpose()?,
            made_with: is_limited.then(|| MadeWith {
                without: self.without.clone(),
                ablated: self.ablated.clone(),
            }),
            ..self.diagnosis.report.clone()
        };
        Ok(serde_json::to_value(report)?)
    }
}
