//! Other people's software reads what we write, value by value, and we read what it writes.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use recorder::{Bag, ChunkCompression, Order, RecorderConfig, dump_json, recover};

use crate::ring;
use crate::sample::{expect_first, read, record, small_chunks};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn python() -> PathBuf {
    std::env::var("ABBE_PYTHON").map_or_else(|_| root().join(".venv/bin/python"), PathBuf::from)
}

fn run(script: &str, arguments: &[&Path]) -> Output {
    let output = Command::new(python())
        .arg(root().join("tests/peers").join(script))
        .args(arguments)
        .output();
    output.unwrap_or_else(|error| panic!("{}: {error}", python().display()))
}

fn dump(bag: &Path, to: &Path) {
    let mut out = BufWriter::new(File::create(to).unwrap());
    let losses = dump_json(&Bag::open(bag).unwrap(), &mut out).unwrap();
    assert_eq!(losses, []);
}

fn check(config: RecorderConfig) {
    let home = tempfile::tempdir().unwrap();
    let (bag, _) = record(home.path(), 400, config);
    let dumped = home.path().join("dump.jsonl");
    dump(&bag, &dumped);
    let output = run("read_bag.py", &[&bag, &dumped]);
    let text = String::from_utf8_lossy(&output.stdout);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}{error}");
    assert!(text.starts_with("400 messages on 5 topics equal"), "{text}");
}

#[test]
fn peers_decode_every_message_alike_in_every_compression() {
    check(small_chunks(ChunkCompression::None));
    check(small_chunks(ChunkCompression::Lz4));
    check(small_chunks(ChunkCompression::Zstd));
    check(RecorderConfig::default());
}

#[test]
fn peers_read_a_recording_of_several_files() {
    check(RecorderConfig {
        max_file_bytes: 16_384,
        ..small_chunks(ChunkCompression::Zstd)
    });
}

#[test]
fn peers_read_files_split_by_time_as_one_bag() {
    check(RecorderConfig {
        max_file_s: 0.1,
        flush_period_s: 0.02,
        ..small_chunks(ChunkCompression::Zstd)
    });
}

#[test]
fn peers_read_a_ring_that_was_saved() {
    let home = tempfile::tempdir().unwrap();
    let mut ring = ring::ring(0.3, 1 << 20);
    ring::fill(&mut ring, 0..2_000);
    let bag = ring::save(&ring, home.path());
    let dumped = home.path().join("dump.jsonl");
    dump(&bag, &dumped);
    let output = run("read_bag.py", &[&bag, &dumped]);
    let text = String::from_utf8_lossy(&output.stdout);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(
        text.starts_with("302 messages on 5 topics equal"),
        "{text}{error}"
    );
}

#[test]
fn the_comparison_fails_when_one_value_differs() {
    let home = tempfile::tempdir().unwrap();
    let (bag, _) = record(home.path(), 60, RecorderConfig::default());
    let dumped = home.path().join("dump.jsonl");
    dump(&bag, &dumped);
    let text = std::fs::read_to_string(&dumped).unwrap();
    let spoiled = text.replacen("0.3333333333333333", "0.33333333333333337", 1);
    assert_ne!(text, spoiled);
    std::fs::write(&dumped, spoiled).unwrap();
    let output = run("read_bag.py", &[&bag, &dumped]);
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(error.contains("velocity[3]"), "{error}");
}

#[test]
fn a_bag_written_by_rosbags_is_read_alike() {
    let home = tempfile::tempdir().unwrap();
    let (ours, _) = record(home.path(), 200, RecorderConfig::default());
    let theirs = home.path().join("theirs");
    let output = run("copy_bag.py", &[&ours, &theirs]);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    let bag = Bag::open(&theirs).unwrap();
    for order in [Order::File, Order::LogTime] {
        let (mut found, losses) = read(&bag, order);
        assert_eq!(losses, []);
        // Its writer keeps neither publish time nor sequence.
        for (n, message) in found.iter_mut().enumerate() {
            message.stamp = crate::sample::message(n as i64).stamp;
        }
        expect_first(&found, 200);
    }
}

/// The README's table of readers, checked.
#[test]
fn peers_stop_at_a_cut_or_refuse_it_and_read_the_recovered_bag() {
    let home = tempfile::tempdir().unwrap();
    let (bag, _) = record(home.path(), 400, small_chunks(ChunkCompression::Zstd));
    let bytes = std::fs::read(bag.join("run_0.mcap")).unwrap();
    let cut = home.path().join("cut.mcap");
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    let (found, _) = read(&Bag::open(&cut).unwrap(), Order::File);
    let output = run("read_cut_file.py", &[&cut]);
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let theirs = said["messages"].as_u64().unwrap();
    assert!(theirs > 0 && theirs <= found.len() as u64, "{said}");
    assert_ne!(said["stream"], "read", "{said}");
    assert_ne!(said["seeking"], "read", "{said}");
    assert_eq!(said["rosbags"], "ReaderError: File end magic is invalid.");
    let whole = home.path().join("recovered");
    recover(&cut, &whole, &RecorderConfig::default()).unwrap();
    let dumped = home.path().join("dump.jsonl");
    dump(&whole, &dumped);
    let output = run("read_bag.py", &[&whole, &dumped]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(
        text.starts_with(&format!("{} messages", found.len())),
        "{text}"
    );
}
