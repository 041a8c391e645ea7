//! Lobing against the lever of a seat on three supports.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;
use twin::History;

use crate::effects::past::{all_round, predict, touch, touching};
use crate::effects::scene::{bench, rms};

const ID: (&str, &str) = ("probe_lobing", "");
const NAMES: [[&str; 2]; 5] = [
    ["free_2_cos_um", "free_2_sin_um"],
    ["three_cos_um", "three_sin_um"],
    ["free_4_cos_um", "free_4_sin_um"],
    ["free_5_cos_um", "free_5_sin_um"],
    ["free_6_cos_um", "free_6_sin_um"],
];

/// Distance from the middle to the border of the triangle of supports, radius 1: what a lateral push tips over.
fn border(angle_rad: f64, support_rad: f64) -> f64 {
    let from_edge = (angle_rad - support_rad - PI / 3.0).rem_euclid(TAU / 3.0);
    let from_edge = if from_edge > PI / 3.0 {
        from_edge - TAU / 3.0
    } else {
        from_edge
    };
    0.5 / from_edge.cos()
}

#[test]
fn val_probe_lobing_triangle_of_supports() {
    let machine = bench();
    let around = all_round(360);
    // Pretravel in proportion to the lever, 4 um over a support; supports turned by 17 degrees.
    let lobes: Vec<f64> = around
        .iter()
        .map(|n| 4.0 * border(n.y.atan2(n.x), 17.0_f64.to_radians()))
        .collect();
    let mean = lobes.iter().sum::<f64>() / 360.0;
    let mut given = vec![];
    for (names, harmonic) in NAMES.iter().zip(2..) {
        let wave = |wave: fn(f64) -> f64| {
            let terms = around.iter().zip(&lobes);
            let sum: f64 = terms
                .map(|(n, lobe)| lobe * wave(f64::from(harmonic) * n.y.atan2(n.x)))
                .sum();
            sum / 180.0
        };
        let (cos, sin) = (wave(f64::cos), wave(f64::sin));
        if harmonic % 3 != 0 {
            assert!(
                cos.hypot(sin) < 1e-12,
                "a triangle has no harmonic {harmonic}"
            );
        }
        given.extend([(names[0], cos), (names[1], sin)]);
    }
    let run = touching(
        around
            .iter()
            .map(|n| touch(0.0, [0.0; 3], *n, 2.0))
            .collect(),
    );
    let seen = predict(&machine, &History::default(), &run, ID, &given);
    let left = seen
        .iter()
        .zip(&lobes)
        .map(|(mm, lobe)| mm * 1e3 + mean - lobe);
    let off = rms(left) / mean;
    let shape = rms(lobes.iter().map(|lobe| lobe - mean)) / mean;
    println!(
        "triangle: {:.2} % of the mean left of {:.2} %",
        100.0 * off,
        100.0 * shape
    );
    assert!(off < 0.055 && shape > 0.2, "{off} {shape}");
}

#[test]
fn eq1_an_axial_touch_feels_no_lobe_and_a_slanting_one_less() {
    let machine = bench();
    let given = [("three_cos_um", 1.0), ("three_sin_um", 0.0)];
    let run = touching(vec![
        touch(0.0, [0.0; 3], -Vector3::z(), 2.0),
        touch(0.0, [0.0; 3], Vector3::new(0.6, 0.0, -0.8), 2.0),
        touch(0.0, [0.0; 3], Vector3::x(), 2.0),
    ]);
    let seen = predict(&machine, &History::default(), &run, ID, &given);
    for (seen, wanted) in seen.iter().zip([0.0, 0.36e-3, 1e-3]) {
        assert!((seen - wanted).abs() < 1e-15, "{seen} {wanted}");
    }
}
