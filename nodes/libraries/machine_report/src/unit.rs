//! Units as MTConnect spells them, and what they are inside.

use std::f64::consts::PI;

use metrology::sample::Quantity;
use serde::{Deserialize, Serialize};

/// A unit in which a machine tells a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the variants are their own words")]
pub enum Unit {
    #[serde(rename = "MILLIMETER")]
    Millimeter,
    #[serde(rename = "INCH")]
    Inch,
    #[serde(rename = "DEGREE")]
    Degree,
    #[serde(rename = "RADIAN")]
    Radian,
    #[serde(rename = "MILLIMETER/SECOND")]
    MillimeterPerSecond,
    #[serde(rename = "MILLIMETER/MINUTE")]
    MillimeterPerMinute,
    #[serde(rename = "INCH/MINUTE")]
    InchPerMinute,
    #[serde(rename = "REVOLUTION/MINUTE")]
    RevolutionPerMinute,
    #[serde(rename = "REVOLUTION/SECOND")]
    RevolutionPerSecond,
    #[serde(rename = "CELSIUS")]
    Celsius,
    #[serde(rename = "FAHRENHEIT")]
    Fahrenheit,
    #[serde(rename = "PERCENT")]
    Percent,
}

/// Millimetres in an inch, by its definition of 1959.
const INCH_MM: f64 = 25.4;

impl Unit {
    /// Every unit, for proposals.
    pub const ALL: [Self; 12] = [
        Self::Millimeter,
        Self::Inch,
        Self::Degree,
        Self::Radian,
        Self::MillimeterPerSecond,
        Self::MillimeterPerMinute,
        Self::InchPerMinute,
        Self::RevolutionPerMinute,
        Self::RevolutionPerSecond,
        Self::Celsius,
        Self::Fahrenheit,
        Self::Percent,
    ];

    /// MTConnect's word for it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Millimeter => "MILLIMETER",
            Self::Inch => "INCH",
            Self::Degree => "DEGREE",
            Self::Radian => "RADIAN",
            Self::MillimeterPerSecond => "MILLIMETER/SECOND",
            Self::MillimeterPerMinute => "MILLIMETER/MINUTE",
            Self::InchPerMinute => "INCH/MINUTE",
            Self::RevolutionPerMinute => "REVOLUTION/MINUTE",
            Self::RevolutionPerSecond => "REVOLUTION/SECOND",
            Self::Celsius => "CELSIUS",
            Self::Fahrenheit => "FAHRENHEIT",
            Self::Percent => "PERCENT",
        }
    }

    /// Factor and offset to the inner unit (mm, rad, mm/s, rad/s, °C, 1): inner = value · factor + offset.
    #[must_use]
    pub fn to_inner(self) -> (f64, f64) {
        match self {
            Self::Millimeter | Self::Radian | Self::MillimeterPerSecond | Self::Celsius => {
                (1.0, 0.0)
            }
            Self::Inch => (INCH_MM, 0.0),
            Self::Degree => (PI / 180.0, 0.0),
            Self::MillimeterPerMinute => (1.0 / 60.0, 0.0),
            Self::InchPerMinute => (INCH_MM / 60.0, 0.0),
            Self::RevolutionPerMinute => (PI / 30.0, 0.0),
            Self::RevolutionPerSecond => (2.0 * PI, 0.0),
            Self::Fahrenheit => (5.0 / 9.0, -160.0 / 9.0),
            Self::Percent => (0.01, 0.0),
        }
    }

    /// Whether it measures that quantity.
    #[must_use]
    pub const fn measures(self, quantity: Quantity) -> bool {
        match quantity {
            Quantity::Feed => matches!(
                self,
                Self::MillimeterPerSecond | Self::MillimeterPerMinute | Self::InchPerMinute
            ),
            Quantity::SpindleSpeed => {
                matches!(self, Self::RevolutionPerMinute | Self::RevolutionPerSecond)
            }
            Quantity::Temperature => matches!(self, Self::Celsius | Self::Fahrenheit),
            Quantity::Load | Quantity::Override => matches!(self, Self::Percent),
            Quantity::Execution | Quantity::ControllerMode | Quantity::Text => false,
        }
    }

    /// Whether it measures the position of a linear (else rotary) axis.
    #[must_use]
    pub const fn measures_position(self, is_linear: bool) -> bool {
        if is_linear {
            matches!(self, Self::Millimeter | Self::Inch)
        } else {
            matches!(self, Self::Degree | Self::Radian)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed forms: a half turn, 212 °F, 60 rpm.
    #[test]
    fn val_units_lead_to_the_inner_ones() {
        let inner = |unit: Unit, value: f64| {
            let (factor, offset) = unit.to_inner();
            value * factor + offset
        };
        for (unit, value, wanted) in [
            (Unit::Degree, 180.0, PI),
            (Unit::Fahrenheit, 212.0, 100.0),
            (Unit::Fahrenheit, -40.0, -40.0),
            (Unit::RevolutionPerMinute, 60.0, 2.0 * PI),
            (Unit::InchPerMinute, 60.0, 25.4),
            (Unit::Percent, 95.0, 0.95),
        ] {
            assert!((inner(unit, value) - wanted).abs() < 1e-12, "{unit:?}");
        }
    }

    #[test]
    fn words_are_those_of_the_mapping_file() {
        for unit in Unit::ALL {
            let word = serde_json::to_value(unit).unwrap();
            assert_eq!(word, unit.word());
        }
    }
}
