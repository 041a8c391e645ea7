//! How the clocks of the hosts of a cell stand to each other.
//!
//! A controller, the models and a recorder on hosts of their own stamp by clocks of their own, which are seconds apart and
//! drift by tens of microseconds per second. Each host asks the reference what time it is; question and answer carry
//! four stamps, and nothing arrives before it left. `band` is what the stamps allow at all, `fast` the line
//! that the fast messages show, `estimate` how well it is known and when a clock stepped, `stage` the node's whole
//! computation.
//!
//! What no exchange of stamps can see is by how much the two shortest ways differ; half of that stays in the
//! offset. It is bounded by half the shortest round trip and stated as part of the uncertainty.
//!
//! # References
//! D. L. Mills, RFC 5905, for the four stamps; S. B. Moon, P. Skelly, D. Towsley, IEEE INFOCOM 1999, for the skew of
//! clocks as a line below all delays.

pub mod band;
pub mod config;
pub mod diagnostic;
pub mod error;
pub mod estimate;
pub mod fast;
pub mod stage;

pub use config::HostClockConfig;
pub use diagnostic::Diagnostic;
pub use error::HostClockError;
pub use stage::{HostClockStage, Input, Output};
