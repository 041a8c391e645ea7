//! Sessions built from recorded samples whose errors are known.

use std::f64::consts::TAU;

use gap_diagnosis::session::{Input, Reason, SessionBuilder, SessionConfig, SessionError};
use machine::MachineFile;
use metrology::sample::{
    AxisCompensation, AxisState, BlockMeasurement, CompensationState, FacePosition, GridSample,
    LatencyShare, ProbeTrigger, Sense, TemperatureSample, TestKind, TestPlane, TestSegment,
};
use metrology::{Axis, AxisSet, Host, PerAxis, Stamp};
use nalgebra::Vector3;
use twin::effects;
use twin::{Channel, Session, Twin};

mod coarse;
mod order;

const MACHINE: &str = include_str!("../../../../launch_configs/gap_first/machine.yaml");

fn machine() -> MachineFile {
    MachineFile::parse(MACHINE, "machine.yaml").expect("the scenario's machine file")
}

fn segment(run: u32, begin: bool, kind: TestKind) -> TestSegment {
    TestSegment {
        at: Stamp::from_nanos(0),
        run,
        begin,
        kind,
        plane: TestPlane::Xy,
        centre_mm: Vector3::new(0.0, 0.0, 30.0),
        radius_mm: 50.0,
        feed_mm_s: 25.0,
        sense: Sense::CounterClockwise,
        repeat: run - 1,
        stylus: String::new(),
        tool_offset_mm: Vector3::zeros(),
        stations: 0,
        zero_id: 1,
        setup_id: 1,
        cold: false,
        features: vec!["middle".to_owned()],
        completed: true,
    }
}

fn state(
    received_at: Stamp<Host>,
    controller_nanos: i64,
    commanded: PerAxis<f64>,
    motor: PerAxis<f64>,
) -> Input {
    Input::State(AxisState {
        received_at,
        controller_at: Stamp::from_nanos(controller_nanos),
        axes: AxisSet::XYZ,
        commanded,
        motor,
        scale: PerAxis([f64::NAN; 6]),
        velocity: PerAxis::default(),
    })
}

fn compensation(at: Stamp<Host>, total: PerAxis<f64>) -> Input {
    Input::Compensation(AxisCompensation {
        at,
        axes: AxisSet::XYZ,
        total,
        thermal: total,
        geometric: PerAxis::default(),
        positioning: PerAxis::default(),
        pulses: PerAxis::default(),
        remainder: PerAxis::default(),
        state: PerAxis([CompensationState::Active; 6]),
    })
}

/// A recording in ticks of a millisecond, on a controller whose clock is 7 s ahead.
struct Rig {
    builder: SessionBuilder,
    millis: i64,
    /// Added to commands and motors alike.
    compensation_mm: f64,
    /// What the plate reads beyond the command and its compensation along X, by the angle.
    error_mm: fn(f64) -> f64,
    /// States arrive so many together.
    burst: i64,
    /// Whether the controller stamps its states.
    stamped: bool,
}

impl Rig {
    fn new(error_mm: fn(f64) -> f64) -> Self {
        Self {
            builder: SessionBuilder::new(&machine(), SessionConfig::default()).expect("a machine"),
            millis: 0,
            compensation_mm: 0.0,
            error_mm,
            burst: 1,
            stamped: true,
        }
    }

    fn tick(&mut self, x: f64, y: f64) {
        let at = Stamp::from_nanos(self.millis / self.burst * self.burst * 1_000_000);
        let controller_millis = if self.stamped { self.millis + 7000 } else { 0 };
        let mut commanded = PerAxis::default();
        (commanded[Axis::X], commanded[Axis::Y], commanded[Axis::Z]) = (x, y, 30.0);
        let mut motor = commanded;
        motor[Axis::X] += self.compensation_mm + 1e-3;
        let controller_nanos = controller_millis * 1_000_000;
        self.builder
            .take(state(at, controller_nanos, commanded, motor));
        let error_mm = (self.error_mm)(y.atan2(x));
        self.builder.take(Input::Grid(GridSample {
            at,
            plane: TestPlane::Xy,
            u_mm: x + self.compensation_mm + error_mm - 3.0,
            v_mm: y + 2.0,
            zero_id: 1,
        }));
        self.millis += 1;
    }

    fn compensate(&mut self, x_mm: f64) {
        self.compensation_mm = x_mm;
        let mut total = PerAxis::default();
        total[Axis::X] = x_mm;
        let at = Stamp::from_nanos(self.millis * 1_000_000);
        self.builder.take(compensation(at, total));
    }

    /// A rest of 6 s at the start of the circle, then once round.
    fn circle(&mut self, run: u32, share: f64) {
        for _ in 0..6000 {
            self.tick(50.0, 0.0);
        }
        self.segment(run, true);
        let ticks = TAU * 50.0 / 0.025 * share;
        let mut k = 0.0;
        while k < ticks {
            let angle: f64 = k * 0.025 / 50.0;
            self.tick(50.0 * angle.cos(), 50.0 * angle.sin());
            k += 1.0;
        }
    }

    fn end(&mut self, run: u32) {
        self.segment(run, false);
    }

    fn segment(&mut self, run: u32, begin: bool) {
        self.builder.take(Input::Segment(TestSegment {
            at: Stamp::from_nanos(self.millis * 1_000_000),
            ..segment(run, begin, TestKind::Circle)
        }));
    }
}

fn of(session: &Session, run: usize, channel: &Channel) -> Vec<(f64, f64)> {
    let run = &session.runs[run];
    let readings = run.readings.iter().filter(|r| r.channel == *channel);
    readings
        .map(|r| {
            let position = |axis: Axis| {
                let p = &run.motion.position[axis];
                p[r.at] + (p.get(r.at + 1).unwrap_or(&p[r.at]) - p[r.at]) * r.fraction
            };
            (position(Axis::Y).atan2(position(Axis::X)), r.deviation)
        })
        .collect()
}

fn touch(millis: i64, feature: &str) -> ProbeTrigger {
    let mut latched = PerAxis::default();
    // block_1's X face lies at -220 and is touched towards +X with a ball of 3 mm; 5 um too deep.
    (latched[Axis::X], latched[Axis::Y], latched[Axis::Z]) = (-222.995, -174.0, 14.0);
    ProbeTrigger {
        received_at: Stamp::from_nanos(millis * 1_000_000),
        controller_at: Stamp::from_nanos((millis + 7000) * 1_000_000),
        feature_id: feature.to_owned(),
        approach: Vector3::x(),
        feed_mm_s: 2.0,
        axes: AxisSet::XYZ,
        latched,
        sequence: 0,
    }
}

#[test]
fn a_circle_gives_deviations_at_their_places_with_the_lead_in_before_it() {
    let mut rig = Rig::new(|angle| 2e-3 * (2.0 * angle).cos());
    rig.circle(1, 1.0);
    rig.end(1);
    let (session, account) = rig.builder.finish().expect("a session");
    assert_eq!((account.runs, account.segments), (1, 1));
    let grid = of(&session, 0, &Channel::GridU);
    assert!((1700..=2000).contains(&grid.len()), "{}", grid.len());
    for (angle, deviation) in &grid {
        let wanted = 2e-3 * (2.0 * angle).cos();
        assert!((deviation - wanted).abs() < 4e-6, "{angle} {deviation}");
    }
    let motor = of(&session, 0, &Channel::Motor(Axis::X));
    assert!(motor.iter().all(|(_, d)| (d - 1e-3).abs() < 1e-9));
    let motion = &session.runs[0].motion;
    assert!(
        (motion.time_s[0] - 1.0).abs() < 0.01,
        "{}",
        motion.time_s[0]
    );
    let reading = &session.runs[0].readings[900];
    let speed = motion.velocity[Axis::X][reading.at].hypot(motion.velocity[Axis::Y][reading.at]);
    assert!((speed - 25.0).abs() < 1e-3, "{speed}");
}

#[test]
fn a_compensation_is_part_of_what_was_commanded() {
    let mut rig = Rig::new(|angle| 2e-3 * (2.0 * angle).cos());
    rig.circle(1, 1.0);
    rig.end(1);
    rig.compensate(0.03);
    rig.circle(2, 1.0);
    rig.end(2);
    let (session, account) = rig.builder.finish().expect("a session");
    for channel in [Channel::GridU, Channel::Motor(Axis::X)] {
        let (without, with) = (of(&session, 0, &channel), of(&session, 1, &channel));
        assert_eq!(without.len(), with.len());
        for (a, b) in without.iter().zip(&with) {
            assert!((a.1 - b.1).abs() < 1e-9, "{channel} {a:?} {b:?}");
        }
    }
    assert_eq!(account.count(Reason::CompensationHeld), 1);
}

#[test]
fn a_bag_that_ends_within_a_run_keeps_the_run_up_to_there() {
    let mut rig = Rig::new(|_| 0.0);
    rig.circle(1, 0.4);
    let (session, account) = rig.builder.finish().expect("a session");
    assert_eq!(account.count(Reason::Cut), 1);
    let readings = of(&session, 0, &Channel::GridU).len();
    assert!((650..=2000).contains(&readings), "{readings}");
}

#[test]
fn a_clock_that_jumps_back_cuts_the_run_and_time_goes_on() {
    let mut rig = Rig::new(|_| 0.0);
    rig.circle(1, 0.5);
    rig.millis -= 10_000;
    rig.circle(2, 1.0);
    rig.end(2);
    let (session, account) = rig.builder.finish().expect("a session");
    assert_eq!(account.count(Reason::ClockJump), 1);
    assert_eq!(account.count(Reason::Cut), 1);
    assert_eq!(session.runs.len(), 2);
    let last = |run: usize| *session.runs[run].motion.time_s.last().expect("ticks");
    assert!(last(1) > last(0));
}

#[test]
fn states_that_arrive_together_are_told_apart_by_the_controllers_clock_and_without_one_only_the_first_counts()
 {
    let of_bursts = |burst: i64, stamped: bool| {
        let mut rig = Rig::new(|_| 0.0);
        (rig.burst, rig.stamped) = (burst, stamped);
        rig.circle(1, 1.0);
        rig.end(1);
        rig.builder.finish().expect("a session")
    };
    let (session, account) = of_bursts(20, true);
    assert_eq!(
        account.left_out.values().sum::<usize>(),
        account.count(Reason::InGap)
    );
    assert_eq!(account.count(Reason::WentBack), 0);
    let motion = &session.runs[0].motion;
    for reading in session.runs[0]
        .readings
        .iter()
        .filter(|r| r.channel == Channel::Motor(Axis::X))
    {
        let speed =
            motion.velocity[Axis::X][reading.at].hypot(motion.velocity[Axis::Y][reading.at]);
        assert!((speed - 25.0).abs() < 1e-3, "{speed}");
    }
    // In a lump of 0.4 s, which a busy computer received at once, no state is missing.
    let (session, account) = of_bursts(400, true);
    assert_eq!(account.count(Reason::HoleInMotion), 0, "{account:?}");
    assert!(of(&session, 0, &Channel::Motor(Axis::X)).len() > 500);
    let (session, account) = of_bursts(20, false);
    assert!(account.count(Reason::WentBack) > 5000, "{account:?}");
    let motor = of(&session, 0, &Channel::Motor(Axis::X));
    assert!(motor.len() > 500, "{}", motor.len());
}

#[test]
fn readings_in_a_hole_of_the_states_and_broken_values_are_counted_and_left_out() {
    let mut rig = Rig::new(|_| 0.0);
    rig.circle(1, 0.5);
    // Readings go on while states are missing for half a second.
    for k in 0..500 {
        let at = Stamp::from_nanos((rig.millis + k) * 1_000_000);
        for u_mm in [1.0, f64::NAN] {
            rig.builder.take(Input::Grid(GridSample {
                at,
                plane: TestPlane::Xy,
                u_mm,
                v_mm: 0.0,
                zero_id: 1,
            }));
        }
    }
    rig.millis += 500;
    rig.tick(-50.0, 0.0);
    rig.end(1);
    let (_, account) = rig.builder.finish().expect("a session");
    assert_eq!(account.count(Reason::NotFinite), 500);
    assert_eq!(account.count(Reason::InGap), 500);
}

#[test]
fn a_run_whose_states_are_missing_in_the_midst_of_its_motion_is_left_out_and_counted() {
    let mut rig = Rig::new(|_| 0.0);
    rig.circle(1, 0.5);
    // Half a second of the other half is not recorded.
    rig.millis += 500;
    rig.tick(-40.0, -30.0);
    rig.end(1);
    rig.circle(2, 1.0);
    rig.end(2);
    let (session, account) = rig.builder.finish().expect("a session");
    assert_eq!(account.count(Reason::HoleInMotion), 1, "{account:?}");
    let runs: Vec<u32> = session.runs.iter().map(|run| run.segment.run).collect();
    assert_eq!(runs, [2]);
}

/// At 150 mm/s, 4 ms apart, on a radius of 40 mm the path stands 1.1 µm off the chord between two states: a plate that
/// stamps its readings between them is read on the path.
#[test]
fn readings_between_the_states_of_a_fast_circle_are_compared_with_the_path() {
    let mut builder = SessionBuilder::new(&machine(), SessionConfig::default()).expect("a machine");
    let (radius_mm, feed_mm_s, late_s) = (40.0, 150.0, 0.0017);
    let run = |begin| TestSegment {
        radius_mm,
        feed_mm_s,
        ..segment(1, begin, TestKind::Circle)
    };
    let place = |time_s: f64| {
        let angle = time_s * feed_mm_s / radius_mm;
        [radius_mm * angle.cos(), radius_mm * angle.sin()]
    };
    let stamp = |time_s: f64| Stamp::from_nanos((time_s * 1e9).round() as i64 + 1_000_000_000);
    builder.take(Input::Segment(TestSegment {
        at: stamp(0.0),
        ..run(true)
    }));
    for tick in 0..420 {
        let time_s = 0.004 * f64::from(tick);
        let mut commanded = PerAxis::default();
        let [x, y] = place(time_s);
        (commanded[Axis::X], commanded[Axis::Y], commanded[Axis::Z]) = (x, y, 30.0);
        let at = stamp(time_s);
        builder.take(state(at, at.nanos(), commanded, commanded));
        let [u_mm, v_mm] = place(time_s + late_s);
        builder.take(Input::Grid(GridSample {
            at: stamp(time_s + late_s),
            plane: TestPlane::Xy,
            u_mm,
            v_mm,
            zero_id: 1,
        }));
    }
    builder.take(Input::Segment(TestSegment {
        at: stamp(1.7),
        ..run(false)
    }));
    let (session, account) = builder.finish().expect("a session");
    let off = of(&session, 0, &Channel::GridU);
    assert!(off.len() > 380, "{} readings: {account:?}", off.len());
    // Where the record begins and ends there are no neighbours to tell the bend of the path from.
    let within = &off[3..off.len() - 3];
    let most_um = within.iter().map(|(_, mm)| mm.abs()).fold(0.0, f64::max) * 1e3;
    assert!(most_um < 0.02, "{most_um}");
}

#[test]
fn a_bag_of_another_machine_is_refused_by_what_differs() {
    let mut rig = Rig::new(|_| 0.0);
    rig.tick(900.0, 0.0);
    assert!(matches!(
        rig.builder.finish(),
        Err(SessionError::OutsideTravel { axis: Axis::X, .. })
    ));
    let builder = SessionBuilder::new(&machine(), SessionConfig::default()).expect("a machine");
    assert_eq!(
        builder.finish().map(|_| ()),
        Err(SessionError::NothingCommanded)
    );
}

#[test]
fn states_of_another_machine_refuse_no_bag_unless_they_are_half_of_it_and_are_counted() {
    for (strangers, is_refused) in [(1, false), (5, false), (399, false), (400, true)] {
        let mut rig = Rig::new(|_| 0.0);
        for n in 0..400 {
            rig.tick(0.01 * f64::from(n), 0.0);
            if n < strangers {
                let mut far = PerAxis::default();
                far[Axis::X] = 9e3;
                let at = Stamp::from_nanos(1_000_000_000 + i64::from(n));
                rig.builder.take(state(at, at.nanos(), far, far));
            }
        }
        let count = rig.builder.account().count(Reason::OtherMachine);
        assert_eq!(count, strangers as usize);
        let refused = matches!(
            rig.builder.finish(),
            Err(SessionError::OutsideTravel { .. })
        );
        assert_eq!(refused, is_refused, "{strangers}");
    }
}

#[test]
fn a_touch_is_measured_from_the_surface_of_the_machine_file() {
    let mut rig = Rig::new(|_| 0.0);
    rig.builder
        .take(Input::Segment(segment(1, true, TestKind::Latency)));
    for feature in ["block_1.x", "nothing.x"] {
        rig.builder.take(Input::Trigger(touch(5, feature)));
    }
    rig.builder
        .take(Input::Segment(segment(1, false, TestKind::Latency)));
    let (session, account) = rig.builder.finish().expect("a session without axis states");
    let run = &session.runs[0];
    assert_eq!((run.touches.len(), run.touches[0].tick), (1, Some(1)));
    assert!((run.readings[0].deviation - 5e-3).abs() < 1e-9);
    assert_eq!(account.count(Reason::UnknownFeature), 1);
    let machine = machine();
    let twin = Twin::new(&machine).expect("a twin");
    assert_eq!(twin.predict(&session, run, &[]), [0.0]);
    // It is told what the place and the way of a touch tell, though no axis state was recorded.
    let squareness = effects::kind("squareness").expect("in the catalogue");
    let square = (squareness.build)(squareness.targets_on(&machine).remove(0), &[30.0]);
    let told = twin.predict(&session, run, &[&*square])[0];
    assert!(told.abs() > 1e-3, "{told}");
    assert_eq!(run.motion.sense[Axis::X], [0, 1]);
    assert_eq!(run.motion.velocity[Axis::X], [0.0, 0.0]);
    // It began the stand-off before the surface of the machine file, which does not scatter with the trigger.
    assert!((run.motion.position[Axis::X][0] - (-225.0)).abs() < 1e-9);
}

#[test]
fn a_touch_that_comes_after_the_end_of_its_run_is_kept_and_one_much_later_is_not() {
    for (late_millis, touches) in [(500, 1), (4000, 0)] {
        let mut rig = Rig::new(|_| 0.0);
        rig.tick(0.0, 0.0);
        for begin in [true, false] {
            rig.builder
                .take(Input::Segment(segment(1, begin, TestKind::Latency)));
        }
        for _ in 0..late_millis {
            rig.tick(0.0, 0.0);
        }
        rig.builder
            .take(Input::Trigger(touch(rig.millis, "block_1.x")));
        let found = rig.builder.finish();
        let found = found.map_or(0, |(session, _)| session.runs[0].touches.len());
        assert_eq!(found, touches);
    }
}

#[test]
fn blocks_that_were_measured_without_touches_are_runs_of_touches() {
    let mut builder = SessionBuilder::new(&machine(), SessionConfig::default()).expect("a machine");
    let face = |position_mm: f64, seconds: i64| {
        Some(FacePosition {
            position_mm,
            at: Stamp::from_nanos(seconds * 1_000_000_000),
            standard_uncertainty_mm: 1e-4,
            latency: LatencyShare::default(),
        })
    };
    for run in 1..=3 {
        let began = i64::from(run) * 100;
        for begin in [true, false] {
            builder.take(Input::Segment(segment(run, begin, TestKind::Block)));
        }
        let mut faces = PerAxis::from_fn(|_| None);
        faces[Axis::X] = face(-220.0 + 1e-3 * f64::from(run), began);
        faces[Axis::Z] = face(20.0, began + 10);
        builder.take(Input::Block(BlockMeasurement {
            at: Stamp::from_nanos((began + 10) * 1_000_000_000),
            block_id: "block_1".to_owned(),
            faces,
            cold: run == 1,
            run,
        }));
    }
    let (session, account) = builder.finish().expect("a session");
    assert_eq!((account.runs, account.readings), (3, 6));
    for (run, wanted_mm) in session.runs.iter().zip([1e-3, 2e-3, 3e-3]) {
        assert_eq!(run.motion.len(), 4);
        let x = &run.readings[0];
        assert!((x.deviation - wanted_mm).abs() < 1e-12, "{x:?}");
        assert!(run.readings[1].deviation.abs() < 1e-12);
        assert_eq!(run.touches[0].tick, Some(1));
    }
    let apart_s = session.runs[1].touches[0].time_s - session.runs[0].touches[0].time_s;
    assert!((apart_s - 100.0).abs() < 1e-9, "{apart_s}");
}

#[test]
fn a_thermometer_is_compared_with_the_first_at_its_place_and_no_other() {
    let text = MACHINE.replace(
        "  - {id: bed, place: bed, period_s: 10.0}",
        "  - {id: bed, place: bed, period_s: 10.0}\n  - {id: bed_2, place: bed, period_s: 10.0}",
    );
    let machine = MachineFile::parse(&text, "machine.yaml").expect("a machine file");
    let mut rig = Rig::new(|_| 0.0);
    rig.builder = SessionBuilder::new(&machine, SessionConfig::default()).expect("a machine");
    rig.builder
        .take(Input::Segment(segment(1, true, TestKind::Dwell)));
    for k in 0..60_000 {
        if k % 10_000 == 0 {
            let second = f64::from(k) * 1e-3;
            for (sensor, degc) in [
                ("bed", 20.0 + 0.01 * second),
                ("bed_2", 20.3 + 0.01 * second),
                ("ambient", 19.0),
            ] {
                rig.builder.take(Input::Temperature(TemperatureSample {
                    at: Stamp::from_nanos(rig.millis * 1_000_000),
                    sensor: sensor.to_owned(),
                    temperature_degc: degc,
                    variance_k2: 0.0,
                }));
            }
        }
        rig.tick(0.0, 0.0);
    }
    rig.end(1);
    let (session, _) = rig.builder.finish().expect("a session");
    let thermometers = session.runs[0].readings.iter();
    let thermometers: Vec<_> = thermometers
        .filter(|r| matches!(r.channel, Channel::Thermometer(_)))
        .collect();
    assert!(thermometers.len() >= 4, "{}", thermometers.len());
    for reading in thermometers {
        assert_eq!(reading.channel, Channel::Thermometer("bed_2".to_owned()));
        assert!((reading.deviation - 0.3).abs() < 1e-9, "{reading:?}");
    }
}

#[test]
fn a_minute_of_standing_axes_is_held_in_few_ticks_and_a_turn_after_it_in_all() {
    let mut rig = Rig::new(|_| 0.0);
    rig.builder
        .take(Input::Segment(segment(1, true, TestKind::Circle)));
    for _ in 0..60_000 {
        rig.tick(50.0, 0.0);
    }
    let mut k = 0.0;
    while k < TAU * 50.0 / 0.025 {
        let angle: f64 = k * 0.025 / 50.0;
        rig.tick(50.0 * angle.cos(), 50.0 * angle.sin());
        k += 1.0;
    }
    rig.end(1);
    let (session, _) = rig.builder.finish().expect("a session");
    let run = &session.runs[0];
    assert!(run.motion.len() < 6000, "{}", run.motion.len());
    let grid = of(&session, 0, &Channel::GridU);
    assert!((1700..=2000).contains(&grid.len()), "{}", grid.len());
    let reading = &run.readings[900];
    let speed =
        run.motion.velocity[Axis::X][reading.at].hypot(run.motion.velocity[Axis::Y][reading.at]);
    assert!((speed - 25.0).abs() < 1e-3, "{speed}");
}

#[test]
fn a_second_bag_has_runs_of_its_own() {
    let mut rig = Rig::new(|_| 0.0);
    rig.circle(1, 1.0);
    rig.end(1);
    rig.builder.next_bag();
    rig.millis = 0;
    rig.circle(1, 1.0);
    rig.end(1);
    let (session, _) = rig.builder.finish().expect("a session");
    let numbers: Vec<u32> = session.runs.iter().map(|run| run.segment.run).collect();
    assert_eq!(numbers, [1, 2]);
    assert!(session.history.len() >= 2);
}
