//! Servo lag against a loop of first order and against the figure of circular tests.

use metrology::Axis;

use crate::effects::scene::{TICK_S, circle, greatest, integrate, response_of, three_axes};

const CHAIN: &str = "[w X' Y' b Z t]";

#[test]
fn val_a_loop_of_first_order_integrated_finely() {
    let machine = three_axes(CHAIN);
    let (radius_mm, feed_mm_s, time_s) = (100.0, 50.0, 0.002);
    let rate: f64 = feed_mm_s / radius_mm;
    let run = circle(radius_mm, feed_mm_s, 1.0);
    let response = response_of(&machine, &run, "servo_lag", "X", &[("time_ms", 2.0)]);
    let follow = |t: f64, x: &[f64; 1]| [(radius_mm * (rate * t).cos() - x[0]) / time_s];
    let ticks = run.motion.len();
    let motor = integrate([radius_mm], TICK_S / 10.0, 10 * (ticks - 1), 10, follow);
    // After ten time constants the start is forgotten.
    let off = (20..ticks)
        .map(|k| motor[k][0] - run.motion.position[Axis::X][k] - response.servo[Axis::X][k]);
    let off_mm = greatest(off);
    println!(
        "lag {:.1} um, off by {:.3} um",
        feed_mm_s * 2.0,
        off_mm * 1e3
    );
    assert!(
        off_mm < 1.05 * radius_mm * (rate * time_s).powi(2),
        "{off_mm}"
    );
}

/// Two axes whose lags differ by 0.2 ms draw a circle at 2 m/min as an ellipse of 3.3 um at 45 degrees:
/// (v/2) (T_x - T_y), the formula by which circular tests are read.
#[test]
fn val_mismatch_is_an_ellipse_at_45_degrees() {
    let machine = three_axes(CHAIN);
    let run = circle(100.0, 2000.0 / 60.0, 1.0);
    let x = response_of(&machine, &run, "servo_lag", "X", &[("time_ms", 0.2)]);
    let mut most = (0.0_f64, 0.0_f64);
    for tick in 0..run.motion.len() {
        let (px, py) = (
            run.motion.position[Axis::X][tick],
            run.motion.position[Axis::Y][tick],
        );
        let radial = x.servo[Axis::X][tick] * px / 100.0;
        if radial > most.0 {
            most = (radial, py.atan2(px).to_degrees().rem_euclid(180.0));
        }
    }
    println!("mismatch {:.3} um at {:.1} degrees", most.0 * 1e3, most.1);
    assert!((most.0 * 1e3 - 10.0 / 3.0).abs() < 0.01, "{most:?}");
    assert!((most.1 - 45.0).abs() < 0.5, "{most:?}");
}

#[test]
fn eq1_odd_powers_are_given_at_100_mm_s() {
    let machine = three_axes(CHAIN);
    let run = crate::effects::scene::run(100, metrology::AxisSet::XYZ, |t| {
        [-100.0 * t, 50.0 * t, 0.0, 0.0, 0.0, 0.0]
    });
    let of = |on: &str, name: &str| {
        response_of(
            &machine,
            &run,
            "servo_lag",
            on,
            &[("time_ms", 0.0), (name, 8.0)],
        )
    };
    for (on, axis, square, cube) in [("X", Axis::X, 8.0, 8.0), ("Y", Axis::Y, -2.0, -1.0)] {
        let found = of(on, "free_square_um").servo[axis][50] * 1e3;
        assert!((found - square).abs() < 1e-9, "{on} {found}");
        let found = of(on, "free_cube_um").servo[axis][50] * 1e3;
        assert!((found - cube).abs() < 1e-9, "{on} {found}");
    }
}

/// A position loop whose velocity feed-forward lacks a share of it: the lag that it leaves beside the nominal one, by fine
/// integration of both loops.
#[test]
fn val_a_loop_that_lacks_feed_forward() {
    let machine = three_axes(CHAIN);
    let gain_per_s = machine.linear(Axis::X).unwrap().position_gain_per_s;
    let (radius_mm, feed_mm_s, time_s) = (40.0, 120.0, 0.2e-3);
    let rate: f64 = feed_mm_s / radius_mm;
    let run = circle(radius_mm, feed_mm_s, 2.0);
    let speed = |t: f64| -radius_mm * rate * (rate * t).sin();
    let lacks = |t: f64, e: &[f64; 1]| [-gain_per_s * e[0] - time_s * gain_per_s * speed(t)];
    let ticks = run.motion.len();
    let error = integrate([0.0], TICK_S / 10.0, 10 * (ticks - 1), 10, lacks);
    let off_um = |given: &[(&str, f64)]| {
        let response = response_of(&machine, &run, "servo_lag", "X", given);
        let off = (ticks / 2..ticks - 2).map(|k| error[k][0] - response.servo[Axis::X][k]);
        greatest(off) * 1e3
    };
    let narrow = off_um(&[("time_ms", 0.2)]);
    let wide = off_um(&[("time_ms", 0.2), ("free_worked_off_ms", 0.2)]);
    println!(
        "lack of feed-forward: {narrow:.3} um left, {wide:.5} um with what the loop works off"
    );
    assert!(narrow > 0.5 && wide < 0.02 * narrow, "{narrow} {wide}");
}
