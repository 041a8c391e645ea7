//! A thermometer's lag against its own heat balance.

use machine::twin::Channel;

use crate::past::{integrate, predict, read, stands, warm};
use crate::scene::bench;

#[test]
fn val_thermometer_lag_ramp_and_step() {
    let machine = bench();
    let lag_s = 90.0;
    let ramp = |t: f64| 20.0 + t / 600.0;
    let rise = |t: f64| 20.0 + 6.0 * (1.0 - (-t / 900.0).exp());
    let cases: [&dyn Fn(f64) -> f64; 2] = [&ramp, &rise];
    let mut worst = 0.0_f64;
    for truth in cases {
        let reads = |t: f64| integrate(|t, [m]| [(truth(t) - m) / lag_s], [20.0], t, 400)[0];
        let history = warm(5.0, 400, "bed", &reads);
        let at_s = [100.0, 400.0, 1000.0, 1900.0];
        let mut run = stands(&at_s, |_| [0.0; 3]);
        read(&mut run, &Channel::Thermometer(String::from("bed")));
        read(&mut run, &Channel::Thermometer(String::from("column")));
        let given = [("lag_s", lag_s)];
        let seen = predict(&machine, &history, &run, ("thermometer_lag", "bed"), &given);
        for (t, seen) in at_s.iter().zip(&seen) {
            worst = worst.max((seen - (reads(*t) - truth(*t))).abs());
        }
        assert!(
            seen[4..].iter().all(|k| *k == 0.0),
            "another thermometer is as it was"
        );
    }
    println!("lag: worst {worst:.2e} K");
    assert!(worst < 3e-5, "{worst}");
}
