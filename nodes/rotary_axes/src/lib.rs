//! Where the rotary axes lie, from the centre of a sphere probed at several of their poses.
//!
//! A sphere on the table is carried by a displaced or tilted axis to another place than the control
//! computes; probing its centre at enough poses tells the location errors apart. `visit` is one
//! centre at one pose. `unknown` lists what may be asked: location errors, and low harmonics of the
//! rotary axes' error motions. `fit` is the weighted least-squares solution that says what it cannot
//! see; `estimate` puts it to use: the sphere's place, doubtful visits, lack of fit, harmonics where
//! they are needed; `allowance` adds to its uncertainty what no visit shows. `verification` holds a model against other
//! poses, `expectation` says what it may leave there; `published` turns the estimate into the message. `stage` is the node's whole computation. The poses themselves are planned, and what they
//! would tell is predicted, in `machine::poses`.
//!
//! One sphere and one stylus length cannot tell a tilt from a displacement that looks alike at that
//! place; two spheres at different heights or distances can. Spheres measured one after the other in
//! one set-up are put together.

pub mod allowance;
pub mod config;
pub mod diagnostic;
pub mod error;
pub mod estimate;
pub mod expectation;
pub mod fit;
pub mod published;
mod run;
pub mod stage;
pub mod unknown;
pub mod verification;
pub mod visit;

pub use allowance::{Allowance, Known};
pub use config::RotaryAxesConfig;
pub use diagnostic::Diagnostic;
pub use error::RotaryAxesError;
pub use estimate::{EstimateRules, RotaryEstimate, estimate};
pub use stage::{Input, Output, RotaryAxesStage};
pub use unknown::Unknown;
pub use visit::SphereVisit;
