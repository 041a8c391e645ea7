//! `abbe record` on a live graph: a new file by size and by time, of the topics that were asked for.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use abbe_msgs::msg::{ProbeTrigger, TestSegment};
use abbe_msgs::{Message, from_cdr, topics};
use abbe_tests::program::{Process, command, domain};
use recorder::{Bag, Event, Order};

use abbe_tests::graph::{Graph, now, port};

/// Time between two messages of a topic.
const PERIOD: Duration = Duration::from_millis(20);
/// What may be on its way when the recorder is told to end.
const ON_ITS_WAY: Duration = Duration::from_millis(500);
/// A chunk, behind which a file may end, is written once it is so old, s, or so large.
const CHUNK_S: f64 = 1.0;
const CHUNK_BYTES: u64 = 1 << 20;
/// Whole files that are waited for.
const FILES: usize = 3;

/// A bag that was recorded, and how many touches were said.
struct Recorded {
    /// Removed with the test.
    home: tempfile::TempDir,
    said: u32,
}

fn file(home: &Path, place: usize) -> PathBuf {
    home.join(format!("bag/bag_{place}.mcap"))
}

/// Says touches, padded to `bytes`, and segments, and lets `abbe record` write down what `/probe/tri*` picks, until whole
/// files are there.
fn record(domain: u16, more: &[&str], bytes: usize) -> Recorded {
    let home = tempfile::tempdir().unwrap();
    let graph = Graph::join(domain);
    let mut record = command(domain, &["record", "--compression", "none"]);
    record.arg("-o").arg(home.path().join("bag")).args(more);
    record.args(["--", "/nobody/*", "/probe/tri*"]);
    let mut recording = Process::start(record);
    let mut voice = graph.voice(&[port(&topics::PROBE_TRIGGER), port(&topics::TEST_SEGMENT)]);
    let mut touch = ProbeTrigger {
        feature_id: "x".repeat(bytes),
        ..ProbeTrigger::default()
    };
    let began = Instant::now();
    while !file(home.path(), FILES).exists() {
        assert!(
            began.elapsed() < Duration::from_secs(60),
            "no {FILES} files"
        );
        assert!(recording.is_running());
        touch.sequence += 1;
        touch.header.stamp = now();
        voice.say(0, &touch);
        voice.say(1, &TestSegment::default());
        std::thread::sleep(PERIOD);
    }
    voice.stop();
    std::thread::sleep(ON_ITS_WAY);
    let said = recording.stop();
    let messages = Bag::open(home.path().join("bag")).unwrap().message_count();
    assert!(
        said.contains(&format!("{messages} messages, 0 lost")),
        "{said}"
    );
    let segments = graph.bytes_of(&format!("/{}", topics::TEST_SEGMENT.name));
    assert!(!segments.is_empty(), "nothing was there to be left out");
    Recorded {
        home,
        said: touch.sequence,
    }
}

impl Recorded {
    /// Log times by file, s, in their order. The bag holds touches alone: each once and in its order, from the first that met
    /// the recorder to the last that was said.
    fn log_times_s(&self) -> Vec<Vec<f64>> {
        let bag = Bag::open(self.home.path().join("bag")).unwrap();
        let names: Vec<&str> = bag.topics().iter().map(|t| t.topic.as_str()).collect();
        assert_eq!(names, ["/probe/trigger"]);
        assert_eq!(bag.topics()[0].type_name, ProbeTrigger::TYPE_NAME);
        let numbers: Vec<u32> = touches(&bag)
            .into_iter()
            .map(|(_, number)| number)
            .collect();
        let expected: Vec<u32> = (numbers[0]..=self.said).collect();
        assert_eq!(numbers, expected);
        let files = bag.files().count();
        let of_file = |place| {
            let own = Bag::open(file(self.home.path(), place)).unwrap();
            let mut times_s: Vec<f64> = touches(&own).into_iter().map(|(at_s, _)| at_s).collect();
            times_s.sort_by(f64::total_cmp);
            times_s
        };
        let by_file: Vec<Vec<f64>> = (0..files).map(of_file).collect();
        let in_files: usize = by_file.iter().map(Vec::len).sum();
        assert_eq!(in_files, numbers.len());
        eprintln!(
            "{} touches of {} in files of {:?}",
            numbers.len(),
            self.said,
            by_file.iter().map(Vec::len).collect::<Vec<_>>()
        );
        by_file
    }
}

/// Log time, s, and number of each touch.
fn touches(bag: &Bag) -> Vec<(f64, u32)> {
    let mut messages = bag.messages(Order::File);
    let mut found = Vec::new();
    while let Some(event) = messages.next_event() {
        let Event::Message(message) = event else {
            panic!("{event:?}");
        };
        let touch: ProbeTrigger = from_cdr(message.data).unwrap();
        found.push((message.log_time_nanos as f64 * 1e-9, touch.sequence));
    }
    found
}

#[test]
fn a_live_recording_begins_a_new_file_at_a_size_and_holds_what_was_asked_for() {
    const LIMIT: u64 = 100_000;
    let recorded = record(domain(19), &["--max-file-bytes", "100000"], 20_000);
    let files = recorded.log_times_s().len();
    let size = |place| file(recorded.home.path(), place).metadata().unwrap().len();
    let sizes: Vec<u64> = (0..files).map(size).collect();
    eprintln!("{sizes:?} bytes");
    assert!(files > FILES);
    for (place, size) in sizes.into_iter().enumerate() {
        assert!(size >= LIMIT || place == files - 1, "{place}: {size}");
        // A chunk and a message more, and an index.
        assert!(size < LIMIT + CHUNK_BYTES + LIMIT, "{place}: {size}");
    }
}

#[test]
fn a_live_recording_begins_a_new_file_after_a_time_and_holds_what_was_asked_for() {
    const LIMIT_S: f64 = 1.5;
    // It shares its number with players that are refused before they join.
    let recorded = record(domain(16), &["--max-file-s", "1.5"], 10);
    let times_s = recorded.log_times_s();
    assert!(times_s.len() > FILES);
    for (place, of_file) in times_s.iter().enumerate() {
        let [first, .., before, last] = of_file[..] else {
            assert_eq!(place, times_s.len() - 1, "{of_file:?}");
            continue;
        };
        let whole = place < times_s.len() - 1;
        assert!(!whole || last - first >= LIMIT_S, "{place}: {of_file:?}");
        // The message that ended it may have been long in coming.
        assert!(before - first < LIMIT_S + CHUNK_S, "{place}: {of_file:?}");
    }
}
