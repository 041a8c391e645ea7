//! Error motion of a rotary axis against the geometry of an eccentric graduated ring.

use metrology::Axis;
use nalgebra::{Rotation3, Vector3};

use crate::effects::scene::{bench, greatest, response_of, run, tip_mm};

/// A ring of radius 80 mm is mounted 5 um off the axis: the head then reads another angle than the table has.
#[test]
fn val_an_eccentric_scale_ring() {
    let machine = bench();
    let (ring_mm, off_mm) = (80.0_f64, 0.005);
    let read =
        |turned: f64| turned + (off_mm * turned.sin()).atan2(ring_mm - off_mm * turned.cos());
    let true_angle = |t: f64| 1.9 * t;
    let p = Vector3::new(150.0, 20.0, 30.0);
    let run = run(3300, machine.axis_set(), |t| {
        [p.x, p.y, p.z, 0.0, 0.0, read(true_angle(t))]
    });
    let given = [
        ("cos_um_urad", 0.0),
        ("sin_um_urad", off_mm / ring_mm * 1e6),
    ];
    let response = response_of(&machine, &run, "rotary_motion", "CC", &given);
    let off = (0..run.motion.len()).flat_map(|tick| {
        let turned = true_angle(run.motion.time_s[tick]);
        let ahead = turned - run.motion.position[Axis::C][tick];
        let wanted = Rotation3::from_axis_angle(&Vector3::z_axis(), -ahead) * p - p;
        (tip_mm(&response, tick) - wanted).as_slice().to_vec()
    });
    let off_um = greatest(off) * 1e3;
    let most_um = greatest(response.tip_mm[1].iter().copied()) * 1e3;
    println!("eccentric ring {most_um:.2} um, off by {off_um:.1e} um");
    assert!(off_um < 1e-3 * most_um, "{off_um}");
}

#[test]
fn eq1_each_wave_a_turn_and_radially() {
    let machine = bench();
    let run = run(700, machine.axis_set(), |t| {
        [0.0, 0.0, 0.0, 0.0, 0.0, 9.0 * t]
    });
    for wave in 1..=5_u8 {
        for part in ["cos", "sin"] {
            let name = match wave {
                1 => format!("{part}_um_urad"),
                _ => format!("free_{part}{wave}_um_urad"),
            };
            let own = [("cos_um_urad", 0.0), ("sin_um_urad", 0.0)];
            let mut given: Vec<(&str, f64)> = own.into_iter().filter(|(k, _)| *k != name).collect();
            given.push((&name, 3.0));
            let response = response_of(&machine, &run, "rotary_motion", "XC", &given);
            for tick in 0..700 {
                let angle = f64::from(wave) * run.motion.position[Axis::C][tick];
                let share = if part == "cos" {
                    angle.cos()
                } else {
                    angle.sin()
                };
                // The error is fixed to the table's frame before it turns, and is seen in the machine frame.
                let size = tip_mm(&response, tick).norm();
                assert!((size - 0.003 * share.abs()).abs() < 1e-12, "{name}");
            }
        }
    }
}
