//! Why a recording is no session of this machine.

use machine::ChainError;
use metrology::Axis;
use metrology::number::number;
use twin::TwinError;

/// A recording that cannot be diagnosed at all.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message names each field")]
pub enum SessionError {
    /// Neither axis states nor touches.
    #[error("the recording holds neither axis states nor touches: record axes/state")]
    NothingCommanded,
    /// No test.
    #[error("the recording holds no test segment: record test/segment, which tells runs apart")]
    NoSegments,
    /// Nothing was read in any run.
    #[error(
        "none of the {segments} test segments holds a reading: record grid/position, length/position, probe/trigger, or motors that move (angle/position alone has figures by abbe report, and no diagnosis)"
    )]
    NothingRead { segments: usize },
    /// The bag is of a machine with other axes.
    #[error(
        "the recording has axes {found}, the machine file has {wanted}: it is another machine's"
    )]
    OtherAxes { found: String, wanted: String },
    /// The bag is of a machine with another travel.
    #[error(
        "axis {axis} was commanded to {position} {unit}, its travel in the machine file is {low} to {high}: it is another machine's", position = number(*position), low = number(*low), high = number(*high))]
    OutsideTravel {
        axis: Axis,
        position: f64,
        unit: &'static str,
        low: f64,
        high: f64,
    },
    /// The machine's chain cannot be used.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// What was gathered is no motion.
    #[error(transparent)]
    Twin(#[from] TwinError),
}
