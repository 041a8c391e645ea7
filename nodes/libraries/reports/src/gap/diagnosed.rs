//! A diagnosis with what was read for it.

use anyhow::Result;
use gap_diagnosis::Diagnosis;
use replayer::Reading;

use super::simulated::Simulated;
use crate::loss;

/// A diagnosis of bags, with what could not be used of them.
pub struct Diagnosed {
    /// What was found.
    pub diagnosis: Diagnosis,
    /// What was left out, in words.
    pub remarks: Vec<String>,
    /// What of each bag was read, lost and left out.
    pub readings: Vec<Reading>,
    /// Defaults of the machine file that the diagnosis uses, as `axes.X.lead_mm = 10.0`.
    pub defaults: Vec<String>,
    /// The simulator that the machine was compared with, where it is not the machine file's own.
    pub simulated: Option<Simulated>,
    /// Ids of effects that were not considered.
    pub without: Vec<String>,
    /// Ids of rules that were switched off.
    pub ablated: Vec<String>,
}

impl Diagnosed {
    /// What was lost or left out, in words.
    pub fn losses(&self) -> Vec<String> {
        loss::lines(&self.readings)
    }

    /// The report as JSON. What was lost or left out is a key of its own, where there is any, and so are defaults in use.
    ///
    /// # Errors
    /// When a number has no place in JSON.
    pub fn json(&self) -> Result<serde_json::Value> {
        let mut report = serde_json::to_value(&self.diagnosis.report)?;
        if self.readings.iter().any(|reading| !reading.is_whole()) {
            report["loss"] = self.readings.iter().map(loss::as_json).collect();
        }
        if !self.defaults.is_empty() {
            report["machine_defaults"] = self.defaults.as_slice().into();
        }
        if let Some(simulated) = &self.simulated {
            report["simulated"] = serde_json::to_value(simulated)?;
        }
        if !(self.without.is_empty() && self.ablated.is_empty()) {
            report["made_with"] = serde_json::json!({
                "without": self.without, "ablated": self.ablated,
            });
        }
        Ok(report)
    }
}
