//! Sums of c e^{i 2π f t} over times that need not be equally spaced, at many equally spaced frequencies.
//!
//! # Model
//!
//! Each value is spread over a grid by a Gaussian, the grid is transformed, and what the spreading did to
//! each frequency is divided out:
//!
//! ```text
//!   F(k) = Σ_j c_j e^{i k x_j},  x_j = 2π Δ t_j,  |k| <= n/2                              (1)
//!   g_m = Σ_j c_j exp(−(x_j − 2π m/N)²/4τ),  τ = π w/(n² r (r − 1/2)),  r = N/n          (2)
//!   F(k) ≈ √(π/τ) e^{k² τ} (1/N) Σ_m g_m e^{2π i k m/N}                                   (3)
//! ```
//!
//! # Agreement
//! `eq3_is_the_direct_sum`: 1e-10 of Σ|c|.
//!
//! # References
//! \[1\] L. Greengard, J.-Y. Lee, SIAM Review 46 (2004) 443-454, doi:10.1137/S003614450343200X.

use std::f64::consts::{PI, TAU};

use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// w of (2): grid points to either side.
const REACH: i64 = 12;
/// Smallest grid.
const LEAST_GRID: usize = 64;

/// Equally spaced frequencies.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frequencies {
    pub first_hz: f64,
    pub step_hz: f64,
    pub n: usize,
}

impl Frequencies {
    /// The same, all doubled.
    pub fn doubled(self) -> Self {
        Self {
            first_hz: 2.0 * self.first_hz,
            step_hz: 2.0 * self.step_hz,
            n: self.n,
        }
    }

    /// The frequency at a place.
    pub fn at_hz(&self, place: usize) -> f64 {
        self.first_hz + self.step_hz * place as f64
    }
}

/// Σ c e^{i 2π f t} at each frequency.
pub(super) fn sums(time_s: &[f64], values: &[f64], at: &Frequencies) -> Vec<Complex<f64>> {
    let n_grid = (2 * at.n).next_power_of_two().max(LEAST_GRID);
    let ratio = n_grid as f64 / at.n as f64;
    let tau = PI * REACH as f64 / ((at.n as f64).powi(2) * ratio * (ratio - 0.5));
    let spacing = TAU / n_grid as f64;
    let middle = at.n / 2;
    let mut grid = vec![Complex::new(0.0, 0.0); n_grid];
    // exp(−(m h)²/4τ) of (2) for whole m; the rest of the exponent is e₁ · e₂^m.
    let whole: Vec<f64> = (-REACH..=REACH)
        .map(|m| (-(m as f64 * spacing).powi(2) / (4.0 * tau)).exp())
        .collect();
    for (time, value) in time_s.iter().zip(values) {
        let c = Complex::from_polar(*value, TAU * (at.at_hz(middle) * time).fract());
        let x = TAU * (at.step_hz * time).rem_euclid(1.0);
        let near = (x / spacing).round();
        let off = x - near * spacing;
        let e1 = (-off * off / (4.0 * tau)).exp();
        let e2 = (off * spacing / (2.0 * tau)).exp();
        let mut power = e2.powi(-(REACH as i32));
        for (m, whole) in (-REACH..=REACH).zip(&whole) {
            let place = (near as i64 + m).rem_euclid(n_grid as i64) as usize;
            grid[place] += c * (e1 * power * whole); // (2)
            power *= e2;
        }
    }
    FftPlanner::new()
        .plan_fft_inverse(n_grid)
        .process(&mut grid);
    let factor = (PI / tau).sqrt() / n_grid as f64;
    (0..at.n)
        .map(|place| {
            let k = place as i64 - middle as i64;
            let undone = factor * ((k * k) as f64 * tau).exp();
            grid[k.rem_euclid(n_grid as i64) as usize] * undone // (3)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq3_is_the_direct_sum() {
        let time_s: Vec<f64> = (0..700)
            .map(|i| -3.0 + 0.011 * f64::from(i) + 0.004 * f64::from(i % 5))
            .collect();
        let values: Vec<f64> = time_s.iter().map(|t| (3.0 * t).sin() + 0.2).collect();
        let scale: f64 = values.iter().map(|v| v.abs()).sum();
        for n in [3, 50, 333] {
            let at = Frequencies {
                first_hz: 1.7,
                step_hz: 0.031,
                n,
            };
            let fast = sums(&time_s, &values, &at);
            for place in [0, 1, n / 2, n - 1] {
                let direct: Complex<f64> = time_s
                    .iter()
                    .zip(&values)
                    .map(|(t, c)| Complex::from_polar(*c, TAU * at.at_hz(place) * t))
                    .sum();
                let off = (fast[place] - direct).norm();
                assert!(off < 1e-10 * scale, "{n} {place}: {off}");
            }
        }
    }
}
