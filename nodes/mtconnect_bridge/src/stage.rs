//! The bridge without its sockets.

use std::convert::Infallible;

use machine_report::Report;
use metrology::Stage;
use metrology::sample::{AxisState, MachineValue, TemperatureSample};
use metrology::stamp::{Host, Span, Stamp};

use crate::agent::{AgentLink, Heard};
use crate::condition::{Condition, Lost, ValueCondition};
use crate::config::{Settings, Source};
use crate::framing::{Framed, Lines};
use crate::logged::{Due, Log};
use crate::reader::Reader;
use crate::shdr::block::Blocks;
use crate::values::Values;

/// What the bridge is told.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Time has passed.
    Tick,
    /// Something came from outside.
    Io(IoEvent),
    /// The bridge is to stop.
    Shutdown,
}

/// What comes from outside.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum IoEvent {
    /// The connection to the adapter stands.
    Connected,
    /// It could not be made, nor a request sent.
    NotConnected {
        /// The reason that the system gives.
        reason: String,
    },
    /// An agent answered as a whole.
    Answered {
        /// HTTP status.
        status: u16,
        /// What it said.
        body: Vec<u8>,
    },
    /// An agent's stream has begun.
    Began {
        /// Value of `Content-Type`.
        content_type: String,
    },
    /// Bytes came.
    Received(Vec<u8>),
    /// The connection or the stream has ended.
    Closed {
        /// The reason that the system gives.
        reason: String,
        /// HTTP status of the stream; 0 for an adapter.
        status: u16,
    },
}

/// What was read of a log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LogRead<'a> {
    /// The next bytes.
    Bytes(&'a [u8]),
    /// Its end was read.
    End,
    /// It cannot be read on.
    Failed {
        /// The reason that the system gives.
        reason: String,
        /// Bytes that were read before.
        at_byte: u64,
    },
}

/// What is to be done outside.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum IoCommand {
    /// Connect to the adapter.
    Connect,
    /// End the connection or the stream.
    Disconnect,
    /// Send a line to the adapter.
    Send(String),
    /// Ask the agent.
    Get {
        /// Path and query.
        path: String,
    },
    /// Ask the agent for an answer without end.
    Stream {
        /// Path and query.
        path: String,
    },
}

/// What the bridge says.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// Positions of all axes that are known.
    State(AxisState),
    /// A temperature that can be.
    Temperature(TemperatureSample),
    /// A value as it was told, with a verdict.
    Value(MachineValue),
    /// A condition worth reporting.
    Condition(Condition),
    /// Something to be done outside.
    Io(IoCommand),
    /// The answer to [`Input::Shutdown`].
    Stopped,
}

impl From<Report> for Output {
    fn from(report: Report) -> Self {
        match report {
            Report::State(state) => Self::State(state),
            Report::Temperature(sample) => Self::Temperature(sample),
            Report::Value(value) => Self::Value(value),
            Report::Condition(condition) => Self::Condition(condition.into()),
        }
    }
}

/// Where the connection is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Waiting { until: Option<Stamp<Host>> },
    Asking { since: Stamp<Host> },
    Up,
}

/// The conversation with an adapter.
#[derive(Clone, Debug)]
struct ShdrLink {
    lines: Lines,
    blocks: Blocks,
    heartbeat: Option<Span>,
    pinged_at: Option<Stamp<Host>>,
}

#[derive(Clone, Debug)]
enum Link {
    Shdr(ShdrLink),
    Agent(AgentLink),
    Log(Box<Log>),
}

/// The bridge.
#[derive(Clone, Debug)]
pub struct BridgeStage {
    settings: Settings,
    link: Link,
    phase: Phase,
    heard_at: Stamp<Host>,
    retry: Span,
    reader: Reader,
    stopping: bool,
    greeted: bool,
}

impl BridgeStage {
    /// A bridge that has not looked for the machine yet.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let link = match settings.source {
            Source::Shdr => Link::Shdr(ShdrLink {
                lines: Lines::new(settings.line_limit),
                blocks: Blocks::default(),
                heartbeat: None,
                pinged_at: None,
            }),
            Source::Log => Link::Log(Box::new(Log::new(
                settings.longest_pause,
                settings.line_limit,
            ))),
            Source::Agent => Link::Agent(AgentLink::new(settings)),
        };
        Self {
            link,
            phase: Phase::Waiting { until: None },
            heard_at: Stamp::default(),
            retry: settings.reconnect_first,
            reader: Reader::new(Values::new(settings.mapping.clone())),
            stopping: false,
            greeted: false,
            settings: settings.clone(),
        }
    }

    /// A bridge that replays the lines of a log, of whatever encoding, when their time has come.
    #[must_use]
    pub fn of_log(settings: &Settings, bytes: &[u8]) -> Self {
        let mut log = Log::new(settings.longest_pause, settings.line_limit);
        log.feed(bytes);
        log.finish();
        Self {
            link: Link::Log(Box::new(log)),
            ..Self::new(settings)
        }
    }

    /// Whether more bytes of a log are to be read.
    #[must_use]
    pub const fn wants_log(&self) -> bool {
        matches!(&self.link, Link::Log(log) if log.wants_more())
    }

    /// Takes what was read of a log.
    pub fn read_log(&mut self, read: LogRead<'_>, out: &mut Vec<Output>) {
        let Link::Log(log) = &mut self.link else {
            return;
        };
        match read {
            LogRead::Bytes(bytes) => log.feed(bytes),
            LogRead::End => log.finish(),
            LogRead::Failed { reason, at_byte } => {
                log.finish();
                out.push(Output::Condition(Condition::LogUnreadable {
                    reason,
                    at_byte,
                }));
            }
        }
    }

    fn tick(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        self.greet(out);
        if let Link::Log(log) = &mut self.link {
            tell_log(log, &mut self.reader, at, out);
            return self.reader.values.wait(at, out);
        }
        self.reader.values.wait(at, out);
        self.reader.tell_account(at, out);
        if let (Link::Agent(agent), Phase::Up) = (&mut self.link, self.phase) {
            let mut heard = Vec::new();
            agent.tick(at, &mut heard);
            self.follow(at, heard, out);
        }
        match self.phase {
            // A clock that was set back lengthens neither a pause nor a silence.
            Phase::Waiting { until }
                if until.is_none_or(|until| {
                    at >= until || at < until - self.settings.reconnect_longest
                }) =>
            {
                self.phase = Phase::Asking { since: at };
                self.heard_at = at;
                out.extend(match &mut self.link {
                    Link::Shdr(_) => Some(Output::Io(IoCommand::Connect)),
                    Link::Agent(agent) => Some(Output::Io(agent.begin())),
                    Link::Log(_) => None,
                });
            }
            Phase::Asking { since } if since > at => self.phase = Phase::Asking { since: at },
            Phase::Asking { since } if at - since > self.settings.reply_timeout => {
                let limit_s = self.settings.reply_timeout.as_secs_f64();
                self.lose(at, Lost::Silent { limit_s }, out);
            }
            Phase::Up => self.watch_silence(at, out),
            Phase::Waiting { .. } | Phase::Asking { .. } => {}
        }
    }

    /// Says once what the mapping leaves open.
    fn greet(&mut self, out: &mut Vec<Output>) {
        let axes = self.reader.values.mapping().uncommanded();
        if !std::mem::replace(&mut self.greeted, true) && !axes.is_empty() {
            let letters: Vec<_> = axes.iter().map(|axis| axis.letter()).collect();
            let axes = letters.join(" ");
            let condition = ValueCondition::Uncommanded { axes };
            out.push(Output::Condition(condition.into()));
        }
    }

    fn watch_silence(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        self.heard_at = self.heard_at.min(at);
        let silence = at - self.heard_at;
        let limit = match &mut self.link {
            Link::Shdr(link) => {
                link.pinged_at = link.pinged_at.map(|pinged_at| pinged_at.min(at));
                let due = link.pinged_at.zip(link.heartbeat);
                if due.is_some_and(|(pinged_at, heartbeat)| at - pinged_at >= heartbeat) {
                    link.pinged_at = Some(at);
                    out.push(Output::Io(IoCommand::Send(PING.to_owned())));
                }
                link.heartbeat
                    .map(|heartbeat| Span::from_nanos(heartbeat.nanos().saturating_mul(2)))
            }
            Link::Agent(agent) => agent.silence_limit(),
            Link::Log(_) => None,
        };
        if let Some(limit) = limit.filter(|limit| silence > *limit) {
            let limit_s = limit.as_secs_f64();
            self.lose(at, Lost::Silent { limit_s }, out);
        }
    }

    fn lose(&mut self, at: Stamp<Host>, lost: Lost, out: &mut Vec<Output>) {
        out.push(Output::Io(IoCommand::Disconnect));
        if let Link::Shdr(link) = &mut self.link {
            self.reader
                .end_of_connection(&mut link.lines, &mut link.blocks, out);
            (link.heartbeat, link.pinged_at) = (None, None);
        }
        self.reader.values.absent_all(at, out);
        self.phase = Phase::Waiting {
            until: Some(at + self.retry),
        };
        out.push(Output::Condition(Condition::Disconnected {
            address: self.settings.address.clone(),
            lost,
            retry_s: self.retry.as_secs_f64(),
        }));
        let twice = Span::from_nanos(self.retry.nanos().saturating_mul(2));
        self.retry = twice.min(self.settings.reconnect_longest);
    }

    fn up(&mut self, out: &mut Vec<Output>) {
        if self.phase != Phase::Up {
            self.phase = Phase::Up;
            // An agent's stream may begin and then hold nothing that can be read: its first part counts.
            if matches!(self.link, Link::Shdr(_)) {
                self.retry = self.settings.reconnect_first;
            }
            let address = self.settings.address.clone();
            out.push(Output::Condition(Condition::Connected { address }));
        }
    }

    fn handle(&mut self, at: Stamp<Host>, event: IoEvent, out: &mut Vec<Output>) {
        if matches!(self.phase, Phase::Waiting { .. }) {
            // The rest of a connection that was given up.
            return;
        }
        self.heard_at = at;
        let mut heard = Vec::new();
        let taken = match (&mut self.link, event) {
            (_, IoEvent::NotConnected { reason }) => Err(Lost::NotConnected { reason }),
            (Link::Shdr(link), IoEvent::Connected) => {
                link.pinged_at = Some(at);
                out.push(Output::Io(IoCommand::Send(PING.to_owned())));
                self.up(out);
                Ok(())
            }
            (Link::Shdr(_), IoEvent::Received(bytes)) => {
                self.lines(at, &bytes, out);
                Ok(())
            }
            (Link::Shdr(_), IoEvent::Closed { reason, .. }) => Err(Lost::Closed { reason }),
            (Link::Agent(agent), IoEvent::Answered { status, body }) => {
                agent.answered(at, status, &body, &mut heard)
            }
            (Link::Agent(agent), IoEvent::Began { content_type }) => {
                agent.began(&content_type);
                Ok(())
            }
            (Link::Agent(agent), IoEvent::Received(bytes)) => {
                agent.received(at, &bytes, &mut heard)
            }
            (Link::Agent(agent), IoEvent::Closed { reason, status }) => {
                agent.ended(at, &reason, status, &mut heard)
            }
            (Link::Log(_), _)
            | (Link::Shdr(_), IoEvent::Answered { .. } | IoEvent::Began { .. })
            | (Link::Agent(_), IoEvent::Connected) => Ok(()),
        };
        self.follow(at, heard, out);
        if let Link::Agent(agent) = &mut self.link
            && agent.take_progress()
        {
            self.retry = self.settings.reconnect_first;
        }
        if let Err(lost) = taken {
            self.lose(at, lost, out);
        }
    }

    fn follow(&mut self, at: Stamp<Host>, heard: Vec<Heard>, out: &mut Vec<Output>) {
        for heard in heard {
            match heard {
                Heard::Observation(observation) => self.reader.values.hear(observation, at, out),
                Heard::Held(observation) => self.reader.values.hear_held(observation, at, out),
                Heard::Read { replaced, left } => {
                    self.reader.account.lines += 1;
                    self.reader.account.is_of_agent = true;
                    self.reader.replaced(replaced, out);
                    let account = &mut self.reader.account;
                    account.leave_many("observations that are none", left as u64, 0);
                }
                Heard::PartLeftOut { path, flaw } => self.reader.part_left_out(path, flaw, out),
                Heard::Repeated { count } => self.reader.repeated(count),
                Heard::Condition(condition) => {
                    self.reader.of_numbers(&condition);
                    out.push(Output::Condition(condition));
                }
                Heard::Io(command) => {
                    if matches!(command, IoCommand::Stream { .. }) {
                        self.up(out);
                    }
                    out.push(Output::Io(command));
                }
            }
        }
    }

    fn lines(&mut self, at: Stamp<Host>, bytes: &[u8], out: &mut Vec<Output>) {
        let Link::Shdr(link) = &mut self.link else {
            return;
        };
        let (reader, limit) = (&mut self.reader, self.settings.line_limit);
        let ShdrLink {
            lines,
            blocks,
            heartbeat,
            ..
        } = link;
        lines.receive(bytes, |framed| match framed {
            Framed::TooLong { length } if blocks.spoil(length, limit) => {}
            Framed::TooLong { length } => reader.too_long(length, limit, out),
            Framed::Line { text, replaced } => {
                reader.replaced(replaced, out);
                blocks.push(text, at, |record| match record {
                    Ok(record) => {
                        if let Some(asked) = reader.take(&record, at, None, out) {
                            *heartbeat = asked;
                        }
                    }
                    Err(given_up) => reader.give_up(given_up, out),
                });
            }
        });
    }

    /// What is left of a log, or open of a connection, when the bridge ends.
    fn leave(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        match &mut self.link {
            Link::Log(log) => out.extend(log.left(at).map(|left| {
                Output::Condition(Condition::LogLeft {
                    lines: left.lines,
                    is_all: left.is_all,
                    next_s: left.next.as_secs_f64(),
                    account: self.reader.account(),
                })
            })),
            Link::Shdr(link) => {
                self.reader
                    .end_of_connection(&mut link.lines, &mut link.blocks, out);
            }
            Link::Agent(_) => {}
        }
    }
}

const PING: &str = "* PING\n";

/// Replays the lines whose time has come; with the last one, reports the account.
fn tell_log(log: &mut Log, reader: &mut Reader, at: Stamp<Host>, out: &mut Vec<Output>) {
    log.due(at, |due| {
        let Due {
            record,
            dated,
            leap,
        } = due;
        if let Some(leap) = leap {
            reader.values.at_line(record.line);
            out.push(reader.values.leap(leap).into());
        }
        reader.take(record, at, dated, out);
    });
    if log.ends() {
        reader.replaced(log.replaced(), out);
        let account = reader.account();
        out.push(Output::Condition(Condition::LogEnded { account }));
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
        if self.stopping {
            return Ok(());
        }
        match input {
            Input::Tick => self.tick(at, out),
            Input::Io(event) => self.handle(at, event, out),
            Input::Shutdown => {
                self.stopping = true;
                self.reader.values.finish(out);
                self.leave(at, out);
                out.push(Output::Io(IoCommand::Disconnect));
                out.push(Output::Stopped);
            }
        }
        Ok(())
    }
}
