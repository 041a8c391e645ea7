//! Readings whose form is known from a drawing.

use machine::SphereDesign;
use rotary_axes::estimate;

use crate::bench::{BALL_MM, Wrong, degrees, file, reading_mm, visits};
use crate::coverage::RULES;

#[test]
fn val_a_displaced_c_draws_a_circle_of_that_radius() {
    let wrong = Wrong {
        ex0c: 0.012,
        ..Wrong::default()
    };
    // Read less nominal place, seen from the displaced line: a circle through 0 of radius 12 µm.
    for k in 0..12 {
        let pose = degrees(0.0, f64::from(k) * 30.0);
        let off =
            reading_mm(&wrong, &BALL_MM, &pose) - reading_mm(&Wrong::default(), &BALL_MM, &pose);
        let radius = (off - nalgebra::Vector3::new(0.012, 0.0, 0.0)).norm();
        assert!((radius - 0.012).abs() < 1e-12, "{radius}");
    }
    let design = SphereDesign::new(&file()).unwrap();
    let poses: Vec<_> = (0..12)
        .flat_map(|k| [0.0, -40.0].map(|a| degrees(a, f64::from(k) * 30.0)))
        .collect();
    let seen = visits(&wrong, &BALL_MM, &poses, 1, (0.0, 0));
    let found = estimate(&design, &seen, &[("ball".to_owned(), BALL_MM)], &RULES).unwrap();
    for (at, (name, truth)) in wrong.values().into_iter().enumerate() {
        assert!(
            (found.fit.values[at] - truth).abs() < 1e-9,
            "{name} {}",
            found.fit.values[at]
        );
    }
}

#[test]
fn val_a_tilted_a_gives_a_height_along_its_line() {
    // A tilted about Y by w: its line falls along X, and turning by A moves the sphere along it.
    let w = 50e-6;
    let wrong = Wrong {
        eb0a: w,
        ..Wrong::default()
    };
    let angle = -60.0_f64;
    let pose = degrees(angle, 0.0);
    let off = reading_mm(&wrong, &BALL_MM, &pose) - reading_mm(&Wrong::default(), &BALL_MM, &pose);
    let (sin, cos) = angle.to_radians().sin_cos();
    // First order: (w x r') - R (w x r) with w along Y, r = (60, -40, 40), r' = R r.
    let turned = nalgebra::Vector3::new(60.0, -40.0 * cos - 40.0 * sin, -40.0 * sin + 40.0 * cos);
    let expected = nalgebra::Vector3::new(w * turned.z, 0.0, -w * turned.x)
        - nalgebra::Vector3::new(w * 40.0, w * 60.0 * sin, -w * 60.0 * cos);
    assert!((off - expected).norm() < 1e-6, "{off} {expected}");
    let design = SphereDesign::new(&file()).unwrap();
    let poses: Vec<_> = [-60.0, -30.0, 0.0, 25.0]
        .into_iter()
        .flat_map(|a| [0.0, 90.0, 180.0, -90.0].map(|c| degrees(a, c)))
        .collect();
    let seen = visits(&wrong, &BALL_MM, &poses, 1, (0.0, 0));
    let found = estimate(&design, &seen, &[("ball".to_owned(), BALL_MM)], &RULES).unwrap();
    let at = found
        .unknowns
        .iter()
        .position(|u| u.to_string() == "EB0A")
        .unwrap();
    assert!(
        (found.fit.values[at] - w).abs() < 1e-8,
        "{}",
        found.fit.values[at]
    );
}

#[test]
fn poses_without_tilt_give_no_number_for_a_and_say_so() {
    let design = SphereDesign::new(&file()).unwrap();
    let wrong = Wrong::drawn(4);
    // A is read with the noise of a servo: 5 arc seconds, which must not count as a tilt.
    let poses: Vec<_> = (0..12)
        .map(|k| degrees(f64::from(k % 3 - 1) * 0.0014, f64::from(k) * 30.0))
        .collect();
    let seen = visits(&wrong, &BALL_MM, &poses, 2, (0.0005, 9));
    let found = estimate(&design, &seen, &[("ball".to_owned(), BALL_MM)], &RULES).unwrap();
    for (unknown, estimable) in found.unknowns.iter().zip(&found.fit.estimable) {
        let of_a = unknown.to_string().ends_with("0A");
        assert_eq!(!estimable, of_a, "{unknown}");
    }
    assert!(found.merit.merit.abs() < 1e-12);
    for (at, (name, truth)) in wrong.values().into_iter().enumerate().skip(4) {
        let u = found.fit.covariance[(at, at)].sqrt();
        assert!((found.fit.values[at] - truth).abs() < 4.0 * u, "{name}");
    }
}
