//! Where an axis stood long enough, and what the scale said there.
//!
//! The axis stands while its command does. The first `settle_s` are left out, for the servo and the slide
//! to come to rest; after that all states are averaged, for `dwell_s` at least. Shorter stops (a reversal, a
//! block's end) are no dwells. Nor is the place where the axis stood before it first moved.

use super::direction::Direction;

/// Sums of ticks end a rounding before or after the time asked for.
const BEYOND_ROUNDING: f64 = 1.0 + 1e-9;

/// One dwell at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visit {
    /// Command, fm.
    pub position_fm: i64,
    /// How it was approached.
    pub direction: Direction,
    /// Mean of xs − xm, mm; NaN where the scale said nothing.
    pub deviation_mm: f64,
    /// States averaged.
    pub n: u32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Standing {
    position_fm: i64,
    direction: Option<Direction>,
    for_s: f64,
    mean_mm: f64,
    n: u32,
}

/// Finds the dwells of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dwells {
    tolerance_fm: i64,
    settle_s: f64,
    dwell_s: f64,
    standing: Option<Standing>,
}

impl Dwells {
    /// A command within `tolerance_fm` of where it was stands.
    #[must_use]
    pub fn new(tolerance_fm: i64, settle_s: f64, dwell_s: f64) -> Self {
        Self {
            tolerance_fm,
            settle_s,
            dwell_s,
            standing: None,
        }
    }

    /// The next state does not follow the last one: what was averaged is dropped.
    pub fn forget(&mut self) {
        self.standing = None;
    }

    /// One state, `dt_s` after the one before; the dwell that it ended, if any. `direction`: of the motion
    /// that led here, unknown before the first one.
    pub fn observe(
        &mut self,
        commanded_fm: i64,
        direction: Option<Direction>,
        deviation_mm: f64,
        dt_s: f64,
    ) -> Option<Visit> {
        if let Some(standing) = &mut self.standing
            && commanded_fm.abs_diff(standing.position_fm) < self.tolerance_fm.unsigned_abs()
        {
            standing.for_s += dt_s;
            if standing.for_s > self.settle_s * BEYOND_ROUNDING {
                standing.n += 1;
                standing.mean_mm += (deviation_mm - standing.mean_mm) / f64::from(standing.n);
            }
            return None;
        }
        let ended = self.end();
        self.standing = Some(Standing {
            position_fm: commanded_fm,
            direction,
            for_s: 0.0,
            mean_mm: 0.0,
            n: 0,
        });
        ended
    }

    /// No more states follow; the dwell that was going on, if it was one.
    pub fn end(&mut self) -> Option<Visit> {
        let standing = self.standing.take()?;
        let long_enough = (self.settle_s + self.dwell_s) / BEYOND_ROUNDING;
        let direction = standing.direction?;
        (standing.for_s >= long_enough && standing.n > 0).then_some(Visit {
            position_fm: standing.position_fm,
            direction,
            deviation_mm: standing.mean_mm,
            n: standing.n,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: Option<Direction> = Some(Direction::Up);

    fn stand(
        dwells: &mut Dwells,
        at_fm: i64,
        milliseconds: u32,
        deviation_mm: f64,
    ) -> Option<Visit> {
        (0..=milliseconds)
            .filter_map(|_| dwells.observe(at_fm, UP, deviation_mm, 1e-3))
            .last()
    }

    #[test]
    fn a_dwell_leaves_out_its_settling_and_averages_the_rest() {
        let mut dwells = Dwells::new(100, 0.2, 0.5);
        assert_eq!(stand(&mut dwells, 5000, 200, 99.0), None);
        for k in 0..600 {
            let deviation_mm = if k % 2 == 0 { 0.004 } else { 0.006 };
            assert_eq!(dwells.observe(5050, UP, deviation_mm, 1e-3), None);
        }
        let visit = dwells.observe(6000, UP, 1.0, 1e-3).unwrap();
        assert_eq!((visit.position_fm, visit.direction), (5000, Direction::Up));
        assert!((visit.deviation_mm - 0.005).abs() < 1e-6, "{visit:?}");
        // The 200th state is still settling, the 201st is not.
        assert_eq!(visit.n, 600);
    }

    #[test]
    fn short_stops_and_the_place_before_the_first_motion_are_no_dwells() {
        let mut dwells = Dwells::new(100, 0.2, 0.5);
        for _ in 0..2000 {
            assert_eq!(dwells.observe(0, None, 0.0, 1e-3), None);
        }
        assert_eq!(stand(&mut dwells, 1000, 650, 0.0), None);
        assert_eq!(stand(&mut dwells, 2000, 700, 0.0), None);
        assert_eq!(dwells.end().map(|visit| visit.position_fm), Some(2000));
        assert_eq!(dwells.end(), None);
    }

    #[test]
    fn one_reading_that_is_missing_spoils_its_dwell_and_a_gap_drops_it() {
        let mut dwells = Dwells::new(100, 0.0, 0.5);
        stand(&mut dwells, 1000, 300, 0.0);
        dwells.observe(1000, UP, f64::NAN, 1e-3);
        stand(&mut dwells, 1000, 300, 0.0);
        assert!(dwells.end().unwrap().deviation_mm.is_nan());
        stand(&mut dwells, 1000, 300, 0.0);
        dwells.forget();
        stand(&mut dwells, 1000, 300, 0.0);
        assert_eq!(dwells.end(), None);
    }
}
