//! The queue: nothing is lost in a composed run, every loss is counted in a live one.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Arc, Condvar, Mutex};
use std::thread;

use recorder::{
    Bag, ChunkCompression, Directory, Order, Pushed, Recorder, RecorderConfig, RecorderError,
    Recording, Shelf, WhenFull,
};

use crate::sample::{self, message, read, small_chunks};

fn begin(path: &Path, config: &RecorderConfig) -> Recorder {
    let shelf = Directory::create(path).unwrap();
    let recording = Recording::begin(shelf, "run", config.clone()).unwrap();
    Recorder::start(recording, config).unwrap()
}

#[test]
fn a_composed_run_waits_and_loses_nothing() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("run");
    let config = RecorderConfig {
        queue_limit_bytes: 4096,
        when_full: WhenFull::Wait,
        ..small_chunks(ChunkCompression::Zstd)
    };
    let recorder = begin(&path, &config);
    let sink = recorder.sink();
    let ids: Vec<_> = sample::channels()
        .iter()
        .map(|channel| sink.add_channel(channel).unwrap())
        .collect();
    for n in 0..5000 {
        let m = message(n);
        assert_eq!(sink.push(ids[m.channel], m.stamp, &m.data), Pushed::Queued);
    }
    let high_water_bytes = recorder.stats().queue_high_water_bytes;
    assert!(high_water_bytes <= 4096, "{high_water_bytes}");
    let summary = recorder.finish().unwrap();
    assert_eq!((summary.messages_written, summary.messages_lost), (5000, 0));
    let (found, losses) = read(&Bag::open(&path).unwrap(), Order::File);
    assert_eq!(losses, []);
    sample::expect_first(&found, 5000);
}

#[test]
fn a_composed_run_gives_the_same_bytes_as_writing_without_a_queue() {
    let home = tempfile::tempdir().unwrap();
    let config = RecorderConfig {
        when_full: WhenFull::Wait,
        ..small_chunks(ChunkCompression::Lz4)
    };
    let (straight, _) = sample::record(home.path(), 800, config.clone());
    let queued = home.path().join("queued");
    let recorder = begin(&queued, &config);
    let sink = recorder.sink();
    let channels = sample::channels();
    let ids: Vec<_> = channels
        .iter()
        .map(|c| sink.add_channel(c).unwrap())
        .collect();
    for n in 0..800 {
        let m = message(n);
        sink.push(ids[m.channel], m.stamp, &m.data);
    }
    recorder.finish().unwrap();
    let bytes = |path: &Path| std::fs::read(path.join("run_0.mcap")).unwrap();
    assert_eq!(bytes(&queued), bytes(&straight));
}

#[test]
fn many_senders_lose_nothing_below_the_limit() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("run");
    let config = RecorderConfig::default();
    let recorder = begin(&path, &config);
    let senders: Vec<_> = (0..4_i64)
        .map(|sender| {
            let sink = recorder.sink();
            thread::spawn(move || {
                for n in 0..2000 {
                    let m = message(n * 4 + sender);
                    let channel = &sample::channels()[m.channel];
                    let id = sink.add_channel(channel).unwrap();
                    assert_eq!(sink.push(id, m.stamp, &m.data), Pushed::Queued);
                }
            })
        })
        .collect();
    senders
        .into_iter()
        .for_each(|sender| sender.join().unwrap());
    let summary = recorder.finish().unwrap();
    assert_eq!((summary.messages_written, summary.messages_lost), (8000, 0));
    let (mut found, losses) = read(&Bag::open(&path).unwrap(), Order::File);
    assert_eq!(losses, []);
    found.sort_by_key(|m| m.stamp.sequence);
    sample::expect_first(&found, 8000);
}

/// A disk that does not answer until the gate is open, and may be full behind it.
struct Gated {
    inner: Directory,
    gate: Arc<(Mutex<bool>, Condvar)>,
    full: bool,
    files: usize,
}

struct GatedFile {
    file: File,
    gate: Arc<(Mutex<bool>, Condvar)>,
    full: bool,
    begun: bool,
}

impl Write for GatedFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // The header of the file passes.
        if std::mem::replace(&mut self.begun, true) {
            let (open, changed) = &*self.gate;
            let mut open = open.lock().unwrap();
            while !*open {
                open = changed.wait(open).unwrap();
            }
            if self.full {
                return Err(io::ErrorKind::StorageFull.into());
            }
        }
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Shelf for Gated {
    type File = GatedFile;

    fn create(&mut self, name: &str) -> io::Result<GatedFile> {
        self.files += 1;
        Ok(GatedFile {
            file: self.inner.create(name)?,
            gate: Arc::clone(&self.gate),
            full: self.full,
            begun: false,
        })
    }

    fn replace(&mut self, name: &str, contents: &[u8]) -> io::Result<()> {
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

fn gated(
    path: &Path,
    full: bool,
    config: &RecorderConfig,
) -> (Recorder, Arc<(Mutex<bool>, Condvar)>) {
    let gate = Arc::new((Mutex::new(false), Condvar::new()));
    let shelf = Gated {
        inner: Directory::create(path).unwrap(),
        gate: Arc::clone(&gate),
        full,
        files: 0,
    };
    let recording = Recording::begin(shelf, "run", config.clone()).unwrap();
    (Recorder::start(recording, config).unwrap(), gate)
}

fn open_gate(gate: &(Mutex<bool>, Condvar)) {
    *gate.0.lock().unwrap() = true;
    gate.1.notify_all();
}

#[test]
fn a_live_queue_at_its_limit_counts_what_it_loses() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("run");
    let config = RecorderConfig {
        queue_limit_bytes: 20_000,
        when_full: WhenFull::CountLoss,
        ..small_chunks(ChunkCompression::None)
    };
    let (recorder, gate) = gated(&path, false, &config);
    let sink = recorder.sink();
    let channels = sample::channels();
    let ids: Vec<_> = channels
        .iter()
        .map(|c| sink.add_channel(c).unwrap())
        .collect();
    let mut queued = 0;
    for n in 0..2000 {
        let m = message(n);
        queued += u64::from(sink.push(ids[m.channel], m.stamp, &m.data) == Pushed::Queued);
    }
    assert!(
        queued < 2000,
        "a disk that stands still must fill the queue"
    );
    let stats = recorder.stats();
    assert_eq!(stats.messages_received, 2000);
    assert_eq!(stats.messages_lost, 2000 - queued);
    assert!(stats.queue_high_water_bytes <= 20_000);
    open_gate(&gate);
    let summary = recorder.finish().unwrap();
    assert_eq!(summary.messages_written, queued);
    assert_eq!(summary.messages_lost, 2000 - queued);
    let bag = Bag::open(&path).unwrap();
    assert_eq!(bag.message_count(), queued);
    let closing = bag.metadata("abbe.recording").unwrap();
    assert_eq!(closing["messages_lost"], (2000 - queued).to_string());
}

#[test]
fn a_full_disk_releases_senders_that_wait_and_every_message_is_accounted_for() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("run");
    let config = RecorderConfig {
        queue_limit_bytes: 4096,
        when_full: WhenFull::Wait,
        ..small_chunks(ChunkCompression::None)
    };
    let (recorder, gate) = gated(&path, true, &config);
    let sink = recorder.sink();
    let sender = thread::spawn(move || {
        let channels = sample::channels();
        let ids: Vec<_> = channels
            .iter()
            .map(|c| sink.add_channel(c).unwrap())
            .collect();
        for n in 0..1000 {
            let m = message(n);
            sink.push(ids[m.channel], m.stamp, &m.data);
        }
    });
    open_gate(&gate);
    sender.join().unwrap();
    let sink = recorder.sink();
    let error = recorder.finish().unwrap_err();
    assert!(
        matches!(error, RecorderError::StorageFull { .. }),
        "{error}"
    );
    let stats = sink.stats();
    assert!(stats.failure.unwrap().starts_with("no space left for "));
    assert_eq!(stats.messages_received, 1000);
    assert_eq!(stats.messages_written + stats.messages_lost, 1000);
}
