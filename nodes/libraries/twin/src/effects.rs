//! The catalogue of error effects: one file each, and this list.
//!
//! An effect knows its physics and nothing of instruments: it adds to a [`Response`] what it does to
//! motor, slide, tip, reading or touch. Its [`Kind`] says what it is called, on what it can act, which
//! parameters it has in the units of the machine file, what excites it, and how to widen its form without
//! losing its name. To add one: write its file, add its line below.

mod form;
mod kind;
mod lever;
mod line;
mod slow;
mod stale;

pub mod acceleration_lag;
pub mod ambient_drift;
pub mod angular_error;
pub mod backlash;
pub mod clock_drift;
pub mod clock_offset;
pub mod column_bend;
pub mod coolant;
pub mod cyclic_error;
pub mod drive_windup;
pub mod feed_lost_motion;
pub mod friction_windup;
pub mod gravity_sag;
pub mod guide_bow;
pub mod homing_shift;
pub mod interpolation_error;
pub mod latency_drift;
pub mod latency_jitter;
pub mod latency_modes;
pub mod lateral_play;
pub mod length_misalignment;
pub mod length_wavelength;
pub mod load_deflection;
pub mod pitch_error;
pub mod plate_error;
pub mod probe_latency;
pub mod probe_lobing;
pub mod probe_pretravel;
pub mod probe_repeatability;
pub mod quantisation;
pub mod reversal_spike;
pub mod rotary_backlash;
pub mod rotary_location;
pub mod rotary_motion;
pub mod scale_error;
pub mod screw_elongation;
pub mod servo_lag;
pub mod spindle_growth;
pub mod squareness;
pub mod stick_slip;
pub mod straightness;
pub mod structural_ringing;
pub mod stylus_jump;
pub mod thermal_shift;
pub mod thermometer_lag;
pub mod thermometer_noise;
pub mod thermometer_offset;
pub mod vibration_random;
pub mod workpiece_expansion;

use metrology::Axis;

pub use kind::{Kind, Moment, Parameter, Role, Target, Targets};
pub use line::line;

use crate::{Following, History, Response, Run, TwinError};
use machine::file::{EffectEntry, MachineFile};
use machine::kinematics::Kinematics;

/// Every effect that the twin knows.
pub static CATALOGUE: &[&Kind] = &[
    &acceleration_lag::KIND,
    &ambient_drift::KIND,
    &angular_error::KIND,
    &backlash::KIND,
    &clock_drift::KIND,
    &clock_offset::KIND,
    &column_bend::KIND,
    &coolant::KIND,
    &cyclic_error::KIND,
    &drive_windup::KIND,
    &feed_lost_motion::KIND,
    &friction_windup::KIND,
    &gravity_sag::KIND,
    &guide_bow::KIND,
    &homing_shift::KIND,
    &interpolation_error::KIND,
    &latency_drift::KIND,
    &latency_jitter::KIND,
    &latency_modes::KIND,
    &lateral_play::KIND,
    &length_misalignment::KIND,
    &length_wavelength::KIND,
    &load_deflection::KIND,
    &pitch_error::KIND,
    &plate_error::KIND,
    &probe_latency::KIND,
    &probe_lobing::KIND,
    &probe_pretravel::KIND,
    &probe_repeatability::KIND,
    &quantisation::KIND,
    &reversal_spike::KIND,
    &rotary_backlash::KIND,
    &rotary_location::KIND,
    &rotary_motion::KIND,
    &scale_error::KIND,
    &screw_elongation::KIND,
    &servo_lag::KIND,
    &spindle_growth::KIND,
    &squareness::KIND,
    &stick_slip::KIND,
    &straightness::KIND,
    &structural_ringing::KIND,
    &stylus_jump::KIND,
    &thermal_shift::KIND,
    &thermometer_lag::KIND,
    &thermometer_noise::KIND,
    &thermometer_offset::KIND,
    &vibration_random::KIND,
    &workpiece_expansion::KIND,
];

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

/// The machine as it is described: the nominal following errors of its loops, then the known effects of its
/// machine file, checked: kinds, targets, keys, ranges. What a measurement is compared with.
///
/// # Errors
/// Names the entry, the key, the value and what would be possible.
pub fn known(machine: &MachineFile) -> Result<Vec<Box<dyn Effect>>, TwinError> {
    let nominal: Box<dyn Effect> = Box::new(Following);
    let listed = machine.effects.iter().enumerate();
    std::iter::once(Ok(nominal))
        .chain(listed.map(|(index, entry)| from_entry(machine, index, entry)))
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
