//! Recomputes what a bag's nodes published from what they were given, and compares it byte for byte; and says when
//! each message of a bag is due while it is played ([`pace`]).
//!
//! A bag of a composed run holds every message in the one order in which it happened. What came from outside (the
//! controller, its instruments, the sequencer and its service calls) is put in again; everything else is computed
//! again by the same stages with the parameters in the bag. A recorded result is never an input: it is only what the
//! computed one is held against. So a bag whose results were taken out gives the same results.
//!
//! What a replay cannot know is the order of a timer's tick and a message of the same instant where neither leads to
//! a message. Composed runs therefore take sources before all other nodes; `check` relies on it.
//!
//! Equality is claimed for one build on one machine; another build differs in the last digits of its numbers, which
//! the first difference shows in units of the last place.
//!
//! Whoever wants to know what a bag's messages say reads it by [`reading`]: one reader that keeps an account, so that one bad
//! message never refuses a bag.

pub mod account;
mod by_stamp;
mod difference;
mod error;
mod inputs;
pub mod known;
pub mod leap;
mod listening;
pub mod machines;
mod outliers;
pub mod pace;
pub mod pause;
pub mod playback;
pub mod reading;
mod repeats;
mod replay;
mod stamps;
mod turned;
mod usable;

pub use account::{Account, LeftOut, Place, Reason, TopicAccount};
pub use difference::{Difference, Discrepancy};
pub use error::{PlaybackError, ReplayError};
pub use inputs::{is_source, sources_first};
pub use leap::{Leap, Leaps};
pub use listening::NotInBag;
pub use playback::{Playback, PlaybackConfig};
pub use reading::{Reading, Taken};
pub use replay::{Compared, Doubtful, Outcome, Relay, check};
