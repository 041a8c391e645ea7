//! The causes of a circle at 20 °C.
//!
//! Where both axes expand alike, a nominal expansion ε is in one cause alone: the radial expansion m, the scale that both axes
//! share. As D and F (`iso230::circular`) it is corrected by
//!
//! ```text
//!   m at 20 °C = m − ε,   u² = u_m² + u²(ε)                                                   (1)
//! ```
//!
//! with u_m of the fit and the instrument, and u(ε) of what is not known about temperatures and coefficients of machine and device.

use iso230::breakdown::{PlaneBreakdown, RowKey};
use serde_json::{Value, json};

use super::causes::with_unit;
use crate::evaluate::budget::Budget;
use crate::evaluate::circle_reading::CircleReading;
use crate::evaluate::circles::{CircleRecording, plane_axes};
use crate::evaluate::test_conditions::TestConditions;

/// What every page of causes begins with.
const AS_MEASURED: &str =
    "The causes are those at the temperature of the measurement, and so is their uncertainty.";

/// The nominal expansion of the circles of one plane, as far as it is known.
pub struct Expansion {
    /// ε, the mean over the readings, mm/mm, and its standard uncertainty; otherwise why it is not known.
    known: Result<(f64, f64), String>,
}

impl Expansion {
    /// Of the circles in the plane of `found` that were recorded with this state of compensation.
    pub fn of(
        found: &PlaneBreakdown,
        (circles, compensated): (&[CircleRecording], bool),
        budget: Option<&Budget>,
        conditions: &TestConditions,
    ) -> Self {
        let (mut sum, mut n, mut greatest) = (0.0, 0.0, 0.0_f64);
        let own = circles.iter().filter(|circle| {
            circle.compensated == compensated
                && plane_axes(circle.segment.plane) == Some(found.axes)
        });
        for circle in own {
            let read = conditions.during(&[circle.segment.run]);
            let measured = CircleReading::of(budget, &read, circle.instrument).measured;
            if let Some(why) = measured.correction.lacks() {
                return Self { known: Err(why) };
            }
            let weight = circle.points.len() as f64;
            sum += weight * measured.correction.differential_expansion();
            n += weight;
            let (machine, device) = (&measured.budget.machine, &measured.budget.device_expansion);
            greatest = greatest.max(machine.standard_mm(1.0).hypot(device.standard_mm(1.0)));
        }
        let known = if n > 0.0 {
            Ok((sum / n, greatest))
        } else {
            Err("no circle was read".to_owned())
        };
        Self { known }
    }

    /// Sentences about the causes, and the radial expansion at 20 °C for machines; null where it is not known.
    pub fn state(&self, found: &PlaneBreakdown) -> (Vec<String>, Value) {
        let mut lines = vec![AS_MEASURED.to_owned()];
        let mut rows = found.rows.iter();
        let Some(row) = rows.find(|row| row.key == RowKey::RadialExpansion) else {
            return (lines, Value::Null);
        };
        let (expansion, of_expansion) = match &self.known {
            Ok(known) => *known,
            Err(why) => {
                lines.push(format!("The radial expansion is {why}."));
                return (lines, Value::Null);
            }
        };
        let (value, u) = (
            row.value - expansion,
            row.standard_uncertainty.hypot(of_expansion),
        );
        lines.push(format!(
            "{} at 20 °C: {}; {:.2} µm/m of nominal expansion taken out. No other cause has a part in it where both axes expand alike.",
            row.name,
            with_unit(value, u, row.unit),
            expansion * 1e6
        ));
        let figures = json!({
            "name": row.name,
            "value": value,
            "standard_uncertainty": u,
            "as_measured": row.value,
            "as_measured_standard_uncertainty": row.standard_uncertainty,
            "differential_expansion": expansion,
        });
        (lines, figures)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;
    use std::path::Path;

    use metrology::sample::Sense;

    use super::super::breakdowns;
    use super::super::tests::recording;
    use super::*;
    use crate::evaluate::circles::{CirclePoint, Instrument};

    const RADIUS_MM: f64 = 50.0;
    /// Scale of both axes that the machine has at 20 °C, and what 2 K of 11 µm/(m K) less 1 K of 5 µm/(m K) add.
    const OWN: f64 = 5e-6;
    const WARM: f64 = 17e-6;
    const BUDGET: &str = "
grid_encoder: {expanded_uncertainty_um: 0.1, expanded_uncertainty_um_per_m: 0.0, coverage_factor: 2.0}
length_reference: {expanded_uncertainty_um: 0.1, expanded_uncertainty_um_per_m: 0.5, coverage_factor: 2.0}
machine: {temperature_deviation_k: 2.0, temperature_half_width_k: 0.2, expansion_um_per_m_k: 11.0, expansion_half_width_um_per_m_k: 1.0}
device: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.1, expansion_um_per_m_k: 0.0, expansion_half_width_um_per_m_k: 0.0}
plate: {temperature_deviation_k: 1.0, temperature_half_width_k: 0.1, expansion_um_per_m_k: 5.0, expansion_half_width_um_per_m_k: 0.0}
misalignment_mm: 0.0
environmental_drift_um: 0.0
";

    /// A circle that a plate read: too large by the scale, smaller with the square of the feed, 0.1 µm of noise.
    fn circle(run: u32, feed_mm_s: f64, sense: Sense) -> CircleRecording {
        let mut seed = run;
        let mut noise_mm = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            1e-4 * (f64::from(seed >> 8) / f64::from(1_u32 << 24) - 0.5) * 12.0_f64.sqrt()
        };
        let turns = if sense == Sense::Clockwise { -1.0 } else { 1.0 };
        let lag_mm = 4e-6 * feed_mm_s.powi(2) / RADIUS_MM;
        let point = |k: u32| {
            let angle = TAU * f64::from(k) / 720.0;
            let radius_mm = RADIUS_MM * (1.0 + OWN + WARM) - lag_mm + noise_mm();
            CirclePoint {
                at_mm: [radius_mm * angle.cos(), turns * radius_mm * angle.sin()],
                time_s: angle * RADIUS_MM / feed_mm_s,
            }
        };
        let points = (0..720).map(point).collect();
        let nominal = (RADIUS_MM, feed_mm_s);
        recording(points, (run, sense), nominal, Instrument::GridEncoder)
    }

    fn circles() -> Vec<CircleRecording> {
        let feeds = [(1, 10.0), (3, 100.0)];
        let both = feeds.map(|(run, feed)| {
            [Sense::Clockwise, Sense::CounterClockwise].map(|sense| {
                let run = if sense == Sense::Clockwise {
                    run
                } else {
                    run + 1
                };
                circle(run, feed, sense)
            })
        });
        both.into_iter().flatten().collect()
    }

    #[test]
    fn eq1_the_scale_of_both_axes_loses_the_nominal_expansion_by_hand() {
        let budget = Budget::read(BUDGET, Path::new("budget.yaml")).unwrap();
        let sections = breakdowns(&circles(), Some(&budget), &TestConditions::default(), &[]);
        let found = &sections[0].figures["scale_at_20_degc"];
        let of = |key: &str| found[key].as_f64().unwrap();
        assert!(
            (of("as_measured") - of("value") - WARM).abs() < 1e-12,
            "{found}"
        );
        assert!(
            (of("value") - OWN).abs() < 3.0 * of("as_measured_standard_uncertainty"),
            "{found}"
        );
        // Rectangular: 11 µm/(m K) 0.2 K, 2 K 1 µm/(m K) of the machine, 5 µm/(m K) 0.1 K of the plate.
        let of_expansion2 = (2.2e-6_f64.powi(2) + 2e-6_f64.powi(2) + 0.5e-6_f64.powi(2)) / 3.0;
        let by_hand = (of("as_measured_standard_uncertainty").powi(2) + of_expansion2).sqrt();
        assert!(
            (of("standard_uncertainty") - by_hand).abs() < 1e-12,
            "{found} {by_hand}"
        );
        let line = &sections[0].lines[2];
        assert!(
            line.contains("17.00 µm/m of nominal expansion taken out"),
            "{line}"
        );
    }

    #[test]
    fn without_a_temperature_the_scale_stays_as_measured_and_the_page_says_why() {
        let silent = BUDGET.replacen("plate:", "# plate:", 1);
        let budget = Budget::read(&silent, Path::new("budget.yaml")).unwrap();
        let sections = breakdowns(&circles(), Some(&budget), &TestConditions::default(), &[]);
        assert!(sections[0].figures["scale_at_20_degc"].is_null());
        let line = &sections[0].lines[2];
        assert!(
            line.starts_with("The radial expansion is not corrected to 20 °C: "),
            "{line}"
        );
    }
}
