//! Vocabulary of machine-tool metrology that every node shares.
//!
//! Lengths are millimetres, angles radians, times integer nanoseconds on a named clock, temperatures
//! degrees Celsius and their differences kelvin. One sign rule holds everywhere: an *error* is
//! actual minus commanded, of the tool relative to the workpiece; a *compensation* is what is added
//! to the command. Axes follow ISO 841.

pub mod arrival;
pub mod axis;
pub mod bound;
pub mod clock_map;
pub mod drift;
pub mod epoch;
pub mod error_component;
pub mod fit;
pub mod homed_gate;
pub mod least_squares;
pub mod leaves;
pub mod number;
pub mod offset_rule;
pub mod parameter;
pub mod sample;
pub mod severity;
pub mod sole_author;
pub mod squareness;
pub mod stage;
pub mod stamp;
pub mod text;
pub mod visible;
pub mod yaml;

pub use arrival::ArrivalClock;
pub use axis::{Axis, AxisSet, PerAxis};
pub use bound::{Bound, BoundError, Range};
pub use clock_map::ClockMap;
pub use error_component::ErrorComponent;
pub use homed_gate::{GateNews, HomedGate};
pub use offset_rule::{OffsetFault, OffsetRule, OffsetsRefused};
pub use parameter::{ParameterDoc, check_between, check_parameters, parameters_of};
pub use severity::Severity;
pub use sole_author::{Author, AuthorNews, SoleAuthor};
pub use stage::Stage;
pub use stamp::{Clock, Host, Machine, Reference, Stamp};
