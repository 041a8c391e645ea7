//! A machine that only reports, on the graph: told by its adapter, lost with it, and told again.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::mpsc::{Sender, channel};
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

/// Parameters of a bridge that listens at a port, and its mapping; the path of the file.
fn parameters(home: &Path, source: &str, port: u16) -> String {
    std::fs::write(home.join("map.yaml"), MAP).unwrap();
    let file = home.join("bridge.yaml");
    let text = format!(
        "/**:\n  ros__parameters:\n    source: {source}\n    port: {port}\n    map_file: map.yaml\n"
    );
    std::fs::write(&file, text).unwrap();
    file.display().to_string()
}

/// A bridge of another name and namespace than that of the other tests, on a domain without nodes.
fn flooded(file: &str, name: &str) -> Process {
    let arguments = ["--params-file", file, "-r", name, "-r", "__ns:=/flooded"];
    Process::node(domain(15), NODE, &arguments)
}

/// Writes the same again and again until the bridge has left.
fn flood(mut socket: TcpStream, lines: &str) {
    let many = lines.repeat(1 + 20_000 / lines.len());
    while socket.write_all(many.as_bytes()).is_ok() {}
}

#[test]
fn a_bridge_stops_while_its_machine_speaks_without_pause() {
    let stamp = "2016-11-29T10:00:00Z";
    let codes = |k: u32| format!("{stamp}|sc|FAULT|C{k}|1|HIGH|too hot\n");
    let floods = [
        format!("{stamp}|Xabs|1|Stemp|43\n"),
        (0..2_000).map(codes).collect::<String>(),
        format!("{stamp}|Stemp|--multiline--AB\n"),
        format!("{stamp}|Stemp|warm|Xabs\n"),
    ];
    for (at, lines) in floods.into_iter().enumerate() {
        let home = tempfile::tempdir().unwrap();
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let port = listener.local_addr().unwrap().port();
        let file = parameters(home.path(), "shdr", port);
        let name = format!("__node:=flooded_{at}");
        let node = flooded(&file, &name);
        let socket = accept(&listener);
        let flooding = std::thread::spawn(move || flood(socket, &lines));
        std::thread::sleep(Duration::from_secs(3));
        // Within 10 s and with exit code 0.
        node.stop();
        flooding.join().unwrap();
    }
}

const DEVICES: &str = r#"<MTConnectDevices><Header instanceId="7"/><Devices><Device id="d" name="mill"><DataItems><DataItem id="Xabs" category="SAMPLE" type="POSITION" units="MILLIMETER"/></DataItems></Device></Devices></MTConnectDevices>"#;

/// Positions with the numbers from `first` on.
fn positions(first: u64, n: u64) -> String {
    let next = first + n;
    let one = |k: u64| {
        format!(
            r#"<Position dataItemId="Xabs" sequence="{k}" timestamp="2016-11-29T10:00:00Z">{}</Position>"#,
            k % 100
        )
    };
    let all: String = (first..next).map(one).collect();
    format!(
        r#"<MTConnectStreams><Header instanceId="7" firstSequence="1" nextSequence="{next}"/><Streams><DeviceStream name="mill" uuid="m"><ComponentStream component="Linear" name="X" componentId="x"><Samples>{all}</Samples></ComponentStream></DeviceStream></Streams></MTConnectStreams>"#
    )
}

/// Answers one question of a bridge; a stream is full parts without pause until the bridge has left.
fn answer(mut socket: TcpStream, begun: &Sender<()>) {
    let (mut head, mut byte) = (Vec::new(), [0_u8]);
    while !head.ends_with(b"\r\n\r\n") && socket.read(&mut byte).unwrap_or(0) == 1 {
        head.push(byte[0]);
    }
    let whole = |text: &str| {
        let n = text.len();
        format!("HTTP/1.1 200 OK\r\nContent-Type: text/xml\r\nContent-Length: {n}\r\n\r\n{text}")
    };
    let asked = String::from_utf8_lossy(&head);
    if asked.starts_with("GET /probe") {
        let _ = socket.write_all(whole(DEVICES).as_bytes());
    } else if asked.starts_with("GET /current") {
        let _ = socket.write_all(whole(&positions(1, 1)).as_bytes());
    } else {
        let kind = "multipart/x-mixed-replace;boundary=b7";
        let head = format!("HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\n\r\n");
        let mut is_open = socket.write_all(head.as_bytes()).is_ok();
        let mut first = 2;
        while is_open {
            let part = positions(first, 1_000);
            let n = part.len();
            let part = format!("--b7\r\nContent-length: {n}\r\n\r\n{part}\r\n");
            is_open = socket.write_all(part.as_bytes()).is_ok();
            let _ = begun.send(());
            first += 1_000;
        }
    }
}

#[test]
fn a_bridge_stops_while_its_agent_sends_full_parts_without_pause() {
    let home = tempfile::tempdir().unwrap();
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = listener.local_addr().unwrap().port();
    let file = parameters(home.path(), "agent", port);
    let (begun, parts) = channel();
    std::thread::spawn(move || {
        for socket in listener.incoming().map_while(Result::ok) {
            let begun = begun.clone();
            std::thread::spawn(move || answer(socket, &begun));
        }
    });
    let name = "__node:=flooded_by_parts";
    let node = flooded(&file, name);
    parts.recv_timeout(Duration::from_secs(30)).unwrap();
    std::thread::sleep(Duration::from_secs(3));
    // Within 10 s and with exit code 0.
    node.stop();
}
