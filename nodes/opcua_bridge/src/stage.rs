//! The bridge without its sockets.

use std::collections::BTreeSet;
use std::convert::Infallible;

use machine_report::Report;
use machine_report::values::Values;
use metrology::Stage;
use metrology::sample::{AxisState, MachineValue, TemperatureSample};
use metrology::stamp::{Host, Span, Stamp};

use crate::condition::Condition;
use crate::config::Settings;
use crate::engineering_unit::ShownUnit;
use crate::value::Change;

mod taking;

use taking::Taking;

/// Inputs of the bridge.
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
#[derive(Clone, Debug, PartialEq)]
pub enum IoEvent {
    /// The session stands, and the nodes are subscribed to.
    Up {
        /// Policy and mode of the endpoint.
        security: String,
        /// As whom.
        user: String,
        /// Nodes that the server has not, or does not give: item and reason.
        missing: Vec<(usize, String)>,
        /// Units that the server shows, by item.
        units: Vec<(usize, ShownUnit)>,
        /// Longest sampling interval that was granted, ms; `None`: no node is subscribed to.
        given_ms: Option<f64>,
        /// Shortest queue that was granted.
        given_queue: u32,
    },
    /// Changes, in the order in which the server sent them.
    Changed(Vec<Change>),
    /// Messages of the subscription that the server does not have any more.
    Lost {
        /// First number that was lost.
        from: u32,
        /// How many.
        count: u64,
    },
    /// Messages that came faster than they could be taken.
    Dropped {
        /// How many.
        count: u64,
    },
    /// The connection is broken; the session is to be taken up again.
    Broken {
        /// The reason.
        reason: String,
    },
    /// The session was taken up again.
    Resumed {
        /// Messages of the break that the server sent again.
        republished: u64,
    },
    /// No endpoint is one that the parameters allow.
    Refused {
        /// What was asked for, and what there is.
        reason: String,
    },
    /// The connection could not be made, or has ended with its session.
    Ended {
        /// The reason.
        reason: String,
    },
}

/// What is to be done outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IoCommand {
    /// Connect and subscribe.
    Connect,
    /// End the connection.
    Disconnect,
}

/// Outputs of the bridge.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// Positions of all axes that are known.
    State(AxisState),
    /// A temperature that can be.
    Temperature(TemperatureSample),
    /// A value as it was reported, with a verdict.
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

impl From<Condition> for Output {
    fn from(condition: Condition) -> Self {
        Self::Condition(condition)
    }
}

/// Where the connection is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Waiting { until: Option<Stamp<Host>> },
    Asking,
    Up,
    Broken,
}

/// Missing nodes are named up to this many.
const NODES_NAMED: usize = 40;

/// The bridge.
#[derive(Clone, Debug)]
pub struct BridgeStage {
    settings: Settings,
    phase: Phase,
    retry: Span,
    taking: Taking,
    stopping: bool,
    greeted: bool,
    /// Items that the server showed in another unit than the mapping.
    other_units: BTreeSet<usize>,
}

impl BridgeStage {
    /// A bridge that has not looked for the machine yet.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let keys = settings.items.iter().map(|item| item.key.clone());
        Self {
            phase: Phase::Waiting { until: None },
            retry: settings.reconnect_first,
            taking: Taking::new(Values::new(settings.mapping.clone()), keys.collect()),
            stopping: false,
            greeted: false,
            other_units: BTreeSet::new(),
            settings: settings.clone(),
        }
    }

    fn tick(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        self.greet(out);
        // A clock that was set back does not lengthen a pause.
        self.taking.values.wait(at, out);
        self.taking.tell_account(at, out);
        if let Phase::Waiting { until } = self.phase
            && until.is_none_or(|until| at >= until || at < until - self.settings.reconnect_longest)
        {
            self.phase = Phase::Asking;
            out.push(Output::Io(IoCommand::Connect));
        }
    }

    /// Says once what the mapping leaves open.
    fn greet(&mut self, out: &mut Vec<Output>) {
        let axes = self.taking.values.mapping().uncommanded();
        if !std::mem::replace(&mut self.greeted, true) && !axes.is_empty() {
            let letters: Vec<_> = axes.iter().map(|axis| axis.letter()).collect();
            let axes = letters.join(" ");
            let condition = machine_report::ValueCondition::Uncommanded { axes };
            out.push(Output::Condition(condition.into()));
        }
    }

    /// The connection has ended, or was never made: it is tried again after a pause that doubles.
    fn lose(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) -> f64 {
        self.taking.absent_all(at, out);
        let retry = self.retry;
        self.phase = Phase::Waiting {
            until: Some(at + retry),
        };
        let twice = Span::from_nanos(retry.nanos().saturating_mul(2));
        self.retry = twice.min(self.settings.reconnect_longest);
        retry.as_secs_f64()
    }

    fn handle(&mut self, at: Stamp<Host>, event: IoEvent, out: &mut Vec<Output>) {
        if matches!(self.phase, Phase::Waiting { .. }) {
            // The rest of a connection that was given up.
            return;
        }
        let endpoint = self.settings.endpoint.clone();
        match event {
            IoEvent::Up {
                security,
                user,
                missing,
                units,
                given_ms,
                given_queue,
            } => {
                self.phase = Phase::Up;
                self.retry = self.settings.reconnect_first;
                let connected = Condition::Connected {
                    endpoint,
                    security,
                    user,
                };
                out.push(connected.into());
                self.offered(&missing, out);
                self.compare_units(&units, out);
                self.granted(given_ms, given_queue, out);
            }
            IoEvent::Changed(changes) => self.taking.take_all(changes, at, out),
            IoEvent::Lost { from, count } => self.taking.lost(from, count, out),
            IoEvent::Dropped { count } => self.taking.dropped(count, out),
            IoEvent::Broken { reason } => {
                if std::mem::replace(&mut self.phase, Phase::Broken) != Phase::Broken {
                    self.taking.absent_all(at, out);
                }
                out.push(Condition::Broken { endpoint, reason }.into());
            }
            IoEvent::Resumed { republished } => {
                self.phase = Phase::Up;
                let count = republished;
                out.push(Condition::Resumed { endpoint, count }.into());
            }
            IoEvent::Refused { reason } => {
                let retry_s = self.lose(at, out);
                let refused = Condition::Refused {
                    endpoint,
                    reason,
                    retry_s,
                };
                out.push(refused.into());
            }
            IoEvent::Ended { reason } => {
                let retry_s = self.lose(at, out);
                let ended = Condition::Disconnected {
                    endpoint,
                    reason,
                    retry_s,
                };
                out.push(ended.into());
            }
        }
    }

    /// Says which nodes of the mapping the server has not.
    fn offered(&self, missing: &[(usize, String)], out: &mut Vec<Output>) {
        if missing.is_empty() {
            return out.push(Condition::Offered.into());
        }
        let named = |(item, reason): &(usize, String)| {
            let item = self.settings.items.get(*item)?;
            Some(format!("{} ({reason})", item.key))
        };
        let named: Vec<String> = missing.iter().take(NODES_NAMED).filter_map(named).collect();
        let mut keys = named.join(", ");
        if missing.len() > NODES_NAMED {
            keys.push_str(&format!(" and {} more", missing.len() - NODES_NAMED));
        }
        out.push(Condition::NotOffered { keys }.into());
    }

    /// Says which numbers the server shows in another unit than the mapping, and which no more.
    fn compare_units(&mut self, units: &[(usize, ShownUnit)], out: &mut Vec<Output>) {
        for (at, item) in self.settings.items.iter().enumerate() {
            let Some(mapped) = self.settings.mapping.unit(&item.key) else {
                continue;
            };
            let shown = units.iter().find(|(of, _)| *of == at).map(|(_, unit)| unit);
            let other = shown.filter(|shown| shown.is(mapped) == Some(false));
            let differed = self.other_units.remove(&at);
            let key = item.key.clone();
            if let Some(other) = other {
                self.other_units.insert(at);
                let (mapped, offered) = (mapped.word(), other.shown());
                let differs = Condition::UnitDiffers {
                    key,
                    mapped,
                    offered,
                };
                out.push(differs.into());
            } else if differed {
                out.push(Condition::UnitAgrees { key }.into());
            }
        }
    }

    /// Says whether the server looks as often, and keeps as much, as it was asked to.
    fn granted(&self, given_ms: Option<f64>, given_queue: u32, out: &mut Vec<Output>) {
        let Some(given_ms) = given_ms else {
            return;
        };
        let asked_ms = f64::from(self.settings.subscription.sampling_ms);
        let asked_queue = self.settings.subscription.queue;
        let is_asked = given_ms <= asked_ms && given_queue >= asked_queue;
        // Asked for 0, a server looks as often as it can.
        let is_fastest = asked_ms <= 0.0 && given_queue >= asked_queue;
        out.push(if is_asked || is_fastest {
            Condition::AsAsked.into()
        } else {
            Condition::Revised {
                asked_ms,
                given_ms,
                asked_queue,
                given_queue,
            }
            .into()
        });
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
                self.taking.values.finish(out);
                out.push(Output::Io(IoCommand::Disconnect));
                out.push(Output::Stopped);
            }
        }
        Ok(())
    }
}
