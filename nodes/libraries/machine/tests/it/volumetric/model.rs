//! All components together, against the product of bodies, closed forms and bad input.

use std::f64::consts::PI;

use machine::volumetric::{
    PoseRefusal, VolumetricModel, components_of, has_component, sensitivity,
};
use machine::{Kinematics, TableSense};
use metrology::drift::Extrapolate;
use metrology::sample::{CurveForm, ErrorCurve, GeometryModel};
use metrology::{Axis, ErrorComponent, PerAxis};
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::volumetric::bodies::Bodies;
use crate::volumetric::{CHAINS, machine, model};

const LINEAR_SPAN_MM: f64 = 300.0;
const ROTARY_SPAN_RAD: f64 = 2.0;

pub fn half_span(axis: Axis) -> f64 {
    if axis.is_linear() {
        LINEAR_SPAN_MM
    } else {
        ROTARY_SPAN_RAD
    }
}

pub fn constant(name: &str, value: f64) -> ErrorCurve {
    ErrorCurve {
        component: name.parse().unwrap(),
        form: CurveForm::Constant,
        origin: 0.0,
        power: Vec::new(),
        position: Vec::new(),
        coefficient: vec![value],
        standard_uncertainty: vec![f64::NAN],
        estimable: vec![true],
        span: (f64::NAN, f64::NAN),
    }
}

/// A cubic without constant or a table whose values reach `size_mm` or `size_rad` at the ends.
pub fn random_curve(component: ErrorComponent, size: f64, rng: &mut Pcg64Mcg) -> ErrorCurve {
    let mut curve = constant(&component.to_string(), rng.random_range(-size..size));
    if component.is_location {
        return curve;
    }
    let half = half_span(component.of);
    curve.span = (-half, half);
    if rng.random_bool(0.2) {
        curve.form = CurveForm::Table;
        curve.position = (0..9).map(|k| half * (f64::from(k) / 4.0 - 1.0)).collect();
        curve.coefficient = (0..9).map(|_| rng.random_range(-size..size)).collect();
    } else {
        curve.form = CurveForm::Polynomial;
        curve.origin = if rng.random_bool(0.2) {
            half / 10.0
        } else {
            0.0
        };
        curve.power = vec![1, 2, 3];
        let scaled = |power| rng.random_range(-size..size) / (3.0 * half.powi(power));
        curve.coefficient = [1, 2, 3].map(scaled).to_vec();
    }
    curve
}

/// A machine with every component: shifts up to `size_mm`, turns up to `size_rad`.
pub fn random_model(
    kinematics: &Kinematics,
    size_mm: f64,
    size_rad: f64,
    rng: &mut Pcg64Mcg,
) -> GeometryModel {
    let chain = kinematics.chain();
    let zero_positions = Axis::ROTARY.map(|axis| ErrorComponent::location(axis, axis));
    let mut all = components_of(chain);
    all.extend(zero_positions);
    all.sort();
    all.dedup();
    let curves = all
        .into_iter()
        .filter(|c| has_component(chain, *c))
        .map(|component| {
            let size = if component.is_angular() {
                size_rad
            } else {
                size_mm
            };
            random_curve(component, size, rng)
        });
    model(&chain.to_string(), curves.collect())
}

pub fn random_pose(rng: &mut Pcg64Mcg) -> (PerAxis<f64>, Vector3<f64>) {
    let positions = PerAxis::from_fn(|axis| rng.random_range(-half_span(axis)..half_span(axis)));
    (
        positions,
        Vector3::from_fn(|_, _| rng.random_range(-150.0..150.0)),
    )
}

fn values(
    model: &VolumetricModel,
    all: &GeometryModel,
    at: &PerAxis<f64>,
) -> Vec<(ErrorComponent, f64)> {
    let value = |curve: &ErrorCurve| {
        let component = curve.component;
        (
            component,
            model.component_value(component, at[component.of]).unwrap(),
        )
    };
    all.curves.iter().map(value).collect()
}

/// Shifts of 50 µm and turns of 100 µrad, and a machine that fell off a lorry: 2 mm and 0.05 rad.
#[test]
fn prop_the_walk_is_the_product_of_bodies() {
    let mut rng = Pcg64Mcg::seed_from_u64(23);
    let mut greatest = 0.0_f64;
    for chain in CHAINS {
        for (sense, size_mm, size_rad) in [
            (TableSense::Table, 0.05, 1e-4),
            (TableSense::Tool, 0.05, 1e-4),
            (TableSense::Table, 2.0, 0.05),
            // Below 30 µrad turns are cut short.
            (TableSense::Table, 0.01, 1e-5),
        ] {
            let kinematics = machine(chain).with_table_sense(sense);
            let published = random_model(&kinematics, size_mm, size_rad, &mut rng);
            let found = VolumetricModel::new(&kinematics, &published).unwrap();
            for _ in 0..20 {
                let (positions, tool) = random_pose(&mut rng);
                let values = values(&found, &published, &positions);
                let actual = Bodies {
                    kinematics: &kinematics,
                    values,
                }
                .tip(&positions, &tool);
                let nominal = Bodies {
                    kinematics: &kinematics,
                    values: Vec::new(),
                };
                let expected = actual - nominal.tip(&positions, &tool);
                let error = found.tip_error_mm(&positions, &tool).unwrap();
                greatest = greatest.max((error - expected).norm());
                assert!(
                    (error - expected).norm() < 1e-11,
                    "{chain}: {error} {expected}"
                );
            }
        }
    }
    eprintln!("walk and product of bodies apart by {greatest:e} mm at most");
}

#[test]
fn prop_the_first_order_is_off_by_the_second_order() {
    let mut greatest = [0.0_f64; 2];
    for (largest, size_mm) in greatest.iter_mut().zip([1e-3, 1e-2]) {
        let mut rng = Pcg64Mcg::seed_from_u64(29);
        for chain in CHAINS {
            let kinematics = machine(chain);
            let published = random_model(&kinematics, size_mm, size_mm * 1e-3, &mut rng);
            let found = VolumetricModel::new(&kinematics, &published).unwrap();
            for _ in 0..50 {
                let (positions, tool) = random_pose(&mut rng);
                let first: Vector3<f64> = values(&found, &published, &positions)
                    .into_iter()
                    .map(|(c, value)| sensitivity(&kinematics, &positions, &tool, c) * value)
                    .sum();
                let error = found.tip_error_mm(&positions, &tool).unwrap();
                *largest = largest.max((error - first).norm());
            }
        }
    }
    eprintln!("first order off by {greatest:?} mm for 1 and 10 µm, 1 and 10 µrad");
    // 1e-12 m for errors of 1e-6 m, a few times over for their number.
    assert!(greatest[0] > 0.0 && greatest[0] < 1e-8, "{greatest:?}");
    let growth = greatest[1] / greatest[0];
    assert!((growth - 100.0).abs() < 1.0, "{growth}");
}

/// Law of cosines: the tool's path is a parallelogram whose angle is 90 degrees and the squareness.
#[test]
fn val_law_of_cosines_gives_the_diagonals_of_a_crooked_square() {
    let (side_mm, squareness_rad) = (200.0_f64, 1e-3_f64);
    for chain in ["[w X' Y' b Z t]", "[w b X Y Z t]", "[w Y' b X Z t]"] {
        let kinematics = machine(chain);
        let published = model(chain, vec![constant("EC0Y", squareness_rad)]);
        let found = VolumetricModel::new(&kinematics, &published).unwrap();
        let corner = |x, y| {
            let at = PerAxis([x, y, 0.0, 0.0, 0.0, 0.0]);
            let tip = Vector3::new(x, y, 0.0);
            tip + found.tip_error_mm(&at, &Vector3::zeros()).unwrap()
        };
        let rising = (corner(side_mm, side_mm) - corner(0.0, 0.0)).norm();
        let falling = (corner(0.0, side_mm) - corner(side_mm, 0.0)).norm();
        let length = |angle: f64| side_mm * (2.0 * (1.0 - angle.cos())).sqrt();
        assert!((rising - length(PI / 2.0 - squareness_rad)).abs() < 1e-12);
        assert!((falling - length(PI / 2.0 + squareness_rad)).abs() < 1e-12);
        assert!(falling > rising, "+Y leans towards -X");
    }
}

/// The radial trace of squareness has amplitude R phi / 2 in sin 2 theta; that of the scales R a / 2.
#[test]
fn val_the_radial_trace_has_the_harmonics_of_its_formula() {
    let radius_mm = 50.0;
    let chain = "[w X' Y' b Z t]";
    let (phi, a, d) = (2e-5, 3e-5, -1e-5);
    let scale = |name: &str, slope| ErrorCurve {
        form: CurveForm::Polynomial,
        power: vec![1],
        span: (-100.0, 100.0),
        ..constant(name, slope)
    };
    let curves = vec![
        constant("EC0Y", phi),
        scale("EXX", a),
        scale("EYY", d),
        scale("ECX", 1e-4),
    ];
    let found = VolumetricModel::new(&machine(chain), &model(chain, curves)).unwrap();
    for k in 0..360 {
        let theta = f64::from(k) * PI / 180.0;
        let (x, y) = (radius_mm * theta.cos(), radius_mm * theta.sin());
        let at = PerAxis([x, y, 0.0, 0.0, 0.0, 0.0]);
        let c = found.tip_error_mm(&at, &Vector3::zeros()).unwrap();
        let radial = (x * c.x + y * c.y) / radius_mm;
        // X yaw of 5 mrad at the rim leaves no trace in first order.
        let second_order = radius_mm * (1e-4_f64 * x).powi(2);
        let expected = radius_mm
            * ((a + d) / 2.0 + (a - d) / 2.0 * (2.0 * theta).cos()
                - phi / 2.0 * (2.0 * theta).sin());
        assert!(
            (radial - expected).abs() <= second_order + 1e-7,
            "at {k} degrees"
        );
    }
}

/// A ball followed round a displaced table is seen on a circle through its place at zero.
#[test]
fn val_a_displaced_table_carries_the_ball_round_a_circle() {
    let chain = "[w C' A' Y' b X Z t]";
    let kinematics = machine(chain);
    let (ex, ey) = (0.012, -0.005);
    let curves = vec![constant("EX0C", ex), constant("EY0C", ey)];
    let found = VolumetricModel::new(&kinematics, &model(chain, curves)).unwrap();
    for k in 0..24 {
        let c_rad = f64::from(k) * PI / 12.0;
        let (sin, cos) = c_rad.sin_cos();
        let at = PerAxis([120.0, -35.0, 60.0, 0.0, 0.0, c_rad]);
        let error = found
            .tip_error_mm(&at, &Vector3::new(0.0, 0.0, -100.0))
            .unwrap();
        let expected = Vector3::new(ex - (cos * ex + sin * ey), ey - (cos * ey - sin * ex), 0.0);
        assert!((error - expected).norm() < 1e-12, "{error}");
    }
}

#[test]
fn a_table_that_runs_too_far_leaves_the_tool_too_far_the_other_way() {
    // Commanded X + 10, the table's body has to run to -10 and runs to -10.001: the tool now stands
    // over the workpiece's X = 10.001.
    let chain = "[w X' Y' b Z t]";
    let body_mm = -10.001;
    let at = PerAxis([10.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let over_workpiece_mm = 0.0 - body_mm;
    let found = VolumetricModel::new(
        &machine(chain),
        &model(
            chain,
            vec![constant("EXX", over_workpiece_mm - at[Axis::X])],
        ),
    );
    let found = found.unwrap();
    let error = found.tip_error_mm(&at, &Vector3::zeros()).unwrap();
    assert!((error.x - 0.001).abs() < 1e-12 && error.x > 0.0);
    let offset = found.command_offset(&at, &Vector3::zeros()).unwrap();
    assert!(
        (offset[Axis::X] + 0.001).abs() < 1e-12,
        "the command must be taken back"
    );
}

#[test]
fn models_of_linear_and_rotary_axes_are_merged() {
    let chain = "[w C' A' Y' b X Z t]";
    let kinematics = machine(chain);
    let linear = model(chain, vec![constant("EC0Y", 1e-5)]);
    let rotary = model(chain, vec![constant("EX0C", 0.01)]);
    let all = VolumetricModel::merged(&kinematics, &[&linear, &rotary]).unwrap();
    let value = |name: &str| all.component_value(name.parse().unwrap(), 0.0);
    assert_eq!(
        (value("EC0Y"), value("EX0C"), value("EY0C")),
        (Some(1e-5), Some(0.01), None)
    );
    let twice = VolumetricModel::merged(&kinematics, &[&linear, &linear]);
    assert_eq!(twice.unwrap_err().to_string(), "EC0Y is given twice");
    let none = VolumetricModel::merged(&kinematics, &[]).unwrap();
    let at = PerAxis([1.0, 2.0, 3.0, 0.4, 0.0, 0.6]);
    assert_eq!(
        none.tip_error_mm(&at, &Vector3::zeros()),
        Ok(Vector3::zeros())
    );
}

#[test]
fn a_model_of_another_machine_is_refused_by_name() {
    let message = |chain: &str, curves| {
        let published = model(chain, curves);
        VolumetricModel::new(&machine("[w X' Y' b Z t]"), &published)
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        message("[w Y' X' b Z t]", Vec::new()),
        "geometry model is of a machine [w Y' X' b Z t], this one is [w X' Y' b Z t]"
    );
    assert!(message("[w X Y' b Z t]", Vec::new()).contains("column 4, \"X\""));
    let ours = "[w X' Y' b Z t]";
    assert_eq!(
        message(ours, vec![constant("EX0C", 1.0)]),
        "EX0C: chain [w X' Y' b Z t] has no axis C"
    );
    assert_eq!(
        message(ours, vec![constant("EC0X", 1.0)]),
        "EC0X: chain [w X' Y' b Z t] has no such location error"
    );
    assert!(message(ours, vec![constant("EXX", f64::NAN)]).contains("EXX: coefficient[0] = NaN"));
    // The name of a spindle makes no other machine.
    let with_spindle = model("[w X' Y' b Z (C1) t]", Vec::new());
    assert!(VolumetricModel::new(&machine(ours), &with_spindle).is_ok());
}

#[test]
fn poses_outside_have_defined_answers() {
    let chain = "[w X' Y' b Z t]";
    let cubic = ErrorCurve {
        form: CurveForm::Polynomial,
        power: vec![2],
        span: (-100.0, 100.0),
        ..constant("EXX", 1e-6)
    };
    let refusing = VolumetricModel::new(&machine(chain), &model(chain, vec![cubic])).unwrap();
    let error = |model: &VolumetricModel, x: f64, tool: Vector3<f64>| {
        model
            .tip_error_mm(&PerAxis([x, 0.0, 0.0, f64::NAN, 0.0, 0.0]), &tool)
            .map(|e| e.x)
    };
    let none = Vector3::zeros();
    assert!((error(&refusing, 100.0, none).unwrap() - 0.01).abs() < 1e-13);
    let out = PoseRefusal::OutOfSpan {
        axis: Axis::X,
        position: 100.5,
        lower: -100.0,
        upper: 100.0,
    };
    assert_eq!(error(&refusing, 100.5, none), Err(out));
    let hold = refusing.clone().with_extrapolate(Extrapolate::Hold);
    assert!((error(&hold, 150.0, none).unwrap() - 0.01).abs() < 1e-13);
    let linear = refusing.with_extrapolate(Extrapolate::Linear);
    assert!((error(&linear, 150.0, none).unwrap() - 0.02).abs() < 1e-13);
    for x in [f64::NAN, f64::INFINITY] {
        let expected = Err(PoseRefusal::PositionNotFinite { axis: Axis::X });
        assert_eq!(error(&linear, x, none), expected);
    }
    let expected = Err(PoseRefusal::ToolOffsetNotFinite { axis: Axis::Z });
    assert_eq!(
        error(&linear, 0.0, Vector3::new(0.0, 0.0, f64::NAN)),
        expected
    );
}
