//! From a node's ports to endpoints on the network.

use std::sync::Arc;
use std::time::Duration;

use abbe_msgs::{Message, Qos, topics};
use anyhow::Context as _;
use tokio::sync::mpsc;
use tokio::time::Instant;

use super::action_client::ActionClient;
use super::action_server::{ActionServer, GoalService};
use super::board::Board;
use super::event_time::EventTime;
use super::incoming::{Incoming, NODE_QUEUE_LEN, Readers};
use super::logger_levels::LoggerService;
use super::owner::{
    ActionEnd, ClientUse, Hearing, Owner, Publication, ServerUse, Subscription, Timers, UsedAction,
    Writers,
};
use super::parameters::ParameterService;
use super::refusals::Refusals;
use super::related;
use super::service::{Client, Server};
use super::timers::{HostTimers, SimulatedTimers};
use super::type_description;
use crate::clock::Clock;

use crate::names::{self, NodeNames};
use crate::network::{Participant, Writer};
use crate::node::{ActionPort, Node, Ports};
use crate::parameter::Parameter;
use crate::setup::Setup;

const FEEDBACK_QOS: Qos = Qos::RELIABLE;
const STATUS_QOS: Qos = Qos::LATCHED;

const GOAL_SERVICES: [(GoalService, &str); 3] = [
    (GoalService::SendGoal, "send_goal"),
    (GoalService::CancelGoal, "cancel_goal"),
    (GoalService::GetResult, "get_result"),
];

struct Assembly {
    names: NodeNames,
    participant: Participant,
    readers: Readers,
    servers: Vec<(ServerUse, Server)>,
    clients: Vec<(ClientUse, Client)>,
}

impl Assembly {
    fn standard<M: Message>(&self, topic: &topics::Topic<M>) -> anyhow::Result<Writer> {
        let name = self.names.resolve(topic.name)?;
        self.participant
            .writer(&name, &names::dds_type(M::TYPE_NAME), topic.qos)
    }

    fn server(&mut self, used: ServerUse, service: &str, type_name: &str) -> anyhow::Result<()> {
        let (reader, writer) = self.participant.server(service, type_name)?;
        self.readers.requests(service, reader, self.servers.len());
        self.servers.push((
            used,
            Server {
                name: service.to_owned(),
                writer,
            },
        ));
        Ok(())
    }

    fn client(&mut self, used: ClientUse, service: &str, type_name: &str) -> anyhow::Result<()> {
        let (reader, writer) = self.participant.client(service, type_name)?;
        self.readers.replies(service, reader, self.clients.len());
        let client = Client::new(service.to_owned(), writer);
        self.clients.push((used, client));
        Ok(())
    }

    fn subscriptions(&mut self, ports: &Ports) -> anyhow::Result<Vec<Subscription>> {
        let mut subscriptions = Vec::with_capacity(ports.subscriptions.len());
        for (place, port) in ports.subscriptions.iter().enumerate() {
            let topic = self.names.resolve(&port.topic)?;
            let dds_type = names::dds_type(port.type_name);
            let reader = self.participant.reader(&topic, &dds_type, port.qos)?;
            self.readers.messages(&topic, reader, place);
            let qos = port.qos;
            subscriptions.push(Subscription {
                topic,
                dds_type,
                qos,
                received: 0,
                lost: 0,
                turns: 0,
                writers: Writers::default(),
            });
        }
        Ok(subscriptions)
    }

    fn publications(&self, ports: &Ports) -> anyhow::Result<Vec<Publication>> {
        let open = |port: &crate::node::TopicPort| {
            let topic = self.names.resolve(&port.topic)?;
            let dds_type = names::dds_type(port.type_name);
            let writer = self.participant.writer(&topic, &dds_type, port.qos)?;
            let qos = port.qos;
            Ok(Publication {
                topic,
                dds_type,
                qos,
                writer,
                sent: 0,
                unsent: 0,
            })
        };
        ports.publications.iter().map(open).collect()
    }

    fn services(&mut self, ports: &Ports) -> anyhow::Result<()> {
        for (place, port) in ports.services.iter().enumerate() {
            let name = self.names.resolve(&port.service)?;
            self.server(ServerUse::Service(place), &name, port.type_name)?;
        }
        for (place, port) in ports.clients.iter().enumerate() {
            let name = self.names.resolve(&port.service)?;
            self.client(ClientUse::Service(place), &name, port.type_name)?;
        }
        for (service, name, type_name) in ParameterService::ALL {
            let name = self.names.resolve(name)?;
            self.server(ServerUse::Parameter(service), &name, type_name)?;
        }
        for (service, name, type_name) in LoggerService::ALL {
            let name = self.names.resolve(name)?;
            self.server(ServerUse::Logger(service), &name, type_name)?;
        }
        let (name, type_name) = type_description::TYPE_SERVICE;
        let name = self.names.resolve(name)?;
        self.server(ServerUse::TypeDescription, &name, type_name)?;
        Ok(())
    }

    fn action_servers(&mut self, ports: &[ActionPort]) -> anyhow::Result<Vec<ActionEnd>> {
        let mut actions = Vec::with_capacity(ports.len());
        for (place, port) in ports.iter().enumerate() {
            let name = self.names.resolve(&port.action)?;
            let first_server = self.servers.len();
            for (service, suffix) in GOAL_SERVICES {
                let type_name = goal_service_type(service, port.type_name);
                let service_name = format!("{name}/_action/{suffix}");
                self.server(ServerUse::Action(place, service), &service_name, &type_name)?;
            }
            let feedback = self.participant.writer(
                &format!("{name}/_action/feedback"),
                &names::dds_type(&format!("{}_FeedbackMessage", port.type_name)),
                FEEDBACK_QOS,
            )?;
            let status = self.participant.writer(
                &format!("{name}/_action/status"),
                &names::dds_type("action_msgs/msg/GoalStatusArray"),
                STATUS_QOS,
            )?;
            let server = ActionServer::default();
            actions.push(ActionEnd {
                name,
                server,
                first_server,
                feedback,
                status,
            });
        }
        Ok(actions)
    }

    fn action_clients(&mut self, ports: &[ActionPort]) -> anyhow::Result<Vec<UsedAction>> {
        let mut actions = Vec::with_capacity(ports.len());
        for (place, port) in ports.iter().enumerate() {
            let name = self.names.resolve(&port.action)?;
            let first_client = self.clients.len();
            for (service, suffix) in GOAL_SERVICES {
                let type_name = goal_service_type(service, port.type_name);
                let service_name = format!("{name}/_action/{suffix}");
                self.client(ClientUse::Action(place, service), &service_name, &type_name)?;
            }
            let topic = format!("{name}/_action/feedback");
            let feedback = self.participant.reader(
                &topic,
                &names::dds_type(&format!("{}_FeedbackMessage", port.type_name)),
                FEEDBACK_QOS,
            )?;
            self.readers.feedback(&topic, feedback, place);
            actions.push(UsedAction {
                client: ActionClient::default(),
                first_client,
            });
        }
        Ok(actions)
    }

    fn clock(&mut self) -> anyhow::Result<()> {
        let topic = self.names.resolve(topics::CLOCK.name)?;
        // ros2-client's own subscription has the type builtin_interfaces/Time, which nobody publishes.
        let type_name = names::dds_type(abbe_msgs::rosgraph_msgs::msg::Clock::TYPE_NAME);
        let reader = self
            .participant
            .reader(&topic, &type_name, topics::CLOCK.qos)?;
        self.readers.clock(&topic, reader);
        Ok(())
    }

    fn timers(
        &mut self,
        clock: &Clock,
        ports: &Ports,
        queue: mpsc::Sender<Incoming>,
    ) -> anyhow::Result<Timers> {
        if clock.is_simulated() {
            self.clock()?;
            return Ok(Timers::Simulated(SimulatedTimers::new(&ports.timers)));
        }
        let timers = HostTimers::start(&ports.timers, queue).context("thread of the timers")?;
        Ok(Timers::Host(timers))
    }

    fn host_clock(&mut self) -> anyhow::Result<()> {
        let topic = self.names.resolve(topics::HOST_CLOCK.name)?;
        let type_name = names::dds_type(abbe_msgs::msg::HostClock::TYPE_NAME);
        let qos = topics::HOST_CLOCK.qos;
        let reader = self.participant.reader(&topic, &type_name, qos)?;
        self.readers.host_clock(&topic, reader);
        Ok(())
    }

    /// What the node's lines go out by, where they are wanted on `/rosout`.
    fn rosout(&mut self, setup: &Setup) -> anyhow::Result<Option<Arc<Writer>>> {
        let is_wanted = setup.log_outputs().rosout;
        let writer = is_wanted.then(|| self.standard(&topics::ROSOUT));
        Ok(writer.transpose()?.map(Arc::new))
    }
}

fn goal_service_type(service: GoalService, action_type: &str) -> String {
    match service {
        GoalService::SendGoal => format!("{action_type}_SendGoal"),
        GoalService::CancelGoal => "action_msgs/srv/CancelGoal".to_owned(),
        GoalService::GetResult => format!("{action_type}_GetResult"),
    }
}

/// Gives a node its endpoints and an owner that drives it.
#[expect(
    clippy::too_many_lines,
    reason = "a table of cases, read from top to bottom"
)]
pub(super) fn assemble(
    setup: &Setup,
    node: Box<dyn Node>,
    participant: Participant,
) -> anyhow::Result<Owner> {
    let ports = node.ports().clone();
    let (sender, queue) = mpsc::channel(NODE_QUEUE_LEN);
    let mut assembly = Assembly {
        names: setup.names().clone(),
        participant,
        readers: Readers::new(sender.clone()),
        servers: Vec::new(),
        clients: Vec::new(),
    };
    let publications = assembly.publications(&ports)?;
    let diagnostics = assembly.standard(&topics::DIAGNOSTICS)?;
    let rosout = assembly.rosout(setup)?;
    let parameter_events = assembly.standard(&topics::PARAMETER_EVENTS)?;
    assembly.services(&ports)?;
    let actions = assembly.action_servers(&ports.action_servers)?;
    let used_actions = assembly.action_clients(&ports.action_clients)?;
    let subscriptions = assembly.subscriptions(&ports)?;
    let clock = Clock::new(setup.use_sim_time(), setup.host_time());
    let timers = assembly.timers(&clock, &ports, sender)?;
    let relation = related::Related::of(setup, &clock, node.keeps_own_time());
    let host_clock = relation.listens().then(|| assembly.host_clock());
    host_clock.transpose()?;
    assembly.participant.announce()?;
    let name = setup.names().fully_qualified();
    Ok(Owner {
        log_level: setup.log_level(),
        is_on_console: setup.log_outputs().stdout,
        board: Board::new(&name),
        refusals: Refusals::default(),
        name,
        parameters: with_runtime_parameters(node.parameters(), setup),
        patience: patience(node.as_ref()),
        node,
        participant: assembly.participant,
        readers: assembly.readers,
        queue,
        clock,
        relation,
        timers,
        subscriptions,
        publications,
        servers: assembly.servers,
        clients: assembly.clients,
        actions,
        used_actions,
        diagnostics,
        rosout,
        parameter_events,
        emissions: Vec::new(),
        event_time: EventTime::new(),
        next_request: 0,
        requests: std::collections::BTreeMap::new(),
        hearing: Hearing::default(),
        stopping_since: None,
        stopped: false,
        forced: false,
        has_told_parameters: false,
        next_second: Instant::now(),
        next_service: Instant::now(),
        last_publication: None,
    })
}

/// How long the node may take to wind down.
fn patience(node: &dyn Node) -> Duration {
    Duration::from_secs_f64(node.patience().as_secs_f64().max(0.0))
}

/// Every node has those of the runtime, whether or not it took its parameters from [`Setup`].
fn with_runtime_parameters(parameters: &[Parameter], setup: &Setup) -> Vec<Parameter> {
    let mut all = parameters.to_vec();
    for own in setup.runtime_parameters() {
        if !all.iter().any(|parameter| parameter.name == own.name) {
            all.push(own);
        }
    }
    all.sort_by(|a, b| a.name.cmp(&b.name));
    all
}
