//! Interpolation error against the arctangent of a pair of signals that are not quite right, and against a loop that is
//! integrated finely.

use std::f64::consts::{PI, TAU};

use machine::MachineFile;
use machine::file::{AxisEntry, PositionFeedback};
use metrology::{Axis, AxisSet};

use crate::scene::{TICK_S, greatest, response_of, run, three_axes};

const PERIOD_MM: f64 = 0.02;
const GAIN_PER_S: f64 = 60.0;
const FEEDFORWARD: f64 = 0.9;

/// X with an ideal velocity loop.
fn machine(position_feedback: PositionFeedback) -> MachineFile {
    let mut machine = three_axes("[w X' Y' b Z t]");
    let Some(AxisEntry::Linear(x)) = machine.axes.get_mut(&Axis::X) else {
        unreachable!("X is linear")
    };
    x.scale_resolution_um = Some(0.1);
    x.position_feedback = position_feedback;
    x.velocity_loop = None;
    (x.position_gain_per_s, x.velocity_feedforward) = (GAIN_PER_S, FEEDFORWARD);
    machine
}

#[test]
fn val_the_arctangent_of_two_unequal_signals() {
    let (offset, unequal) = (0.02, 0.03);
    let mut machine = machine(PositionFeedback::Motor);
    if let Some(AxisEntry::Linear(x)) = machine.axes.get_mut(&Axis::X) {
        x.velocity_feedforward = 1.0;
    }
    let run = run(3000, AxisSet::XYZ, |t| [0.02 * t, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let per_rad_um = PERIOD_MM * 1e3 / TAU;
    let given = [
        ("sin_um", -offset * per_rad_um),
        ("cos_um", 0.0),
        ("period_um", 20.0),
        ("free_sin2_um", -0.5 * unequal * per_rad_um),
    ];
    let response = response_of(&machine, &run, "interpolation_error", "X", &given);
    let off = run.motion.position[Axis::X]
        .iter()
        .zip(&response.servo[Axis::X]);
    let off_um = greatest(off.map(|(u, error)| {
        let phase = TAU * u / PERIOD_MM;
        let (sin, cos) = phase.sin_cos();
        let read = sin.atan2((1.0 + unequal) * cos + offset);
        let ahead = (read - phase + PI).rem_euclid(TAU) - PI;
        // The loop holds the reading at the command, so that the slide is off the other way.
        -ahead * per_rad_um - error * 1e3
    }));
    let most_um = greatest(response.servo[Axis::X].iter().copied()) * 1e3;
    println!("interpolation {most_um:.4} um, off by {off_um:.4} um");
    assert!(off_um < 0.05 * most_um, "{off_um} {most_um}");
    let seen = response.servo[Axis::X]
        .iter()
        .zip(&response.motor_reading[Axis::X]);
    let seen_um = greatest(seen.map(|(off, read)| off + read)) * 1e3;
    assert!(
        seen_um < 0.05 * most_um,
        "the encoder that closes the loop sees nothing of it: {seen_um}"
    );
}

/// Speeds up for three seconds, to fifty periods a second, slows down, turns round and comes back.
fn commanded(t: f64) -> [f64; 2] {
    let (far, most) = (3.0, 2.0);
    let rate = PI / far;
    let velocity = 0.5 * most * (rate * t).sin();
    [0.5 * most * (1.0 - (rate * t).cos()) / rate, velocity]
}

#[test]
fn val_a_loop_that_follows_a_scale_integrated_finely() {
    let machine = machine(PositionFeedback::Scale);
    let amplitude_mm = 0.2e-3;
    let run = run(6000, AxisSet::XYZ, |t| {
        [commanded(t)[0], 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let given = [("sin_um", 0.2), ("cos_um", 0.0), ("period_um", 20.0)];
    let response = response_of(&machine, &run, "interpolation_error", "X", &given);

    let step_s = 2e-6;
    let rate = |t: f64, slide: f64, amplitude: f64| {
        let [position, velocity] = commanded(t);
        let read = slide + amplitude * (TAU * slide / PERIOD_MM).sin();
        GAIN_PER_S * (position - read) + FEEDFORWARD * velocity
    };
    let mut slides = [0.0_f64; 2];
    let mut off_mm = 0.0_f64;
    let mut most_mm = 0.0_f64;
    let mut fast_mm = 0.0_f64;
    for (tick, servo) in response.servo[Axis::X].iter().enumerate() {
        let t = tick as f64 * TICK_S;
        let true_mm = slides[1] - slides[0];
        off_mm = off_mm.max((true_mm - servo).abs());
        most_mm = most_mm.max(true_mm.abs());
        if (t - 1.5).abs() < 0.05 {
            fast_mm = fast_mm.max(true_mm.abs());
        }
        for k in 0..500 {
            let t = t + f64::from(k) * step_s;
            for (slide, amplitude) in slides.iter_mut().zip([0.0, amplitude_mm]) {
                let begin = rate(t, *slide, amplitude);
                let end = rate(t + step_s, *slide + begin * step_s, amplitude);
                *slide += 0.5 * (begin + end) * step_s;
            }
        }
    }
    println!("slide off {most_mm:.6} mm, {fast_mm:.6} at speed; the effect off {off_mm:.6} mm");
    assert!(most_mm > 0.9 * amplitude_mm && fast_mm < 0.4 * amplitude_mm);
    assert!(off_mm < 0.05 * amplitude_mm, "{off_mm}");
}
