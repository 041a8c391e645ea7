//! Thermometers that stopped to measure: their readings leap to one value and stay at it.
//!
//! A broken wire or a logger without its sensor shows 0, the end of the range, or the last value it had in memory. No body of a
//! machine leaps by 5 K between two readings and then keeps its temperature to the last digit.

use metrology::number::number;

use super::test_conditions::Thermometers;
use crate::section::Section;

/// Equal readings one after another, at least.
const LEAST_EQUAL_READINGS: u32 = 5;
/// Leap to them, K, at least.
const LEAST_LEAP_K: f64 = 5.0;
/// What warnings of such thermometers have in common.
const DEAD_THERMOMETER: &str = "Dead thermometer";

/// A thermometer that stopped to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dead {
    /// The reading before, °C; none: it never read anything else.
    pub before_degc: Option<f64>,
    /// What it shows since then, °C.
    pub degc: f64,
    /// How often.
    pub n: u32,
}

impl Dead {
    /// A sentence without its end.
    #[must_use]
    pub fn in_words(&self, name: &str) -> String {
        let since = self.before_degc.map_or_else(
            || "all the time".to_owned(),
            |degc| format!("after {} °C", number(degc)),
        );
        format!(
            "thermometer {name} reads {} °C {} times one after another, {since}: a broken wire or a missing sensor shows so; mend it, or leave its readings out",
            number(self.degc),
            self.n
        )
    }
}

/// Looks at the readings of one thermometer in their order.
#[derive(Clone, Debug, Default)]
pub(super) struct Watch {
    /// The latest reading, °C, and how many before it are the same one after another.
    last: Option<(f64, u32)>,
    /// The reading before these, °C.
    before_degc: Option<f64>,
    dead: Option<Dead>,
}

impl Watch {
    /// A later reading.
    pub fn add(&mut self, degc: f64) {
        let n = match self.last {
            Some((last, n)) if last.total_cmp(&degc).is_eq() => n.saturating_add(1),
            other => {
                self.before_degc = other.map(|(last, _)| last);
                1
            }
        };
        self.last = Some((degc, n));
        let is_leap = self
            .before_degc
            .map_or(degc.abs() < f64::MIN_POSITIVE, |before| {
                (before - degc).abs() >= LEAST_LEAP_K
            });
        if n >= LEAST_EQUAL_READINGS && is_leap {
            self.dead = Some(Dead {
                before_degc: self.before_degc,
                degc,
                n,
            });
        }
    }

    /// What it shows since it stopped to measure, the last such time; none: it measures.
    pub fn dead(&self) -> Option<Dead> {
        self.dead
    }
}

/// Warns of each thermometer that stopped to measure.
pub fn name_dead(section: &mut Section, thermometers: &Thermometers) {
    for (name, readings) in thermometers {
        if let Some(dead) = readings.dead {
            section.warn(DEAD_THERMOMETER, format!("The {}.", dead.in_words(name)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watched(degc: &[f64]) -> Option<Dead> {
        let mut watch = Watch::default();
        degc.iter().for_each(|degc| watch.add(*degc));
        watch.dead()
    }

    #[test]
    fn a_thermometer_that_falls_to_one_value_and_stays_is_named() {
        let fallen = watched(&[22.1, 22.2, 22.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
        assert_eq!((fallen.before_degc, fallen.n), (Some(22.1), 6));
        let said = fallen.in_words("bed");
        let begin = "thermometer bed reads 0 °C 6 times one after another, after 22.1 °C: ";
        assert!(said.starts_with(begin), "{said}");
        let never = watched(&[0.0; 5]).unwrap();
        assert!(never.in_words("bed").contains("all the time"));
        assert!(watched(&[22.0, 85.0, 85.0, 85.0, 85.0, 85.0]).is_some());
    }

    #[test]
    fn a_thermometer_that_measures_is_not_named() {
        // Steady, in steps of 0.5 K, a start of a spindle, and four readings of a contact that came back.
        for degc in [
            &[22.0; 9][..],
            &[22.0, 22.5, 22.5, 22.5, 22.5, 22.5, 22.5],
            &[22.0, 28.0, 31.0, 33.0, 34.0, 34.5, 34.8],
            &[22.0, 0.0, 0.0, 0.0, 0.0, 22.1, 22.2],
        ] {
            assert_eq!(watched(degc), None, "{degc:?}");
        }
    }
}
