//! A plate's errors against its reversal and against the oval of a circle out of square.

use twin::{Channel, History};

use crate::effects::past::{predict, read};
use crate::effects::scene::{bench, circle, rms};

const ID: (&str, &str) = ("plate_error", "");
const SQUARE: [(&str, f64); 3] = [
    ("scale_u_um_per_m", 0.0),
    ("scale_v_um_per_m", 0.0),
    ("squareness_um_per_m", 8.0),
];

/// Deviations u and v of a circle of 80 mm, at each tick.
fn seen(given: &[(&str, f64)], quarter_turns: bool) -> (Vec<f64>, Vec<f64>) {
    let mut run = circle(80.0, 400.0, 1.0);
    if quarter_turns {
        // What stands at (x, y) stands at (y, -x) on a plate that is turned by +90 degrees.
        let [x, y, ..] = &mut run.motion.position.0;
        std::mem::swap(x, y);
        y.iter_mut().for_each(|y| *y = -*y);
    }
    read(&mut run, &Channel::GridU);
    read(&mut run, &Channel::GridV);
    let mut u = predict(&bench(), &History::default(), &run, ID, given);
    let v = u.split_off(run.motion.len());
    (u, v)
}

#[test]
fn val_plate_error_reversal() {
    let (u, v) = seen(&SQUARE, false);
    let (on_plate_u, on_plate_v) = seen(&SQUARE, true);
    // Back to the machine's directions: (u, v) of the plate lies along (-v, u).
    let off = |a: &[f64], b: &[f64], sign: f64| rms(a.iter().zip(b).map(|(a, b)| a + sign * b));
    let size = rms(u.iter().copied());
    assert!(size > 1e-4);
    assert!(
        off(&u, &on_plate_v, -1.0) < 1e-12,
        "squareness turns its sign: u"
    );
    assert!(
        off(&v, &on_plate_u, 1.0) < 1e-12,
        "squareness turns its sign: v"
    );
}

#[test]
fn val_plate_error_oval_of_a_circle() {
    let run = circle(80.0, 400.0, 1.0);
    let (u, v) = seen(&SQUARE, false);
    for (k, (u, v)) in u.iter().zip(&v).enumerate() {
        let (x, y) = (run.motion.position.0[0][k], run.motion.position.0[1][k]);
        let radial = (u * x + v * y) / 80.0;
        // (R q / 2) sin 2 theta, the oval at 45 degrees of every circular test.
        let wanted = 0.5 * 80.0 * 8e-6 * (2.0 * y.atan2(x)).sin();
        assert!((radial - wanted).abs() < 1e-12, "{radial} {wanted}");
    }
}

#[test]
fn eq2_is_stated_at_100_mm() {
    let given = [
        ("scale_u_um_per_m", 0.0),
        ("scale_v_um_per_m", 0.0),
        ("squareness_um_per_m", 0.0),
        ("free_v_uu_um_per_m", 5.0),
    ];
    let mut run = circle(100.0, 400.0, 1.0);
    read(&mut run, &Channel::GridV);
    let seen = predict(&bench(), &History::default(), &run, ID, &given);
    assert!((seen[0] - 5e-4).abs() < 1e-12, "{}", seen[0]);
}
