//! A thermometer's offset against the tolerance of platinum sensors.

use twin::Channel;

use crate::effects::past::{predict, read, stands, warm};
use crate::effects::scene::{bench, fit, greatest};

/// What the effect adds to a thermometer that reads so.
fn added_k(reads_degc: f64, given: &[(&str, f64)]) -> f64 {
    let history = warm(5.0, 10, "air", &|_| reads_degc);
    let mut run = stands(&[20.0], |_| [0.0; 3]);
    read(&mut run, &Channel::Thermometer(String::from("air")));
    let on = ("thermometer_offset", "air");
    predict(&bench(), &history, &run, on, given)[0]
}

/// Temperature of a resistance by the equation of IEC 60751 above 0 degC, R = 100 (1 + A t + B t2).
fn degc(ohm: f64) -> f64 {
    let (a, b) = (3.9083e-3, -5.775e-7);
    (-a + (a * a - 4.0 * b * (1.0 - ohm / 100.0)).sqrt()) / (2.0 * b)
}

fn ohm(degc: f64) -> f64 {
    100.0 * (1.0 + 3.9083e-3 * degc - 5.775e-7 * degc * degc)
}

/// A resistor of class B may have 100.12 ohm at 0 degC, and two leads of 0.1 ohm each are read as part of it.
#[test]
fn val_thermometer_offset_pt100_read_with_its_leads() {
    // Published points of the table: 107.79 ohm at 20 degC, 115.54 ohm at 40 degC.
    assert!((ohm(20.0) - 107.79).abs() < 5e-3 && (degc(115.54) - 40.0).abs() < 0.02);
    let truth: Vec<f64> = (0..=30).map(|k| 10.0 + f64::from(k)).collect();
    for (r0_ohm, leads_ohm, at_20_k) in [(100.12, 0.0, 0.33), (100.0, 0.2, 0.52)] {
        let reads = truth
            .iter()
            .map(|t| degc(ohm(*t) * r0_ohm / 100.0 + leads_ohm));
        let reads: Vec<f64> = reads.collect();
        let wanted: Vec<f64> = reads.iter().zip(&truth).map(|(r, t)| r - t).collect();
        let column = |given: [(&str, f64); 2]| -> Vec<f64> {
            reads.iter().map(|r| added_k(*r, &given)).collect()
        };
        let columns = [
            column([("offset_k", 1.0), ("free_slope_percent", 0.0)]),
            column([("offset_k", 0.0), ("free_slope_percent", 1.0)]),
        ];
        let (sizes, left_k) = fit(&columns, &wanted);
        let whole_k = greatest(wanted.iter().copied());
        println!("{r0_ohm} and {leads_ohm} ohm: {sizes:?}, left {left_k:.1e} of {whole_k:.2} K");
        assert!((sizes[0] - at_20_k).abs() < 0.01, "{sizes:?}");
        assert!(left_k < 1e-4, "{left_k}");
    }
}

#[test]
fn eq2_an_offset_and_a_slope_meet_the_limits_of_class_b() {
    let machine = bench();
    // 0.30 K + 0.005 |t|: 0.30 K at 0 and 0.60 K at 60 degC.
    for (degc, limit_k) in [(0.0, 0.30), (60.0, 0.60)] {
        let history = warm(5.0, 10, "air", &|_| degc);
        let mut run = stands(&[20.0], |_| [0.0; 3]);
        read(&mut run, &Channel::Thermometer(String::from("air")));
        let given = [("offset_k", 0.4), ("free_slope_percent", 0.5)];
        let seen = predict(
            &machine,
            &history,
            &run,
            ("thermometer_offset", "air"),
            &given,
        );
        assert!((seen[0] - limit_k).abs() < 1e-12, "{seen:?}");
    }
}
