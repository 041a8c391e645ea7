//! The stage: runs, spheres that are missing or others', poses that cannot be.

use machine::poses::{ReachLimits, calibration_poses, verification_poses};
use metrology::sample::{FeatureKind, GeometryModel, ProbedFeature, TestKind, TestSegment};
use metrology::{Axis, PerAxis, Stage, Stamp};
use nalgebra::{Matrix3, Vector3};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rotary_axes::verification::Verification;
use rotary_axes::{Input, Output, RotaryAxesConfig, RotaryAxesStage};

use crate::bench::{BALL_MM, Wrong, file, visit};

pub struct Rig {
    stage: RotaryAxesStage,
    now_ns: i64,
    run: u32,
    setup_id: u32,
    /// Whether each sphere is told twice.
    tells_again: bool,
    pub out: Vec<Output>,
}

impl Rig {
    pub fn new() -> Self {
        Self {
            stage: RotaryAxesStage::new(&RotaryAxesConfig::default(), &file()).unwrap(),
            now_ns: 1_000_000_000,
            run: 0,
            setup_id: 1,
            tells_again: false,
            out: Vec::new(),
        }
    }

    fn send(&mut self, input: Input) {
        let at = Stamp::from_nanos(self.now_ns);
        self.stage.step(at, input, &mut self.out).unwrap();
    }

    fn segment(&mut self, kind: TestKind, begin: bool, completed: bool, sphere: &str) {
        self.send(Input::Segment(TestSegment {
            begin,
            feed_mm_s: 2.0,
            stylus: String::from("ruby_6"),
            setup_id: self.setup_id,
            features: vec![sphere.to_owned()],
            completed,
            ..TestSegment::of_kind(kind, self.run, Stamp::from_nanos(self.now_ns))
        }));
    }

    fn feature(&self, sphere: &str, pose: &PerAxis<f64>, centre_mm: Vector3<f64>) -> ProbedFeature {
        ProbedFeature {
            at: Stamp::from_nanos(self.now_ns),
            feature_id: sphere.to_owned(),
            kind: FeatureKind::Sphere,
            centre_mm,
            centre_covariance_mm2: Matrix3::identity() * 0.0005_f64.powi(2),
            normal: Vector3::zeros(),
            normal_standard_uncertainty_rad: f64::NAN,
            radius_mm: 12.5,
            radius_standard_uncertainty_mm: 0.0003,
            form_mm: 0.001,
            n: 6,
            n_rejected: 0,
            run: self.run,
            rotary_axes: [Axis::A, Axis::C].into_iter().collect(),
            rotary_rad: *pose,
        }
    }

    /// A whole test; `change` may spoil or drop each feature.
    pub fn test(
        &mut self,
        kind: TestKind,
        wrong: &Wrong,
        poses: &[PerAxis<f64>],
        change: impl Fn(usize, &mut ProbedFeature) -> bool,
    ) {
        self.run += 1;
        let mut rng = Pcg64Mcg::seed_from_u64(u64::from(self.run));
        self.segment(kind, true, false, "ball");
        for (k, pose) in poses.iter().enumerate() {
            self.now_ns += 20_000_000_000;
            let seen = visit("ball", &BALL_MM, wrong, pose, (0.0005, &mut rng));
            let mut feature = self.feature("ball", pose, seen.centre_mm);
            if change(k, &mut feature) {
                for _ in 0..=u32::from(self.tells_again) {
                    self.send(Input::Feature(feature.clone()));
                }
            }
        }
        self.segment(kind, false, true, "ball");
        self.settle();
    }

    fn settle(&mut self) {
        self.now_ns += 2_000_000_000;
        self.send(Input::Tick);
    }

    pub fn said(&self) -> Vec<String> {
        let said = self.out.iter().filter_map(|out| match out {
            Output::Diagnostic(condition) => {
                Some(format!("{}: {condition}", condition.condition()))
            }
            _ => None,
        });
        said.collect()
    }

    pub fn models(&self) -> Vec<GeometryModel> {
        let models = self.out.iter().filter_map(|out| match out {
            Output::Model(model) => Some(model.clone()),
            _ => None,
        });
        models.collect()
    }

    fn verifications(&self) -> Vec<Verification> {
        let all = self.out.iter().filter_map(|out| match out {
            Output::Verification(verification) => Some((**verification).clone()),
            _ => None,
        });
        all.collect()
    }

    #[track_caller]
    pub fn expect(&self, words: &[&str]) {
        let said = self.said();
        let fits = |line: &&String| words.iter().all(|word| line.contains(word));
        assert!(
            said.iter().any(|line| fits(&line)),
            "{words:?} in {said:#?}"
        );
    }
}

pub fn good_poses(n: usize) -> Vec<PerAxis<f64>> {
    calibration_poses(&file(), "ball", n, &ReachLimits::default()).unwrap()
}

#[test]
fn a_test_gives_a_model_and_a_verification_judges_it() {
    let wrong = Wrong::drawn(3);
    let poses = good_poses(12);
    let others = verification_poses(&file(), "ball", 6, &poses, &ReachLimits::default()).unwrap();
    let mut rig = Rig::new();
    rig.test(TestKind::Rotary, &wrong, &poses, |_, _| true);
    assert_eq!(rig.models().len(), 1);
    rig.expect(&["calibrated: run 1: 12 visits of 1 sphere,"]);
    rig.test(TestKind::RotaryVerification, &wrong, &others, |_, _| true);
    let [verified] = &rig.verifications()[..] else {
        panic!("{:?}", rig.said());
    };
    assert!(verified.same_places);
    assert!(
        verified.rms_before_mm > 10.0 * verified.rms_after_mm,
        "{}",
        rig.said().join("\n")
    );
    assert_eq!(rig.models().len(), 1, "a verification changes no model");
}

#[test]
fn the_next_run_may_begin_before_the_last_sphere_of_this_one_arrives() {
    let wrong = Wrong::drawn(3);
    let poses = good_poses(12);
    let mut rig = Rig::new();
    rig.run = 1;
    rig.segment(TestKind::Rotary, true, false, "ball");
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let features: Vec<_> = poses
        .iter()
        .map(|pose| {
            let seen = visit("ball", &BALL_MM, &wrong, pose, (0.0005, &mut rng));
            rig.feature("ball", pose, seen.centre_mm)
        })
        .collect();
    rig.segment(TestKind::Rotary, false, true, "ball");
    rig.run = 2;
    rig.segment(TestKind::RotaryVerification, true, false, "ball");
    for feature in features {
        rig.send(Input::Feature(feature));
    }
    rig.settle();
    assert_eq!(rig.models().len(), 1, "{:?}", rig.said());
}

#[test]
fn too_few_poses_are_refused_with_what_is_needed() {
    let mut rig = Rig::new();
    rig.test(
        TestKind::Rotary,
        &Wrong::default(),
        &good_poses(12)[..3],
        |_, _| true,
    );
    rig.expect(&["not_estimated", "3 visits of 1 spheres", "at least 4"]);
    assert!(rig.models().is_empty());
    rig.test(
        TestKind::RotaryVerification,
        &Wrong::default(),
        &good_poses(4),
        |_, _| true,
    );
    rig.expect(&["nothing_to_verify: run 2"]);
}

#[test]
fn a_sphere_that_is_missing_at_a_pose_is_named_with_the_pose() {
    let poses = good_poses(12);
    let twice: Vec<_> = poses.iter().chain(&poses).copied().collect();
    let mut rig = Rig::new();
    rig.test(TestKind::Rotary, &Wrong::drawn(1), &twice, |k, _| k != 5);
    let (a, c) = (
        poses[5][Axis::A].to_degrees(),
        poses[5][Axis::C].to_degrees(),
    );
    let place = format!("A {a:.2} deg, C {c:.2} deg");
    rig.expect(&["visit_missing", &place, "found 1 times, 2 times elsewhere"]);
    assert_eq!(rig.models().len(), 1, "the others suffice");
}

#[test]
fn a_visit_that_is_off_is_left_out_and_named() {
    let wrong = Wrong::drawn(2);
    let poses = good_poses(14);
    let mut rig = Rig::new();
    rig.test(TestKind::Rotary, &wrong, &poses, |k, feature| {
        if k == 4 {
            feature.centre_mm.x += 0.02;
        }
        true
    });
    rig.expect(&["doubtful_visit", "µm off, which chance does not explain"]);
    let doubtful = rig
        .said()
        .iter()
        .filter(|line| line.starts_with("doubtful"))
        .count();
    assert_eq!(doubtful, 1, "{:?}", rig.said());
    let model = &rig.models()[0];
    for (name, truth) in wrong.values() {
        let curve = model
            .curves
            .iter()
            .find(|c| c.component.to_string() == name)
            .unwrap();
        let off = (curve.coefficient[0] - truth).abs();
        assert!(off < 4.0 * curve.standard_uncertainty[0], "{name}");
    }
}

#[test]
fn bad_features_are_named_and_spoil_nothing_else() {
    let poses = good_poses(14);
    let mut rig = Rig::new();
    rig.test(TestKind::Rotary, &Wrong::drawn(9), &poses, |k, feature| {
        match k {
            0 => feature.centre_mm.y = f64::NAN,
            1 => feature.feature_id = "low".to_owned(),
            2 => feature.rotary_rad[Axis::A] = 31.0_f64.to_radians(),
            3 => feature.centre_covariance_mm2 = Matrix3::zeros(),
            4 => feature.feature_id = "nobody".to_owned(),
            5 => feature.run = 99,
            _ => {}
        }
        true
    });
    rig.expect(&["not_finite: run 1: centre, covariance or pose of sphere ball"]);
    rig.expect(&["other_sphere: run 1: sphere low"]);
    rig.expect(&[
        "outside_travel: run 1",
        "axis A at 31.0000 deg, travel is [-120, 30] deg",
    ]);
    rig.expect(&["unknown_sphere: run 1", "\"nobody\""]);
    rig.expect(&["calibrated: run 1: 8 visits"]);
}

#[test]
fn a_feature_without_an_axis_breaks_the_contract() {
    let mut rig = Rig::new();
    rig.run = 1;
    rig.segment(TestKind::Rotary, true, false, "ball");
    let mut feature = rig.feature("ball", &good_poses(4)[0], BALL_MM);
    feature.rotary_axes = [Axis::A].into_iter().collect();
    let at = Stamp::from_nanos(rig.now_ns);
    let error = rig
        .stage
        .step(at, Input::Feature(feature), &mut rig.out)
        .unwrap_err();
    assert_eq!(
        error.to_string(),
        "run 1: sphere ball does not say where axis C was"
    );
}

#[test]
fn tests_that_do_not_end_as_they_should_are_not_evaluated() {
    let mut rig = Rig::new();
    rig.run = 1;
    rig.segment(TestKind::Rotary, true, false, "ball");
    rig.run = 2;
    rig.segment(TestKind::Rotary, true, false, "ball");
    rig.expect(&["not_bracketed: run 1"]);
    rig.segment(TestKind::Rotary, false, false, "ball");
    rig.settle();
    rig.expect(&["not_completed: run 2"]);
    rig.run = 3;
    rig.segment(TestKind::Rotary, false, true, "ball");
    rig.expect(&["not_bracketed: run 3"]);
}

#[test]
fn another_set_up_begins_anew() {
    let (wrong, poses) = (Wrong::drawn(6), good_poses(12));
    let mut rig = Rig::new();
    rig.test(TestKind::Rotary, &wrong, &poses, |_, _| true);
    rig.setup_id = 2;
    rig.test(TestKind::RotaryVerification, &wrong, &poses[..6], |_, _| {
        true
    });
    assert!(!rig.verifications()[0].same_places);
    rig.test(TestKind::Rotary, &wrong, &poses, |_, _| true);
    assert_eq!(rig.models().len(), 2);
    assert_eq!(rig.models()[1].n_samples, 12);
}

/// Spheres come on one topic and segments on another: nothing orders the two.
#[test]
fn spheres_that_overtake_the_begin_of_their_run_are_its_visits() {
    let poses = good_poses(12);
    let told = |overtaking: usize| {
        let (mut rig, wrong) = (Rig::new(), Wrong::drawn(3));
        let mut random = Pcg64Mcg::seed_from_u64(1);
        rig.run = 1;
        for (place, pose) in poses.iter().enumerate() {
            if place == overtaking {
                rig.segment(TestKind::Rotary, true, false, "ball");
            }
            let seen = visit("ball", &BALL_MM, &wrong, pose, (0.0005, &mut random));
            let feature = rig.feature("ball", pose, seen.centre_mm);
            rig.send(Input::Feature(feature));
        }
        rig.segment(TestKind::Rotary, false, true, "ball");
        rig.settle();
        rig
    };
    let in_order = told(0);
    assert_eq!(in_order.models().len(), 1);
    for overtaking in [1, 5, 11] {
        let mut rig = told(overtaking);
        assert_eq!(models_of(&rig), models_of(&in_order), "{overtaking}");
        // One that was found in the run and comes when all is over is told of.
        let mut late = rig.feature("ball", &poses[0], BALL_MM);
        late.at = Stamp::from_nanos(1_000_000_000);
        rig.send(Input::Feature(late));
        rig.expect(&["too_late: run 1: a visit of sphere ball came after"]);
        // One of a later run of the same number, of a sequencer that was started again, waits for its begin.
        rig.now_ns += 60_000_000_000;
        rig.out.clear();
        let next = rig.feature("ball", &poses[0], BALL_MM);
        rig.send(Input::Feature(next));
        assert_eq!(rig.said(), [""; 0]);
    }
}

/// In words: what is not known is NaN, which equals nothing.
fn models_of(rig: &Rig) -> String {
    format!("{:?}", rig.models())
}

#[test]
fn a_sphere_that_is_told_again_counts_once() {
    let told = |again: bool| {
        let mut rig = Rig::new();
        rig.tells_again = again;
        rig.test(
            TestKind::Rotary,
            &Wrong::drawn(3),
            &good_poses(12),
            |_, _| true,
        );
        rig
    };
    let (once, again) = (told(false), told(true));
    assert_eq!(models_of(&once), models_of(&again));
    assert_eq!(once.models().len(), 1);
    again.expect(&["told_before: run 1: sphere ball"]);
}

#[test]
fn a_sphere_of_an_hour_ago_is_none_of_a_run_of_the_same_number() {
    let told = |stale: bool| {
        let mut rig = Rig::new();
        rig.now_ns += 4_000_000_000_000;
        let (wrong, poses) = (Wrong::drawn(3), good_poses(12));
        rig.test(TestKind::Rotary, &wrong, &poses, |k, feature| {
            if stale && k == 11 {
                feature.at = Stamp::from_nanos(feature.at.nanos() - 3_600_000_000_000);
                feature.centre_mm.x += 0.1;
            }
            stale || k < 11
        });
        rig
    };
    let (without, stale) = (told(false), told(true));
    assert_eq!(models_of(&without), models_of(&stale));
    stale.expect(&["of_another_time: run 1: sphere ball", "3360.0 s before"]);
}

#[test]
fn a_sphere_of_an_hour_ago_that_arrives_before_the_begin_is_reported_too() {
    let mut rig = Rig::new();
    rig.now_ns += 4_000_000_000_000;
    rig.run = 1;
    let poses = good_poses(12);
    let mut stale = rig.feature("ball", &poses[0], BALL_MM);
    stale.at = Stamp::from_nanos(stale.at.nanos() - 3_600_000_000_000);
    rig.send(Input::Feature(stale));
    assert_eq!(rig.said(), [""; 0]);
    rig.segment(TestKind::Rotary, true, false, "ball");
    rig.expect(&["of_another_time: run 1: sphere ball"]);
}
