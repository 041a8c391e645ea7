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
}
