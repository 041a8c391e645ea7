//! Messages as they stand in the files.

use std::collections::VecDeque;
use std::fs::File;
use std::ops::Range;

use mcap::records::{Record, op};

use super::bag::BagFile;
use super::chunk::{ChunkBuffer, Inside};
use super::index::parse;
use super::walk::{FRAME_BYTES, Frame, Walker};
use super::{Event, LARGEST_READ_CHUNK_BYTES, Loss, LossReason, MessageRef, TopicId};

/// How far the current file is.
enum Stage {
    Closed,
    Walking(Walker<File>),
    /// No more frames; what is in hand is still given.
    Left,
}

/// Reads file after file, chunk after chunk.
pub(super) struct FileOrder<'b> {
    files: &'b [BagFile],
    current: usize,
    stage: Stage,
    chunk: ChunkBuffer,
    chunk_at: u64,
    losses: VecDeque<Loss>,
    messages_read: u64,
}

/// A message whose bytes are still to be borrowed.
struct Found {
    topic: TopicId,
    log_time_nanos: u64,
    publish_time_nanos: u64,
    sequence: u32,
    data: Range<usize>,
}

impl<'b> FileOrder<'b> {
    pub(super) fn new(files: &'b [BagFile], losses: VecDeque<Loss>) -> Self {
        Self {
            files,
            current: 0,
            stage: Stage::Closed,
            chunk: ChunkBuffer::default(),
            chunk_at: 0,
            losses,
            messages_read: 0,
        }
    }

    pub(super) fn next_event(&mut self) -> Option<Event<'_>> {
        loop {
            if let Some(found) = self.next_in_chunk() {
                self.messages_read += 1;
                return Some(Event::Message(MessageRef {
                    topic: found.topic,
                    log_time_nanos: found.log_time_nanos,
                    publish_time_nanos: found.publish_time_nanos,
                    sequence: found.sequence,
                    data: &self.chunk.records()[found.data],
                }));
            }
            if let Some(mut loss) = self.losses.pop_front() {
                loss.messages_read = self.messages_read;
                return Some(Event::Loss(loss));
            }
            if !self.advance() {
                return None;
            }
        }
    }

    fn next_in_chunk(&mut self) -> Option<Found> {
        loop {
            match self.chunk.step() {
                Inside::Message {
                    channel,
                    sequence,
                    log_time_nanos,
                    publish_time_nanos,
                    data,
                } => match self.files[self.current].topic(channel) {
                    Some(topic) => {
                        return Some(Found {
                            topic,
                            log_time_nanos,
                            publish_time_nanos,
                            sequence,
                            data,
                        });
                    }
                    None => self.lose(self.chunk_at, LossReason::UnknownChannel { channel }),
                },
                Inside::Other { .. } => {}
                // The end of a chunk that the file cuts is told with the cut itself.
                Inside::Bad { opcode } if self.losses.is_empty() => {
                    self.lose(self.chunk_at, LossReason::BadRecord { opcode });
                }
                Inside::Bad { .. } | Inside::End => return None,
            }
        }
    }

    fn lose(&mut self, at_byte: u64, reason: LossReason) {
        let file = &self.files[self.current];
        let same = |loss: &Loss| loss.file == file.path && loss.reason == reason;
        // One chunk with many messages on an unknown channel is one loss.
        if !self.losses.back().is_some_and(same) {
            let loss = file.loss(at_byte, reason, self.messages_read);
            self.losses.push_back(loss);
        }
    }

    /// Reads the next frame or opens the next file; false at the end of all.
    fn advance(&mut self) -> bool {
        self.chunk.clear();
        match &mut self.stage {
            Stage::Left => {
                self.current += 1;
                self.stage = Stage::Closed;
            }
            Stage::Closed => {
                let Some(file) = self.files.get(self.current) else {
                    return false;
                };
                match file.open().and_then(|source| Walker::begin(source, true)) {
                    Ok(walker) => self.stage = Stage::Walking(walker),
                    Err(reason) => self.leave(0, Some(reason)),
                }
            }
            Stage::Walking(walker) => {
                let at = walker.at();
                // The CRC of the file covers what is before the record that holds it.
                let crc = walker.crc();
                match walker.next_frame() {
                    Ok(Some(frame)) => {
                        if let Err(reason) = self.take(frame, crc) {
                            self.leave(at, Some(reason));
                        }
                    }
                    Ok(None) => self.leave(at, Some(LossReason::NoEnd)),
                    Err(reason) => self.leave(at, Some(reason)),
                }
            }
        }
        true
    }

    fn leave(&mut self, at: u64, reason: Option<LossReason>) {
        if let Some(reason) = reason {
            self.lose(at, reason);
        }
        self.stage = Stage::Left;
    }

    /// Takes one frame in hand; an error ends the file.
    fn take(&mut self, frame: Frame, crc: Option<u32>) -> Result<(), LossReason> {
        let Stage::Walking(walker) = &mut self.stage else {
            return Ok(());
        };
        if frame.body_bytes > LARGEST_READ_CHUNK_BYTES {
            let too_large = LossReason::ChunkTooLarge {
                bytes: frame.body_bytes,
                limit_bytes: LARGEST_READ_CHUNK_BYTES,
            };
            walker.skip_body(frame)?;
            if !frame.is_whole() {
                return Err(frame.cut());
            }
            self.lose(frame.at, too_large);
            return Ok(());
        }
        if frame.opcode == op::MESSAGE {
            put_frame(frame, &mut self.chunk.raw);
        }
        walker.read_body(frame, &mut self.chunk.raw)?;
        self.chunk_at = frame.at;
        match frame.opcode {
            op::CHUNK => {
                let opened = self.chunk.open(frame);
                if !frame.is_whole() {
                    return Err(frame.cut());
                }
                if let Err(reason) = opened {
                    self.lose(frame.at, reason);
                }
            }
            _ if !frame.is_whole() => {
                self.chunk.clear();
                return Err(frame.cut());
            }
            op::MESSAGE => self.chunk.take_bare(),
            op::DATA_END => self.end_data(crc)?,
            _ => self.chunk.clear(),
        }
        Ok(())
    }

    fn end_data(&mut self, calculated: Option<u32>) -> Result<(), LossReason> {
        let parsed = parse(op::DATA_END, &self.chunk.raw);
        let at = self.chunk_at;
        if let (Record::DataEnd(end), Some(calculated)) = (parsed?, calculated) {
            let saved = end.data_section_crc;
            if saved != 0 && saved != calculated {
                self.lose(at, LossReason::FileCrc { saved, calculated });
            }
        }
        self.chunk.clear();
        let damaged = self.files[self.current].index.index_damaged;
        self.leave(at, damaged.then_some(LossReason::Index));
        Ok(())
    }
}

/// Writes a frame's own bytes in front of its body.
fn put_frame(frame: Frame, bytes: &mut Vec<u8>) {
    bytes.reserve((FRAME_BYTES + frame.body_bytes) as usize);
    bytes.push(frame.opcode);
    bytes.extend_from_slice(&frame.body_bytes.to_le_bytes());
}
