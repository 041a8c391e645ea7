//! Whatever comes in, the offsets that go out never break a limit.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

use axis_compensation::{AxisCompensationConfig, AxisCompensationStage, Input, Output};
use metrology::sample::{
    AxisCompensation, AxisDrift, AxisState, DriftGrowth, Sense, TestKind, TestPlane, TestSegment,
    ThermalModel,
};
use metrology::{Axis, AxisSet, Host, Machine, PerAxis, Stage, Stamp};
use nalgebra::Vector3;
use proptest::prelude::*;

const SIZE_MM: f64 = 0.1;
const RATE_MM_S: f64 = 0.05;
const ACCELERATION_MM_S2: f64 = 0.5;
const GAP_S: f64 = 0.2;
const SERVO_S: f64 = 1e-3;
const PULSE_MM: f64 = 1e-4;
// At full rate an offset can stop within the time that counts as a gap.
const _: () = assert!(RATE_MM_S / ACCELERATION_MM_S2 <= GAP_S);

const POSITIONING: &str = "\
    X: {reading: refreshed_table, weight: 0.3, directions: apart, thermal_part: true, \
        measured_limit_um: 5000.0, measuring_feed_limit_mm_min: 60000.0, settle_s: 0.0, dwell_s: 0.01, \
        start_points_mm: [-50.0, -40.0, -30.0, -20.0, -10.0, 0.0], \
        start_deviations_um: [0.0, 50.0, -120.0, 3.0, 3.0, 10.0], \
        start_deviations_down_um: [0.0, -50.0, 20.0, 3.0, -3.0, 10.0]}, \
    Y: {reading: weighted_increments, weight: 0.2, directions: together, thermal_part: false, \
        measured_limit_um: 5000.0, measuring_feed_limit_mm_min: 60000.0, loop_cycle_s: 0.002, \
        start_points_mm: [-40.0, -20.0, 0.0, 20.0, 40.0], start_deviations_um: [0.0, 50.0, -20.0, 3.0, 3.0]}";

fn stage(extrapolate: &str) -> AxisCompensationStage {
    let machine = include_str!("../../../launch_configs/first_run/machine.yaml");
    let limits =
        "size_limit_um: 100.0, rate_limit_um_per_s: 50.0, acceleration_limit_um_per_s2: 500.0";
    let config: AxisCompensationConfig = serde_saphyr::from_str(&format!(
        "{{axes: {{X: {{{limits}}}, Y: {{{limits}}}, Z: {{{limits}}}}}, extrapolate: {extrapolate}, \
         physical_rate_um_per_min: 3.0, jump_margin_um: 20.0, expanded_uncertainty_limit_um: 1000.0, hold_s: 0.1, fade_s: 0.2, gap_s: 0.2, positioning: {{{POSITIONING}}}}}"
    ))
    .unwrap();
    AxisCompensationStage::new(&config, &serde_saphyr::from_str(machine).unwrap()).unwrap()
}

fn model(
    sequence: u32,
    at: Stamp<Host>,
    k0_mm: f64,
    slope: f64,
    life_s: f64,
    rate_mm_s: f64,
) -> ThermalModel {
    let drift = AxisDrift {
        p0_mm: -220.0,
        k0_mm,
        slope_mm_per_mm: slope,
        cross_slope_mm_per_mm: Vector3::new(0.0, slope, 0.0),
        span_mm: (-220.0, 220.0),
        offset_identifiable: true,
        slope_identifiable: true,
        growth: [
            Some(DriftGrowth {
                rate_mm_s,
                gradient_rate_per_s: Vector3::zeros(),
                time_constant_s: 1800.0,
            }),
            None,
            None,
        ],
        measured_at: at,
        ..AxisDrift::default()
    };
    let mut axes = PerAxis::default();
    for axis in Axis::LINEAR {
        let mut own = drift;
        own.cross_slope_mm_per_mm[axis.index()] = 0.0;
        axes[axis] = Some(own);
    }
    ThermalModel {
        at,
        axes,
        valid_from: at,
        valid_until: at + metrology::stamp::Span::from_secs_f64(life_s),
        n_blocks: 2,
        lack_of_fit_p: f64::NAN,
        quarantined: false,
        sequence,
    }
}

#[derive(Clone, Debug)]
enum Event {
    Sweep {
        from_mm: f64,
        to_mm: f64,
        ticks: u32,
    },
    State {
        step_nanos: i64,
        position_mm: [f64; 3],
        all_axes: bool,
        beyond_motor_mm: f64,
    },
    Test {
        begin: bool,
        completed: bool,
    },
    Model {
        k0_mm: f64,
        slope: f64,
        life_s: f64,
        rate_mm_s: f64,
    },
    Enable(bool),
    Active(bool),
    Tick,
    Wait {
        host_nanos: i64,
    },
    Shutdown,
}

fn position() -> impl Strategy<Value = f64> {
    prop_oneof![
        12 => -320.0..320.0_f64,
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
        1 => Just(-1e300),
    ]
}

fn spacing() -> impl Strategy<Value = i64> {
    prop_oneof![
        10 => Just(1_000_000_i64),
        6 => 1_000..200_000_000_i64,
        3 => Just(100_000_000),
        1 => Just(0),
        1 => -5_000_000_000..0_i64,
        1 => 200_000_001..100_000_000_000_i64,
        1 => Just(i64::MAX / 2),
        1 => Just(i64::MIN / 2),
    ]
}

fn number(range: std::ops::Range<f64>) -> impl Strategy<Value = f64> {
    prop_oneof![15 => range, 1 => Just(f64::NAN), 1 => Just(f64::NEG_INFINITY), 1 => Just(1e200)]
}

fn event() -> impl Strategy<Value = Event> {
    prop_oneof![
        3 => (-320.0..320.0_f64, -320.0..320.0_f64, 50..3000_u32)
            .prop_map(|(from_mm, to_mm, ticks)| Event::Sweep { from_mm, to_mm, ticks }),
        40 => (spacing(), position(), position(), position(), prop::bool::weighted(0.95), number(-0.05..0.05))
            .prop_map(|(step_nanos, x, y, z, all_axes, beyond_motor_mm)| Event::State { step_nanos, position_mm: [x, y, z], all_axes, beyond_motor_mm }),
        2 => (any::<bool>(), any::<bool>()).prop_map(|(begin, completed)| Event::Test { begin, completed }),
        4 => (number(-0.15..0.15), number(-3e-4..3e-4), number(0.0..2.0), number(-1e-4..1e-4))
            .prop_map(|(k0_mm, slope, life_s, rate_mm_s)| Event::Model { k0_mm, slope, life_s, rate_mm_s }),
        2 => any::<bool>().prop_map(Event::Enable),
        3 => any::<bool>().prop_map(Event::Active),
        3 => Just(Event::Tick),
        2 => (-1_000_000_000..1_000_000_000_i64).prop_map(|host_nanos| Event::Wait { host_nanos }),
        1 => prop::bool::weighted(0.1).prop_map(|b| if b { Event::Shutdown } else { Event::Tick }),
    ]
}

fn segment(at: Stamp<Host>, begin: bool, completed: bool) -> TestSegment {
    TestSegment {
        at,
        run: 1,
        begin,
        kind: TestKind::Positioning,
        plane: TestPlane::None,
        centre_mm: Vector3::zeros(),
        radius_mm: 0.0,
        feed_mm_s: 1.0,
        sense: Sense::None,
        repeat: 0,
        stylus: String::new(),
        zero_id: 0,
        setup_id: 0,
        tool_offset_mm: Vector3::zeros(),
        stations: 0,
        cold: false,
        features: Vec::new(),
        completed,
    }
}

/// Follows the outputs and checks each against the one before.
struct Watch {
    last: PerAxis<f64>,
    velocity: PerAxis<f64>,
}

impl Watch {
    /// `dt_s`: how long the change took; `None`: no time passed.
    fn check(&mut self, c: &AxisCompensation, dt_s: Option<f64>) -> Result<(), TestCaseError> {
        for axis in Axis::LINEAR {
            let (total, change) = (c.total[axis], c.total[axis] - self.last[axis]);
            prop_assert!(
                total.is_finite() && total.abs() <= SIZE_MM * (1.0 + 1e-12),
                "size {total}"
            );
            prop_assert!(c.remainder[axis].abs() < PULSE_MM);
            prop_assert!(
                (c.pulses[axis] as f64 * PULSE_MM + c.remainder[axis] - total).abs() < 1e-12
            );
            let Some(dt_s) = dt_s else {
                prop_assert!(change == 0.0, "{change} in no time");
                continue;
            };
            prop_assert!(
                change.abs() <= RATE_MM_S * dt_s * (1.0 + 1e-9) + 1e-15,
                "{change} in {dt_s} s"
            );
            let velocity = change / dt_s;
            let bent = (velocity - self.velocity[axis]).abs();
            // The second term: what rounding of the offset itself does to a difference over dt.
            let allowed = ACCELERATION_MM_S2 * dt_s * (1.0 + 1e-9) + 1e-16 / dt_s + 1e-9;
            prop_assert!(bent <= allowed, "velocity changed by {bent} in {dt_s} s");
            self.velocity[axis] = velocity;
            self.last[axis] = total;
        }
        Ok(())
    }
}

/// Both clocks and what the stage is known to count from.
struct Bench {
    stage: AxisCompensationStage,
    host_nanos: i64,
    machine_nanos: i64,
    last_state: Option<i64>,
    last_driven: Option<i64>,
    sequence: u32,
    /// States since the last that was answered.
    silent_states: u32,
    watch: Watch,
}

impl Bench {
    fn run(&mut self, event: &Event) -> Result<(), TestCaseError> {
        let Event::Sweep {
            from_mm,
            to_mm,
            ticks,
        } = *event
        else {
            return self.run_one(event);
        };
        for tick in 0..ticks {
            let x_mm = from_mm + (to_mm - from_mm) * f64::from(tick) / f64::from(ticks);
            self.run_one(&Event::State {
                step_nanos: 1_000_000,
                position_mm: [x_mm, 0.0, -x_mm],
                all_axes: true,
                beyond_motor_mm: 0.03 * (0.05 * x_mm).sin(),
            })?;
        }
        Ok(())
    }

    fn run_one(&mut self, event: &Event) -> Result<(), TestCaseError> {
        let (input, by_state) = self.input(event);
        if input == Input::Tick {
            self.last_driven = self.last_driven.map(|last| last.min(self.host_nanos));
        }
        let mut out = Vec::new();
        let at = Stamp::from_nanos(self.host_nanos);
        self.stage.step(at, input, &mut out).unwrap();
        let is_compensation = |output: &Output| matches!(output, Output::Compensation(_));
        if by_state && !out.iter().any(is_compensation) {
            // Not active: nothing is said, and time goes on.
            self.last_driven = Some(self.host_nanos);
            self.last_state = Some(self.machine_nanos);
            self.watch.velocity = PerAxis::default();
            self.silent_states += 1;
        }
        for output in &out {
            if let Output::Compensation(c) = output {
                self.silent_states = 0;
                let host = self
                    .last_driven
                    .map(|last| self.host_nanos.saturating_sub(last));
                let dt_s = match (by_state, self.last_state) {
                    (true, Some(last)) => match self.machine_nanos.saturating_sub(last) {
                        i64::MIN..0 => Some(SERVO_S),
                        nanos => Some(nanos as f64 / 1e9),
                    },
                    _ => host.map(|nanos| nanos as f64 / 1e9),
                };
                self.watch.check(c, dt_s.filter(|dt_s| *dt_s > 0.0))?;
                self.last_driven = Some(self.host_nanos);
                self.last_state = by_state.then_some(self.machine_nanos);
            }
        }
        Ok(())
    }

    fn input(&mut self, event: &Event) -> (Input, bool) {
        let at = Stamp::<Host>::from_nanos(self.host_nanos);
        match *event {
            Event::State {
                step_nanos,
                position_mm,
                all_axes,
                beyond_motor_mm,
            } => {
                self.machine_nanos = self.machine_nanos.saturating_add(step_nanos);
                self.host_nanos = self
                    .host_nanos
                    .saturating_add(step_nanos.clamp(0, 1_000_000_000));
                let [x_mm, y_mm, z_mm] = position_mm;
                let commanded = PerAxis([x_mm, y_mm, z_mm, 0.0, 0.0, 0.0]);
                let state = AxisState {
                    received_at: Stamp::from_nanos(self.host_nanos),
                    controller_at: Stamp::<Machine>::from_nanos(self.machine_nanos),
                    axes: [AxisSet::EMPTY.with(Axis::Y), AxisSet::XYZ][usize::from(all_axes)],
                    commanded,
                    motor: commanded,
                    scale: PerAxis::from_fn(|axis| commanded[axis] + beyond_motor_mm),
                    velocity: PerAxis::default(),
                };
                (Input::State(state), true)
            }
            Event::Model {
                k0_mm,
                slope,
                life_s,
                rate_mm_s,
            } => {
                self.sequence += 1;
                (
                    Input::Model(Box::new(model(
                        self.sequence,
                        at,
                        k0_mm,
                        slope,
                        life_s,
                        rate_mm_s,
                    ))),
                    false,
                )
            }
            Event::Test { begin, completed } => (
                Input::Segment(Box::new(segment(at, begin, completed))),
                false,
            ),
            Event::Enable(on) => (Input::Enable(on), false),
            Event::Active(active) => (Input::Active(active), false),
            Event::Tick => (Input::Tick, false),
            Event::Wait { host_nanos } => {
                self.host_nanos = self.host_nanos.saturating_add(host_nanos);
                (Input::Tick, false)
            }
            Event::Shutdown => (Input::Shutdown, false),
            Event::Sweep { .. } => unreachable!("a sweep is run as its states"),
        }
    }
}

fn bench(extrapolate: &str) -> Bench {
    Bench {
        stage: stage(extrapolate),
        host_nanos: 0,
        machine_nanos: 0,
        last_state: None,
        last_driven: None,
        sequence: 0,
        silent_states: 0,
        watch: Watch {
            last: PerAxis::default(),
            velocity: PerAxis::default(),
        },
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 1500,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(20231),
        max_shrink_iters: 2000,
        ..ProptestConfig::default()
    })]

    #[test]
    fn prop_no_sequence_of_inputs_makes_an_output_step(
        extrapolate in prop_oneof![Just("linear"), Just("hold"), Just("refuse")],
        events in prop::collection::vec(event(), 1..200),
    ) {
        let mut bench = bench(extrapolate);
        for event in &events {
            bench.run(event)?;
        }
    }

    #[test]
    fn prop_after_deactivation_every_offset_reaches_zero_and_activation_takes_it_up_without_a_step(
        events in prop::collection::vec(event(), 1..60),
        later in prop::collection::vec(event(), 1..60),
    ) {
        let mut bench = bench("linear");
        for event in events.iter().filter(|e| !matches!(e, Event::Shutdown)) {
            bench.run(event)?;
        }
        bench.machine_nanos /= 4;
        bench.host_nanos /= 4;
        bench.run(&Event::Active(false))?;
        let state = Event::State { step_nanos: 1_000_000, position_mm: [0.0; 3], all_axes: true, beyond_motor_mm: 0.0 };
        for _ in 0..12_000 {
            bench.run(&state)?;
            if bench.silent_states > 100 {
                break;
            }
        }
        prop_assert!(bench.silent_states > 100, "it is not at rest within 12 s");
        prop_assert!(bench.watch.last.0.iter().all(|mm| mm.abs() <= 0.0), "{:?}", bench.watch.last);
        bench.run(&Event::Active(true))?;
        for event in &later {
            bench.run(event)?;
        }
    }

    #[test]
    fn prop_after_shutdown_every_offset_reaches_zero(
        events in prop::collection::vec(event(), 1..100),
        by_ticks in any::<bool>(),
    ) {
        let mut bench = bench("linear");
        for event in events.iter().filter(|e| !matches!(e, Event::Shutdown)) {
            bench.run(event)?;
        }
        // Clocks may stand at their ends; from here on they go on as usual.
        bench.machine_nanos /= 4;
        bench.host_nanos /= 4;
        let mut out = Vec::new();
        bench.stage.step(Stamp::from_nanos(bench.host_nanos), Input::Shutdown, &mut out).unwrap();
        let mut done = out.contains(&Output::FadedOut);
        for _ in 0..12_000 {
            bench.host_nanos += 1_000_000;
            bench.machine_nanos += 1_000_000;
            out.clear();
            let input = if by_ticks {
                Input::Tick
            } else {
                let state = Event::State { step_nanos: 0, position_mm: [0.0; 3], all_axes: true, beyond_motor_mm: 0.0 };
                bench.input(&state).0
            };
            bench.stage.step(Stamp::from_nanos(bench.host_nanos), input, &mut out).unwrap();
            done |= out.contains(&Output::FadedOut);
            if done {
                break;
            }
        }
        prop_assert!(done, "no FadedOut within 12 s");
    }
}
