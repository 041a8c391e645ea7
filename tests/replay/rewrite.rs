//! A bag with something changed in it.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use mcap::records::{MessageHeader, Record};
use sha2::{Digest, Sha256};

/// A message on its way into the changed bag.
pub struct Copied {
    /// Full name of its topic.
    pub topic: String,
    /// Its bytes.
    pub data: Vec<u8>,
    header: MessageHeader,
}

/// What is changed.
#[derive(Default)]
pub struct Change<'c> {
    /// Changes the messages, all in the order of recording.
    pub messages: Option<&'c dyn Fn(&mut Vec<Copied>)>,
    /// Replaces a text in an attachment: its name, what stood there, what stands there now.
    pub attachment: Option<(&'c str, &'c str, &'c str)>,
    /// Whether the hash beside a changed attachment stays the old one.
    pub keeps_hash: bool,
}

/// Copies the one file of a bag into the folder `to`, changed.
pub fn rewrite(from: &Path, to: &Path, change: &Change<'_>) {
    std::fs::create_dir_all(to).unwrap();
    let bytes = std::fs::read(from).unwrap();
    let file = std::fs::File::create(to.join("bag_0.mcap")).unwrap();
    let mut writer = mcap::WriteOptions::new()
        .profile("ros2")
        .compression(None)
        .create(std::io::BufWriter::new(file))
        .unwrap();
    let mut schemas = BTreeMap::new();
    let mut channels = BTreeMap::new();
    let mut messages = Vec::new();
    let (mut attachments, mut metadata) = (Vec::new(), Vec::new());
    for record in mcap::read::ChunkFlattener::new(&bytes).unwrap() {
        match record.unwrap() {
            Record::Schema { header, data } => {
                let id = writer
                    .add_schema(&header.name, &header.encoding, &data)
                    .unwrap();
                schemas.insert(header.id, id);
            }
            Record::Channel(channel) => {
                let schema = schemas[&channel.schema_id];
                let encoding = &channel.message_encoding;
                let id = writer
                    .add_channel(schema, &channel.topic, encoding, &channel.metadata)
                    .unwrap();
                channels.insert(channel.id, (id, channel.topic));
            }
            Record::Message { mut header, data } => {
                let (id, topic) = &channels[&header.channel_id];
                header.channel_id = *id;
                messages.push(Copied {
                    topic: topic.clone(),
                    data: data.into_owned(),
                    header,
                });
            }
            Record::Attachment { header, data, .. } => {
                attachments.push((header, data.into_owned()));
            }
            Record::Metadata(record) => metadata.push(record),
            _ => {}
        }
    }
    if let Some(change_messages) = change.messages {
        change_messages(&mut messages);
    }
    for (header, mut data) in attachments {
        if let Some((_, old, new)) = change.attachment.filter(|(name, ..)| *name == header.name) {
            let text = String::from_utf8(data).unwrap();
            assert!(text.contains(old), "{}: no {old} in {text}", header.name);
            data = text.replace(old, new).into_bytes();
            if !change.keeps_hash {
                let hash = Sha256::digest(&data)
                    .iter()
                    .map(|byte| format!("{byte:02x}"))
                    .collect();
                let mut records = metadata.iter_mut();
                let hashes = records
                    .find(|record| record.name == "abbe.attachments")
                    .unwrap();
                hashes.metadata.insert(header.name.clone(), hash);
            }
        }
        let attachment = mcap::Attachment {
            log_time: header.log_time,
            create_time: header.create_time,
            name: header.name,
            media_type: header.media_type,
            data: Cow::Owned(data),
        };
        writer.attach(&attachment).unwrap();
    }
    for record in &metadata {
        writer.write_metadata(record).unwrap();
    }
    for message in &messages {
        writer
            .write_to_known_channel(&message.header, &message.data)
            .unwrap();
    }
    writer.finish().unwrap();
}
