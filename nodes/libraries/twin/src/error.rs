//! What can be wrong with a session or an effect that is to be simulated.

use metrology::Axis;
use metrology::number::{number, quantity};

/// A session that cannot be simulated, or an effect that is none.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message names each field")]
pub enum TwinError {
    /// Time must grow.
    #[error("motion: time {time_s} s at tick {index} does not lie after the tick before", time_s = number(*time_s))]
    Time { index: usize, time_s: f64 },
    /// Vectors of different length.
    #[error("motion: axis {axis} has {found} positions, time has {wanted}")]
    Lengths {
        axis: Axis,
        found: usize,
        wanted: usize,
    },
    /// A position that is no number.
    #[error("motion: axis {axis} at tick {index} is {value}: must be finite", value = number(*value))]
    NotFinite {
        axis: Axis,
        index: usize,
        value: f64,
    },
    /// A reading refers to a tick that is not there.
    #[error("run {run}: a reading of {channel} refers to tick {tick}, the motion has {ticks}")]
    Reading {
        run: u32,
        channel: String,
        tick: usize,
        ticks: usize,
    },
    /// An effect that the catalogue does not have.
    #[error("effects[{index}].kind = `{kind}`: no such effect; the catalogue has {known}")]
    UnknownEffect {
        index: usize,
        kind: String,
        known: String,
    },
    /// An effect on something the machine does not have.
    #[error("effects[{index}] ({kind}): axis `{target}`: must be one of {possible}")]
    Target {
        index: usize,
        kind: String,
        target: String,
        possible: String,
    },
    /// A parameter that the effect does not have.
    #[error("effects[{index}] ({kind}): unknown key `{name}`; it has {known}")]
    UnknownParameter {
        index: usize,
        kind: String,
        name: String,
        known: String,
    },
    /// A parameter that is missing.
    #[error("effects[{index}] ({kind}): `{name}` is missing: physics has no default")]
    MissingParameter {
        index: usize,
        kind: String,
        name: String,
    },
    /// A parameter outside its physical range.
    #[error("effects[{index}] ({kind}): {name} = {value}: must be within {low} and {high}", value = quantity(name, *value), low = number(*low), high = quantity(name, *high))]
    Range {
        index: usize,
        kind: String,
        name: String,
        value: f64,
        low: f64,
        high: f64,
    },
    /// The machine's chain cannot be used.
    #[error(transparent)]
    Chain(#[from] machine::chain::ChainError),
}
