//! The last minutes of every topic in memory, to be written when something has happened.
//!
//! What is older than the window leaves; so does the oldest when the bytes have reached their limit, and then the ring
//! reaches less far back than it should, which is counted. Of a latched topic the last messages stay, as many as its
//! depth, however old: a late joiner would get them too. So a bag that is saved has everything that was said within
//! the window, and what held when it began; the latter stand at its begin, with their own publish times. Where the clock
//! is set back the window goes on: by how much it was is no part of it.
//!
//! Taking a snapshot copies no bytes and takes microseconds; writing it is the caller's, in its own time.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::channel::{Channel, ChannelId, Durability};
use crate::config::{RecorderConfig, RingConfig};
use crate::context::RunContext;
use crate::error::RecorderError;
use crate::queue::Pushed;
use crate::recording::{MessageStamp, Recording, RecordingSummary};
use crate::shelf::Shelf;

/// A message that is kept.
#[derive(Clone, Debug)]
struct Kept {
    channel: ChannelId,
    stamp: MessageStamp,
    /// Log time that had passed when it came, ns: steps of the clock backwards are left out.
    passed_nanos: i64,
    data: Arc<[u8]>,
}

impl Kept {
    /// Bytes that it takes, its bookkeeping included.
    fn bytes(&self) -> u64 {
        (self.data.len() + size_of::<Self>()) as u64
    }
}

#[derive(Debug)]
struct KeptTopic {
    channel: Channel,
    /// How many messages a late joiner would get.
    latched_depth: usize,
    /// Latched messages from before the window.
    before: VecDeque<Kept>,
}

/// Counts of a ring.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RingStats {
    /// Messages pushed.
    pub messages_received: u64,
    /// Messages that are kept.
    pub messages_kept: u64,
    /// Bytes that are kept, bookkeeping included.
    pub bytes_kept: u64,
    /// Most bytes that were ever kept.
    pub high_water_bytes: u64,
    /// Messages that left within the window, for want of room.
    pub messages_crowded_out: u64,
    /// How far back it reaches, s of log time.
    pub reach_s: f64,
}

/// The last minutes of every topic.
#[derive(Debug)]
pub struct Ring {
    window_nanos: i64,
    limit_bytes: u64,
    topics: Vec<KeptTopic>,
    messages: VecDeque<Kept>,
    /// Log time of the newest message since the clock was set back, ns.
    newest_nanos: Option<i64>,
    /// Log time that has passed, ns.
    passed_nanos: i64,
    stats: RingStats,
}

/// A log time that goes back by more was set back, ns: by less, messages of several topics overtake each other.
const SET_BACK_NANOS: i64 = 100_000_000;

impl Ring {
    /// An empty ring.
    ///
    /// # Errors
    /// A value out of its range.
    pub fn new(config: &RingConfig) -> Result<Self, RecorderError> {
        config.checked()?;
        Ok(Self {
            window_nanos: config.window_nanos(),
            limit_bytes: config.limit_bytes,
            topics: Vec::new(),
            messages: VecDeque::new(),
            newest_nanos: None,
            passed_nanos: 0,
            stats: RingStats::default(),
        })
    }

    /// Adds a topic; the same topic and type again gives the same id.
    ///
    /// # Errors
    /// A malformed channel, or another type for a known topic.
    pub fn add_channel(&mut self, channel: &Channel) -> Result<ChannelId, RecorderError> {
        let qos = channel.checked()?;
        let mut topics = self.topics.iter();
        if let Some(index) = topics.position(|known| known.channel.topic == channel.topic) {
            let known_type = self.topics[index].channel.type_name.clone();
            if known_type == channel.type_name {
                return Ok(ChannelId(index));
            }
            return Err(RecorderError::TypeConflict {
                topic: channel.topic.clone(),
                known_type,
                given_type: channel.type_name.clone(),
            });
        }
        let latched = qos
            .iter()
            .find(|one| one.durability == Durability::TransientLocal);
        self.topics.push(KeptTopic {
            channel: channel.clone(),
            latched_depth: latched.map_or(0, |qos| usize::try_from(qos.depth).unwrap_or(0).max(1)),
            before: VecDeque::new(),
        });
        Ok(ChannelId(self.topics.len() - 1))
    }

    /// Takes one message: CDR with its encapsulation header.
    pub fn push(&mut self, channel: ChannelId, stamp: MessageStamp, data: &[u8]) -> Pushed {
        self.stats.messages_received += 1;
        if channel.0 >= self.topics.len() {
            return Pushed::Lost;
        }
        let message = Kept {
            channel,
            stamp,
            passed_nanos: self.pass(stamp.log_time_nanos),
            data: Arc::from(data),
        };
        self.stats.bytes_kept += message.bytes();
        self.messages.push_back(message);
        self.let_go();
        let stats = &mut self.stats;
        stats.high_water_bytes = stats.high_water_bytes.max(stats.bytes_kept);
        Pushed::Queued
    }

    /// What has passed when a message comes.
    fn pass(&mut self, log_time_nanos: i64) -> i64 {
        let newest_nanos = self.newest_nanos.unwrap_or(log_time_nanos);
        let on_nanos = log_time_nanos.saturating_sub(newest_nanos);
        if !(-SET_BACK_NANOS..0).contains(&on_nanos) {
            self.newest_nanos = Some(log_time_nanos);
        }
        self.passed_nanos = self.passed_nanos.saturating_add(on_nanos.max(0));
        self.passed_nanos
    }

    fn let_go(&mut self) {
        let begin_nanos = self.passed_nanos.saturating_sub(self.window_nanos);
        while let Some(oldest) = self.messages.front() {
            let is_old = oldest.passed_nanos < begin_nanos;
            let is_crowded = self.stats.bytes_kept > self.limit_bytes;
            if !is_old && !is_crowded {
                return;
            }
            self.stats.messages_crowded_out += u64::from(!is_old);
            if let Some(oldest) = self.messages.pop_front() {
                self.put_before(oldest);
            }
        }
    }

    /// A message has left the window: it stays where its topic is latched, in the place of an older one.
    fn put_before(&mut self, message: Kept) {
        let topic = &mut self.topics[message.channel.0];
        let mut gone = (topic.latched_depth == 0).then(|| message.bytes());
        if gone.is_none() {
            topic.before.push_back(message);
            if topic.before.len() > topic.latched_depth {
                gone = topic.before.pop_front().map(|older| older.bytes());
            }
        }
        self.stats.bytes_kept -= gone.unwrap_or(0);
    }

    /// Counts as of now.
    #[must_use]
    pub fn stats(&self) -> RingStats {
        let oldest = self.messages.front();
        let reach_nanos = oldest.map_or(0, |oldest| self.passed_nanos - oldest.passed_nanos);
        let before: usize = self.topics.iter().map(|topic| topic.before.len()).sum();
        RingStats {
            messages_kept: (self.messages.len() + before) as u64,
            reach_s: reach_nanos as f64 * 1e-9,
            ..self.stats
        }
    }

    /// What is kept at this moment.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        let oldest = self.messages.iter().map(|kept| kept.stamp.log_time_nanos);
        let begin_nanos = oldest.min().or(self.newest_nanos).unwrap_or(0);
        let mut messages = Vec::with_capacity(self.messages.len());
        for topic in &self.topics {
            messages.extend(topic.before.iter().cloned().map(|mut kept| {
                kept.stamp.log_time_nanos = begin_nanos;
                kept
            }));
        }
        messages.extend(self.messages.iter().cloned());
        Snapshot {
            channels: self
                .topics
                .iter()
                .map(|topic| topic.channel.clone())
                .collect(),
            messages,
        }
    }
}

/// What a ring held at one moment.
#[derive(Clone, Debug)]
pub struct Snapshot {
    channels: Vec<Channel>,
    messages: Vec<Kept>,
}

impl Snapshot {
    /// Messages that it holds.
    #[must_use]
    pub fn len(&self) -> usize {
        self.messages.len()
    }

    /// Whether it holds nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.messages.is_empty()
    }

    /// Writes it as a bag of its own, with what a reader needs to know of the run.
    ///
    /// # Errors
    /// The context holds what must not be in a bag, or a write failed.
    pub fn write<S: Shelf>(
        &self,
        shelf: S,
        name: &str,
        config: &RecorderConfig,
        context: &RunContext,
    ) -> Result<RecordingSummary, RecorderError> {
        self.write_all(shelf, name, config, context)
            .map_err(|mut error| {
                // What was still to be written is lost as well.
                if let Some((written, _)) = error.written_and_lost() {
                    error.set_lost(self.messages.len() as u64 - written);
                }
                error
            })
    }

    fn write_all<S: Shelf>(
        &self,
        shelf: S,
        name: &str,
        config: &RecorderConfig,
        context: &RunContext,
    ) -> Result<RecordingSummary, RecorderError> {
        let mut recording = Recording::begin(shelf, name, config.clone())?;
        recording.add_context(context)?;
        let mut ids = Vec::with_capacity(self.channels.len());
        for channel in &self.channels {
            ids.push(recording.add_channel(channel)?);
        }
        for kept in &self.messages {
            match recording.write(ids[kept.channel.0], kept.stamp, &kept.data) {
                Ok(()) => {}
                Err(RecorderError::TimeBeforeEpoch { .. }) => recording.note_lost(1),
                Err(error) => return Err(error),
            }
        }
        recording.finish()
    }
}

/// A ring that several threads fill; cheap to clone.
#[derive(Clone, Debug)]
pub struct RingSink {
    ring: Arc<Mutex<Ring>>,
}

impl RingSink {
    /// Shares a ring.
    #[must_use]
    pub fn new(ring: Ring) -> Self {
        Self {
            ring: Arc::new(Mutex::new(ring)),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Ring> {
        // A panic elsewhere leaves whole messages behind.
        self.ring.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// As [`Ring::add_channel`].
    ///
    /// # Errors
    /// As there.
    pub fn add_channel(&self, channel: &Channel) -> Result<ChannelId, RecorderError> {
        self.lock().add_channel(channel)
    }

    /// As [`Ring::push`].
    pub fn push(&self, channel: ChannelId, stamp: MessageStamp, data: &[u8]) -> Pushed {
        self.lock().push(channel, stamp, data)
    }

    /// As [`Ring::stats`].
    #[must_use]
    pub fn stats(&self) -> RingStats {
        self.lock().stats()
    }

    /// As [`Ring::snapshot`].
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        self.lock().snapshot()
    }
}
