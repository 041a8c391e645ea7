//! A cell whose machine is behind OPC UA: what fake_cnc read in a recorded session stands in a server of PyPI `asyncua`,
//! `opcua_bridge` hears it, `abbe record` keeps it beside the probe's touches, and `abbe diagnose` names the cause.

use std::time::{Duration, Instant};

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::sensor_msgs::msg::Temperature;
use abbe_msgs::{from_cdr, msg, to_cdr, topics};
use abbe_tests::graph::{Graph, port};
use abbe_tests::program::{Process, command, domain, root};
use abbe_tests::python::interpreter;
use metrology::stamp::{Host, Span, Stamp};
use recorder::{Bag, Event, Order};
use serde_json::{Value, json};

use crate::opcua_machine::{Server, diagnosed, is_built, latency_ms, mapped, named, nanos};

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
const AXES: [&str; 3] = ["X", "Y", "Z"];
const SENSORS: [&str; 4] = ["nut_x", "nut_y", "bed", "ambient"];

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
            let is = format!("is: {is}, axis: {axis}, unit: MILLIMETER");
            map.push_str(&mapped(&format!("{axis}{node}"), &is));
        }
    }
    for sensor in SENSORS {
        let is = format!("is: temperature, name: {sensor}, unit: CELSIUS");
        map.push_str(&mapped(sensor, &is));
    }
    map
}

/// What the nodes have before the session.
fn before() -> Value {
    let mut values = json!({});
    for axis in AXES {
        values[format!("{axis}act")] = json!(0.0);
        values[format!("{axis}cmd")] = json!(0.0);
    }
    for sensor in SENSORS {
        values[sensor] = json!(20.0);
    }
    values
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
    let mut server = Server::start(&python, &before());
    let file = server.parameters(home.path(), &map(), 1000);
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
    let report = diagnosed(&bag, "launch_configs/gap_first/machine.yaml");
    latency_ms(&report, LATENCY_MS);
    assert_eq!(named(&report).len(), 1);
}
