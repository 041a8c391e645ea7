//! The text protocol of `linuxcncrsh`: one request at a time, one line of answer each.
//!
//! Owns no socket: bytes go in, signals and the next line to send come out, and time arrives with
//! the call. Quirks that were seen and are handled here: commands are echoed until `set echo off`;
//! `set` is acknowledged only after `set verbose on`, with the line end `\n\r` instead of `\r\n`;
//! some answers are followed by an empty line; an unknown command is not answered at all; `get spindle` ends
//! `linuxcncrsh`, and LinuxCNC with it, so it is never asked.
//!
//! # References
//! linuxcncrsh(1), LinuxCNC 2.9.

use std::collections::VecDeque;
use std::fmt::Write as _;

use metrology::stamp::{Host, Span, Stamp};

/// Longest line that is accepted; LinuxCNC's own messages are below 256 bytes.
pub const MESSAGE_LIMIT_BYTES: usize = 2048;

/// Something to ask of the controller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Greeting with the password.
    Hello(String),
    /// Stop repeating commands.
    EchoOff,
    /// Acknowledge every setting.
    VerboseOn,
    /// Allow commands, with the password.
    Enable(String),
    /// Change something.
    Set(Setting),
    /// Ask something.
    Get(Query),
}

/// A change of the controller's state.
#[derive(Clone, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "named as in linuxcncrsh")]
pub enum Setting {
    EstopOff,
    MachineOn,
    Mode(Mode),
    HomeAll,
    /// Execute this block.
    Mdi(String),
    /// Load the program at this path.
    Open(String),
    Run,
    Abort,
}

/// Who gives LinuxCNC its commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "named as in linuxcncrsh")]
pub enum Mode {
    Manual,
    Auto,
    Mdi,
}

/// A question.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "named as in linuxcncrsh")]
pub enum Query {
    Estop,
    Machine,
    Mode,
    ProgramStatus,
    ProgramLine,
    Error,
    JointHomed,
    JointLimit,
    Program,
    /// Active G codes, F and S.
    ProgramCodes,
    /// The oldest unread message of a `(debug, …)` comment.
    OperatorDisplay,
    /// Commanded position without any offset, mm.
    AbsCmdPos,
    /// Commanded position as programs see it, mm.
    RelCmdPos,
    /// Sum of work offset and G92 or G52, mm; the rotation is not in it.
    PosOffset,
}

/// What the interpreter does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "named as in linuxcncrsh")]
pub enum ProgramStatus {
    Idle,
    Running,
    Paused,
}

/// A limit that a joint stands on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "named as in linuxcncrsh")]
pub enum JointLimit {
    Free,
    MinSoft,
    MinHard,
    MaxSoft,
    MaxHard,
}

/// Number of joints that LinuxCNC can report.
pub const JOINTS: usize = 16;

/// An answer.
#[derive(Clone, Debug, PartialEq)]
pub enum Reply {
    /// The connection was greeted or set up by one step.
    Greeted,
    /// A setting was taken.
    Taken(Setting),
    /// The emergency stop is on.
    Estop(bool),
    /// The drives are on.
    Machine(bool),
    /// Who gives commands.
    Mode(Mode),
    /// What the interpreter does.
    ProgramStatus(ProgramStatus),
    /// Line of the motion that is being executed; 0 where there is none.
    ProgramLine(u32),
    /// The oldest unread error message.
    Error(Option<String>),
    /// Which joints are homed.
    JointHomed([bool; JOINTS]),
    /// Limits that joints stand on.
    JointLimit([JointLimit; JOINTS]),
    /// Path of the loaded program, or `NONE`.
    Program(String),
    /// Active G codes, F and S, as LinuxCNC prints them.
    ProgramCodes(String),
    /// A message of the program, where there is one.
    OperatorDisplay(Option<String>),
    /// Commanded position without any offset, mm.
    AbsCmdPos(Vec<f64>),
    /// Commanded position as programs see it, mm.
    RelCmdPos(Vec<f64>),
    /// Sum of work offset and G92 or G52, mm.
    PosOffset(Vec<f64>),
}

/// What came out of the received bytes or of the time that has passed.
#[derive(Clone, Debug, PartialEq)]
pub enum Signal {
    /// The answer to a request.
    Reply(Reply),
    /// The controller said no.
    Denied(Request),
    /// A line that answers nothing.
    Unexpected(String),
    /// A line that never ends; the connection cannot be trusted.
    LineTooLong {
        /// Bytes without a line end.
        length_bytes: usize,
    },
    /// The answer did not come in time.
    TimedOut(Request),
}

/// The client's side of one connection.
#[derive(Debug)]
pub struct Client {
    reply_timeout: Span,
    queue: VecDeque<Request>,
    waiting: Option<(Request, Stamp<Host>)>,
    line: Vec<u8>,
}

impl Client {
    /// For a fresh connection.
    #[must_use]
    pub fn new(reply_timeout: Span) -> Self {
        Self {
            reply_timeout,
            queue: VecDeque::new(),
            waiting: None,
            line: Vec::new(),
        }
    }

    /// Puts a request at the end of the queue.
    pub fn ask(&mut self, request: Request) {
        self.queue.push_back(request);
    }

    /// Puts a request before those that have not been sent yet.
    pub fn ask_first(&mut self, request: Request) {
        self.queue.push_front(request);
    }

    /// Whether nothing is queued or unanswered.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.queue.is_empty() && self.waiting.is_none()
    }

    /// Drops what has not been sent yet.
    pub fn forget_unsent(&mut self) {
        self.queue.clear();
    }

    /// The next line to send, when no answer is outstanding.
    pub fn send(&mut self, at: Stamp<Host>) -> Option<String> {
        if self.waiting.is_some() {
            return None;
        }
        let request = self.queue.pop_front()?;
        let line = wire_line(&request);
        self.waiting = Some((request, at));
        Some(line)
    }

    /// Takes received bytes and appends what they mean.
    pub fn receive(&mut self, bytes: &[u8], out: &mut Vec<Signal>) {
        for &byte in bytes {
            if byte == b'\n' || byte == b'\r' {
                let line = std::mem::take(&mut self.line);
                let text = String::from_utf8_lossy(&line);
                if !text.trim().is_empty() {
                    out.push(self.answer(text.trim()));
                }
            } else if self.line.len() == MESSAGE_LIMIT_BYTES {
                out.push(Signal::LineTooLong {
                    length_bytes: self.line.len(),
                });
                self.line.clear();
                return;
            } else {
                self.line.push(byte);
            }
        }
    }

    /// What waits for an answer was asked by then.
    pub fn asked_by(&mut self, at: Stamp<Host>) {
        if let Some((_, asked_at)) = &mut self.waiting {
            *asked_at = (*asked_at).min(at);
        }
    }

    /// What waits for an answer waits anew from `at`.
    pub fn asked_not_before(&mut self, at: Stamp<Host>) {
        if let Some((_, asked_at)) = &mut self.waiting {
            *asked_at = (*asked_at).max(at);
        }
    }

    /// Reports an answer that is overdue; the request is dropped.
    pub fn expire(&mut self, at: Stamp<Host>) -> Option<Signal> {
        let (_, asked_at) = self.waiting.as_ref()?;
        if at - *asked_at <= self.reply_timeout {
            return None;
        }
        self.waiting
            .take()
            .map(|(request, _)| Signal::TimedOut(request))
    }

    fn answer(&mut self, line: &str) -> Signal {
        let Some((request, asked_at)) = self.waiting.take() else {
            return Signal::Unexpected(line.to_owned());
        };
        if is_denial(&request, line) {
            return Signal::Denied(request);
        }
        if let Some(reply) = parse(&request, line) {
            return Signal::Reply(reply);
        }
        self.waiting = Some((request, asked_at));
        Signal::Unexpected(line.to_owned())
    }
}

fn setting_words(setting: &Setting) -> (&'static str, &str) {
    match setting {
        Setting::EstopOff => ("estop", "off"),
        Setting::MachineOn => ("machine", "on"),
        Setting::Mode(Mode::Manual) => ("mode", "manual"),
        Setting::Mode(Mode::Auto) => ("mode", "auto"),
        Setting::Mode(Mode::Mdi) => ("mode", "mdi"),
        Setting::HomeAll => ("home", "-1"),
        Setting::Mdi(block) => ("mdi", block),
        Setting::Open(path) => ("open", path),
        Setting::Run => ("run", ""),
        Setting::Abort => ("abort", ""),
    }
}

const fn query_word(query: Query) -> &'static str {
    match query {
        Query::Estop => "estop",
        Query::Machine => "machine",
        Query::Mode => "mode",
        Query::ProgramStatus => "program_status",
        Query::ProgramLine => "program_line",
        Query::Error => "error",
        Query::JointHomed => "joint_homed",
        Query::JointLimit => "joint_limit",
        Query::Program => "program",
        Query::ProgramCodes => "program_codes",
        Query::OperatorDisplay => "operator_display",
        Query::AbsCmdPos => "abs_cmd_pos",
        Query::RelCmdPos => "rel_cmd_pos",
        Query::PosOffset => "pos_offset",
    }
}

fn wire_line(request: &Request) -> String {
    let mut line = match request {
        Request::Hello(password) => format!("hello {password} abbe 1.0"),
        Request::EchoOff => "set echo off".to_owned(),
        Request::VerboseOn => "set verbose on".to_owned(),
        Request::Enable(password) => format!("set enable {password}"),
        Request::Set(setting) => {
            let (what, value) = setting_words(setting);
            let mut line = format!("set {what}");
            if !value.is_empty() {
                write!(line, " {value}").expect("writing to a String cannot fail");
            }
            line
        }
        Request::Get(query) => format!("get {}", query_word(*query)),
    };
    line.push_str("\r\n");
    line
}

fn request_word(request: &Request) -> &str {
    match request {
        Request::Hello(_) => "hello",
        Request::EchoOff => "echo",
        Request::VerboseOn => "verbose",
        Request::Enable(_) => "enable",
        Request::Set(setting) => setting_words(setting).0,
        Request::Get(query) => query_word(*query),
    }
}

fn is_denial(request: &Request, line: &str) -> bool {
    let word = request_word(request);
    match request {
        Request::Hello(_) => equals(line, "hello nak"),
        Request::Get(_) => equals(line, &format!("get {word} nak")),
        _ => equals(line, &format!("set {word} nak")),
    }
}

fn equals(line: &str, expected: &str) -> bool {
    line.eq_ignore_ascii_case(expected)
}

/// The part behind `word`, where the line begins with it.
fn after<'a>(line: &'a str, word: &str) -> Option<&'a str> {
    let head = line.get(..word.len())?;
    let tail = &line[word.len()..];
    (equals(head, word) && (tail.is_empty() || tail.starts_with(' '))).then(|| tail.trim())
}

fn parse(request: &Request, line: &str) -> Option<Reply> {
    match request {
        Request::Hello(_) => after(line, "hello ack").map(|_| Reply::Greeted),
        // The echo of the command that switches the echo off is its only answer.
        Request::EchoOff => equals(line, "set echo off").then_some(Reply::Greeted),
        Request::VerboseOn => equals(line, "set verbose ack").then_some(Reply::Greeted),
        Request::Enable(_) => equals(line, "set enable ack").then_some(Reply::Greeted),
        Request::Set(setting) => equals(line, &format!("set {} ack", setting_words(setting).0))
            .then(|| Reply::Taken(setting.clone())),
        Request::Get(query) => parse_answer(*query, after(line, query_word(*query))?),
    }
}

fn parse_answer(query: Query, value: &str) -> Option<Reply> {
    Some(match query {
        Query::Estop => Reply::Estop(on_off(value)?),
        Query::Machine => Reply::Machine(on_off(value)?),
        Query::Mode => Reply::Mode(match value.to_ascii_lowercase().as_str() {
            "manual" => Mode::Manual,
            "auto" => Mode::Auto,
            "mdi" => Mode::Mdi,
            _ => return None,
        }),
        Query::ProgramStatus => Reply::ProgramStatus(match value.to_ascii_lowercase().as_str() {
            "idle" => ProgramStatus::Idle,
            "running" => ProgramStatus::Running,
            "paused" => ProgramStatus::Paused,
            _ => return None,
        }),
        // A negative line is LinuxCNC's word for none.
        Query::ProgramLine => {
            Reply::ProgramLine(u32::try_from(value.parse::<i64>().ok()?.max(0)).ok()?)
        }
        Query::Program => Reply::Program(value.to_owned()),
        Query::ProgramCodes => Reply::ProgramCodes(value.to_owned()),
        Query::AbsCmdPos => Reply::AbsCmdPos(positions(value)?),
        Query::RelCmdPos => Reply::RelCmdPos(positions(value)?),
        Query::PosOffset => Reply::PosOffset(positions(value)?),
        Query::OperatorDisplay => {
            Reply::OperatorDisplay((!equals(value, "ok")).then(|| value.to_owned()))
        }
        Query::Error => Reply::Error((!equals(value, "ok")).then(|| value.to_owned())),
        Query::JointHomed => Reply::JointHomed(joints(value, false, |word| match word {
            "yes" => Some(true),
            "no" => Some(false),
            _ => None,
        })?),
        Query::JointLimit => Reply::JointLimit(joints(value, JointLimit::Free, |word| {
            Some(match word {
                "ok" => JointLimit::Free,
                "minsoft" => JointLimit::MinSoft,
                "minhard" => JointLimit::MinHard,
                "maxsoft" => JointLimit::MaxSoft,
                "maxhard" => JointLimit::MaxHard,
                _ => return None,
            })
        })?),
    })
}

/// Finite positions of at most as many axes as there are joints.
fn positions(value: &str) -> Option<Vec<f64>> {
    let words = value.split_ascii_whitespace().take(JOINTS + 1);
    let found: Vec<f64> = words.map(|word| word.parse().ok()).collect::<Option<_>>()?;
    let known = !found.is_empty() && found.len() <= JOINTS;
    (known && found.iter().all(|position| position.is_finite())).then_some(found)
}

fn on_off(value: &str) -> Option<bool> {
    match value {
        _ if equals(value, "on") => Some(true),
        _ if equals(value, "off") => Some(false),
        _ => None,
    }
}

fn joints<T: Copy>(
    value: &str,
    absent: T,
    word_value: impl Fn(&str) -> Option<T>,
) -> Option<[T; JOINTS]> {
    let mut found = [absent; JOINTS];
    let mut words = value.split_ascii_whitespace();
    for (place, word) in found.iter_mut().zip(&mut words) {
        *place = word_value(&word.to_ascii_lowercase())?;
    }
    words.next().is_none().then_some(found)
}
