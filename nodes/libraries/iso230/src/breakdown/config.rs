//! What a breakdown looks for, and when it believes what it finds.

use serde::{Deserialize, Serialize};

use super::error::BreakdownError;
use metrology::Axis;

/// Period of a cyclic error on one axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Pitch {
    /// Known, for example the lead of the screw.
    Given {
        /// Period, mm.
        pitch_mm: f64,
    },
    /// One of several, or none.
    Searched {
        /// Periods, mm.
        candidates_mm: Vec<f64>,
    },
}

impl Pitch {
    /// The periods, mm.
    pub(super) fn candidates_mm(&self) -> &[f64] {
        match self {
            Self::Given { pitch_mm } => std::slice::from_ref(pitch_mm),
            Self::Searched { candidates_mm } => candidates_mm,
        }
    }
}

/// Cyclic error to look for on one axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxisPitch {
    /// The axis.
    pub axis: Axis,
    /// Its period.
    pub pitch: Pitch,
}

/// What a breakdown looks for, and when it believes what it finds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BreakdownConfig {
    /// Cyclic errors; an axis that is not named has none looked for.
    pub pitches: Vec<AxisPitch>,
    /// A spike, cyclic error or tone is believed when chance makes one with less than this probability.
    pub false_alarm: f64,
    /// Least sine of the angle between a regressor and those before for it to be told apart from them.
    pub least_sine: f64,
    /// Residuals beyond this many robust standard deviations weigh less (Huber).
    pub huber_limit: f64,
    /// Single samples beyond this many standard deviations are spikes of the reader and left out.
    pub outlier_limit: f64,
    /// Tones are looked for above this many lobes per turn; below, it is geometry.
    pub least_lobes: f64,
    /// Most tones to look for.
    pub most_tones: usize,
    /// Samples a turn that spikes, cyclic errors and slow tones are searched in; more are taken together.
    /// The fit itself has all.
    pub search_samples: usize,
}

impl Default for BreakdownConfig {
    fn default() -> Self {
        let common = vec![4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0, 20.0, 25.0, 32.0];
        let pitches = Axis::LINEAR.map(|axis| AxisPitch {
            axis,
            pitch: Pitch::Searched {
                candidates_mm: common.clone(),
            },
        });
        Self {
            pitches: pitches.to_vec(),
            false_alarm: 1e-3,
            least_sine: 0.02,
            huber_limit: 3.0,
            outlier_limit: 6.0,
            least_lobes: 12.0,
            most_tones: 3,
            search_samples: 1440,
        }
    }
}

impl BreakdownConfig {
    pub(super) fn check(&self) -> Result<(), BreakdownError> {
        let limits = [
            ("false_alarm", self.false_alarm, 0.0, 0.5),
            // Products of columns have half of the digits of an angle.
            ("least_sine", self.least_sine, 1e-6, 0.5),
            ("huber_limit", self.huber_limit, 1.0, 100.0),
            ("outlier_limit", self.outlier_limit, 3.0, 1000.0),
            ("least_lobes", self.least_lobes, 3.0, 1e6),
            (
                "search_samples",
                self.search_samples as f64,
                300.0,
                f64::INFINITY,
            ),
        ];
        for (key, value, above, below) in limits {
            within(key, value, above, below)?;
        }
        for (i, AxisPitch { axis, pitch }) in self.pitches.iter().enumerate() {
            if self
                .pitches
                .iter()
                .skip(i + 1)
                .any(|other| other.axis == *axis)
            {
                return Err(BreakdownError::PitchTwice { axis: *axis });
            }
            if pitch.candidates_mm().is_empty() {
                return Err(BreakdownError::NoCandidate { axis: *axis });
            }
            for value in pitch.candidates_mm() {
                within("pitch_mm", *value, 0.0, 1e4)?;
            }
        }
        Ok(())
    }

    /// Periods to try on an axis, mm.
    pub(super) fn candidates_mm(&self, axis: Axis) -> &[f64] {
        let of_axis = self.pitches.iter().find(|pitch| pitch.axis == axis);
        of_axis.map_or(&[], |found| found.pitch.candidates_mm())
    }

    /// The period of an axis where it is known, mm.
    pub(super) fn given_pitch_mm(&self, axis: Axis) -> Option<f64> {
        let of_axis = self.pitches.iter().find(|pitch| pitch.axis == axis)?;
        match of_axis.pitch {
            Pitch::Given { pitch_mm } => Some(pitch_mm),
            Pitch::Searched { .. } => None,
        }
    }
}

fn within(key: &'static str, value: f64, above: f64, below: f64) -> Result<(), BreakdownError> {
    if value > above && value < below {
        Ok(())
    } else {
        Err(BreakdownError::Config {
            key,
            value,
            above,
            below,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_usable_and_limits_are_named() {
        assert_eq!(BreakdownConfig::default().check(), Ok(()));
        let bad = BreakdownConfig {
            least_sine: f64::NAN,
            ..BreakdownConfig::default()
        };
        assert!(
            bad.check()
                .unwrap_err()
                .to_string()
                .starts_with("least_sine = NaN")
        );
        let twice = AxisPitch {
            axis: Axis::X,
            pitch: Pitch::Given { pitch_mm: 10.0 },
        };
        let bad = BreakdownConfig {
            pitches: vec![twice.clone(), twice],
            ..BreakdownConfig::default()
        };
        assert_eq!(
            bad.check(),
            Err(BreakdownError::PitchTwice { axis: Axis::X })
        );
    }
}
