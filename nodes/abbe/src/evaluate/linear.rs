//! Positioning runs and diagonals: what the reference read while the axes rested at each target.
//!
//! A stop counts when the command stands still; readings of its first part, while the machine settles,
//! are left out, and a stop that is shorter than that gives nothing. A target is a place that every run
//! approached from both sides; the places of overrun and arrival are none. The reading is that of the
//! length reference along its beam, or, without one, of the linear scale of the axis.

use std::collections::BTreeMap;

use metrology::Axis;
use metrology::sample::{AxisState, LengthSample, TestKind, TestSegment};
use metrology::stamp::{Host, Span, Stamp};
use nalgebra::Vector3;

/// Rest after which readings count.
const SETTLE: Span = Span::from_nanos(300_000_000);
/// Positions closer than this are one place, mm.
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
    /// What measured.
    pub reference: Reference,
    /// Targets by ascending position along the line, mm.
    pub targets_mm: Vec<f64>,
    /// Deviations per run and target towards greater positions, mm.
    pub up_mm: Vec<Vec<f64>>,
    /// The same towards smaller positions, mm.
    pub down_mm: Vec<Vec<f64>>,
    /// Whether anything was added to the commands while it ran.
    pub compensated: bool,
}

/// One rest of the command.
#[derive(Clone, Copy, Debug)]
struct Stop {
    place_mm: Vector3<f64>,
    since: Stamp<Host>,
    sum_mm: f64,
    scale_sum_mm: Vector3<f64>,
    n: u32,
    n_scale: u32,
}

/// One run: where the command rested and what was read there.
#[derive(Clone, Debug, Default)]
struct Run {
    stops: Vec<(Vector3<f64>, Option<f64>, Vector3<f64>)>,
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
            self.current = matches!(segment.kind, TestKind::Positioning | TestKind::Diagonal)
                .then(|| (segment.clone(), Run::default(), None, false));
        } else if let Some((begin, mut run, stop, compensated)) = self.current.take()
            && segment.completed
            && segment.run == begin.run
        {
            run.stops.extend(stop.and_then(Stop::read));
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
                if state.at - at.since >= SETTLE && state.scale.xyz().iter().any(|s| s.is_finite())
                {
                    at.scale_sum_mm += state.scale.xyz();
                    at.n_scale += 1;
                }
            }
            _ => {
                run.stops.extend(stop.take().and_then(Stop::read));
                *stop = Some(Stop {
                    place_mm,
                    since: state.at,
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
            && sample.at - stop.since >= SETTLE
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
    fn read(self) -> Option<(Vector3<f64>, Option<f64>, Vector3<f64>)> {
        let length_mm = (self.n > 0).then(|| self.sum_mm / f64::from(self.n));
        let scale_mm = self.scale_sum_mm / f64::from(self.n_scale.max(1));
        let has_scale = self.n_scale > 0;
        let scale_mm = if has_scale {
            scale_mm
        } else {
            Vector3::repeat(f64::NAN)
        };
        (length_mm.is_some() || has_scale).then_some((self.place_mm, length_mm, scale_mm))
    }
}

/// Deviations by direction and place: (up, down).
type Visits = BTreeMap<i64, [Vec<f64>; 2]>;

fn test(group: &[(TestSegment, Run, bool)]) -> Option<LinearTest> {
    let (first, ..) = group.first()?;
    let axis: Option<Axis> = first.features.first().and_then(|name| name.parse().ok());
    let stops = || group.iter().flat_map(|(_, run, _)| &run.stops);
    let reference = if stops().all(|(_, length, _)| length.is_some()) {
        Reference::Length
    } else {
        Reference::Scale
    };
    let direction = direction(axis, stops().map(|(place_mm, ..)| place_mm))?;
    let runs: Vec<Visits> = group
        .iter()
        .map(|(_, run, _)| visits(run, axis, &direction, reference))
        .collect();
    let in_every = |place: &&i64| {
        let complete = |visits: &[Vec<f64>; 2]| visits.iter().all(|values| values.len() == 1);
        runs.iter().all(|run| run.get(place).is_some_and(complete))
    };
    let places: Vec<i64> = runs.first()?.keys().filter(in_every).copied().collect();
    let of = |side: usize| {
        let row = |run: &Visits| places.iter().map(|place| run[place][side][0]).collect();
        runs.iter().map(row).collect::<Vec<Vec<f64>>>()
    };
    let (mut up_mm, mut down_mm) = (of(0), of(1));
    level(&mut up_mm, &mut down_mm);
    Some(LinearTest {
        kind: first.kind,
        axis,
        name: first.features.join(" "),
        first_run: first.run,
        reference,
        targets_mm: places.iter().map(|place| *place as f64 * SAME_MM).collect(),
        up_mm,
        down_mm,
        compensated: group.iter().any(|(.., compensated)| *compensated),
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

fn visits(run: &Run, axis: Option<Axis>, direction: &Vector3<f64>, reference: Reference) -> Visits {
    let mut visits = Visits::new();
    let mut before: Option<f64> = None;
    // On a diagonal places count from the first stop; along an axis from the machine's zero.
    let origin = match (axis, run.stops.first()) {
        (None, Some((place_mm, ..))) => *place_mm,
        _ => Vector3::zeros(),
    };
    for (place_mm, length_mm, scale_mm) in &run.stops {
        let along_mm = direction.dot(&(place_mm - origin));
        let read_mm = match (reference, axis) {
            (Reference::Length, _) => length_mm.unwrap_or(f64::NAN),
            (Reference::Scale, Some(axis)) => scale_mm[axis.index()],
            (Reference::Scale, None) => f64::NAN,
        };
        if let Some(before_mm) = before
            && read_mm.is_finite()
        {
            let side = usize::from(along_mm < before_mm);
            let [up, down] = visits
                .entry((along_mm / SAME_MM).round() as i64)
                .or_default();
            [up, down][side].push(read_mm - along_mm);
        }
        before = Some(along_mm);
    }
    visits
}

/// A reference counts from where it was zeroed: the mean of all deviations is taken out.
fn level(up_mm: &mut [Vec<f64>], down_mm: &mut [Vec<f64>]) {
    let all = || up_mm.iter().chain(down_mm.iter()).flatten();
    let n = all().count();
    if n == 0 {
        return;
    }
    let mean_mm = all().sum::<f64>() / n as f64;
    for value in up_mm.iter_mut().chain(down_mm.iter_mut()).flatten() {
        *value -= mean_mm;
    }
}
