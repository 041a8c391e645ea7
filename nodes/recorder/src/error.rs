//! What can go wrong with a recording.

use std::io;
use std::path::PathBuf;

use metrology::bound::BoundError;

/// Errors of writing and of opening a recording. Damage met while reading is no error but a
/// [`crate::Loss`].
#[derive(Debug, thiserror::Error)]
pub enum RecorderError {
    /// A recording never overwrites.
    #[error("{path} exists already, a recording overwrites nothing")]
    Exists {
        /// The directory.
        path: PathBuf,
    },
    /// What rosbag2 writes besides MCAP with compressed chunks.
    #[error("{path}: {what}, which is not read: `ros2 bag convert` makes MCAP of it")]
    NotRead {
        /// The file or directory.
        path: PathBuf,
        /// Its kind.
        what: &'static str,
    },
    /// A file neither begins nor ends as an MCAP file does.
    #[error("{path} is no bag: it is no MCAP file")]
    NotMcap {
        /// The file.
        path: PathBuf,
    },
    /// All files of a bag are empty.
    #[error("{path} is no bag: nothing is in it (0 bytes)")]
    Empty {
        /// The file, or the folder of several.
        path: PathBuf,
    },
    /// A file of a bag is no regular file.
    #[error("{path} is {kind}, must be a regular file: copy the bag to a folder")]
    NotRegular {
        /// The file.
        path: PathBuf,
        /// What it is.
        kind: &'static str,
    },
    /// A path has no last part to name the files by.
    #[error("{path} has no name to call a recording by")]
    NoName {
        /// The path.
        path: PathBuf,
    },
    /// A directory or file could not be made.
    #[error("cannot create {path}: {source}")]
    Create {
        /// The directory or file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The disk is full; whole chunks before it stay readable.
    #[error(
        "no space left for {path}: {bytes_written} bytes with {messages_written} messages are written, {messages_lost} messages are lost"
    )]
    StorageFull {
        /// The file.
        path: PathBuf,
        /// Bytes that stay in the file.
        bytes_written: u64,
        /// Messages of this recording that stay readable.
        messages_written: u64,
        /// Messages taken but not written.
        messages_lost: u64,
        /// The system's reason.
        source: io::Error,
    },
    /// A write failed for another reason.
    #[error(
        "cannot write {path}: {source}; {bytes_written} bytes with {messages_written} messages are written, {messages_lost} messages are lost"
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// Bytes that stay in the file.
        bytes_written: u64,
        /// Messages of this recording that stay readable.
        messages_written: u64,
        /// Messages taken but not written.
        messages_lost: u64,
        /// The system's reason.
        source: io::Error,
    },
    /// The description beside the files cannot be written; every message is in the files.
    #[error(
        "cannot write {path}: {source}; the {messages_written} messages are written, and the bag is read without it"
    )]
    Undescribed {
        /// The description.
        path: PathBuf,
        /// Messages in the files.
        messages_written: u64,
        /// The system's reason.
        source: io::Error,
    },
    /// The file format has no place for it (65,535 channels or schemas).
    #[error("{path}: {source}")]
    Format {
        /// The file.
        path: PathBuf,
        /// The format's reason.
        source: mcap::McapError,
    },
    /// The recording stopped at an earlier error.
    #[error("{path} stopped at an earlier error, {messages_lost} messages are lost")]
    Stopped {
        /// The recording.
        path: PathBuf,
        /// Messages offered since that are not written.
        messages_lost: u64,
    },
    /// A channel id that was never given out.
    #[error("channel {channel} is not one of the {known} channels of this recording")]
    UnknownChannel {
        /// The id.
        channel: usize,
        /// Number of channels.
        known: usize,
    },
    /// One topic, two types.
    #[error("topic {topic} has type {known_type}, so it cannot have type {given_type}")]
    TypeConflict {
        /// The topic.
        topic: String,
        /// Type of the first channel.
        known_type: String,
        /// Type of the refused channel.
        given_type: String,
    },
    /// Not `package/kind/Name`.
    #[error("topic {topic}: type {type_name:?} is not of the form package/msg/Name")]
    TypeName {
        /// The topic.
        topic: String,
        /// The name given.
        type_name: String,
    },
    /// Not a RIHS01 hash.
    #[error("topic {topic}: type hash {type_hash:?} is not RIHS01_ and 64 hexadecimal digits")]
    TypeHash {
        /// The topic.
        topic: String,
        /// The hash given.
        type_hash: String,
    },
    /// A name that ROS 2 does not take.
    #[error("topic {topic:?} is not a full topic name")]
    TopicName {
        /// The name given.
        topic: String,
    },
    /// QoS text that is not a list of profiles.
    #[error("topic {topic}: offered QoS: {source}")]
    Qos {
        /// The topic.
        topic: String,
        /// The reader's reason.
        source: Box<serde_saphyr::Error>,
    },
    /// Before the epoch there is no log time.
    #[error("topic {topic}: {which} time {time_nanos} ns is before the epoch")]
    TimeBeforeEpoch {
        /// The topic.
        topic: String,
        /// `log` or `publish`.
        which: &'static str,
        /// The time, ns.
        time_nanos: i64,
    },
    /// A parameter outside its limits.
    #[error(transparent)]
    Parameter(#[from] BoundError),
    /// The plant's truth never enters a bag.
    #[error("{attachment}: key {key} holds the plant's truth, which never enters a bag")]
    PlantTruth {
        /// The attachment refused.
        attachment: String,
        /// The key.
        key: String,
    },
    /// An attachment that cannot be read as YAML.
    #[error("{attachment}: {source}")]
    Yaml {
        /// The attachment refused.
        attachment: String,
        /// The reader's reason.
        source: Box<serde_saphyr::Error>,
    },
    /// A name that would leave the bag's own folders.
    #[error("{name:?} is not a plain file name")]
    AttachmentName {
        /// The name given.
        name: String,
    },
    /// Two attachments of one name.
    #[error("{name} is attached twice")]
    AttachedTwice {
        /// The name.
        name: String,
    },
    /// An attachment does not match the hash recorded beside it.
    #[error("{name}: sha256 is {found}, the bag says {recorded}")]
    AttachmentHash {
        /// The attachment.
        name: String,
        /// Hash of what is in the bag.
        found: String,
        /// Hash that was recorded.
        recorded: String,
    },
    /// An attachment is not in the bag, though its hash is.
    #[error("{name}: is absent, the bag says that its sha256 is {recorded}")]
    AttachmentAbsent {
        /// The attachment.
        name: String,
        /// Hash that was recorded.
        recorded: String,
    },
    /// The layout could not be written as YAML.
    #[error("cannot write the layout of {path}: {source}")]
    Layout {
        /// The recording.
        path: PathBuf,
        /// The writer's reason.
        source: Box<serde_saphyr::SerializeError>,
    },
    /// A path that cannot be opened.
    #[error("cannot open {path}: {source}")]
    Open {
        /// The path.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// A part of a bag that is there and cannot be read.
    #[error("{loss}")]
    Damaged {
        /// Where and why.
        loss: crate::Loss,
    },
    /// A directory without a single file.
    #[error("{path} holds no .mcap file{}", inside.as_deref().map_or_else(String::new, |bag| format!("; {} does", bag.display())))]
    NoFiles {
        /// The directory.
        path: PathBuf,
        /// A directory in it that is a recording.
        inside: Option<PathBuf>,
    },
    /// The worker thread could not be started or did not come back.
    #[error("the thread that writes {path} is gone")]
    WorkerGone {
        /// The recording.
        path: PathBuf,
    },
    /// A dump could not be written.
    #[error("cannot write the dump: {source}")]
    Dump {
        /// The system's reason.
        source: io::Error,
    },
    /// A name that no topic can have.
    #[error(
        "{key}[{index}] = \"{name}\": names of topics are absolute: must begin with / (or with *, which stands for any run of characters)"
    )]
    RelativeName {
        /// The parameter.
        key: &'static str,
        /// Its place in the list.
        index: usize,
        /// The name.
        name: String,
    },
    /// The list of topics is empty.
    #[error(
        "topics = []: nothing would be recorded: name topics, or leave the parameter out to record all"
    )]
    NoTopics,
    /// Every topic to record is left out.
    #[error(
        "exclude = {exclude:?}: leaves out every topic of {topics:?}, so that nothing would be recorded: exclude less"
    )]
    NothingToRecord {
        /// Patterns of topics to record.
        topics: Vec<String>,
        /// Patterns of topics to leave out.
        exclude: Vec<String>,
    },
    /// A message that its definition does not describe.
    #[error("topic {topic}, message {message} at {log_time_nanos} ns: {source}")]
    Decode {
        /// The topic.
        topic: String,
        /// Number of the message in the bag, from 0.
        message: u64,
        /// Its log time, ns.
        log_time_nanos: u64,
        /// Why.
        source: crate::ReflectError,
    },
    /// A definition that cannot be read.
    #[error("topic {topic}, type {type_name}: {source}")]
    Definition {
        /// The topic.
        topic: String,
        /// Its type.
        type_name: String,
        /// Why.
        source: crate::ReflectError,
    },
}

impl RecorderError {
    /// Corrects the count of lost messages by what has come of it meanwhile.
    pub(crate) fn set_lost(&mut self, messages: u64) {
        if let Self::StorageFull { messages_lost, .. }
        | Self::Write { messages_lost, .. }
        | Self::Stopped { messages_lost, .. } = self
        {
            *messages_lost = messages;
        }
    }

    /// Messages that stay readable and messages that are lost, of a recording that stopped at a failed write.
    #[must_use]
    pub fn written_and_lost(&self) -> Option<(u64, u64)> {
        match self {
            Self::StorageFull {
                messages_written,
                messages_lost,
                ..
            }
            | Self::Write {
                messages_written,
                messages_lost,
                ..
            } => Some((*messages_written, *messages_lost)),
            _ => None,
        }
    }
}
