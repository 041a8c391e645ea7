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
//! been one for `steady_s` (`steady`), as where the axis turns at a point it is not. What differs from the table by
//! more than `believed` (a chip, a scale that lost counts) is refused and said.
//!
//! With tables apart, a pass upwards refreshes the table of upwards. Together, each pass refreshes the one
//! there is, which then trembles by ω/(2 − ω) of half the lost motion as directions alternate.
//!
//! Work seldom passes every point: it turns before the ends, and goes fast between holes. Points that are never passed would
//! stay as they were learned while the screw beside them grows. With `unpassed_follow` they take their share of each change of Δ(m)
//! in (1), with k the next point beyond them that was passed within [`MEASURED_S`],
//!
//! ```text
//!   Δ(i) ← Δ(i) + change of Δ(m)                                  where there is no such k                  (5)
//!   Δ(i) ← Δ(i) + change of Δ(m) [x(k) − x(i)]/[x(k) − x(m)]      between m and k                           (6)
//! ```
//!
//! for all i that were not passed within that time, on both sides of m. So ends keep the difference that was learned to the
//! outermost point that is passed, gaps are bridged straight, and where every point is passed there is (1) alone. A choice of
//! ours: right for what grows or shifts as a whole. Of tables apart one that nothing has measured follows the other.
//!
//! # Agreement
//! `val_ewma_remembers_2_minus_w_over_w_passes`: 5.667 to 1e-9. `val_ewma_noise_gain`: variance ratio of 4,000
//! points within its 99.9 % χ² interval about 0.1765. `val_ewma_lags_a_drift_by_its_closed_form`: within 4 fm.
//!
//! # References
//! The form of the mean is DERIVED, see `positioning`; its moments are those of S. W. Roberts'
//! geometric moving average.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::deviation_table::DeviationTable;
use super::direction::Direction;
use super::ends::Ends;
use super::offset::share_fm;
use super::steady::Steady;
use crate::femtometre::FM_PER_MM;

/// Whether both directions of motion share a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Directions {
    /// One mean of both, as published: lost motion averages away.
    Together,
    /// One table each: lost motion is compensated at each reversal.
    Apart,
}

/// For how long a pass counts for its point, s: shorter than what a screw takes to warm up, longer than a part.
pub const MEASURED_S: f64 = 1800.0;

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

/// What becomes of points that are not passed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unpassed {
    /// They stay.
    #[default]
    Stay,
    /// The ends alone, by the rule of before (`ends`).
    EndsFollow,
    /// (5) and (6).
    Follow,
}

/// Refreshes one table.
#[derive(Clone, Debug, PartialEq)]
pub struct Refresh {
    weight: f64,
    directions: Directions,
    feed_limit_mm_s: f64,
    believed_fm: i64,
    pulse_fm: i64,
    unpassed: Unpassed,
    ends: Ends,
    steady: Steady,
    /// Time of the states so far, s.
    time_s: f64,
    /// When each point was passed last, up and down, s.
    passed_s: [Vec<f64>; 2],
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
            unpassed: Unpassed::Stay,
            ends: Ends::default(),
            steady: Steady::new(0.0, pulse_fm),
            time_s: 0.0,
            passed_s: [Vec::new(), Vec::new()],
            before: None,
        }
    }

    /// The same, with another rule for points that are not passed.
    #[must_use]
    pub fn with_unpassed(mut self, unpassed: Unpassed) -> Self {
        self.unpassed = unpassed;
        self
    }

    /// The same, whose passes count once the speed was one for `steady_s`.
    #[must_use]
    pub fn with_steadiness(mut self, steady_s: f64) -> Self {
        self.steady = Steady::new(steady_s, self.pulse_fm);
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
        self.ends = Ends::new(table.n_points());
        self.passed_s = [(); 2].map(|()| vec![f64::NEG_INFINITY; table.n_points()]);
    }

    /// One state, `dt_s` after the one before; (1) for each point passed in between.
    pub fn observe(
        &mut self,
        table: &mut DeviationTable,
        now: ScaleReading,
        dt_s: f64,
    ) -> Refreshed {
        let mut refreshed = Refreshed::default();
        self.time_s += dt_s;
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
        let measured = match self.directions {
            Directions::Apart => direction,
            Directions::Together => Direction::Up,
        };
        if let Some(passed_s) = self.passed_s[measured as usize].get_mut(point) {
            *passed_s = self.time_s;
        }
        if self.unpassed == Unpassed::EndsFollow {
            let following = self.ends.pass(point, measured as usize, self.weight);
            for of in [Direction::Up, Direction::Down] {
                if of == measured || self.directions == Directions::Together {
                    following
                        .clone()
                        .for_each(|place| add(table, place, of, moved_fm));
                }
            }
            return Ok(());
        }
        for of in [Direction::Up, Direction::Down] {
            if of == measured || self.moves_along(of) {
                self.spread(table, (point, measured), of, moved_fm);
            }
        }
        Ok(())
    }

    /// Whether a table takes what the other one measures.
    fn moves_along(&self, of: Direction) -> bool {
        let points = 0..self.passed_s[of as usize].len();
        let mut fresh = points.filter(|point| self.is_fresh(*point, of));
        self.directions == Directions::Together
            || (self.unpassed == Unpassed::Follow && fresh.next().is_none())
    }

    fn is_fresh(&self, point: usize, of: Direction) -> bool {
        let passed_s = self.passed_s[of as usize].get(point);
        passed_s.is_some_and(|passed_s| self.time_s - passed_s <= MEASURED_S)
    }

    /// The point's change, and (5) and (6) of the others.
    fn spread(
        &self,
        table: &mut DeviationTable,
        (point, measured): (usize, Direction),
        of: Direction,
        moved_fm: i64,
    ) {
        add(table, point, of, moved_fm);
        if self.unpassed != Unpassed::Follow {
            return;
        }
        let n = table.n_points();
        let next = (point + 1..n).find(|place| self.is_fresh(*place, measured));
        for place in point + 1..next.unwrap_or(n) {
            let share = next.map_or(1.0, |next| share_of(table, [point, place, next]));
            add(table, place, of, share_fm(share, moved_fm));
        }
        let next = (0..point)
            .rev()
            .find(|place| self.is_fresh(*place, measured));
        for place in next.map_or(0, |next| next + 1)..point {
            let share = next.map_or(1.0, |next| share_of(table, [point, place, next]));
            add(table, place, of, share_fm(share, moved_fm));
        }
    }
}

/// (6): how near i is to m, of the way from m to k.
fn share_of(table: &DeviationTable, [m, i, k]: [usize; 3]) -> f64 {
    let way_fm = |from: usize, to: usize| {
        let ends = table.position_fm(from).zip(table.position_fm(to));
        ends.map_or(0, |(from, to)| to - from) as f64
    };
    way_fm(i, k) / way_fm(m, k)
}

fn add(table: &mut DeviationTable, point: usize, of: Direction, moved_fm: i64) {
    if let Some(now_fm) = table.point_fm(point, of) {
        table.replace(point, of, now_fm + moved_fm);
    }
}

#[cfg(test)]
mod tests;
