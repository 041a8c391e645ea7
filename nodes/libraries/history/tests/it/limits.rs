//! When a limit is reached, against Fieller's interval by `numpy.roots` (numpy 2.4.6).

use history::{Crossing, Limit, Side, Trend, crossing};

use crate::example::{DAY_S, points};

const DAYS: [f64; 7] = [0.0, 30.0, 61.0, 91.0, 122.0, 152.0, 183.0];
const VALUES: [f64; 7] = [4.1, 4.4, 4.3, 4.9, 5.2, 5.1, 5.6];
const U: [f64; 7] = [0.2, 0.2, 0.3, 0.2, 0.25, 0.2, 0.3];

fn upper(value: f64) -> Limit {
    Limit {
        value,
        side: Side::Upper,
    }
}

fn is_day(at_s: f64, day: f64) -> bool {
    (at_s / DAY_S - day).abs() < 1e-6 * 183.0
}

#[test]
fn val_numpy_fieller() {
    let trend = Trend::of(&points(&DAYS, &VALUES, &U)).unwrap();
    let found = crossing(&trend, upper(7.0));
    let Crossing::Expected {
        at_s,
        earliest_s,
        latest_s,
        spans_ahead,
    } = found
    else {
        panic!("{found:?}");
    };
    assert!(is_day(at_s, 383.751_253_566_551_6), "{found:?}");
    assert!(is_day(earliest_s, 282.996_480_166_222_9), "{found:?}");
    assert!(is_day(latest_s, 666.998_022_060_229_6), "{found:?}");
    assert!((spans_ahead - 200.751_253_566_551_6 / 183.0).abs() < 1e-6);
}

#[test]
fn a_lower_limit_mirrors_an_upper_one() {
    let mirrored = VALUES.map(|value| -value);
    let trend = Trend::of(&points(&DAYS, &mirrored, &U)).unwrap();
    let limit = Limit {
        value: -7.0,
        side: Side::Lower,
    };
    let Crossing::Expected { at_s, .. } = crossing(&trend, limit) else {
        panic!("must be expected");
    };
    assert!(is_day(at_s, 383.751_253_566_551_6));
}

#[test]
fn a_slope_that_is_not_significant_has_no_date_but_an_earliest_one() {
    let trend = Trend::of(&points(
        &[0.0, 30.0, 60.0, 90.0, 120.0],
        &[4.0, 4.3, 3.9, 4.2, 4.1],
        &[],
    ))
    .unwrap();
    let found = crossing(&trend, upper(6.0));
    let Crossing::NeedsData {
        not_before_s: Some(at_s),
    } = found
    else {
        panic!("{found:?}");
    };
    assert!(is_day(at_s, 352.716_093_688_599_6), "{found:?}");
}

#[test]
fn a_limit_behind_the_trend_is_reached_or_left() {
    let trend = Trend::of(&points(&DAYS, &VALUES, &U)).unwrap();
    assert_eq!(crossing(&trend, upper(5.0)), Crossing::Reached);
    let below = Limit {
        value: 3.0,
        side: Side::Lower,
    };
    assert_eq!(crossing(&trend, below), Crossing::MovesAway);
}

#[test]
fn a_level_line_without_scatter_never_reaches_a_limit() {
    let trend = Trend::of(&points(&[0.0, 1.0, 2.0, 3.0], &[2.0; 4], &[])).unwrap();
    assert_eq!(
        crossing(&trend, upper(3.0)),
        Crossing::NeedsData { not_before_s: None }
    );
}
