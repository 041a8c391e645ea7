//! Steps of a managed node, asked for as service calls, are taken again.
//!
//! No plan asks for such steps and nobody from outside can steer a run in simulated time, so this one is composed here and
//! recorded as `abbe run` records: every publication in total order, each call where it happened.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;

use abbe_msgs::{SERVICE_EVENT_SUFFIX, Wire as _, msg, to_cdr, topics};
use abbe_tests::operator::{Answers, Operator};
use abbe_tests::program::root;
use abbe_tests::scenario::Scenario;
use metrology::sample::{AxisDrift, ThermalModel};
use metrology::stamp::{Host, Span, Stamp};
use metrology::{Axis, PerAxis};
use node_runtime::arguments::Arguments;
use node_runtime::parameter::Value;
use node_runtime::{Harness, Node, Setup};
use recorder::{
    CALL_RECORD, Channel, Directory, END_RECORD, MessageOrder, MessageStamp, RecordedCall,
    RecordedRun, Recorder, RecorderConfig, RecorderSink, Recording, RunContext, RunNode, WhenFull,
};

use crate::contract::{Run, changed_of, check, count, edited};
use crate::rewrite::Change;
use crate::snapshot::resumes_at;

const START: Stamp<Host> = Stamp::from_nanos(1_767_600_000_000_000_000);
const NODE: &str = "axis_compensation";
/// What the node is asked for, and when, s; the second is refused, for it is on its way to rest. It is activated again before
/// a state reaches it, so that what it forgot shows.
const STEPS: [(f64, &str); 7] = [
    (2.0, "deactivate"),
    (2.5, "activate"),
    (6.0, "activate"),
    (9.0, "deactivate"),
    (12.5, "cleanup"),
    (13.0, "configure"),
    (13.001, "activate"),
];
/// Drift of X, mm, that a model tells at the start and after so many seconds.
const MODELS: [(f64, f64); 2] = [(0.0, 0.012), (7.5, 0.0125)];
const END_S: f64 = 15.5;
/// Where the bag is to be kept as well: a folder that is not there yet.
const KEEP: &str = "ABBE_KEEP_LIFECYCLE_BAG";

fn after(seconds: f64) -> Stamp<Host> {
    START + Span::from_secs_f64(seconds)
}

fn model(sequence: u32, at_s: f64, drift_mm: f64) -> Vec<u8> {
    let mut axes = PerAxis::default();
    axes[Axis::X] = Some(AxisDrift {
        k0_mm: drift_mm,
        span_mm: (-220.0, 220.0),
        measured_at: after(at_s),
        ..AxisDrift::default()
    });
    let model = ThermalModel {
        at: after(at_s),
        axes,
        valid_from: after(at_s),
        valid_until: after(3600.0),
        n_blocks: 1,
        lack_of_fit_p: f64::NAN,
        quarantined: false,
        sequence,
    };
    to_cdr(&msg::ThermalModel::from_inner(&model))
}

type Builder = fn(&Setup) -> anyhow::Result<Box<dyn Node>>;

fn build(scenario: &Scenario, name: &str, builder: Builder) -> Box<dyn Node> {
    let file = scenario.argument(&format!("{name}.yaml"));
    let words = ["--ros-args".to_owned(), "--params-file".to_owned(), file];
    let setup = Setup::new(name, &Arguments::parse(words).unwrap()).unwrap();
    builder(&setup).unwrap()
}

/// Resolved parameters as a bag has them.
fn parameters(node: &dyn Node) -> String {
    let flat: BTreeMap<&str, serde_json::Value> = node
        .parameters()
        .iter()
        .map(|parameter| {
            let value = match &parameter.value {
                Value::Bool(value) => (*value).into(),
                Value::Integer(value) => (*value).into(),
                Value::Double(value) => (*value).into(),
                Value::String(value) => value.as_str().into(),
                // An empty list has no type of its own.
                Value::StringArray(values) if values.is_empty() => serde_json::json!([]),
                other => panic!("{}: {other:?}", parameter.name),
            };
            (parameter.name.as_str(), value)
        })
        .collect();
    serde_saphyr::to_string(&flat).unwrap()
}

/// The begin of the bag; `nodes` are those of the run but the operator, whom no replay needs.
fn begin(bag: &Path, scenario: &Scenario, nodes: &[&dyn Node]) -> Recorder {
    let config = RecorderConfig {
        flush_period_s: 60.0,
        when_full: WhenFull::Wait,
        ..RecorderConfig::default()
    };
    let mut head = Command::new("git");
    head.args(["rev-parse", "HEAD"]).current_dir(root());
    let head = head.output().unwrap();
    let name = |node: &&dyn Node| node.name().to_owned();
    let context = RunContext {
        start_time_nanos: u64::try_from(START.nanos()).unwrap(),
        scenario_name: "lifecycle".to_owned(),
        commit: String::from_utf8(head.stdout).unwrap().trim().to_owned(),
        machine_file: std::fs::read_to_string(scenario.path("machine.yaml")).ok(),
        parameters: nodes
            .iter()
            .map(|node| (name(node), parameters(*node)))
            .collect(),
        nodes: nodes
            .iter()
            .map(|node| RunNode {
                name: name(node),
                executable: name(node),
            })
            .collect(),
        order: MessageOrder::Total,
        ..RunContext::default()
    };
    let shelf = Directory::create(bag).unwrap();
    let mut recording = Recording::begin(shelf, "bag", config.clone()).unwrap();
    recording.add_context(&context).unwrap();
    Recorder::start(recording, &config).unwrap()
}

/// Writes every publication and each call.
fn listen(harness: &mut Harness, sink: RecorderSink) {
    let mut places = Vec::new();
    for port in harness.topics() {
        let is_call = port.topic.ends_with(SERVICE_EVENT_SUFFIX);
        let channel = Channel {
            topic: format!("/{}", port.topic.trim_start_matches('/')),
            type_name: port.type_name.to_owned(),
            type_hash: port.type_hash.to_owned(),
            definition: port.definition.to_owned(),
            qos_yaml: port.qos.offered_qos_profiles(),
        };
        let id = (!is_call).then(|| sink.add_channel(&channel).unwrap());
        places.push((port.topic.clone(), id));
    }
    let mut messages = 0;
    harness.observe(Box::new(move |published| {
        let nanos = published.at.nanos();
        let (topic, channel) = &places[published.topic];
        let Some(channel) = channel else {
            let call = RecordedCall {
                after_messages: messages,
                time_nanos: u64::try_from(nanos).unwrap(),
                topic: topic.clone(),
                event: published.bytes.to_vec(),
            };
            sink.note(CALL_RECORD, call.metadata());
            return;
        };
        messages += 1;
        let stamp = MessageStamp {
            log_time_nanos: nanos,
            publish_time_nanos: nanos,
            sequence: published.sequence,
        };
        sink.push(*channel, stamp, published.bytes);
    }));
}

/// Runs machine, operator and compensation, and records them into `bag`.
fn record(scenario: &Scenario, bag: &Path) -> Answers {
    let machine = build(scenario, "fake_cnc", fake_cnc_node::node);
    let compensation = build(scenario, NODE, axis_compensation_node::node);
    let recorder = begin(bag, scenario, &[machine.as_ref(), compensation.as_ref()]);
    let (operator, answers) = Operator::of(START, NODE, &STEPS);
    let mut harness = Harness::compose(vec![machine, operator, compensation], START).unwrap();
    listen(&mut harness, recorder.sink());
    for ((at_s, drift_mm), sequence) in MODELS.into_iter().zip(1..) {
        harness.run_until(after(at_s));
        let model = model(sequence, at_s, drift_mm);
        assert!(harness.inject(topics::THERMAL_MODEL.name, &model));
    }
    harness.run_until(after(END_S));
    let stop = (
        RecordedRun::STOP_KEY.to_owned(),
        harness.now().nanos().to_string(),
    );
    recorder.sink().note(END_RECORD, BTreeMap::from([stop]));
    assert!(harness.shutdown(Span::from_secs_f64(60.0)));
    drop(harness);
    assert_eq!(recorder.finish().unwrap().messages_lost, 0);
    answers
}

fn run() -> &'static Path {
    static RUN: OnceLock<Run> = OnceLock::new();
    let (_, bag) = RUN.get_or_init(|| {
        let scenario = Scenario::copy_of("first_run");
        scenario.replace("axis_compensation.yaml", "enabled: false", "enabled: true");
        let often = "background_rate_hz: 50.0";
        scenario.replace("fake_cnc.yaml", "background_rate_hz: 10.0", often);
        let bag = scenario.out();
        let answers = record(&scenario, &bag);
        let told: Vec<_> = answers.lock().unwrap().clone();
        eprintln!("{told:?}");
        let refused: Vec<_> = told.iter().filter(|(_, _, good)| !good).collect();
        assert_eq!((told.len(), refused.len()), (STEPS.len(), 1), "{told:?}");
        if let Some(folder) = std::env::var_os(KEEP) {
            record(&scenario, Path::new(&folder));
        }
        (scenario, bag)
    });
    bag
}

#[test]
fn replay_takes_the_steps_of_a_managed_node_again() {
    let (code, outcome) = check(run());
    assert_eq!(code, 0, "{outcome:#}");
    let messages = count(&outcome, "/compensation", "messages");
    eprintln!("/compensation: {messages} messages");
    assert!(messages > 500, "{messages}");
    resumes_at(run(), 61);
}

#[test]
fn replay_notices_each_call_of_a_managed_node_that_is_missing() {
    for (nth, (at_s, step)) in STEPS.into_iter().enumerate() {
        let changed = changed_of(
            run(),
            &Change {
                without_call: Some(nth),
                ..Change::default()
            },
        );
        let (code, outcome) = check(changed.path());
        eprintln!("{step} at {at_s} s: {}", outcome["first_difference"]);
        // The one that was refused changed nothing.
        assert_eq!(code, i32::from(nth != 1), "{step} at {at_s} s: {outcome:#}");
    }
}

/// The drift that a model tells of X, by one unit in the last place.
pub fn drift_by_one_ulp(data: &mut Vec<u8>) {
    edited(data, |model: &mut msg::ThermalModel| {
        model.axes[0].k0_m = model.axes[0].k0_m.next_up();
    });
}
