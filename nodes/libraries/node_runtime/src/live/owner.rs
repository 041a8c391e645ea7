//! The one owner of a node: takes what happens out of one queue, in the order of arrival, hands it to
//! the node, and carries out what the node says.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use abbe_msgs::{Defect, Qos, to_cdr, topics};
use metrology::Stamp;
use metrology::stamp::Host;
use tokio::sync::{mpsc, watch};
use tokio::time::Instant;

use super::Stop;
use super::action_client::ActionClient;
use super::action_server::{ActionServer, GoalService};
use super::board::Board;
use super::event_time::EventTime;
use super::incoming::{Incoming, Readers};
use super::logger_levels::LoggerService;
use super::parameters::{self, ParameterService};
use super::refusals::Refusals;
use super::related::Related;
use super::service::{Client, ReplyTo, Server, shared};
use super::timers::{HostTimers, SimulatedTimers};
use crate::clock::Clock;
use crate::diagnostic::{Diagnostic, Level};
use crate::log::{self, Severity};
use crate::network::{Participant, PublishError, Writer};
use crate::node::{Bytes, Emission, Event, Node, RequestId};
use crate::parameter::Parameter;

mod carry;
mod early;
mod graph;
mod take;

pub(super) use early::Hearing;
pub(super) use graph::Writers;

/// What a server is there for.
#[derive(Clone, Copy, Debug)]
pub(super) enum ServerUse {
    Service(usize),
    Action(usize, GoalService),
    Parameter(ParameterService),
    Logger(LoggerService),
    TypeDescription,
}

/// What a client is there for.
#[derive(Clone, Copy, Debug)]
pub(super) enum ClientUse {
    Service(usize),
    Action(usize, GoalService),
}

pub(super) struct Subscription {
    pub topic: String,
    pub dds_type: String,
    pub qos: Qos,
    pub received: u64,
    pub lost: u64,
    /// Samples since the last look at which another publisher came back.
    pub turns: u64,
    pub writers: Writers,
}

pub(super) struct Publication {
    pub topic: String,
    pub dds_type: String,
    pub qos: Qos,
    pub writer: Writer,
    pub sent: u64,
    pub unsent: u64,
}

/// An action that the node offers; its three servers stand together from `first_server` on.
pub(super) struct ActionEnd {
    pub name: String,
    pub server: ActionServer,
    pub first_server: usize,
    pub feedback: Writer,
    pub status: Writer,
}

/// An action that the node uses; its three clients stand together from `first_client` on.
pub(super) struct UsedAction {
    pub client: ActionClient,
    pub first_client: usize,
}

pub(super) enum Timers {
    Host(Option<HostTimers>),
    Simulated(SimulatedTimers),
}

pub(super) struct Owner {
    pub name: String,
    pub node: Box<dyn Node>,
    pub parameters: Vec<Parameter>,
    pub participant: Participant,
    pub readers: Readers,
    pub queue: mpsc::Receiver<Incoming>,
    pub clock: Clock,
    pub relation: Related,
    pub timers: Timers,
    pub subscriptions: Vec<Subscription>,
    pub publications: Vec<Publication>,
    pub servers: Vec<(ServerUse, Server)>,
    pub clients: Vec<(ClientUse, Client)>,
    pub actions: Vec<ActionEnd>,
    pub used_actions: Vec<UsedAction>,
    pub diagnostics: Writer,
    /// None: its lines are not wanted there.
    pub rosout: Option<Arc<Writer>>,
    pub parameter_events: Writer,
    pub log_level: Option<Severity>,
    pub is_on_console: bool,
    pub board: Board,
    pub refusals: Refusals,
    pub emissions: Vec<Emission>,
    pub event_time: EventTime,
    pub next_request: RequestId,
    pub requests: BTreeMap<(usize, RequestId), (usize, ReplyTo)>,
    pub hearing: Hearing,
    pub patience: Duration,
    pub stopping_since: Option<Instant>,
    pub stopped: bool,
    pub forced: bool,
    pub has_told_parameters: bool,
    pub next_second: Instant,
    pub next_service: Instant,
    pub last_publication: Option<Instant>,
}

/// How long it takes until everybody has met: `/parameter_events` is volatile, and what is said on it
/// before is heard by nobody.
const MEETING: Duration = Duration::from_millis(900);
/// How long the last samples may take to be acknowledged.
const ACKNOWLEDGEMENT: Duration = Duration::from_secs(1);
/// How long the last news of the graph may take; it is a courtesy.
const FAREWELL: Duration = Duration::from_millis(300);
/// Between looks for a server while a request waits.
const SERVER_POLL: Duration = Duration::from_millis(20);
/// Between looks at the time limits of open requests.
const LIMIT_POLL: Duration = Duration::from_millis(200);
/// Between publications of `/diagnostics` when conditions come and go quickly.
const DIAGNOSTICS_PAUSE: Duration = Duration::from_millis(100);
/// Why an input was refused that the wire has nothing against.
const NOT_TAKEN: &str = "not taken by the node";
/// Why a sample was refused that another type's publisher sent.
const FOREIGN_TYPE: &str = "of another type";
/// Events handled before chores and the wish to stop are looked at again.
const BATCH: usize = 256;
/// Events are handled for no longer than this before the same; the one at hand is ended.
const TURN: Duration = Duration::from_millis(20);

fn now() -> Instant {
    Instant::now()
}

impl Owner {
    /// Drives the node until `stop` says so, then winds it down.
    pub async fn run(mut self, mut stop: watch::Receiver<Stop>) {
        log::open(&log::Speech {
            node: &self.name,
            rosout: self.rosout.as_ref(),
            clock: &self.clock,
            chosen: self.log_level,
            is_on_console: self.is_on_console,
        });
        for action in &self.actions {
            let _ = action.status.publish(&action.server.status(), None);
        }
        tracing::info!(parameters = self.parameters.len(), "started");
        let met_by = now() + MEETING;
        while !self.is_done() {
            let wake = self.wake();
            tokio::select! {
                // The wish to stop first, however much waits.
                biased;
                Ok(()) = stop.changed() => self.told(*stop.borrow_and_update()),
                Some(incoming) = self.queue.recv() => self.batch(incoming),
                () = tokio::time::sleep_until(wake) => {}
            }
            self.chores(now());
            if !self.has_told_parameters && now() >= met_by {
                self.tell_parameters();
            }
        }
        self.finish().await;
    }

    fn tell_parameters(&mut self) {
        self.has_told_parameters = true;
        let event = parameters::start_event(&self.name, &self.parameters, self.clock.now());
        if let Err(error) = self.parameter_events.publish(&event, None) {
            self.unsent(topics::PARAMETER_EVENTS.name, &error);
        }
    }

    fn batch(&mut self, first: Incoming) {
        let until = now() + TURN;
        self.take(first);
        for _ in 1..BATCH {
            if now() >= until {
                return;
            }
            match self.queue.try_recv() {
                Ok(incoming) => self.take(incoming),
                Err(_) => return,
            }
        }
    }

    fn is_done(&self) -> bool {
        let patience_over = |since: Instant| now().duration_since(since) >= self.patience;
        self.stopping_since
            .is_some_and(|since| self.stopped || self.forced || patience_over(since))
    }

    fn wake(&self) -> Instant {
        let mut wake = self.next_second;
        let clients = || self.clients.iter().map(|(_, client)| client);
        if clients().any(|client| client.requests.is_waiting()) {
            wake = wake.min(self.next_service);
        } else if clients().any(|client| client.requests.has_asked()) {
            wake = wake.min(now() + LIMIT_POLL);
        }
        if !self.hearing.early.is_empty() {
            wake = wake.min(now() + early::POLL);
        }
        if self.board.has_changed() {
            wake = wake.min(
                self.last_publication
                    .map_or(now(), |last| last + DIAGNOSTICS_PAUSE),
            );
        }
        self.stopping_since
            .map_or(wake, |since| wake.min(since + self.patience))
    }

    fn told(&mut self, stop: Stop) {
        if stop != Stop::No && self.stopping_since.is_none() {
            self.begin_to_stop();
        }
        self.forced |= stop == Stop::AtOnce;
    }

    fn begin_to_stop(&mut self) {
        tracing::info!("stopping");
        self.stopping_since = Some(now());
        self.board.stopping();
        let at = self.instant(None);
        self.hand(at, Event::Shutdown);
    }

    /// The time of an event; it does not go back unless the clock was set back.
    fn instant(&mut self, received: Option<Stamp<Host>>) -> Stamp<Host> {
        if self.clock.is_simulated() {
            return self.clock.now();
        }
        let (now, arrived) = if self.relation.keeps_own_time {
            (self.relation.own_now(), None)
        } else {
            let arrived = received.map(|at| self.clock.taken_over(at));
            (self.clock.now(), arrived)
        };
        let (at, set_back) = self.event_time.of(now, arrived);
        if let Some(back) = set_back {
            self.tell_set_back(back.as_secs_f64());
        }
        at
    }

    fn tell_set_back(&mut self, back_s: f64) {
        let mut message = format!("clock went back {back_s} s");
        if let Some(unheard) = self.participant.unheard_after_set_back() {
            message += ": until that has passed again, ";
            message += unheard;
            message += " are not heard";
        }
        let diagnostic = Diagnostic::new(Level::Warn, "clock_stepped_back", message);
        self.notice(diagnostic.with("step_s", -back_s));
    }

    fn notice(&mut self, diagnostic: Diagnostic) {
        self.board.notice(diagnostic, now());
    }

    /// Hands an event to the node and carries out what it says.
    fn hand(&mut self, at: Stamp<Host>, event: Event<'_>) {
        let mut emissions = std::mem::take(&mut self.emissions);
        let outcome = self.node.handle(at, event, &mut emissions);
        for emission in emissions.drain(..) {
            self.carry(emission);
        }
        self.emissions = emissions;
        if let Err(fault) = outcome {
            let reason = fault.defect.map_or(NOT_TAKEN, Defect::words);
            self.refuse(
                ("input_refused", fault.port.as_str()),
                reason,
                at,
                &fault.to_string(),
            );
        }
    }

    /// Reports an input that cannot be used, and counts it by port and reason.
    fn refuse(
        &mut self,
        (name, port): (&str, &str),
        reason: &'static str,
        at: Stamp<Host>,
        what: &str,
    ) {
        self.board.count("inputs refused", 1);
        let (diagnostic, counter) = self.refusals.add((name, port), reason, at, what);
        self.board.set(counter.name, counter.inputs);
        self.notice(diagnostic);
    }

    /// Reports a sample that could not be sent.
    fn unsent(&mut self, topic: &str, error: &PublishError) {
        self.board.count("samples not sent", 1);
        let message = format!("{topic}: not sent: {error}");
        self.notice(
            Diagnostic::new(Level::Error, "samples_not_sent", message).with("topic", topic),
        );
    }

    fn chores(&mut self, now: Instant) {
        if !self.hearing.early.is_empty() {
            self.take_early(now);
        }
        if self
            .clients
            .iter()
            .any(|(_, client)| client.requests.is_waiting() || client.requests.has_asked())
            && now >= self.next_service
        {
            self.next_service = now + SERVER_POLL;
            self.serve_clients(now);
        }
        if now >= self.next_second {
            self.next_second = now + Duration::from_secs(1);
            self.every_second(now);
        } else if self.board.has_changed()
            && self
                .last_publication
                .is_none_or(|last| now >= last + DIAGNOSTICS_PAUSE)
        {
            self.publish_diagnostics(now);
        }
    }

    fn every_second(&mut self, now: Instant) {
        self.board.expire(now);
        self.check_graph();
        for place in 0..self.actions.len() {
            let action = &mut self.actions[place];
            if action.server.forget(now) {
                let _ = action.status.publish(&action.server.status(), None);
            }
        }
        self.tell_relation();
        self.look_for_servers(now);
        for place in 0..self.clients.len() {
            for token in self.clients[place].1.requests.abandoned() {
                self.replied(place, token, None);
            }
        }
        self.publish_diagnostics(now);
    }

    fn publish_diagnostics(&mut self, now: Instant) {
        for subscription in &self.subscriptions {
            let Subscription {
                topic,
                received,
                lost,
                ..
            } = subscription;
            self.board.set(format!("{topic} received"), *received);
            self.board.set(format!("{topic} lost"), *lost);
        }
        for Publication {
            topic,
            sent,
            unsent,
            ..
        } in &self.publications
        {
            self.board.set(format!("{topic} sent"), *sent);
            if *unsent > 0 {
                self.board.set(format!("{topic} not sent"), *unsent);
            }
        }
        self.last_publication = Some(now);
        let message = shared(&to_cdr(&self.board.message(self.clock.now())));
        let _ = self.diagnostics.publish(&message, self.clock.source());
    }

    /// Stop reading, say the last things, wait until they have arrived, leave the graph.
    async fn finish(mut self) {
        if !self.stopped {
            let message = if self.forced {
                "not wound down: the end was forced".to_owned()
            } else {
                format!("not wound down after {} s", self.patience.as_secs_f64())
            };
            self.notice(Diagnostic::new(Level::Error, "stop_forced", message));
        }
        if let Timers::Host(Some(timers)) = self.timers {
            timers.stop();
            self.timers = Timers::Host(None);
        }
        self.publish_diagnostics(now());
        tracing::info!("stopped");
        log::close();
        let Self {
            readers,
            participant,
            publications,
            servers,
            clients,
            actions,
            diagnostics,
            rosout,
            parameter_events,
            ..
        } = self;
        readers.stop().await;
        let mut writers: Vec<&Writer> = vec![&diagnostics, &parameter_events];
        writers.extend(rosout.as_deref());
        writers.extend(publications.iter().map(|publication| &publication.writer));
        writers.extend(servers.iter().map(|(_, server)| &server.writer));
        writers.extend(clients.iter().map(|(_, client)| &client.writer));
        for ActionEnd {
            feedback, status, ..
        } in &actions
        {
            writers.extend([feedback, status]);
        }
        let all = futures::future::join_all(writers.into_iter().map(Writer::acknowledged));
        let _ = tokio::time::timeout(ACKNOWLEDGEMENT, all).await;
        if participant.withdraw().is_ok() {
            let _ = tokio::time::timeout(FAREWELL, participant.graph_acknowledged()).await;
        }
        // An endpoint that outlives its participant complains.
        drop((publications, servers, clients, actions));
        drop((diagnostics, rosout, parameter_events));
        drop(participant);
    }
}

/// Bytes of a reply, where one came.
type Reply<'b> = Option<&'b Bytes>;
