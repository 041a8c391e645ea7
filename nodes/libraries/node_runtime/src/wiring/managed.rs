//! A node that is managed: it acts only while it is active, and anybody may steer it.
//!
//! Asking for a step is a service call like any other, so it is an event of the node: a harness delivers it in the
//! total order and tells of it, and a bag that holds it replays. A node with `autostart` is configured and
//! activated by the first event that reaches it.
//!
//! Configuring, cleaning up and activating happen at once. Deactivating takes as long as the stage needs to come
//! to rest; the answer to who asked for it waits until then. While the node is unconfigured or finalized its
//! stage hears nothing; what latched topics said meanwhile is handed over when it is configured, as a
//! subscription that is made only then would get it.

use std::collections::VecDeque;

use abbe_msgs::lifecycle_msgs::msg::TransitionEvent;
use abbe_msgs::{Durability, Qos};
use metrology::stamp::{Host, Span, Stamp};
use metrology::{Author, Stage};

use super::{Satisfied, Wiring, topic_port};
use crate::lifecycle::{Ending, State, Transition};
use crate::node::{Bytes, Emission, Event, Node, NodeFault, Ports, RequestId, Saved};
use crate::parameter::Parameter;

mod calls;
mod steps;

use calls::Call;

/// A step of the stage's own code; what it says is why it failed.
type Callback<S> = Box<dyn FnMut(&mut S) -> Result<(), String> + Send>;

/// What a managed node does on its steps.
pub struct Lifecycle<S: Stage> {
    autostart: bool,
    within: Span,
    configure: Callback<S>,
    cleanup: Callback<S>,
    activity: Box<dyn Fn(bool) -> S::Input + Send>,
    at_rest: Satisfied<S::Output>,
}

impl<S: Stage> Lifecycle<S> {
    /// Activating and deactivating tell the stage `activity`; it has been deactivated when an output satisfies
    /// `at_rest`, and is in error when that takes longer than `within`. The stage of the table begins
    /// inactive.
    pub fn new(
        autostart: bool,
        within: Span,
        activity: impl Fn(bool) -> S::Input + Send + 'static,
        at_rest: impl Fn(&S::Output) -> bool + Send + 'static,
    ) -> Self {
        Self {
            autostart,
            within,
            configure: Box::new(|_| Ok(())),
            cleanup: Box::new(|_| Ok(())),
            activity: Box::new(activity),
            at_rest: Box::new(at_rest),
        }
    }

    /// What is to be made ready when the node is configured.
    #[must_use]
    pub fn configured(
        mut self,
        callback: impl FnMut(&mut S) -> Result<(), String> + Send + 'static,
    ) -> Self {
        self.configure = Box::new(callback);
        self
    }

    /// What is to be given back when the node is cleaned up.
    #[must_use]
    pub fn cleaned_up(
        mut self,
        callback: impl FnMut(&mut S) -> Result<(), String> + Send + 'static,
    ) -> Self {
        self.cleanup = Box::new(callback);
        self
    }
}

/// A node whose table was closed by [`Wiring::managed`].
pub(super) struct Managed<S: Stage> {
    wiring: Wiring<S>,
    lifecycle: Lifecycle<S>,
    ports: Ports,
    standing: Standing,
}

/// What is to be known of a managed node beside its stage.
#[derive(Clone)]
struct Standing {
    state: State,
    /// By subscription: what a latched topic said last.
    latched: Vec<VecDeque<Bytes>>,
    /// Whether the first event has come.
    met: bool,
    /// Since when the stage is coming to rest.
    since: Option<Stamp<Host>>,
    /// Who waits for the end of a step.
    waiting: Option<(usize, RequestId)>,
    /// It was told that the node is not active.
    told: bool,
    /// A step went wrong, and none has been taken since.
    failed: bool,
    /// The process is to end.
    leaving: bool,
}

impl<S> Managed<S>
where
    S: Stage + Send + 'static,
    S::Input: Send + 'static,
    S::Output: Send + 'static,
{
    pub(super) fn new(wiring: Wiring<S>, lifecycle: Lifecycle<S>) -> Self {
        let mut ports = wiring.ports.clone();
        let name = &wiring.name;
        ports.services.extend(Call::ALL.map(|call| call.port(name)));
        let events = format!("{name}/transition_event");
        ports
            .publications
            .push(topic_port::<TransitionEvent>(events, Qos::RELIABLE));
        Self {
            standing: Standing {
                state: State::Unconfigured,
                latched: vec![VecDeque::new(); ports.subscriptions.len()],
                met: false,
                since: None,
                waiting: None,
                told: false,
                failed: false,
                leaving: false,
            },
            wiring,
            lifecycle,
            ports,
        }
    }

    /// Whether the stage is told of what comes; a node that leaves goes on to its end.
    const fn hears(&self) -> bool {
        self.standing.leaving
            || !matches!(self.standing.state, State::Unconfigured | State::Finalized)
    }

    fn keep_latched(&mut self, subscription: usize, bytes: &[u8]) {
        let Some(port) = self.ports.subscriptions.get(subscription) else {
            return;
        };
        if port.qos.durability == Durability::TransientLocal {
            let kept = &mut self.standing.latched[subscription];
            if kept.len() >= port.qos.depth as usize {
                kept.pop_front();
            }
            kept.push_back(Bytes::from(bytes));
        }
    }

    /// Answers in the place of a stage that hears nothing.
    fn answer_deaf(&self, event: &Event<'_>, out: &mut Vec<Emission>) {
        match *event {
            Event::Goal { server, id, .. } => out.push(Emission::RejectGoal { server, id }),
            Event::Request { service, id, .. } => {
                if let Some((_, reply)) = self.wiring.services.get(service) {
                    let reason = format!("{} is {}", self.wiring.name, self.standing.state.label());
                    let bytes = reply(Err(&reason));
                    out.push(Emission::Respond { service, id, bytes });
                }
            }
            _ => {}
        }
    }

    /// The process is to end, which the stage is told in its own words.
    fn leave(&mut self, at: Stamp<Host>, out: &mut Vec<Emission>) -> Result<(), NodeFault> {
        let heard = self.hears();
        self.standing.leaving = true;
        self.standing.since = None;
        let mut steps = Transition::of(self.standing.state);
        if let Some(step) = steps.find(|step| step.goal == State::ShuttingDown) {
            self.take(at, *step, out);
        }
        if heard {
            return self.pass(at, Event::Shutdown, out);
        }
        self.end(at, Ending::Success, out);
        out.push(Emission::Stopped);
        Ok(())
    }

    fn pass(
        &mut self,
        at: Stamp<Host>,
        event: Event<'_>,
        out: &mut Vec<Emission>,
    ) -> Result<(), NodeFault> {
        let before = out.len();
        let result = self.wiring.handle(at, event, out);
        if self.standing.leaving {
            let mut said = out[before..].iter();
            if said.any(|emission| matches!(emission, Emission::Stopped)) {
                self.end(at, Ending::Success, out);
            }
        } else {
            self.look_whether_at_rest(at, out);
        }
        result
    }
}

impl<S> Node for Managed<S>
where
    S: Stage + Send + 'static,
    S::Input: Send + 'static,
    S::Output: Send + 'static,
{
    fn name(&self) -> &str {
        self.wiring.name()
    }

    fn ports(&self) -> &Ports {
        &self.ports
    }

    fn parameters(&self) -> &[Parameter] {
        self.wiring.parameters()
    }

    fn patience(&self) -> Span {
        self.wiring.patience()
    }

    fn stops_last(&self) -> bool {
        Node::stops_last(&self.wiring)
    }

    fn keeps_own_time(&self) -> bool {
        Node::keeps_own_time(&self.wiring)
    }

    fn goes_live(&mut self) {
        Node::goes_live(&mut self.wiring);
    }

    fn sees_publishers(&mut self, subscription: usize, publishers: usize) {
        if self.hears() {
            self.wiring.sees_publishers(subscription, publishers);
        }
    }

    fn hears_from(&mut self, at: Stamp<Host>, subscription: usize, author: Author) {
        if self.hears() {
            self.wiring.hear_from(at, subscription, author);
        }
    }

    fn save(&self) -> Option<Saved> {
        let stage = self.wiring.save()?;
        Some(Box::new((stage, self.standing.clone())))
    }

    fn resume(&mut self, saved: &Saved) -> bool {
        let Some((stage, standing)) = saved.downcast_ref::<(Saved, Standing)>() else {
            return false;
        };
        self.standing.clone_from(standing);
        self.wiring.resume(stage)
    }

    fn handle(
        &mut self,
        at: Stamp<Host>,
        event: Event<'_>,
        out: &mut Vec<Emission>,
    ) -> Result<(), NodeFault> {
        if matches!(event, Event::Shutdown) {
            return self.leave(at, out);
        }
        if !std::mem::replace(&mut self.standing.met, true) {
            self.start(at, out);
        }
        if let Event::Message {
            subscription,
            bytes,
        } = event
        {
            self.keep_latched(subscription, bytes);
        }
        if let Event::Request { service, id, bytes } = event
            && let Some(place) = service.checked_sub(self.wiring.ports.services.len())
            && let Some(call) = Call::ALL.get(place)
        {
            let asked = self.asked(at, *call, (service, id), bytes, out);
            let port = &self.ports.services[service].service;
            return asked.map_err(|refusal| refusal.fault(&self.wiring.name, port));
        }
        if self.hears() {
            return self.pass(at, event, out);
        }
        self.answer_deaf(&event, out);
        Ok(())
    }
}
