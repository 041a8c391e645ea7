//! Location of a rotary axis against tables turned by rotation matrices.

use metrology::Axis;
use nalgebra::{Rotation3, Vector3};

use crate::effects::scene::{bench, greatest, response_of, run, tip_mm};

/// The table C of the bench turns right-handed about a line through the machine's origin.
#[test]
fn val_a_table_that_turns_about_another_line() {
    let machine = bench();
    let run = run(3000, machine.axis_set(), |t| {
        [120.0, -60.0, 40.0, 0.0, 0.0, 2.0 * t]
    });
    let p = Vector3::new(120.0, -60.0, 40.0);
    let shift = |e: Vector3<f64>| move |turn: Rotation3<f64>| turn * e - e;
    let tilt = |about: Vector3<f64>| {
        let lean = Rotation3::from_scaled_axis(about);
        move |turn: Rotation3<f64>| {
            let table = lean * turn * lean.inverse();
            turn * (table.inverse() * p - turn.inverse() * p)
        }
    };
    type Wanted = Box<dyn Fn(Rotation3<f64>) -> Vector3<f64>>;
    let cases: [(&str, Wanted); 4] = [
        ("X0C", Box::new(shift(Vector3::x() * 0.02))),
        ("Y0C", Box::new(shift(Vector3::y() * 0.02))),
        ("A0C", Box::new(tilt(Vector3::x() * 20e-6))),
        ("B0C", Box::new(tilt(Vector3::y() * 20e-6))),
    ];
    for (on, wanted) in cases {
        let given = [("size_um_urad", 20.0)];
        let response = response_of(&machine, &run, "rotary_location", on, &given);
        let off = (0..run.motion.len()).flat_map(|tick| {
            let angle = run.motion.position[Axis::C][tick];
            let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
            let off = tip_mm(&response, tick) - wanted(turn);
            off.as_slice().to_vec()
        });
        let off_um = greatest(off) * 1e3;
        println!("{on} off by {off_um:.1e} um");
        assert!(off_um < 1e-3, "{on} {off_um}");
    }
}
