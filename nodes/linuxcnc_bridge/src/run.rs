//! The life of one program on the controller, from its text to its outcome.

use crate::fault::{FaultKind, classify};
use crate::program::ProgramText;
use crate::protocol::{Client, ProgramStatus, Query, Reply, Request, Setting, Signal};
use crate::session::ControllerState;

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
    held: bool,
}

impl Run {
    /// A program whose text is being stored.
    #[must_use]
    pub fn new(goal: u64, number: u32, text: &str) -> Self {
        Self {
            goal,
            number,
            program: ProgramText::new(text),
            phase: Phase::Storing,
            line: 0,
            faults: Vec::new(),
            called_off: false,
            held: false,
        }
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

    /// Motion of this line is being executed.
    pub fn moving(&mut self, line: u32) {
        if line > 0 && matches!(self.phase, Phase::Running | Phase::Starting) {
            self.line = line;
        }
    }

    /// The text lies at `path`: load it and look for complaints.
    pub fn stored(&mut self, path: &str, client: &mut Client) -> Option<Ending> {
        if self.called_off {
            return Some(self.ending(&ControllerState::default()));
        }
        self.phase = Phase::Opening {
            path: path.to_owned(),
        };
        client.ask(Request::Set(Setting::ModeAuto));
        client.ask(Request::Set(Setting::Open(path.to_owned())));
        for _ in 0..3 {
            client.ask(Request::Get(Query::Error));
        }
        client.ask(Request::Get(Query::Program));
        None
    }

    /// Calls it off.
    pub fn call_off(&mut self, client: &mut Client) {
        if !self.called_off {
            self.called_off = true;
            client.ask(Request::Set(Setting::Abort));
        }
    }

    /// Takes an answer of the controller; says how the program ended when it has.
    pub fn hear(
        &mut self,
        signal: &Signal,
        state: &ControllerState,
        client: &mut Client,
    ) -> Option<Ending> {
        match signal {
            Signal::Reply(Reply::Error(message)) => self.heard_error(message.as_deref(), state),
            Signal::Reply(Reply::Program(loaded)) => self.opened(loaded, client),
            Signal::Reply(Reply::Taken(Setting::Run)) => {
                self.phase = Phase::Running;
                client.ask(Request::Get(Query::ProgramStatus));
                client.ask(Request::Get(Query::Mode));
                None
            }
            Signal::Reply(Reply::ModeAuto(false)) if self.phase == Phase::Running => {
                self.faults
                    .push((FaultKind::Other, "the controller left mode auto".to_owned()));
                None
            }
            Signal::Reply(Reply::ProgramStatus(status)) => {
                self.observe(*status, client);
                None
            }
            Signal::Denied(Request::Set(setting)) => {
                self.faults
                    .push((FaultKind::Other, format!("refused: {setting:?}")));
                Some(self.ending(state))
            }
            _ => None,
        }
    }

    /// The connection is gone.
    #[must_use]
    pub fn abandoned(&self) -> Ending {
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
    #[must_use]
    pub fn not_stored(&self, reason: &str) -> Ending {
        let message = format!("the program could not be stored: {reason}");
        Ending {
            outcome: Outcome::Refused,
            message,
            line: 0,
        }
    }

    fn opened(&mut self, loaded: &str, client: &mut Client) -> Option<Ending> {
        let Phase::Opening { path } = &self.phase else {
            return None;
        };
        if self.faults.is_empty() && !self.called_off && loaded != path {
            let complaint = format!("the controller holds {loaded}, not {path}");
            self.faults.push((FaultKind::Other, complaint));
        }
        if self.called_off || !self.faults.is_empty() {
            return Some(self.ending(&ControllerState::default()));
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

    fn heard_error(&mut self, message: Option<&str>, state: &ControllerState) -> Option<Ending> {
        if let Some(text) = message
            && self.phase != Phase::Storing
        {
            let kind = classify(text);
            if kind != FaultKind::RealtimeDelay {
                self.faults.push((kind, text.to_owned()));
            }
        }
        let Phase::Ending { questions } = &mut self.phase else {
            return None;
        };
        *questions = questions.saturating_sub(1);
        (*questions == 0).then(|| self.ending(state))
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
            Some((FaultKind::FollowingError, _)) => Outcome::Fault,
            Some(_) if self.line == 0 => Outcome::Refused,
            Some(_) => Outcome::Fault,
            None if state.estop == Some(true) || state.drives == Some(false) => Outcome::Fault,
            None => Outcome::Done,
        }
    }
}

/// Why a program is not begun.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// One runs already.
    #[error("another program is running")]
    Busy,
    /// The bridge is not active.
    #[error("the bridge is not active")]
    Inactive,
    /// There is no connection.
    #[error("not connected to the controller")]
    NotConnected,
    /// The emergency stop is on, or its state is not known.
    #[error("emergency stop is on")]
    EmergencyStop,
    /// The drives are off.
    #[error("drives are off")]
    DrivesOff,
    /// Not every axis is homed.
    #[error("not homed")]
    NotHomed,
    /// Positions do not come, touches would be lost.
    #[error("no positions come from the sampler")]
    NoPositions,
    /// The interpreter runs something that was not started here.
    #[error("the controller is running something else")]
    ControllerBusy,
    /// There is nothing in it.
    #[error("the program is empty")]
    Empty,
}

impl Refusal {
    /// The ending of a program that is not begun.
    #[must_use]
    pub fn ending(self) -> Ending {
        Ending {
            outcome: Outcome::Refused,
            message: self.to_string(),
            line: 0,
        }
    }
}
