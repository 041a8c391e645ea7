//! Symmetries that hold whatever the machine is.

use iso230::breakdown::{BreakdownConfig, CircularRecording, PlaneBreakdown, RowKey, evaluate};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::breakdown::machine::{Axis, Machine, full_set};
use crate::breakdown::printed;

const MACHINES: u64 = 5;

fn random(seed: u64) -> Machine {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut any = |size: f64| rng.random_range(-size..size);
    let mut axis = || Axis {
        lag_s: 2e-4 + any(2e-4).abs(),
        play_mm: any(0.006).abs(),
        scale: any(3e-5),
        bow_per_mm: any(4e-7),
        lateral_mm: any(0.004),
        ..Axis::default()
    };
    let axes = [axis(), axis()];
    Machine {
        axes,
        squareness_rad: any(4e-5),
        noise_mm: 2e-4,
        ..Machine::default()
    }
}

fn linear(recordings: &[CircularRecording]) -> PlaneBreakdown {
    let config = BreakdownConfig {
        pitches: Vec::new(),
        most_tones: 0,
        ..BreakdownConfig::default()
    };
    evaluate(recordings, &config).unwrap().planes.remove(0)
}

#[test]
fn prop_a_constant_added_to_the_radius_changes_only_the_radius_rows() {
    for seed in 0..MACHINES {
        let recordings = random(seed).measure_all(&full_set()[..4]);
        let mut wider = recordings.clone();
        for sample in wider.iter_mut().flat_map(|r| &mut r.samples) {
            sample.radial_deviation_mm += 0.004;
        }
        let (before, after) = (linear(&recordings), linear(&wider));
        for row in &before.rows {
            let now = after.row(&row.key).unwrap();
            let change = if row.key == RowKey::RadialExpansion {
                4e-5
            } else {
                0.0
            };
            let off = (now.value - row.value - change).abs();
            assert!(
                off < 0.02 * row.standard_uncertainty,
                "{}\n{}",
                row.name,
                printed(&after)
            );
        }
    }
}

#[test]
fn prop_a_mirrored_machine_has_its_squareness_turned_over_and_its_lags_kept() {
    for seed in 0..MACHINES {
        let recordings = random(seed).measure_all(&full_set()[..4]);
        // The second axis counted the other way round: angles and senses turn over.
        let mut mirrored = recordings.clone();
        for recording in &mut mirrored {
            recording.sense = recording.sense.reversed();
            for sample in &mut recording.samples {
                sample.angle_rad = -sample.angle_rad;
            }
        }
        let (before, after) = (linear(&recordings), linear(&mirrored));
        let pairs = [
            (RowKey::Squareness, -1.0),
            (RowKey::ServoMismatch, 1.0),
            (RowKey::ScalingMismatch, 1.0),
            (RowKey::RadialExpansion, 1.0),
            (RowKey::Drift, 1.0),
            (
                RowKey::LateralPlay {
                    axis: metrology::Axis::X,
                },
                -1.0,
            ),
            (
                RowKey::LateralPlay {
                    axis: metrology::Axis::Y,
                },
                -1.0,
            ),
        ];
        for (key, sign) in pairs {
            let (a, b) = (before.row(&key).unwrap(), after.row(&key).unwrap());
            let off = (a.value - sign * b.value).abs();
            assert!(
                off < 0.02 * a.standard_uncertainty,
                "{}\n{}\n{}",
                a.name,
                printed(&before),
                printed(&after)
            );
        }
    }
}

#[test]
fn prop_shares_add_up_and_no_row_has_a_number_without_uncertainty() {
    for seed in 0..MACHINES {
        let plane = linear(&random(seed).measure_all(&full_set()[..3]));
        let shares: f64 = plane.rows.iter().map(|row| row.share_percent).sum();
        assert!((shares - 100.0).abs() < 1e-9);
        let explained: f64 = plane
            .rows
            .iter()
            .map(|row| row.variance_share_percent)
            .sum();
        assert!(
            explained < 100.0 + 1e-6 && explained > 80.0,
            "{explained}\n{}",
            printed(&plane)
        );
        assert!(plane.rows.iter().all(|row| row.standard_uncertainty > 0.0));
    }
}
