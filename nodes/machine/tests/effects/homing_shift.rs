//! A shifted reference point against a counter.

use machine::twin::{Channel, History};
use metrology::Axis;

use crate::past::{instants, predict, read, stands};
use crate::scene::bench;

#[test]
fn val_homing_shift_counter() {
    let machine = bench();
    let pulse_mm = 1e-4;
    let mut run = stands(&instants(8, 300.0), |k| [10.0 * k as f64, 0.0, 0.0]);
    read(&mut run, &Channel::Scale(Axis::X));
    read(&mut run, &Channel::Motor(Axis::X));
    let given = [("shift_um", 2.3), ("at_min", 17.0)];
    let on = ("homing_shift", "X");
    let seen = predict(&machine, &History::default(), &run, on, &given);
    let mut index_pulses = 0_i64;
    for (k, at_s) in run.motion.time_s.iter().enumerate() {
        if *at_s > 1020.0 {
            // The counter was set to zero 23 pulses further on.
            index_pulses = 23;
        }
        let command_mm = run.motion.position[Axis::X][k];
        let counted = (command_mm / pulse_mm).round() as i64;
        let slide_mm = (counted + index_pulses) as f64 * pulse_mm;
        assert!(
            (seen[k] - (slide_mm - command_mm)).abs() < 1e-9,
            "{k}: {}",
            seen[k]
        );
        assert!(seen[k + 8].abs() < 1e-15, "the motor's encoder believes it");
    }
}
