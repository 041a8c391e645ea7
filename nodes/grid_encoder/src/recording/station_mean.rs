//! Mean of the readings at one station, its outliers set aside, with an uncertainty that knows that
//! neighbouring readings resemble each other.
//!
//! # Model
//!
//! ```text
//!   σ̂ = 1.4826 median|x − median x|                                                 (1)
//!   an outlier has |x − median x| > 4 max(σ̂, resolution)                              (2)
//!   x̄ = mean of the others;   s² = Σ(x − x̄)²/(n − 1)                                (3)
//!   τ = 1 + 2 Σ_{k=1}^{K} (1 − k/n) ρ_k,  K before the first ρ_k ≤ 0, τ ≥ 1           (4)
//!   u² = s² τ / n + resolution²/12                                                    (5)
//! ```
//!
//! ρ is taken over all stations of a recording together: 55 readings tell a mean well and a correlation
//! badly. The same holds for s²: a station's own is used where it is greater than four times the pooled one.
//!
//! # Holds when
//! The machine stands still. Drift within a dwell is in ρ.
//!
//! # References
//! \[1\] JCGM 100:2008, 4.2 and 4.2.7 (correlated observations). \[2\] P. J. Rousseeuw, C. Croux, J. Am. Stat.
//! Assoc. 88, 1273 (1993): (1).

/// Distance from the median, in standard deviations, beyond which a reading is an outlier.
const OUTLIER_LIMIT: f64 = 4.0;
/// Makes the median of distances a standard deviation for normal noise.
const MAD_TO_SIGMA: f64 = 1.4826;

/// Mean of one coordinate at one station.
#[derive(Clone, Debug, PartialEq)]
pub struct StationMean {
    /// x̄ of (3), mm.
    pub mean_mm: f64,
    /// s² of (3), mm².
    pub variance_mm2: f64,
    /// Readings used.
    pub n: usize,
    /// Readings set aside by (2).
    pub n_outliers: usize,
    /// Readings less their mean in the order of time, outliers as 0; for (4).
    pub residuals_mm: Vec<f64>,
}

/// (1) to (3); `None` without readings.
#[must_use]
pub fn station_mean(readings_mm: &[f64], resolution_mm: f64) -> Option<StationMean> {
    let middle = median(readings_mm)?;
    let distances: Vec<f64> = readings_mm.iter().map(|x| (x - middle).abs()).collect();
    let sigma = (MAD_TO_SIGMA * median(&distances)?).max(resolution_mm); // (1)
    let limit = OUTLIER_LIMIT * sigma;
    let is_used = |x: &f64| (x - middle).abs() <= limit; // (2)
    let n = readings_mm.iter().filter(|x| is_used(x)).count();
    let sum: f64 = readings_mm.iter().filter(|x| is_used(x)).sum();
    let mean_mm = sum / n as f64;
    let residual = |x: &f64| if is_used(x) { x - mean_mm } else { 0.0 };
    let residuals_mm: Vec<f64> = readings_mm.iter().map(residual).collect();
    let squares: f64 = residuals_mm.iter().map(|r| r * r).sum();
    Some(StationMean {
        mean_mm,
        variance_mm2: squares / (n.saturating_sub(1).max(1)) as f64, // (3)
        n,
        n_outliers: readings_mm.len() - n,
        residuals_mm,
    })
}

/// τ of (4) from the residuals of many stations; at least 1.
#[must_use]
pub fn correlation_length<'a>(stations: impl Iterator<Item = &'a [f64]> + Clone) -> f64 {
    let at_lag = |k: usize| -> f64 {
        let products = stations.clone().map(|r| {
            let later = r.get(k..).unwrap_or_default();
            r.iter().zip(later).map(|(a, b)| a * b).sum::<f64>()
        });
        products.sum()
    };
    let count = stations.clone().count().max(1) as f64;
    let n = stations.clone().map(<[f64]>::len).sum::<usize>() as f64 / count;
    let longest = stations.clone().map(<[f64]>::len).max().unwrap_or(0);
    let whole = at_lag(0);
    if whole <= 0.0 {
        return 1.0;
    }
    let lags = (1..longest / 2).map(|k| (k as f64, at_lag(k) / whole));
    let positive = lags.take_while(|(_, rho)| *rho > 0.0);
    let sum: f64 = positive.map(|(k, rho)| (1.0 - k / n).max(0.0) * rho).sum();
    1.0 + 2.0 * sum
}

/// u of (5), mm, from the variance of a reading.
pub(super) fn standard_uncertainty_mm(
    variance_mm2: f64,
    tau: f64,
    n: usize,
    resolution_mm: f64,
) -> f64 {
    let of_mean = variance_mm2 * tau / n.max(1) as f64;
    (of_mean + resolution_mm * resolution_mm / 12.0).sqrt()
}

pub(crate) fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let upper = *sorted.get(sorted.len() / 2)?;
    let lower = *sorted.get((sorted.len() - 1) / 2)?;
    Some(f64::midpoint(lower, upper))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn eq2_a_reading_far_off_is_set_aside_and_counted() {
        let mut readings: Vec<f64> = (0..55).map(|k| 1.0 + 1e-4 * f64::from(k % 5 - 2)).collect();
        readings[30] = 1.02;
        readings[31] = -4.0;
        let mean = station_mean(&readings, 1e-6).unwrap();
        assert_eq!((mean.n, mean.n_outliers), (53, 2));
        assert!((mean.mean_mm - 1.0).abs() < 1e-5);
        assert!(station_mean(&[], 1e-6).is_none());
    }

    #[test]
    fn eq1_equal_readings_have_no_outliers() {
        let mean = station_mean(&[2.0; 10], 0.0).unwrap();
        assert_eq!((mean.n, mean.n_outliers), (10, 0));
        assert!(mean.variance_mm2.abs() < 1e-30);
    }

    #[test]
    fn val_eq4_of_an_autoregressive_process_is_its_closed_form() {
        // tau = (1 + phi) / (1 - phi) = 4 for phi = 0.6 and long series; 1 for white noise.
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        for (phi, expected) in [(0.6, 4.0), (0.0, 1.0)] {
            let stations: Vec<Vec<f64>> = (0..300)
                .map(|_| {
                    let mut state = 0.0;
                    let mut next = || {
                        let noise: f64 = StandardNormal.sample(&mut rng);
                        state = phi * state + noise;
                        state
                    };
                    for _ in 0..50 {
                        next();
                    }
                    (0..400).map(|_| next()).collect()
                })
                .collect();
            let tau = correlation_length(stations.iter().map(Vec::as_slice));
            assert!((tau - expected).abs() < 0.1 * expected, "{tau} for {phi}");
        }
    }
}
