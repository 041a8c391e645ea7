//! A recording: channels, files, the description beside them, and what went wrong.

use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;

use mcap::records::MessageHeader;

use crate::channel::{Channel, ChannelId, QosProfile, qos_to_yaml};
use crate::config::RecorderConfig;
use crate::context::RunContext;
use crate::error::RecorderError;
use crate::layout::{
    BagMetadata, FileEntry, METADATA_FILE, TimeSpan, TopicDescription, TopicEntry, split_file_name,
};
use crate::shelf::Shelf;
use crate::split::{Split, SplitFault};

/// When a message was received and sent, and its number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MessageStamp {
    /// When the recorder received it [ns since the epoch of the recording's clock].
    pub log_time_nanos: i64,
    /// When it was published, the same where unknown, ns.
    pub publish_time_nanos: i64,
    /// The publisher's number, 0 where there is none.
    pub sequence: u32,
}

/// What a recording came to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordingSummary {
    /// Messages in whole chunks.
    pub messages_written: u64,
    /// Messages taken and not written.
    pub messages_lost: u64,
    /// Bytes in all files.
    pub bytes_written: u64,
    /// Names of the files.
    pub files: Vec<String>,
    /// Messages whose log time is before that of the message before them.
    pub messages_back_in_time: u64,
    /// The largest such step, ns.
    pub largest_step_back_nanos: u64,
}

struct Topic {
    channel: Channel,
    qos: Vec<QosProfile>,
    qos_yaml: String,
    /// Messages in whole chunks.
    sealed: u64,
    /// Messages in the open chunk.
    open: u64,
}

/// A recording on a shelf; see the crate's introduction.
pub struct Recording<S: Shelf> {
    shelf: S,
    name: String,
    config: RecorderConfig,
    topics: Vec<Topic>,
    current: Option<Split<S::File>>,
    finished: Vec<FileEntry>,
    finished_bytes: u64,
    finished_messages: u64,
    finished_span: TimeSpan,
    messages_lost: u64,
    last_log_time_nanos: u64,
    messages_back_in_time: u64,
    largest_step_back_nanos: u64,
    described_at_nanos: Option<u64>,
    /// Why the description beside the files could not be refreshed; messages are written all the same.
    undescribed: Option<io::Error>,
}

impl<S: Shelf> Recording<S> {
    /// Begins a recording: the first file, and a `metadata.yaml` that says it is empty.
    ///
    /// # Errors
    /// A parameter out of range, or the first write failed.
    pub fn begin(shelf: S, name: &str, config: RecorderConfig) -> Result<Self, RecorderError> {
        config.checked()?;
        let mut recording = Self {
            shelf,
            name: name.to_owned(),
            config,
            topics: Vec::new(),
            current: None,
            finished: Vec::new(),
            finished_bytes: 0,
            finished_messages: 0,
            finished_span: TimeSpan::default(),
            messages_lost: 0,
            last_log_time_nanos: 0,
            messages_back_in_time: 0,
            largest_step_back_nanos: 0,
            described_at_nanos: None,
            undescribed: None,
        };
        recording.open_split()?;
        recording.describe()?;
        // One that cannot be described from the begin is not begun.
        recording.described()?;
        Ok(recording)
    }

    /// Puts the run's context into the file. Meant for the beginning, so that a killed recording
    /// has it too.
    ///
    /// # Errors
    /// The context holds what must not be in a bag, or the write failed.
    pub fn add_context(&mut self, context: &RunContext) -> Result<(), RecorderError> {
        let attached = context.attachments()?;
        let records = context.metadata_records(&attached)?;
        self.flush()?;
        for (name, metadata) in records {
            self.with_split(|split| split.add_metadata(&name, metadata))?;
        }
        for attachment in &attached {
            let record = mcap::Attachment {
                log_time: context.start_time_nanos,
                create_time: context.start_time_nanos,
                name: attachment.name.clone(),
                media_type: attachment.media_type.to_owned(),
                data: attachment.text.as_bytes().into(),
            };
            self.with_split(|split| split.attach(&record))?;
        }
        Ok(())
    }

    /// Copies an attachment of another bag.
    pub(crate) fn attach(&mut self, record: &mcap::Attachment<'_>) -> Result<(), RecorderError> {
        self.flush()?;
        self.with_split(|split| split.attach(record))
    }

    /// Copies a metadata record of another bag.
    pub(crate) fn add_metadata(
        &mut self,
        name: &str,
        metadata: &BTreeMap<String, String>,
    ) -> Result<(), RecorderError> {
        self.flush()?;
        self.with_split(|split| split.add_metadata(name, metadata.clone()))
    }

    /// Adds a topic; the same topic and type again gives the same id.
    ///
    /// # Errors
    /// A malformed channel, another type for a known topic, or the write failed.
    pub fn add_channel(&mut self, channel: &Channel) -> Result<ChannelId, RecorderError> {
        let known = self
            .topics
            .iter()
            .position(|t| t.channel.topic == channel.topic);
        if let Some(index) = known {
            let known_type = &self.topics[index].channel.type_name;
            if *known_type == channel.type_name {
                return Ok(ChannelId(index));
            }
            return Err(RecorderError::TypeConflict {
                topic: channel.topic.clone(),
                known_type: known_type.clone(),
                given_type: channel.type_name.clone(),
            });
        }
        let qos = channel.checked()?;
        let qos_yaml = qos_to_yaml(&qos).map_err(|source| self.layout_error(source))?;
        self.with_split(|split| split.add_channel(channel, &qos_yaml))?;
        self.topics.push(Topic {
            channel: channel.clone(),
            qos,
            qos_yaml,
            sealed: 0,
            open: 0,
        });
        Ok(ChannelId(self.topics.len() - 1))
    }

    /// Writes one message: CDR with its encapsulation header. A log time before the last one is
    /// written as it is, and counted.
    ///
    /// # Errors
    /// An unknown channel, a time before the epoch, or the write failed. After a failed write the
    /// recording is stopped: every message from then on is lost and counted.
    pub fn write(
        &mut self,
        channel: ChannelId,
        stamp: MessageStamp,
        data: &[u8],
    ) -> Result<(), RecorderError> {
        let known = self.topics.len();
        let Some(topic) = self.topics.get(channel.0) else {
            return Err(RecorderError::UnknownChannel {
                channel: channel.0,
                known,
            });
        };
        let nanos = |which, time_nanos: i64| {
            u64::try_from(time_nanos).map_err(|_| RecorderError::TimeBeforeEpoch {
                topic: topic.channel.topic.clone(),
                which,
                time_nanos,
            })
        };
        let header = MessageHeader {
            channel_id: 0,
            sequence: stamp.sequence,
            log_time: nanos("log", stamp.log_time_nanos)?,
            publish_time: nanos("publish", stamp.publish_time_nanos)?,
        };
        if self.current.is_none() {
            self.messages_lost += 1;
            return Err(self.stopped());
        }
        let sealed = self.with_split(|split| split.write(channel.0, header, data))?;
        if sealed {
            self.promote();
        }
        self.topics[channel.0].open += 1;
        self.note_time(header.log_time);
        if sealed {
            self.after_seal(header.log_time)?;
        }
        Ok(())
    }

    fn note_time(&mut self, log_time_nanos: u64) {
        let step_back_nanos = self.last_log_time_nanos.saturating_sub(log_time_nanos);
        if step_back_nanos > 0 {
            self.messages_back_in_time += 1;
            self.largest_step_back_nanos = self.largest_step_back_nanos.max(step_back_nanos);
        }
        self.last_log_time_nanos = log_time_nanos;
    }

    fn after_seal(&mut self, log_time_nanos: u64) -> Result<(), RecorderError> {
        let config = &self.config;
        let is_large = |split: &Split<S::File>| {
            config.max_file_bytes > 0 && split.sealed_bytes() >= config.max_file_bytes
        };
        // A file ends with a chunk, so that it spans up to a chunk more.
        let is_long = |split: &Split<S::File>| {
            let longest = config.max_file_nanos();
            let since = split.since_nanos().unwrap_or(log_time_nanos);
            longest.is_some_and(|longest| log_time_nanos.abs_diff(since) >= longest)
        };
        let full = (self.current.as_ref()).is_some_and(|split| is_large(split) || is_long(split));
        if full {
            self.finish_split(None)?;
            self.open_split()?;
        }
        let period_nanos = self.config.metadata_period_nanos();
        let due = self
            .described_at_nanos
            .is_none_or(|at| log_time_nanos.abs_diff(at) >= period_nanos);
        if full || due {
            self.described_at_nanos = Some(log_time_nanos);
            self.describe()?;
        }
        Ok(())
    }

    /// Writes the open chunk. A live recorder calls this when no message has come for a while.
    ///
    /// # Errors
    /// The write failed, or an earlier one did.
    pub fn flush(&mut self) -> Result<(), RecorderError> {
        self.with_split(Split::seal)?;
        self.promote();
        Ok(())
    }

    /// The open chunk is written: its messages count as written.
    fn promote(&mut self) {
        for topic in &mut self.topics {
            topic.sealed += topic.open;
            topic.open = 0;
        }
    }

    /// Ends the recording: index, description, everything on the disk.
    ///
    /// # Errors
    /// The write failed, or an earlier one did; whole chunks stay readable.
    pub fn finish(mut self) -> Result<RecordingSummary, RecorderError> {
        if self.current.is_none() {
            return Err(self.stopped());
        }
        self.flush()?;
        let closing = BTreeMap::from([
            ("messages".to_owned(), self.messages_written().to_string()),
            ("messages_lost".to_owned(), self.messages_lost.to_string()),
            (
                "messages_back_in_time".to_owned(),
                self.messages_back_in_time.to_string(),
            ),
            (
                "largest_step_back_ns".to_owned(),
                self.largest_step_back_nanos.to_string(),
            ),
        ]);
        self.finish_split(Some(closing))?;
        self.describe()?;
        self.described()?;
        Ok(self.summary())
    }

    /// What the recording has come to so far.
    #[must_use]
    pub fn summary(&self) -> RecordingSummary {
        let (_, open) = self.current.as_ref().map_or((0, 0), Split::messages);
        let current_bytes = self.current.as_ref().map_or(0, Split::sealed_bytes);
        let current_name = self.current.iter().map(|split| split.name.clone());
        RecordingSummary {
            messages_written: self.messages_written() + open,
            messages_lost: self.messages_lost,
            bytes_written: self.finished_bytes + current_bytes,
            files: self
                .finished
                .iter()
                .map(|file| file.path.clone())
                .chain(current_name)
                .collect(),
            messages_back_in_time: self.messages_back_in_time,
            largest_step_back_nanos: self.largest_step_back_nanos,
        }
    }

    /// Adds to the count of lost messages: those that the queue in front of the recording lost.
    pub fn note_lost(&mut self, messages: u64) {
        self.messages_lost += messages;
    }

    /// For messages: where the recording stands.
    #[must_use]
    pub fn path(&self) -> PathBuf {
        self.shelf.path().to_owned()
    }

    fn messages_written(&self) -> u64 {
        let (sealed, _) = self.current.as_ref().map_or((0, 0), Split::messages);
        self.finished_messages + sealed
    }

    fn open_split(&mut self) -> Result<(), RecorderError> {
        let name = split_file_name(&self.name, self.finished.len());
        let file = match self.shelf.create(&name) {
            Ok(file) => file,
            Err(error) => return Err(self.fault(&name, SplitFault::Io(error))),
        };
        let split = match Split::begin(name.clone(), file, &self.config) {
            Ok(split) => split,
            Err(fault) => return Err(self.fault(&name, fault)),
        };
        self.current = Some(split);
        for index in 0..self.topics.len() {
            let channel = self.topics[index].channel.clone();
            let qos_yaml = self.topics[index].qos_yaml.clone();
            self.with_split(|split| split.add_channel(&channel, &qos_yaml))?;
        }
        Ok(())
    }

    fn finish_split(
        &mut self,
        closing: Option<BTreeMap<String, String>>,
    ) -> Result<(), RecorderError> {
        self.flush()?;
        if let Some(closing) = closing {
            self.with_split(|split| split.add_metadata("abbe.recording", closing))?;
        }
        let inner = self.metadata().to_inner_yaml();
        let inner = inner.map_err(|source| self.layout_error(source))?;
        // rosbag2 reads its own description from the file when the directory's one is gone.
        let own = BTreeMap::from([("serialized_metadata".to_owned(), inner)]);
        self.with_split(|split| split.add_metadata("rosbag2", own))?;
        self.with_split(Split::finish)?;
        if let Some(split) = self.current.take() {
            let name = split.name.clone();
            let (entry, span) = (split.entry(), split.span());
            match split.close() {
                Ok(bytes) => self.finished_bytes += bytes,
                Err(fault) => return Err(self.fault(&name, fault)),
            }
            self.finished_messages += entry.message_count;
            self.finished_span.join(span);
            self.finished.push(entry);
            if let Err(error) = self.shelf.settle(&name) {
                return Err(self.fault(&name, SplitFault::Io(error)));
            }
        }
        Ok(())
    }

    /// Runs one action on the current file; a fault ends the recording.
    fn with_split<T>(
        &mut self,
        action: impl FnOnce(&mut Split<S::File>) -> Result<T, SplitFault>,
    ) -> Result<T, RecorderError> {
        let Some(split) = self.current.as_mut() else {
            return Err(self.stopped());
        };
        match action(split) {
            Ok(value) => Ok(value),
            Err(fault) => {
                let name = split.name.clone();
                Err(self.fault(&name, fault))
            }
        }
    }

    /// An error where the description could not be written.
    fn described(&mut self) -> Result<(), RecorderError> {
        match self.undescribed.take() {
            None => Ok(()),
            Some(source) => Err(RecorderError::Undescribed {
                path: self.shelf.path().join(METADATA_FILE),
                messages_written: self.summary().messages_written,
                source,
            }),
        }
    }

    /// What goes wrong while messages are written all the same.
    #[must_use]
    pub fn trouble(&self) -> Option<String> {
        let source = self.undescribed.as_ref()?;
        let path = self.shelf.path().join(METADATA_FILE);
        Some(format!(
            "cannot write {}: {source}; messages are written all the same",
            path.display()
        ))
    }

    /// Stops the recording: cuts the file behind its last whole chunk and counts what is lost.
    fn fault(&mut self, name: &str, fault: SplitFault) -> RecorderError {
        if let Some(split) = self.current.take() {
            let (sealed, open) = split.messages();
            let entry = split.entry();
            for topic in &mut self.topics {
                topic.open = 0;
            }
            self.messages_lost += open;
            self.finished_messages += sealed;
            self.finished_bytes += split.sealed_bytes();
            self.finished_span.join(split.span());
            let (own_name, keep_bytes) = (split.name.clone(), split.sealed_bytes());
            split.abandon();
            // Both may fail on a broken disk; the fault itself is what is reported.
            let _ = self.shelf.truncate(&own_name, keep_bytes);
            self.finished.push(entry);
            let _ = self.describe();
        }
        let path = self.shelf.path().join(name);
        let bytes_written = self.finished_bytes;
        let messages_written = self.finished_messages;
        let messages_lost = self.messages_lost;
        match fault {
            SplitFault::Format(source) => RecorderError::Format { path, source },
            SplitFault::Io(source) if is_full(&source) => RecorderError::StorageFull {
                path,
                bytes_written,
                messages_written,
                messages_lost,
                source,
            },
            SplitFault::Io(source) => RecorderError::Write {
                path,
                bytes_written,
                messages_written,
                messages_lost,
                source,
            },
        }
    }

    fn stopped(&self) -> RecorderError {
        RecorderError::Stopped {
            path: self.shelf.path().to_owned(),
            messages_lost: self.messages_lost,
        }
    }

    fn layout_error(&self, source: Box<serde_saphyr::SerializeError>) -> RecorderError {
        RecorderError::Layout {
            path: self.shelf.path().to_owned(),
            source,
        }
    }

    fn describe(&mut self) -> Result<(), RecorderError> {
        let text = self.metadata().to_yaml();
        let text = text.map_err(|source| self.layout_error(source))?;
        // Readers find the files without it too, so that no message is given up for it.
        self.undescribed = self.shelf.replace(METADATA_FILE, text.as_bytes()).err();
        Ok(())
    }

    /// What `metadata.yaml` says of the whole chunks.
    fn metadata(&self) -> BagMetadata {
        let mut files = self.finished.clone();
        let mut span = self.finished_span;
        if let Some(split) = &self.current {
            files.push(split.entry());
            span.join(split.span());
        }
        let topics = self.topics.iter().map(|topic| TopicEntry {
            topic_metadata: TopicDescription {
                name: topic.channel.topic.clone(),
                type_name: topic.channel.type_name.clone(),
                serialization_format: "cdr".to_owned(),
                offered_qos_profiles: topic.qos.clone(),
                type_description_hash: topic.channel.type_hash.clone(),
            },
            message_count: topic.sealed,
        });
        BagMetadata::new(files, topics.collect(), span)
    }
}

fn is_full(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded
    )
}
