//! Conditions of the measurement behind a table: what its map states, and nothing that the program assumed.

use super::*;

/// A condition on the page.
fn condition(report: &Report, name: &str) -> String {
    let text = report.terminal();
    let lines = text
        .lines()
        .flat_map(|line| line.trim_end_matches('.').split("; "));
    let mut found = lines.filter_map(|one| one.strip_prefix(name));
    found
        .next()
        .unwrap_or_else(|| panic!("{name}: {text}"))
        .trim()
        .to_owned()
}

#[test]
fn conditions_of_a_table_are_those_of_its_map() {
    // feed_mm_min: 600.0 and dwell_s: 1.0 of steps.yaml, feed_deg_min: 1800.0 and dwell_s: 2.0 of rotary.yaml.
    for (table, machine, feed, dwell) in [
        ("steps", "first_run", "600 mm/min", "1.0 s"),
        ("rotary", "five_axis", "1800 deg/min", "2.0 s"),
    ] {
        let (csv, map) = (format!("{table}.csv"), format!("{table}.yaml"));
        let report = reported(&csv, &map, machine, None);
        assert_eq!(condition(&report, "date"), "2026-01-05 08:00:00 UTC");
        assert_eq!(condition(&report, "feed"), feed);
        assert_eq!(condition(&report, "dwell"), dwell);
        let production = condition(&report, "production before the first test");
        assert_eq!(production, "not stated");
        let conditions = &report.figures["conditions"];
        assert_eq!(conditions["begin"], "2026-01-05 08:00:00 UTC");
        assert!(conditions["end"].is_null() && conditions["production_before_s"].is_null());
    }
}

#[test]
fn what_is_assumed_of_a_table_is_no_condition_of_its_measurement() {
    let (report, lines) = reported_alone(&root("tests/import/steps.csv"));
    for (name, key) in [
        ("date", "start_s"),
        ("feed", "feed_mm_min"),
        ("dwell", "dwell_s"),
    ] {
        let lacks = format!("not in the table: {key}");
        assert!(
            lines.iter().any(|line| line.starts_with(&lacks)),
            "{lines:?}"
        );
        assert_eq!(condition(&report, name), "not stated");
    }
    let html = report.html();
    assert!(html.contains("not in the table; 1000 mm/min was assumed"));
    assert!(!html.contains("1970-01-01"));
    let conditions = &report.figures["conditions"];
    assert!(conditions["begin"].is_null());
    assert_eq!(conditions["feeds_mm_min"], serde_json::json!([]));
    // The times of a log are its own.
    let report = reported("drift.csv", "drift.yaml", "first_run", None);
    let date = condition(&report, "date");
    assert_eq!(date, "2026-01-05 08:00:00 UTC to 2026-01-05 11:00:00 UTC");
}

#[test]
fn the_resolution_that_a_map_states_is_in_the_bag() {
    let home = TempDir::new().unwrap();
    let map = text_file::yaml(&root("tests/import/positioning.yaml")).unwrap();
    let map = format!("resolution_um: 10.0\n{map}");
    reported_by(
        &home,
        &root("tests/import/positioning.csv"),
        &map,
        "gap_first",
        None,
    );
    let bag = Bag::open(home.path().join("bag")).unwrap();
    let stated = bag.attachment("params/import.yaml").unwrap().unwrap();
    assert_eq!(
        String::from_utf8(stated.data).unwrap(),
        "start_s: 1767600000\nresolution_um: 10.0\nfeed_mm_min: 6000.0\ndwell_s: 2.0\n"
    );
}
