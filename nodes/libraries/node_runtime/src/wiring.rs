//! From a pure stage to a node: a table that says which topic is which input and output.
//!
//! A shell is one expression: it names the stage, then a line for every topic, timer, service and
//! action. The table decodes and encodes, converts between wire and inner units, and reports
//! what could not be converted; the stage sees typed inner samples only.
//!
//! ```text
//! Ok(Wiring::new(setup, ThermalStage::new(&config)?)
//!     .on(&topics::BLOCKS_MEASUREMENT, Input::Block)
//!     .every(config.check_period, || Input::Tick)
//!     .publish(&topics::THERMAL_MODEL, |output| match output {
//!         Output::Model(model) => Some(model),
//!         _ => None,
//!     })
//!     .diagnose(diagnostic)
//!     .node())
//! ```

use std::sync::Arc;

use abbe_msgs::topics::{ServiceName, Topic, TopicFamily};
use abbe_msgs::{Message, Qos, Service, Wire, WireError, from_cdr, to_cdr};
use metrology::stamp::{Host, Span, Stamp};
use metrology::{Author, Stage};

use crate::diagnostic::Diagnostic;
use crate::node::{
    Bytes, Emission, Event, Node, NodeFault, Ports, Refusal, STOP_TIMEOUT, Saved, ServiceEvents,
    ServicePort, TopicPort,
};
use crate::parameter::Parameter;

mod action;
mod heard;
mod managed;
mod outgoing;
mod snapshot;

pub use action::{ClientSignal, GoalNews, GoalSignal};
pub use managed::Lifecycle;

/// Turns serialised bytes into a stage input, or says why it cannot.
type Decode<I> = Box<dyn Fn(&[u8]) -> Result<I, Refusal> + Send>;
/// Turns a stage output into emissions of one port.
type Emit<O> = Box<dyn Fn(&O, &mut Vec<Emission>) + Send>;
/// Decodes a request and forms the reply from what the stage answered.
type Reply<O> = Box<dyn Fn(Result<&[O], &str>) -> Bytes + Send>;
/// A service: how its requests become inputs, and outputs its replies.
type ServiceTable<I, O> = (Decode<I>, Reply<O>);
/// Whether an output is the awaited one.
type Satisfied<O> = Box<dyn Fn(&O) -> bool + Send>;
/// Decodes the answer to a call of ours.
type Answer<I> = Box<dyn Fn(u64, Option<&[u8]>) -> Result<I, Refusal> + Send>;

/// Tells a stage of what its runner does.
type Told<S> = Box<dyn Fn(&mut S) + Send>;
/// Tells a stage how many publish what it listens to.
type Counted<S> = Box<dyn Fn(&mut S, usize) + Send>;

/// The table of one node: a stage and what its inputs and outputs are called outside.
pub struct Wiring<S: Stage> {
    name: String,
    parameters: Vec<Parameter>,
    ports: Ports,
    stage: S,
    messages: Vec<Decode<S::Input>>,
    timers: Vec<Box<dyn Fn() -> S::Input + Send>>,
    services: Vec<ServiceTable<S::Input, S::Output>>,
    clients: Vec<Answer<S::Input>>,
    action_servers: Vec<action::ServerTable<S::Input>>,
    action_clients: Vec<action::ClientTable<S::Input>>,
    emitters: Vec<Emit<S::Output>>,
    shutdown: Option<Box<dyn Fn() -> S::Input + Send>>,
    stopped: Option<Satisfied<S::Output>>,
    patience: Span,
    last: bool,
    own_time: bool,
    live: Option<Told<S>>,
    publishers: Vec<(String, Counted<S>)>,
    authors: Vec<(String, heard::Heard<S>)>,
    snapshots: Option<snapshot::Snapshots<S>>,
    outputs: Vec<S::Output>,
}

fn topic_port<M: Message>(name: String, qos: Qos) -> TopicPort {
    TopicPort {
        topic: name,
        type_name: M::TYPE_NAME,
        type_hash: M::TYPE_HASH,
        definition: M::DEFINITION,
        qos,
    }
}

/// Serialises a message that was built here.
fn encode<M: Message>(message: &M) -> Bytes {
    Arc::from(to_cdr(message))
}

/// Length of one message, request or goal: what nodes of ours send is below 16 MiB, a program of 100,000 touches included.
const MOST_MESSAGE_BYTES: usize = 64 << 20;

fn decode<M: Message>(bytes: &[u8]) -> Result<M, Refusal> {
    let n = bytes.len();
    if n > MOST_MESSAGE_BYTES {
        let name = M::TYPE_NAME;
        let reason = format!("{name}: {n} bytes: at most {MOST_MESSAGE_BYTES}");
        return Err(Refusal::by_node(reason));
    }
    Ok(from_cdr(bytes)?)
}

impl<S> Wiring<S>
where
    S: Stage + Send + 'static,
    S::Input: Send + 'static,
    S::Output: Send + 'static,
{
    /// Starts the table of node `name` with its resolved `parameters`.
    #[must_use]
    pub fn new(name: &str, parameters: Vec<Parameter>, stage: S) -> Self {
        Self {
            name: name.to_owned(),
            parameters,
            ports: Ports::default(),
            stage,
            messages: Vec::new(),
            timers: Vec::new(),
            services: Vec::new(),
            clients: Vec::new(),
            action_servers: Vec::new(),
            action_clients: Vec::new(),
            emitters: Vec::new(),
            shutdown: None,
            stopped: None,
            patience: STOP_TIMEOUT,
            last: false,
            own_time: false,
            live: None,
            publishers: Vec::new(),
            authors: Vec::new(),
            snapshots: None,
            outputs: Vec::new(),
        }
    }

    /// Listens to a topic whose messages have an inner form.
    #[must_use]
    pub fn on<M: Wire>(
        self,
        topic: &Topic<M>,
        input: impl Fn(M::Inner) -> S::Input + Send + 'static,
    ) -> Self {
        self.listen::<M>(topic_port::<M>(topic.name.to_owned(), topic.qos), input)
    }

    /// Listens to one member of a topic family, e.g. `temperature/bed`.
    ///
    /// # Errors
    /// When `member` is no ROS name.
    pub fn on_member<M: Wire>(
        self,
        family: &TopicFamily<M>,
        member: &str,
        input: impl Fn(M::Inner) -> S::Input + Send + 'static,
    ) -> Result<Self, WireError> {
        Ok(self.listen::<M>(topic_port::<M>(family.of(member)?, family.qos), input))
    }

    fn listen<M: Wire>(
        mut self,
        port: TopicPort,
        input: impl Fn(M::Inner) -> S::Input + Send + 'static,
    ) -> Self {
        self.ports.subscriptions.push(port);
        self.messages.push(Box::new(move |bytes| {
            let message: M = decode(bytes)?;
            Ok(input(message.into_inner()?))
        }));
        self
    }

    /// Calls the stage at a fixed period.
    #[must_use]
    pub fn every(mut self, period: Span, input: impl Fn() -> S::Input + Send + 'static) -> Self {
        self.ports.timers.push(period);
        self.timers.push(Box::new(input));
        self
    }

    /// Publishes the outputs that `select` picks.
    #[must_use]
    pub fn publish<M: Wire>(
        self,
        topic: &Topic<M>,
        select: impl for<'a> Fn(&'a S::Output) -> Option<&'a M::Inner> + Send + 'static,
    ) -> Self {
        self.say(
            topic_port::<M>(topic.name.to_owned(), topic.qos),
            move |output| select(output).map(M::from_inner),
        )
    }

    /// As [`Wiring::publish`], with the name of a frame at `place` of each message.
    #[must_use]
    pub fn publish_in<M: Wire>(
        self,
        topic: &Topic<M>,
        frame_id: String,
        place: fn(&mut M) -> &mut String,
        select: impl for<'a> Fn(&'a S::Output) -> Option<&'a M::Inner> + Send + 'static,
    ) -> Self {
        self.say(
            topic_port::<M>(topic.name.to_owned(), topic.qos),
            move |output| {
                let mut message = M::from_inner(select(output)?);
                place(&mut message).clone_from(&frame_id);
                Some(message)
            },
        )
    }

    /// Publishes the outputs that `select` picks as one member of a topic family.
    ///
    /// # Errors
    /// When `member` is no ROS name.
    pub fn publish_member<M: Wire>(
        self,
        family: &TopicFamily<M>,
        member: &str,
        select: impl for<'a> Fn(&'a S::Output) -> Option<&'a M::Inner> + Send + 'static,
    ) -> Result<Self, WireError> {
        let port = topic_port::<M>(family.of(member)?, family.qos);
        Ok(self.say(port, move |output| select(output).map(M::from_inner)))
    }

    /// Publishes what its readers can take; see [`outgoing`].
    fn say<M: Wire>(
        mut self,
        port: TopicPort,
        form: impl Fn(&S::Output) -> Option<M> + Send + 'static,
    ) -> Self {
        let guard = outgoing::Outgoing::new(self.ports.publications.len(), port.topic.clone());
        self.ports.publications.push(port);
        self.emitters.push(Box::new(move |output, out| {
            if let Some(message) = form(output) {
                guard.push(&message, out);
            }
        }));
        self
    }

    /// Publishes a message that `form` makes itself (standard messages without an inner form).
    #[must_use]
    pub fn publish_message<M: Message>(
        mut self,
        topic: &Topic<M>,
        form: impl Fn(&S::Output) -> Option<M> + Send + 'static,
    ) -> Self {
        let port = topic_port::<M>(topic.name.to_owned(), topic.qos);
        let publication = self.ports.publications.len();
        self.ports.publications.push(port);
        self.emitters.push(Box::new(move |output, out| {
            if let Some(message) = form(output) {
                out.push(Emission::Publish {
                    publication,
                    bytes: encode(&message),
                });
            }
        }));
        self
    }

    /// Offers a service that is answered from what the stage puts out at once.
    #[must_use]
    pub fn service<V: Service>(
        mut self,
        service: &ServiceName<V>,
        request: impl Fn(V::Request) -> S::Input + Send + 'static,
        reply: impl Fn(Result<&[S::Output], &str>) -> V::Response + Send + 'static,
    ) -> Self {
        self.ports.services.push(ServicePort {
            service: service.name.to_owned(),
            type_name: V::TYPE_NAME,
            events: ServiceEvents::of::<V>(),
        });
        self.services.push((
            Box::new(move |bytes| decode::<V::Request>(bytes).map(&request)),
            Box::new(move |outcome| encode(&reply(outcome))),
        ));
        self
    }

    /// Calls a service when an output says so; the answer (`None`: nobody answered) comes back as an input.
    #[must_use]
    pub fn client<V: Service>(
        mut self,
        service: &ServiceName<V>,
        call: impl Fn(&S::Output) -> Option<(u64, V::Request)> + Send + 'static,
        response: impl Fn(u64, Option<V::Response>) -> S::Input + Send + 'static,
    ) -> Self {
        let client = self.ports.clients.len();
        self.ports.clients.push(ServicePort {
            service: service.name.to_owned(),
            type_name: V::TYPE_NAME,
            events: ServiceEvents::of::<V>(),
        });
        self.emitters.push(Box::new(move |output, out| {
            if let Some((id, request)) = call(output) {
                out.push(Emission::Call {
                    client,
                    id,
                    bytes: encode(&request),
                });
            }
        }));
        self.clients.push(Box::new(move |id, bytes| {
            Ok(response(id, bytes.map(decode::<V::Response>).transpose()?))
        }));
        self
    }

    /// Reports the outputs that are conditions.
    #[must_use]
    pub fn diagnose(
        mut self,
        condition: impl Fn(&S::Output) -> Option<Diagnostic> + Send + 'static,
    ) -> Self {
        self.emitters.push(Box::new(move |output, out| {
            if let Some(diagnostic) = condition(output) {
                out.push(Emission::Diagnostic(diagnostic));
            }
        }));
        self
    }

    /// Tells the stage of a shutdown; the node has stopped when an output satisfies `stopped`.
    #[must_use]
    pub fn shutdown(
        mut self,
        input: impl Fn() -> S::Input + Send + 'static,
        stopped: impl Fn(&S::Output) -> bool + Send + 'static,
    ) -> Self {
        self.shutdown = Some(Box::new(input));
        self.stopped = Some(Box::new(stopped));
        self
    }

    /// Lets winding down take as long as this rather than 5 s.
    #[must_use]
    pub fn wound_down_within(mut self, patience: Span) -> Self {
        self.patience = patience;
        self
    }

    /// Stops this node only when the others of the process have stopped.
    #[must_use]
    pub fn stops_last(mut self) -> Self {
        self.last = true;
        self
    }

    /// Times events by the computer's clock as it is, when they are handed over: for a node that compares clocks.
    #[must_use]
    pub fn keeps_own_time(mut self) -> Self {
        self.own_time = true;
        self
    }

    /// Tells the stage when it is put on a live graph, where real time passes while it computes.
    #[must_use]
    pub fn live(mut self, told: impl Fn(&mut S) + Send + 'static) -> Self {
        self.live = Some(Box::new(told));
        self
    }

    /// Tells the stage once a second how many publish a topic that it listens to; on a live graph alone.
    #[must_use]
    pub fn publishers_of<M: Wire>(
        mut self,
        topic: &Topic<M>,
        told: impl Fn(&mut S, usize) + Send + 'static,
    ) -> Self {
        self.publishers
            .push((topic.name.to_owned(), Box::new(told)));
        self
    }

    /// Closes the table.
    #[must_use]
    pub fn node(self) -> Box<dyn Node> {
        Box::new(self)
    }

    /// Closes the table of a node that acts only while it is active.
    #[must_use]
    pub fn managed(self, lifecycle: Lifecycle<S>) -> Box<dyn Node> {
        Box::new(managed::Managed::new(self, lifecycle))
    }
}

/// Where an event came in, for the message of a fault.
#[derive(Clone, Copy)]
enum Place {
    Subscription(usize),
    Service(usize),
    Client(usize),
    ActionServer(usize),
    ActionClient(usize),
    Timer,
    Shutdown,
}

impl Place {
    fn of(event: &Event<'_>) -> Self {
        match *event {
            Event::Message { subscription, .. } => Self::Subscription(subscription),
            Event::Request { service, .. } => Self::Service(service),
            Event::Response { client, .. } => Self::Client(client),
            Event::Goal { server, .. } | Event::Cancel { server, .. } => Self::ActionServer(server),
            Event::GoalAnswer { client, .. }
            | Event::GoalFeedback { client, .. }
            | Event::GoalResult { client, .. } => Self::ActionClient(client),
            Event::Timer { .. } => Self::Timer,
            Event::Shutdown => Self::Shutdown,
        }
    }

    fn name(self, ports: &Ports) -> &str {
        let named = match self {
            Self::Subscription(at) => ports.subscriptions.get(at).map(|port| &port.topic),
            Self::Service(at) => ports.services.get(at).map(|port| &port.service),
            Self::Client(at) => ports.clients.get(at).map(|port| &port.service),
            Self::ActionServer(at) => ports.action_servers.get(at).map(|port| &port.action),
            Self::ActionClient(at) => ports.action_clients.get(at).map(|port| &port.action),
            Self::Timer => return "timer",
            Self::Shutdown => return "shutdown",
        };
        named.map_or("unknown port", String::as_str)
    }
}

impl<S: Stage> Wiring<S> {
    /// Steps the stage and turns its outputs into emissions; outputs stay in `self.outputs`.
    fn step(
        &mut self,
        at: Stamp<Host>,
        input: Result<S::Input, Refusal>,
        out: &mut Vec<Emission>,
    ) -> Result<(), Refusal> {
        self.outputs.clear();
        let result = input.and_then(|input| {
            self.stage
                .step(at, input, &mut self.outputs)
                .map_err(Refusal::by_node)
        });
        for output in &self.outputs {
            for emit in &self.emitters {
                emit(output, out);
            }
            if self.stopped.as_ref().is_some_and(|stopped| stopped(output)) {
                out.push(Emission::Stopped);
            }
        }
        result
    }

    fn request(
        &mut self,
        at: Stamp<Host>,
        (service, id): (usize, u64),
        bytes: &[u8],
        out: &mut Vec<Emission>,
    ) -> Result<(), Refusal> {
        let Some((decode, _)) = self.services.get(service) else {
            return Ok(());
        };
        let input = decode(bytes);
        let result = self.step(at, input, out);
        let reply = &self.services[service].1;
        let bytes = match &result {
            Ok(()) => reply(Ok(&self.outputs)),
            Err(refusal) => reply(Err(&refusal.reason)),
        };
        out.push(Emission::Respond { service, id, bytes });
        result
    }

    /// The stage input of every event but requests; `None` for a port that does not exist.
    fn input(&self, event: Event<'_>) -> Option<Result<S::Input, Refusal>> {
        match event {
            Event::Message {
                subscription,
                bytes,
            } => Some(self.messages.get(subscription)?(bytes)),
            Event::Timer { timer } => Some(Ok(self.timers.get(timer)?())),
            Event::Response { client, id, bytes } => Some(self.clients.get(client)?(id, bytes)),
            Event::Shutdown => Some(Ok(self.shutdown.as_ref()?())),
            action_event => self.action_input(action_event),
        }
    }
}

impl<S> Node for Wiring<S>
where
    S: Stage + Send,
    S::Input: Send,
    S::Output: Send,
{
    fn name(&self) -> &str {
        &self.name
    }

    fn ports(&self) -> &Ports {
        &self.ports
    }

    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn patience(&self) -> Span {
        self.patience
    }

    fn stops_last(&self) -> bool {
        self.last
    }

    fn keeps_own_time(&self) -> bool {
        self.own_time
    }

    fn goes_live(&mut self) {
        if let Some(told) = &self.live {
            told(&mut self.stage);
        }
    }

    fn sees_publishers(&mut self, subscription: usize, publishers: usize) {
        let port = self.ports.subscriptions.get(subscription);
        for (topic, told) in &self.publishers {
            if port.is_some_and(|port| port.topic == *topic) {
                told(&mut self.stage, publishers);
            }
        }
    }

    fn hears_from(&mut self, at: Stamp<Host>, subscription: usize, author: Author) {
        self.hear_from(at, subscription, author);
    }

    fn save(&self) -> Option<Saved> {
        self.snapshots.as_ref()?.save(&self.stage)
    }

    fn resume(&mut self, saved: &Saved) -> bool {
        let snapshots = self.snapshots.as_ref();
        snapshots.is_some_and(|snapshots| snapshots.resume(&mut self.stage, saved))
    }

    fn handle(
        &mut self,
        at: Stamp<Host>,
        event: Event<'_>,
        out: &mut Vec<Emission>,
    ) -> Result<(), NodeFault> {
        let place = Place::of(&event);
        let goal = match event {
            Event::Goal { server, id, .. } => Some((server, id)),
            _ => None,
        };
        let result = match event {
            Event::Request { service, id, bytes } => self.request(at, (service, id), bytes, out),
            Event::Shutdown if self.shutdown.is_none() => {
                out.push(Emission::Stopped);
                Ok(())
            }
            event => match self.input(event) {
                Some(input) => {
                    // Who proposes what cannot be read waits for an answer as everybody does.
                    if let (Err(_), Some((server, id))) = (&input, goal) {
                        out.push(Emission::RejectGoal { server, id });
                    }
                    self.step(at, input, out)
                }
                None => Ok(()),
            },
        };
        result.map_err(|refusal| refusal.fault(&self.name, place.name(&self.ports)))
    }
}
