//! Budget files that are read, and those that are refused.

use super::*;
use crate::evaluate::thermometer::Dead;
use iso230::circular::{CircularTest, CircularTrace, evaluate};

pub(super) const WHOLE: &str = "
grid_encoder: {expanded_uncertainty_um: 0.6, expanded_uncertainty_um_per_m: 1.0, coverage_factor: 2.0}
length_reference: {expanded_uncertainty_um: 0.1, expanded_uncertainty_um_per_m: 0.5, coverage_factor: 2.0}
machine: {temperature_deviation_k: 0.5, temperature_half_width_k: 0.5, expansion_um_per_m_k: 11.0, expansion_half_width_um_per_m_k: 1.0}
device: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.1, expansion_um_per_m_k: 0.0, expansion_half_width_um_per_m_k: 0.0}
misalignment_mm: 0.1
environmental_drift_um: 0.6
";

fn refusal(from: &str, to: &str) -> String {
    assert!(WHOLE.contains(from));
    let text = WHOLE.replacen(from, to, 1);
    let error = Budget::read(&text, Path::new("budget.yaml")).unwrap_err();
    format!("{error:#}")
}

#[test]
fn an_expansion_in_another_unit_is_refused_with_the_right_one() {
    for number in ["11.0e-6", "0.011", "1.0e-9", "0.0115"] {
        let words = refusal(
            "expansion_um_per_m_k: 11.0,",
            &format!("expansion_um_per_m_k: {number},"),
        );
        assert!(words.contains("machine.expansion_um_per_m_k"), "{words}");
        assert!(words.contains("11e-6 per K are 11.0"), "{words}");
    }
    for number in ["0.0", "0.05", "1.2", "23.8"] {
        let text = WHOLE.replace("k: 11.0,", &format!("k: {number},"));
        assert!(
            Budget::read(&text, Path::new("budget.yaml")).is_ok(),
            "{number}"
        );
    }
}

#[test]
fn a_data_sheet_becomes_mm_and_ratios() {
    let budget = Budget::read(WHOLE, Path::new("budget.yaml")).unwrap();
    let device = budget.positioning(None, None).device;
    assert!((device.expanded_uncertainty_mm - 1e-4).abs() < 1e-18);
    assert!((device.expanded_uncertainty_per_length - 5e-7).abs() < 1e-18);
    assert!((budget.circular(None, None).environmental_drift_mm - 6e-4).abs() < 1e-18);
}

fn readings(degc: &[f64]) -> Readings {
    let mut readings = Readings::new(degc[0]);
    degc[1..].iter().for_each(|value| readings.add(*value));
    readings
}

#[test]
fn no_length_is_corrected_by_a_thermometer_that_fell_to_zero() {
    let text = WHOLE.replacen("temperature_deviation_k: 0.5", "thermometers: [bed]", 1);
    let budget = Budget::read(&text, Path::new("budget.yaml")).unwrap();
    let mut bed = readings(&[22.1, 0.0, 0.0, 0.0, 0.0, 0.0]);
    bed.dead = Some(Dead {
        before_degc: Some(22.1),
        degc: 0.0,
        n: 5,
    });
    let read = Thermometers::from([("bed".to_owned(), bed)]);
    let why = budget.machine_body().temperature(&read).unwrap_err();
    let words = "names a dead thermometer: thermometer bed reads 0 °C 5 times one after another, after 22.1 °C";
    assert!(why.starts_with(words), "{why}");
}

#[test]
fn a_body_is_as_warm_as_it_is_stated_or_as_its_thermometers_read_during_the_test() {
    let budget = Budget::read(WHOLE, Path::new("budget.yaml")).unwrap();
    let nothing = Thermometers::new();
    let stated = budget.machine_body().temperature(&nothing).unwrap();
    assert_eq!((stated.deviation_k, stated.half_width_k), (0.5, 0.5));
    let text = WHOLE.replacen(
        "temperature_deviation_k: 0.5",
        "thermometers: [bed, nut_x]",
        1,
    );
    let budget = Budget::read(&text, Path::new("budget.yaml")).unwrap();
    let why = budget.machine_body().temperature(&nothing).unwrap_err();
    assert!(
        why.contains("thermometer bed, which has no reading"),
        "{why}"
    );
    // Means 22.3 and 22.7; ranges 0.6 and 1.8, so 0.6 beside the stated 0.5.
    let read = Thermometers::from([
        ("bed".to_owned(), readings(&[22.0, 22.6])),
        ("nut_x".to_owned(), readings(&[21.8, 23.6])),
    ]);
    let found = budget.machine_body().temperature(&read).unwrap();
    assert!((found.deviation_k - 2.5).abs() < 1e-12, "{found:?}");
    assert!(
        (found.half_width_k - 0.61_f64.sqrt()).abs() < 1e-12,
        "{found:?}"
    );
    // A driver's kelvins or degrees Fahrenheit are no temperature of a machine.
    for (degc, is_known) in [
        (49.9, true),
        (-9.9, true),
        (71.6, false),
        (295.15, false),
        (-10.1, false),
    ] {
        let read = Thermometers::from([
            ("bed".to_owned(), readings(&[22.0, degc])),
            ("nut_x".to_owned(), readings(&[22.0])),
        ]);
        let found = budget.machine_body().temperature(&read);
        assert_eq!(found.is_ok(), is_known, "{degc}");
        if let Err(why) = found {
            let words = format!("temperature/bed read {degc} °C");
            assert!(
                why.contains(&words) && why.contains("from -10 to 50 °C"),
                "{why}"
            );
        }
    }
    let text = text.replacen("thermometers: [bed, nut_x], ", "", 1);
    let budget = Budget::read(&text, Path::new("budget.yaml")).unwrap();
    let why = budget.machine_body().temperature(&read).unwrap_err();
    assert!(
        why.contains("neither temperature_deviation_k nor thermometers"),
        "{why}"
    );
    assert!(budget.device_body().temperature(&nothing).is_ok());
}

#[test]
fn a_circular_budget_counts_the_plates_constant_once_and_its_expansion_too() {
    let text = WHOLE.replace(
        "device: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.1, expansion_um_per_m_k: 0.0,",
        "device: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.6, expansion_um_per_m_k: 8.0,",
    );
    let budget = Budget::read(&text, Path::new("budget.yaml")).unwrap();
    let points = (0..360).map(|k| {
        let angle = f64::from(k).to_radians();
        [50.0 * angle.cos(), 50.0 * angle.sin()]
    });
    let test = CircularTest {
        nominal_radius_mm: 50.0,
        clockwise: Some(CircularTrace::PointsMm(points.collect())),
        counter_clockwise: None,
    };
    let result = evaluate(&test, &budget.circular(None, None)).unwrap();
    // Standard uncertainties over R = 50 mm by hand, µm.
    let plate =
        (0.867 * 0.6_f64.powi(2) + 0.468 * 2.0 * 0.6 * 0.05 + 0.05_f64.powi(2)).sqrt() / 2.0;
    let drift = 0.6 / 2.0 / 3.0_f64.sqrt();
    let machine_temperature = 11.0 * 0.05 * 0.5 / 3.0_f64.sqrt();
    let machine_expansion = 0.5 * 0.05 * 1.0 / 3.0_f64.sqrt();
    let device_temperature = 8.0 * 0.05 * 0.6 / 3.0_f64.sqrt();
    // 0.293² + 0.173² + 0.159² + 0.0144² + 0.139² = 0.160 µm²; U = 2 × 0.400 = 0.801 µm.
    let all = [
        plate,
        drift,
        machine_temperature,
        machine_expansion,
        device_temperature,
    ];
    let by_hand_um = 2.0 * all.iter().map(|u: &f64| u * u).sum::<f64>().sqrt();
    assert!((by_hand_um - 0.801).abs() < 1e-3, "{by_hand_um}");
    let f = result.clockwise.unwrap().greatest_radial_deviation;
    assert!((1e3 * f.expanded_uncertainty_mm - by_hand_um).abs() < 1e-12);
}

#[test]
fn every_number_has_a_largest_value_and_one_beyond_it_is_refused_with_both() {
    for mandrel in [
        "temperature_range_k: 2.0",
        "thermometers: [a], temperature_half_width_k: 0.2, expansion_half_width_um_per_m_k: 0.1, growth_reads: less",
    ] {
        let text = format!(
            "{WHOLE}angular_reference: {{expanded_uncertainty_arcsec: 0.4, coverage_factor: 2.0, environmental_drift_arcsec: 0.2}}\nplate_squareness_urad: 2.0\nlength_error_period_um: 0.3\nmandrel: {{length_mm: 250.0, expansion_um_per_m_k: 1.5, {mandrel}}}\n"
        );
        let budget = Budget::read(&text, Path::new("budget.yaml")).unwrap();
        for (key, value) in budget.numbers() {
            assert!(greatest(key) < 1e6, "{key} has no largest value");
            let (parent, name) = key.split_once('.').unwrap_or(("", key));
            let of_parent = text.find(&format!("\n{parent}")).unwrap();
            let place = of_parent + text[of_parent..].find(name).unwrap();
            for far in ["1e300", "1e5", ".inf", ".nan", "-1e-9"] {
                let old = format!("{name}: {value:?}");
                let wrong = text[place..].replacen(&old, &format!("{name}: {far}"), 1);
                let wrong = format!("{}{wrong}", &text[..place]);
                assert_ne!(wrong, text, "{key}");
                let error = Budget::read(&wrong, Path::new("budget.yaml")).unwrap_err();
                let error = format!("{error:#}");
                let limit = quantity(key, greatest(key));
                assert!(
                    error.contains(key) && error.contains(&limit),
                    "{far}: {error}"
                );
            }
        }
    }
    let factor = refusal("coverage_factor: 2.0", "coverage_factor: 200.0");
    assert!(factor.contains("must be from 1 to 13"), "{factor}");
}

#[test]
fn a_wrong_budget_is_refused_with_key_and_value() {
    let both = refusal(
        "temperature_deviation_k: 0.5,",
        "temperature_deviation_k: 0.5, thermometers: [bed],",
    );
    assert!(
        both.contains("machine.temperature_deviation_k: leave it out"),
        "{both}"
    );
    let far = refusal(
        "temperature_deviation_k: 0.5",
        "temperature_deviation_k: 293.0",
    );
    assert!(
        far.contains("machine.temperature_deviation_k = 293 K: must be from -100 to 100 K"),
        "{far}"
    );
    let long = format!("misalignment_mm: 0.1\noperator: {}", "x".repeat(300));
    let long = refusal("misalignment_mm: 0.1", &long);
    assert!(long.contains("operator"), "{long}");
    assert!(
        refusal("misalignment_mm: 0.1", "misalignment_mm: -0.1")
            .contains("misalignment_mm = -0.1 mm: must be from 0 to 100 mm")
    );
    assert!(refusal("misalignment_mm: 0.1", "misalignment_um: 0.1").contains("misalignment_um"));
    assert!(
        refusal("coverage_factor: 2.0", "coverage_factor: 0.0")
            .contains("grid_encoder.coverage_factor = 0")
    );
}

const BALLBAR: &str = "ballbar: {expanded_uncertainty_um: 1.0, expanded_uncertainty_um_per_m: 0.0, coverage_factor: 2.0, length: {expanded_uncertainty_um: 0.5, expanded_uncertainty_um_per_m: 1.0, coverage_factor: 2.0}, body: {temperature_half_width_k: 0.1, expansion_um_per_m_k: 1.2, expansion_half_width_um_per_m_k: 0.5}}\n";

#[test]
fn numbers_of_a_ballbar_have_limits_too() {
    let whole = format!("{WHOLE}{BALLBAR}");
    let budget = Budget::read(&whole, Path::new("budget.yaml")).unwrap();
    let length = budget.ballbar_length().unwrap();
    assert!((length.standard_mm(1000.0) - 0.75e-3).abs() < 1e-15);
    for (from, to, words) in [
        (
            "_um: 1.0",
            "_um: -1.0",
            "ballbar.expanded_uncertainty_um = -1",
        ),
        (
            "_um: 0.5",
            "_um: 1e9",
            "ballbar.length.expanded_uncertainty_um = ",
        ),
        (
            "factor: 2.0, length",
            "factor: 0.5, length",
            "ballbar.coverage_factor = 0.5",
        ),
        (
            "factor: 2.0}, body",
            "factor: 50.0}, body",
            "ballbar.length.coverage_factor = 50",
        ),
        (
            "m_k: 1.2",
            "m_k: 1200.0",
            "ballbar.body.expansion_um_per_m_k = ",
        ),
        (
            "body: {",
            "body: {temperature_deviation_k: 200.0, ",
            "ballbar.body.temperature_deviation_k = ",
        ),
    ] {
        assert!(BALLBAR.contains(from), "{from}");
        let text = format!("{WHOLE}{}", BALLBAR.replacen(from, to, 1));
        let error = Budget::read(&text, Path::new("budget.yaml")).unwrap_err();
        let error = format!("{error:#}");
        assert!(error.contains(words), "{error}");
    }
}
