//! Writes a damaged bag anew: everything that can be read, with an index.

use std::path::Path;

use crate::channel::Channel;
use crate::config::RecorderConfig;
use crate::error::RecorderError;
use crate::read::{Bag, Event, Loss, Order};
use crate::recording::{MessageStamp, Recording, RecordingSummary};
use crate::shelf::Directory;

/// What a recovery came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recovered {
    /// The new recording.
    pub summary: RecordingSummary,
    /// What the old one lacks.
    pub losses: Vec<Loss>,
    /// Names of attachments that are damaged.
    pub attachments_lost: Vec<String>,
}

/// Reads `from`, a directory or a file in any state, and writes the directory `to` with every
/// message, attachment and metadata record that can be read. `from` stays as it is.
///
/// # Errors
/// `from` cannot be opened, `to` exists, or a write failed.
pub fn recover(
    from: &Path,
    to: &Path,
    config: &RecorderConfig,
) -> Result<Recovered, RecorderError> {
    let bag = Bag::open(from)?;
    let name = to.file_name().and_then(|name| name.to_str());
    let name = name.ok_or_else(|| RecorderError::NoName {
        path: to.to_owned(),
    })?;
    let mut recording = Recording::begin(Directory::create(to)?, name, config.clone())?;
    for (name, metadata) in bag.metadata_records() {
        // rosbag2's own record describes the old files; the new one writes its own.
        if name != "rosbag2" {
            recording.add_metadata(name, metadata)?;
        }
    }
    let mut attachments_lost = Vec::new();
    for name in bag.attachment_names() {
        match bag.stored(name) {
            Ok(Some(found)) => recording.attach(&mcap::Attachment {
                log_time: found.log_time_nanos,
                create_time: found.create_time_nanos,
                name: found.name,
                media_type: found.media_type,
                data: found.data.into(),
            })?,
            Ok(None) | Err(_) => attachments_lost.push(name.to_owned()),
        }
    }
    let mut channels = Vec::new();
    for topic in bag.topics() {
        channels.push(recording.add_channel(&Channel {
            topic: topic.topic.clone(),
            type_name: topic.type_name.clone(),
            type_hash: topic.type_hash.clone(),
            definition: topic.definition.clone(),
            qos_yaml: topic.qos_yaml.clone(),
        })?);
    }
    let mut losses = Vec::new();
    let mut messages = bag.messages(Order::File);
    while let Some(event) = messages.next_event() {
        match event {
            Event::Message(message) => {
                let stamp = MessageStamp {
                    log_time_nanos: signed(message.log_time_nanos),
                    publish_time_nanos: signed(message.publish_time_nanos),
                    sequence: message.sequence,
                };
                recording.write(channels[message.topic.index()], stamp, message.data)?;
            }
            Event::Loss(loss) => losses.push(loss),
        }
    }
    Ok(Recovered {
        summary: recording.finish()?,
        losses,
        attachments_lost,
    })
}

/// Stamps beyond the year 2262 come only from damaged files; they become that year.
fn signed(nanos: u64) -> i64 {
    i64::try_from(nanos).unwrap_or(i64::MAX)
}
