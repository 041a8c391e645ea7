//! Backlash of a rotary axis against a gear that yields to a dry bearing.

use metrology::Axis;
use nalgebra::{Rotation3, Vector3};

use crate::effects::scene::{bench, greatest, response_of, run, tip_mm};

/// The table hangs on its motor by a spring of 2e6 N m/rad and slides in its bearing at 14 N m: it stays up to 7 urad behind.
#[test]
fn val_a_gear_that_yields_to_a_dry_bearing() {
    let machine = bench();
    let (stiffness, friction) = (2e6, 14.0);
    let at = |t: f64| 0.4 * (1.3 * t).sin() + 0.1 * (4.1 * t).sin();
    let p = Vector3::new(150.0, 20.0, 30.0);
    let run = run(6000, machine.axis_set(), |t| {
        [p.x, p.y, p.z, 0.0, 0.0, at(t)]
    });
    let width_urad = 2.0 * friction / stiffness * 1e6;
    let given = [("width_urad", width_urad)];
    let response = response_of(&machine, &run, "rotary_backlash", "C", &given);
    let mut table: f64 = at(0.0);
    let off = (0..run.motion.len()).flat_map(|tick| {
        for k in 0..100 {
            let motor = at((run.motion.time_s[tick] - 1e-5 * f64::from(99 - k)).max(0.0));
            let torque = stiffness * (motor - table);
            // The bearing gives way to what is beyond its friction.
            table += (torque.abs() - friction).max(0.0) * torque.signum() / stiffness;
        }
        let behind = table - run.motion.position[Axis::C][tick];
        // The workpiece turns, so that the tip is off the other way in its frame.
        let wanted = Rotation3::from_axis_angle(&Vector3::z_axis(), -behind) * p - p;
        (tip_mm(&response, tick) - wanted).as_slice().to_vec()
    });
    let off_um = greatest(off) * 1e3;
    let most_um = greatest(response.tip_mm[1].iter().copied()) * 1e3;
    println!("dry bearing {most_um:.3} um, off by {off_um:.1e} um");
    assert!(most_um > 1.0 && off_um < 0.02 * most_um, "{off_um}");
}
