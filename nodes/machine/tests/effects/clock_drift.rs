//! A clock's drift between two runs of one line.

use machine::twin::{Channel, History};
use metrology::Axis;

use crate::past::{predict, read};
use crate::scene::{bench, run};

/// By how much the readings of a line at 20 mm/s are late that begins at an instant, s.
fn late_s(begins_s: f64) -> f64 {
    let machine = bench();
    let mut line = run(3000, machine.axis_set(), |t| {
        [20.0 * t, 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    for time in &mut line.motion.time_s {
        *time += begins_s;
    }
    read(&mut line, &Channel::Length(Axis::X));
    let given = [("drift_ppm", 10.0)];
    let seen = predict(
        &machine,
        &History::default(),
        &line,
        ("clock_drift", "length"),
        &given,
    );
    -seen[1500] / 20.0
}

#[test]
fn val_clock_drift_between_two_runs() {
    // 10 ppm of 30 min.
    let (first, second) = (late_s(600.0), late_s(2400.0));
    println!("drift: {first} s, then {second} s");
    assert!((second - first - 18e-3).abs() < 1e-9, "{first} {second}");
    assert!((first - 10e-6 * 601.5).abs() < 1e-9, "{first}");
}
