//! A disk that is full at any byte: how many messages are lost is right, in a queue, in several files and of a ring; and a
//! description that cannot be written costs no message.

use std::fs::{self, File};
use std::io;
use std::path::Path;

use recorder::{
    Bag, ChunkCompression, Directory, Order, Recorder, RecorderConfig, RecorderError, Recording,
    Ring, RingConfig, RunContext, Shelf, WhenFull,
};

use crate::sample::{add_channels, channels, expect_first, message, read, small_chunks};
use crate::storage::SmallDisk;

/// Bytes that a whole recording of the samples needs, more or less.
const SIZES: std::ops::Range<u64> = 8_500..60_000;
const STEP: usize = 1_237;
const OFFERED: u64 = 3_000;

fn in_files() -> RecorderConfig {
    RecorderConfig {
        max_file_bytes: 12_000,
        ..small_chunks(ChunkCompression::None)
    }
}

/// Messages that can be read of what is left.
fn readable(path: &Path) -> u64 {
    let bag = Bag::open(path).unwrap();
    let (found, _) = read(&bag, Order::File);
    expect_first(&found, i64::try_from(found.len()).unwrap());
    found.len() as u64
}

#[test]
fn every_message_of_a_queue_is_written_or_lost_wherever_the_disk_is_full() {
    for (round, bytes) in SIZES.step_by(STEP).enumerate() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("run");
        let config = RecorderConfig {
            when_full: WhenFull::Wait,
            queue_limit_bytes: 4_096 << (round % 4),
            ..if round % 2 == 0 {
                in_files()
            } else {
                small_chunks(ChunkCompression::None)
            }
        };
        let recording = Recording::begin(SmallDisk::of(&path, bytes), "run", config.clone());
        let recorder = Recorder::start(recording.unwrap(), &config).unwrap();
        let sink = recorder.sink();
        let ids: Vec<_> = channels()
            .iter()
            .map(|channel| sink.add_channel(channel).unwrap())
            .collect();
        for n in 0..OFFERED {
            let m = message(n.cast_signed());
            sink.push(ids[m.channel], m.stamp, &m.data);
        }
        // Told while it goes on, with what was lost up to now.
        let stats = sink.stats();
        if let Some(told) = stats.failure {
            let lost = format!("{} messages are lost", stats.messages_lost);
            assert!(told.contains(&lost), "{told} {}", stats.messages_lost);
        }
        let error = recorder.finish().unwrap_err();
        let (written, lost) = error.written_and_lost().unwrap();
        assert_eq!(written + lost, OFFERED, "{bytes} bytes: {error}");
        assert_eq!(readable(&path), written, "{bytes} bytes");
        let stats = sink.stats();
        assert_eq!(
            (stats.messages_written, stats.messages_lost),
            (written, lost)
        );
        let told = stats.failure.unwrap();
        assert!(
            told.contains(&format!("{lost} messages are lost")),
            "{told}"
        );
    }
}

#[test]
fn what_a_ring_could_not_save_is_counted_whole() {
    for bytes in SIZES.step_by(4 * STEP) {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("run");
        let mut ring = Ring::new(&RingConfig {
            window_s: 3_600.0,
            limit_bytes: 64 << 20,
            save_on_error: false,
        })
        .unwrap();
        let ids: Vec<_> = channels()
            .iter()
            .map(|channel| ring.add_channel(channel).unwrap())
            .collect();
        for n in 0..OFFERED {
            let m = message(n.cast_signed());
            ring.push(ids[m.channel], m.stamp, &m.data);
        }
        let snapshot = ring.snapshot();
        let disk = SmallDisk::of(&path, bytes);
        let saved = snapshot.write(disk, "run", &in_files(), &RunContext::default());
        let (written, lost) = saved.unwrap_err().written_and_lost().unwrap();
        assert_eq!(written + lost, snapshot.len() as u64, "{bytes} bytes");
        let bag = Bag::open(&path).unwrap();
        let (found, _) = read(&bag, Order::File);
        assert_eq!(found.len() as u64, written);
    }
}

/// A directory in which small files can be replaced so many times.
struct Undescribed {
    inner: Directory,
    left: u32,
}

impl Shelf for Undescribed {
    type File = File;

    fn create(&mut self, name: &str) -> io::Result<File> {
        self.inner.create(name)
    }

    fn replace(&mut self, name: &str, contents: &[u8]) -> io::Result<()> {
        match self.left.checked_sub(1) {
            Some(left) => self.left = left,
            None => return Err(io::ErrorKind::PermissionDenied.into()),
        }
        self.inner.replace(name, contents)
    }

    fn truncate(&mut self, name: &str, length_bytes: u64) -> io::Result<()> {
        self.inner.truncate(name, length_bytes)
    }

    fn settle(&mut self, name: &str) -> io::Result<()> {
        self.inner.settle(name)
    }

    fn path(&self) -> &Path {
        self.inner.path()
    }
}

#[test]
fn a_description_that_cannot_be_written_costs_no_message_and_is_told() {
    for left in [1, 2, 5] {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("run");
        let inner = Directory::create(&path).unwrap();
        let config = RecorderConfig {
            metadata_period_s: 0.1,
            ..in_files()
        };
        let shelf = Undescribed { inner, left };
        let mut recording = Recording::begin(shelf, "run", config).unwrap();
        let ids = add_channels(&mut recording);
        for n in 0..OFFERED {
            let m = message(n.cast_signed());
            recording.write(ids[m.channel], m.stamp, &m.data).unwrap();
        }
        let trouble = recording.trouble().unwrap();
        assert!(trouble.contains("metadata.yaml"), "{trouble}");
        let before = fs::read(path.join("metadata.yaml")).unwrap();
        let error = recording.finish().unwrap_err();
        let RecorderError::Undescribed {
            messages_written, ..
        } = &error
        else {
            panic!("{error}");
        };
        assert_eq!(*messages_written, OFFERED);
        assert_eq!(fs::read(path.join("metadata.yaml")).unwrap(), before);
        assert_eq!(readable(&path), OFFERED);
        let bag = Bag::open(&path).unwrap();
        assert_eq!(read(&bag, Order::LogTime).1, []);
    }
}

#[test]
fn a_recording_that_cannot_be_described_from_its_begin_is_not_begun() {
    let home = tempfile::tempdir().unwrap();
    let inner = Directory::create(&home.path().join("run")).unwrap();
    let begun = Recording::begin(Undescribed { inner, left: 0 }, "run", in_files());
    let Err(error) = begun else {
        panic!("a folder in which nothing can be written took a recording");
    };
    assert!(error.to_string().contains("metadata.yaml"), "{error}");
}

/// A message every so many seconds, for a day; whether the description had to be written no more than 40 times.
fn is_described_seldom(every_s: i64, config: RecorderConfig) -> bool {
    let home = tempfile::tempdir().unwrap();
    let inner = Directory::create(&home.path().join("run")).unwrap();
    let mut recording = Recording::begin(Undescribed { inner, left: 40 }, "run", config).unwrap();
    let ids = add_channels(&mut recording);
    for n in 0..86_400 / every_s {
        let mut m = message(n);
        m.stamp.log_time_nanos += n * every_s * 1_000_000_000;
        recording.write(ids[m.channel], m.stamp, &m.data).unwrap();
    }
    recording.finish().is_ok()
}

#[test]
fn a_log_of_a_day_that_is_read_when_finished_is_described_a_few_times_however_dense_it_is() {
    for every_s in [20, 60, 600] {
        assert!(is_described_seldom(
            every_s,
            RecorderConfig::read_when_finished()
        ));
        // By default it grows with the log time.
        assert!(!is_described_seldom(every_s, RecorderConfig::default()));
    }
}
