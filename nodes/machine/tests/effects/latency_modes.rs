//! Two modes of latency against drawn touches.

use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::past::{scatter, touch, touching};
use crate::scene::bench;

#[test]
fn val_latency_modes_drawn() {
    let mut rng = Pcg64Mcg::seed_from_u64(11);
    let (feed, apart_s, share) = (8.0, 0.7e-3, 0.3);
    let n = 200_000;
    let travel: Vec<f64> = (0..n)
        .map(|_| {
            if rng.random::<f64>() < share {
                feed * (2e-3 + apart_s)
            } else {
                feed * 2e-3
            }
        })
        .collect();
    let mean = travel.iter().sum::<f64>() / f64::from(n);
    let drawn = travel.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / f64::from(n);
    let run = touching(vec![touch(0.0, [0.0; 3], Vector3::x(), feed)]);
    let given = [("apart_ms", 0.7), ("late_share", 0.3)];
    let seen = scatter(&bench(), &run, ("latency_modes", ""), &given)[0];
    println!("modes: {:.2} % off", 100.0 * (seen / drawn - 1.0));
    assert!((seen / drawn - 1.0).abs() < 0.01, "{seen} {drawn}");
}
