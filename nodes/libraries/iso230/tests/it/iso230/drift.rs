//! ISO 230-3 against closed forms and budgets by hand.

use iso230::budget::DeviceUncertainty;
use iso230::thermal::{
    self, Artefact, ArtefactTemperature, DriftBudget, DriftCause, DriftChannel, DriftTest,
    GrowthReads,
};
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
    artefact: None,
};

/// 200 mm of 1 µm/(m K) in a range that grows it by 0.04 √3 µm: a standard uncertainty of 0.04 µm.
const GROWS_BY_40_NM: Artefact = Artefact {
    length_mm: 200.0,
    expansion_per_k: 1e-6,
    expansion_half_width_per_k: 0.0,
    temperature: ArtefactTemperature::Range {
        range_k: 0.346_410_161_513_775_44,
    },
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
        artefact: Some(GROWS_BY_40_NM),
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
    // (13): twice the certificate's part, and all of the growth.
    near(
        "U",
        expanded_mm,
        2e-3 * f64::sqrt(2.0 * 0.09) + 4e-5 * f64::sqrt(3.0),
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
        artefact: Some(GROWS_BY_40_NM),
    };
    // 1 nm/s over 4 h: 3.6 µm in an hour, 14.4 µm in all.
    let result = thermal::evaluate(&drift_test(|t| 1e-6 * t, 4.0), &budget).unwrap();
    let x = result.displacements[0];
    // In µm²: certificate 2 · 0.3² + (0.05 d/2)², scatter 2 · 0.1²; (13): the growth of 0.04 √3 µm is added in full.
    let by_hand_mm = |d_um: f64| {
        let by_length2 = (0.05 * d_um / 2.0).powi(2);
        2e-3 * (0.18 + by_length2 + 0.02).sqrt() + 4e-5 * 3.0_f64.sqrt()
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
    // (6) of 3.6 µm in the last hour, in µm²: certificate 0.18 + (0.05 · 3.6/2)²; scatter 0.01 by 361 readings 10 s apart, whose
    // squares of time are 100 n (n² - 1)/12 s² together. (13): the artefact's a quarter over the last of four hours.
    let squares_s2: f64 = 100.0 * 361.0 * (361.0 * 361.0 - 1.0) / 12.0;
    let by_hand_um2 = 0.18 + 0.0081 + 0.01 * 3600.0_f64.powi(2) / squares_s2;
    let by_hand_mm = 2e-3 * by_hand_um2.sqrt() + 1e-5 * 3.0_f64.sqrt();
    let rate = x.final_rate.expanded_uncertainty_mm_s * 3600.0;
    near("U(rate)", rate, by_hand_mm, 1e-9);
}

/// 200 mm of (10 ± 1) µm/(m K), read within ± 0.1 K at the times of a test; kelvins by the time in s.
fn read_artefact(test: &DriftTest, growth_reads: GrowthReads, k: fn(f64) -> f64) -> Artefact {
    Artefact {
        length_mm: 200.0,
        expansion_per_k: 10e-6,
        expansion_half_width_per_k: 1e-6,
        temperature: ArtefactTemperature::Read {
            degc: test.times_s.iter().map(|t| 20.0 + k(t - 5e8)).collect(),
            half_width_k: 0.1,
            growth_reads,
        },
    }
}

/// Half a kelvin in an hour, which grows that artefact by 1 µm.
fn half_a_kelvin_an_hour(t: f64) -> f64 {
    0.5 * t / 3600.0
}

#[test]
fn eq9_growth_that_was_read_is_taken_out() {
    let warm_k = |t: f64| 3.0 * (1.0 - (-t / 2700.0).exp());
    for (growth_reads, sign) in [(GrowthReads::More, 1.0), (GrowthReads::Less, -1.0)] {
        // The growth alone: 2 µm/K, from another zero.
        let test = drift_test(|t| 7.0 + sign * 2e-3 * warm_k(t), 4.0);
        let artefact = read_artefact(&test, growth_reads, |t| 3.0 * (1.0 - (-t / 2700.0).exp()));
        let budget = DriftBudget {
            artefact: Some(artefact),
            ..CERTAIN_DRIFT
        };
        let x = thermal::evaluate(&test, &budget).unwrap().displacements[0];
        near("d", x.drift_after.value_mm, 0.0, 1e-14);
        near("range", x.range.value_mm, 0.0, 1e-14);
        near("rate", x.final_rate.value_mm_s, 0.0, 1e-17);
        // 3.6 µm of drift in an hour beside 1 µm of growth.
        let test = drift_test(|t| 1e-6 * t, 4.0);
        let artefact = read_artefact(&test, growth_reads, half_a_kelvin_an_hour);
        let growth_mm = artefact.growth_mm().unwrap();
        near("growth", *growth_mm.last().unwrap(), sign * 4e-3, 1e-12);
        let budget = DriftBudget {
            artefact: Some(artefact),
            ..CERTAIN_DRIFT
        };
        let x = thermal::evaluate(&test, &budget).unwrap().displacements[0];
        let an_hour_mm = 3.6e-3 - sign * 1e-3;
        near("d", x.drift_after.value_mm, an_hour_mm, 1e-12);
        near("range", x.range.value_mm, 4.0 * an_hour_mm, 1e-12);
        near("rate", x.final_rate.value_mm_s * 3600.0, an_hour_mm, 1e-12);
    }
}

#[test]
fn eq10_eq11_eq12_of_a_read_artefact_by_hand() {
    let test = drift_test(|t| 1e-6 * t, 4.0);
    let budget = DriftBudget {
        sensor: DeviceUncertainty {
            expanded_uncertainty_mm: 0.000_6,
            expanded_uncertainty_per_length: 0.05,
            coverage_factor: 2.0,
        },
        reading_scatter_mm: 0.000_1,
        sensor_error_period_mm: None,
        artefact: Some(read_artefact(
            &test,
            GrowthReads::More,
            half_a_kelvin_an_hour,
        )),
    };
    let result = thermal::evaluate(&test, &budget).unwrap();
    let x = result.displacements[0];
    // In µm²: certificate 2 · 0.3² + (0.05 D/2)² of 3.6 and 14.4 µm that were read, scatter 2 · 0.1²; two temperatures within
    // ± 0.2 µm, coefficient within ± 0.1 µm of half a kelvin and ± 0.4 µm of 2 K.
    let limits_um2 =
        |of_coefficient_um: f64| (2.0 * 0.2_f64.powi(2) + of_coefficient_um.powi(2)) / 3.0;
    let after_um2 = 0.18 + 0.0081 + 0.02 + limits_um2(0.1);
    let range_um2 = 0.18 + 0.1296 + 0.02 + limits_um2(0.4);
    let squares_s2: f64 = 100.0 * 361.0 * (361.0 * 361.0 - 1.0) / 12.0;
    let rate_um2 = 0.18 + 0.0081 + 0.01 * 3600.0_f64.powi(2) / squares_s2 + limits_um2(0.1);
    for (name, expanded_mm, k, by_hand_um2) in [
        (
            "d",
            x.drift_after.expanded_uncertainty_mm,
            x.drift_after_coverage_factor,
            after_um2,
        ),
        (
            "range",
            x.range.expanded_uncertainty_mm,
            x.range_coverage_factor,
            range_um2,
        ),
        (
            "rate",
            x.final_rate.expanded_uncertainty_mm_s * 3600.0,
            x.final_rate_coverage_factor,
            rate_um2,
        ),
    ] {
        assert!((1.9..2.0).contains(&k), "{name}: {k}");
        near(name, expanded_mm, 1e-3 * k * by_hand_um2.sqrt(), 1e-9);
    }
    let artefact_mm = 1e-3 * limits_um2(0.4).sqrt();
    near("artefact", x.contributions.artefact_mm, artefact_mm, 1e-12);
    // The growth is the same at both heights.
    let alone = DriftBudget {
        artefact: None,
        ..budget
    };
    let without = thermal::evaluate(&test, &alone).unwrap();
    assert_eq!(result.angles, without.angles);
}

/// k of the three figures beside an artefact, by an instrument of this certificate.
fn factors(artefact: Artefact, expanded_uncertainty_mm: f64) -> [f64; 3] {
    let budget = DriftBudget {
        sensor: DeviceUncertainty {
            expanded_uncertainty_mm,
            ..EXACT_DEVICE
        },
        artefact: Some(artefact),
        ..CERTAIN_DRIFT
    };
    let test = drift_test(|t| 1e-6 * t, 1.0);
    let x = thermal::evaluate(&test, &budget).unwrap().displacements[0];
    [
        x.drift_after_coverage_factor,
        x.range_coverage_factor,
        x.final_rate_coverage_factor,
    ]
}

#[test]
fn eq12_k_of_two_limits_by_hand() {
    let test = drift_test(|t| 1e-6 * t, 1.0);
    let mut known = read_artefact(&test, GrowthReads::Less, half_a_kelvin_an_hour);
    known.expansion_half_width_per_k = 0.0;
    // The sum of two like rectangles has 1 − (1 − c/2a)² within ± c.
    let by_hand = 2.0 * (1.0 - (1.0 - 0.9545_f64).sqrt()) * 1.5_f64.sqrt();
    for k in factors(known, 0.0) {
        near("k", k, by_hand, 2e-3);
    }
}

#[test]
fn eq13_k_of_a_bound_by_hand() {
    // The growth alone; a normal part of u_n = a_l · 2/3, where k is greatest; none of it.
    let a_l_mm = 4e-5 * 3.0_f64.sqrt();
    let u_n_mm = a_l_mm * 2.0 / 3.0;
    let mut rigid = GROWS_BY_40_NM;
    rigid.expansion_per_k = 0.0;
    for (artefact, u_n_mm, by_hand) in [
        (GROWS_BY_40_NM, 0.0, 3.0_f64.sqrt()),
        (GROWS_BY_40_NM, u_n_mm, 7.0_f64.sqrt()),
        (rigid.clone(), u_n_mm, 2.0),
        (rigid, 0.0, 2.0),
    ] {
        for k in factors(artefact, 2.0 * u_n_mm / 2.0_f64.sqrt()) {
            near("k", k, by_hand, 1e-12);
        }
    }
}

#[test]
fn eq10_a_coefficient_counts_for_what_the_temperature_did_between_the_extremes() {
    // Up to 2 h and half the way back; the artefact keeps its temperature until 3 h and then warms.
    let test = drift_test(|t| 1e-6 * t.min(10_800.0 - t / 2.0), 4.0);
    let late_k = |t: f64| (t - 10_800.0).max(0.0) / 1800.0;
    let mut artefact = read_artefact(&test, GrowthReads::More, late_k);
    artefact.expansion_per_k = 0.0;
    let budget = DriftBudget {
        artefact: Some(artefact),
        ..CERTAIN_DRIFT
    };
    let x = thermal::evaluate(&test, &budget).unwrap().displacements[0];
    near("range", x.contributions.artefact_mm, 0.0, 1e-18);
    near("d", x.drift_after.expanded_uncertainty_mm, 0.0, 1e-18);
    // 2 K in the last hour of 200 mm with ± 1 µm/(m K), of one rectangle.
    let rate_mm_s = 0.9545 * 0.4e-3 / 3600.0;
    near(
        "rate",
        x.final_rate.expanded_uncertainty_mm_s,
        rate_mm_s,
        2e-3 * rate_mm_s,
    );
}

#[test]
fn a_coefficient_within_limits_widens_the_bound_of_a_range() {
    let budget = DriftBudget {
        artefact: Some(Artefact {
            expansion_half_width_per_k: 0.5e-6,
            ..GROWS_BY_40_NM
        }),
        ..CERTAIN_DRIFT
    };
    let result = thermal::evaluate(&drift_test(|t| t, 2.0), &budget).unwrap();
    near(
        "artefact",
        result.displacements[0].contributions.artefact_mm,
        6e-5,
        1e-15,
    );
}

#[test]
fn an_artefact_since_a_reading_has_the_temperatures_from_there() {
    let test = drift_test(|t| t, 1.0);
    let whole = read_artefact(&test, GrowthReads::More, half_a_kelvin_an_hour);
    let late = whole.clone().since_reading(180);
    let growth_mm = late.growth_mm().unwrap();
    assert_eq!(growth_mm.len(), 181);
    near("growth", growth_mm[180], 0.5e-3, 1e-12);
    assert_eq!(whole.since_reading(1000).growth_mm(), None);
    assert_eq!(GROWS_BY_40_NM.since_reading(180), GROWS_BY_40_NM);
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
