//! What the machine would have done: every test of a recorded session, simulated from its commands.
//!
//! `session` is what was commanded and read during the runs of a session, `motion` the commanded
//! motion with what an effect asks of it (direction, distance since reversal), `history` the slow
//! past that heats a machine. An effect adds to a `response`: where the motor, the slide and the tool
//! tip are off, and what a sensor or a probe adds. `simulate` sums the responses of a list of effects
//! and reads them off as each channel's instrument would.
//!
//! # Model
//!
//! ```text
//!   motor   = command + servo                                             (1)
//!   slide   = motor + drive                                               (2)
//!   tip     = slides' position + tip        (machine frame)               (3)
//!   reading = what the instrument stands on + its own error               (4)
//! ```
//!
//! | channel | deviation that is predicted, mm (rad for rotary axes) |
//! |---|---|
//! | motor | servo + motor reading |
//! | scale | servo + drive + scale reading |
//! | grid u, v | (servo + drive + tip) along u, v of the plate + grid reading |
//! | length | (servo + drive + tip) along the beam + length reading |
//! | touch | what the latched position along the approach is beyond the surface: -(drive + tip) . n + travel |
//! | block face | the same, without a feed |
//! | thermometer | reading minus the temperature, K |
//!
//! Every channel adds what its instrument itself does to each reading (`Response::reading`).
//!
//! The machine as it is described is `effects::known`: the nominal following errors of its control loops
//! (`following`), and the effects of its machine file. What is predicted with no effect at all is zero.
//!
//! Deviations are small (below a millimetre), so responses of effects add up; positions on a curve are
//! those commanded.
//!
//! # Holds when
//! The recorded command is what the control followed, and the machine's known compensation is part of it
//! or is off. A deviation is measured minus nominal; an error actual minus commanded.

pub mod effects;
pub mod error;
pub mod following;
pub mod history;
pub mod motion;
pub mod response;
pub mod rubbing;
pub mod series;
pub mod session;
pub mod simulate;

pub use error::TwinError;
pub use following::Following;
pub use history::History;
pub use motion::Motion;
pub use response::Response;
pub use rubbing::Rubbing;
pub use series::Series;
pub use session::{Channel, Instrument, Reading, Run, Session, Touch};
pub use simulate::Twin;
