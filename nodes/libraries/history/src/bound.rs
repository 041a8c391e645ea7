//! The most of everything that is kept or read.

/// Longest name of a machine, test or figure, bytes.
pub const NAME_BYTES: usize = 300;
/// Longest path or other text of an entry, bytes.
pub const TEXT_BYTES: usize = 4_096;
/// Most figures of one entry.
pub const FIGURES: usize = 10_000;
/// Greatest magnitude of a figure.
pub const MAGNITUDE: f64 = 1e12;
/// Greatest figure of a machine's error: a metre, or a turn.
pub const ERRORS: [(&str, f64); 2] = [("mm", 1_000.0), ("rad", std::f64::consts::TAU)];
/// Last words of names of figures that are never below zero.
pub const NEVER_NEGATIVE: [&str; 12] = [
    "accuracy",
    "repeatability",
    "systematic_error",
    "mean_systematic_error",
    "reversal",
    "range",
    "range_last_hour",
    "mean_range",
    "spread",
    "circular_error",
    "hysteresis_1996",
    "residual_standard_deviation_mm",
];
/// First and last time of an entry, s since 1970: the range of a bag's stamps.
pub const TIMES_S: std::ops::RangeInclusive<i64> = 0..=4_294_967_295;
/// Most points of one series that are read.
pub const POINTS: usize = 1_000_000;
/// Most rows of a list that are read.
pub const ROWS: usize = 100_000;
