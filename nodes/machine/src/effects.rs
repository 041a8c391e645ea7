//! The catalogue of error effects: one file each, and this list.
//!
//! An effect knows its physics and nothing of instruments: it adds to a [`Response`] what it does to
//! motor, slide, tip, reading or touch. Its [`Kind`] says what it is called, on what it can act, which
//! parameters it has in the units of the machine file, what excites it, and how to widen its form without
//! losing its name. To add one: write its file, add its line below.

mod kind;

pub mod backlash;

use metrology::Axis;

pub use kind::{Kind, Moment, Parameter, Role, Target, Targets};

use crate::file::{EffectEntry, MachineFile};
use crate::kinematics::Kinematics;
use crate::twin::{History, Response, Run, TwinError};

/// Every effect that the twin knows.
pub static CATALOGUE: &[&Kind] = &[&backlash::KIND];

/// What an effect may look at: the machine as described, the run, and the past of the session.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// The machine file.
    pub machine: &'a MachineFile,
    /// Its chain.
    pub kinematics: &'a Kinematics,
    /// The slow past of the session.
    pub history: &'a History,
    /// The run that is simulated.
    pub run: &'a Run,
}

/// One effect on one target with its parameters.
pub trait Effect: Send + Sync {
    /// Adds what the effect does during a run.
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response);
}

/// Kind of an id.
#[must_use]
pub fn kind(id: &str) -> Option<&'static Kind> {
    CATALOGUE.iter().copied().find(|kind| kind.id == id)
}

/// The known effects of a machine file, checked: kinds, targets, keys, ranges.
///
/// # Errors
/// Names the entry, the key, the value and what would be possible.
pub fn known(machine: &MachineFile) -> Result<Vec<Box<dyn Effect>>, TwinError> {
    machine
        .effects
        .iter()
        .enumerate()
        .map(|(index, entry)| from_entry(machine, index, entry))
        .collect()
}

/// One entry of a machine file's list of effects.
///
/// # Errors
/// As [`known`].
pub fn from_entry(
    machine: &MachineFile,
    index: usize,
    entry: &EffectEntry,
) -> Result<Box<dyn Effect>, TwinError> {
    let kind = kind(&entry.kind).ok_or_else(|| TwinError::UnknownEffect {
        index,
        kind: entry.kind.clone(),
        known: CATALOGUE
            .iter()
            .map(|kind| kind.id)
            .collect::<Vec<_>>()
            .join(", "),
    })?;
    let target = kind.target_of(machine, index, entry)?;
    let values = kind.values_of(index, entry)?;
    Ok((kind.build)(target, &values))
}

/// Linear axes of a machine, in the order X Y Z.
#[must_use]
pub fn linear_axes(machine: &MachineFile) -> Vec<Axis> {
    Axis::LINEAR
        .into_iter()
        .filter(|axis| machine.linear(*axis).is_some())
        .collect()
}
