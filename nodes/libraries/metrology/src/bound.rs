//! Bounds of numbers that come from outside: counts, sizes, durations, and products of them.
//!
//! A count of a file, a message, a goal or a command line is checked against its bound before anything is made of it:
//! memory is never reserved, and no loop begins, for a number that nobody has looked at. Each type of such numbers has
//! one table of bounds; each bound has its reason where it stands.
//!
//! ```text
//!   n = f_1 f_2 ... f_k,   refused where n > greatest          (1)
//! ```
//!
//! (1) is computed in 128 bits and stays at the largest number where it would overflow, so that no product wraps below
//! its bound.

use std::borrow::Cow;
use std::fmt::Write as _;

use crate::number::{number, quantity, unit_of};

/// Bytes of a name in a message: of a feature, a sensor, a stylus, a host.
pub const NAME_BYTES: usize = 255;

/// Touches of one run: what a sequencer lets a cycle make, and what those who evaluate it hold. A program of so many stays
/// below the 1,000,000 lines that a control takes.
pub const TOUCHES_OF_RUN: usize = 100_000;

/// Runs or repeats of one step of a plan, or touches of one point: a run takes seconds at least, so this many take a day.
pub const MOST_RUNS: u64 = 10_000;
/// Targets along one axis, stations of a contour: what one program may have.
pub const MOST_STOPS: u64 = 100_000;
/// Points on a bore or sphere, or on the side of a plane's grid.
pub const MAX_FEATURE_POINTS: u64 = 1_000;
/// Poses of rotary axes, given or planned.
pub const MOST_POSES: u64 = 1_000;
/// Least and greatest of the counts that people write, by their keys.
pub const COUNTS: &[(&str, u64, u64)] = &[
    ("runs", 1, MOST_RUNS),
    ("repeats", 1, MOST_RUNS),
    ("stations", 1, MOST_STOPS),
    ("targets", 2, MOST_STOPS),
    ("points", 1, MAX_FEATURE_POINTS),
    ("planned", 0, MOST_POSES),
];

/// A temperature that a thermometer of a machine, its coolant or its shop reads: from liquid nitrogen to molten steel. An
/// open or broken sensor reads beyond it.
pub const TEMPERATURE: Range = Range::new(-200.0, 1_600.0, " °C");

/// The greatest value of a count or of a size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bound {
    greatest: u64,
    remedy: &'static str,
}

/// The range of a number with a unit, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    least: f64,
    greatest: f64,
    unit: &'static str,
}

/// A number outside its bound.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "fields are named in the messages")]
pub enum BoundError {
    #[error("{place} = {value}: at most {greatest}{remedy}")]
    Count {
        place: String,
        value: u64,
        greatest: u64,
        remedy: &'static str,
    },
    #[error("{place}: {value} {what}: at most {greatest}{remedy}")]
    Amount {
        place: String,
        value: u64,
        what: &'static str,
        greatest: u64,
        remedy: &'static str,
    },
    #[error("{place}: {factors} = {value} {what}: at most {greatest}{remedy}")]
    Product {
        place: String,
        factors: String,
        value: u128,
        what: &'static str,
        greatest: u64,
        remedy: &'static str,
    },
    #[error("{place} = {value}: must be from {least} to {greatest}{unit}", value = shown(place, *value, unit), least = number(*least), greatest = number(*greatest))]
    Number {
        place: String,
        value: f64,
        least: f64,
        greatest: f64,
        unit: Cow<'static, str>,
    },
}

/// The value with the unit of its name, or else with that of its range.
fn shown(place: &str, value: f64, unit: &str) -> String {
    match unit_of(place) {
        Some(_) => quantity(place, value),
        None => format!("{}{unit}", number(value)),
    }
}

impl BoundError {
    /// Path of the key, or name of the field.
    #[must_use]
    pub fn place(&self) -> &str {
        match self {
            Self::Count { place, .. }
            | Self::Amount { place, .. }
            | Self::Product { place, .. }
            | Self::Number { place, .. } => place,
        }
    }
}

impl Bound {
    /// At most so much.
    #[must_use]
    pub const fn at_most(greatest: u64) -> Self {
        Self {
            greatest,
            remedy: "",
        }
    }

    /// The same with what to do instead; `remedy` begins with `; `.
    #[must_use]
    pub const fn with_remedy(self, remedy: &'static str) -> Self {
        Self { remedy, ..self }
    }

    /// The greatest value.
    #[must_use]
    pub const fn greatest(self) -> u64 {
        self.greatest
    }

    /// Refuses a value above the bound; `place` names where it stands.
    ///
    /// # Errors
    /// With place, value and bound.
    pub fn check(
        self,
        place: impl FnOnce() -> String,
        value: impl TryInto<u64>,
    ) -> Result<(), BoundError> {
        let value = value.try_into().unwrap_or(u64::MAX);
        if value <= self.greatest {
            return Ok(());
        }
        Err(BoundError::Count {
            place: place(),
            value,
            greatest: self.greatest,
            remedy: self.remedy,
        })
    }

    /// Refuses an amount above the bound: a number of entries, a length of a text; `what` says of what.
    ///
    /// # Errors
    /// With place, amount and bound.
    pub fn check_amount(
        self,
        place: impl FnOnce() -> String,
        what: &'static str,
        value: impl TryInto<u64>,
    ) -> Result<(), BoundError> {
        let value = value.try_into().unwrap_or(u64::MAX);
        if value <= self.greatest {
            return Ok(());
        }
        Err(BoundError::Amount {
            place: place(),
            value,
            what,
            greatest: self.greatest,
            remedy: self.remedy,
        })
    }

    /// Refuses a product above the bound, equation (1); gives the product. `what` says what is counted, and each factor
    /// has its own word.
    ///
    /// # Errors
    /// With place, factors, product and bound.
    pub fn check_product(
        self,
        place: impl FnOnce() -> String,
        what: &'static str,
        factors: &[(u64, &str)],
    ) -> Result<u64, BoundError> {
        let product = factors.iter().fold(1_u128, |so_far, (n, _)| {
            so_far.saturating_mul(u128::from(*n))
        });
        match u64::try_from(product) {
            Ok(product) if product <= self.greatest => Ok(product),
            _ => Err(BoundError::Product {
                place: place(),
                factors: in_words(factors),
                value: product,
                what,
                greatest: self.greatest,
                remedy: self.remedy,
            }),
        }
    }
}

impl Range {
    /// From `least` to `greatest`; `unit` begins with a blank.
    #[must_use]
    pub const fn new(least: f64, greatest: f64, unit: &'static str) -> Self {
        Self {
            least,
            greatest,
            unit,
        }
    }

    /// The greatest value.
    #[must_use]
    pub const fn greatest(self) -> f64 {
        self.greatest
    }

    /// The least value.
    #[must_use]
    pub const fn least(self) -> f64 {
        self.least
    }

    /// The unit of both, with a blank before it.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        self.unit
    }

    /// Whether a value is inside.
    #[must_use]
    pub const fn holds(self, value: f64) -> bool {
        self.least <= value && value <= self.greatest
    }

    /// Refuses a value outside, and one that is not a number.
    ///
    /// # Errors
    /// With place, value and range.
    pub fn check(self, place: impl FnOnce() -> String, value: f64) -> Result<(), BoundError> {
        if (self.least..=self.greatest).contains(&value) {
            return Ok(());
        }
        Err(BoundError::Number {
            place: place(),
            value,
            least: self.least,
            greatest: self.greatest,
            unit: Cow::Borrowed(self.unit),
        })
    }
}

fn in_words(factors: &[(u64, &str)]) -> String {
    let mut words = String::new();
    for (place, (n, word)) in factors.iter().enumerate() {
        let times = if place == 0 { "" } else { " x " };
        let _ = write!(words, "{times}{n} {word}"); // writing to a String cannot fail
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    fn here() -> String {
        "steps[3].runs".to_owned()
    }

    #[test]
    fn a_count_is_refused_above_its_bound_with_place_value_and_bound() {
        let bound = Bound::at_most(10_000);
        assert_eq!(bound.check(here, 10_000_u32), Ok(()));
        let said = bound
            .check(here, 1_000_000_000_u32)
            .unwrap_err()
            .to_string();
        assert_eq!(said, "steps[3].runs = 1000000000: at most 10000");
        let with = bound.with_remedy("; split the plan");
        let said = with.check(here, u64::MAX).unwrap_err().to_string();
        assert_eq!(
            said,
            "steps[3].runs = 18446744073709551615: at most 10000; split the plan"
        );
        let said = bound.check_amount(here, "entries", 10_001_usize);
        assert_eq!(
            said.unwrap_err().to_string(),
            "steps[3].runs: 10001 entries: at most 10000"
        );
    }

    #[test]
    fn eq1_a_product_that_overflows_is_above_every_bound() {
        let bound = Bound::at_most(u64::MAX);
        let huge = [(u64::MAX, "runs"), (u64::MAX, "targets"), (2, "ways")];
        for n in 2..=huge.len() {
            assert!(bound.check_product(here, "stops", &huge[..n]).is_err());
        }
        let small = [(3, "runs"), (4, "targets"), (2, "ways")];
        assert_eq!(bound.check_product(here, "stops", &small), Ok(24));
        let said = Bound::at_most(23).check_product(here, "stops", &small);
        assert_eq!(
            said.unwrap_err().to_string(),
            "steps[3].runs: 3 runs x 4 targets x 2 ways = 24 stops: at most 23"
        );
    }

    #[test]
    fn a_number_outside_its_range_or_no_number_is_refused() {
        let range = Range::new(0.1, 3600.0, " s");
        let place = || "steps[0].dwell_s".to_owned();
        for good in [0.1, 1.0, 3600.0] {
            assert_eq!(range.check(place, good), Ok(()));
        }
        for bad in [0.0, -1.0, 3600.1, f64::NAN, f64::INFINITY, f64::MAX] {
            assert!(range.check(place, bad).is_err(), "{bad}");
        }
        assert_eq!(
            range.check(place, 4000.0).unwrap_err().to_string(),
            "steps[0].dwell_s = 4000 s: must be from 0.1 to 3600 s"
        );
    }
}
