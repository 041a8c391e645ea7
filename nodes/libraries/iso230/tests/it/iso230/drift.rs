//! ISO 230-3 against closed forms and budgets by hand.

use iso230::budget::DeviceUncertainty;
use iso230::thermal::{self, DriftBudget, DriftCause, DriftChannel, DriftTest};
use metrology::Axis;

use crate::iso230::{EXACT_DEVICE, near};

fn drift_test(displacement_mm: impl Fn(f64) -> f64, hours: f64) -> DriftTest {
    let n = (hours * 360.0) as u32;
    let times_s: Vec<f64> = (0..=n).map(|k| 5e8 + 10.0 * f64::from(k)).collect();
    let displacements = |scale: f64| -> Vec<f64> {
        let at = |t: &f64| scale * displacement_mm(t - 5e8);
        times_s.iter().map(at).collect()
    };
    DriftTest {
        cause: DriftCause::Spindle,
        channels: [
            (Axis::X, 50.0, 1.0),
            (Axis::Y, 150.0, 2.0),
            (Axis::Y, 50.0, 1.0),
        ]
        .map(|(axis, height_mm, scale)| DriftChannel {
            axis,
            height_mm,
            displacements_mm: displacements(scale),
        })
        .to_vec(),
        times_s,
        drift_after_s: 3600.0,
        rate_window_s: 3600.0,
        longest_gap_s: 30.0,
    }
}

const CERTAIN_DRIFT: DriftBudget = DriftBudget {
    sensor: EXACT_DEVICE,
    reading_scatter_mm: 0.0,
    sensor_error_period_mm: None,
    artefact_length_mm: 0.0,
    artefact_expansion_per_k: 0.0,
    artefact_temperature_range_k: 0.0,
};

#[test]
fn val_iso230_3_an_exponential_drift_has_its_closed_form() {
    let (a, tau) = (0.040, 2700.0);
    let test = drift_test(|t| a * (1.0 - (-t / tau).exp()), 4.0);
    let result = thermal::evaluate(&test, &CERTAIN_DRIFT).unwrap();
    let x = result.displacements[0];
    near(
        "d60",
        x.drift_after.value_mm,
        a * (1.0 - f64::exp(-3600.0 / tau)),
        1e-15,
    );
    near(
        "range",
        x.range.value_mm,
        a * (1.0 - f64::exp(-14_400.0 / tau)),
        1e-15,
    );
    // Slope of the least-squares line through a e^(−t/τ) over a window w from t₁ on, continuous:
    // with q = w/τ, slope = 6 a e^(−t₁/τ) [(q + 2) e^(−q) + q − 2]/(q² w)
    // (its limit for q → 0 is the derivative a e^(−t₁/τ)/τ); 361 samples differ by some 1/361.
    let (w, t1) = (3600.0_f64, 10_800.0_f64);
    let q = w / tau;
    let slope = 6.0 * a * (-t1 / tau).exp() * ((q + 2.0) * (-q).exp() + q - 2.0) / (q * q * w);
    near("rate", x.final_rate.value_mm_s, slope, 5e-4 * slope.abs());
    // Y moves once more at the upper height: −y/100 mm about A.
    let angle = result.angles[0];
    assert_eq!((result.angles.len(), angle.axis), (1, Axis::A));
    assert_eq!(
        angle.heights_mm.map(f64::to_bits),
        [50.0, 150.0].map(f64::to_bits)
    );
    near(
        "A60",
        angle.drift_after.value_rad,
        -x.drift_after.value_mm / 100.0,
        1e-15,
    );
    near(
        "A range",
        angle.range.value_rad,
        x.range.value_mm / 100.0,
        1e-15,
    );
    near(
        "A rate",
        angle.final_rate.value_rad_s,
        -x.final_rate.value_mm_s / 100.0,
        1e-18,
    );
}

#[test]
fn eq3_eq6_a_steady_drift_has_its_own_rate_and_no_uncertainty() {
    let test = drift_test(|t| 0.01 - 2e-6 * t, 2.0);
    let result = thermal::evaluate(&test, &CERTAIN_DRIFT).unwrap();
    let rate = result.displacements[0].final_rate;
    near("rate", rate.value_mm_s, -2e-6, 1e-17);
    assert!(rate.expanded_uncertainty_mm_s < 1e-16);
    near(
        "d60",
        result.displacements[0].drift_after.value_mm,
        -0.0072,
        1e-15,
    );
}

#[test]
fn eq5_of_a_drift_budget_by_hand() {
    let budget = DriftBudget {
        sensor: DeviceUncertainty {
            expanded_uncertainty_mm: 0.000_6,
            ..EXACT_DEVICE
        },
        reading_scatter_mm: 0.0,
        sensor_error_period_mm: None,
        artefact_length_mm: 200.0,
        artefact_expansion_per_k: 1e-6,
        artefact_temperature_range_k: 0.2 * 3.0_f64.sqrt(),
    };
    let test = drift_test(|t| t, 1.0);
    let result = thermal::evaluate(&test, &budget).unwrap();
    let expanded_mm = result.displacements[0].range.expanded_uncertainty_mm;
    // (6) of a straight line: what the difference of two readings has, over the window.
    let rate = result.displacements[0].final_rate;
    near(
        "U of the rate",
        rate.expanded_uncertainty_mm_s * test.rate_window_s,
        expanded_mm,
        1e-12,
    );
    near(
        "U",
        expanded_mm,
        2e-3 * f64::sqrt(2.0 * 0.09 + 0.0016),
        1e-15,
    );
    near(
        "U(A)",
        result.angles[0].range.expanded_uncertainty_rad,
        2.0 * 6e-6,
        1e-18,
    );
}

#[test]
fn eq5_certificate_scatter_and_artefact_by_hand() {
    let budget = DriftBudget {
        sensor: DeviceUncertainty {
            expanded_uncertainty_mm: 0.000_6,
            expanded_uncertainty_per_length: 0.05,
            coverage_factor: 2.0,
        },
        reading_scatter_mm: 0.000_1,
        sensor_error_period_mm: None,
        artefact_length_mm: 200.0,
        artefact_expansion_per_k: 1e-6,
        artefact_temperature_range_k: 0.2 * 3.0_f64.sqrt(),
    };
    // 1 nm/s over 4 h: 3.6 µm in an hour, 14.4 µm in all.
    let result = thermal::evaluate(&drift_test(|t| 1e-6 * t, 4.0), &budget).unwrap();
    let x = result.displacements[0];
    // In µm²: certificate 2 · 0.3² + (0.05 d/2)², scatter 2 · 0.1², artefact 0.04².
    let by_hand_mm = |d_um: f64| {
        let by_length2 = (0.05 * d_um / 2.0).powi(2);
        2e-3 * (0.18 + by_length2 + 0.02 + 0.0016).sqrt()
    };
    let (after, all) = (x.drift_after, x.range);
    near(
        "U(d)",
        after.expanded_uncertainty_mm,
        by_hand_mm(3.6),
        1e-12,
    );
    near(
        "U(range)",
        all.expanded_uncertainty_mm,
        by_hand_mm(14.4),
        1e-12,
    );
    let parts = x.contributions;
    near(
        "certificate",
        parts.certificate_mm,
        1e-3 * 0.3096_f64.sqrt(),
        1e-12,
    );
    near("scatter", parts.scatter_mm, 1e-4 * 2.0_f64.sqrt(), 1e-15);
    near("artefact", parts.artefact_mm, 4e-5, 1e-15);
    // (6) of 3.6 µm in the last hour, in µm²: certificate 0.18 + (0.05 · 3.6/2)², artefact a quarter of 0.04 over the last of four
    // hours; scatter 0.01 by 361 readings 10 s apart, whose squares of time are 100 n (n² - 1)/12 s² together.
    let squares_s2: f64 = 100.0 * 361.0 * (361.0 * 361.0 - 1.0) / 12.0;
    let by_hand_um2 = 0.18 + 0.0081 + 0.0001 + 0.01 * 3600.0_f64.powi(2) / squares_s2;
    let rate = x.final_rate.expanded_uncertainty_mm_s * 3600.0;
    near("U(rate)", rate, 2e-3 * by_hand_um2.sqrt(), 1e-9);
}

#[test]
fn eq7_scatter_of_noise_on_a_line_by_hand() {
    let line = [0.0, 0.010, 0.040, 0.050];
    let times = [0.0, 10.0, 40.0, 50.0];
    near(
        "line",
        thermal::scatter_mm(&times, &line).unwrap(),
        0.0,
        1e-17,
    );
    // w = (40 − 10)/40: 0.5 off the line, and variances 1 + 0.75² + 0.25² = 1.625 of one reading's.
    let found = thermal::scatter_mm(&times[..3], &[1.0, 1.5, 1.0]).unwrap();
    near("bent", found, 0.5 / 1.625_f64.sqrt(), 1e-15);
    assert!(thermal::scatter_mm(&times[..2], &line[..2]).is_err());
}
