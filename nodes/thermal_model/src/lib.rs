//! Models thermal drift of a machine tool from reference blocks on its table.
//!
//! Blocks stand on the table, each with three orthogonal faces. When the machine is cold every face
//! is touched along its own normal; that is the reference. While the machine works the faces are
//! touched again: what the readings have moved is the drift at the blocks, and between the blocks
//! it is interpolated. The drift of a *reading* is +d: to reach the same physical place the axis has
//! to be commanded to p + d(p), and the machine's position error (actual − commanded) is −d(p).
//!
//! `two_block` is the published method: a line per axis through two blocks at the ends of the
//! table's diagonal, renewed when `tt >= ct`. `n_block` carries it to any number of blocks, fits
//! what their geometry allows (offsets, scales, rotations, shears) and tests the fit. `alignment`
//! brings faces touched one after another to one instant, `latency_share` is what their errors have in
//! common. `quarantine` keeps back a jump that heat
//! cannot make. `update_rule` asks for the next cycle, `load` sees that the heat sources changed.
//! Between cycles `relaxation` extrapolates with a time constant where the data show one, and
//! `temperature` by the sensors where they have earned it; `prediction` keeps the score of both
//! against simply holding the last value. `block_heights` remarks blocks
//! whose heights differ too little or too much. `reference` and `cycle` gather the touches, `stage` joins
//! everything.
//!
//! # References
//! CN patent application on on-machine modelling of a whole machine's thermal error from two
//! reference blocks, Xi'an University of Technology, published 2024-01-16. ISO 230-3:2020.

pub mod alignment;
pub mod block_heights;
pub mod config;
pub mod cycle;
pub mod diagnostic;
pub mod drift_field;
pub mod error;
pub mod latency_share;
pub mod load;
pub mod n_block;
pub mod prediction;
pub mod quarantine;
pub mod reference;
pub mod relaxation;
pub mod stage;
pub mod temperature;
pub mod two_block;
pub mod update;
pub mod update_rule;

pub use config::{Method, SingleBlockJump, ThermalModelConfig};
pub use diagnostic::{Diagnostic, Severity};
pub use error::ThermalModelError;
pub use stage::{Input, Output, ThermalModelStage};
