//! What came last. Topics arrive in an order of their own: a begin may be told after the first samples of its run.

use std::collections::VecDeque;

use metrology::sample::{GridSample, LengthSample, ProbeTrigger, TemperatureSample};
use metrology::stamp::{Host, Span, Stamp};

use super::record::{Offset, Tick};

/// How long a message may come after those of other topics with its stamp, s.
pub(super) const LATE_S: f64 = 2.0;

/// Samples of the last [`LATE_S`], ticks of a lead-in before them.
#[derive(Clone, Debug, Default)]
pub(super) struct Recent {
    pub ticks: VecDeque<Tick>,
    pub offsets: VecDeque<Offset>,
    pub grid: VecDeque<GridSample>,
    pub length: VecDeque<LengthSample>,
    pub temperatures: VecDeque<TemperatureSample>,
    /// With their session time.
    pub triggers: VecDeque<(f64, ProbeTrigger)>,
    /// The stamp of the newest sample.
    newest: Option<Stamp<Host>>,
}

impl Recent {
    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// The stamp of the newest sample.
    pub(super) const fn newest(&self) -> Option<Stamp<Host>> {
        self.newest
    }

    /// The stamp of a segment where it is of the samples' clock: not further from the newest than a message may be late.
    pub(super) fn of_this_clock(&self, at: Stamp<Host>) -> Option<Stamp<Host>> {
        let apart = |newest: Stamp<Host>| (at - newest).as_secs_f64().abs();
        self.newest
            .is_some_and(|newest| apart(newest) <= LATE_S)
            .then_some(at)
    }

    pub(super) fn tick(&mut self, tick: Tick, lead_in_s: f64) {
        self.came(tick.at);
        self.ticks.push_back(tick);
        let oldest_s = tick.time_s - lead_in_s - LATE_S;
        while self.ticks.front().is_some_and(|t| t.time_s < oldest_s) {
            self.ticks.pop_front();
        }
    }

    pub(super) fn offset(&mut self, offset: Offset) {
        self.offsets.push_back(offset);
        // The one that held when the oldest sample was taken stays.
        let oldest = oldest(offset.at);
        while self.offsets.get(1).is_some_and(|next| next.at < oldest) {
            self.offsets.pop_front();
        }
    }

    pub(super) fn grid(&mut self, sample: GridSample) {
        self.came(sample.at);
        keep(&mut self.grid, sample, sample.at, |s| s.at);
    }

    pub(super) fn length(&mut self, sample: LengthSample) {
        self.came(sample.at);
        keep(&mut self.length, sample, sample.at, |s| s.at);
    }

    pub(super) fn temperature(&mut self, sample: &TemperatureSample) {
        self.came(sample.at);
        keep(&mut self.temperatures, sample.clone(), sample.at, |s| s.at);
    }

    pub(super) fn trigger(&mut self, time_s: f64, trigger: &ProbeTrigger) {
        let at = trigger.received_at;
        self.came(at);
        keep(
            &mut self.triggers,
            (time_s, trigger.clone()),
            at,
            |(_, t)| t.received_at,
        );
    }

    fn came(&mut self, at: Stamp<Host>) {
        self.newest = Some(self.newest.map_or(at, |newest| newest.max(at)));
    }
}

fn oldest(newest: Stamp<Host>) -> Stamp<Host> {
    newest - Span::from_secs_f64(LATE_S)
}

fn keep<T>(held: &mut VecDeque<T>, one: T, at: Stamp<Host>, of: fn(&T) -> Stamp<Host>) {
    held.push_back(one);
    let oldest = oldest(at);
    while held.front().is_some_and(|first| of(first) < oldest) {
        held.pop_front();
    }
}
