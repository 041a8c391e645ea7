//! Two modes of latency against drawn touches.

use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::effects::past::{scatter, touch, touching};
use crate::effects::scene::bench;

/// A link sends a trigger again in each next frame until it is heard. That it takes k frames more has the probability
/// (1 - p) p^k, whose variance is p / (1 - p)^2 (Feller, geometric distribution).
#[test]
fn val_latency_modes_of_a_link_that_sends_again() {
    let mut rng = Pcg64Mcg::seed_from_u64(15);
    let (feed, frame_s, lost) = (8.0, 2e-3, 0.03);
    let n = 400_000;
    let travel: Vec<f64> = (0..n)
        .map(|_| {
            let mut late_s = 0.0;
            while rng.random::<f64>() < lost {
                late_s += frame_s;
            }
            feed * late_s
        })
        .collect();
    let mean = travel.iter().sum::<f64>() / f64::from(n);
    let drawn = travel.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / f64::from(n);
    let published = lost / (1.0 - lost).powi(2) * (feed * frame_s).powi(2);
    assert!(
        (drawn / published - 1.0).abs() < 0.03,
        "{drawn} {published}"
    );
    let run = touching(vec![touch(0.0, [0.0; 3], Vector3::x(), feed)]);
    let given = [("apart_ms", 2.0), ("late_share", lost)];
    let seen = scatter(&bench(), &run, ("latency_modes", ""), &given)[0];
    println!("modes: {:.1} % of the link's", 100.0 * seen / published);
    // The third mode, of triggers that were lost twice, is missing.
    assert!((0.9..0.93).contains(&(seen / published)), "{seen}");
}

#[test]
fn eq1_latency_modes_drawn() {
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
