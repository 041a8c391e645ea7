//! The slow past of a session: what heats a machine, on a coarse grid of time.

use std::collections::BTreeMap;
use std::ops::Range;

use metrology::PerAxis;

use super::rubbing::Rubbing;

/// Mean motion and temperatures of the whole session, equally spaced in time from 0.
///
/// Entry k covers the time from k to k + 1 times [`History::step_s`]. All vectors have one length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// Spacing, s.
    pub step_s: f64,
    /// Mean commanded position (mm, rad).
    pub position: PerAxis<Vec<f64>>,
    /// Mean of the magnitude of the velocity (mm/s, rad/s).
    pub speed: PerAxis<Vec<f64>>,
    /// Mean of the velocity squared.
    pub speed_squared: PerAxis<Vec<f64>>,
    /// Where along its travel each axis has moved; without entries where that is not known.
    pub rubbing: PerAxis<Rubbing>,
    /// Temperature of each sensor by the name in the machine file, degC; NaN before the first reading.
    pub temperature_degc: BTreeMap<String, Vec<f64>>,
    /// Entries in which nothing at all was recorded, longer than the usual spacing of what was: nights, meals.
    pub pauses: Vec<Range<usize>>,
    /// By sensor: entries in which it was not read for longer than usual; its temperature is taken to go evenly there.
    pub unread: BTreeMap<String, Vec<Range<usize>>>,
}

/// After a pause of more lags than this what follows a temperature is settled at it.
pub const SETTLED_LAGS: f64 = 5.0;

impl History {
    /// Number of entries.
    #[must_use]
    pub fn len(&self) -> usize {
        self.speed.0.iter().map(Vec::len).max().unwrap_or(0)
    }

    /// Whether nothing is known of the past.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How far a thermometer is above its first reading, K; none where it was never read. Before the first
    /// reading zero, where readings are missing the last one.
    #[must_use]
    pub fn warming_k(&self, sensor: &str) -> Option<Vec<f64>> {
        let series = self.temperature_degc.get(sensor)?;
        let first = series.iter().copied().find(|t| t.is_finite())?;
        let mut last = 0.0;
        let rise = |t: &f64| {
            if t.is_finite() {
                last = t - first;
            }
            last
        };
        Some(series.iter().map(rise).collect())
    }

    /// Reading of a thermometer less a reference, K; none where it was never read. Missing readings as in
    /// [`History::warming_k`].
    #[must_use]
    pub fn above_k(&self, sensor: &str, reference_degc: f64) -> Option<Vec<f64>> {
        let series = self.temperature_degc.get(sensor)?;
        let first = series.iter().find(|t| t.is_finite())? - reference_degc;
        let warming = self.warming_k(sensor)?;
        Some(warming.iter().map(|k| k + first).collect())
    }

    /// What follows a series of this history with the time constant `lag_s`, from zero, at the middles of the
    /// entries; exact where the series is constant within each entry.
    ///
    /// ```text
    ///   y' = (u - y) / tau,   y(0) = 0
    /// ```
    #[must_use]
    pub fn lagged(&self, series: &[f64], lag_s: f64) -> Vec<f64> {
        let half = (-0.5 * self.step_s / lag_s).exp();
        let mut state = 0.0;
        let follow = |input: &f64| {
            let middle = input + (state - input) * half;
            state = input + (middle - input) * half;
            middle
        };
        series.iter().map(follow).collect()
    }

    /// What follows a temperature, as [`History::lagged`], but begins settled at the temperature after a pause of more
    /// than [`SETTLED_LAGS`] time constants.
    ///
    /// What is not read over a pause P is taken to go evenly. A machine that is left to itself tends to its surroundings,
    /// fast at first, and its slope at the end of the pause lies between that of the even way and nought. With a change D
    /// over the pause what follows it lies, when the next run begins, between
    ///
    /// ```text
    ///   T - D tau/P   and   T
    /// ```
    ///
    /// so that T is off by at most a fifth of D where P is five time constants, while after a shorter pause the state
    /// from before it is not forgotten and only the even way has it. Heat of friction is no temperature: it stops with the motion.
    #[must_use]
    pub fn lagged_temperature(&self, series: &[f64], lag_s: f64) -> Vec<f64> {
        let is_long = |pause: &&Range<usize>| {
            let entries = u32::try_from(pause.len()).unwrap_or(u32::MAX);
            f64::from(entries) * self.step_s > SETTLED_LAGS * lag_s
        };
        let mut starts = self.pauses.iter().filter(is_long).map(|pause| pause.end);
        let mut start = starts.next();
        let half = (-0.5 * self.step_s / lag_s).exp();
        let mut state = 0.0;
        let follow = |(k, input): (usize, &f64)| {
            if start == Some(k) {
                state = *input;
                start = starts.next();
            }
            let middle = input + (state - input) * half;
            state = input + (middle - input) * half;
            middle
        };
        series.iter().enumerate().map(follow).collect()
    }

    /// Value of a series of this history at an instant of the session, linear between the middles of the
    /// entries and constant beyond the first and last; NaN for an empty series.
    #[must_use]
    pub fn at(&self, series: &[f64], time_s: f64) -> f64 {
        self.between(series, time_s, |value| *value)
    }

    /// What `of` makes of the entries of any series at an instant, as [`History::at`].
    #[must_use]
    pub fn between<T>(&self, series: &[T], time_s: f64, of: impl Fn(&T) -> f64) -> f64 {
        let (Some(first), Some(last)) = (series.first(), series.last()) else {
            return f64::NAN;
        };
        let place = time_s / self.step_s - 0.5;
        if place <= 0.0 || self.step_s <= 0.0 {
            return of(first);
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive and checked against the length"
        )]
        let k = place as usize;
        match (series.get(k), series.get(k + 1)) {
            (Some(a), Some(b)) => {
                let (a, b) = (of(a), of(b));
                a + (b - a) * place.fract()
            }
            _ => of(last),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lags_rises_as_the_exponential_and_ends_at_its_input() {
        let history = History {
            step_s: 7.0,
            ..History::default()
        };
        let lagged = history.lagged(&[2.0; 400], 100.0);
        for (k, value) in lagged.iter().enumerate() {
            let at_s = 7.0 * (f64::from(u32::try_from(k).expect("few")) + 0.5);
            assert!((value - 2.0 * (1.0 - (-at_s / 100.0).exp())).abs() < 1e-12);
        }
    }

    /// 8 K up, a pause of n entries, and 8 K up again from where it began.
    #[test]
    fn after_a_long_pause_what_follows_begins_settled_and_after_a_short_one_remembers() {
        for (n, lag_s, is_settled) in [(600, 1000.0, true), (600, 1300.0, false)] {
            let history = History {
                step_s: 10.0,
                pauses: std::iter::once(100..100 + n).collect(),
                ..History::default()
            };
            let mut series = vec![8.0; 100];
            series.extend((0..n).map(|k| 8.0 - 8.0 * k as f64 / n as f64));
            series.extend([0.0; 10]);
            let lagged = history.lagged_temperature(&series, lag_s);
            let plain = history.lagged(&series, lag_s);
            assert_eq!(lagged[..100 + n], plain[..100 + n]);
            if is_settled {
                assert_eq!(lagged[100 + n..], [0.0; 10]);
            } else {
                assert_eq!(lagged, plain);
                assert!(lagged[100 + n] > 1.0);
            }
        }
    }

    #[test]
    fn warming_counts_from_the_first_reading_and_bridges_gaps() {
        let mut history = History::default();
        let nan = f64::NAN;
        let _ = history
            .temperature_degc
            .insert("bed".to_owned(), vec![nan, 21.0, nan, 23.5]);
        assert_eq!(history.warming_k("bed"), Some(vec![0.0, 0.0, 0.0, 2.5]));
        assert_eq!(history.warming_k("column"), None);
    }

    #[test]
    fn a_series_is_linear_between_middles_and_constant_beyond() {
        let history = History {
            step_s: 10.0,
            ..History::default()
        };
        let series = [1.0, 3.0];
        for (at_s, wanted) in [
            (-5.0, 1.0),
            (5.0, 1.0),
            (10.0, 2.0),
            (15.0, 3.0),
            (99.0, 3.0),
        ] {
            assert!((history.at(&series, at_s) - wanted).abs() < 1e-12, "{at_s}");
        }
    }
}
