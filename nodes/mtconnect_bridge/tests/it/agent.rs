//! A conversation with an agent over HTTP: what is asked in which order, and what is said of gaps, a cut line and a
//! restart. The agent here is a socket that answers as written; its documents follow the published schema.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(
    clippy::disallowed_methods,
    reason = "a test against sockets looks at clocks"
)]

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use metrology::{Severity, Stage};
use mtconnect_bridge::condition::{Condition, ValueCondition};
use mtconnect_bridge::config::{AgentConfig, ConnectionConfig, Source};
use mtconnect_bridge::io::host_now;
use mtconnect_bridge::live::{LiveBridge, LiveInput};
use mtconnect_bridge::mapping::MapFile;
use mtconnect_bridge::{BridgeConfig, Output, Settings};

mod unreadable;

const MAP: &str = "values:
  xp: {is: position, axis: X, unit: MILLIMETER}
  Stemp: {is: temperature, name: spindle, unit: CELSIUS}
  ex: {is: execution}
  c1: {is: condition, name: spindle_heat}
";

/// What the agent answers to one request.
enum Answer {
    /// A whole document with a status.
    Whole(u16, String),
    /// A whole document of other bytes.
    Bytes(Vec<u8>),
    /// Parts of bytes with headers that end in line feeds alone; the stream stays open.
    Plain(Vec<Vec<u8>>),
    /// Parts; the stream then stays open or is cut.
    Parts(Vec<String>, bool),
}

fn devices(instance: u64) -> String {
    format!(
        r#"<?xml version="1.0"?><MTConnectDevices xmlns="urn:mtconnect.org:MTConnectDevices:1.3"><Header instanceId="{instance}"/><Devices><Device id="d" name="mill"><DataItems><DataItem id="ex" name="exec" category="EVENT" type="EXECUTION"/><DataItem id="t" name="Stemp" category="SAMPLE" type="TEMPERATURE" units="CELSIUS"/><DataItem id="c1" category="CONDITION" type="TEMPERATURE"/></DataItems><Components><Axes id="a" name="base"><Components><Linear id="l" name="X"><DataItems><DataItem id="xp" name="Xabs" category="SAMPLE" type="POSITION" units="MILLIMETER"/></DataItems></Linear></Components></Axes></Components></Device></Devices></MTConnectDevices>"#
    )
}

type Value<'a> = (u64, &'a str, &'a str, &'a str);

/// A state of the program.
fn exec(sequence: u64, word: &str) -> Value<'_> {
    (sequence, "Execution", "ex", word)
}

/// Where X is.
fn position(sequence: u64) -> Value<'static> {
    (sequence, "Position", "xp", "1.5")
}

/// A whole document.
fn told(document: String) -> Answer {
    Answer::Whole(200, document)
}

/// A part that is the only one of an open stream.
fn open(part: String) -> Answer {
    Answer::Parts(vec![part], false)
}

/// What was asked, without what follows the number.
fn asked(paths: &mpsc::Receiver<String>) -> Vec<String> {
    let short = |path: String| path.split('&').next().unwrap_or_default().to_owned();
    paths.try_iter().map(short).collect()
}

/// A document of values: `(sequence, kind, dataItemId, text)`.
fn streams(instance: u64, first: u64, next: u64, told: &[Value<'_>]) -> String {
    let element = |(sequence, kind, id, text): &Value<'_>| {
        let name = if *id == "t" { " name=\"Stemp\"" } else { "" };
        let code = if *id == "c1" {
            " nativeCode=\"17\" type=\"TEMPERATURE\""
        } else {
            ""
        };
        let second = sequence % 60;
        format!(
            r#"<{kind} dataItemId="{id}"{name}{code} sequence="{sequence}" timestamp="2016-11-29T10:00:{second:02}.25Z">{text}</{kind}>"#
        )
    };
    let of = |conditions: bool| -> String {
        let chosen = told
            .iter()
            .filter(|(_, _, id, _)| (*id == "c1") == conditions);
        chosen.map(element).collect()
    };
    format!(
        r#"<?xml version="1.0"?><MTConnectStreams xmlns="urn:mtconnect.org:MTConnectStreams:1.3"><Header instanceId="{instance}" firstSequence="{first}" lastSequence="{}" nextSequence="{next}" bufferSize="64"/><Streams><DeviceStream name="mill" uuid="m"><ComponentStream component="Device" name="mill" componentId="d"><Samples>{}</Samples><Condition>{}</Condition></ComponentStream></DeviceStream></Streams></MTConnectStreams>"#,
        next.saturating_sub(1),
        of(false),
        of(true)
    )
}

const OUT_OF_RANGE: &str = r#"<?xml version="1.0"?><MTConnectError xmlns="urn:mtconnect.org:MTConnectError:1.3"><Header instanceId="7"/><Errors><Error errorCode="OUT_OF_RANGE">from is below the first</Error></Errors></MTConnectError>"#;

fn request(socket: &mut TcpStream) -> String {
    let mut head = Vec::new();
    let mut byte = [0_u8];
    while !head.ends_with(b"\r\n\r\n") && socket.read(&mut byte).unwrap_or(0) == 1 {
        head.push(byte[0]);
    }
    let head = String::from_utf8(head).unwrap();
    head.split_whitespace()
        .nth(1)
        .unwrap_or_default()
        .to_owned()
}

fn chunk(socket: &mut TcpStream, bytes: &[u8]) {
    let head = format!("{:x}\r\n", bytes.len());
    let sent = socket.write_all(&[head.as_bytes(), bytes, b"\r\n"].concat());
    // The bridge hangs up when it has heard enough.
    let _ = sent.and_then(|()| socket.flush());
}

const STREAM: &[u8] = b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=a1b2\r\nTransfer-Encoding: chunked\r\n\r\n";

fn answer(mut socket: TcpStream, answer: Answer, open: &mut Vec<TcpStream>) {
    match answer {
        Answer::Bytes(body) => {
            let length = body.len();
            let head = format!("HTTP/1.1 200 said\r\nContent-Length: {length}\r\n\r\n");
            socket
                .write_all(&[head.as_bytes(), &body].concat())
                .unwrap();
        }
        Answer::Plain(parts) => {
            socket.write_all(STREAM).unwrap();
            for part in parts {
                let head = format!(
                    "\n--a1b2\nContent-type: text/xml\nContent-length: {}\n\n",
                    part.len()
                );
                chunk(&mut socket, &[head.as_bytes(), &part].concat());
            }
            open.push(socket);
        }
        Answer::Whole(status, body) => {
            let length = body.len();
            let head = format!(
                "HTTP/1.1 {status} said\r\nContent-Type: text/xml\r\nContent-Length: {length}\r\n\r\n"
            );
            socket
                .write_all(format!("{head}{body}").as_bytes())
                .unwrap();
        }
        Answer::Parts(parts, is_cut) => {
            socket.write_all(STREAM).unwrap();
            for part in parts {
                let length = part.len();
                let part = format!(
                    "\r\n--a1b2\r\nContent-type: text/xml\r\nContent-length: {length}\r\n\r\n{part}"
                );
                // A part comes in two pieces: the cut lies anywhere.
                let (front, back) = part.as_bytes().split_at(part.len() / 2);
                chunk(&mut socket, front);
                std::thread::sleep(Duration::from_millis(3));
                chunk(&mut socket, back);
            }
            if !is_cut {
                open.push(socket);
            }
        }
    }
}

/// Answers requests in order; returns the paths that were asked.
fn serve(script: Vec<Answer>) -> (u16, mpsc::Receiver<String>) {
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = listener.local_addr().unwrap().port();
    let (asked, paths) = mpsc::channel();
    std::thread::spawn(move || {
        let mut open = Vec::new();
        for step in script {
            let (mut socket, _) = listener.accept().unwrap();
            asked.send(request(&mut socket)).unwrap();
            answer(socket, step, &mut open);
        }
        // Streams stay open until the test is over.
        std::thread::sleep(Duration::from_secs(20));
    });
    (port, paths)
}

fn bridge(port: u16) -> LiveBridge {
    opened(&config(port))
}

fn config(port: u16) -> BridgeConfig {
    BridgeConfig {
        source: Source::Agent,
        host: "127.0.0.1".to_owned(),
        port,
        log_file: None,
        log_longest_pause_s: BridgeConfig::default_longest_pause_s(),
        map_file: String::new(),
        connection: ConnectionConfig {
            reconnect_first_s: 0.05,
            ..ConnectionConfig::default()
        },
        agent: AgentConfig::default(),
    }
}

fn opened(config: &BridgeConfig) -> LiveBridge {
    let map = MapFile::from_yaml(MAP).unwrap();
    LiveBridge::open(&Settings::new(config, &map).unwrap()).unwrap()
}

/// All that the bridge says until `is_last` says so.
fn heard(bridge: &mut LiveBridge, is_last: impl Fn(&Output) -> bool) -> Vec<Output> {
    let (begin, mut said) = (Instant::now(), Vec::new());
    while !said.iter().any(&is_last) {
        assert!(begin.elapsed() < Duration::from_secs(10), "{said:#?}");
        bridge.step(host_now(), LiveInput::Tick, &mut said).unwrap();
        std::thread::sleep(Duration::from_millis(2));
    }
    said
}

fn is_value(output: &Output, text: &str) -> bool {
    matches!(output, Output::Value(value) if value.text == text)
}

fn is_state(output: &Output) -> bool {
    matches!(output, Output::State(_))
}

fn conditions(said: &[Output]) -> Vec<&Condition> {
    let all = said.iter().filter_map(|output| match output {
        Output::Condition(condition) => Some(condition),
        _ => None,
    });
    all.collect()
}

fn values(said: &[Output]) -> Vec<&str> {
    let all = said.iter().filter_map(|output| match output {
        Output::Value(value) => Some(value.text.as_str()),
        _ => None,
    });
    all.collect()
}

fn the_machine_warned_and_its_temperature_was_absent(said: &[Output]) {
    let alarms: Vec<_> = conditions(said)
        .into_iter()
        .filter(|condition| condition.name() == "alarm/spindle_heat")
        .map(|condition| (condition.severity(), condition.to_string()))
        .collect();
    let warm = (Severity::Warn, "WARNING 17: warm".to_owned());
    let hot = (Severity::Error, "FAULT 17: hot".to_owned());
    assert_eq!(alarms, [warm, hot]);
    let absent = |condition: &&Condition| condition.name() == "unavailable/spindle";
    let absent: Vec<_> = conditions(said).into_iter().filter(absent).collect();
    assert_eq!(
        absent[0].to_string(),
        "unavailable since 2016-11-29T10:00:06.250Z"
    );
    assert_eq!((absent.len(), absent[1].severity()), (2, Severity::Info));
}

#[test]
fn an_agent_is_asked_what_there_is_what_holds_and_what_happens() {
    let (port, paths) = serve(vec![
        told(devices(7)),
        told(streams(
            7,
            1,
            10,
            &[
                exec(4, "READY"),
                position(5),
                (6, "Temperature", "t", "UNAVAILABLE"),
                (9, "Warning", "c1", "warm"),
            ],
        )),
        Answer::Parts(
            vec![
                streams(
                    7,
                    1,
                    12,
                    &[(11, "Temperature", "t", "43.5"), exec(10, "ACTIVE")],
                ),
                // A sign of life, with a value that was told before.
                streams(7, 1, 12, &[exec(10, "ACTIVE")]),
                streams(7, 1, 14, &[(12, "Fault", "c1", "hot"), exec(13, "STOPPED")]),
            ],
            false,
        ),
    ]);
    let mut bridge = bridge(port);
    let mut said = heard(&mut bridge, |output| is_value(output, "STOPPED"));
    if !said.iter().any(is_state) {
        said.extend(heard(&mut bridge, is_state));
    }
    assert_eq!(values(&said), ["READY", "ACTIVE", "43.5", "STOPPED"]);
    the_machine_warned_and_its_temperature_was_absent(&said);
    let state = said.iter().find_map(|output| match output {
        Output::State(state) => Some(state.motor[metrology::Axis::X]),
        _ => None,
    });
    assert_eq!(state, Some(1.5));
    let asked: Vec<_> = paths.try_iter().collect();
    let sample = "/sample?from=10&interval=100&heartbeat=2000&count=1000";
    assert_eq!(asked, ["/probe", "/current", sample]);
}

#[test]
fn sequence_numbers_up_to_the_greatest_are_counted_and_end_nothing() {
    const BIG: u64 = u64::MAX - 1;
    let (port, _paths) = serve(vec![
        told(devices(7)),
        told(streams(7, 1, 10, &[exec(4, "READY")])),
        open(streams(7, BIG, u64::MAX, &[exec(BIG, "ACTIVE")])),
        // The agent begins anew, and leaps again.
        told(streams(8, 1, 10, &[exec(4, "STOPPED")])),
        open(streams(8, BIG, u64::MAX, &[exec(BIG, "FEED_HOLD")])),
    ]);
    let is_last = |output: &Output| {
        matches!(
            output,
            Output::Condition(Condition::SequenceGap {
                total: u64::MAX,
                ..
            })
        )
    };
    let said = heard(&mut bridge(port), is_last);
    assert_eq!(values(&said)[..2], ["READY", "ACTIVE"]);
}

#[test]
fn what_the_agent_lost_is_said_and_what_holds_is_asked_again() {
    let (port, paths) = serve(vec![
        told(devices(7)),
        told(streams(7, 1, 10, &[exec(4, "READY")])),
        // The buffer ran over: 10 to 39 are gone.
        open(streams(7, 40, 42, &[exec(41, "ACTIVE")])),
        told(streams(7, 40, 50, &[exec(45, "STOPPED")])),
        // Again, and the agent says so itself.
        Answer::Whole(404, OUT_OF_RANGE.to_owned()),
        told(streams(7, 60, 62, &[exec(61, "FEED_HOLD")])),
        open(streams(7, 60, 63, &[exec(62, "INTERRUPTED")])),
    ]);
    let said = heard(&mut bridge(port), |output| is_value(output, "INTERRUPTED"));
    let words = ["READY", "ACTIVE", "STOPPED", "FEED_HOLD", "INTERRUPTED"];
    assert_eq!(values(&said), words);
    let gaps: Vec<_> = conditions(&said)
        .into_iter()
        .filter_map(|condition| match condition {
            Condition::SequenceGap {
                from,
                to,
                lost,
                total,
            } => Some((*from, *to, *lost, *total)),
            _ => None,
        })
        .collect();
    assert_eq!(gaps, [(10, 40, 30, 30), (50, 60, 10, 40)]);
    let asked = asked(&paths);
    let wanted = [
        "/probe",
        "/current",
        "/sample?from=10",
        "/current",
        "/sample?from=50",
        "/current",
        "/sample?from=62",
    ];
    assert_eq!(asked, wanted);
}

#[test]
fn a_cut_line_loses_nothing_and_an_agent_that_starts_anew_is_begun_anew() {
    let (port, paths) = serve(vec![
        told(devices(7)),
        told(streams(7, 1, 10, &[exec(4, "READY")])),
        Answer::Parts(
            vec![streams(7, 1, 12, &[exec(10, "ACTIVE"), position(11)])],
            true,
        ),
        // The same agent: 12 to 14 were told while nobody listened.
        told(devices(7)),
        told(streams(7, 1, 15, &[exec(14, "STOPPED"), position(5)])),
        Answer::Parts(
            vec![
                streams(
                    7,
                    1,
                    15,
                    &[exec(12, "FEED_HOLD"), position(13), exec(14, "STOPPED")],
                ),
                // Another instance, with numbers from 1.
                streams(8, 1, 3, &[exec(2, "ACTIVE")]),
            ],
            false,
        ),
        told(streams(8, 1, 4, &[exec(3, "INTERRUPTED")])),
        Answer::Parts(Vec::new(), false),
    ]);
    let mut bridge = bridge(port);
    let said = heard(&mut bridge, |output| is_value(output, "INTERRUPTED"));
    let words = ["READY", "ACTIVE", "FEED_HOLD", "STOPPED", "INTERRUPTED"];
    assert_eq!(values(&said), words);
    let names: Vec<_> = conditions(&said)
        .iter()
        .map(|condition| condition.name())
        .collect();
    assert!(
        !names.iter().any(|name| name == "sequence_gap"),
        "{names:?}"
    );
    let has = |wanted: &Condition| conditions(&said).contains(&wanted);
    assert!(
        has(&Condition::AgentRestarted { before: 7, now: 8 }),
        "{said:#?}"
    );
    // While the line was cut nothing was known.
    let absent = |output: &Output| matches!(output, Output::Condition(Condition::Value(ValueCondition::Absent { name, .. })) if name == "ex");
    assert_eq!(said.iter().filter(|output| absent(output)).count(), 1);
    let asked = asked(&paths);
    let wanted = [
        "/probe",
        "/current",
        "/sample?from=10",
        "/probe",
        "/current",
        "/sample?from=12",
        "/current",
    ];
    assert_eq!(asked[..7], wanted);
}

#[test]
fn an_answer_that_is_none_is_said_and_tried_again() {
    let (port, _paths) = serve(vec![
        Answer::Whole(500, "out of order".to_owned()),
        Answer::Whole(200, "<html><body>a proxy</body></html>".to_owned()),
        told(devices(7)),
        told(streams(7, 1, 2, &[exec(1, "READY")])),
        Answer::Parts(Vec::new(), false),
    ]);
    let said = heard(&mut bridge(port), |output| is_value(output, "READY"));
    let lost: Vec<_> = conditions(&said)
        .into_iter()
        .filter(|condition| matches!(condition, Condition::Disconnected { .. }))
        .map(ToString::to_string)
        .collect();
    let address = format!("not connected to 127.0.0.1:{port}: /probe: ");
    assert_eq!(
        lost,
        [
            format!("{address}HTTP status 500; next attempt in 0.05 s"),
            format!("{address}root element \"html\" is none of MTConnect's; next attempt in 0.1 s"),
        ]
    );
}

/// A document in which the state's first letter is the byte F6.
fn broken(document: &str, word: &str) -> Vec<u8> {
    let at = document.find(word).unwrap();
    let mut bytes = document.as_bytes().to_vec();
    bytes[at] = 0xf6;
    bytes
}

#[test]
fn a_byte_that_is_no_utf8_costs_one_letter_in_an_answer_and_in_a_part() {
    let current = streams(
        7,
        1,
        10,
        &[
            exec(4, "oeffnen"),
            position(5),
            (6, "Temperature", "t", "21.5"),
        ],
    );
    let part = streams(
        7,
        1,
        12,
        &[exec(10, "aendern"), (11, "Temperature", "t", "22.5")],
    );
    let next = streams(7, 1, 13, &[exec(12, "STOPPED")]);
    let (port, paths) = serve(vec![
        told(devices(7)),
        Answer::Bytes(broken(&current, "oeffnen")),
        // Headers that end in line feeds alone are read as well.
        Answer::Plain(vec![broken(&part, "aendern"), next.into_bytes()]),
    ]);
    let said = heard(&mut bridge(port), |output| is_value(output, "STOPPED"));
    let words = [
        "\u{fffd}effnen",
        "21.5",
        "\u{fffd}endern",
        "22.5",
        "STOPPED",
    ];
    assert_eq!(values(&said), words);
    let replaced = conditions(&said)
        .into_iter()
        .filter(|one| matches!(one, Condition::Replaced { .. }));
    assert_eq!(replaced.count(), 2);
    assert_eq!(asked(&paths).len(), 3);
}

#[test]
fn an_agent_that_always_begins_behind_is_asked_after_growing_pauses_and_no_value_is_told_twice() {
    let mut script = vec![
        told(devices(7)),
        told(streams(7, 1, 10, &[exec(4, "READY"), position(5)])),
    ];
    for round in 1..=4 {
        let next = 10 + 20 * round;
        script.push(open(streams(
            7,
            1,
            next,
            &[exec(next - 1, ["A", "B", "C", "LAST"][round as usize - 1])],
        )));
        script.push(told(streams(
            7,
            1,
            next,
            &[
                exec(next - 1, "twice"),
                position(5),
                (6, "Temperature", "t", "UNAVAILABLE"),
            ],
        )));
    }
    let (port, paths) = serve(script);
    let begin = Instant::now();
    let said = heard(&mut bridge(port), |output| is_value(output, "LAST"));
    assert_eq!(values(&said), ["READY", "A", "B", "C", "LAST"]);
    let gaps = conditions(&said)
        .into_iter()
        .filter(|one| matches!(one, Condition::SequenceGap { .. }));
    assert_eq!(gaps.count(), 4);
    // Asked again at once, then after 0.05 s and 0.1 s.
    assert!(
        begin.elapsed() >= Duration::from_millis(150),
        "{:?}",
        begin.elapsed()
    );
    let absent = conditions(&said)
        .into_iter()
        .filter(|one| matches!(one, Condition::Value(ValueCondition::Absent { .. })));
    assert_eq!(absent.count(), 1);
    assert!(asked(&paths).len() >= 9);
}

#[test]
fn a_unit_that_the_agent_describes_otherwise_is_said_and_values_come_as_the_mapping_says() {
    let inch = devices(7).replace("MILLIMETER", "INCH");
    let (port, _paths) = serve(vec![
        told(inch),
        told(streams(7, 1, 10, &[exec(4, "READY"), position(5)])),
        Answer::Parts(Vec::new(), false),
    ]);
    let said = heard(&mut bridge(port), is_state);
    let unit = conditions(&said)
        .into_iter()
        .find(|one| one.name() == "unit/xp")
        .unwrap();
    assert_eq!(unit.severity(), Severity::Warn);
    assert!(
        unit.to_string()
            .contains("the mapping has MILLIMETER, the agent's probe INCH"),
        "{unit}"
    );
}
