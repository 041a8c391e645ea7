//! Compensates the axes within limits of size, rate and acceleration.
//!
//! At every servo tick the offset to be added to each axis' command is computed from the position
//! commanded and the models known. The readings of a warm machine have drifted by d(p), so that
//! the same place is reached by commanding p + d(p): the thermal part of the offset is +d(p).
//! An axis with a linear scale may have a dual loop (`positioning`): what lies between its motor and its
//! slide is learned point by point, and minus that deviation is the positioning part. The
//! geometric part (`geometric`) is minus the error of the tip that the published geometry models give.
//! `parts` holds the sum.
//!
//! Compensation moves a real axis, so nothing else than `limiter` decides what leaves the node: it
//! follows its target without ever exceeding the axis' size, rate or acceleration, whatever the
//! target and the spacing of time do. `axis_state` says per axis what the target is: the model, the
//! last good value (held), or zero by way of a fade. `model_gate` keeps back a model that jumps
//! faster than heat can, and refuses an axis whose drift is too uncertain where it may go; `span_watch`
//! sees where a drift is used beyond the blocks. `pulses` turns the offset
//! into whole pulses of the control and carries the rest, in the whole femtometres of `femtometre`.
//!
//! A node that is killed and started again begins from zero with nothing added. The control, which
//! sees the stream break off, is the one that must let go of the old offset gently; the new stream
//! then rises from zero within its limits.
//!
//! # References
//! SINUMERIK limits the velocity of temperature compensation for the same reason: a step of
//! compensation is a jerk on the axis.

pub mod axis_state;
pub mod config;
pub mod diagnostic;
pub mod error;
pub mod femtometre;
pub mod geometric;
pub mod limiter;
pub mod model_gate;
pub mod parts;
pub mod positioning;
pub mod pulses;
pub mod span_watch;
pub mod stage;

pub use config::AxisCompensationConfig;
pub use diagnostic::{Diagnostic, Severity};
pub use error::AxisCompensationError;
pub use stage::{AxisCompensationStage, Input, Output};
