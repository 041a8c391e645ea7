//! The bridge without its sockets.

use std::convert::Infallible;

use metrology::Stage;
use metrology::sample::{AxisState, MachineValue, TemperatureSample};
use metrology::stamp::{Host, Span, Stamp};

use crate::agent::{AgentLink, Heard};
use crate::condition::{Condition, Lost};
use crate::config::{Settings, Source};
use crate::framing::{Framed, Lines};
use crate::logged::Log;
use crate::shdr::{self, Line, Shape};
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
        /// The system's word for it.
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
        /// The system's word for it.
        reason: String,
        /// HTTP status of the stream; 0 for an adapter.
        status: u16,
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
    heartbeat: Option<Span>,
    pinged_at: Option<Stamp<Host>>,
}

#[derive(Clone, Debug)]
enum Link {
    Shdr(ShdrLink),
    Agent(AgentLink),
    Log(Log),
}

/// The bridge.
#[derive(Clone, Debug)]
pub struct BridgeStage {
    settings: Settings,
    link: Link,
    phase: Phase,
    heard_at: Stamp<Host>,
    retry: Span,
    values: Values,
    refused_lines: u64,
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
                heartbeat: None,
                pinged_at: None,
            }),
            Source::Log => Link::Log(Log::default()),
            Source::Agent => Link::Agent(AgentLink::new(&settings.agent, &settings.mapping)),
        };
        Self {
            link,
            phase: Phase::Waiting { until: None },
            heard_at: Stamp::default(),
            retry: settings.reconnect_first,
            values: Values::new(settings.mapping.clone()),
            refused_lines: 0,
            stopping: false,
            greeted: false,
            settings: settings.clone(),
        }
    }

    /// A bridge that tells the lines of a log when their time has come.
    #[must_use]
    pub fn of_log(settings: &Settings, text: &str) -> Self {
        Self {
            link: Link::Log(Log::new(text)),
            ..Self::new(settings)
        }
    }

    fn tick(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        self.greet(out);
        if let Link::Log(log) = &mut self.link {
            let (values, refused) = (&mut self.values, &mut self.refused_lines);
            log.due(at, |line| {
                let flaw = take(line, at, values, &mut None, out);
                out.extend(flaw.map(|flaw| {
                    *refused += 1;
                    let count = *refused;
                    Output::Condition(Condition::Malformed { flaw, count })
                }));
            });
            return self.values.wait(at, out);
        }
        self.values.wait(at, out);
        match self.phase {
            Phase::Waiting { until } if until.is_none_or(|until| at >= until) => {
                self.phase = Phase::Asking { since: at };
                self.heard_at = at;
                out.extend(match &mut self.link {
                    Link::Shdr(_) => Some(Output::Io(IoCommand::Connect)),
                    Link::Agent(agent) => Some(Output::Io(agent.begin())),
                    Link::Log(_) => None,
                });
            }
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
        let axes = self.values.mapping().uncommanded();
        if !std::mem::replace(&mut self.greeted, true) && !axes.is_empty() {
            let letters: Vec<_> = axes.iter().map(|axis| axis.letter()).collect();
            let axes = letters.join(" ");
            out.push(Output::Condition(Condition::Uncommanded { axes }));
        }
    }

    fn watch_silence(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        let silence = at - self.heard_at;
        let limit = match &mut self.link {
            Link::Shdr(link) => {
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
        self.values.absent_all(at, out);
        if let Link::Shdr(link) = &mut self.link {
            link.lines.restart();
            (link.heartbeat, link.pinged_at) = (None, None);
        }
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
            self.retry = self.settings.reconnect_first;
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
                agent.answered(status, &body, &mut heard)
            }
            (Link::Agent(agent), IoEvent::Began { content_type }) => {
                agent.began(&content_type);
                Ok(())
            }
            (Link::Agent(agent), IoEvent::Received(bytes)) => agent.received(&bytes, &mut heard),
            (Link::Agent(agent), IoEvent::Closed { reason, status }) => {
                agent.ended(&reason, status, &mut heard)
            }
            (Link::Log(_), _)
            | (Link::Shdr(_), IoEvent::Answered { .. } | IoEvent::Began { .. })
            | (Link::Agent(_), IoEvent::Connected) => Ok(()),
        };
        self.follow(at, heard, out);
        if let Err(lost) = taken {
            self.lose(at, lost, out);
        }
    }

    fn follow(&mut self, at: Stamp<Host>, heard: Vec<Heard>, out: &mut Vec<Output>) {
        for heard in heard {
            match heard {
                Heard::Observation(observation) => self.values.hear(observation, at, out),
                Heard::Condition(condition) => out.push(Output::Condition(condition)),
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
        let (values, refused, limit) = (
            &mut self.values,
            &mut self.refused_lines,
            self.settings.line_limit,
        );
        let heartbeat = &mut link.heartbeat;
        link.lines.receive(bytes, |framed| {
            let condition = match framed {
                Framed::TooLong { length } => {
                    *refused += 1;
                    Some(Condition::LineTooLong {
                        length,
                        limit,
                        count: *refused,
                    })
                }
                Framed::NotText { length } => {
                    *refused += 1;
                    Some(Condition::NotText {
                        length,
                        count: *refused,
                    })
                }
                Framed::Line(line) => take(line, at, values, heartbeat, out).map(|flaw| {
                    *refused += 1;
                    Condition::Malformed {
                        flaw,
                        count: *refused,
                    }
                }),
            };
            out.extend(condition.map(Output::Condition));
        });
    }
}

const PING: &str = "* PING\n";
/// An adapter that wants to be asked more or less often than this is not watched, ms.
const HEARTBEATS_MS: std::ops::RangeInclusive<f64> = 100.0..=3.6e6;

/// Takes one line; returns what is wrong with it.
fn take(
    line: &str,
    at: Stamp<Host>,
    values: &mut Values,
    heartbeat: &mut Option<Span>,
    out: &mut Vec<Output>,
) -> Option<shdr::Flaw> {
    if line.trim().is_empty() {
        return None;
    }
    let shape = |key: &str| -> Option<Shape> {
        let found = values.mapping().find(key.trim(), None);
        found.map(|(_, used)| used.shape())
    };
    match shdr::read(line, shape) {
        Line::Observations(observations) => {
            for observation in observations {
                values.hear(observation, at, out);
            }
            None
        }
        Line::Pong { period_ms } => {
            let is_sensible = HEARTBEATS_MS.contains(&period_ms);
            *heartbeat = is_sensible.then(|| Span::from_secs_f64(period_ms * 1e-3));
            None
        }
        Line::Command => None,
        Line::Malformed(flaw) => Some(flaw),
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
                self.values.finish(out);
                out.push(Output::Io(IoCommand::Disconnect));
                out.push(Output::Stopped);
            }
        }
        Ok(())
    }
}
