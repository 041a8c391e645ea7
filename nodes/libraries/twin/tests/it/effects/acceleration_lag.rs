//! Acceleration lag against the contraction of a circle by a loop of first order.

use metrology::Axis;

use crate::effects::scene::{circle, greatest, response_of, three_axes};

const CHAIN: &str = "[w X' Y' b Z t]";

#[test]
fn val_a_first_order_loop_shrinks_circles_as_its_frequency_response_says() {
    let machine = three_axes(CHAIN);
    let (radius_mm, feed_mm_s, time_ms) = (20.0, 100.0, 4.0);
    let run = circle(radius_mm, feed_mm_s, 1.0);
    let turned: f64 = feed_mm_s / radius_mm * time_ms * 1e-3;
    let of = |id: &str, on: &str, name: &str, value: f64| {
        response_of(&machine, &run, id, on, &[(name, value)])
    };
    let lag = [("X", Axis::X), ("Y", Axis::Y)].map(|(on, axis)| {
        let first = of("servo_lag", on, "time_ms", time_ms);
        let second = of(
            "acceleration_lag",
            on,
            "time_squared_ms2",
            -time_ms * time_ms,
        );
        let both = first.servo[axis].iter().zip(&second.servo[axis]);
        both.map(|(a, b)| a + b).collect::<Vec<_>>()
    });
    let wanted = -radius_mm * (1.0 - 1.0 / (1.0 + turned * turned).sqrt());
    // The run's first and last ticks have one-sided derivatives.
    let off = (5..run.motion.len() - 5).map(|k| {
        let x = run.motion.position[Axis::X][k] + lag[0][k];
        let y = run.motion.position[Axis::Y][k] + lag[1][k];
        x.hypot(y) - radius_mm - wanted
    });
    let off_mm = greatest(off);
    println!(
        "radius {:.2} um, off by {:.3} um",
        wanted * 1e3,
        off_mm * 1e3
    );
    assert!(off_mm < radius_mm * turned.powi(4), "{off_mm}");
}

#[test]
fn eq1_jerk_and_square_are_those_of_a_cubic_and_a_parabola() {
    let machine = three_axes(CHAIN);
    let run = crate::effects::scene::run(200, metrology::AxisSet::XYZ, |t| {
        [1000.0 * t.powi(3), -250.0 * t * t, 0.0, 0.0, 0.0, 0.0]
    });
    let none = ("time_squared_ms2", 0.0);
    let jerk = response_of(
        &machine,
        &run,
        "acceleration_lag",
        "X",
        &[none, ("free_time_cubed_ms3", 50.0)],
    );
    // d = 50e-9 s3 times 6000 mm/s3
    assert!((jerk.servo[Axis::X][100] + 3e-4).abs() < 1e-9);
    let square = response_of(
        &machine,
        &run,
        "acceleration_lag",
        "Y",
        &[none, ("free_square_um", 4.0)],
    );
    // a = -500 mm/s2, half of the reference: a quarter of 4 um, ahead.
    assert!((square.servo[Axis::Y][100] - 1e-3).abs() < 1e-9);
}
