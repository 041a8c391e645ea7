//! Two blocks that are touched every twenty minutes of a shift: what slips is reported with its face and its run, what the machine
//! does is named, and what warms is no noise.

use gap_diagnosis::report::{DoesNotRepeat, Status};
use gap_diagnosis::{Diagnosis, GapConfig, diagnose};
use machine::MachineFile;
use metrology::sample::{TestKind, TestSegment};
use metrology::stamp::Stamp;
use metrology::{Axis, AxisSet, PerAxis};
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use twin::{Channel, Motion, Reading, Run, Session, Touch};

use crate::trials::plant::{names, told};

const CYCLE_S: f64 = 1200.0;
const CYCLES: u32 = 12;
/// Noise of a touch, mm.
const WHITE_MM: f64 = 0.3e-3;
/// Corners, mm; every face is approached along its axis, Z from above.
const CORNERS_MM: [[f64; 3]; 2] = [[-200.0, -150.0, 20.0], [210.0, 160.0, 190.0]];

/// Block, axis and time since the begin, s, to how much further along its axis a touch is, mm.
type Moves = dyn Fn(usize, usize, f64) -> f64;

fn machine() -> MachineFile {
    let text = include_str!("../../../../../launch_configs/grid_xy/machine.yaml");
    MachineFile::parse(text, "grid_xy").expect("the plant is sound")
}

/// Cycles of some blocks.
fn shift(seed: u64, blocks: usize, moves: &Moves) -> Session {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut session = Session::default();
    for cycle in 0..CYCLES {
        let start_s = 60.0 + CYCLE_S * f64::from(cycle);
        let (mut touches, mut readings) = (vec![], vec![]);
        for (block, corner_mm) in CORNERS_MM.iter().enumerate().take(blocks) {
            for axis in 0..3 {
                let sense = if axis == 2 || block == 1 { -1.0 } else { 1.0 };
                let at = touches.len();
                let time_s = start_s + 6.0 * at as f64;
                let mut approach = Vector3::zeros();
                approach[axis] = sense;
                let mut position = PerAxis::default();
                for linear in Axis::LINEAR {
                    position[linear] = corner_mm[linear.index()];
                }
                touches.push(Touch {
                    time_s,
                    feature_id: format!("block_{}.{}", block + 1, ["x", "y", "z"][axis]),
                    approach,
                    feed_mm_s: 2.0,
                    position,
                    tick: Some(at),
                });
                let white: f64 = StandardNormal.sample(&mut random);
                readings.push(Reading {
                    channel: Channel::Touch,
                    at,
                    fraction: 0.0,
                    deviation: WHITE_MM * white + sense * moves(block, axis, time_s),
                });
            }
        }
        let times_s = touches.iter().map(|touch: &Touch| touch.time_s).collect();
        let places =
            PerAxis::from_fn(|axis| touches.iter().map(|touch| touch.position[axis]).collect());
        let motion = Motion::new(times_s, AxisSet::XYZ, places);
        let mut segment = TestSegment::of_kind(TestKind::Block, cycle, Stamp::from_nanos(0));
        (segment.setup_id, segment.zero_id) = (1, 1);
        session.runs.push(Run {
            segment,
            motion: motion.expect("a tick a touch"),
            touches,
            readings,
        });
    }
    session
}

/// The same with a thermometer at the column, which warms by 6 K with the morning and falls again, and others that warm in proportion.
fn with_column(mut session: Session, others: &[&str]) -> (MachineFile, Session) {
    let mut sensors =
        "temperature_sensors:\n  - {id: column, place: column, period_s: 60.0}\n".to_owned();
    for place in others {
        sensors += &format!("  - {{id: {place}, place: {place}, period_s: 60.0}}\n");
    }
    let text = include_str!("../../../../../launch_configs/grid_xy/machine.yaml");
    let file = MachineFile::parse(&format!("{text}\n{sensors}"), "grid_xy");
    session.history.step_s = 60.0;
    let series = |share: f64| {
        let at = move |minute: i32| 20.0 + share * warming_k(60.0 * f64::from(minute));
        (0..250).map(at).collect()
    };
    let all = [&["column"], others].concat().into_iter().enumerate();
    let series = all.map(|(n, id)| (id.to_owned(), series(1.0 / (n + 1) as f64)));
    session.history.temperature_degc = series.collect();
    (file.expect("the plant is sound"), session)
}

fn warming_k(time_s: f64) -> f64 {
    let hours = time_s / 3600.0;
    6.0 * (std::f64::consts::PI * hours / 3.2).sin() + 0.8 * (5.0 * hours).sin()
}

fn diagnosed(session: &Session) -> Diagnosis {
    diagnose(&machine(), session, &GapConfig::default()).expect("a diagnosis")
}

/// A head that grows along Z as it warms, with 45 min.
fn grows(axis: usize, time_s: f64) -> f64 {
    let of_z = f64::from(u8::from(axis == 2));
    -18e-3 * of_z * (1.0 - (-time_s / 2700.0).exp())
}

fn step(since_s: f64, time_s: f64) -> f64 {
    f64::from(u8::from(time_s > since_s))
}

fn told_of(own: &DoesNotRepeat) -> (Option<&str>, u32, u32, bool) {
    (
        own.feature.as_deref(),
        own.last_run,
        own.from_run,
        own.of_set_up,
    )
}

#[test]
fn a_block_whose_clamp_slips_is_told_with_its_face_and_its_run() {
    for seed in 1..4 {
        let slips = |block: usize, axis: usize, time_s: f64| {
            let is_own = f64::from(u8::from((block, axis) == (1, 0)));
            9e-3 * is_own * step(7000.0, time_s) + grows(axis, time_s)
        };
        let diagnosis = diagnosed(&shift(seed, 2, &slips));
        let all = told(&diagnosis);
        let changes = &diagnosis.report.does_not_repeat;
        let found: Vec<_> = changes.iter().map(told_of).collect();
        assert_eq!(found, [(Some("block_2.x"), 5, 6, true)], "{all}");
        assert!((changes[0].size_um - 9.0).abs() < 0.6, "{changes:?}");
        // A slip is no effect of the machine.
        let is_along_x = |name: &String| name.ends_with(" X");
        assert!(!names(&diagnosis).iter().any(is_along_x), "{all}");
    }
}

#[test]
fn a_single_block_cannot_tell_a_slip_from_a_reference_point_that_shifts() {
    for seed in 4..7 {
        let slips = |_: usize, axis: usize, time_s: f64| {
            -7e-3 * f64::from(u8::from(axis == 1)) * step(9500.0, time_s)
        };
        let diagnosis = diagnosed(&shift(seed, 1, &slips));
        let all = told(&diagnosis);
        let found: Vec<_> = diagnosis
            .report
            .does_not_repeat
            .iter()
            .map(told_of)
            .collect();
        assert_eq!(found, [(Some("block_1.y"), 7, 8, true)], "{all}");
        assert!(names(&diagnosis).is_empty(), "{all}");
        let is_told = diagnosis.notes.iter().any(|note| {
            let note = note.to_string();
            note.starts_with("touch of block_1.y does not repeat")
                && note.contains("reference point")
        });
        assert!(is_told, "{all}");
    }
}

#[test]
fn a_reference_point_that_shifts_moves_both_blocks_and_stands_with_the_coolant() {
    for seed in 7..10 {
        let shifts = |_: usize, axis: usize, time_s: f64| {
            8e-3 * f64::from(u8::from(axis == 1)) * step(4700.0, time_s)
        };
        let diagnosis = diagnosed(&shift(seed, 2, &shifts));
        let all = told(&diagnosis);
        let mut causes = diagnosis.report.causes.iter();
        let cause = causes.find(|cause| cause.status != Status::Surrogate);
        let cause = cause.unwrap_or_else(|| panic!("{all}"));
        let alike = cause.confusable_with.iter();
        let mut all_names: Vec<String> = alike
            .map(|own| format!("{} {}", own.effect, own.axis))
            .collect();
        all_names.push(format!("{} {}", cause.effect, cause.axis));
        assert_eq!(cause.status, Status::Set, "{all}");
        for wanted in ["homing_shift Y", "coolant Y"] {
            assert!(
                all_names.iter().any(|name| name == wanted),
                "{wanted}: {all}"
            );
        }
        let instant = cause.parameters.iter().find(|own| own.name == "at_min");
        let at_s = 60.0 * instant.expect("an instant").value;
        assert!((3600.0..4860.0).contains(&at_s), "{at_s} {all}");
        assert!(diagnosis.report.does_not_repeat.is_empty(), "{all}");
    }
}

#[test]
fn a_block_that_creeps_in_its_clamp_is_no_noise_and_is_not_passed_over() {
    for seed in 30..34 {
        let creeps = |block: usize, axis: usize, time_s: f64| {
            let is_own = f64::from(u8::from((block, axis) == (0, 1)));
            -30e-3 * is_own * (1.0 - (-(time_s - 7000.0).max(0.0) / 2400.0).exp())
        };
        for blocks in [1, 2] {
            let diagnosis = diagnosed(&shift(seed, blocks, &creeps));
            let all = told(&diagnosis);
            let report = &diagnosis.report;
            let floor = report.noise_floor.iter().find(|own| own.channel == "touch");
            let sigma_um = floor.expect("touches").sigma_um;
            assert!((0.15..0.6).contains(&sigma_um), "{sigma_um} {all}");
            let is_told = report.unknown.flagged || !report.does_not_repeat.is_empty();
            assert!(is_told || !names(&diagnosis).is_empty(), "{all}");
            assert!(report.gap.above_floor, "{all}");
            // Coolant may do so to a single block, and is then one of a set.
            let mut kept = report
                .causes
                .iter()
                .filter(|own| own.status != Status::Surrogate);
            let is_right = if blocks == 1 {
                kept.all(|own| own.status == Status::Set)
            } else {
                kept.next().is_none()
            };
            assert!(is_right, "{blocks}: {all}");
        }
    }
}

#[test]
fn what_comes_with_the_held_out_runs_alone_is_not_passed_over() {
    for seed in 40..43 {
        let slips_late = |block: usize, axis: usize, time_s: f64| {
            let is_own = f64::from(u8::from((block, axis) == (0, 0)));
            -20e-3 * is_own * ((time_s - 11_000.0) / 2400.0).max(0.0)
        };
        let diagnosis = diagnosed(&shift(seed, 1, &slips_late));
        let all = told(&diagnosis);
        let report = &diagnosis.report;
        assert!(report.unknown.flagged && report.gap.above_floor, "{all}");
        assert!(names(&diagnosis).is_empty(), "{all}");
    }
}

#[test]
fn what_warms_between_cycles_is_no_noise_of_touches() {
    for seed in 10..13 {
        let warms = |_: usize, axis: usize, time_s: f64| grows(axis, time_s);
        let diagnosis = diagnosed(&shift(seed, 2, &warms));
        let floors = &diagnosis.report.noise_floor;
        let floor = floors.iter().find(|own| own.channel == "touch");
        let sigma_um = floor.expect("touches").sigma_um;
        let all = told(&diagnosis);
        assert!((0.2..0.6).contains(&sigma_um), "{sigma_um} {all}");
        let is_found = names(&diagnosis)
            .iter()
            .any(|name| name.ends_with(" Z") || name == "spindle_growth ");
        assert!(is_found || diagnosis.report.unknown.flagged, "{all}");
    }
}

/// A column that leans along Y with its temperature, half an hour late, by two bodies one behind the other.
fn leans(_: usize, axis: usize, time_s: f64) -> f64 {
    let (mut first, mut second, step_s) = (0.0, 0.0, 10.0);
    let mut at_s = 0.0;
    while at_s < time_s {
        first += (warming_k(at_s) - first) * step_s / 900.0;
        second += (first - second) * step_s / 900.0;
        at_s += step_s;
    }
    2e-3 * f64::from(u8::from(axis == 1)) * second
}

#[test]
fn touches_that_go_with_a_thermometer_are_named_with_it() {
    for seed in 50..53 {
        let (file, session) = with_column(shift(seed, 2, &leans), &[]);
        let diagnosis = diagnose(&file, &session, &GapConfig::default()).expect("a diagnosis");
        let all = told(&diagnosis);
        let right = ["thermal_shift column", "column_bend "];
        let found = names(&diagnosis);
        assert!(!found.is_empty(), "{all}");
        assert!(found.iter().all(|name| right.contains(&&**name)), "{all}");
    }
}

#[test]
fn a_thermometer_that_warms_in_proportion_stands_with_the_one_that_is_named() {
    for seed in 54..57 {
        let (file, session) = with_column(shift(seed, 2, &leans), &["bed"]);
        let diagnosis = diagnose(&file, &session, &GapConfig::default()).expect("a diagnosis");
        let all = told(&diagnosis);
        let mut causes = diagnosis.report.causes.iter();
        let cause = causes.find(|cause| cause.status != Status::Surrogate);
        let cause = cause.unwrap_or_else(|| panic!("{all}"));
        assert_eq!(cause.status, Status::Set, "{all}");
        let mut ids = cause.confusable_with.iter().map(|own| &*own.axis);
        assert!(ids.any(|id| id == "bed") || cause.axis == "bed", "{all}");
    }
}

#[test]
fn touches_that_only_scatter_and_warm_do_not_slip() {
    for seed in 13..25 {
        let warms = |_: usize, axis: usize, time_s: f64| grows(axis, time_s);
        let diagnosis = diagnosed(&shift(seed, 2, &warms));
        let steps = diagnosis
            .report
            .does_not_repeat
            .iter()
            .filter(|own| !own.evenly);
        assert_eq!(steps.count(), 0, "{seed}: {}", told(&diagnosis));
        let diagnosis = diagnosed(&shift(seed, 2, &|_, _, _| 0.0));
        assert!(
            diagnosis.report.does_not_repeat.is_empty(),
            "{seed}: {}",
            told(&diagnosis)
        );
        assert!(names(&diagnosis).is_empty(), "{seed}: {}", told(&diagnosis));
    }
}
