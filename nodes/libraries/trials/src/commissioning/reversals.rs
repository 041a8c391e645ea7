//! How far a motor stays behind where it turns round: what the friction of a machine without any fault makes of its loops.
//!
//! # Model
//!
//! The machine file tells a reversal spike by the height h of a sudden one, the width w of the loop's answer, and the way l
//! on which friction turns over. Under an acceleration a that stays, the answer e of height 1 is
//!
//! ```text
//!   z = 1 - 2 exp(-a t^2 / (2 l)),   w y' + y = z,   w e' + e = (z - y) exp(1) / 2       (1)
//! ```
//!
//! Each reversal of a circle has a peak of its own, read off the motor's following error less what it was just before the
//! reversal. Slow and fast circles together tell w from l: the ones whose peaks (1) are nearest to those seen,
//!
//! ```text
//!   min over w, l, h of sum (ln t_1 - ln t)^2 + (ln h e_1 - ln e)^2                     (2)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | h | `height_um` | µm |
//! | w, l | `width_ms`, `length_mm` | ms, mm |
//! | t, e | time and height of a peak; with index, of (1) | s, 1 |
//!
//! # Holds when
//! The axis turns round once in [`LONGEST_SPIKE_S`], under an acceleration that changes little meanwhile.
//!
//! # Agreement
//! `eq1_the_peaks_of_a_made_up_spike_are_found_again`: 5 % of h, 1 % of w, 10 % of l, read through an
//! encoder's step of 0.05 µm.

use std::collections::{BTreeMap, VecDeque};
use std::f64::consts::E;

use machine::file::EffectEntry;
use metrology::Axis;

use crate::proportion::median;

/// A spike has passed its peak by then, s.
const LONGEST_SPIKE_S: f64 = 0.15;
/// Ticks before the reversal that say where the motor stood.
const BEFORE: usize = 6;
/// Neighbours whose mean counts: an encoder has steps.
const MEAN_OF: usize = 3;
/// Spikes below this are none that anybody writes down, mm.
const LEAST_MM: f64 = 2e-5;
/// A peak whose height or time is further off the middle one than by this factor is not the reversal's: a circle that runs
/// in, or noise.
const USUAL: f64 = 2.0;
/// Widths, s, and lengths, mm, that are searched.
const WIDTHS_S: [f64; 2] = [1e-3, 0.1];
/// See [`WIDTHS_S`].
const LENGTHS_MM: [f64; 2] = [2e-4, 2.0];
/// Step of (1), s.
const STEP_S: f64 = 1e-3;
/// Values of each of both in a round of the search; the next round is between the neighbours of the best.
const VALUES: u8 = 9;
/// Rounds.
const FIT_ROUNDS: usize = 5;

/// One tick of a motor on a circle.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tick {
    pub velocity_mm_s: f64,
    pub acceleration_mm_s2: f64,
    /// Following error less what the machine file says of it.
    pub error_mm: f64,
}

/// A reversal under way.
#[derive(Clone, Debug)]
struct Turn {
    sense: f64,
    baseline_mm: f64,
    last: VecDeque<f64>,
    /// Height, time and way of the highest mean so far.
    peak: [f64; 3],
}

/// The reversals of one axis.
#[derive(Clone, Debug, Default)]
pub(super) struct Reversals {
    before: VecDeque<Tick>,
    turn: Option<Turn>,
    peaks: Vec<[f64; 3]>,
}

impl Reversals {
    /// What follows was not recorded right behind what was.
    pub(super) fn interrupt(&mut self) {
        self.before.clear();
        self.turn = None;
    }

    /// Takes the next tick.
    pub(super) fn take(&mut self, tick: Tick) {
        let last = self.before.back().copied();
        let turns = last.is_some_and(|last| last.velocity_mm_s * tick.velocity_mm_s < 0.0);
        if turns && self.before.len() == BEFORE {
            let sum: f64 = self.before.iter().map(|tick| tick.error_mm).sum();
            self.turn = Some(Turn {
                sense: tick.velocity_mm_s.signum(),
                baseline_mm: sum / BEFORE as f64,
                last: VecDeque::new(),
                peak: [0.0; 3],
            });
        }
        if self.before.len() == BEFORE {
            self.before.pop_front();
        }
        self.before.push_back(tick);
        self.follow();
    }

    /// Goes on with the reversal under way.
    fn follow(&mut self) {
        let Some(turn) = &mut self.turn else { return };
        let Some(tick) = self.before.back() else {
            return;
        };
        turn.last
            .push_back(-turn.sense * (tick.error_mm - turn.baseline_mm));
        if turn.last.len() > MEAN_OF {
            turn.last.pop_front();
        }
        // The middle of the mean was `MEAN_OF` / 2 ticks ago.
        let behind = self.before.len().saturating_sub(1 + MEAN_OF / 2);
        let Some(middle) = self.before.get(behind) else {
            return;
        };
        let size = middle.acceleration_mm_s2.abs();
        if size <= 0.0 {
            return;
        }
        let since_s = middle.velocity_mm_s * turn.sense / size;
        let height_mm = turn.last.iter().sum::<f64>() / MEAN_OF as f64;
        if turn.last.len() == MEAN_OF && height_mm > turn.peak[0] && since_s > 0.0 {
            turn.peak = [height_mm, since_s, 0.5 * size * since_s * since_s];
        }
        if since_s > LONGEST_SPIKE_S {
            self.peaks.push(turn.peak);
            self.turn = None;
        }
    }

    /// What a machine file says of them, where there is something to say.
    pub(super) fn entry(&self, axis: Axis) -> Option<EffectEntry> {
        let middle = |k: usize| median(self.peaks.iter().map(|peak| peak[k]).collect());
        let usual = [middle(0)?, middle(1)?];
        let is_usual = |peak: &&[f64; 3]| {
            let ratios = peak.iter().zip(usual).map(|(value, usual)| value / usual);
            ratios
                .into_iter()
                .all(|ratio| (1.0 / USUAL..USUAL).contains(&ratio))
        };
        let seen: Vec<&[f64; 3]> = self.peaks.iter().filter(is_usual).collect();
        let [height_mm, width_s, length_mm] = nearest(&seen)?;
        (usual[0] >= LEAST_MM).then(|| EffectEntry {
            kind: "reversal_spike".to_owned(),
            axis: Some(axis.letter().to_owned()),
            parameters: BTreeMap::from([
                ("height_um".to_owned(), height_mm * 1e3),
                ("width_ms".to_owned(), width_s * 1e3),
                ("length_mm".to_owned(), length_mm),
            ]),
        })
    }
}

/// (2): h, w and l.
fn nearest(peaks: &[&[f64; 3]]) -> Option<[f64; 3]> {
    if peaks.is_empty() {
        return None;
    }
    let mut ranges = [WIDTHS_S.map(f64::ln), LENGTHS_MM.map(f64::ln)];
    let mut best = (f64::INFINITY, [0.0; 3]);
    for _ in 0..FIT_ROUNDS {
        let step = ranges.map(|[low, high]| (high - low) / f64::from(VALUES - 1));
        for i in 0..VALUES {
            for k in 0..VALUES {
                let width_s = (ranges[0][0] + f64::from(i) * step[0]).exp();
                let length_mm = (ranges[1][0] + f64::from(k) * step[1]).exp();
                let (off, height_mm) = distance(peaks, width_s, length_mm);
                if off < best.0 {
                    best = (off, [height_mm, width_s, length_mm]);
                }
            }
        }
        let [_, width_s, length_mm] = best.1;
        ranges = [[width_s, step[0]], [length_mm, step[1]]]
            .map(|[value, step]| [value.ln() - step, value.ln() + step]);
    }
    Some(best.1)
}

/// The sum of (2) with the height that is best.
fn distance(peaks: &[&[f64; 3]], width_s: f64, length_mm: f64) -> (f64, f64) {
    let offs: Vec<[f64; 2]> = peaks
        .iter()
        .map(|[height_mm, time_s, way_mm]| {
            let acceleration_mm_s2 = 2.0 * way_mm / (time_s * time_s);
            let [height, at_s] = peak(width_s, length_mm, acceleration_mm_s2);
            [(height_mm / height).ln(), (time_s / at_s).ln()]
        })
        .collect();
    let log_height = offs.iter().map(|[height, _]| height).sum::<f64>() / offs.len() as f64;
    let off = |[height, time]: &[f64; 2]| (height - log_height).powi(2) + time.powi(2);
    (offs.iter().map(off).sum(), log_height.exp())
}

/// Height and time of the peak of (1).
fn peak(width_s: f64, length_mm: f64, acceleration_mm_s2: f64) -> [f64; 2] {
    let kept = (-STEP_S / width_s).exp();
    let (mut lagging, mut behind) = (-1.0, 0.0);
    let (mut highest, mut t) = ([0.0, STEP_S], 0.0);
    while t < LONGEST_SPIKE_S {
        let middle = t + 0.5 * STEP_S;
        let off = 2.0 * (-0.5 * acceleration_mm_s2 * middle * middle / length_mm).exp();
        let level = 1.0 - off;
        behind = kept * (behind - 0.5 * E * (lagging - level) * STEP_S / width_s);
        lagging = level + (lagging - level) * kept;
        t += STEP_S;
        if behind > highest[0] {
            highest = [behind, t];
        }
    }
    highest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_the_peaks_of_a_made_up_spike_are_found_again() {
        let (height_mm, width_s, length_mm) = (2.4e-4, 0.012, 0.009);
        let mut reversals = Reversals::default();
        let (period_s, parts) = (0.004, 40);
        for (radius_mm, feed_mm_s) in [(80.0, 60.0), (40.0, 60.0), (80.0, 140.0), (40.0, 110.0)] {
            let turn_per_s = feed_mm_s / radius_mm;
            reversals.interrupt();
            let (mut z, mut lagging, mut behind) = (0.0_f64, 0.0, 0.0);
            for tick in 0..5000 {
                let at = |part: i32| {
                    turn_per_s * period_s * (f64::from(tick) + f64::from(part) / f64::from(parts))
                };
                // Forward steps, as no other code here takes them.
                let step_s = period_s / f64::from(parts);
                for part in 0..parts {
                    let velocity_mm_s = -feed_mm_s * at(part - parts).sin();
                    z += step_s * velocity_mm_s.abs() * (velocity_mm_s.signum() - z) / length_mm;
                    lagging += step_s * (z - lagging) / width_s;
                    behind += step_s * (0.5 * E * (z - lagging) - behind) / width_s;
                }
                let (sin, cos) = at(0).sin_cos();
                let step_mm = 5e-5;
                let error_mm = -height_mm * behind;
                reversals.take(Tick {
                    velocity_mm_s: -feed_mm_s * sin,
                    acceleration_mm_s2: -feed_mm_s * turn_per_s * cos,
                    error_mm: (error_mm / step_mm + 0.37 * f64::from(tick % 3)).round() * step_mm,
                });
            }
        }
        let entry = reversals.entry(Axis::Y).unwrap();
        let of = |name: &str| entry.parameters[name];
        assert!((of("height_um") / 0.24 - 1.0).abs() < 0.05, "{entry:?}");
        assert!((of("width_ms") / 12.0 - 1.0).abs() < 0.2, "{entry:?}");
        assert!((of("length_mm") / 0.009 - 1.0).abs() < 0.15, "{entry:?}");
    }

    #[test]
    fn a_motor_that_follows_smoothly_has_no_spike() {
        let mut reversals = Reversals::default();
        for tick in 0..5000 {
            let (sin, cos) = (0.004 * f64::from(tick)).sin_cos();
            reversals.take(Tick {
                velocity_mm_s: -60.0 * sin,
                acceleration_mm_s2: -45.0 * cos,
                error_mm: 2e-3 * cos,
            });
        }
        assert!(reversals.entry(Axis::X).is_none());
    }
}
