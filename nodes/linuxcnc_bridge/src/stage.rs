//! The bridge as a stage: bytes and time go in; positions, touches and commands come out.

use std::convert::Infallible;

use metrology::Stage;
use metrology::sample::{AxisCompensation, AxisState, ProbeTrigger};
use metrology::stamp::{Host, Machine, Span, Stamp};

use crate::clock::{SampleClock, Succession};
use crate::compensation::{CompensationPath, Freshness};
use crate::condition::{Condition, Lost};
use crate::config::Settings;
use crate::latch::TouchDetector;
use crate::protocol::ProgramStatus;
use crate::run::{Ending, Refusal, Run, RunState};
use crate::samples::{PROBING, Record, SampleEvent, SampleReader};
use crate::session::{Session, Want};

/// From where on a slow servo thread is reported.
const SLIP_LIMIT: f64 = 0.01;
/// Least time between two [`Output::Joints`].
const JOINT_PERIOD: Span = Span::from_nanos(20_000_000);
/// The sampler is started anew after this silence.
const SILENCE_LIMIT: Span = Span::from_nanos(2_000_000_000);

/// What the bridge is told.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "one at a time; a box would allocate at 1 kHz"
)]
pub enum Input {
    /// A program is to be run.
    Goal {
        /// Number of the goal.
        goal: u64,
        /// Text of the program.
        program: String,
    },
    /// A program is called off.
    Cancel {
        /// Number of the goal.
        goal: u64,
    },
    /// What is to be added to the commands.
    Compensation(AxisCompensation),
    /// Time has passed.
    Tick,
    /// News from outside.
    Io(IoEvent),
    /// The bridge may act, or is to come to rest and say when it has: a running program is called off first.
    Active(bool),
    /// The bridge is to stop: a running program is called off first.
    Shutdown,
}

/// News from the sockets, processes and files that the stage does not own.
#[derive(Clone, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "each variant says it")]
pub enum IoEvent {
    Connected,
    NotConnected { reason: String },
    Received(Vec<u8>),
    Closed { reason: String },
    Sampled(Vec<u8>),
    SamplerEnded { reason: String },
    HalComplained { message: String },
    Stored { number: u32, path: String },
    NotStored { number: u32, reason: String },
}

/// What the stage wants done with them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum IoCommand {
    /// Open a connection to the controller.
    Connect,
    /// Close it.
    Disconnect,
    /// Send this line.
    Send(String),
    /// Start the sampler's reader, ending an earlier one.
    StartSampler,
    /// End the sampler's reader.
    StopSampler,
    /// Give these lines to HAL.
    Hal(String),
    /// Write a program where the controller can read it.
    Store {
        /// Its number.
        number: u32,
        /// Its text.
        text: String,
    },
}

/// What the bridge says.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// Positions of one servo period.
    State(AxisState),
    /// The same, at 50 Hz, for everybody's tools.
    Joints(AxisState),
    /// A latched touch.
    Trigger(ProbeTrigger),
    /// A goal was taken.
    Accepted {
        /// Number of the goal.
        goal: u64,
    },
    /// A goal was not taken.
    Refused {
        /// Number of the goal.
        goal: u64,
        /// Why.
        refusal: Refusal,
    },
    /// News of a goal.
    Feedback {
        /// Number of the goal.
        goal: u64,
        /// Line being executed, from 1.
        line: u32,
        /// What the controller does.
        state: RunState,
        /// Share of the lines, 0 to 1.
        progress: f64,
    },
    /// A goal has ended.
    Finished {
        /// Number of the goal.
        goal: u64,
        /// How.
        ending: Ending,
    },
    /// A condition worth reporting.
    Condition(Condition),
    /// Something to be done outside.
    Io(IoCommand),
    /// After [`Input::Active`] with false: no program is on its way, and HAL is told of offsets no longer.
    AtRest,
    /// The answer to [`Input::Shutdown`].
    Stopped,
}

/// The reader of the sampler, as the stage sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sampling {
    Off { retry_at: Option<Stamp<Host>> },
    Started { at: Stamp<Host> },
    Flowing { last: Stamp<Host> },
}

/// The whole bridge without its sockets and processes.
#[derive(Debug)]
pub struct BridgeStage {
    settings: Settings,
    session: Session,
    run: Option<Run>,
    stored: u32,
    news: Option<(u32, RunState)>,
    sampling: Sampling,
    reader: SampleReader,
    clock: SampleClock,
    touches: TouchDetector,
    joints_at: Option<Stamp<Machine>>,
    slow: bool,
    sequence: u32,
    motion_type: i32,
    compensation: CompensationPath,
    freshness: Option<Freshness>,
    active: bool,
    resting: bool,
    stopping: bool,
    stopped: bool,
    conditions: Vec<Condition>,
}

impl BridgeStage {
    /// A bridge that has not looked for the controller yet.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        Self {
            session: Session::new(settings),
            run: None,
            stored: 0,
            news: None,
            sampling: Sampling::Off { retry_at: None },
            reader: SampleReader::new(&settings.joints, &settings.scales),
            clock: SampleClock::new(settings.servo_period),
            touches: TouchDetector::new(settings.servo_period, settings.axes),
            joints_at: None,
            slow: false,
            sequence: 0,
            motion_type: 0,
            compensation: CompensationPath::new(settings),
            freshness: None,
            active: true,
            resting: false,
            stopping: false,
            stopped: false,
            conditions: Vec::new(),
            settings: settings.clone(),
        }
    }

    /// The same, but it takes programs and offsets only once [`Input::Active`] says so.
    #[must_use]
    pub fn inactive(mut self) -> Self {
        self.active = false;
        self
    }

    fn act(&mut self, active: bool) {
        self.active = active;
        self.resting = !active;
        if !active {
            self.call_off(None);
            self.compensation.release();
            self.freshness = None;
        }
    }

    fn refusal(&self, program: &str) -> Option<Refusal> {
        let state = self.session.state();
        if self.run.is_some() || self.stopping {
            Some(Refusal::Busy)
        } else if !self.active {
            Some(Refusal::Inactive)
        } else if program.trim().is_empty() {
            Some(Refusal::Empty)
        } else if !self.session.is_up() {
            Some(Refusal::NotConnected)
        } else if state.estop != Some(false) {
            Some(Refusal::EmergencyStop)
        } else if state.drives != Some(true) {
            Some(Refusal::DrivesOff)
        } else if state.homed != Some(true) {
            Some(Refusal::NotHomed)
        } else if !matches!(self.sampling, Sampling::Flowing { .. }) {
            Some(Refusal::NoPositions)
        } else if state.status != Some(ProgramStatus::Idle) {
            Some(Refusal::ControllerBusy)
        } else {
            None
        }
    }

    fn begin(&mut self, goal: u64, text: String, out: &mut Vec<Output>) {
        if let Some(refusal) = self.refusal(&text) {
            out.push(Output::Refused { goal, refusal });
            return;
        }
        out.push(Output::Accepted { goal });
        self.stored = self.stored.wrapping_add(1);
        self.news = None;
        self.run = Some(Run::new(goal, self.stored, &text));
        out.push(Output::Io(IoCommand::Store {
            number: self.stored,
            text,
        }));
    }

    fn finish(&mut self, ending: Ending, out: &mut Vec<Output>) {
        if let Some(run) = self.run.take() {
            out.push(Output::Finished {
                goal: run.goal,
                ending,
            });
        }
    }

    fn call_off(&mut self, goal: Option<u64>) {
        if let Some(run) = &mut self.run
            && goal.is_none_or(|goal| goal == run.goal)
        {
            run.call_off(&mut self.session.client);
        }
    }

    fn handle_io(&mut self, at: Stamp<Host>, event: IoEvent, out: &mut Vec<Output>) {
        match event {
            IoEvent::Connected => self.session.connected(),
            IoEvent::NotConnected { reason } => self.lose(at, Lost::Refused { reason }, out),
            IoEvent::Closed { reason } => self.lose(at, Lost::Closed { reason }, out),
            IoEvent::Received(bytes) => self.hear(at, &bytes, out),
            IoEvent::Sampled(bytes) => self.sampled(at, &bytes, out),
            IoEvent::SamplerEnded { reason } => {
                let retry_at = Some(at + self.settings.reconnect_period);
                self.sampling = Sampling::Off { retry_at };
                self.conditions.push(Condition::SamplerEnded { reason });
            }
            IoEvent::HalComplained { message } => {
                self.conditions.push(Condition::HalRefused { message });
            }
            IoEvent::Stored { number, path } => self.stored(number, &path, out),
            IoEvent::NotStored { number, reason } => {
                let ending = self
                    .run
                    .as_ref()
                    .filter(|run| run.number == number)
                    .map(|run| run.not_stored(&reason));
                if let Some(ending) = ending {
                    self.finish(ending, out);
                }
            }
        }
    }

    fn stored(&mut self, number: u32, path: &str, out: &mut Vec<Output>) {
        let client = &mut self.session.client;
        let run = self.run.as_mut().filter(|run| run.number == number);
        if let Some(ending) = run.and_then(|run| run.stored(path, client)) {
            self.finish(ending, out);
        }
    }

    fn lose(&mut self, at: Stamp<Host>, reason: Lost, out: &mut Vec<Output>) {
        self.session.lost(at, reason, &mut self.conditions);
        self.abandon(out);
    }

    /// What follows from a lost connection.
    fn abandon(&mut self, out: &mut Vec<Output>) {
        if let Some(ending) = self.run.as_ref().map(Run::abandoned) {
            self.finish(ending, out);
        }
        if !matches!(self.sampling, Sampling::Off { .. }) {
            out.push(Output::Io(IoCommand::StopSampler));
        }
        self.sampling = Sampling::Off { retry_at: None };
        self.compensation.forget_passed();
    }

    fn hear(&mut self, at: Stamp<Host>, bytes: &[u8], out: &mut Vec<Output>) {
        let mut ending = None;
        let run = &mut self.run;
        let want =
            self.session
                .receive(at, bytes, &mut self.conditions, |state, client, signal| {
                    if ending.is_none()
                        && let Some(run) = run
                    {
                        ending = run.hear(signal, state, client);
                    }
                });
        if let Some(ending) = ending {
            self.finish(ending, out);
        }
        self.want(want, out);
    }

    fn want(&mut self, want: Option<Want>, out: &mut Vec<Output>) {
        match want {
            Some(Want::Connect) => out.push(Output::Io(IoCommand::Connect)),
            Some(Want::Disconnect) => {
                out.push(Output::Io(IoCommand::Disconnect));
                self.abandon(out);
            }
            None => {}
        }
    }

    fn tick(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        let want = self.session.tick(at, &mut self.conditions);
        self.want(want, out);
        match &mut self.sampling {
            Sampling::Off { retry_at } => {
                let next_try_at = at + self.settings.reconnect_period;
                *retry_at = retry_at.map(|retry_at| retry_at.min(next_try_at));
            }
            Sampling::Started { at: last } | Sampling::Flowing { last } => *last = (*last).min(at),
        }
        match self.sampling {
            Sampling::Off { retry_at }
                if self.session.is_up() && retry_at.is_none_or(|retry_at| at >= retry_at) =>
            {
                self.start_sampler(at, out);
            }
            Sampling::Started { at: last } | Sampling::Flowing { last }
                if at - last > SILENCE_LIMIT =>
            {
                let silence_s = (at - last).as_secs_f64();
                self.conditions.push(Condition::SamplerSilent { silence_s });
                self.start_sampler(at, out);
            }
            _ => {}
        }
        if matches!(self.sampling, Sampling::Flowing { .. })
            && let Some(lines) = self.compensation.due(at)
        {
            out.push(Output::Io(IoCommand::Hal(lines)));
        }
        self.watch_freshness(at);
        self.tell_news(out);
    }

    fn start_sampler(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        self.reader.restart();
        self.touches.gap();
        self.clock.interrupt();
        self.sampling = Sampling::Started { at };
        out.push(Output::Io(IoCommand::StartSampler));
    }

    fn watch_freshness(&mut self, at: Stamp<Host>) {
        let freshness = self.compensation.freshness(at);
        if freshness != self.freshness {
            self.conditions.push(match freshness {
                Some(Freshness::Stale) => Condition::CompensationStale {
                    limit_s: self.settings.compensation_stale_after.as_secs_f64(),
                },
                _ => Condition::CompensationFresh,
            });
            self.freshness = freshness;
        }
    }

    fn tell_news(&mut self, out: &mut Vec<Output>) {
        let Some(run) = &self.run else { return };
        let line = run.line();
        let state = if run.is_held() {
            RunState::Holding
        } else if self.motion_type == PROBING {
            RunState::Probing
        } else {
            RunState::Running
        };
        if self.news.replace((line, state)) != Some((line, state)) {
            let progress = run.program.progress_at(line);
            out.push(Output::Feedback {
                goal: run.goal,
                line,
                state,
                progress,
            });
        }
    }

    fn sampled(&mut self, at: Stamp<Host>, bytes: &[u8], out: &mut Vec<Output>) {
        if matches!(self.sampling, Sampling::Off { .. }) {
            return;
        }
        let mut reader = std::mem::take(&mut self.reader);
        reader.receive(bytes, |event| match event {
            SampleEvent::Record(record) => self.record(at, &record, out),
            // The gap in the numbers that follows says how many were lost.
            SampleEvent::Overrun => self.touches.gap(),
            SampleEvent::Malformed { columns, expected } => {
                self.touches.gap();
                self.conditions
                    .push(Condition::MalformedSample { columns, expected });
            }
        });
        self.reader = reader;
    }

    fn record(&mut self, at: Stamp<Host>, record: &Record, out: &mut Vec<Output>) {
        if !matches!(self.sampling, Sampling::Flowing { .. }) {
            self.conditions.push(Condition::Sampling);
        }
        self.sampling = Sampling::Flowing { last: at };
        let (controller_at, succession) = self.clock.stamp(record.number, at);
        match succession {
            Succession::Next => {}
            Succession::Lost(lost) => {
                self.touches.gap();
                self.conditions.push(Condition::SamplerOverrun { lost });
            }
            Succession::First | Succession::Restarted => self.touches.gap(),
        }
        self.watch_slip();
        let state = AxisState {
            received_at: at,
            controller_at,
            axes: self.settings.axes,
            commanded: record.commanded,
            motor: record.motor,
            scale: record.scale,
            velocity: self.touches.velocity(record),
        };
        out.push(Output::State(state));
        if self
            .joints_at
            .is_none_or(|last| controller_at - last >= JOINT_PERIOD)
        {
            self.joints_at = Some(controller_at);
            out.push(Output::Joints(state));
        }
        self.motion_type = record.motion_type;
        if let Some(run) = &mut self.run
            && record.motion_type != 0
        {
            run.moving(record.line);
        }
        self.touch(at, controller_at, record, out);
    }

    fn watch_slip(&mut self) {
        let Some(slip) = self.clock.take_slip() else {
            return;
        };
        let slow = slip > SLIP_LIMIT;
        if slow {
            self.conditions.push(Condition::ServoSlip {
                slip,
                limit: SLIP_LIMIT,
            });
        } else if self.slow {
            self.conditions.push(Condition::ServoInTime);
        }
        self.slow = slow;
    }

    fn touch(
        &mut self,
        received_at: Stamp<Host>,
        controller_at: Stamp<Machine>,
        record: &Record,
        out: &mut Vec<Output>,
    ) {
        match self.touches.step(record) {
            None => {}
            Some(Err(reason)) => {
                let line = record.line;
                self.conditions
                    .push(Condition::TouchUnusable { line, reason });
            }
            Some(Ok(touch)) => {
                let feature = self
                    .run
                    .as_ref()
                    .map_or("", |run| run.program.feature_at(touch.line));
                out.push(Output::Trigger(ProbeTrigger {
                    received_at,
                    controller_at,
                    feature_id: feature.to_owned(),
                    approach: touch.approach,
                    feed_mm_s: touch.feed_mm_s,
                    axes: self.settings.axes,
                    latched: touch.latched,
                    sequence: self.sequence,
                }));
                self.sequence = self.sequence.wrapping_add(1);
            }
        }
    }
}

impl Stage for BridgeStage {
    type Input = Input;
    type Output = Output;
    type Error = Infallible;

    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Input,
        out: &mut Vec<Output>,
    ) -> Result<(), Infallible> {
        match input {
            Input::Goal { goal, program } => self.begin(goal, program, out),
            Input::Cancel { goal } => self.call_off(Some(goal)),
            Input::Active(active) => self.act(active),
            Input::Compensation(_) if !self.active => {}
            Input::Compensation(compensation) => {
                if let Err(refused) = self.compensation.receive(at, &compensation) {
                    self.conditions
                        .push(Condition::CompensationRefused(refused));
                }
            }
            Input::Tick => self.tick(at, out),
            Input::Io(event) => self.handle_io(at, event, out),
            Input::Shutdown => {
                self.stopping = true;
                self.call_off(None);
            }
        }
        while let Some(line) = self.session.client.send(at) {
            out.push(Output::Io(IoCommand::Send(line)));
        }
        out.extend(self.conditions.drain(..).map(Output::Condition));
        if self.resting && self.run.is_none() {
            self.resting = false;
            out.push(Output::AtRest);
        }
        if self.stopping && self.run.is_none() && !self.stopped {
            self.stopped = true;
            out.push(Output::Stopped);
        }
        Ok(())
    }
}
