//! What no two runs have in common: noise of the instruments, and a smooth deviation of each run.
//!
//! # Model
//!
//! ```text
//!   reading += e_d(p) + n,   e_d(p) = sum_k (a_dk cos(k_k . p) + b_dk sin(k_k . p))        (1)
//!   a_dk, b_dk ~ N(0, s^2 / K)   drawn anew for each run and direction d                  (2)
//!   n_i = phi n_(i-1) + sigma sqrt(1 - phi^2) w_i,   w ~ N(0, 1)                           (3)
//! ```
//!
//! (1) stands for what differs between runs of a real machine: oil film, thermal state, set-up. The wave vectors
//! are the machine's and the same for all runs. A touch has (1) alone, since the probe has a repeatability of its own.
//! Some machines have outliers: single readings that are off by 5 to 30 µm.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | s | `between_runs_mm` | mm |
//! | sigma, phi | `white_mm`, `ar` | mm, 1 |
//! | k | `wave_rad_per_mm` | rad/mm |
//!
//! # Agreement
//! `eq2_deviations_of_runs_have_their_size`: within 5 % over 4000 runs.

use metrology::sample::{TestKind, TestSegment};
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// Waves of the smooth deviation.
pub const WAVES: usize = 12;
/// Sizes of an outlier, mm.
const OUTLIER_MM: [f64; 2] = [5e-3, 30e-3];

/// The scatter of one machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Scatter {
    /// Seed of every draw below.
    pub seed: u64,
    /// Standard deviation of the smooth deviation of a run, per direction, mm.
    pub between_runs_mm: f64,
    /// Standard deviation of a reading within a run, mm.
    pub white_mm: f64,
    /// Autoregression from one reading to the next.
    pub ar: f64,
    /// Share of readings that are outliers.
    pub outliers: f64,
    /// Wave vectors, rad/mm.
    pub wave_rad_per_mm: [Vector3<f64>; WAVES],
    /// Runs that scatter more than the repeats, where there are such.
    pub heavier: Option<Heavier>,
}

/// Noise that the repeats do not show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heavier {
    /// Radius of the circle that is repeated, mm.
    pub repeated_radius_mm: f64,
    /// Its feed, mm/s.
    pub repeated_feed_mm_s: f64,
    /// Factor on the noise of the other circles.
    pub factor: f64,
    /// Their autoregression.
    pub ar: f64,
}

impl Scatter {
    /// Values of the waves of (1) at a place: cosines, then sines.
    #[must_use]
    pub fn waves(&self, place_mm: &Vector3<f64>) -> [f64; 2 * WAVES] {
        let mut values = [0.0; 2 * WAVES];
        for (k, wave) in self.wave_rad_per_mm.iter().enumerate() {
            let (sin, cos) = wave.dot(place_mm).sin_cos();
            (values[k], values[WAVES + k]) = (cos, sin);
        }
        values
    }

    /// Variance of each coefficient of (1), mm2.
    #[must_use]
    pub fn coefficient_variance_mm2(&self) -> f64 {
        self.between_runs_mm.powi(2) / WAVES as f64
    }
}

/// Scatter as it goes on through a session.
#[derive(Clone, Debug)]
pub struct Scattering<'a> {
    scatter: &'a Scatter,
    random: Pcg64Mcg,
    coefficients: [[f64; 2 * WAVES]; 3],
    noise: [f64; 3],
    white_mm: f64,
    ar: f64,
}

impl<'a> Scattering<'a> {
    /// Begins.
    #[must_use]
    pub fn new(scatter: &'a Scatter) -> Self {
        Self {
            random: Pcg64Mcg::seed_from_u64(scatter.seed),
            coefficients: [[0.0; 2 * WAVES]; 3],
            noise: [0.0; 3],
            white_mm: scatter.white_mm,
            ar: scatter.ar,
            scatter,
        }
    }

    /// A run begins: (2). Every run draws from a stream of its own, so that a reading more or less in one does not
    /// change the next.
    pub fn begin(&mut self, segment: &TestSegment) {
        let own = self.scatter.seed ^ u64::from(segment.run).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.random = Pcg64Mcg::seed_from_u64(own);
        let size_mm = self.scatter.coefficient_variance_mm2().sqrt();
        for coefficient in self.coefficients.iter_mut().flatten() {
            let draw: f64 = self.random.sample(StandardNormal);
            *coefficient = size_mm * draw;
        }
        self.noise = [0.0; 3];
        (self.white_mm, self.ar) = (self.scatter.white_mm, self.scatter.ar);
        if let Some(heavier) = &self.scatter.heavier {
            let is_repeated = (segment.radius_mm - heavier.repeated_radius_mm).abs() < 1e-6
                && (segment.feed_mm_s - heavier.repeated_feed_mm_s).abs() < 1e-6;
            if segment.kind == TestKind::Circle && !is_repeated {
                self.white_mm *= heavier.factor;
                self.ar = heavier.ar;
                for coefficient in self.coefficients.iter_mut().flatten() {
                    *coefficient *= heavier.factor;
                }
            }
        }
    }

    /// (1) and (3) along a direction (0, 1, 2: X, Y, Z) at a place, mm.
    pub fn reading_mm(&mut self, direction: usize, place_mm: &Vector3<f64>) -> f64 {
        let draw: f64 = self.random.sample(StandardNormal);
        let fresh = (1.0 - self.ar * self.ar).sqrt() * self.white_mm * draw;
        self.noise[direction] = self.ar * self.noise[direction] + fresh;
        let mut sum = self.noise[direction] + self.deviation_mm(direction, place_mm);
        if self.scatter.outliers > 0.0 && self.random.random::<f64>() < self.scatter.outliers {
            let size_mm = self.random.random_range(OUTLIER_MM[0]..OUTLIER_MM[1]);
            sum += if self.random.random::<bool>() {
                size_mm
            } else {
                -size_mm
            };
        }
        sum
    }

    /// (1) alone, mm.
    #[must_use]
    pub fn deviation_mm(&self, direction: usize, place_mm: &Vector3<f64>) -> f64 {
        let waves = self.scatter.waves(place_mm);
        let own = self.coefficients[direction].iter();
        own.zip(waves).map(|(a, wave)| a * wave).sum()
    }
}

#[cfg(test)]
mod tests {
    use metrology::sample::{Sense, TestPlane};
    use metrology::stamp::Stamp;

    use super::*;

    fn scatter() -> Scatter {
        Scatter {
            seed: 5,
            between_runs_mm: 3e-4,
            white_mm: 2e-4,
            ar: 0.6,
            outliers: 0.0,
            wave_rad_per_mm: std::array::from_fn(|k| {
                let turn = k as f64;
                Vector3::new(
                    0.03 * turn.cos(),
                    0.03 * turn.sin(),
                    0.01 * turn / WAVES as f64,
                )
            }),
            heavier: None,
        }
    }

    fn run(run: u32) -> TestSegment {
        TestSegment {
            plane: TestPlane::Xy,
            radius_mm: 50.0,
            feed_mm_s: 50.0,
            sense: Sense::Clockwise,
            zero_id: 1,
            setup_id: 1,
            ..TestSegment::of_kind(TestKind::Circle, run, Stamp::from_nanos(0))
        }
    }

    #[test]
    fn eq2_deviations_of_runs_have_their_size() {
        let scatter = scatter();
        let mut scattering = Scattering::new(&scatter);
        let place = Vector3::new(12.0, -40.0, 30.0);
        let mut squares = 0.0;
        for number in 0..4000 {
            scattering.begin(&run(number));
            squares += scattering.deviation_mm(1, &place).powi(2);
        }
        let size_mm = (squares / 4000.0_f64).sqrt();
        assert!((size_mm / 3e-4 - 1.0).abs() < 0.05, "{size_mm}");
    }

    #[test]
    fn eq3_noise_has_its_size_and_its_memory() {
        let scatter = Scatter {
            between_runs_mm: 0.0,
            ..scatter()
        };
        let mut scattering = Scattering::new(&scatter);
        scattering.begin(&run(1));
        let noise: Vec<f64> = (0..20_000)
            .map(|_| scattering.reading_mm(0, &Vector3::zeros()))
            .collect();
        let variance = noise.iter().map(|n| n * n).sum::<f64>() / 20_000.0;
        let product = noise.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / 19_999.0;
        assert!((variance.sqrt() / 2e-4 - 1.0).abs() < 0.05, "{variance}");
        assert!((product / variance - 0.6).abs() < 0.03, "{product}");
    }

    #[test]
    fn a_run_has_the_same_scatter_whatever_was_read_before() {
        let scatter = scatter();
        let place = Vector3::new(1.0, 2.0, 3.0);
        let mut short = Scattering::new(&scatter);
        short.begin(&run(1));
        short.begin(&run(2));
        let mut long = Scattering::new(&scatter);
        long.begin(&run(1));
        for _ in 0..100 {
            long.reading_mm(0, &place);
        }
        long.begin(&run(2));
        assert_eq!(
            short.reading_mm(2, &place).to_bits(),
            long.reading_mm(2, &place).to_bits()
        );
    }

    #[test]
    fn circles_that_are_not_repeated_scatter_more_where_they_are_told_to() {
        let mut scatter = scatter();
        let place = Vector3::new(12.0, -40.0, 30.0);
        let of = |scatter: &Scatter| {
            let mut scattering = Scattering::new(scatter);
            scattering.begin(&run(3));
            scattering.deviation_mm(0, &place)
        };
        let plain = of(&scatter);
        scatter.heavier = Some(Heavier {
            repeated_radius_mm: 30.0,
            repeated_feed_mm_s: 50.0,
            factor: 2.0,
            ar: 0.9,
        });
        assert!((of(&scatter) - 2.0 * plain).abs() < 1e-15);
        scatter.heavier.as_mut().unwrap().repeated_radius_mm = 50.0;
        assert!((of(&scatter) - plain).abs() < 1e-15);
    }
}
