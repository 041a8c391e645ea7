//! Squareness between reference lines against numpy's lines through trajectories that are written out for the chain.
//!
//! The numbers are in `numpy/squareness_lines.txt`, which states how they were made.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use grid_encoder::reference_lines::{Lines, squareness};
use machine::Kinematics;
use metrology::sample::{CurveForm, ErrorCurve, EstimableCombination, GeometryModel, TestPlane};
use metrology::stamp::Stamp;
use metrology::{Axis, ErrorComponent, PerAxis};
use nalgebra::{DMatrix, DVector, Vector3};

const REFERENCE: &str = include_str!("../numpy/squareness_lines.txt");
const CHAIN: &str = "[w X' Y' b Z t]";

fn number(name: &str) -> f64 {
    let mut lines = REFERENCE.lines();
    let line = lines.find_map(|line| line.strip_prefix(&format!("{name} ")));
    line.unwrap().parse().unwrap()
}

fn curve(direction: Axis, of: Axis, first: u8, coefficients: &[(f64, f64)]) -> ErrorCurve {
    let n = coefficients.len();
    ErrorCurve {
        component: ErrorComponent::motion(direction, of),
        form: CurveForm::Polynomial,
        origin: 0.0,
        power: (first..).take(n).collect(),
        position: Vec::new(),
        coefficient: coefficients.iter().map(|c| c.0).collect(),
        standard_uncertainty: coefficients.iter().map(|c| c.1).collect(),
        estimable: vec![true; n],
        span: (-200.0, 200.0),
    }
}

/// The machine of `tests/validation/squareness_lines.py`.
fn model() -> GeometryModel {
    let mut tangent = curve(Axis::C, Axis::Y, 1, &[(1.2e-4, 2e-6)]);
    tangent.component = ErrorComponent::SQUARENESS[0];
    tangent.form = CurveForm::Constant;
    tangent.power.clear();
    let curves = vec![
        curve(Axis::X, Axis::X, 1, &[(2e-5, 1e-6)]),
        curve(Axis::Y, Axis::Y, 1, &[(-3e-5, 1e-6)]),
        curve(Axis::X, Axis::Y, 2, &[(4e-7, 2e-8), (-1e-9, 1e-10)]),
        curve(Axis::Y, Axis::X, 2, &[(-2e-7, 3e-8), (6e-10, 2e-10)]),
        curve(Axis::C, Axis::X, 1, &[(1e-7, 1e-8), (3e-10, 2e-11)]),
        curve(Axis::C, Axis::Y, 1, &[(-2e-7, 2e-8)]),
        tangent,
    ];
    let u = curves.iter().flat_map(|curve| &curve.standard_uncertainty);
    let variances: Vec<f64> = u.map(|u| u * u).collect();
    GeometryModel {
        at: Stamp::from_nanos(0),
        chain: CHAIN.to_owned(),
        covariance: DMatrix::from_diagonal(&DVector::from_vec(variances)),
        curves,
        combinations: Vec::new(),
        n_samples: 1,
        n_unknowns: 10,
        rank: 10,
        residual_standard_deviation_mm: 0.0,
        sequence: 1,
    }
}

fn kinematics() -> Kinematics {
    Kinematics::of_chain(CHAIN.parse().unwrap(), PerAxis::default())
}

/// The trajectories of a circle of 50 mm about (150, -20).
fn lines() -> Lines {
    Lines {
        plane: TestPlane::Xy,
        through_mm: Vector3::new(150.0, -20.0, 0.0),
        tool_offset_mm: Vector3::zeros(),
        spans_mm: [(100.0, 200.0), (-70.0, 30.0)],
    }
}

#[test]
fn val_squareness_between_lines_off_the_origin() {
    let found = squareness(&kinematics(), &model(), &lines()).unwrap();
    assert_eq!(found.component.to_string(), "EC0Y");
    assert!(
        (found.value_rad - number("lines")).abs() < 1e-9,
        "{found:?}"
    );
    let u = number("standard_uncertainty");
    assert!(
        (found.standard_uncertainty_rad - u).abs() < 1e-3 * u,
        "{found:?} {u}"
    );
    // The tangents at the origin enclose another angle.
    assert!(
        (found.value_rad - number("tangent")).abs() > 1e-5,
        "{found:?}"
    );
}

#[test]
fn straight_trajectories_have_the_squareness_of_their_tangents_wherever_they_lie() {
    let mut model = model();
    let last = model.curves.len() - 1;
    for curve in &mut model.curves[..last] {
        curve.coefficient.fill(0.0);
    }
    for through_mm in [Vector3::zeros(), Vector3::new(150.0, -20.0, 0.0)] {
        let lines = Lines {
            through_mm,
            ..lines()
        };
        let found = squareness(&kinematics(), &model, &lines).unwrap();
        assert!((found.value_rad - 1.2e-4).abs() < 1e-15, "{found:?}");
    }
}

#[test]
fn what_the_recordings_do_not_determine_is_not_stated_and_a_known_sum_is() {
    let mut model = model();
    let tangent = model.curves.len() - 1;
    model.curves[tangent].estimable[0] = false;
    assert_eq!(squareness(&kinematics(), &model, &lines()), None);
    // The sum of the squareness and of the quadratic straightness of Y that it has in the slope over -70 to 30 mm:
    // a parabola's line rises by the sum of the ends.
    model.curves[2].estimable[0] = false;
    let sum = |weight| EstimableCombination {
        weights: vec![(2, weight), (9, -50.0)],
        value_mm: 0.0,
        standard_uncertainty_mm: 0.0,
    };
    model.combinations = vec![sum(-40.0 * 50.0)];
    assert!(squareness(&kinematics(), &model, &lines()).is_some());
    model.combinations = vec![sum(40.0 * 50.0)];
    assert_eq!(squareness(&kinematics(), &model, &lines()), None);
}
