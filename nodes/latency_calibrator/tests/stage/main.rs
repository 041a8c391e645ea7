//! The calibrator, driven by touches with a latency that only the test knows.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod limits;

use latency_calibrator::evaluation::LatencyEvaluation;
use latency_calibrator::{
    Input, LatencyCalibratorConfig, LatencyCalibratorError, LatencyCalibratorStage, Output,
    Refusal, TouchFault,
};
use machine::MachineFile;
use metrology::sample::{
    AxisState, LatencyMethod, ProbeLatency, ProbeTrigger, TestKind, TestSegment,
};
use metrology::{Axis, PerAxis, Stage, Stamp};
use nalgebra::{Rotation3, Vector3};
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;

const BENCH: &str = include_str!("../../../libraries/machine/tests/data/bench.yaml");
const FEEDS_MM_S: [f64; 5] = [1.0, 2.0, 4.0, 6.0, 10.0];

/// A machine with its own straight motion; times in ns.
struct Rig {
    stage: LatencyCalibratorStage,
    out: Vec<Output>,
    now_ns: i64,
    sequence: u32,
    latency_ns: i64,
    /// Repeatability of the probe, mm.
    scatter_mm: f64,
    rng: Pcg64Mcg,
    rotary: PerAxis<f64>,
    /// Ramps up with this acceleration over the stand-off, mm/s², mm; otherwise constant feed.
    ramp: Option<(f64, f64)>,
    /// Share of the positions that are published.
    publishes: bool,
    /// Whether each touch is told twice.
    tells_again: bool,
}

impl Rig {
    fn new(latency_ns: i64) -> Self {
        let file = MachineFile::parse(BENCH, "bench.yaml").unwrap();
        let config = LatencyCalibratorConfig::default();
        Self {
            stage: LatencyCalibratorStage::new(&config, &file).unwrap(),
            out: Vec::new(),
            now_ns: 5_000_000_000,
            sequence: 0,
            latency_ns,
            scatter_mm: 0.0,
            rng: Pcg64Mcg::seed_from_u64(21),
            rotary: PerAxis::default(),
            ramp: None,
            publishes: true,
            tells_again: false,
        }
    }

    fn send(&mut self, input: Input) {
        let at = Stamp::from_nanos(self.now_ns);
        self.stage.step(at, input, &mut self.out).unwrap();
    }

    fn segment(&mut self, begin: bool, completed: bool) {
        let segment = TestSegment {
            begin,
            features: vec![String::from("block_1.z")],
            completed,
            ..TestSegment::of_kind(TestKind::Latency, 3, Stamp::from_nanos(self.now_ns))
        };
        self.send(Input::Segment(segment));
    }

    /// Way of the ball since `t_s` before contact, mm: negative before, zero at contact.
    fn way_mm(&self, t_s: f64, feed_mm_s: f64) -> f64 {
        let Some((acceleration, standoff_mm)) = self.ramp else {
            return feed_mm_s * t_s;
        };
        let ramp_s = feed_mm_s / acceleration;
        let ramp_mm = acceleration * ramp_s * ramp_s / 2.0;
        // Time of contact since the start of the move.
        let contact_s = if standoff_mm < ramp_mm {
            (2.0 * standoff_mm / acceleration).sqrt()
        } else {
            ramp_s + (standoff_mm - ramp_mm) / feed_mm_s
        };
        let s = (t_s + contact_s).max(0.0);
        let moved_mm = if s < ramp_s {
            acceleration * s * s / 2.0
        } else {
            ramp_mm + feed_mm_s * (s - ramp_s)
        };
        moved_mm - standoff_mm
    }

    fn touch(&mut self, feed_mm_s: f64) {
        let surface = Vector3::new(-214.0, -174.0, 23.0);
        self.touch_at(surface, -Vector3::z(), feed_mm_s);
    }

    fn touch_at(&mut self, surface_mm: Vector3<f64>, approach: Vector3<f64>, feed_mm_s: f64) {
        let noise = Normal::new(0.0, self.scatter_mm)
            .unwrap()
            .sample(&mut self.rng);
        let contact_ns = self.now_ns + 100_000_321;
        let latch_ns = contact_ns + self.latency_ns;
        let motor_at = |rig: &Self, at_ns: i64, extra_mm: f64| {
            let t_s = (at_ns - contact_ns) as f64 / 1e9;
            let ball = surface_mm + approach * (rig.way_mm(t_s, feed_mm_s) + extra_mm);
            let mut motor = rig.rotary;
            for axis in Axis::LINEAR {
                motor[axis] = ball[axis.index()];
            }
            motor
        };
        self.sequence += 1;
        let trigger = ProbeTrigger {
            received_at: Stamp::from_nanos(latch_ns),
            controller_at: Stamp::from_nanos(latch_ns),
            feature_id: String::from("block_1.z"),
            approach,
            // A program that lies about its feed must not matter.
            feed_mm_s: 99.0,
            axes: MachineFile::parse(BENCH, "bench.yaml").unwrap().axis_set(),
            latched: motor_at(self, latch_ns, noise),
            sequence: self.sequence,
        };
        let mut sent = false;
        while self.now_ns < latch_ns.max(contact_ns) + 4_000_000 {
            if !sent && self.now_ns >= latch_ns {
                for _ in 0..=u32::from(self.tells_again) {
                    self.send(Input::Trigger(trigger.clone()));
                }
                sent = true;
            }
            if self.publishes {
                let motor = motor_at(self, self.now_ns, 0.0);
                let state = AxisState {
                    scale: motor,
                    ..AxisState::standing(
                        Stamp::from_nanos(self.now_ns),
                        Stamp::from_nanos(self.now_ns),
                        trigger.axes,
                        motor,
                    )
                };
                self.send(Input::State(state));
            }
            self.now_ns += 1_000_000;
        }
        assert!(sent);
    }

    /// Ends the run and lets time pass.
    fn finish(&mut self) {
        self.segment(false, true);
        self.now_ns += 300_000_000;
        self.send(Input::Tick);
    }

    fn run(&mut self, feeds_mm_s: &[f64], repeats: usize) {
        self.segment(true, false);
        for _ in 0..repeats {
            for &feed in feeds_mm_s {
                self.touch(feed);
            }
        }
        self.finish();
    }

    fn latency(&self) -> ProbeLatency {
        let mut found = self.out.iter().filter_map(|out| match out {
            Output::Latency(latency) => Some(latency.clone()),
            _ => None,
        });
        found.next().unwrap_or_else(|| panic!("{:?}", self.out))
    }

    fn evaluation(&self) -> LatencyEvaluation {
        let mut found = self.out.iter().filter_map(|out| match out {
            Output::Evaluation(evaluation) => Some((**evaluation).clone()),
            _ => None,
        });
        found.next().unwrap()
    }

    fn refusals(&self) -> Vec<Refusal> {
        let refusals = self.out.iter().filter_map(|out| match out {
            Output::Refused(refusal) => Some(refusal.clone()),
            _ => None,
        });
        refusals.collect()
    }
}

#[test]
fn five_feeds_give_the_latency_the_surface_and_both_values() {
    let mut rig = Rig::new(8_370_000);
    rig.run(&FEEDS_MM_S, 3);
    let latency = rig.latency();
    assert_eq!(latency.method, LatencyMethod::WeightedLeastSquares);
    assert!((latency.latency_s - 0.008_37).abs() < 1e-8, "{latency:?}");
    assert!((latency.two_feed_latency_s - 0.008_37).abs() < 1e-8);
    assert!((latency.least_squares_latency_s - 0.008_37).abs() < 1e-8);
    // Ball centre at -23 along the approach, its radius of 3 mm in front of it.
    assert!(
        (latency.intercept_mm + 20.0).abs() < 1e-7,
        "{}",
        latency.intercept_mm
    );
    assert_eq!((latency.n, latency.negative), (15, false));
    for (found, feed) in latency.feeds_mm_s.iter().zip(FEEDS_MM_S) {
        assert!((found - feed).abs() < 1e-6, "from the log, not the program");
    }
    assert!(rig.refusals().is_empty() || latency.lack_of_fit_p < 0.01);
}

#[test]
fn two_feeds_use_the_published_method_in_its_single_and_multi_sample_form() {
    for (repeats, method) in [
        (1, LatencyMethod::TwoFeedSingle),
        (4, LatencyMethod::TwoFeedMulti),
    ] {
        let mut rig = Rig::new(8_370_000);
        rig.run(&[1.0, 10.0], repeats);
        let latency = rig.latency();
        assert_eq!(latency.method, method);
        assert!((latency.latency_s - 0.008_37).abs() < 1e-8);
        assert!(latency.least_squares_latency_s.is_nan() && latency.lack_of_fit_p.is_nan());
        // One touch a feed has the stated repeatability; four that are equal have no scatter and are
        // as good as the encoder's 0.05 µm.
        let u_mm = if repeats == 1 {
            0.0003
        } else {
            0.00005 / 12_f64.sqrt()
        };
        let u_s = 2_f64.sqrt() * u_mm / 9.0;
        assert!((latency.standard_uncertainty_s - u_s).abs() < 1e-8);
        let evaluation = rig.evaluation();
        assert!((evaluation.single_s - 0.008_37).abs() < 1e-8);
        assert!((evaluation.of_means_s - 0.008_37).abs() < 1e-8);
        assert!((evaluation.mean_of_norms_s - 0.008_37).abs() < 1e-8);
    }
}

#[test]
fn the_interval_of_the_whole_stage_holds_the_truth() {
    // Noise in the latched position, five feeds, two touches each: 200 whole calibrations.
    let mut held = 0;
    for seed in 0..200 {
        let mut rig = Rig::new(8_370_000);
        rig.scatter_mm = 0.0003;
        rig.rng = Pcg64Mcg::seed_from_u64(seed);
        rig.run(&FEEDS_MM_S, 2);
        let latency = rig.latency();
        let error_s = latency.latency_s - 0.008_37;
        held += u32::from(error_s.abs() <= 1.96 * latency.standard_uncertainty_s);
    }
    // 95 % of 200 within three standard deviations of a binomial.
    assert!((181..=199).contains(&held), "{held} of 200");
}

#[test]
fn the_interval_of_two_feeds_holds_the_truth_with_twice_the_stated_scatter() {
    let mut held = 0;
    for seed in 0..400 {
        let mut rig = Rig::new(8_370_000);
        rig.scatter_mm = 0.0006;
        rig.rng = Pcg64Mcg::seed_from_u64(seed);
        rig.run(&[2.0, 10.0], 3);
        let latency = rig.latency();
        assert_eq!(latency.method, LatencyMethod::TwoFeedMulti);
        let error_s = latency.latency_s - 0.008_37;
        held += u32::from(error_s.abs() <= 1.96 * latency.standard_uncertainty_s);
    }
    // 95 % of 400 within three standard deviations of a binomial.
    assert!((367..=393).contains(&held), "{held} of 400");
}

#[test]
fn a_latency_that_the_window_does_not_hold_is_not_published() {
    let mut rig = Rig::new(40_000_000);
    rig.run(&FEEDS_MM_S, 2);
    assert!(!rig.out.iter().any(|o| matches!(o, Output::Latency(_))));
    match &rig.refusals()[..] {
        [
            Refusal::WindowTooShort {
                latency_s,
                window_s,
                ..
            },
        ] => {
            assert!((latency_s - 0.040).abs() < 1e-6 && (window_s - 0.030).abs() < 1e-12);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_log_that_forgets_before_a_touch_is_read_is_refused_at_the_start() {
    let file = MachineFile::parse(BENCH, "bench.yaml").unwrap();
    let config = LatencyCalibratorConfig {
        log_samples: 200,
        ..LatencyCalibratorConfig::default()
    };
    let error = LatencyCalibratorStage::new(&config, &file).unwrap_err();
    assert_eq!(
        error.to_string(),
        "log_samples = 200 at control.servo_period_ms = 1: covers 200 ms, feed_window_ms + hold_ms need 230 ms"
    );
}

#[test]
fn a_negative_latency_is_flagged_though_the_norm_hides_it() {
    for feeds in [&[1.0, 10.0][..], &FEEDS_MM_S] {
        let mut rig = Rig::new(-3_000_000);
        rig.run(feeds, 2);
        let latency = rig.latency();
        assert!(latency.negative && (latency.latency_s + 0.003).abs() < 1e-8);
        assert!((latency.two_feed_latency_s - 0.003).abs() < 1e-8);
        assert!(matches!(rig.refusals()[..], [.., Refusal::Negative { .. }]));
    }
}

#[test]
fn a_touch_made_while_the_ball_still_accelerates_is_refused() {
    let mut rig = Rig::new(8_370_000);
    rig.segment(true, false);
    for feed in [1.0, 2.0, 4.0] {
        rig.touch(feed);
    }
    // 40 mm/s needs 2.7 mm at 300 mm/s²; the stand-off is 2 mm.
    rig.ramp = Some((300.0, 2.0));
    rig.touch(40.0);
    rig.finish();
    let refusals = rig.refusals();
    assert!(
        matches!(
            &refusals[0],
            Refusal::Touch {
                sequence: 4,
                fault: TouchFault::FeedNotSteady { .. },
                ..
            }
        ),
        "{refusals:?}"
    );
    let latency = rig.latency();
    assert_eq!(latency.n, 3);
    assert!((latency.latency_s - 0.008_37).abs() < 1e-8);
    // With room enough the same feed is used.
    let mut rig = Rig::new(8_370_000);
    rig.ramp = Some((300.0, 6.0));
    rig.run(&[2.0, 10.0, 40.0], 1);
    assert_eq!(rig.latency().n, 3);
    assert!((rig.latency().latency_s - 0.008_37).abs() < 1e-7);
}

#[test]
fn equal_feeds_and_single_touches_are_refused_with_their_values() {
    let mut rig = Rig::new(8_370_000);
    rig.run(&[5.0, 5.05], 3);
    let [refusal @ Refusal::EqualFeeds { .. }] = &rig.refusals()[..] else {
        panic!("{:?}", rig.refusals());
    };
    let text = refusal.to_string();
    assert_eq!(
        text,
        "block_1.z: feeds at contact from 5.0000 to 5.0500 mm/s are within 0.02 of each other: latency needs different feeds"
    );
    let mut rig = Rig::new(8_370_000);
    rig.run(&[5.0], 1);
    assert_eq!(
        rig.refusals()[0].to_string(),
        "block_1.z: 1 usable touches of 1, at least 2 are needed"
    );
    let mut rig = Rig::new(8_370_000);
    rig.run(&[], 0);
    assert_eq!(rig.refusals(), [Refusal::NothingTouched { run: 3 }]);
}

#[test]
fn a_feed_of_zero_and_a_feed_that_nobody_logged_are_refused() {
    let mut rig = Rig::new(8_370_000);
    rig.run(&[0.0, 1.0], 1);
    assert!(matches!(
        rig.refusals()[0],
        Refusal::Touch {
            fault: TouchFault::FeedNotPositive { .. },
            ..
        }
    ));
    let mut rig = Rig::new(8_370_000);
    rig.publishes = false;
    rig.run(&[1.0, 2.0], 1);
    assert!(matches!(
        rig.refusals()[0],
        Refusal::Touch {
            fault: TouchFault::FeedUnknown { n: 0, .. },
            ..
        }
    ));
    assert!(matches!(
        rig.refusals()[2],
        Refusal::TooFewTouches { n: 0, made: 2, .. }
    ));
}

#[test]
fn the_workpiece_frame_is_used_on_a_turned_table() {
    let mut rig = Rig::new(8_370_000);
    rig.rotary[Axis::A] = -0.5;
    rig.rotary[Axis::C] = 0.8;
    rig.run(&FEEDS_MM_S, 1);
    let latency = rig.latency();
    assert!((latency.latency_s - 0.008_37).abs() < 1e-8);
    // Plane at machine Z = 20 touched from above, about an A line through Z = 50 and C at zero.
    let about_a = Rotation3::from_axis_angle(&Vector3::x_axis(), -0.5);
    let origin = Vector3::new(0.0, 0.0, 50.0);
    let surface = Vector3::new(-214.0, -174.0, 20.0);
    let turned = about_a.inverse() * (surface - origin) + origin;
    let about_c = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.8);
    let on_workpiece = about_c.inverse() * turned;
    let approach = about_c.inverse() * (about_a.inverse() * -Vector3::z());
    assert!((latency.intercept_mm - on_workpiece.dot(&approach)).abs() < 1e-6);
}

#[test]
fn a_curve_over_feed_is_reported_as_lack_of_fit() {
    // Pretravel that grows with the square of the feed: 0.1 µm at 1 mm/s, 10 µm at 10 mm/s.
    let mut rig = Rig::new(8_370_000);
    rig.scatter_mm = 0.0002;
    rig.segment(true, false);
    for _ in 0..4 {
        for feed in FEEDS_MM_S {
            let deeper = Vector3::new(-214.0, -174.0, 23.0 - 1e-4 * feed * feed);
            rig.touch_at(deeper, -Vector3::z(), feed);
        }
    }
    rig.finish();
    assert!(rig.latency().lack_of_fit_p < 1e-4);
    assert!(matches!(rig.refusals()[..], [Refusal::LackOfFit { .. }]));
}

#[test]
fn other_approaches_numbers_that_are_none_and_broken_runs_are_refused() {
    let mut rig = Rig::new(8_370_000);
    rig.segment(true, false);
    rig.touch(1.0);
    rig.touch(4.0);
    rig.touch_at(Vector3::zeros(), Vector3::x(), 8.0);
    rig.finish();
    assert!(matches!(
        rig.refusals()[0],
        Refusal::Touch { sequence: 3, fault: TouchFault::OtherApproach { cosine }, .. } if cosine.abs() < 1e-9
    ));
    assert_eq!(rig.latency().n, 2);

    let mut rig = Rig::new(8_370_000);
    rig.segment(true, false);
    rig.touch_at(Vector3::repeat(f64::NAN), -Vector3::z(), 1.0);
    rig.finish();
    assert!(matches!(
        rig.refusals()[0],
        Refusal::Touch {
            fault: TouchFault::NotFinite,
            ..
        }
    ));

    let mut rig = Rig::new(8_370_000);
    rig.segment(true, false);
    rig.touch(1.0);
    rig.segment(false, false);
    rig.now_ns += 300_000_000;
    rig.send(Input::Tick);
    assert_eq!(rig.refusals(), [Refusal::NotCompleted { run: 3, made: 1 }]);
}

#[test]
fn time_that_goes_back_is_said_and_its_touches_are_not_used() {
    let mut rig = Rig::new(8_370_000);
    rig.segment(true, false);
    rig.touch(1.0);
    rig.touch(4.0);
    let mut lost = rig.stage.clone();
    let mut out = Vec::new();
    let state = AxisState {
        scale: PerAxis::default(),
        ..AxisState::standing(
            Stamp::from_nanos(0),
            Stamp::from_nanos(12),
            MachineFile::parse(BENCH, "bench.yaml").unwrap().axis_set(),
            PerAxis::default(),
        )
    };
    lost.step(Stamp::from_nanos(rig.now_ns), Input::State(state), &mut out)
        .unwrap();
    assert!(matches!(out[..], [Output::ClockWentBack { to, .. }] if to.nanos() == 12));
    // Feeds that were read before stay valid.
    rig.stage = lost;
    rig.finish();
    assert_eq!(rig.latency().n, 2);
}

#[test]
fn an_end_without_a_begin_is_said() {
    let mut rig = Rig::new(8_370_000);
    rig.touch(1.0);
    rig.finish();
    assert_eq!(rig.refusals(), [Refusal::NotBegun { run: 3 }]);
}

#[test]
fn a_machine_without_repeatability_is_refused() {
    let config = LatencyCalibratorConfig::default();
    for repeatability_um in [
        0.0,
        -0.3,
        1e-150,
        f64::MIN_POSITIVE,
        f64::NAN,
        f64::INFINITY,
        1e4,
    ] {
        let mut file = MachineFile::parse(BENCH, "bench.yaml").unwrap();
        file.probe.repeatability_um = repeatability_um;
        let error = LatencyCalibratorStage::new(&config, &file).unwrap_err();
        assert!(
            matches!(error, LatencyCalibratorError::NoRepeatability { .. }),
            "{repeatability_um}: {error}"
        );
        assert!(
            error.to_string().contains("from 0.001 to 1000 µm"),
            "{error}"
        );
    }
}

#[test]
fn snapshot_then_resume_equals_straight_run() {
    let mut rig = Rig::new(8_370_000);
    rig.segment(true, false);
    rig.touch(1.0);
    let (stage, now_ns, sequence) = (rig.stage.clone(), rig.now_ns, rig.sequence);
    let rest = |rig: &mut Rig| {
        rig.touch(4.0);
        rig.touch(9.0);
        rig.finish();
        rig.latency()
    };
    let straight = rest(&mut rig);
    let mut resumed = Rig::new(8_370_000);
    (resumed.stage, resumed.now_ns, resumed.sequence) = (stage, now_ns, sequence);
    assert_eq!(format!("{straight:?}"), format!("{:?}", rest(&mut resumed)));
}
