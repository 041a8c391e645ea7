//! Lines, corners, spikes and arcs over the plate of a grid encoder: how far the tool left the commanded path.
//!
//! ```text
//!   e_i = n_i . (r_i + s - p_i),   p_i: nearest point of the commanded path, n_i: its normal to the left   (1)
//!   sum e_i^2 least over s, for all paths under one zero                                                   (2)
//! ```
//!
//! The plate counts from where it was zeroed, which nothing states: s is that place. A lag along the path is no deviation from it,
//! so that (2) holds where a mean of commanded minus read places would be off by the lag. p_i and s follow from each other and are
//! found in turn.
//!
//! A program moves to its path and away from it, and the axes settle on a run-in. `(rate: full)` stands before the evaluated part,
//! `(rate: background)` behind it, and a control that reads these comments publishes its states closer in between: evaluated is
//! the longest stretch of close states, where sparse ones come before it. A recording without them is evaluated as a whole.

use metrology::Axis;
use metrology::sample::{AxisState, GridSample, TestKind, TestPlane, TestSegment};
use metrology::stamp::{Host, Machine, Stamp};
use nalgebra::{Matrix2, Vector2};

use super::circles::{FEWEST_SPARSE, SPARSE, median, plane_axes};

/// Kinds of paths that are no whole circle.
const KINDS: [TestKind; 6] = [
    TestKind::Line,
    TestKind::Corner,
    TestKind::Spike,
    TestKind::Arc,
    TestKind::ArcWithLine,
    TestKind::TwoArcs,
];

/// Whether tests of a kind are paths.
pub(super) fn is_path(kind: TestKind) -> bool {
    KINDS.contains(&kind)
}

/// Most readings of a path: ten minutes at 1 kHz.
const MOST_READINGS: usize = 600_000;
/// Commands about that of a reading among which its nearest place is sought.
const WINDOW: usize = 250;
/// Distance beyond the least at which a way leads away, mm.
const AWAY_MM: f64 = 0.2;
/// Shorter steps of the command are a rest, mm.
const LEAST_STEP_MM: f64 = 1e-5;
/// Times that (1) and (2) follow each other.
const ROUNDS: usize = 4;
/// Least share of the greatest at which a direction of s is determined.
const DETERMINED: f64 = 1e-6;

/// A reading on a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathPoint {
    /// Way of the command since the begin of the evaluated part, mm.
    pub along_mm: f64,
    /// Distance from the commanded path, to the left of the motion positive, mm.
    pub deviation_mm: f64,
}

/// A path as it was recorded.
#[derive(Clone, Debug)]
pub struct PathRecording {
    /// The test.
    pub segment: TestSegment,
    /// Readings in the order of time.
    pub points: Vec<PathPoint>,
    /// Readings beyond the most that are kept.
    pub left_out: usize,
    /// Readings of run-in and run-out that are not among the points; `None` where the recording does not mark its evaluated part.
    pub run_in: Option<usize>,
}

/// A reading of the plate.
#[derive(Clone, Copy, Debug)]
struct Reading {
    at: Stamp<Host>,
    /// Number of the command before it.
    command: usize,
    place_mm: Vector2<f64>,
}

#[derive(Debug)]
struct Current {
    segment: TestSegment,
    axes: [Axis; 2],
    commanded_mm: Vec<Vector2<f64>>,
    /// Each state: when it came, and how long after the one before by the controller's clock, s.
    states: Vec<(Stamp<Host>, f64)>,
    last_stamp: Option<Stamp<Machine>>,
    read: Vec<Reading>,
    left_out: usize,
    run_in: Option<usize>,
}

/// Collects the paths of a recording.
#[derive(Debug, Default)]
pub struct Paths {
    current: Option<Current>,
    done: Vec<Current>,
}

impl Paths {
    /// Begin or end of a test.
    pub fn segment(&mut self, segment: &TestSegment) {
        if segment.begin {
            let is_wanted = is_path(segment.kind) && segment.stations == 0;
            let axes = plane_axes(segment.plane).filter(|_| is_wanted);
            self.current = axes.map(|axes| Current {
                segment: segment.clone(),
                axes,
                commanded_mm: Vec::new(),
                states: Vec::new(),
                last_stamp: None,
                read: Vec::new(),
                left_out: 0,
                run_in: None,
            });
        } else if let Some(mut current) = self.current.take()
            && segment.completed
            && segment.run == current.segment.run
            && !current.read.is_empty()
        {
            current.keep_evaluated();
            self.done.push(current);
        }
    }

    /// Positions at one tick.
    pub fn axes(&mut self, state: &AxisState) {
        let Some(current) = &mut self.current else {
            return;
        };
        let stamp = state.controller_at;
        if let Some(last) = current.last_stamp.replace(stamp)
            && current.states.len() < MOST_READINGS
        {
            let step_s = (stamp - last).as_secs_f64();
            current.states.push((state.received_at, step_s));
        }
        let [u, v] = current.axes.map(|axis| state.commanded[axis]);
        let place = Vector2::new(u, v);
        let last = current.commanded_mm.last();
        let is_rest = last.is_some_and(|last| (place - last).norm() < LEAST_STEP_MM);
        if !is_rest && u.is_finite() && v.is_finite() && current.commanded_mm.len() < MOST_READINGS
        {
            current.commanded_mm.push(place);
        }
    }

    /// One reading of the plate.
    pub fn grid(&mut self, sample: &GridSample) {
        let Some(current) = &mut self.current else {
            return;
        };
        let is_own =
            sample.plane == current.segment.plane && sample.zero_id == current.segment.zero_id;
        let place = Vector2::new(sample.u_mm, sample.v_mm);
        let Some(last) = current.commanded_mm.len().checked_sub(1) else {
            return;
        };
        if !is_own || !place.x.is_finite() || !place.y.is_finite() {
            return;
        }
        if current.read.len() < MOST_READINGS {
            current.read.push(Reading {
                at: sample.at,
                command: last,
                place_mm: place,
            });
        } else {
            current.left_out += 1;
        }
    }

    /// The paths in the order of the recording.
    #[must_use]
    pub fn recordings(self) -> Vec<PathRecording> {
        let zero = |one: &Current| -> (TestPlane, u32, u32) {
            (one.segment.plane, one.segment.setup_id, one.segment.zero_id)
        };
        let mut shifts: Vec<((TestPlane, u32, u32), Vector2<f64>)> = Vec::new();
        for one in &self.done {
            if shifts.iter().all(|(known, _)| *known != zero(one)) {
                let own = self.done.iter().filter(|other| zero(other) == zero(one));
                shifts.push((zero(one), shift_mm(&own.collect::<Vec<_>>())));
            }
        }
        let recording = |one: &Current| {
            let (_, shift) = shifts.iter().find(|(known, _)| *known == zero(one))?;
            Some(one.recording(shift))
        };
        let all = self.done.iter().filter_map(recording);
        all.filter(|one| !one.points.is_empty()).collect()
    }
}

/// The nearest place of a path: way to it, the place and the normal to the left.
struct Nearest {
    along_mm: f64,
    place_mm: Vector2<f64>,
    normal: Vector2<f64>,
}

impl Current {
    /// Leaves out run-in and run-out, where the recording marks its evaluated part.
    fn keep_evaluated(&mut self) {
        let Some((from, until)) = self.evaluated() else {
            return;
        };
        let n = self.read.len();
        let is_evaluated = |reading: &Reading| reading.at >= from && reading.at <= until;
        if self.read.iter().any(is_evaluated) {
            self.read.retain(is_evaluated);
            self.run_in = Some(n - self.read.len());
        }
    }

    /// Begin and end of the longest stretch of close states behind sparse ones.
    fn evaluated(&self) -> Option<(Stamp<Host>, Stamp<Host>)> {
        let usual_s = median(self.states.iter().map(|(_, step_s)| *step_s))?;
        let is_close = |state: &(Stamp<Host>, f64)| usual_s > 0.0 && state.1 <= SPARSE * usual_s;
        let mut longest: Option<(usize, usize)> = None;
        let mut begin = None;
        for (k, state) in self.states.iter().enumerate() {
            if !is_close(state) {
                begin = None;
                continue;
            }
            let first = *begin.get_or_insert(k);
            if longest.is_none_or(|(a, b)| k - first > b - a) {
                longest = Some((first, k));
            }
        }
        let (first, last) = longest?;
        let sparse = self
            .states
            .get(..first)?
            .iter()
            .filter(|one| !is_close(one));
        // The step of the first close state began at the state before it.
        let from = self.states.get(first.saturating_sub(1))?.0;
        let until = self.states.get(last)?.0;
        (sparse.count() >= FEWEST_SPARSE).then_some((from, until))
    }

    /// Way of each command since the begin, mm.
    fn ways_mm(&self) -> Vec<f64> {
        let mut way_mm = 0.0;
        let mut ways = vec![0.0; self.commanded_mm.len().min(1)];
        for pair in self.commanded_mm.windows(2) {
            way_mm += (pair[1] - pair[0]).norm();
            ways.push(way_mm);
        }
        ways
    }

    /// The nearest place among the commands about one of them. Each way is followed until it leads away.
    fn nearest(&self, ways_mm: &[f64], about: usize, place_mm: &Vector2<f64>) -> Option<Nearest> {
        let first = about.saturating_sub(WINDOW);
        let last = (about + WINDOW).min(self.commanded_mm.len().checked_sub(1)?);
        let mut found: Option<(f64, Nearest)> = None;
        let mut leads_away = |k: usize| {
            let (distance_mm, nearest) = self.on_piece(ways_mm, k, place_mm);
            let least_mm = found.as_ref().map_or(f64::INFINITY, |(least, _)| *least);
            if distance_mm < least_mm {
                found = Some((distance_mm, nearest));
            }
            distance_mm > least_mm + AWAY_MM
        };
        for k in (first..about.min(last)).rev() {
            if leads_away(k) {
                break;
            }
        }
        for k in about..last {
            if leads_away(k) {
                break;
            }
        }
        found.map(|(_, nearest)| nearest)
    }

    /// Distance from a place to one piece of the path, mm, and the nearest place on it.
    fn on_piece(&self, ways_mm: &[f64], k: usize, place_mm: &Vector2<f64>) -> (f64, Nearest) {
        let (a, b) = (self.commanded_mm[k], self.commanded_mm[k + 1]);
        let step = b - a;
        let length_mm = step.norm();
        let share = ((place_mm - a).dot(&step) / length_mm.powi(2)).clamp(0.0, 1.0);
        let at = a + share * step;
        let nearest = Nearest {
            along_mm: ways_mm[k] + share * length_mm,
            place_mm: at,
            normal: Vector2::new(-step.y, step.x) / length_mm,
        };
        ((place_mm - at).norm(), nearest)
    }

    fn recording(&self, shift_mm: &Vector2<f64>) -> PathRecording {
        let ways_mm = self.ways_mm();
        let point = |reading: &Reading| {
            let place = reading.place_mm + shift_mm;
            let nearest = self.nearest(&ways_mm, reading.command, &place)?;
            Some(PathPoint {
                along_mm: nearest.along_mm,
                // (1)
                deviation_mm: nearest.normal.dot(&(place - nearest.place_mm)),
            })
        };
        let mut points: Vec<PathPoint> = self.read.iter().filter_map(point).collect();
        // The way counts from the begin of the evaluated part.
        let begin_mm = points.first().map_or(0.0, |point| point.along_mm);
        for point in &mut points {
            point.along_mm -= begin_mm;
        }
        PathRecording {
            segment: self.segment.clone(),
            points,
            left_out: self.left_out,
            run_in: self.run_in,
        }
    }
}

/// s of (2), mm; along a direction that no path determines it stays that of the mean.
fn shift_mm(paths: &[&Current]) -> Vector2<f64> {
    let pairs = || {
        paths
            .iter()
            .flat_map(|path| path.read.iter().map(move |read| (path, read)))
    };
    let n = pairs().count().max(1) as f64;
    let apart = pairs().map(|(path, read)| path.commanded_mm[read.command] - read.place_mm);
    let mut shift = apart.sum::<Vector2<f64>>() / n;
    let ways: Vec<Vec<f64>> = paths.iter().map(|path| path.ways_mm()).collect();
    for _ in 0..ROUNDS {
        let (mut normal_matrix, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for (path, ways_mm) in paths.iter().zip(&ways) {
            // Some hundred readings of a path have all that two unknowns need.
            for read in path.read.iter().step_by(1 + path.read.len() / 400) {
                let place = read.place_mm + shift;
                if let Some(near) = path.nearest(ways_mm, read.command, &place) {
                    normal_matrix += near.normal * near.normal.transpose();
                    right += near.normal * near.normal.dot(&(near.place_mm - place));
                }
            }
        }
        let eigen = normal_matrix.symmetric_eigen();
        let greatest = eigen.eigenvalues.max();
        for (value, direction) in eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter())
        {
            if *value > DETERMINED * greatest {
                shift += direction * (direction.dot(&right) / value);
            }
        }
    }
    shift
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::stamp::Stamp;

    /// A corner of two lines, read late, shifted, and off by `off_mm` to the left on the first line.
    fn corner(off_mm: f64) -> Current {
        let at = |k: usize| {
            let way = k as f64 * 0.02;
            if way < 30.0 {
                Vector2::new(way, 0.0)
            } else {
                Vector2::new(30.0, way - 30.0)
            }
        };
        let read = |k: usize| {
            let late = at(k.saturating_sub(15));
            let left = if late.y == 0.0 {
                Vector2::new(0.0, off_mm)
            } else {
                Vector2::zeros()
            };
            Reading {
                at: Stamp::from_nanos(k as i64 * 1_000_000),
                command: k,
                place_mm: late + left + Vector2::new(-7.0, 3.0),
            }
        };
        Current {
            segment: TestSegment::of_kind(TestKind::Corner, 1, Stamp::default()),
            axes: [Axis::X, Axis::Y],
            commanded_mm: (0..3000).map(at).collect(),
            states: Vec::new(),
            last_stamp: None,
            read: (0..3000).step_by(7).map(read).collect(),
            left_out: 0,
            run_in: None,
        }
    }

    #[test]
    fn eq1_eq2_a_lag_and_a_shift_are_no_deviation() {
        let exact = corner(0.0);
        let shift = shift_mm(&[&exact]);
        assert!((shift - Vector2::new(7.0, -3.0)).norm() < 1e-3, "{shift}");
        let recording = exact.recording(&shift);
        let greatest = { recording.points.iter() }
            .map(|p| p.deviation_mm.abs())
            .fold(0.0, f64::max);
        assert!(greatest < 1e-3, "{greatest}");
        let last = recording.points[recording.points.len() - 1];
        assert!(last.along_mm > 59.0, "{last:?}");
    }

    #[test]
    fn eq1_the_left_of_the_motion_is_positive() {
        let off = corner(0.004).recording(&Vector2::new(7.0, -3.0));
        let early = off.points[40];
        assert!((early.deviation_mm - 0.004).abs() < 1e-9, "{early:?}");
    }

    #[test]
    fn the_way_to_the_path_is_no_part_of_it() {
        let mut path = corner(0.0);
        // Half a micrometre beside the path, but 50 beside it on the way there, at a tenth of the rate.
        for reading in &mut path.read {
            let is_run_in = reading.command < 1000;
            reading.place_mm.y += if is_run_in { 0.05 } else { 0.0005 };
        }
        let at = |k: i64| Stamp::from_nanos(k * 1_000_000);
        let sparse = (1..=100).map(|k| (at(10 * k), 0.01));
        let close = (1001..3000).map(|k| (at(k), 0.001));
        path.states = sparse.chain(close).collect();
        let n = path.read.len();
        path.keep_evaluated();
        let left_out = path.run_in.unwrap();
        assert!((140..=145).contains(&left_out), "{left_out}");
        assert_eq!(path.read.len() + left_out, n);
        let recording = path.recording(&shift_mm(&[&path]));
        let greatest = { recording.points.iter() }
            .map(|p| p.deviation_mm.abs())
            .fold(0.0, f64::max);
        assert!(greatest < 2e-3, "{greatest}");
        assert!(recording.points[0].along_mm.abs() < 1e-12);
        // States of one rate mark nothing.
        let mut whole = corner(0.0);
        whole.states = (0..3000).map(|k| (at(k), 0.001)).collect();
        whole.keep_evaluated();
        assert_eq!((whole.run_in, whole.read.len()), (None, n));
    }

    #[test]
    fn whole_circles_and_paths_that_were_broken_off_are_none() {
        let mut paths = Paths::default();
        let mut segment = TestSegment::of_kind(TestKind::Line, 1, Stamp::default());
        segment.plane = TestPlane::Xy;
        paths.segment(&segment);
        assert!(paths.current.is_some());
        segment.begin = false;
        segment.completed = false;
        paths.segment(&segment);
        assert!(paths.recordings().is_empty());
        let mut paths = Paths::default();
        let mut circle = TestSegment::of_kind(TestKind::Circle, 1, Stamp::default());
        circle.plane = TestPlane::Xy;
        paths.segment(&circle);
        assert!(paths.current.is_none());
    }
}
