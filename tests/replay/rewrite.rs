//! A bag with something changed in it.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use mcap::records::{AttachmentHeader, MessageHeader, Metadata, Record};
use sha2::{Digest, Sha256};

/// A message on its way into the changed bag.
#[derive(Clone)]
pub struct Copied {
    /// Full name of its topic.
    pub topic: String,
    /// Its bytes.
    pub data: Vec<u8>,
    /// Times and channel.
    pub header: MessageHeader,
}

/// Changes the messages, all in the order of recording.
pub type ChangeMessages<'c> = &'c dyn Fn(&mut Vec<Copied>);

/// What a bag says of a topic's messages.
pub struct Described {
    /// `package/msg/Name`.
    pub type_name: String,
    /// Text of the definition.
    pub definition: Vec<u8>,
    /// Encoding of the messages.
    pub message_encoding: String,
    /// The type's hash.
    pub type_hash: String,
}

/// Changes the description of a topic's messages.
pub type Describe<'c> = &'c dyn Fn(&str, &mut Described);

/// What is changed.
#[derive(Default)]
pub struct Change<'c> {
    /// The messages.
    pub messages: Option<ChangeMessages<'c>>,
    /// A text in an attachment: its name, what stood there, what stands there now.
    pub attachment: Option<(&'c str, &'c str, &'c str)>,
    /// Topics that are left out, their channels too.
    pub without: Option<&'c dyn Fn(&str) -> bool>,
    /// The descriptions of topics' types.
    pub describe: Option<Describe<'c>>,
    /// Place of a service call that is left out, among all.
    pub without_call: Option<usize>,
    /// Whether the hash beside a changed attachment stays the old one.
    pub keeps_hash: bool,
    /// Whether the count of the recorder's messages stays the old one.
    pub keeps_count: bool,
}

/// The contents of a bag, with the channels that its messages will have.
#[derive(Default)]
struct Contents {
    messages: Vec<Copied>,
    attachments: Vec<(AttachmentHeader, Vec<u8>)>,
    metadata: Vec<Metadata>,
}

type Writer = mcap::Writer<BufWriter<File>>;

/// Copies the one file of a bag into the folder `to`, changed.
pub fn rewrite(from: &Path, to: &Path, change: &Change<'_>) {
    std::fs::create_dir_all(to).unwrap();
    let bytes = std::fs::read(from).unwrap();
    let file = File::create(to.join("bag_0.mcap")).unwrap();
    let mut writer = mcap::WriteOptions::new()
        .profile("ros2")
        .compression(None)
        .create(BufWriter::new(file))
        .unwrap();
    let keeps = |topic: &str| !change.without.is_some_and(|without| without(topic));
    let mut contents = read(&bytes, &mut writer, &keeps, change.describe);
    if let Some(change_messages) = change.messages {
        change_messages(&mut contents.messages);
    }
    if let Some((name, old, new)) = change.attachment {
        contents.replace(name, (old, new), change.keeps_hash);
    }
    if let Some(nth) = change.without_call {
        contents.remove_call(nth);
    }
    if !change.keeps_count {
        contents.count_anew();
    }
    contents.write(writer);
}

/// Everything in a file but what is not kept; its schemas and channels go into the new one at once.
fn read(
    bytes: &[u8],
    writer: &mut Writer,
    keeps: &dyn Fn(&str) -> bool,
    describe: Option<Describe<'_>>,
) -> Contents {
    let mut schemas = BTreeMap::new();
    let mut channels = BTreeMap::new();
    let mut contents = Contents::default();
    for record in mcap::read::ChunkFlattener::new(bytes).unwrap() {
        match record.unwrap() {
            Record::Schema { header, data } => {
                schemas.insert(header.id, (header, data.into_owned()));
            }
            Record::Channel(mut channel) if keeps(&channel.topic) => {
                let (schema, definition) = &schemas[&channel.schema_id];
                let hash = channel.metadata.remove("topic_type_hash");
                let mut described = Described {
                    type_name: schema.name.clone(),
                    definition: definition.clone(),
                    message_encoding: channel.message_encoding,
                    type_hash: hash.unwrap_or_default(),
                };
                if let Some(describe) = describe {
                    describe(&channel.topic, &mut described);
                }
                let Described {
                    type_name,
                    definition,
                    message_encoding,
                    type_hash,
                } = described;
                let hash = ("topic_type_hash".to_owned(), type_hash);
                channel.metadata.extend([hash]);
                let schema = writer.add_schema(&type_name, &schema.encoding, &definition);
                let (topic, metadata) = (&channel.topic, &channel.metadata);
                let id = writer.add_channel(schema.unwrap(), topic, &message_encoding, metadata);
                channels.insert(channel.id, (id.unwrap(), channel.topic));
            }
            Record::Message { mut header, data } => {
                let Some((id, topic)) = channels.get(&header.channel_id) else {
                    continue;
                };
                header.channel_id = *id;
                contents.messages.push(Copied {
                    topic: topic.clone(),
                    data: data.into_owned(),
                    header,
                });
            }
            Record::Attachment { header, data, .. } => {
                contents.attachments.push((header, data.into_owned()));
            }
            Record::Metadata(record) => contents.metadata.push(record),
            _ => {}
        }
    }
    contents
}

impl Contents {
    fn replace(&mut self, name: &str, (old, new): (&str, &str), keeps_hash: bool) {
        let mut attachments = self.attachments.iter_mut();
        let (_, data) = attachments.find(|(h, _)| h.name == name).unwrap();
        let text = String::from_utf8(std::mem::take(data)).unwrap();
        assert!(text.contains(old), "{name}: no {old} in {text}");
        *data = text.replace(old, new).into_bytes();
        if !keeps_hash {
            let hash = Sha256::digest(&*data);
            let hash = hash.iter().map(|byte| format!("{byte:02x}")).collect();
            let mut records = self.metadata.iter_mut();
            let hashes = records.find(|record| record.name == "abbe.attachments");
            hashes.unwrap().metadata.insert(name.to_owned(), hash);
        }
    }

    /// States as many messages as there are.
    fn count_anew(&mut self) {
        let n = self.messages.len().to_string();
        let records = self.metadata.iter_mut();
        for record in records.filter(|record| record.name == "abbe.recording") {
            record.metadata.insert("messages".to_owned(), n.clone());
        }
    }

    fn remove_call(&mut self, nth: usize) {
        let records = self.metadata.iter().enumerate();
        let mut calls = records.filter(|(_, record)| record.name == "abbe.call");
        let (place, _) = calls.nth(nth).unwrap();
        self.metadata.remove(place);
    }

    fn write(self, mut writer: Writer) {
        for (header, data) in self.attachments {
            let attachment = mcap::Attachment {
                log_time: header.log_time,
                create_time: header.create_time,
                name: header.name,
                media_type: header.media_type,
                data: Cow::Owned(data),
            };
            writer.attach(&attachment).unwrap();
        }
        for record in &self.metadata {
            writer.write_metadata(record).unwrap();
        }
        for message in &self.messages {
            let written = writer.write_to_known_channel(&message.header, &message.data);
            written.unwrap();
        }
        writer.finish().unwrap();
    }
}
