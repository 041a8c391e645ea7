//! A thermometer's noise against a digital sensor and against one in a draught.

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use twin::{Channel, History};

use crate::effects::past::{read, scatter_after, stands, warm};
use crate::effects::scene::bench;

/// Standard deviation that the effect gives a reading of the thermometer `bed`, K, at a temperature above the air's.
fn told_k(above_air_k: f64, given: &[(&str, f64)]) -> f64 {
    let mut history = warm(5.0, 10, "bed", &|_| 23.0 + above_air_k);
    let air: History = warm(5.0, 10, "air", &|_| 23.0);
    history.temperature_degc.extend(air.temperature_degc);
    let mut run = stands(&[20.0], |_| [0.0; 3]);
    read(&mut run, &Channel::Thermometer(String::from("bed")));
    read(&mut run, &Channel::Thermometer(String::from("air")));
    let on = ("thermometer_noise", "bed");
    let seen = scatter_after(&bench(), &history, &run, on, given);
    assert!(
        seen[1].abs() < 1e-18,
        "another thermometer is as quiet as it was"
    );
    seen[0].sqrt()
}

fn deviation(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
    (squares / n).sqrt()
}

#[test]
fn val_thermometer_noise_of_a_digital_sensor() {
    // Twelve bits over 256 K; something warms by 6 K an hour and is read once a second.
    let step_k = 0.0625;
    let off: Vec<f64> = (0..3600)
        .map(|second| {
            let truth = 20.01 + f64::from(second) / 600.0;
            (truth / step_k).round() * step_k - truth
        })
        .collect();
    let seen_k = deviation(&off);
    let given = [("sigma_k", 0.29 * step_k)];
    println!("digital: {seen_k:.5} K, {:.5} K", told_k(0.0, &given));
    assert!(
        (told_k(0.0, &given) / seen_k - 1.0).abs() < 0.01,
        "{seen_k}"
    );
}

/// A sensor between what it is glued to (`glue_w_per_k`) and the air, whose draught makes its cooling go up and down evenly
/// by a fifth: its temperature divides the difference as two resistances do.
#[test]
fn val_thermometer_noise_of_a_sensor_in_a_draught() {
    let (glue_w_per_k, air_w_per_k, spread) = (0.030_f64, 0.003_f64, 0.2_f64);
    let mut rng = Pcg64Mcg::seed_from_u64(21);
    let share = air_w_per_k * glue_w_per_k / (air_w_per_k + glue_w_per_k).powi(2);
    for above_air_k in [4.0, 12.0] {
        let shown: Vec<f64> = (0..50_000)
            .map(|_| {
                let even = 2.0 * rng.random::<f64>() - 1.0;
                let cooling = air_w_per_k * (1.0 + spread * even);
                above_air_k * glue_w_per_k / (glue_w_per_k + cooling)
            })
            .collect();
        let seen_k = deviation(&shown);
        let mean_k = shown.iter().sum::<f64>() / 50_000.0;
        // An even spread has 1 / sqrt 3 of its half width; of what is shown above the air, not of what is there.
        let of_shown = share * (air_w_per_k + glue_w_per_k) / glue_w_per_k;
        let percent = 100.0 * of_shown * spread / 3.0_f64.sqrt();
        let given = [("sigma_k", 0.0), ("free_draught_percent", percent)];
        let told = told_k(mean_k, &given);
        println!("draught: {seen_k:.4} K, {told:.4} K");
        assert!((told / seen_k - 1.0).abs() < 0.02, "{seen_k} {told}");
    }
}
