//! A recording under way: what lies between its begin and its end by their stamps, in whatever order topics arrive.

use std::collections::VecDeque;

use metrology::sample::{GridSample, TestSegment};
use metrology::{Host, Stamp};

use crate::axis_log::AxisLog;
use crate::recording::Collector;

/// Readings that may wait for positions.
const WAITING: usize = 10_000;

/// A recording under way.
#[derive(Clone, Debug)]
pub struct Open {
    pub begin: TestSegment,
    pub collector: Collector,
    waiting: VecDeque<GridSample>,
    /// Readings whose positions the log no longer held.
    n_unpaired: usize,
    /// When the end was told, and what it said.
    pub end: Option<(Stamp<Host>, TestSegment)>,
    /// Whether a reading after the end has come.
    is_read_beyond: bool,
}

impl Open {
    /// A recording that begins, of at most `limit` readings.
    pub fn new(begin: TestSegment, limit: usize) -> Self {
        Self {
            collector: Collector::new(begin.plane, begin.zero_id, limit),
            begin,
            waiting: VecDeque::new(),
            n_unpaired: 0,
            end: None,
            is_read_beyond: false,
        }
    }

    /// The end is told; readings after it that came before it go to `beyond`.
    pub fn end(
        &mut self,
        told_at: Stamp<Host>,
        end: TestSegment,
        mut beyond: impl FnMut(GridSample),
    ) {
        let at = end.at;
        self.collector.end(at, &mut beyond);
        self.waiting.retain(|sample| {
            let is_within = sample.at <= at;
            if !is_within {
                beyond(*sample);
            }
            is_within
        });
        self.end = Some((told_at, end));
    }

    /// Readings that have found no positions.
    pub fn n_unpaired(&self) -> usize {
        self.n_unpaired + self.waiting.len()
    }

    fn is_past(&self, at: Stamp<Host>) -> bool {
        self.end.as_ref().is_some_and(|(_, end)| at > end.at)
    }

    /// Takes a reading in; false where it lies after the end.
    pub fn take(&mut self, sample: &GridSample) -> bool {
        if self.is_past(sample.at) {
            self.is_read_beyond = true;
            return false;
        }
        if sample.at >= self.begin.at && self.collector.accepts(sample) {
            if self.waiting.len() == WAITING {
                self.waiting.pop_front();
                self.n_unpaired += 1;
            }
            self.waiting.push_back(*sample);
        }
        true
    }

    /// Pairs every reading that the log has reached.
    pub fn pair_waiting(&mut self, log: &AxisLog) {
        let Some(newest) = log.newest() else { return };
        while let Some(sample) = self.waiting.front()
            && sample.at <= newest
        {
            match log.pair(sample) {
                Some(pair) => self.collector.push(pair),
                None => self.n_unpaired += 1,
            }
            self.waiting.pop_front();
        }
    }

    /// Whether nothing more can come: a reading after the end has, or the next one will be after it; and all have their positions.
    pub fn is_whole(&self) -> bool {
        let is_next_beyond = match self.collector.pairs() {
            [.., before, last] => self.is_past(last.at + (last.at - before.at)),
            _ => false,
        };
        self.waiting.is_empty() && (self.is_read_beyond || is_next_beyond)
    }
}
