//! The queue between those who send and the thread that writes.
//!
//! [`RecorderSink::push`] copies the message into a buffer that the worker takes whole, so that a
//! sender neither waits for the disk nor, once the buffers have grown, allocates. The buffer has a
//! limit; at the limit the sender waits or the loss is counted, as [`WhenFull`] says. After a
//! failed write every further message is counted as lost, and the failure is kept for whoever asks.

use std::collections::BTreeMap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::channel::{Channel, ChannelId};
use crate::config::{RecorderConfig, WhenFull};
use crate::error::RecorderError;
use crate::read::MetadataRecord;
use crate::recording::{MessageStamp, Recording, RecordingSummary};
use crate::shelf::Shelf;

/// Bookkeeping of one waiting message beside its bytes.
const ENTRY_BYTES: u64 = size_of::<Entry>() as u64;

/// What became of a pushed message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pushed {
    /// It waits to be written.
    Queued,
    /// The queue was full or the recording has stopped; it is counted.
    Lost,
}

/// Counts for `/diagnostics`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecorderStats {
    /// Messages pushed.
    pub messages_received: u64,
    /// Messages taken by the file; at most the open chunk of them is not on the disk yet.
    pub messages_written: u64,
    /// Messages that will not be in the bag.
    pub messages_lost: u64,
    /// Messages whose log time is before that of the message before them.
    pub messages_back_in_time: u64,
    /// Bytes that wait.
    pub queue_bytes: u64,
    /// Most bytes that ever waited.
    pub queue_high_water_bytes: u64,
    /// Bytes in the files.
    pub bytes_written: u64,
    /// Why the recording stopped, where it did.
    pub failure: Option<String>,
    /// What goes wrong while messages are written all the same.
    pub trouble: Option<String>,
}

impl RecorderStats {
    fn take(&mut self, summary: &RecordingSummary) {
        self.messages_written = summary.messages_written;
        self.messages_back_in_time = summary.messages_back_in_time;
        self.bytes_written = summary.bytes_written;
        self.messages_lost = summary.messages_lost;
    }
}

#[derive(Clone, Copy)]
struct Entry {
    channel: ChannelId,
    stamp: MessageStamp,
    begin: usize,
    end: usize,
}

#[derive(Default)]
struct Batch {
    bytes: Vec<u8>,
    entries: Vec<Entry>,
    channels: Vec<Channel>,
    /// Metadata records, each with the number of entries before it.
    notes: Vec<(usize, MetadataRecord)>,
}

impl Batch {
    fn waiting_bytes(&self) -> u64 {
        self.bytes.len() as u64 + self.entries.len() as u64 * ENTRY_BYTES
    }

    fn is_empty(&self) -> bool {
        self.entries.is_empty() && self.channels.is_empty() && self.notes.is_empty()
    }

    fn clear(&mut self) {
        self.bytes.clear();
        self.entries.clear();
        self.channels.clear();
        self.notes.clear();
    }
}

#[derive(Default)]
struct State {
    batch: Batch,
    topics: Vec<(String, String)>,
    stats: RecorderStats,
    lost_in_queue: u64,
    /// Why the recording stopped, until the worker's end.
    failure: Option<RecorderError>,
    stopped: bool,
    closing: bool,
    worker_waits: bool,
}

impl State {
    fn lose_one(&mut self) -> Pushed {
        self.stats.messages_lost += 1;
        self.lost_in_queue += 1;
        Pushed::Lost
    }
}

struct Shared {
    state: Mutex<State>,
    work: Condvar,
    room: Condvar,
    limit_bytes: u64,
    when_full: WhenFull,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        // A panic elsewhere leaves counts and whole messages behind, nothing half done.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Takes messages; cheap to clone, one per sender.
#[derive(Clone)]
pub struct RecorderSink {
    shared: Arc<Shared>,
}

impl RecorderSink {
    /// Adds a topic; the same topic and type again gives the same id.
    ///
    /// # Errors
    /// A malformed channel, or another type for a known topic.
    pub fn add_channel(&self, channel: &Channel) -> Result<ChannelId, RecorderError> {
        channel.checked()?;
        let mut state = self.shared.lock();
        if let Some(index) = state
            .topics
            .iter()
            .position(|(topic, _)| *topic == channel.topic)
        {
            let known_type = state.topics[index].1.clone();
            if known_type == channel.type_name {
                return Ok(ChannelId(index));
            }
            return Err(RecorderError::TypeConflict {
                topic: channel.topic.clone(),
                known_type,
                given_type: channel.type_name.clone(),
            });
        }
        state
            .topics
            .push((channel.topic.clone(), channel.type_name.clone()));
        state.batch.channels.push(channel.clone());
        let id = ChannelId(state.topics.len() - 1);
        self.wake(state);
        Ok(id)
    }

    /// Hands over one message: CDR with its encapsulation header.
    pub fn push(&self, channel: ChannelId, stamp: MessageStamp, data: &[u8]) -> Pushed {
        let mut state = self.shared.lock();
        state.stats.messages_received += 1;
        let needed_bytes = data.len() as u64 + ENTRY_BYTES;
        loop {
            if state.stopped || state.closing || channel.0 >= state.topics.len() {
                return state.lose_one();
            }
            let waiting_bytes = state.batch.waiting_bytes();
            // A message larger than the limit still passes when it is alone.
            if waiting_bytes == 0 || waiting_bytes + needed_bytes <= self.shared.limit_bytes {
                break;
            }
            if self.shared.when_full == WhenFull::CountLoss {
                return state.lose_one();
            }
            state = self
                .shared
                .room
                .wait(state)
                .unwrap_or_else(PoisonError::into_inner);
        }
        let begin = state.batch.bytes.len();
        state.batch.bytes.extend_from_slice(data);
        let end = state.batch.bytes.len();
        state.batch.entries.push(Entry {
            channel,
            stamp,
            begin,
            end,
        });
        let waiting_bytes = state.batch.waiting_bytes();
        let stats = &mut state.stats;
        stats.queue_high_water_bytes = stats.queue_high_water_bytes.max(waiting_bytes);
        self.wake(state);
        Pushed::Queued
    }

    /// Has a metadata record written behind the messages that were pushed before.
    pub fn note(&self, name: &str, metadata: BTreeMap<String, String>) {
        let mut state = self.shared.lock();
        let place = state.batch.entries.len();
        let record = (name.to_owned(), metadata);
        state.batch.notes.push((place, record));
        self.wake(state);
    }

    /// Counts as of now.
    #[must_use]
    pub fn stats(&self) -> RecorderStats {
        let mut state = self.shared.lock();
        let lost = state.stats.messages_lost;
        let failure = state.failure.as_mut().map(|failure| {
            failure.set_lost(lost);
            failure.to_string()
        });
        RecorderStats {
            queue_bytes: state.batch.waiting_bytes(),
            failure: failure.or_else(|| state.stats.failure.clone()),
            ..state.stats.clone()
        }
    }

    fn wake(&self, state: MutexGuard<'_, State>) {
        let waits = state.worker_waits;
        drop(state);
        if waits {
            self.shared.work.notify_one();
        }
    }
}

/// A recording with the thread that writes it.
pub struct Recorder {
    sink: RecorderSink,
    worker: Option<JoinHandle<Result<RecordingSummary, RecorderError>>>,
    path: std::path::PathBuf,
}

impl Recorder {
    /// Starts the thread.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start<S>(recording: Recording<S>, config: &RecorderConfig) -> Result<Self, RecorderError>
    where
        S: Shelf + Send + 'static,
        S::File: 'static,
    {
        let shared = Arc::new(Shared {
            state: Mutex::new(State::default()),
            work: Condvar::new(),
            room: Condvar::new(),
            limit_bytes: config.queue_limit_bytes,
            when_full: config.when_full,
        });
        let path = recording.path();
        // A composed run flushes by log time alone, so that its bytes do not depend on the pace.
        let idle = match config.when_full {
            WhenFull::Wait => None,
            WhenFull::CountLoss => Some(Duration::from_secs_f64(config.flush_period_s)),
        };
        let worker = Worker {
            shared: Arc::clone(&shared),
            recording,
            has_failed: false,
            idle,
        };
        let thread = std::thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || worker.run())
            .map_err(|_| RecorderError::WorkerGone { path: path.clone() })?;
        Ok(Self {
            sink: RecorderSink { shared },
            worker: Some(thread),
            path,
        })
    }

    /// A way in.
    #[must_use]
    pub fn sink(&self) -> RecorderSink {
        self.sink.clone()
    }

    /// Counts as of now.
    #[must_use]
    pub fn stats(&self) -> RecorderStats {
        self.sink.stats()
    }

    /// Writes what waits, closes the bag and gives its summary.
    ///
    /// # Errors
    /// The first failure of the recording; whole chunks stay readable.
    pub fn finish(mut self) -> Result<RecordingSummary, RecorderError> {
        self.close();
        let gone = RecorderError::WorkerGone {
            path: self.path.clone(),
        };
        match self.worker.take().map(JoinHandle::join) {
            Some(Ok(result)) => result,
            Some(Err(_)) | None => Err(gone),
        }
    }

    fn close(&self) {
        self.sink.shared.lock().closing = true;
        self.sink.shared.work.notify_one();
        self.sink.shared.room.notify_all();
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if let Some(worker) = self.worker.take() {
            self.close();
            // The failure, where there is one, was on the diagnostics already.
            let _ = worker.join();
        }
    }
}

struct Worker<S: Shelf> {
    shared: Arc<Shared>,
    recording: Recording<S>,
    has_failed: bool,
    idle: Option<Duration>,
}

impl<S: Shelf> Worker<S> {
    fn run(mut self) -> Result<RecordingSummary, RecorderError> {
        let mut batch = Batch::default();
        while self.take(&mut batch) {
            self.write(&batch);
            batch.clear();
            self.publish();
        }
        let lost = self.shared.lock().lost_in_queue;
        self.recording.note_lost(lost);
        let failure = self.shared.lock().failure.take();
        if let Some(mut failure) = failure {
            // What was offered since the recording stopped is lost with it.
            let lost = self.recording.summary().messages_lost;
            failure.set_lost(lost);
            let mut state = self.shared.lock();
            state.stats.messages_lost = lost;
            state.stats.failure = Some(failure.to_string());
            return Err(failure);
        }
        let finished = self.recording.finish();
        let mut state = self.shared.lock();
        match &finished {
            Ok(summary) => state.stats.take(summary),
            Err(failure) => {
                state.stats.failure = Some(failure.to_string());
                if let Some((written, lost)) = failure.written_and_lost() {
                    state.stats.messages_written = written;
                    state.stats.messages_lost = lost;
                }
            }
        }
        drop(state);
        finished
    }

    /// Waits for messages; false when there will be no more.
    fn take(&mut self, batch: &mut Batch) -> bool {
        let shared = Arc::clone(&self.shared);
        let mut state = shared.lock();
        loop {
            if !state.batch.is_empty() {
                std::mem::swap(&mut state.batch, batch);
                drop(state);
                shared.room.notify_all();
                return true;
            }
            if state.closing {
                return false;
            }
            state.worker_waits = true;
            state = match self.idle {
                None => shared
                    .work
                    .wait(state)
                    .unwrap_or_else(PoisonError::into_inner),
                Some(period) => {
                    let waited = shared.work.wait_timeout(state, period);
                    let (state, timeout) = waited.unwrap_or_else(PoisonError::into_inner);
                    if timeout.timed_out() && state.batch.is_empty() {
                        drop(state);
                        self.flush_idle();
                        shared.lock()
                    } else {
                        state
                    }
                }
            };
            state.worker_waits = false;
        }
    }

    fn flush_idle(&mut self) {
        if !self.has_failed
            && let Err(error) = self.recording.flush()
        {
            self.fail(error);
            self.publish();
        }
    }

    fn write(&mut self, batch: &Batch) {
        for channel in &batch.channels {
            if !self.has_failed
                && let Err(error) = self.recording.add_channel(channel)
            {
                self.fail(error);
            }
        }
        let mut notes = batch.notes.iter().peekable();
        for (index, entry) in batch.entries.iter().enumerate() {
            while let Some((_, record)) = notes.next_if(|(place, _)| *place <= index) {
                self.add_note(record);
            }
            if self.has_failed {
                self.recording
                    .note_lost((batch.entries.len() - index) as u64);
                break;
            }
            let data = &batch.bytes[entry.begin..entry.end];
            match self.recording.write(entry.channel, entry.stamp, data) {
                Ok(()) => {}
                // One bad stamp spoils one message, not the recording.
                Err(RecorderError::TimeBeforeEpoch { .. }) => self.recording.note_lost(1),
                Err(error) => self.fail(error),
            }
        }
        notes.for_each(|(_, record)| self.add_note(record));
    }

    fn add_note(&mut self, (name, metadata): &MetadataRecord) {
        if !self.has_failed
            && let Err(error) = self.recording.add_metadata(name, metadata)
        {
            self.fail(error);
        }
    }

    fn fail(&mut self, error: RecorderError) {
        let mut state = self.shared.lock();
        state.stopped = true;
        state.failure = Some(error);
        drop(state);
        self.has_failed = true;
        self.shared.room.notify_all();
    }

    fn publish(&mut self) {
        let summary = self.recording.summary();
        let mut state = self.shared.lock();
        state.stats.take(&summary);
        let lost_in_queue = state.lost_in_queue;
        state.stats.messages_lost += lost_in_queue;
        state.stats.trouble = self.recording.trouble();
    }
}
