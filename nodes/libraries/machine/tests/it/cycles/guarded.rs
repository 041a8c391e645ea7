//! The ball never meets a surface in G0: every cycle of every shipped machine file, line by line.

use std::num::NonZeroU32;
use std::path::Path;

use machine::cycle::{self, Cycle, RotaryOrder, guarded_feed_mm_min};
use machine::file::ArtefactEntry;
use machine::program_frame::HEAD;
use machine::{CycleError, MachineFile};
use metrology::{Axis, PerAxis, yaml};
use nalgebra::Vector3;

use crate::cycles::bodies::{Body, clearance_mm, of_artefacts};
use crate::cycles::{bench, bench_with};

/// How far a block's body reaches behind its faces: along X and Y, and down through the table.
const BODY_MM: [f64; 3] = [60.0, 60.0, 2000.0];

/// Machine files of all scenarios that have their own, and the bench of these tests.
fn machines() -> Vec<(String, MachineFile)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../launch_configs");
    let mut found = vec![("bench".to_owned(), bench())];
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path().join("machine.yaml");
        let name = path.display().to_string();
        let own = |text: &String| yaml::base_of(text).unwrap().is_none();
        if let Some(text) = std::fs::read_to_string(&path).ok().filter(own) {
            found.push((name.clone(), MachineFile::parse(&text, &name).unwrap()));
        }
    }
    assert!(found.len() > 13, "{}", found.len());
    found
}

fn solid(file: &MachineFile) -> Vec<Body> {
    let mut bodies = of_artefacts(file);
    for block in &file.blocks {
        let corner = Vector3::from(block.corner_mm);
        let inward = Vector3::from(block.approach_sign).map(f64::from);
        let far = corner + inward.component_mul(&Vector3::from(BODY_MM));
        bodies.push(Body::Box {
            least: corner.inf(&far),
            greatest: corner.sup(&far),
        });
    }
    bodies
}

/// One straight move of a program: its word, from where, to where.
struct Move<'a> {
    line: &'a str,
    word: &'a str,
    from: Vector3<f64>,
    to: Vector3<f64>,
    feed_mm_min: f64,
    turns: bool,
}

fn moves<'a>(file: &MachineFile, program: &'a str) -> Vec<Move<'a>> {
    let top_mm = file.linear(Axis::Z).unwrap().travel_mm[1] - 1.0;
    let (mut at, mut feed_mm_min) = (Vector3::new(0.0, 0.0, top_mm), 0.0);
    let mut found = Vec::new();
    for line in program.lines() {
        let mut words = line.split(' ');
        let word = words.next().unwrap();
        if !["G0", "G1", "G38.2"].contains(&word) {
            let other = line.starts_with('(') || HEAD.contains(line) || line == "M2";
            assert!(other, "{line}");
            continue;
        }
        let (from, mut turns) = (at, false);
        for word in words {
            let value: f64 = word[1..].parse().unwrap();
            match &word[..1] {
                "X" => at.x = value,
                "Y" => at.y = value,
                "Z" => at.z = value,
                "F" => feed_mm_min = value,
                _ => turns = true,
            }
        }
        found.push(Move {
            line,
            word,
            from,
            to: at,
            feed_mm_min,
            turns,
        });
    }
    found
}

/// Each G0 is at the top of Z, straight up, or back from a touch to its start; the others go at the guarded feed.
fn check_words(name: &str, file: &MachineFile, cycle: &Cycle) {
    let top_mm = file.linear(Axis::Z).unwrap().travel_mm[1] - 1.0;
    let guarded_mm_min = guarded_feed_mm_min(file).unwrap();
    let mut start = None;
    for step in moves(file, &cycle.program) {
        let Move { line, from, to, .. } = step;
        match step.word {
            "G38.2" => start = Some(from),
            "G0" => {
                let at_top = from.z >= top_mm - 1e-6 && to.z >= top_mm - 1e-6;
                let up = to.xy() == from.xy() && to.z >= from.z && !step.turns;
                let back = start.take() == Some(to);
                assert!(at_top || up || back, "{name}: {line}");
            }
            _ => {
                assert!(start.is_none(), "{name}: {line}");
                assert!(
                    (step.feed_mm_min - guarded_mm_min).abs() < 1e-4,
                    "{name}: {line}"
                );
            }
        }
    }
}

/// Outside the way back from a touch, a ball in G0 keeps the stand-off from every surface.
fn check_distances(name: &str, file: &MachineFile, cycle: &Cycle) {
    let bodies = solid(file);
    let least_mm = file.ball_radius_mm() + file.probe.standoff_mm - 0.01;
    let mut touched = false;
    for step in moves(file, &cycle.program) {
        let back = std::mem::replace(&mut touched, step.word == "G38.2");
        if step.word != "G0" || back {
            continue;
        }
        let n = ((step.to - step.from).norm() / 0.5).ceil().max(1.0);
        let mut k = 0.0;
        while k <= n {
            let ball = step.from.lerp(&step.to, k / n);
            let clear_mm = clearance_mm(&bodies, &ball);
            assert!(
                clear_mm >= least_mm,
                "{name}: {}: {clear_mm} mm at {ball}",
                step.line
            );
            k += 1.0;
        }
    }
}

/// Every cycle that a machine file allows; what it has nothing for is left out.
fn cycles(file: &MachineFile) -> Vec<Cycle> {
    let twice = NonZeroU32::new(2).unwrap();
    let faces: Vec<String> = { file.blocks.iter() }
        .flat_map(|block| ["x", "y", "z"].map(|axis| format!("{}.{axis}", block.id)))
        .collect();
    let mut wanted = vec![
        cycle::blocks(file, &[], twice),
        cycle::spheres(file, &[], 5, twice),
        cycle::spheres(file, &[], 25, NonZeroU32::MIN),
        cycle::bores(file, &[], 6, twice),
        cycle::planes(file, &[], 3, twice),
        cycle::touches(file, &faces, twice),
    ];
    for face in &faces {
        wanted.push(cycle::latency(file, face, &[60.0, 300.0, 120.0], twice));
    }
    let nothing = |error: &CycleError| matches!(error, CycleError::NothingToTouch { .. });
    let (made, refused): (Vec<_>, Vec<_>) = wanted.into_iter().partition(Result::is_ok);
    for error in refused.into_iter().filter_map(Result::err) {
        assert!(nothing(&error), "{error}");
    }
    made.into_iter().flatten().collect()
}

#[test]
fn no_ball_meets_a_surface_in_g0_on_any_shipped_machine() {
    let mut n = 0;
    for (name, file) in machines() {
        for cycle in cycles(&file) {
            assert!(cycle.program.starts_with(HEAD), "{name}");
            check_words(&name, &file, &cycle);
            check_distances(&name, &file, &cycle);
            n += 1;
        }
    }
    println!("{n} programs");
    assert!(n > 100, "{n}");
}

#[test]
fn a_sphere_at_turned_poses_is_approached_as_slowly() {
    let mut n = 0;
    for (name, file) in machines() {
        let sphere = file.artefacts.iter().find_map(|entry| match entry {
            ArtefactEntry::Sphere { id, .. } => Some(id.as_str()),
            _ => None,
        });
        let (Some(sphere), true) = (sphere, file.rotary_axis(Axis::A).is_some()) else {
            continue;
        };
        let poses_rad = [(0.0, 0.0), (-20.0, 90.0), (-40.0, -120.0), (10.0, 45.0)].map(|(a, c)| {
            let mut pose = PerAxis::default();
            (pose[Axis::A], pose[Axis::C]) = (f64::to_radians(a), f64::to_radians(c));
            pose
        });
        for points in [5, 11] {
            let order = RotaryOrder {
                sphere,
                poses_rad: &poses_rad,
                points,
                repeats: NonZeroU32::MIN,
                verification: false,
            };
            match cycle::rotary(&file, &order) {
                Ok(cycle) => check_words(&name, &file, &cycle),
                Err(error) => panic!("{name}: {error}"),
            }
            n += 1;
        }
    }
    assert!(n > 0);
}

/// How far behind a surface a slide comes that meets it at `feed_mm_s`: the control brakes `wait_s` later, the
/// slide follows by a loop of first order.
fn overrun_mm(file: &MachineFile, axis: Axis, feed_mm_s: f64, wait_s: f64) -> f64 {
    const STEP_S: f64 = 1e-5;
    let entry = file.linear(axis).unwrap();
    let (gain, forward) = (entry.position_gain_per_s, entry.velocity_feedforward);
    let lag_mm = feed_mm_s * (1.0 - forward) / gain;
    let (mut command_mm, mut slide_mm, mut speed_mm_s) = (lag_mm, 0.0, feed_mm_s);
    let (mut greatest_mm, mut at_s) = (0.0_f64, 0.0);
    while at_s < 2.0 {
        if at_s >= wait_s {
            speed_mm_s = (speed_mm_s - entry.acceleration_limit_mm_s2 * STEP_S).max(0.0);
        }
        command_mm += speed_mm_s * STEP_S;
        slide_mm += (gain * (command_mm - slide_mm) + forward * speed_mm_s) * STEP_S;
        greatest_mm = greatest_mm.max(slide_mm);
        at_s += STEP_S;
    }
    greatest_mm
}

#[test]
fn eq5_a_contact_at_the_guarded_feed_ends_within_the_overtravel() {
    let mut files = machines();
    for (from, to) in [
        ("overtravel_mm: 3.0", "overtravel_mm: 0.5"),
        ("overtravel_mm: 3.0", "overtravel_mm: 12.0"),
        (
            "acceleration_limit_mm_s2: 2500.0",
            "acceleration_limit_mm_s2: 400.0",
        ),
        ("velocity_feedforward: 0.98", "velocity_feedforward: 0.0"),
        (
            "feed_mm_min: 120.0",
            "feed_mm_min: 120.0\n  latency_ms: 45.0",
        ),
    ] {
        files.push((to.to_owned(), bench_with(from, to)));
    }
    for (name, file) in files {
        let feed_mm_s = guarded_feed_mm_min(&file).unwrap() / 60.0;
        let latency_s = file.probe.latency_ms.unwrap_or(0.0).max(20.0) * 1e-3;
        let wait_s = latency_s + file.control.servo_period_ms * 1e-3;
        let overrun = Axis::LINEAR.map(|axis| overrun_mm(&file, axis, feed_mm_s, wait_s));
        let greatest_mm = overrun.into_iter().fold(0.0, f64::max);
        let allowed_mm = file.probe.overtravel_mm;
        println!(
            "{name}: {:.0} mm/min, {greatest_mm:.3} of {allowed_mm} mm",
            feed_mm_s * 60.0
        );
        assert!(greatest_mm <= allowed_mm + 1e-3, "{name}: {greatest_mm} mm");
        // Not needlessly slow: 1 mm/min of rounding, and loops that braking finds at rest.
        assert!(greatest_mm > 0.9 * allowed_mm, "{name}: {greatest_mm} mm");
    }
}

#[test]
fn no_guarded_feed_is_above_what_an_axis_can() {
    let slow = bench_with("feed_limit_mm_min: 15000.0", "feed_limit_mm_min: 900.0");
    assert!((guarded_feed_mm_min(&slow).unwrap() - 900.0).abs() < 1e-9);
}
