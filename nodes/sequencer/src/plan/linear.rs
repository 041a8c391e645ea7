//! Steps that run along one axis or along the beam of a length reference.

use machine::trajectory::{
    Arrival, AxisRun, Diagonal, Trajectory, diagonal, positioning, scan, uneven_targets_mm,
};
use machine::{MachineFile, TrajectoryError};
use metrology::Axis;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::grid::in_step;
use crate::error::SequencerError;

/// Stops along one axis, up and down.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PositioningStep {
    /// The axis.
    pub axis: Axis,
    /// Targets by ascending position; or the three keys below.
    #[serde(default)]
    pub targets_mm: Vec<f64>,
    /// First target.
    #[serde(default)]
    pub from_mm: Option<f64>,
    /// Last target.
    #[serde(default)]
    pub to_mm: Option<f64>,
    /// About how far targets are apart; they are scattered unevenly.
    #[serde(default)]
    pub spacing_mm: Option<f64>,
    /// Runs, each up and down and a program of its own.
    pub runs: u32,
    /// Rest at each target; a scan has none.
    #[serde(default)]
    pub dwell_s: Option<f64>,
    /// Feed.
    pub feed_mm_min: f64,
    /// How far the axis overruns its first and last target.
    pub overrun_mm: f64,
    /// Beam of the length reference; without it, where the other axes rest.
    #[serde(default)]
    pub beam: Option<String>,
    /// Where the other axes rest.
    #[serde(default)]
    pub at_mm: Option<[f64; 3]>,
}

/// Stops along beams, up and down.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DiagonalStep {
    /// Beams of the length reference.
    pub beams: Vec<String>,
    /// Targets on each.
    pub targets: u32,
    /// Runs of each, up and down, each a program of its own.
    pub runs: u32,
    /// Rest at each target.
    pub dwell_s: f64,
    /// Feed.
    pub feed_mm_min: f64,
    /// Way beyond the first and last target, inside the beam.
    pub overrun_mm: f64,
}

impl PositioningStep {
    /// The program of one run; `stops`: with rests, otherwise a scan.
    pub(crate) fn program(
        &self,
        step: usize,
        machine: &MachineFile,
        stops: bool,
        arrival: Arrival,
    ) -> Result<Trajectory, SequencerError> {
        let of = if stops { "positioning" } else { "a scan" };
        let dwell_s = match (self.dwell_s, stops) {
            (Some(dwell_s), true) => dwell_s,
            (None, false) => 0.0,
            (None, true) => return Err(missing(step, "dwell_s", of)),
            (Some(_), false) => return Err(superfluous(step, "dwell_s", of)),
        };
        let at_mm = match (&self.beam, self.at_mm) {
            (None, Some(at_mm)) => Vector3::from(at_mm),
            (Some(_), None) => Vector3::zeros(),
            (None, None) => return Err(missing(step, "at_mm", "a run without a beam")),
            (Some(_), Some(_)) => return Err(superfluous(step, "at_mm", "a run along a beam")),
        };
        let order = AxisRun {
            axis: self.axis,
            beam: self.beam.as_deref(),
            at_mm,
            targets_mm: self.targets(step)?,
            runs: 1,
            dwell_s,
            feed_mm_min: self.feed_mm_min,
            overrun_mm: self.overrun_mm,
            arrival,
        };
        let written = if stops {
            positioning(machine, &order)
        } else {
            scan(machine, &order)
        };
        written.map_err(|source| in_step(step, source))
    }

    fn targets(&self, step: usize) -> Result<Vec<f64>, SequencerError> {
        const OF: &str = "a run whose targets are not listed";
        let keys = (self.from_mm, self.to_mm, self.spacing_mm);
        if !self.targets_mm.is_empty() {
            return match keys {
                (None, None, None) => Ok(self.targets_mm.clone()),
                _ => Err(superfluous(
                    step,
                    "from_mm, to_mm or spacing_mm",
                    "a list of targets",
                )),
            };
        }
        let from_mm = keys.0.ok_or_else(|| missing(step, "from_mm", OF))?;
        let to_mm = keys.1.ok_or_else(|| missing(step, "to_mm", OF))?;
        let spacing_mm = keys.2.ok_or_else(|| missing(step, "spacing_mm", OF))?;
        uneven_targets_mm(from_mm, to_mm, spacing_mm).map_err(|source| in_step(step, source))
    }
}

impl DiagonalStep {
    /// The program of one run along one beam.
    pub(crate) fn program(
        &self,
        step: usize,
        machine: &MachineFile,
        beam: &str,
        arrival: Arrival,
    ) -> Result<Trajectory, SequencerError> {
        let order = Diagonal {
            beam,
            targets: self.targets,
            runs: 1,
            dwell_s: self.dwell_s,
            feed_mm_min: self.feed_mm_min,
            overrun_mm: self.overrun_mm,
            arrival,
        };
        diagonal(machine, &order).map_err(|source: TrajectoryError| in_step(step, source))
    }
}

fn missing(step: usize, key: &'static str, of: &'static str) -> SequencerError {
    SequencerError::KeyMissing { step, key, of }
}

fn superfluous(step: usize, key: &'static str, of: &'static str) -> SequencerError {
    SequencerError::KeySuperfluous { step, key, of }
}
