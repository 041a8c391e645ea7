use metrology::Axis;
use metrology::sample::{Sense, TestKind, TestPlane};

use super::*;

fn at(s: f64) -> Stamp<Host> {
    Stamp::from_nanos((s * 1e9).round() as i64)
}

/// Recorded at so many seconds, ns.
fn log(s: f64) -> u64 {
    (s * 1e9).round() as u64
}

fn begin(kind: TestKind) -> TestSegment {
    TestSegment {
        plane: TestPlane::Xy,
        radius_mm: 50.0,
        feed_mm_s: 25.0,
        sense: Sense::CounterClockwise,
        zero_id: 1,
        setup_id: 1,
        features: vec!["X".to_owned()],
        ..TestSegment::of_kind(kind, 3, at(99.0))
    }
}

fn held(topic: &str) -> Held {
    Held {
        topic: topic.to_owned(),
        messages: 1,
        first: Place {
            number: 1,
            log_time_nanos: log(100.0),
            stamp: None,
        },
    }
}

/// A run whose last state, of 100 s, has X at 200 mm and Z at 120 mm; it began at X = -200 mm.
fn open(kind: TestKind) -> Open {
    let mut place = PerAxis::default();
    place[Axis::X] = 200.0;
    place[Axis::Z] = 120.0;
    let mut first = place;
    first[Axis::X] = -200.0;
    Open {
        begin: begin(kind),
        begin_message: held("/test/segment"),
        axes: Some(Axes {
            at: at(100.0),
            log_time_nanos: log(100.0),
            place,
            first,
        }),
        held: vec![],
        last: [None; 3],
        own: None,
        further: vec![],
    }
}

fn is_other_time(judged: &Judged) -> bool {
    matches!(judged, Judged::LeftOut(Reason::OtherTime, _))
}

/// States of 10 ms and of an hour off: at most 2 s are of the run's time.
#[test]
fn a_grid_reading_of_another_time_than_the_axes_is_left_out() {
    let open = open(TestKind::Circle);
    for off_s in [-1.9, 0.0, 1.9] {
        let judged = open.judge_time(Of::Grid, at(100.0 + off_s), log(100.01));
        assert_eq!(judged, Judged::Counts, "{off_s}");
    }
    for off_s in [-3600.0, -2.1, 2.1, 3600.0] {
        let judged = open.judge_time(Of::Grid, at(100.0 + off_s), log(100.01));
        assert!(is_other_time(&judged), "{off_s}: {judged:?}");
    }
}

/// The last state is of 100 s and the next one comes much later. Recorded as fast as they were made, readings go on by
/// themselves; recorded late, in one go, each has to follow the one before by at most 2 s.
#[test]
fn seldom_states_are_bridged_by_readings_that_follow_each_other() {
    let mut open = open(TestKind::Circle);
    let judged = open.judge_time(Of::Grid, at(107.0), log(107.0));
    assert_eq!(judged, Judged::Counts);
    for kind in [Of::Angle, Of::Length, Of::Grid] {
        assert!(is_other_time(&open.judge_time(kind, at(103.0), log(130.0))));
    }
    open.last[Of::Grid as usize] = Some(at(101.5));
    let judged = open.judge_time(Of::Grid, at(103.4), log(130.0));
    assert_eq!(judged, Judged::Counts);
    let judged = open.judge_time(Of::Grid, at(103.6), log(130.0));
    assert!(is_other_time(&judged), "{judged:?}");
    // Readings of another kind do not vouch for it.
    let judged = open.judge_time(Of::Length, at(103.4), log(130.0));
    assert!(is_other_time(&judged), "{judged:?}");
}

#[test]
fn a_further_axis_is_no_contradiction_and_a_value_of_the_own_axis_under_another_name_is() {
    let open = open(TestKind::Positioning);
    let judge = |axis, mm| open.judge((Of::Length, axis), mm, at(100.0), log(100.0));
    assert_eq!(judge(Axis::X, 200.003), Judged::Counts);
    for (axis, mm) in [
        (Axis::Y, 0.004),
        (Axis::Z, 119.99),
        // Since the begin of the run, and in a frame of the tracker's own.
        (Axis::Z, -0.002),
        (Axis::Z, -1_203.0),
    ] {
        let judged = judge(axis, mm);
        assert!(matches!(judged, Judged::Further(_)), "{axis}: {judged:?}");
    }
    // X itself, from the machine's zero and since the begin of the run.
    for mm in [200.003, 400.002] {
        let judged = judge(Axis::Y, mm);
        let is_contradiction = matches!(judged, Judged::LeftOut(Reason::OtherAxis, _));
        assert!(is_contradiction, "{mm}: {judged:?}");
    }
    let judged = open.judge((Of::Length, Axis::Y), 0.0, at(4000.0), log(100.0));
    assert!(is_other_time(&judged), "{judged:?}");
}

#[test]
fn a_run_that_was_not_completed_is_named_where_a_report_would_have_evaluated_it() {
    let name = |kind| open(kind).evaluated();
    let circle = "circle in XY of radius 50 mm";
    assert_eq!(name(TestKind::Circle).as_deref(), Some(circle));
    let along = "positioning along or about X";
    assert_eq!(name(TestKind::Positioning).as_deref(), Some(along));
    assert_eq!(name(TestKind::Production), None);
    // Standing while nothing was read is no test.
    assert_eq!(name(TestKind::Dwell), None);
    let mut log = open(TestKind::Dwell);
    log.held.push(held("/length/position"));
    assert_eq!(log.evaluated().as_deref(), Some("displacement at rest, X"));
}

fn grid(zero_id: u32, plane: TestPlane, at_s: f64) -> GridSample {
    GridSample {
        at: at(at_s),
        plane,
        u_mm: 50.0,
        v_mm: 0.0,
        zero_id,
    }
}

#[test]
fn a_reading_of_another_zero_or_plane_is_left_out_where_the_run_needs_one() {
    for (kind, sample, reason) in [
        (TestKind::Circle, grid(1, TestPlane::Xy, 100.0), None),
        (
            TestKind::Circle,
            grid(2, TestPlane::Xy, 100.0),
            Some(Reason::OtherZero),
        ),
        (
            TestKind::Corner,
            grid(2, TestPlane::Xy, 100.0),
            Some(Reason::OtherZero),
        ),
        (
            TestKind::Circle,
            grid(1, TestPlane::Zx, 100.0),
            Some(Reason::OtherPlane),
        ),
        // Of before the begin, or of a plate that nobody reads.
        (TestKind::Circle, grid(2, TestPlane::Xy, 98.9), None),
        (TestKind::Positioning, grid(2, TestPlane::Zx, 100.0), None),
    ] {
        let judged = open(kind).judge_grid(&sample, log(100.0));
        match reason {
            None => assert_eq!(judged, Judged::Counts, "{kind:?}: {sample:?}"),
            Some(reason) => {
                assert!(
                    matches!(&judged, Judged::LeftOut(it, _) if *it == reason),
                    "{judged:?}"
                );
            }
        }
    }
    let length = |zero_id| LengthSample {
        at: at(100.0),
        axis: Axis::X,
        displacement_mm: 200.0,
        zero_id,
    };
    for (kind, has_grid, is_left_out) in [
        (TestKind::Positioning, true, true),
        (TestKind::Circle, false, true),
        // Beside a plate, and where sensors of several heights have a zero each.
        (TestKind::Circle, true, false),
        (TestKind::Dwell, false, false),
    ] {
        let judge = |zero| open(kind).judge_length(&length(zero), (log(100.0), has_grid));
        assert_eq!(judge(1), Judged::Counts, "{kind:?}");
        let is_other = matches!(judge(2), Judged::LeftOut(Reason::OtherZero, _));
        assert_eq!(is_other, is_left_out, "{kind:?}: {has_grid}");
    }
}
