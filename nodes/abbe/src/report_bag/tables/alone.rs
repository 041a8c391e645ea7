//! Tables without a map and a machine file.

use super::*;

/// The page of a table alone: no map, no machine file.
pub fn reported_alone(table: &Path) -> (Report, Vec<String>) {
    let taken = from_table::of(table, None).unwrap().unwrap();
    let tests = Tests {
        machine: None,
        ..Tests::of(&Bag::open(&taken.bag).unwrap())
    };
    let mut report = page("Tests", &tests, None).unwrap();
    report.begin_with_table(&taken.lines);
    (report, taken.lines.clone())
}

#[test]
fn val_a_table_alone_has_the_figures_of_its_standard() {
    for table in ["positioning.csv", "wide.xlsx"] {
        let (report, lines) = reported_alone(&root(&format!("tests/import/{table}")));
        let linear = found(&report, "iso230_2");
        for (key, name) in [("accuracy", "a"), ("repeatability", "r"), ("reversal", "b")] {
            near(
                &linear[key]["value_mm"],
                1e3,
                reference("positioning", name),
            );
        }
        let text = report.terminal();
        assert!(
            text.starts_with(&format!("Tests\n\n{}", lines[0])),
            "{text}"
        );
        assert!(
            lines
                .iter()
                .any(|line| line.starts_with("not in the table: axis")),
            "{lines:?}"
        );
    }
    let (report, lines) = reported_alone(&root("tests/import/drift.csv"));
    let log = found(&report, "iso230_3_log");
    near(
        &log["figures"]["after_1_h"]["value_mm"],
        1e3,
        reference("drift", "after_1_h"),
    );
    assert!(lines.contains(&"axis Z".to_owned()), "{lines:?}");
    let (report, _) = reported_alone(&root("tests/import/rotary.csv"));
    is_rotary_reference(&report);
    let (report, _) = reported_alone(&root("tests/import/ballbar.csv"));
    assert!(
        report.terminal().contains("ISO 230-4"),
        "{}",
        report.terminal()
    );
}

/// Whether the figures are those of `rotary.csv`.
fn is_rotary_reference(report: &Report) {
    let figures = &found(report, "iso230_2_rotary")["figures"];
    let arcsec = 648_000.0 / std::f64::consts::PI;
    near(
        &figures["both"]["accuracy"]["value_rad"],
        arcsec,
        reference("rotary", "a"),
    );
}

#[test]
fn val_a_laser_file_alone_has_the_figures_of_the_table_that_it_was_made_of() {
    let (report, lines) = reported_alone(&root("tests/import/laser.rtl"));
    let linear = found(&report, "iso230_2");
    for (key, name) in [("accuracy", "a"), ("repeatability", "r"), ("reversal", "b")] {
        near(
            &linear[key]["value_mm"],
            1e3,
            reference("positioning", name),
        );
    }
    for words in [
        "Renishaw laser file (rtl, rta)",
        "axis X",
        "air 21.40 to 21.52 °C",
    ] {
        assert!(lines.iter().any(|line| line.contains(words)), "{lines:?}");
    }
    let (report, _) = reported_alone(&root("tests/import/rotary.rta"));
    is_rotary_reference(&report);
}
