//! A bag: its files, topics, texts.
#![expect(
    clippy::disallowed_methods,
    reason = "opening a bag reads files; only recorder, replayer and the command line do"
)]

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

use mcap::records::{Record, op};
use metrology::text::{self, Comments};

use super::description;
use super::fewer;
use super::file_order::FileOrder;
use super::foreign;
use super::index::{FileIndex, parse};
use super::parts::{self, Parts};
use super::regular;
use super::time_order::TimeOrder;
use super::walk::Walker;
use super::{
    Attachment, Inner, LARGEST_READ_CHUNK_BYTES, Loss, LossReason, Messages, Order, TopicId,
    TopicInfo,
};
use crate::context::{self, MACHINE_FILE, MessageOrder, RecordedRun};
use crate::error::RecorderError;
use crate::layout::{METADATA_FILE, TimeSpan};

/// One file of a bag.
#[derive(Debug)]
pub(crate) struct BagFile {
    pub(crate) path: PathBuf,
    pub(super) index: FileIndex,
    /// Topic of each channel number.
    pub(super) topics: Vec<Option<TopicId>>,
}

impl BagFile {
    pub(super) fn open(&self) -> Result<File, LossReason> {
        File::open(&self.path).map_err(|error| LossReason::Io { kind: error.kind() })
    }

    pub(super) fn topic(&self, channel: u16) -> Option<TopicId> {
        self.topics.get(usize::from(channel)).copied().flatten()
    }

    pub(super) fn loss(&self, at_byte: u64, reason: LossReason, messages_read: u64) -> Loss {
        Loss {
            file: self.path.clone(),
            at_byte,
            reason,
            messages_read,
        }
    }
}

/// The first directory in another one, by name, that holds a recording.
fn recording_in(path: &Path) -> Option<PathBuf> {
    let entries = std::fs::read_dir(path).ok()?.flatten();
    let folders = entries.map(|entry| entry.path()).filter(|it| it.is_dir());
    let is_one = |it: &PathBuf| parts::of(it).is_ok_and(|parts| !parts.files.is_empty());
    folders.filter(is_one).min()
}

/// A recording, open for reading.
#[derive(Debug)]
pub struct Bag {
    path: PathBuf,
    files: Vec<BagFile>,
    topics: Vec<TopicInfo>,
    /// Files of the bag of which nothing can be read.
    unread: Vec<Loss>,
    description: Vec<Loss>,
}

impl Bag {
    /// Opens a rosbag2 directory or one `.mcap` file. Damage is no error here: [`Bag::messages`] reports it, as each
    /// file beside others of which nothing can be read. Files of a composed run are in the order of their log times.
    ///
    /// # Errors
    /// The path cannot be opened, the directory holds no `.mcap` file that can be read, or rosbag2 has compressed it by
    /// itself.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, RecorderError> {
        let path = path.as_ref();
        let failed = |path: &Path, source| RecorderError::Open {
            path: path.to_owned(),
            source,
        };
        let parts = if path.is_dir() {
            parts::of(path).map_err(|source| failed(path, source))?
        } else {
            Parts::one(path)
        };
        if parts.is_empty() {
            return Err(RecorderError::NoFiles {
                path: path.to_owned(),
                inside: recording_in(path),
            });
        }
        let (names, unread) = foreign::readable(path, parts)?;
        let mut bag = Self {
            path: path.to_owned(),
            files: Vec::new(),
            topics: Vec::new(),
            unread,
            description: Vec::new(),
        };
        for name in names {
            let mut file = regular::open(&name)?;
            bag.add_file(name, FileIndex::read(&mut file));
        }
        if RecordedRun::of(&bag).is_some_and(|run| run.order == MessageOrder::Total) {
            parts::sort_by_time(&mut bag.files);
        }
        bag.description = bag.described_wrongly();
        let attached_wrongly = bag.attached_wrongly();
        bag.description.extend(attached_wrongly);
        let fewer = bag.fewer_than_recorded();
        bag.description.extend(fewer);
        Ok(bag)
    }

    /// Whether every file is whole, so that its messages are counted.
    fn are_counts_known(&self) -> bool {
        let is_whole = |file: &BagFile| file.index.end_loss.is_none() && !file.index.index_damaged;
        self.unread.is_empty() && self.files.iter().all(is_whole)
    }

    /// What the files lack of the messages that their recorder wrote.
    fn fewer_than_recorded(&self) -> Option<Loss> {
        let is_known = self.are_counts_known();
        let fewer = || fewer::of(&self.path, self.path.is_dir(), &self.files, &self.topics);
        is_known.then(fewer).flatten()
    }

    /// Faults of the description, where there is one.
    fn described_wrongly(&self) -> Vec<Loss> {
        let file = self.path.join(METADATA_FILE);
        if !self.path.is_dir() || file.symlink_metadata().is_err() {
            return Vec::new();
        }
        let is_known = self.are_counts_known();
        let text = regular::description(&file);
        let faults = description::faults(text.as_deref(), is_known.then_some(&self.topics));
        let loss = |what| Loss {
            file: file.clone(),
            at_byte: 0,
            reason: LossReason::Description { what },
            messages_read: 0,
        };
        faults.into_iter().map(loss).collect()
    }

    /// What is wrong with the machine file: it is not the recorded one, or nobody can read it.
    fn attached_wrongly(&self) -> Option<Loss> {
        let what = match self.attachment(MACHINE_FILE) {
            Ok(None) => return None,
            Ok(Some(found)) if found.data.trim_ascii().is_empty() => {
                format!("{MACHINE_FILE}: is empty")
            }
            Ok(Some(found)) => match text::decode(&found.data, Comments::Yaml) {
                Ok(_) => return None,
                Err(wrong) => format!("{MACHINE_FILE}:{wrong}"),
            },
            Err(error) => error.to_string(),
        };
        let reason = LossReason::Attachment { what };
        let place = self.files.iter().find_map(|file| {
            let mut attached = file.index.attachments.iter();
            Some((file, attached.find(|it| it.name == MACHINE_FILE)?.at))
        });
        let place = place.or_else(|| Some((self.files.first()?, 0)));
        place.map(|(file, at)| file.loss(at, reason, 0))
    }

    /// What is wrong with the description beside the files and with the machine file, and messages that were recorded and are in no
    /// file.
    #[must_use]
    pub fn description_losses(&self) -> &[Loss] {
        &self.description
    }

    fn add_file(&mut self, path: PathBuf, index: FileIndex) {
        let mut by_channel = Vec::new();
        for (id, channel) in &index.channels {
            let schema = index
                .schemas
                .get(&channel.schema)
                .cloned()
                .unwrap_or_default();
            let of = |key: &str| channel.metadata.get(key).cloned().unwrap_or_default();
            let type_hash = of("topic_type_hash");
            // One name with another type or another version of it is another topic: its bytes mean something else.
            let known = |info: &TopicInfo| {
                info.topic == channel.topic
                    && info.type_name == schema.name
                    && info.type_hash == type_hash
                    && info.definition == schema.text
                    && info.message_encoding == channel.encoding
            };
            let topic = self.topics.iter().position(known).unwrap_or_else(|| {
                self.topics.push(TopicInfo {
                    topic: channel.topic.clone(),
                    type_name: schema.name.clone(),
                    type_hash: type_hash.clone(),
                    definition_encoding: schema.encoding.clone(),
                    definition: schema.text.clone(),
                    message_encoding: channel.encoding.clone(),
                    qos_yaml: of("offered_qos_profiles"),
                    message_count: 0,
                });
                self.topics.len() - 1
            });
            self.topics[topic].message_count += channel.messages;
            by_channel.resize(usize::from(*id) + 1, None);
            by_channel[usize::from(*id)] = Some(TopicId(topic));
        }
        self.files.push(BagFile {
            path,
            index,
            topics: by_channel,
        });
    }

    /// Topics in the order in which they were first recorded.
    #[must_use]
    pub fn topics(&self) -> &[TopicInfo] {
        &self.topics
    }

    /// One topic.
    #[must_use]
    pub fn topic(&self, id: TopicId) -> &TopicInfo {
        &self.topics[id.0]
    }

    /// The path that was opened.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Files in order.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(|file| file.path.as_path())
    }

    /// Whether the log times of one file reach into those of another: the order of the files is not that of the messages.
    #[must_use]
    pub fn has_overlapping_files(&self) -> bool {
        parts::overlap(&self.files)
    }

    /// Whether two files have equal first and last log times and equally many messages: one is a copy of the other.
    #[must_use]
    pub fn has_doubled_file(&self) -> bool {
        parts::is_doubled(&self.files)
    }

    /// Number of messages of all topics.
    #[must_use]
    pub fn message_count(&self) -> u64 {
        self.topics.iter().map(|topic| topic.message_count).sum()
    }

    /// Earliest and latest log time, ns, `None` without messages.
    #[must_use]
    pub fn log_times_nanos(&self) -> Option<(u64, u64)> {
        let mut span = TimeSpan::default();
        self.files
            .iter()
            .for_each(|file| span.join(file.index.span));
        span.bounds_nanos()
    }

    /// Every message, in an order; may be called again and again.
    #[must_use]
    pub fn messages(&self, order: Order) -> Messages<'_> {
        let unread = self.unread.iter().cloned().collect();
        let inner = match order {
            Order::File => Inner::File(FileOrder::new(&self.files, unread)),
            Order::LogTime => Inner::LogTime(TimeOrder::new(&self.files, unread)),
        };
        Messages { inner }
    }

    /// Metadata records by name, of all files; of one name, the first.
    #[must_use]
    pub fn metadata(&self, name: &str) -> Option<&BTreeMap<String, String>> {
        self.metadata_records()
            .find_map(|(known, metadata)| (known == name).then_some(metadata))
    }

    /// All metadata records in order.
    pub fn metadata_records(&self) -> impl Iterator<Item = (&str, &BTreeMap<String, String>)> {
        let records = self.files.iter().flat_map(|file| &file.index.metadata);
        records.map(|(name, metadata)| (name.as_str(), metadata))
    }

    /// Names of the attachments, in order.
    pub fn attachment_names(&self) -> impl Iterator<Item = &str> {
        let places = self.files.iter().flat_map(|file| &file.index.attachments);
        places.map(|place| place.name.as_str())
    }

    /// An attachment; `None` where the bag has no such name and its list of attachments neither.
    ///
    /// # Errors
    /// It is there and cannot be read, or it is not the one whose hash was recorded.
    pub fn attachment(&self, name: &str) -> Result<Option<Attachment>, RecorderError> {
        let found = self.stored(name)?;
        context::verify(self, name, found.as_ref())?;
        Ok(found)
    }

    /// An attachment as it is there, whatever hash was recorded.
    ///
    /// # Errors
    /// It is there and cannot be read.
    pub(crate) fn stored(&self, name: &str) -> Result<Option<Attachment>, RecorderError> {
        for file in &self.files {
            if let Some(place) = file.index.attachments.iter().find(|a| a.name == name) {
                return match read_attachment(file, place.at) {
                    Ok(attachment) => Ok(Some(attachment)),
                    Err(reason) => Err(RecorderError::Damaged {
                        loss: file.loss(place.at, reason, 0),
                    }),
                };
            }
        }
        Ok(None)
    }
}

fn read_attachment(file: &BagFile, at: u64) -> Result<Attachment, LossReason> {
    let mut walker = Walker::begin(file.open()?, false)?;
    walker.seek(at)?;
    let frame = walker.next_frame()?.ok_or(LossReason::NoEnd)?;
    if !frame.is_whole() {
        return Err(frame.cut());
    }
    if frame.body_bytes > LARGEST_READ_CHUNK_BYTES {
        return Err(LossReason::ChunkTooLarge {
            bytes: frame.body_bytes,
            limit_bytes: LARGEST_READ_CHUNK_BYTES,
        });
    }
    let mut body = Vec::new();
    walker.read_body(frame, &mut body)?;
    match parse(op::ATTACHMENT, &body)? {
        Record::Attachment { header, data, .. } if frame.opcode == op::ATTACHMENT => {
            Ok(Attachment {
                name: header.name,
                media_type: header.media_type,
                log_time_nanos: header.log_time,
                create_time_nanos: header.create_time,
                data: data.into_owned(),
            })
        }
        _ => Err(LossReason::BadRecord {
            opcode: frame.opcode,
        }),
    }
}
