//! What a wave of an instrument's error takes part in the slope of a line, (8) of [`super`].

/// Where g of (8) is greatest.
const GREATEST_K: f64 = 2.081_576;
/// g there.
const GREATEST_G: f64 = 2.617_10;
/// Below it, the first term of j₁ is exact to nine digits.
const SMALL_K: f64 = 1e-4;

/// g of (8) for a travel v τ over a period λ.
pub(super) fn wave_in_slope(travel_mm: f64, period_mm: f64) -> f64 {
    let k = std::f64::consts::PI * travel_mm.abs() / period_mm;
    if k < SMALL_K {
        // j₁ = K/3 − K³/30 + …
        return 2.0 * k;
    }
    if k <= GREATEST_K {
        return 6.0 * (k.sin() - k * k.cos()) / (k * k);
    }
    GREATEST_G.min(6.0 * (1.0 + 1.0 / (k * k)).sqrt() / k)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq8_the_slope_of_a_wave_is_that_of_sampled_lines() {
        // Least-squares slopes of sampled waves of 24 phases, by the two sums of a regression.
        let n = 2001;
        let sampled = |travel: f64| {
            let mut squares = 0.0;
            for phase in 0..24 {
                let phi = std::f64::consts::TAU * f64::from(phase) / 24.0;
                let (mut top, mut bottom) = (0.0, 0.0);
                for i in 0..n {
                    let t = f64::from(i) / f64::from(n - 1) - 0.5;
                    let wave = (std::f64::consts::TAU * travel * t + phi).sin();
                    top += t * wave;
                    bottom += t * t;
                }
                squares += (top / bottom).powi(2) / 24.0;
            }
            // Of a wave with standard deviation 1.
            (2.0 * squares).sqrt()
        };
        for travel in [1e-6, 0.01, 0.1, 0.3, 0.6, 0.66] {
            let (found, wanted) = (wave_in_slope(travel, 1.0), sampled(travel));
            assert!(
                (found - wanted).abs() < 3e-3 * wanted + 1e-9,
                "{travel}: {found} {wanted}"
            );
        }
        for travel in [0.7, 0.9, 1.3, 2.0, 3.7, 12.2] {
            assert!(
                wave_in_slope(travel, 1.0) >= 0.999 * sampled(travel),
                "{travel}"
            );
        }
        assert!(wave_in_slope(0.0, 1.0).abs() < 1e-30);
    }
}
