//! Which ticks of a run's motion are kept, and where between them a reading lies.
//!
//! The motion is differentiated at the full rate of the record and thinned afterwards, so that velocity and
//! acceleration are those of the control's ticks.

use metrology::{Axis, AxisSet, PerAxis};
use twin::{Motion, TwinError};

use super::record::Tick;

/// A command that changes by less stands, mm or rad.
const STANDSTILL: f64 = 1e-6;
/// Ticks on either side of a reversal, start or stop that are all kept, s.
const AROUND_TURN_S: f64 = 0.02;
/// Greatest time between kept ticks in motion, s.
const SPACING_S: f64 = 0.05;
/// Greatest way between kept ticks, mm or rad.
const SPACING_WAY: f64 = 0.5;

/// Session time of each tick: the controller's clock, whose ticks are even, laid on the host's.
///
/// Where the controller's stamps do not grow the host's are taken, and of those that do not grow the
/// later ones are left out by the caller.
pub(super) fn times_s(ticks: &[Tick]) -> Vec<f64> {
    let grows = ticks
        .windows(2)
        .all(|pair| pair[1].controller_at > pair[0].controller_at);
    let Some(first) = ticks.first().filter(|_| grows) else {
        return ticks.iter().map(|tick| tick.time_s).collect();
    };
    let controller_s = |tick: &Tick| (tick.controller_at - first.controller_at).as_secs_f64();
    let mut shifts: Vec<f64> = ticks.iter().map(|t| t.time_s - controller_s(t)).collect();
    let middle = shifts.len() / 2;
    let (_, shift_s, _) = shifts.select_nth_unstable_by(middle, f64::total_cmp);
    let shift_s = *shift_s;
    ticks.iter().map(|t| controller_s(t) + shift_s).collect()
}

/// Motion at every tick.
pub(super) fn of(ticks: &[Tick], times_s: Vec<f64>, axes: AxisSet) -> Result<Motion, TwinError> {
    let position = PerAxis::from_fn(|axis| {
        if axes.contains(axis) {
            ticks.iter().map(|tick| tick.commanded[axis]).collect()
        } else {
            vec![]
        }
    });
    Motion::new(times_s, axes, position)
}

/// Marks the ticks at which some axis turns, starts or stops, those around them, and enough in between.
pub(super) fn wanted(motion: &Motion, marks: &mut [bool]) {
    let n = motion.len();
    if n == 0 || marks.len() != n {
        return;
    }
    (marks[0], marks[n - 1]) = (true, true);
    let moves = |axis: Axis, k: usize| {
        (motion.position[axis][k] - motion.position[axis][k - 1]).abs() > STANDSTILL
    };
    let mut last_turn_s = f64::NEG_INFINITY;
    let mut kept = 0;
    let mut turns = vec![];
    for (k, mark) in marks.iter_mut().enumerate().skip(1) {
        let turned = motion.axes.iter().any(|axis| {
            motion.sense[axis][k] != motion.sense[axis][k - 1]
                || (k > 1 && moves(axis, k) != moves(axis, k - 1))
        });
        if turned {
            last_turn_s = motion.time_s[k];
            turns.push(k);
        }
        let way = |axis: Axis| (motion.position[axis][k] - motion.position[axis][kept]).abs();
        let is_far = motion.axes.iter().any(|axis| way(axis) > SPACING_WAY);
        let is_late = motion.time_s[k] - motion.time_s[kept] > SPACING_S
            && motion.axes.iter().any(|axis| way(axis) > STANDSTILL);
        if motion.time_s[k] - last_turn_s <= AROUND_TURN_S || is_far || is_late {
            *mark = true;
        }
        if *mark {
            kept = k;
        }
    }
    for turn in turns {
        let before = (0..turn).rev();
        for k in before.take_while(|k| motion.time_s[turn] - motion.time_s[*k] <= AROUND_TURN_S) {
            marks[k] = true;
        }
    }
}

/// The marked ticks of a motion, and for each old tick the kept one at or before it.
pub(super) fn thin(motion: &Motion, marks: &[bool]) -> (Motion, Vec<usize>) {
    let marked = marks.iter().enumerate().filter(|(_, marked)| **marked);
    let kept: Vec<usize> = marked.map(|(k, _)| k).collect();
    fn pick<T: Copy>(kept: &[usize], from: &[T]) -> Vec<T> {
        kept.iter().filter_map(|k| from.get(*k).copied()).collect()
    }
    let all = |from: &PerAxis<Vec<f64>>| PerAxis::from_fn(|axis| pick(&kept, &from[axis]));
    let thinned = Motion {
        time_s: pick(&kept, &motion.time_s),
        axes: motion.axes,
        position: all(&motion.position),
        velocity: all(&motion.velocity),
        acceleration: all(&motion.acceleration),
        driven: all(&motion.driven),
        sense: PerAxis::from_fn(|axis| pick(&kept, &motion.sense[axis])),
        since_reversal: all(&motion.since_reversal),
        since_reversal_s: all(&motion.since_reversal_s),
    };
    let mut place = 0;
    let places = (0..motion.len())
        .map(|k| {
            while kept.get(place + 1).is_some_and(|next| *next <= k) {
                place += 1;
            }
            place
        })
        .collect();
    (thinned, places)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn out_and_back() -> Motion {
        let n = 2001;
        let time_s = (0..n).map(|k| f64::from(k) * 1e-3).collect();
        let mut position = PerAxis::<Vec<f64>>::default();
        position[Axis::X] = (0..n)
            .map(|k| 25.0 * (1.0 - (f64::from(k) * 1e-3 - 1.0).abs()))
            .collect();
        Motion::new(time_s, AxisSet::EMPTY.with(Axis::X), position).expect("a motion")
    }

    #[test]
    fn a_turn_is_kept_tick_by_tick_and_the_way_in_between_in_steps() {
        let motion = out_and_back();
        let mut marks = vec![false; motion.len()];
        wanted(&motion, &mut marks);
        assert!((985..=1015).all(|k| marks[k]));
        let (thinned, places) = thin(&motion, &marks);
        assert!(thinned.len() < 250, "{}", thinned.len());
        let steps = thinned.position[Axis::X].windows(2);
        assert!(steps.map(|s| (s[1] - s[0]).abs()).fold(0.0, f64::max) < 0.6);
        for (k, place) in places.iter().enumerate() {
            assert!(thinned.time_s[*place] <= motion.time_s[k] + 1e-12);
        }
        let turned = thinned.since_reversal[Axis::X].iter();
        assert!(turned.filter(|way| way.is_finite()).all(|way| *way <= 25.0));
    }

    #[test]
    fn velocity_is_that_of_the_full_rate() {
        let motion = out_and_back();
        let mut marks = vec![false; motion.len()];
        wanted(&motion, &mut marks);
        let (thinned, _) = thin(&motion, &marks);
        let speeds = thinned.velocity[Axis::X].iter().map(|v| v.abs());
        assert!(speeds.filter(|v| (v - 25.0).abs() > 1e-6).count() <= 2);
    }
}
