//! Whether stated intervals hold the truth as often as they say, over simulated tests.

use std::f64::consts::TAU;

use iso230::ExpandedLength;
use iso230::budget::{DeviceUncertainty, Expansion, drift_mm};
use iso230::positioning::budget::PositioningBudget;
use iso230::positioning::{self, PositioningResult, PositioningRuns, periodic};
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use crate::iso230::{EXACT, EXACT_DEVICE, RIGID};

const SEEDS: u64 = 1000;

fn normal(rng: &mut Pcg64Mcg) -> f64 {
    StandardNormal.sample(rng)
}

/// Counts the seeds in which a simulated test holds its truth.
fn share(holds: impl Fn(&mut Pcg64Mcg) -> bool) -> f64 {
    let held = (0..SEEDS)
        .filter(|seed| holds(&mut Pcg64Mcg::seed_from_u64(*seed)))
        .count();
    held as f64 / SEEDS as f64
}

fn within_93_and_97_percent(what: &str, share: f64) {
    eprintln!("{what}: {:.1} %", 100.0 * share);
    assert!((0.93..=0.97).contains(&share), "{what}: {share}");
}

/// True mean deviations of five targets: a lead error and a bow; backlash downwards.
const TARGETS_MM: [f64; 5] = [11.0, 243.0, 508.0, 749.0, 996.0];

fn true_mm(target_mm: f64, down: bool) -> f64 {
    let backlash_mm = if down { 0.004 } else { 0.0 };
    9e-6 * target_mm - 2e-8 * target_mm * target_mm - backlash_mm
}

/// Readings of one test with a scale error of the whole measurement.
fn simulated(rng: &mut Pcg64Mcg, scale: f64, scatter_mm: f64) -> PositioningRuns {
    let mut rows = |down: bool| -> Vec<Vec<f64>> {
        let mut reading =
            |t: &f64| true_mm(*t, down) + scale * (t - TARGETS_MM[0]) + scatter_mm * normal(rng);
        (0..5)
            .map(|_| TARGETS_MM.iter().map(&mut reading).collect())
            .collect()
    };
    PositioningRuns {
        targets_mm: TARGETS_MM.to_vec(),
        up_mm: rows(false),
        down_mm: rows(true),
        zero_mm: TARGETS_MM[0],
        periods_mm: vec![],
    }
}

fn holds_far_end(runs: &PositioningRuns, budget: &PositioningBudget) -> bool {
    let result = positioning::evaluate(runs, budget).unwrap();
    let interval = result.points[4].down.interval;
    let truth_mm = true_mm(TARGETS_MM[4], true);
    interval.lower_mm <= truth_mm && truth_mm <= interval.upper_mm
}

#[test]
fn eq8_scatter_of_five_runs_is_covered_by_students_t() {
    let share = share(|rng| holds_far_end(&simulated(rng, 0.0, 0.002), &EXACT));
    within_93_and_97_percent("scatter alone", share);
}

#[test]
fn eq8_scatter_device_and_temperature_together_are_covered() {
    let machine = Expansion {
        temperature_deviation_k: 4.0,
        temperature_half_width_k: 0.15,
        expansion_per_k: 11e-6,
        expansion_half_width_per_k: 0.4e-6,
    };
    let budget = PositioningBudget {
        device: DeviceUncertainty {
            expanded_uncertainty_per_length: 2.4e-6,
            ..EXACT_DEVICE
        },
        machine,
        ..EXACT
    };
    let share = share(|rng| {
        let device = 1.2e-6 * normal(rng);
        let temperature = machine.expansion_per_k * rng.random_range(-0.15..0.15);
        let coefficient = 4.0 * rng.random_range(-0.4e-6..0.4e-6);
        let runs = simulated(rng, device + temperature + coefficient, 0.002);
        holds_far_end(&runs, &budget)
    });
    within_93_and_97_percent("scatter, device and temperature", share);
}

#[test]
fn corrected_means_of_machines_from_16_to_28_degc_are_covered_at_20_degc() {
    let share = share(|rng| {
        let warm_k: f64 = rng.random_range(-4.0..8.0);
        let stated = Expansion {
            temperature_deviation_k: warm_k + rng.random_range(-0.2..0.2),
            temperature_half_width_k: 0.2,
            expansion_per_k: 11e-6,
            expansion_half_width_per_k: 0.4e-6,
        };
        let coefficient = stated.expansion_per_k + rng.random_range(-0.4e-6..0.4e-6);
        let budget = PositioningBudget {
            machine: stated,
            ..EXACT
        };
        let runs = simulated(rng, coefficient * warm_k, 0.002);
        let at_20 = runs.corrected_to_20_degc(budget.differential_expansion());
        holds_far_end(&at_20, &budget)
    });
    within_93_and_97_percent("corrected to 20 °C", share);
}

#[test]
fn eq8_students_factor_is_needed() {
    // The same intervals with the factor 2 hold far less: t of four degrees of freedom is 2.78.
    let share = share(|rng| {
        let result = positioning::evaluate(&simulated(rng, 0.0, 0.002), &EXACT).unwrap();
        let down = result.points[4].down;
        let half_mm = 2.0 * down.standard_deviation_mm / 5.0_f64.sqrt();
        (down.mean_mm - true_mm(TARGETS_MM[4], true)).abs() <= half_mm
    });
    assert!((0.86..0.91).contains(&share), "{share}");
}

#[test]
fn eq4_the_amplitude_of_a_period_is_covered() {
    let budget = PositioningBudget {
        machine: RIGID,
        ..EXACT
    };
    let share = share(|rng| {
        let positions_mm: Vec<f64> = (0..60).map(|k| 0.47 * f64::from(k)).collect();
        let reading = |u: &f64| 0.0015 * (TAU * u / 8.0 + 1.0).sin() + 0.0004 * normal(rng);
        let run = periodic::PeriodicRun {
            deviations_mm: positions_mm.iter().map(reading).collect(),
            positions_mm,
            period_mm: 8.0,
            n_harmonics: 1,
        };
        let amplitude = periodic::evaluate(&run, &budget).unwrap().harmonics[0].amplitude;
        (amplitude.value_mm - 0.0015).abs() <= amplitude.expanded_uncertainty_mm
    });
    within_93_and_97_percent("amplitude", share);
}

/// Errors of the figures of a machine that never scatters, by what its measurement does: the
/// device's scale and a drift that is new at every reading, both normal.
fn figure_errors(budget: &PositioningBudget) -> Vec<PositioningResult> {
    let machine_mm = |t: f64, down: bool| 5e-5 * t - if down { 0.004 } else { 0.0 };
    let u_drift_mm = drift_mm(budget.environmental_drift_mm);
    let u_scale = budget.device.standard_mm(1.0);
    let test = |seed| {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let scale = u_scale * normal(&mut rng);
        let mut rows = |down: bool| -> Vec<Vec<f64>> {
            let mut reading = |t: &f64| {
                let drift_mm = u_drift_mm * normal(&mut rng);
                machine_mm(*t, down) + scale * (t - TARGETS_MM[0]) + drift_mm
            };
            (0..5)
                .map(|_| TARGETS_MM.iter().map(&mut reading).collect())
                .collect()
        };
        let runs = PositioningRuns {
            targets_mm: TARGETS_MM.to_vec(),
            up_mm: rows(false),
            down_mm: rows(true),
            zero_mm: TARGETS_MM[0],
            periods_mm: vec![],
        };
        positioning::evaluate(&runs, budget).unwrap()
    };
    (0..SEEDS).map(test).collect()
}

#[test]
fn eq2_eq6_eq7_of_the_budget_are_the_scatter_of_the_figures() {
    let budget = PositioningBudget {
        device: DeviceUncertainty {
            expanded_uncertainty_per_length: 1.2e-6,
            ..EXACT_DEVICE
        },
        environmental_drift_mm: 0.004,
        ..EXACT
    };
    let results = figure_errors(&budget);
    type Figure = fn(&PositioningResult) -> ExpandedLength;
    let span_mm = TARGETS_MM[4] - TARGETS_MM[0];
    let figures: [(&str, Figure, f64); 3] = [
        ("E up", |r| r.up.systematic_error, 5e-5 * span_mm),
        ("E", |r| r.systematic_error, 5e-5 * span_mm + 0.004),
        ("M", |r| r.mean_systematic_error, 5e-5 * span_mm),
    ];
    for (name, of, truth_mm) in figures {
        let held = results.iter().filter(|r| {
            let figure = of(r);
            (figure.value_mm - truth_mm).abs() <= figure.expanded_uncertainty_mm
        });
        within_93_and_97_percent(name, held.count() as f64 / SEEDS as f64);
    }
    // The reversal of every target: the greatest of them is further off than one.
    let reversals = results.iter().flat_map(|r| {
        let expanded_mm = r.reversal.expanded_uncertainty_mm;
        r.points.iter().map(move |p| (p.reversal_mm, expanded_mm))
    });
    let held = reversals.filter(|(b, expanded_mm)| (b - 0.004).abs() <= *expanded_mm);
    within_93_and_97_percent("B_i", held.count() as f64 / (SEEDS * 5) as f64);
}

#[test]
fn eq4_eq5_eq8_of_the_budget_bound_what_drift_adds_to_the_scatter() {
    let budget = PositioningBudget {
        environmental_drift_mm: 0.004,
        ..EXACT
    };
    let span_mm = TARGETS_MM[4] - TARGETS_MM[0];
    let results = figure_errors(&budget);
    type Figure = fn(&PositioningResult) -> ExpandedLength;
    let figures: [(&str, Figure, f64); 3] = [
        ("R up", |r| r.up.repeatability, 0.0),
        ("R", |r| r.repeatability, 0.004),
        ("A", |r| r.accuracy, 5e-5 * span_mm + 0.004),
    ];
    for (name, of, truth_mm) in figures {
        let held = results.iter().filter(|r| {
            let figure = of(r);
            (figure.value_mm - truth_mm).abs() <= figure.expanded_uncertainty_mm
        });
        let share = held.count() as f64 / SEEDS as f64;
        eprintln!("{name}: {:.1} %", 100.0 * share);
        assert!(share >= 0.93, "{name}: {share}");
    }
}
