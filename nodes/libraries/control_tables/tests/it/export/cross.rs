//! Straightness and squareness as a cross-axis table, and what a model may be asked for.

use control_tables::sinumerik::{CrossTable, cross_table};
use control_tables::{AxisErrors, CrossErrors, Grid, Unestimable};
use machine::volumetric::{VolumetricModel, components_of};
use machine::{Chain, Kinematics};
use metrology::sample::{CurveForm, ErrorCurve, GeometryModel};
use metrology::stamp::Stamp;
use metrology::{Axis, ErrorComponent, PerAxis};
use nalgebra::{DMatrix, Rotation3, Vector3};

use crate::export::sinumerik::{assignments, moved_by_cross_mm, points};
use crate::export::slide::look_up;

pub const EXY: ErrorComponent = ErrorComponent::motion(Axis::X, Axis::Y);
pub const EC0Y: ErrorComponent = ErrorComponent::location(Axis::C, Axis::Y);

pub fn polynomial(component: ErrorComponent, coefficient: &[f64]) -> ErrorCurve {
    let n = coefficient.len();
    ErrorCurve {
        component,
        form: CurveForm::Polynomial,
        origin: 0.0,
        power: (1..=n as u8).collect(),
        position: Vec::new(),
        coefficient: coefficient.to_vec(),
        standard_uncertainty: vec![0.0; n],
        estimable: vec![true; n],
        span: (-250.0, 250.0),
    }
}

pub fn constant(component: ErrorComponent, value: f64) -> ErrorCurve {
    ErrorCurve {
        form: CurveForm::Constant,
        power: Vec::new(),
        ..polynomial(component, &[value])
    }
}

pub fn model(curves: Vec<ErrorCurve>) -> GeometryModel {
    GeometryModel {
        at: Stamp::from_nanos(1),
        chain: "[w b Y X Z t]".to_owned(),
        curves,
        covariance: DMatrix::zeros(0, 0),
        combinations: Vec::new(),
        n_samples: 0,
        n_unknowns: 0,
        rank: 0,
        residual_standard_deviation_mm: 0.0,
        sequence: 1,
    }
}

pub fn set_up() -> CrossTable {
    CrossTable {
        table: 3,
        max_tables: 8,
        max_points: 200,
        input_axis: "Y1".to_owned(),
        output_axis: "X1".to_owned(),
        max_sum: 1.0,
    }
}

pub fn grid() -> Grid {
    Grid::new(Axis::Y, -250.0, 25.0, 21, (-250.0, 250.0)).unwrap()
}

const BOW: [f64; 3] = [0.0, 1.5e-7, -2e-10];
const SQUARENESS_RAD: f64 = 4e-5;

/// X of a tool that Y has carried: Y is turned about Z by the squareness, as a rotation does it, and bowed.
fn x_mm(y_mm: f64) -> f64 {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), SQUARENESS_RAD);
    let carried = turn * Vector3::new(0.0, y_mm, 0.0);
    carried.x + BOW[1] * y_mm.powi(2) + BOW[2] * y_mm.powi(3)
}

#[test]
fn eq1_moved_as_the_manual_says_a_cross_axis_table_straightens_and_squares_an_axis() {
    let curves = vec![polynomial(EXY, &BOW), constant(EC0Y, SQUARENESS_RAD)];
    let errors = CrossErrors::sample(
        &model(curves),
        &[EXY, EC0Y],
        Axis::X,
        &grid(),
        Unestimable::Refuse,
    );
    let file = cross_table(&errors.unwrap(), &set_up()).unwrap();
    let data = assignments(&file.text);
    assert_eq!(data["$AN_CEC_INPUT_AXIS[3]"], "(Y1)");
    assert_eq!(data["$AN_CEC_OUTPUT_AXIS[3]"], "(X1)");
    let table = points(&data, "$AN_CEC", "3,N", "3");
    let greatest_mm = grid()
        .positions()
        .map(|y| x_mm(y).abs())
        .fold(0.0, f64::max);
    assert!(greatest_mm > 0.009, "{greatest_mm}");
    for y_mm in grid().positions() {
        let left_mm = x_mm(y_mm) + moved_by_cross_mm(look_up(&table, y_mm));
        // Half of 1 nm, and the second order of the turn.
        assert!(left_mm.abs() < 0.6e-6, "{left_mm}");
    }
}

#[test]
fn the_three_squareness_errors_act_as_rotations_do() {
    for (component, direction) in
        ErrorComponent::SQUARENESS
            .into_iter()
            .zip([Axis::X, Axis::X, Axis::Y])
    {
        let base = component.of;
        let grid = Grid::new(base, -100.0, 100.0, 3, (-100.0, 100.0)).unwrap();
        let model = model(vec![constant(component, 1e-5)]);
        let errors =
            CrossErrors::sample(&model, &[component], direction, &grid, Unestimable::Refuse)
                .unwrap();
        let about = Vector3::ith_axis(component.direction.index() - 3);
        let carried =
            Rotation3::from_axis_angle(&about, 1e-5) * (Vector3::ith(base.index(), 1.0) * 100.0);
        let expected_mm: f64 = carried[direction.index()];
        assert!(expected_mm.abs() > 9e-4);
        assert!(
            (errors.error()[2] - expected_mm).abs() < 1e-12,
            "{component}"
        );
    }
}

#[test]
fn a_table_of_knots_and_a_polynomial_about_an_origin_are_evaluated_as_they_are_defined() {
    let exx = ErrorComponent::motion(Axis::X, Axis::X);
    let grid = Grid::new(Axis::X, -50.0, 50.0, 3, (-50.0, 50.0)).unwrap();
    let knots = ErrorCurve {
        form: CurveForm::Table,
        power: Vec::new(),
        position: vec![-50.0, 0.0, 100.0],
        ..polynomial(exx, &[0.001, 0.002, 0.006])
    };
    let shifted = ErrorCurve {
        origin: 50.0,
        ..polynomial(exx, &[1e-5, 1e-7])
    };
    for (curve, expected_mm) in [
        (knots, [0.001, 0.002, 0.004]),
        (shifted, [0.0, -0.00025, 0.0]),
    ] {
        let errors = CrossErrors::sample(
            &model(vec![curve]),
            &[exx],
            Axis::X,
            &grid,
            Unestimable::Refuse,
        );
        let own = AxisErrors::from_component(&errors.unwrap()).unwrap();
        for (e, expected_mm) in own.up().iter().zip(expected_mm) {
            assert!((e - expected_mm).abs() < 1e-12, "{e} {expected_mm}");
        }
        assert_eq!(own.up(), own.down());
    }
}

#[test]
fn eq1_a_table_and_the_machine_model_say_the_same_of_every_component_that_moves_the_tool() {
    const SMALL_RAD: f64 = 3e-5;
    let mut n = 0;
    for text in ["[w b Y X Z t]", "[w X' Y' b Z t]", "[w Y' b X Z t]"] {
        let chain: Chain = text.parse().unwrap();
        let kinematics = Kinematics::of_chain(chain.clone(), PerAxis::default());
        for component in components_of(&chain) {
            let base = component.of;
            let curve = if component.is_location {
                constant(component, SMALL_RAD)
            } else {
                polynomial(component, &[2e-6, -4e-9, 3e-11])
            };
            let mut published = model(vec![curve]);
            published.chain = text.to_owned();
            let machine = VolumetricModel::new(&kinematics, &published).unwrap();
            let grid = Grid::new(base, -250.0, 50.0, 11, (-250.0, 250.0)).unwrap();
            for direction in Axis::LINEAR {
                if !CrossErrors::acts(component, base, direction) {
                    continue;
                }
                let what = Unestimable::Refuse;
                let table =
                    CrossErrors::sample(&published, &[component], direction, &grid, what).unwrap();
                for (at, error) in table.position().iter().zip(table.error()) {
                    let mut pose = PerAxis::default();
                    pose[base] = *at;
                    let tip = machine.tip_error_mm(&pose, &Vector3::zeros()).unwrap();
                    let apart_mm = (tip[direction.index()] - error).abs();
                    // A squareness turns the whole way: less than its square times the way is between both.
                    let second_order_mm = SMALL_RAD * SMALL_RAD * at.abs();
                    assert!(
                        apart_mm <= second_order_mm + 1e-15,
                        "{text} {component} at {at}: {error} {tip}"
                    );
                }
                n += 1;
            }
        }
    }
    // Nine shifts and one effect of each squareness.
    assert_eq!(n, 3 * (9 + 3));
}
