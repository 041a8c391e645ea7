//! The turn of a recorded circle that is evaluated: the run-in, in which the position loops settle, is not part of it.
//!
//! ISO 230-4 evaluates one whole turn at the test feed. A recording is longer: the command reaches its feed on the circle
//! before the turn and leaves it behind the turn. Which part is the turn is found in this order:
//!
//! 1. *Full rate.* A measuring program writes `(rate: full)` before the turn and `(rate: background)` behind it, and a
//!    control that reads these comments publishes its axis states closer during the turn. The turn is the longest stretch
//!    of close states, where it goes all round and sparse states of the same feed come before it. The control switches some
//!    states late, so that the stretch is a few degrees longer: what it has beyond 360° at its end is left out.
//! 2. *Settling.* Otherwise the turn begins [`SETTLING_S`] after the command reached its feed.
//! 3. *Too short.* Where the recording does not go on for a whole turn from there, its last turn is evaluated. Its first
//!    readings may be unsettled, and the page warns.
//!
//! # Holds when
//! The slower loop has a position gain of 16.7/s (1 m/min per mm) at least: of its lag after 0.5 s, e^(−8.3) = 0.03 % is
//! left. The run-in of our own programs is longer than that of equation (2) of `machine::trajectory`.

use std::f64::consts::TAU;

use iso230::circular::LONGEST_GAP_RAD;
use metrology::stamp::{Host, Stamp};
use serde::Serialize;

/// Time at feed after which readings count where no rate marks the turn, s.
pub const SETTLING_S: f64 = 0.5;
/// A state is sparse when it comes this many times later than the usual one.
pub(crate) const SPARSE: f64 = 1.5;
/// Sparse states at feed before the turn, at least: one alone may be a lost message.
pub(crate) const FEWEST_SPARSE: usize = 2;
/// Rounding of the swept angle, rad.
const SAME_RAD: f64 = 1e-6;

/// An axis state on the circle at its feed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tick {
    pub at: Stamp<Host>,
    /// Command from the centre along u and v, mm.
    pub place_mm: [f64; 2],
    /// Since the state before, by the controller's clock, s.
    pub step_s: f64,
    /// Angle that the command went since it reached its feed, rad.
    pub swept_rad: f64,
    /// Time since then, s.
    pub since_feed_s: f64,
}

/// A reading while the command was on the circle at its feed.
#[derive(Clone, Copy, Debug)]
pub(super) struct AtFeed {
    pub at: Stamp<Host>,
    /// Reading along u and v, mm.
    pub read_mm: [f64; 2],
    /// The state before it.
    pub tick: Tick,
}

/// How the evaluated turn was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TurnBy {
    /// The control published its states at the full rate during the turn.
    FullRate,
    /// One turn from [`SETTLING_S`] after the feed was reached.
    Settling,
    /// The last turn of a recording that is too short for that.
    TooShort,
}

/// The evaluated turn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EvaluatedTurn {
    /// How it was found.
    pub by: TurnBy,
    /// Time at feed before its first reading, s.
    pub left_out_s: f64,
    /// Angle at feed before its first reading, rad.
    pub left_out_rad: f64,
    /// Readings at feed that are not in it, before and behind.
    pub n_left_out: usize,
}

/// What belongs to the turn.
#[derive(Clone, Copy, Debug)]
enum Part {
    /// From one stamp to another, and of that a turn from an angle on.
    Marked(Stamp<Host>, Stamp<Host>, f64),
    Swept(f64, f64),
}

impl Part {
    fn contains(self, reading: &AtFeed) -> bool {
        match self {
            Self::Marked(from, until, from_rad) => {
                let is_of_turn = reading.tick.swept_rad < from_rad + TAU - SAME_RAD;
                reading.at >= from && reading.at <= until && is_of_turn
            }
            Self::Swept(from_rad, until_rad) => {
                let swept_rad = reading.tick.swept_rad;
                swept_rad >= from_rad - SAME_RAD && swept_rad <= until_rad + SAME_RAD
            }
        }
    }
}

/// The readings of the evaluated turn, and which it is.
pub(super) fn evaluated(ticks: &[Tick], readings: Vec<AtFeed>) -> (Vec<AtFeed>, EvaluatedTurn) {
    let (by, part) = match full_rate(ticks) {
        Some(marked) => (TurnBy::FullRate, marked),
        None => settled(&readings),
    };
    let n = readings.len();
    let mut turn = readings;
    turn.retain(|reading| part.contains(reading));
    let first = turn.first().map(|reading| reading.tick);
    let evaluated = EvaluatedTurn {
        by,
        left_out_s: first.map_or(0.0, |tick| tick.since_feed_s),
        left_out_rad: first.map_or(0.0, |tick| tick.swept_rad),
        n_left_out: n - turn.len(),
    };
    (turn, evaluated)
}

/// The longest stretch of close states behind sparse ones, where it goes all round.
fn full_rate(ticks: &[Tick]) -> Option<Part> {
    let usual_s = median(ticks.iter().map(|tick| tick.step_s))?;
    if usual_s <= 0.0 {
        return None;
    }
    let is_close = |tick: &Tick| tick.step_s <= SPARSE * usual_s;
    let first_close = ticks.iter().position(is_close)?;
    if first_close < FEWEST_SPARSE {
        return None;
    }
    let stretch = ticks[first_close..]
        .iter()
        .take_while(|tick| is_close(tick));
    // The step of the first close state began at the state before it.
    let begin = ticks[first_close - 1];
    let end = stretch.last()?;
    let is_whole = end.swept_rad - begin.swept_rad > TAU - LONGEST_GAP_RAD;
    is_whole.then_some(Part::Marked(begin.at, end.at, begin.swept_rad))
}

/// The turn from the settled reading on, or the last one.
fn settled(readings: &[AtFeed]) -> (TurnBy, Part) {
    let (Some(first), Some(last)) = (readings.first(), readings.last()) else {
        return (TurnBy::TooShort, Part::Swept(0.0, TAU));
    };
    let latest_rad = last.tick.swept_rad - TAU;
    let settled = readings
        .iter()
        .find(|reading| reading.tick.since_feed_s >= SETTLING_S);
    match settled.map(|reading| reading.tick.swept_rad) {
        // A table at stations of 10 degrees ends a station before a whole turn.
        Some(from_rad) if from_rad <= latest_rad + LONGEST_GAP_RAD + SAME_RAD => {
            (TurnBy::Settling, Part::Swept(from_rad, from_rad + TAU))
        }
        _ => {
            let from_rad = latest_rad.max(first.tick.swept_rad);
            (TurnBy::TooShort, Part::Swept(from_rad, from_rad + TAU))
        }
    }
}

/// The middle of the finite values.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}
