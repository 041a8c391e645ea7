//! Reading a bag, whole or damaged, in flat memory.
//!
//! [`Bag::open`] reads the index at the end of each file, or, where there is none, walks through
//! the file. [`Bag::messages`] then gives every message that can be trusted: a chunk is given when
//! its CRC is right; of a chunk that the file's end cuts, the messages before the cut are given.
//! Where something is missing a [`Loss`] says at which byte and why, and reading goes on behind it
//! where the records' frames allow.

mod bag;
mod chunk;
mod description;
mod fewer;
mod file_order;
mod foreign;
mod framing;
mod index;
mod parts;
mod regular;
mod time_order;
mod walk;

use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::path::PathBuf;

pub use bag::Bag;

/// Largest chunk that is read, before and after decompression, byte.
pub(crate) const LARGEST_READ_CHUNK_BYTES: u64 = 256 << 20;

/// Order in which messages are given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// As they stand in the files: the order of recording. Checks the CRC of whole files too.
    #[default]
    File,
    /// By log time; equal times in the order of recording.
    LogTime,
}

/// Position of a topic in [`Bag::topics`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TopicId(pub(crate) usize);

impl TopicId {
    /// Position in [`Bag::topics`].
    #[must_use]
    pub fn index(self) -> usize {
        self.0
    }
}

/// A topic of a bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TopicInfo {
    /// Full name.
    pub topic: String,
    /// `package/msg/Name`.
    pub type_name: String,
    /// RIHS01 hash or empty.
    pub type_hash: String,
    /// Encoding of the definition, `ros2msg` or empty.
    pub definition_encoding: String,
    /// Definition text or empty.
    pub definition: String,
    /// Encoding of the messages, `cdr`.
    pub message_encoding: String,
    /// QoS of the publishers as recorded.
    pub qos_yaml: String,
    /// Messages in all files.
    pub message_count: u64,
}

/// One message; the bytes are valid until the next step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MessageRef<'a> {
    /// Its topic.
    pub topic: TopicId,
    /// When it was received, ns.
    pub log_time_nanos: u64,
    /// When it was published, ns.
    pub publish_time_nanos: u64,
    /// The publisher's number.
    pub sequence: u32,
    /// CDR with its encapsulation header.
    pub data: &'a [u8],
}

/// What reading gives.
#[derive(Debug, PartialEq)]
pub enum Event<'a> {
    /// A message.
    Message(MessageRef<'a>),
    /// Something is missing here.
    Loss(Loss),
}

/// Something is missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loss {
    /// The file.
    pub file: PathBuf,
    /// Where in it.
    pub at_byte: u64,
    /// Why.
    pub reason: LossReason,
    /// Messages given before.
    pub messages_read: u64,
}

impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (file, at, read) = (self.file.display(), self.at_byte, self.messages_read);
        write!(
            f,
            "{file}, byte {at}: {}; {read} messages were read before",
            self.reason
        )
    }
}

/// Why something is missing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LossReason {
    /// No MCAP file begins here.
    #[error("not an MCAP file")]
    NotMcap,
    /// A file that the description names is absent.
    #[error("the file is absent")]
    Absent,
    /// A name of a file of the bag is a folder, a pipe, or a link that leads nowhere.
    #[error(
        "is {kind}, must be a regular file: nothing of it is read; move it out of the bag's folder"
    )]
    NotRegular {
        /// What it is.
        kind: &'static str,
    },
    /// A file that rosbag2 writes besides MCAP with compressed chunks, beside others.
    #[error("{what}, which is not read: `ros2 bag convert` makes MCAP of it")]
    NotRead {
        /// What it is.
        what: &'static str,
    },
    /// The file ends inside a record.
    #[error(
        "the file was read up to its end at byte {end_byte}, which cuts a record of kind {opcode:#04x}: what followed is unknown"
    )]
    Cut {
        /// Kind of the record.
        opcode: u8,
        /// Where the file ends, bytes from its begin.
        end_byte: u64,
    },
    /// The file ends behind a whole record, without its end.
    #[error(
        "the file was read up to its end, but has no index: what followed, if anything, is unknown"
    )]
    NoEnd,
    /// A chunk's contents are not what was written.
    #[error("chunk of {chunk_bytes} bytes: CRC is {calculated:08x}, was {saved:08x}")]
    ChunkCrc {
        /// Its length in the file.
        chunk_bytes: u64,
        /// The CRC recorded.
        saved: u32,
        /// The CRC of what is there.
        calculated: u32,
    },
    /// A chunk's records are of another length than its header states.
    #[error(
        "chunk of {chunk_bytes} bytes: its records have {record_bytes} bytes, its header states {saved_bytes}"
    )]
    ChunkLength {
        /// Its length in the file.
        chunk_bytes: u64,
        /// Length of the records by its header.
        saved_bytes: u64,
        /// Length of the records.
        record_bytes: u64,
    },
    /// A chunk that cannot be decompressed.
    #[error("chunk of {chunk_bytes} bytes cannot be decompressed by {compression:?}")]
    Decompression {
        /// Its length in the file.
        chunk_bytes: u64,
        /// Name of its compression.
        compression: String,
    },
    /// A chunk larger than is read.
    #[error("chunk of {bytes} bytes, at most {limit_bytes} are read")]
    ChunkTooLarge {
        /// Its length.
        bytes: u64,
        /// The limit.
        limit_bytes: u64,
    },
    /// Bytes that are no record.
    #[error("not a record (kind {opcode:#04x})")]
    BadRecord {
        /// The byte where a kind should be.
        opcode: u8,
    },
    /// A message on a channel that no record describes.
    #[error("message on channel {channel}, which the file does not describe")]
    UnknownChannel {
        /// Its number.
        channel: u16,
    },
    /// The file is not what was written, though every chunk is.
    #[error("file up to its index: CRC is {calculated:08x}, was {saved:08x}")]
    FileCrc {
        /// The CRC recorded.
        saved: u32,
        /// The CRC of what is there.
        calculated: u32,
    },
    /// The description beside the files is damaged, or contradicts them.
    #[error("{what}; messages are read without it: write it anew (`ros2 bag reindex`)")]
    Description {
        /// What is wrong, with key, value and what the files hold.
        what: String,
    },
    /// The recorder wrote more messages than the files hold.
    #[error(
        "{recorded} messages were recorded, and the files hold {held}{of_topics}: some were taken out or lost: take an undamaged copy of the bag"
    )]
    Fewer {
        /// Messages that the recorder wrote.
        recorded: u64,
        /// Messages that are there.
        held: u64,
        /// The topics that lack some, in words.
        of_topics: String,
    },
    /// The machine file is absent, cannot be read, or is not the one that was recorded.
    #[error("{what}; the bag is read without it: take an undamaged copy of the bag")]
    Attachment {
        /// What is wrong, with name and reason.
        what: String,
    },
    /// The index at the end cannot be used; the file was walked through instead.
    #[error("the index is damaged")]
    Index,
    /// The system cannot read on.
    #[error("cannot be read: {kind}")]
    Io {
        /// The system's reason.
        kind: io::ErrorKind,
    },
}

impl LossReason {
    /// Whether it is of what stands beside the messages: none of them is lost.
    #[must_use]
    pub const fn is_beside_messages(&self) -> bool {
        matches!(self, Self::Description { .. } | Self::Attachment { .. })
    }
}

/// A text or blob of the bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// Name, e.g. `machine.yaml`.
    pub name: String,
    /// IANA media type.
    pub media_type: String,
    /// Time it was recorded, ns.
    pub log_time_nanos: u64,
    /// Time it was made, ns.
    pub create_time_nanos: u64,
    /// Contents.
    pub data: Vec<u8>,
}

/// Name and contents of a metadata record.
pub(crate) type MetadataRecord = (String, BTreeMap<String, String>);

/// Messages of a bag, one step at a time.
pub struct Messages<'b> {
    inner: Inner<'b>,
}

enum Inner<'b> {
    File(file_order::FileOrder<'b>),
    LogTime(time_order::TimeOrder<'b>),
}

impl Messages<'_> {
    /// The next message or loss; `None` at the end.
    pub fn next_event(&mut self) -> Option<Event<'_>> {
        match &mut self.inner {
            Inner::File(order) => order.next_event(),
            Inner::LogTime(order) => order.next_event(),
        }
    }
}
