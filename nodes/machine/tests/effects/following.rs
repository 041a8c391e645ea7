//! The nominal following error against the loop itself.

use machine::effects;
use machine::twin::Following;
use metrology::Axis;

use crate::scene::{TICK_S, bench, circle, greatest, integrate, respond};

#[test]
fn val_the_loop_integrated_finely() {
    let machine = bench();
    let (radius_mm, feed_mm_s) = (50.0, 100.0);
    let run = circle(radius_mm, feed_mm_s, 1.0);
    let response = respond(&machine, &run, &Following);
    let x = machine.linear(Axis::X).unwrap();
    let (gain, left) = (x.position_gain_per_s, 1.0 - x.velocity_feedforward);
    let rate = feed_mm_s / radius_mm;
    let loop_of = |t: f64, x: &[f64; 1]| {
        let (sin, cos) = (rate * t).sin_cos();
        let velocity = -radius_mm * rate * sin;
        [gain * (radius_mm * cos - x[0]) + (1.0 - left) * velocity]
    };
    let ticks = run.motion.len();
    let motor = integrate([radius_mm], TICK_S / 10.0, 10 * (ticks - 1), 10, loop_of);
    // The run begins at rest here, in motion there: forgotten after a quarter of a second.
    let off = (250..ticks).map(|k| {
        let command = run.motion.position[Axis::X][k];
        motor[k][0] - command - response.servo[Axis::X][k]
    });
    let off_um = greatest(off) * 1e3;
    let most_um = greatest(response.servo[Axis::X].iter().copied()) * 1e3;
    println!("following error {most_um:.2} um, off by {off_um:.2e} um");
    assert!(off_um < 1e-3, "{off_um}");
}

#[test]
fn eq2_constant_velocity_leaves_what_feedforward_misses() {
    let machine = bench();
    let run = crate::scene::run(500, metrology::AxisSet::XYZ, |t| {
        [20.0 * t, 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let response = respond(&machine, &run, &Following);
    for error in &response.servo[Axis::X] {
        assert!((error + 0.02 * 20.0 / 60.0).abs() < 1e-12, "{error}");
    }
}

#[test]
fn the_machine_as_described_has_its_loops_and_its_listed_effects() {
    let mut machine = bench();
    assert_eq!(effects::known(&machine).unwrap().len(), 1);
    let kind = effects::kind("backlash").unwrap();
    let target = &kind.targets_on(&machine)[0];
    machine.effects = vec![kind.entry(target, &kind.typical())];
    assert_eq!(effects::known(&machine).unwrap().len(), 2);
}
