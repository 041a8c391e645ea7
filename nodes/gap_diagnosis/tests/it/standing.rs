//! A sensor at the end of its range, one that is stuck, and what only looks like it.

use std::f64::consts::{FRAC_PI_2, TAU};

use gap_diagnosis::session::{Account, Input, Reason, SessionBuilder, SessionConfig};
use machine::MachineFile;
use metrology::sample::{AxisState, GridSample, Sense, TestKind, TestPlane, TestSegment};
use metrology::{Axis, AxisSet, PerAxis, Stamp};
use nalgebra::Vector3;
use twin::{Channel, Session};

const MACHINE: &str = include_str!("../../../../launch_configs/gap_first/machine.yaml");
const RADIUS_MM: f64 = 50.0;
const FEED_MM_S: f64 = 50.0;
const PERIOD_S: f64 = 0.004;
const CIRCLE_S: f64 = TAU * RADIUS_MM / FEED_MM_S;
/// What the plate resolves.
const RESOLUTION_MM: f64 = 5e-6;

fn segment(kind: TestKind, begin: bool, time_s: f64) -> TestSegment {
    TestSegment {
        begin,
        plane: TestPlane::Xy,
        centre_mm: Vector3::new(0.0, 0.0, 30.0),
        radius_mm: RADIUS_MM,
        feed_mm_s: FEED_MM_S,
        sense: Sense::CounterClockwise,
        zero_id: 1,
        setup_id: 1,
        features: vec!["middle".to_owned()],
        ..TestSegment::of_kind(kind, 1, stamp(time_s))
    }
}

fn stamp(time_s: f64) -> Stamp<metrology::stamp::Host> {
    Stamp::from_nanos((time_s * 1e9).round() as i64 + 1_000_000_000)
}

/// One run along a path of X and Y, whose plate reads what `read` makes of the command.
fn recorded(
    kind: TestKind,
    seconds: f64,
    path_mm: fn(f64) -> [f64; 2],
    read: &mut dyn FnMut([f64; 2]) -> [f64; 2],
) -> (Session, Account) {
    let machine = MachineFile::parse(MACHINE, "machine.yaml").expect("the scenario's machine file");
    let mut builder = SessionBuilder::new(&machine, SessionConfig::default()).expect("a machine");
    builder.take(Input::Segment(segment(kind, true, 0.0)));
    let mut time_s = 0.0;
    while time_s < seconds {
        let here = path_mm(time_s);
        let mut commanded = PerAxis::default();
        (commanded[Axis::X], commanded[Axis::Y], commanded[Axis::Z]) = (here[0], here[1], 30.0);
        builder.take(Input::State(AxisState::standing(
            stamp(time_s),
            Stamp::from_nanos(stamp(time_s).nanos()),
            AxisSet::XYZ,
            commanded,
        )));
        let [u_mm, v_mm] = read(here).map(|mm| (mm / RESOLUTION_MM).round() * RESOLUTION_MM);
        builder.take(Input::Grid(GridSample {
            at: stamp(time_s),
            plane: TestPlane::Xy,
            u_mm,
            v_mm,
            zero_id: 1,
        }));
        time_s += PERIOD_S;
    }
    builder.take(Input::Segment(segment(kind, false, seconds)));
    builder.finish().expect("a session")
}

fn circle(time_s: f64) -> [f64; 2] {
    let (sin, cos) = (time_s * FEED_MM_S / RADIUS_MM - FRAC_PI_2).sin_cos();
    [RADIUS_MM * cos, RADIUS_MM * sin]
}

fn along_y(time_s: f64) -> [f64; 2] {
    [0.0, FEED_MM_S * time_s - 80.0]
}

fn deviations_mm(session: &Session, channel: &Channel) -> Vec<f64> {
    let readings = session.runs[0].readings.iter();
    let own = readings.filter(|reading| reading.channel == *channel);
    own.map(|reading| reading.deviation).collect()
}

fn most_mm(session: &Session, channel: &Channel) -> f64 {
    let all = deviations_mm(session, channel);
    all.iter().fold(0.0, |most, mm| mm.abs().max(most))
}

#[test]
fn a_coordinate_at_the_end_of_its_range_is_left_out_there_counted_and_said_and_the_other_is_used() {
    let (whole, _) = recorded(TestKind::Circle, CIRCLE_S, circle, &mut |here| here);
    let all = deviations_mm(&whole, &Channel::GridV).len();
    for limit_mm in [40.0, 49.9, 49.99] {
        let mut clipped = 0;
        let (session, account) = recorded(TestKind::Circle, CIRCLE_S, circle, &mut |[u, v]| {
            clipped += usize::from(u > limit_mm);
            [u.min(limit_mm), v]
        });
        assert!(clipped > 5);
        assert_eq!(account.count(Reason::StuckInPart), clipped, "{limit_mm}");
        assert_eq!(account.count(Reason::Stuck), 0);
        let words = format!("{clipped} readings stood in one coordinate");
        let said: Vec<String> = account.remarks().collect();
        assert!(said.iter().any(|line| line.starts_with(&words)), "{said:?}");
        assert_eq!(deviations_mm(&session, &Channel::GridV).len(), all);
        let kept = deviations_mm(&session, &Channel::GridU).len();
        assert!(kept < all && kept + clipped + 5 > all, "{kept} of {all}");
        assert!(most_mm(&session, &Channel::GridU) < 2.0 * RESOLUTION_MM);
    }
}

#[test]
fn what_the_motion_leaves_at_rest_is_not_called_stuck() {
    let (session, account) = recorded(TestKind::Line, 3.2, along_y, &mut |here| here);
    assert_eq!(account.left_out.len(), 0, "{account:?}");
    let [u, v] = [Channel::GridU, Channel::GridV].map(|c| deviations_mm(&session, &c).len());
    assert!(u > 700 && u == v, "{u} {v}");
}

#[test]
fn a_sensor_that_stands_as_a_whole_is_left_out_as_a_whole() {
    let mut clipped = 0;
    let (session, account) = recorded(TestKind::Line, 3.2, along_y, &mut |[u, v]| {
        clipped += usize::from(v > 60.0);
        [u, v.min(60.0)]
    });
    assert!(clipped > 90);
    assert_eq!(account.count(Reason::Stuck), clipped);
    assert_eq!(account.count(Reason::StuckInPart), 0);
    let [u, v] = [Channel::GridU, Channel::GridV].map(|c| deviations_mm(&session, &c).len());
    assert!(u == v && u < 710, "{u} {v}");
}

#[test]
fn a_slide_that_stays_where_it_is_after_its_axis_turned_is_no_stuck_sensor() {
    let play_mm = 0.02;
    let mut slide = [0.0, -RADIUS_MM];
    let (session, account) = recorded(TestKind::Circle, CIRCLE_S, circle, &mut |here| {
        for (slide, here) in slide.iter_mut().zip(here) {
            *slide = slide.clamp(here - 0.5 * play_mm, here + 0.5 * play_mm);
        }
        slide
    });
    assert_eq!(account.left_out.len(), 0, "{account:?}");
    let most = most_mm(&session, &Channel::GridU);
    assert!(most > 0.4 * play_mm, "{most}");
}
