//! Logs along Z on a mandrel that warms.

use std::path::Path;

use super::*;
use crate::evaluate::drift::Series;
use crate::evaluate::test_conditions::Readings;

const BUDGET: &str = include_str!("../../../../../../launch_configs/full_closed/budget.yaml");
const READ: &str = "mandrel: {length_mm: 200.0, expansion_um_per_m_k: 10.0, expansion_half_width_um_per_m_k: 1.0, thermometers: [top], temperature_half_width_k: 0.1, growth_reads: more}";

/// Warming of the mandrel by the time in hours, K.
fn warm_k(h: f64) -> f64 {
    3.0 * (1.0 - (-h / 0.75).exp())
}

/// A value every 5 minutes for so many hours.
fn every_5_min(hours: f64, value: impl Fn(f64) -> f64) -> Series {
    let mut series = Series::default();
    for k in 0..=(12.0 * hours) as i64 {
        let at = Stamp::from_nanos(300_000_000_000 * k);
        series.push(at, value(k as f64 / 12.0));
    }
    series
}

/// The part of a log of four hours along an axis, beside a thermometer on the mandrel that was read for `hours`.
fn part(axis: Axis, mm: fn(f64) -> f64, (mandrel, hours): (&str, f64)) -> Section {
    let budget = Budget::read(&format!("{BUDGET}\n{mandrel}\n"), Path::new("budget.yaml"));
    let top = every_5_min(hours, |h| 21.0 + warm_k(h));
    let mut during = Thermometers::new();
    for (_, degc) in &top.points {
        let fresh = || Readings::new(*degc);
        during
            .entry("top".to_owned())
            .or_insert_with(fresh)
            .add(*degc);
    }
    let log = DriftLog {
        run: 1,
        axis,
        cause: DriftCause::Spindle,
        height_mm: None,
        displacements: every_5_min(4.0, mm),
        zeroed_anew: false,
    };
    let drift = Drift {
        temperatures: [("top".to_owned(), top)].into(),
        ..Drift::default()
    };
    section(&log, &drift, (Some(&budget.unwrap()), &during)).unwrap()
}

fn warnings(of: &Section) -> Vec<&str> {
    of.warnings.iter().map(|one| one.kind).collect()
}

/// A number of the log's JSON.
fn number_of(section: &Section, path: &str) -> f64 {
    let found = section.figures["iso230_3_log"].pointer(path);
    let number = found.and_then(serde_json::Value::as_f64);
    number.unwrap_or_else(|| panic!("{path}: {}", section.figures))
}

fn near(section: &Section, path: &str, by_hand: f64, within: f64) {
    let found = number_of(section, path);
    assert!(
        (found - by_hand).abs() <= within,
        "{path}: {found} {by_hand}"
    );
}

#[test]
fn a_log_that_is_the_growth_of_the_mandrel_alone_has_no_drift() {
    // 2 µm/K of 200 mm of 10 µm/(m K).
    let section = part(Axis::Z, |h| 5.0 + 2e-3 * warm_k(h), (READ, 4.0));
    for figure in [
        "after_1_h",
        "after_3_h",
        "at_end",
        "range_last_hour",
        "range",
    ] {
        near(&section, &format!("/figures/{figure}/value_mm"), 0.0, 1e-12);
        let k = number_of(&section, &format!("/figures/coverage_factors/{figure}"));
        assert!((1.6..2.0).contains(&k), "{figure}: {k}");
    }
    near(&section, "/figures/final_rate/value_mm_s", 0.0, 1e-15);
    near(&section, "/growth_taken_out_mm", 2e-3 * warm_k(4.0), 1e-12);
    assert_eq!(warnings(&section), [""; 0]);
    let note = &section.tables[0].note;
    for words in [
        "k = 1.",
        "of the last rate by their distributions",
        "The growth of the mandrel, read by top, was taken out: 5.97 µm at the end.",
    ] {
        assert!(note.contains(words), "{note}: {words}");
    }
    let said = section.terminal();
    assert!(
        said.contains("by the rest of the growth of the mandrel"),
        "{said}"
    );
}

#[test]
fn what_is_left_beside_the_growth_is_the_drift_with_its_parts_by_hand() {
    // 1 µm/h beside the growth, whose last hour lies where the mandrel is nearly warm.
    let section = part(Axis::Z, |h| 1e-3 * h + 2e-3 * warm_k(h), (READ, 4.0));
    near(&section, "/figures/after_1_h/value_mm", 1e-3, 1e-12);
    near(&section, "/figures/range_last_hour/value_mm", 1e-3, 1e-12);
    near(&section, "/figures/range/value_mm", 4e-3, 1e-12);
    near(
        &section,
        "/figures/final_rate/value_mm_s",
        1e-3 / HOUR_S,
        1e-15,
    );
    // ± 0.2 µm twice, and ± 0.2 µm for each kelvin between the extremes: begin and end.
    let by_hand = (2.0 * 0.2e-3_f64.powi(2) + (0.2e-3 * warm_k(4.0)).powi(2)) / 3.0;
    let path = "/figures/contributions/artefact_mm";
    near(&section, path, by_hand.sqrt(), 1e-9);
}

#[test]
fn a_sensor_of_the_other_sign_is_asked_about() {
    let section = part(Axis::Z, |h| -2e-3 * warm_k(h), (READ, 4.0));
    near(
        &section,
        "/figures/at_end/value_mm",
        -4e-3 * warm_k(4.0),
        1e-12,
    );
    assert_eq!(warnings(&section), ["Sign of the mandrel's growth"]);
    let less = READ.replace("more", "less");
    let section = part(Axis::Z, |h| -2e-3 * warm_k(h), (&less, 4.0));
    near(&section, "/figures/at_end/value_mm", 0.0, 1e-12);
    assert_eq!(warnings(&section), [""; 0]);
}

#[test]
fn a_thermometer_that_stops_before_the_log_ends_leaves_the_growth_in_the_drift() {
    let section = part(Axis::Z, |h| 2e-3 * warm_k(h), (READ, 3.5));
    assert_eq!(warnings(&section), ["Growth of the mandrel not taken out"]);
    near(
        &section,
        "/figures/at_end/value_mm",
        2e-3 * warm_k(4.0),
        1e-12,
    );
    let said = section.terminal();
    for words in [
        "`mandrel` names the thermometer top, whose last reading is 30 min from the end of the log",
        "Its growth counts as drift.",
        "What the mandrel and its holder grow is part of the drift.",
    ] {
        assert!(said.contains(words), "{said}: {words}");
    }
    assert!(section.figures["iso230_3_log"]["growth_taken_out_mm"].is_null());
}

#[test]
fn a_thermometer_that_was_not_read_is_named_with_those_that_were() {
    let unread = READ.replace("[top]", "[end]");
    let section = part(Axis::Z, |h| 2e-3 * warm_k(h), (&unread, 4.0));
    assert_eq!(warnings(&section), ["Growth of the mandrel not taken out"]);
    let words = "names the thermometer end, which has no reading during this test; read were top";
    assert!(section.terminal().contains(words), "{}", section.terminal());
}

#[test]
fn a_range_of_the_temperature_is_a_bound_by_hand_and_x_has_no_mandrel_along_it() {
    let range = "mandrel: {length_mm: 200.0, expansion_um_per_m_k: 10.0, temperature_range_k: 3.0}";
    let grown = |h: f64| 2e-3 * warm_k(h);
    let section = part(Axis::Z, grown, (range, 4.0));
    near(
        &section,
        "/figures/range/value_mm",
        2e-3 * warm_k(4.0),
        1e-12,
    );
    let alone = part(Axis::X, grown, (READ, 4.0));
    // 6 µm of growth beside what U is without a mandrel.
    let path = "/figures/range/expanded_uncertainty_mm";
    near(&section, path, number_of(&alone, path) + 6e-3, 1e-12);
    let note = &section.tables[0].note;
    assert!(note.contains("a bound: k = 2 of certificate"), "{note}");
    assert!(note.contains("holds in at least 95 %"), "{note}");
    let of_x = &alone.figures["iso230_3_log"];
    assert!(of_x["growth_taken_out_mm"].is_null() && of_x["figures"]["coverage_factors"].is_null());
    assert!(alone.tables[0].note.contains("k = 2: certificate"));
}
