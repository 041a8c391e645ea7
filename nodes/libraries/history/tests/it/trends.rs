//! Lines over time, against `numpy.polyfit` (numpy 2.4.6) with weights 1/u and unscaled covariance.

use history::{Point, Trend};

use crate::example::{DAY_S, is_near, points};

const DAYS: [f64; 7] = [0.0, 30.0, 61.0, 91.0, 122.0, 152.0, 183.0];
const VALUES: [f64; 7] = [4.1, 4.4, 4.3, 4.9, 5.2, 5.1, 5.6];
const U: [f64; 7] = [0.2, 0.2, 0.3, 0.2, 0.25, 0.2, 0.3];

#[test]
fn val_numpy_polyfit_with_uncertainties() {
    let trend = Trend::of(&points(&DAYS, &VALUES, &U)).unwrap();
    for (value, expected) in [
        (trend.mean_at_s, 7_180_992.926_045_017),
        (trend.mean_value, 4.743_810_289_389_068),
        (trend.slope_per_s, 8.685_966_077_229_755e-8),
        // They scatter less than their uncertainties: nothing is narrowed.
        (trend.mean_standard_uncertainty, 0.085_057_196_568_561_41),
        (
            trend.slope_standard_uncertainty_per_s,
            1.630_477_805_480_681_2e-8,
        ),
        (
            trend.birge_ratio.unwrap(),
            0.476_573_748_364_126_2_f64.sqrt(),
        ),
    ] {
        assert!(is_near(value, expected, 1e-9), "{value} {expected}");
    }
    // Student's t of 5 degrees of freedom at 97.5 %.
    assert!(is_near(trend.coverage_factor, 2.570_581_836_6, 1e-8));
    assert!(trend.is_significant());
}

#[test]
fn val_numpy_polyfit_without_uncertainties() {
    // One point without uncertainty: all count alike.
    let trend = Trend::of(&points(&DAYS, &VALUES, &U[..6])).unwrap();
    for (value, expected) in [
        (trend.mean_value, 4.8),
        (trend.slope_per_s, 9.215_738_729_757_113e-8),
        (trend.mean_standard_uncertainty, 0.065_158_838_969_616_84),
        (
            trend.slope_standard_uncertainty_per_s,
            1.236_306_597_636_898_4e-8,
        ),
    ] {
        assert!(is_near(value, expected, 1e-9), "{value} {expected}");
    }
    assert_eq!(trend.birge_ratio, None);
}

#[test]
fn eq3_scatter_beyond_the_uncertainties_widens_the_interval() {
    let narrow = U.map(|u| u / 10.0);
    let trend = Trend::of(&points(&DAYS, &VALUES, &narrow)).unwrap();
    // s² grows by 100, the weights as well: the widened uncertainty is that of the scatter.
    let expected = 1.630_477_805_480_681_2e-8 * 0.476_573_748_364_126_2_f64.sqrt();
    assert!(is_near(
        trend.slope_standard_uncertainty_per_s,
        expected,
        1e-9
    ));
}

#[test]
fn the_interval_of_a_slope_holds_the_truth_in_95_of_100_series() {
    let mut held = 0;
    for seed in 1..=1_000 {
        let mut noise = crate::example::noise(seed);
        let at = |i: u32| f64::from(i) * 30.0;
        let days: Vec<f64> = (0..12).map(at).collect();
        let values: Vec<f64> = days
            .iter()
            .map(|day| 0.01 * day + noise.next().unwrap())
            .collect();
        let trend = Trend::of(&points(&days, &values, &[])).unwrap();
        let truth = 0.01 / DAY_S;
        if (trend.slope_per_s - truth).abs() <= trend.slope_half_width_per_s() {
            held += 1;
        }
    }
    assert!((930..=970).contains(&held), "{held}");
}

#[test]
fn too_few_points_or_one_time_have_no_trend() {
    assert!(Trend::of(&points(&[0.0, 1.0], &[1.0, 2.0], &[])).is_none());
    assert!(Trend::of(&points(&[5.0; 4], &[1.0, 2.0, 3.0, 4.0], &[])).is_none());
    assert!(Trend::of(&[]).is_none());
}

#[test]
fn values_without_scatter_have_a_certain_trend_or_none() {
    let days = [0.0, 1.0, 2.0, 3.0];
    let level = Trend::of(&points(&days, &[2.0; 4], &[])).unwrap();
    assert!(!level.is_significant());
    // Binary fractions: the line meets the points exactly.
    let rising = Trend::of(&points(&days, &[0.0, 0.5, 1.0, 1.5], &[])).unwrap();
    assert!(rising.is_significant());
    assert!(is_near(rising.slope_per_s * DAY_S, 0.5, 1e-12));
}

#[test]
fn an_uncertainty_of_zero_is_not_known() {
    let mut all = points(&DAYS, &VALUES, &U);
    all[3] = Point {
        standard_uncertainty: Some(0.0),
        ..all[3]
    };
    assert_eq!(Trend::of(&all).unwrap().birge_ratio, None);
}
