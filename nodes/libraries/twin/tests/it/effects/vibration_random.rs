//! Vibration of random phase against drawn sines.

use metrology::Axis;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use twin::Channel;

use crate::effects::past::{read, scatter};
use crate::effects::scene::{bench, run};

#[test]
fn val_vibration_random_phases() {
    let machine = bench();
    let mut rng = Pcg64Mcg::seed_from_u64(14);
    let n = 200_000;
    let sines: Vec<f64> = (0..n)
        .map(|_| 0.6e-3 * (std::f64::consts::TAU * rng.random::<f64>()).sin())
        .collect();
    let mean_of = |power: i32| sines.iter().map(|x| x.powi(power)).sum::<f64>() / f64::from(n);
    let drawn = mean_of(2);
    // A sine's kurtosis is 1.5, that of noise 3 (Thomson, 13.4).
    let kurtosis = mean_of(4) / drawn.powi(2);
    assert!((kurtosis - 1.5).abs() < 0.01, "{kurtosis}");
    let mut line = run(100, machine.axis_set(), |t| {
        [0.0, 50.0 * t, 0.0, 0.0, 0.0, 0.0]
    });
    read(&mut line, &Channel::GridU);
    read(&mut line, &Channel::GridV);
    let seen = |given: &[(&str, f64)]| scatter(&machine, &line, ("vibration_random", "Y"), given);
    let plain = seen(&[("amplitude_um", 0.6)]);
    println!("phases: {:.2} % off", 100.0 * (plain[150] / drawn - 1.0));
    assert!((plain[150] / drawn - 1.0).abs() < 0.01);
    assert!(plain[50].abs() < 1e-18, "across it nothing shakes");
    // At 50 mm/s half the amplitude that is stated at 100 mm/s.
    let with_speed = seen(&[("amplitude_um", 0.0), ("free_with_speed_um", 1.2)]);
    assert!((with_speed[150] / drawn - 1.0).abs() < 0.01);
    let _ = Axis::Y;
}
