//! Files of instruments alone, against the figures of the tables that they were made of.

use super::*;

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
