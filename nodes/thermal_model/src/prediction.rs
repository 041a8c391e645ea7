//! Between updates: which of three predictions is used, and how each has done.
//!
//! *Hold* keeps the last drift: the zero-order hold of the published method. With a drift rate r its
//! residual grows to r·ct; with a first-order drift it is, of what remains,
//!
//! ```text
//!   1 − exp(−ct/τ)                                                                (1)
//! ```
//!
//! 22 % for ct = 15 min and τ = 60 min, 39 % for τ = 30 min. *Relaxation* and *temperature* are
//! scored at each update, before it enters their fits, by the root mean square over all faces of
//! measured minus predicted. Relaxation is used where its time constant is identifiable and its
//! record is not worse than hold's; temperature where its left-out residual has proven it and its
//! record is the best.
//!
//! # Agreement
//! `val_hold_residual_is_22_and_39_percent` in `tests/shop_floor/saw_tooth.rs`.

use std::collections::VecDeque;

use crate::reference::FaceDrift;

/// Scores that make a record.
const RECORD_LENGTH: usize = 4;

/// A way to know the drift between updates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Predictor {
    /// The last drift.
    #[default]
    Hold,
    /// Exponential with an identified time constant.
    Relaxation,
    /// Regression on temperatures.
    Temperature,
}

/// Residuals of one update, root mean square over its faces, µm; `None`: no prediction was there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Score {
    /// Of holding.
    pub hold_um: f64,
    /// Of the relaxation.
    pub relaxation_um: Option<f64>,
    /// Of the temperatures.
    pub temperature_um: Option<f64>,
}

/// Last scores.
#[derive(Clone, Debug, Default)]
pub struct Record {
    scores: VecDeque<Score>,
}

impl Record {
    /// Adds an update's score.
    pub fn add(&mut self, score: Score) {
        self.scores.push_back(score);
        if self.scores.len() > RECORD_LENGTH {
            self.scores.pop_front();
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.scores.clear();
    }

    /// The predictor to use, given which ones could be.
    #[must_use]
    pub fn choose(&self, relaxation_identified: bool, temperature_proven: bool) -> Predictor {
        let relaxation = self.against_hold(|s| s.relaxation_um);
        let relaxation_usable = relaxation_identified && relaxation.is_none_or(|r| r <= 1.0);
        let temperature = self.against_hold(|s| s.temperature_um);
        let best_other = match relaxation {
            Some(r) if relaxation_usable => r.min(1.0),
            _ => 1.0,
        };
        if temperature_proven && temperature.is_some_and(|t| t < best_other) {
            Predictor::Temperature
        } else if relaxation_usable {
            Predictor::Relaxation
        } else {
            Predictor::Hold
        }
    }

    /// Ratio of root mean squares, predictor over hold, where the predictor had a score.
    fn against_hold(&self, of: impl Fn(&Score) -> Option<f64>) -> Option<f64> {
        let (mut own, mut hold, mut n) = (0.0, 0.0, 0);
        for score in &self.scores {
            if let Some(residual_um) = of(score) {
                own += residual_um * residual_um;
                hold += score.hold_um * score.hold_um;
                n += 1;
            }
        }
        (n > 0).then(|| {
            if hold > 0.0 {
                (own / hold).sqrt()
            } else {
                f64::INFINITY
            }
        })
    }
}

/// Root mean square of measured minus predicted over the common faces, µm; `None` without one.
#[must_use]
pub fn residual_um(measured: &[FaceDrift], predicted: &[FaceDrift]) -> Option<f64> {
    let (mut sum, mut n) = (0.0, 0_u32);
    for face in measured {
        if let Some(guess) = predicted.iter().find(|p| p.same_face(face)) {
            sum += ((face.drift_mm - guess.drift_mm) * 1e3).powi(2);
            n += 1;
        }
    }
    (n > 0).then(|| (sum / f64::from(n)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score(hold_um: f64, relaxation_um: Option<f64>, temperature_um: Option<f64>) -> Score {
        Score {
            hold_um,
            relaxation_um,
            temperature_um,
        }
    }

    #[test]
    fn without_a_record_an_identified_time_constant_is_used_but_temperatures_are_not() {
        let record = Record::default();
        assert_eq!(record.choose(true, true), Predictor::Relaxation);
        assert_eq!(record.choose(false, true), Predictor::Hold);
    }

    #[test]
    fn the_record_decides() {
        let mut record = Record::default();
        record.add(score(5.0, Some(2.0), Some(1.0)));
        assert_eq!(record.choose(true, true), Predictor::Temperature);
        assert_eq!(record.choose(true, false), Predictor::Relaxation);
        record.add(score(1.0, Some(9.0), Some(8.0)));
        assert_eq!(record.choose(true, true), Predictor::Hold);
        for _ in 0..4 {
            record.add(score(3.0, Some(1.0), Some(2.0)));
        }
        assert_eq!(record.choose(true, true), Predictor::Relaxation);
    }
}
