//! Geometric errors and positioning tables on the wire: SI, whatever the power of a coefficient.

#![expect(
    clippy::unwrap_used,
    reason = "a test fails by panicking, in its helper functions too"
)]

use abbe_msgs::{Wire, from_cdr, msg, to_cdr};
use metrology::sample::{
    CurveForm, ErrorCurve, EstimableCombination, GeometryModel, PositioningTable,
};
use metrology::{Axis, Stamp};
use nalgebra::DMatrix;

fn curve(component: &str, form: CurveForm, power: &[u8], coefficient: &[f64]) -> ErrorCurve {
    let knots = if form == CurveForm::Table {
        coefficient.len()
    } else {
        0
    };
    ErrorCurve {
        component: component.parse().unwrap(),
        form,
        origin: 0.0,
        power: power.to_vec(),
        position: (0..knots).map(|idx| 50.0 * idx as f64).collect(),
        coefficient: coefficient.to_vec(),
        standard_uncertainty: vec![f64::NAN; coefficient.len()],
        estimable: vec![false; coefficient.len()],
        span: (-100.0, 200.0),
    }
}

fn model() -> GeometryModel {
    let curves = vec![
        curve(
            "EXX",
            CurveForm::Polynomial,
            &[1, 2, 3],
            &[2e-5, 1e-8, 3e-11],
        ),
        curve("ECX", CurveForm::Polynomial, &[1], &[4e-8]),
        curve("EC0Y", CurveForm::Constant, &[], &[1.2e-5]),
        curve("EX0C", CurveForm::Constant, &[], &[0.004]),
        curve("EYY", CurveForm::Table, &[], &[0.0, 0.001, 0.0005]),
    ];
    let combination = EstimableCombination {
        weights: vec![(1, 2500.0), (4, -50.0)],
        value_mm: 0.0012,
        standard_uncertainty_mm: 0.0001,
    };
    GeometryModel {
        at: Stamp::from_nanos(12),
        chain: "[w X' Y' b Z t]".to_owned(),
        curves,
        covariance: DMatrix::from_fn(9, 9, |row, column| 1e-12 * (1 + row + column) as f64),
        combinations: vec![combination],
        n_samples: 360,
        n_unknowns: 14,
        rank: 9,
        residual_standard_deviation_mm: f64::NAN,
        sequence: 3,
    }
}

#[test]
fn eq3_gives_si_units_for_every_power() {
    let wire = msg::GeometryModel::from_inner(&model());
    let near = |value: f64, wanted: f64| assert!((value / wanted - 1.0).abs() < 1e-12, "{value}");
    // A lead of 20 µm/m is a ratio; 1e-8 mm/mm² is 1e-5 m/m²; a yaw of 4e-8 rad/mm is 4e-5 rad/m.
    near(wire.curves[0].coefficient[0], 2e-5);
    near(wire.curves[0].coefficient[1], 1e-5);
    near(wire.curves[0].coefficient[2], 3e-5);
    near(wire.curves[1].coefficient[0], 4e-5);
    near(wire.curves[2].coefficient[0], 1.2e-5);
    near(wire.curves[3].coefficient[0], 4e-6);
    near(wire.curves[4].position[2], 0.1);
    // Weight times coefficient is a length in either unit.
    near(
        wire.combinations[0].weight[0] * wire.curves[1].coefficient[0],
        2500.0 * 4e-8 * 1e-3,
    );
    near(wire.covariance[9 + 2], 1e-12 * 4.0 * 1e3 * 1e6);
}

#[test]
fn a_geometry_model_comes_back() {
    let inner = model();
    let bytes = to_cdr(&msg::GeometryModel::from_inner(&inner));
    let back = from_cdr::<msg::GeometryModel>(&bytes)
        .unwrap()
        .into_inner()
        .unwrap();
    let near = |a: f64, b: f64| assert!((a - b).abs() <= 1e-14 * b.abs(), "{a} {b}");
    for (a, b) in back.curves.iter().zip(&inner.curves) {
        assert_eq!(
            (a.component, a.form, &a.power),
            (b.component, b.form, &b.power)
        );
        for (a, b) in a.coefficient.iter().zip(&b.coefficient) {
            near(*a, *b);
        }
        for (a, b) in a.position.iter().zip(&b.position) {
            near(*a, *b);
        }
        assert!(a.standard_uncertainty.iter().all(|u| u.is_nan()));
    }
    for (a, b) in back.covariance.iter().zip(&inner.covariance) {
        near(*a, *b);
    }
    assert_eq!(back.combinations[0].weights[1].0, 4);
    near(back.combinations[0].weights[1].1, -50.0);
    assert!(back.residual_standard_deviation_mm.is_nan());
    assert_eq!((back.rank, back.sequence), (9, 3));
}

#[test]
fn a_geometry_model_that_contradicts_itself_is_refused_by_name() {
    let refusal = |spoil: fn(&mut msg::GeometryModel)| {
        let mut wire = msg::GeometryModel::from_inner(&model());
        spoil(&mut wire);
        wire.to_inner().unwrap_err().to_string()
    };
    for (message, spoil) in [
        (
            "abbe_msgs/msg/ErrorCurve: power: 2 entries: must be 3",
            (|m| m.curves[0].power = vec![1, 2]) as fn(&mut msg::GeometryModel),
        ),
        (
            "abbe_msgs/msg/ErrorCurve: component \"EXQ\": must be an ISO 230-1 name such as EXX or EC0Y",
            |m| m.curves[0].component = "EXQ".to_owned(),
        ),
        (
            "abbe_msgs/msg/ErrorCurve: coefficient[0]: NaN: must be a finite number",
            |m| m.curves[0].coefficient[0] = f64::NAN,
        ),
        (
            "abbe_msgs/msg/ErrorCurve: form: value 9: must be 0 to 2",
            |m| m.curves[0].form = 9,
        ),
        (
            "abbe_msgs/msg/GeometryModel: covariance: 3 entries: must be 81",
            |m| m.covariance.truncate(3),
        ),
        (
            "abbe_msgs/msg/EstimableCombination: coefficient[1]: 40: the model has 9",
            |m| m.combinations[0].coefficient[1] = 40,
        ),
    ] {
        assert_eq!(refusal(spoil), message);
    }
}

#[test]
fn a_positioning_table_comes_back_and_is_refused_by_name() {
    for axis in [Axis::X, Axis::C] {
        let inner = PositioningTable {
            at: Stamp::from_nanos(1),
            axis,
            position: vec![-125.0, 0.0, 125.0],
            deviation_up: vec![0.125, 0.0, -0.5],
            deviation_down: vec![0.25, 0.0, -0.5],
            n_runs: 10,
            weight: 0.2,
            sequence: 4,
        };
        let mut wire = msg::PositioningTable::from_inner(&inner);
        assert_eq!(wire.to_inner().unwrap(), inner);
        wire.deviation_down.pop();
        assert_eq!(
            wire.to_inner().unwrap_err().to_string(),
            "abbe_msgs/msg/PositioningTable: deviation_down: 2 entries: must be 3"
        );
    }
}
