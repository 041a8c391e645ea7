//! Why a session cannot be diagnosed, and what to record instead.

use metrology::bound::BoundError;
use metrology::number::quantity;

/// A session, a machine file or a setting that no diagnosis can be made of.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message names each field")]
pub enum GapError {
    /// Nothing was read.
    #[error("no run holds a reading: record a test whose instrument was on")]
    NoReadings,
    /// No channel was repeated.
    #[error(
        "no test was repeated, so nothing says what noise is ({runs} runs, channels {channels}): \
         run one short test three times, spread over the session"
    )]
    NoRepeats { runs: usize, channels: String },
    /// A count outside its range.
    #[error("{key} = {value}: must be within {low} and {high}")]
    Count {
        key: &'static str,
        value: usize,
        low: usize,
        high: usize,
    },
    /// A setting that is no number or too small.
    #[error("{key} = {value}: must be {low} or above", value = quantity(key, *value), low = quantity(key, *low))]
    Setting {
        key: &'static str,
        value: f64,
        low: f64,
    },
    /// A parameter of the node outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// The samples are no session of this machine.
    #[error(transparent)]
    Session(#[from] crate::session::SessionError),
    /// An id that the catalogue does not have.
    #[error("left_out: `{id}` is not in the catalogue")]
    LeftOut { id: String },
    /// A name that a design does not know.
    #[error("\"{name}\": is no {what}")]
    Unknown { what: &'static str, name: String },
    /// A rule that the diagnosis does not have.
    #[error(
        "rule \"{name}\": must be one of constancy free_shapes swap_search held_out recalibration"
    )]
    Rule { name: String },
    /// The twin cannot simulate it.
    #[error(transparent)]
    Twin(#[from] twin::TwinError),
}
