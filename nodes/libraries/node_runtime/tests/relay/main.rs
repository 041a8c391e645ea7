//! The smallest node: repeats the numbers of `in` on `out` with an offset added.
//!
//! With `stubborn` it does not wind down when it is told to end. It stands for every node's program in the tests of processes.

use std::process::ExitCode;

use abbe_msgs::std_msgs::msg::Int64;
use abbe_msgs::{Message, Qos, from_cdr, to_cdr};
use metrology::Stamp;
use metrology::stamp::{Host, Span};
use node_runtime::node::{Ports, TopicPort};
use node_runtime::parameter::Parameter;
use node_runtime::{Emission, Event, Node, NodeFault, Setup};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[derive(Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[derive(Default)]
struct Config {
    offset: i64,
    stubborn: bool,
}

struct Relay {
    name: String,
    offset: i64,
    stubborn: bool,
    ports: Ports,
    parameters: Vec<Parameter>,
}

fn port(topic: &str) -> TopicPort {
    TopicPort {
        topic: topic.to_owned(),
        type_name: Int64::TYPE_NAME,
        type_hash: Int64::TYPE_HASH,
        definition: Int64::DEFINITION,
        qos: Qos::RELIABLE_DEEP,
    }
}

impl Relay {
    fn build(setup: &Setup) -> anyhow::Result<Box<dyn Node>> {
        let config: Config = setup.config()?;
        let ports = Ports {
            subscriptions: vec![port("in")],
            publications: vec![port("out")],
            ..Ports::default()
        };
        let parameters = setup.resolved(&config)?;
        let name = setup.name().to_owned();
        Ok(Box::new(Self {
            name,
            offset: config.offset,
            stubborn: config.stubborn,
            ports,
            parameters,
        }))
    }
}

impl Node for Relay {
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
        Span::from_nanos(60_000_000_000)
    }

    fn handle(
        &mut self,
        _at: Stamp<Host>,
        event: Event<'_>,
        out: &mut Vec<Emission>,
    ) -> Result<(), NodeFault> {
        match event {
            Event::Message { bytes, .. } => {
                let fault = |error: abbe_msgs::WireError| NodeFault {
                    node: self.name.clone(),
                    port: "in".to_owned(),
                    reason: error.to_string(),
                    defect: Some(error.defect()),
                };
                let Int64 { data } = from_cdr(bytes).map_err(fault)?;
                let data = data.wrapping_add(self.offset);
                let bytes = to_cdr(&Int64 { data }).into();
                out.push(Emission::Publish {
                    publication: 0,
                    bytes,
                });
            }
            Event::Shutdown if !self.stubborn => out.push(Emission::Stopped),
            _ => {}
        }
        Ok(())
    }
}

fn main() -> ExitCode {
    node_runtime::run("relay", Relay::build)
}
