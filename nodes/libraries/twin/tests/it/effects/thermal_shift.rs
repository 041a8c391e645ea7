//! Thermal shift against a bar in which heat spreads.

use metrology::Axis;
use twin::Channel;

use crate::effects::past::{predict, read, stands, warm};
use crate::effects::scene::bench;

/// Thermal diffusivity of steel, mm2/s, and the bar.
const STEEL_MM2_S: f64 = 13.0;
const LENGTH_MM: f64 = 300.0;
const CELLS: usize = 40;
/// Growth of the whole bar, um/K.
const UM_PER_K: f64 = 11.5e-3 * LENGTH_MM;

/// Warming of the end with the thermometer, K.
fn end_k(at_s: f64) -> f64 {
    8.0 * (1.0 - (-at_s / 1500.0).exp())
}

/// Mean warming of the bar at the end of some time, K: heat enters at one end, the other is insulated.
fn mean_k(until_s: f64) -> f64 {
    let cell_mm = LENGTH_MM / CELLS as f64;
    let rate = STEEL_MM2_S / cell_mm.powi(2);
    let steps = (until_s * rate / 0.4).ceil();
    let step_s = until_s / steps;
    let mut cells = [0.0; CELLS];
    let mut at_s = 0.0;
    for _ in 0..steps as usize {
        let before = cells;
        for (k, cell) in cells.iter_mut().enumerate() {
            // The end is half a cell away.
            let warmer = if k == 0 {
                2.0 * (end_k(at_s) - before[0])
            } else {
                before[k - 1] - before[k]
            };
            let cooler = if k + 1 == CELLS {
                0.0
            } else {
                before[k + 1] - before[k]
            };
            *cell += step_s * rate * (warmer + cooler);
        }
        at_s += step_s;
    }
    cells.iter().sum::<f64>() / CELLS as f64
}

#[test]
fn val_thermal_shift_of_a_bar_heated_at_its_end() {
    let machine = bench();
    let lag_min = LENGTH_MM.powi(2) / (3.0 * STEEL_MM2_S) / 60.0;
    let history = warm(20.0, 1000, "bed", &|t| 20.0 + end_k(t));
    let at_s: Vec<f64> = (1..10).map(|k| 1800.0 * f64::from(k)).collect();
    let mut run = stands(&at_s, |_| [0.0; 3]);
    read(&mut run, &Channel::Length(Axis::Z));
    let given = [
        ("x_um_per_k", 0.0),
        ("y_um_per_k", 0.0),
        ("z_um_per_k", UM_PER_K),
        ("lag_min", lag_min),
    ];
    let seen = predict(&machine, &history, &run, ("thermal_shift", "bed"), &given);
    let whole_mm = 8.0 * UM_PER_K * 1e-3;
    let mut worst = 0.0_f64;
    for (until_s, seen) in at_s.iter().zip(&seen) {
        worst = worst.max((seen.abs() - mean_k(*until_s) * UM_PER_K * 1e-3).abs());
    }
    println!("bar: {:.1} % of its growth", 100.0 * worst / whole_mm);
    assert!(worst < 0.06 * whole_mm, "{worst} of {whole_mm}");
    assert!(seen[8].abs() > 0.9 * whole_mm, "{seen:?}");
    let mut across = stands(&at_s, |_| [0.0; 3]);
    read(&mut across, &Channel::Length(Axis::X));
    let none = predict(
        &machine,
        &history,
        &across,
        ("thermal_shift", "bed"),
        &given,
    );
    assert!(none.iter().all(|mm| mm.abs() < 1e-12), "{none:?}");
}
