//! What was recorded of one run while it is open.

use std::collections::VecDeque;

use metrology::PerAxis;
use metrology::sample::{
    AxisState, GridSample, LengthSample, ProbeTrigger, TemperatureSample, TestSegment,
};
use metrology::stamp::{Host, Machine, Stamp};

use super::motion::times_s;
use super::recent::Recent;

/// Positions at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tick {
    /// Host's stamp.
    pub at: Stamp<Host>,
    /// Controller's stamp.
    pub controller_at: Stamp<Machine>,
    /// Session time of the host's stamp, s.
    pub time_s: f64,
    /// Command without compensation.
    pub commanded: PerAxis<f64>,
    /// Motors, compensation included.
    pub motor: PerAxis<f64>,
    /// Scales, NaN where there are none.
    pub scale: PerAxis<f64>,
}

impl Tick {
    pub(super) fn new(time_s: f64, state: &AxisState) -> Self {
        Self {
            at: state.received_at,
            controller_at: state.controller_at,
            time_s,
            commanded: state.commanded,
            motor: state.motor,
            scale: state.scale,
        }
    }
}

impl Tick {
    /// The same at another instant, of axes that stand.
    fn moved_to(self, at: Stamp<Host>) -> Self {
        let early = self.at - at;
        Self {
            at,
            controller_at: self.controller_at - early,
            time_s: self.time_s - early.as_secs_f64(),
            ..self
        }
    }
}

/// Offsets from one instant on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Offset {
    /// From when.
    pub at: Stamp<Host>,
    /// Added to the command.
    pub total: PerAxis<f64>,
}

/// One run as it comes.
#[derive(Clone, Debug)]
pub(super) struct Record {
    /// Its begin.
    pub segment: TestSegment,
    /// First and last stamp of what is of it; without one, what arrives is.
    from: Option<Stamp<Host>>,
    to: Option<Stamp<Host>>,
    /// The lead-in and the run.
    pub ticks: Vec<Tick>,
    /// How many of the ticks are lead-in.
    pub lead_in: usize,
    /// Compensation in effect, in time.
    pub offsets: Vec<Offset>,
    /// Readings of the grid encoder.
    pub grid: Vec<GridSample>,
    /// Readings of the length reference.
    pub length: Vec<LengthSample>,
    /// Touches with their session time.
    pub triggers: Vec<(f64, ProbeTrigger)>,
    /// Faces of blocks that a node computed, for records without touches: feature, approach, positions, time.
    pub faces: Vec<(f64, String, nalgebra::Vector3<f64>, PerAxis<f64>)>,
    /// Temperatures.
    pub temperatures: Vec<TemperatureSample>,
    /// Ticks that were not held.
    pub beyond_limit: usize,
}

/// Readings of one instrument, or offsets, that are held of a run while it is open: half an hour at 1 kHz, as of ticks.
pub(super) const MOST_READINGS: usize = 2_000_000;
/// Temperatures of all thermometers that are held of a run: an hour at 30 Hz.
pub(super) const MOST_TEMPERATURES: usize = 100_000;

/// Ticks of axes that stand are kept this far apart, s: nothing happens between them.
pub(super) const STANDING_S: f64 = 0.02;
/// A command that changes by less stands, mm or rad.
const STANDSTILL: f64 = 1e-6;

/// States further apart than this, and than so many times their middle spacing, leave a hole, s.
const STATE_HOLE_S: f64 = 0.25;
const HOLE_SPACINGS: f64 = 20.0;
/// Axes that are further on after a hole moved in it, mm or rad.
const MOVED: f64 = 1e-2;

/// Silence of the compensation beyond which its last value is only held, s.
const COMPENSATION_SILENCE_S: f64 = 1.0;

impl Record {
    /// A run that begins, with what came before and is of it.
    pub(super) fn new(segment: TestSegment, recent: &Recent, lead_in_s: f64) -> Self {
        let from = recent.of_this_clock(segment.at);
        let newest = recent.ticks.back().map(|tick| tick.at);
        let begins = from.or(newest).unwrap_or_default();
        let is_in = |at: Stamp<Host>| from.is_some_and(|from| at >= from);
        let mut record = Self {
            segment,
            from,
            to: None,
            ticks: vec![],
            lead_in: 0,
            offsets: recent.offsets.iter().copied().collect(),
            grid: of(&recent.grid, |sample| is_in(sample.at)),
            length: of(&recent.length, |sample| is_in(sample.at)),
            triggers: of(&recent.triggers, |(_, touch)| is_in(touch.received_at)),
            faces: vec![],
            temperatures: of(&recent.temperatures, |sample| is_in(sample.at)),
            beyond_limit: 0,
        };
        let is_old = |tick: &&Tick| (begins - tick.at).as_secs_f64() > lead_in_s;
        for tick in recent.ticks.iter().skip_while(is_old) {
            if is_in(tick.at) {
                record.push(*tick);
            } else {
                record.ticks.push(*tick);
                record.lead_in += 1;
            }
        }
        record
    }

    /// Whether a sample with this stamp is of the run.
    pub(super) fn holds(&self, at: Stamp<Host>) -> bool {
        self.from.is_none_or(|from| at >= from) && self.to.is_none_or(|to| at <= to)
    }

    /// What has a later stamp is not of the run.
    pub(super) fn end(&mut self, to: Option<Stamp<Host>>) {
        self.to = to;
        let Some(to) = to else { return };
        let run = self.ticks.get(self.lead_in..).unwrap_or(&[]);
        let within = self.lead_in + run.partition_point(|tick| tick.at <= to);
        let next = self.ticks.get(within).copied();
        self.ticks.truncate(within);
        // Of axes that stand the last tick was held only.
        if let (Some(last), Some(next)) = (self.ticks.last(), next)
            && stands(last, &next)
            && last.at < to
        {
            self.ticks.push(next.moved_to(to));
        }
        self.offsets.retain(|offset| offset.at <= to);
        self.grid.retain(|sample| sample.at <= to);
        self.length.retain(|sample| sample.at <= to);
        self.temperatures.retain(|sample| sample.at <= to);
    }

    /// Instants between which a sample is of the run; all of them where it has no begin or end.
    pub(super) fn span(&self) -> [Stamp<Host>; 2] {
        let from = self.from.unwrap_or(Stamp::from_nanos(i64::MIN));
        [from, self.to.unwrap_or(Stamp::from_nanos(i64::MAX))]
    }

    /// Gives up the touches from an instant on: they are of the run that began then.
    pub(super) fn give_up(&mut self, from: Stamp<Host>) {
        self.triggers.retain(|(_, touch)| touch.received_at < from);
    }

    /// Holds a sample in one of its lists; what is beyond the limit is counted, as ticks are.
    pub(super) fn hold<T>(
        &mut self,
        sample: T,
        most: usize,
        list: impl Fn(&mut Self) -> &mut Vec<T>,
    ) {
        let list = list(self);
        if list.len() < most {
            list.push(sample);
        } else {
            self.beyond_limit += 1;
        }
    }

    /// Takes an offset that was added before the end.
    pub(super) fn compensated(&mut self, offset: Offset) {
        if self.to.is_none_or(|to| offset.at <= to) {
            self.hold(offset, MOST_READINGS, |run| &mut run.offsets);
        }
    }

    /// Takes a tick where it is of the run or before it.
    pub(super) fn take(&mut self, tick: Tick, most: usize) {
        let is_before = self.from.is_some_and(|from| tick.at < from);
        if is_before && self.ticks.len() == self.lead_in {
            self.ticks.push(tick);
            self.lead_in += 1;
        } else if self.holds(tick.at) {
            if self.ticks.len() < most {
                self.push(tick);
            } else {
                self.beyond_limit += 1;
            }
        }
    }

    /// Takes a tick; of axes that stand only some are kept, the first and the last always.
    fn push(&mut self, tick: Tick) {
        if let [.., before, last] = &mut self.ticks[self.lead_in..]
            && stands(before, last)
            && stands(last, &tick)
            && tick.time_s - before.time_s < STANDING_S
        {
            *last = tick;
        } else {
            self.ticks.push(tick);
        }
    }

    /// Where the controller's stamps do not grow throughout, of ticks that arrived at one instant the first is kept;
    /// how many were left out.
    pub(super) fn leave_out_unordered(&mut self) -> usize {
        let grows = |pair: &[Tick]| pair[1].controller_at > pair[0].controller_at;
        if self.ticks.windows(2).all(grows) {
            return 0;
        }
        let (before, lead_in) = (self.ticks.len(), &self.ticks[..self.lead_in]);
        self.lead_in = lead_in.chunk_by(|a, b| a.at == b.at).count();
        self.ticks.dedup_by_key(|tick| tick.at);
        self.lead_in = self.lead_in.min(self.ticks.len());
        before - self.ticks.len()
    }

    /// Offsets that were added to the command at an instant: the last message at or before it.
    pub(super) fn offset(&self, at: Stamp<Host>) -> PerAxis<f64> {
        let next = self.offsets.partition_point(|offset| offset.at <= at);
        next.checked_sub(1)
            .and_then(|k| self.offsets.get(k))
            .map_or_else(PerAxis::default, |offset| offset.total)
    }

    /// Whether states are missing from the midst of a motion: speed, acceleration and turns there would be made up, and with
    /// them all that an effect remembers of them. States that a busy computer received in one lump are there.
    pub(super) fn has_hole_in_motion(&self) -> bool {
        let run = self.ticks.get(self.lead_in..).unwrap_or(&[]);
        let times_s = times_s(run);
        let spacing_s = |k: usize| times_s[k + 1] - times_s[k];
        let mut spacings_s: Vec<f64> = (1..run.len()).map(|k| spacing_s(k - 1)).collect();
        if spacings_s.is_empty() {
            return false;
        }
        let middle = spacings_s.len() / 2;
        let (_, middle_s, _) = spacings_s.select_nth_unstable_by(middle, f64::total_cmp);
        let least_s = STATE_HOLE_S.max(HOLE_SPACINGS * *middle_s);
        run.windows(2).enumerate().any(|(k, two)| {
            let pairs = two[0].commanded.0.iter().zip(&two[1].commanded.0);
            spacing_s(k) > least_s && pairs.into_iter().any(|(a, b)| (a - b).abs() > MOVED)
        })
    }

    /// Whether the compensation acted and its messages broke off during the run.
    pub(super) fn compensation_broke_off(&self) -> bool {
        let acts = |offset: &Offset| offset.total.0.iter().any(|v| v.abs() > 0.0);
        let end = self.ticks.last().map(|tick| tick.at);
        let begin = self.ticks.get(self.lead_in).map(|tick| tick.at);
        let (Some(begin), Some(end)) = (begin, end) else {
            return false;
        };
        let times = self.offsets.iter().map(|o| o.at).filter(|at| *at >= begin);
        let mut before = begin;
        let mut longest_s = 0.0_f64;
        for at in times.chain([end]) {
            longest_s = longest_s.max((at - before).as_secs_f64());
            before = at;
        }
        self.offsets.iter().filter(|o| o.at < end).any(acts) && longest_s > COMPENSATION_SILENCE_S
    }
}

fn of<T: Clone>(recent: &VecDeque<T>, is_in: impl Fn(&T) -> bool) -> Vec<T> {
    recent.iter().filter(|one| is_in(one)).cloned().collect()
}

/// Whether the command is the same at two ticks.
pub(super) fn stands(a: &Tick, b: &Tick) -> bool {
    let pairs = a.commanded.0.iter().zip(&b.commanded.0);
    pairs.into_iter().all(|(a, b)| (a - b).abs() < STANDSTILL)
}
