//! A node made of a closure, and the network that tests run it on.

use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use metrology::Stamp;
use metrology::stamp::Host;
use node_runtime::arguments::Arguments;
use node_runtime::environment::{DiscoveryRange, Environment, Middleware};
use node_runtime::node::{Ports, ServiceEvents, ServicePort, TopicPort};
use node_runtime::parameter::Parameter;
use node_runtime::{Emission, Event, Node, NodeFault, Running, Setup, launch};

use abbe_msgs::{Message, Qos, Service};

type Handle = dyn FnMut(Stamp<Host>, Event<'_>, &mut Vec<Emission>) -> Result<(), String> + Send;

/// A node that does what its closure says and stops when asked.
pub struct Puppet {
    pub name: String,
    pub ports: Ports,
    pub parameters: Vec<Parameter>,
    pub handle: Box<Handle>,
}

impl Puppet {
    pub fn new(
        name: &str,
        ports: Ports,
        handle: impl FnMut(Stamp<Host>, Event<'_>, &mut Vec<Emission>) -> Result<(), String>
        + Send
        + 'static,
    ) -> Self {
        let handle = Box::new(handle);
        Self {
            name: name.to_owned(),
            ports,
            parameters: Vec::new(),
            handle,
        }
    }
}

impl Node for Puppet {
    fn name(&self) -> &str {
        &self.name
    }

    fn ports(&self) -> &Ports {
        &self.ports
    }

    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn handle(
        &mut self,
        at: Stamp<Host>,
        event: Event<'_>,
        out: &mut Vec<Emission>,
    ) -> Result<(), NodeFault> {
        if matches!(event, Event::Shutdown) {
            out.push(Emission::Stopped);
        }
        (self.handle)(at, event, out).map_err(|reason| NodeFault {
            node: self.name.clone(),
            port: "test".to_owned(),
            reason,
            defect: None,
        })
    }
}

/// A network of its own for one test, below those of the tests of programs. The middleware is
/// the one that `RMW_IMPLEMENTATION` names; on Zenoh the test is the router through which programs meet it.
pub fn environment(test: u16) -> Environment {
    assert!(test < 39, "a test's number is 0 to 38");
    let domain_id = 1 + test;
    let mut environment = Environment {
        middleware: Environment::read().unwrap().middleware,
        domain_id,
        range: DiscoveryRange::Localhost,
        ..Environment::default()
    };
    let listening = format!(
        "mode=\"router\";connect/endpoints=[];listen/endpoints=[\"{}\"]",
        endpoint(domain_id)
    );
    environment.zenoh.config_override = Some(listening);
    environment.zenoh.router_checks = -1;
    environment
}

/// The same on DDS, whatever is named: for tests of DDS's own mappings.
pub fn on_dds(test: u16) -> Environment {
    Environment {
        middleware: Middleware::Dds,
        ..environment(test)
    }
}

fn endpoint(domain_id: u16) -> String {
    format!("tcp/127.0.0.1:{}", 17_000 + domain_id)
}

/// Puts a program into the same network.
pub fn put_into(command: &mut std::process::Command, environment: &Environment) {
    let endpoint = endpoint(environment.domain_id);
    command
        .env("ROS_DOMAIN_ID", environment.domain_id.to_string())
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .env_remove("ROS_LOCALHOST_ONLY")
        .env(
            "ZENOH_CONFIG_OVERRIDE",
            format!("connect/endpoints=[\"{endpoint}\"]"),
        )
        .env("ZENOH_ROUTER_CHECK_ATTEMPTS", "-1");
}

pub fn start_with(environment: &Environment, puppet: Puppet, arguments: &[&str]) -> Running {
    let arguments = Arguments::parse(arguments.iter().map(|a| (*a).to_owned())).unwrap();
    let setup = Setup::new(&puppet.name, &arguments).unwrap();
    launch(environment, vec![(setup, Box::new(puppet))]).unwrap()
}

pub fn start(environment: &Environment, puppet: Puppet) -> Running {
    start_with(environment, puppet, &[])
}

pub fn topic<M: Message>(name: &str, qos: Qos) -> TopicPort {
    TopicPort {
        topic: name.to_owned(),
        type_name: M::TYPE_NAME,
        type_hash: M::TYPE_HASH,
        definition: M::DEFINITION,
        qos,
    }
}

pub fn service<V: Service>(name: &str) -> ServicePort {
    ServicePort {
        service: name.to_owned(),
        type_name: V::TYPE_NAME,
        events: ServiceEvents::of::<V>(),
    }
}

/// Waits for something of which the closure makes a value.
pub fn wait<T, U>(received: &Receiver<T>, what: &str, mut pick: impl FnMut(T) -> Option<U>) -> U {
    let deadline = Instant::now() + Duration::from_secs(10);
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        match received.recv_timeout(left) {
            Ok(item) => {
                if let Some(picked) = pick(item) {
                    return picked;
                }
            }
            Err(RecvTimeoutError::Timeout) => panic!("{what} did not come within 10 s"),
            Err(RecvTimeoutError::Disconnected) => panic!("the node ended before {what} came"),
        }
    }
}
