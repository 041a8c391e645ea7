//! The life of one program on the controller, from its text to its outcome.

use metrology::AxisSet;
use metrology::stamp::{Host, Stamp};

use crate::condition::Condition;
use crate::fault::{FaultKind, classify};
use crate::frame::{Frame, FrameNews};
use crate::program::ProgramText;
use crate::protocol::{Client, Mode, ProgramStatus, Query, Reply, Request, Setting, Signal};
use crate::samples::Record;
use crate::session::ControllerState;
use crate::waiting::{Standstill, Wait};
use crate::watch::{Trouble, Watch};

mod refusal;

pub use refusal::Refusal;

/// Error messages that are asked for after a program has ended. LinuxCNC hands out one message of
/// any kind at a time and an error may stand behind messages of the program itself.
const LAST_QUESTIONS: u32 = 12;

/// How a program ended (the values of `RunProgram.action`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It ran to its end.
    Done = 0,
    /// It was not begun.
    Refused = 1,
    /// A probing move met nothing.
    ProbeMissed = 2,
    /// The probe was closed when it should have been open.
    ProbeStuck = 3,
    /// It would have left the travel.
    Limit = 4,
    /// It was called off.
    Stopped = 5,
    /// The controller stopped it, or was lost.
    Fault = 6,
}

/// What the controller is doing (the values of `RunProgram.action`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "named as in the action")]
pub enum RunState {
    Idle = 0,
    Running = 1,
    Probing = 2,
    Holding = 3,
    Fault = 4,
}

/// The end of a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ending {
    /// How.
    pub outcome: Outcome,
    /// Empty when done.
    pub message: String,
    /// Last line whose motion was executed, from 1; 0: none.
    pub line: u32,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Phase {
    /// Machine coordinates are being made sure of.
    Framing,
    /// The text is being written where the controller can read it.
    Storing,
    /// Loaded from `path`; errors are being looked for.
    Opening { path: String },
    /// Told to run.
    Starting,
    /// Running.
    Running,
    /// Over; so many last messages are still being asked for.
    Ending { questions: u32 },
    /// Over; the state that was found is being put back.
    PuttingBack { ending: Ending },
}

/// A program on its way.
#[derive(Clone, Debug)]
pub struct Run {
    /// Number of the goal.
    pub goal: u64,
    /// Number of the stored text.
    pub number: u32,
    /// What is known of the text.
    pub program: ProgramText,
    phase: Phase,
    line: u32,
    faults: Vec<(FaultKind, String)>,
    called_off: bool,
    /// Whether LinuxCNC got the command to run it.
    has_run: bool,
    held: bool,
    /// The text, until it may be stored.
    text: Option<String>,
    frame: Option<Frame>,
    watch: Watch,
    standstill: Standstill,
    waits: Option<Wait>,
    conditions: Vec<Condition>,
}

impl Run {
    /// A program that begins with making sure of machine coordinates where it is one of them.
    #[must_use]
    pub fn new(goal: u64, number: u32, text: &str, axes: AxisSet, client: &mut Client) -> Self {
        let program = ProgramText::new(text);
        let is_machine_frame = program.is_machine_frame();
        let frame = is_machine_frame.then(|| Frame::begin(number, client));
        Self {
            goal,
            number,
            phase: if frame.is_some() {
                Phase::Framing
            } else {
                Phase::Storing
            },
            line: 0,
            faults: Vec::new(),
            called_off: false,
            has_run: false,
            held: false,
            text: Some(text.to_owned()),
            frame,
            watch: Watch::new(text, is_machine_frame, axes),
            standstill: Standstill::default(),
            waits: None,
            conditions: Vec::new(),
            program,
        }
    }

    /// The text that is to be stored now.
    pub fn take_text(&mut self) -> Option<String> {
        if self.phase == Phase::Storing {
            self.text.take()
        } else {
            None
        }
    }

    /// Conditions since the last time.
    pub fn take_conditions(&mut self) -> impl Iterator<Item = Condition> {
        std::mem::take(&mut self.conditions).into_iter()
    }

    /// Time has passed.
    pub fn tick(
        &mut self,
        at: Stamp<Host>,
        state: &ControllerState,
        client: &mut Client,
    ) -> Option<Ending> {
        self.look_whether_it_waits(at);
        let news = self.frame.as_mut().and_then(|frame| frame.tick(at, client));
        news.and_then(|news| self.framed(news, state, client))
    }

    /// Says once when it begins to wait, and once when it goes on.
    fn look_whether_it_waits(&mut self, at: Stamp<Host>) {
        let running = self.phase == Phase::Running;
        let stops = self.program.stops();
        let waits = { running }
            .then(|| self.standstill.wait(at, stops, self.line, self.held))
            .flatten();
        if waits != self.waits {
            self.waits = waits;
            self.conditions.push(match waits {
                Some(wait) => Condition::ProgramWaits(wait),
                None => Condition::ProgramGoesOn,
            });
        }
    }

    fn framed(
        &mut self,
        news: FrameNews,
        state: &ControllerState,
        client: &mut Client,
    ) -> Option<Ending> {
        match news {
            FrameNews::Ready { system, changed } => {
                if let Some(changed) = changed {
                    self.conditions.push(Condition::FrameSet { changed });
                }
                if let Some(text) = &mut self.text {
                    begin_in(text, system);
                }
                self.phase = Phase::Storing;
                None
            }
            FrameNews::Refused(reason) => {
                self.faults.push((FaultKind::Other, reason));
                let ending = self.ending(state);
                self.end(ending, state, client)
            }
            FrameNews::PutBack(outcome) => {
                if let Err(left) = outcome {
                    self.conditions.push(Condition::StateLeft { left });
                }
                match &self.phase {
                    Phase::PuttingBack { ending } => Some(ending.clone()),
                    _ => None,
                }
            }
        }
    }

    /// The program is over: at once, or when the state that was found is there again.
    fn end(
        &mut self,
        ending: Ending,
        state: &ControllerState,
        client: &mut Client,
    ) -> Option<Ending> {
        if self.waits.take().is_some() {
            self.conditions.push(Condition::ProgramGoesOn);
        }
        let Some(frame) = self.frame.as_mut().filter(|frame| frame.owes()) else {
            return Some(ending);
        };
        let reason = if state.estop == Some(true) {
            Some("the emergency stop is on")
        } else if state.drives == Some(false) {
            Some("the drives are off")
        } else {
            None
        };
        if let Some(reason) = reason {
            let found = frame.found();
            let left = format!("{reason}; found were {found}");
            self.conditions.push(Condition::StateLeft { left });
            return Some(ending);
        }
        let was_reset = self.has_run && ending.outcome != Outcome::Done;
        frame.put_back(was_reset, client);
        self.phase = Phase::PuttingBack { ending };
        None
    }

    /// Last line whose motion was executed.
    #[must_use]
    pub fn line(&self) -> u32 {
        self.line
    }

    /// Whether the interpreter pauses.
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.held
    }

    /// Takes the next record; what is not as it should be stops the program.
    pub fn sampled(&mut self, at: Stamp<Host>, record: &Record, client: &mut Client) {
        if !matches!(self.phase, Phase::Running | Phase::Starting) {
            return;
        }
        if record.motion_type != 0 && record.line > 0 {
            self.line = record.line;
        }
        self.standstill.step(at, record);
        let Some(trouble) = self.watch.step(record) else {
            return;
        };
        let kind = match trouble {
            Trouble::Tripped { .. } => FaultKind::ProbeTripped,
            Trouble::Astray { .. } => FaultKind::Astray,
        };
        self.faults.push((kind, trouble.to_string()));
        self.conditions.push(Condition::Stopped(trouble));
        client.ask_first(Request::Set(Setting::Abort));
    }

    /// Something that has nothing to do with the program ends it, as soon as LinuxCNC takes commands.
    pub fn stop(&mut self, why: String, client: &mut Client) {
        let is_said = self.faults.iter().any(|(_, said)| *said == why);
        if is_said || !matches!(self.phase, Phase::Opening { .. } | Phase::Running) {
            return;
        }
        self.faults.push((FaultKind::Other, why));
        if self.phase == Phase::Running {
            client.ask_first(Request::Set(Setting::Abort));
        }
    }

    /// Records are missing.
    pub fn gap(&mut self) {
        self.watch.gap();
    }

    /// The text lies at `path`: load it and look for complaints.
    pub fn stored(
        &mut self,
        path: &str,
        state: &ControllerState,
        client: &mut Client,
    ) -> Option<Ending> {
        if self.phase != Phase::Storing {
            return None;
        }
        if self.called_off {
            let ending = self.ending(&ControllerState::default());
            return self.end(ending, state, client);
        }
        self.phase = Phase::Opening {
            path: path.to_owned(),
        };
        client.ask(Request::Set(Setting::Mode(Mode::Auto)));
        client.ask(Request::Set(Setting::Open(path.to_owned())));
        for _ in 0..3 {
            client.ask(Request::Get(Query::Error));
        }
        client.ask(Request::Get(Query::Program));
        None
    }

    /// Calls it off; how it ended where it had not begun.
    pub fn call_off(&mut self, state: &ControllerState, client: &mut Client) -> Option<Ending> {
        // What is over is not called off, and putting back is not disturbed.
        if self.called_off || matches!(self.phase, Phase::PuttingBack { .. }) {
            return None;
        }
        self.called_off = true;
        if self.phase == Phase::Framing {
            let ending = self.ending(state);
            return self.end(ending, state, client);
        }
        client.ask(Request::Set(Setting::Abort));
        None
    }

    /// Takes an answer of the controller; says how the program ended when it has.
    pub fn hear(
        &mut self,
        signal: &Signal,
        state: &ControllerState,
        client: &mut Client,
    ) -> Option<Ending> {
        let news = { self.frame.as_mut() }.and_then(|frame| frame.hear(signal, client));
        if let Some(news) = news {
            return self.framed(news, state, client);
        }
        match signal {
            Signal::Reply(Reply::Error(message)) => {
                self.heard_error(message.as_deref(), state, client)
            }
            Signal::Reply(Reply::Program(loaded)) => self.opened(loaded, state, client),
            Signal::Reply(Reply::Taken(Setting::Run)) => {
                self.phase = Phase::Running;
                self.has_run = true;
                client.ask(Request::Get(Query::ProgramStatus));
                client.ask(Request::Get(Query::Mode));
                None
            }
            Signal::Reply(Reply::Mode(Mode::Manual | Mode::Mdi))
                if self.phase == Phase::Running =>
            {
                self.faults
                    .push((FaultKind::Other, "the controller left mode auto".to_owned()));
                None
            }
            Signal::Reply(Reply::ProgramStatus(status)) => {
                self.observe(*status, client);
                None
            }
            Signal::Denied(Request::Set(setting)) => {
                let what = format!("refused: {setting:?}");
                if let Phase::PuttingBack { ending } = &self.phase {
                    self.conditions.push(Condition::StateLeft { left: what });
                    return Some(ending.clone());
                }
                self.faults.push((FaultKind::Other, what));
                let ending = self.ending(state);
                self.end(ending, state, client)
            }
            _ => None,
        }
    }

    /// The connection is gone.
    pub fn abandoned(&mut self) -> Ending {
        if let Some(frame) = self.frame.as_ref().filter(|frame| frame.owes()) {
            let left = format!("the connection is gone; found were {}", frame.found());
            self.conditions.push(Condition::StateLeft { left });
        }
        if let Phase::PuttingBack { ending } = &self.phase {
            return ending.clone();
        }
        let message = format!(
            "line {}: the connection to the controller was lost",
            self.line
        );
        Ending {
            outcome: Outcome::Fault,
            message,
            line: self.line,
        }
    }

    /// The text could not be stored.
    pub fn not_stored(
        &mut self,
        reason: &str,
        state: &ControllerState,
        client: &mut Client,
    ) -> Option<Ending> {
        let ending = Ending {
            outcome: Outcome::Refused,
            message: format!("the program could not be stored: {reason}"),
            line: 0,
        };
        self.end(ending, state, client)
    }

    fn opened(
        &mut self,
        loaded: &str,
        state: &ControllerState,
        client: &mut Client,
    ) -> Option<Ending> {
        let Phase::Opening { path } = &self.phase else {
            return None;
        };
        if self.faults.is_empty() && !self.called_off && loaded != path {
            let complaint = format!("the controller holds {loaded}, not {path}");
            self.faults.push((FaultKind::Other, complaint));
        }
        if self.called_off || !self.faults.is_empty() {
            let ending = self.ending(&ControllerState::default());
            return self.end(ending, state, client);
        }
        self.phase = Phase::Starting;
        client.ask(Request::Set(Setting::Run));
        None
    }

    fn observe(&mut self, status: ProgramStatus, client: &mut Client) {
        self.held = status == ProgramStatus::Paused;
        if self.phase == Phase::Running && status == ProgramStatus::Idle {
            self.phase = Phase::Ending {
                questions: LAST_QUESTIONS,
            };
            client.ask(Request::Get(Query::Estop));
            client.ask(Request::Get(Query::Machine));
            for _ in 0..LAST_QUESTIONS {
                client.ask(Request::Get(Query::Error));
            }
        }
    }

    fn heard_error(
        &mut self,
        message: Option<&str>,
        state: &ControllerState,
        client: &mut Client,
    ) -> Option<Ending> {
        if let Some(text) = message
            && !matches!(self.phase, Phase::Storing | Phase::PuttingBack { .. })
        {
            let kind = classify(text);
            if kind != FaultKind::RealtimeDelay {
                self.faults.push((kind, text.to_owned()));
            }
            if self.phase == Phase::Framing && !self.faults.is_empty() {
                let ending = self.ending(state);
                return self.end(ending, state, client);
            }
        }
        let Phase::Ending { questions } = &mut self.phase else {
            return None;
        };
        *questions = questions.saturating_sub(1);
        if *questions > 0 {
            return None;
        }
        let ending = self.ending(state);
        self.end(ending, state, client)
    }

    fn ending(&self, state: &ControllerState) -> Ending {
        let outcome = self.outcome(state);
        let mut words: Vec<&str> = self.faults.iter().map(|(_, text)| text.as_str()).collect();
        if outcome == Outcome::Stopped {
            words.insert(0, "called off");
        }
        if state.estop == Some(true) {
            words.push("emergency stop is on");
        } else if state.drives == Some(false) {
            words.push("drives are off");
        }
        let message = match (outcome, self.line) {
            (Outcome::Done, _) => String::new(),
            (_, 0) => words.join("; "),
            (_, line) => format!("line {line}: {}", words.join("; ")),
        };
        Ending {
            outcome,
            message,
            line: self.line,
        }
    }

    fn outcome(&self, state: &ControllerState) -> Outcome {
        if self.called_off {
            return Outcome::Stopped;
        }
        match self.faults.first() {
            Some((FaultKind::ProbeMissed, _)) => Outcome::ProbeMissed,
            Some((FaultKind::ProbeStuck, _)) => Outcome::ProbeStuck,
            Some((FaultKind::Limit, _)) => Outcome::Limit,
            Some((FaultKind::FollowingError | FaultKind::ProbeTripped, _)) => Outcome::Fault,
            Some((FaultKind::Astray, _)) => Outcome::Refused,
            Some(_) if self.line == 0 => Outcome::Refused,
            Some(_) => Outcome::Fault,
            None if state.estop == Some(true) || state.drives == Some(false) => Outcome::Fault,
            None => Outcome::Done,
        }
    }
}

/// Puts the work system behind the frame's comment, in the same line, so that no line changes its number.
fn begin_in(text: &mut String, system: &str) {
    if let Some(end) = frame_comment_end(text) {
        text.insert_str(end, &format!(" {system} "));
    }
}

fn frame_comment_end(text: &str) -> Option<usize> {
    // The first line is known to begin with comments, one of which is the frame's.
    let line = text.lines().next()?;
    let mut end = 0;
    for piece in line.split_inclusive(')') {
        end += piece.len();
        if machine::program_frame::is_machine_frame(&line[..end]) {
            return Some(end);
        }
    }
    None
}
