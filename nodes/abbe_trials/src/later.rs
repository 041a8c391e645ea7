//! How much of the gap the named effects close on later runs, for judging the interval that a diagnosis gives.
//!
//! The same programme is measured once more on the machine that hides the effects, an hour later, with another draw of
//! what its runs do not have in common. Its held-out runs are predicted with the machine file and with the machine
//! file that has the named effects:
//!
//! ```text
//!   closed = 1 - sum (after2 - floor2) / sum (before2 - floor2)           (1)
//! ```
//!
//! over held-out runs. Nothing is fitted to them but set-ups.

use anyhow::Result;
use gap_diagnosis::{GapConfig, diagnose};
use machine::MachineFile;
use trials::Rig;
use twin::Session;
use twin::effects::CATALOGUE;

use crate::blind::{self, Recording};

/// (1); none where there is no gap.
///
/// # Errors
/// When the rig cannot be measured.
pub fn closed(rig: &Rig, with: &MachineFile) -> Result<Option<f64>> {
    let later = rig.later(rig.plan.clone());
    let recording = blind::recorded(&[&later])?;
    Ok(recording.ok().and_then(|it| closed_on(&it, with)))
}

/// (1) on a recording; none where there is no gap.
pub fn closed_on((machine, session): &Recording, with: &MachineFile) -> Option<f64> {
    let before = beyond_floor(machine, session)?;
    let after = beyond_floor(with, session)?;
    (before > 0.0).then(|| 1.0 - after.max(0.0) / before)
}

/// Mean square beyond the floor on held-out runs, µm²; with a machine file that names everything that is known.
fn beyond_floor(machine: &MachineFile, session: &Session) -> Option<f64> {
    let diagnosis = diagnose(machine, session, &nothing_named()).ok()?;
    let runs = diagnosis.figures.held_out;
    let squares = runs
        .iter()
        .map(|run| run.before_um.powi(2) - run.floor_um.powi(2));
    (!runs.is_empty()).then(|| squares.sum())
}

/// A diagnosis that may name nothing: what is left of a session.
pub fn nothing_named() -> GapConfig {
    GapConfig {
        left_out: CATALOGUE.iter().map(|kind| kind.id.to_owned()).collect(),
        significance_draws: 99,
        bootstrap_draws: 100,
        ..GapConfig::default()
    }
}
