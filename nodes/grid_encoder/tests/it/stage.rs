//! The stage, driven by a machine with a few errors that only the test knows.

#![expect(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a test fails by panicking and shows its figures"
)]

mod refusals;
mod rig;

use metrology::Axis;
use metrology::sample::{Sense, TestPlane};
use rig::{Motion, Rig};

/// EXX1 and EYY1, 1; EC0Y, rad; EXX2, 1/mm.
const TRUTH: [(&str, f64); 4] = [
    ("EXX1", 20e-6),
    ("EYY1", -15e-6),
    ("EC0Y", 30e-6),
    ("EXX2", 0.3e-6),
];

fn machine_error_mm(x: f64, y: f64) -> [f64; 2] {
    let [(_, exx1), (_, eyy1), (_, ec0y), (_, exx2)] = TRUTH;
    [exx1 * x + exx2 * x * x - ec0y * y, eyy1 * y]
}

fn check_truth(rig: &Rig, coverage: f64) {
    let found = rig.identification();
    for (name, truth) in TRUTH {
        let (value, u) = found.estimate(found.find(name).unwrap()).unwrap();
        println!("{name}: {value:.4e} +- {u:.1e}, truth {truth:.4e}");
        assert!(
            (value - truth).abs() < coverage * u + 1e-9,
            "{name}: {value} {u} {truth}"
        );
    }
}

#[test]
fn stationwise_circles_give_the_errors_of_the_machine() {
    let mut rig = Rig::new(machine_error_mm);
    for (run, radius) in [(1, 50.0), (2, 25.0)] {
        rig.record(run, &Motion::stops(radius, 72));
    }
    check_truth(&rig, 4.0);
    let models = rig.models();
    assert_eq!(models.len(), 2, "one model for each recording");
    let flags = |idx: usize| -> usize {
        let curves = models[idx].curves.iter();
        curves
            .flat_map(|curve| &curve.estimable)
            .filter(|e| **e)
            .count()
    };
    assert!(flags(1) > flags(0), "{} {}", flags(0), flags(1));
    assert_eq!(models[1].sequence, 2);
    assert_eq!(models[1].covariance.nrows(), 51);
    for curve in &models[1].curves {
        for (flag, u) in curve.estimable.iter().zip(&curve.standard_uncertainty) {
            assert_eq!(*flag, u.is_finite(), "{}", curve.component);
        }
    }
    let span = models[1].curves[0].span;
    assert!((span.0 + 50.0).abs() < 0.1 && (span.1 - 50.0).abs() < 0.1);
}

#[test]
fn traces_on_the_fly_in_both_senses_give_them_too_and_the_lost_motion() {
    let mut rig = Rig::new(machine_error_mm);
    rig.lost_motion_mm = [0.003, 0.005];
    rig.stamp_late_s = 0.0004;
    let mut run = 0;
    for radius in [50.0, 25.0] {
        for sense in [Sense::CounterClockwise, Sense::Clockwise] {
            run += 1;
            rig.record(run, &Motion::moving(radius, sense));
        }
    }
    check_truth(&rig, 5.0);
    let found = rig.identification();
    for (name, truth) in [
        ("lost motion of X", 0.003),
        ("lost motion of Y", 0.005),
        ("stamp offset", -0.0004),
    ] {
        let (value, u) = found.estimate(found.find(name).unwrap()).unwrap();
        println!("{name}: {value:.6} +- {u:.6}");
        assert!(
            (value - truth).abs() < 0.05 * truth.abs(),
            "{name}: {value}"
        );
    }
}

#[test]
fn a_model_recorded_with_its_predecessor_on_is_the_same_model() {
    let mut rig = Rig::new(machine_error_mm);
    rig.compensated = true;
    for (run, radius) in [(1, 50.0), (2, 25.0)] {
        rig.record(run, &Motion::stops(radius, 72));
    }
    check_truth(&rig, 4.0);
}

#[test]
fn a_plate_that_lies_askew_changes_nothing() {
    let mut rig = Rig::new(machine_error_mm);
    rig.turn_rad = 0.02;
    for (run, radius) in [(1, 50.0), (2, 25.0)] {
        rig.record(run, &Motion::stops(radius, 72));
    }
    check_truth(&rig, 4.0);
    let found = rig.identification();
    let idx = found.find("plate rotation of set-up 1").unwrap();
    assert!(
        (found.values[idx] - 0.02).abs() < 1e-5,
        "{}",
        found.values[idx]
    );
}

/// Topics arrive in any order.
#[test]
fn readings_that_come_before_the_begin_of_their_segment_count() {
    let recorded = |begins_late_ticks| {
        let mut rig = Rig::new(machine_error_mm);
        rig.begins_late_ticks = begins_late_ticks;
        for run in 1..=2 {
            rig.record(run, &Motion::moving(50.0, Sense::CounterClockwise));
        }
        assert_eq!(rig.models().len(), 2);
        // What is not known is NaN, which equals nothing.
        format!("{:?}", rig.models())
    };
    assert_eq!(recorded(0), recorded(40));
}

#[test]
fn readings_after_the_end_do_not_count_although_they_come_before_it() {
    let recorded = |ends_late_ticks| {
        let mut rig = Rig::new(machine_error_mm);
        rig.ends_late_ticks = ends_late_ticks;
        rig.record(1, &Motion::moving(50.0, Sense::CounterClockwise));
        assert_eq!(rig.models().len(), 1);
        format!("{:?}", rig.models()[0].curves)
    };
    assert_eq!(recorded(0), recorded(40));
}

/// The grid is zeroed anew for the next recording while the end of this one is still on its way.
#[test]
fn readings_under_the_next_zero_do_not_spoil_a_recording_whose_end_is_late() {
    let mut rig = Rig::new(machine_error_mm);
    rig.ends_late_ticks = 40;
    rig.spoil = |t_s, mut sample| {
        // Beyond the end of a circle of 50 mm at 25 mm/s.
        if t_s > 4.0 * std::f64::consts::PI {
            sample.zero_id += 1;
        }
        Some(sample)
    };
    let motion = Motion::moving(50.0, Sense::CounterClockwise);
    rig.record(1, &motion);
    assert_eq!(rig.models().len(), 1, "{:?}", rig.diagnostics());
}

/// Nor is a recording over for readings that are on their way when the next one begins.
#[test]
fn readings_that_come_after_the_begin_of_the_next_segment_count() {
    let recorded = |lag_ticks| {
        let mut rig = Rig::new(machine_error_mm);
        rig.lag_ticks = lag_ticks;
        for (run, pauses) in [(1, false), (2, true)] {
            rig.pauses = pauses;
            rig.record(run, &Motion::moving(50.0, Sense::CounterClockwise));
        }
        let recordings = rig.out.iter().filter_map(|output| match output {
            grid_encoder::Output::Recording(recording) => {
                Some((recording.run, recording.points.clone()))
            }
            _ => None,
        });
        recordings.collect::<Vec<_>>()
    };
    let (at_once, late) = (recorded(0), recorded(20));
    assert_eq!((at_once.len(), late.len()), (2, 2));
    assert_eq!(at_once[0], late[0]);
}

#[test]
fn equal_events_give_equal_outputs() {
    let run = || {
        let mut rig = Rig::new(machine_error_mm);
        rig.record(1, &Motion::stops(50.0, 24));
        // As text: a number that is not told is NaN, which equals nothing.
        format!("{:?}", rig.out)
    };
    assert!(run() == run());
}

#[test]
fn what_is_not_estimable_stays_as_small_as_the_errors() {
    let mut rig = Rig::new(machine_error_mm);
    rig.record(1, &Motion::stops(50.0, 24));
    let found = rig.identification();
    let idx = found.find("EXX2").unwrap();
    assert!(found.estimate(idx).is_none());
    // The zero is 1.25 mm and -3.5 mm off, and one circle mixes it with what is quadratic.
    for idx in 0..found.n_coefficients {
        let at_edge_mm = found.values[idx] / found.scale[idx];
        assert!(
            at_edge_mm.abs() < 0.005,
            "{}: {at_edge_mm}",
            found.unknowns[idx]
        );
    }
    let offset = found.values[found.find("offset u of zero 7").unwrap()];
    assert!((offset - 1.25).abs() < 0.01, "{offset}");
}

#[test]
fn a_circle_in_yz_sees_y_and_z_alone() {
    let mut rig = Rig::new(|_, _| [0.0, 0.0]);
    let mut motion = Motion::stops(50.0, 24);
    motion.plane = TestPlane::Yz;
    rig.record(1, &motion);
    let found = rig.identification();
    assert!(found.estimate(found.find("EYY1").unwrap()).is_some());
    assert!(found.estimate(found.find("EXX1").unwrap()).is_none());
    let unseen = found.visibility[found.find("EXX1").unwrap()];
    assert_eq!(unseen, grid_encoder::spectrum::Visibility::Unseen);
    let (least, greatest) = found.spans[Axis::X];
    assert!((greatest - least).abs() < 1e-9);
}
