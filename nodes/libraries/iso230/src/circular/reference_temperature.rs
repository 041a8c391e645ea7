//! A circular test as it is at 20 °C, the temperature at which lengths are defined (ISO 1).
//!
//! # Model
//!
//! A warm machine runs too large a circle, and a warm plate counts too little, as in equation (1) of
//! `positioning/reference_temperature.rs`. Away from the nominal centre, with the nominal radius R:
//!
//! ```text
//!   p at 20 °C = p − ε R p/|p|,   ε = α_m (θ_m − 20 °C) − α_d (θ_d − 20 °C)            (1)
//! ```
//!
//! D and F change by −ε R. G and H are differences of radii and stay, but for the share ε of the distance between the
//! nominal centre and that of the path.
//!
//! # Holds when
//! Machine and device have one temperature each over the circle. A ballbar that corrects its own length has ε = 0.
//!
//! # Agreement
//! `eq1_takes_1_1_um_out_of_the_radius_of_50_mm_at_22_degc_by_hand`, below 1e-9 mm.

use super::{CircularBudget, CircularTest, CircularTrace};
use crate::budget::differential_expansion;

impl CircularBudget {
    /// ε of (1), mm/mm.
    #[must_use]
    pub fn differential_expansion(&self) -> f64 {
        differential_expansion(&self.machine, &self.device_expansion)
    }
}

impl CircularTest {
    /// The test at 20 °C, by (1); `differential_expansion` is ε, mm/mm.
    #[must_use]
    pub fn corrected_to_20_degc(mut self, differential_expansion: f64) -> Self {
        let too_long_mm = differential_expansion * self.nominal_radius_mm;
        let traces = [&mut self.clockwise, &mut self.counter_clockwise];
        for trace in traces.into_iter().flatten() {
            match trace {
                CircularTrace::PointsMm(points) => points
                    .iter_mut()
                    .for_each(|point| *point = shortened(*point, too_long_mm)),
                CircularTrace::Radial { deviations_mm, .. } => {
                    deviations_mm.iter_mut().for_each(|dr| *dr -= too_long_mm);
                }
            }
        }
        self
    }
}

/// A point nearer to the nominal centre; one that lies there has no direction and stays.
fn shortened([u, v]: [f64; 2], by_mm: f64) -> [f64; 2] {
    let distance_mm = u.hypot(v);
    if distance_mm > 0.0 {
        [u, v].map(|along| along - by_mm * along / distance_mm)
    } else {
        [u, v]
    }
}

#[cfg(test)]
mod tests {
    use super::super::evaluate;
    use super::*;
    use crate::budget::{DeviceUncertainty, Expansion};

    /// 360 points of a circle of 50.003 mm that lies 4 µm beside its nominal centre.
    fn points() -> Vec<[f64; 2]> {
        let point = |k: u32| {
            let (sin, cos) = f64::from(k).to_radians().sin_cos();
            [50.003 * cos + 0.004, 50.003 * sin]
        };
        (0..360).map(point).collect()
    }

    #[test]
    fn eq1_takes_1_1_um_out_of_the_radius_of_50_mm_at_22_degc_by_hand() {
        // 11 µm/(m K), 2 K, 0.05 m: 1.1 µm of 3 µm; G stays 0.
        let steel = Expansion {
            temperature_deviation_k: 2.0,
            temperature_half_width_k: 0.0,
            expansion_per_k: 11e-6,
            expansion_half_width_per_k: 0.0,
        };
        let budget = CircularBudget {
            displacement: DeviceUncertainty {
                expanded_uncertainty_mm: 0.0,
                expanded_uncertainty_per_length: 0.0,
                coverage_factor: 2.0,
            },
            length: None,
            machine: steel,
            device_expansion: Expansion {
                expansion_per_k: 0.0,
                ..steel
            },
            environmental_drift_mm: 0.0,
            environmental_unrest_mm: None,
        };
        let radial = CircularTrace::Radial {
            angles_rad: (0..360).map(|k| f64::from(k).to_radians()).collect(),
            deviations_mm: vec![0.003; 360],
        };
        for trace in [CircularTrace::PointsMm(points()), radial] {
            let test = CircularTest {
                nominal_radius_mm: 50.0,
                clockwise: Some(trace.clone()),
                counter_clockwise: Some(trace),
            };
            let at_20 = test.corrected_to_20_degc(budget.differential_expansion());
            let found = evaluate(&at_20, &budget).unwrap();
            let both = found.both.unwrap();
            let sense = found.clockwise.unwrap();
            for radial in [
                both.mean_radial_deviation,
                sense.greatest_radial_deviation,
                sense.least_radial_deviation,
            ] {
                assert!((radial.value_mm - 0.001_9).abs() < 1e-9, "{radial:?}");
            }
            assert!(both.circular_error.value_mm < 1e-9, "{both:?}");
        }
    }
}
