//! How far a motor stays behind where it turns round: what the friction of a machine without any fault makes of its loops.
//!
//! # Model
//!
//! The machine file tells a reversal spike by its height h and by where its peak stands, at a time t and a way s since
//! the reversal:
//!
//! ```text
//!   t/w + s/l = 1                                                         (1)
//! ```
//!
//! Each reversal of a circle has a peak of its own, read off the motor's following error less what it was just before the
//! reversal. Slow and fast circles together tell w from l, by least squares of (1) over all reversals; h is their mean.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | h | `height_um` | µm |
//! | w, l | `width_ms`, `length_mm` | ms, mm |
//!
//! # Holds when
//! The axis turns round once in [`LONGEST_S`], under an acceleration that changes little meanwhile.
//!
//! # Agreement
//! `eq1_the_peaks_of_a_made_up_spike_are_found_again`: 3 % of h, 18 % of w, 10 % of l, read
//! through an encoder's step of 0.05 µm.

use std::collections::{BTreeMap, VecDeque};

use machine::file::EffectEntry;
use metrology::Axis;
use nalgebra::{Matrix2, Vector2};

use crate::proportion::median;

/// A spike has passed its peak by then, s.
const LONGEST_S: f64 = 0.15;
/// Ticks before the reversal that say where the motor stood.
const BEFORE: usize = 6;
/// Neighbours whose mean counts: an encoder has steps.
const MEAN_OF: usize = 3;
/// Spikes below this are none that anybody writes down, mm.
const LEAST_MM: f64 = 2e-5;
/// A peak whose height or time is further off the middle one than by this factor is not the reversal's: a circle that runs
/// in, or noise.
const USUAL: f64 = 2.0;
/// What a machine file may say: widths, s, and lengths, mm.
const WIDTHS_S: [f64; 2] = [5e-4, 2.0];
/// See [`WIDTHS_S`].
const LENGTHS_MM: [f64; 2] = [3e-3, 100.0];

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
        if since_s > LONGEST_S {
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
        let height_mm = seen.iter().map(|peak| peak[0]).sum::<f64>() / seen.len() as f64;
        let (width_s, length_mm) = shape(&seen)?;
        (height_mm >= LEAST_MM).then(|| EffectEntry {
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

/// w and l of (1); a reciprocal that comes out negative is none, and the other one tells alone.
fn shape(peaks: &[&[f64; 3]]) -> Option<(f64, f64)> {
    let mut normal = Matrix2::zeros();
    let mut right = Vector2::zeros();
    for [_, time_s, way_mm] in peaks {
        let row = Vector2::new(*time_s, *way_mm);
        normal += row * row.transpose();
        right += row;
    }
    let alone = |k: usize| right[k] / normal[(k, k)];
    let both = normal.try_inverse()? * right;
    let [per_s, per_mm] = match (both[0] > 0.0, both[1] > 0.0) {
        (true, true) => [both[0], both[1]],
        (true, false) => [alone(0), 0.0],
        _ => [0.0, alone(1)],
    };
    let within = |value: f64, [low, high]: [f64; 2]| value.max(low).min(high);
    Some((
        within(1.0 / per_s, WIDTHS_S),
        within(1.0 / per_mm, LENGTHS_MM),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_the_peaks_of_a_made_up_spike_are_found_again() {
        let (height_mm, width_s, length_mm) = (2.4e-4, 0.035, 0.09);
        let mut reversals = Reversals::default();
        let period_s = 0.004;
        for (radius_mm, feed_mm_s) in [(80.0, 60.0), (40.0, 60.0), (80.0, 140.0), (40.0, 110.0)] {
            let turn_per_s = feed_mm_s / radius_mm;
            reversals.interrupt();
            for tick in 0..5000 {
                let (sin, cos) = (turn_per_s * period_s * f64::from(tick)).sin_cos();
                let (velocity_mm_s, acceleration_mm_s2) =
                    (-feed_mm_s * sin, -feed_mm_s * turn_per_s * cos);
                let size = acceleration_mm_s2.abs();
                let since_s = velocity_mm_s.abs() / size;
                let is_after = velocity_mm_s * acceleration_mm_s2 > 0.0 && since_s < 0.3;
                let p = since_s / width_s + 0.5 * size * since_s * since_s / length_mm;
                let spike_mm = if is_after {
                    -velocity_mm_s.signum() * height_mm * p * (1.0 - p).exp()
                } else {
                    0.0
                };
                let step_mm = 5e-5;
                reversals.take(Tick {
                    velocity_mm_s,
                    acceleration_mm_s2,
                    error_mm: (spike_mm / step_mm + 0.37 * f64::from(tick % 3)).round() * step_mm,
                });
            }
        }
        let entry = reversals.entry(Axis::Y).unwrap();
        let of = |name: &str| entry.parameters[name];
        assert!((of("height_um") / 0.24 - 1.0).abs() < 0.05, "{entry:?}");
        assert!((of("width_ms") / 35.0 - 1.0).abs() < 0.2, "{entry:?}");
        assert!((of("length_mm") / 0.09 - 1.0).abs() < 0.15, "{entry:?}");
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
