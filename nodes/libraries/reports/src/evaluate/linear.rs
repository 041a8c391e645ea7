//! Positioning runs and diagonals: what the reference read while the axes rested at each target.
//!
//! A stop counts when the command stands still; readings of its first part, while the machine settles,
//! are left out, and a stop that is shorter than that gives nothing. A target is a place that every run
//! approached once from both sides; where no two places were, one that every run approached once from the side that
//! all share. The places of overrun and arrival are no targets. Other places with readings are named as left out. The
//! reading is that of the length reference along its beam, or, without one, of the linear scale of the axis.

use std::collections::BTreeMap;

use metrology::Axis;
use metrology::sample::{AxisState, LengthSample, TestKind, TestSegment};
use metrology::stamp::{Host, Span, Stamp};
use nalgebra::Vector3;

pub(super) mod targets;

use targets::{Places, left_out, targets};

/// Rest after which readings count.
pub const STOP_SETTLE: Span = Span::from_nanos(300_000_000);
/// A command that moves by less rests, mm.
const SAME_MM: f64 = 1e-6;

/// What measured the runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reference {
    /// The length reference, along its beam.
    Length,
    /// The linear scale of the axis.
    Scale,
}

/// Runs along one line, up and down, as ISO 230-2 and 230-6 take them.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearTest {
    /// Positioning or diagonal.
    pub kind: TestKind,
    /// Axis, where it runs along one.
    pub axis: Option<Axis>,
    /// What else names it, e.g. the beam.
    pub name: String,
    /// Number of its first run.
    pub first_run: u32,
    /// Numbers of all its runs.
    pub runs: Vec<u32>,
    /// Programmed feed, mm/s.
    pub feed_mm_s: f64,
    /// What measured.
    pub reference: Reference,
    /// Where the line leads, from its smaller positions to its greater ones; of length 1.
    pub direction: Vector3<f64>,
    /// The point of the line nearest to the machine's zero, mm; none: nothing rested, or the place is not known.
    pub place_mm: Option<Vector3<f64>>,
    /// Targets by ascending position along the line, mm.
    pub targets_mm: Vec<f64>,
    /// Deviations per run and target towards greater positions, their mean over all taken out, mm.
    pub up_mm: Vec<Vec<f64>>,
    /// The same towards smaller positions, mm. One of the two is empty where all targets were approached from one side.
    pub down_mm: Vec<Vec<f64>>,
    /// That mean: what the zero of the reference and the zero of the axis differ by, mm.
    pub mean_mm: f64,
    /// Places with readings that are no targets, and why.
    pub left_out: Vec<String>,
    /// Whether anything was added to the commands while it ran.
    pub compensated: bool,
    /// The longest rest between the first and the last one of a run; none: nothing rested.
    pub longest_rest: Option<Span>,
}

/// One rest of the command.
#[derive(Clone, Copy, Debug)]
struct Stop {
    place_mm: Vector3<f64>,
    /// Where the command was one state before it rested here.
    from_mm: Vector3<f64>,
    since: Stamp<Host>,
    until: Stamp<Host>,
    sum_mm: f64,
    scale_sum_mm: Vector3<f64>,
    n: u32,
    n_scale: u32,
}

/// What was read at one rest.
#[derive(Clone, Copy, Debug)]
struct Reading {
    place_mm: Vector3<f64>,
    from_mm: Vector3<f64>,
    length_mm: Option<f64>,
    scale_mm: Vector3<f64>,
}

/// One run: where the command rested and what was read there.
#[derive(Clone, Debug, Default)]
struct Run {
    stops: Vec<Reading>,
    /// Where and how long the command rested, of rests of two states or more.
    rests: Vec<(Vector3<f64>, Span)>,
}

impl Run {
    fn add(&mut self, stop: Stop) {
        if stop.until > stop.since {
            self.rests.push((stop.place_mm, stop.until - stop.since));
        }
        self.stops.extend(stop.read());
    }

    /// Before the first way and behind the last one the machine may stand for any time.
    fn longest_rest(&self) -> Option<Span> {
        let within = self.rests.len().saturating_sub(1);
        let rests = self.rests.get(1..within)?.iter();
        rests.map(|(_, rest)| *rest).max()
    }
}

/// Collects the runs of a recording.
#[derive(Debug, Default)]
pub struct LinearRuns {
    current: Option<(TestSegment, Run, Option<Stop>, bool)>,
    done: Vec<(TestSegment, Run, bool)>,
}

impl LinearRuns {
    /// Begin or end of a test.
    pub fn segment(&mut self, segment: &TestSegment) {
        if segment.begin {
            let is_linear = axis_of(segment).is_none_or(Axis::is_linear);
            self.current = (is_linear
                && matches!(segment.kind, TestKind::Positioning | TestKind::Diagonal))
            .then(|| (segment.clone(), Run::default(), None, false));
        } else if let Some((begin, mut run, stop, compensated)) = self.current.take()
            && segment.completed
            && segment.run == begin.run
        {
            stop.into_iter().for_each(|stop| run.add(stop));
            self.done.push((begin, run, compensated));
        }
    }

    /// Something is added to the commands, or nothing.
    pub fn compensation(&mut self, acts: bool) {
        if let Some((.., compensated)) = &mut self.current {
            *compensated |= acts;
        }
    }

    /// Positions at one tick.
    pub fn axes(&mut self, state: &AxisState) {
        let Some((_, run, stop, _)) = &mut self.current else {
            return;
        };
        let place_mm = state.commanded.xyz();
        match stop {
            Some(at) if (at.place_mm - place_mm).amax() < SAME_MM => {
                at.until = state.received_at;
                if state.received_at - at.since >= STOP_SETTLE
                    && state.scale.xyz().iter().any(|s| s.is_finite())
                {
                    at.scale_sum_mm += state.scale.xyz();
                    at.n_scale += 1;
                }
            }
            _ => {
                let from_mm = stop.map_or(place_mm, |before| before.place_mm);
                stop.take().into_iter().for_each(|stop| run.add(stop));
                *stop = Some(Stop {
                    place_mm,
                    from_mm,
                    since: state.received_at,
                    until: state.received_at,
                    sum_mm: 0.0,
                    scale_sum_mm: Vector3::zeros(),
                    n: 0,
                    n_scale: 0,
                });
            }
        }
    }

    /// One reading of the length reference.
    pub fn length(&mut self, sample: &LengthSample) {
        if let Some((_, _, Some(stop), _)) = &mut self.current
            && sample.at - stop.since >= STOP_SETTLE
        {
            stop.sum_mm += sample.displacement_mm;
            stop.n += 1;
        }
    }

    /// The tests: runs that repeat one another belong together.
    #[must_use]
    pub fn tests(self) -> Vec<LinearTest> {
        let mut groups: Vec<Vec<(TestSegment, Run, bool)>> = Vec::new();
        for run in self.done {
            let goes_on = groups
                .last()
                .and_then(|group| group.last())
                .is_some_and(|last| {
                    let alike = last.0.kind == run.0.kind && last.0.features == run.0.features;
                    alike && run.0.repeat == last.0.repeat + 1
                });
            match groups.last_mut().filter(|_| goes_on) {
                Some(group) => group.push(run),
                None => groups.push(vec![run]),
            }
        }
        groups.iter().filter_map(|group| test(group)).collect()
    }
}

impl Stop {
    fn read(self) -> Option<Reading> {
        let length_mm = (self.n > 0).then(|| self.sum_mm / f64::from(self.n));
        let scale_mm = if self.n_scale > 0 {
            self.scale_sum_mm / f64::from(self.n_scale)
        } else {
            Vector3::repeat(f64::NAN)
        };
        (length_mm.is_some() || self.n_scale > 0).then_some(Reading {
            place_mm: self.place_mm,
            from_mm: self.from_mm,
            length_mm,
            scale_mm,
        })
    }
}

/// The axis that a test names first.
pub(super) fn axis_of(segment: &TestSegment) -> Option<Axis> {
    segment.features.first()?.parse().ok()
}

/// Deviations by number of the place and direction: (up, down).
pub(super) type Visits = BTreeMap<usize, [Vec<f64>; 2]>;

fn test(group: &[(TestSegment, Run, bool)]) -> Option<LinearTest> {
    let (first, ..) = group.first()?;
    let axis = axis_of(first);
    let stops = || group.iter().flat_map(|(_, run, _)| &run.stops);
    // Where the reference is put up and zeroed it says nothing yet. Where nothing was read, no scale was.
    let is_by_length = stops().any(|stop| stop.length_mm.is_some());
    let reference = if is_by_length || stops().next().is_none() {
        Reference::Length
    } else {
        Reference::Scale
    };
    let rests = group.iter().flat_map(|(_, run, _)| &run.rests);
    let direction = direction(axis, stops().map(|stop| &stop.place_mm))
        .or_else(|| direction(axis, rests.map(|(place_mm, _)| place_mm)))?;
    let read: Vec<Vec<Approach>> = group
        .iter()
        .map(|(_, run, _)| approaches(run, axis, &direction, reference))
        .collect();
    let places = Places::of(read.iter().flatten().map(|one| one.along_mm));
    let runs: Vec<Visits> = read.iter().map(|run| visits(run, &places)).collect();
    let (targets, sides) = targets(&runs);
    let numbers: Vec<u32> = group.iter().map(|(segment, ..)| segment.run).collect();
    let left_out = left_out(&runs, &numbers, (&targets, sides), (&places, "mm"));
    let of = |side: usize| {
        if !sides.contains(&side) {
            return vec![];
        }
        let row = |run: &Visits| targets.iter().map(|place| run[place][side][0]).collect();
        runs.iter().map(row).collect::<Vec<Vec<f64>>>()
    };
    let first_stop = stops().next().map(|stop| stop.place_mm);
    let (mut up_mm, mut down_mm) = (of(0), of(1));
    let mean_mm = level(&mut up_mm, &mut down_mm);
    Some(LinearTest {
        kind: first.kind,
        axis,
        name: first.features.join(" "),
        first_run: first.run,
        runs: numbers,
        feed_mm_s: first.feed_mm_s,
        reference,
        direction,
        place_mm: first_stop.map(|at| at - direction * at.dot(&direction)),
        targets_mm: places.at(&targets),
        up_mm,
        down_mm,
        mean_mm,
        left_out,
        compensated: group.iter().any(|(.., compensated)| *compensated),
        longest_rest: group
            .iter()
            .filter_map(|(_, run, _)| run.longest_rest())
            .max(),
    })
}

/// Where the line leads: along its axis, or from the first place to the farthest.
fn direction<'a>(
    axis: Option<Axis>,
    mut places: impl Iterator<Item = &'a Vector3<f64>>,
) -> Option<Vector3<f64>> {
    if let Some(axis) = axis {
        return Some(Vector3::ith(axis.index(), 1.0));
    }
    let first = places.next()?;
    let farthest = places.max_by(|a, b| (*a - first).norm().total_cmp(&(*b - first).norm()))?;
    (farthest - first).try_normalize(SAME_MM)
}

/// One stop with a reading.
struct Approach {
    along_mm: f64,
    deviation_mm: f64,
    upwards: bool,
}

fn approaches(
    run: &Run,
    axis: Option<Axis>,
    direction: &Vector3<f64>,
    reference: Reference,
) -> Vec<Approach> {
    // On a diagonal places count from the first stop; along an axis from the machine's zero.
    let origin = match (axis, run.stops.first()) {
        (None, Some(stop)) => stop.place_mm,
        _ => Vector3::zeros(),
    };
    let approach = |stop: &Reading| {
        let along_mm = direction.dot(&(stop.place_mm - origin));
        let way_mm = direction.dot(&(stop.place_mm - stop.from_mm));
        let read_mm = match (reference, axis) {
            (Reference::Length, _) => stop.length_mm.unwrap_or(f64::NAN),
            (Reference::Scale, Some(axis)) => stop.scale_mm[axis.index()],
            (Reference::Scale, None) => f64::NAN,
        };
        (way_mm.abs() > SAME_MM && read_mm.is_finite()).then_some(Approach {
            along_mm,
            deviation_mm: read_mm - along_mm,
            upwards: way_mm > 0.0,
        })
    };
    run.stops.iter().filter_map(approach).collect()
}

fn visits(run: &[Approach], places: &Places) -> Visits {
    let mut visits = Visits::new();
    for approach in run {
        let [up, down] = visits.entry(places.number(approach.along_mm)).or_default();
        let side = if approach.upwards { up } else { down };
        side.push(approach.deviation_mm);
    }
    visits
}

/// A reference counts from where it was zeroed: takes out the mean of all deviations, and returns it.
pub fn level(up: &mut [Vec<f64>], down: &mut [Vec<f64>]) -> f64 {
    let all = || up.iter().chain(down.iter()).flatten();
    let n = all().count();
    if n == 0 {
        return 0.0;
    }
    let mean = all().sum::<f64>() / n as f64;
    for value in up.iter_mut().chain(down.iter_mut()).flatten() {
        *value -= mean;
    }
    mean
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::{AxisSet, PerAxis};

    const TICK_NANOS: i64 = 10_000_000;

    fn segment(
        run: u32,
        repeat: u32,
        begin: bool,
        kind: TestKind,
        features: &[&str],
    ) -> TestSegment {
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
                let rest = if x_mm == 35.0 { 2 } else { 60 };
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
}
