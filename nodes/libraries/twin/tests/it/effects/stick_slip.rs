//! Stick-slip against a block that a spring drags over static and sliding friction.

use metrology::AxisSet;

use crate::effects::scene::{response_of, run, three_axes};

/// Variance of block minus drive, um2, by stepping stick and slip finely.
fn variance_um2(natural: f64, stick_um: f64, slide_um: f64, feed_um_s: f64) -> f64 {
    let step_s = 1e-6;
    let (mut x, mut v, mut drive) = (-stick_um, 0.0_f64, 0.0);
    let (mut sum, mut square, mut n) = (0.0, 0.0, 0.0);
    for k in 0..4_000_000_u32 {
        drive += feed_um_s * step_s;
        let stretch = drive - x;
        if v > 0.0 || stretch > stick_um {
            v = (v + natural * natural * (stretch - slide_um) * step_s).max(0.0);
            x += v * step_s;
        }
        if k > 1_000_000 {
            sum += x - drive;
            square += (x - drive).powi(2);
            n += 1.0;
        }
    }
    square / n - (sum / n).powi(2)
}

#[test]
fn val_a_block_dragged_by_a_spring() {
    let machine = three_axes("[w X' Y' b Z t]");
    // Spring stretch at which the block breaks away and at which it would slide steadily; the jump is twice
    // the difference.
    let (stick_um, slide_um, feed_um_s) = (12.0, 7.0, 40.0);
    let wanted = variance_um2(500.0, stick_um, slide_um, feed_um_s);
    let run = run(100, AxisSet::XYZ, |t| {
        [feed_um_s * 1e-3 * t, 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let given = [
        ("height_um", 2.0 * (stick_um - slide_um)),
        ("critical_mm_s", 20.0),
    ];
    let response = response_of(&machine, &run, "stick_slip", "X", &given);
    let found = response.tip_variance_mm2[0][50] * 1e6;
    println!("variance {found:.3} um2, block {wanted:.3} um2");
    assert!((found / wanted - 1.0).abs() < 0.05, "{found} {wanted}");
}

#[test]
fn val_a_block_whose_friction_does_not_know_the_feed() {
    let machine = three_axes("[w X' Y' b Z t]");
    let (stick_um, slide_um) = (12.0, 7.0);
    let given = [
        ("height_um", 0.0),
        ("critical_mm_s", 0.2),
        ("free_even_um", 2.0 * (stick_um - slide_um)),
    ];
    for feed_um_s in [40.0, 160.0] {
        let wanted = variance_um2(500.0, stick_um, slide_um, feed_um_s);
        let run = run(100, AxisSet::XYZ, |t| {
            [feed_um_s * 1e-3 * t, 0.0, 0.0, 0.0, 0.0, 0.0]
        });
        let response = response_of(&machine, &run, "stick_slip", "X", &given);
        let found = response.tip_variance_mm2[0][50] * 1e6;
        println!("{feed_um_s} um/s: {found:.3} um2, block {wanted:.3} um2");
        assert!((found / wanted - 1.0).abs() < 0.1, "{found} {wanted}");
    }
}

#[test]
fn eq1_an_axis_that_stands_or_runs_fast_does_not_stick() {
    let machine = three_axes("[w X' Y' b Z t]");
    let run = run(100, AxisSet::XYZ, |t| {
        [0.0, 3.0 * t, 0.5 * t, 0.0, 0.0, 0.0]
    });
    let given = [("height_um", 6.0), ("critical_mm_s", 2.0)];
    for (on, index, wanted) in [("X", 0, 0.0), ("Y", 1, 0.0), ("Z", 2, 3e-6 * 0.5625)] {
        let response = response_of(&machine, &run, "stick_slip", on, &given);
        let found = response.tip_variance_mm2[index][50];
        assert!((found - wanted).abs() < 1e-15, "{on} {found}");
    }
}

#[test]
fn eq3_an_axis_that_slows_down_slides_on_below_the_critical_feed() {
    let machine = three_axes("[w X' Y' b Z t]");
    let given = [
        ("height_um", 0.0),
        ("critical_mm_s", 2.0),
        ("free_even_um", 6.0),
        ("free_hysteresis", 0.25),
    ];
    // 1.8 mm/s and 1.2 mm/s, once gaining and once losing 0.5 mm/s in a second, and at a steady feed.
    for (feed, gain, jumps) in [
        (1.8, 0.5, true),
        (1.8, -0.5, false),
        (1.2, -0.5, true),
        (1.8, 0.0, true),
    ] {
        let run = run(100, AxisSet::XYZ, |t| {
            [(feed + 0.5 * gain * t) * t, 0.0, 0.0, 0.0, 0.0, 0.0]
        });
        let response = response_of(&machine, &run, "stick_slip", "X", &given);
        let found = response.tip_variance_mm2[0][5];
        let wanted = if jumps { 3e-6 } else { 0.0 };
        assert!((found - wanted).abs() < 1e-15, "{feed} {gain}: {found}");
    }
}
