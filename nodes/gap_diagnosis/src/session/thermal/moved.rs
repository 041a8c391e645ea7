//! Whether a thermometer moved by more than its own noise.
//!
//! ```text
//!   noise = 1.4826 median |T_k+1 - 2 T_k + T_k-1| / sqrt 6,  at least the finest step of the readings      (1)
//!   moved = max of the means of a twelfth of the readings - min                                             (2)
//! ```
//!
//! Second differences hold no slope. A reading that is held until the next one is one reading.

use crate::search::rows::count;

/// How many times its noise (1) a thermometer has moved (2) that explains anything.
pub(super) const LEAST_MOVED: f64 = 3.0;
/// Parts of a recording whose means are compared.
const COMPARED_PARTS: usize = 12;
/// Fewer readings than this are not judged.
const FEWEST_JUDGED: usize = 24;
/// Median of the magnitude of a normal variable, inverse.
const PER_MEDIAN: f64 = 1.4826;

/// Whether a series of temperatures, °C, shows more than noise; of very few readings this is taken for granted.
pub(crate) fn has_moved(degc: &[f64]) -> bool {
    let mut read: Vec<f64> = degc.iter().copied().filter(|t| t.is_finite()).collect();
    read.dedup();
    if read.len() < FEWEST_JUDGED {
        return read.len() > 1;
    }
    moved_k(&read) >= LEAST_MOVED * noise_k(&read)
}

/// (1).
fn noise_k(read: &[f64]) -> f64 {
    let second = read.windows(3).map(|three| match three {
        [a, b, c] => (a - 2.0 * b + c).abs(),
        _ => 0.0,
    });
    let mut second: Vec<f64> = second.collect();
    let middle = second.len() / 2;
    let (_, median, _) = second.select_nth_unstable_by(middle, f64::total_cmp);
    let steps = read.windows(2).map(|two| match two {
        [a, b] => (b - a).abs(),
        _ => f64::INFINITY,
    });
    let finest = steps.fold(f64::INFINITY, f64::min);
    (PER_MEDIAN * *median / 6.0_f64.sqrt()).max(finest)
}

/// (2).
fn moved_k(read: &[f64]) -> f64 {
    let means = read
        .chunks(read.len().div_ceil(COMPARED_PARTS))
        .map(|part| part.iter().sum::<f64>() / count(part.len()));
    let (least, most) = means.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), mean| {
        (low.min(mean), high.max(mean))
    });
    most - least
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise of 0.02 K by a chaotic map, rounded to 0.01 K as a logger writes it, on a slope.
    fn logged(slope_k: f64) -> Vec<f64> {
        let mut state = 0.37_f64;
        let reading = |k: u32| {
            state = (3.99 * state * (1.0 - state)).clamp(0.001, 0.999);
            let degc = 20.0 + slope_k * f64::from(k) / 180.0 + 0.06 * (state - 0.5);
            (degc * 100.0).round() / 100.0
        };
        (0..180).map(reading).collect()
    }

    #[test]
    fn a_room_that_stays_within_its_noise_has_not_moved() {
        assert!(!has_moved(&logged(0.0)));
        assert!(!has_moved(&logged(0.02)));
        assert!(has_moved(&logged(0.5)));
    }

    #[test]
    fn a_step_of_the_resolution_is_no_movement() {
        let flicker: Vec<f64> = (0..400)
            .map(|k| 21.0 + 0.1 * f64::from(k / 7 % 2))
            .collect();
        assert!(!has_moved(&flicker));
        assert!(!has_moved(&[21.0; 50]));
        let rise: Vec<f64> = (0..400).map(|k| 21.0 + 0.1 * f64::from(k / 20)).collect();
        assert!(has_moved(&rise));
    }
}
