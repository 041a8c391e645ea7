//! Intervals hold the truth as often as they say.

use iso230::breakdown::CircularSense::{Clockwise, CounterClockwise};
use iso230::breakdown::{BacklashEnd, BreakdownConfig, RowKey, evaluate};
use metrology::Axis::{X, Y};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use crate::breakdown::machine::{Axis, Machine, drive};

const RUNS: usize = 1000;
const NOISE_MM: f64 = 0.0005;
/// Every n-th sample of the simulation is kept, so that 1,000 runs do not take minutes.
const EVERY: usize = 7;

/// A machine with all linear faults, without noise.
fn machine() -> Machine {
    let x = Axis {
        lag_s: 3e-4,
        play_mm: 0.004,
        lateral_mm: 0.003,
        scale: 3e-5,
        bow_per_mm: 4e-7,
        ..Axis::default()
    };
    let y = Axis {
        play_mm: 0.002,
        scale: -1e-5,
        lateral_mm: -0.002,
        ..Axis::default()
    };
    Machine {
        axes: [x, y],
        squareness_rad: 2e-5,
        drift_mm_s: 2e-5,
        setting_up_mm: [0.002, 0.001],
        ..Machine::default()
    }
}

fn truths() -> Vec<(RowKey, f64)> {
    let backlash = |axis, end, b| (RowKey::Backlash { axis, end }, b);
    vec![
        (RowKey::Squareness, 2e-5),
        (RowKey::ServoMismatch, 3e-4),
        (RowKey::ScalingMismatch, 4e-5),
        backlash(X, BacklashEnd::Positive, 0.004),
        backlash(X, BacklashEnd::Negative, 0.004),
        backlash(Y, BacklashEnd::Positive, 0.002),
        backlash(Y, BacklashEnd::Negative, 0.002),
        (RowKey::LateralPlay { axis: X }, 0.003),
        (RowKey::LateralPlay { axis: Y }, -0.002),
        (RowKey::Straightness { axis: X }, 4e-7),
        (RowKey::Straightness { axis: Y }, 0.0),
        (RowKey::Drift, 2e-5),
    ]
}

#[test]
fn ninety_five_percent_intervals_of_the_linear_rows_hold_the_truth_in_93_to_97_percent() {
    let drives = [
        (50.0, CounterClockwise),
        (50.0, Clockwise),
        (20.0, CounterClockwise),
        (20.0, Clockwise),
    ];
    let mut quiet = machine().measure_all(&drives.map(|(feed, sense)| drive(100.0, feed, sense)));
    for recording in &mut quiet {
        let mut at = 0;
        recording.samples.retain(|_| {
            at += 1;
            at % EVERY == 1
        });
    }
    let config = BreakdownConfig {
        pitches: Vec::new(),
        most_tones: 0,
        ..BreakdownConfig::default()
    };
    let truths = truths();
    let mut hits = vec![0; truths.len()];
    let mut sums = vec![(0.0, 0.0); truths.len()];
    for run in 0..RUNS {
        let mut rng = Pcg64Mcg::seed_from_u64(run as u64);
        let mut noisy = quiet.clone();
        for sample in noisy.iter_mut().flat_map(|r| &mut r.samples) {
            let noise: f64 = StandardNormal.sample(&mut rng);
            sample.radial_deviation_mm += NOISE_MM * noise;
        }
        let breakdown = evaluate(&noisy, &config).unwrap();
        for ((hits, sums), (key, truth)) in hits.iter_mut().zip(&mut sums).zip(&truths) {
            let row = breakdown.planes[0].row(key).unwrap();
            let score = (row.value - truth) / row.standard_uncertainty;
            *sums = (
                sums.0 + score / RUNS as f64,
                sums.1 + score * score / RUNS as f64,
            );
            *hits += usize::from((row.value - truth).abs() <= 1.96 * row.standard_uncertainty);
        }
    }
    let keys = truths.iter().map(|(key, _)| key);
    // Beside the hits: mean and mean square of the error over its uncertainty.
    let counted: Vec<_> = keys.zip(hits).zip(sums).collect();
    assert!(
        counted
            .iter()
            .all(|((_, hits), _)| (930..=970).contains(hits)),
        "{counted:#?}"
    );
}
