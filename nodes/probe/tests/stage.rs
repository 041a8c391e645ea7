//! The probe stage, driven by touches whose true contact is known.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use machine::{Kinematics, MachineFile};
use metrology::sample::{
    AxisState, BlockMeasurement, Correction, FeatureKind, LatencyMethod, ProbeLatency,
    ProbeTrigger, ProbedFeature, ProbedPoint, Rejection, Sense, TestKind, TestPlane, TestSegment,
};
use metrology::stamp::Span;
use metrology::{Axis, PerAxis, Stage, Stamp};
use nalgebra::Vector3;
use probe::queue::QueueMiss;
use probe::{Diagnostic, Input, Output, ProbeConfig, ProbeError, ProbeStage};

const BENCH: &str = include_str!("../../machine/tests/data/bench.yaml");
const BALL_MM: f64 = 3.0;
const LATENCY_S: f64 = 0.008_37;

fn bench() -> MachineFile {
    MachineFile::parse(BENCH, "bench.yaml").unwrap()
}

fn known_latency() -> ProbeConfig {
    ProbeConfig {
        latency_ms: Some(LATENCY_S * 1e3),
        latency_standard_uncertainty_ms: Some(0.025),
        ..ProbeConfig::default()
    }
}

/// A machine that moves in straight lines and a stage that watches it.
struct Rig {
    stage: ProbeStage,
    now_ns: i64,
    sequence: u32,
    out: Vec<Output>,
    /// Rotary positions, rad.
    rotary: PerAxis<f64>,
    /// Acceleration along the approach during a touch, mm/s².
    acceleration_mm_s2: f64,
    /// Whether the trigger arrives before the position at its stamp.
    trigger_first: bool,
    /// Changes a position before it is published.
    spoil: fn(&mut AxisState),
}

impl Rig {
    fn new(config: &ProbeConfig) -> Self {
        Self::with_file(config, &bench())
    }

    fn with_file(config: &ProbeConfig, file: &MachineFile) -> Self {
        Self {
            stage: ProbeStage::new(config, file).unwrap(),
            now_ns: 1_000_000_000,
            sequence: 0,
            out: Vec::new(),
            rotary: PerAxis::default(),
            acceleration_mm_s2: 0.0,
            trigger_first: false,
            spoil: |_| {},
        }
    }

    fn send(&mut self, input: Input) {
        let at = Stamp::from_nanos(self.now_ns);
        self.stage.step(at, input, &mut self.out).unwrap();
    }

    /// Lets time pass until everything that waits has been settled.
    fn settle(&mut self) {
        self.now_ns += 300_000_000;
        self.send(Input::Tick);
    }

    fn state(&self, ball_mm: &Vector3<f64>, at_ns: i64) -> AxisState {
        let mut motor = self.rotary;
        for axis in Axis::LINEAR {
            motor[axis] = ball_mm[axis.index()];
        }
        AxisState {
            received_at: Stamp::from_nanos(at_ns),
            controller_at: Stamp::from_nanos(at_ns),
            axes: bench().axis_set(),
            commanded: motor,
            motor,
            scale: PerAxis::from_fn(|_| f64::NAN),
            velocity: PerAxis::default(),
        }
    }

    /// Touches with the ball's centre at `contact_mm` at the true instant of contact.
    fn touch_ball(
        &mut self,
        feature: &str,
        contact_mm: Vector3<f64>,
        approach: Vector3<f64>,
        feed_mm_s: f64,
    ) -> ProbeTrigger {
        let contact_ns = self.now_ns + 60_000_456;
        let latch_ns = contact_ns + Span::from_secs_f64(LATENCY_S).nanos();
        let acceleration = self.acceleration_mm_s2;
        let at_instant = move |at_ns: i64| {
            let t_s = (at_ns - contact_ns) as f64 / 1e9;
            contact_mm + approach * (feed_mm_s * t_s + acceleration * t_s * t_s / 2.0)
        };
        self.sequence += 1;
        let trigger = ProbeTrigger {
            received_at: Stamp::from_nanos(latch_ns + 500_000),
            controller_at: Stamp::from_nanos(latch_ns),
            feature_id: feature.to_owned(),
            approach,
            feed_mm_s: feed_mm_s + acceleration * LATENCY_S,
            axes: bench().axis_set(),
            latched: self.state(&at_instant(latch_ns), latch_ns).motor,
            sequence: self.sequence,
        };
        let first_ns = self.now_ns;
        let mut sent = false;
        while self.now_ns < latch_ns + 5_000_000 {
            let due = if self.trigger_first {
                contact_ns - 2_000_000
            } else {
                latch_ns + 500_000
            };
            if !sent && self.now_ns >= due {
                self.send(Input::Trigger(trigger.clone()));
                sent = true;
            }
            let mut state = self.state(&at_instant(self.now_ns), self.now_ns);
            (self.spoil)(&mut state);
            self.send(Input::State(state));
            self.now_ns += 1_000_000;
        }
        assert!(sent && self.now_ns > first_ns);
        trigger
    }

    /// Touches a surface point.
    fn touch(&mut self, feature: &str, point_mm: Vector3<f64>, approach: Vector3<f64>, feed: f64) {
        self.touch_ball(feature, point_mm - approach * BALL_MM, approach, feed);
    }

    fn segment(&mut self, kind: TestKind, begin: bool, features: &[&str]) {
        let segment = TestSegment {
            at: Stamp::from_nanos(self.now_ns),
            run: 7,
            begin,
            kind,
            plane: TestPlane::None,
            centre_mm: Vector3::zeros(),
            radius_mm: 0.0,
            feed_mm_s: 2.0,
            sense: Sense::None,
            repeat: 0,
            stylus: String::from("ruby_6"),
            zero_id: 0,
            setup_id: 0,
            cold: true,
            features: features.iter().map(|&name| name.to_owned()).collect(),
            completed: !begin,
        };
        self.send(Input::Segment(segment));
    }

    fn points(&self) -> Vec<ProbedPoint> {
        let points = self.out.iter().filter_map(|out| match out {
            Output::Point(point) => Some(point.clone()),
            _ => None,
        });
        points.collect()
    }

    fn only_point(&self) -> ProbedPoint {
        let [point] = &self.points()[..] else {
            panic!("{:?}", self.out);
        };
        point.clone()
    }

    fn blocks(&self) -> Vec<BlockMeasurement> {
        let blocks = self.out.iter().filter_map(|out| match out {
            Output::Block(block) => Some(block.clone()),
            _ => None,
        });
        blocks.collect()
    }

    fn feature(&self) -> ProbedFeature {
        let mut features = self.out.iter().filter_map(|out| match out {
            Output::Feature(feature) => Some(feature.clone()),
            _ => None,
        });
        features.next().unwrap_or_else(|| panic!("{:?}", self.out))
    }

    fn diagnostics(&self) -> Vec<String> {
        let texts = self.out.iter().filter_map(|out| match out {
            Output::Diagnostic(diagnostic) => Some(diagnostic.to_string()),
            _ => None,
        });
        texts.collect()
    }
}

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
fn three_faces_make_a_block_with_repeats_averaged() {
    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Block, true, &["block_1"]);
    let drift = [0.012, -0.007, 0.020];
    let corner = Vector3::new(-220.0, -180.0, 20.0) + Vector3::from(drift);
    let faces = [
        ("x", Vector3::x()),
        ("y", Vector3::y()),
        ("z", -Vector3::z()),
    ];
    for (letter, approach) in faces {
        for shift_mm in [-0.001, 0.001] {
            let point = corner + approach * shift_mm;
            rig.touch(&format!("block_1.{letter}"), point, approach, 2.0);
        }
    }
    rig.segment(TestKind::Block, false, &["block_1"]);
    assert!(rig.blocks().is_empty(), "the last touch may come late");
    rig.settle();
    let block = &rig.blocks()[0];
    assert!(block.cold && block.run == 7 && block.block_id == "block_1");
    for axis in Axis::LINEAR {
        let face = block.faces[axis].unwrap();
        assert!(
            (face.position_mm - corner[axis.index()]).abs() < 1e-9,
            "{axis}"
        );
        let u_mm = (0.0003 / 2_f64.sqrt()).hypot(2.0 * 25e-6);
        assert!((face.standard_uncertainty_mm - u_mm).abs() < 1e-12);
    }
    assert_eq!(block.at, rig.points()[5].received_at);
    assert!(rig.diagnostics().is_empty());
}

#[test]
fn a_face_that_was_not_touched_is_unknown_and_named() {
    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Block, true, &["block_1", "block_2"]);
    rig.touch(
        "block_1.x",
        Vector3::new(-220.0, 0.0, 0.0),
        Vector3::x(),
        2.0,
    );
    rig.touch(
        "block_1.y",
        Vector3::new(0.0, -180.0, 0.0),
        Vector3::x(),
        2.0,
    );
    rig.segment(TestKind::Block, false, &[]);
    rig.settle();
    let blocks = rig.blocks();
    assert_eq!(blocks.len(), 2);
    assert!(blocks[0].faces[Axis::X].is_some());
    assert!(blocks[0].faces[Axis::Y].is_none() && blocks[0].faces[Axis::Z].is_none());
    assert!(
        Axis::LINEAR
            .iter()
            .all(|axis| blocks[1].faces[*axis].is_none())
    );
    let said = rig.diagnostics();
    assert_eq!(
        said[0],
        "run 7: touch 2 of face Y of block block_1 came along [1.0000, 0.0000, 0.0000], not along its normal"
    );
    assert_eq!(
        said[2],
        "run 7: face Z of block block_1 was not measured, 0 touches rejected"
    );
    assert_eq!(said.len(), 6);
}

#[test]
fn a_touch_that_comes_after_the_end_of_its_segment_still_counts() {
    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Block, true, &["block_1"]);
    rig.touch(
        "block_1.x",
        Vector3::new(-220.0, 0.0, 0.0),
        Vector3::x(),
        2.0,
    );
    rig.touch(
        "block_1.y",
        Vector3::new(0.0, -180.0, 0.0),
        Vector3::y(),
        2.0,
    );
    rig.segment(TestKind::Block, false, &["block_1"]);
    rig.touch(
        "block_1.z",
        Vector3::new(0.0, 0.0, 20.0),
        -Vector3::z(),
        2.0,
    );
    rig.settle();
    assert!(rig.blocks()[0].faces[Axis::Z].is_some());
    assert!(rig.diagnostics().is_empty());
}

#[test]
fn a_sphere_a_ring_and_a_pin_have_their_centres_and_radii() {
    let centre = Vector3::new(60.01, -39.98, 90.005);
    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Sphere, true, &["ball"]);
    let normals = [
        Vector3::z(),
        Vector3::x(),
        Vector3::y(),
        -Vector3::x(),
        -Vector3::y(),
    ];
    for (k, normal) in normals.into_iter().enumerate() {
        // Touched along the nominal normal: the ball meets a sphere of 12.502 + 3 mm.
        let from = centre + normal * 15.502;
        rig.touch_ball(&format!("ball.{}", k + 1), from, -normal, 3.0);
    }
    rig.segment(TestKind::Sphere, false, &["ball"]);
    rig.settle();
    let sphere = rig.feature();
    assert_eq!(
        (sphere.kind, sphere.n, sphere.run),
        (FeatureKind::Sphere, 5, 7)
    );
    assert!((sphere.centre_mm - centre).norm() < 1e-8);
    assert!((sphere.radius_mm - 12.502).abs() < 1e-8 && sphere.form_mm < 1e-8);
    let u_mm = (0.0003_f64 / 2.0).hypot(3.0 * 25e-6);
    assert!((sphere.radius_standard_uncertainty_mm - u_mm).abs() < 1e-9);
    assert!((sphere.centre_covariance_mm2[(0, 0)] - 0.0003_f64.powi(2) / 2.0).abs() < 1e-15);

    for (kind, name, sign, offset_mm) in [("ring", "ring", 1.0, -3.0), ("pin", "pin", -1.0, 3.0)] {
        let mut rig = Rig::new(&known_latency());
        rig.segment(TestKind::Bore, true, &[name]);
        for k in 0..6 {
            let angle = f64::from(k) * 1.047_197_551_196_597_6;
            let radial = Vector3::new(angle.cos(), angle.sin(), 0.0);
            let ball = Vector3::new(1.0, 2.0, 40.0) + radial * (20.003 + offset_mm);
            rig.touch_ball(&format!("{name}.{}", k + 1), ball, radial * sign, 3.0);
        }
        rig.segment(TestKind::Bore, false, &[name]);
        rig.settle();
        let round = rig.feature();
        assert!(
            (round.radius_mm - 20.003).abs() < 1e-8,
            "{kind} {}",
            round.radius_mm
        );
        assert!((round.centre_mm - Vector3::new(1.0, 2.0, 40.0)).norm() < 1e-8);
        assert_eq!(round.normal, Vector3::z());
    }
}

#[test]
fn a_tilted_plane_has_its_normal_and_too_few_points_have_none() {
    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Plane, true, &["top"]);
    let slope = 1e-4;
    for (k, (x, y)) in [(-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)]
        .into_iter()
        .enumerate()
    {
        let point = Vector3::new(x, y, 10.0 + slope * x);
        rig.touch(&format!("top.{}", k + 1), point, -Vector3::z(), 2.0);
    }
    rig.segment(TestKind::Plane, false, &["top"]);
    rig.settle();
    let plane = rig.feature();
    assert!((plane.normal.x + slope).abs() < 1e-9 && plane.normal.z > 0.0);
    assert!((plane.centre_mm.z - 10.0).abs() < 1e-9 && plane.radius_mm.is_nan());

    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Plane, true, &["top", "nothing"]);
    rig.touch("top.1", Vector3::new(0.0, 0.0, 10.0), -Vector3::z(), 2.0);
    rig.segment(TestKind::Plane, false, &["top"]);
    rig.settle();
    assert_eq!(
        rig.diagnostics(),
        [
            "run 7: top not evaluated, 0 points rejected: 1 points were given: a plane needs at least 3",
            "run 7: the machine file has no feature \"nothing\"",
        ]
    );
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
fn lost_touches_and_unmatched_segments_are_reported() {
    let mut rig = Rig::new(&known_latency());
    rig.touch("top.1", Vector3::zeros(), -Vector3::z(), 5.0);
    rig.sequence = 4;
    rig.touch("top.1", Vector3::zeros(), -Vector3::z(), 5.0);
    rig.segment(TestKind::Block, false, &[]);
    rig.settle();
    rig.segment(TestKind::Block, true, &[]);
    rig.segment(TestKind::Block, true, &[]);
    assert_eq!(
        rig.diagnostics(),
        [
            "touches between 1 and 5 did not arrive",
            "run 7 ended, but its begin was not seen; it is not evaluated",
            "run 7 did not end before run 7 began; it is not evaluated",
        ]
    );
}

#[test]
fn snapshot_then_resume_equals_straight_run() {
    let mut rig = Rig::new(&known_latency());
    rig.segment(TestKind::Block, true, &["block_1"]);
    rig.touch(
        "block_1.x",
        Vector3::new(-220.0, 0.0, 0.0),
        Vector3::x(),
        2.0,
    );
    let (stage, now_ns, sequence) = (rig.stage.clone(), rig.now_ns, rig.sequence);
    let finish = |rig: &mut Rig| {
        rig.out.clear();
        rig.touch(
            "block_1.y",
            Vector3::new(0.0, -180.0, 0.0),
            Vector3::y(),
            2.0,
        );
        rig.segment(TestKind::Block, false, &["block_1"]);
        rig.settle();
    };
    finish(&mut rig);
    let mut resumed = Rig::new(&known_latency());
    (resumed.stage, resumed.now_ns, resumed.sequence) = (stage, now_ns, sequence);
    finish(&mut resumed);
    assert_eq!(format!("{:?}", rig.out), format!("{:?}", resumed.out));
    assert_eq!(rig.blocks().len(), 1);
}
