//! The state that programs leave to each other.

use super::*;
use fake_cnc::rs274::Registers;

#[test]
fn offsets_stay_from_program_to_program_and_positions_are_those_of_the_machine() {
    let mut shop = shop(Bench::open());
    assert_eq!(
        shop.run("G10 L2 P1 X10 Y5 R90\nG92 Z-3\nM2").0,
        Outcome::Done
    );
    assert_eq!(shop.run("G21 G90\nG0 X20 Y2 Z4\nM2").0, Outcome::Done);
    let at = shop.cnc.commanded().xyz();
    // Turned by 90 degrees: machine X = 10 - 2, machine Y = 5 + 20; Z was called -3 where it is 0.
    assert!(
        (at - nalgebra::Vector3::new(8.0, 25.0, 7.0)).norm() < 1e-9,
        "{at}"
    );
    let last = *shop.states().last().unwrap();
    assert!((last.commanded[Axis::X] - 8.0).abs() < 1e-9);
    let (outcome, message, _) = shop.run("G0 X320\nM2");
    assert_eq!(outcome, Outcome::Refused);
    assert_eq!(
        message,
        "line 1, column 4: axis Y would go to 325 mm, limit 270 mm"
    );
}

#[test]
fn m2_resets_and_an_end_before_it_leaves_the_state_of_its_line() {
    let mut shop = shop(Bench::open());
    shop.run("G91 G18 G55 G20\nM2");
    let state = *shop.cnc.registers();
    assert!(state.system == 0 && !state.modes.is_incremental && state.modes.is_inch);
    // Called off in the first motion: what follows it has not been done.
    shop.request("G21 G91 G56\nF600 G1 X50\nG90 G57\nG1 X0\nM2");
    shop.pass_ms(500);
    shop.tell(Input::CancelProgram { goal: 7 });
    assert_eq!(shop.finish().0, Outcome::Stopped);
    let state = *shop.cnc.registers();
    assert!(state.system == 2 && state.modes.is_incremental, "{state:?}");
    // A touch that misses leaves the state of its line as well.
    shop.run("G90 G54\nM2");
    let (outcome, ..) = shop.run("G58\nF600 G38.2 Z-4\nG59\nM2");
    assert_eq!(outcome, Outcome::ProbeMissed);
    assert_eq!(shop.cnc.registers().system, 4);
    // A refused program changes nothing.
    let before = *shop.cnc.registers();
    assert_eq!(shop.run("G55 G20\nG77\nM2").0, Outcome::Refused);
    assert_eq!(*shop.cnc.registers(), before);
}

#[test]
fn a_program_without_changes_leaves_a_control_as_it_was_switched_on() {
    let mut shop = shop(Bench::new(-3.0, 0.001));
    for text in [
        "G21 G90 G17\nG0 X1\nM2",
        "F600 G38.2 Z-8\nG0 Z0\nM2",
        "S1000 M3\nG4 P0.1\nM2",
    ] {
        assert_eq!(shop.run(text).0, Outcome::Done);
        assert_eq!(*shop.cnc.registers(), Registers::default());
    }
}

#[test]
fn changes_of_state_between_motions_make_no_stop() {
    let time = |text: &str| {
        let mut shop = shop(Bench::open());
        shop.run(text);
        shop.states().len()
    };
    let plain = time("F6000 G1 X20\nG1 X40\nG1 X60\nM2");
    let changing =
        time("G10 L2 P2 X10\nF6000 G1 X20\nG55 G91 G1 X20\nG90 G92 X0\nG52 X0\nG54 X60\nM2");
    assert_eq!(plain, changing);
    let stopping = time("G61.1 F6000 G1 X20\nG1 X40\nG1 X60\nM2");
    assert!(stopping > plain + 40, "{stopping} {plain}");
}

#[test]
fn touches_in_a_turned_system_latch_machine_coordinates() {
    let mut shop = shop(Bench::new(-3.0, 0.0));
    let text = "G10 L2 P1 X5 R30\nG92 Z1\n(feature: top)\nF300 G38.2 Z-8\nG0 Z1\nM2";
    let (outcome, message, _) = shop.run(text);
    assert_eq!((outcome, message), done());
    let [touch] = &shop.triggers()[..] else {
        panic!("one touch");
    };
    assert!(
        (touch.latched[Axis::Z] + 3.0).abs() < 2e-3,
        "{}",
        touch.latched[Axis::Z]
    );
    assert!((touch.approach + nalgebra::Vector3::z()).norm() < 1e-12);
    assert!(shop.cnc.commanded()[Axis::Z].abs() < 1e-9);
    // Along the program's X, which is turned: the approach is the machine's.
    let mut program = String::from("G10 L2 P1 R30\n");
    program.push_str("F300 G91 G38.3 X1\nM2");
    shop.run(&program);
    let at = shop.cnc.commanded();
    let angle = (at[Axis::Y] / at[Axis::X]).atan().to_degrees();
    assert!((angle - 30.0).abs() < 1e-9, "{angle}");
}
