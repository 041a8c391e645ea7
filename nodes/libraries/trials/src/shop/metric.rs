//! Size of a signature against the noise that a session really has.
//!
//! # Model
//!
//! A run has noise with a memory of one reading, and a smooth deviation on few waves over its course u from 0 to 1:
//!
//! ```text
//!   n_i = phi n_(i-1) + sigma sqrt(1 - phi^2) w_i,   w = L n of variance 1        (1)
//!   C = I + B B',   B = L (a_k cos 2 pi f_k u, a_k sin 2 pi f_k u)                (2)
//!   <s, t> = s'L' C^-1 L t = s'L'Lt - s'L'B (I + B'B)^-1 B'Lt                     (3)
//!   D^2 = <s, s> - <s, N> <N, N>^-1 <N, s>                                        (4)
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
const WAVES_BETWEEN_RUNS: usize = 6;
/// Their periods in one run.
const PERIODS: [f64; 2] = [0.4, 4.0];
/// Share of its square below which a direction counts as taken out.
const TAKEN_OUT: f64 = 1e-9;

/// Noise of a session.
#[derive(Clone, Debug, PartialEq)]
pub struct Floor {
    /// Noise of a reading, µm.
    pub white_um: f64,
    /// Smooth deviation of a run, µm.
    pub between_runs_um: f64,
    /// What a reading keeps of the noise of the one before.
    pub memory: f64,
    periods: [f64; WAVES_BETWEEN_RUNS],
}

impl Floor {
    /// Draws the noise of a session.
    pub fn draw(random: &mut Pcg64Mcg, white_um: [f64; 2], between_runs_um: [f64; 2]) -> Self {
        Self {
            white_um: log_uniform(random, white_um),
            between_runs_um: log_uniform(random, between_runs_um),
            memory: 0.0,
            periods: [(); WAVES_BETWEEN_RUNS].map(|()| random.random_range(PERIODS[0]..PERIODS[1])),
        }
    }

    /// Noise of every so many readings that tells as much as that of all.
    pub fn thinned(&self, every: usize) -> Self {
        // Of a slow signal the noise at frequency zero counts.
        let worth = (1.0 - self.memory) / (1.0 + self.memory);
        let memory = self.memory.powi(i32::try_from(every).unwrap_or(i32::MAX));
        let worth_thinned = (1.0 - memory) / (1.0 + memory);
        let ratio = worth_thinned / (worth * every as f64);
        Self {
            white_um: self.white_um * ratio.sqrt(),
            memory,
            ..self.clone()
        }
    }

    /// The same with a memory.
    pub fn with_memory(self, memory: f64) -> Self {
        Self { memory, ..self }
    }

    /// Values of one run as (1) makes their noise white with variance 1.
    fn whitened(&self, values: &[f64]) -> Vec<f64> {
        let share = (1.0 - self.memory * self.memory).sqrt();
        let of = |k: usize| match k {
            0 => values[0] / self.white_um,
            _ => (values[k] - self.memory * values[k - 1]) / (share * self.white_um),
        };
        (0..values.len()).map(of).collect()
    }

    fn waves(&self, u: f64) -> [f64; 2 * WAVES_BETWEEN_RUNS] {
        let size = self.between_runs_um / (WAVES_BETWEEN_RUNS as f64).sqrt();
        let mut values = [0.0; 2 * WAVES_BETWEEN_RUNS];
        for (k, periods) in self.periods.iter().enumerate() {
            let (sin, cos) = (TAU * periods * u).sin_cos();
            (values[k], values[WAVES_BETWEEN_RUNS + k]) = (size * cos, size * sin);
        }
        values
    }

    /// Noise of one run, at its readings, µm.
    pub fn run(&self, random: &mut Pcg64Mcg, course: &[f64]) -> Vec<f64> {
        let drawn = [(); 2 * WAVES_BETWEEN_RUNS].map(|()| normal(random));
        let smooth = |u: &f64| -> f64 {
            let waves = self.waves(*u);
            waves
                .iter()
                .zip(&drawn)
                .map(|(wave, size)| wave * size)
                .sum()
        };
        let mut noise: Option<f64> = None;
        let of = |u: &f64| {
            let share = (1.0 - self.memory * self.memory).sqrt();
            let fresh = heavy(random);
            let now = noise.map_or(fresh, |before| self.memory * before + share * fresh);
            noise = Some(now);
            smooth(u) + self.white_um * now
        };
        course.iter().map(of).collect()
    }
}

/// Equation (3) of all runs of a session.
pub struct Metric {
    floor: Floor,
    runs: Vec<(Range<usize>, DMatrix<f64>, DMatrix<f64>)>,
}

impl Metric {
    /// The metric of runs, each given by the course of its readings.
    pub fn of(floor: &Floor, runs: &[Vec<f64>]) -> Self {
        let mut from = 0;
        let of = |course: &Vec<f64>| {
            let rows: Vec<[f64; 2 * WAVES_BETWEEN_RUNS]> =
                course.iter().map(|u| floor.waves(*u)).collect();
            let column = |k: usize| {
                let own: Vec<f64> = rows.iter().map(|row| row[k]).collect();
                DVector::from_vec(floor.whitened(&own))
            };
            let waves: Vec<DVector<f64>> = (0..2 * WAVES_BETWEEN_RUNS).map(column).collect();
            let waves = DMatrix::from_columns(&waves);
            let inner = DMatrix::identity(2 * WAVES_BETWEEN_RUNS, 2 * WAVES_BETWEEN_RUNS)
                + waves.tr_mul(&waves);
            let inner = inner.try_inverse();
            let inner = inner
                .unwrap_or_else(|| DMatrix::zeros(2 * WAVES_BETWEEN_RUNS, 2 * WAVES_BETWEEN_RUNS));
            let range = from..from + course.len();
            from = range.end;
            (range, waves, inner)
        };
        let runs = runs.iter().map(of).collect();
        Self {
            floor: floor.clone(),
            runs,
        }
    }

    /// Readings of all runs.
    pub fn len(&self) -> usize {
        self.runs.last().map_or(0, |(range, ..)| range.end)
    }

    /// A signature as the noise within runs makes it, and the same times `C^-1`.
    pub(super) fn weighted(&self, signature: &[f64]) -> [DVector<f64>; 2] {
        let [mut plain, mut weighted] = [(); 2].map(|()| DVector::zeros(signature.len()));
        for (range, waves, inner) in &self.runs {
            let own = DVector::from_vec(self.floor.whitened(&signature[range.clone()]));
            let along = inner * waves.tr_mul(&own);
            let left = &own - waves * along;
            plain.rows_mut(range.start, range.len()).copy_from(&own);
            weighted.rows_mut(range.start, range.len()).copy_from(&left);
        }
        [plain, weighted]
    }

    /// D of a signature with others taken out, by (4).
    pub fn d(&self, signature: &[f64], taken_out: &[Vec<f64>]) -> f64 {
        let mut columns: Vec<&[f64]> = taken_out.iter().map(Vec::as_slice).collect();
        columns.push(signature);
        let n = columns.len();
        let both: Vec<[DVector<f64>; 2]> = columns.iter().map(|c| self.weighted(c)).collect();
        last_left(DMatrix::from_fn(n, n, |a, b| both[a][0].dot(&both[b][1])))
    }
}

/// Root of what the last of several columns keeps with the others taken out, from their products.
pub(super) fn last_left(mut gram: DMatrix<f64>) -> f64 {
    let n = gram.nrows();
    let before = gram.clone();
    let whole = gram[(n - 1, n - 1)];
    // Gram-Schmidt on the Gram matrix, the signature last.
    for k in 0..n - 1 {
        let own = gram[(k, k)];
        if own <= TAKEN_OUT * before[(k, k)] || own <= 0.0 {
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
    fn eq4_of_white_noise_is_the_root_of_the_sum_of_squares() {
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
    fn eq3_scores_of_drawn_noise_have_variance_one() {
        let (floor, mut random) = (floor(1.0).with_memory(0.8), Pcg64Mcg::seed_from_u64(9));
        let metric = Metric::of(&floor, &[course(30)]);
        let signature: Vec<f64> = (0..30).map(|k| f64::from(k) / 30.0).collect();
        let [_, weighted] = metric.weighted(&signature);
        let d = metric.d(&signature, &[]);
        let scores = (0..4000).map(|_| {
            let noise = floor.run(&mut random, &course(30));
            let noise = DVector::from_vec(floor.whitened(&noise));
            noise.dot(&weighted) / d
        });
        let variance = scores.map(|score| score * score).sum::<f64>() / 4000.0;
        assert!((variance - 1.0).abs() < 0.1, "{variance}");
    }
}
