//! Repeatability against a drawn seat that settles anew after each touch.

use machine::file::StylusEntry;
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::effects::past::{scatter, touch, touching};
use crate::effects::scene::bench;

/// A standard normal number, by the sum of twelve uniform ones.
fn normal(rng: &mut Pcg64Mcg) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

#[test]
fn val_probe_repeatability_seat_and_lever() {
    let mut machine = bench();
    let long = StylusEntry {
        radius_mm: 3.0,
        length_mm: 225.0,
        stem_length_mm: None,
    };
    machine.probe.styli.insert(String::from("long"), long);
    // The seat settles within 2 urad about X and Y and 0.3 um along the approach; ball 150 or 225 mm below it.
    let mut rng = Pcg64Mcg::seed_from_u64(13);
    for (name, length_mm) in [("ruby_6", 150.0), ("long", 225.0)] {
        for n in [Vector3::x(), -Vector3::z()] {
            let draws = 100_000;
            let drawn: f64 = (0..draws)
                .map(|_| {
                    let tilt = Vector3::new(normal(&mut rng), normal(&mut rng), 0.0) * 2e-6;
                    let ball = tilt.cross(&Vector3::new(0.0, 0.0, -length_mm));
                    (ball.dot(&n) + 0.3e-3 * normal(&mut rng)).powi(2)
                })
                .sum::<f64>()
                / f64::from(draws);
            let mut run = touching(vec![touch(0.0, [0.0; 3], n, 2.0)]);
            run.segment.stylus = String::from(name);
            let given = [("sigma_um", 0.3), ("free_lateral_um", 2e-6 * 150.0 * 1e3)];
            let seen = scatter(&machine, &run, ("probe_repeatability", ""), &given)[0];
            println!("{name} {n:?}: {:.2} % off", 100.0 * (seen / drawn - 1.0));
            // Four standard deviations of a sample variance: 4 sqrt(2 / n).
            assert!((seen / drawn - 1.0).abs() < 4.0 * f64::sqrt(2.0 / f64::from(draws)));
        }
    }
}
