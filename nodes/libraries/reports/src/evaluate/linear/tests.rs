use super::*;
use metrology::{AxisSet, PerAxis};

const TICK_NANOS: i64 = 10_000_000;

fn segment(run: u32, repeat: u32, begin: bool, kind: TestKind, features: &[&str]) -> TestSegment {
    TestSegment {
        begin,
        feed_mm_s: 10.0,
        repeat,
        zero_id: 1,
        setup_id: 1,
        features: features.iter().map(|name| (*name).to_owned()).collect(),
        completed: !begin,
        ..TestSegment::of_kind(kind, run, Stamp::from_nanos(0))
    }
}

struct Machine {
    runs: LinearRuns,
    nanos: i64,
    place_mm: Vector3<f64>,
}

impl Machine {
    fn new() -> Self {
        Self {
            runs: LinearRuns::default(),
            nanos: 0,
            place_mm: Vector3::new(-1.0, 0.0, 0.0),
        }
    }

    fn tick(&mut self, place_mm: Vector3<f64>, displacement_mm: Option<f64>) {
        self.nanos += TICK_NANOS;
        let at = Stamp::from_nanos(self.nanos);
        let mut commanded = PerAxis::default();
        for axis in Axis::LINEAR {
            commanded[axis] = place_mm[axis.index()];
        }
        self.runs.axes(&AxisState::standing(
            at,
            Stamp::from_nanos(self.nanos),
            AxisSet::XYZ,
            commanded,
        ));
        if let Some(displacement_mm) = displacement_mm {
            self.runs.length(&LengthSample {
                at,
                axis: Axis::X,
                displacement_mm,
                zero_id: 1,
            });
        }
    }

    /// Goes there, passing two places on the way, and rests for `rest` ticks.
    fn go(&mut self, to_mm: Vector3<f64>, rest: usize, error: impl Fn(f64, bool) -> f64) {
        let from_mm = self.place_mm;
        for share in [0.3, 0.7] {
            self.tick(from_mm + (to_mm - from_mm) * share, Some(0.0));
        }
        let upwards = to_mm.sum() > from_mm.sum();
        for tick in 0..rest {
            // While it settles the reading is far off.
            let wild_mm = if tick < 25 { 0.5 } else { 0.0 };
            let along_mm = to_mm.norm() * to_mm.sum().signum();
            self.tick(to_mm, Some(along_mm + error(along_mm, upwards) + wild_mm));
        }
        self.place_mm = to_mm;
    }
}

#[test]
fn targets_are_what_every_run_approached_from_both_sides_and_overruns_are_none() {
    let error = |x_mm: f64, upwards: bool| 1e-5 * x_mm + if upwards { -0.001 } else { 0.001 };
    let mut machine = Machine::new();
    for repeat in 0..3 {
        let run = 4 + repeat;
        let features = ["X", "beam_x"];
        let begin = segment(run, repeat, true, TestKind::Positioning, &features);
        machine.runs.segment(&begin);
        let there = [10.0, 20.0, 30.0].map(|x| Vector3::new(x, 0.0, 0.0));
        machine.go(Vector3::new(5.0, 0.0, 0.0), 2, error);
        for place in there {
            machine.go(place, 60, error);
        }
        machine.go(Vector3::new(35.0, 0.0, 0.0), 2, error);
        for place in there.into_iter().rev() {
            machine.go(place, 60, error);
        }
        machine.go(Vector3::new(5.0, 0.0, 0.0), 2, error);
        let end = segment(run, repeat, false, TestKind::Positioning, &features);
        machine.runs.segment(&end);
    }
    let tests = machine.runs.tests();
    assert_eq!(tests.len(), 1);
    let test = &tests[0];
    assert_eq!(
        (test.axis, test.first_run, test.reference),
        (Some(Axis::X), 4, Reference::Length)
    );
    assert_eq!(test.targets_mm, [10.0, 20.0, 30.0]);
    assert_eq!(test.direction, Vector3::x());
    assert_eq!((test.up_mm.len(), test.down_mm.len()), (3, 3));
    for run in 0..3 {
        for (place, x_mm) in [10.0, 20.0, 30.0].into_iter().enumerate() {
            let slope = 1e-5 * (x_mm - 20.0);
            assert!(
                (test.up_mm[run][place] - slope + 0.001).abs() < 1e-9,
                "{test:?}"
            );
            assert!(
                (test.down_mm[run][place] - slope - 0.001).abs() < 1e-9,
                "{test:?}"
            );
        }
    }
}

#[test]
fn stops_shorter_than_the_settling_are_told_with_how_long_they_were() {
    for (kind, features) in [
        (TestKind::Positioning, &["X"][..]),
        (TestKind::Diagonal, &["diagonal"]),
    ] {
        let mut machine = Machine::new();
        let begin = segment(1, 0, true, kind, features);
        machine.runs.segment(&begin);
        // It stands for a second before and behind, and for 0.2 s at each stop.
        let home_mm = machine.place_mm;
        for _ in 0..100 {
            machine.tick(home_mm, Some(0.0));
        }
        for x_mm in [10.0, 20.0, 35.0, 20.0, 10.0] {
            machine.go(Vector3::new(x_mm, 0.0, 0.0), 20, |_, _| 0.0);
        }
        machine.go(home_mm, 100, |_, _| 0.0);
        let end = segment(1, 0, false, kind, features);
        machine.runs.segment(&end);
        let tests = machine.runs.tests();
        assert_eq!(tests[0].targets_mm, [0.0; 0], "{kind:?}");
        let rest_s = tests[0].longest_rest.unwrap().as_secs_f64();
        assert!((rest_s - 0.19).abs() < 1e-9, "{kind:?}: {rest_s}");
    }
}

fn tests_of(ways: &[&[f64]]) -> Vec<LinearTest> {
    let mut machine = Machine::new();
    for (repeat, places) in (0_u32..).zip(ways) {
        let begin = segment(repeat + 1, repeat, true, TestKind::Positioning, &["X"]);
        machine.runs.segment(&begin);
        for x_mm in *places {
            // A place that is only passed has no rest.
            let rest = if x_mm.fract() == 0.0 { 60 } else { 2 };
            machine.go(Vector3::new(*x_mm, 0.0, 0.0), rest, |_, _| 0.0);
        }
        let end = segment(repeat + 1, repeat, false, TestKind::Positioning, &["X"]);
        machine.runs.segment(&end);
    }
    machine.runs.tests()
}

#[test]
fn targets_that_were_approached_from_one_side_alone_are_targets_of_that_side() {
    for (ways, up) in [
        (&[5.5, 10.0, 20.0, 30.0][..], true),
        (&[35.5, 30.0, 20.0, 10.0], false),
    ] {
        let tests = tests_of(&[ways, ways, ways]);
        assert_eq!(tests[0].targets_mm, [10.0, 20.0, 30.0]);
        let (has, lacks) = (&tests[0].up_mm, &tests[0].down_mm);
        let (has, lacks) = if up { (has, lacks) } else { (lacks, has) };
        assert_eq!((has.len(), lacks.len()), (3, 0));
        assert_eq!(tests[0].left_out, [""; 0]);
    }
}

#[test]
fn a_target_that_a_run_lacks_or_has_twice_is_named_with_the_run() {
    let whole = &[5.5, 10.0, 20.0, 30.0, 35.5, 30.0, 20.0, 10.0][..];
    let lacks = &[5.5, 10.0, 20.5, 30.0, 35.5, 30.0, 20.0, 10.0];
    let tests = tests_of(&[whole, lacks, whole]);
    assert_eq!(tests[0].targets_mm, [10.0, 30.0]);
    assert_eq!(tests[0].left_out, ["20.000 mm: run 2 has no reading up"]);
    let twice = &[5.5, 10.0, 20.0, 19.5, 20.0, 30.0, 35.5, 30.0, 20.0, 10.0];
    let tests = tests_of(&[whole, whole, twice]);
    assert_eq!(tests[0].left_out, ["20.000 mm: run 3 has 2 readings up"]);
    let one_sided = &[5.5, 10.0, 20.0, 30.0][..];
    let tests = tests_of(&[one_sided, one_sided, &[5.5, 10.0, 30.0]]);
    assert_eq!(tests[0].targets_mm, [10.0, 30.0]);
    assert_eq!(tests[0].left_out, ["20.000 mm: run 3 has no reading up"]);
}

#[test]
fn a_run_that_was_broken_off_is_left_out_whole_and_takes_no_target_from_the_others() {
    let whole = &[5.5, 10.0, 20.0, 30.0, 35.5, 30.0, 20.0, 10.0][..];
    for (broken_off, n) in [
        (&[5.5, 10.0, 20.0][..], 2),
        (&[5.5, 10.0, 20.0, 30.0], 3),
        (&[35.5, 30.0], 1),
        (&[5.5, 10.0, 20.0, 30.0, 35.5, 30.0], 4),
    ] {
        for place in [0, 1, 3] {
            let mut ways = vec![whole; 3];
            ways.insert(place, broken_off);
            let found = &tests_of(&ways)[0];
            assert_eq!(found.targets_mm, [10.0, 20.0, 30.0], "{broken_off:?}");
            assert_eq!((found.up_mm.len(), found.down_mm.len()), (3, 3));
            assert_eq!(found.runs.len(), 3);
            let run = place as u32 + 1;
            let [(named, reason)] = &found.outlying.slips[..] else {
                panic!("{:?}", found.outlying);
            };
            assert_eq!(*named, run);
            let words =
                format!("it has {n} readings where a complete run has 6: it was broken off");
            assert!(reason.starts_with(&words), "{reason}");
            assert_eq!(found.left_out, [format!("run {run}: {reason}")]);
        }
    }
}

#[test]
fn a_stop_whose_readings_contradict_each_other_leaves_its_run_out_by_name() {
    for (run_with, apart_mm, is_used) in [(1, 0.4, true), (1, 0.6, false), (0, 40.0, false)] {
        let mut machine = Machine::new();
        for repeat in 0..3 {
            let of = |begin| segment(repeat + 1, repeat, begin, TestKind::Positioning, &["X"]);
            machine.runs.segment(&of(true));
            for x_mm in [10.0, 20.0, 35.0, 20.0, 10.0] {
                machine.go(Vector3::new(x_mm, 0.0, 0.0), 60, |_, _| 0.0);
                let is_second = repeat == run_with && f64::abs(x_mm - 20.0) < 1e-9;
                // A second series of readings, as of another clock.
                for _ in 0..if is_second { 20 } else { 0 } {
                    machine.tick(Vector3::new(x_mm, 0.0, 0.0), Some(x_mm + apart_mm));
                }
            }
            machine.runs.segment(&of(false));
        }
        let found = &machine.runs.tests()[0];
        let slips = &found.outlying.slips;
        assert_eq!(slips.is_empty(), is_used, "{slips:?}");
        if let [(run, reason)] = &slips[..] {
            assert_eq!((*run, found.runs.len()), (run_with + 1, 2));
            let words = format!(
                "readings of the stop at 20.000 mm up differ by {} µm, at most 500 µm",
                apart_mm * 1e3
            );
            assert!(reason.starts_with(&words), "{reason}");
            assert!(
                reason.ends_with("; 1 more such stops of this run"),
                "{reason}"
            );
        }
    }
}

#[test]
fn stops_a_few_nanometres_apart_are_one_target() {
    // Up it ends 1.1 nm before each target and down 1.1 nm beyond, as steps of 1/6 mm do about inches.
    let there = [10.0, 20.0, 30.0].map(|x_mm| x_mm - 1.1e-6);
    let back = [30.0, 20.0, 10.0].map(|x_mm| x_mm + 1.1e-6);
    let mut machine = Machine::new();
    for repeat in 0..3 {
        let run = repeat + 1;
        machine
            .runs
            .segment(&segment(run, repeat, true, TestKind::Positioning, &["X"]));
        for x_mm in [&there[..], &[35.0], &back[..]].concat() {
            let rest = if f64::abs(x_mm - 35.0) < 1e-9 { 2 } else { 60 };
            machine.go(Vector3::new(x_mm, 0.0, 0.0), rest, |_, _| 0.0);
        }
        machine.go(Vector3::new(5.0, 0.0, 0.0), 2, |_, _| 0.0);
        machine
            .runs
            .segment(&segment(run, repeat, false, TestKind::Positioning, &["X"]));
    }
    let tests = machine.runs.tests();
    assert_eq!(tests[0].targets_mm, [10.0, 20.0, 30.0]);
    assert_eq!(tests[0].left_out, [""; 0]);
    assert_eq!((tests[0].up_mm.len(), tests[0].down_mm.len()), (3, 3));
}

#[test]
fn a_broken_off_run_gives_nothing_and_another_axis_begins_another_test() {
    let mut runs = LinearRuns::default();
    runs.segment(&segment(1, 0, true, TestKind::Positioning, &["X"]));
    let mut end = segment(1, 0, false, TestKind::Positioning, &["X"]);
    end.completed = false;
    runs.segment(&end);
    assert!(runs.tests().is_empty());
}
