//! Deviation of the slide from its motor, point by point, and straight in between.
//!
//! # Model
//!
//! For each direction of motion s, in the cell x_j to x_j+1:
//!
//! ```text
//!   Δ_s(x) = Δ_s(j) + round{[Δ_s(j+1) − Δ_s(j)]/[x(j+1) − x(j)] (x − x_j)},
//!   Δ_s(x) = Δ_s(1) below x_1, Δ_s(n) above x_n                                   (1)
//!   e = Δ_s(x) − Δ_s'(x')      for a motion from x, s to x', s'                   (2)
//! ```
//!
//! (2) is the increment Δxm − Δxs of the dual loop. A motion over several cells is a sum of such, one for
//! the piece in each, in which each border is met by the piece before and the piece after with the same
//! Δ(j): the sum telescopes to (2), exactly, since all are whole femtometres. Which of two cells a point
//! on their border belongs to is asked only for the slope: the one that the motion enters.
//!
//! # Holds when
//! 5 points or more, ascending, 10 to 20 mm apart. Outside of them the slope is 0.
//!
//! # Agreement
//! `prop_eq2_equals_the_published_increments_cell_by_cell`: within 2 fm.
//! `val_sampled_cosine_keeps_sinc_squared_of_its_amplitude`: below 1e-6 of the amplitude.

use metrology::Axis;
use metrology::sample::PositioningTable;
use metrology::{Host, Stamp};

use super::direction::Direction;
use super::refusal::PositioningRefusal;
use crate::femtometre::{fm_from_mm, mm_from_fm, rounded};

/// Least number of points: a choice; the published text gives none.
pub const LEAST_POINTS: usize = 5;
/// Least and greatest distance of neighbouring points, mm: CN 1562563 A, claim 1, step (1).
pub const SPACING_MM: (f64, f64) = (10.0, 20.0);
/// How far a distance of points may be beyond its limits, mm: rounding of commands.
pub const SPACING_TOLERANCE_MM: f64 = 1e-3;
/// Greatest deviation that is believed, mm: what offsets may have as their widest limit.
pub const DEVIATION_LIMIT_MM: f64 = 5.0;

/// Deviations at ascending points, apart for each direction of motion.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviationTable {
    positions_fm: Vec<i64>,
    up_fm: Vec<i64>,
    down_fm: Vec<i64>,
    /// The cells, up and down.
    lines: [Vec<Line>; 2],
    /// Cells per femtometre if all were alike: where the search for a cell begins.
    density_per_fm: f64,
}

// Slopes are quotients of whole numbers by lengths above zero: never NaN.
impl Eq for DeviationTable {}

impl DeviationTable {
    /// A table of deviations xs − xm at `positions_mm`.
    ///
    /// # Errors
    /// Names the first point or number that is refused.
    pub fn new(
        axis: Axis,
        positions_mm: &[f64],
        up_mm: &[f64],
        down_mm: &[f64],
    ) -> Result<Self, PositioningRefusal> {
        let points = positions_mm.len();
        for deviations in [up_mm.len(), down_mm.len()] {
            if deviations != points {
                return Err(PositioningRefusal::LengthsDiffer {
                    axis,
                    points,
                    deviations,
                });
            }
        }
        if points < LEAST_POINTS {
            return Err(PositioningRefusal::TooFewPoints {
                axis,
                points,
                least: LEAST_POINTS,
            });
        }
        let positions_fm = ascending(axis, positions_mm)?;
        let counted = |deviations_mm: &[f64]| -> Result<Vec<i64>, PositioningRefusal> {
            let pairs = positions_mm.iter().zip(deviations_mm);
            pairs
                .map(|(&position_mm, &deviation_mm)| {
                    believed(deviation_mm).ok_or(PositioningRefusal::DeviationOutOfRange {
                        axis,
                        position_mm,
                        deviation_mm,
                        limit_mm: DEVIATION_LIMIT_MM,
                    })
                })
                .collect()
        };
        let whole_fm = positions_fm[points - 1] - positions_fm[0];
        let mut table = Self {
            density_per_fm: (points - 1) as f64 / whole_fm as f64,
            up_fm: counted(up_mm)?,
            down_fm: counted(down_mm)?,
            lines: [Vec::new(), Vec::new()],
            positions_fm,
        };
        table.lines = [Direction::Up, Direction::Down].map(|direction| {
            (1..points)
                .map(|next| table.drawn(next - 1, direction))
                .collect()
        });
        Ok(table)
    }

    /// The straight line through both ends of a cell.
    fn drawn(&self, cell: usize, direction: Direction) -> Line {
        let (x_fm, deviations_fm) = (&self.positions_fm, self.deviations_fm(direction));
        let risen_fm = deviations_fm[cell + 1] - deviations_fm[cell];
        Line {
            x_fm: x_fm[cell],
            x_next_fm: x_fm[cell + 1],
            from_fm: deviations_fm[cell],
            slope: risen_fm as f64 / (x_fm[cell + 1] - x_fm[cell]) as f64,
        }
    }

    /// Number of points.
    #[must_use]
    pub fn n_points(&self) -> usize {
        self.positions_fm.len()
    }

    /// Position of a point, fm.
    #[must_use]
    pub fn position_fm(&self, point: usize) -> Option<i64> {
        self.positions_fm.get(point).copied()
    }

    #[inline]
    fn deviations_fm(&self, direction: Direction) -> &[i64] {
        match direction {
            Direction::Up => &self.up_fm,
            Direction::Down => &self.down_fm,
        }
    }

    /// The cell that a motion from `position_fm` goes through; `None` outside of the points, where the slope is 0.
    #[inline]
    fn line(&self, position_fm: i64, direction: Direction) -> Option<&Line> {
        let lines = &self.lines[direction as usize];
        let above_fm = position_fm.saturating_sub(self.positions_fm[0]);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a guess: below the first point it is 0, above the last one no cell"
        )]
        let guess = (above_fm as f64 * self.density_per_fm) as u32;
        match lines.get(guess as usize) {
            Some(line) if line.x_fm < position_fm && position_fm < line.x_next_fm => Some(line),
            _ => lines.get(self.cell_by_search(position_fm, direction)?),
        }
    }

    fn cell_by_search(&self, position_fm: i64, direction: Direction) -> Option<usize> {
        let before = match direction {
            Direction::Up => self
                .positions_fm
                .partition_point(|&x_fm| x_fm <= position_fm),
            Direction::Down => self
                .positions_fm
                .partition_point(|&x_fm| x_fm < position_fm),
        };
        (before < self.n_points())
            .then(|| before.checked_sub(1))
            .flatten()
    }

    /// Slope of the deviation in the cell that a motion from `position_fm` goes through, mm/mm.
    #[must_use]
    pub fn slope(&self, position_fm: i64, direction: Direction) -> f64 {
        let line = self.line(position_fm, direction);
        line.map_or(0.0, |line| line.slope)
    }

    /// Deviation xs − xm at a position, fm: (1). Both directions' mean where none is known yet.
    #[must_use]
    #[inline]
    pub fn deviation_fm(&self, position_fm: i64, direction: Option<Direction>) -> i64 {
        let Some(direction) = direction else {
            let up_fm = self.deviation_fm(position_fm, Some(Direction::Up));
            let down_fm = self.deviation_fm(position_fm, Some(Direction::Down));
            return up_fm.midpoint(down_fm);
        };
        match self.line(position_fm, direction) {
            Some(line) => line.at(position_fm),
            None => self.beyond_fm(position_fm, direction),
        }
    }

    /// What holds outside of the points, fm.
    fn beyond_fm(&self, position_fm: i64, direction: Direction) -> i64 {
        let deviations_fm = self.deviations_fm(direction);
        let is_below = self
            .positions_fm
            .first()
            .is_some_and(|&x_fm| position_fm <= x_fm);
        let end = if is_below {
            deviations_fm.first()
        } else {
            deviations_fm.last()
        };
        end.copied().unwrap_or_default()
    }

    /// Whether an error of this period looks the same at all points, to 1 % of the period.
    #[must_use]
    pub fn hides(&self, period_fm: i64) -> bool {
        let Some(&first_fm) = self.positions_fm.first().filter(|_| period_fm > 0) else {
            return false;
        };
        self.positions_fm.iter().all(|&x_fm| {
            let phase_fm = (x_fm - first_fm) % period_fm;
            phase_fm.min(period_fm - phase_fm) <= period_fm / 100
        })
    }

    /// The points that a motion of the command passes or arrives at, the one it leaves not included.
    #[must_use]
    pub fn points_passed(&self, from_fm: i64, to_fm: i64) -> std::ops::Range<usize> {
        let x_fm = &self.positions_fm;
        if to_fm >= from_fm {
            x_fm.partition_point(|&x| x <= from_fm)..x_fm.partition_point(|&x| x <= to_fm)
        } else {
            x_fm.partition_point(|&x| x < to_fm)..x_fm.partition_point(|&x| x < from_fm)
        }
    }

    /// Deviation at a point, fm.
    #[must_use]
    pub fn point_fm(&self, point: usize, direction: Direction) -> Option<i64> {
        self.deviations_fm(direction).get(point).copied()
    }

    /// Puts another deviation at a point, in one direction's table.
    pub(super) fn replace(&mut self, point: usize, direction: Direction, deviation_fm: i64) {
        let deviations_fm = match direction {
            Direction::Up => &mut self.up_fm,
            Direction::Down => &mut self.down_fm,
        };
        let Some(old_fm) = deviations_fm.get_mut(point) else {
            return;
        };
        *old_fm = deviation_fm;
        for cell in point.saturating_sub(1)..(point + 1).min(self.n_points() - 1) {
            self.lines[direction as usize][cell] = self.drawn(cell, direction);
        }
    }

    /// As it is published.
    #[must_use]
    pub fn published(&self, axis: Axis, about: Published) -> PositioningTable {
        let mm = |lengths_fm: &[i64]| lengths_fm.iter().copied().map(mm_from_fm).collect();
        PositioningTable {
            at: about.at,
            axis,
            position: mm(&self.positions_fm),
            deviation_up: mm(&self.up_fm),
            deviation_down: mm(&self.down_fm),
            n_runs: about.n_runs,
            weight: about.weight,
            sequence: about.sequence,
        }
    }
}

/// What is published beside the points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Published {
    /// When it was last changed.
    pub at: Stamp<Host>,
    /// Runs behind it.
    pub n_runs: u32,
    /// Weight of a new measurement.
    pub weight: f64,
    /// Counts publications.
    pub sequence: u32,
}

/// The deviation inside one cell.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Line {
    x_fm: i64,
    x_next_fm: i64,
    from_fm: i64,
    slope: f64,
}

impl Line {
    #[inline]
    fn at(&self, position_fm: i64) -> i64 {
        // Up to 2e13 fm inside the cell and 1e13 fm of deviation: the product is exact to a few
        // hundredths of a femtometre, so the cell's end gets its own deviation back.
        self.from_fm + rounded(self.slope * (position_fm - self.x_fm) as f64)
    }
}

/// A deviation in whole femtometres, unless it is beyond all belief.
pub(super) fn believed(deviation_mm: f64) -> Option<i64> {
    fm_from_mm(deviation_mm).filter(|_| deviation_mm.abs() <= DEVIATION_LIMIT_MM)
}

fn ascending(axis: Axis, positions_mm: &[f64]) -> Result<Vec<i64>, PositioningRefusal> {
    let mut positions_fm = Vec::with_capacity(positions_mm.len());
    let mut before_mm = None;
    for &position_mm in positions_mm {
        let position_fm = fm_from_mm(position_mm)
            .ok_or(PositioningRefusal::PositionNotFinite { axis, position_mm })?;
        if let Some(before_mm) = before_mm {
            let spacing_mm = position_mm - before_mm;
            if spacing_mm <= 0.0 {
                return Err(PositioningRefusal::NotAscending {
                    axis,
                    position_mm,
                    before_mm,
                });
            }
            let (lower_mm, upper_mm) = SPACING_MM;
            let is_inside = spacing_mm >= lower_mm - SPACING_TOLERANCE_MM
                && spacing_mm <= upper_mm + SPACING_TOLERANCE_MM;
            if !is_inside {
                return Err(PositioningRefusal::SpacingOutOfRange {
                    axis,
                    position_mm,
                    spacing_mm,
                    lower_mm,
                    upper_mm,
                });
            }
        }
        positions_fm.push(position_fm);
        before_mm = Some(position_mm);
    }
    Ok(positions_fm)
}

#[cfg(test)]
mod tests;
