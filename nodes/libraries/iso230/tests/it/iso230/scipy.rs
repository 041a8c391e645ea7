//! Against a second implementation in numpy and scipy, `tests/data/iso230_reference.py`.

use std::sync::LazyLock;

use iso230::budget::DeviceUncertainty;
use iso230::circular::{self, CircularBudget, CircularTest, CircularTrace, SenseResult};
use iso230::conformance::{self, Policy, Specification};
use iso230::positioning::budget::PositioningBudget;
use iso230::positioning::{self, PointResult, PositioningRuns, periodic};
use iso230::{ExpandedLength, probing};
use nalgebra::Vector3;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::iso230::{EXACT, EXACT_DEVICE, RIGID, near};

static REFERENCE: LazyLock<Value> = LazyLock::new(|| {
    serde_json::from_str(include_str!("../../data/iso230_reference.json")).unwrap()
});

fn case<T: DeserializeOwned>(case: &str, name: &str) -> T {
    serde_json::from_value(REFERENCE[case][name].clone()).unwrap()
}

fn all_near(what: &str, found: impl Iterator<Item = f64>, expected: &[f64], within: f64) {
    let found: Vec<f64> = found.collect();
    assert_eq!(found.len(), expected.len(), "{what}");
    for (found, expected) in found.iter().zip(expected) {
        near(what, *found, *expected, within);
    }
}

#[test]
fn val_iso230_2_numpy() {
    let targets_mm: Vec<f64> = case("positioning", "targets_mm");
    let runs = PositioningRuns {
        zero_mm: targets_mm[0],
        targets_mm,
        up_mm: case("positioning", "up_mm"),
        down_mm: case("positioning", "down_mm"),
        periods_mm: vec![10.0],
    };
    let budget = PositioningBudget {
        device: DeviceUncertainty {
            expanded_uncertainty_per_length: 1e-6,
            ..EXACT_DEVICE
        },
        ..EXACT
    };
    let result = positioning::evaluate(&runs, &budget).unwrap();
    let figures = [
        ("b", result.reversal),
        ("b_mean", result.mean_reversal),
        ("r", result.repeatability),
        ("r_up", result.up.repeatability),
        ("r_down", result.down.repeatability),
        ("e", result.systematic_error),
        ("e_up", result.up.systematic_error),
        ("e_down", result.down.systematic_error),
        ("m", result.mean_systematic_error),
        ("a", result.accuracy),
        ("a_up", result.up.accuracy),
        ("a_down", result.down.accuracy),
    ];
    for (name, figure) in figures {
        near(name, figure.value_mm, case("positioning", name), 1e-15);
    }
    type OfPoint = fn(&PointResult) -> f64;
    let lists: [(&str, OfPoint); 7] = [
        ("means_up_mm", |p| p.up.mean_mm),
        ("means_down_mm", |p| p.down.mean_mm),
        ("scatter_up_mm", |p| p.up.standard_deviation_mm),
        ("scatter_down_mm", |p| p.down.standard_deviation_mm),
        ("reversals_mm", |p| p.reversal_mm),
        ("repeatabilities_mm", |p| p.repeatability_mm),
        ("half_widths_up_mm", |p| {
            (p.up.interval.upper_mm - p.up.interval.lower_mm) / 2.0
        }),
    ];
    for (name, of) in lists {
        let expected: Vec<f64> = case("positioning", name);
        all_near(name, result.points.iter().map(of), &expected, 1e-14);
    }
    assert_eq!(result.remarks, []);
}

#[test]
fn val_iso230_2_periodic_scipy() {
    let run = periodic::PeriodicRun {
        positions_mm: case("periodic", "positions_mm"),
        deviations_mm: case("periodic", "deviations_mm"),
        period_mm: case("periodic", "period_mm"),
        n_harmonics: 2,
    };
    let result = periodic::evaluate(&run, &EXACT).unwrap();
    let list = |name| case::<Vec<f64>>("periodic", name);
    let harmonics = || result.harmonics.iter();
    all_near(
        "amplitude",
        harmonics().map(|h| h.amplitude.value_mm),
        &list("amplitudes_mm"),
        1e-13,
    );
    let expanded = harmonics().map(|h| h.amplitude.expanded_uncertainty_mm);
    all_near("its uncertainty", expanded, &list("expanded_mm"), 1e-13);
    let p = harmonics().map(|h| h.p_value.unwrap());
    all_near("p value", p, &list("p_values"), 1e-9);
    near(
        "slope",
        result.slope_mm_per_mm,
        case("periodic", "slope"),
        1e-15,
    );
    let residual = result.residual_standard_deviation_mm;
    near("s", residual, case("periodic", "residual_mm"), 1e-14);
    let error = result.periodic_error;
    near("P", error.value_mm, case("periodic", "error_mm"), 1e-10);
    let expanded: f64 = case("periodic", "error_expanded_mm");
    near("U(P)", error.expanded_uncertainty_mm, expanded, 1e-8);
}

#[derive(Deserialize)]
struct OneSense {
    g: f64,
    f_max: f64,
    f_min: f64,
}

fn compare_sense(name: &str, found: &SenseResult) {
    let expected: OneSense = case("circular", name);
    near("G", found.circular_error.value_mm, expected.g, 1e-9);
    near(
        "F max",
        found.greatest_radial_deviation.value_mm,
        expected.f_max,
        1e-9,
    );
    near(
        "F min",
        found.least_radial_deviation.value_mm,
        expected.f_min,
        1e-9,
    );
}

#[test]
fn val_iso230_4_scipy() {
    let test = CircularTest {
        nominal_radius_mm: case("circular", "radius_mm"),
        clockwise: Some(CircularTrace::PointsMm(case("circular", "clockwise_mm"))),
        counter_clockwise: Some(CircularTrace::PointsMm(case(
            "circular",
            "counter_clockwise_mm",
        ))),
    };
    let budget = CircularBudget {
        displacement: EXACT_DEVICE,
        length: None,
        machine: RIGID,
        device_expansion: RIGID,
        environmental_drift_mm: 0.0,
        environmental_unrest_mm: None,
    };
    let result = circular::evaluate(&test, &budget).unwrap();
    compare_sense("clockwise", &result.clockwise.unwrap());
    compare_sense("counter_clockwise", &result.counter_clockwise.unwrap());
    let both = result.both.unwrap();
    let centre: Vec<f64> = case("circular", "centre_mm");
    all_near("centre", both.centre_mm.into_iter(), &centre, 1e-9);
    near(
        "G(b)",
        both.circular_error.value_mm,
        case("circular", "g_b"),
        1e-9,
    );
    near(
        "D",
        both.mean_radial_deviation.value_mm,
        case("circular", "d"),
        1e-9,
    );
    near(
        "H",
        both.hysteresis_1996.value_mm,
        case("circular", "h"),
        1e-9,
    );
}

#[test]
fn val_iso230_10_sphere_scipy() {
    let points: Vec<[f64; 3]> = case("sphere", "points_mm");
    let points: Vec<Vector3<f64>> = points.into_iter().map(Vector3::from).collect();
    let artefact = probing::Artefact {
        diameter_mm: 25.0,
        diameter_uncertainty: EXACT_DEVICE,
        form_mm: 0.0,
        form_standard_uncertainty_mm: 0.0,
        expansion: RIGID,
        stylus_radius_mm: 2.5,
        side: probing::Side::Outside,
    };
    let result = probing::sphere(&points, &artefact, 0.0).unwrap();
    let centre: Vec<f64> = case("sphere", "centre_mm");
    all_near("centre", result.centre_mm.iter().copied(), &centre, 1e-9);
    near(
        "P",
        result.form_error.value_mm,
        case("sphere", "form_mm"),
        1e-9,
    );
    let radius_mm: f64 = case("sphere", "radius_mm");
    near(
        "S",
        result.size_error.value_mm,
        2.0 * (radius_mm - 2.5) - 25.0,
        1e-9,
    );
    assert_eq!(result.unusual_number, None);
}

#[test]
fn val_iso14253_1_scipy_normal() {
    type Row = (f64, f64, Option<f64>, Option<f64>, f64);
    for (value_mm, u_mm, lower_mm, upper_mm, probability) in case::<Vec<Row>>("conformance", "rows")
    {
        let figure = ExpandedLength::new(value_mm, u_mm);
        let specification = Specification { lower_mm, upper_mm };
        let verdict = conformance::decide(&figure, &specification, Policy::Simple).unwrap();
        near("P", verdict.probability_of_conformance, probability, 1e-11);
    }
    for (probability, factor) in case::<Vec<(f64, f64)>>("conformance", "factors") {
        near(
            "factor",
            conformance::guard_factor(probability).unwrap(),
            factor,
            1e-9,
        );
    }
}
