//! A cell whose machine is behind OPC UA: what fake_cnc read in a recorded session stands in a server of PyPI `asyncua`,
//! `opcua_bridge` hears it, `abbe record` keeps it beside the probe's touches, and `abbe diagnose` names the cause.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Stdio};
use std::time::{Duration, Instant};

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::sensor_msgs::msg::Temperature;
use abbe_msgs::{from_cdr, msg, to_cdr, topics};
use abbe_tests::graph::{Graph, port};
use abbe_tests::program::{Process, command, domain, root};
use abbe_tests::python::{interpreter, script};
use metrology::stamp::{Host, Span, Stamp};
use recorder::{Bag, Event, Order};
use serde_json::{Value, json};

/// A session of touches at three feeds, 36 s long.
const BAG: &str = "bags/rosbag2_touches";
/// What the plant's probe has, ms: `launch_configs/gap_first/plant.yaml` as it was when the bag was recorded.
const LATENCY_MS: f64 = 3.7;
/// Between two writings of the server.
const BEAT: Duration = Duration::from_millis(20);
/// Between two states that the server is given: what a control offers by OPC UA, rather than each of its servo periods.
const STATE_PERIOD: Span = Span::from_nanos(5_000_000);
/// The program, the server and the graph are ready after this time.
const LEAD: Span = Span::from_nanos(8_000_000_000);
const END: Duration = Duration::from_secs(120);
const AXES: [&str; 3] = ["X", "Y", "Z"];
const SENSORS: [&str; 4] = ["nut_x", "nut_y", "bed", "ambient"];

/// The server as a process.
struct Server {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Server {
    fn start(python: &std::path::PathBuf, port: u16) -> Self {
        let mut values = json!({});
        for axis in AXES {
            values[format!("{axis}act")] = json!(0.0);
            values[format!("{axis}cmd")] = json!(0.0);
        }
        for sensor in SENSORS {
            values[sensor] = json!(20.0);
        }
        let plan = json!({"port": port, "namespaces": ["urn:abbe:machine"], "values": values});
        let mut server = script(python, "opcua_server.py");
        server.arg(plan.to_string()).stderr(Stdio::null());
        server.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = server.spawn().unwrap();
        let (input, output) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        let mut server = Self {
            child,
            input,
            output: BufReader::new(output),
        };
        server.hear("ready");
        server
    }

    fn hear(&mut self, event: &str) {
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        let said: Value = serde_json::from_str(&line).unwrap_or_default();
        assert_eq!(said["event"], event, "{line}");
    }

    fn write(&mut self, rows: &[Value]) {
        writeln!(self.input, "{}", json!({"rows": rows})).unwrap();
        self.input.flush().unwrap();
        self.hear("done");
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What happens at an instant of the session.
enum Moment {
    /// Node, value in the unit of the mapping, stamp in ns.
    Rows(Vec<Value>),
    /// A message of the probe or of the session, by the voice's place.
    Said(usize, Vec<u8>),
}

fn later(time: &mut Time, by: Span) {
    let at: Stamp<Host> = abbe_msgs::instant(time).unwrap();
    *time = abbe_msgs::time(at + by);
}

fn nanos(time: &Time) -> i64 {
    let at: Stamp<Host> = abbe_msgs::instant(time).unwrap();
    at.nanos()
}

/// The session of a bag, later by a span, in the order of its recording: log time, and what happens.
fn session(bag: &Bag, by: Span) -> Vec<(i64, Moment)> {
    let mut moments = Vec::new();
    let mut next_state = i64::MIN;
    let mut messages = bag.messages(Order::LogTime);
    while let Some(event) = messages.next_event() {
        let Event::Message(message) = event else {
            panic!("{event:?}");
        };
        let name = bag.topic(message.topic).topic.trim_start_matches('/');
        let moment = if name == topics::AXES_STATE.name {
            let mut state: msg::AxisState = from_cdr(message.data).unwrap();
            later(&mut state.controller_stamp, by);
            let at = nanos(&state.controller_stamp);
            if at < next_state {
                continue;
            }
            next_state = at + STATE_PERIOD.nanos();
            let rows = state.axis.iter().enumerate().flat_map(|(place, axis)| {
                let (act, cmd) = (state.motor[place], state.commanded[place]);
                [
                    json!([format!("{axis}act"), act * 1e3, at]),
                    json!([format!("{axis}cmd"), cmd * 1e3, at]),
                ]
            });
            Moment::Rows(rows.collect())
        } else if name == topics::PROBE_TRIGGER.name {
            let mut trigger: msg::ProbeTrigger = from_cdr(message.data).unwrap();
            later(&mut trigger.header.stamp, by);
            later(&mut trigger.controller_stamp, by);
            Moment::Said(0, to_cdr(&trigger))
        } else if name == topics::TEST_SEGMENT.name {
            let mut segment: msg::TestSegment = from_cdr(message.data).unwrap();
            later(&mut segment.header.stamp, by);
            Moment::Said(1, to_cdr(&segment))
        } else if let Some(sensor) = name.strip_prefix("temperature/") {
            let sample: Temperature = from_cdr(message.data).unwrap();
            let at = nanos(&sample.header.stamp) + by.nanos();
            Moment::Rows(vec![json!([sensor, sample.temperature, at])])
        } else {
            continue;
        };
        let at = i64::try_from(message.log_time_nanos).unwrap() + by.nanos();
        moments.push((at, moment));
    }
    moments
}

fn map() -> String {
    let mut map = "values:\n".to_owned();
    for axis in AXES {
        for (node, is) in [("act", "position"), ("cmd", "commanded_position")] {
            map.push_str(&format!(
                "  nsu=urn:abbe:machine;s={axis}{node}: {{is: {is}, axis: {axis}, unit: MILLIMETER}}\n"
            ));
        }
    }
    for sensor in SENSORS {
        map.push_str(&format!(
            "  nsu=urn:abbe:machine;s={sensor}: {{is: temperature, name: {sensor}, unit: CELSIUS}}\n"
        ));
    }
    map
}

/// Whether the program has the client: without it the test says so and ends.
fn is_built() -> bool {
    let asked = command(0, &["import-map", "opc.tcp://127.0.0.1:1"]);
    let said = Process::start(asked).ended_within(END).said;
    if said.contains("built without OPC UA") {
        eprintln!("NOT TESTED: a cell behind OPC UA: {said}");
        return false;
    }
    true
}

/// Named causes of a bag by the machine file of its session.
fn diagnosed(bag: &Path) -> Vec<Value> {
    let machine = root().join("launch_configs/gap_first/machine.yaml");
    let mut diagnose = command(0, &["diagnose", "--json", "-"]);
    diagnose.arg(bag).arg("--machine").arg(machine);
    diagnose.stderr(Stdio::null());
    let ended = Process::start(diagnose).ended_within(END);
    assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
    let report: Value = serde_json::from_str(&ended.said).unwrap();
    let causes = report["causes"].as_array().unwrap();
    let named = causes.iter().filter(|one| one["status"] == "named");
    named.cloned().collect()
}

#[test]
fn a_cell_behind_opc_ua_is_recorded_and_its_cause_named() {
    let Some(python) = interpreter("a cell behind OPC UA") else {
        return;
    };
    if !is_built() {
        return;
    }
    let (home, domain) = (tempfile::tempdir().unwrap(), domain(9));
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let at_port = listener.local_addr().unwrap().port();
    drop(listener);
    let mut server = Server::start(&python, at_port);
    std::fs::write(home.path().join("map.yaml"), map()).unwrap();
    let file = home.path().join("bridge.yaml");
    let parameters = format!(
        "/**:\n  ros__parameters:\n    endpoint: opc.tcp://127.0.0.1:{at_port}/\n    map_file: map.yaml\n    \
         subscription: {{sampling_ms: 0, publishing_ms: 20, queue: 1000}}\n"
    );
    std::fs::write(&file, parameters).unwrap();
    let graph = Graph::join(domain);
    let began = Instant::now();
    let bag = home.path().join("bag");
    let mut record = command(domain, &["record", "-o"]);
    record.arg(&bag);
    let recorder = Process::start(record);
    let bridge = Process::node(
        domain,
        "opcua_bridge",
        &["--params-file", &file.to_string_lossy()],
    );
    let mut voice = graph.voice(&[port(&topics::PROBE_TRIGGER), port(&topics::TEST_SEGMENT)]);
    // The server stands already, so it is connected before it says anything about itself.
    graph.alive("opcua_bridge", began);
    let kept = Bag::open(root().join(BAG)).unwrap();
    let (first, _) = kept.log_times_nanos().unwrap();
    let now = nanos(&abbe_tests::graph::now());
    let by = Span::from_nanos(now - i64::try_from(first).unwrap() + LEAD.nanos());
    let mut rows = Vec::new();
    for (at, moment) in session(&kept, by) {
        let ahead = at - nanos(&abbe_tests::graph::now());
        let is_due = ahead > i64::try_from(BEAT.as_nanos()).unwrap();
        if is_due || matches!(moment, Moment::Said(..)) {
            server.write(&std::mem::take(&mut rows));
        }
        if is_due {
            std::thread::sleep(Duration::from_nanos(ahead.unsigned_abs()));
        }
        match moment {
            Moment::Rows(more) => rows.extend(more),
            Moment::Said(place, bytes) => voice.bytes(place, &bytes),
        }
    }
    server.write(&rows);
    voice.settle();
    std::thread::sleep(Duration::from_secs(1));
    bridge.stop();
    recorder.stop();
    let named = diagnosed(&bag);
    assert_eq!(named.len(), 1, "{named:#?}");
    assert_eq!(named[0]["effect"], "probe_latency");
    let figures = &named[0]["parameters"][0];
    let [low, high] = ["low", "high"].map(|key| figures[key].as_f64().unwrap());
    assert!(low < LATENCY_MS && LATENCY_MS < high, "{figures:#}");
}
