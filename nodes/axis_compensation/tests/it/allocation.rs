//! The servo tick allocates nothing.

use axis_compensation::geometric::GeometrySource;
use axis_compensation::{AxisCompensationConfig, AxisCompensationStage, Input, Output};
use metrology::drift::{Extrapolate, drift_at};
use metrology::sample::{
    AxisDrift, AxisState, CurveForm, DriftGrowth, ErrorCurve, GeometryModel, ThermalModel,
};
use metrology::{Axis, AxisSet, ErrorComponent, PerAxis, Stage, Stamp};
use nalgebra::{DMatrix, Vector3};

fn model() -> ThermalModel {
    let mut axes = PerAxis::default();
    for axis in Axis::LINEAR {
        axes[axis] = Some(AxisDrift {
            k0_mm: 0.01,
            slope_mm_per_mm: 5e-5,
            span_mm: (-220.0, 220.0),
            growth: Axis::LINEAR.map(|source| {
                (source == axis).then_some(DriftGrowth {
                    rate_mm_s: 1e-6,
                    gradient_rate_per_s: Vector3::from_fn(|row, _| {
                        if row == axis.index() { 1e-9 } else { 0.0 }
                    }),
                    time_constant_s: 1800.0,
                })
            }),
            ..AxisDrift::default()
        });
    }
    ThermalModel {
        at: Stamp::from_nanos(0),
        axes,
        valid_from: Stamp::from_nanos(0),
        valid_until: Stamp::from_nanos(i64::MAX),
        n_blocks: 2,
        lack_of_fit_p: f64::NAN,
        quarantined: false,
        sequence: 1,
    }
}

/// Every component of a table-table machine: cubics, tables, constants.
fn geometry(source: GeometrySource) -> Input {
    let chain = "[w C' A' Y' b X Z t]";
    let wanted =
        |component: &ErrorComponent| component.of.is_linear() == (source == GeometrySource::Linear);
    let all = machine::volumetric::components_of(&chain.parse().expect("a chain"));
    let curves = all.into_iter().filter(wanted).map(|component| {
        let mut curve = ErrorCurve {
            component,
            form: CurveForm::Polynomial,
            origin: 0.0,
            power: vec![1, 2, 3],
            position: Vec::new(),
            coefficient: vec![3e-8, 1e-10, -3e-13],
            standard_uncertainty: Vec::new(),
            estimable: Vec::new(),
            span: (-400.0, 400.0),
        };
        if component.is_location {
            curve.form = CurveForm::Constant;
            curve.power = Vec::new();
            curve.coefficient = vec![1e-5];
        } else if component.direction == Axis::Z {
            curve.form = CurveForm::Table;
            curve.power = Vec::new();
            curve.position = vec![-400.0, 0.0, 400.0];
        }
        curve
    });
    let model = GeometryModel {
        at: Stamp::from_nanos(0),
        chain: chain.to_owned(),
        curves: curves.collect(),
        covariance: DMatrix::zeros(0, 0),
        combinations: Vec::new(),
        n_samples: 0,
        n_unknowns: 0,
        rank: 0,
        residual_standard_deviation_mm: 0.0,
        sequence: 1,
    };
    Input::Geometry(source, Box::new(model))
}

/// Both readings; X passes points slowly enough to refresh its table.
const POSITIONING: &str = "\
    X: {reading: refreshed_table, weight: 0.3, directions: apart, thermal_part: true, \
        measured_limit_um: 50.0, measuring_feed_limit_mm_min: 60000.0, \
        start_points_mm: [-50.0, -40.0, -30.0, -20.0, -10.0, 0.0], \
        start_deviations_um: [0.0, 1.0, 2.0, 3.0, 3.0, 10.0]}, \
    Y: {reading: weighted_increments, weight: 0.2, directions: together, thermal_part: true, \
        measured_limit_um: 50.0, measuring_feed_limit_mm_min: 60000.0, loop_cycle_s: 0.002, \
        start_points_mm: [-40.0, -20.0, 0.0, 20.0, 40.0], start_deviations_um: [0.0, 5.0, -2.0, 3.0, 3.0]}";

#[test]
fn a_thousand_ticks_allocate_nothing() {
    let machine = include_str!("../../../../launch_configs/first_run/machine.yaml");
    let limits =
        "size_limit_um: 100.0, rate_limit_um_per_s: 50.0, acceleration_limit_um_per_s2: 500.0";
    let config: AxisCompensationConfig = serde_saphyr::from_str(&format!(
        "{{axes: {{X: {{{limits}}}, Y: {{{limits}}}, Z: {{{limits}}}}}, extrapolate: linear, \
         physical_rate_um_per_min: 3.0, jump_margin_um: 2.0, expanded_uncertainty_limit_um: 1000.0, hold_s: 1.0, fade_s: 2.0, positioning: {{{POSITIONING}}}, \
         geometry: {{tool_offset_mm: [0.0, 0.0, -100.0], jump_limit_um: 20.0}}}}"
    ))
    .unwrap();
    let mut stage =
        AxisCompensationStage::new(&config, &serde_saphyr::from_str(machine).unwrap()).unwrap();
    let mut out = Vec::with_capacity(64);
    for source in [GeometrySource::Linear, GeometrySource::Rotary] {
        stage
            .step(Stamp::from_nanos(0), geometry(source), &mut out)
            .unwrap();
    }
    stage
        .step(
            Stamp::from_nanos(0),
            Input::Model(Box::new(model())),
            &mut out,
        )
        .unwrap();
    let measured = allocation_counter::measure(|| {
        for k in 0..1000_i64 {
            out.clear();
            let mut commanded = PerAxis::default();
            commanded[Axis::X] = k as f64 * 0.3 - 150.0;
            commanded[Axis::A] = -0.3;
            commanded[Axis::C] = k as f64 * 1e-3;
            let state = AxisState {
                scale: PerAxis::from_fn(|axis| commanded[axis] + 2e-3),
                ..AxisState::standing(
                    Stamp::from_nanos(k * 1_000_000),
                    Stamp::from_nanos(k * 1_000_000),
                    AxisSet::XYZ.with(Axis::A).with(Axis::C),
                    commanded,
                )
            };
            stage
                .step(
                    Stamp::from_nanos(k * 1_000_000),
                    Input::State(state),
                    &mut out,
                )
                .unwrap();
        }
    });
    assert_eq!(measured.count_total, 0);
    let worked = |output: &Output| matches!(output, Output::Compensation(c) if c.geometric[Axis::Y].abs() > 1e-6);
    assert!(out.iter().any(worked), "{out:?}");
    // The table of X was refreshed meanwhile: a tick of the host now publishes it anew.
    out.clear();
    stage
        .step(Stamp::from_nanos(1_000_000_000), Input::Tick, &mut out)
        .unwrap();
    let refreshed = |output: &Output| matches!(output, Output::Table(table) if table.axis == Axis::X && table.sequence == 6);
    assert!(out.iter().any(refreshed), "{out:?}");
}

#[test]
fn evaluating_a_model_allocates_nothing() {
    let model = model();
    let mut sum_mm = 0.0;
    let measured = allocation_counter::measure(|| {
        let p_mm = Vector3::new(1.0, 2.0, 3.0);
        let drifts_mm = drift_at(&model, &p_mm, Stamp::from_nanos(1), Extrapolate::Linear);
        for drift_mm in drifts_mm {
            sum_mm += drift_mm.unwrap_or(f64::NAN);
        }
    });
    assert_eq!(measured.count_total, 0);
    assert!(sum_mm.is_finite());
    // The counter itself is seen counting.
    assert!(
        allocation_counter::measure(|| drop(std::hint::black_box(vec![1_u8; 10]))).count_total > 0
    );
}
