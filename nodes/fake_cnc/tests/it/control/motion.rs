//! Programs from request to end, refusals and faults.

use super::*;

#[test]
fn a_program_ends_exactly_where_it_says() {
    let mut shop = shop(Bench::open());
    let text = "G21 G90 (go)\nG0 X12.345 Y-6.789\nF3000 G1 Z33.3 A-10.5 C123.4\nG2 X22.345 I5\nG91 G1 X0.1 X-0\nM2";
    assert_eq!(shop.run(text).0, Outcome::Refused);
    let (outcome, message, line) = shop.run(&text.replace(" X-0", ""));
    assert_eq!((outcome, message.as_str(), line), (Outcome::Done, "", 6));
    let at = *shop.cnc.commanded();
    let expected = [
        22.345 + 0.1,
        -6.789,
        33.3,
        (-10.5_f64).to_radians(),
        0.0,
        123.4_f64.to_radians(),
    ];
    for (at, expected) in at.0.iter().zip(expected) {
        assert!((at - expected).abs() < 1e-12, "{at} {expected}");
    }
    shop.pass_ms(500);
    let last = shop.states().pop().unwrap();
    for axis in last.axes.iter() {
        assert!(
            (last.motor[axis] - at[axis]).abs() < 1e-6,
            "{axis} {}",
            last.motor[axis] - at[axis]
        );
    }
}

#[test]
fn following_error_opens_the_loop_and_faults() {
    let mut bench = Bench::open();
    bench.jammed = true;
    let mut shop = shop(bench);
    let (outcome, message, line) = shop.run("F3000\nG1 X50 Y50\nM2");
    assert_eq!((outcome, line), (Outcome::Fault, 2));
    assert!(
        message.contains("axis Y follows with an error of"),
        "{message}"
    );
    assert!(message.contains("limit 1"), "{message}");
    let state = shop.states().pop().unwrap();
    assert!((state.commanded[Axis::X] - state.motor[Axis::X]).abs() < 1e-9);
    assert!(state.velocity[Axis::X].abs() < 1e-3);
    // What still moves can be moved.
    assert_eq!(shop.run("G0 X0\nM2").0, Outcome::Done);
}

#[test]
fn cancel_slows_down_along_the_path_and_ends_stopped() {
    let mut shop = shop(Bench::open());
    shop.request("F12000\nG1 X100 Y50\nG1 X200\nM2");
    shop.pass_ms(300);
    shop.tell(Input::CancelProgram { goal: 8 });
    shop.tell(Input::CancelProgram { goal: 7 });
    let (outcome, message, line) = shop.finish();
    assert_eq!(
        (outcome, message.as_str(), line),
        (Outcome::Stopped, "line 2: cancelled", 2)
    );
    assert_eq!(
        shop.diagnostics(),
        [Diagnostic::NothingToCancel { goal: 8 }]
    );
    let at = *shop.cnc.commanded();
    assert!(
        (at[Axis::X] - 2.0 * at[Axis::Y]).abs() < 1e-9,
        "on its path"
    );
    let accelerations = shop.states().windows(3).fold(0.0_f64, |most, w| {
        let second =
            w[2].commanded[Axis::X] - 2.0 * w[1].commanded[Axis::X] + w[0].commanded[Axis::X];
        most.max(second.abs() / 1e-6)
    });
    assert!(accelerations <= 3000.0, "{accelerations}");
}

#[test]
fn a_second_program_is_refused_while_one_runs() {
    let mut shop = shop(Bench::open());
    shop.request("G4 P1\nM2");
    shop.tell(Input::RunProgram {
        goal: 9,
        text: "M2".to_owned(),
        name: String::new(),
    });
    let refused = Output::Refused {
        goal: 9,
        message: "program 7 is running".to_owned(),
    };
    assert_eq!(shop.out.last(), Some(&refused));
    assert_eq!(shop.finish().0, Outcome::Done);
}

#[test]
fn out_of_travel_is_refused_before_anything_moves() {
    let mut shop = shop(Bench::open());
    let (outcome, message, _) = shop.run("G0 X100\nG0 X-320.001\nM2");
    assert_eq!(outcome, Outcome::Refused);
    assert_eq!(
        message,
        "line 2, column 4: axis X would go to -320.001 mm, limit -320 mm"
    );
    let (_, message, _) = shop.run("G1 F0 X5\nM2");
    assert_eq!(
        message,
        "line 1, column 1: G1 needs a feed, F is 0: must be above 0"
    );
    shop.pass_ms(100);
    assert!(
        shop.cnc
            .hardware()
            .feedback
            .motor
            .0
            .iter()
            .all(|x| x.abs() <= 0.0)
    );
}

#[test]
fn the_plant_follows_within_its_lag_and_comes_to_rest() {
    let truth = PlantFile::from_yaml(PLANT).unwrap();
    let machine = machine();
    let plant = Plant::new(&machine, &truth).unwrap();
    let mut shop = Shop::new(&Config::default(), &machine, plant);
    let (outcome, message, _) = shop
        .run("F6000 G1 X150 Y-100 Z120\nA-30 C90\nG2 X100 I-25\nG0 X0 Y0 Z20 A0 C0\nG4 P0.5\nM2");
    assert_eq!((outcome, message), done());
    let states = shop.states();
    let worst = |axis: Axis| {
        states
            .iter()
            .map(|s| (s.commanded[axis] - s.motor[axis]).abs())
            .fold(0.0, f64::max)
    };
    for axis in Axis::LINEAR {
        assert!(worst(axis) < 0.1, "{axis}: {} mm", worst(axis));
    }
    let last = states.last().unwrap();
    for axis in last.axes.iter() {
        let rest = (last.commanded[axis] - last.motor[axis]).abs();
        assert!(
            rest < if axis.is_linear() { 1e-3 } else { 1e-5 },
            "{axis}: {rest}"
        );
    }
}
