//! Messages of 200 B per second, written and read, beside PyPI `rosbags` on the same machine in
//! the same run (`ABBE_PYTHON` or `.venv/bin/python` at the root of the workspace).
//!
//! ```text
//! cargo bench -p recorder
//! ```
//!
//! Each figure is the median of five passes. `rosbags` writes as many messages of the same bytes with its
//! own writer and reads the bag that we wrote with each compression; raw, without decoding. Without that
//! Python its columns are NaN, and it is said.
#![expect(
    clippy::disallowed_methods,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a bench reads the clock and prints its figures"
)]

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use recorder::{
    Bag, Channel, ChunkCompression, Directory, Event, MessageStamp, Order, Recorder,
    RecorderConfig, Recording, WhenFull,
};

const MESSAGES: u64 = 1_000_000;
const MESSAGE_BYTES: usize = 200;
const PASSES: usize = 5;
/// What ARCHITECTURE asks of a recorder [messages/s].
const BUDGET_PER_S: f64 = 100_000.0;

fn channel() -> Channel {
    Channel {
        topic: "/axes/state".into(),
        type_name: "std_msgs/msg/UInt8MultiArray".into(),
        type_hash: String::new(),
        definition: "std_msgs/MultiArrayLayout layout\nuint8[] data\n".to_owned()
            + &"=".repeat(80)
            + "\nMSG: std_msgs/MultiArrayLayout\nstd_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n"
            + &"=".repeat(80)
            + "\nMSG: std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride\n",
        qos_yaml: String::new(),
    }
}

/// CDR of 200 B whose numbers drift as positions do: the low bytes change, the high ones do not.
fn fill(n: u64, data: &mut [u8; MESSAGE_BYTES]) {
    data[..16].copy_from_slice(&[0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 184, 0, 0, 0]);
    for (index, place) in data[16..].chunks_exact_mut(8).enumerate() {
        let phase = n as f64 * 1e-3 * (index + 1) as f64;
        // Positions on a grid of 2^-20 m, near the resolution of an encoder.
        let value = (phase.fract() * 1_048_576.0).floor() / 1_048_576.0;
        place.copy_from_slice(&value.to_le_bytes());
    }
}

fn stamp(n: u64) -> MessageStamp {
    let log_time_nanos = 1_700_000_000_000_000_000 + n as i64 * 1_000_000;
    MessageStamp {
        log_time_nanos,
        publish_time_nanos: log_time_nanos,
        sequence: n as u32,
    }
}

fn config(compression: ChunkCompression) -> RecorderConfig {
    RecorderConfig {
        compression,
        when_full: WhenFull::Wait,
        // Chunks close by size: a million messages at 1 kHz are a thousand seconds.
        flush_period_s: 60.0,
        ..RecorderConfig::default()
    }
}

fn per_second(work: impl Fn()) -> f64 {
    let mut rates: Vec<f64> = (0..PASSES)
        .map(|_| {
            let begin = Instant::now();
            work();
            MESSAGES as f64 / begin.elapsed().as_secs_f64()
        })
        .collect();
    rates.sort_by(f64::total_cmp);
    rates[PASSES / 2]
}

fn write(path: &Path, messages: &[[u8; MESSAGE_BYTES]], compression: ChunkCompression) {
    let _ = std::fs::remove_dir_all(path);
    let shelf = Directory::create(path).unwrap();
    let mut recording = Recording::begin(shelf, "run", config(compression)).unwrap();
    let id = recording.add_channel(&channel()).unwrap();
    for (n, data) in messages.iter().enumerate() {
        recording.write(id, stamp(n as u64), data).unwrap();
    }
    assert_eq!(recording.finish().unwrap().messages_written, MESSAGES);
}

fn write_through_queue(
    path: &Path,
    messages: &[[u8; MESSAGE_BYTES]],
    compression: ChunkCompression,
) {
    let _ = std::fs::remove_dir_all(path);
    let shelf = Directory::create(path).unwrap();
    let config = config(compression);
    let recording = Recording::begin(shelf, "run", config.clone()).unwrap();
    let recorder = Recorder::start(recording, &config).unwrap();
    let sink = recorder.sink();
    let id = sink.add_channel(&channel()).unwrap();
    for (n, data) in messages.iter().enumerate() {
        sink.push(id, stamp(n as u64), data);
    }
    let summary = recorder.finish().unwrap();
    assert_eq!(
        (summary.messages_written, summary.messages_lost),
        (MESSAGES, 0)
    );
}

fn read(path: &Path, order: Order) {
    let bag = Bag::open(path).unwrap();
    let mut messages = bag.messages(order);
    let (mut count, mut bytes, mut last) = (0, 0, 0);
    while let Some(event) = messages.next_event() {
        let Event::Message(message) = event else {
            panic!("{event:?}");
        };
        count += 1;
        bytes += message.data.len();
        last = message.log_time_nanos.max(last);
    }
    assert_eq!(
        (count, bytes),
        (MESSAGES, MESSAGES as usize * MESSAGE_BYTES)
    );
    assert_eq!(last as i64, stamp(MESSAGES - 1).log_time_nanos);
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn python() -> PathBuf {
    let python = std::env::var("ABBE_PYTHON");
    python.map_or_else(|_| root().join(".venv/bin/python"), PathBuf::from)
}

/// Messages per second of `rosbags`: `write` into, or `read` of, a directory; NaN where it is not installed.
fn rosbags(what: &str, path: &Path) -> f64 {
    let python = python();
    if !python.exists() {
        return f64::NAN;
    }
    let root = root();
    let output = Command::new(&python)
        .arg(root.join("tests/peers/bench_bag.py"))
        .args([what, &MESSAGES.to_string(), &PASSES.to_string()])
        .arg(path)
        .output()
        .unwrap_or_else(|error| panic!("{}: {error}", python.display()));
    let text = String::from_utf8_lossy(&output.stdout);
    let error = String::from_utf8_lossy(&output.stderr);
    text.trim()
        .parse()
        .unwrap_or_else(|_| panic!("{text}{error}"))
}

fn main() {
    let home = tempfile::tempdir().unwrap();
    let mut messages = vec![[0; MESSAGE_BYTES]; MESSAGES as usize];
    for (n, data) in messages.iter_mut().enumerate() {
        fill(n as u64, data);
    }
    if !python().exists() {
        let python = python();
        println!("rosbags not run: no {}", python.display());
    }
    println!("{MESSAGES} messages of {MESSAGE_BYTES} B, median of {PASSES} passes [1000/s]");
    println!("chunks   write rosbags  ratio  queued    read by time rosbags  ratio   MiB");
    for compression in [
        ChunkCompression::None,
        ChunkCompression::Lz4,
        ChunkCompression::Zstd,
    ] {
        let path = home.path().join("ours");
        let queued = per_second(|| write_through_queue(&path, &messages, compression));
        let written = per_second(|| write(&path, &messages, compression));
        let read_file = per_second(|| read(&path, Order::File));
        let read_time = per_second(|| read(&path, Order::LogTime));
        let rosbags_read = rosbags("read", &path);
        // It has no LZ4 in its writer; its zstd is the nearest.
        let rosbags_writes = match compression {
            ChunkCompression::None => "write",
            ChunkCompression::Lz4 | ChunkCompression::Zstd => "write_zstd",
        };
        let rosbags_write = rosbags(rosbags_writes, &home.path().join("rosbags"));
        let file_bytes = std::fs::metadata(path.join("run_0.mcap")).unwrap().len();
        println!(
            "{:<6} {:>7.0} {:>7.0} {:>6.1} {:>7.0} {:>7.0} {:>7.0} {:>7.0} {:>6.1} {:>5.0}",
            format!("{compression:?}"),
            written / 1e3,
            rosbags_write / 1e3,
            written / rosbags_write,
            queued / 1e3,
            read_file / 1e3,
            read_time / 1e3,
            rosbags_read / 1e3,
            read_file / rosbags_read,
            file_bytes as f64 / 1_048_576.0,
        );
        assert!(
            queued > BUDGET_PER_S,
            "{queued} messages/s, the budget is {BUDGET_PER_S}"
        );
    }
}
