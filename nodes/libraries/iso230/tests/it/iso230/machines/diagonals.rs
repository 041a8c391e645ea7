//! ISO 230-6: four space diagonals of one machine.

use iso230::diagonal::{DiagonalRuns, SpaceDiagonal, evaluate};
use iso230::positioning::PositioningRuns;
use rand_pcg::Pcg64Mcg;

use super::linear::{Laser, columns, range};
use super::{
    Held, MACHINES, Screw, between, hold_clause, machine, normal, normal_as_limits, shares,
    within_limits,
};

/// E and B of one diagonal, its length and all its means, by the words of the standard.
fn of_truth(runs: &PositioningRuns) -> (f64, f64, f64, Vec<f64>) {
    let (up, down) = (columns(&runs.up_mm), columns(&runs.down_mm));
    let means: Vec<f64> = up.iter().chain(&down).map(|c| c[0]).collect();
    let reversals = up.iter().zip(&down).map(|(u, d)| (u[0] - d[0]).abs());
    let both: Vec<f64> = up
        .iter()
        .zip(&down)
        .map(|(u, d)| (u[0] + d[0]) / 2.0)
        .collect();
    let length_mm = both[both.len() - 1] - both[0];
    let reversal_mm = reversals.fold(f64::MIN, f64::max);
    (range(&means), reversal_mm, length_mm, means)
}

fn tested(seed: u64, off: fn(&mut Pcg64Mcg) -> f64) -> Vec<Held> {
    let mut rng = machine(seed, 2);
    let travels_mm = [0; 3].map(|_| between(&mut rng, 250.0, 800.0));
    let screws = travels_mm.map(|travel_mm| Screw::draw(&mut rng, travel_mm));
    let squareness = [0; 3].map(|_| 15e-6 * normal(&mut rng));
    let laser = Laser::draw_by(&mut rng, off);
    let long_mm = travels_mm.iter().map(|t| t * t).sum::<f64>().sqrt();
    let targets_mm: Vec<f64> = (0..7).map(|i| f64::from(i) * long_mm / 6.0).collect();
    let (mut read, mut truths) = (vec![], vec![]);
    for (diagonal, signs) in SpaceDiagonal::ALL.into_iter().zip([
        [1.0, 1.0, 1.0],
        [-1.0, 1.0, 1.0],
        [1.0, -1.0, 1.0],
        [1.0, 1.0, -1.0],
    ]) {
        // Along the diagonal: each axis by its share, the squareness of two axes by both of theirs.
        let along_mm = |at_mm: f64, side: f64| -> f64 {
            let place = |a: usize| {
                let share = at_mm / long_mm;
                travels_mm[a] * if signs[a] > 0.0 { share } else { 1.0 - share }
            };
            let own: f64 = (0..3)
                .map(|a| {
                    let error_mm = screws[a].error_mm(place(a), signs[a] * side);
                    signs[a] * travels_mm[a] / long_mm * error_mm
                })
                .sum();
            let lean: f64 = [(0, 1), (0, 2), (1, 2)]
                .into_iter()
                .zip(squareness)
                .map(|((a, b), turn)| signs[a] * travels_mm[a] / long_mm * turn * place(b))
                .sum();
            own + lean
        };
        let start_mm = along_mm(0.0, 1.0);
        let from_start_mm = |at_mm: f64, side: f64| along_mm(at_mm, side) - start_mm;
        let [runs, truth] = laser.runs(&mut rng, &targets_mm, &from_start_mm);
        truths.push(of_truth(&truth));
        read.push(DiagonalRuns { diagonal, runs });
    }
    let found = evaluate(&read, &laser.budget()).unwrap();
    let all: Vec<f64> = truths.iter().flat_map(|t| t.3.clone()).collect();
    let lengths_mm: Vec<f64> = truths.iter().map(|t| t.2).collect();
    let most = |all: Vec<f64>| all.into_iter().fold(f64::MIN, f64::max);
    let errors_mm = most(truths.iter().map(|t| t.0).collect());
    let reversals_mm = most(truths.iter().map(|t| t.1).collect());
    [
        ("E_d", found.systematic_error, errors_mm),
        ("B_d", found.reversal, reversals_mm),
        ("spread", found.spread, range(&all)),
        ("lengths", found.lengths, range(&lengths_mm)),
    ]
    .map(|(name, figure, truth)| Held {
        name,
        value: figure.value_mm,
        expanded: figure.expanded_uncertainty_mm,
        truth,
    })
    .to_vec()
}

#[test]
fn iso230_6_u_holds_the_figures_of_the_runs_that_were_made() {
    // Temperatures and coefficients anywhere within their limits, then normal with the standard deviation of the limits.
    for (what, off) in [
        ("ISO 230-6", within_limits as fn(&mut Pcg64Mcg) -> f64),
        ("ISO 230-6, normal temperatures,", normal_as_limits),
    ] {
        let all: Vec<Vec<Held>> = (0..MACHINES).map(|seed| tested(seed, off)).collect();
        hold_clause(&shares(what, &all), &[]);
    }
}
