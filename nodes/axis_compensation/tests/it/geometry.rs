//! The geometric part through the whole stage: sums, gates, policies and refusals.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::f64::consts::FRAC_PI_2;

use axis_compensation::geometric::GeometrySource;
use axis_compensation::{AxisCompensationConfig, AxisCompensationStage, Diagnostic, Input, Output};
use machine::MachineFile;
use metrology::sample::{
    AxisCompensation, AxisDrift, AxisState, CompensationState, CurveForm, ErrorCurve,
    GeometryModel, ThermalModel,
};
use metrology::stamp::Span;
use metrology::{Axis, AxisSet, PerAxis, Stage, Stamp};
use nalgebra::DMatrix;

const CHAIN: &str = "[w C' A' Y' b X Z t]";
const MACHINE: &str = include_str!("../../../libraries/machine/tests/data/bench.yaml");
const GEOMETRY: &str = "geometry: {tool_offset_mm: [0.0, 0.0, -100.0], jump_limit_um: 20.0}";

struct Scene {
    stage: AxisCompensationStage,
    axes: AxisSet,
    nanos: i64,
    diagnostics: Vec<Diagnostic>,
    last: Option<AxisCompensation>,
}

fn config(rest: &str) -> AxisCompensationConfig {
    let limits =
        "size_limit_um: 100.0, rate_limit_um_per_s: 50.0, acceleration_limit_um_per_s2: 500.0";
    serde_saphyr::from_str(&format!(
        "{{axes: {{X: {{{limits}}}, Y: {{{limits}}}, Z: {{{limits}}}}}, \
         physical_rate_um_per_min: 3.0, jump_margin_um: 2.0, expanded_uncertainty_limit_um: 1000.0, hold_s: 1.0, fade_s: 2.0, {rest}}}"
    ))
    .unwrap()
}

fn machine() -> MachineFile {
    MachineFile::parse(MACHINE, "bench.yaml").unwrap()
}

impl Scene {
    fn new(extrapolate: &str, geometry: &str) -> Self {
        let config = config(&format!("extrapolate: {extrapolate}, {geometry}"));
        Self {
            stage: AxisCompensationStage::new(&config, &machine()).unwrap(),
            axes: AxisSet::XYZ.with(Axis::A).with(Axis::C),
            nanos: 0,
            diagnostics: Vec::new(),
            last: None,
        }
    }

    fn step(&mut self, input: Input) {
        let mut out = Vec::new();
        let at = Stamp::from_nanos(self.nanos);
        self.stage.step(at, input, &mut out).unwrap();
        for output in out {
            match output {
                Output::Compensation(c) => self.last = Some(c),
                Output::Diagnostic(d) => self.diagnostics.push(d),
                Output::Table(_) | Output::AtRest | Output::FadedOut => {}
            }
        }
    }

    fn run(&mut self, seconds: f64, commanded: [f64; 6]) {
        for _ in 0..(seconds * 1e3).round() as i64 {
            self.nanos += 1_000_000;
            let commanded = PerAxis(commanded);
            self.step(Input::State(AxisState {
                scale: commanded,
                ..AxisState::standing(
                    Stamp::from_nanos(self.nanos),
                    Stamp::from_nanos(self.nanos),
                    self.axes,
                    commanded,
                )
            }));
        }
    }

    fn offer(&mut self, source: GeometrySource, sequence: u32, curves: Vec<ErrorCurve>) {
        let model = GeometryModel {
            at: Stamp::from_nanos(self.nanos),
            chain: CHAIN.to_owned(),
            curves,
            covariance: DMatrix::zeros(0, 0),
            combinations: Vec::new(),
            n_samples: 100,
            n_unknowns: 1,
            rank: 1,
            residual_standard_deviation_mm: 1e-4,
            sequence,
        };
        self.step(Input::Geometry(source, Box::new(model)));
    }

    fn assert_total(&self, axis: Axis, offset_mm: f64) {
        let last = self.last.unwrap();
        let total_mm = last.total[axis];
        assert!(
            (total_mm - offset_mm).abs() < 1e-9,
            "{axis} {total_mm} {offset_mm}"
        );
    }

    fn said(&self, wanted: &str) -> bool {
        self.diagnostics
            .iter()
            .any(|d| d.to_string().contains(wanted))
    }
}

fn constant(name: &str, value: f64) -> ErrorCurve {
    ErrorCurve {
        component: name.parse().unwrap(),
        form: CurveForm::Constant,
        origin: 0.0,
        power: Vec::new(),
        position: Vec::new(),
        coefficient: vec![value],
        standard_uncertainty: vec![f64::NAN],
        estimable: vec![true],
        span: (0.0, 0.0),
    }
}

fn line(name: &str, slope: f64, half_span: f64) -> ErrorCurve {
    ErrorCurve {
        form: CurveForm::Polynomial,
        power: vec![1],
        span: (-half_span, half_span),
        ..constant(name, slope)
    }
}

fn thermal(scene: &mut Scene, k0_mm: f64) {
    let at = Stamp::from_nanos(scene.nanos);
    let drift = AxisDrift {
        k0_mm,
        span_mm: (-220.0, 220.0),
        ..AxisDrift::default()
    };
    let mut axes = PerAxis::default();
    axes[Axis::X] = Some(drift);
    scene.step(Input::Model(Box::new(ThermalModel {
        at,
        axes,
        valid_from: at,
        valid_until: at + Span::from_secs_f64(1e6),
        n_blocks: 2,
        lack_of_fit_p: f64::NAN,
        quarantined: false,
        sequence: 1,
    })));
}

#[test]
fn eq1_the_offset_takes_the_error_back_beside_the_thermal_part() {
    let mut scene = Scene::new("linear", GEOMETRY);
    scene.offer(
        GeometrySource::Linear,
        1,
        vec![line("EXX", 1e-4, 300.0), line("EBZ", 1e-7, 300.0)],
    );
    let pose = [200.0, 0.0, 150.0, 0.0, 0.0, 0.0];
    scene.run(3.0, pose);
    // EXX = 20 µm; the head nods by 15 µrad about +Y, 100 mm above the tip: -1.5 µm.
    scene.assert_total(Axis::X, -0.0185);
    assert_eq!(
        scene.last.unwrap().state[Axis::X],
        CompensationState::Active
    );
    thermal(&mut scene, 0.004);
    scene.run(3.0, pose);
    let last = scene.last.unwrap();
    assert!((last.thermal[Axis::X] - 0.004).abs() < 1e-12);
    assert!((last.geometric[Axis::X] + 0.0185).abs() < 1e-8);
    assert!((last.total[Axis::X] + 0.0145).abs() < 1e-8);
    // No thermal model of Y and Z was ever heard: they have the geometric part alone.
    assert_eq!(last.state[Axis::Y], CompensationState::Active);
}

#[test]
fn a_turned_table_is_followed_by_the_linear_axes() {
    let mut scene = Scene::new("linear", GEOMETRY);
    scene.offer(GeometrySource::Linear, 1, vec![constant("EC0Y", 1e-5)]);
    scene.offer(GeometrySource::Rotary, 1, vec![constant("EX0C", 0.010)]);
    assert!(scene.said("rotary geometry model 1 is used"));
    scene.run(2.0, [0.0; 6]);
    scene.assert_total(Axis::X, 0.0);
    // (R - 1) e at a quarter turn is (-10, +10) µm in machine directions, to be taken back.
    scene.run(3.0, [0.0, 0.0, 0.0, 0.0, 0.0, FRAC_PI_2]);
    scene.assert_total(Axis::X, 0.010);
    scene.assert_total(Axis::Y, -0.010);
}

#[test]
fn a_jump_is_kept_back_until_a_second_measurement_agrees() {
    let mut scene = Scene::new("linear", GEOMETRY);
    scene.offer(GeometrySource::Linear, 1, vec![constant("EXX", 0.010)]);
    scene.run(2.0, [0.0; 6]);
    scene.offer(GeometrySource::Linear, 2, vec![constant("EXX", 0.040)]);
    scene.run(2.0, [0.0; 6]);
    assert!(scene.said("changes the tip's error by 0.030000 mm, 0.02 mm are allowed"));
    scene.assert_total(Axis::X, -0.010);
    scene.offer(GeometrySource::Linear, 3, vec![constant("EXX", 0.041)]);
    scene.run(2.0, [0.0; 6]);
    assert!(scene.said("geometry model 3 confirms the change"));
    scene.assert_total(Axis::X, -0.041);
}

#[test]
fn a_refused_model_leaves_the_one_before() {
    let mut scene = Scene::new("linear", GEOMETRY);
    scene.offer(GeometrySource::Linear, 1, vec![constant("EXX", 0.010)]);
    scene.offer(GeometrySource::Linear, 2, vec![constant("EXX", f64::NAN)]);
    assert!(scene.said("geometry model 2 is refused: EXX: coefficient[0] = NaN"));
    scene.offer(GeometrySource::Linear, 3, vec![constant("EXB", 0.0)]);
    assert!(scene.said("EXB: chain [w C' A' Y' b X Z t] has no axis B"));
    scene.run(2.0, [0.0; 6]);
    scene.assert_total(Axis::X, -0.010);
}

#[test]
fn positions_outside_the_recorded_span_follow_the_policy() {
    let offset = |policy| {
        let mut scene = Scene::new(policy, GEOMETRY);
        scene.offer(GeometrySource::Linear, 1, vec![line("EXX", 1e-4, 100.0)]);
        scene.run(2.0, [100.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        scene.assert_total(Axis::X, -0.010);
        scene.run(0.9, [150.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        scene
    };
    offset("hold").assert_total(Axis::X, -0.010);
    offset("linear").assert_total(Axis::X, -0.015);
    let mut refused = offset("refuse");
    refused.assert_total(Axis::X, -0.010);
    assert_eq!(
        refused.last.unwrap().state[Axis::X],
        CompensationState::Holding
    );
    assert!(
        refused.said("position 150 mm of axis X is outside the recorded span -100 mm to 100 mm")
    );
    refused.run(4.0, [150.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    refused.assert_total(Axis::X, 0.0);
}

#[test]
fn a_position_that_is_none_is_held_and_a_missing_axis_too() {
    let mut scene = Scene::new("linear", GEOMETRY);
    scene.offer(GeometrySource::Linear, 1, vec![constant("EXX", 0.010)]);
    scene.run(2.0, [0.0; 6]);
    scene.run(0.1, [0.0, 0.0, 0.0, 0.0, 0.0, f64::NAN]);
    assert!(scene.said("position of axis C is not a finite number"));
    assert_eq!(
        scene.last.unwrap().state[Axis::X],
        CompensationState::Holding
    );
    scene.assert_total(Axis::X, -0.010);
    scene.run(0.1, [0.0; 6]);
    scene.axes = AxisSet::XYZ;
    scene.run(0.1, [0.0; 6]);
    assert_eq!(
        scene.last.unwrap().state[Axis::X],
        CompensationState::Holding
    );
}

#[test]
fn an_offset_that_is_no_number_is_refused_and_the_last_one_held() {
    let mut scene = Scene::new("linear", GEOMETRY);
    scene.offer(GeometrySource::Linear, 1, vec![constant("EXX", 0.010)]);
    scene.offer(GeometrySource::Rotary, 1, vec![line("ECC", 1e-6, 6.3)]);
    scene.run(2.0, [0.0; 6]);
    scene.assert_total(Axis::X, -0.010);
    // Continued so far, ECC is a turn of 1e294 rad.
    scene.run(0.1, [0.0, 0.0, 0.0, 0.0, 0.0, 1e300]);
    assert!(scene.said("offset of axis X that is not a finite number"));
    let last = scene.last.unwrap();
    assert_eq!(last.state[Axis::X], CompensationState::Holding);
    assert!(last.geometric[Axis::X].is_finite());
    scene.assert_total(Axis::X, -0.010);
    scene.run(4.0, [0.0, 0.0, 0.0, 0.0, 0.0, 1e300]);
    scene.assert_total(Axis::X, 0.0);
}

#[test]
fn without_the_parameters_a_model_is_not_used_and_that_is_said() {
    let mut scene = Scene::new("linear", "");
    scene.offer(GeometrySource::Linear, 1, vec![constant("EXX", 0.010)]);
    assert!(scene.said("geometry model 1 is not used: the parameters have no `geometry`"));
    scene.run(1.0, [0.0; 6]);
    assert_eq!(scene.last.unwrap().state[Axis::X], CompensationState::Off);
}

#[test]
fn parameters_outside_their_limits_are_refused_by_name() {
    let message = |geometry: &str| {
        let config = config(&format!("extrapolate: hold, geometry: {{{geometry}}}"));
        AxisCompensationStage::new(&config, &machine())
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        message("tool_offset_mm: [0.0, .nan, 0.0], jump_limit_um: 10.0"),
        "geometry.tool_offset_mm = NaN mm: must be from -2000 to 2000 mm"
    );
    assert_eq!(
        message("tool_offset_mm: [0.0, 0.0, 0.0], jump_limit_um: 0.0"),
        "geometry.jump_limit_um = 0 µm: must be from 0.01 to 5000 µm"
    );
}
