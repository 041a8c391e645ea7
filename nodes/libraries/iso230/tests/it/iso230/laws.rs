//! What must hold of every figure, whatever was measured.

use iso230::ExpandedLength;
use iso230::circular::{self, BothSenses, CircularBudget, CircularTest, CircularTrace};
use iso230::conformance::{Decision, Policy, Specification, decide};
use iso230::positioning::{DirectionResult, PositioningResult, PositioningRuns};
use nalgebra::{Rotation2, Vector2};
use proptest::collection::vec;
use proptest::prelude::*;

use crate::iso230::{EXACT_DEVICE, RIGID, evaluated};

/// Between 2 and 8 targets, 2 to 7 runs, deviations up to 50 µm.
fn runs() -> impl Strategy<Value = PositioningRuns> {
    (2..=8_usize, 2..=7_usize).prop_flat_map(|(n_targets, n_runs)| {
        let rows = || vec(vec(-0.05..0.05, n_targets), n_runs);
        (vec(1.0..200.0, n_targets), rows(), rows()).prop_map(|(steps, up_mm, down_mm)| {
            let mut at_mm = -300.0;
            let place = |step: &f64| {
                at_mm += step;
                at_mm
            };
            PositioningRuns {
                targets_mm: steps.iter().map(place).collect(),
                up_mm,
                down_mm,
                zero_mm: 0.0,
                periods_mm: vec![],
            }
        })
    })
}

fn of_direction(d: &DirectionResult) -> [f64; 3] {
    [d.repeatability, d.systematic_error, d.accuracy].map(|f| f.value_mm)
}

/// All figures that are ranges or sizes, none with a sign.
fn figures(r: &PositioningResult) -> Vec<f64> {
    let both = [
        r.reversal,
        r.repeatability,
        r.systematic_error,
        r.mean_systematic_error,
        r.accuracy,
    ];
    let mut all = both.map(|f| f.value_mm).to_vec();
    all.extend(of_direction(&r.up));
    all.extend(of_direction(&r.down));
    all
}

fn same(a: &[f64], b: &[f64], factor: f64) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert!(
            (factor * a - b).abs() < 1e-13 * factor.abs().max(1.0),
            "{a} {b}"
        );
    }
}

fn each(rows: &[Vec<f64>], change: impl Fn(f64) -> f64) -> Vec<Vec<f64>> {
    let row = |row: &Vec<f64>| row.iter().map(|x| change(*x)).collect();
    rows.iter().map(row).collect()
}

proptest! {
    #[test]
    fn prop_a_constant_added_to_all_deviations_changes_no_range(runs in runs(), c in -1.0..1.0) {
        let mut shifted = runs.clone();
        shifted.up_mm = each(&runs.up_mm, |x| x + c);
        shifted.down_mm = each(&runs.down_mm, |x| x + c);
        let (before, after) = (evaluated(&runs), evaluated(&shifted));
        same(&figures(&before), &figures(&after), 1.0);
        same(&[before.mean_reversal.value_mm], &[after.mean_reversal.value_mm], 1.0);
        same(&[before.points[0].mean_mm + c], &[after.points[0].mean_mm], 1.0);
    }

    #[test]
    fn prop_exchanging_the_directions_exchanges_their_figures(runs in runs()) {
        let mut exchanged = runs.clone();
        std::mem::swap(&mut exchanged.up_mm, &mut exchanged.down_mm);
        let (before, after) = (evaluated(&runs), evaluated(&exchanged));
        same(&of_direction(&before.up), &of_direction(&after.down), 1.0);
        same(&of_direction(&before.down), &of_direction(&after.up), 1.0);
        same(&[before.mean_reversal.value_mm], &[after.mean_reversal.value_mm], -1.0);
        same(&figures(&before)[..5], &figures(&after)[..5], 1.0);
    }

    #[test]
    fn prop_figures_scale_with_the_deviations(runs in runs(), k in -3.0..3.0) {
        let mut scaled = runs.clone();
        scaled.up_mm = each(&runs.up_mm, |x| k * x);
        scaled.down_mm = each(&runs.down_mm, |x| k * x);
        same(&figures(&evaluated(&runs)), &figures(&evaluated(&scaled)), f64::abs(k));
    }

    #[test]
    fn prop_the_order_of_the_runs_does_not_matter(runs in runs(), turn in 0..7_usize) {
        let mut reordered = runs.clone();
        reordered.up_mm.reverse();
        let n = reordered.down_mm.len();
        reordered.down_mm.rotate_left(turn % n);
        same(&figures(&evaluated(&runs)), &figures(&evaluated(&reordered)), 1.0);
    }

    #[test]
    fn prop_an_axis_that_is_turned_round_keeps_its_figures(runs in runs()) {
        let turned = |rows: &[Vec<f64>]| each(rows, |x| -x).into_iter().map(|mut row| {
            row.reverse();
            row
        }).collect();
        let mirrored = PositioningRuns {
            targets_mm: runs.targets_mm.iter().rev().map(|t| -t).collect(),
            up_mm: turned(&runs.down_mm),
            down_mm: turned(&runs.up_mm),
            ..runs.clone()
        };
        let (before, after) = (evaluated(&runs), evaluated(&mirrored));
        same(&figures(&before)[..5], &figures(&after)[..5], 1.0);
        same(&of_direction(&before.up), &of_direction(&after.down), 1.0);
        same(&[before.mean_reversal.value_mm], &[after.mean_reversal.value_mm], 1.0);
    }

    #[test]
    fn prop_the_figures_keep_their_order(runs in runs()) {
        let r = evaluated(&runs);
        let [b, repeatability, e, m, a, ..] = figures(&r)[..] else { unreachable!() };
        let slack = 1e-15;
        prop_assert!(m <= e + slack && e <= a + slack);
        prop_assert!(b <= repeatability + slack && repeatability <= a + slack);
        for direction in [r.up, r.down] {
            let [r1, e1, a1] = of_direction(&direction);
            prop_assert!(r1 <= a1 + slack && e1 <= a1 + slack && a1 <= a + slack && e1 <= e + slack);
        }
    }
}

fn both(cw: &[Vector2<f64>], ccw: &[Vector2<f64>]) -> BothSenses {
    let trace = |points: &[Vector2<f64>]| {
        Some(CircularTrace::PointsMm(
            points.iter().map(|p| (*p).into()).collect(),
        ))
    };
    let test = CircularTest {
        nominal_radius_mm: 50.0,
        clockwise: trace(cw),
        counter_clockwise: trace(ccw),
    };
    let budget = CircularBudget {
        displacement: EXACT_DEVICE,
        length: None,
        machine: RIGID,
        device_expansion: RIGID,
        environmental_drift_mm: 0.0,
        environmental_unrest_mm: None,
    };
    circular::evaluate(&test, &budget).unwrap().both.unwrap()
}

fn circle_figures(b: &BothSenses) -> [f64; 3] {
    [b.circular_error, b.mean_radial_deviation, b.hysteresis_1996].map(|f| f.value_mm)
}

/// A path of 90 points with deviations up to 10 µm.
fn path() -> impl Strategy<Value = Vec<Vector2<f64>>> {
    vec(-0.01..0.01, 90).prop_map(|deviations: Vec<f64>| {
        let point = |(k, d): (usize, &f64)| {
            let angle = (4.0 * k as f64 + 1.0).to_radians();
            (50.0 + d) * Vector2::new(angle.cos(), angle.sin())
        };
        deviations.iter().enumerate().map(point).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn prop_turning_both_paths_changes_no_circular_figure(cw in path(), ccw in path(), by in 0.0..6.0) {
        let turn = Rotation2::new(by);
        let turned = |path: &[Vector2<f64>]| path.iter().map(|p| turn * p).collect::<Vec<_>>();
        let before = circle_figures(&both(&cw, &ccw));
        let after = circle_figures(&both(&turned(&cw), &turned(&ccw)));
        for (a, b) in before.iter().zip(after) {
            prop_assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn prop_exchanging_the_senses_changes_no_figure_of_both(cw in path(), ccw in path()) {
        let (before, after) = (both(&cw, &ccw), both(&ccw, &cw));
        for (a, b) in circle_figures(&before).iter().zip(circle_figures(&after)) {
            prop_assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn prop_an_eccentric_set_up_changes_no_figure_of_both(
        cw in path(), ccw in path(), u in -0.1..0.1, v in -0.1..0.1
    ) {
        let moved = |path: &[Vector2<f64>]| {
            path.iter().map(|p| p + Vector2::new(u, v)).collect::<Vec<_>>()
        };
        let before = circle_figures(&both(&cw, &ccw));
        let after = circle_figures(&both(&moved(&cw), &moved(&ccw)));
        for (a, b) in before.iter().zip(after) {
            prop_assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn prop_what_a_guard_band_accepts_is_accepted_by_the_milder_rules(
        value_mm in -2.0..2.0, u_mm in 0.0..0.6, lower_mm in -1.0..0.0, width_mm in 0.01..2.0
    ) {
        let zone = Specification { lower_mm: Some(lower_mm), upper_mm: Some(lower_mm + width_mm) };
        let figure = ExpandedLength::new(value_mm, u_mm);
        let says = |policy| decide(&figure, &zone, policy).unwrap();
        let guarded = says(Policy::GuardBand).decision;
        let probable = says(Policy::Probability { at_least: 0.95 }).decision;
        let simple = says(Policy::Simple);
        if guarded == Decision::Conforms {
            prop_assert_eq!((probable, simple.decision), (guarded, guarded));
        }
        if guarded == Decision::DoesNotConform {
            prop_assert_eq!((probable, simple.decision), (guarded, guarded));
        }
        prop_assert!(simple.decision != Decision::CannotBeDecided);
        prop_assert!((0.0..=1.0).contains(&simple.probability_of_conformance));
    }
}
