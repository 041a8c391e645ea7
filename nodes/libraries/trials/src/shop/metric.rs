//! Size of a signature against the noise that a session really has.
//!
//! # Model
//!
//! A run has white noise and a smooth deviation on few waves over its course u from 0 to 1:
//!
//! ```text
//!   C = sigma^2 I + B B',   B = (a_k cos 2 pi f_k u, a_k sin 2 pi f_k u)          (1)
//!   <s, t> = s' C^-1 t = (s't - s'B (sigma^2 I + B'B)^-1 B't) / sigma^2           (2)
//!   D^2 = <s, s> - <s, N> <N, N>^-1 <N, s>                                        (3)
//! ```
//!
//! N are the constants of the set-up, and whatever else is to be taken out.

use std::f64::consts::TAU;
use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rand::Rng;
use rand_pcg::Pcg64Mcg;

use super::dice::{heavy, log_uniform, normal};

/// Waves of the smooth deviation.
const WAVES: usize = 4;
/// Their periods in one run.
const PERIODS: [f64; 2] = [0.4, 3.0];
/// Share of its square below which a direction counts as taken out.
const TAKEN_OUT: f64 = 1e-9;

/// Noise of a session.
#[derive(Clone, Debug, PartialEq)]
pub struct Floor {
    /// Noise of a reading, µm.
    pub white_um: f64,
    /// Smooth deviation of a run, µm.
    pub between_runs_um: f64,
    periods: [f64; WAVES],
}

impl Floor {
    /// Draws the noise of a session.
    pub fn draw(random: &mut Pcg64Mcg, white_um: [f64; 2], between_runs_um: [f64; 2]) -> Self {
        Self {
            white_um: log_uniform(random, white_um),
            between_runs_um: log_uniform(random, between_runs_um),
            periods: [(); WAVES].map(|()| random.random_range(PERIODS[0]..PERIODS[1])),
        }
    }

    /// The same with other white noise.
    pub fn with_white(&self, white_um: f64) -> Self {
        Self {
            white_um,
            ..self.clone()
        }
    }

    fn waves(&self, u: f64) -> [f64; 2 * WAVES] {
        let size = self.between_runs_um / (WAVES as f64).sqrt();
        let mut values = [0.0; 2 * WAVES];
        for (k, periods) in self.periods.iter().enumerate() {
            let (sin, cos) = (TAU * periods * u).sin_cos();
            (values[k], values[WAVES + k]) = (size * cos, size * sin);
        }
        values
    }

    /// Noise of one run, at its readings, µm.
    pub fn run(&self, random: &mut Pcg64Mcg, course: &[f64]) -> Vec<f64> {
        let drawn = [(); 2 * WAVES].map(|()| normal(random));
        let smooth = |u: &f64| -> f64 {
            let waves = self.waves(*u);
            waves
                .iter()
                .zip(&drawn)
                .map(|(wave, size)| wave * size)
                .sum()
        };
        { course.iter() }
            .map(|u| smooth(u) + self.white_um * heavy(random))
            .collect()
    }
}

/// Equation (2) of all runs of a session.
pub struct Metric {
    runs: Vec<(Range<usize>, DMatrix<f64>, DMatrix<f64>)>,
    white_um: f64,
}

impl Metric {
    /// The metric of runs, each given by the course of its readings.
    pub fn of(floor: &Floor, runs: &[Vec<f64>]) -> Self {
        let mut from = 0;
        let of = |course: &Vec<f64>| {
            let rows: Vec<f64> = course.iter().flat_map(|u| floor.waves(*u)).collect();
            let waves = DMatrix::from_row_slice(course.len(), 2 * WAVES, &rows);
            let white = DMatrix::identity(2 * WAVES, 2 * WAVES) * floor.white_um.powi(2);
            let inner = (white + waves.tr_mul(&waves)).try_inverse();
            let inner = inner.unwrap_or_else(|| DMatrix::zeros(2 * WAVES, 2 * WAVES));
            let range = from..from + course.len();
            from = range.end;
            (range, waves, inner)
        };
        Self {
            runs: runs.iter().map(of).collect(),
            white_um: floor.white_um,
        }
    }

    /// Readings of all runs.
    pub fn len(&self) -> usize {
        self.runs.last().map_or(0, |(range, ..)| range.end)
    }

    /// `C^-1` times a signature.
    fn weighted(&self, signature: &[f64]) -> DVector<f64> {
        let mut all = DVector::zeros(signature.len());
        for (range, waves, inner) in &self.runs {
            let own = DVector::from_column_slice(&signature[range.clone()]);
            let along = inner * waves.tr_mul(&own);
            let left = (own - waves * along) / self.white_um.powi(2);
            all.rows_mut(range.start, range.len()).copy_from(&left);
        }
        all
    }

    /// D of a signature with others taken out, by (3).
    pub fn d(&self, signature: &[f64], taken_out: &[Vec<f64>]) -> f64 {
        let mut columns: Vec<&[f64]> = taken_out.iter().map(Vec::as_slice).collect();
        columns.push(signature);
        let n = columns.len();
        let weighted: Vec<DVector<f64>> = columns.iter().map(|c| self.weighted(c)).collect();
        let dot = |a: usize, b: usize| -> f64 {
            { columns[a].iter() }
                .zip(weighted[b].iter())
                .map(|(x, y)| x * y)
                .sum()
        };
        let mut gram = DMatrix::from_fn(n, n, dot);
        let whole = gram[(n - 1, n - 1)];
        // Gram-Schmidt on the Gram matrix, the signature last.
        for k in 0..n - 1 {
            let own = gram[(k, k)];
            if own <= TAKEN_OUT * dot(k, k) || own <= 0.0 {
                continue;
            }
            let row = gram.row(k).clone_owned();
            let column = gram.column(k).clone_owned();
            gram -= column * row / own;
        }
        let left = gram[(n - 1, n - 1)];
        if left > TAKEN_OUT * whole {
            left.sqrt()
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    fn floor(between_runs_um: f64) -> Floor {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        Floor::draw(&mut random, [0.5, 0.5], [between_runs_um, between_runs_um])
    }

    fn course(n: usize) -> Vec<f64> {
        (0..n).map(|k| k as f64 / (n - 1) as f64).collect()
    }

    #[test]
    fn eq3_of_white_noise_is_the_root_of_the_sum_of_squares() {
        let metric = Metric::of(&floor(1e-9), &[course(20), course(20)]);
        let zeros = [true, false].map(|is_first| {
            (0..40)
                .map(|k| f64::from(u8::from((k < 20) == is_first)))
                .collect()
        });
        let signature: Vec<f64> = (0..40)
            .map(|k| if k % 2 == 0 { 1.0 } else { -1.0 })
            .collect();
        let d = metric.d(&signature, &zeros);
        assert!((d - 40_f64.sqrt() / 0.5).abs() < 1e-6, "{d}");
        let nothing = metric.d(&vec![3.0; 40], &zeros);
        assert!(nothing.abs() < 1e-12, "{nothing}");
    }

    #[test]
    fn eq1_scores_of_drawn_noise_have_variance_one() {
        let (floor, mut random) = (floor(1.0), Pcg64Mcg::seed_from_u64(9));
        let metric = Metric::of(&floor, &[course(30)]);
        let signature: Vec<f64> = (0..30).map(|k| f64::from(k) / 30.0).collect();
        let weighted = metric.weighted(&signature);
        let d = metric.d(&signature, &[]);
        let scores = (0..4000).map(|_| {
            let noise = DVector::from_vec(floor.run(&mut random, &course(30)));
            noise.dot(&weighted) / d
        });
        let variance = scores.map(|score| score * score).sum::<f64>() / 4000.0;
        assert!((variance - 1.0).abs() < 0.1, "{variance}");
    }
}
