//! One connection to the controller: greeting, making ready, and watching its state.
//!
//! A freshly started LinuxCNC has no joint homed. Only then, and only where the configuration says
//! so, is the emergency stop released and the machine homed; an emergency stop that a person has
//! pressed stays until a person releases it, also across a lost connection.

use metrology::stamp::{Host, Stamp};

use crate::condition::{Condition, Lost};
use crate::config::{Prepare, Settings};
use crate::fault::classify;
use crate::protocol::{
    Client, JOINTS, JointLimit, MESSAGE_LIMIT_BYTES, Mode, ProgramStatus, Query, Reply, Request,
    Setting, Signal,
};

/// Steps of the greeting: hello, echo off, verbose on, enable.
const GREETINGS: u8 = 4;

/// Where a connection stands.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Link {
    /// None; the next attempt at this instant.
    Down { retry_at: Option<Stamp<Host>> },
    /// An attempt is under way.
    Connecting,
    /// So many steps of the greeting are done.
    Greeting { done: u8 },
    /// Homing since this instant.
    Homing { since: Stamp<Host> },
    /// In use.
    Up,
}

/// The controller's state as far as it is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ControllerState {
    /// Emergency stop.
    pub estop: Option<bool>,
    /// Drives on.
    pub drives: Option<bool>,
    /// Every joint homed.
    pub homed: Option<bool>,
    /// At least one joint homed.
    pub any_homed: Option<bool>,
    /// What the interpreter does.
    pub status: Option<ProgramStatus>,
    limits: [Option<JointLimit>; JOINTS],
}

/// What a session wants from outside.
#[derive(Clone, Debug, PartialEq)]
pub enum Want {
    /// A new connection.
    Connect,
    /// The connection is to be given up.
    Disconnect,
}

/// A connection and what is known through it.
#[derive(Debug)]
pub struct Session {
    settings: Settings,
    link: Link,
    state: ControllerState,
    poll_at: Option<Stamp<Host>>,
    signals: Vec<Signal>,
    /// Requests and answers; a run asks through it.
    pub client: Client,
}

impl Session {
    /// Without a connection.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        Self {
            settings: settings.clone(),
            link: Link::Down { retry_at: None },
            state: ControllerState::default(),
            poll_at: None,
            signals: Vec::new(),
            client: Client::new(settings.reply_timeout),
        }
    }

    /// What is known of the controller; nothing without a connection.
    #[must_use]
    pub fn state(&self) -> &ControllerState {
        &self.state
    }

    /// Whether commands can be given.
    #[must_use]
    pub fn is_up(&self) -> bool {
        self.link == Link::Up
    }

    /// The socket is open: greet.
    pub fn connected(&mut self) {
        self.client = Client::new(self.settings.reply_timeout);
        self.link = Link::Greeting { done: 0 };
        self.client
            .ask(Request::Hello(self.settings.connect_password.clone()));
        self.client.ask(Request::EchoOff);
        self.client.ask(Request::VerboseOn);
        self.client
            .ask(Request::Enable(self.settings.enable_password.clone()));
    }

    /// The socket is closed or was never open.
    pub fn lost(&mut self, at: Stamp<Host>, reason: Lost, conditions: &mut Vec<Condition>) {
        self.link = Link::Down {
            retry_at: Some(at + self.settings.reconnect_period),
        };
        self.state = ControllerState::default();
        self.client = Client::new(self.settings.reply_timeout);
        self.poll_at = None;
        conditions.push(Condition::Disconnected(reason));
    }

    /// A host clock that went back makes nothing wait longer than it would have.
    fn wait_no_longer(&mut self, at: Stamp<Host>) {
        self.client.asked_by(at);
        let next_poll_at = at + self.settings.poll_period;
        self.poll_at = self.poll_at.map(|poll_at| poll_at.min(next_poll_at));
        match &mut self.link {
            Link::Down { retry_at } => {
                let next_try_at = at + self.settings.reconnect_period;
                *retry_at = retry_at.map(|retry_at| retry_at.min(next_try_at));
            }
            Link::Homing { since } => *since = (*since).min(at),
            _ => {}
        }
    }

    /// Time has passed: connect, look at the controller's state, notice what is overdue.
    pub fn tick(&mut self, at: Stamp<Host>, conditions: &mut Vec<Condition>) -> Option<Want> {
        self.wait_no_longer(at);
        if let Some(Signal::TimedOut(request)) = self.client.expire(at) {
            let limit_s = self.settings.reply_timeout.as_secs_f64();
            let silent = Lost::Silent {
                request: shown(&request),
                limit_s,
            };
            self.lost(at, silent, conditions);
            return Some(Want::Disconnect);
        }
        match self.link {
            Link::Down { retry_at } if retry_at.is_none_or(|retry_at| at >= retry_at) => {
                self.link = Link::Connecting;
                return Some(Want::Connect);
            }
            Link::Homing { since } if at - since > self.settings.homing_timeout => {
                let limit_s = self.settings.homing_timeout.as_secs_f64();
                conditions.push(Condition::HomingTimeout { limit_s });
                self.link = Link::Up;
            }
            Link::Homing { .. } | Link::Up => self.poll(at),
            _ => {}
        }
        None
    }

    /// Takes received bytes; answers that a run may want are passed to `sink`.
    pub fn receive(
        &mut self,
        at: Stamp<Host>,
        bytes: &[u8],
        conditions: &mut Vec<Condition>,
        mut sink: impl FnMut(&ControllerState, &mut Client, &Signal),
    ) -> Option<Want> {
        let mut signals = std::mem::take(&mut self.signals);
        self.client.receive(bytes, &mut signals);
        let mut want = None;
        for signal in signals.drain(..) {
            sink(&self.state, &mut self.client, &signal);
            if let Some(reason) = self.take(at, signal, conditions) {
                self.lost(at, reason, conditions);
                want = Some(Want::Disconnect);
                break;
            }
        }
        signals.clear();
        self.signals = signals;
        want
    }

    fn take(
        &mut self,
        at: Stamp<Host>,
        signal: Signal,
        conditions: &mut Vec<Condition>,
    ) -> Option<Lost> {
        match signal {
            Signal::Reply(Reply::Greeted) => self.greeted(),
            Signal::Reply(reply) => self.observe(at, reply, conditions),
            Signal::Denied(request) => match self.link {
                Link::Greeting { .. } => {
                    return Some(Lost::GreetingRefused {
                        step: shown(&request),
                    });
                }
                _ => conditions.push(Condition::CommandRefused {
                    request: shown(&request),
                }),
            },
            Signal::Unexpected(line) => conditions.push(Condition::UnexpectedLine { line }),
            Signal::LineTooLong { .. } => {
                return Some(Lost::Nonsense {
                    limit_bytes: MESSAGE_LIMIT_BYTES,
                });
            }
            Signal::TimedOut(_) => {}
        }
        if self.link == (Link::Greeting { done: GREETINGS }) {
            self.link = Link::Up;
            conditions.push(Condition::Connected);
        }
        None
    }

    fn greeted(&mut self) {
        if let Link::Greeting { done } = self.link {
            self.link = Link::Greeting { done: done + 1 };
            if done + 1 == GREETINGS {
                // Homing first: it tells whether a machine was switched off or never on.
                for query in [Query::JointHomed, Query::Estop, Query::Machine] {
                    self.client.ask(Request::Get(query));
                }
            }
        }
    }

    fn poll(&mut self, at: Stamp<Host>) {
        if !self.client.is_idle() || self.poll_at.is_some_and(|poll_at| at < poll_at) {
            return;
        }
        self.poll_at = Some(at + self.settings.poll_period);
        for query in [
            Query::Estop,
            Query::Machine,
            Query::Error,
            Query::ProgramStatus,
            Query::JointHomed,
            Query::JointLimit,
        ] {
            self.client.ask(Request::Get(query));
        }
    }

    fn observe(&mut self, at: Stamp<Host>, reply: Reply, conditions: &mut Vec<Condition>) {
        match reply {
            Reply::Estop(on) => {
                let before = self.state.estop.replace(on);
                let condition = if on && before.is_none() && self.state.any_homed == Some(false) {
                    Condition::NotSwitchedOn
                } else {
                    Condition::Estop { on }
                };
                conditions.extend((before != Some(on)).then_some(condition));
            }
            Reply::Machine(on) => {
                let changed = self.state.drives.replace(on) != Some(on);
                conditions.extend(changed.then_some(Condition::Drives { on }));
            }
            Reply::ProgramStatus(status) => self.state.status = Some(status),
            Reply::JointHomed(joints) => self.observe_homed(at, &joints, conditions),
            Reply::JointLimit(limits) => self.observe_limits(&limits, conditions),
            Reply::Error(Some(message)) => {
                let kind = classify(&message);
                conditions.push(Condition::ControllerError { kind, message });
            }
            _ => {}
        }
    }

    fn observe_homed(
        &mut self,
        at: Stamp<Host>,
        joints: &[bool; JOINTS],
        conditions: &mut Vec<Condition>,
    ) {
        let used = &joints[..self.settings.joints.len().min(JOINTS)];
        let homed = used.iter().all(|joint| *joint);
        let first_look = self.state.homed.is_none();
        self.state.any_homed = Some(used.iter().any(|joint| *joint));
        if self.state.homed.replace(homed) != Some(homed) {
            conditions.push(Condition::Homed { homed });
        }
        let fresh = first_look && !used.iter().any(|joint| *joint);
        match self.link {
            Link::Homing { .. } if homed => self.link = Link::Up,
            Link::Up if fresh && self.settings.prepare == Prepare::PowerOnAndHome => {
                for setting in [
                    Setting::EstopOff,
                    Setting::MachineOn,
                    Setting::Mode(Mode::Manual),
                    Setting::HomeAll,
                ] {
                    self.client.ask(Request::Set(setting));
                }
                self.link = Link::Homing { since: at };
            }
            _ => {}
        }
    }

    fn observe_limits(&mut self, limits: &[JointLimit; JOINTS], conditions: &mut Vec<Condition>) {
        for ((axis, limit), known) in self
            .settings
            .joints
            .iter()
            .zip(limits)
            .zip(&mut self.state.limits)
        {
            let before = known.replace(*limit).unwrap_or(JointLimit::Free);
            if before != *limit {
                conditions.push(Condition::AxisLimit {
                    axis: *axis,
                    limit: *limit,
                });
            }
        }
    }
}

/// A request as it may be shown: without passwords.
fn shown(request: &Request) -> String {
    match request {
        Request::Hello(_) => "hello".to_owned(),
        Request::Enable(_) => "enable".to_owned(),
        other => format!("{other:?}"),
    }
}
