//! Entries and points for tests.

use history::{Entry, Figure, Kind, Point};

/// Seconds of a day.
pub const DAY_S: f64 = 86_400.0;

/// Points at days with values; the same uncertainty of each, or of none.
pub fn points(days: &[f64], values: &[f64], u: &[f64]) -> Vec<Point> {
    let all = days.iter().zip(values).enumerate();
    all.map(|(i, (day, value))| Point {
        at_s: day * DAY_S,
        value: *value,
        standard_uncertainty: u.get(i).copied(),
    })
    .collect()
}

/// A figure without a test of its own.
pub fn figure(name: &str, value: f64) -> Figure {
    Figure {
        test: "Positioning X".to_owned(),
        name: name.to_owned(),
        axis: String::new(),
        value,
        unit: "mm".to_owned(),
        standard_uncertainty: Some(0.001),
        interval: None,
        status: String::new(),
    }
}

/// An entry of one figure; `number` makes its hash.
pub fn entry(machine: &str, number: u64, at_s: i64, value: f64) -> Entry {
    Entry {
        machine: machine.to_owned(),
        at_s,
        kind: Kind::Report,
        sha256: format!("{number:064x}"),
        machine_sha256: None,
        source: format!("bag_{number}"),
        instruments: String::new(),
        operator: String::new(),
        software: "abbe 0.1.0".to_owned(),
        figures: vec![figure("iso230_2.accuracy", value)],
    }
}

/// Normal noise of standard deviation 1: sums of twelve uniform numbers of a linear congruential generator.
pub fn noise(seed: u64) -> impl Iterator<Item = f64> {
    let mut state = seed;
    let mut uniform = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    std::iter::from_fn(move || Some((0..12).map(|_| uniform()).sum::<f64>() - 6.0))
}

/// Whether two numbers agree within a share of the second.
pub fn is_near(value: f64, expected: f64, share: f64) -> bool {
    (value - expected).abs() <= share * expected.abs()
}
