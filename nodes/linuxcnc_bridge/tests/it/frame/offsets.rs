//! Offsets wait for homing; a normal start is no error; offsets that never come are reported.

use linuxcnc_bridge::Input;
use linuxcnc_bridge::condition::Condition;
use linuxcnc_bridge::config::Prepare;
use linuxcnc_bridge::run::Outcome;
use metrology::sample::{AxisCompensation, CompensationState};
use metrology::{Author, Axis, AxisSet, PerAxis, Severity};

use crate::frame::control::{Control, State};
use crate::frame::desk::{Desk, at};

fn offsets(now_s: f64, mm: f64) -> Input {
    offsets_of(AxisSet::XYZ, now_s, mm)
}

fn offsets_of(axes: AxisSet, now_s: f64, mm: f64) -> Input {
    Input::Compensation(AxisCompensation {
        at: at(now_s),
        axes,
        total: PerAxis([mm; 6]),
        thermal: PerAxis::default(),
        geometric: PerAxis::default(),
        positioning: PerAxis::default(),
        pulses: PerAxis::default(),
        remainder: PerAxis([mm; 6]),
        state: PerAxis([CompensationState::Active; 6]),
    })
}

/// Offsets of X that HAL was given, mm.
fn passed_mm(desk: &mut Desk) -> Vec<f64> {
    let lines = desk.hal.drain(..).collect::<String>();
    { lines.lines() }
        .filter_map(|line| line.strip_prefix("sets abbe-compensation-x "))
        .map(|value| value.parse().unwrap())
        .collect()
}

fn with_offsets(desk: &mut Desk, seconds_s: f64, mm: f64) {
    let end_s = desk.now_s + seconds_s;
    while desk.now_s < end_s {
        let now_s = desk.now_s;
        desk.tell(offsets(now_s, mm));
        desk.later(0.05);
    }
}

#[test]
fn offsets_wait_until_every_axis_is_homed_and_fade_when_one_is_not() {
    let mut control = Control::new(State::usual());
    control.homed = false;
    let mut desk = Desk::with(control, Prepare::Observe);
    with_offsets(&mut desk, 2.0, 0.03);
    assert!(
        passed_mm(&mut desk).iter().all(|mm| *mm == 0.0),
        "nothing before homing"
    );
    assert!(desk.conditions.contains(&Condition::CompensationHeld));
    assert!(!desk.conditions.contains(&Condition::CompensationFresh));
    desk.control.homed = true;
    with_offsets(&mut desk, 0.5, 0.03);
    assert_eq!(passed_mm(&mut desk), [0.03]);
    assert!(desk.conditions.contains(&Condition::CompensationFresh));
    assert!(!desk.has("homed_under_offset"));

    // Unhomed: zero at once, the heart goes on beating so that HAL fades at once, too.
    desk.conditions.clear();
    desk.control.homed = false;
    with_offsets(&mut desk, 1.0, 0.03);
    assert!(
        desk.hal
            .iter()
            .any(|lines| lines.contains("abbe-heartbeat"))
    );
    assert_eq!(passed_mm(&mut desk), [0.0]);
    assert!(desk.conditions.contains(&Condition::CompensationHeld));
    desk.control.homed = true;
    with_offsets(&mut desk, 0.5, 0.04);
    assert_eq!(passed_mm(&mut desk), [0.04]);
    assert!(
        desk.has("homed_under_offset"),
        "homed 1 s later: {:?}",
        desk.conditions
    );

    // With time to fade there is nothing to say.
    desk.conditions.clear();
    desk.control.homed = false;
    with_offsets(&mut desk, 11.0, 0.04);
    desk.control.homed = true;
    with_offsets(&mut desk, 0.5, 0.04);
    assert!(!desk.has("homed_under_offset"), "{:?}", desk.conditions);
}

#[test]
fn a_normal_start_has_no_error_and_a_stop_of_a_homed_machine_is_one() {
    for prepare in [Prepare::Observe, Prepare::PowerOnAndHome] {
        let mut control = Control::new(State::usual());
        (control.homed, control.estop) = (false, true);
        let mut desk = Desk::with(control, prepare);
        desk.control.estop = false;
        desk.later(0.5);
        desk.control.homed = true;
        desk.later(0.5);
        let is_error = |condition: &Condition| condition.severity() == Severity::Error;
        assert!(
            !desk.conditions.iter().any(is_error),
            "{:?}",
            desk.conditions
        );
        assert!(desk.conditions.contains(&Condition::NotSwitchedOn));
        desk.control.estop = true;
        desk.later(0.5);
        assert!(desk.conditions.contains(&Condition::Estop { on: true }));
    }
}

#[test]
fn compensation_that_somebody_publishes_and_that_never_comes_is_said_once() {
    let never = |condition: &&Condition| {
        matches!(
            condition,
            Condition::CompensationNeverCame { publishers: 2, .. }
        )
    };
    let mut desk = Desk::new(State::usual());
    for _ in 0..30 {
        desk.tell(Input::Publishers(2));
        desk.later(1.0);
    }
    assert_eq!(
        desk.conditions.iter().filter(never).count(),
        1,
        "{:?}",
        desk.conditions
    );
    // Nobody publishes, or it comes, or the bridge is not active: nothing is missing.
    for (publishers, comes, active) in [(0, false, true), (2, true, true), (2, false, false)] {
        let mut desk = Desk::new(State::usual());
        desk.tell(Input::Active(active));
        for _ in 0..30 {
            desk.tell(Input::Publishers(publishers));
            if comes {
                let now_s = desk.now_s;
                desk.tell(offsets(now_s, 0.0));
            }
            desk.later(1.0);
        }
        assert_eq!(
            desk.conditions.iter().filter(never).count(),
            0,
            "{:?}",
            desk.conditions
        );
    }
}

#[test]
fn an_axis_that_a_message_leaves_out_has_no_offset() {
    let others: [AxisSet; 2] = [
        [Axis::Y, Axis::A].into_iter().collect(),
        std::iter::empty().collect(),
    ];
    for axes in others {
        let mut desk = Desk::new(State::usual());
        with_offsets(&mut desk, 0.5, 0.03);
        assert_eq!(passed_mm(&mut desk).last(), Some(&0.03));
        // Who published it has fallen silent; somebody else keeps the heart beating.
        let now_s = desk.now_s;
        desk.tell(offsets_of(axes, now_s, 0.02));
        desk.later(0.05);
        assert_eq!(passed_mm(&mut desk), [0.0], "{axes:?}");
    }
}

/// Spoils a set that comes at this time, s.
type Spoil = fn(&mut AxisCompensation, f64);

#[test]
fn offsets_that_contradict_themselves_or_are_not_of_now_are_refused_and_become_stale() {
    let bad: [(Spoil, &str); 6] = [
        (
            |sent, _| sent.state[Axis::X] = CompensationState::Off,
            "STATE_OFF",
        ),
        (
            |sent, _| sent.pulses[Axis::Y] = 4_900,
            "pulses and remainder",
        ),
        (|sent, _| sent.remainder[Axis::Z] = 0.0, "axis Z"),
        (|sent, now_s| sent.at = at(now_s - 3e7), "30000000 s ago"),
        (|sent, now_s| sent.at = at(now_s - 1.2), "1.2 s ago"),
        (|sent, now_s| sent.at = at(now_s + 3e8), "in the future"),
    ];
    for (spoil, word) in bad {
        let mut desk = Desk::new(State::usual());
        with_offsets(&mut desk, 0.5, 0.03);
        assert_eq!(passed_mm(&mut desk).last(), Some(&0.03));
        for _ in 0..40 {
            let now_s = desk.now_s;
            let Input::Compensation(mut sent) = offsets(now_s, 0.1) else {
                unreachable!()
            };
            spoil(&mut sent, now_s);
            desk.tell(Input::Compensation(sent));
            desk.later(0.05);
        }
        assert!(passed_mm(&mut desk).is_empty(), "{word}");
        let is_told = |condition: &&Condition| condition.to_string().contains(word);
        let refused =
            { desk.conditions.iter() }.filter(|told| told.name() == "compensation_refused");
        assert_eq!(refused.filter(is_told).count(), 40, "{word}");
        let is_stale = |told: &Condition| matches!(told, Condition::CompensationStale { .. });
        assert!(desk.conditions.iter().any(is_stale), "{word}");
        with_offsets(&mut desk, 0.5, 0.02);
        assert_eq!(passed_mm(&mut desk).last(), Some(&0.02), "{word}");
    }
}

#[test]
fn that_offsets_are_refused_ends_when_none_has_been_for_a_while() {
    let over = |desk: &Desk| {
        let is_over = |condition: &&Condition| {
            matches!(condition, Condition::CompensationRefusedNoMore { .. })
        };
        desk.conditions.iter().filter(is_over).count()
    };
    let mut desk = Desk::new(State::usual());
    // A bad set among good ones, again and again.
    for _ in 0..20 {
        let now_s = desk.now_s;
        desk.tell(offsets(now_s, 5.0));
        with_offsets(&mut desk, 0.4, 0.03);
    }
    assert!(desk.has("compensation_refused"));
    assert_eq!(over(&desk), 0, "it comes again");
    with_offsets(&mut desk, 5.0, 0.03);
    assert_eq!(over(&desk), 1, "once");
    let last = desk.conditions.iter().rev();
    let mut last = last.filter(|condition| condition.name() == "compensation_refused");
    assert_eq!(last.next().unwrap().severity(), Severity::Info);
}

/// Offsets of each author, 20 times a second.
fn two_publish(desk: &mut Desk, seconds_s: f64, wanted_mm: [Option<f64>; 2]) {
    let end_s = desk.now_s + seconds_s;
    while desk.now_s < end_s {
        for (author, mm) in [Author([1; 16]), Author([2; 16])]
            .into_iter()
            .zip(wanted_mm)
        {
            if let Some(mm) = mm {
                let now_s = desk.now_s;
                desk.stage.hears(at(now_s), author);
                desk.tell(offsets(now_s, mm));
            }
        }
        desk.later(0.05);
    }
}

fn publishers(desk: &Desk) -> Vec<Severity> {
    let of_them = { desk.conditions.iter() }
        .filter(|condition| condition.name() == "compensation_publishers");
    of_them.map(Condition::severity).collect()
}

#[test]
fn hal_is_given_zero_while_two_publish_and_one_alone_is_followed_again() {
    for other_mm in [0.02, -0.03, 0.0, 5.0] {
        let mut desk = Desk::new(State::usual());
        two_publish(&mut desk, 1.0, [Some(0.03), None]);
        assert_eq!(passed_mm(&mut desk), [0.03]);
        two_publish(&mut desk, 5.0, [Some(0.03), Some(other_mm)]);
        assert_eq!(passed_mm(&mut desk), [0.0], "{other_mm}");
        assert_eq!(publishers(&desk), [Severity::Error]);
        assert!(!desk.has("compensation_refused"));
        two_publish(&mut desk, 3.0, [Some(0.03), None]);
        assert_eq!(passed_mm(&mut desk), [0.03], "{other_mm}");
        assert_eq!(publishers(&desk), [Severity::Error, Severity::Info]);
    }
    // Who was started anew takes over.
    let mut desk = Desk::new(State::usual());
    two_publish(&mut desk, 1.0, [Some(0.03), None]);
    two_publish(&mut desk, 2.0, [None, Some(0.02)]);
    assert_eq!(passed_mm(&mut desk), [0.03, 0.02]);
    assert!(publishers(&desk).is_empty());
}

#[test]
fn what_touches_is_refused_or_stopped_while_two_publish() {
    let touching = "G21 G90\nG0 X5\nG38.2 Z-8 F60\nM2\n";
    let mut desk = Desk::new(State::usual());
    two_publish(&mut desk, 1.0, [Some(0.03), Some(-0.03)]);
    desk.begin(touching);
    // Nobody has spoken for 4 s by then, but it was refused before.
    let (outcome, message) = desk.ending();
    assert_eq!(outcome, Outcome::Refused);
    assert!(
        message.contains("two publishers of compensation"),
        "{message}"
    );
    desk.endings.clear();
    desk.begin("G21 G90\nG1 X5 F60\nM2\n");
    two_publish(&mut desk, 1.0, [Some(0.03), Some(-0.03)]);
    assert!(desk.control.running, "what does not touch runs on");
    desk.run_out();
    assert_eq!(desk.ending().0, Outcome::Done);
    desk.endings.clear();
    desk.begin(touching);
    assert!(desk.control.running);
    desk.sample(1.0, 0, 1, 2);
    two_publish(&mut desk, 1.0, [Some(0.03), Some(-0.03)]);
    desk.control.running = false;
    two_publish(&mut desk, 4.0, [Some(0.03), Some(-0.03)]);
    let (outcome, message) = desk.ending();
    assert_eq!(outcome, Outcome::Fault, "{message}");
    assert!(
        message.contains("two publishers of compensation"),
        "{message}"
    );
}
