//! What no effect of the catalogue explains is described: its period, its time constant, how it grows with feed.

use std::f64::consts::TAU;

use gap_diagnosis::report::{Description, Status};
use gap_diagnosis::{Diagnosis, GapConfig, diagnose};

use crate::trials::plant::{Circle, Noise, State, Wrong, machine, session_of, told};

/// Circles of two radii at four feeds, each of them five times in both senses.
fn program() -> Vec<Circle> {
    let mut all = vec![];
    for repeat in 0..5 {
        for (radius, feed) in [(50.0, 1500.0), (80.0, 3000.0)] {
            all.extend([true, false].map(|ccw| (radius, feed, ccw, repeat)));
        }
        let (radius, feed) = [
            (80.0, 1500.0),
            (50.0, 3000.0),
            (60.0, 2200.0),
            (50.0, 4000.0),
            (80.0, 4000.0),
        ][repeat as usize];
        all.extend([true, false].map(|ccw| (radius, feed, ccw, 0)));
    }
    all
}

/// What is said without the classes that would take it for theirs.
fn without(left_out: &[&str], seed: u64, wrong: &Wrong) -> Diagnosis {
    let config = GapConfig {
        left_out: left_out.iter().map(|id| (*id).to_owned()).collect(),
        ..GapConfig::default()
    };
    let session = session_of(&program(), seed, Noise::default(), wrong);
    diagnose(&machine(), &session, &config).expect("the plant is sound")
}

fn described(diagnosis: &Diagnosis) -> &Description {
    let report = &diagnosis.report;
    assert!(report.unknown.flagged, "{}", told(diagnosis));
    let is_named = |status| status != Status::Surrogate;
    let named = report.causes.iter().any(|cause| is_named(cause.status));
    assert!(!named, "{}", told(diagnosis));
    &report.unknown.description
}

fn first_number(words: &str) -> f64 {
    let word = words.split(' ').next().unwrap_or_default();
    word.parse().unwrap_or(f64::NAN)
}

#[test]
fn a_wave_over_the_position_is_described_by_its_period() {
    for (seed, period_mm, axis) in [(41, 7.3, 0), (42, 23.7, 1), (43, 3.1, 0)] {
        let wrong = move |s: &State| {
            let mut error_mm = [0.0; 2];
            error_mm[axis] = 1.5e-3 * (TAU * s.position[axis] / period_mm + 0.4).sin();
            error_mm
        };
        let diagnosis = without(&["cyclic_error"], seed, &wrong);
        let description = described(&diagnosis);
        let letter = ["X", "Y"][axis];
        let ends = format!(" mm of {letter}");
        assert!(description.period.ends_with(&ends), "{description:?}");
        let found_mm = first_number(&description.period);
        assert!(
            (found_mm - period_mm).abs() < 0.05 * period_mm,
            "{found_mm}"
        );
        let covariate = format!("position_{}", letter.to_lowercase());
        assert_eq!(description.covariate, covariate);
        assert_eq!(description.parity, "even");
    }
}

#[test]
fn a_drift_that_dies_away_is_described_by_its_time_constant() {
    for (seed, constant_s) in [(46, 60.0), (47, 200.0)] {
        let wrong = move |s: &State| [8e-3 * (-s.time_s / constant_s).exp(), 0.0];
        let diagnosis = without(&[], seed, &wrong);
        let description = described(&diagnosis);
        assert_eq!(description.covariate, "time", "{description:?}");
        let found_s = description.time_constant_s.unwrap();
        assert!(
            (found_s / constant_s).ln().abs() < 1.3_f64.ln(),
            "{found_s}"
        );
    }
}

#[test]
fn what_grows_with_the_feed_is_described_by_its_exponent() {
    let squared = |s: &State| {
        let share = s.velocity[0] / 66.0;
        [4e-3 * share * share.abs(), 0.0]
    };
    let diagnosis = without(&[], 48, &squared);
    let description = described(&diagnosis);
    assert_eq!(description.covariate, "velocity_x");
    let exponent = description.feed_exponent.unwrap();
    assert!((exponent - 2.0).abs() < 0.2, "{description:?}");

    let linear = |s: &State| {
        let feed = s.velocity[0].hypot(s.velocity[1]) / 66.0;
        [4e-3 * feed * s.velocity[0].signum(), 0.0]
    };
    let diagnosis = without(&[], 49, &linear);
    let description = described(&diagnosis);
    assert_eq!(description.covariate, "sense*log_distance_since_reversal_x");
    let exponent = description.feed_exponent.unwrap();
    assert!((exponent - 1.0).abs() < 0.2, "{description:?}");
}
