//! Readings of thermometers that are no temperatures: a sensor that drops out reads 0, or the end of its range, for a moment.
//!
//! A reading is an outlier where three of the four beside it are more than [`FAR_K`] from it and agree among themselves: no body
//! of a machine changes by so much from one reading to the next and back. A step that lasts is no outlier, and fewer than
//! four readings have no outlier.

use std::collections::VecDeque;

use metrology::number::number;

/// Farther than this a reading is far from one beside it, and those beside it disagree, K.
const FAR_K: f64 = 10.0;
/// Readings beside one another that are compared.
const WINDOW: usize = 5;
/// So many of those beside it must be far from an outlier.
const LEAST_FAR: usize = 3;

/// A reading far beside those next to it, and one of these, °C.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Outlier {
    read_degc: f64,
    beside_degc: f64,
}

impl Outlier {
    /// What is wrong with it.
    pub(crate) fn in_words(self) -> String {
        format!(
            "temperature = {} °C: at most {FAR_K} K from the readings beside it, which are {} °C; check the sensor and its cable",
            number(self.read_degc),
            number(self.beside_degc)
        )
    }
}

/// The readings of one thermometer, in their order; each has a key.
#[derive(Debug)]
pub(crate) struct Course<K> {
    last: VecDeque<(K, f64)>,
    /// How many of them are judged.
    judged: usize,
}

impl<K> Default for Course<K> {
    fn default() -> Self {
        Self {
            last: VecDeque::new(),
            judged: 0,
        }
    }
}

impl<K: Copy> Course<K> {
    /// Takes the next reading; returns the outliers that are known by it.
    pub(crate) fn take(&mut self, key: K, degc: f64) -> Vec<(K, Outlier)> {
        if self.last.len() == WINDOW {
            self.last.pop_front();
            self.judged = self.judged.saturating_sub(1);
        }
        self.last.push_back((key, degc));
        if self.last.len() < WINDOW {
            return Vec::new();
        }
        self.judge(WINDOW / 2 + 1)
    }

    /// No reading follows: returns the outliers among the last ones.
    pub(crate) fn end(mut self) -> Vec<(K, Outlier)> {
        self.judge(self.last.len())
    }

    fn judge(&mut self, until: usize) -> Vec<(K, Outlier)> {
        let places = self.judged..until;
        self.judged = self.judged.max(until);
        places.filter_map(|place| self.outlier(place)).collect()
    }

    fn outlier(&self, place: usize) -> Option<(K, Outlier)> {
        let (key, read_degc) = *self.last.get(place)?;
        let all = self.last.iter().map(|(_, degc)| *degc).enumerate();
        let others = all.filter(|(other, _)| *other != place);
        let far: Vec<f64> = others
            .map(|(_, degc)| degc)
            .filter(|degc| (degc - read_degc).abs() > FAR_K)
            .collect();
        let least = far.iter().copied().fold(f64::INFINITY, f64::min);
        let greatest = far.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let is_outlier = far.len() >= LEAST_FAR && greatest - least <= FAR_K;
        let beside_degc = *far.first()?;
        is_outlier.then_some((
            key,
            Outlier {
                read_degc,
                beside_degc,
            },
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(readings: &[f64]) -> Vec<usize> {
        let mut course = Course::default();
        let mut found = Vec::new();
        for (place, degc) in readings.iter().enumerate() {
            found.extend(course.take(place, *degc));
        }
        found.extend(course.end());
        found.into_iter().map(|(place, _)| place).collect()
    }

    #[test]
    fn a_sensor_that_drops_out_is_found_wherever_it_does() {
        for place in 0..9 {
            for wrong in [0.0, 500.0, -40.0] {
                let mut readings = [22.0, 22.1, 22.0, 21.9, 22.0, 22.2, 22.1, 22.0, 22.1];
                readings[place] = wrong;
                assert_eq!(places(&readings), [place], "{wrong}");
            }
        }
        assert_eq!(places(&[22.0, 22.0, 0.0, 0.0, 22.0, 22.0, 22.0]), [2, 3]);
        assert_eq!(places(&[22.0, 0.0, 22.0, 22.0]), [1]);
    }

    #[test]
    fn what_lasts_or_has_nothing_to_be_compared_with_is_none() {
        for readings in [
            &[20.0, 20.0, 20.0, 35.0, 35.0, 35.0][..],
            &[20.0, 28.0, 20.0, 20.0, 20.0],
            &[20.0, 31.0, 42.0, 53.0, 64.0, 75.0],
            &[22.0, 0.0, 22.0],
            &[295.15; 9],
            &[],
        ] {
            assert_eq!(places(readings), [0; 0], "{readings:?}");
        }
    }
}
