//! Messages that stand in a bag more than once: two recorders wrote the same topics, and their bags were merged.
//!
//! A message repeats another one when topic, log time, publish time and bytes are equal, which two publications never are.
//! Holds for messages of one log time that follow one another in the order of reading, and for the first [`MOST`] of them.

use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hasher};

use recorder::MessageRef;

/// Messages of one log time that are remembered.
const MOST: usize = 65_536;

/// Which message: its topic, its publish time, its number where that counts, length and hash (64 bits) of its bytes.
type Key = (usize, u64, Option<u32>, usize, u64);

/// Why a repeated message is left out.
pub(crate) const WHAT: &str =
    "the bag has it already, with equal times and bytes; record each topic with one recorder";

/// The messages of the last log time.
#[derive(Debug, Default)]
pub(crate) struct Repeats {
    log_time_nanos: u64,
    is_numbered: bool,
    seen: BTreeSet<Key>,
}

impl Repeats {
    /// Of a bag in which each publication has a number of its own within its topic: equal ones of other numbers are no repeats.
    pub(crate) fn numbered() -> Self {
        Self {
            is_numbered: true,
            ..Self::default()
        }
    }

    /// Whether a message repeats one that was passed before.
    pub(crate) fn pass(&mut self, message: &MessageRef<'_>) -> bool {
        if message.log_time_nanos != self.log_time_nanos {
            self.log_time_nanos = message.log_time_nanos;
            self.seen.clear();
        }
        let mut hasher = DefaultHasher::new();
        hasher.write(message.data);
        let key = (
            message.topic.index(),
            message.publish_time_nanos,
            self.is_numbered.then_some(message.sequence),
            message.data.len(),
            hasher.finish(),
        );
        if self.seen.contains(&key) {
            return true;
        }
        if self.seen.len() < MOST {
            self.seen.insert(key);
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use recorder::{
        Bag, Channel, Directory, Event, MessageStamp, Order, RecorderConfig, Recording,
    };

    use super::*;

    /// Which messages are repeats: of each its topic, log time, publish time and contents.
    fn repeats(messages: &[(usize, i64, i64, u8)]) -> Vec<bool> {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("bag");
        let directory = Directory::create(&path).unwrap();
        let mut recording = Recording::begin(directory, "bag", RecorderConfig::default()).unwrap();
        let ids = ["/a", "/b"].map(|topic| {
            let channel = Channel {
                topic: topic.to_owned(),
                type_name: "std_msgs/msg/Float64".to_owned(),
                type_hash: String::new(),
                definition: String::new(),
                qos_yaml: String::new(),
            };
            recording.add_channel(&channel).unwrap()
        });
        for (topic, log_time_nanos, publish_time_nanos, byte) in messages {
            let at = MessageStamp {
                log_time_nanos: *log_time_nanos,
                publish_time_nanos: *publish_time_nanos,
                sequence: 0,
            };
            recording
                .write(ids[*topic], at, &[0, 1, 0, 0, *byte])
                .unwrap();
        }
        recording.finish().unwrap();
        let bag = Bag::open(&path).unwrap();
        let mut repeats = Repeats::default();
        let mut found = Vec::new();
        let mut read = bag.messages(Order::LogTime);
        while let Some(Event::Message(message)) = read.next_event() {
            found.push(repeats.pass(&message));
        }
        found
    }

    #[test]
    fn a_message_of_equal_topic_times_and_bytes_is_a_repeat() {
        let once = [(0, 5, 5, 1), (1, 5, 5, 1), (0, 5, 5, 2), (0, 6, 6, 1)];
        assert_eq!(repeats(&once), [false; 4]);
        // The publish time alone differs.
        assert_eq!(repeats(&[(0, 5, 4, 1), (0, 5, 5, 1)]), [false; 2]);
        let twice: Vec<_> = once.iter().flat_map(|it| [*it, *it]).collect();
        assert_eq!(repeats(&twice), [false, true].repeat(4));
        // One recording behind the other, by log time beside one another.
        let [a, b, ..] = once;
        assert_eq!(repeats(&[a, b, a, b, a]), [false, false, true, true, true]);
    }
}
