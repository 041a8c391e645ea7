//! The bridge as a stage: bytes and time go in; positions, touches and commands come out.

use std::convert::Infallible;

use machine::program_machine;
use metrology::sample::{AxisCompensation, AxisState, ProbeTrigger};
use metrology::stamp::{Host, Machine, Span, Stamp};
use metrology::{Author, Stage};

use crate::clock::SampleClock;
use crate::condition::{Condition, Lost};
use crate::config::Settings;
use crate::latch::TouchDetector;
use crate::program::ProgramText;
use crate::protocol::ProgramStatus;
use crate::run::{Ending, Refusal, Run, RunState};
use crate::samples::{PROBING, SampleReader};
use crate::session::{Session, Want};

mod offsets;
mod records;

use offsets::Offsets;

/// Ticks come every few milliseconds; further apart than this, the bridge itself stood still.
const STOOD_STILL: Span = Span::from_nanos(500_000_000);
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
    /// So many publish what is to be added to the commands.
    Publishers(usize),
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
    offsets: Offsets,
    active: bool,
    resting: bool,
    stopping: bool,
    stopped: bool,
    conditions: Vec<Condition>,
    ticked_at: Option<Stamp<Host>>,
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
            offsets: Offsets::new(settings),
            active: true,
            resting: false,
            stopping: false,
            stopped: false,
            conditions: Vec::new(),
            ticked_at: None,
            settings: settings.clone(),
        }
    }

    /// The same, but it takes programs and offsets only once [`Input::Active`] says so.
    #[must_use]
    pub fn inactive(mut self) -> Self {
        self.active = false;
        self
    }

    /// The offsets that come next are of this publisher, whether they can be read or not.
    pub fn hears(&mut self, at: Stamp<Host>, author: Author) {
        self.offsets.hears(at, author);
    }

    /// Stops a program that touches while two publishers of offsets speak.
    fn watch_authors(&mut self) {
        let Some((one, other)) = self.offsets.contested() else {
            return;
        };
        let is_probing = self.motion_type == PROBING;
        if let Some(run) = &mut self.run
            && (is_probing || run.program.touches())
        {
            let why = Condition::CompensationContested { one, other };
            run.stop(why.to_string(), &mut self.session.client);
        }
    }

    fn act(&mut self, active: bool, out: &mut Vec<Output>) {
        self.active = active;
        self.resting = !active;
        if !active {
            self.call_off(None, out);
            self.offsets.release();
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
        } else if let Err(other) = program_machine::check(program, self.settings.mark) {
            Some(Refusal::OtherMachine(other))
        } else if let Some(line) = ProgramText::new(program).misplaced_frame() {
            Some(Refusal::FrameComment(line))
        } else if let Some((line, word)) = ProgramText::new(program).breaks_frame() {
            Some(Refusal::ShiftsFrame { line, word })
        } else if let Some((line, bytes)) = ProgramText::new(program).long_name() {
            Some(Refusal::LongName(line, bytes))
        } else if let (Some((one, other)), true) = (
            self.offsets.contested(),
            ProgramText::new(program).touches(),
        ) {
            Some(Refusal::TwoPublishers(one, other))
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
        let axes = self.settings.axes;
        self.run = Some(Run::new(
            goal,
            self.stored,
            &text,
            axes,
            &mut self.session.client,
        ));
        self.follow(None, out);
    }

    /// Acts on the results of a run: stores its text, reports its conditions, finishes it.
    fn follow(&mut self, ending: Option<Ending>, out: &mut Vec<Output>) {
        let Some(run) = &mut self.run else { return };
        self.conditions.extend(run.take_conditions());
        if let Some(text) = run.take_text() {
            let number = run.number;
            out.push(Output::Io(IoCommand::Store { number, text }));
        }
        if let Some(ending) = ending {
            self.finish(ending, out);
        }
    }

    fn finish(&mut self, ending: Ending, out: &mut Vec<Output>) {
        if let Some(run) = self.run.take() {
            out.push(Output::Finished {
                goal: run.goal,
                ending,
            });
        }
    }

    fn call_off(&mut self, goal: Option<u64>, out: &mut Vec<Output>) {
        let state = *self.session.state();
        let run = self
            .run
            .as_mut()
            .filter(|run| goal.is_none_or(|goal| goal == run.goal));
        let ending = run.and_then(|run| run.call_off(&state, &mut self.session.client));
        self.follow(ending, out);
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
                let state = *self.session.state();
                let client = &mut self.session.client;
                let run = self.run.as_mut().filter(|run| run.number == number);
                let ending = run.and_then(|run| run.not_stored(&reason, &state, client));
                self.follow(ending, out);
            }
        }
    }

    fn stored(&mut self, number: u32, path: &str, out: &mut Vec<Output>) {
        let state = *self.session.state();
        let client = &mut self.session.client;
        let run = self.run.as_mut().filter(|run| run.number == number);
        let ending = run.and_then(|run| run.stored(path, &state, client));
        self.follow(ending, out);
    }

    fn lose(&mut self, at: Stamp<Host>, reason: Lost, out: &mut Vec<Output>) {
        self.session.lost(at, reason, &mut self.conditions);
        self.abandon(out);
    }

    /// What follows from a lost connection.
    fn abandon(&mut self, out: &mut Vec<Output>) {
        let ending = self.run.as_mut().map(Run::abandoned);
        self.follow(ending, out);
        if !matches!(self.sampling, Sampling::Off { .. }) {
            out.push(Output::Io(IoCommand::StopSampler));
        }
        self.sampling = Sampling::Off { retry_at: None };
        self.offsets.forget_passed();
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
        self.follow(ending, out);
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

    /// After a time in which the bridge stood still what came meanwhile is not read yet: nobody was silent.
    fn wait_anew_after_standstill(&mut self, at: Stamp<Host>) {
        let Some(before) = self.ticked_at.replace(at) else {
            return;
        };
        if at - before <= STOOD_STILL {
            return;
        }
        let for_s = (at - before).as_secs_f64();
        self.conditions.push(Condition::StoodStill { for_s });
        self.session.client.asked_not_before(at);
        if let Sampling::Started { at: last } | Sampling::Flowing { last } = &mut self.sampling {
            *last = at;
        }
    }

    fn tick(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        self.wait_anew_after_standstill(at);
        let want = self.session.tick(at, &mut self.conditions);
        self.want(want, out);
        let state = *self.session.state();
        let client = &mut self.session.client;
        let ending = { self.run.as_mut() }.and_then(|run| run.tick(at, &state, client));
        self.follow(ending, out);
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
        let homed = self.session.state().homed == Some(true);
        let reached = matches!(self.sampling, Sampling::Flowing { .. });
        let lines = self.offsets.tick(at, homed, reached, &mut self.conditions);
        out.extend(lines.map(|lines| Output::Io(IoCommand::Hal(lines))));
        self.watch_authors();
        self.tell_news(out);
    }

    fn start_sampler(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        self.reader.restart();
        self.touches.gap();
        self.clock.interrupt();
        self.sampling = Sampling::Started { at };
        out.push(Output::Io(IoCommand::StartSampler));
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
            Input::Cancel { goal } => self.call_off(Some(goal), out),
            Input::Active(active) => self.act(active, out),
            Input::Publishers(publishers) => self.offsets.publishers(at, publishers, self.active),
            Input::Compensation(_) if !self.active => {}
            Input::Compensation(compensation) => {
                let refused = self.offsets.receive(at, &compensation);
                self.conditions.extend(refused);
            }
            Input::Tick => self.tick(at, out),
            Input::Io(event) => self.handle_io(at, event, out),
            Input::Shutdown => {
                self.stopping = true;
                self.call_off(None, out);
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
