//! A small bag with every kind of field.

use std::path::{Path, PathBuf};

use recorder::{
    Bag, Channel, ChannelId, ChunkCompression, Directory, Durability, Event, Loss, MessageOrder,
    MessageStamp, Order, QosProfile, RecorderConfig, Recording, RecordingSummary, Reliability,
    RunContext, Shelf, qos_to_yaml,
};
use serde::Serialize;

const TIME: &str = "int32 sec\nuint32 nanosec\n";
const HEADER: &str = "# when and where\nbuiltin_interfaces/Time stamp\nstring frame_id\n";
const TEMPERATURE: &str = "std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n";
const POINT: &str = "float64 x\nfloat64 y\nfloat64 z\n";
const EVERYTHING: &str = "\
uint8 KIND_A=1
string NAME=\"a = b # c\"
bool truth
byte raw
int8 i8
uint8 u8
int16 i16
uint16 u16
int32 i32
uint32 u32
int64 i64
uint64 u64
float32 f32
float64 f64
string text
string<=16 short_text
geometry_msgs/Point centre
float64[3] fixed
float32[] floats
int64[] longs
uint8[] bytes
bool[] truths
string[<=4] words
geometry_msgs/Point[] path
geometry_msgs/Point[2] ends
uint8 last  # behind everything
";

#[derive(Serialize, Clone, Copy)]
struct Time {
    sec: i32,
    nanosec: u32,
}

#[derive(Serialize)]
struct Header {
    stamp: Time,
    frame_id: String,
}

#[derive(Serialize)]
struct Temperature {
    header: Header,
    temperature: f64,
    variance: f64,
}

#[derive(Serialize)]
struct AxisState {
    header: Header,
    controller_stamp: Time,
    axis: Vec<String>,
    commanded: Vec<f64>,
    motor: Vec<f64>,
    scale: Vec<f64>,
    velocity: Vec<f64>,
}

#[derive(Serialize, Clone, Copy)]
struct Point {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Serialize)]
struct Everything {
    truth: bool,
    raw: u8,
    i8: i8,
    u8: u8,
    i16: i16,
    u16: u16,
    i32: i32,
    u32: u32,
    i64: i64,
    u64: u64,
    f32: f32,
    f64: f64,
    text: String,
    short_text: String,
    centre: Point,
    fixed: [f64; 3],
    floats: Vec<f32>,
    longs: Vec<i64>,
    bytes: Vec<u8>,
    truths: Vec<bool>,
    words: Vec<String>,
    path: Vec<Point>,
    ends: [Point; 2],
    last: u8,
}

fn cdr(message: &impl Serialize) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    bytes.extend(cdr_encoding::to_vec::<_, byteorder::LittleEndian>(message).unwrap());
    bytes
}

fn nested(root: &str, parts: &[(&str, &str)]) -> String {
    let mut text = root.to_owned();
    for (name, part) in parts {
        text += &format!("{}\nMSG: {name}\n{part}", "=".repeat(80));
    }
    text
}

pub fn channels() -> Vec<Channel> {
    let header = [
        ("std_msgs/Header", HEADER),
        ("builtin_interfaces/Time", TIME),
    ];
    let axis_state = include_str!("../../../../msgs/msg/AxisState.msg");
    let qos = |depth, reliability, durability| {
        qos_to_yaml(&[QosProfile::keep_last(depth, reliability, durability)]).unwrap()
    };
    let channel = |topic: &str, type_name: &str, definition: String, qos_yaml: String| Channel {
        topic: topic.into(),
        type_name: type_name.into(),
        type_hash: String::new(),
        definition,
        qos_yaml,
    };
    vec![
        channel(
            "/mill/axes/state",
            "abbe_msgs/msg/AxisState",
            nested(axis_state, &header),
            qos(20_000, Reliability::Reliable, Durability::Volatile),
        ),
        channel(
            "/mill/temperature/spindle_front",
            "sensor_msgs/msg/Temperature",
            nested(TEMPERATURE, &header),
            qos(5, Reliability::BestEffort, Durability::Volatile),
        ),
        Channel {
            type_hash: "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
                .into(),
            ..channel(
                "/note",
                "std_msgs/msg/String",
                "string data\n".into(),
                String::new(),
            )
        },
        channel("/mark", "std_msgs/msg/Empty", "\n".into(), String::new()),
        channel(
            "/everything",
            "recorder_tests/msg/Everything",
            nested(EVERYTHING, &[("geometry_msgs/Point", POINT)]),
            qos(1, Reliability::Reliable, Durability::TransientLocal),
        ),
    ]
}

fn header(at_nanos: i64) -> Header {
    Header {
        stamp: Time {
            sec: (at_nanos / 1_000_000_000) as i32,
            nanosec: (at_nanos % 1_000_000_000) as u32,
        },
        frame_id: "mill".into(),
    }
}

fn axis_state(n: i64, at_nanos: i64) -> AxisState {
    let s = n as f64 * 1e-3;
    AxisState {
        header: header(at_nanos),
        controller_stamp: header(at_nanos - 250_000).stamp,
        axis: ["X", "Y", "Z", "A", "C"].map(String::from).to_vec(),
        commanded: vec![s, -s, 0.1 * s, 0.0, s.sin()],
        motor: vec![s + 1e-6, -s, 0.1 * s, -0.0, s.sin()],
        scale: vec![s, f64::NAN, f64::NAN, f64::INFINITY, f64::NEG_INFINITY],
        velocity: vec![f64::MIN_POSITIVE, f64::MAX, 5e-324, 1.0 / 3.0, 0.1],
    }
}

fn everything(n: i64) -> Everything {
    let p = |k: f64| Point {
        x: k,
        y: -k / 3.0,
        z: n as f64,
    };
    Everything {
        truth: n % 2 == 0,
        // The peers do not agree on the sign of a `byte` above 127.
        raw: 100,
        i8: -128,
        u8: 255,
        i16: -32_768,
        u16: 65_535,
        i32: i32::MIN,
        u32: u32::MAX,
        i64: i64::MIN + n,
        u64: u64::MAX - n as u64,
        f32: 0.1,
        f64: 0.1,
        text: format!("Längenfehler {n} µm: 直线度"),
        short_text: String::new(),
        centre: p(1.5),
        fixed: [1.0, 2.0, n as f64],
        floats: (0..n % 5).map(|k| k as f32 / 7.0).collect(),
        longs: vec![n, -n],
        bytes: (0..(n % 9) as u8).collect(),
        truths: vec![true, false, true],
        words: vec!["a".into(), "Größe".into(), String::new()],
        path: (0..n % 3).map(|k| p(k as f64)).collect(),
        ends: [p(8.0), p(9.0)],
        last: 7,
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    pub channel: usize,
    pub stamp: MessageStamp,
    pub data: Vec<u8>,
}

/// First log time of the sample [ns].
pub const BEGIN_NANOS: i64 = 1_700_000_000_000_000_000;

/// The `n`-th message: mostly axis states at 1 kHz, and now and then each of the others.
pub fn message(n: i64) -> Message {
    let at_nanos = BEGIN_NANOS + n * 1_000_000;
    let (channel, data) = match n % 10 {
        3 => (
            1,
            cdr(&Temperature {
                header: header(at_nanos),
                temperature: 20.0 + n as f64 / 128.0,
                variance: 0.0,
            }),
        ),
        5 => (2, cdr(&format!("line {n}: Größe"))),
        7 => (3, vec![0, 1, 0, 0, 0]),
        9 => (4, cdr(&everything(n))),
        _ => (0, cdr(&axis_state(n, at_nanos))),
    };
    Message {
        channel,
        stamp: MessageStamp {
            log_time_nanos: at_nanos,
            publish_time_nanos: at_nanos - 40_000,
            sequence: n as u32,
        },
        data,
    }
}

pub fn small_chunks(compression: ChunkCompression) -> RecorderConfig {
    RecorderConfig {
        compression,
        chunk_size_bytes: 4096,
        ..RecorderConfig::default()
    }
}

pub fn add_channels<S: Shelf>(recording: &mut Recording<S>) -> Vec<ChannelId> {
    channels()
        .iter()
        .map(|channel| recording.add_channel(channel).unwrap())
        .collect()
}

/// Records the sample's first `count` messages into `directory/run`.
pub fn record(directory: &Path, count: i64, config: RecorderConfig) -> (PathBuf, RecordingSummary) {
    record_run(directory, count, config, None)
}

/// The same of a run, where `order` is given.
pub fn record_run(
    directory: &Path,
    count: i64,
    config: RecorderConfig,
    order: Option<MessageOrder>,
) -> (PathBuf, RecordingSummary) {
    let path = directory.join("run");
    let shelf = Directory::create(&path).unwrap();
    let mut recording = Recording::begin(shelf, "run", config).unwrap();
    if let Some(order) = order {
        let start_time_nanos = BEGIN_NANOS as u64;
        recording
            .add_context(&RunContext {
                start_time_nanos,
                order,
                ..RunContext::default()
            })
            .unwrap();
    }
    let ids = add_channels(&mut recording);
    for n in 0..count {
        let message = message(n);
        recording
            .write(ids[message.channel], message.stamp, &message.data)
            .unwrap();
    }
    (path, recording.finish().unwrap())
}

/// Everything that reading gives, with the channel found by the topic's name.
pub fn read(bag: &Bag, order: Order) -> (Vec<Message>, Vec<Loss>) {
    let channels = channels();
    let numbers: Vec<usize> = bag
        .topics()
        .iter()
        .map(|topic| {
            channels
                .iter()
                .position(|c| c.topic == topic.topic)
                .unwrap()
        })
        .collect();
    let (mut messages, mut losses) = (Vec::new(), Vec::new());
    let mut events = bag.messages(order);
    while let Some(event) = events.next_event() {
        match event {
            Event::Loss(loss) => {
                assert_eq!(loss.messages_read, messages.len() as u64, "{loss}");
                losses.push(loss);
            }
            Event::Message(m) => messages.push(Message {
                channel: numbers[m.topic.index()],
                stamp: MessageStamp {
                    log_time_nanos: m.log_time_nanos as i64,
                    publish_time_nanos: m.publish_time_nanos as i64,
                    sequence: m.sequence,
                },
                data: m.data.to_vec(),
            }),
        }
    }
    (messages, losses)
}

/// Checks that `found` is exactly the sample's first `count` messages, and says where it is not.
pub fn expect_first(found: &[Message], count: i64) {
    for (n, found) in found.iter().enumerate() {
        assert!(
            *found == message(n as i64),
            "message {n}: {:?}",
            found.stamp
        );
    }
    assert_eq!(found.len() as i64, count);
}
