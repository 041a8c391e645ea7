//! Takes samples in the order of the recording and closes runs.

use std::collections::VecDeque;

use machine::file::AxisEntry;
use machine::twin::{Channel, Motion, Reading, Run, Session, Touch, simulate};
use machine::{Kinematics, MachineFile};
use metrology::sample::{
    AxisCompensation, AxisState, BlockMeasurement, GridSample, LengthSample, ProbeTrigger,
    TemperatureSample, TestSegment,
};
use metrology::stamp::{Host, Stamp};
use metrology::{Axis, AxisSet, PerAxis};

use super::account::{Account, Reason};
use super::channels::{Scope, Series, Zero, is_test, take_zero};
use super::config::SessionConfig;
use super::error::SessionError;
use super::motion::{of, thin, times_s, wanted};
use super::nominal;
use super::past::Past;
use super::record::{Offset, Record, Tick};
use super::select::{Selection, index};
use super::time::{At, SessionTime};

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

/// Number of readings that makes one mean, by what repeats have in common.
type Blocks = Vec<(TestSegment, usize)>;

/// Builds a session from recorded samples.
#[derive(Clone, Debug)]
pub struct SessionBuilder {
    config: SessionConfig,
    machine: MachineFile,
    kinematics: Kinematics,
    axes: AxisSet,
    time: SessionTime,
    past: Past,
    recent: VecDeque<Tick>,
    offset: Option<Offset>,
    open: Option<Record>,
    runs: Vec<Run>,
    zeros: Vec<Zero>,
    blocks: Blocks,
    account: Account,
    /// Greatest run, set-up and zero of the bags before this one, and of all.
    base: [u32; 3],
    greatest: [u32; 3],
    other_machine: Option<SessionError>,
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
            past: Past::new(config.history_step_s),
            machine: machine.clone(),
            config,
            time: SessionTime::default(),
            recent: VecDeque::new(),
            offset: None,
            open: None,
            runs: vec![],
            zeros: vec![],
            blocks: vec![],
            account: Account::default(),
            base: [0; 3],
            greatest: [0; 3],
            other_machine: None,
            has_commands: false,
        })
    }

    /// A bag ends: what is open is cut there.
    pub fn end_bag(&mut self) {
        self.cut();
    }

    /// Another bag begins: its runs, set-ups and zeros are others than those before.
    pub fn next_bag(&mut self) {
        self.end_bag();
        self.recent.clear();
        self.offset = None;
        self.base = self.greatest;
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
                self.open.iter_mut().for_each(|open| open.grid.push(sample));
            }
            Input::Length(mut sample) => {
                sample.zero_id = sample.zero_id.saturating_add(self.base[2]);
                self.open
                    .iter_mut()
                    .for_each(|open| open.length.push(sample));
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
        self.cut();
        if let Some(error) = self.other_machine {
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
        };
        simulate::check(&session)?;
        self.account.runs = session.runs.len();
        self.account.readings = session.runs.iter().map(|run| run.readings.len()).sum();
        Ok((session, self.account))
    }

    fn session_time(&mut self, at: Stamp<Host>) -> f64 {
        match self.time.take(at) {
            At::Time(time_s) => time_s,
            At::Jumped(time_s) => {
                self.account.note(Reason::ClockJump);
                self.cut();
                self.recent.clear();
                self.offset = None;
                time_s
            }
        }
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
        let time_s = self.session_time(state.received_at);
        let open = self.open.as_ref();
        let last = open.map_or(self.recent.back(), |open| open.ticks.last());
        if last.is_some_and(|last| state.received_at <= last.at) {
            self.account.note(Reason::WentBack);
            return;
        }
        self.past.axes(time_s, &state.commanded);
        let tick = Tick::new(time_s, state);
        match &mut self.open {
            Some(open) if open.ticks.len() < self.config.ticks_per_run => open.ticks.push(tick),
            Some(open) => open.beyond_limit += 1,
            None => {
                self.recent.push_back(tick);
                let oldest_s = time_s - self.config.lead_in_s;
                while self.recent.front().is_some_and(|t| t.time_s < oldest_s) {
                    self.recent.pop_front();
                }
            }
        }
    }

    fn is_another_machine(&mut self, state: &AxisState) -> bool {
        if self.other_machine.is_none() {
            self.other_machine = other_machine(&self.machine, self.axes, state);
        }
        self.other_machine.is_some()
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
        let is_late = self.offset.is_some_and(|before| offset.at <= before.at);
        if is_late {
            self.account.note(Reason::WentBack);
            return;
        }
        self.offset = Some(offset);
        self.open
            .iter_mut()
            .for_each(|open| open.offsets.push(offset));
    }

    fn temperature(&mut self, sample: &TemperatureSample) {
        if sample.temperature_degc.is_finite() {
            let time_s = self.session_time(sample.at);
            self.past
                .temperature(time_s, &sample.sensor, sample.temperature_degc);
        } else {
            self.account.note(Reason::NotFinite);
        }
    }

    fn trigger(&mut self, trigger: ProbeTrigger) {
        self.has_commands = true;
        let positions = self.axes.iter().map(|axis| trigger.latched[axis]);
        if positions
            .chain(trigger.approach.iter().copied())
            .all(f64::is_finite)
        {
            let time_s = self.session_time(trigger.received_at);
            self.open
                .iter_mut()
                .for_each(|open| open.triggers.push((time_s, trigger.clone())));
        } else {
            self.account.note(Reason::NotFinite);
        }
    }

    fn block(&mut self, measurement: &BlockMeasurement) {
        self.has_commands = true;
        for axis in Axis::LINEAR {
            let Some(face) = &measurement.faces[axis] else {
                continue;
            };
            let time_s = self.session_time(face.at);
            let known = nominal::face(&self.machine, &measurement.block_id, axis, face.position_mm);
            match known {
                Some((feature, approach, positions)) => self.open.iter_mut().for_each(|open| {
                    open.faces
                        .push((time_s, feature.clone(), approach, positions));
                }),
                None => self.account.note(Reason::UnknownFeature),
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
        if segment.begin {
            self.cut();
            self.account.segments += 1;
            if is_test(segment.kind) {
                let lead_in = self.recent.iter().copied().collect();
                self.open = Some(Record::new(segment, lead_in, self.offset));
            }
        } else if let Some(open) = self.open.take() {
            if open.segment.run != segment.run {
                self.account.note(Reason::NotBegun);
                self.open = Some(open);
            } else if segment.completed {
                self.close(open);
            } else {
                self.account.note(Reason::Failed);
                self.go_on(&open);
            }
        } else if is_test(segment.kind) {
            self.account.note(Reason::NotBegun);
        }
    }

    /// Closes an open run that has no end.
    fn cut(&mut self) {
        if let Some(open) = self.open.take() {
            self.account.note(Reason::Cut);
            self.close(open);
        }
    }

    /// The end of a run is the lead-in of the next.
    fn go_on(&mut self, open: &Record) {
        self.recent.clear();
        let newest_s = open.ticks.last().map_or(0.0, |tick| tick.time_s);
        let recent = |tick: &&Tick| tick.time_s >= newest_s - self.config.lead_in_s;
        self.recent.extend(open.ticks.iter().filter(recent));
    }

    fn close(&mut self, open: Record) {
        self.go_on(&open);
        self.account.note_many(Reason::TooLong, open.beyond_limit);
        if open.compensation_broke_off() {
            self.account.note(Reason::CompensationHeld);
        }
        // What is no motion was refused sample by sample before.
        if let Ok(Some(run)) = self.run(open) {
            self.runs.push(run);
        }
    }

    fn run(&mut self, open: Record) -> Result<Option<Run>, SessionError> {
        let times = times_s(&open.ticks);
        let motion = of(&open.ticks, times, self.axes)?;
        let selection = Selection::of(&open.segment, &motion, open.lead_in, self.config.settle_s);
        let block = self.block_of(&open.segment, selection.len());
        let scope = Scope {
            machine: &self.machine,
            record: &open,
            motion: &motion,
        };
        let mut series = scope.channels(&mut self.account);
        for (_, readings) in &mut series {
            *readings = selection.apply(readings, block);
        }
        take_zero(&mut self.zeros, &open, &mut series);
        let touches = self.touches(&open, &motion);
        let mut marks = vec![false; motion.len()];
        wanted(&motion, &mut marks);
        let places = series.iter().flat_map(|(_, readings)| readings);
        for place in places.map(|raw| raw.place) {
            marks[index(place)] = true;
            if place.fract() > 0.0 && index(place) + 1 < marks.len() {
                marks[index(place) + 1] = true;
            }
        }
        for tick in touches.iter().filter_map(|(touch, _)| touch.tick) {
            marks[tick] = true;
        }
        Ok(assemble(open.segment, &motion, &marks, series, touches))
    }

    /// How many neighbours make one reading: the same odd number in every repeat.
    fn block_of(&mut self, segment: &TestSegment, n: usize) -> usize {
        if let Some((_, block)) = self.blocks.iter().find(|(known, _)| alike(known, segment)) {
            return *block;
        }
        let block = n.div_ceil(self.config.readings_per_run.max(1)).max(1) | 1;
        self.blocks.push((segment.clone(), block));
        block
    }

    /// Touches with their deviation (4); faces of blocks where there are none.
    fn touches(&mut self, open: &Record, motion: &Motion) -> Vec<(Touch, f64)> {
        let mut touches = vec![];
        for (time_s, trigger) in &open.triggers {
            let beyond = self.beyond(&trigger.feature_id, &trigger.latched, &trigger.approach);
            let Some(deviation) = beyond else {
                self.account.note(Reason::UnknownFeature);
                continue;
            };
            let after = open
                .ticks
                .partition_point(|tick| tick.controller_at <= trigger.controller_at);
            let tick = after
                .checked_sub(1)
                .map(|before| nearest(open, before, trigger));
            touches.push((
                Touch {
                    time_s: tick.map_or(*time_s, |tick| motion.time_s[tick]),
                    feature_id: trigger.feature_id.clone(),
                    approach: trigger.approach,
                    feed_mm_s: trigger.feed_mm_s,
                    position: trigger.latched,
                    tick,
                },
                deviation,
            ));
        }
        if touches.is_empty() && open.triggers.is_empty() {
            for (time_s, feature, approach, positions) in &open.faces {
                let touch = Touch {
                    time_s: *time_s,
                    feature_id: feature.clone(),
                    approach: *approach,
                    feed_mm_s: 0.0,
                    position: *positions,
                    tick: None,
                };
                let beyond = self.beyond(feature, positions, approach);
                touches.extend(beyond.map(|deviation| (touch, deviation)));
            }
        }
        touches
    }

    fn beyond(
        &self,
        feature: &str,
        latched: &PerAxis<f64>,
        approach: &nalgebra::Vector3<f64>,
    ) -> Option<f64> {
        nominal::beyond_surface_mm(&self.machine, &self.kinematics, feature, latched, approach)
    }
}

/// The run with the marked ticks of its motion; none without a reading.
fn assemble(
    segment: TestSegment,
    motion: &Motion,
    marks: &[bool],
    series: Vec<Series>,
    touches: Vec<(Touch, f64)>,
) -> Option<Run> {
    let (thinned, kept) = thin(motion, marks);
    let mut readings: Vec<Reading> = vec![];
    for (channel, raws) in series {
        readings.extend(raws.into_iter().map(|raw| {
            let (at, fraction) = place_in(motion, &thinned, &kept, raw.place);
            Reading {
                channel: channel.clone(),
                at,
                fraction,
                deviation: raw.deviation,
            }
        }));
    }
    let mut kept_touches = vec![];
    for (mut touch, deviation) in touches {
        touch.tick = touch.tick.map(|tick| kept[tick]);
        readings.push(Reading {
            channel: Channel::Touch,
            at: kept_touches.len(),
            fraction: 0.0,
            deviation,
        });
        kept_touches.push(touch);
    }
    if readings.is_empty() {
        return None;
    }
    Some(Run {
        segment,
        motion: thinned,
        touches: kept_touches,
        readings,
    })
}

fn nearest(open: &Record, before: usize, trigger: &ProbeTrigger) -> usize {
    let off = |k: usize| {
        let tick = open.ticks.get(k)?;
        Some((tick.controller_at - trigger.controller_at).nanos().abs())
    };
    match (off(before), off(before + 1)) {
        (Some(a), Some(b)) if b < a => before + 1,
        _ => before,
    }
}

/// Index and fraction in the thinned motion of a place in the full one.
fn place_in(full: &Motion, thinned: &Motion, kept: &[usize], place: f64) -> (usize, f64) {
    let k = index(place);
    let time = |k: usize| full.time_s.get(k).copied();
    let here = full.time_s[k];
    let at_s = here + (time(k + 1).unwrap_or(here) - here) * place.fract();
    let at = kept[k];
    let before_s = thinned.time_s[at];
    let fraction = thinned
        .time_s
        .get(at + 1)
        .map_or(0.0, |after_s| (at_s - before_s) / (after_s - before_s));
    (at, fraction.clamp(0.0, 1.0))
}

/// Whether two runs are repeats of one test.
fn alike(a: &TestSegment, b: &TestSegment) -> bool {
    a.kind == b.kind
        && a.plane == b.plane
        && a.stations == b.stations
        && a.features == b.features
        && (a.radius_mm - b.radius_mm).abs() < 1e-9
        && (a.feed_mm_s - b.feed_mm_s).abs() < 1e-9
}

fn other_machine(machine: &MachineFile, axes: AxisSet, state: &AxisState) -> Option<SessionError> {
    if state.axes != axes {
        let letters = |set: AxisSet| set.iter().map(Axis::letter).collect::<String>();
        return Some(SessionError::OtherAxes {
            found: letters(state.axes),
            wanted: letters(axes),
        });
    }
    axes.iter().find_map(|axis| {
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
