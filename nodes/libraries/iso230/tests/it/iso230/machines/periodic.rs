//! Periodic positioning error of ISO 230-2: five runs in short steps, beside a lead error, a bow, scatter and drift.

use std::f64::consts::TAU;

use iso230::positioning::budget::PositioningBudget;
use iso230::positioning::periodic::{PeriodicRun, evaluate};
use rand::Rng;
use rand_pcg::Pcg64Mcg;

use super::linear::{RUNS, range};
use super::{Drift, Held, MACHINES, UM, between, hold_clause, machine, normal, shares};
use crate::iso230::EXACT;

/// Leads of the screws, mm.
const LEADS_MM: [f64; 4] = [5.0, 8.0, 10.0, 12.0];

/// What repeats with the lead: amplitude and phase of the first two harmonics.
struct Cycle {
    period_mm: f64,
    harmonics: [[f64; 2]; 2],
}

impl Cycle {
    fn at_mm(&self, at_mm: f64) -> f64 {
        let turn = TAU * at_mm / self.period_mm;
        let harmonics = [1.0_f64, 2.0].into_iter().zip(&self.harmonics);
        harmonics.map(|(h, [a, p])| a * (h * turn + p).cos()).sum()
    }
}

/// Means of five runs over positions, and the range of drift that was watched before.
fn read_mm(rng: &mut Pcg64Mcg, cycle: &Cycle, positions_mm: &[f64]) -> (Vec<f64>, f64) {
    let m = positions_mm.len();
    let lead = 12e-6 * normal(rng);
    let bow_mm = 0.3 * UM * normal(rng);
    let size_mm = UM * between(rng, 0.05, 0.4);
    let drift = Drift::draw(rng, size_mm);
    let scatter_mm = UM * between(rng, 0.05, 0.4);
    let mut means_mm = vec![0.0; m];
    for run in 0..RUNS {
        for (k, u) in positions_mm.iter().enumerate() {
            let time = (2.0 * run as f64 + k as f64 / m as f64) / (2 * RUNS) as f64;
            let slow_mm = lead * u + bow_mm * (u / positions_mm[m - 1]).powi(2);
            let scatter_mm = scatter_mm * normal(rng) + drift.at(time, rng);
            means_mm[k] += (slow_mm + cycle.at_mm(*u) + scatter_mm) / RUNS as f64;
        }
    }
    (means_mm, drift.watched_mm(rng))
}

fn tested(seed: u64) -> Vec<Held> {
    let mut rng = machine(seed, 7);
    let period_mm = LEADS_MM[rng.random_range(0..4)];
    let m: u32 = rng.random_range(25..50);
    let step = between(&mut rng, 0.08, 0.125);
    let positions_mm: Vec<f64> = (0..m).map(|k| f64::from(k) * step * period_mm).collect();
    let cycle = Cycle {
        period_mm,
        harmonics: [
            [
                UM * between(&mut rng, 0.3, 2.0),
                between(&mut rng, 0.0, TAU),
            ],
            [
                UM * between(&mut rng, 0.0, 0.5),
                between(&mut rng, 0.0, TAU),
            ],
        ],
    };
    let (deviations_mm, environmental_drift_mm) = read_mm(&mut rng, &cycle, &positions_mm);
    // As many harmonics as the steps show, and half as many parameters as positions.
    let by_step = (0.5 / step + 1e-6).floor() - 1.0;
    let by_number = (f64::from(m) / 4.0 - 1.0).floor();
    let run = PeriodicRun {
        positions_mm,
        deviations_mm,
        period_mm,
        n_harmonics: by_step.min(by_number).clamp(1.0, 4.0) as usize,
    };
    let budget = PositioningBudget {
        environmental_drift_mm,
        ..EXACT
    };
    let found = evaluate(&run, &budget).unwrap();
    let turn = (0..1440).map(|k| cycle.at_mm(f64::from(k) / 1440.0 * period_mm));
    let turn: Vec<f64> = turn.collect();
    let first_mm = cycle.harmonics[0][0];
    [
        ("P", found.periodic_error, range(&turn)),
        ("first amplitude", found.harmonics[0].amplitude, first_mm),
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
fn iso230_2_u_holds_the_periodic_error_beside_bow_scatter_and_drift() {
    let all: Vec<Vec<Held>> = (0..MACHINES).map(tested).collect();
    // Shares by numpy: `tests/validation/coverage_of_u.py`.
    hold_clause(&shares("periodic error", &all), &[]);
}
