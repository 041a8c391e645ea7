//! Begin of a run that stands before the end of the run before it, at one log time: a sort or a merge of bags does not keep the
//! order of equal times. The end comes first.
//!
//! Holds for one begin. Messages of other topics of that log time come before it.

use abbe_msgs::from_cdr;
use abbe_msgs::msg::TestSegment;
use abbe_msgs::topics::{self, Entry};
use recorder::{MessageRef, TopicId};

/// A begin that waits for the end of the run before it.
pub(crate) struct Held {
    /// Place of its topic in the account.
    pub(crate) place: usize,
    /// Its number among the messages of its topic, from 1.
    pub(crate) number: u64,
    pub(crate) entry: &'static Entry,
    topic: TopicId,
    log_time_nanos: u64,
    publish_time_nanos: u64,
    sequence: u32,
    data: Vec<u8>,
}

impl Held {
    /// A message whose topic has this place in the account.
    pub(crate) fn of(
        message: &MessageRef<'_>,
        entry: &'static Entry,
        (place, number): (usize, u64),
    ) -> Self {
        Self {
            place,
            number,
            entry,
            topic: message.topic,
            log_time_nanos: message.log_time_nanos,
            publish_time_nanos: message.publish_time_nanos,
            sequence: message.sequence,
            data: message.data.to_vec(),
        }
    }

    /// The message as it was read.
    pub(crate) fn message(&self) -> MessageRef<'_> {
        MessageRef {
            topic: self.topic,
            log_time_nanos: self.log_time_nanos,
            publish_time_nanos: self.publish_time_nanos,
            sequence: self.sequence,
            data: &self.data,
        }
    }
}

/// What becomes of a message.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Turn {
    /// It is handed on.
    Now,
    /// It is held.
    Later,
    /// It is handed on, and what is held after it.
    BeforeHeld,
}

/// Begins and ends in the order of reading.
#[derive(Default)]
pub(crate) struct Turned {
    is_open: bool,
    held: Option<Held>,
}

impl Turned {
    /// What is held, where a message of this log time cannot be the end that it waits for.
    pub(crate) fn overdue(&mut self, log_time_nanos: u64) -> Option<Held> {
        self.held
            .take_if(|held| log_time_nanos > held.log_time_nanos)
    }

    /// What is held.
    pub(crate) fn rest(&mut self) -> Option<Held> {
        self.held.take()
    }

    /// What becomes of the next message, whose topic has this place in the account.
    pub(crate) fn take(
        &mut self,
        message: &MessageRef<'_>,
        entry: &'static Entry,
        (place, number): (usize, u64),
    ) -> Turn {
        if entry.name != topics::TEST_SEGMENT.name {
            return Turn::Now;
        }
        let Ok(segment) = from_cdr::<TestSegment>(message.data) else {
            return Turn::Now;
        };
        if !segment.begin {
            self.is_open = self.held.is_some();
            return if self.is_open {
                Turn::BeforeHeld
            } else {
                Turn::Now
            };
        }
        if !self.is_open || self.held.is_some() {
            self.is_open = true;
            return Turn::Now;
        }
        self.held = Some(Held::of(message, entry, (place, number)));
        Turn::Later
    }
}
