//! The wavelength in air against the dispersion formula of standard air.

use metrology::Axis;
use twin::{Channel, History};

use crate::effects::past::{instants, predict, read, stands, warm};
use crate::effects::scene::bench;

const ID: (&str, &str) = ("length_wavelength", "");

/// Ciddor 1996, (1): dry air at 15 degC and 101.325 kPa with 450 ppm of carbon dioxide; wavelength in um.
fn standard_refractivity(wavelength_um: f64) -> f64 {
    let square = wavelength_um.powi(-2);
    0.057_921_05 / (238.0185 - square) + 0.001_679_17 / (57.362 - square)
}

#[test]
fn val_length_wavelength_ciddor_standard_air() {
    let machine = bench();
    let at_degc = |degc: f64| standard_refractivity(0.632_991) * 288.15 / (degc + 273.15);
    let per_k = at_degc(20.5) - at_degc(19.5);
    // 400 mm in air of 23 degC, taken for 20 degC.
    let history = warm(10.0, 20, "air", &|_| 23.0);
    let mut run = stands(&instants(2, 100.0), |k| {
        [400.0 * k as f64 - 200.0, 0.0, 0.0]
    });
    read(&mut run, &Channel::Length(Axis::X));
    let given = [("scale_ppm", 0.0), ("free_air_share", 1.0)];
    let seen = predict(&machine, &history, &run, ID, &given);
    println!("air: {} per K for {per_k}", seen[1] / 400.0 / 3.0);
    assert!(
        (seen[1] / 400.0 / 3.0 - per_k).abs() < 1e-9,
        "{seen:?} {per_k}"
    );
    assert!(seen[1] < 0.0, "warm air makes long waves, and few of them");
}

#[test]
fn eq1_a_diagonal_beam_is_as_long_as_its_way() {
    let machine = bench();
    let mut run = stands(&instants(2, 3600.0), |k| {
        let k = k as f64;
        [300.0 * k, 400.0 * k, 0.0]
    });
    run.segment.kind = metrology::sample::TestKind::Diagonal;
    read(&mut run, &Channel::Length(Axis::Y));
    let given = [("scale_ppm", 2.0), ("free_rate_ppm_per_h", 0.5)];
    let seen = predict(&machine, &History::default(), &run, ID, &given);
    assert!((seen[1] - 2.5e-6 * 500.0).abs() < 1e-12, "{seen:?}");
}
