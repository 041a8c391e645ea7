//! Reversal spike against a drive with LuGre friction under a cascaded loop.

use metrology::{Axis, AxisSet};

use crate::effects::scene::{TICK_S, fit, integrate, response_of, rms, run, three_axes};

/// Axis of a circle near its reversal, as position and velocity, mm.
fn command(t: f64, radius_mm: f64, feed_mm_s: f64) -> (f64, f64) {
    let rate = feed_mm_s / radius_mm;
    let (sin, cos) = (rate * (t - 0.5)).sin_cos();
    (radius_mm * cos, -radius_mm * rate * sin)
}

/// Position error that LuGre friction adds, at each tick, um. State: x, v, integral, bristle.
fn lugre_um(radius_mm: f64, feed_mm_s: f64, ticks: usize) -> Vec<f64> {
    let (position_gain, velocity_gain, integral_s) = (60.0, 200.0, 0.02);
    let drive = |coulomb: f64| {
        let (stiffness, damping, viscous) = (2e5, 300.0, 5.0);
        let (breakaway, stribeck_mm_s) = (1.3 * coulomb, 1.0);
        let f = move |t: f64, y: &[f64; 4]| {
            let [x, v, integral, bristle] = *y;
            let (r, rate) = command(t, radius_mm, feed_mm_s);
            let wanted = position_gain * (r - x) + rate;
            let level = coulomb + (breakaway - coulomb) * (-(v / stribeck_mm_s).powi(2)).exp();
            let slip = if coulomb > 0.0 {
                v - v.abs() * bristle * stiffness / level
            } else {
                0.0
            };
            let friction = stiffness * bristle + if coulomb > 0.0 { damping * slip } else { 0.0 };
            let error = wanted - v;
            let force = velocity_gain * error + integral - friction - viscous * v;
            [v, force, velocity_gain / integral_s * error, slip]
        };
        let (r, rate) = command(0.0, radius_mm, feed_mm_s);
        integrate(
            [r, rate, coulomb + viscous * rate, coulomb / stiffness],
            2e-5,
            50 * (ticks - 1),
            50,
            f,
        )
    };
    let (with, without) = (drive(150.0), drive(0.0));
    with.iter()
        .zip(&without)
        .map(|(a, b)| (a[0] - b[0]) * 1e3)
        .collect()
}

#[test]
fn val_lugre_friction_under_a_cascaded_loop() {
    let machine = three_axes("[w X' Y' b Z t]");
    let ticks = 1000_usize;
    let mut wanted = vec![];
    let mut runs = vec![];
    for (radius_mm, feed_mm_s) in [(100.0, 30.0), (50.0, 50.0)] {
        let run = run(ticks, AxisSet::XYZ, |t| {
            [command(t, radius_mm, feed_mm_s).0, 0.0, 0.0, 0.0, 0.0, 0.0]
        });
        wanted.extend(lugre_um(radius_mm, feed_mm_s, ticks).split_off(400));
        runs.push(run);
    }
    let column = |width_ms: f64, length_mm: f64, free: &str| {
        let mut given = vec![("width_ms", width_ms), ("length_mm", length_mm)];
        given.push(("height_um", if free.is_empty() { 1.0 } else { 0.0 }));
        if !free.is_empty() {
            given.push((free, 1.0));
        }
        let of = |run| {
            let response = response_of(&machine, run, "reversal_spike", "X", &given);
            response.servo[Axis::X][400..]
                .iter()
                .map(|e| e * 1e3)
                .collect::<Vec<_>>()
        };
        runs.iter().flat_map(of).collect::<Vec<_>>()
    };
    let mut best = (f64::INFINITY, 0.0, 0.0, 0.0);
    for width_ms in (1..20).map(|k| 8.0 * f64::from(k)) {
        for length_mm in [0.0003, 0.001, 0.003, 0.01, 0.03, 0.1] {
            let (found, left) = fit(&[column(width_ms, length_mm, "")], &wanted);
            if left < best.0 {
                best = (left, width_ms, length_mm, found[0]);
            }
        }
    }
    let mut columns = vec![column(best.1, best.2, "")];
    columns.extend(
        [
            "free_at_100mm_s2_um",
            "free_0p01mm_um",
            "free_0p03mm_um",
            "free_0p1mm_um",
            "free_0p3mm_um",
            "free_1mm_um",
            "free_below_2mm_s_um",
            "free_below_8mm_s_um",
        ]
        .map(|free| column(best.1, best.2, free)),
    );
    let (_, wide) = fit(&columns, &wanted);
    let size = rms(wanted.iter().copied());
    let peak = wanted.iter().fold(0.0_f64, |m, e| m.max(e.abs()));
    println!("spike {peak:.2} um, rms {size:.3}; {best:?}; wider form {wide:.3}; tick {TICK_S}");
    assert!(best.0 < 0.3 * size, "{best:?} of {size}");
    assert!(wide < 0.19 * size, "{wide} of {size}");
}

#[test]
fn eq2_a_step_into_a_loop_of_two_equal_poles() {
    let machine = three_axes("[w X' Y' b Z t]");
    let width_s = 0.02;
    // A triangle: the reversal is at 0.2 s, and friction turns over within 0.1 µm.
    let run = run(600, AxisSet::XYZ, |t| {
        [
            20.0 * if t < 0.2 { t } else { 0.4 - t },
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
        ]
    });
    let given = [
        ("height_um", 5.0),
        ("width_ms", 20.0),
        ("length_mm", 0.0001),
    ];
    let response = response_of(&machine, &run, "reversal_spike", "X", &given);
    // w2 e'' + 2 w e' + e = w d', the step d at 0 giving e' = d / w there; its peak d/e is the height.
    let start = 0.005 * std::f64::consts::E / width_s;
    let f = |_: f64, y: &[f64; 2]| [y[1], -(2.0 * width_s * y[1] + y[0]) / (width_s * width_s)];
    let after = integrate([0.0, start], TICK_S / 10.0, 10 * 390, 10, f);
    for (k, state) in after.iter().enumerate() {
        let off = response.servo[Axis::X][200 + k] - state[0];
        assert!(off.abs() < 0.001 * 0.005, "{k} {off}");
    }
}
