//! Messages by log time.
//!
//! Chunks are opened in the order of their earliest message, and only while they may hold the next
//! one, so that memory holds the chunks that overlap in time and no more.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};
use std::fs::File;
use std::ops::Range;

use super::bag::BagFile;
use super::chunk::{ChunkBuffer, Inside};
use super::index::Place;
use super::walk::{Frame, Walker};
use super::{Event, LARGEST_READ_CHUNK_BYTES, Loss, LossReason, MessageRef, TopicId};

/// One message of an open chunk.
struct Entry {
    log_time_nanos: u64,
    publish_time_nanos: u64,
    sequence: u32,
    topic: TopicId,
    data: Range<usize>,
}

/// An open chunk with its messages by log time.
#[derive(Default)]
struct Open {
    chunk: ChunkBuffer,
    entries: Vec<Entry>,
    next: usize,
}

/// A chunk that is still closed.
struct Waiting {
    file: usize,
    place: Place,
}

/// Log time, order of recording, slot.
type Next = Reverse<(u64, usize, usize)>;

/// Merges chunks by log time.
pub(super) struct TimeOrder<'b> {
    files: &'b [BagFile],
    walkers: Vec<Option<Walker<File>>>,
    waiting: VecDeque<(usize, Waiting)>,
    open: Vec<Open>,
    free: Vec<usize>,
    heap: BinaryHeap<Next>,
    losses: VecDeque<Loss>,
    end_losses: VecDeque<Loss>,
    messages_read: u64,
}

impl<'b> TimeOrder<'b> {
    pub(super) fn new(files: &'b [BagFile], losses: VecDeque<Loss>) -> Self {
        let mut waiting: Vec<(usize, Waiting)> = files
            .iter()
            .enumerate()
            .flat_map(|(file, f)| {
                f.index
                    .places
                    .iter()
                    .map(move |p| Waiting { file, place: *p })
            })
            .enumerate()
            .collect();
        waiting.sort_by_key(|(order, w)| (w.place.start_nanos, *order));
        let mut end_losses = VecDeque::new();
        for file in files {
            let index = &file.index;
            if let Some((at, reason)) = &index.end_loss {
                end_losses.push_back(file.loss(*at, reason.clone(), 0));
            } else if index.index_damaged {
                end_losses.push_back(file.loss(0, LossReason::Index, 0));
            }
        }
        Self {
            files,
            walkers: files.iter().map(|_| None).collect(),
            waiting: waiting.into(),
            open: Vec::new(),
            free: Vec::new(),
            heap: BinaryHeap::new(),
            losses,
            end_losses,
            messages_read: 0,
        }
    }

    pub(super) fn next_event(&mut self) -> Option<Event<'_>> {
        self.open_due_chunks();
        if let Some(mut loss) = self.losses.pop_front() {
            loss.messages_read = self.messages_read;
            return Some(Event::Loss(loss));
        }
        let Some(mut top) = self.heap.peek_mut() else {
            return self.end_losses.pop_front().map(|mut loss| {
                loss.messages_read = self.messages_read;
                Event::Loss(loss)
            });
        };
        let Reverse((_, order, slot)) = *top;
        let open = &mut self.open[slot];
        let given = open.next;
        open.next += 1;
        // A chunk's buffers are given back one step later, when its last message is read.
        match open.entries.get(open.next) {
            Some(entry) => {
                *top = Reverse((entry.log_time_nanos, order, slot));
                drop(top);
            }
            None => {
                std::collections::binary_heap::PeekMut::pop(top);
                self.free.push(slot);
            }
        }
        self.messages_read += 1;
        let open = &self.open[slot];
        let entry = &open.entries[given];
        Some(Event::Message(MessageRef {
            topic: entry.topic,
            log_time_nanos: entry.log_time_nanos,
            publish_time_nanos: entry.publish_time_nanos,
            sequence: entry.sequence,
            data: &open.chunk.records()[entry.data.clone()],
        }))
    }

    /// Opens every chunk that may hold the next message.
    fn open_due_chunks(&mut self) {
        while let Some((_, front)) = self.waiting.front() {
            let earliest = self.heap.peek().map(|Reverse((log_time, ..))| *log_time);
            if earliest.is_some_and(|earliest| front.place.start_nanos > earliest) {
                return;
            }
            let Some((order, waiting)) = self.waiting.pop_front() else {
                return;
            };
            let slot = self.free.pop().unwrap_or_else(|| {
                self.open.push(Open::default());
                self.open.len() - 1
            });
            if let Err(reason) = self.load(&waiting, slot) {
                let file = &self.files[waiting.file];
                self.losses
                    .push_back(file.loss(waiting.place.at, reason, 0));
            }
            match self.open[slot].entries.first() {
                Some(entry) => self.heap.push(Reverse((entry.log_time_nanos, order, slot))),
                None => self.free.push(slot),
            }
        }
    }

    fn load(&mut self, waiting: &Waiting, slot: usize) -> Result<(), LossReason> {
        let file = &self.files[waiting.file];
        let open = &mut self.open[slot];
        open.entries.clear();
        open.next = 0;
        open.chunk.clear();
        let walker = match &mut self.walkers[waiting.file] {
            Some(walker) => walker,
            none => none.insert(Walker::begin(file.open()?, false)?),
        };
        walker.seek(waiting.place.at)?;
        match waiting.place.run_end {
            Some(end) => {
                let length = end - waiting.place.at;
                let whole = Frame {
                    opcode: 0,
                    at: waiting.place.at,
                    body_bytes: length,
                    present_bytes: length,
                };
                walker.read_body(whole, &mut open.chunk.raw)?;
                open.chunk.take_bare();
            }
            None => {
                let frame = walker.next_frame()?.ok_or(LossReason::NoEnd)?;
                if frame.body_bytes > LARGEST_READ_CHUNK_BYTES {
                    return Err(LossReason::ChunkTooLarge {
                        bytes: frame.body_bytes,
                        limit_bytes: LARGEST_READ_CHUNK_BYTES,
                    });
                }
                walker.read_body(frame, &mut open.chunk.raw)?;
                let opened = open.chunk.open(frame);
                // That the file ends here is told at its end.
                if frame.is_whole() {
                    opened?;
                }
            }
        }
        list_messages(file, open)
    }
}

/// Lists the messages of an open chunk by log time.
fn list_messages(file: &BagFile, open: &mut Open) -> Result<(), LossReason> {
    let mut unknown = None;
    loop {
        match open.chunk.step() {
            Inside::Message {
                channel,
                sequence,
                log_time_nanos,
                publish_time_nanos,
                data,
            } => match file.topic(channel) {
                Some(topic) => open.entries.push(Entry {
                    log_time_nanos,
                    publish_time_nanos,
                    sequence,
                    topic,
                    data,
                }),
                None => unknown = Some(LossReason::UnknownChannel { channel }),
            },
            Inside::Other { .. } => {}
            Inside::Bad { .. } | Inside::End => break,
        }
    }
    open.entries.sort_by_key(|entry| entry.log_time_nanos);
    unknown.map_or(Ok(()), Err)
}
