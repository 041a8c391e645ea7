//! A recording beside another simulator: which runs and places are compared, and what is left out with which reason.

use std::f64::consts::TAU;

use gap_diagnosis::simulated::{FEWEST_READINGS, Matched, Reason, SimulatedError, beside};
use machine::MachineFile;
use metrology::sample::{Sense, TestKind, TestPlane, TestSegment};
use metrology::{Axis, AxisSet, PerAxis, Stamp};
use nalgebra::Vector3;
use twin::effects;
use twin::{Channel, Motion, Reading, Run, Session, Touch, Twin};

const MACHINE: &str = include_str!("../../../../launch_configs/gap_first/machine.yaml");
const RADIUS_MM: f64 = 50.0;
const FEED_MM_S: f64 = 25.0;

fn machine() -> MachineFile {
    MachineFile::parse(MACHINE, "machine.yaml").expect("the scenario's machine file")
}

fn segment(run: u32, kind: TestKind) -> TestSegment {
    TestSegment {
        at: Stamp::from_nanos(0),
        run,
        begin: true,
        kind,
        plane: TestPlane::None,
        centre_mm: Vector3::zeros(),
        radius_mm: 0.0,
        feed_mm_s: FEED_MM_S,
        sense: Sense::None,
        repeat: 0,
        stylus: String::new(),
        tool_offset_mm: Vector3::zeros(),
        stations: 0,
        zero_id: 1,
        setup_id: 1,
        cold: false,
        features: vec![],
        completed: true,
    }
}

fn session(runs: Vec<Run>) -> Session {
    Session {
        runs,
        ..Session::default()
    }
}

/// A motion of X and Y at Z = 30 mm from places at equal times.
fn motion(period_s: f64, places_mm: &[[f64; 2]]) -> Motion {
    let n = u32::try_from(places_mm.len()).expect("few");
    let time_s = (0..n).map(|k| period_s * f64::from(k)).collect();
    let mut position = PerAxis::<Vec<f64>>::default();
    position[Axis::X] = places_mm.iter().map(|place| place[0]).collect();
    position[Axis::Y] = places_mm.iter().map(|place| place[1]).collect();
    position[Axis::Z] = vec![30.0; places_mm.len()];
    Motion::new(time_s, AxisSet::XYZ, position).expect("a motion")
}

/// How a circle is gone and read.
#[derive(Clone, Copy)]
struct Circle {
    run: u32,
    /// 1: counter-clockwise.
    sense: f64,
    /// Readings a turn.
    readings: u32,
    begins_deg: f64,
    /// Deviation at an angle in rad where X goes in this direction, mm.
    shows_mm: fn(f64, f64) -> f64,
}

/// Shared by machine and simulator, mm.
fn oval(angle: f64, _: f64) -> f64 {
    0.01 * (2.0 * angle).cos()
}

/// The same with 4 um of play in X.
fn with_play(angle: f64, sense_x: f64) -> f64 {
    oval(angle, sense_x) + play(angle, sense_x)
}

fn play(angle: f64, sense_x: f64) -> f64 {
    -0.002 * sense_x * angle.cos()
}

const REAL: Circle = Circle {
    run: 1,
    sense: 1.0,
    readings: 720,
    begins_deg: 30.0,
    shows_mm: with_play,
};

impl Circle {
    /// The run; a twentieth of a turn is gone before the first reading.
    fn made(self) -> Run {
        let before = self.readings / 20;
        let angle = |k: u32| {
            let turned = (f64::from(k) - f64::from(before)) / f64::from(self.readings);
            self.begins_deg.to_radians() + TAU * self.sense * turned
        };
        let ticks = 0..=before + self.readings;
        let places = ticks.map(|k| angle(k).sin_cos());
        let places: Vec<[f64; 2]> = places
            .map(|(y, x)| [RADIUS_MM * x, RADIUS_MM * y])
            .collect();
        let period_s = TAU * RADIUS_MM / FEED_MM_S / f64::from(self.readings);
        let motion = motion(period_s, &places);
        let reading = |k: u32| {
            let at = k as usize;
            let sense_x = f64::from(motion.sense[Axis::X][at]);
            Reading {
                channel: Channel::Radial,
                at,
                fraction: 0.0,
                deviation: (self.shows_mm)(angle(k), sense_x),
            }
        };
        let readings = (before..=before + self.readings).map(reading).collect();
        Run {
            segment: TestSegment {
                plane: TestPlane::Xy,
                radius_mm: RADIUS_MM,
                sense: if self.sense > 0.0 {
                    Sense::CounterClockwise
                } else {
                    Sense::Clockwise
                },
                ..segment(self.run, TestKind::Circle)
            },
            motion,
            touches: vec![],
            readings,
        }
    }
}

/// What a diagnosis takes for the residual of a run: less the twin's nominal prediction.
fn residual_mm(session: &Session, run: usize) -> Vec<f64> {
    let machine = machine();
    let twin = Twin::new(&machine).expect("a chain");
    let known = effects::known(&machine).expect("effects");
    let known: Vec<&dyn effects::Effect> = known.iter().map(|effect| &**effect).collect();
    let run = &session.runs[run];
    let nominal = twin.predict(session, run, &known);
    let readings = run.readings.iter().zip(nominal);
    readings
        .map(|(read, nominal)| read.deviation - nominal)
        .collect()
}

/// Angle and direction of X of each reading of a run.
fn places(run: &Run) -> Vec<(f64, f64)> {
    let of = |reading: &Reading| {
        let [x, y] = [Axis::X, Axis::Y].map(|axis| run.motion.position[axis][reading.at]);
        (y.atan2(x), f64::from(run.motion.sense[Axis::X][reading.at]))
    };
    run.readings.iter().map(of).collect()
}

fn compared(real: Vec<Run>, simulated: Vec<Run>) -> (Session, Matched) {
    beside(&machine(), &session(real), &session(simulated)).expect("comparable")
}

fn refused(real: Vec<Run>, simulated: Vec<Run>) -> SimulatedError {
    beside(&machine(), &session(real), &session(simulated)).expect_err("nothing in common")
}

#[test]
fn a_simulator_of_another_rate_that_begins_elsewhere_leaves_what_it_lacks() {
    let simulated = Circle {
        readings: 500,
        begins_deg: 100.0,
        shows_mm: oval,
        ..REAL
    };
    let (left, matched) = compared(vec![REAL.made()], vec![simulated.made()]);
    assert_eq!((matched.runs.matched, matched.runs.of), (1, 1));
    assert_eq!(matched.readings.of, 721);
    // At each of the four reversals nothing is interpolated.
    let lost = matched.readings.of - matched.readings.matched;
    assert!((1..=8).contains(&lost), "{matched:?}");
    let reasons = matched.unmatched.iter();
    assert!(reasons.clone().all(|lost| lost.reason == Reason::Direction));
    assert_eq!(reasons.map(|lost| lost.readings).sum::<usize>(), lost);
    let found_mm = residual_mm(&left, 0);
    assert_eq!(found_mm.len(), matched.readings.matched);
    for ((angle, sense_x), found_mm) in places(&left.runs[0]).into_iter().zip(found_mm) {
        let wanted_mm = play(angle, sense_x);
        assert!((found_mm - wanted_mm).abs() < 3e-6, "{angle}: {found_mm}");
    }
}

#[test]
fn runs_are_matched_by_their_test_and_repeat_whatever_numbers_and_order_they_have() {
    let up = |_: f64, _: f64| 0.001;
    let down = |_: f64, _: f64| 0.005;
    let real = |run: u32, sense: f64, shows_mm: fn(f64, f64) -> f64| {
        Circle {
            run,
            sense,
            shows_mm,
            ..REAL
        }
        .made()
    };
    let recorded = vec![
        real(1, 1.0, |_, _| 0.011),
        real(2, -1.0, |_, _| 0.025),
        real(3, 1.0, |_, _| 0.012),
    ];
    let again = |_: f64, _: f64| 0.002;
    let simulated = vec![
        real(40, -1.0, down),
        real(41, 1.0, up),
        real(42, 1.0, again),
    ];
    let (left, matched) = compared(recorded, simulated);
    assert_eq!((matched.runs.matched, matched.stood_in), (3, 0));
    assert!(matched.unmatched.is_empty(), "{matched:?}");
    for (run, wanted_mm) in [(0, 0.010), (1, 0.020), (2, 0.010)] {
        for found_mm in residual_mm(&left, run) {
            assert!((found_mm - wanted_mm).abs() < 1e-9, "{run}: {found_mm}");
        }
    }
}

#[test]
fn a_run_that_the_simulator_lacks_is_counted_and_the_last_repeat_stands_in_for_others() {
    let ccw = |run| Circle { run, ..REAL }.made();
    let cw = |run| {
        Circle {
            run,
            sense: -1.0,
            ..REAL
        }
        .made()
    };
    let simulated = Circle {
        shows_mm: oval,
        ..REAL
    }
    .made();
    let (left, matched) = compared(vec![ccw(1), cw(2), ccw(3), ccw(4)], vec![simulated]);
    assert_eq!((matched.runs.matched, matched.runs.of), (3, 4));
    assert_eq!(matched.stood_in, 2);
    let numbers: Vec<u32> = left.runs.iter().map(|run| run.segment.run).collect();
    assert_eq!(numbers, [1, 3, 4]);
    let [lost] = &matched.unmatched[..] else {
        panic!("{matched:?}");
    };
    assert_eq!(
        (lost.reason, lost.runs, lost.readings),
        (Reason::Sense, 1, 721)
    );
    assert_eq!(
        lost.to_string(),
        "1 run: the simulator has the test only in the other sense"
    );
}

#[test]
fn no_run_in_common_is_refused_with_what_it_lacks() {
    let simulated = Circle {
        sense: -1.0,
        ..REAL
    }
    .made();
    let error = refused(vec![REAL.made()], vec![simulated]);
    assert!(
        matches!(error, SimulatedError::NoRun { runs: 1, .. }),
        "{error}"
    );
    assert!(error.to_string().contains("in the other sense"), "{error}");

    let mut faster = REAL.made();
    faster.segment.feed_mm_s = 2.0 * FEED_MM_S;
    let error = refused(vec![REAL.made()], vec![faster]);
    assert!(error.to_string().contains("at another feed"), "{error}");

    let mut elsewhere = REAL.made();
    elsewhere.motion.position[Axis::Z].fill(90.0);
    let error = refused(vec![REAL.made()], vec![elsewhere]);
    assert!(error.to_string().contains("only elsewhere"), "{error}");

    let mut other = REAL.made();
    (other.segment.kind, other.segment.plane) = (TestKind::Line, TestPlane::Yz);
    let error = refused(vec![REAL.made()], vec![other]).to_string();
    let words = "the simulator's tests are line YZ, those of the recording circle XY";
    assert!(error.contains(words), "{error}");
}

#[test]
fn hardly_a_reading_in_common_is_refused_with_how_many_there_are() {
    let mut simulated = REAL.made();
    // The turn ends where it begins: its last reading is at the place of its first.
    simulated.readings.truncate(FEWEST_READINGS - 3);
    let error = refused(vec![REAL.made()], vec![simulated]);
    let SimulatedError::TooFew { matched, of, why } = error else {
        panic!("{error}");
    };
    assert_eq!((matched, of), (FEWEST_READINGS - 2, 721));
    assert!(why.contains("no reading at this place"), "{why}");
}

#[test]
fn a_channel_that_the_simulator_does_not_read_is_left_out_and_named() {
    let mut real = REAL.made();
    let motors: Vec<Reading> = real.readings.iter().step_by(10).cloned().collect();
    real.readings
        .extend(motors.into_iter().map(|reading| Reading {
            channel: Channel::Motor(Axis::X),
            ..reading
        }));
    let (left, matched) = compared(vec![real], vec![REAL.made()]);
    assert_eq!(matched.readings.matched, 721);
    let [lost] = &matched.unmatched[..] else {
        panic!("{matched:?}");
    };
    assert_eq!((lost.reason, lost.readings), (Reason::Channel, 73));
    assert_eq!(lost.channel, "motor.X");
    let readings = left.runs[0].readings.iter();
    assert!(
        readings
            .map(|one| &one.channel)
            .all(|it| *it == Channel::Radial)
    );
}

/// Stops along X and back at their places, mm, each with a deviation.
fn stops(run: u32, places_mm: &[f64], shows_mm: fn(f64, f64) -> f64) -> Run {
    let back = places_mm.iter().rev();
    let way = places_mm.iter().chain(back).map(|x_mm| [*x_mm, 0.0]);
    let mut way: Vec<[f64; 2]> = way.collect();
    // Beyond the last target and back.
    let n = places_mm.len();
    way.insert(n, [places_mm[n - 1] + 5.0, 0.0]);
    way.insert(0, [places_mm[0] - 5.0, 0.0]);
    let ticks = (1..=n).chain(n + 2..=2 * n + 1);
    let reading = |(k, at): (usize, usize)| Reading {
        channel: Channel::Length(Axis::X),
        at,
        fraction: 0.0,
        deviation: shows_mm(way[at][0], if k < n { 1.0 } else { -1.0 }),
    };
    let readings = ticks.enumerate().map(reading).collect();
    Run {
        segment: segment(run, TestKind::Positioning),
        motion: motion(1.0, &way),
        touches: vec![],
        readings,
    }
}

#[test]
fn targets_are_compared_with_the_simulators_pass_of_their_own_direction() {
    let targets: Vec<f64> = (0..8).map(|k| 10.0 * f64::from(k)).collect();
    let between: Vec<f64> = (0..15).map(|k| 5.0 * f64::from(k)).collect();
    let lead = |x_mm: f64, sense: f64| 1e-4 * x_mm - 0.002 * sense;
    let real = stops(1, &targets, lead);
    let (left, matched) = compared(vec![real.clone()], vec![stops(1, &between, lead)]);
    assert_eq!(matched.readings.matched, 16);
    for found_mm in residual_mm(&left, 0) {
        assert!(found_mm.abs() < 1e-9, "{found_mm}");
    }
    // One pass alone leaves the other without a match.
    let mut one_way = stops(1, &between, lead);
    one_way.readings.truncate(between.len());
    let error = refused(vec![real], vec![one_way]);
    let SimulatedError::TooFew {
        matched: 8, why, ..
    } = error
    else {
        panic!("{error}");
    };
    assert!(why.contains("in the other direction only"), "{why}");
}

#[test]
fn a_zero_of_the_simulator_for_each_run_makes_zeros_of_their_own_and_one_leaves_them_as_they_are() {
    let numbered = |zeros: [u32; 2]| {
        let run = |(run, zero_id): (u32, u32)| {
            let mut made = Circle { run, ..REAL }.made();
            made.segment.zero_id = zero_id;
            made
        };
        let runs: Vec<Run> = (1..).zip(zeros).map(run).collect();
        runs
    };
    for (simulated, wanted) in [([7, 7], [1, 1]), ([7, 8], [1, 2])] {
        let (left, _) = compared(numbered([1, 1]), numbered(simulated));
        let zeros: Vec<u32> = left.runs.iter().map(|run| run.segment.zero_id).collect();
        assert_eq!(zeros, wanted);
        let setups: Vec<u32> = left.runs.iter().map(|run| run.segment.setup_id).collect();
        assert_eq!(setups, [1, 1]);
    }
}

#[test]
fn a_log_is_compared_at_equal_times_since_its_begin() {
    let log = |period_s: f64, rows: u32, shows_mm: fn(f64) -> f64| {
        let places = vec![[0.0, 0.0]; rows as usize];
        let reading = |k: u32| Reading {
            channel: Channel::Length(Axis::Z),
            at: k as usize,
            fraction: 0.0,
            deviation: shows_mm(period_s * f64::from(k)),
        };
        Run {
            segment: segment(1, TestKind::Dwell),
            motion: motion(period_s, &places),
            touches: vec![],
            readings: (0..rows).map(reading).collect(),
        }
    };
    let real = log(10.0, 61, |time_s| 2e-5 * time_s + 0.003);
    let simulated = log(25.0, 21, |time_s| 2e-5 * time_s);
    let (left, matched) = compared(vec![real], vec![simulated]);
    // 500 s of 600 s, and half a spacing beyond.
    assert_eq!((matched.readings.matched, matched.readings.of), (52, 61));
    assert_eq!(matched.unmatched[0].reason, Reason::OffPath);
    for found_mm in residual_mm(&left, 0).into_iter().take(51) {
        assert!((found_mm - 0.003).abs() < 1e-9, "{found_mm}");
    }
}

#[test]
fn touches_are_compared_by_feature_side_feed_and_place_in_their_order() {
    let touches = |made: &[(&str, f64, f64)]| {
        let touch = |k: usize, feature: &str, feed_mm_s: f64| Touch {
            time_s: 10.0 + 1e-3 * f64::from(u32::try_from(k).expect("few")),
            feature_id: feature.to_owned(),
            approach: Vector3::x(),
            feed_mm_s,
            position: PerAxis::default(),
            tick: None,
        };
        let all = made.iter().enumerate();
        let reading = |(at, one): (usize, &(&str, f64, f64))| Reading {
            channel: Channel::Touch,
            at,
            fraction: 0.0,
            deviation: one.2,
        };
        Run {
            segment: segment(1, TestKind::Touch),
            motion: motion(1.0, &[[0.0, 0.0]; 3]),
            touches: all.clone().map(|(k, one)| touch(k, one.0, one.1)).collect(),
            readings: all.map(reading).collect(),
        }
    };
    let twelve: Vec<(&str, f64, f64)> = vec![("a", 2.0, 0.010); FEWEST_READINGS];
    let more = [("b", 2.0, 0.030), ("b", 8.0, 0.040), ("b", 2.0, 0.031)];
    let real = touches(&[&more[..], &twelve].concat());
    let simulated = touches(&[("a", 2.0, 0.010), ("b", 2.0, 0.020), ("b", 2.0, 0.021)]);
    let (left, matched) = compared(vec![real], vec![simulated]);
    let [lost] = &matched.unmatched[..] else {
        panic!("{matched:?}");
    };
    assert_eq!((lost.reason, lost.readings), (Reason::Touch, 1));
    let found_mm = residual_mm(&left, 0);
    assert_eq!(found_mm.len(), 2 + FEWEST_READINGS);
    for (found_mm, wanted_mm) in found_mm.iter().zip([0.010, 0.010, 0.0]) {
        assert!((found_mm - wanted_mm).abs() < 1e-9, "{found_mm}");
    }
}
