//! To which stops the readings of a run belong: those beside which they were recorded, or those of their stamps.
//!
//! A topic may be recorded late throughout, or stamped by the clock of another host. Stops decide between the two: while an
//! axis rests its reference reads one place, and a place that goes with the command. The stamps count where the readings of a
//! stop agree better by them.

use metrology::stamp::{Host, Stamp};

use super::STOP_SETTLE;
use super::unusable::Extent;
use crate::evaluate::circles::median;

/// By how much the readings have to agree better by their stamps, mm or rad.
const LEAST_GAIN: f64 = 1e-3;

/// Part of the readings that belongs to a stop by its stamp at least: three of four.
const LEAST_PART: [u64; 2] = [3, 4];

/// Readings of a run with their stamps, mm or rad.
#[derive(Clone, Debug, Default)]
pub(in crate::evaluate) struct Readings(Vec<(Stamp<Host>, f64)>);

/// What was read at a stop.
#[derive(Clone, Copy, Debug)]
pub(in crate::evaluate) struct StopRead {
    /// Least and greatest reading.
    pub extent: Extent,
    /// Mean reading minus command, mm or rad.
    pub deviation: f64,
    /// Readings.
    pub n: u32,
}

impl Readings {
    /// Takes the next reading.
    pub(in crate::evaluate) fn take(&mut self, at: Stamp<Host>, reading: f64) {
        self.0.push((at, reading));
    }

    /// In the order of their stamps.
    pub(in crate::evaluate) fn sort(&mut self) {
        self.0.sort_by_key(|(at, _)| *at);
    }

    /// Of sorted ones how far two of one stamp lie apart at most that were made during a rest, where that is more than they may.
    pub(in crate::evaluate) fn clash(
        &self,
        is_linear: bool,
        (since, until): (Stamp<Host>, Stamp<Host>),
    ) -> Option<f64> {
        let first = self.0.partition_point(|(at, _)| *at - since < STOP_SETTLE);
        let end = self.0.partition_point(|(at, _)| *at <= until);
        let during = self.0.get(first..end)?;
        let of_stamp = during.chunk_by(|(a, _), (b, _)| a == b).map(|same| {
            let low = same.iter().map(|(_, it)| *it).fold(f64::INFINITY, f64::min);
            let high = same
                .iter()
                .map(|(_, it)| *it)
                .fold(f64::NEG_INFINITY, f64::max);
            high - low
        });
        let apart = of_stamp.fold(0.0, f64::max);
        (apart > SAME_STAMP_APART[usize::from(!is_linear)]).then_some(apart)
    }

    /// Of sorted ones those that were made during a rest, after it settled.
    pub(in crate::evaluate) fn within(
        &self,
        since: Stamp<Host>,
        until: Stamp<Host>,
    ) -> impl Iterator<Item = f64> {
        let first = self.0.partition_point(|(at, _)| *at - since < STOP_SETTLE);
        let all = self.0.iter().skip(first);
        let during = all.take_while(move |(at, _)| *at <= until);
        during.map(|(_, reading)| *reading)
    }
}

/// Readings of one stamp at rest that lie farther apart contradict each other, mm, and rad of a rotary axis.
pub(in crate::evaluate) const SAME_STAMP_APART: [f64; 2] = [0.005, 5e-5];

/// Whether the stamps say to which stops readings belong; otherwise the order of recording does.
pub(in crate::evaluate) fn is_by_stamp(recorded: &[StopRead], stamped: &[StopRead]) -> bool {
    // The last stop may be cut off by the end of its run.
    let n = |stops: &[StopRead]| stops.iter().map(|stop| u64::from(stop.n)).sum::<u64>();
    let has_as_many = n(stamped) * LEAST_PART[1] >= n(recorded) * LEAST_PART[0];
    let gains = || Some(spread(stamped)? + LEAST_GAIN < spread(recorded)?);
    has_as_many && gains().unwrap_or(recorded.is_empty() && !stamped.is_empty())
}

/// Mean of how far readings of a stop lie apart and how far stops lie from their middle; `None`: nothing was read.
fn spread(stops: &[StopRead]) -> Option<f64> {
    let middle = median(stops.iter().map(|stop| stop.deviation))?;
    let own = stops.iter().map(|stop| {
        let extent = stop.extent.size().unwrap_or(0.0);
        extent + (stop.deviation - middle).abs()
    });
    Some(own.sum::<f64>() / stops.len() as f64)
}
