//! Deflection under inertia against a mass on a spring.

use twin::{Channel, History};

use crate::effects::past::{integrate, predict, read};
use crate::effects::scene::{bench, circle};

#[test]
fn val_load_deflection_mass_on_spring() {
    let machine = bench();
    // 50 mm at 113 mm/s: 0.255 m/s2; a resonance of 40 Hz with 5 % of damping.
    let (radius_mm, feed_mm_s) = (50.0, 113.0);
    let resonance = std::f64::consts::TAU * 40.0;
    let rate = feed_mm_s / radius_mm;
    let mut run = circle(radius_mm, feed_mm_s, 1.0);
    read(&mut run, &Channel::GridU);
    let given = [("along_um", 1e3 * 1000.0 / (resonance * resonance))];
    let on = ("load_deflection", "X");
    let seen = predict(&machine, &History::default(), &run, on, &given);
    let spring = |t: f64, [bend, speed]: [f64; 2]| {
        let acceleration = -radius_mm * rate * rate * (rate * t).cos();
        let back = -resonance * resonance * bend - 2.0 * 0.05 * resonance * speed;
        [speed, back - acceleration]
    };
    let start = [radius_mm * rate * rate / (resonance * resonance), 0.0];
    let mut worst = 0.0_f64;
    for tick in [400, 1000, 1700, 2300] {
        let end_s = tick as f64 * 1e-3;
        let [bend_mm, _] = integrate(spring, start, end_s, tick * 20);
        worst = worst.max((seen[tick] - bend_mm).abs());
    }
    println!("spring: worst {worst:.2e} mm of {}", start[0]);
    assert!(seen[100] > 0.0, "the radius grows");
    assert!(worst < 1e-3 * start[0], "{worst}");
}
