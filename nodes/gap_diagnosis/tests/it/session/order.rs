//! Topics that do not arrive in the order of their stamps.

use gap_diagnosis::session::{Input, Reason, SessionBuilder, SessionConfig};
use metrology::sample::{
    GridSample, ProbeTrigger, TemperatureSample, TestKind, TestPlane, TestSegment,
};
use metrology::{Axis, PerAxis, Stamp};
use twin::{Channel, Run, Session};

use crate::session::{Rig, compensation, machine, of, segment, state, touch};

fn temperature(millis: i64) -> Input {
    Input::Temperature(TemperatureSample {
        at: Stamp::from_nanos(millis * 1_000_000),
        sensor: "bed".to_owned(),
        temperature_degc: 20.0,
        variance_k2: 0.0,
    })
}

/// Two circles one after the other with all that is told of them and its stamp, ms.
fn told() -> Vec<(i64, Input)> {
    let mut told = vec![];
    let mut millis = 0;
    let stamp = |millis: i64| Stamp::from_nanos(millis * 1_000_000);
    for run in 1..=2 {
        let mut tick = |angle: f64| {
            let (x, y) = (50.0 * angle.cos(), 50.0 * angle.sin());
            let mut commanded = PerAxis::default();
            (commanded[Axis::X], commanded[Axis::Y], commanded[Axis::Z]) = (x, y, 30.0);
            let mut total = PerAxis::default();
            total[Axis::X] = 1e-6 * f64::from(millis as i32);
            let inputs = [
                compensation(stamp(millis), total),
                state(
                    stamp(millis),
                    (millis + 7000) * 1_000_000,
                    commanded,
                    commanded,
                ),
                Input::Grid(GridSample {
                    at: stamp(millis),
                    plane: TestPlane::Xy,
                    u_mm: x + total[Axis::X] + 2e-3 * (2.0 * angle).cos(),
                    v_mm: y,
                    zero_id: 1,
                }),
            ];
            told.extend(inputs.map(|input| (millis, input)));
            if millis % 500 == 0 {
                told.push((millis, temperature(millis)));
            }
            millis += 2;
            millis
        };
        let begins = (0..3000).map(|_| tick(0.0)).last().expect("a rest");
        let ends = (0..6284).map(|k| tick(f64::from(k) * 1e-3)).last();
        let ends = ends.expect("a circle");
        for (at, begin) in [(begins, true), (ends, false)] {
            let segment = TestSegment {
                at: stamp(at),
                ..segment(run, begin, TestKind::Circle)
            };
            told.push((at, Input::Segment(segment)));
        }
    }
    told
}

/// The session of what is told, each topic so much later than its stamps, ms.
fn arriving(late: impl Fn(&Input) -> i64) -> Session {
    let mut told = told();
    told.sort_by_key(|(millis, input)| millis + late(input));
    let mut builder = SessionBuilder::new(&machine(), SessionConfig::default()).expect("a machine");
    for (_, input) in told {
        builder.take(input);
    }
    let (session, account) = builder.finish().expect("a session");
    assert_eq!(account.left_out.values().sum::<usize>(), 0, "{account:?}");
    session
}

#[test]
fn a_run_is_the_same_in_whatever_order_the_topics_arrive() {
    let in_time = arriving(|_| 0);
    assert_eq!(in_time.runs.len(), 2);
    assert!(of(&in_time, 1, &Channel::GridU).len() > 1200);
    // The begin behind the first samples or before the last of the rest; the plate before the axes or behind them.
    for [segment, state, grid, offset, degc] in [
        [820, 0, 0, 0, 0],
        [0, 150, 0, 0, 0],
        [190, 0, 16, 0, 0],
        [0, 0, 1300, 0, 0],
        [900, 0, 400, 50, 0],
        [0, 30, 0, 700, 0],
        [0, 0, 0, 0, 1500],
        [1200, 1300, 0, 1300, 0],
    ] {
        let late = arriving(|input| match input {
            Input::Segment(_) => segment,
            Input::State(_) => state,
            Input::Grid(_) => grid,
            Input::Temperature(_) => degc,
            _ => offset,
        });
        assert!(
            late.runs == in_time.runs,
            "{segment} {state} {grid} {offset} {degc}"
        );
    }
}

/// A circle and a run of two touches behind it, in the order of arrival.
fn circle_and_touches(arriving: &[(i64, &str)]) -> Vec<(u32, usize)> {
    let mut rig = Rig::new(|_| 0.0);
    rig.circle(1, 1.0);
    let ended = rig.millis;
    let at = |millis: i64| Stamp::from_nanos(millis * 1_000_000);
    let segment = |run: u32, begin: bool, kind: TestKind, millis: i64| TestSegment {
        at: at(millis),
        ..segment(run, begin, kind)
    };
    for (millis, what) in arriving {
        let millis = ended + millis;
        rig.builder.take(match *what {
            "end of the circle" => Input::Segment(segment(1, false, TestKind::Circle, millis)),
            "begin" => Input::Segment(segment(2, true, TestKind::Latency, millis)),
            "end" => Input::Segment(segment(2, false, TestKind::Latency, millis)),
            "production" => Input::Segment(segment(3, true, TestKind::Production, millis)),
            _ => Input::Trigger(touch(millis, "block_1.x")),
        });
    }
    let (session, _) = rig.builder.finish().expect("a session");
    let touches = |run: &Run| (run.segment.run, run.touches.len());
    session.runs.iter().map(touches).collect()
}

#[test]
fn a_touch_is_of_the_run_in_which_it_is_stamped_and_of_no_other() {
    let end = (0, "end of the circle");
    let (begin, ended) = ((100, "begin"), (900, "end"));
    let (one, other) = ((300, "touch"), (600, "touch"));
    for arriving in [
        [end, begin, one, other, ended],
        // The begin behind the first touch, the end before the last.
        [end, one, begin, other, ended],
        [end, begin, one, ended, other],
        [one, end, begin, ended, other],
    ] {
        let found = circle_and_touches(&arriving);
        assert_eq!(found, [(1, 0), (2, 2)], "{arriving:?}");
    }
    // What is made after a test is none of its touches.
    let found = circle_and_touches(&[end, (100, "production"), one, other]);
    assert_eq!(found, [(1, 0)]);
}

#[test]
fn readings_with_the_stamp_of_another_clock_are_of_no_run_and_hold_nobody_up() {
    let stray = |millis: i64| {
        Input::Grid(GridSample {
            at: Stamp::from_nanos(millis * 1_000_000),
            plane: TestPlane::Xy,
            u_mm: 7.0,
            v_mm: 7.0,
            zero_id: 1,
        })
    };
    let in_time = arriving(|_| 0);
    let mut builder = SessionBuilder::new(&machine(), SessionConfig::default()).expect("a machine");
    let mut told = told();
    told.sort_by_key(|(millis, _)| *millis);
    for (millis, input) in told {
        if matches!(input, Input::Segment(_)) {
            builder.take(stray(millis + 3_600_000));
        }
        builder.take(input);
    }
    let (session, _) = builder.finish().expect("a session");
    assert!(session.runs == in_time.runs);
}

/// Logs and tables begin a run before their first axis state.
#[test]
fn the_first_run_of_an_older_bag_is_whole_where_it_begins_before_its_samples() {
    let mut rig = Rig::new(|_| 0.0);
    rig.circle(1, 1.0);
    rig.end(1);
    rig.builder.next_bag();
    rig.millis = -86_400_000;
    rig.segment(1, true);
    for k in 0..12_567 {
        let angle = f64::from(k) * 0.025 / 50.0;
        rig.tick(50.0 * angle.cos(), 50.0 * angle.sin());
    }
    rig.end(1);
    let (session, account) = rig.builder.finish().expect("a session");
    let numbers: Vec<u32> = session.runs.iter().map(|run| run.segment.run).collect();
    assert_eq!(numbers, [1, 2]);
    assert_eq!(account.losses().count(), 0, "{account:?}");
}

#[test]
fn touches_whose_numbers_are_left_out_within_a_run_are_counted_as_lost() {
    for (numbers, lost) in [
        (vec![4, 5, 6], 0),
        (vec![0, 1], 0),
        (vec![4, 5, 7], 1),
        (vec![3, 6, 9], 4),
    ] {
        let mut rig = Rig::new(|_| 0.0);
        let at = |millis: i64| Stamp::from_nanos(millis * 1_000_000);
        let segment = |begin, millis| TestSegment {
            at: at(millis),
            ..segment(1, begin, TestKind::Latency)
        };
        rig.builder.take(Input::Segment(segment(true, 0)));
        for (k, number) in (1..).zip(numbers) {
            let touch = touch(100 * k, "block_1.x");
            rig.builder.take(Input::Trigger(ProbeTrigger {
                sequence: number,
                ..touch
            }));
        }
        rig.builder.take(Input::Segment(segment(false, 1000)));
        let (_, account) = rig.builder.finish().expect("a session");
        assert_eq!(account.count(Reason::TouchMissing), lost, "{account:?}");
        assert_eq!(account.losses().count(), usize::from(lost > 0));
    }
}

#[test]
fn a_touch_and_a_thermometer_that_come_seconds_behind_the_axes_are_no_jump_of_the_clock() {
    let mut rig = Rig::new(|_| 0.0);
    let began = rig.millis;
    let at = |millis: i64| Stamp::from_nanos(millis * 1_000_000);
    let segment = |begin, millis| TestSegment {
        at: at(millis),
        ..segment(1, begin, TestKind::Latency)
    };
    rig.builder.take(Input::Segment(segment(true, began)));
    let mut place = PerAxis::default();
    place[Axis::Z] = 30.0;
    for millis in (began..began + 20_000).step_by(8) {
        let stamp = at(millis);
        rig.builder
            .take(state(stamp, (millis + 7000) * 1_000_000, place, place));
        // Each comes seven seconds after it was.
        if (millis - began) % 4000 == 0 && millis > began + 7000 {
            rig.builder
                .take(Input::Trigger(touch(millis - 7000, "block_1.x")));
            rig.builder.take(temperature(millis - 7000));
        }
    }
    let ended = began + 20_000;
    rig.builder.take(Input::Segment(segment(false, ended)));
    let (session, account) = rig.builder.finish().expect("a session");
    assert_eq!(account.count(Reason::ClockJump), 0, "{account:?}");
    assert_eq!((session.runs.len(), session.runs[0].touches.len()), (1, 3));
}

#[test]
fn a_touch_behind_its_closed_run_is_lost_and_said_and_a_bag_waits_for_it() {
    for (config, touches, late) in [
        (SessionConfig::default(), 1, 1),
        (SessionConfig::of_bags(), 2, 0),
    ] {
        let mut builder = SessionBuilder::new(&machine(), config).expect("a machine");
        let at = |millis: i64| Stamp::from_nanos(millis * 1_000_000);
        let segment = |begin, millis| TestSegment {
            at: at(millis),
            ..segment(1, begin, TestKind::Latency)
        };
        let mut place = PerAxis::default();
        place[Axis::Z] = 30.0;
        for millis in (0..12_000).step_by(8) {
            if millis == 1000 || millis == 4000 {
                builder.take(Input::Segment(segment(millis == 1000, millis)));
            }
            let controller = (millis + 7000) * 1_000_000;
            builder.take(state(at(millis), controller, place, place));
            if millis == 2000 {
                builder.take(Input::Trigger(touch(millis, "block_1.x")));
            }
        }
        // Stamped in the run, and told eight seconds after its end.
        builder.take(Input::Trigger(touch(3000, "block_1.x")));
        let (session, account) = builder.finish().expect("a session");
        let found = session.runs[0].touches.len();
        assert_eq!((found, account.count(Reason::TouchLate)), (touches, late));
        assert_eq!(account.losses().count(), late);
    }
}
