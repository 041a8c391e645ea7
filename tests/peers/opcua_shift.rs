//! A simulated shift behind OPC UA: fake_cnc works off parts of a real shift (`launch_configs/real_shift`); its positions,
//! feed and temperatures and the log's spindle, load and execution stand in a server of PyPI `asyncua`, with a fault of the
//! coolant; `opcua_bridge` hears them in simulated time, the recorder keeps them beside the probe's touches, and
//! `abbe diagnose` names the cause.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use abbe_msgs::diagnostic_msgs::msg::DiagnosticArray;
use abbe_msgs::rosgraph_msgs::msg::Clock;
use abbe_msgs::sensor_msgs::msg::Temperature;
use abbe_msgs::{from_cdr, msg, topics};
use abbe_tests::graph::{Graph, Voice, port};
use abbe_tests::hosts::bag::{bytes, messages, numbers};
use abbe_tests::program::{Process, command, domain};
use abbe_tests::python::interpreter;
use abbe_tests::scenario::Scenario;
use metrology::Axis;
use metrology::stamp::Stamp;
use recorder::{Bag, Event, Order};
use serde_json::{Value, json};

use crate::opcua_machine::{Server, diagnosed, is_built, latency_ms, mapped, nanos};

/// Half an hour of the shift, in which the spindle turns.
const PLAN: &str = "title: half an hour of a real shift
steps:
  - {do: latency, feature: block_1.z, feeds_mm_min: [60.0, 120.0, 240.0, 480.0, 960.0], repeats: 6}
  - {do: blocks, cold: true}
  - {do: compensation, enable: false}
  - {do: produce, program: shift_09.ngc, minutes: 1.0, serve_updates: true}
  - {do: produce, program: shift_11.ngc, minutes: 1.0, serve_updates: true}
  - {do: latency, feature: block_1.z, feeds_mm_min: [60.0, 120.0, 240.0, 480.0, 960.0], repeats: 6}
";
/// What the plant's probe has, ms: `launch_configs/first_run/plant.yaml`.
const LATENCY_MS: f64 = 3.7;
const MACHINE_FILE: &str = "launch_configs/real_shift/machine.yaml";
/// Between two instants of the simulated clock, in time of the computer, and of the shift: fifty times as fast in production,
/// and ten times in tests, where a state must come before its test has ended.
const BEAT: Duration = Duration::from_millis(20);
const STEP_NANOS: i64 = 1_000_000_000;
const STEP_IN_TESTS_NANOS: i64 = 200_000_000;
/// Before a test begins or ends so much time goes by in small steps: what the server had is heard by then, as from a control in
/// real time.
const APPROACH_NANOS: i64 = 400_000_000;
const STEP_TO_TEST_NANOS: i64 = 40_000_000;
/// A state that the server is given is at least so much later than the one before, ns.
const STATE_NANOS: i64 = 20_000_000;
/// The fault of the coolant begins and ends so long after the begin, ns.
const FAULT_NANOS: [i64; 2] = [600_000_000_000, 1_200_000_000_000];
/// Until all have met.
const LEAD_BEATS: i64 = 400;
const SENSORS: [&str; 7] = [
    "spindle_front",
    "column",
    "bed",
    "nut_x",
    "nut_y",
    "nut_z",
    "ambient",
];
const AXES: [(&str, f64, &str); 5] = [
    ("X", 1e3, "MILLIMETER"),
    ("Y", 1e3, "MILLIMETER"),
    ("Z", 1e3, "MILLIMETER"),
    ("A", 180.0 / std::f64::consts::PI, "DEGREE"),
    ("C", 180.0 / std::f64::consts::PI, "DEGREE"),
];
/// Node, its use in the mapping, and how many of its unit are one of the wire's.
const NUMBERS: [(&str, &str, f64); 3] = [
    ("feed", "is: feed, name: feed, unit: MILLIMETER/MINUTE", 6e4),
    (
        "speed",
        "is: spindle_speed, name: spindle_speed, unit: REVOLUTION/MINUTE",
        30.0 / std::f64::consts::PI,
    ),
    ("load", "is: load, name: spindle_load, unit: PERCENT", 100.0),
];
/// Topics of the scenario's log with the node that has their values.
const LOGGED: [(&str, &str); 3] = [
    ("machine/log_spindle_speed", "speed"),
    ("machine/log_spindle_load", "load"),
    ("machine/log_execution", "execution"),
];

fn map() -> String {
    let mut map = "values:\n".to_owned();
    for (axis, _, unit) in AXES {
        for (node, is) in [("act", "position"), ("cmd", "commanded_position")] {
            let is = format!("is: {is}, axis: {axis}, unit: {unit}");
            map.push_str(&mapped(&format!("{axis}{node}"), &is));
        }
    }
    for sensor in SENSORS {
        let is = format!("is: temperature, name: {sensor}, unit: CELSIUS");
        map.push_str(&mapped(sensor, &is));
    }
    for (node, is, _) in NUMBERS {
        map.push_str(&mapped(node, is));
    }
    map.push_str(&mapped("execution", "is: execution, name: execution"));
    map.push_str(&mapped("coolant", "is: condition, name: coolant"));
    map
}

/// What the nodes have before the shift.
fn before() -> BTreeMap<String, Value> {
    let mut values = BTreeMap::new();
    for (axis, ..) in AXES {
        values.insert(format!("{axis}act"), json!(0.0));
        values.insert(format!("{axis}cmd"), json!(0.0));
    }
    for sensor in SENSORS {
        values.insert(sensor.to_owned(), json!(20.0));
    }
    for (node, ..) in NUMBERS {
        values.insert(node.to_owned(), json!(0.0));
    }
    values.insert("execution".to_owned(), json!("READY"));
    values.insert("coolant".to_owned(), json!(false));
    values
}

/// Places of the voice's topics.
const TOUCH: usize = 1;
const SEGMENT: usize = 2;

/// What happens at an instant of the shift.
enum Moment {
    /// A node has another value: node, value, stamp in ns.
    Rows(Vec<Value>),
    /// A message of the probe or of the session, by the voice's place.
    Said(usize, Vec<u8>),
}

/// The shift in the order of its time, ns since 1970, and each value of each node that the server is given.
struct Shift {
    moments: Vec<(i64, Moment)>,
    values: BTreeMap<String, Vec<Value>>,
}

/// Takes a shift apart: a node is written when its value is another one.
struct Parts {
    shift: Shift,
    /// What each node has.
    stands: BTreeMap<String, Value>,
    last_state: i64,
}

impl Parts {
    fn push(&mut self, at: i64, rows: Vec<(String, Value)>) {
        let mut changed = Vec::new();
        for (node, value) in rows {
            let stands = self.stands.insert(node.clone(), value.clone());
            if stands.as_ref() != Some(&value) {
                let given = self.shift.values.entry(node.clone()).or_default();
                given.push(value.clone());
                changed.push(json!([node, value, at]));
            }
        }
        self.shift.moments.push((at, Moment::Rows(changed)));
    }

    fn state(&mut self, state: &msg::AxisState) {
        let at = nanos(&state.controller_stamp);
        if at < self.last_state + STATE_NANOS {
            return;
        }
        self.last_state = at;
        let mut rows = Vec::new();
        for (place, (axis, factor, _)) in AXES.into_iter().enumerate() {
            let (act, cmd) = (state.motor[place], state.commanded[place]);
            rows.push((format!("{axis}act"), json!(act * factor)));
            rows.push((format!("{axis}cmd"), json!(cmd * factor)));
        }
        let squares = state.velocity.iter().take(3).map(|one| one * one);
        let feed_mm_min = (squares.sum::<f64>().sqrt() * 6e4).round();
        rows.push(("feed".to_owned(), json!(feed_mm_min)));
        self.push(at, rows);
    }

    fn logged(&mut self, node: &str, at: i64, value: &msg::MachineValue) {
        if value.verdict != msg::MachineValue::VERDICT_GOOD {
            return;
        }
        let factor = NUMBERS.iter().find(|(name, ..)| *name == node);
        let value = match factor {
            Some((_, _, factor)) => json!((value.value * factor).round()),
            None => json!(value.text),
        };
        self.push(at, vec![(node.to_owned(), value)]);
    }

    fn coolant(&mut self, begin: i64) {
        for (after, is_low) in FAULT_NANOS.into_iter().zip([true, false]) {
            let row = ("coolant".to_owned(), json!(is_low));
            self.push(begin + after, vec![row]);
        }
    }
}

/// The shift of a bag, without what is decided by other nodes.
fn shift(path: &Path) -> Shift {
    let bag = Bag::open(path).unwrap();
    let mut parts = Parts {
        shift: Shift {
            moments: Vec::new(),
            values: BTreeMap::new(),
        },
        stands: before(),
        last_state: i64::MIN / 2,
    };
    let mut events = bag.messages(Order::LogTime);
    while let Some(event) = events.next_event() {
        let Event::Message(message) = event else {
            panic!("{event:?}");
        };
        let at = i64::try_from(message.log_time_nanos).unwrap();
        let name = bag.topic(message.topic).topic.trim_start_matches('/');
        let said = |place| (at, Moment::Said(place, message.data.to_vec()));
        if name == topics::AXES_STATE.name {
            parts.state(&from_cdr(message.data).unwrap());
        } else if name == topics::PROBE_TRIGGER.name {
            parts.shift.moments.push(said(TOUCH));
        } else if name == topics::TEST_SEGMENT.name {
            parts.shift.moments.push(said(SEGMENT));
        } else if let Some(sensor) = name.strip_prefix("temperature/") {
            if SENSORS.contains(&sensor) {
                let sample: Temperature = from_cdr(message.data).unwrap();
                let row = (sensor.to_owned(), json!(sample.temperature));
                parts.push(at, vec![row]);
            }
        } else if let Some((_, node)) = LOGGED.iter().find(|(topic, _)| *topic == name) {
            parts.logged(node, at, &from_cdr(message.data).unwrap());
        }
    }
    parts.coolant(parts.shift.moments[0].0);
    parts.shift.moments.sort_by_key(|(at, _)| *at);
    parts.shift
}

/// Lets the simulated time go on.
struct Beats {
    voice: Voice,
    now: i64,
    step_nanos: i64,
    due: Instant,
}

impl Beats {
    fn next(&mut self) {
        self.until(i64::MAX, false);
    }

    /// The next beat, at most to the instant of a message, such as the begin of a test.
    fn until(&mut self, latest: i64, is_segment: bool) {
        let left_nanos = latest.saturating_sub(self.now);
        let step_nanos = match is_segment {
            true if left_nanos <= APPROACH_NANOS => STEP_TO_TEST_NANOS,
            true => self.step_nanos.min(left_nanos - APPROACH_NANOS),
            false => self.step_nanos,
        };
        let left = self.due.saturating_duration_since(Instant::now());
        std::thread::sleep(left);
        self.due = Instant::now().max(self.due) + BEAT;
        self.now = latest.min(self.now + step_nanos);
        let clock = abbe_msgs::time(Stamp::<metrology::stamp::Host>::from_nanos(self.now));
        self.voice.say(0, &Clock { clock });
    }

    /// Says something, and lets no time pass until everybody has it.
    fn say(&mut self, place: usize, bytes: &[u8]) {
        self.voice.bytes(place, bytes);
        self.voice.settle();
        std::thread::sleep(BEAT);
    }
}

/// How the simulated time goes on after a segment has begun or ended.
fn step_nanos(segment: &[u8]) -> i64 {
    let segment: msg::TestSegment = from_cdr(segment).unwrap();
    let is_production = segment.kind == msg::TestSegment::KIND_PRODUCTION;
    if segment.begin && is_production {
        STEP_NANOS
    } else {
        STEP_IN_TESTS_NANOS
    }
}

/// Plays a shift: nodes of the server and the probe's messages, each as its time comes.
fn play(shift: Shift, server: &mut Server, beats: &mut Beats) {
    let said = shift
        .moments
        .iter()
        .filter_map(|(at, moment)| match moment {
            Moment::Said(place, _) => Some((*at, *place == SEGMENT)),
            Moment::Rows(_) => None,
        });
    let mut said: VecDeque<(i64, bool)> = said.collect();
    let mut moments = shift.moments.into_iter().peekable();
    while moments.peek().is_some() {
        let (latest, is_segment) = said.front().copied().unwrap_or((i64::MAX, false));
        beats.until(latest, is_segment);
        let mut rows = Vec::new();
        while let Some((_, moment)) = moments.next_if(|(at, _)| *at <= beats.now) {
            match moment {
                Moment::Rows(more) => rows.extend(more),
                Moment::Said(place, bytes) => {
                    said.pop_front();
                    server.write(&std::mem::take(&mut rows));
                    beats.say(place, &bytes);
                    if place == SEGMENT {
                        beats.step_nanos = step_nanos(&bytes);
                    }
                }
            }
        }
        server.write(&rows);
    }
}

/// Every value of a node in a bag, in the unit of the mapping, without what it had before the shift.
fn heard(bag: &Path, topic: &str, node: &str, factor: f64) -> Vec<Value> {
    let mut found = all_heard(bag, topic, factor);
    // Who meets the bridge early has heard it.
    if found.first() == before().get(node) {
        found.remove(0);
    }
    found
}

fn all_heard(bag: &Path, topic: &str, factor: f64) -> Vec<Value> {
    let value = |bytes: Vec<u8>| {
        if topic.starts_with("temperature/") {
            return json!(from_cdr::<Temperature>(&bytes).unwrap().temperature);
        }
        let value: msg::MachineValue = from_cdr(&bytes).unwrap();
        assert_eq!(value.verdict, msg::MachineValue::VERDICT_GOOD, "{value:?}");
        if value.value.is_nan() {
            json!(value.text)
        } else {
            json!((value.value * factor).round())
        }
    };
    bytes(bag, topic).into_iter().map(value).collect()
}

/// How the level of the coolant's condition changed.
fn levels_of_the_coolant(bag: &Path) -> Vec<u8> {
    let name = "/opcua_bridge: alarm/coolant";
    let mut levels: Vec<u8> = Vec::new();
    for message in bytes(bag, topics::DIAGNOSTICS.name) {
        let message: DiagnosticArray = from_cdr(&message).unwrap();
        let statuses = message.status.into_iter();
        levels.extend(statuses.filter(|one| one.name == name).map(|one| one.level));
    }
    levels.dedup();
    levels
}

/// That the bag has each value of each node that the server was given, once and in order.
fn is_whole(bag: &Path, given: &BTreeMap<String, Vec<Value>>) {
    let numbers = NUMBERS.map(|(node, _, factor)| (node, factor));
    let sensors = SENSORS.map(|sensor| (sensor, 1.0));
    let all = numbers.into_iter().chain(sensors);
    for (node, factor) in all.chain([("execution", 1.0)]) {
        let topic = match node {
            "speed" => "machine/spindle_speed".to_owned(),
            "load" => "machine/spindle_load".to_owned(),
            "feed" | "execution" => format!("machine/{node}"),
            sensor => format!("temperature/{sensor}"),
        };
        let (heard, given) = (heard(bag, &topic, node, factor), &given[node]);
        let same = heard.iter().zip(given).take_while(|(a, b)| a == b).count();
        eprintln!("{topic}: {} values", heard.len());
        assert!(
            same == given.len() && same == heard.len(),
            "{topic}: {} values of {} were heard, the first {same} as given; then {:?} for {:?}",
            heard.len(),
            given.len(),
            heard.get(same),
            given.get(same)
        );
    }
}

/// That the bag has each position, touch and begin or end of a test that was given.
fn has_the_motion(bag: &Path, simulated: &Path, given: &BTreeMap<String, Vec<Value>>) {
    for topic in [topics::PROBE_TRIGGER.name, topics::TEST_SEGMENT.name] {
        let [all, heard] = [simulated, bag].map(|bag| numbers(bag, topic).len());
        assert_eq!(all, heard, "{topic}");
    }
    let states = messages(bag, &topics::AXES_STATE);
    for axis in [Axis::X, Axis::Y, Axis::Z] {
        let mut heard: Vec<f64> = states.iter().map(|(_, state)| state.motor[axis]).collect();
        heard.dedup();
        let given = &given[&format!("{}act", axis.letter())];
        let given: Vec<f64> = given.iter().map(|value| value.as_f64().unwrap()).collect();
        // What held before the shift may be in the bag too.
        let begin = heard.len().saturating_sub(given.len());
        let far = heard[begin..]
            .iter()
            .zip(&given)
            .filter(|(a, b)| (**a - **b).abs() > 1e-9);
        assert!(
            begin <= 1 && heard.len() >= given.len(),
            "{axis:?}: {} of {}",
            heard.len(),
            given.len()
        );
        assert_eq!(far.count(), 0, "{axis:?}");
        eprintln!("{axis:?}: {} positions", given.len());
    }
}

/// Plays the shift of `simulated` to a cell of bridge and recorder; each value that the server was given.
fn recorded(simulated: &Path, python: &PathBuf, into: &Path) -> BTreeMap<String, Vec<Value>> {
    let (home, domain) = (tempfile::tempdir().unwrap(), domain(5));
    let shift = shift(simulated);
    let given = shift.values.clone();
    let begin = shift.moments[0].0;
    let lead = LEAD_BEATS * STEP_NANOS;
    let values = before();
    let mut server = Server::start(python, &json!(values));
    let rows = values.iter();
    let rows: Vec<_> = rows
        .map(|(node, value)| json!([node, value, begin - lead]))
        .collect();
    server.write(&rows);
    let file = server.parameters(home.path(), &map(), 10_000);
    let graph = Graph::join(domain);
    let began = Instant::now();
    let mut record = command(domain, &["record", "--use-sim-time", "-o"]);
    // Fifty times as fast, that is more than a best-effort topic holds.
    record.arg(into).args(["--exclude", "/joint_states"]);
    let recorder = Process::start(record);
    let file = file.to_string_lossy();
    let arguments = ["--params-file", &file, "-p", "use_sim_time:=true"];
    let bridge = Process::node(domain, "opcua_bridge", &arguments);
    let voices = [
        port(&topics::CLOCK),
        port(&topics::PROBE_TRIGGER),
        port(&topics::TEST_SEGMENT),
    ];
    let mut beats = Beats {
        voice: graph.voice(&voices),
        now: begin - lead,
        step_nanos: STEP_NANOS,
        due: Instant::now(),
    };
    // Timers of the nodes follow the clock, so they say something about themselves as it goes on.
    for _ in 0..LEAD_BEATS - 1 {
        beats.next();
    }
    graph.alive("opcua_bridge", began);
    play(shift, &mut server, &mut beats);
    for _ in 0..LEAD_BEATS / 2 {
        beats.next();
    }
    beats.voice.settle();
    bridge.stop();
    recorder.signal(nix::sys::signal::Signal::SIGINT);
    // What counts as lost may be a best-effort /clock: whether the rest is whole is seen in the bag.
    let code = recorder.ended_within(Duration::from_secs(60)).status.code();
    assert!(matches!(code, Some(0 | 3)), "{code:?}");
    given
}

#[test]
fn a_simulated_shift_behind_opc_ua_is_recorded_whole_and_its_cause_named() {
    let Some(python) = interpreter("a simulated shift behind OPC UA") else {
        return;
    };
    if !is_built() {
        return;
    }
    let scenario = Scenario::copy_of("real_shift");
    scenario.write("plan.yaml", PLAN);
    let simulated = scenario.run().join("bag");
    let bag = scenario.path("behind_opc_ua");
    let given = recorded(&simulated, &python, &bag);
    is_whole(&bag, &given);
    has_the_motion(&bag, &simulated, &given);
    assert_eq!(levels_of_the_coolant(&bag), [2, 0]);
    // The way through the server changes nothing of what is found.
    let [direct, behind] =
        [&simulated, &bag].map(|bag| latency_ms(&diagnosed(bag, MACHINE_FILE), LATENCY_MS));
    eprintln!("latency {behind} ms behind the server, {direct} ms beside it");
    assert!((direct - behind).abs() < 0.01, "{direct} {behind}");
}
