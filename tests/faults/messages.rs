//! Bytes and numbers that no good publisher sends, said to every node that listens: each refuses by topic, says so, and goes on.

use std::time::{Duration, Instant};

use abbe_msgs::msg::{BlockMeasurement, ProbeTrigger, TestSegment};
use abbe_msgs::sensor_msgs::msg::Temperature;
use abbe_msgs::{Message, to_cdr, topics};
use abbe_tests::graph::{Graph, Voice, now, port};
use abbe_tests::namespace;
use abbe_tests::program::{Process, domain};
use abbe_tests::scenario::Scenario;
use node_runtime::node::TopicPort;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::said::{later, state};

/// Nodes, the scenario of each, and the topic that it hears here.
const LISTENERS: [(&str, &str, &str); 8] = [
    ("probe", "short_cell", topics::AXES_STATE.name),
    ("latency_calibrator", "short_cell", topics::AXES_STATE.name),
    ("axis_compensation", "short_cell", topics::AXES_STATE.name),
    ("grid_encoder", "grid_xy", topics::AXES_STATE.name),
    ("thermal_model", "short_cell", topics::TEST_SEGMENT.name),
    ("sequencer", "short_cell", topics::PROBE_TRIGGER.name),
    ("rotary_axes", "five_axis", topics::TEST_SEGMENT.name),
    ("gap_diagnosis", "gap_wear", topics::AXES_STATE.name),
];

const STATES: usize = 0;
const SEGMENTS: usize = 1;

fn ports() -> [TopicPort; 3] {
    [
        port(&topics::AXES_STATE),
        port(&topics::TEST_SEGMENT),
        port(&topics::PROBE_TRIGGER),
    ]
}

fn good(place: usize) -> Vec<u8> {
    match place {
        STATES => to_cdr(&state(&now(), 0.1)),
        SEGMENTS => {
            let mut segment = TestSegment::default();
            segment.header.stamp = now();
            to_cdr(&segment)
        }
        _ => {
            let mut trigger = ProbeTrigger::default();
            trigger.header.stamp = now();
            to_cdr(&trigger)
        }
    }
}

/// Every listener says `condition` of its topic since `since`.
fn all_say(graph: &Graph, condition: &str, words: &[&str], since: Instant) {
    for (node, _, topic) in LISTENERS {
        let mut all = vec![topic];
        all.extend(words);
        graph.condition(node, condition, &all, since);
    }
}

fn all_live(graph: &Graph, nodes: &mut Vec<Process>) {
    let since = Instant::now();
    for place in 0..nodes.len() {
        let (node, ..) = LISTENERS[place];
        if !nodes[place].is_running() {
            let ended = nodes.remove(place).ended_within(Duration::from_secs(1));
            panic!("{node} ended: {}: {}", ended.status, ended.said);
        }
        graph.alive(node, since);
    }
}

#[test]
fn every_node_refuses_spoiled_bytes_names_a_second_publisher_and_goes_on() {
    namespace::alone("spoiled bytes to every node", || {
        let domain = domain(3);
        let graph = Graph::join(domain);
        let scenarios = LISTENERS.map(|(_, scenario, _)| Scenario::copy_of(scenario));
        let mut nodes: Vec<Process> = LISTENERS
            .iter()
            .zip(&scenarios)
            .map(|((node, ..), scenario)| {
                let file = scenario.argument(&format!("{node}.yaml"));
                Process::node(domain, node, &["--params-file", &file])
            })
            .collect();
        let (mut voice, mut other) = (graph.voice(&ports()), graph.voice(&ports()));
        all_live(&graph, &mut nodes);
        // Cut in the middle of a field; said until all who listen have met.
        let since = Instant::now();
        for (node, _, topic) in LISTENERS {
            graph.wait(&format!("{node} refuses half a message"), |graph| {
                // One topic alone: of what is refused, a node shows the last.
                let place = ports().iter().position(|port| port.topic == topic);
                let bytes = good(place.unwrap());
                voice.bytes(place.unwrap(), &bytes[..bytes.len() / 2]);
                std::thread::sleep(Duration::from_millis(200));
                graph.hears_condition(node, "input_refused", &[topic], since)
            });
        }
        flood(&mut voice);
        all_live(&graph, &mut nodes);
        // Two who speak by turns.
        let since = Instant::now();
        for _ in 0..20 {
            for place in 0..ports().len() {
                voice.bytes(place, &good(place));
                other.bytes(place, &good(place));
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        all_say(&graph, "second_publisher", &["more than one"], since);
        clock_back(&graph, &mut voice);
        all_live(&graph, &mut nodes);
        voice.stop();
        other.stop();
        nodes.into_iter().for_each(|node| drop(node.stop()));
    });
}

/// Thousands of messages with bytes turned over, shortened or doubled.
fn flood(voice: &mut Voice) {
    let mut rng = Pcg64Mcg::seed_from_u64(42);
    for _ in 0..1_000 {
        for place in 0..ports().len() {
            let mut bytes = good(place);
            for _ in 0..rng.random_range(1..6) {
                let at = rng.random_range(4..bytes.len());
                bytes[at] = rng.random();
            }
            if rng.random_bool(0.2) {
                bytes.truncate(rng.random_range(0..bytes.len()));
            }
            voice.bytes(place, &bytes);
            if rng.random_bool(0.2) {
                voice.bytes(place, &bytes);
            }
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// The controller's clock goes back: those who keep its positions say so.
fn clock_back(graph: &Graph, voice: &mut Voice) {
    let since = Instant::now();
    let start = later(&now(), 10_000_000_000);
    for (ahead_s, times) in [(0, 20), (-100, 20)] {
        for beat in 0..times {
            let at = later(&start, ahead_s * 1_000_000_000 + beat * 1_000_000);
            // Of three axes and of five, for either kind of machine.
            let mut said = state(&at, 0.1);
            voice.say(STATES, &said);
            said.axis.extend(["A", "C"].map(str::to_owned));
            for values in [&mut said.commanded, &mut said.motor, &mut said.velocity] {
                values.extend([0.0; 2]);
            }
            said.scale.extend([f64::NAN; 2]);
            voice.say(STATES, &said);
        }
    }
    graph.condition("probe", "clock_went_back", &["back"], since);
    graph.condition(
        "latency_calibrator",
        "clock_went_back",
        &["went back"],
        since,
    );
    graph.condition(
        "axis_compensation",
        "controller_clock",
        &["went back by"],
        since,
    );
    graph.condition("grid_encoder", "recording", &["went back by"], since);
}

/// Measurements of the past and the future, twice, out of order, and temperatures without sense or for too long none.
#[test]
fn the_thermal_model_refuses_stale_and_senseless_measurements_and_says_so() {
    namespace::alone("faulty blocks and temperatures", || {
        let (scenario, domain) = (Scenario::copy_of("short_cell"), domain(4));
        let text = std::fs::read_to_string(scenario.path("thermal_model.yaml")).unwrap();
        assert!(!text.contains("stale_s"));
        scenario.append("thermal_model.yaml", "    temperature: {stale_s: 2.0}\n");
        let graph = Graph::join(domain);
        let file = scenario.argument("thermal_model.yaml");
        let node = Process::node(domain, "thermal_model", &["--params-file", &file]);
        let bed = topics::TEMPERATURE.of("bed").unwrap();
        let temperature = TopicPort {
            topic: bed,
            type_name: Temperature::TYPE_NAME,
            type_hash: Temperature::TYPE_HASH,
            definition: Temperature::DEFINITION,
            qos: topics::TEMPERATURE.qos,
        };
        let mut voice = graph.voice(&[port(&topics::BLOCKS_MEASUREMENT), temperature]);
        graph.alive("thermal_model", Instant::now());
        std::thread::sleep(Duration::from_secs(1));
        let blocks = [
            ("block_1", [-0.22, -0.18, 0.02]),
            ("block_2", [0.22, 0.18, 0.2]),
        ];
        let since = Instant::now();
        for (id, position_m) in blocks {
            let measured = block(id, position_m, 0);
            voice.say(0, &measured);
            voice.say(0, &measured);
        }
        let first = graph.next(&topics::THERMAL_MODEL, since, |_| true);
        assert!(first.axes.iter().all(|axis| axis.k0_m.abs() < 1e-12));
        // What was told twice does not make a reference of one block.
        let words = ["before the last update"];
        graph.condition("thermal_model", "update", &words, since);
        std::thread::sleep(Duration::from_secs(1));
        let lost = graph.hears_condition("thermal_model", "", &["was not measured"], since);
        assert_eq!(lost, None);
        of_another_hour(&graph, &mut voice, &blocks);
        let since = Instant::now();
        voice.say(1, &warmth(20.5));
        std::thread::sleep(Duration::from_secs(4));
        graph.condition("thermal_model", "temperature_sensor", &["bed"], since);
        let since = Instant::now();
        voice.say(1, &warmth(f64::NAN));
        graph.condition("thermal_model", "", &["bed", "NaN"], since);
        voice.stop();
        node.stop();
    });
}

/// Of an hour ago and of the next: neither makes a model.
fn of_another_hour(graph: &Graph, voice: &mut Voice, blocks: &[(&str, [f64; 3])]) {
    for (age_s, word) in [
        (3_600, "before the last update"),
        (-3_600, "later than reported"),
    ] {
        let since = Instant::now();
        for (id, position_m) in blocks {
            let shifted = position_m.map(|m| m + 50e-6);
            let mut old = block(id, shifted, age_s);
            old.cold = false;
            old.run = 2;
            voice.say(0, &old);
        }
        graph.condition("thermal_model", "", &[word], since);
        let models = graph.since(&topics::THERMAL_MODEL, since);
        let moved = |k0_m: f64| k0_m.abs() > 1e-9;
        let mut axes = models.iter().flat_map(|(_, model)| &model.axes);
        assert!(!axes.any(|axis| moved(axis.k0_m)), "{models:?}");
    }
}

fn block(id: &str, position_m: [f64; 3], age_s: i64) -> BlockMeasurement {
    let at = later(&now(), -age_s * 1_000_000_000);
    let mut block = BlockMeasurement::default();
    block.header.stamp = at.clone();
    block.block_id = id.to_owned();
    block.position_m = position_m;
    block.standard_uncertainty_m = [3e-7; 3];
    block.touched = [at.clone(), at.clone(), at];
    block.cold = true;
    block.run = 1;
    block
}

fn warmth(degc: f64) -> Temperature {
    let mut message = Temperature {
        temperature: degc,
        ..Temperature::default()
    };
    message.header.stamp = now();
    message.header.frame_id = "bed".to_owned();
    message
}
