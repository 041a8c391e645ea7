//! A machine that only reports, on the graph: told by its adapter, lost with it, and told again.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};

use abbe_msgs::{from_cdr, msg, sensor_msgs, topics};
use abbe_tests::program::{Process, domain};

use abbe_tests::graph::Graph;

const NODE: &str = "mtconnect_bridge";
const MAP: &str = "values:
  Xabs: {is: position, axis: X, unit: MILLIMETER}
  Stemp: {is: temperature, name: spindle, unit: CELSIUS, change: {step: 1.0, rate_limit_per_s: 1.0, sample_period_s: 1.5}}
  sc: {is: condition, name: spindle_heat}
";

/// Waits for the bridge, and for its greeting.
fn accept(listener: &TcpListener) -> TcpStream {
    let (mut socket, _) = listener.accept().unwrap();
    let mut ping = [0_u8; 7];
    socket.read_exact(&mut ping).unwrap();
    assert_eq!(&ping, b"* PING\n");
    socket
}

fn say(socket: &mut TcpStream, second: u32, values: &str) {
    let line = format!("2016-11-29T10:00:{second:02}Z|{values}\n");
    socket.write_all(line.as_bytes()).unwrap();
}

/// Says a position until somebody on the graph has heard one.
fn is_heard(graph: &Graph, socket: &mut TcpStream) {
    let since = Instant::now();
    let mut position_mm = 0;
    graph.wait("a position", |graph| {
        position_mm += 1;
        say(socket, 0, &format!("Xabs|{position_mm}"));
        std::thread::sleep(Duration::from_millis(150));
        let states = graph.since(&topics::AXES_STATE, since);
        states.into_iter().next()
    });
}

#[test]
fn a_machine_is_told_lost_with_its_adapter_and_told_again() {
    let home = tempfile::tempdir().unwrap();
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = listener.local_addr().unwrap().port();
    std::fs::write(home.path().join("map.yaml"), MAP).unwrap();
    let file = home.path().join("bridge.yaml");
    let parameters = format!(
        "/**:\n  ros__parameters:\n    source: shdr\n    port: {port}\n    map_file: map.yaml\n"
    );
    std::fs::write(&file, parameters).unwrap();

    // It shares its number with nodes that are refused before they join.
    let (domain, began) = (domain(5), Instant::now());
    let graph = Graph::join(domain);
    let file = file.to_string_lossy();
    let node = Process::node(domain, NODE, &["--params-file", &file]);
    let mut socket = accept(&listener);
    is_heard(&graph, &mut socket);

    for (second, value) in [(10, 43), (15, 43), (20, 0), (21, 44)] {
        say(&mut socket, second, &format!("Stemp|{value}"));
    }
    say(&mut socket, 22, "sc|FAULT|417|||too hot");
    graph.condition(NODE, "alarm/spindle_heat", &["FAULT 417: too hot"], began);
    graph.condition(
        NODE,
        "impossible/spindle",
        &["0", "between 43 and 44"],
        began,
    );
    let topic = format!("/{}", topics::TEMPERATURE.of("spindle").unwrap());
    let temperatures: Vec<f64> = graph
        .bytes_of(&topic)
        .iter()
        .map(|bytes| {
            from_cdr::<sensor_msgs::msg::Temperature>(bytes)
                .unwrap()
                .temperature
        })
        .collect();
    assert!(
        temperatures.ends_with(&[44.0]) && !temperatures.contains(&0.0),
        "{temperatures:?}"
    );
    let topic = format!("/{}", topics::MACHINE.of("spindle").unwrap());
    let told = graph.bytes_of(&topic);
    let verdicts = told
        .iter()
        .map(|bytes| from_cdr::<msg::MachineValue>(bytes).unwrap());
    let impossible =
        |value: &msg::MachineValue| value.verdict == msg::MachineValue::VERDICT_IMPOSSIBLE;
    assert_eq!(verdicts.filter(impossible).count(), 1);

    let cut = Instant::now();
    drop(socket);
    graph.condition(NODE, "connection", &["not connected", "closed"], cut);
    graph.condition(NODE, "unavailable/spindle", &["unavailable since"], cut);
    is_heard(&graph, &mut accept(&listener));
    node.stop();
}
