//! What a file holds and where: from the index at its end, or by walking through it.

use std::collections::BTreeMap;
use std::io::{Read, Seek};

use mcap::records::{Record, Statistics, op};

use super::chunk::{ChunkBuffer, Inside};
use super::framing::is_framed;
use super::walk::{Frame, Walker};
use super::{LARGEST_READ_CHUNK_BYTES, LossReason, MetadataRecord};
use crate::layout::TimeSpan;

/// Footer record and magic at the end of a file, byte.
const TAIL_BYTES: u64 = 9 + 20 + 8;
/// Records outside chunks are read in runs of about this many bytes.
const RUN_BYTES: u64 = 1 << 20;

/// A schema of the file.
#[derive(Clone, Debug, Default)]
pub(super) struct Schema {
    pub name: String,
    pub encoding: String,
    pub text: String,
}

/// A channel of the file.
#[derive(Clone, Debug)]
pub(super) struct FileChannel {
    pub schema: u16,
    pub topic: String,
    pub encoding: String,
    pub metadata: BTreeMap<String, String>,
    pub messages: u64,
}

/// A chunk, or a run of records outside chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub at: u64,
    /// For a run, the byte behind it.
    pub run_end: Option<u64>,
    pub start_nanos: u64,
}

/// An attachment's place.
#[derive(Clone, Debug)]
pub(super) struct AttachmentPlace {
    pub name: String,
    pub at: u64,
}

/// What a file holds.
#[derive(Debug, Default)]
pub(super) struct FileIndex {
    pub schemas: BTreeMap<u16, Schema>,
    pub channels: BTreeMap<u16, FileChannel>,
    pub places: Vec<Place>,
    pub attachments: Vec<AttachmentPlace>,
    pub metadata: Vec<MetadataRecord>,
    pub span: TimeSpan,
    /// Byte at which the walk through a damaged file stopped, and why; `None`: it came to the end record.
    pub end_loss: Option<(u64, LossReason)>,
    /// The file has an end, but its index cannot be used.
    pub index_damaged: bool,
}

impl FileIndex {
    pub(super) fn read<R: Read + Seek>(source: &mut R) -> Self {
        match Self::from_summary(source) {
            Ok(Some(index)) => index,
            Ok(None) => Self::by_walking(source),
            Err(_) => {
                let mut index = Self::by_walking(source);
                // Without an end the walk says so itself.
                index.index_damaged = index.end_loss.is_none();
                index
            }
        }
    }

    /// `None` when the file has no usable summary by its own word.
    fn from_summary<R: Read + Seek>(source: &mut R) -> Result<Option<Self>, LossReason> {
        let mut walker = Walker::begin(&mut *source, false)?;
        let length = walker.length();
        let tail_at = length.checked_sub(TAIL_BYTES).ok_or(LossReason::NoEnd)?;
        walker.seek(tail_at)?;
        let footer_frame = walker.next_frame()?.ok_or(LossReason::NoEnd)?;
        if footer_frame.opcode != op::FOOTER || footer_frame.body_bytes != 20 {
            return Err(LossReason::NoEnd);
        }
        let mut tail = Vec::new();
        walker.read_body(footer_frame, &mut tail)?;
        let Ok(Record::Footer(footer)) = mcap::parse_record(op::FOOTER, &tail) else {
            return Err(LossReason::Index);
        };
        if footer.summary_start == 0 {
            return Ok(None);
        }
        if footer.summary_start > tail_at {
            return Err(LossReason::Index);
        }
        walker.seek(footer.summary_start)?;
        let mut section = vec![0; 0];
        let whole = Frame {
            opcode: 0,
            at: footer.summary_start,
            body_bytes: length - footer.summary_start,
            present_bytes: length - footer.summary_start,
        };
        walker.read_body(whole, &mut section)?;
        if section[section.len() - 8..] != *mcap::MAGIC {
            return Err(LossReason::Index);
        }
        // The CRC covers the section and the footer up to the CRC itself.
        let covered = &section[..section.len() - 8 - 4];
        if footer.summary_crc != 0 && footer.summary_crc != crc32fast::hash(covered) {
            return Err(LossReason::Index);
        }
        Self::from_section(&section[..section.len() - TAIL_BYTES as usize], &mut walker)
    }

    fn from_section<R: Read + Seek>(
        section: &[u8],
        walker: &mut Walker<R>,
    ) -> Result<Option<Self>, LossReason> {
        let mut index = Self::default();
        let mut statistics = None;
        let mut metadata_at = Vec::new();
        let mut buffer = ChunkBuffer::default();
        buffer.raw.extend_from_slice(section);
        buffer.take_bare();
        loop {
            let (opcode, body) = match buffer.step() {
                Inside::End => break,
                Inside::Other { opcode, body } => (opcode, body),
                Inside::Bad { .. } | Inside::Message { .. } => return Err(LossReason::Index),
            };
            match parse(opcode, &buffer.records()[body])? {
                Record::ChunkIndex(chunk) => index.places.push(Place {
                    at: chunk.chunk_start_offset,
                    run_end: None,
                    start_nanos: chunk.message_start_time,
                }),
                Record::Statistics(found) => statistics = Some(found),
                Record::AttachmentIndex(found) => index.attachments.push(AttachmentPlace {
                    name: found.name,
                    at: found.offset,
                }),
                Record::MetadataIndex(found) => metadata_at.push(found.offset),
                record => index.note(record),
            }
        }
        let Some(statistics) = statistics else {
            return Ok(None);
        };
        if !index.agrees_with(&statistics, metadata_at.len()) {
            return Ok(None);
        }
        index.places.sort_by_key(|place| place.at);
        for at in metadata_at {
            index.read_metadata(walker, at)?;
        }
        index.take_statistics(&statistics);
        Ok(Some(index))
    }

    fn agrees_with(&self, statistics: &Statistics, metadata_records: usize) -> bool {
        let in_chunks = statistics.message_count == 0 || !self.places.is_empty();
        in_chunks
            && self.places.len() == statistics.chunk_count as usize
            && self.channels.len() == statistics.channel_count as usize
            && self.attachments.len() == statistics.attachment_count as usize
            && metadata_records == statistics.metadata_count as usize
    }

    fn take_statistics(&mut self, statistics: &Statistics) {
        for (id, count) in &statistics.channel_message_counts {
            if let Some(channel) = self.channels.get_mut(id) {
                channel.messages = *count;
            }
        }
        if statistics.message_count > 0 {
            self.span.include(statistics.message_start_time);
            self.span.include(statistics.message_end_time);
        }
    }

    fn read_metadata<R: Read + Seek>(
        &mut self,
        walker: &mut Walker<R>,
        at: u64,
    ) -> Result<(), LossReason> {
        walker.seek(at)?;
        let frame = walker.next_frame()?.ok_or(LossReason::Index)?;
        if frame.opcode != op::METADATA || !frame.is_whole() || frame.body_bytes > RUN_BYTES * 64 {
            return Err(LossReason::Index);
        }
        let mut body = Vec::new();
        walker.read_body(frame, &mut body)?;
        self.note(parse(op::METADATA, &body)?);
        Ok(())
    }

    /// Walks through the whole file.
    fn by_walking<R: Read + Seek>(source: &mut R) -> Self {
        let mut index = Self::default();
        let mut walker = match Walker::begin(source, false) {
            Ok(walker) => walker,
            Err(reason) => {
                index.end_loss = Some((0, reason));
                return index;
            }
        };
        let mut buffer = ChunkBuffer::default();
        let mut run: Option<Place> = None;
        loop {
            let at = walker.at();
            let frame = match walker.next_frame() {
                Ok(Some(frame)) => frame,
                Ok(None) => {
                    index.end_loss = Some((at, LossReason::NoEnd));
                    break;
                }
                Err(reason) => {
                    index.end_loss = Some((at, reason));
                    break;
                }
            };
            match index.walk_one(&mut walker, frame, &mut buffer, &mut run) {
                Ok(true) => {}
                Ok(false) => break,
                Err(reason) => {
                    index.end_loss = Some((at, reason));
                    break;
                }
            }
        }
        index.places.extend(run);
        index
    }

    /// Takes in one frame; false at the end of the data.
    fn walk_one<R: Read + Seek>(
        &mut self,
        walker: &mut Walker<R>,
        frame: Frame,
        buffer: &mut ChunkBuffer,
        run: &mut Option<Place>,
    ) -> Result<bool, LossReason> {
        let in_run = matches!(frame.opcode, op::MESSAGE | op::SCHEMA | op::CHANNEL);
        if !in_run {
            self.places.extend(run.take());
        }
        if frame.opcode == op::DATA_END {
            return Ok(false);
        }
        if frame.opcode == op::CHUNK {
            buffer.clear();
            self.walk_chunk(walker, frame, buffer)?;
            return if frame.is_whole() {
                Ok(true)
            } else {
                Err(frame.cut())
            };
        }
        if !frame.is_whole() {
            return Err(frame.cut());
        }
        match frame.opcode {
            op::MESSAGE | op::SCHEMA | op::CHANNEL | op::METADATA | op::ATTACHMENT => {
                if frame.body_bytes > LARGEST_READ_CHUNK_BYTES {
                    walker.skip_body(frame)?;
                    return Ok(true);
                }
                let mut body = Vec::new();
                walker.read_body(frame, &mut body)?;
                self.note_bare(frame, &body, run);
            }
            _ => walker.skip_body(frame)?,
        }
        Ok(true)
    }

    fn walk_chunk<R: Read + Seek>(
        &mut self,
        walker: &mut Walker<R>,
        frame: Frame,
        buffer: &mut ChunkBuffer,
    ) -> Result<(), LossReason> {
        if frame.body_bytes > LARGEST_READ_CHUNK_BYTES {
            walker.skip_body(frame)?;
            // Met again, and told, when the messages are read.
            self.places.push(Place {
                at: frame.at,
                run_end: None,
                start_nanos: 0,
            });
            return Ok(());
        }
        walker.read_body(frame, &mut buffer.raw)?;
        let header = buffer.open(frame);
        self.places.push(Place {
            at: frame.at,
            run_end: None,
            start_nanos: header.as_ref().map_or(0, |header| header.start_nanos),
        });
        if header.is_err() {
            return Ok(());
        }
        loop {
            match buffer.step() {
                Inside::Message {
                    channel,
                    log_time_nanos,
                    ..
                } => self.count(channel, log_time_nanos),
                Inside::Other { opcode, body } => {
                    if let Ok(record) = parse(opcode, &buffer.records()[body]) {
                        self.note(record);
                    }
                }
                Inside::Bad { .. } | Inside::End => return Ok(()),
            }
        }
    }

    fn note_bare(&mut self, frame: Frame, body: &[u8], run: &mut Option<Place>) {
        if frame.opcode == op::ATTACHMENT {
            if let Ok(Record::Attachment { header, .. }) = parse(frame.opcode, body) {
                self.attachments.push(AttachmentPlace {
                    name: header.name,
                    at: frame.at,
                });
            }
            return;
        }
        let Ok(record) = parse(frame.opcode, body) else {
            return;
        };
        let Record::Message { header, .. } = &record else {
            return self.note(record);
        };
        self.count(header.channel_id, header.log_time);
        let place = run.get_or_insert(Place {
            at: frame.at,
            run_end: None,
            start_nanos: header.log_time,
        });
        place.run_end = Some(frame.end());
        place.start_nanos = place.start_nanos.min(header.log_time);
        if frame.end() - place.at >= RUN_BYTES {
            self.places.extend(run.take());
        }
    }

    fn count(&mut self, channel: u16, log_time_nanos: u64) {
        if let Some(channel) = self.channels.get_mut(&channel) {
            channel.messages += 1;
            self.span.include(log_time_nanos);
        }
    }

    /// Takes in a schema, a channel or a metadata record; the first of one number stays.
    fn note(&mut self, record: Record<'_>) {
        match record {
            Record::Schema { header, data } => {
                self.schemas.entry(header.id).or_insert_with(|| Schema {
                    name: header.name,
                    encoding: header.encoding,
                    text: String::from_utf8_lossy(&data).into_owned(),
                });
            }
            Record::Channel(channel) => {
                self.channels.entry(channel.id).or_insert(FileChannel {
                    schema: channel.schema_id,
                    topic: channel.topic,
                    encoding: channel.message_encoding,
                    metadata: channel.metadata,
                    messages: 0,
                });
            }
            Record::Metadata(record) => self.metadata.push((record.name, record.metadata)),
            _ => {}
        }
    }
}

/// Parses one record, whatever its bytes are.
pub(super) fn parse(opcode: u8, body: &[u8]) -> Result<Record<'_>, LossReason> {
    if !is_framed(opcode, body) {
        return Err(LossReason::BadRecord { opcode });
    }
    mcap::parse_record(opcode, body).map_err(|_| LossReason::BadRecord { opcode })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_attachment_shorter_than_its_own_crc_is_a_bad_record() {
        for length in 0..60 {
            let body = vec![0_u8; length];
            let parsed = parse(op::ATTACHMENT, &body);
            // 8 + 8 + 4 + 4 + 8 + 4: two times, two empty texts, no data, its CRC.
            assert_eq!(parsed.is_ok(), length == 36, "{length}");
        }
    }
}
