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

pub(super) mod against;
pub(super) mod joined;
pub mod slips;
pub(super) mod targets;
pub(super) mod unusable;

use against::{Pair, against};
use joined::{Readings, StopRead, is_by_stamp};
use slips::Outlying;
use targets::{Places, left_out, targets};
use unusable::{Contradiction, Extent, take_out, why_not};

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
    /// When that began.
    pub began: Stamp<Host>,
    /// Numbers of all its runs that count.
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
    /// Readings far from the others of their targets.
    pub outlying: Outlying,
    /// Places with readings that are no targets, and runs that do not count; each with the reason.
    pub left_out: Vec<String>,
    /// Whether anything was added to the commands while it ran.
    pub compensated: bool,
    /// The longest rest between the first and the last one of a run; none: nothing rested.
    pub longest_rest: Option<Span>,
}

#[cfg(test)]
impl LinearTest {
    /// Five runs along X with the same readings up and down, for tests.
    pub(crate) fn along_x(run: u32, targets_mm: Vec<f64>, read_mm: Vec<f64>) -> Self {
        Self {
            kind: TestKind::Positioning,
            axis: Some(Axis::X),
            name: "X".to_owned(),
            first_run: run,
            began: Stamp::from_nanos(0),
            runs: vec![run],
            feed_mm_s: 100.0,
            reference: Reference::Length,
            direction: Vector3::x(),
            place_mm: None,
            targets_mm,
            up_mm: vec![read_mm.clone(); 5],
            down_mm: vec![read_mm; 5],
            mean_mm: 0.0,
            outlying: Default::default(),
            left_out: vec![],
            compensated: false,
            longest_rest: None,
        }
    }
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
    extent: Extent,
    /// How far two readings of one stamp lie apart, where they contradict each other, mm.
    clash_mm: Option<f64>,
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
    /// How far its readings of the length lie apart, where they contradict each other, mm.
    apart_mm: Option<f64>,
    /// The same of two readings of one stamp.
    clash_mm: Option<f64>,
    scale_mm: Vector3<f64>,
}

/// A run while it is read.
#[derive(Clone, Debug, Default)]
struct Course {
    /// Rests with readings, or long enough to have some.
    passed: Vec<Stop>,
    /// Every reading of the length.
    lengths: Readings,
    /// Where and how long the command rested, of rests of two states or more.
    rests: Vec<(Vector3<f64>, Span)>,
}

/// One run: where the command rested and what was read there.
#[derive(Clone, Debug, Default)]
struct Run {
    stops: Vec<Reading>,
    /// Where and how long the command rested, of rests of two states or more.
    rests: Vec<(Vector3<f64>, Span)>,
}

impl Course {
    fn add(&mut self, stop: Stop) {
        if stop.until > stop.since {
            self.rests.push((stop.place_mm, stop.until - stop.since));
        }
        if stop.n > 0 || stop.n_scale > 0 || stop.until - stop.since >= STOP_SETTLE {
            self.passed.push(stop);
        }
    }

    /// The run, where each reading belongs to one stop.
    fn finished(mut self, axis: Option<Axis>) -> Run {
        self.lengths.sort();
        let stamped: Vec<Stop> = (self.passed.iter())
            .map(|stop| stop.with(self.lengths.within(stop.since, stop.until)))
            .collect();
        let mut stops = if is_by_stamp(&reads(&self.passed, axis), &reads(&stamped, axis)) {
            stamped
        } else {
            self.passed
        };
        for stop in &mut stops {
            stop.clash_mm = self.lengths.clash(true, (stop.since, stop.until));
        }
        Run {
            stops: stops.into_iter().filter_map(Stop::read).collect(),
            rests: self.rests,
        }
    }
}

/// What the length reference read at the stops.
fn reads(stops: &[Stop], axis: Option<Axis>) -> Vec<StopRead> {
    let read = || stops.iter().filter(|stop| stop.n > 0);
    let first_mm = read().next().map_or_else(Vector3::zeros, |it| it.place_mm);
    let all = read().map(|stop| {
        let along_mm = match axis {
            Some(axis) => stop.place_mm[axis.index()],
            None => (stop.place_mm - first_mm).norm(),
        };
        StopRead {
            extent: stop.extent,
            deviation: stop.sum_mm / f64::from(stop.n) - along_mm,
            n: stop.n,
        }
    });
    all.collect()
}

impl Run {
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
    current: Option<(TestSegment, Course, Option<Stop>, bool)>,
    done: Vec<(TestSegment, Run, bool)>,
}

impl LinearRuns {
    /// Begin or end of a test.
    pub fn segment(&mut self, segment: &TestSegment) {
        if segment.begin {
            let is_linear = axis_of(segment).is_none_or(Axis::is_linear);
            self.current = (is_linear
                && matches!(segment.kind, TestKind::Positioning | TestKind::Diagonal))
            .then(|| (segment.clone(), Course::default(), None, false));
        } else if let Some((begin, mut run, stop, compensated)) = self.current.take()
            && segment.completed
            && segment.run == begin.run
        {
            stop.into_iter().for_each(|stop| run.add(stop));
            let axis = axis_of(&begin);
            self.done.push((begin, run.finished(axis), compensated));
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
                    extent: Extent::default(),
                    clash_mm: None,
                    scale_sum_mm: Vector3::zeros(),
                    n: 0,
                    n_scale: 0,
                });
            }
        }
    }

    /// One reading of the length reference.
    pub fn length(&mut self, sample: &LengthSample) {
        let Some((_, run, stop, _)) = &mut self.current else {
            return;
        };
        run.lengths.take(sample.at, sample.displacement_mm);
        if let Some(stop) = stop
            && sample.at - stop.since >= STOP_SETTLE
        {
            stop.take(sample.displacement_mm);
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
                .is_some_and(|last| last.0.kind == run.0.kind && is_of_one_test(&last.0, &run.0));
            match groups.last_mut().filter(|_| goes_on) {
                Some(group) => group.push(run),
                None => groups.push(vec![run]),
            }
        }
        groups.iter().filter_map(|group| test(group)).collect()
    }
}

/// Whether a run repeats the one before it: along the same axis with the same offset, set-up and feed.
pub(super) fn is_of_one_test(last: &TestSegment, run: &TestSegment) -> bool {
    run.features == last.features
        && run.repeat == last.repeat + 1
        && run.setup_id == last.setup_id
        && (run.tool_offset_mm - last.tool_offset_mm).amax() < SAME_MM
        && (run.feed_mm_s - last.feed_mm_s).abs() < SAME_MM
}

impl Stop {
    fn take(&mut self, length_mm: f64) {
        self.sum_mm += length_mm;
        self.extent.add(length_mm);
        self.n += 1;
    }

    /// The same with these readings of the length.
    fn with(&self, lengths_mm: impl Iterator<Item = f64>) -> Self {
        let mut stop = Self {
            sum_mm: 0.0,
            extent: Extent::default(),
            n: 0,
            ..*self
        };
        lengths_mm.for_each(|length_mm| stop.take(length_mm));
        stop
    }

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
            apart_mm: self.extent.contradiction(true),
            clash_mm: self.clash_mm,
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
    let reference = reference(stops());
    let rests = group.iter().flat_map(|(_, run, _)| &run.rests);
    let direction = direction(axis, stops().map(|stop| &stop.place_mm))
        .or_else(|| direction(axis, rests.map(|(place_mm, _)| place_mm)))?;
    let read: Vec<Vec<Approach>> = group
        .iter()
        .map(|(_, run, _)| approaches(run, axis, &direction, reference))
        .collect();
    let places = Places::of(read.iter().flatten().map(|one| one.along_mm));
    let mut runs: Vec<Visits> = read.iter().map(|run| visits(run, &places)).collect();
    let mut numbers: Vec<u32> = group.iter().map(|(segment, ..)| segment.run).collect();
    let own = read.iter().map(|run| reason_against(run, reference));
    let unusable = take_out(&mut runs, &mut numbers, own.collect());
    let (targets, sides) = targets(&runs);
    let mut left_out = left_out(&runs, &numbers, (&targets, sides), (&places, "mm"));
    let of = |side: usize| {
        if !sides.contains(&side) {
            return vec![];
        }
        let row = |run: &Visits| targets.iter().map(|place| run[place][side][0]).collect();
        runs.iter().map(row).collect::<Vec<Vec<f64>>>()
    };
    let first_stop = stops().next().map(|stop| stop.place_mm);
    let (mut up_mm, mut down_mm) = (of(0), of(1));
    let targets_mm = places.at(&targets);
    let sides = [&mut up_mm, &mut down_mm];
    let outlying = Outlying::of(true, &targets_mm, &mut numbers, sides).with(unusable);
    left_out.extend(outlying.left_out());
    let mean_mm = level(&mut up_mm, &mut down_mm);
    Some(LinearTest {
        kind: first.kind,
        axis,
        name: first.features.join(" "),
        first_run: first.run,
        began: first.at,
        runs: numbers,
        feed_mm_s: first.feed_mm_s,
        reference,
        direction,
        place_mm: first_stop.map(|at| at - direction * at.dot(&direction)),
        targets_mm,
        up_mm,
        down_mm,
        mean_mm,
        outlying,
        left_out,
        compensated: group.iter().any(|(.., compensated)| *compensated),
        longest_rest: group
            .iter()
            .filter_map(|(_, run, _)| run.longest_rest())
            .max(),
    })
}

/// What measured the stops.
fn reference<'a>(mut stops: impl Iterator<Item = &'a Reading> + Clone) -> Reference {
    // Where the reference is put up and zeroed it says nothing yet. Where nothing was read, no scale was.
    let is_by_length = stops.clone().any(|stop| stop.length_mm.is_some());
    if is_by_length || stops.next().is_none() {
        Reference::Length
    } else {
        Reference::Scale
    }
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
    apart_mm: Option<f64>,
    clash_mm: Option<f64>,
}

/// Why a run cannot be used by itself.
fn reason_against(run: &[Approach], reference: Reference) -> Option<String> {
    let pairs: Vec<Pair> = run.iter().map(Approach::pair).collect();
    let is_by_length = reference == Reference::Length;
    let against = is_by_length.then(|| against(true, &pairs)).flatten();
    why_not(&contradictions(run), against)
}

impl Approach {
    fn pair(&self) -> Pair {
        Pair {
            at: self.along_mm,
            deviation: self.deviation_mm,
        }
    }
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
            apart_mm: stop.apart_mm.filter(|_| reference == Reference::Length),
            clash_mm: stop.clash_mm.filter(|_| reference == Reference::Length),
        })
    };
    run.stops.iter().filter_map(approach).collect()
}

/// The stops of a run whose readings contradict each other.
fn contradictions(run: &[Approach]) -> Vec<Contradiction> {
    let of = |approach: &Approach| {
        Some(Contradiction {
            is_linear: true,
            at: approach.along_mm,
            is_up: approach.upwards,
            apart: approach.apart_mm.or(approach.clash_mm)?,
            is_of_one_stamp: approach.apart_mm.is_none(),
        })
    };
    run.iter().filter_map(of).collect()
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
mod tests;
