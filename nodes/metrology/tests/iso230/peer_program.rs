//! Against tests that others measured and evaluated with a program of theirs.

use std::collections::BTreeMap;

use metrology::iso230::positioning::{PointResult, PositioningRuns};

use crate::{evaluated, near};

const SLIT_AXIS: &str = include_str!("../data/iso230_2_slit_axis.tsv");
const ACCEPTANCE: &str = include_str!("../data/iso230_2_acceptance.tsv");

struct Published {
    runs: PositioningRuns,
    rows: BTreeMap<&'static str, Vec<f64>>,
}

fn published(text: &'static str) -> Published {
    let mut rows: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    let mut measured: BTreeMap<&str, Vec<Vec<f64>>> = BTreeMap::new();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let (name, values) = line.split_once('\t').unwrap();
        let values = values.split('\t').map(|v| v.parse().unwrap()).collect();
        match name {
            "up" | "down" => measured.entry(name).or_default().push(values),
            _ => assert_eq!(rows.insert(name, values), None),
        }
    }
    let targets_mm = rows["target"].clone();
    let deviations = |direction| -> Vec<Vec<f64>> {
        let runs: &Vec<Vec<f64>> = &measured[direction];
        let deviation = |run: &Vec<f64>| run.iter().zip(&targets_mm).map(|(p, t)| p - t).collect();
        runs.iter().map(deviation).collect()
    };
    Published {
        runs: PositioningRuns {
            up_mm: deviations("up"),
            down_mm: deviations("down"),
            zero_mm: targets_mm[0],
            targets_mm,
            periods_mm: vec![],
        },
        rows,
    }
}

impl Published {
    /// Compares every figure that the program evaluates as the standard does.
    fn compare(&self, within_mm: f64) -> usize {
        let result = evaluated(&self.runs);
        let mut compared = 0;
        let mut list = |name: &str, of: fn(&PointResult) -> f64| {
            for (point, expected) in result.points.iter().zip(&self.rows[name]) {
                near(name, of(point), *expected, within_mm);
                compared += 1;
            }
        };
        list("mean_up", |p| p.up.mean_mm);
        list("mean_down", |p| p.down.mean_mm);
        list("mean", |p| p.mean_mm);
        list("reversal", |p| p.reversal_mm);
        list("s_up", |p| p.up.standard_deviation_mm);
        list("s_down", |p| p.down.standard_deviation_mm);
        list("r_up", |p| p.up.repeatability_mm);
        list("r_down", |p| p.down.repeatability_mm);
        list("r", |p| p.repeatability_mm);
        let figures = [
            ("B", result.reversal),
            ("B_mean", result.mean_reversal),
            ("R_up", result.up.repeatability),
            ("R_down", result.down.repeatability),
            ("R", result.repeatability),
            ("E_up", result.up.systematic_error),
            ("E_down", result.down.systematic_error),
            ("E", result.systematic_error),
            ("M", result.mean_systematic_error),
            ("A_up", result.up.accuracy),
            ("A_down", result.down.accuracy),
            ("A", result.accuracy),
        ];
        for (name, figure) in figures {
            if let Some(expected) = self.rows.get(name) {
                near(name, figure.value_mm, expected[0], within_mm);
                compared += 1;
            }
        }
        compared
    }
}

#[test]
fn val_iso230_2_slit_axis_of_bifrost() {
    let published = published(SLIT_AXIS);
    // Half of the last digit printed and the rounding of the data.
    assert_eq!(published.compare(6e-6), 9 * 5 + 11);
    // E by hand from the printed means: 0.00552 − (−0.00742).
    let result = evaluated(&published.runs);
    near("E", result.systematic_error.value_mm, 0.01294, 1e-5);
    // What the program prints in its place.
    let greater_least = -0.00293;
    near(
        "its E",
        published.rows["E_of_the_program"][0],
        0.00552 - greater_least,
        1e-5,
    );
}

#[test]
fn val_iso230_2_linear_axis_of_an_acceptance_test() {
    let published = published(ACCEPTANCE);
    let rows = |name| published.rows[name][0];
    // R_i has four digits: half of the last is 5e-9.
    assert_eq!(published.compare(6e-9), 9 * 5 + 10);
    let result = evaluated(&published.runs);
    // By hand from the printed rows.
    near("R", result.repeatability.value_mm, 6.882e-5, 6e-9);
    near(
        "E",
        result.systematic_error.value_mm,
        -8.482e-5 + 12.162e-5,
        6e-9,
    );
    // What the program prints in their place.
    near("its R", rows("R_of_the_program"), rows("R_down"), 1e-12);
    near(
        "its E",
        rows("E_of_the_program"),
        -8.482e-5 + 10.942e-5,
        6e-9,
    );
}
