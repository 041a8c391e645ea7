//! What can be wrong with a mapping.

use metrology::Axis;
use metrology::bound::BoundError;
use metrology::number::{number, quantity};

/// Errors of a mapping.
#[derive(Debug, thiserror::Error)]
pub enum MappingError {
    /// More keys than there may be.
    #[error(transparent)]
    Bound(#[from] BoundError),
    /// The mapping file cannot be read as a mapping.
    #[error("{0}")]
    MapFile(metrology::yaml::YamlError),
    /// A unit that does not fit the quantity of the mapping.
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
    /// Words for a value that is no text.
    #[error("{key}: a condition has no words")]
    Words {
        /// Key of the mapping.
        key: String,
    },
    /// Two keys report the same axis.
    #[error("{key}: axis {axis} is reported by another key")]
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
    #[error(
        "{key}: change.{field} = {}: must be from {} to {}",
        quantity(field, *value), number(*least), quantity(field, *greatest)
    )]
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
}
