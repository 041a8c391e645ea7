//! ISO 230-2 of a rotary axis against an angular reference, in seconds of arc.

use std::f64::consts::TAU;

use iso230::ExpandedAngle;
use iso230::positioning::rotary::{RotaryBudget, RotaryResult, RotaryRuns, evaluate};
use rand::Rng;
use rand_pcg::Pcg64Mcg;

use super::linear::{BOTH, ONE, RUNS, columns, of_both, of_side};
use super::{Drift, Held, MACHINES, between, hold_clause, machine, normal, shares};

/// A second of arc, rad.
const ARCSEC: f64 = TAU / 1_296_000.0;
/// Turns of the worm in one of the axis.
const WORM: f64 = 90.0;

/// What a rotary axis does.
struct RotaryAxis {
    harmonics: [[f64; 2]; 3],
    worm: [f64; 2],
    reversal_rad: f64,
    scatter_rad: f64,
}

impl RotaryAxis {
    fn draw(rng: &mut Pcg64Mcg) -> Self {
        Self {
            harmonics: [3.0, 1.5, 0.5]
                .map(|size| [size * ARCSEC * normal(rng), between(rng, 0.0, TAU)]),
            worm: [ARCSEC * between(rng, 0.0, 1.0), between(rng, 0.0, TAU)],
            reversal_rad: ARCSEC * between(rng, -0.5, 4.0),
            scatter_rad: ARCSEC * between(rng, 0.05, 0.6),
        }
    }

    /// Error at an angle without its scatter; `side` +1 upwards, −1 downwards.
    fn error_rad(&self, at_rad: f64, side: f64) -> f64 {
        let harmonics = (1..).zip(&self.harmonics);
        let slow: f64 = harmonics
            .map(|(h, [a, p])| a * (f64::from(h) * at_rad + p).cos())
            .sum();
        let [a, p] = self.worm;
        slow + a * (WORM * at_rad + p).sin() + side * self.reversal_rad / 2.0
    }
}

/// What an exact reference would have read of one test, and what was read: deviations up and down, rad.
fn recorded(
    rng: &mut Pcg64Mcg,
    axis: &RotaryAxis,
    targets_rad: &[f64],
    (reference_rad, drift): (&[f64], &Drift),
) -> [[Vec<Vec<f64>>; 2]; 2] {
    let m = targets_rad.len();
    let (mut truth, mut read) = ([vec![], vec![]], [vec![], vec![]]);
    for run in 0..RUNS {
        for (leg, side) in [1.0, -1.0].into_iter().enumerate() {
            let mut rows = [vec![0.0; m], vec![0.0; m]];
            for step in 0..m {
                let i = if leg == 0 { step } else { m - 1 - step };
                let time = ((2 * run + leg) * m + step) as f64 / (2 * RUNS * m) as f64;
                let turned_rad =
                    axis.error_rad(targets_rad[i], side) + axis.scatter_rad * normal(rng);
                rows[0][i] = turned_rad;
                rows[1][i] = turned_rad + reference_rad[i] + drift.at(time, rng);
            }
            let [of_truth, of_read] = rows;
            truth[leg].push(of_truth);
            read[leg].push(of_read);
        }
    }
    [truth, read]
}

fn of_result(found: &RotaryResult) -> [ExpandedAngle; 9] {
    let (both, up) = (found.both.unwrap(), found.up.unwrap());
    [
        both.accuracy.unwrap(),
        both.systematic_error,
        both.repeatability.unwrap(),
        both.reversal,
        both.mean_reversal,
        both.mean_systematic_error,
        up.accuracy.unwrap(),
        up.systematic_error,
        up.repeatability.unwrap(),
    ]
}

fn tested(seed: u64) -> Vec<Held> {
    let mut rng = machine(seed, 5);
    let m = rng.random_range(8..14);
    let targets_rad: Vec<f64> = (0..m)
        .map(|i| (i as f64 + between(&mut rng, 0.1, 0.9)) * TAU / m as f64)
        .collect();
    let axis = RotaryAxis::draw(&mut rng);
    // The certificate states the angle between two positions; each has its own share.
    let standard_rad = ARCSEC * between(&mut rng, 0.05, 0.5);
    let reference_rad: Vec<f64> = (0..m)
        .map(|_| standard_rad / 2.0_f64.sqrt() * normal(&mut rng))
        .collect();
    let size_rad = ARCSEC * between(&mut rng, 0.05, 0.4);
    let drift = Drift::draw(&mut rng, size_rad);
    let [environmental_drift_rad, unrest_rad] = drift.watch(&mut rng);
    let budget = RotaryBudget {
        expanded_uncertainty_rad: 2.0 * standard_rad,
        coverage_factor: 2.0,
        environmental_drift_rad,
        environmental_unrest_rad: Some(unrest_rad),
    };
    let [truth, [up_rad, down_rad]] =
        recorded(&mut rng, &axis, &targets_rad, (&reference_rad, &drift));
    let runs = RotaryRuns {
        targets_rad,
        up_rad,
        down_rad,
    };
    let found = of_result(&evaluate(&runs, &budget).unwrap());
    let [up, down] = truth.map(|rows| columns(&rows));
    let truths = of_both(&up, &down).into_iter().chain(of_side(&up));
    let names = BOTH.into_iter().chain(ONE);
    names
        .zip(found)
        .zip(truths)
        .map(|((name, figure), truth)| Held {
            name,
            value: figure.value_rad,
            expanded: figure.expanded_uncertainty_rad,
            truth,
        })
        .collect()
}

#[test]
fn iso230_2_u_holds_the_figures_of_a_rotary_axis() {
    let all: Vec<Vec<Held>> = (0..MACHINES).map(tested).collect();
    // Shares by numpy: `tests/validation/coverage_of_u.py`.
    hold_clause(&shares("ISO 230-2 of a rotary axis", &all), &[]);
}
