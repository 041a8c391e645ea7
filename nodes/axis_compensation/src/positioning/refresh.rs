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
//! one state and the axis' elastic wind-up would be learned as deviation. So would they where the speed changes: it must have
//! been one for `settle_s` ([`super::steady`]), as where the axis turns at a point it is not. What differs from the table by
//! more than `believed` (a chip, a scale that lost counts) is refused and said.
//!
//! With tables apart, a pass upwards refreshes the table of upwards. Together, each pass refreshes the one
//! there is, which then trembles by ω/(2 − ω) of half the lost motion as directions alternate.
//!
//! Work seldom reaches both ends. Points that are never passed would stay as they were learned while the screw beside them
//! grows: with `ends_follow` they move as the outermost point of the work does,
//!
//! ```text
//!   Δ(i) ← Δ0(i) + Δ(m) − Δ0(m)   at each pass of m, for all i beyond it, with Δ0 as it was learned          (5)
//!   of the work:  p(j) > (2 − ω)/ω  and  10 p(j) ≥ greatest p                                                (6)
//!   m:  of the work, and no i beyond it is, nor was passed half as often
//! ```
//!
//! where a point was passed p times. A choice of ours, and an extrapolation: right for what grows or shifts as a whole. The few
//! passes of its own that a point beyond m has are thereby left out; a point becomes one of the work once it is passed a tenth
//! as often as the one that is passed most.
//!
//! # Agreement
//! `val_ewma_remembers_2_minus_w_over_w_passes`: 5.667 to 1e-9. `val_ewma_noise_gain`: variance ratio of 4,000
//! points within its 99.9 % χ² interval about 0.1765. `val_ewma_lags_a_drift_by_its_closed_form`: within 4 fm.
//!
//! # References
//! The form of the mean is DERIVED, see `positioning`; its moments are those of S. W. Roberts'
//! geometric moving average.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::deviation_table::DeviationTable;
use super::direction::Direction;
use super::offset::share_fm;
use super::steady::Steady;
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
    steady: Steady,
    /// How often each point was passed, up and down.
    passes: [Vec<u32>; 2],
    /// The table as it began, up and down, fm.
    learned_fm: [Vec<i64>; 2],
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
            steady: Steady::new(0.0, pulse_fm),
            passes: [Vec::new(), Vec::new()],
            learned_fm: [Vec::new(), Vec::new()],
            before: None,
        }
    }

    /// The same, with (5) or without.
    #[must_use]
    pub fn with_ends_following(mut self, ends_follow: bool) -> Self {
        self.ends_follow = ends_follow;
        self
    }

    /// The same, whose passes count once the speed was one for `settle_s`.
    #[must_use]
    pub fn with_settling(mut self, settle_s: f64) -> Self {
        self.steady = Steady::new(settle_s, self.pulse_fm);
        self
    }

    /// The next state does not follow the last one.
    pub fn forget(&mut self) {
        self.before = None;
        self.steady.forget();
    }

    /// A table begins, none of whose points was passed yet.
    pub fn begin(&mut self, table: &DeviationTable) {
        self.forget();
        self.passes = [(); 2].map(|()| vec![0; table.n_points()]);
        self.learned_fm = [Direction::Up, Direction::Down].map(|direction| {
            let points = 0..table.n_points();
            points
                .filter_map(|point| table.point_fm(point, direction))
                .collect()
        });
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
        let is_steady = self.steady.advance(step_fm, dt_s);
        if step_fm == 0 || self.weight <= 0.0 || !is_slow || !is_steady {
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
        let apart = [direction];
        let tables = match self.directions {
            Directions::Apart => &apart[..],
            Directions::Together => &[Direction::Up, Direction::Down],
        };
        for &of in tables {
            let now_fm = table.point_fm(point, of).unwrap_or_default();
            table.replace(point, of, now_fm + moved_fm);
        }
        if let Some(count) = self.passes[tables[0] as usize].get_mut(point) {
            *count = count.saturating_add(1);
        }
        if self.ends_follow {
            for beyond in [0..point, point + 1..table.n_points()] {
                if self.is_outermost(point, &beyond, tables[0]) {
                    self.carry_along(table, point, beyond, tables);
                }
            }
        }
        Ok(())
    }

    /// (6).
    fn is_outermost(&self, point: usize, beyond: &Range<usize>, table: Direction) -> bool {
        let passes = &self.passes[table as usize];
        let (Some(&own), Some(others)) = (passes.get(point), passes.get(beyond.clone())) else {
            return false;
        };
        let most = passes.iter().copied().max().unwrap_or_default();
        let is_of_the_work = |count: u32| {
            f64::from(count) * self.weight > 2.0 - self.weight && count.saturating_mul(10) >= most
        };
        let is_left_aside = |count: &u32| !is_of_the_work(*count) && count.saturating_mul(2) < own;
        is_of_the_work(own) && others.iter().all(is_left_aside)
    }

    /// (5).
    fn carry_along(
        &self,
        table: &mut DeviationTable,
        point: usize,
        beyond: Range<usize>,
        tables: &[Direction],
    ) {
        for &of in tables {
            let learned_fm = &self.learned_fm[of as usize];
            let (Some(now_fm), Some(then_fm)) = (table.point_fm(point, of), learned_fm.get(point))
            else {
                continue;
            };
            for place in beyond.clone() {
                if let Some(own_fm) = learned_fm.get(place) {
                    table.replace(place, of, own_fm + now_fm - then_fm);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
