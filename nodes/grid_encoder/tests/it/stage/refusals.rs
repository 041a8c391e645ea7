//! Recordings that are none are refused by name, and never stop the stage.

use grid_encoder::diagnostic::{Diagnostic, Refusal};
use grid_encoder::{GridEncoderConfig, GridEncoderError, GridEncoderStage, IdentifyError, Input};
use machine::MachineFile;
use metrology::sample::{Sense, TestPlane};
use metrology::{Axis, AxisSet, PerAxis, Stage, Stamp};

use crate::stage::rig::{Motion, Rig};

fn still(_: f64, _: f64) -> [f64; 2] {
    [0.0, 0.0]
}

fn refused(prepare: impl Fn(&mut Rig, &mut Motion)) -> Vec<Refusal> {
    let mut rig = Rig::new(still);
    let mut motion = Motion::stops(50.0, 24);
    prepare(&mut rig, &mut motion);
    rig.record(1, &motion);
    assert!(rig.models().is_empty());
    rig.refusals().into_iter().cloned().collect()
}

#[test]
fn a_zeroing_within_a_recording_is_refused() {
    let found = refused(|rig, _| {
        rig.spoil = |t_s, mut sample| {
            sample.zero_id += u32::from(t_s > 5.0);
            Some(sample)
        };
    });
    assert!(
        found.contains(&Refusal::MixedZeroIds {
            expected: 7,
            found: 8
        }),
        "{found:?}"
    );
}

#[test]
fn readings_of_another_plane_are_refused() {
    let found = refused(|rig, _| {
        rig.spoil = |_, mut sample| {
            sample.plane = TestPlane::Zx;
            Some(sample)
        };
    });
    let expected = TestPlane::Xy;
    assert!(
        found.contains(&Refusal::WrongPlane { expected }),
        "{found:?}"
    );
}

#[test]
fn a_hole_in_the_readings_is_refused_with_its_length() {
    let found = refused(|rig, _| {
        rig.spoil = |t_s, sample| (!(4.0..7.0).contains(&t_s)).then_some(sample);
    });
    assert!(
        matches!(found[0], Refusal::Gap { longest_s, .. } if (longest_s - 3.0).abs() < 0.1),
        "{found:?}"
    );
}

#[test]
fn a_circle_larger_than_the_plate_is_refused() {
    let found = refused(|_, motion| motion.radius_mm = 120.0);
    assert!(matches!(found[0], Refusal::OffPlate { .. }), "{found:?}");
}

#[test]
fn too_few_stops_are_refused() {
    let found = refused(|_, motion| motion.dwell_s = 0.2);
    let few = |r: &Refusal| {
        matches!(
            r,
            Refusal::TooFewStations {
                found: 0,
                planned: 24,
                ..
            }
        )
    };
    assert!(few(&found[0]), "{found:?}");
}

#[test]
fn a_run_that_was_broken_off_is_refused() {
    assert!(refused(|rig, _| rig.completed = false).contains(&Refusal::NotCompleted));
}

#[test]
fn readings_that_are_no_numbers_are_refused_if_most_and_left_out_if_few() {
    let found = refused(|rig, _| {
        rig.spoil = |_, mut sample| {
            sample.u_mm = f64::NAN;
            Some(sample)
        };
    });
    assert!(found.contains(&Refusal::NoReadings), "{found:?}");
    assert!(
        found.iter().any(|r| matches!(r, Refusal::NotFinite { .. })),
        "{found:?}"
    );
    let mut rig = Rig::new(still);
    rig.spoil = |t_s, mut sample| {
        if (4.0..4.1).contains(&t_s) {
            sample.v_mm = f64::INFINITY;
        }
        Some(sample)
    };
    rig.record(1, &Motion::stops(50.0, 24));
    assert_eq!(rig.models().len(), 1);
    let left_out = |d: &&&Diagnostic| matches!(d, Diagnostic::LeftOut { .. });
    assert_eq!(rig.diagnostics().iter().filter(left_out).count(), 1);
}

#[test]
fn one_zero_in_two_set_ups_is_refused_and_the_next_recording_is_fitted() {
    let mut rig = Rig::new(still);
    rig.record(1, &Motion::stops(50.0, 24));
    rig.setup_id = 2;
    rig.record(2, &Motion::stops(50.0, 24));
    let reason = IdentifyError::ZeroUsedTwice { zero_id: 7, run: 2 };
    assert!(
        rig.diagnostics()
            .contains(&&Diagnostic::NotFitted { reason })
    );
    (rig.zero_id, rig.told_zero_id) = (8, 8);
    rig.record(3, &Motion::stops(50.0, 24));
    assert_eq!(rig.models().len(), 2);
}

#[test]
fn an_end_without_a_begin_and_a_begin_without_an_end_are_named() {
    let mut rig = Rig::new(still);
    rig.segment(5, false, &Motion::stops(50.0, 24));
    rig.segment(6, true, &Motion::stops(50.0, 24));
    rig.segment(7, true, &Motion::stops(50.0, 24));
    assert_eq!(
        rig.refusals(),
        [&Refusal::NotBegun, &Refusal::NotEnded { next: 7 }]
    );
}

#[test]
fn a_clock_that_goes_back_ends_the_recording() {
    let mut rig = Rig::new(still);
    let motion = Motion::stops(50.0, 24);
    rig.segment(1, true, &motion);
    rig.state(&motion, 0.0);
    rig.now_ns -= 500_000_000;
    rig.state(&motion, 0.1);
    assert!(
        matches!(rig.diagnostics()[0], Diagnostic::ClockWentBack { by_s } if (by_s - 0.5).abs() < 1e-9)
    );
    rig.segment(1, false, &motion);
    assert_eq!(rig.refusals(), [&Refusal::NotBegun]);
}

#[test]
fn old_recordings_leave_at_the_limit() {
    let config = GridEncoderConfig {
        recordings_limit: 1,
        ..GridEncoderConfig::default()
    };
    let mut rig = Rig::with(still, config);
    rig.record(1, &Motion::stops(50.0, 24));
    rig.record(2, &Motion::moving(50.0, Sense::Clockwise));
    assert_eq!(rig.stage.recordings().len(), 1);
    assert!(
        rig.diagnostics()
            .contains(&&Diagnostic::Dropped { run: 1, limit: 1 })
    );
}

#[test]
fn an_outlier_at_a_station_is_set_aside() {
    let mut rig = Rig::new(still);
    rig.spoil = |t_s, mut sample| {
        if (5.0..5.02).contains(&t_s) {
            sample.u_mm += 0.1;
        }
        Some(sample)
    };
    rig.record(1, &Motion::stops(50.0, 24));
    let aside = rig.diagnostics().into_iter().find_map(|d| match d {
        Diagnostic::Recorded { outliers, .. } => Some(*outliers),
        _ => None,
    });
    assert!((3..=4).contains(&aside.unwrap()), "{aside:?}");
}

#[test]
fn a_machine_without_a_grid_encoder_or_a_sample_without_an_axis_is_refused() {
    let text = include_str!("../../../../../launch_configs/four_blocks/machine.yaml");
    let mut file = MachineFile::parse(text, "machine.yaml").unwrap();
    let config = GridEncoderConfig::default();
    let mut stage = GridEncoderStage::new(&config, &file).unwrap();
    let mut state = metrology::sample::AxisState {
        received_at: Stamp::from_nanos(0),
        controller_at: Stamp::from_nanos(0),
        axes: AxisSet::XYZ,
        commanded: PerAxis::default(),
        motor: PerAxis::default(),
        scale: PerAxis::default(),
        velocity: PerAxis::default(),
    };
    let mut out = Vec::new();
    let step = stage.step(Stamp::from_nanos(0), Input::State(state), &mut out);
    assert_eq!(step, Err(GridEncoderError::AxisMissing { axis: Axis::A }));
    state.axes = file.axis_set();
    assert!(
        stage
            .step(Stamp::from_nanos(0), Input::State(state), &mut out)
            .is_ok()
    );
    file.grid_encoder = None;
    assert_eq!(
        GridEncoderStage::new(&config, &file).unwrap_err(),
        GridEncoderError::NoGridEncoder
    );
}

#[test]
fn readings_that_are_told_again_or_out_of_order_count_once_and_are_said() {
    let recorded = |again: bool| {
        let mut rig = Rig::new(|u, v| [1e-5 * u, -2e-5 * v]);
        rig.tells_again = again;
        for (run, motion) in [
            (1, Motion::stops(50.0, 24)),
            (2, Motion::moving(50.0, Sense::Clockwise)),
        ] {
            rig.record(run, &motion);
        }
        rig
    };
    let (once, again) = (recorded(false), recorded(true));
    assert_eq!(once.models().len(), 2);
    // What is not known is NaN, which equals nothing.
    let models = |rig: &Rig| format!("{:?}", rig.models());
    assert_eq!(models(&once), models(&again));
    let told_before = |rig: &Rig| {
        let all = rig.diagnostics().into_iter();
        all.filter(|told| matches!(told, Diagnostic::ToldBefore { .. }))
            .count()
    };
    assert_eq!((told_before(&once), told_before(&again)), (0, 2));
}
