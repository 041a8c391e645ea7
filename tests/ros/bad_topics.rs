//! Nonsense on topics: refused with topic, field and value, and the node goes on.

use std::time::{Duration, Instant};

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::msg::{AxisState, BlockMeasurement, ThermalModel};
use abbe_msgs::{to_cdr, topics};
use abbe_tests::program::{Process, domain};
use abbe_tests::scenario::Scenario;

use abbe_tests::graph::{Graph, Voice, now, port};

fn state(controller_stamp: Time) -> AxisState {
    let mut state = AxisState::default();
    state.header.stamp = now();
    state.controller_stamp = controller_stamp;
    state.axis = ["X", "Y", "Z"].map(str::to_owned).into();
    state.commanded = vec![0.1, 0.0, 0.2];
    state.motor = vec![0.1, 0.0, 0.2];
    state.scale = vec![f64::NAN; 3];
    state.velocity = vec![0.0; 3];
    state
}

/// Sends a good state until a compensation answers: the node lives.
fn answers(graph: &Graph, voice: &mut Voice) {
    let since = Instant::now();
    graph.wait("an answer to a good state", |graph| {
        voice.say(0, &state(now()));
        std::thread::sleep(Duration::from_millis(10));
        let answers = graph.since(&topics::COMPENSATION, since);
        (!answers.is_empty()).then_some(())
    });
}

#[test]
fn nonsense_in_axis_states_is_refused_by_field_and_value_and_the_node_goes_on() {
    let (scenario, domain) = (Scenario::copy_of("first_run"), domain(3));
    let graph = Graph::join(domain);
    let file = scenario.argument("axis_compensation.yaml");
    let node = Process::node(domain, "axis_compensation", &["--params-file", &file]);
    let mut voice = graph.voice(&[port(&topics::AXES_STATE), port(&topics::THERMAL_MODEL)]);
    answers(&graph, &mut voice);
    let mut bad = state(now());
    bad.commanded[1] = f64::NAN;
    refused(&graph, &mut voice, &bad, &["commanded", "Y", "NaN"]);
    let mut bad = state(now());
    bad.motor[2] = f64::INFINITY;
    refused(&graph, &mut voice, &bad, &["motor", "Z", "inf"]);
    let mut bad = state(now());
    bad.axis[0] = "Q".to_owned();
    refused(&graph, &mut voice, &bad, &["axis", "Q"]);
    let mut bad = state(now());
    bad.velocity.pop();
    refused(&graph, &mut voice, &bad, &["velocity", "2", "3"]);
    let mut bad = state(now());
    bad.controller_stamp.nanosec = 2_000_000_000;
    refused(
        &graph,
        &mut voice,
        &bad,
        &["controller_stamp", "2000000000"],
    );
    // Cut in the middle, and a list that claims more than there is.
    let whole = to_cdr(&state(now()));
    let mut long = whole.to_vec();
    long[28..32].copy_from_slice(&u32::MAX.to_le_bytes());
    for bytes in [&whole[..whole.len() / 2], &whole[..6], &long] {
        let since = Instant::now();
        voice.bytes(0, bytes);
        graph.condition("axis_compensation", "input_refused", &["axes/state"], since);
        answers(&graph, &mut voice);
    }
    // Time that goes back is answered, and said.
    let since = Instant::now();
    let mut past = now();
    past.sec -= 100;
    voice.say(0, &state(past));
    let words = ["went back by", "9"];
    graph.condition("axis_compensation", "controller_clock", &words, since);
    answers(&graph, &mut voice);
    voice.stop();
    node.stop();
}

fn refused(graph: &Graph, voice: &mut Voice, bad: &AxisState, words: &[&str]) {
    let since = Instant::now();
    voice.say(0, bad);
    let refusal = graph.condition("axis_compensation", "input_refused", words, since);
    let port = refusal.values.iter().find(|value| value.key == "port");
    assert_eq!(port.unwrap().value, topics::AXES_STATE.name, "{refusal:?}");
    answers(graph, voice);
}

#[test]
fn nonsense_in_block_measurements_is_refused_and_good_ones_make_a_model() {
    let (scenario, domain) = (Scenario::copy_of("first_run"), domain(4));
    let graph = Graph::join(domain);
    let file = scenario.argument("thermal_model.yaml");
    let node = Process::node(domain, "thermal_model", &["--params-file", &file]);
    graph.alive("thermal_model", Instant::now());
    let mut voice = graph.voice(&[port(&topics::BLOCKS_MEASUREMENT)]);
    std::thread::sleep(Duration::from_secs(1));
    let since = Instant::now();
    let mut bad = block("block_1", [-0.22, -0.18, 0.02]);
    bad.position_m[0] = f64::INFINITY;
    voice.say(0, &bad);
    let words = ["position_m", "X", "inf"];
    graph.condition("thermal_model", "input_refused", &words, since);
    let since = Instant::now();
    let mut bad = block("block_1", [-0.22, -0.18, 0.02]);
    bad.standard_uncertainty_m[2] = f64::NAN;
    voice.say(0, &bad);
    let words = ["standard_uncertainty_m", "Z", "NaN"];
    graph.condition("thermal_model", "input_refused", &words, since);
    let since = Instant::now();
    voice.say(0, &block("block_9", [0.0; 3]));
    graph.condition("thermal_model", "", &["block_9"], since);
    voice.say(0, &block("block_1", [-0.22, -0.18, 0.02]));
    voice.say(0, &block("block_2", [0.22, 0.18, 0.2]));
    let model: ThermalModel = graph.next(&topics::THERMAL_MODEL, since, |_| true);
    assert_eq!((model.n_blocks, model.axes.len()), (2, 3));
    assert!(
        model
            .axes
            .iter()
            .all(|axis| axis.k0_m.abs() < 1e-12 && axis.slope.abs() < 1e-12)
    );
    voice.stop();
    node.stop();
}

fn block(id: &str, position_m: [f64; 3]) -> BlockMeasurement {
    let mut block = BlockMeasurement::default();
    block.header.stamp = now();
    block.block_id = id.to_owned();
    block.position_m = position_m;
    block.standard_uncertainty_m = [3e-7; 3];
    block.touched = [now(), now(), now()];
    block.cold = true;
    block.run = 1;
    block
}
