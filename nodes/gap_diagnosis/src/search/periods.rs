//! Lines in what is left: periods over a position or in time.
//!
//! # Model
//!
//! The power of a frequency f in the white leftover z at places x, which noise alone has as chi-square of two:
//!
//! ```text
//!   P(f) = 2/n |sum_i z_i exp(-i 2 pi f x_i)|^2                           (1)
//! ```
//!
//! with one phase for the whole session. Frequencies stand a quarter of what the extent resolves apart, from three periods in
//! the extent to two rows a period. What is worth most is told, by the bound of the tail of chi-square of k (Chernoff):
//!
//! ```text
//!   -ln p >= (T - k) / 2 - k/2 ln(T / k)                                  (2)
//! ```
//!
//! # Holds when
//! Rows lie close enough to each other for the period, and whitening turns the phase of one period everywhere alike. A
//! wave whose phase differs from repeat to repeat is noise.

use std::f64::consts::TAU;
use std::fmt;

use metrology::Axis;
use nalgebra::{DMatrix, DVector};

use crate::noise::stack::Stack;
use crate::report::description::{of_columns, of_slot};
use crate::search::families::Slot;
use crate::search::rows::{count, position, time_s};

/// (2) from which a line stands out, as a power of 60 with one phase does.
const STANDS_OUT: f64 = 25.0;
/// Periods that the extent has to hold.
const LEAST_PERIODS: f64 = 3.0;
/// Frequencies to what the extent resolves.
const FREQUENCY_OVERSAMPLING: f64 = 4.0;
/// Most frequencies of one search.
const MAX_FREQUENCIES: usize = 2000;
/// Shortest period over a position, mm.
const SHORTEST_MM: f64 = 0.5;

/// What a line is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Over {
    Position(Axis),
    Time,
}

/// Which lines are sought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sought {
    /// Those over a position.
    Positions,
    /// Those in time as well.
    All,
}

/// A line.
pub struct Line<'s> {
    /// (1).
    pub power: f64,
    /// (2).
    pub worth: f64,
    /// Where it is.
    pub slot: &'s Slot,
    over: Over,
    /// mm or s.
    period: f64,
}

impl fmt::Display for Line<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.over {
            Over::Position(axis) => write!(f, "{:.3} mm of {axis}", self.period),
            Over::Time => write!(f, "{:.3} s", self.period),
        }
    }
}

impl Line<'_> {
    /// What it goes with.
    pub fn covariate(&self) -> String {
        match self.over {
            Over::Position(axis) => format!("position_{}", axis.letter().to_lowercase()),
            Over::Time => "time".to_owned(),
        }
    }

    /// One phase over a position is the same in both directions.
    pub const fn parity(&self) -> &'static str {
        match self.over {
            Over::Position(_) => "even",
            Over::Time => "",
        }
    }

    /// Cosine and sine over the slot's rows.
    pub fn waves(&self, stack: &Stack<'_>) -> [Vec<f64>; 2] {
        let places = Places::new(stack, self.slot);
        let at = match self.over {
            Over::Position(axis) => places.of_axis(stack, self.slot, axis),
            Over::Time => places.time_s,
        };
        let turns = at.iter().map(|at| (TAU * at / self.period).sin_cos());
        let (sin, cos) = turns.unzip();
        [cos, sin]
    }

    /// Its share of a stack before whitening.
    pub fn fitted(&self, stack: &Stack<'_>, floated: &[f64]) -> Vec<f64> {
        let columns = self.waves(stack).map(DVector::from_vec);
        of_columns(
            &DMatrix::from_columns(&columns),
            &of_slot(self.slot, floated),
        )
    }
}

/// (2) of T with k degrees of freedom.
pub fn worth(square: f64, freedom: f64) -> f64 {
    if square <= freedom {
        return 0.0;
    }
    0.5 * (square - freedom) - 0.5 * freedom * (square / freedom).ln()
}

/// The line of a slot that is worth most, where one stands out.
pub fn strongest<'s>(
    stack: &Stack<'_>,
    slot: &'s Slot,
    left: &DVector<f64>,
    sought: Sought,
) -> Option<Line<'s>> {
    let places = Places::new(stack, slot);
    let z: Vec<f64> = slot.rows.iter().map(|place| left[*place]).collect();
    let axes = stack.twin.machine().axis_set();
    let of_axis = |axis: Axis| {
        let at = places.of_axis(stack, slot, axis);
        let highest = places.highest(&at).min(1.0 / SHORTEST_MM);
        Some((Over::Position(axis), search(&at, &z, highest)?))
    };
    let linear = axes.iter().filter(|axis| axis.is_linear());
    let mut all: Vec<_> = linear.filter_map(of_axis).collect();
    let at = &places.time_s;
    if sought == Sought::All {
        let in_time = search(at, &z, places.highest(at));
        all.extend(in_time.map(|found| (Over::Time, found)));
    }
    let (over, (power, period)) = all.into_iter().max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
    let worth = worth(power, 2.0);
    (worth > STANDS_OUT).then_some(Line {
        power,
        worth,
        slot,
        over,
        period,
    })
}

/// Where and when the rows of a slot are.
struct Places {
    /// Rows of each block, among the slot's.
    blocks: Vec<std::ops::Range<usize>>,
    time_s: Vec<f64>,
}

impl Places {
    fn new(stack: &Stack<'_>, slot: &Slot) -> Self {
        let mut own = Self {
            blocks: vec![],
            time_s: vec![],
        };
        for index in &slot.blocks {
            let block = &stack.rows.blocks[*index];
            let run = &stack.session.runs[block.run];
            let first = own.time_s.len();
            own.time_s
                .extend(block.rows.iter().map(|row| time_s(run, row)));
            own.blocks.push(first..own.time_s.len());
        }
        own
    }

    fn of_axis(&self, stack: &Stack<'_>, slot: &Slot, axis: Axis) -> Vec<f64> {
        let mut at = Vec::with_capacity(self.time_s.len());
        for index in &slot.blocks {
            let block = &stack.rows.blocks[*index];
            let run = &stack.session.runs[block.run];
            at.extend(block.rows.iter().map(|row| position(run, row, axis)));
        }
        at
    }

    /// Frequency with two rows a period, where rows are closest.
    fn highest(&self, at: &[f64]) -> f64 {
        let of_block = |block: &std::ops::Range<usize>| {
            let own = &at[block.clone()];
            let way: f64 = own.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum();
            0.5 * count(own.len().saturating_sub(1)) / way.max(f64::MIN_POSITIVE)
        };
        let moves = |block: &&std::ops::Range<usize>| extent(&at[(*block).clone()]) > 1e-3;
        let own = self.blocks.iter().filter(moves);
        own.map(of_block).fold(0.0, f64::max)
    }
}

fn extent(at: &[f64]) -> f64 {
    let high = at.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let low = at.iter().copied().fold(f64::INFINITY, f64::min);
    (high - low).max(0.0)
}

/// Power and period of the best frequency up to the highest.
fn search(at: &[f64], z: &[f64], highest: f64) -> Option<(f64, f64)> {
    let extent = extent(at);
    if extent <= 0.0 {
        return None;
    }
    let step = 1.0 / (FREQUENCY_OVERSAMPLING * extent);
    let first = LEAST_PERIODS / extent;
    let mut wave = Wave::new(at, first, step);
    let powers: Vec<f64> = (0..MAX_FREQUENCIES)
        .take_while(|k| first + step * count(*k) <= highest)
        .map(|_| wave.next_power(z))
        .collect();
    let best = (0..powers.len()).max_by(|a, b| powers[*a].total_cmp(&powers[*b]))?;
    let beside = |k: Option<usize>| k.and_then(|k| powers.get(k)).copied();
    let off = match (beside(best.checked_sub(1)), beside(Some(best + 1))) {
        (Some(before), Some(after)) => {
            let bend = before - 2.0 * powers[best] + after;
            if bend < 0.0 {
                0.5 * (before - after) / bend
            } else {
                0.0
            }
        }
        _ => 0.0,
    };
    let period = 1.0 / (first + step * (count(best) + off));
    Some((powers[best], period))
}

/// Cosine and sine at every row, turned on from frequency to frequency.
struct Wave {
    here: Vec<[f64; 2]>,
    turn: Vec<[f64; 2]>,
}

impl Wave {
    fn new(at: &[f64], first: f64, step: f64) -> Self {
        let of = |frequency: f64| {
            let angles = at.iter().map(|at| (TAU * frequency * at).sin_cos());
            angles.map(|(sin, cos)| [cos, sin]).collect()
        };
        Self {
            here: of(first),
            turn: of(step),
        }
    }

    /// (1); the next time of the next frequency.
    fn next_power(&mut self, z: &[f64]) -> f64 {
        let (mut c, mut s) = (0.0, 0.0);
        for ([cos, sin], z) in self.here.iter().zip(z) {
            c += z * cos;
            s += z * sin;
        }
        for ([cos, sin], [c, s]) in self.here.iter_mut().zip(&self.turn) {
            (*cos, *sin) = (*cos * c - *sin * s, *cos * s + *sin * c);
        }
        (c * c + s * s) / (0.5 * count(z.len()).max(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twelve runs of 8 s in 25 min, with a line of a period that no frequency of the grid has.
    #[test]
    fn eq1_a_line_is_found_between_the_frequencies_of_the_grid_and_across_holes() {
        let start_s = |run: f64| 100.0 * run + 3.0 * run * run;
        let row = |k: usize| start_s(count(k / 160)) + 0.05 * count(k % 160);
        let at: Vec<f64> = (0..1920).map(row).collect();
        for period in [5.03, 41.7, 160.0] {
            let z: Vec<f64> = at.iter().map(|t| (TAU * t / period + 0.8).sin()).collect();
            let (power, found) = search(&at, &z, 10.0).expect("a line");
            assert!((found / period - 1.0).abs() < 2e-2, "{found} {period}");
            // A sine of one has half a square a row, 960 in all, more where the runs lie at its crests.
            assert!((800.0..1500.0).contains(&power), "{power}");
        }
        assert!(search(&at[..1], &[1.0], 10.0).is_none());
    }

    #[test]
    fn eq2_is_worth_nothing_at_what_noise_has_and_grows_by_half_the_square() {
        assert!(worth(2.0, 2.0).abs() < 1e-12);
        let [less, more] = [1000.0, 1002.0].map(|square| worth(square, 2.0));
        assert!((more - less - 1.0).abs() < 0.01);
        assert!(worth(60.0, 2.0) > STANDS_OUT && worth(60.0, 20.0) < STANDS_OUT);
    }
}
