//! One modal state after the other.

use linuxcnc_bridge::Input;
use linuxcnc_bridge::run::Outcome;
use linuxcnc_bridge::stage::IoEvent;
use machine::program_frame::HEAD;
use machine::program_machine::marked;
use metrology::Severity;
use rand::Rng as _;
use rand::SeedableRng as _;
use rand_pcg::Pcg64Mcg;

use crate::frame::control::{Control, State};
use crate::frame::desk::{Desk, MARK};

fn program() -> String {
    format!("{HEAD}G0 Z439\nG0 X-226 Y-174\nG1 Z14 F3600\nM2\n")
}

#[test]
fn a_program_for_another_machine_file_is_refused_and_one_for_its_own_is_run() {
    for (mark, is_own) in [
        (MARK, true),
        (MARK + 1, false),
        (0, false),
        (u64::MAX, false),
    ] {
        let mut desk = Desk::new(State::usual());
        desk.begin(&marked(&program(), mark));
        assert_eq!(desk.control.running, is_own, "{mark:x}");
        assert_eq!(desk.stored.is_empty(), !is_own, "{:?}", desk.stored);
        if is_own {
            desk.run_out();
            assert_eq!(desk.ending().0, Outcome::Done);
            continue;
        }
        let (outcome, message) = desk.ending();
        assert_eq!(outcome, Outcome::Refused);
        assert!(message.contains("another machine file"), "{message}");
    }
}

/// What the contract asks for.
const ASSERTED: [&str; 9] = [
    "G21", "G90", "G17", "G40", "G49", "G80", "G94", "G91.1", "G61",
];

fn state(change: impl FnOnce(&mut State)) -> State {
    let mut state = State::usual();
    change(&mut state);
    state
}

/// Whether a program of the machine frame may run in a state at all.
fn is_runnable(state: &State) -> bool {
    let shifted = state.g92_active && state.g92.iter().any(|offset| *offset != 0.0);
    let free = state
        .systems
        .iter()
        .any(|system| system.iter().all(|value| *value == 0.0));
    !shifted && free && state.has("G40")
}

/// Runs the program in `found`: refused or in the machine's frame, and everything as it was.
#[track_caller]
fn check(found: &State, spindle: bool) {
    let mut control = Control::new(found.clone());
    control.spindle = spindle;
    let mut desk = Desk::with(control, linuxcnc_bridge::config::Prepare::Observe);
    desk.begin(&program());
    if is_runnable(found) {
        let began_in = { desk.control.began_in.first() }
            .unwrap_or_else(|| panic!("{found:?}: {:?}", desk.endings));
        for code in ASSERTED {
            assert!(began_in.has(code), "{code} of {found:?}");
        }
        let free = { began_in.systems.iter() }.position(|s| s.iter().all(|value| *value == 0.0));
        assert_eq!(Some(began_in.active[6]), free, "the first free one");
        assert!(began_in.tool_mm.iter().all(|offset| *offset == 0.0));
        let first_line = desk.stored[0].lines().next().unwrap();
        assert_eq!(desk.stored[0].lines().count(), program().lines().count());
        assert!(
            first_line.starts_with("(frame: machine) G5"),
            "{first_line}"
        );
        desk.run_out();
        assert_eq!(desk.ending(), (Outcome::Done, ""));
    } else {
        let (outcome, message) = desk.ending();
        assert_eq!(outcome, Outcome::Refused, "{found:?}");
        assert!(message.starts_with("machine coordinates: "), "{message}");
        assert!(desk.control.began_in.is_empty());
    }
    let mut left = desk.control.state.clone();
    // G1 of inverse time feed cannot be set by its word alone.
    if found.has("G93") && found.has("G1") {
        left.active[0] = found.active[0];
    }
    for (left, found) in left.tool_mm.iter_mut().zip(found.tool_mm) {
        assert!((*left - found).abs() < 1e-6);
        *left = found;
    }
    assert!(
        (left.feed - found.feed).abs() < 1e-3,
        "{} {}",
        left.feed,
        found.feed
    );
    left.feed = found.feed;
    if spindle && found.has("G64") {
        left.path_tolerance = found.path_tolerance;
    }
    assert_eq!(&left, found);
    let errors: Vec<_> = { desk.conditions.iter() }
        .filter(|condition| condition.severity() == Severity::Error)
        .collect();
    assert!(errors.is_empty(), "{errors:?}");
    // M72 would turn the spindle on again, so that the tolerance is not kept.
    let lost = spindle && found.has("G64") && is_runnable(found);
    assert_eq!(desk.has("modal_state"), lost, "{:?}", desk.conditions);
}

#[test]
fn every_state_that_a_job_leaves_is_run_in_the_machines_frame_or_refused_and_is_there_again() {
    check(&State::usual(), false);
    check(&state(|s| s.systems[0][0] = 1.5), false);
    check(&state(|s| s.systems[0][0] = 10.0), false);
    check(&state(|s| s.systems[0][9] = 0.5), false);
    check(&state(|s| (s.g92_active, s.g92[1]) = (true, 3.0)), false);
    check(&state(|s| (s.g92_active, s.g92[0]) = (true, 2.0)), false);
    // Offsets that are there and not active, and active without an offset.
    check(&state(|s| s.g92[1] = 3.0), false);
    check(&state(|s| s.g92_active = true), false);
    check(&state(|s| s.tool_mm[2] = 80.25).with("G43"), false);
    check(
        &state(|s| s.tool_mm[2] = 80.25).with("G43").with("G20"),
        false,
    );
    check(&state(|s| s.mode = "MDI").with("G91"), false);
    check(&state(|s| s.feed = 47.244_094).with("G20"), false);
    check(&State::usual().with("G18").with("G56"), false);
    check(&State::usual().with("G93"), false);
    check(&State::usual().with("G95"), false);
    check(&State::usual().with("G90.1"), false);
    check(&State::usual().with("G7"), false);
    check(&state(|s| s.path_tolerance = 0.05).with("G64"), false);
    check(&state(|s| s.path_tolerance = 0.05).with("G64"), true);
    check(&State::usual().with("G41"), false);
    check(
        &state(|s| s.systems.iter_mut().for_each(|system| system[2] = -1.0)),
        false,
    );
    check(
        &state(|s| {
            s.systems[..8]
                .iter_mut()
                .for_each(|system| system[3] = 90.0)
        }),
        false,
    );
}

#[test]
fn prop_any_combination_of_states_is_run_in_the_machines_frame_or_refused_and_is_there_again() {
    let mut rng = Pcg64Mcg::seed_from_u64(20_261_126);
    for _ in 0..400 {
        let mut found = State::usual();
        for code in [
            "G0", "G1", "G18", "G19", "G41", "G20", "G91", "G93", "G95", "G55", "G59.3", "G61.1",
            "G64", "G90.1", "G7",
        ] {
            if rng.random_bool(0.15) {
                found.set(code);
            }
        }
        found.mode = ["MANUAL", "AUTO", "MDI"][rng.random_range(0..3)];
        found.feed = f64::from(rng.random_range(0..100_000_u32)) / 64.0;
        found.rpm = f64::from(rng.random_range(0..3_u32)) * 500.0;
        let share = [0.0, 0.3, 0.9, 1.0][rng.random_range(0..4)];
        for system in &mut found.systems {
            if rng.random_bool(share) {
                let axis = rng.random_range(0..10);
                system[axis] = f64::from(rng.random_range(-2_000_000..2_000_000_i32)) / 1024.0;
            }
        }
        if rng.random_bool(0.3) {
            found.set("G43");
            found.tool_mm[rng.random_range(0..3)] =
                f64::from(rng.random_range(1..20_000_u32)) / 64.0;
        }
        found.g92_active = rng.random_bool(0.2);
        if rng.random_bool(0.2) {
            found.g92[rng.random_range(0..9)] = f64::from(rng.random_range(-300..300_i32)) / 8.0;
        }
        if found.has("G64") {
            found.path_tolerance = 0.01;
        }
        check(&found, rng.random_bool(0.1));
    }
}

#[test]
fn refusals_name_the_offset_its_size_and_what_to_do() {
    let told = |found: State| {
        let mut desk = Desk::new(found);
        desk.begin(&program());
        desk.ending().1.to_owned()
    };
    let g92 = told(state(|s| (s.g92_active, s.g92[1]) = (true, 3.0)));
    assert_eq!(
        g92,
        "machine coordinates: G92 or G52 shifts the axes by Y 3 mm: clear it at the control (G92.1, or G52 X0 Y0 Z0)"
    );
    let all = told(state(|s| {
        s.systems.iter_mut().for_each(|system| system[0] = 1.5)
    }));
    assert!(
        all.contains("G54 X 1.5 mm; G55 X 1.5 mm") && all.contains("G10 L2 P9"),
        "{all}"
    );
    let cutter = told(State::usual().with("G41"));
    assert!(cutter.contains("G41") && cutter.contains("G40"), "{cutter}");
}

/// Nothing is begun where what was asserted is not there, or where it is not seen.
#[test]
fn what_is_not_verified_is_not_run() {
    let refused = |change: fn(&mut Control), words: &[&str]| {
        let mut control = Control::new(State::usual().with("G91"));
        change(&mut control);
        let mut desk = Desk::with(control, linuxcnc_bridge::config::Prepare::Observe);
        desk.begin(&program());
        desk.later(40.0);
        let (outcome, message) = desk.ending();
        assert_eq!(outcome, Outcome::Refused);
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
        assert!(desk.control.began_in.is_empty() && desk.control.state.has("G91"));
        assert_eq!(desk.control.state.mode, "MANUAL");
    };
    refused(
        |control| control.stubborn = Some("G90"),
        &["G90 did not become active"],
    );
    refused(
        |control| control.hidden_mm = 0.25,
        &["still shifts its axes by X 0.25 mm"],
    );
    refused(
        |control| control.robbed = true,
        &["did not report its offsets", "another user interface"],
    );
}

/// A busy computer holds LinuxCNC's interpreter up.
#[test]
fn offsets_that_are_reported_late_are_waited_for() {
    let mut control = Control::new(State::usual().with("G91"));
    control.withheld = true;
    let mut desk = Desk::with(control, linuxcnc_bridge::config::Prepare::Observe);
    desk.begin(&program());
    desk.later(6.0);
    assert!(desk.endings.is_empty() && desk.control.began_in.is_empty());
    desk.control.withheld = false;
    desk.later(4.0);
    assert_eq!(desk.control.began_in.len(), 1);
    assert!(desk.control.began_in[0].has("G90"));
}

/// LinuxCNC's positions follow its line of active codes: neither before nor after a program is the first answer the last word.
#[test]
fn positions_that_follow_the_active_codes_later_are_waited_for() {
    let mut control = Control::new(State::usual().with("G55"));
    control.state.systems[1][0] = -10.0;
    control.hidden_mm = -10.0;
    let mut desk = Desk::with(control, linuxcnc_bridge::config::Prepare::Observe);
    desk.begin(&program());
    desk.later(6.0);
    assert!(desk.endings.is_empty() && desk.control.began_in.is_empty());
    desk.control.hidden_mm = 0.0;
    desk.later(4.0);
    assert_eq!(desk.control.began_in.len(), 1);
    desk.control.behind_mm = 10.0;
    desk.run_out();
    desk.later(2.0);
    assert!(desk.endings.is_empty());
    desk.control.behind_mm = 0.0;
    desk.later(4.0);
    assert_eq!(desk.ending(), (Outcome::Done, ""));
}

#[test]
fn a_program_of_its_authors_own_runs_in_the_state_that_is_there() {
    let mut found = State::usual().with("G91").with("G18");
    found.systems[0][0] = 10.0;
    let mut desk = Desk::new(found);
    desk.begin("G21\nG1 X1 F60\nM2\n");
    assert!(desk.control.began_in[0].has("G91") && desk.control.began_in[0].has("G18"));
    assert!(
        desk.control
            .told
            .iter()
            .all(|line| !line.starts_with("set mdi"))
    );
    assert_eq!(desk.stored[0], "G21\nG1 X1 F60\nM2\n");
    desk.run_out();
    assert!(
        desk.control.state.has("G90"),
        "M2's resets are its author's own"
    );
}

#[test]
fn a_program_that_would_shift_the_machines_frame_is_refused_with_its_line() {
    let mut desk = Desk::new(State::usual());
    desk.begin("(frame: machine)\nG21 G90\nG54\nG0 X1\nM2\n");
    let (outcome, message) = desk.ending();
    assert_eq!(outcome, Outcome::Refused);
    assert!(
        message.starts_with("line 3: G54 shifts coordinates"),
        "{message}"
    );
}

/// Called off, in whatever step: the state is there again.
#[test]
fn an_aborted_program_leaves_the_state_as_it_was_found() {
    for after_s in [0.0, 0.005, 0.01, 0.02, 0.03, 0.05, 0.2, 3.0] {
        let mut found = State::usual()
            .with("G91")
            .with("G20")
            .with("G55")
            .with("G43");
        found.tool_mm[2] = 12.5;
        let mut desk = Desk::new(found.clone());
        desk.tell(Input::Goal {
            goal: 7,
            program: program(),
        });
        desk.later(after_s);
        desk.tell(Input::Cancel { goal: 7 });
        desk.later(5.0);
        assert_eq!(desk.ending().0, Outcome::Stopped, "{after_s}");
        assert!((desk.control.state.tool_mm[2] - 12.5).abs() < 1e-6);
        desk.control.state.tool_mm = found.tool_mm;
        desk.control.state.feed = found.feed;
        assert_eq!(desk.control.state, found, "after {after_s} s");
        assert!(!desk.has("modal_state"), "{:?}", desk.conditions);
    }
}

#[test]
fn what_cannot_be_put_back_is_said() {
    // The tolerance of G64 is gone after an abort.
    let mut desk = Desk::new(state(|s| s.path_tolerance = 0.05).with("G64"));
    desk.begin(&program());
    desk.tell(Input::Cancel { goal: 7 });
    desk.later(5.0);
    assert!(
        desk.control.state.has("G64") && desk.has("modal_state"),
        "{:?}",
        desk.conditions
    );
    // Nothing can be set with the emergency stop on, or without a connection.
    let mut desk = Desk::new(State::usual().with("G91"));
    desk.begin(&program());
    (desk.control.estop, desk.control.running) = (true, false);
    desk.later(1.0);
    assert_eq!(desk.ending().0, Outcome::Fault);
    assert!(desk.has("modal_state"), "{:?}", desk.conditions);
    let mut desk = Desk::new(State::usual().with("G91"));
    desk.begin(&program());
    desk.tell(Input::Io(IoEvent::Closed {
        reason: "gone".to_owned(),
    }));
    assert_eq!(desk.ending().0, Outcome::Fault);
    assert!(desk.has("modal_state"), "{:?}", desk.conditions);
}

/// The first moves go where the program says, or the program ends before it comes near anything.
#[test]
fn a_machine_that_stands_elsewhere_than_its_program_is_stopped() {
    for (z_mm, astray) in [
        (439.0, false),
        (439.005, false),
        (440.5, true),
        (429.0, true),
    ] {
        let mut desk = Desk::new(State::usual().with("G91"));
        desk.begin(&program());
        // Line 3 of the text is G0 Z439; line 4 goes across.
        for step in 0..20 {
            desk.sample(z_mm - 2.0 + f64::from(step.min(10)) * 0.2, 0, 1, 3);
        }
        desk.sample(z_mm, 0, 1, 4);
        desk.sample(z_mm, 0, 1, 4);
        assert_eq!(desk.has("axis_astray"), astray, "{z_mm}");
        assert_eq!(
            desk.control.told.iter().any(|line| line == "set abort"),
            astray
        );
        if astray {
            desk.later(5.0);
            let (outcome, message) = desk.ending();
            assert_eq!(outcome, Outcome::Refused, "{message}");
            assert!(message.contains("axis Z to 439.000 mm"), "{message}");
            assert!(desk.control.state.has("G91"));
        }
    }
}

/// An abort in the first move is no machine that stands elsewhere.
#[test]
fn a_move_that_was_not_ended_is_not_compared() {
    let mut desk = Desk::new(State::usual());
    desk.begin(&program());
    for step in 0..20 {
        desk.sample(100.0 + f64::from(step), 0, 1, 3);
    }
    for _ in 0..5 {
        desk.sample(119.0, 0, 0, 0);
    }
    assert!(!desk.has("axis_astray"));
}

#[test]
fn a_touch_outside_a_touch_stops_the_program_with_line_and_position() {
    for (motion_type, tripped) in [(1, true), (2, true), (3, true), (5, false), (0, false)] {
        let mut desk = Desk::new(State::usual());
        desk.begin(&program());
        desk.sample(14.0, 0, motion_type, 5);
        desk.sample(13.9, 0, motion_type, 5);
        desk.sample(13.8, 1, motion_type, 5);
        desk.sample(13.7, 1, motion_type, 5);
        assert_eq!(desk.has("probe_tripped"), tripped, "{motion_type}");
        assert_eq!(
            desk.control.told.iter().any(|line| line == "set abort"),
            tripped
        );
        if tripped {
            desk.later(5.0);
            let (outcome, message) = desk.ending();
            assert_eq!(outcome, Outcome::Fault, "{message}");
            assert!(
                message.contains("line 5") && message.contains("Z 13.800 mm"),
                "{message}"
            );
        }
    }
}
