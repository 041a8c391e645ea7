//! What is refused when the node starts. A bad measurement is no error: see [`crate::Diagnostic`].

use metrology::Axis;
use metrology::bound::BoundError;
use metrology::least_squares::FitError;

/// A configuration, machine or geometry from which no thermal model can be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ThermalModelError {
    /// A parameter outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// The method cannot work with the blocks of the machine file.
    #[error("blocks: the machine file has {n_blocks}, the method needs {least} to {most}")]
    BlockCount {
        /// Blocks in the machine file.
        n_blocks: usize,
        /// Least number.
        least: usize,
        /// Greatest number.
        most: usize,
    },
    /// Two blocks have one name.
    #[error("block \"{block_id}\" is in the machine file more than once")]
    DuplicateBlock {
        /// The name.
        block_id: String,
    },
    /// A linear axis is not in the machine file.
    #[error(
        "axis {axis}: the blocks need its travel, and the machine file has no such linear axis"
    )]
    NoTravel {
        /// The axis.
        axis: Axis,
    },
    /// A sensor is named that the machine file does not have.
    #[error(
        "{key} = \"{sensor}\": the machine file has no such temperature sensor, it has {known}"
    )]
    UnknownSensor {
        /// The parameter.
        key: &'static str,
        /// The name given.
        sensor: String,
        /// The names that there are.
        known: String,
    },
    /// The least-squares fit refused its numbers.
    #[error(transparent)]
    Fit(#[from] FitError),
}
