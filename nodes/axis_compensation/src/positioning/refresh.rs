//! Keeps the table up to date while the machine works: at each pass of a point a little of what is measured.
//!
//! # Model
//!
//! ```text
//!   Δ(j) ← Δ(j) + round{ω [(xs − xm)|_j − Δ(j)]}                                  (1)
//! ```
//!
//! An exponentially weighted mean. A pass that lies i passes back has the weight ω (1 − ω)^i, so
//!
//! ```text
//!   effective number of passes   1/Σ w² = (2 − ω)/ω            5.67 at ω = 0.3     (2)
//!   variance of Δ(j)             ω/(2 − ω) of one pass'        0.176 at ω = 0.3    (3)
//!   lag behind a drift r a pass  r (1 − ω)/ω [1 − (1 − ω)^k]   after k passes      (4)
//! ```
//!
//! The command passes x_j between two states; xs − xm is taken straight between them. Only a pass below
//! the feed limit counts, with states less than 1 mm apart: faster, the time between the two readings of
//! one state and the axis' elastic wind-up would be learned as deviation. What differs from the table
//! by more than `believed` (a chip, a scale that lost counts) is refused and said.
//!
//! With tables apart, a pass upwards refreshes the table of upwards. Together, each pass refreshes the one
//! there is, which then trembles by ω/(2 − ω) of half the lost motion as directions alternate.
//!
//! Work seldom reaches both ends. Points that are never passed would stay as they were learned while the screw beside them
//! grows: with `ends_follow` they move as the outermost point that was passed,
//!
//! ```text
//!   Δ(i) ← Δ(i) + change of Δ(m) in (1)   for all i beyond m,  m the outermost point passed n > (2 − ω)/ω times     (5)
//! ```
//!
//! a choice of ours, and an extrapolation: right for what grows or shifts as a whole. What m takes in its first n passes is its
//! own: readings of a moving axis differ a little from those at its dwells, by which the table was learned.
//!
//! # Agreement
//! `val_ewma_remembers_2_minus_w_over_w_passes`: 5.667 to 1e-9. `val_ewma_noise_gain`: variance ratio of 4,000
//! points within its 99.9 % χ² interval about 0.1765. `val_ewma_lags_a_drift_by_its_closed_form`: within 4 fm.
//!
//! # References
//! The form of the mean is DERIVED, see `positioning`; its moments are those of S. W. Roberts'
//! geometric moving average.

use serde::{Deserialize, Serialize};

use super::deviation_table::DeviationTable;
use super::direction::Direction;
use super::offset::share_fm;
use crate::femtometre::FM_PER_MM;

/// Whether both directions of motion share a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Directions {
    /// One mean of both, as published: lost motion averages away.
    Together,
    /// One table each: lost motion is compensated at each reversal.
    Apart,
}

/// Greatest distance between the two states about a pass, mm.
pub const PASS_STEP_MM: f64 = 1.0;

/// Where command and slide are at one state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScaleReading {
    /// Command, fm.
    pub commanded_fm: i64,
    /// xs − xm, fm.
    pub deviation_fm: i64,
}

/// A measurement that was not believed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Doubted {
    /// The point, fm.
    pub position_fm: i64,
    /// What was measured less the table, fm.
    pub change_fm: i64,
}

/// What a state did to the table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Refreshed {
    /// Points that took a measurement.
    pub n_points: u32,
    /// The last that refused one.
    pub doubted: Option<Doubted>,
}

/// Refreshes one table.
#[derive(Clone, Debug, PartialEq)]
pub struct Refresh {
    weight: f64,
    directions: Directions,
    feed_limit_mm_s: f64,
    believed_fm: i64,
    pulse_fm: i64,
    ends_follow: bool,
    /// How often each point was passed, up and down.
    passes: [Vec<u32>; 2],
    before: Option<ScaleReading>,
}

impl Refresh {
    /// Nothing passed yet, on a control whose commands are known to a pulse of `pulse_fm`.
    #[must_use]
    pub fn new(
        weight: f64,
        directions: Directions,
        feed_limit_mm_s: f64,
        believed_fm: i64,
        pulse_fm: i64,
    ) -> Self {
        Self {
            weight,
            directions,
            feed_limit_mm_s,
            believed_fm,
            pulse_fm,
            ends_follow: false,
            passes: [Vec::new(), Vec::new()],
            before: None,
        }
    }

    /// The same, with (5) or without.
    #[must_use]
    pub fn with_ends_following(mut self, ends_follow: bool) -> Self {
        self.ends_follow = ends_follow;
        self
    }

    /// The next state does not follow the last one.
    pub fn forget(&mut self) {
        self.before = None;
    }

    /// A table of so many points begins, none of which was passed yet.
    pub fn begin(&mut self, n_points: usize) {
        self.before = None;
        self.passes = [vec![0; n_points], vec![0; n_points]];
    }

    /// One state, `dt_s` after the one before; (1) for each point passed in between.
    pub fn observe(
        &mut self,
        table: &mut DeviationTable,
        now: ScaleReading,
        dt_s: f64,
    ) -> Refreshed {
        let mut refreshed = Refreshed::default();
        let Some(before) = self.before.replace(now) else {
            return refreshed;
        };
        let step_fm = now.commanded_fm.saturating_sub(before.commanded_fm);
        let step_mm = (step_fm as f64 / FM_PER_MM).abs();
        // A command at the limit itself advances by a rounding more in every second tick.
        let limit_mm = self.feed_limit_mm_s * dt_s + self.pulse_fm as f64 / FM_PER_MM;
        let is_slow = step_mm <= PASS_STEP_MM && step_mm <= limit_mm;
        if step_fm == 0 || self.weight <= 0.0 || !is_slow {
            return refreshed;
        }
        let direction = if step_fm > 0 {
            Direction::Up
        } else {
            Direction::Down
        };
        for point in table.points_passed(before.commanded_fm, now.commanded_fm) {
            let Some(position_fm) = table.position_fm(point) else {
                continue;
            };
            let share = (position_fm - before.commanded_fm) as f64 / step_fm as f64;
            let risen_fm = now.deviation_fm.saturating_sub(before.deviation_fm);
            let measured_fm = before.deviation_fm + share_fm(share, risen_fm);
            match self.take(table, point, direction, measured_fm) {
                Ok(()) => refreshed.n_points += 1,
                Err(change_fm) => {
                    refreshed.doubted = Some(Doubted {
                        position_fm,
                        change_fm,
                    });
                }
            }
        }
        refreshed
    }

    /// (1) for one point; what was measured less the table where that is not believed, fm.
    fn take(
        &mut self,
        table: &mut DeviationTable,
        point: usize,
        direction: Direction,
        measured_fm: i64,
    ) -> Result<(), i64> {
        let Some(old_fm) = table.point_fm(point, direction) else {
            return Ok(());
        };
        let change_fm = measured_fm.saturating_sub(old_fm);
        if change_fm.saturating_abs() > self.believed_fm {
            return Err(change_fm);
        }
        let moved_fm = share_fm(self.weight, change_fm);
        let (least, greatest) = self.beyond(point, direction, table.n_points());
        for place in least..greatest {
            let tables = match self.directions {
                Directions::Apart => &[direction][..],
                Directions::Together => &[Direction::Up, Direction::Down],
            };
            for &of in tables {
                if let Some(before_fm) = table.point_fm(place, of) {
                    table.replace(place, of, before_fm + moved_fm);
                }
            }
        }
        Ok(())
    }

    /// The point and those that follow it by (5), from the first to one behind the last.
    fn beyond(&mut self, point: usize, direction: Direction, n_points: usize) -> (usize, usize) {
        let table = match self.directions {
            Directions::Apart => direction as usize,
            Directions::Together => 0,
        };
        let passes = &mut self.passes[table];
        let Some(count) = passes.get_mut(point) else {
            return (point, point + 1);
        };
        *count = count.saturating_add(1);
        let is_settled = |count: &u32| f64::from(*count) * self.weight > 2.0 - self.weight;
        if !self.ends_follow || !is_settled(&passes[point]) {
            return (point, point + 1);
        }
        let from = if passes[..point].iter().any(is_settled) {
            point
        } else {
            0
        };
        let to = if passes[point + 1..].iter().any(is_settled) {
            point + 1
        } else {
            n_points
        };
        (from, to)
    }
}

#[cfg(test)]
mod tests;
