//! Learns the table: mean deviation per point from 10 to 20 runs along the axis.
//!
//! # Model
//!
//! ```text
//!   Δ_s(j) = (1/n) Σ_i (xs − xm) over the dwells at x_j approached in direction s     (1)
//!   together: Δ(j) = mean of Δ_up(j) and Δ_down(j), or the one there is               (2)
//! ```
//!
//! A *run* visits each point once, in one direction or in both. One test segment may hold one run or all of
//! them; segments add up until enough runs are there. A segment of repetition 0, another set-up or
//! another zero begins anew. The command cancels: a deviation from the motor encoder needs no reference.
//!
//! The means of both directions count equally in (2), also at the ends of a way without overrun, where
//! one direction may miss; the published mean over all visits is the same where none does.
//!
//! # Holds when
//! The other axes stand. Machine and scale do not drift within the n runs: drift from run to run goes into
//! the mean unseen.
//!
//! # References
//! CN 1562563 A, claim 1, steps (1) to (3): n from 10 to 20, points every 10 to 20 mm.

use metrology::Axis;
use metrology::sample::TestSegment;

use super::deviation_table::{DeviationTable, SPACING_MM, SPACING_TOLERANCE_MM};
use super::direction::Direction;
use super::dwell::{Dwells, Visit};
use super::refresh::Directions;
use super::refusal::PositioningRefusal;
use crate::femtometre::{FM_PER_MM, mm_from_fm};

/// Least and greatest number of runs: CN 1562563 A, claim 1, step (1).
pub const RUN_RANGE: (u32, u32) = (10, 20);

#[expect(
    clippy::cast_possible_truncation,
    reason = "1e9 fm is a whole number inside i64"
)]
const SAME_POINT_FM: i64 = (SPACING_TOLERANCE_MM * FM_PER_MM) as i64;

/// A mean under way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Mean {
    n: u32,
    mean_mm: f64,
}

impl Mean {
    fn add(&mut self, other: Self) {
        let n = self.n + other.n;
        if n > 0 {
            self.mean_mm += (other.mean_mm - self.mean_mm) * f64::from(other.n) / f64::from(n);
        }
        self.n = n;
    }
}

/// Dwells at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    position_fm: i64,
    up: Mean,
    down: Mean,
}

impl Point {
    fn mean(&self, direction: Direction) -> Mean {
        match direction {
            Direction::Up => self.up,
            Direction::Down => self.down,
        }
    }

    fn mean_mut(&mut self, direction: Direction) -> &mut Mean {
        match direction {
            Direction::Up => &mut self.up,
            Direction::Down => &mut self.down,
        }
    }
}

/// What is learned, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lesson {
    /// The axis.
    pub axis: Axis,
    /// Whether directions are kept apart.
    pub directions: Directions,
    /// Runs after which there is a table.
    pub runs: u32,
    /// As many points as the travel has room for.
    pub most_points: usize,
}

/// How far the learning is at the end of a segment.
#[derive(Clone, Debug, PartialEq)]
pub enum Progress {
    /// More runs are needed.
    Collected {
        /// Runs so far.
        runs: u32,
    },
    /// Enough.
    Learned {
        /// The new table.
        table: DeviationTable,
        /// Runs behind it.
        runs: u32,
    },
}

/// Learns the table of one axis; allocates only when made and at the end of a segment.
#[derive(Clone, Debug, PartialEq)]
pub struct Learning {
    lesson: Lesson,
    dwells: Dwells,
    is_under_way: bool,
    /// Place of the segment's first dwell.
    arrival_fm: Option<i64>,
    /// Of the segment under way.
    segment: Vec<Point>,
    /// Of the segments before it.
    kept: Vec<Point>,
    kept_setup: Option<(u32, u32)>,
    fault: Option<PositioningRefusal>,
}

impl Learning {
    /// Nothing learned yet.
    #[must_use]
    pub fn new(lesson: Lesson, dwells: Dwells) -> Self {
        Self {
            lesson,
            dwells,
            is_under_way: false,
            arrival_fm: None,
            segment: Vec::with_capacity(lesson.most_points),
            kept: Vec::with_capacity(lesson.most_points),
            kept_setup: None,
            fault: None,
        }
    }

    /// A positioning test begins.
    pub fn begin(&mut self, segment: &TestSegment) {
        self.leave();
        self.is_under_way = true;
        let setup = Some((segment.setup_id, segment.zero_id));
        if segment.repeat == 0 || self.kept_setup != setup {
            self.kept.clear();
        }
        self.kept_setup = setup;
    }

    /// Leaves the segment under way and what it said.
    pub fn leave(&mut self) {
        self.is_under_way = false;
        self.arrival_fm = None;
        self.segment.clear();
        self.dwells.forget();
        self.fault = None;
    }

    /// The next state does not follow the last one.
    pub fn forget(&mut self) {
        self.dwells.forget();
    }

    /// Whether a test is under way.
    #[must_use]
    pub fn is_under_way(&self) -> bool {
        self.is_under_way
    }

    /// Points at which the axis dwelled in this segment, the one where it stands included.
    #[must_use]
    pub fn n_points(&self) -> usize {
        let mut dwells = self.dwells;
        let is_new = dwells
            .end()
            .is_some_and(|visit| find(&self.segment, visit.position_fm).is_err());
        self.segment.len() + usize::from(is_new)
    }

    /// One state of the axis, `dt_s` after the one before.
    pub fn observe(
        &mut self,
        commanded_fm: i64,
        direction: Option<Direction>,
        deviation_mm: f64,
        dt_s: f64,
    ) {
        if !self.is_under_way {
            return;
        }
        if let Some(visit) = self
            .dwells
            .observe(commanded_fm, direction, deviation_mm, dt_s)
        {
            self.visit(visit);
        }
    }

    fn visit(&mut self, visit: Visit) {
        let axis = self.lesson.axis;
        if !visit.deviation_mm.is_finite() {
            self.fault.get_or_insert(PositioningRefusal::ScaleMissing {
                axis,
                position_mm: mm_from_fm(visit.position_fm),
            });
        }
        self.arrival_fm.get_or_insert(visit.position_fm);
        let place = match find(&self.segment, visit.position_fm) {
            Ok(place) => place,
            Err(_) if self.segment.len() >= self.lesson.most_points => {
                let most = self.lesson.most_points;
                self.fault
                    .get_or_insert(PositioningRefusal::TooManyPoints { axis, most });
                return;
            }
            Err(place) => {
                let point = Point {
                    position_fm: visit.position_fm,
                    up: Mean::default(),
                    down: Mean::default(),
                };
                self.segment.insert(place, point);
                place
            }
        };
        if let Some(point) = self.segment.get_mut(place) {
            point.mean_mut(visit.direction).add(Mean {
                n: 1,
                mean_mm: visit.deviation_mm,
            });
        }
    }

    /// The segment ends; its points are added to those before.
    ///
    /// # Errors
    /// When the segment's points are not used; those of the segments before stay, but for too many runs.
    pub fn end(&mut self, segment: &TestSegment) -> Result<Progress, PositioningRefusal> {
        if let Some(visit) = self.dwells.end() {
            self.visit(visit);
        }
        let (fault, axis) = (self.fault, self.lesson.axis);
        let mut points = std::mem::take(&mut self.segment);
        if let Some(arrival) = self.arrival_fm {
            leave_out_arrival(&mut points, arrival);
        }
        leave_out_overruns(&mut points);
        let outcome = match fault {
            _ if !segment.completed => Err(PositioningRefusal::RunBrokenOff {
                axis,
                run: segment.run,
            }),
            Some(fault) => Err(fault),
            None => self.add(&points).and_then(|()| self.table()),
        };
        self.segment = points;
        self.leave();
        outcome
    }

    fn add(&mut self, points: &[Point]) -> Result<(), PositioningRefusal> {
        let axis = self.lesson.axis;
        for direction in [Direction::Up, Direction::Down] {
            let visits = || points.iter().map(|point| point.mean(direction).n);
            let expected = visits().max().unwrap_or_default();
            for point in points {
                let visits = point.mean(direction).n;
                // At an end without overrun one direction may miss altogether, see the header.
                let is_end = self.lesson.directions == Directions::Together
                    && visits == 0
                    && is_end(points, point);
                if visits != expected && !is_end {
                    return Err(PositioningRefusal::RunIncomplete {
                        axis,
                        position_mm: mm_from_fm(point.position_fm),
                        direction,
                        visits,
                        expected,
                    });
                }
            }
        }
        if self.kept.is_empty() {
            self.kept.extend_from_slice(points);
            return Ok(());
        }
        let other = points
            .iter()
            .zip(&self.kept)
            .find(|(new, kept)| (new.position_fm - kept.position_fm).abs() > SAME_POINT_FM);
        let extra = points.get(self.kept.len()).or(self.kept.get(points.len()));
        if let Some(other) = other.map(|(new, _)| new).or(extra) {
            let position_mm = mm_from_fm(other.position_fm);
            return Err(PositioningRefusal::OtherPoints { axis, position_mm });
        }
        for (kept, new) in self.kept.iter_mut().zip(points) {
            kept.up.add(new.up);
            kept.down.add(new.down);
        }
        Ok(())
    }

    /// Runs collected so far: in each direction that there is, or in both.
    fn runs(&self) -> (u32, u32) {
        let most = |direction| {
            let visits = self.kept.iter().map(|point| point.mean(direction).n);
            visits.max().unwrap_or_default()
        };
        (most(Direction::Up), most(Direction::Down))
    }

    fn table(&mut self) -> Result<Progress, PositioningRefusal> {
        let Lesson {
            axis,
            directions,
            runs: needed,
            ..
        } = self.lesson;
        let (up, down) = self.runs();
        if directions == Directions::Apart && up.min(down) == 0 && up.max(down) >= needed {
            let direction = if up == 0 {
                Direction::Up
            } else {
                Direction::Down
            };
            return Err(PositioningRefusal::DirectionMissing { axis, direction });
        }
        let runs = if up.min(down) == 0 && directions == Directions::Together {
            up.max(down)
        } else {
            up.min(down)
        };
        if runs < needed {
            return Ok(Progress::Collected { runs });
        }
        let points = std::mem::take(&mut self.kept);
        let table = mean_table(axis, directions, runs, &points);
        self.kept = points;
        self.kept.clear();
        table.map(|table| Progress::Learned { table, runs })
    }
}

/// Leaves out an outermost place that was met from one side only, and nearer to the next one than points may be,
/// while all points between were met from both: the axis turned there, or stood there when the test began or ended.
fn leave_out_overruns(points: &mut Vec<Point>) {
    let from_one_side = |point: &Point| (point.up.n == 0) != (point.down.n == 0);
    let near = |a: &Point, b: &Point| {
        mm_from_fm(a.position_fm) - mm_from_fm(b.position_fm) < SPACING_MM.0 - SPACING_TOLERANCE_MM
    };
    let inner = points.get(2..points.len().saturating_sub(2));
    if !inner.is_some_and(|inner| !inner.is_empty() && !inner.iter().any(from_one_side)) {
        return;
    }
    if let [.., next, last] = points.as_slice()
        && from_one_side(last)
        && near(last, next)
    {
        points.pop();
    }
    if let [first, next, ..] = points.as_slice()
        && from_one_side(first)
        && near(next, first)
    {
        points.remove(0);
    }
}

/// Leaves out where the axis rested first, if it came there once while the points were met twice or more: it
/// stood there when the test began, or a reference was zeroed there.
fn leave_out_arrival(points: &mut Vec<Point>, arrival_fm: i64) {
    let met_once = |point: &Point| point.up.n + point.down.n == 1;
    // The far end of a run without overrun is met once too.
    let few = points.len() > 2 && points.iter().filter(|point| met_once(point)).count() <= 2;
    if let Ok(place) = find(points, arrival_fm)
        && few
        && points.get(place).is_some_and(met_once)
    {
        points.remove(place);
    }
}

/// Place of a point among others, or where it belongs.
fn find(points: &[Point], position_fm: i64) -> Result<usize, usize> {
    let place = points
        .partition_point(|point| point.position_fm < position_fm.saturating_sub(SAME_POINT_FM));
    match points.get(place) {
        Some(point) if point.position_fm <= position_fm.saturating_add(SAME_POINT_FM) => Ok(place),
        _ => Err(place),
    }
}

fn is_end(points: &[Point], point: &Point) -> bool {
    [points.first(), points.last()]
        .into_iter()
        .flatten()
        .any(|end| end.position_fm == point.position_fm)
}

/// (1) and (2).
fn mean_table(
    axis: Axis,
    directions: Directions,
    runs: u32,
    points: &[Point],
) -> Result<DeviationTable, PositioningRefusal> {
    let (lower, upper) = RUN_RANGE;
    if runs < lower || runs > upper {
        return Err(PositioningRefusal::RunsOutOfRange {
            axis,
            runs,
            lower,
            upper,
        });
    }
    let positions_mm: Vec<_> = points
        .iter()
        .map(|point| mm_from_fm(point.position_fm))
        .collect();
    let own = |direction| move |point: &Point| point.mean(direction).mean_mm;
    let both = |point: &Point| match (point.up, point.down) {
        (up, Mean { n: 0, .. }) => up.mean_mm,
        (Mean { n: 0, .. }, down) => down.mean_mm,
        (up, down) => up.mean_mm.midpoint(down.mean_mm),
    };
    let [up_mm, down_mm]: [Vec<f64>; 2] = match directions {
        Directions::Apart => [Direction::Up, Direction::Down]
            .map(|direction| points.iter().map(own(direction)).collect()),
        Directions::Together => [(); 2].map(|()| points.iter().map(both).collect()),
    };
    DeviationTable::new(axis, &positions_mm, &up_mm, &down_mm)
}

#[cfg(test)]
mod tests;
