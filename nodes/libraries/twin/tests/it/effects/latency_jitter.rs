//! Jitter against touches whose input is polled.

use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::effects::past::{scatter, touch, touching};
use crate::effects::scene::bench;

#[test]
fn val_latency_jitter_polled_input() {
    let mut rng = Pcg64Mcg::seed_from_u64(12);
    let (feed, period_s) = (10.0, 1e-3);
    let n = 200_000;
    // The ball meets the face at a random instant and its position is taken at the next poll.
    let latched: Vec<f64> = (0..n)
        .map(|_| {
            let contact_s = 50.0 * rng.random::<f64>();
            let poll_s = (contact_s / period_s).ceil() * period_s;
            feed * (poll_s - contact_s)
        })
        .collect();
    let mean = latched.iter().sum::<f64>() / f64::from(n);
    let drawn = latched.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / f64::from(n);
    let run = touching(vec![touch(0.0, [0.0; 3], Vector3::x(), feed)]);
    let given = [("jitter_ms", 1.0 / f64::sqrt(12.0))];
    let seen = scatter(&bench(), &run, ("latency_jitter", ""), &given)[0];
    println!("polled: {:.2} % off", 100.0 * (seen / drawn - 1.0));
    assert!((seen / drawn - 1.0).abs() < 0.01, "{seen} {drawn}");
}

#[test]
fn eq1_scatter_doubles_with_the_feed() {
    let run = touching(
        [5.0, 10.0]
            .map(|f| touch(0.0, [0.0; 3], Vector3::x(), f))
            .into(),
    );
    let seen = scatter(
        &bench(),
        &run,
        ("latency_jitter", ""),
        &[("jitter_ms", 0.1)],
    );
    assert!((seen[1] / seen[0] - 4.0).abs() < 1e-12, "{seen:?}");
}
