//! Takes samples in the order of the recording and closes runs.

use std::cmp::Ordering;
use std::collections::VecDeque;

use machine::file::AxisEntry;
use machine::{Kinematics, MachineFile};
use metrology::bound::TOUCHES_OF_RUN;
use metrology::sample::{
    AxisCompensation, AxisState, BlockMeasurement, GridSample, LengthSample, NewTouches,
    ProbeTrigger, TemperatureSample, TestSegment,
};
use metrology::stamp::{Host, Stamp};
use metrology::{Axis, AxisSet};
use twin::{Run, Session, simulate};

use super::account::{Account, Reason};
use super::channels::{Zero, is_test, touches_only};
use super::config::SessionConfig;
use super::error::SessionError;
use super::nominal;
use super::past::Past;
use super::recent::Recent;
use super::record::{MOST_READINGS, MOST_TEMPERATURES, Offset, Record, Tick};
use super::time::{At, SessionTime, Source};

/// One recorded sample.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Positions at one tick.
    State(AxisState),
    /// Grid encoder.
    Grid(GridSample),
    /// Length reference.
    Length(LengthSample),
    /// A touch as the controller latched it.
    Trigger(ProbeTrigger),
    /// Offsets added to the commands.
    Compensation(AxisCompensation),
    /// A temperature.
    Temperature(TemperatureSample),
    /// A corner of a block; used where a run has no touches.
    Block(BlockMeasurement),
    /// Begin or end of a test.
    Segment(TestSegment),
}

/// How far beyond the travel of the machine file a command may go, share of the travel.
const BEYOND_TRAVEL: f64 = 0.01;

/// Where one of so many axis states, or more, is of another machine, the recording is another machine's.
const STATES_PER_STRANGER: usize = 2;

/// Most runs that have ended and are not closed yet.
const MOST_ENDED: usize = 4;

/// Number of readings that makes one mean, by what repeats have in common.
type Blocks = Vec<(TestSegment, usize)>;

/// Builds a session from recorded samples.
#[derive(Clone, Debug)]
pub struct SessionBuilder {
    pub(super) config: SessionConfig,
    pub(super) machine: MachineFile,
    pub(super) kinematics: Kinematics,
    pub(super) axes: AxisSet,
    time: SessionTime,
    past: Past,
    recent: Recent,
    open: Option<Record>,
    /// Runs that have ended, with the time of their end: their last samples may still come.
    ended: VecDeque<(f64, Record)>,
    /// Begin and end of the last run of touches that was closed.
    over: Option<[Stamp<Host>; 2]>,
    /// Whether the last segment was the end of a run of touches: one may come, and be stamped, after it.
    awaits_touches: bool,
    touches: NewTouches,
    pub(super) runs: Vec<Run>,
    pub(super) closed: usize,
    pub(super) zeros: Vec<Zero>,
    pub(super) blocks: Blocks,
    pub(super) account: Account,
    /// Greatest run, set-up and zero of the bags before this one, and of all.
    base: [u32; 3],
    first_bag_ends: Option<u32>,
    greatest: [u32; 3],
    /// Whether no sample of the bag came yet.
    awaits_bag: bool,
    /// Why the first axis state was refused that is of another machine.
    other_machine: Option<SessionError>,
    /// Axis states with numbers, those of another machine included.
    states: usize,
    has_commands: bool,
}

impl SessionBuilder {
    /// A builder for one machine.
    ///
    /// # Errors
    /// When its chain is none.
    pub fn new(machine: &MachineFile, config: SessionConfig) -> Result<Self, SessionError> {
        Ok(Self {
            kinematics: Kinematics::new(machine)?,
            axes: machine.axis_set(),
            past: Past::new(machine, config.history_step_s),
            machine: machine.clone(),
            config,
            time: SessionTime::default(),
            recent: Recent::default(),
            open: None,
            ended: VecDeque::new(),
            over: None,
            awaits_touches: false,
            touches: NewTouches::default(),
            runs: vec![],
            closed: 0,
            zeros: vec![],
            blocks: vec![],
            account: Account::default(),
            base: [0; 3],
            greatest: [0; 3],
            first_bag_ends: None,
            awaits_bag: true,
            other_machine: None,
            states: 0,
            has_commands: false,
        })
    }

    /// A bag ends: what is open is cut there.
    pub fn end_bag(&mut self) {
        self.cut();
    }

    /// Nothing comes any more for now: runs that have ended are whole.
    pub fn settle(&mut self) {
        self.close_ended(self.ended.len());
    }

    /// Another bag begins: its runs, set-ups and zeros are others than those before.
    pub fn next_bag(&mut self) {
        self.end_bag();
        self.recent.clear();
        self.time.next_bag();
        self.over = None;
        self.touches = NewTouches::default();
        self.base = self.greatest;
        self.awaits_bag = true;
        if !self.runs.is_empty() {
            let _ = self.first_bag_ends.get_or_insert(self.base[0]);
        }
    }

    /// Takes one sample.
    pub fn take(&mut self, input: Input) {
        match input {
            Input::State(state) => self.state(&state),
            Input::Segment(segment) => self.segment(segment),
            Input::Compensation(compensation) => self.compensation(&compensation),
            Input::Temperature(sample) => self.temperature(&sample),
            Input::Grid(mut sample) => {
                sample.zero_id = sample.zero_id.saturating_add(self.base[2]);
                self.recent.grid(sample);
                let of = self.run_at(sample.at);
                of.into_iter()
                    .for_each(|run| run.hold(sample, MOST_READINGS, |run| &mut run.grid));
            }
            Input::Length(mut sample) => {
                sample.zero_id = sample.zero_id.saturating_add(self.base[2]);
                self.recent.length(sample);
                let of = self.run_at(sample.at);
                of.into_iter()
                    .for_each(|run| run.hold(sample, MOST_READINGS, |run| &mut run.length));
            }
            Input::Trigger(trigger) => self.trigger(trigger),
            Input::Block(measurement) => self.block(&measurement),
        }
    }

    /// Runs that are closed so far.
    #[must_use]
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// Whether the session has become longer than what is held of its past.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.past.is_over(self.time.newest_s())
    }

    /// Number of runs with readings that were closed since the start.
    #[must_use]
    pub fn closed(&self) -> usize {
        self.closed
    }

    /// Keeps the last `most` runs only.
    pub fn keep_last(&mut self, most: usize) {
        let beyond = self.runs.len().saturating_sub(most);
        self.runs.drain(..beyond);
    }

    /// The session of the runs that are closed so far.
    #[must_use]
    pub fn so_far(&self) -> Session {
        Session {
            history: self.past.history(self.axes),
            runs: self.runs.clone(),
            first_bag_ends: self.first_bag_ends,
        }
    }

    /// What was counted so far.
    #[must_use]
    pub fn account(&self) -> &Account {
        &self.account
    }

    /// Ends the recording.
    ///
    /// # Errors
    /// When it is another machine's, or holds nothing that could be diagnosed.
    pub fn finish(mut self) -> Result<(Session, Account), SessionError> {
        self.end_bag();
        let strangers = self.account.count(Reason::OtherMachine);
        if let Some(error) = self.other_machine.take()
            && strangers.saturating_mul(STATES_PER_STRANGER) >= self.states
        {
            return Err(error);
        }
        if self.runs.is_empty() {
            return Err(match self.account.segments {
                _ if !self.has_commands => SessionError::NothingCommanded,
                0 => SessionError::NoSegments,
                segments => SessionError::NothingRead { segments },
            });
        }
        let session = Session {
            history: self.past.history(self.axes),
            runs: self.runs,
            first_bag_ends: self.first_bag_ends,
        };
        simulate::check(&session)?;
        self.account.runs = session.runs.len();
        self.account.readings = session.runs.iter().map(|run| run.readings.len()).sum();
        Ok((session, self.account))
    }

    fn session_time(&mut self, at: Stamp<Host>, source: Source) -> f64 {
        let is_first = std::mem::take(&mut self.awaits_bag);
        match self.time.take(at, source) {
            // Axis states may come behind all else: what has ended is whole when they say so.
            At::Time(time_s) if source == Source::Other && self.time.follows_axes() => time_s,
            At::Time(time_s) => {
                let wait_s = self.config.wait_s;
                let is_over = |(ended_s, _): &(f64, Record)| time_s - ended_s > wait_s;
                let over = self.ended.iter().take_while(|run| is_over(run)).count();
                self.close_ended(over);
                time_s
            }
            At::Jumped(time_s) => {
                self.account.note(Reason::ClockJump);
                // What is open before a bag's first sample is the bag's own.
                if !is_first {
                    self.cut();
                    self.recent.clear();
                }
                time_s
            }
        }
    }

    /// Runs that are not closed, in their order.
    fn records(&mut self) -> impl Iterator<Item = &mut Record> {
        let ended = self.ended.iter_mut().map(|(_, ended)| ended);
        ended.chain(&mut self.open)
    }

    /// The run that a sample with this stamp is of.
    fn run_at(&mut self, at: Stamp<Host>) -> Option<&mut Record> {
        self.records().find(|run| run.holds(at))
    }

    fn state(&mut self, state: &AxisState) {
        self.has_commands = true;
        if self.is_another_machine(state) {
            return;
        }
        if self
            .axes
            .iter()
            .any(|axis| !state.commanded[axis].is_finite())
        {
            self.account.note(Reason::NotFinite);
            return;
        }
        let time_s = self.session_time(state.received_at, Source::Axes);
        let last = self.recent.ticks.back();
        // Many states may arrive at one instant: their order is the controller's then.
        let is_later =
            |last: &Tick| (state.received_at, state.controller_at) > (last.at, last.controller_at);
        if last.is_some_and(|last| !is_later(last)) {
            self.account.note(Reason::WentBack);
            return;
        }
        if self.past.is_over(time_s) {
            self.account.note(Reason::TooMuch);
        }
        self.past.axes(time_s, &state.commanded);
        let tick = Tick::new(time_s, state);
        self.recent.tick(tick, self.config.lead_in_s);
        let most = self.config.ticks_per_run;
        self.records().for_each(|run| run.take(tick, most));
    }

    /// Refuses this one state; what is the machine's own is taken before and after it.
    fn is_another_machine(&mut self, state: &AxisState) -> bool {
        self.states += 1;
        let Some(error) = other_machine(&self.machine, self.axes, state) else {
            return false;
        };
        self.account.note(Reason::OtherMachine);
        self.other_machine.get_or_insert(error);
        true
    }

    /// Why an axis state is not of this machine; [`Self::take`] leaves it out.
    #[must_use]
    pub fn why_not_of_machine(&self, state: &AxisState) -> Option<SessionError> {
        other_machine(&self.machine, self.axes, state)
    }

    /// Why the first axis state was refused that is of another machine.
    #[must_use]
    pub const fn other_machine(&self) -> Option<&SessionError> {
        self.other_machine.as_ref()
    }

    fn compensation(&mut self, compensation: &AxisCompensation) {
        if !compensation.total.0.iter().all(|v| v.is_finite()) {
            self.account.note(Reason::NotFinite);
            return;
        }
        let offset = Offset {
            at: compensation.at,
            total: compensation.total,
        };
        let before = { self.recent.offsets.back() }.map(|before| offset.at.cmp(&before.at));
        match before {
            Some(Ordering::Less) => return self.account.note(Reason::WentBack),
            // Of several at one instant the first counts.
            Some(Ordering::Equal) => return,
            Some(Ordering::Greater) | None => {}
        }
        self.recent.offset(offset);
        self.records().for_each(|run| run.compensated(offset));
    }

    fn temperature(&mut self, sample: &TemperatureSample) {
        if sample.temperature_degc.is_finite() {
            let time_s = self.session_time(sample.at, Source::Other);
            let degc = sample.temperature_degc;
            if !self.past.temperature(time_s, &sample.sensor, degc) {
                self.account.note(Reason::TooMuch);
                return;
            }
            self.recent.temperature(sample);
            let of = self.run_at(sample.at);
            of.into_iter().for_each(|run| {
                run.hold(sample.clone(), MOST_TEMPERATURES, |run| {
                    &mut run.temperatures
                })
            });
        } else {
            self.account.note(Reason::NotFinite);
        }
    }

    fn trigger(&mut self, trigger: ProbeTrigger) {
        self.has_commands = true;
        if !self.touches.is_later(&trigger) {
            self.account.note(Reason::ToldBefore);
            return;
        }
        let positions = self.axes.iter().map(|axis| trigger.latched[axis]);
        if positions
            .chain(trigger.approach.iter().copied())
            .all(f64::is_finite)
        {
            let time_s = self.session_time(trigger.received_at, Source::Other);
            self.recent.trigger(time_s, &trigger);
            if let Some(run) = self.run_at(trigger.received_at) {
                run.hold((time_s, trigger), TOUCHES_OF_RUN, |run| &mut run.triggers);
            } else if self.awaits_touches
                && let Some((_, ended)) = self.ended.back_mut()
            {
                ended.hold((time_s, trigger), TOUCHES_OF_RUN, |run| &mut run.triggers);
            } else if { self.over }
                .is_some_and(|[from, to]| (from..=to).contains(&trigger.received_at))
            {
                self.account.note(Reason::TouchLate);
            }
        } else {
            self.account.note(Reason::NotFinite);
        }
    }

    /// A block is measured when its touches are corrected, which may be after the end of its run.
    fn block(&mut self, measurement: &BlockMeasurement) {
        self.has_commands = true;
        let number = measurement.run.saturating_add(self.base[0]);
        for axis in Axis::LINEAR {
            let Some(face) = &measurement.faces[axis] else {
                continue;
            };
            let known = nominal::face(&self.machine, &measurement.block_id, axis, face.position_mm);
            let Some((feature, approach, positions)) = known else {
                self.account.note(Reason::UnknownFeature);
                continue;
            };
            let time_s = self.time.of(face.at);
            if let Some(run) = self.records().find(|run| run.segment.run == number) {
                let face = (time_s, feature, approach, positions);
                run.hold(face, TOUCHES_OF_RUN, |run| &mut run.faces);
            }
        }
    }

    fn segment(&mut self, mut segment: TestSegment) {
        let numbers = [
            &mut segment.run,
            &mut segment.setup_id,
            &mut segment.zero_id,
        ];
        for ((number, base), greatest) in numbers.into_iter().zip(self.base).zip(&mut self.greatest)
        {
            *number = number.saturating_add(base);
            *greatest = (*greatest).max(*number);
        }
        if self.recent.is_late(segment.at) && is_test(segment.kind) {
            self.account.note(Reason::SegmentLate);
        }
        self.awaits_touches = false;
        let at = self.recent.of_this_clock(segment.at);
        if segment.begin {
            self.cut_at(at);
            self.account.segments += 1;
            for (at, (_, ended)) in at.iter().zip(self.ended.back_mut()) {
                ended.give_up(*at);
            }
            if is_test(segment.kind) {
                let lead_in_s = self.config.lead_in_s;
                self.open = Some(Record::new(segment, &self.recent, lead_in_s));
            }
        } else if let Some(mut open) = self.open.take() {
            if open.segment.run != segment.run {
                self.account.note(Reason::NotBegun);
                self.open = Some(open);
            } else if segment.completed {
                self.awaits_touches = touches_only(segment.kind);
                self.close_ended(self.ended.len().saturating_sub(MOST_ENDED - 1));
                let ended_s = at.map_or(self.time.newest_s(), |at| self.time.of(at));
                open.end(at.or(self.recent.newest()));
                self.ended.push_back((ended_s, open));
            } else {
                self.account.note(Reason::Failed);
            }
        } else if is_test(segment.kind) {
            self.account.note(Reason::NotBegun);
        }
    }

    /// Closes the first so many runs of those that have ended.
    fn close_ended(&mut self, many: usize) {
        for _ in 0..many {
            if let Some((_, ended)) = self.ended.pop_front() {
                if touches_only(ended.segment.kind) {
                    self.over = Some(ended.span());
                }
                self.close(ended);
            }
        }
    }

    /// Closes every run, also one that has no end.
    fn cut(&mut self) {
        self.cut_at(None);
        self.settle();
    }

    /// Closes an open run that has no end, with what was taken before the next one.
    fn cut_at(&mut self, next: Option<Stamp<Host>>) {
        if let Some(mut open) = self.open.take() {
            self.account.note(Reason::Cut);
            self.settle();
            open.end(next);
            self.close(open);
        }
    }
}

/// Why an axis state with these axes cannot be of the machine whose file this is: it has other axes, or
/// [`outside_travel`].
fn other_machine(machine: &MachineFile, axes: AxisSet, state: &AxisState) -> Option<SessionError> {
    if state.axes != axes {
        let letters = |set: AxisSet| set.iter().map(Axis::letter).collect::<String>();
        return Some(SessionError::OtherAxes {
            found: letters(state.axes),
            wanted: letters(axes),
        });
    }
    outside_travel(machine, state)
}

/// Why an axis state is of no use to the machine whose file this is: an axis that both have was commanded further beyond
/// its travel than 1 % of it. The one rule of every verb that reads axis states.
#[must_use]
pub fn outside_travel(machine: &MachineFile, state: &AxisState) -> Option<SessionError> {
    state.axes.iter().find_map(|axis| {
        let ([low, high], position, unit) = match machine.axes.get(&axis)? {
            AxisEntry::Linear(entry) => (entry.travel_mm, state.commanded[axis], "mm"),
            AxisEntry::Rotary(entry) => {
                (entry.travel_deg, state.commanded[axis].to_degrees(), "deg")
            }
        };
        let slack = BEYOND_TRAVEL * (high - low);
        (position < low - slack || position > high + slack).then_some(SessionError::OutsideTravel {
            axis,
            position,
            unit,
            low,
            high,
        })
    })
}

#[cfg(test)]
mod tests {
    use metrology::PerAxis;

    use super::*;

    const MACHINE: &str = include_str!("../../../../launch_configs/gap_first/machine.yaml");

    #[test]
    fn a_state_far_outside_the_travel_is_known_by_one_rule() {
        let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
        let AxisEntry::Linear(entry) = &machine.axes[&Axis::X] else {
            panic!("X is a linear axis");
        };
        let [low, high] = entry.travel_mm;
        let slack = 0.01 * (high - low);
        for (x_mm, is_outside) in [
            (low, false),
            (high + 0.99 * slack, false),
            (high + 1.01 * slack, true),
            (low - 1.01 * slack, true),
            (1e5, true),
            (-1e300, true),
        ] {
            let mut place = PerAxis::default();
            place[Axis::X] = x_mm;
            let state = AxisState {
                received_at: Stamp::from_nanos(1_000_000_000),
                controller_at: Stamp::from_nanos(1_000_000_000),
                axes: AxisSet::XYZ,
                commanded: place,
                motor: place,
                scale: place,
                velocity: PerAxis::default(),
            };
            let found = outside_travel(&machine, &state);
            assert_eq!(found.is_some(), is_outside, "{x_mm}");
        }
    }
}
