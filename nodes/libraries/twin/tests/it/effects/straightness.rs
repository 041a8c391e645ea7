//! Straightness against a guide bent to a circle.

use metrology::AxisSet;

use crate::effects::scene::{fit, response_of, run, three_axes};

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

/// A slide of 120 mm on a guide whose middle is worn over 70 mm: the slide's centre is the mean of what is under it.
#[test]
fn val_a_slide_on_a_guide_that_is_worn_in_one_place() {
    let machine = three_axes("[w b X Y Z t]");
    let ticks = 6401;
    let run = run(ticks, AxisSet::XYZ, |t| {
        [-320.0 + 100.0 * t, 0.0, 0.0, 0.0, 0.0, 0.0]
    });
    let worn_um = |u_mm: f64| {
        let way = (u_mm - 30.0) / 35.0;
        if way.abs() < 1.0 {
            -6.0 * (1.0 - way * way)
        } else {
            0.0
        }
    };
    let under = |centre_mm: f64| {
        let places = (-60..=60).map(|k| worn_um(centre_mm + f64::from(k)));
        places.sum::<f64>() / 121.0
    };
    let line = run.motion.position[metrology::Axis::X].clone();
    let height: Vec<f64> = line.iter().map(|u| under(*u)).collect();
    let column = |name: &str| -> Vec<f64> {
        let mut given = vec![("p2_um", 0.0), ("p3_um", 0.0)];
        given.retain(|(other, _)| *other != name);
        given.push((name, 1.0));
        let response = response_of(&machine, &run, "straightness", "ZX", &given);
        response.tip_mm[2].iter().map(|z| z * 1e3).collect()
    };
    let mut columns = vec![vec![1.0; ticks], line.clone()];
    columns.extend(["p2_um", "p3_um", "free_p4_um", "free_p5_um"].map(column));
    let (_, smooth) = fit(&columns, &height);
    columns.extend((1..8).map(|k| column(&format!("free_{k}_of_8_um"))));
    let (_, wide) = fit(&columns, &height);
    columns.extend(
        (1..16)
            .step_by(2)
            .map(|k| column(&format!("free_{k}_of_16_um"))),
    );
    let (_, fine) = fit(&columns, &height);
    let (_, straight) = fit(&columns[..2], &height);
    println!(
        "worn guide {straight:.2} um: P2 to P5 leave {smooth:.3}, with splines {wide:.3}, to the sixteenth {fine:.3}"
    );
    assert!(smooth > 0.5 * straight && wide < 0.3 * straight && fine < 0.6 * wide);
}
