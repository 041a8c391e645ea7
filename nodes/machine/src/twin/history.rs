//! The slow past of a session: what heats a machine, on a coarse grid of time.

use std::collections::BTreeMap;

use metrology::PerAxis;

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
    /// Temperature of each sensor by the name in the machine file, degC; NaN before the first reading.
    pub temperature_degc: BTreeMap<String, Vec<f64>>,
}

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

    /// Value of a series of this history at an instant of the session, linear between the middles of the
    /// entries and constant beyond the first and last; NaN for an empty series.
    #[must_use]
    pub fn at(&self, series: &[f64], time_s: f64) -> f64 {
        let (Some(first), Some(last)) = (series.first(), series.last()) else {
            return f64::NAN;
        };
        let place = time_s / self.step_s - 0.5;
        if place <= 0.0 || self.step_s <= 0.0 {
            return *first;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive and checked against the length"
        )]
        let k = place as usize;
        match (series.get(k), series.get(k + 1)) {
            (Some(a), Some(b)) => a + (b - a) * place.fract(),
            _ => *last,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
