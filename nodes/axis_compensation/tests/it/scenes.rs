//! The safety rules, one scene each.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

use axis_compensation::parts::PartRefusal;
use axis_compensation::{AxisCompensationConfig, AxisCompensationStage, Diagnostic, Input, Output};
use metrology::drift::DriftRefusal;
use metrology::sample::{AxisCompensation, AxisDrift, AxisState, CompensationState, ThermalModel};
use metrology::stamp::Span;
use metrology::{Axis, AxisSet, PerAxis, Stage, Stamp};
use nalgebra::Matrix4;

const MILLISECOND: i64 = 1_000_000;

struct Scene {
    stage: AxisCompensationStage,
    nanos: i64,
    diagnostics: Vec<Diagnostic>,
    faded_out: bool,
    at_rest: bool,
    sequence: u32,
    /// Of the model's offset, mm².
    variance_mm2: f64,
    /// The last model told.
    told: Option<Input>,
    last: Option<AxisCompensation>,
}

impl Scene {
    fn new(extrapolate: &str) -> Self {
        Self::with(extrapolate, "fade_s: 2.0")
    }

    fn with(extrapolate: &str, rest: &str) -> Self {
        let machine = include_str!("../../../../launch_configs/first_run/machine.yaml");
        let limits =
            "size_limit_um: 100.0, rate_limit_um_per_s: 50.0, acceleration_limit_um_per_s2: 500.0";
        let config: AxisCompensationConfig = serde_saphyr::from_str(&format!(
            "{{axes: {{X: {{{limits}}}, Z: {{{limits}}}}}, extrapolate: {extrapolate}, \
             physical_rate_um_per_min: 3.0, jump_margin_um: 2.0, expanded_uncertainty_limit_um: 1000.0, \
             hold_s: 1.0, {rest}}}"
        ))
        .unwrap();
        Self {
            stage: AxisCompensationStage::new(&config, &serde_saphyr::from_str(machine).unwrap())
                .unwrap(),
            nanos: 0,
            diagnostics: Vec::new(),
            faded_out: false,
            at_rest: false,
            sequence: 0,
            variance_mm2: 0.0,
            told: None,
            last: None,
        }
    }

    fn step(&mut self, input: Input) {
        let mut out = Vec::new();
        self.stage
            .step(Stamp::from_nanos(self.nanos), input, &mut out)
            .unwrap();
        for output in out {
            match output {
                Output::Compensation(c) => self.last = Some(c),
                Output::Diagnostic(d) => self.diagnostics.push(d),
                Output::FadedOut => self.faded_out = true,
                Output::AtRest => self.at_rest = true,
                Output::Table(_) => {}
            }
        }
    }

    fn state(&mut self, x_mm: f64) {
        let mut commanded = PerAxis::default();
        commanded[Axis::X] = x_mm;
        let state = AxisState {
            scale: commanded,
            ..AxisState::standing(
                Stamp::from_nanos(self.nanos),
                Stamp::from_nanos(self.nanos),
                AxisSet::XYZ,
                commanded,
            )
        };
        self.step(Input::State(state));
    }

    fn run(&mut self, seconds: f64, x_mm: f64) {
        for _ in 0..(seconds * 1e3).round() as i64 {
            self.nanos += MILLISECOND;
            self.state(x_mm);
        }
    }

    fn model(&mut self, k0_mm: f64, slope: f64, life_s: f64) {
        self.sequence += 1;
        let mut covariance = Matrix4::zeros();
        covariance[(0, 0)] = self.variance_mm2;
        let drift = AxisDrift {
            k0_mm,
            covariance,
            slope_mm_per_mm: slope,
            span_mm: (-220.0, 220.0),
            measured_at: Stamp::from_nanos(self.nanos),
            ..AxisDrift::default()
        };
        let mut axes = PerAxis::default();
        axes[Axis::X] = Some(drift);
        let at = Stamp::from_nanos(self.nanos);
        let model = Input::Model(Box::new(ThermalModel {
            at,
            axes,
            valid_from: at,
            valid_until: at + Span::from_secs_f64(life_s),
            n_blocks: 2,
            lack_of_fit_p: f64::NAN,
            quarantined: false,
            sequence: self.sequence,
        }));
        self.told = Some(model.clone());
        self.step(model);
    }

    fn x(&self) -> (f64, CompensationState) {
        let last = self.last.as_ref().unwrap();
        (last.total[Axis::X], last.state[Axis::X])
    }

    fn assert_x(&self, offset_mm: f64, state: CompensationState) {
        assert!((self.x().0 - offset_mm).abs() < 1e-9, "{:?}", self.x());
        assert_eq!(self.x().1, state);
    }
}

#[test]
fn the_thermal_part_is_plus_d_at_the_commanded_position() {
    let mut scene = Scene::new("linear");
    scene.model(0.010, 5e-5, 1e6);
    scene.run(3.0, 200.0);
    scene.assert_x(0.020, CompensationState::Active);
    let last = scene.last.unwrap();
    assert!((last.thermal[Axis::X] - 0.020).abs() < 1e-12);
    let whole_mm = last.pulses[Axis::X] as f64 * 1e-4;
    assert!((whole_mm + last.remainder[Axis::X] - last.total[Axis::X]).abs() < 1e-12);
    assert!((last.pulses[Axis::X] - 200).abs() <= 1);
    // No block spoke about Z: nothing is added there.
    assert_eq!(last.state[Axis::Z], CompensationState::Off);
}

#[test]
fn a_stale_model_is_held_then_faded() {
    let mut scene = Scene::new("linear");
    scene.model(0.010, 0.0, 5.0);
    scene.run(5.0, 0.0);
    scene.run(0.5, 0.0);
    scene.assert_x(0.010, CompensationState::Holding);
    scene.run(1.5, 0.0);
    assert_eq!(scene.x().1, CompensationState::Fading);
    scene.run(2.0, 0.0);
    scene.assert_x(0.0, CompensationState::Off);
    let refused = |d: &Diagnostic| {
        matches!(
            d,
            Diagnostic::ModelRefused {
                axis: Axis::X,
                cause: PartRefusal::Thermal {
                    source: DriftRefusal::Expired { .. }
                }
            }
        )
    };
    assert_eq!(scene.diagnostics.iter().filter(|d| refused(d)).count(), 1);
}

#[test]
fn outside_the_span_a_refusing_policy_holds_and_inside_again_it_goes_on() {
    let mut scene = Scene::new("refuse");
    scene.model(0.010, 0.0, 1e6);
    scene.run(2.0, 0.0);
    scene.run(0.5, 300.0);
    scene.assert_x(0.010, CompensationState::Holding);
    scene.run(0.5, 100.0);
    scene.assert_x(0.010, CompensationState::Active);
}

#[test]
fn a_drift_used_beyond_the_blocks_is_said_once_where_the_extrapolation_matters() {
    let mut scene = Scene::new("hold");
    scene.variance_mm2 = 4e-6;
    scene.model(0.010, 5e-5, 1e6);
    // Held, the drift is wrong by 0.25 µm 5 mm beyond the block, where 4 µm are stated.
    for x_mm in [220.0, 225.0, -225.0, 250.0] {
        scene.run(0.2, x_mm);
    }
    assert!(!scene.diagnostics.iter().any(|d| d.condition() == "span_x"));
    for x_mm in [300.0, 0.0, 310.0, 0.0] {
        scene.run(0.1, x_mm);
    }
    let told: Vec<_> = scene
        .diagnostics
        .iter()
        .filter(|d| d.condition() == "span_x")
        .collect();
    let [
        Diagnostic::BeyondSpan {
            position_mm,
            expanded_uncertainty_mm,
            ..
        },
    ] = told[..]
    else {
        panic!("{told:?}");
    };
    assert!((*position_mm - 300.0).abs() < 1e-9, "{position_mm}");
    // u² = 4 µm² of the block and (0.05 µm/mm · 80 mm)² of the hold.
    assert!((expanded_uncertainty_mm - 2.0 * 20e-6_f64.sqrt()).abs() < 1e-9);
    // A whole cycle inside takes it back.
    for _ in 0..2 {
        scene.model(0.010, 5e-5, 1e6);
        scene.run(0.1, 0.0);
    }
    let within = Diagnostic::WithinSpan { axis: Axis::X };
    assert!(scene.diagnostics.contains(&within));
}

#[test]
fn an_axis_too_uncertain_at_the_travels_corners_holds_and_fades_with_value_and_limit() {
    let mut scene = Scene::new("linear");
    scene.model(0.010, 0.0, 1e6);
    scene.run(3.0, 0.0);
    scene.assert_x(0.010, CompensationState::Active);
    scene.variance_mm2 = 0.36;
    scene.model(0.010, 0.0, 1e6);
    scene.run(0.5, 0.0);
    scene.assert_x(0.010, CompensationState::Holding);
    let refused = DriftRefusal::TooUncertain {
        axis: Axis::X,
        expanded_uncertainty_mm: 1.2,
        limit_mm: 1.0,
    };
    assert!(scene.diagnostics.iter().any(|d| matches!(
        d,
        Diagnostic::ModelRefused { axis: Axis::X, cause: PartRefusal::Thermal { source } } if *source == refused
    )));
    scene.run(4.0, 0.0);
    scene.assert_x(0.0, CompensationState::Off);
    scene.variance_mm2 = 0.0;
    scene.model(0.010, 0.0, 1e6);
    scene.run(3.0, 0.0);
    scene.assert_x(0.010, CompensationState::Active);
}

#[test]
fn a_model_that_expired_or_is_older_than_the_one_in_use_is_history() {
    let mut scene = Scene::new("linear");
    scene.model(0.010, 0.0, 0.5);
    let latched = scene.told.clone();
    scene.run(1.0, 0.0);
    scene.step(latched.clone().unwrap());
    let expired = Diagnostic::ModelExpired {
        sequence: 1,
        late_s: 0.5,
    };
    assert_eq!(scene.diagnostics.last(), Some(&expired));
    scene.model(0.011, 0.0, 1e6);
    let Some(Input::Model(mut older)) = latched else {
        panic!("no model was told")
    };
    older.valid_until = Stamp::from_nanos(i64::MAX);
    scene.step(Input::Model(older));
    let older = Diagnostic::ModelOlder {
        sequence: 1,
        by_s: 1.0,
    };
    assert_eq!(scene.diagnostics.last(), Some(&older));
    scene.run(3.0, 0.0);
    scene.assert_x(0.011, CompensationState::Active);
}

#[test]
fn a_position_that_is_no_number_holds_and_is_reported_once() {
    let mut scene = Scene::new("linear");
    scene.model(0.010, 1e-5, 1e6);
    scene.run(2.0, 100.0);
    scene.run(0.3, f64::NAN);
    scene.assert_x(0.011, CompensationState::Holding);
    let nan = |d: &Diagnostic| {
        matches!(
            d,
            Diagnostic::ModelRefused {
                cause: PartRefusal::Thermal {
                    source: DriftRefusal::NotFinite { axis: Axis::X }
                },
                ..
            }
        )
    };
    assert_eq!(scene.diagnostics.iter().filter(|d| nan(d)).count(), 1);
}

#[test]
fn a_jump_between_models_waits_for_the_second() {
    let mut scene = Scene::new("linear");
    scene.model(0.010, 0.0, 1e6);
    scene.run(2.0, 0.0);
    scene.model(0.060, 0.0, 1e6);
    scene.run(3.0, 0.0);
    scene.assert_x(0.010, CompensationState::Active);
    scene.model(0.0601, 0.0, 1e6);
    scene.run(3.0, 0.0);
    scene.assert_x(0.0601, CompensationState::Active);
    assert!(
        scene
            .diagnostics
            .iter()
            .any(|d| matches!(d, Diagnostic::ModelQuarantined { .. }))
    );
    assert!(
        scene
            .diagnostics
            .contains(&Diagnostic::ModelConfirmed { sequence: 3 })
    );
}

#[test]
fn an_oversize_offset_is_not_cut_but_left_at_the_last_one_inside() {
    let mut scene = Scene::new("linear");
    scene.model(0.0, 4e-4, 1e6);
    scene.run(4.0, 200.0);
    scene.assert_x(0.080, CompensationState::Active);
    scene.run(1.0, 300.0);
    scene.assert_x(0.080, CompensationState::Limited);
    assert!(
        scene
            .diagnostics
            .iter()
            .any(|d| matches!(d, Diagnostic::SizeExceeded { axis: Axis::X, .. }))
    );
    scene.run(1.0, 200.0);
    assert!(
        scene
            .diagnostics
            .contains(&Diagnostic::SizeKept { axis: Axis::X })
    );
}

#[test]
fn ten_hertz_then_a_kilohertz_gives_the_same_place() {
    let mut scene = Scene::new("linear");
    scene.model(0.050, 0.0, 1e6);
    for _ in 0..50 {
        scene.nanos += 100 * MILLISECOND;
        scene.state(0.0);
    }
    scene.assert_x(0.050, CompensationState::Active);
    scene.run(1.0, 0.0);
    scene.assert_x(0.050, CompensationState::Active);
}

#[test]
fn after_a_gap_the_offset_stands_and_then_goes_on_without_a_jump() {
    let mut scene = Scene::new("linear");
    scene.model(0.050, 0.0, 1e6);
    scene.run(0.5, 0.0);
    let before = scene.x().0;
    scene.nanos += 10_000 * MILLISECOND;
    scene.step(Input::Tick);
    assert!(
        scene
            .diagnostics
            .iter()
            .any(|d| matches!(d, Diagnostic::StatesStale { .. }))
    );
    scene.state(0.0);
    scene.assert_x(before, CompensationState::Holding);
    scene.run(0.001, 0.0);
    assert!((scene.x().0 - before).abs() < 1e-6);
    scene.run(3.0, 0.0);
    scene.assert_x(0.050, CompensationState::Active);
}

#[test]
fn shutdown_fades_and_says_when_it_is_done() {
    let mut scene = Scene::new("linear");
    scene.model(0.050, 0.0, 1e6);
    scene.run(3.0, 0.0);
    scene.step(Input::Shutdown);
    assert!(!scene.faded_out);
    scene.run(1.0, 0.0);
    assert_eq!(scene.x().1, CompensationState::Fading);
    scene.run(2.5, 0.0);
    assert!(scene.faded_out && scene.x() == (0.0, CompensationState::Off));
}

#[test]
fn shutdown_is_quicker_than_a_long_fade_and_keeps_the_rate_limit() {
    let mut scene = Scene::with("linear", "fade_s: 30.0, shutdown_fade_s: 0.5");
    scene.model(0.050, 0.0, 1e6);
    scene.run(3.0, 0.0);
    scene.step(Input::Shutdown);
    let (mut before, mut fastest) = (scene.x().0, 0.0_f64);
    for _ in 0..1500 {
        scene.run(0.001, 0.0);
        fastest = fastest.max((scene.x().0 - before).abs() / 0.001);
        before = scene.x().0;
    }
    // 50 µm at 50 µm/s and a start and a stop at 500 µm/s²: 1.1 s.
    assert!(scene.faded_out, "{before} mm is left");
    assert!((0.049..0.050 + 1e-9).contains(&fastest), "{fastest} mm/s");
}

#[test]
fn the_longest_wind_down_holds_for_the_greatest_offset_and_states_that_end() {
    let config = "fade_s: 30.0, shutdown_fade_s: 0.5";
    for states_end in [false, true] {
        let mut scene = Scene::with("linear", config);
        scene.model(0.0999, 0.0, 1e6);
        scene.run(4.0, 0.0);
        scene.step(Input::Shutdown);
        let began = scene.nanos;
        scene.run(0.5, 0.0);
        while !scene.faded_out && scene.nanos - began < 60_000 * MILLISECOND {
            if states_end {
                scene.nanos += 10 * MILLISECOND;
                scene.step(Input::Tick);
            } else {
                scene.run(0.01, 0.0);
            }
        }
        let took_s = (scene.nanos - began) as f64 * 1e-9;
        // 100 µm at 50 µm/s, four starts and stops of 0.1 s, and gap_s.
        assert!(
            took_s <= 2.0 + 0.4 + 0.5,
            "states end: {states_end}: {took_s} s"
        );
    }
}

#[test]
fn shutdown_without_axis_states_fades_by_ticks() {
    let mut scene = Scene::new("linear");
    scene.model(0.050, 0.0, 1e6);
    scene.run(3.0, 0.0);
    scene.step(Input::Shutdown);
    for _ in 0..60 {
        scene.nanos += 100 * MILLISECOND;
        scene.step(Input::Tick);
    }
    assert!(scene.faded_out);
}

#[test]
fn a_stage_that_never_added_anything_may_stop_at_once() {
    let mut scene = Scene::new("linear");
    scene.step(Input::Shutdown);
    assert!(scene.faded_out);
}

#[test]
fn a_copy_in_mid_run_goes_on_exactly_as_the_original() {
    let mut scene = Scene::new("linear");
    scene.model(0.050, 1e-5, 1e6);
    scene.run(0.7, 30.0);
    let mut copy = Scene {
        stage: scene.stage.clone(),
        ..Scene::new("linear")
    };
    copy.nanos = scene.nanos;
    for x_mm in [40.0, 50.0, f64::NAN, 60.0] {
        scene.run(0.2, x_mm);
        copy.run(0.2, x_mm);
        assert_eq!(scene.x().0.to_bits(), copy.x().0.to_bits());
    }
}

/// Runs for a while and gives the greatest step of X between two messages, mm, and how many came.
fn steps(scene: &mut Scene, seconds: f64) -> (f64, u32) {
    let (mut greatest_mm, mut messages) = (0.0_f64, 0);
    let mut before = scene.last.map(|last| last.total[Axis::X]);
    for _ in 0..(seconds * 1e3).round() as i64 {
        scene.last = None;
        scene.nanos += MILLISECOND;
        scene.state(0.0);
        if let Some(last) = scene.last {
            let now = last.total[Axis::X];
            greatest_mm = greatest_mm.max((now - before.unwrap_or(0.0)).abs());
            before = Some(now);
            messages += 1;
        }
    }
    (greatest_mm, messages)
}

/// The rate limit of the scenes' axes over a servo period, mm.
const RATE_STEP_MM: f64 = 0.05 * 1e-3 + 1e-12;

#[test]
fn deactivated_it_fades_says_so_once_and_is_silent_until_it_is_active_again() {
    let mut scene = Scene::with("linear", "fade_s: 30.0, shutdown_fade_s: 1.0");
    scene.model(0.020, 0.0, 1e6);
    scene.run(3.0, 0.0);
    scene.assert_x(0.020, CompensationState::Active);
    scene.step(Input::Active(false));
    assert!(!scene.at_rest);
    let (greatest_mm, messages) = steps(&mut scene, 0.5);
    assert!(
        greatest_mm > 0.0 && greatest_mm <= RATE_STEP_MM,
        "{greatest_mm}"
    );
    assert_eq!(messages, 500);
    assert_eq!(scene.x().1, CompensationState::Fading);
    // As an end does: a fade of 1 s, not of 30 s.
    let (greatest_mm, messages) = steps(&mut scene, 1.0);
    assert!(scene.at_rest && !scene.faded_out);
    assert!(greatest_mm <= RATE_STEP_MM && messages < 700, "{messages}");
    scene.at_rest = false;
    let (_, silence) = steps(&mut scene, 2.0);
    assert_eq!(silence, 0, "an inactive node publishes no offset");
    assert!(!scene.at_rest, "said once");
    scene.step(Input::Active(true));
    let (greatest_mm, messages) = steps(&mut scene, 3.0);
    assert_eq!(messages, 3000);
    assert!(greatest_mm <= RATE_STEP_MM, "{greatest_mm}");
    scene.assert_x(0.020, CompensationState::Active);
}

#[test]
fn activated_in_the_middle_of_the_last_fade_it_goes_on_from_where_it_is() {
    let mut scene = Scene::with("linear", "fade_s: 2.0, shutdown_fade_s: 2.0");
    scene.model(0.020, 0.0, 1e6);
    scene.run(3.0, 0.0);
    scene.step(Input::Active(false));
    scene.run(1.0, 0.0);
    let halfway_mm = scene.x().0;
    assert!((halfway_mm - 0.010).abs() < 1e-3, "{halfway_mm}");
    scene.step(Input::Active(true));
    let (greatest_mm, _) = steps(&mut scene, 2.0);
    assert!(greatest_mm <= RATE_STEP_MM && !scene.at_rest);
    scene.assert_x(0.020, CompensationState::Active);
}

#[test]
fn deactivated_without_states_it_fades_on_the_computers_clock() {
    let mut scene = Scene::with("linear", "fade_s: 2.0, shutdown_fade_s: 0.5");
    scene.model(0.020, 0.0, 1e6);
    scene.run(3.0, 0.0);
    scene.step(Input::Active(false));
    for _ in 0..300 {
        scene.nanos += 10 * MILLISECOND;
        scene.step(Input::Tick);
    }
    assert!(scene.at_rest);
    assert!(scene.x().0.abs() <= 0.0);
}

#[test]
fn an_inactive_stage_is_at_rest_at_once_and_still_ends_in_order() {
    let mut scene = Scene::with("linear", "fade_s: 2.0");
    scene.stage = scene.stage.clone().inactive();
    scene.model(0.020, 0.0, 1e6);
    let (_, messages) = steps(&mut scene, 1.0);
    assert_eq!(messages, 0);
    scene.step(Input::Active(false));
    assert!(scene.at_rest && !scene.faded_out);
    scene.step(Input::Shutdown);
    assert!(scene.faded_out);
}
