//! Single touches: correction, waiting, rejection.

use machine::Kinematics;
use metrology::sample::{
    AxisState, Correction, LatencyMethod, ProbeLatency, ProbeTrigger, Rejection,
};
use metrology::stamp::Span;
use metrology::{Axis, Stage, Stamp};
use nalgebra::Vector3;
use probe::queue::QueueMiss;
use probe::{Diagnostic, Input, Output, ProbeConfig, ProbeError, ProbeStage};

use crate::rig::{LATENCY_S, Rig, bench, known_latency};

fn calibrated(latency_s: f64, u_s: f64) -> Input {
    Input::Latency(ProbeLatency {
        at: Stamp::default(),
        method: LatencyMethod::WeightedLeastSquares,
        latency_s,
        standard_uncertainty_s: u_s,
        two_feed_latency_s: latency_s,
        least_squares_latency_s: latency_s,
        feeds_mm_s: vec![1.0, 2.0, 4.0],
        n: 9,
        intercept_mm: 0.0,
        intercept_uncertainty_mm: 0.0,
        lack_of_fit_p: 0.5,
        negative: latency_s < 0.0,
    })
}

#[test]
fn eq1_eq3_the_surface_is_found_at_every_feed() {
    for feed_mm_s in [0.5, 2.0, 8.3, 33.0] {
        let mut rig = Rig::new(&known_latency());
        let surface = Vector3::new(-220.0, 5.0, 14.0);
        rig.touch("block_1.x", surface, Vector3::x(), feed_mm_s);
        let point = rig.only_point();
        assert_eq!(
            (point.rejection, point.correction),
            (Rejection::None, Correction::Queue)
        );
        assert!(
            (point.point_in_machine_mm - surface).norm() < 1e-9,
            "{point:?}"
        );
        assert!((point.applied_latency_s - LATENCY_S).abs() < 1e-12);
        let u_mm = 0.0003_f64.hypot(feed_mm_s * 25e-6);
        assert!((point.standard_uncertainty_mm - u_mm).abs() < 1e-12);
    }
}

#[test]
fn eq1_holds_while_the_axis_accelerates_and_eq2_does_not() {
    let surface = Vector3::new(0.0, 0.0, 10.0);
    let mut rig = Rig::new(&known_latency());
    rig.acceleration_mm_s2 = 800.0;
    rig.touch("top.1", surface, -Vector3::z(), 10.0);
    let queued = rig.only_point();
    // Linear interpolation over 1 ms of 800 mm/s²: at most 0.1 µm.
    assert!(
        (queued.point_in_machine_mm - surface).norm() < 1.1e-4,
        "{queued:?}"
    );
    let config = ProbeConfig {
        allow_feed_correction: true,
        queue_samples: 2,
        ..known_latency()
    };
    let mut rig = Rig::new(&config);
    rig.acceleration_mm_s2 = 800.0;
    rig.touch("top.1", surface, -Vector3::z(), 10.0);
    let fed = rig.only_point();
    assert_eq!(fed.correction, Correction::Feed);
    // The feed at the latch is too high for the way since contact by a T²/2 = 28 µm.
    let miss_mm = (fed.point_in_machine_mm - surface).z;
    assert!(
        (miss_mm - 800.0 * LATENCY_S * LATENCY_S / 2.0).abs() < 1e-6,
        "{miss_mm}"
    );
}

#[test]
fn eq2_is_exact_at_constant_feed_and_says_that_it_was_used() {
    let config = ProbeConfig {
        allow_feed_correction: true,
        queue_samples: 2,
        ..known_latency()
    };
    let mut rig = Rig::new(&config);
    let surface = Vector3::new(220.0, -3.0, 190.0);
    rig.touch("block_2.x", surface, -Vector3::x(), 8.3);
    let point = rig.only_point();
    assert_eq!(point.correction, Correction::Feed);
    assert!((point.point_in_machine_mm - surface).norm() < 1e-9);
    assert!(matches!(
        rig.out[0],
        Output::Diagnostic(Diagnostic::CorrectedByFeed {
            sequence: 1,
            miss: QueueMiss::BeforeOldest { .. }
        })
    ));
}

#[test]
fn a_trigger_that_overtakes_its_positions_waits_for_them() {
    let mut rig = Rig::new(&known_latency());
    rig.trigger_first = true;
    let surface = Vector3::new(1.0, 2.0, 10.0);
    rig.touch("top.1", surface, -Vector3::z(), 5.0);
    let point = rig.only_point();
    assert_eq!(point.rejection, Rejection::None);
    assert!((point.point_in_machine_mm - surface).norm() < 1e-9);
}

#[test]
fn a_trigger_whose_positions_never_come_is_rejected_after_the_hold() {
    let mut rig = Rig::new(&known_latency());
    let mut trigger =
        Rig::new(&known_latency()).touch_ball("top.1", Vector3::zeros(), -Vector3::z(), 5.0);
    trigger.controller_at = Stamp::from_nanos(50_000_000_000);
    rig.send(Input::Trigger(trigger));
    assert!(rig.points().is_empty());
    rig.now_ns += 199_000_000;
    rig.send(Input::Tick);
    assert!(rig.points().is_empty());
    rig.now_ns += 1_000_000;
    rig.send(Input::Tick);
    let point = rig.only_point();
    assert_eq!(point.rejection, Rejection::AfterQueue);
    assert!(point.point_in_machine_mm.x.is_nan() && point.standard_uncertainty_mm.is_nan());
}

#[test]
fn what_the_queue_cannot_answer_is_rejected_with_its_reason() {
    let rejection = |config: &ProbeConfig, spoil: fn(&mut AxisState)| {
        let mut rig = Rig::new(config);
        rig.spoil = spoil;
        rig.touch("top.1", Vector3::zeros(), -Vector3::z(), 5.0);
        rig.settle();
        rig.only_point().rejection
    };
    let config = known_latency();
    let short = ProbeConfig {
        queue_samples: 4,
        ..known_latency()
    };
    let strict = ProbeConfig {
        longest_gap_ms: 0.5,
        ..known_latency()
    };
    let unknown = ProbeConfig::default();
    assert_eq!(rejection(&config, |_| {}), Rejection::None);
    assert_eq!(rejection(&short, |_| {}), Rejection::BeforeQueue);
    assert_eq!(rejection(&strict, |_| {}), Rejection::Gap);
    assert_eq!(rejection(&unknown, |_| {}), Rejection::NoLatency);
    let nan = |state: &mut AxisState| state.motor[Axis::Y] = f64::NAN;
    assert_eq!(rejection(&config, nan), Rejection::NotFinite);
}

#[test]
fn a_trigger_that_is_no_number_is_rejected() {
    let template =
        Rig::new(&known_latency()).touch_ball("top.1", Vector3::zeros(), -Vector3::z(), 5.0);
    let spoils: [fn(&mut ProbeTrigger); 3] = [
        |trigger| trigger.latched[Axis::Z] = f64::INFINITY,
        |trigger| trigger.feed_mm_s = f64::NAN,
        |trigger| trigger.approach.x = f64::NAN,
    ];
    for spoil in spoils {
        let mut trigger = template.clone();
        spoil(&mut trigger);
        let mut rig = Rig::new(&known_latency());
        rig.send(Input::Trigger(trigger));
        assert_eq!(rig.only_point().rejection, Rejection::NotFinite);
    }
}

#[test]
fn time_that_goes_back_rejects_the_touches_that_wait() {
    let mut rig = Rig::new(&known_latency());
    let mut trigger = rig.touch_ball("top.1", Vector3::zeros(), -Vector3::z(), 5.0);
    trigger.controller_at += Span::from_secs_f64(1.0);
    trigger.sequence += 1;
    rig.send(Input::Trigger(trigger));
    let old = rig.state(&Vector3::zeros(), 5);
    rig.send(Input::State(old));
    assert_eq!(rig.points()[1].rejection, Rejection::ClockWentBack);
    assert!(
        rig.diagnostics()[0].contains("went back") && rig.diagnostics()[0].contains("1 waiting")
    );
    // The new time line works at once.
    rig.now_ns = 10_000_000;
    rig.touch("top.1", Vector3::new(0.0, 0.0, 10.0), -Vector3::z(), 5.0);
    assert_eq!(rig.points()[2].rejection, Rejection::None);
}

#[test]
fn a_calibrated_latency_overrides_a_given_one_unless_it_is_nonsense() {
    let mut rig = Rig::new(&ProbeConfig::default());
    rig.send(calibrated(LATENCY_S, 10e-6));
    let surface = Vector3::new(0.0, 0.0, 10.0);
    rig.touch("top.1", surface, -Vector3::z(), 20.0);
    assert!((rig.points()[0].point_in_machine_mm - surface).norm() < 1e-9);
    rig.send(calibrated(-0.002, 10e-6));
    rig.send(calibrated(f64::NAN, 10e-6));
    assert_eq!(rig.diagnostics().len(), 2);
    rig.touch("top.1", surface, -Vector3::z(), 20.0);
    assert!((rig.points()[1].point_in_machine_mm - surface).norm() < 1e-9);
    // A hardware latch may be estimated slightly below zero.
    rig.send(calibrated(-5e-6, 10e-6));
    assert_eq!(rig.diagnostics().len(), 2);
}

#[test]
fn a_point_on_the_turned_table_is_given_on_the_workpiece() {
    let file = bench();
    let kinematics = Kinematics::new(&file).unwrap();
    let mut rig = Rig::new(&known_latency());
    rig.rotary[Axis::A] = -0.6;
    rig.rotary[Axis::C] = 1.2;
    let surface = Vector3::new(30.0, 20.0, 60.0);
    rig.touch("top.1", surface, -Vector3::z(), 5.0);
    let point = rig.only_point();
    assert!((point.point_in_machine_mm - surface).norm() < 1e-9);
    let mut pose = rig.rotary;
    pose[Axis::X] = surface.x;
    pose[Axis::Y] = surface.y;
    pose[Axis::Z] = surface.z;
    let expected = kinematics.ball_in_workpiece_mm(&pose);
    assert!((point.point_in_workpiece_mm - expected).norm() < 1e-9);
    assert!((expected - surface).norm() > 1.0);
}

#[test]
fn broken_contracts_are_refused_and_change_nothing() {
    let mut rig = Rig::new(&known_latency());
    let template =
        Rig::new(&known_latency()).touch_ball("top.1", Vector3::zeros(), -Vector3::z(), 5.0);
    let mut step = |input| {
        let mut out = Vec::new();
        rig.stage
            .step(Stamp::from_nanos(0), input, &mut out)
            .unwrap_err()
    };
    let mut long = template.clone();
    long.approach *= 2.0;
    assert_eq!(
        step(Input::Trigger(long)).to_string(),
        "trigger 1: approach has length 2, must be 1"
    );
    let mut short = template;
    short.axes = metrology::AxisSet::XYZ;
    assert_eq!(
        step(Input::Trigger(short)),
        ProbeError::AxisMissing {
            sample: "trigger",
            axis: Axis::A
        }
    );
    let bad = ProbeConfig {
        latency_ms: Some(5.0),
        ..ProbeConfig::default()
    };
    assert_eq!(
        ProbeStage::new(&bad, &bench()).unwrap_err(),
        ProbeError::UncertaintyMissing { latency_ms: 5.0 }
    );
}

#[test]
fn a_touch_that_is_told_again_or_after_a_later_one_is_none() {
    let mut rig = Rig::new(&known_latency());
    let surface = Vector3::new(0.0, 0.0, 10.0);
    let touch = |rig: &mut Rig| rig.touch_ball("top.1", surface, -Vector3::z(), 2.0);
    let first = touch(&mut rig);
    rig.send(Input::Trigger(first.clone()));
    touch(&mut rig);
    rig.send(Input::Trigger(first));
    touch(&mut rig);
    rig.settle();
    let sequences: Vec<u32> = rig.points().iter().map(|point| point.sequence).collect();
    assert_eq!(sequences, [1, 2, 3]);
    let told_before = Diagnostic::ToldBefore { sequence: 1 }.to_string();
    assert_eq!(rig.diagnostics(), [told_before.clone(), told_before]);
}

#[test]
fn a_latency_of_before_the_one_in_use_is_refused_unless_the_clock_was_set_back() {
    let calibrated_at = |seconds: i64, latency_s: f64| {
        let Input::Latency(mut latency) = calibrated(latency_s, 25e-6) else {
            panic!("no latency")
        };
        latency.at = Stamp::from_nanos(seconds * 1_000_000_000);
        Input::Latency(latency)
    };
    let applied_s = |rig: &mut Rig| {
        rig.out.clear();
        rig.touch("top.1", Vector3::new(0.0, 0.0, 10.0), -Vector3::z(), 2.0);
        rig.only_point().applied_latency_s
    };
    let mut rig = Rig::new(&ProbeConfig::default());
    rig.now_ns = 7_200_000_000_000;
    rig.send(calibrated_at(7_000, LATENCY_S));
    rig.send(calibrated_at(3_400, LATENCY_S + 1e-3));
    let older = Diagnostic::LatencyOlder { by_s: 3_600.0 };
    assert_eq!(rig.diagnostics(), [older.to_string()]);
    assert!((applied_s(&mut rig) - LATENCY_S).abs() < 1e-12);
    // Set back by an hour, in which the latency is calibrated anew.
    rig.now_ns = 3_700_000_000_000;
    rig.send(calibrated_at(3_650, LATENCY_S + 1e-4));
    assert!((applied_s(&mut rig) - LATENCY_S - 1e-4).abs() < 1e-12);
}

/// A stranger's touches: all of them wait for positions that never come.
#[test]
fn touches_without_end_wait_up_to_a_limit_and_it_is_said() {
    let mut rig = Rig::new(&known_latency());
    let state = rig.state(&Vector3::zeros(), rig.now_ns);
    for n in 0..10_050 {
        let at = Stamp::from_nanos(rig.now_ns + n);
        rig.send(Input::Trigger(ProbeTrigger {
            received_at: at,
            controller_at: Stamp::from_nanos(rig.now_ns + 1_000_000_000_000 + n),
            feature_id: "top.1".to_owned(),
            approach: -Vector3::z(),
            feed_mm_s: 2.0,
            axes: state.axes,
            latched: state.motor,
            sequence: u32::try_from(n).unwrap(),
        }));
    }
    let is_too_many = |o: &&Output| {
        matches!(
            o,
            Output::Diagnostic(Diagnostic::TooMany { held: 10_000, .. })
        )
    };
    assert_eq!(rig.out.iter().filter(is_too_many).count(), 50);
    rig.settle();
    let points = rig.out.iter().filter(|o| matches!(o, Output::Point(_)));
    assert_eq!(points.count(), 10_000);
}
