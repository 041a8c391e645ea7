//! Straightness against a guide bent to a circle.

use metrology::AxisSet;

use crate::scene::{fit, response_of, run, three_axes};

#[test]
fn val_a_guide_bent_to_a_circle() {
    let machine = three_axes("[w b X Y Z t]");
    let run = run(6401, AxisSet::XYZ, |t| {
        [-320.0 + 100.0 * t, 30.0, 50.0, 0.0, 0.0, 0.0]
    });
    // 5 km: 10 um over half the travel.
    let radius_mm = 5e6_f64;
    let bent: Vec<f64> = run.motion.position[metrology::Axis::X]
        .iter()
        .map(|u| radius_mm - (radius_mm * radius_mm - u * u).sqrt())
        .collect();
    let p2_um = 320.0 * 320.0 / (3.0 * radius_mm) * 1e3;
    let given = [("p2_um", p2_um), ("p3_um", 0.0)];
    let response = response_of(&machine, &run, "straightness", "YX", &given);
    let across: Vec<f64> = bent
        .iter()
        .zip(&response.tip_mm[1])
        .map(|(a, b)| a - b)
        .collect();
    let (mean, left) = fit(&[vec![1.0; 6401]], &across);
    println!(
        "P2 {p2_um:.3} um, mean {:.3} um, off by {:.1e} um",
        mean[0] * 1e3,
        left * 1e3
    );
    assert!(left < 1e-8, "{left}");
    for other in [0, 2] {
        assert!(response.tip_mm[other].iter().all(|e| e.abs() < 1e-15));
    }
}

#[test]
fn the_sign_is_that_of_the_tool_relative_to_the_workpiece_on_either_side() {
    for chain in ["[w b X Y Z t]", "[w X' Y' b Z t]"] {
        let machine = three_axes(chain);
        let run = run(10, AxisSet::XYZ, |_| [320.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let given = [("p2_um", 3.0), ("p3_um", 2.0)];
        let response = response_of(&machine, &run, "straightness", "ZX", &given);
        assert!((response.tip_mm[2][5] - 0.005).abs() < 1e-12, "{chain}");
    }
}
