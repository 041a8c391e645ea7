//! What can be wrong with a plant file, and with the two files together.

use metrology::number::{number, quantity, unit_of};
use metrology::yaml::YamlError;
use metrology::{Axis, BoundError};

use super::file::Place;

/// A plant that cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum PlantError {
    /// The text is not a plant file; the message names key, line and column.
    #[error("{source}")]
    Syntax {
        /// What the reader found.
        #[from]
        source: YamlError,
    },
    /// A number is outside the range of any machine.
    #[error(transparent)]
    Bound(#[from] BoundError),
    /// A value is outside its range.
    #[error("{place} = {}: must be {limit}", of_key(place, *value))]
    OutOfRange {
        /// Path of the key, unit in its name.
        place: String,
        /// The value as written.
        value: f64,
        /// The range.
        limit: &'static str,
    },
    /// An axis of the machine file has no entry.
    #[error("{place}: no entry for axis {axis}, which the machine file has")]
    AxisMissing {
        /// The table that lacks it.
        place: &'static str,
        /// The axis.
        axis: Axis,
    },
    /// An entry for an axis that the machine file lacks, or has as another kind.
    #[error("{place}.{axis}: the machine file has no such axis of this kind")]
    AxisUnknown {
        /// The table.
        place: &'static str,
        /// The axis.
        axis: Axis,
    },
    /// A name that the machine file does not know.
    #[error("{place}: \"{name}\" is not in the machine file")]
    NameUnknown {
        /// Path of the key.
        place: &'static str,
        /// The name.
        name: String,
    },
    /// The chain string cannot be read.
    #[error("chain \"{chain}\", column {column}: \"{found}\": expected {expected}")]
    Chain {
        /// The whole string.
        chain: String,
        /// Column of the offence, from 1.
        column: usize,
        /// What stands there.
        found: String,
        /// What should.
        expected: &'static str,
    },
    /// A drive whose elastic mode is too fast for the servo period.
    #[error(
        "drive {axis}: natural frequency times inner step = {}: must be below {} \
         (lower the stiffnesses or the servo period)",
        number(*product), number(*limit)
    )]
    TooStiff {
        /// The axis.
        axis: Axis,
        /// Angular frequency times inner step.
        product: f64,
        /// Greatest allowed.
        limit: f64,
    },
    /// A spindle that would melt the machine.
    #[error(
        "heat.spindle: at the machine file's spindle.max_speed_rpm = {speed_rpm}, {place} settles at {temp_degc} °C: \
         must be at most {limit_degc} °C (lower the speed or the losses, or raise the conductances)",
        speed_rpm = quantity("speed_rpm", *speed_rpm),
        temp_degc = number(*temp_degc),
        limit_degc = number(*limit_degc)
    )]
    TooHot {
        /// Greatest speed of the machine file, 1/min.
        speed_rpm: f64,
        /// The hottest place.
        place: Place,
        /// Where it settles.
        temp_degc: f64,
        /// The greatest temperature allowed.
        limit_degc: f64,
    },
    /// A lumped place without an entry.
    #[error("heat.places: no entry for {place}")]
    PlaceMissing {
        /// The place.
        place: Place,
    },
    /// Two heat links between the same places, or a link from a place to itself.
    #[error(
        "heat.links[{index}]: {from} to {to}: each pair of different places has one link at most"
    )]
    Link {
        /// Index of the link in the file.
        index: usize,
        /// One end.
        from: Place,
        /// The other end.
        to: Place,
    },
    /// An artefact whose normal is no axis direction.
    #[error("artefact \"{id}\": normal {normal:?}: must be an axis direction such as [0, 0, 1]")]
    Normal {
        /// Name of the artefact.
        id: String,
        /// The normal as written.
        normal: [f64; 3],
    },
}

/// A number with the unit of its key, or of the key above it, as in `standing_heat_w.bed`.
fn of_key(place: &str, value: f64) -> String {
    let above = place.rsplit_once('.').map(|(above, _)| above);
    match above.filter(|_| unit_of(place).is_none()) {
        Some(above) => quantity(above, value),
        None => quantity(place, value),
    }
}

/// Refuses a value outside `limit`.
pub(super) fn require(
    holds: bool,
    place: impl Into<String>,
    value: f64,
    limit: &'static str,
) -> Result<(), PlantError> {
    if holds {
        Ok(())
    } else {
        Err(PlantError::OutOfRange {
            place: place.into(),
            value,
            limit,
        })
    }
}

/// Refuses anything but a finite number above zero.
pub(super) fn require_positive(place: impl Into<String>, value: f64) -> Result<(), PlantError> {
    require(
        value > 0.0 && value.is_finite(),
        place,
        value,
        "finite and above 0",
    )
}

/// Refuses anything but a finite number not below zero.
pub(super) fn require_not_negative(place: impl Into<String>, value: f64) -> Result<(), PlantError> {
    require(
        value >= 0.0 && value.is_finite(),
        place,
        value,
        "finite and not below 0",
    )
}

/// Refuses infinities and NaN.
pub(super) fn require_finite(place: impl Into<String>, value: f64) -> Result<(), PlantError> {
    require(value.is_finite(), place, value, "finite")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_below_a_key_has_the_unit_of_the_key() {
        for (place, words) in [
            (
                "heat.standing_heat_w.bed",
                "heat.standing_heat_w.bed = -1 W: must be",
            ),
            (
                "drives.X.torque_limit_n_m",
                "= -1 N m: must be finite and above 0",
            ),
            (
                "heat.spindle.motor_exponent",
                "heat.spindle.motor_exponent = -1: must be",
            ),
        ] {
            let said = require_positive(place, -1.0).unwrap_err().to_string();
            assert!(said.contains(words), "{said}");
        }
    }
}
