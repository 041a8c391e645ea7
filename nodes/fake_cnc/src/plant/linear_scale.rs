//! Linear scales: what they read of a slide, with their own errors.
//!
//! ```text
//!   reading = x (1 - strain) + g(x) + b sin(2 pi x / p)                                   (1)
//!   g(x) = sum_{k=1..5} [a_k sin(k t) + b_k (cos(k t) - 1)],  t = 2 pi x / length          (2)
//! ```
//!
//! x is where the slide really is along its axis, `strain` the thermal growth of scale and mount. A
//! scale sits at the slide's carriage, about which the slide's angular errors turn, so that it sees
//! none of them: what they do at the tool (Abbe's offset) stays.

use std::f64::consts::TAU;

use metrology::{Axis, PerAxis};

use super::error::{PlantError, require_not_negative, require_positive};
use super::file::LinearScalesEntry;
use super::noise::{Effect, Stream};

const SCALE_HARMONICS: usize = 5;

/// Errors of every axis' scale.
#[derive(Clone, Debug)]
pub(super) struct LinearScales {
    angle_per_mm: f64,
    signal_angle_per_mm: f64,
    interpolation_mm: f64,
    waves: PerAxis<[[f64; 2]; SCALE_HARMONICS]>,
}

impl LinearScales {
    pub(super) fn new(entry: &LinearScalesEntry, seed: u64) -> Result<Self, PlantError> {
        let at = |key: &str| format!("linear_scales.{key}");
        require_not_negative(at("graduation_um"), entry.graduation_um)?;
        require_positive(at("graduation_length_mm"), entry.graduation_length_mm)?;
        require_positive(at("signal_period_um"), entry.signal_period_um)?;
        require_not_negative(at("interpolation_um"), entry.interpolation_um)?;
        let squares: f64 = (1..=SCALE_HARMONICS).map(|k| 2.0 / (k * k) as f64).sum();
        let waves = PerAxis::from_fn(|axis: Axis| {
            let mut stream = Stream::new(seed, Effect::Graduation, axis.index() as u64);
            std::array::from_fn(|index| {
                let share = entry.graduation_um / 1e3 / ((index + 1) as f64 * squares.sqrt());
                [share * stream.normal(), share * stream.normal()]
            })
        });
        Ok(Self {
            angle_per_mm: TAU / entry.graduation_length_mm,
            signal_angle_per_mm: TAU / (entry.signal_period_um / 1e3),
            interpolation_mm: entry.interpolation_um / 1e3,
            waves,
        })
    }

    /// (1), before quantisation, mm.
    pub(super) fn reading_mm(&self, axis: Axis, true_mm: f64, strain: f64) -> f64 {
        let angle = true_mm * self.angle_per_mm;
        let mut error_mm = self.interpolation_mm * (true_mm * self.signal_angle_per_mm).sin();
        let mut k = 1.0;
        for [sine, cosine] in self.waves[axis] {
            error_mm += sine * (k * angle).sin() + cosine * ((k * angle).cos() - 1.0);
            k += 1.0;
        }
        true_mm * (1.0 - strain) + error_mm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry() -> LinearScalesEntry {
        LinearScalesEntry {
            graduation_um: 0.4,
            graduation_length_mm: 500.0,
            signal_period_um: 20.0,
            interpolation_um: 0.05,
        }
    }

    #[test]
    fn eq1_a_perfect_scale_reads_its_place_less_its_growth() {
        let perfect = LinearScalesEntry {
            graduation_um: 0.0,
            interpolation_um: 0.0,
            ..entry()
        };
        let scales = LinearScales::new(&perfect, 1).unwrap();
        let read = scales.reading_mm(Axis::X, 200.0, 8e-6);
        assert!((read - 200.0 * (1.0 - 8e-6)).abs() < 1e-12, "{read}");
    }

    #[test]
    fn eq2_graduation_errors_are_smooth_differ_by_axis_and_have_their_size() {
        let mut squares = 0.0;
        for seed in 0..200 {
            let waves = LinearScales::new(&entry(), seed).unwrap().waves[Axis::Y];
            squares += waves.iter().flatten().map(|a| a * a).sum::<f64>();
        }
        let deviation_um = (squares / 200.0).sqrt() * 1e3;
        assert!((deviation_um / 0.4 - 1.0).abs() < 0.08, "{deviation_um}");
        let scales = LinearScales::new(&entry(), 3).unwrap();
        let error = |axis, x: f64| scales.reading_mm(axis, x, 0.0) - x;
        assert!((error(Axis::X, 123.0) - error(Axis::Y, 123.0)).abs() > 1e-6);
        // Whole signal periods apart only the graduation differs, and little.
        assert!((error(Axis::X, 123.02) - error(Axis::X, 123.0)).abs() < 1e-6);
    }
}
