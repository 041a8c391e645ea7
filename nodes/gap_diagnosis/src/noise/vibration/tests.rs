//! Vibrations in series of numpy, none in noise, none in what goes with the path.

use metrology::Axis;
use metrology::sample::{TestKind, TestSegment};
use metrology::{AxisSet, PerAxis, Stamp};
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use twin::{History, Motion};

use super::*;

const SERIES: &str = include_str!("series.csv");

/// Runs that stand, or move along X at so many mm/s.
fn session(runs: u32, readings: usize, period_s: f64, mm_s: f64) -> Session {
    let run = |number: u32| {
        let time_s: Vec<f64> = (0..readings).map(|k| count(k) * period_s).collect();
        let mut position = PerAxis::<Vec<f64>>::default();
        for axis in Axis::LINEAR {
            let speed = if axis == Axis::X { mm_s } else { 0.0 };
            position[axis] = time_s.iter().map(|s| s * speed).collect();
        }
        Run {
            segment: TestSegment::of_kind(TestKind::Dwell, number, Stamp::from_nanos(0)),
            motion: Motion::new(time_s, AxisSet::XYZ, position).unwrap(),
            touches: vec![],
            readings: vec![],
        }
    };
    Session {
        history: History::default(),
        runs: (1..=runs).map(run).collect(),
        first_bag_ends: None,
    }
}

fn sampled(columns: Vec<Vec<f64>>, period_s: f64) -> Vec<Sampled> {
    let one = |(run, values_um): (usize, Vec<f64>)| Sampled {
        run,
        period_s,
        time_s: (0..values_um.len()).map(|k| count(k) * period_s).collect(),
        values_um,
    };
    columns.into_iter().enumerate().map(one).collect()
}

fn normal(dice: &mut Pcg64Mcg) -> f64 {
    StandardNormal.sample(dice)
}

#[test]
fn val_numpy_vibration() {
    let mut lines = SERIES.lines();
    let head = lines.next().unwrap();
    let rms_um = head.split("vibration ").nth(1).unwrap();
    let rms_um: f64 = rms_um.trim_end_matches(" um").parse().unwrap();
    let mut columns = vec![vec![]; 8];
    for line in lines {
        for (column, cell) in columns.iter_mut().zip(line.split(',')) {
            column.push(0.01 * cell.parse::<f64>().unwrap());
        }
    }
    let session = session(8, 700, 0.004, 0.0);
    let found = of_runs(&session, sampled(columns, 0.004), 1);
    let [line] = &found[..] else {
        panic!("{found:#?}")
    };
    assert!((line.frequency_hz - 47.3).abs() < 0.2, "{line:?}");
    assert!(
        (0.05..0.5).contains(&line.frequency_half_width_hz),
        "{line:?}"
    );
    assert!(
        (line.rms_um / rms_um - 1.0).abs() < 0.1,
        "{line:?} {rms_um}"
    );
    assert_eq!((line.runs, line.of), (8, 8));
    assert!((line.sampled_hz - 250.0).abs() < 1e-9 && line.period_mm.is_none());
}

/// Twelve runs of 600 readings: white noise, and noise with a memory of 0.9 in every second seed.
#[test]
fn white_noise_has_no_line() {
    let session = session(12, 600, 0.002, 0.0);
    let has_line = |seed: &u64| {
        let mut dice = Pcg64Mcg::seed_from_u64(*seed);
        let memory = if seed.is_multiple_of(2) { 0.0 } else { 0.9 };
        let columns = (0..12).map(|_| {
            let mut last = 0.0;
            let next = |_| {
                last = memory * last + normal(&mut dice);
                last
            };
            (0..600).map(next).collect()
        });
        !of_runs(&session, sampled(columns.collect(), 0.002), 1).is_empty()
    };
    let false_lines: Vec<u64> = (0..1000).filter(has_line).collect();
    assert!(false_lines.len() <= 1, "{false_lines:?}");
}

/// A wave of 0.4 mm along the path at 20 mm/s has 50 Hz in all runs, and one phase; a shaking floor has another one each time.
#[test]
fn what_goes_with_the_path_is_no_vibration() {
    let session = session(5, 2000, 0.002, 20.0);
    let found = |has_one_phase: bool| {
        let mut dice = Pcg64Mcg::seed_from_u64(7);
        let columns = (0..5).map(|_| {
            let phase: f64 = if has_one_phase {
                0.3
            } else {
                dice.random_range(0.0..TAU)
            };
            let reading = |k: usize| {
                let turns = TAU * 50.0 * 0.002 * count(k);
                0.5 * (turns + phase).sin() + 0.2 * normal(&mut dice)
            };
            (0..2000).map(reading).collect()
        });
        of_runs(&session, sampled(columns.collect(), 0.002), 1)
    };
    assert!(found(true).is_empty());
    let [line] = &found(false)[..] else {
        panic!("no vibration")
    };
    assert!((line.period_mm.unwrap() - 0.4).abs() < 0.005, "{line:?}");
}

#[test]
fn two_runs_of_five_show_too_little() {
    let session = session(5, 1000, 0.002, 0.0);
    let mut dice = Pcg64Mcg::seed_from_u64(11);
    let columns = (0..5).map(|run| {
        let size = if run < 2 { 1.0 } else { 0.0 };
        let reading = |k: usize| {
            size * (TAU * 80.0 * 0.002 * count(k) + f64::from(run)).sin() + normal(&mut dice)
        };
        (0..1000).map(reading).collect()
    });
    assert!(of_runs(&session, sampled(columns.collect(), 0.002), 1).is_empty());
}
