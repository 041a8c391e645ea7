//! A clock's offset against the equation of the circle, shifted.

use metrology::Axis;
use twin::{Channel, History, Reading};

use crate::effects::past::{predict, read};
use crate::effects::scene::{bench, circle, run};

#[test]
fn val_clock_offset_circle() {
    let machine = bench();
    let (radius_mm, feed_mm_s, late_s) = (50.0, 50.0, 2e-3);
    let mut circle = circle(radius_mm, feed_mm_s, 1.5);
    let rows = |channel: &Channel| {
        let of = |at: usize| Reading {
            channel: channel.clone(),
            at,
            fraction: 0.3,
            deviation: 0.0,
        };
        (10..circle.motion.len() - 10)
            .step_by(7)
            .map(of)
            .collect::<Vec<_>>()
    };
    let n = rows(&Channel::GridU).len();
    circle.readings = [Channel::GridU, Channel::GridV, Channel::Radial]
        .iter()
        .flat_map(rows)
        .collect();
    let mut worst = 0.0_f64;
    for (on, of) in [("grid", 0..2 * n), ("radial", 2 * n..3 * n)] {
        let given = [("offset_ms", late_s * 1e3)];
        let seen = predict(
            &machine,
            &History::default(),
            &circle,
            ("clock_offset", on),
            &given,
        );
        for (row, seen) in seen.iter().enumerate() {
            let t = circle.time_of(&circle.readings[row]).unwrap();
            let at = |t: f64| {
                let (sin, cos) = (feed_mm_s / radius_mm * t).sin_cos();
                [radius_mm * cos, radius_mm * sin, radius_mm]
            };
            let shifted = at(t - late_s)[row / n] - at(t)[row / n];
            let wanted = if of.contains(&row) { shifted } else { 0.0 };
            worst = worst.max((seen - wanted).abs());
        }
    }
    println!("circle: worst {worst:.2e} mm of {}", late_s * feed_mm_s);
    assert!(worst < 1e-11, "{worst}");
}

#[test]
fn eq2_the_sign_goes_with_the_direction_and_nothing_moves_at_rest() {
    let machine = bench();
    let mut line = run(3000, machine.axis_set(), |t| {
        let x = if t < 1.0 {
            20.0 * t
        } else {
            20.0 - 20.0 * (t - 1.0).min(1.0)
        };
        [x, 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    read(&mut line, &Channel::Length(Axis::X));
    let given = [("offset_ms", 5.0)];
    let seen = predict(
        &machine,
        &History::default(),
        &line,
        ("clock_offset", "length"),
        &given,
    );
    assert!((seen[500] + 0.1).abs() < 1e-9, "{}", seen[500]);
    assert!((seen[1500] - 0.1).abs() < 1e-9, "{}", seen[1500]);
    assert!(seen[2500].abs() < 1e-12);
}
