//! Our parameter services, asked by ros2-client's own service client.

use std::sync::mpsc::channel;
use std::time::Duration;

use abbe_msgs::rcl_interfaces::msg::{Log, ParameterEvent};
use abbe_msgs::{from_cdr, topics};
use node_runtime::node::Ports;
use node_runtime::parameter::{Parameter, Value};
use node_runtime::{Event, launch};
use ros2_client::rcl_interfaces::{
    DescribeParametersRequest, DescribeParametersResponse, GetParametersRequest,
    GetParametersResponse, ListParametersRequest, ListParametersResponse, SetParametersRequest,
    SetParametersResponse,
};
use ros2_client::{
    Context, Message, Name, NodeName, NodeOptions, ParameterValue, QosProfile, ServiceMapping,
    ServiceTypeName,
};
use rustdds::DomainParticipantBuilder;

use super::puppet::{Puppet, environment, on_dds, start, topic, wait};

fn puppet() -> Puppet {
    let parameter = |name: &str, value, range| Parameter {
        name: name.to_owned(),
        value,
        description: "How often. [Hz]".to_owned(),
        range,
    };
    let mut puppet = Puppet::new("probe", Ports::default(), |_, _, _| Ok(()));
    puppet.parameters = vec![
        parameter("machine.name", Value::String("small".to_owned()), None),
        parameter("rate_hz", Value::Double(10.0), Some((1.0, 100.0))),
    ];
    puppet
}

/// Asks a service of the node through ros2-client, in the mapping of Fast DDS.
pub struct Asker {
    pub node: ros2_client::Node,
    _context: Context,
}

impl Asker {
    pub fn new(domain_id: u16) -> Self {
        let participant = DomainParticipantBuilder::new(domain_id)
            .with_only_networks([std::net::Ipv4Addr::LOCALHOST])
            .build()
            .unwrap();
        let context = Context::from_domain_participant(participant).unwrap();
        let name = NodeName::new("/", "asker").unwrap();
        let node = context
            .new_node(name, NodeOptions::new().start_parameter_services(false))
            .unwrap();
        Self {
            node,
            _context: context,
        }
    }

    fn ask<Req, Resp>(&mut self, service: &str, type_name: &str, request: Req) -> Resp
    where
        Req: Message + Clone + 'static,
        Resp: Message + 'static,
    {
        let qos = QosProfile::publisher_default();
        let client = self
            .node
            .create_client::<Req, Resp>(
                ServiceMapping::Enhanced,
                &Name::new("/probe", service).unwrap(),
                &ServiceTypeName::new("rcl_interfaces", type_name),
                qos.clone(),
                qos,
            )
            .unwrap();
        // Until both have met, on a busy computer as well: a request before that is lost.
        std::thread::sleep(Duration::from_millis(1_500));
        let call = async { client.async_call_service(request).await };
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .unwrap();
        runtime
            .block_on(async { tokio::time::timeout(Duration::from_secs(5), call).await })
            .expect("an answer within 5 s")
            .unwrap()
    }
}

#[test]
fn ros2_param_can_list_get_and_describe_but_not_set() {
    let environment = on_dds(6);
    let running = start(&environment, puppet());
    let mut asker = Asker::new(environment.domain_id);
    let everything = ListParametersRequest {
        prefixes: Vec::new(),
        depth: 0,
    };
    let listed: ListParametersResponse = asker.ask("list_parameters", "ListParameters", everything);
    assert_eq!(
        listed.result.names,
        ["machine.name", "rate_hz", "use_sim_time"]
    );

    let names = vec!["rate_hz".to_owned(), "unknown".to_owned()];
    let got: GetParametersResponse = asker.ask(
        "get_parameters",
        "GetParameters",
        GetParametersRequest { names },
    );
    let values: Vec<ParameterValue> = got.values.into_iter().map(Into::into).collect();
    assert_eq!(
        values,
        [ParameterValue::Double(10.0), ParameterValue::NotSet]
    );

    let set = |name: &str, value| {
        let name = name.to_owned();
        ros2_client::Parameter { name, value }.into()
    };
    let parameter = vec![
        set("rate_hz", ParameterValue::Double(20.0)),
        set("rate_hz", ParameterValue::Integer(20)),
        set("rat_hz", ParameterValue::Double(20.0)),
    ];
    let refused: SetParametersResponse = asker.ask(
        "set_parameters",
        "SetParameters",
        SetParametersRequest { parameter },
    );
    let reasons: Vec<_> = refused
        .results
        .iter()
        .map(|r| (r.successful, r.reason.as_str()))
        .collect();
    assert_eq!(
        reasons,
        [
            (
                false,
                "parameters are frozen after start: restart the node with the new value"
            ),
            (false, "parameter `rate_hz` is a double, not an integer"),
            (false, "parameter `rat_hz` is unknown"),
        ]
    );

    let names = vec!["rate_hz".to_owned()];
    let described: DescribeParametersResponse = asker.ask(
        "describe_parameters",
        "DescribeParameters",
        DescribeParametersRequest { names },
    );
    let text = format!("{described:?}");
    assert!(
        text.contains("How often. [Hz]") && text.contains("100.0"),
        "{text}"
    );
    drop(asker);
    running.stop().unwrap();
}

#[test]
fn a_reply_that_is_longer_than_a_datagram_arrives() {
    const LONGEST_DATAGRAM: usize = 65_507;
    let environment = on_dds(19);
    let mut puppet = puppet();
    let description = "How often. ".repeat(LONGEST_DATAGRAM / 10);
    puppet.parameters[1].description = description.clone();
    let running = start(&environment, puppet);
    let mut asker = Asker::new(environment.domain_id);
    let names = vec!["rate_hz".to_owned()];
    let described: DescribeParametersResponse = asker.ask(
        "describe_parameters",
        "DescribeParameters",
        DescribeParametersRequest { names },
    );
    assert!(format!("{described:?}").contains(&description));
    drop(asker);
    running.stop().unwrap();
}

#[test]
fn the_start_is_on_parameter_events_and_the_log_on_rosout() {
    let environment = environment(7);
    let (sender, received) = channel();
    let ports = Ports {
        subscriptions: vec![
            topic::<ParameterEvent>(topics::PARAMETER_EVENTS.name, topics::PARAMETER_EVENTS.qos),
            topic::<Log>(topics::ROSOUT.name, topics::ROSOUT.qos),
        ],
        ..Ports::default()
    };
    let watch = Puppet::new("watch", ports, move |_, event, _| {
        if let Event::Message {
            subscription,
            bytes,
        } = event
        {
            let _ = sender.send((subscription, bytes.to_vec()));
        }
        Ok(())
    });
    let watching = start(&environment, watch);
    let running = start(&environment, puppet());
    let (mut event, mut line) = (None, None);
    wait(
        &received,
        "parameters and log of /probe",
        |(subscription, bytes)| {
            if subscription == 0 {
                let told: ParameterEvent = from_cdr(&bytes).unwrap();
                event = event.take().or((told.node == "/probe").then_some(told));
            } else {
                let logged: Log = from_cdr(&bytes).unwrap();
                line = line.take().or((logged.name == "probe").then_some(logged));
            }
            (event.is_some() && line.is_some()).then_some(())
        },
    );
    assert_eq!(event.unwrap().new_parameters.len(), 3);
    let line = line.unwrap();
    assert_eq!(
        (line.level, line.msg.as_str()),
        (Log::INFO, "started parameters=3")
    );
    running.stop().unwrap();
    watching.stop().unwrap();
}

#[test]
fn a_second_node_of_the_same_name_is_refused() {
    let environment = environment(8);
    let running = start(&environment, puppet());
    let second = puppet();
    let setup = node_runtime::Setup::new("probe", &Default::default()).unwrap();
    let nodes: Vec<(_, Box<dyn node_runtime::Node>)> = vec![(setup.clone(), Box::new(second))];
    let error = launch(&environment, nodes)
        .err()
        .expect("the second node must not start");
    assert!(
        error.to_string().contains("/probe is already running"),
        "{error}"
    );
    let twins: Vec<(_, Box<dyn node_runtime::Node>)> = vec![
        (setup.clone(), Box::new(puppet())),
        (setup, Box::new(puppet())),
    ];
    let error = launch(&environment, twins)
        .err()
        .expect("twins must not start");
    assert!(
        error.to_string().contains("/probe is there twice"),
        "{error}"
    );
    running.stop().unwrap();
}
