//! Taking in what happens.

use abbe_msgs::action_msgs::srv::CancelGoalRequest;
use abbe_msgs::{Defect, Reliability, WireError, from_cdr};
use metrology::stamp::Host;
use metrology::{Author, Stamp};
use tokio::time::Instant;

use super::{ClientUse, FOREIGN_TYPE, Owner, Reply, ServerUse, Timers, now};
use crate::diagnostic::{Diagnostic, Level};
use crate::live::action_client::{Ask, News};
use crate::live::action_server::{Answer, GoalService};
use crate::live::incoming::{After, Incoming};
use crate::live::requests::{Due, Unanswered};
use crate::live::service::ReplyTo;
use crate::live::timers::SimulatedTimers;
use crate::live::type_description;
use crate::node::{Bytes, Event};

impl Owner {
    #[expect(clippy::too_many_lines, reason = "one arm or field after another")]
    pub(super) fn take(&mut self, incoming: Incoming) {
        match incoming {
            Incoming::Message {
                subscription,
                bytes,
                received,
                writer,
                after,
            } => {
                self.count_message(subscription, after);
                let at = self.instant(Some(received));
                if let Some(what) = self.foreign(subscription, writer) {
                    let port = self.node.ports().subscriptions[subscription].topic.clone();
                    let name = ("input_refused", port.as_str());
                    return self.refuse(name, FOREIGN_TYPE, at, &what);
                }
                self.node.hears_from(at, subscription, Author(writer));
                let bytes = &bytes;
                let event = Event::Message {
                    subscription,
                    bytes,
                };
                self.hand(at, event);
            }
            Incoming::Unreadable { topic, reason } => {
                self.board.count("samples unreadable", 1);
                let (at, what) = (self.instant(None), format!("{topic}: {reason}"));
                let name = ("sample_unreadable", &*topic);
                self.refuse(name, Defect::Encoding.words(), at, &what);
            }
            Incoming::Request {
                server,
                client,
                to,
                bytes,
            } => self.request_of(server, &client, to, bytes),
            Incoming::Reply {
                client,
                identity,
                bytes,
            } => {
                if let Some(token) = self.clients[client].1.requests.answered(identity) {
                    self.replied(client, token, Some(&bytes));
                }
            }
            Incoming::Feedback { client, bytes } => {
                if let Some((id, bytes)) = self.used_actions[client].client.feedback(&bytes) {
                    let at = self.instant(None);
                    self.hand(
                        at,
                        Event::GoalFeedback {
                            client,
                            id,
                            bytes: &bytes,
                        },
                    );
                }
            }
            Incoming::Timer { timer, missed } => {
                if let Timers::Host(Some(timers)) = &self.timers {
                    timers.taken(timer);
                }
                self.missed(timer, missed);
                let at = self.instant(None);
                self.hand(at, Event::Timer { timer });
            }
            Incoming::Clock(now) => self.set_clock(now),
            Incoming::HostClock(clock) => self.relate(*clock),
        }
    }

    fn count_message(&mut self, place: usize, After { lost, takes_turns }: After) {
        let subscription = &mut self.subscriptions[place];
        subscription.received += 1;
        subscription.turns += u64::from(takes_turns);
        if lost == 0 {
            return;
        }
        subscription.lost += lost;
        if subscription.qos.reliability == Reliability::Reliable {
            let (topic, total) = (subscription.topic.clone(), subscription.lost);
            let message = format!("{topic}: {lost} samples lost, {total} since the start");
            let diagnostic = Diagnostic::new(Level::Error, "samples_lost", message);
            self.notice(diagnostic.with("topic", topic).with("lost", total));
        }
    }

    /// Counts missed periods; a stall that a person would notice is a condition too.
    fn missed(&mut self, timer: usize, missed: u64) {
        const NOTICED_STALL_NANOS: u64 = 20_000_000;
        if missed == 0 {
            return;
        }
        let period = self
            .node
            .ports()
            .timers
            .get(timer)
            .map_or(0, |period| period.nanos());
        let stall_nanos = missed.saturating_mul(u64::try_from(period).unwrap_or(0));
        if stall_nanos >= NOTICED_STALL_NANOS {
            self.overrun(missed);
        } else {
            self.board.count("timer periods missed", missed);
        }
    }

    fn overrun(&mut self, missed: u64) {
        self.board.count("timer periods missed", missed);
        let message = format!("{missed} timer periods missed");
        self.notice(Diagnostic::new(Level::Warn, "timer_overrun", message).with("missed", missed));
    }

    fn set_clock(&mut self, to: Stamp<Host>) {
        let before = self.clock.set(to);
        let Timers::Simulated(timers) = &mut self.timers else {
            return;
        };
        let is_first = before == Stamp::from_nanos(0);
        if is_first || to < before {
            timers.arm(to);
        }
        if to < before {
            let back_s = (before - to).as_secs_f64();
            let message = format!("/clock went back {back_s} s: timers are armed anew");
            let diagnostic = Diagnostic::new(Level::Warn, "clock_stepped_back", message);
            self.notice(diagnostic.with("step_s", -back_s));
        }
        for _ in 0..SimulatedTimers::most_ticks() {
            let Timers::Simulated(timers) = &mut self.timers else {
                return;
            };
            let Some((at, timer)) = timers.next(to) else {
                return;
            };
            self.hand(at, Event::Timer { timer });
        }
        let Timers::Simulated(timers) = &mut self.timers else {
            return;
        };
        let skipped = timers.skip(to);
        if skipped > 0 {
            self.overrun(skipped);
        }
    }

    pub(super) fn request(&mut self, place: usize, to: ReplyTo, bytes: &Bytes) {
        match self.servers[place].0 {
            ServerUse::Service(service) => {
                let id = self.next_request;
                self.next_request += 1;
                self.requests.insert((service, id), (place, to));
                let at = self.instant(None);
                self.hand(at, Event::Request { service, id, bytes });
            }
            ServerUse::Parameter(service) => {
                let answer = service.answer(&self.parameters, bytes);
                self.answer_or_complain(place, to, answer);
            }
            ServerUse::Logger(service) => {
                let answer = service.answer(&self.name, bytes);
                self.answer_or_complain(place, to, answer);
            }
            ServerUse::TypeDescription => {
                let answer = type_description::answer(self.participant.release(), bytes);
                self.answer_or_complain(place, to, answer);
            }
            ServerUse::Action(action, service) => self.goal_request(action, service, to, bytes),
        }
    }

    fn answer_or_complain(&mut self, place: usize, to: ReplyTo, answer: Result<Bytes, WireError>) {
        match answer {
            Ok(answer) => self.answer(place, to, &answer),
            Err(error) => self.malformed(place, &error.to_string()),
        }
    }

    fn malformed(&mut self, server: usize, reason: &str) {
        self.board.count("requests malformed", 1);
        let name = self.servers[server].1.name.clone();
        let diagnostic = Diagnostic::new(
            Level::Warn,
            "request_malformed",
            format!("{name}: {reason}"),
        );
        self.notice(diagnostic.with("service", name));
    }

    pub(super) fn answer(&mut self, server: usize, to: ReplyTo, bytes: &Bytes) {
        if let Err(error) = self.servers[server].1.answer(to, bytes) {
            let name = self.servers[server].1.name.clone();
            self.unsent(&name, &error);
        }
    }

    pub(super) fn answer_goal(&mut self, action: usize, answer: &Answer) {
        let first = self.actions[action].first_server;
        self.answer(first + place_of(answer.service), answer.to, &answer.bytes);
    }

    pub(super) fn publish_status(&mut self, action: usize) {
        let end = &self.actions[action];
        if let Err(error) = end.status.publish(&end.server.status(), None) {
            let name = end.name.clone();
            self.unsent(&name, &error);
        }
    }

    fn goal_request(&mut self, action: usize, service: GoalService, to: ReplyTo, bytes: &Bytes) {
        let server = &mut self.actions[action].server;
        match service {
            GoalService::SendGoal => match server.propose(to, bytes) {
                Ok((id, goal)) => {
                    let at = self.instant(None);
                    self.hand(
                        at,
                        Event::Goal {
                            server: action,
                            id,
                            bytes: &goal,
                        },
                    );
                }
                Err(Some(answer)) => self.answer_goal(action, &answer),
                Err(None) => {
                    let place = self.actions[action].first_server;
                    self.malformed(place, "a goal begins with its 16-byte identifier");
                }
            },
            GoalService::GetResult => {
                if let Some(answer) = server.result(to, bytes) {
                    self.answer_goal(action, &answer);
                }
            }
            GoalService::CancelGoal => match from_cdr::<CancelGoalRequest>(bytes) {
                Ok(request) => self.cancel_goals(action, to, &request),
                Err(error) => {
                    let place = self.actions[action].first_server + place_of(service);
                    self.malformed(place, &error.to_string());
                }
            },
        }
    }

    fn cancel_goals(&mut self, action: usize, to: ReplyTo, request: &CancelGoalRequest) {
        let (cancelled, answer) = self.actions[action].server.cancel(to, request);
        self.answer_goal(action, &answer);
        self.publish_status(action);
        for id in cancelled {
            let at = self.instant(None);
            self.hand(at, Event::Cancel { server: action, id });
        }
    }

    /// A reply to one of our requests, or that none will come.
    pub(super) fn replied(&mut self, place: usize, token: u64, bytes: Reply<'_>) {
        if bytes.is_none() {
            self.unanswered(place);
        }
        match self.clients[place].0 {
            ClientUse::Service(client) => {
                let bytes = bytes.map(AsRef::as_ref);
                let at = self.instant(None);
                self.hand(
                    at,
                    Event::Response {
                        client,
                        id: token,
                        bytes,
                    },
                );
            }
            ClientUse::Action(action, service) => {
                let used = &mut self.used_actions[action];
                let (news, ask) = used.client.replied(service, token, bytes);
                if let Some(ask) = ask {
                    self.ask(action, ask, Due::AtTheEnd);
                }
                if let Some(news) = news {
                    self.tell(action, &news);
                }
            }
        }
    }

    fn unanswered(&mut self, place: usize) {
        self.board.count("requests unanswered", 1);
        let name = self.clients[place].1.name.clone();
        let message = format!("{name}: no server answered");
        let diagnostic = Diagnostic::new(Level::Warn, "request_unanswered", message);
        self.notice(diagnostic.with("service", name));
    }

    fn tell(&mut self, client: usize, news: &News) {
        let at = self.instant(None);
        match news {
            News::Answer { id, accepted } => {
                self.hand(
                    at,
                    Event::GoalAnswer {
                        client,
                        id: *id,
                        accepted: *accepted,
                    },
                );
            }
            News::Result { id, status, bytes } => {
                let bytes = bytes.as_deref();
                self.hand(
                    at,
                    Event::GoalResult {
                        client,
                        id: *id,
                        status: *status,
                        bytes,
                    },
                );
            }
        }
    }

    pub(super) fn ask(&mut self, action: usize, ask: Ask, due: Due) {
        let place = self.used_actions[action].first_client + place_of(ask.service);
        let requests = &mut self.clients[place].1.requests;
        requests.ask(ask.token, ask.bytes, due, now());
    }

    /// Looks for servers.
    pub(super) fn look_for_servers(&mut self, now: Instant) {
        if self.clients.is_empty() {
            return;
        }
        let (writers, readers) = (self.participant.writers(), self.participant.readers());
        for (_, client) in &mut self.clients {
            client.look(&writers, &readers, now);
        }
    }

    /// Sends what waits for a server, and gives up what has waited too long.
    pub(super) fn serve_clients(&mut self, now: Instant) {
        if self
            .clients
            .iter()
            .any(|(_, client)| client.requests.is_waiting())
        {
            self.look_for_servers(now);
        }
        for place in 0..self.clients.len() {
            // Before anything is sent: what is given up must not go out with it.
            for unanswered in self.clients[place].1.requests.expired(now) {
                self.given_up(place, unanswered);
            }
            while let Err((token, error)) = self.clients[place].1.send(now) {
                let name = self.clients[place].1.name.clone();
                self.unsent(&name, &error);
                if let Some(token) = token {
                    self.replied(place, token, None);
                }
            }
        }
    }

    /// A request has found no answer in its time. A goal that a server may have taken meanwhile is called off: nobody would
    /// hear of its end.
    fn given_up(&mut self, place: usize, Unanswered { token, was_sent }: Unanswered) {
        if let ClientUse::Action(action, service) = self.clients[place].0 {
            let may_run = match service {
                GoalService::SendGoal => was_sent,
                GoalService::GetResult => true,
                GoalService::CancelGoal => false,
            };
            let cancel = self.used_actions[action].client.cancel(token);
            if let Some(cancel) = cancel.filter(|_| may_run) {
                self.ask(action, cancel, Due::AtOnce);
            }
        }
        self.replied(place, token, None);
    }
}

/// The order in which an action's three services are assembled.
const fn place_of(service: GoalService) -> usize {
    match service {
        GoalService::SendGoal => 0,
        GoalService::CancelGoal => 1,
        GoalService::GetResult => 2,
    }
}
