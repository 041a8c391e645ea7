//! Touching cycles, run by a small interpreter of their own against solid bodies.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::print_stdout, reason = "the figures seen are worth showing")]
#![expect(clippy::disallowed_methods, reason = "shipped machine files are read")]

use std::num::NonZeroU32;

use machine::cycle::{self, Cycle, FeatureId};
use machine::program_frame::HEAD;
use machine::{CycleError, MachineFile};
use metrology::sample::TestKind;
use nalgebra::Vector3;

use crate::cycles::bodies::{Body, bodies, clearance_mm};

mod bodies;
mod guarded;

const BENCH: &str = include_str!("../data/bench.yaml");
const BALL_MM: f64 = 3.0;
const SHAFT_MM: f64 = 2.2;
const ONCE: NonZeroU32 = NonZeroU32::MIN;

fn bench() -> MachineFile {
    MachineFile::parse(BENCH, "bench.yaml").unwrap()
}

fn bench_with(from: &str, to: &str) -> MachineFile {
    assert!(BENCH.contains(from), "{from}");
    MachineFile::parse(&BENCH.replace(from, to), "bench.yaml").unwrap()
}

/// Runs a program; every touch must find a body where it was planned and no move may meet one.
fn run(file: &MachineFile, cycle: &Cycle) {
    let bodies = bodies(file);
    let mut at = Vector3::new(0.0, 0.0, 400.0);
    let mut feature = String::new();
    let mut made = 0;
    for line in cycle.program.lines() {
        if let Some(name) = line.strip_prefix("(feature: ") {
            name.trim_end_matches(')').clone_into(&mut feature);
            continue;
        }
        if line == "M2" || HEAD.lines().any(|head| head == line) {
            continue;
        }
        let mut target = at;
        let mut words = line.split(' ');
        let motion = words.next().unwrap();
        for word in words {
            let value: f64 = word[1..].parse().unwrap();
            match &word[..1] {
                "X" => target.x = value,
                "Y" => target.y = value,
                "Z" => target.z = value,
                "A" | "C" | "F" => {}
                other => panic!("word {other} in {line}"),
            }
        }
        let steps = ((target - at).norm() / 0.05).ceil().max(1.0) as usize;
        let path = (1..=steps).map(|k| at.lerp(&target, k as f64 / steps as f64));
        match motion {
            "G0" | "G1" => {
                path.for_each(|p| check_free(&bodies, &p, line));
                at = target;
            }
            "G38.2" => {
                let planned = &cycle.touches[made];
                assert_eq!(planned.feature_id, feature);
                let hit = { path }
                    .find(|p| clearance_mm(&bodies, p) <= BALL_MM)
                    .unwrap_or_else(|| panic!("{feature} found nothing"));
                let surface = hit + planned.approach * BALL_MM;
                assert!(
                    (surface - planned.contact_mm).norm() < 0.06,
                    "{feature}: {surface}"
                );
                assert!(((target - at).normalize() - planned.approach).norm() < 1e-4);
                made += 1;
                at = hit;
            }
            other => panic!("motion {other} in {line}"),
        }
    }
    assert_eq!(made, cycle.touches.len());
    assert!(cycle.program.ends_with("M2\n"));
}

fn check_free(bodies: &[Body], ball: &Vector3<f64>, line: &str) {
    assert!(
        clearance_mm(bodies, ball) > BALL_MM - 0.06,
        "ball at {ball} in {line}"
    );
    for k in 1..60 {
        let shaft = ball + Vector3::z() * (2.5 * f64::from(k));
        assert!(
            clearance_mm(bodies, &shaft) > SHAFT_MM - 0.01,
            "shaft at {shaft} in {line}"
        );
    }
}

#[test]
fn blocks_are_touched_on_three_faces_without_a_collision() {
    let file = bench();
    let cycle = cycle::blocks(&file, &[], NonZeroU32::new(2).unwrap()).unwrap();
    assert_eq!(cycle.kind, TestKind::Block);
    assert_eq!(cycle.features, ["block_1", "block_2"]);
    assert_eq!(cycle.touches.len(), 12);
    assert!(
        cycle
            .program
            .starts_with(&format!("{HEAD}G0 Z439\nG0 A0 C0\n"))
    );
    run(&file, &cycle);
}

#[test]
fn each_face_is_touched_along_its_own_normal_near_the_corner() {
    let file = bench();
    let cycle = cycle::blocks(&file, &[String::from("block_2")], ONCE).unwrap();
    let x = &cycle.touches[0];
    assert_eq!(x.feature_id, "block_2.x");
    assert_eq!(x.approach, Vector3::new(-1.0, 0.0, 0.0));
    assert_eq!(x.contact_mm, Vector3::new(220.0, 174.0, 194.0));
    let z = &cycle.touches[2];
    assert_eq!(z.approach, Vector3::new(0.0, 0.0, -1.0));
    assert_eq!(z.contact_mm, Vector3::new(214.0, 174.0, 200.0));
}

#[test]
fn blocks_at_one_coordinate_are_legal_to_probe() {
    let file = bench_with(
        "corner_mm: [220.0, 180.0, 200.0]",
        "corner_mm: [-220.0, 180.0, 200.0]",
    );
    assert_eq!(cycle::blocks(&file, &[], ONCE).unwrap().touches.len(), 6);
}

#[test]
fn other_shapes_are_touched_without_a_collision() {
    let file = bench();
    run(&file, &cycle::planes(&file, &[], 3, ONCE).unwrap());
    run(
        &file,
        &cycle::bores(&file, &[], 6, NonZeroU32::new(2).unwrap()).unwrap(),
    );
    run(&file, &cycle::spheres(&file, &[], 5, ONCE).unwrap());
    run(&file, &cycle::spheres(&file, &[], 25, ONCE).unwrap());
    let faces = ["block_1.x", "top", "block_2.z", "side.1"].map(String::from);
    run(&file, &cycle::touches(&file, &faces, ONCE).unwrap());
    run(
        &file,
        &cycle::latency(&file, "block_1.y", &[60.0, 500.0], ONCE).unwrap(),
    );
}

#[test]
fn every_feature_id_can_be_read_back() {
    let file = bench();
    for cycle in [
        cycle::blocks(&file, &[], ONCE).unwrap(),
        cycle::spheres(&file, &[], 25, ONCE).unwrap(),
        cycle::bores(&file, &[], 4, ONCE).unwrap(),
        cycle::planes(&file, &[], 3, ONCE).unwrap(),
    ] {
        for touch in cycle.touches {
            let id = FeatureId::parse(&touch.feature_id).unwrap();
            assert_eq!(id.to_string(), touch.feature_id);
        }
    }
}

#[test]
fn a_linear_drift_cancels_from_the_slope_over_feed() {
    let file = bench();
    let feeds = [500.0, 60.0, 120.0, 240.0, 360.0];
    let cycle = cycle::latency(&file, "block_1.z", &feeds, NonZeroU32::new(4).unwrap()).unwrap();
    assert_eq!(cycle.touches.len(), 20);
    let n = cycle.touches.len() as f64;
    let mean = cycle.touches.iter().map(|t| t.feed_mm_min).sum::<f64>() / n;
    let moment: f64 = (0..).zip(&cycle.touches).fold(0.0, |sum, (k, touch)| {
        sum + (f64::from(k) - (n - 1.0) / 2.0) * (touch.feed_mm_min - mean)
    });
    assert!(moment.abs() < 1e-9, "{moment}");
}

#[test]
fn a_polled_latch_is_met_at_different_phases() {
    let file = bench_with("latch: hardware", "latch: polled");
    let cycle = cycle::latency(
        &file,
        "block_1.z",
        &[60.0, 600.0],
        NonZeroU32::new(8).unwrap(),
    );
    let mut phases: Vec<f64> = cycle
        .unwrap()
        .touches
        .iter()
        .filter(|touch| touch.feed_mm_min > 100.0)
        .map(|touch| (touch.standoff_mm - 2.0) / 0.010)
        .collect();
    phases.sort_by(f64::total_cmp);
    let gaps = phases.windows(2).map(|pair| pair[1] - pair[0]);
    assert!(gaps.clone().fold(f64::INFINITY, f64::min) > 0.05);
    assert!(
        phases[0] < 0.15 && phases[7] > 0.85 && phases[7] < 1.0,
        "{phases:?}"
    );
}

#[test]
fn feeds_that_tell_nothing_about_latency_are_refused_with_their_values() {
    let file = bench();
    let message = |feeds: &[f64]| {
        cycle::latency(&file, "block_1.z", feeds, ONCE)
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        message(&[60.0, 120.0, 60.0]),
        "feeds[0] and feeds[2] are both 60 mm/min: latency needs different feeds"
    );
    assert_eq!(
        message(&[60.0, 0.0]),
        "feeds[1] = 0 mm/min: must be a finite number above 0"
    );
    assert_eq!(
        message(&[-5.0, 60.0]),
        "feeds[0] = -5 mm/min: must be a finite number above 0"
    );
    assert_eq!(
        message(&[60.0, f64::NAN]),
        "feeds[1] = NaN mm/min: must be a finite number above 0"
    );
    assert_eq!(
        message(&[60.0]),
        "1 feeds were given: latency needs at least 2 different feeds"
    );
    assert_eq!(
        message(&[]),
        "0 feeds were given: latency needs at least 2 different feeds"
    );
}

#[test]
fn a_standoff_or_overtravel_too_short_for_the_feed_is_refused() {
    let file = bench();
    let error = cycle::latency(&file, "block_1.z", &[60.0, 6000.0], ONCE).unwrap_err();
    // 100^2 / 5000 = 2 mm of ramp alone.
    assert!(
        matches!(error, CycleError::StandoffTooShort { feed_mm_min: 6000.0, standoff_mm: 2.0, needed_mm, .. } if needed_mm > 3.0),
        "{error}"
    );
    let file = bench_with("overtravel_mm: 3.0", "overtravel_mm: 0.3");
    let error = cycle::latency(&file, "block_1.z", &[60.0, 1800.0], ONCE).unwrap_err();
    assert_eq!(
        error.to_string(),
        "feature \"block_1.z\": feed 1800 mm/min needs an overtravel of 0.380 mm to be held at contact (acceleration 2500 mm/s2), probe.overtravel_mm is 0.3"
    );
}

#[test]
fn what_is_not_there_or_out_of_reach_is_refused_by_name() {
    let file = bench();
    let ids = [String::from("block_9")];
    assert_eq!(
        cycle::blocks(&file, &ids, ONCE).unwrap_err().to_string(),
        "feature \"block_9\": the machine file has no block of this name"
    );
    let none = [String::from("top")];
    assert_eq!(
        cycle::spheres(&file, &none, 5, ONCE)
            .unwrap_err()
            .to_string(),
        "feature \"top\": the machine file has no sphere of this name"
    );
    assert!(matches!(
        cycle::latency(&file, "block_1.q", &[60.0, 120.0], ONCE),
        Err(CycleError::UnknownFeature { .. })
    ));
    let far = bench_with(
        "corner_mm: [220.0, 180.0, 200.0]",
        "corner_mm: [318.0, 180.0, 200.0]",
    );
    assert_eq!(
        cycle::blocks(&far, &[], ONCE).unwrap_err().to_string(),
        "feature \"block_2.x\": axis X would go to 323 mm, its travel is from -320 to 320 mm"
    );
    let below = bench_with("approach_sign: [1, 1, -1]", "approach_sign: [1, 1, 1]");
    assert!(matches!(
        cycle::blocks(&below, &[], ONCE),
        Err(CycleError::ApproachFromBelow { .. })
    ));
    let small = bench_with(
        "centre_mm: [-60.0, 60.0, 40.0], radius_mm: 20.0",
        "centre_mm: [-60.0, 60.0, 40.0], radius_mm: 4.0",
    );
    assert!(matches!(
        cycle::bores(&small, &[], 4, ONCE),
        Err(CycleError::BoreTooSmall { room_mm: 1.0, .. })
    ));
    assert!(matches!(
        cycle::bores(&file, &[], 3, ONCE),
        Err(CycleError::TooFewPoints {
            points: 3,
            least: 4,
            ..
        })
    ));
    let skew = bench_with("normal: [0.0, 0.0, 1.0]", "normal: [0.0, 0.6, 0.8]");
    assert!(matches!(
        cycle::planes(&skew, &[], 3, ONCE),
        Err(CycleError::NormalNotAlongAxis { .. })
    ));
    let turned = bench_with("travel_deg: [-120.0, 30.0]", "travel_deg: [-120.0, -30.0]");
    assert!(matches!(
        cycle::blocks(&turned, &[], ONCE),
        Err(CycleError::OutsideTravel { .. })
    ));
}
