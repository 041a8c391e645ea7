//! A thermometer's lag against its own heat balance.

use twin::Channel;

use crate::effects::past::{integrate, predict, read, stands, warm};
use crate::effects::scene::bench;

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

/// An element of 20 s in a sheath of 70 s, in something that warms by 6 K.
#[test]
fn val_thermometer_lag_of_an_element_in_a_sheath() {
    let (sheath_s, element_s) = (70.0, 20.0);
    let truth = |t: f64| 20.0 + 6.0 * (1.0 - (-t / 240.0).exp());
    let balance = |t: f64, [s, e]: [f64; 2]| [(truth(t) - s) / sheath_s, (s - e) / element_s];
    let reads = |t: f64| integrate(balance, [20.0; 2], t, 400)[1];
    let history = warm(5.0, 300, "bed", &reads);
    let at_s: Vec<f64> = (1..13).map(|k| 100.0 * f64::from(k)).collect();
    let mut run = stands(&at_s, |_| [0.0; 3]);
    read(&mut run, &Channel::Thermometer(String::from("bed")));
    let off_k = |square_s2: f64| {
        let given = [
            ("lag_s", sheath_s + element_s),
            ("free_square_s2", square_s2),
        ];
        let seen = predict(&bench(), &history, &run, ("thermometer_lag", "bed"), &given);
        let pairs = at_s.iter().zip(&seen);
        pairs.fold(0.0, |worst, (t, seen)| {
            f64::max(worst, (seen - (reads(*t) - truth(*t))).abs())
        })
    };
    let (plain, wide) = (off_k(0.0), off_k(sheath_s * element_s));
    println!("sheath: (2) leaves {plain:.3} K, (3) {wide:.1e} K");
    assert!(plain > 0.05 && wide < 2e-3, "{plain} {wide}");
}
