//! Bags that other people's writers made of one of ours: played whole and diagnosed alike, in every layout.

use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use abbe_tests::program::{Process, command, domain, root};
use abbe_tests::python::{interpreter, script, succeeded};
use recorder::{Bag, Event, Order};
use serde_json::Value;

const END: Duration = Duration::from_secs(120);
/// Number of this test's domain among those of its process.
const DOMAIN: u16 = 5;

/// A bag in one layout, and its only file.
struct Layout {
    bag: PathBuf,
    file: PathBuf,
}

/// A written bag as a file and as a directory. A directory that is made here has no metadata.yaml.
fn layouts(written: &Path) -> [Layout; 2] {
    let folder = written.with_extension("");
    let file = if written.is_dir() {
        let name = written.file_name().unwrap().to_string_lossy();
        written.join(format!("{name}.mcap"))
    } else {
        std::fs::create_dir(&folder).unwrap();
        std::fs::copy(written, folder.join("foreign_0.mcap")).unwrap();
        written.to_owned()
    };
    [file.clone(), folder].map(|bag| Layout {
        bag,
        file: file.clone(),
    })
}

/// How the chunks of a file are compressed.
fn compression(file: &Path) -> String {
    let bytes = std::fs::read(file).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let chunks = summary.chunk_indexes.into_iter();
    let mut found: Vec<String> = chunks.map(|chunk| chunk.compression).collect();
    found.dedup();
    assert_eq!(found.len(), 1, "{}: {found:?}", file.display());
    found.remove(0)
}

fn messages(bag: &Path) -> u64 {
    let bag = Bag::open(bag).unwrap();
    let mut messages = bag.messages(Order::File);
    let mut count = 0;
    while let Some(event) = messages.next_event() {
        count += u64::from(matches!(event, Event::Message(_)));
    }
    count
}

/// Exit code and words of `abbe play`, as fast as can be.
fn played(bag: &Path) -> (Option<i32>, String) {
    let mut play = command(domain(DOMAIN), &["play"]);
    play.arg(bag).args(["--rate", "0", "--delay", "0"]);
    let ended = Process::start(play).ended_within(END);
    (ended.status.code(), ended.said)
}

/// Exit code and report of `abbe diagnose`; the report without the bag's place, the hash of its bytes and the time taken.
fn diagnosed(bag: &Path) -> (Option<i32>, Value) {
    let machine = root().join("launch_configs/cold_reference/machine.yaml");
    let mut diagnose = command(0, &["diagnose", "--json", "-"]);
    diagnose.arg(bag).arg("--machine").arg(machine);
    diagnose.stderr(Stdio::null());
    let ended = Process::start(diagnose).ended_within(END);
    let mut report: Value = serde_json::from_str(&ended.said).unwrap_or(Value::Null);
    if let Some(took_s) = report.get_mut("runtime_s") {
        took_s.take();
    }
    if let Some(told) = report.pointer_mut("/inputs/bags/0") {
        for of_the_file in ["path", "sha256"] {
            assert_ne!(told[of_the_file].take(), Value::Null, "{of_the_file}");
        }
    }
    (ended.status.code(), report)
}

#[test]
fn bags_of_other_writers_are_played_whole_and_diagnosed_alike_in_every_layout() {
    let Some(python) = interpreter("bags of rosbags and mcap are played and diagnosed") else {
        return;
    };
    let ours = root().join("bags/cold_reference");
    let count = messages(&ours);
    let expected = diagnosed(&ours);
    assert_eq!(expected.0, Some(0), "{:#}", expected.1);
    assert_eq!(expected.1["inputs"]["bags"][0]["runs"], 3);
    let home = tempfile::tempdir().unwrap();
    let output = script(&python, "foreign_bags.py")
        .args([&ours, home.path()])
        .output();
    let written = succeeded(&output.unwrap());
    let mut seen = Vec::new();
    for written in written.lines().map(Path::new) {
        for Layout { bag, file } in layouts(written) {
            let (code, said) = played(&bag);
            assert_eq!(code, Some(0), "{}: {said}", bag.display());
            let whole = format!(": {count} messages, 0 lost");
            assert!(said.contains(&whole), "{}: {said}", bag.display());
            let found = diagnosed(&bag);
            assert!(found == expected, "{}: {:#}", bag.display(), found.1);
            let writer = written.file_name().unwrap().to_string_lossy();
            let writer = writer.split('_').next().unwrap().to_owned();
            let described = bag.join("metadata.yaml").is_file();
            seen.push((writer, compression(&file), bag.is_dir(), described));
        }
    }
    seen.sort();
    let row = |writer: &str, compression: &str, is_directory, described| {
        (
            writer.to_owned(),
            compression.to_owned(),
            is_directory,
            described,
        )
    };
    // `rosbags` has no LZ4.
    let mut table = Vec::new();
    for compression in ["", "lz4", "zstd"] {
        table.extend([false, true].map(|is_dir| row("mcap", compression, is_dir, false)));
    }
    for compression in ["", "zstd"] {
        table.extend([false, true].map(|is_dir| row("rosbags", compression, is_dir, is_dir)));
    }
    assert_eq!(seen, table);
}
