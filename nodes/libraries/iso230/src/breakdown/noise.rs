//! Whether what is left is noise, and how much of it there is.
//!
//! ```text
//!   σ = median |r_i − 3 r_{i+1} + 3 r_{i+2} − r_{i+3}| / (0.6745 √20)           (1)
//!   η = Σ (r_{i+1} − r_i)² / (2 Σ r_i²),  1 ± 1/√n for white residuals           (2)
//!   g = 1 + 2 Σ ρ_k, over lags k until ρ_k falls under 2/√n                     (3)
//! ```
//!
//! (1) sees only what changes from sample to sample. (3) multiplies variances of slow regressors when
//! residuals drag on; it is used when (2) is more than four of its deviations below 1, so that white
//! noise keeps the plain intervals.
//!
//! # References
//! \[1\] J. von Neumann, Ann. Math. Statist. 12 (1941) 367-395 (ratio of the mean square successive difference).

/// Standard deviations of η at which residuals count as dragging on.
const DRAGS_ON: f64 = -4.0;
/// Greatest lag of (3), as a share of a trace.
const GREATEST_LAG: f64 = 0.1;
/// Median of |N(0, 1)|.
const MEDIAN_OF_NORMAL: f64 = 0.674_489_750_196_081_7;

/// Median; 0 of nothing.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Standard deviation that the median of absolute values implies for a normal distribution.
pub(super) fn by_median(values: impl Iterator<Item = f64>) -> f64 {
    median(values.map(f64::abs).collect()) / MEDIAN_OF_NORMAL
}

/// (1) over all traces.
pub(super) fn high_pass(traces: &[Vec<f64>]) -> f64 {
    let differences = traces.iter().flat_map(|r| {
        r.windows(4).map(|w| match w {
            [a, b, c, d] => a - 3.0 * b + 3.0 * c - d,
            _ => 0.0,
        })
    });
    by_median(differences) / 20_f64.sqrt()
}

/// η of (2) and its distance from 1 in its own standard deviations.
pub(super) fn whiteness(traces: &[Vec<f64>]) -> (f64, f64) {
    let sum: f64 = traces.iter().flatten().map(|r| r * r).sum();
    let steps: f64 = traces
        .iter()
        .flat_map(|r| r.windows(2).map(|w| (w[1] - w[0]).powi(2)))
        .sum();
    let n: usize = traces.iter().map(Vec::len).sum();
    if sum <= 0.0 {
        return (1.0, 0.0);
    }
    let ratio = steps / (2.0 * sum);
    (ratio, (ratio - 1.0) * (n as f64).sqrt())
}

/// g of (3), 1 for residuals that count as white.
pub(super) fn inflation(traces: &[Vec<f64>]) -> f64 {
    let sum: f64 = traces.iter().flatten().map(|r| r * r).sum();
    let n: usize = traces.iter().map(Vec::len).sum();
    if whiteness(traces).1 > DRAGS_ON || sum <= 0.0 {
        return 1.0;
    }
    let shortest = traces.iter().map(Vec::len).min().unwrap_or(0) as f64;
    let least = 2.0 / (n as f64).sqrt();
    let correlation = |lag: usize| {
        let products = traces.iter().flat_map(|r| r.iter().zip(r.iter().skip(lag)));
        products.map(|(a, b)| a * b).sum::<f64>() / sum
    };
    let lags = (1..=(GREATEST_LAG * shortest) as usize).map(correlation);
    1.0 + 2.0 * lags.take_while(|rho| *rho > least).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    fn white(n: usize) -> Vec<f64> {
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        (0..n).map(|_| StandardNormal.sample(&mut rng)).collect()
    }

    #[test]
    fn eq1_eq2_white_noise_is_white_and_has_its_size() {
        let traces = [white(4000)];
        assert!((high_pass(&traces) - 1.0).abs() < 0.05);
        assert!(whiteness(&traces).1.abs() < 3.0);
        assert!((inflation(&traces) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn eq3_a_first_order_process_is_inflated_as_its_theory_says() {
        // var of the mean of an AR(1) process is (1 + a)/(1 − a) that of white noise: 9 at a = 0.8.
        let mut state = 0.0;
        let traces = [white(20_000)
            .into_iter()
            .map(|w| {
                state = 0.8 * state + w;
                state
            })
            .collect()];
        let found = inflation(&traces);
        assert!((found - 9.0).abs() < 1.5, "{found}");
        assert!((whiteness(&traces).0 - 0.2).abs() < 0.02);
    }

    #[test]
    fn eq1_a_slow_wave_is_no_noise() {
        let wave = (0..1000).map(|i| (f64::from(i) * 0.01).sin()).collect();
        assert!(high_pass(&[wave]) < 1e-5);
    }
}
