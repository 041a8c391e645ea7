//! The commanded motion of one run, with what an effect asks of it.

use metrology::{Axis, AxisSet, PerAxis};

use super::error::TwinError;

/// Commanded motion of all axes during one run, one entry per recorded servo tick.
///
/// Every vector has the length of [`Motion::time_s`]. Linear axes in mm, rotary ones in rad. The record
/// begins before the test itself where the bag has it, so that play and friction know how they stand.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Seconds since the session's start, strictly growing.
    pub time_s: Vec<f64>,
    /// The axes that the machine has; vectors of others are empty.
    pub axes: AxisSet,
    /// Commanded position, compensation not included.
    pub position: PerAxis<Vec<f64>>,
    /// Its derivative, per second.
    pub velocity: PerAxis<Vec<f64>>,
    /// Its second derivative, per second squared.
    pub acceleration: PerAxis<Vec<f64>>,
    /// Acceleration of the axes themselves: that of the command, until [`Motion::follow`] puts the loops between.
    pub driven: PerAxis<Vec<f64>>,
    /// Direction of the latest motion: -1, +1, or 0 before the first.
    pub sense: PerAxis<Vec<i8>>,
    /// Way since the axis last turned round; infinite before the first turn.
    pub since_reversal: PerAxis<Vec<f64>>,
    /// Time since the axis last began to move the other way, s; infinite before the first turn.
    pub since_reversal_s: PerAxis<Vec<f64>>,
}

/// A step that is no motion: below a tenth of the finest pulse (mm, rad).
const STANDSTILL: f64 = 1e-6;

impl Motion {
    /// Builds the motion from time and commanded positions; velocity and acceleration are slopes of parabolas through
    /// neighbours, at whatever spacing they were recorded.
    ///
    /// # Errors
    /// [`TwinError::Lengths`] where an axis has another number of entries than time,
    /// [`TwinError::Time`] where time does not grow, [`TwinError::NotFinite`] for a position that is no number.
    pub fn new(
        time_s: Vec<f64>,
        axes: AxisSet,
        position: PerAxis<Vec<f64>>,
    ) -> Result<Self, TwinError> {
        for (index, pair) in time_s.windows(2).enumerate() {
            if !matches!(pair, [a, b] if a < b) {
                return Err(TwinError::Time {
                    index: index + 1,
                    time_s: pair[1],
                });
            }
        }
        for axis in axes.iter() {
            if position[axis].len() != time_s.len() {
                return Err(TwinError::Lengths {
                    axis,
                    found: position[axis].len(),
                    wanted: time_s.len(),
                });
            }
            if let Some(index) = position[axis].iter().position(|p| !p.is_finite()) {
                return Err(TwinError::NotFinite {
                    axis,
                    index,
                    value: position[axis][index],
                });
            }
        }
        let mut motion = Self {
            time_s,
            axes,
            position,
            ..Self::default()
        };
        for axis in axes.iter() {
            motion.velocity[axis] = derivative(&motion.time_s, &motion.position[axis]);
            motion.acceleration[axis] = derivative(&motion.time_s, &motion.velocity[axis]);
            motion.driven[axis].clone_from(&motion.acceleration[axis]);
            motion.turns(axis);
        }
        Ok(motion)
    }

    /// Number of ticks.
    #[must_use]
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether nothing was recorded.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Commanded position at an instant between ticks: the cubic through position and velocity of the
    /// ticks about it; where it stood before the first and after the last tick. Zero for an axis that the
    /// motion lacks.
    #[must_use]
    pub fn position_at(&self, axis: Axis, time_s: f64) -> f64 {
        let (position, velocity) = (&self.position[axis], &self.velocity[axis]);
        let after = self.time_s.partition_point(|t| *t <= time_s);
        let before = after.saturating_sub(1);
        let (Some(a), Some(b)) = (position.get(before), position.get(after)) else {
            return position.last().copied().unwrap_or(0.0);
        };
        if before == after {
            return *a;
        }
        let step_s = self.time_s[after] - self.time_s[before];
        let share = (time_s - self.time_s[before]) / step_s;
        let (from, to) = (velocity[before] * step_s, velocity[after] * step_s);
        let way = b - a;
        let bend = (3.0 * way - 2.0 * from - to) + share * (from + to - 2.0 * way);
        a + share * (from + share * bend)
    }

    fn turns(&mut self, axis: Axis) {
        let position = &self.position[axis];
        let mut sense = 0_i8;
        let mut has_turned = false;
        let (mut way, mut since_s) = (0.0, 0.0);
        let mut last = None;
        let (mut senses, mut ways, mut times) = (vec![], vec![], vec![]);
        for (&at_s, &here) in self.time_s.iter().zip(position) {
            if let Some((before_s, before)) = last {
                let step: f64 = here - before;
                since_s += at_s - before_s;
                if step.abs() > STANDSTILL {
                    let now = if step > 0.0 { 1 } else { -1 };
                    if now != sense {
                        has_turned |= sense != 0;
                        (sense, way, since_s) = (now, 0.0, at_s - before_s);
                    }
                    way += step.abs();
                    last = Some((at_s, here));
                } else {
                    last = Some((at_s, before));
                }
            } else {
                last = Some((at_s, here));
            }
            senses.push(sense);
            ways.push(if has_turned { way } else { f64::INFINITY });
            times.push(if has_turned { since_s } else { f64::INFINITY });
        }
        self.sense[axis] = senses;
        self.since_reversal[axis] = ways;
        self.since_reversal_s[axis] = times;
    }
}

/// Steps that differ by less are even, share of them.
const SAME_STEP: f64 = 1e-6;
/// A step that is shorter than this share of the other one is no lack of ticks: the slope over it alone would be noise.
const MIN_STEP_SHARE: f64 = 0.25;

/// The slope of the parabola through each value and its neighbours, so that a tick that was not recorded moves no slope. Beside
/// a very short step it is that between the neighbours. One-sided at the ends.
fn derivative(time_s: &[f64], value: &[f64]) -> Vec<f64> {
    let n = value.len();
    (0..n)
        .map(|k| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(n - 1));
            if a == b {
                return 0.0;
            }
            let whole = (value[b] - value[a]) / (time_s[b] - time_s[a]);
            let (before_s, after_s) = (time_s[k] - time_s[a], time_s[b] - time_s[k]);
            let is_even = (after_s - before_s).abs() <= SAME_STEP * (after_s + before_s);
            let is_short = before_s.min(after_s) < MIN_STEP_SHARE * before_s.max(after_s);
            if is_even || is_short {
                return whole;
            }
            let before = (value[k] - value[a]) / before_s;
            let after = (value[b] - value[k]) / after_s;
            (before * after_s + after * before_s) / (before_s + after_s)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one_axis(position: Vec<f64>) -> Motion {
        let time_s = (0..position.len())
            .map(|k| 0.001 * f64::from(u32::try_from(k).expect("few")))
            .collect();
        let mut all = PerAxis::<Vec<f64>>::default();
        all[Axis::X] = position;
        Motion::new(time_s, AxisSet::EMPTY.with(Axis::X), all).expect("a motion")
    }

    #[test]
    fn way_since_reversal_starts_at_the_turn() {
        let motion = one_axis(vec![0.0, 0.1, 0.2, 0.1, 0.1, 0.0]);
        assert_eq!(motion.sense[Axis::X], [0, 1, 1, -1, -1, -1]);
        assert!(motion.since_reversal[Axis::X][2].is_infinite());
        assert!((motion.since_reversal[Axis::X][3] - 0.1).abs() < 1e-12);
        assert!((motion.since_reversal[Axis::X][5] - 0.2).abs() < 1e-12);
        assert!((motion.since_reversal_s[Axis::X][5] - 0.003).abs() < 1e-12);
    }

    #[test]
    fn position_between_ticks_is_that_of_a_parabola_and_holds_beyond() {
        let motion = one_axis((0..6).map(|k| 0.5 * f64::from(k * k)).collect());
        let at = |ticks: f64| motion.position_at(Axis::X, 0.001 * ticks);
        for ticks in [1.0, 1.25, 2.5, 3.9] {
            assert!((at(ticks) - 0.5 * ticks * ticks).abs() < 1e-9, "{ticks}");
        }
        assert!(at(-3.0).abs() < 1e-12);
        assert!((at(9.0) - 12.5).abs() < 1e-12);
        assert!(motion.position_at(Axis::Y, 0.002).abs() < 1e-12);
    }

    #[test]
    fn ticks_that_were_not_recorded_move_neither_velocity_nor_acceleration() {
        let is_missing = |k: &usize| k % 17 == 5 || k % 23 == 9;
        let time_s: Vec<f64> = (0..2000)
            .filter(|k| !is_missing(k))
            .map(|k| 0.004 * k as f64)
            .collect();
        let (radius_mm, rad_per_s) = (50.0, 2.0_f64);
        let mut all = PerAxis::<Vec<f64>>::default();
        all[Axis::X] = time_s
            .iter()
            .map(|t| radius_mm * (rad_per_s * t).cos())
            .collect();
        let motion = Motion::new(time_s, AxisSet::EMPTY.with(Axis::X), all).expect("a motion");
        let (speed, bend) = (radius_mm * rad_per_s, radius_mm * rad_per_s * rad_per_s);
        for k in 3..motion.len() - 3 {
            let turned = rad_per_s * motion.time_s[k];
            let velocity = motion.velocity[Axis::X][k] + speed * turned.sin();
            let acceleration = motion.acceleration[Axis::X][k] + bend * turned.cos();
            assert!(velocity.abs() < 1e-4 * speed, "{k}: {velocity} mm/s");
            assert!(
                acceleration.abs() < 2e-2 * bend,
                "{k}: {acceleration} mm/s2"
            );
        }
    }

    /// As of a bridge that has a state of its own for each axis: X at an instant, Y 5 µs later.
    #[test]
    fn states_that_come_axis_by_axis_keep_their_speed() {
        let turned = |k: usize| 2.0 * 0.02 * (k / 2) as f64;
        let time_s = (0..800).map(|k| 0.02 * (k / 2) as f64 + 5e-6 * (k % 2) as f64);
        let mut all = PerAxis::<Vec<f64>>::default();
        all[Axis::X] = (0..800).map(|k| 50.0 * turned(k).cos()).collect();
        let of_before = |k: usize| if k % 2 == 1 { k } else { k.saturating_sub(1) };
        all[Axis::Y] = (0..800)
            .map(|k| 50.0 * turned(of_before(k)).sin())
            .collect();
        let axes = AxisSet::EMPTY.with(Axis::X).with(Axis::Y);
        let motion = Motion::new(time_s.collect(), axes, all).expect("a motion");
        for k in 4..790 {
            let (x, y) = (motion.velocity[Axis::X][k], motion.velocity[Axis::Y][k]);
            assert!((x + 100.0 * turned(k).sin()).abs() < 4.0, "{k}: {x}");
            assert!((y - 100.0 * turned(k).cos()).abs() < 4.0, "{k}: {y}");
        }
    }

    #[test]
    fn time_that_does_not_grow_is_refused_with_its_place() {
        let refused = Motion::new(vec![0.0, 1.0, 1.0], AxisSet::EMPTY, PerAxis::default());
        assert_eq!(
            refused,
            Err(TwinError::Time {
                index: 2,
                time_s: 1.0
            })
        );
    }
}
