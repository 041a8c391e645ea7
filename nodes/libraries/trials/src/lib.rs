//! Blind trials of the diagnosis: machines whose hidden effect it is not told, and the judge of what it says.
//!
//! Three programs share nothing but a bag. The *generator* is here: `arm` says what kind of trials there are, `rig`
//! draws a machine with its plant, `own` gives it a programme of its own for classes that the common one does not show, `commissioning` measures what its maker knows of its loops, `programme` is what is measured, `effect` what is hidden in the plant,
//! `scatter` what no two runs have in common, `trial` puts them together and `measurement` runs the plan on
//! `fake_cnc`'s plant in simulated time. Its physics is the plant's own: nothing here calls the simulator or its
//! catalogue, whose ids it only writes down. The *diagnoser* is `abbe diagnose`, a process that is given the bag and
//! the machine file. The *judge* is `verdict` for one trial, `tally`, `calibration`, `confusion` and `detection` for all of
//! them, `covariate` knows what a leftover should go with, `target` says which figures are as good as they should be;
//! `compared` has the programmes that a designed one is compared with; `comparison` puts the methods of `baseline` and diagnoses without one of their rules before the same judge.
//!
//! `shop` has generator, judge and table of the sessions that shops bring, in files of its own; `shift` draws those of
//! hours on the plant.
//!
//! `size` says how large a hidden effect is for these measurements: D, the root of its chi-square against the
//! trial's own scatter, of which the generator, unlike the diagnoser, knows the covariance.

pub mod arm;
pub mod baseline;
pub mod calibration;
mod commissioning;
pub mod compared;
pub mod comparison;
pub mod confusion;
pub mod covariate;
pub mod detection;
pub mod effect;
pub mod error;
pub mod measurement;
mod own;
mod programme;
pub mod proportion;
pub mod rig;
#[cfg(test)]
mod sample;
pub mod scatter;
pub mod shift;
pub mod shop;
mod size;
pub mod tally;
pub mod target;
pub mod trial;
pub mod truth;
pub mod verdict;

pub use arm::Arm;
pub use baseline::Method;
pub use compared::Compared;
pub use effect::Class;
pub use error::TrialError;
pub use measurement::{Sample, measure};
pub use rig::Rig;
pub use shift::ShiftTrial;
pub use tally::Tally;
pub use trial::Trial;
pub use truth::Truth;
pub use verdict::{Second, Verdict, judge, likeness};
