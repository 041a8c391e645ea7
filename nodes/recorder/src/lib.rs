//! Records topics to MCAP in the layout of rosbag2, and reads them back.
//!
//! A recording is a directory: `metadata.yaml` (version 9, as rosbag2 of ROS 2 Jazzy writes it) and
//! one or more files `<name>_<n>.mcap` of profile `ros2`. A message is bytes: CDR with its
//! encapsulation header, a log time (when the recorder got it), a publish time and a sequence
//! number. Its type is unknown here; a [`Channel`] brings the name, the RIHS01 hash and the
//! `ros2msg` text, which go into the file, so that every reader can decode it.
//!
//! Messages are gathered into chunks, compressed and protected by a CRC. A chunk is written when it
//! is large enough or old enough (in log time, so that a recording of simulated time is the same
//! bytes each time); killing the process loses what is in the open chunk and no more. The file's
//! index comes last; a file without it is read from its beginning by [`Bag`], which says where and
//! why it stops, and [`recover`] writes it anew with an index.
//!
//! A [`Ring`] keeps the last minutes in memory instead, and gives them out when asked.
//!
//! A [`RunContext`] puts what a replay needs into the same file: the machine file, programs, the
//! scenario, the resolved parameters, the seed and the commit. The plant's true state has no place
//! in it.

mod channel;
mod config;
mod context;
mod dump;
mod error;
mod layout;
mod queue;
mod read;
mod recording;
mod recover;
mod reflect;
mod ring;
mod shelf;
mod split;

pub use channel::{Channel, ChannelId, Durability, History, Liveliness, QosProfile, QosTime};
pub use channel::{Reliability, qos_from_yaml, qos_to_yaml};
pub use config::{ChunkCompression, NodeConfig, RecorderConfig, RingConfig, WhenFull};
pub use context::{
    Attached, CALL_RECORD, END_RECORD, MACHINE_FILE, MessageOrder, NODES_RECORD, RecordedCall,
    RecordedRun, RunContext, RunNode, verify_attachments,
};
pub use dump::dump_json;
pub use error::RecorderError;
pub use layout::{BagMetadata, FileEntry, TopicEntry, split_file_name};
pub use queue::{Pushed, Recorder, RecorderSink, RecorderStats};
pub use read::{
    Attachment, Bag, Event, Loss, LossReason, MessageRef, Messages, Order, TopicId, TopicInfo,
};
pub use recording::{MessageStamp, Recording, RecordingSummary};
pub use recover::{Recovered, recover};
pub use reflect::{ReflectError, Reflector, Value};
pub use ring::{Ring, RingSink, RingStats, Snapshot};
pub use shelf::{Directory, Shelf};
