//! What can go wrong before or beneath the stage.

use metrology::Axis;

/// Errors of the bridge: its parameters, its mapping, and its thread.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// A number of the configuration is out of its range.
    #[error("{key} = {value}: must be from {least} to {greatest}")]
    OutOfRange {
        /// Key in the parameter file.
        key: &'static str,
        /// What was read, in the key's unit.
        value: f64,
        /// Least value that is allowed.
        least: f64,
        /// Greatest value that is allowed.
        greatest: f64,
    },
    /// A word that goes over the wire would break the line.
    #[error("{key} = {value:?}: must be one word without white space")]
    NotAWord {
        /// Key in the parameter file.
        key: &'static str,
        /// What was read.
        value: String,
    },
    /// A log without the source, or the source without a log.
    #[error("log_file: belongs to source = log, and to no other")]
    LogFile,
    /// The mapping file is none.
    #[error("mapping: {0}")]
    MapFile(serde_saphyr::Error),
    /// A unit does not measure what the mapping says.
    #[error("{key}: {unit} does not measure {what}")]
    Unit {
        /// Key of the mapping.
        key: String,
        /// Unit in MTConnect's words.
        unit: &'static str,
        /// What it was to measure.
        what: &'static str,
    },
    /// A name cannot be a topic's.
    #[error("{key}: name {name:?}: {reason}")]
    Name {
        /// Key of the mapping.
        key: String,
        /// The name.
        name: String,
        /// Why not.
        reason: &'static str,
    },
    /// Two keys tell the same axis.
    #[error("{key}: axis {axis} is told by another key")]
    AxisTwice {
        /// Second key of the mapping.
        key: String,
        /// Axis.
        axis: Axis,
    },
    /// A commanded position without the actual one.
    #[error("axis {axis}: a commanded position alone")]
    CommandedAlone {
        /// Axis.
        axis: Axis,
    },
    /// A number of a rule is out of its range.
    #[error("{key}: change.{field} = {value}: must be from {least} to {greatest}")]
    Change {
        /// Key of the mapping.
        key: String,
        /// Field of `change`.
        field: &'static str,
        /// What was read.
        value: f64,
        /// Least value that is allowed.
        least: f64,
        /// Greatest value that is allowed.
        greatest: f64,
    },
    /// The system has no thread or event queue left.
    #[error("{action}: {source}")]
    Io {
        /// What was tried.
        action: &'static str,
        /// The system's word.
        source: std::io::Error,
    },
    /// An agent could not be asked.
    #[error("{url}: {reason}")]
    Ask {
        /// Where.
        url: String,
        /// Why.
        reason: String,
    },
    /// The mapping has no such spindle.
    #[error("the mapping has no spindle speed {name:?}")]
    NoSpindle {
        /// Its name.
        name: String,
    },
    /// A part of a shift is too fast for the other machine.
    #[error(
        "at {at_s} s: feed {feed_mm_min:.0} mm/min, limit {limit_mm_min:.0} mm/min: take longer bins"
    )]
    FeedTooHigh {
        /// Time from the shift's begin, s.
        at_s: f64,
        /// The feed.
        feed_mm_min: f64,
        /// The limit.
        limit_mm_min: f64,
    },
}
