//! Error motions of the cold axes: random Fourier series with the amplitudes of the plant file.
//!
//! ```text
//!   linear:  e(q) = sum_{k=1..5} [a_k sin(k t) + b_k (cos(k t) - 1)],  t = pi q / span       (1)
//!   rotary:  the same with t = q                                                            (2)
//! ```
//!
//! `a_k` and `b_k` are normal with a standard deviation that falls as 1/k and whose squares sum to
//! that of the file; each series is zero at q = 0, where the axis was referenced. For a linear axis
//! `span` is its travel, so that the series is not periodic within it.
//!
//! # Holds when
//! Errors are smooth along the axis; the cyclic error of the screw is not here.

use metrology::Axis;
use nalgebra::{Rotation3, Vector3};

use super::chain::{Rigid, shift, turn_about};
use super::guide_form::GuideForm;
use super::noise::{Effect, Stream};

const MOTION_HARMONICS: usize = 5;
const COMPONENTS: usize = 6;

/// Six error motions of one axis: three shifts (mm), three turns (rad).
#[derive(Clone, Debug)]
pub(super) struct ErrorMotion {
    angle_per_unit: f64,
    sine: [[f64; MOTION_HARMONICS]; COMPONENTS],
    cosine: [[f64; MOTION_HARMONICS]; COMPONENTS],
    centre_mm: Vector3<f64>,
    forms: Vec<GuideForm>,
}

impl ErrorMotion {
    /// Draws the series of `axis` from standard deviations per component, turning about `centre_mm`.
    pub(super) fn draw(
        seed: u64,
        axis: Axis,
        angle_per_unit: f64,
        deviation: &[f64; COMPONENTS],
        centre_mm: Vector3<f64>,
    ) -> Self {
        let mut stream = Stream::new(seed, Effect::ErrorMotions, axis.index() as u64);
        let squares: f64 = (1..=MOTION_HARMONICS).map(|k| 2.0 / (k * k) as f64).sum();
        let mut draw = || {
            std::array::from_fn(|component| {
                std::array::from_fn(|harmonic| {
                    let share = 1.0 / ((harmonic + 1) as f64 * squares.sqrt());
                    deviation[component] * share * stream.normal()
                })
            })
        };
        Self {
            angle_per_unit,
            sine: draw(),
            cosine: draw(),
            centre_mm,
            forms: Vec::new(),
        }
    }

    /// Adds forms that are known by their drawing.
    pub(super) fn with_forms(mut self, forms: Vec<GuideForm>) -> Self {
        self.forms = forms;
        self
    }

    /// (1), (2) and the forms: shift (mm) and turn (rad) at position `q`.
    pub(super) fn at(&self, q: f64) -> (Vector3<f64>, Vector3<f64>) {
        let (sin, cos) = (q * self.angle_per_unit).sin_cos();
        let mut value = [0.0; COMPONENTS];
        let (mut sin_k, mut cos_k) = (sin, cos);
        for harmonic in 0..MOTION_HARMONICS {
            for (component, value) in value.iter_mut().enumerate() {
                *value += self.sine[component][harmonic] * sin_k
                    + self.cosine[component][harmonic] * (cos_k - 1.0);
            }
            (sin_k, cos_k) = (sin_k * cos + cos_k * sin, cos_k * cos - sin_k * sin);
        }
        for form in &self.forms {
            value[form.component] += form.at(q);
        }
        (
            Vector3::new(value[0], value[1], value[2]),
            Vector3::new(value[3], value[4], value[5]),
        )
    }

    /// One component of the shift alone, mm.
    pub(super) fn component(&self, component: usize, q: f64) -> f64 {
        let (sin, cos) = (q * self.angle_per_unit).sin_cos();
        let (mut sin_k, mut cos_k) = (sin, cos);
        let mut value = 0.0;
        for (a, b) in self.sine[component].iter().zip(&self.cosine[component]) {
            value += a * sin_k + b * (cos_k - 1.0);
            (sin_k, cos_k) = (sin_k * cos + cos_k * sin, cos_k * cos - sin_k * sin);
        }
        let own = self.forms.iter().filter(|form| form.component == component);
        value + own.map(|form| form.at(q)).sum::<f64>()
    }

    /// Leaves one component and puts the others to zero.
    #[cfg(test)]
    pub(super) fn keep(&mut self, kept: Option<usize>) {
        for component in (0..COMPONENTS).filter(|component| Some(*component) != kept) {
            self.sine[component] = [0.0; MOTION_HARMONICS];
            self.cosine[component] = [0.0; MOTION_HARMONICS];
        }
    }

    /// The same as a rigid motion of the carried body.
    pub(super) fn rigid(&self, q: f64) -> Rigid {
        let (shift_mm, turn_rad) = self.at(q);
        shift(shift_mm) * turn_about(&self.centre_mm, &Rotation3::new(turn_rad))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(seed: u64) -> ErrorMotion {
        let deviation = [5e-3, 3e-3, 3e-3, 1e-5, 1e-5, 1e-5];
        ErrorMotion::draw(
            seed,
            Axis::X,
            std::f64::consts::PI / 640.0,
            &deviation,
            Vector3::z(),
        )
    }

    #[test]
    fn eq1_errors_vanish_where_the_axis_was_referenced() {
        let (shift_mm, turn_rad) = motion(1).at(0.0);
        assert!(shift_mm.norm() < 1e-15 && turn_rad.norm() < 1e-15);
    }

    #[test]
    fn eq1_recurrence_equals_the_series_term_by_term() {
        let motion = motion(2);
        for q in [-300.0, -12.5, 77.0, 320.0] {
            let angle = q * motion.angle_per_unit;
            let direct: f64 = (0..MOTION_HARMONICS)
                .map(|h| {
                    let k = (h + 1) as f64;
                    motion.sine[1][h] * (k * angle).sin()
                        + motion.cosine[1][h] * ((k * angle).cos() - 1.0)
                })
                .sum();
            assert!((motion.at(q).0.y - direct).abs() < 1e-15);
            assert!((motion.component(1, q) - direct).abs() < 1e-15);
        }
    }

    #[test]
    fn drawn_amplitudes_have_the_stated_size_over_many_machines() {
        let n = 400;
        let squares: f64 = (0..n)
            .map(|seed| {
                let motion = motion(seed);
                motion.sine[0]
                    .iter()
                    .chain(&motion.cosine[0])
                    .map(|a| a * a)
                    .sum::<f64>()
            })
            .sum();
        let deviation_mm = (squares / n as f64).sqrt();
        assert!((deviation_mm / 5e-3 - 1.0).abs() < 0.05, "{deviation_mm}");
    }
}
