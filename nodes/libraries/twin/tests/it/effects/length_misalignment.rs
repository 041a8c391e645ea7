//! Cosine error against the projection itself.

use metrology::Axis;
use twin::{Channel, History};

use nalgebra::{Rotation3, Vector3};

use crate::effects::past::{instants, predict, read, stands};
use crate::effects::scene::bench;

/// The bench's beam along X.
const BEAM_MM: f64 = 600.0;

/// A beam from the origin goes out along a direction, is reflected by the three faces of a corner cube and comes back to
/// the plane that it left: half its way, and where it meets that plane.
fn returned(beam: Vector3<f64>, corner_mm: Vector3<f64>) -> (f64, Vector3<f64>) {
    let cube = Rotation3::from_euler_angles(0.3, 0.6, 0.2);
    let mut faces: Vec<Vector3<f64>> = [Vector3::x(), Vector3::y(), Vector3::z()]
        .iter()
        .map(|normal| cube * normal)
        .collect();
    let (mut at, mut along, mut way_mm) = (Vector3::zeros(), beam, 0.0);
    while !faces.is_empty() {
        let to = |face: &Vector3<f64>| (corner_mm - at).dot(face) / along.dot(face);
        let next = (0..faces.len()).min_by(|a, b| to(&faces[*a]).total_cmp(&to(&faces[*b])));
        let face = faces[next.unwrap()];
        let step_mm = to(&face);
        at += along * step_mm;
        along -= face * (2.0 * along.dot(&face));
        way_mm += step_mm;
        faces.retain(|other| *other != face);
    }
    let back_mm = -at.dot(&beam) / along.dot(&beam);
    (0.5 * (way_mm + back_mm), at + along * back_mm)
}

/// The manual's examples: the returning dot moves by 0.5 mm over 500 mm of travel, 0.13 ppm or 0.00006 mm of cosine error; by
/// 0.2 mm over 125 mm, 0.3 ppm or 0.00004 mm.
#[test]
fn val_length_misalignment_of_a_returning_beam() {
    for (dot_mm, travel_mm, ppm, error_mm) in
        [(0.5, 500.0, 0.13, 6e-5), (0.2, 125.0, 0.3, 4e-5_f64)]
    {
        let angle_rad = f64::asin(0.5 * dot_mm / travel_mm);
        let beam = Vector3::new(angle_rad.cos(), angle_rad.sin(), 0.0);
        let from = Vector3::new(900.0, 2.0, -1.0);
        let (near_mm, near_dot) = returned(beam, from);
        let (far_mm, far_dot) = returned(beam, from + Vector3::x() * travel_mm);
        assert!(((far_dot - near_dot).norm() - dot_mm).abs() < 1e-9);
        let short_mm = far_mm - near_mm - travel_mm;
        assert!((short_mm + error_mm).abs() < 0.6e-5, "{short_mm}");
        let mut run = stands(&instants(2, 1.0), |k| [travel_mm * k as f64, 0.0, 0.0]);
        read(&mut run, &Channel::Length(Axis::X));
        let on = ("length_misalignment", "X");
        let of = |angle_rad: f64| {
            let given = [("stray_mm2", (BEAM_MM * angle_rad).powi(2))];
            predict(&bench(), &History::default(), &run, on, &given)[1]
        };
        let of_manual = of((2e-6_f64 * ppm).sqrt());
        println!("dot {dot_mm} mm: {short_mm:.2e} mm, {of_manual:.2e} mm");
        assert!((of_manual + error_mm).abs() < 0.6e-5, "{of_manual}");
        assert!((of(angle_rad) - short_mm).abs() < 1e-9);
    }
}

#[test]
fn eq1_length_misalignment_is_the_projection() {
    let machine = bench();
    let mut worst = 0.0_f64;
    for angle_rad in [0.5e-3_f64, 1e-3, 3e-3] {
        let mut run = stands(&instants(11, 1.0), |k| [-250.0 + 50.0 * k as f64, 0.0, 0.0]);
        read(&mut run, &Channel::Length(Axis::X));
        let given = [("stray_mm2", (BEAM_MM * angle_rad).powi(2))];
        let on = ("length_misalignment", "X");
        let seen = predict(&machine, &History::default(), &run, on, &given);
        for (k, seen) in seen.iter().enumerate() {
            let way_mm = 50.0 * k as f64;
            worst = worst.max((seen - way_mm * (angle_rad.cos() - 1.0)).abs());
        }
    }
    println!("cosine: worst {worst:.2e} mm");
    assert!(worst < 1e-8, "{worst}");
}

#[test]
fn eq2_a_curved_motion_goes_with_the_square() {
    let machine = bench();
    let mut run = stands(&instants(2, 1.0), |k| [500.0 * k as f64 - 250.0, 0.0, 0.0]);
    read(&mut run, &Channel::Length(Axis::X));
    let given = [("stray_mm2", 0.0), ("free_curve_um_per_m2", 4.0)];
    let on = ("length_misalignment", "X");
    let seen = predict(&machine, &History::default(), &run, on, &given);
    assert!((seen[1] - 1e-3).abs() < 1e-12, "{seen:?}");
}

#[test]
fn eq1_the_set_up_of_one_axis_is_not_anothers() {
    let machine = bench();
    let mut run = stands(&instants(2, 1.0), |k| [0.0, 500.0 * k as f64 - 250.0, 0.0]);
    read(&mut run, &Channel::Length(Axis::Y));
    // The bench has no beam along Y: 3 mm over its travel.
    let travel_mm = machine.linear(Axis::Y).unwrap().travel_mm;
    let given = [("stray_mm2", 9.0)];
    let short_mm = 250.0 * 9.0 * 2.0 / (2.0 * (travel_mm[1] - travel_mm[0]).powi(2));
    let of = |axis| {
        let on = ("length_misalignment", axis);
        predict(&machine, &History::default(), &run, on, &given)[1]
    };
    assert!(
        (of("Y") + short_mm).abs() < 1e-12 && of("X").abs() < 1e-15,
        "{}",
        of("Y")
    );
}
