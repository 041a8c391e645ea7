//! What came last. Topics arrive in an order of their own: a begin may be told after the first samples of its run.

use std::collections::VecDeque;

pub(super) use metrology::sample::LATE_S;
use metrology::sample::{GridSample, LengthSample, ProbeTrigger, TemperatureSample};
use metrology::stamp::{Host, Span, Stamp};

use super::record::{Offset, Tick};

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
    /// The newest stamp of those that tell whether the clock jumped: of axes, thermometers and touches.
    newest: Option<Stamp<Host>>,
}

impl Recent {
    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// The newest stamp.
    pub(super) const fn newest(&self) -> Option<Stamp<Host>> {
        self.newest
    }

    /// The stamp of a segment where it is of the samples' clock: not further from the newest than a message may be late.
    pub(super) fn of_this_clock(&self, at: Stamp<Host>) -> Option<Stamp<Host>> {
        let ahead_s = self.ahead_s(at)?;
        (ahead_s.abs() <= LATE_S).then_some(at)
    }

    /// Whether a stamp is older than any message may be.
    pub(super) fn is_late(&self, at: Stamp<Host>) -> bool {
        self.ahead_s(at).is_some_and(|ahead_s| ahead_s < -LATE_S)
    }

    /// How far a stamp is ahead of the newest sample.
    fn ahead_s(&self, at: Stamp<Host>) -> Option<f64> {
        self.newest.map(|newest| (at - newest).as_secs_f64())
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
        keep(&mut self.grid, sample, self.newest, |s| s.at);
    }

    pub(super) fn length(&mut self, sample: LengthSample) {
        keep(&mut self.length, sample, self.newest, |s| s.at);
    }

    pub(super) fn temperature(&mut self, sample: &TemperatureSample) {
        self.came(sample.at);
        keep(&mut self.temperatures, sample.clone(), self.newest, |s| {
            s.at
        });
    }

    pub(super) fn trigger(&mut self, time_s: f64, trigger: &ProbeTrigger) {
        self.came(trigger.received_at);
        let touch = (time_s, trigger.clone());
        keep(&mut self.triggers, touch, self.newest, |(_, t)| {
            t.received_at
        });
    }

    fn came(&mut self, at: Stamp<Host>) {
        self.newest = Some(self.newest.map_or(at, |newest| newest.max(at)));
    }
}

fn oldest(newest: Stamp<Host>) -> Stamp<Host> {
    newest - Span::from_secs_f64(LATE_S)
}

/// Holds one where it is near the newest stamp: one far from it, as of a clock that was set, would stay for good.
fn keep<T>(held: &mut VecDeque<T>, one: T, newest: Option<Stamp<Host>>, of: fn(&T) -> Stamp<Host>) {
    let Some(newest) = newest else { return };
    let oldest = oldest(newest);
    while held.front().is_some_and(|first| of(first) < oldest) {
        held.pop_front();
    }
    if (of(&one) - newest).as_secs_f64().abs() <= LATE_S {
        held.push_back(one);
    }
}
