//! The artefact of a drift test: what its growth does to a displacement, and what of it is left in U.
//!
//! The equations are those of [`super`]: (5), (6) and (13) where a range of its temperature is known alone, (9) to (12) where
//! thermometers read it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Iso230Error;
use crate::budget::{combined, coverage_factor, rectangular};
use crate::expanded::COVERAGE_FACTOR;
use crate::extent::{check_finite, check_length, check_not_negative};

/// Body between its seat and the sensors that read it, such as a test mandrel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Artefact {
    /// Length between its seat and the sensors, l, mm.
    pub length_mm: f64,
    /// Coefficient of expansion, α, 1/K.
    pub expansion_per_k: f64,
    /// Half of the interval in which the coefficient lies, `a_α`, 1/K.
    pub expansion_half_width_per_k: f64,
    /// Its temperature during the test.
    pub temperature: ArtefactTemperature,
}

/// What is known of an artefact's temperature.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ArtefactTemperature {
    /// Greatest minus least over the test alone.
    Range {
        /// Δθ of (5), K.
        range_k: f64,
    },
    /// Its readings.
    Read {
        /// θ at the test's times, °C.
        degc: Vec<f64>,
        /// Half of the interval in which the error of a reading lies, `a_θ`, K; an error that stays the same cancels.
        half_width_k: f64,
        /// Sign of the growth in the displacement.
        growth_reads: GrowthReads,
    },
}

/// What a displacement does while the artefact grows: the sign of the sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GrowthReads {
    /// It becomes less: the artefact hangs from the spindle, and the displacement counts along Z+.
    Less,
    /// It becomes more: the sensor counts what approaches it.
    More,
}

impl GrowthReads {
    const fn sign(self) -> f64 {
        match self {
            Self::Less => -1.0,
            Self::More => 1.0,
        }
    }
}

impl Artefact {
    /// The artefact of a test that begins at a later reading.
    #[must_use]
    pub fn since_reading(mut self, first: usize) -> Self {
        if let ArtefactTemperature::Read { degc, .. } = &mut self.temperature {
            degc.drain(..first.min(degc.len()));
        }
        self
    }

    /// Growth since the first reading as a displacement has it, ± α l (θ_i − θ₀), mm; none where it is not read.
    #[must_use]
    pub fn growth_mm(&self) -> Option<Vec<f64>> {
        let ArtefactTemperature::Read {
            degc, growth_reads, ..
        } = &self.temperature
        else {
            return None;
        };
        let first_degc = degc.first()?;
        let per_k_mm = growth_reads.sign() * self.expansion_per_k * self.length_mm;
        Some(degc.iter().map(|it| per_k_mm * (it - first_degc)).collect())
    }

    /// (9): displacements without the growth, mm; as they are where it is not read.
    pub(super) fn without_growth_mm(&self, read_mm: &[f64]) -> Vec<f64> {
        let Some(growth_mm) = self.growth_mm() else {
            return read_mm.to_vec();
        };
        let pairs = read_mm.iter().zip(growth_mm);
        pairs.map(|(read, growth)| read - growth).collect()
    }

    /// θ at the test's times, °C; none where it is not read.
    pub(super) fn degc(&self) -> Option<&[f64]> {
        match &self.temperature {
            ArtefactTemperature::Read { degc, .. } => Some(degc),
            ArtefactTemperature::Range { .. } => None,
        }
    }

    /// What is left in a difference of two readings, mm: of (5), or of (10) for a temperature that was read `change_k` apart.
    pub(super) fn left_mm(&self, change_k: f64) -> Left {
        let of_coefficient = |k: f64| self.length_mm * self.expansion_half_width_per_k * k.abs();
        let of_temperature = |k: f64| self.length_mm * self.expansion_per_k * k;
        match self.temperature {
            ArtefactTemperature::Range { range_k } => Left {
                half_widths: vec![of_temperature(range_k) + of_coefficient(range_k)],
                is_bound: true,
            },
            ArtefactTemperature::Read { half_width_k, .. } => {
                let of_reading = of_temperature(half_width_k);
                Left {
                    half_widths: vec![of_reading, of_reading, of_coefficient(change_k)],
                    is_bound: false,
                }
            }
        }
    }

    /// What is left in the rate over a window τ of a test of length T, mm/s: of (6), or of (11) for a temperature that was read
    /// with this slope.
    pub(super) fn left_of_rate_mm_s(
        &self,
        slope_k_s: f64,
        (window_s, duration_s): (f64, f64),
    ) -> Left {
        let mut left = self.left_mm(slope_k_s * window_s);
        let within_s = if left.is_bound { duration_s } else { window_s };
        left.half_widths.iter_mut().for_each(|it| *it /= within_s);
        left
    }

    pub(super) fn check(&self, n_times: usize) -> Result<(), Iso230Error> {
        check_not_negative("artefact.length_mm", self.length_mm)?;
        check_not_negative("artefact.expansion_per_k", self.expansion_per_k)?;
        check_not_negative(
            "artefact.expansion_half_width_per_k",
            self.expansion_half_width_per_k,
        )?;
        match &self.temperature {
            ArtefactTemperature::Range { range_k } => {
                check_not_negative("artefact.temperature.range_k", *range_k)
            }
            ArtefactTemperature::Read {
                degc, half_width_k, ..
            } => {
                check_not_negative("artefact.temperature.half_width_k", *half_width_k)?;
                check_length("artefact.temperature.degc", 0, degc.len(), n_times)?;
                check_finite("artefact.temperature.degc", 0, degc)
            }
        }
    }
}

/// What the growth of an artefact leaves in a figure, in the figure's unit.
#[derive(Default)]
pub(super) struct Left {
    half_widths: Vec<f64>,
    /// Whether the growth may well be at its limit: no distribution is claimed.
    is_bound: bool,
}

impl Left {
    /// Standard uncertainty.
    pub fn standard(&self) -> f64 {
        let each: Vec<f64> = self.half_widths.iter().copied().map(rectangular).collect();
        combined(&each)
    }

    /// k of a figure with this normal part: (12), or (13) of a bound.
    pub fn coverage_factor(&self, normal: f64) -> f64 {
        if !self.is_bound {
            let each: Vec<f64> = self.half_widths.iter().copied().map(rectangular).collect();
            return coverage_factor(normal, &each);
        }
        let u = normal.hypot(self.standard());
        if !u.is_normal() {
            return COVERAGE_FACTOR;
        }
        (COVERAGE_FACTOR * normal + self.half_widths.iter().sum::<f64>()) / u
    }
}
