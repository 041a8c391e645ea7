//! A bag in which messages stand twice, and messages that two readers of one verb decode: each counts once. And one whose
//! topics came late.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::path::{Path, PathBuf};

use abbe_msgs::topics;
use recorder::{
    Bag, Channel, ChannelId, Directory, Event, MessageStamp, Order, RecorderConfig, Recording,
};
use replayer::{Reading, Reason, reading};

/// A bag of the tree.
fn bag_of_tree(name: &str) -> Bag {
    let bags = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags");
    Bag::open(bags.join(name)).unwrap()
}

/// A copy of a bag of the tree with every message so many times; that of `bad` thermometers is cut.
fn copied(home: &Path, times: usize, is_bad: fn(&str) -> bool) -> PathBuf {
    copy(
        home,
        &bag_of_tree("cold_reference"),
        (times, is_bad),
        |_, _| 0,
    )
}

/// A copy of a bag; `late_nanos` is how much later a message of a topic was recorded, by its number in the bag.
fn copy(
    home: &Path,
    bag: &Bag,
    (times, is_bad): (usize, fn(&str) -> bool),
    late_nanos: impl Fn(&str, i64) -> i64,
) -> PathBuf {
    let path = home.join("bag");
    let directory = Directory::create(&path).unwrap();
    let mut recording = Recording::begin(directory, "bag", RecorderConfig::default()).unwrap();
    let ids: Vec<ChannelId> = (bag.topics().iter())
        .map(|info| {
            let channel = Channel {
                topic: info.topic.clone(),
                type_name: info.type_name.clone(),
                type_hash: info.type_hash.clone(),
                definition: info.definition.clone(),
                qos_yaml: info.qos_yaml.clone(),
            };
            recording.add_channel(&channel).unwrap()
        })
        .collect();
    let mut messages = bag.messages(Order::File);
    let mut number = 0;
    while let Some(Event::Message(message)) = messages.next_event() {
        number += 1;
        let late_nanos = late_nanos(&bag.topic(message.topic).topic, number);
        let stamp = MessageStamp {
            log_time_nanos: i64::try_from(message.log_time_nanos).unwrap() + late_nanos,
            publish_time_nanos: i64::try_from(message.publish_time_nanos).unwrap(),
            sequence: message.sequence,
        };
        let is_cut = is_bad(&bag.topic(message.topic).topic);
        let length = message.data.len() - usize::from(is_cut) * 3;
        for _ in 0..times {
            let id = ids[message.topic.index()];
            recording.write(id, stamp, &message.data[..length]).unwrap();
        }
    }
    recording.finish().unwrap();
    path
}

/// Reads states and thermometers, each message as often as a verb with so many readers; what the first reader got.
fn read(path: &Path, readers: usize) -> (Reading, usize) {
    let wanted = [topics::AXES_STATE.name, topics::TEMPERATURE.base];
    let bag = Bag::open(path).unwrap();
    let mut got = 0;
    let found = reading::read(&bag, Order::LogTime, &wanted, |mut taken| {
        for reader in 0..readers {
            let is_read = if taken.is(&topics::AXES_STATE) {
                taken.of(&topics::AXES_STATE).is_some()
            } else {
                taken.of_member(&topics::TEMPERATURE).is_some()
            };
            got += usize::from(is_read && reader == 0);
        }
    });
    (found, got)
}

#[test]
fn messages_that_stand_twice_are_left_out_once_and_counted() {
    let none = |_: &str| false;
    let home = tempfile::tempdir().unwrap();
    let (once, got_once) = read(&copied(home.path(), 1, none), 1);
    assert!(once.is_whole() && got_once > 100, "{once:?}");
    let home = tempfile::tempdir().unwrap();
    let (twice, got_twice) = read(&copied(home.path(), 2, none), 1);
    assert_eq!(got_twice, got_once);
    assert!(!twice.is_whole());
    for (one, two) in once.account.topics.iter().zip(&twice.account.topics) {
        assert_eq!((two.used, two.messages), (one.used, 2 * one.messages));
        let [left_out] = &two.left_out[..] else {
            panic!("{two:?}")
        };
        assert_eq!(left_out.reason, Reason::Repeated);
        assert_eq!(left_out.messages, one.messages);
        assert_eq!(left_out.first.number, 2);
    }
    let lines = twice.lines();
    let words = "messages left out, repeated: the bag has it already";
    assert!(lines.iter().all(|line| line.contains(words)), "{lines:?}");
}

#[test]
fn a_message_that_several_readers_decode_is_counted_once() {
    let is_bad = |topic: &str| topic.starts_with("/temperature/");
    let home = tempfile::tempdir().unwrap();
    let path = copied(home.path(), 1, is_bad);
    let (alone, _) = read(&path, 1);
    assert!(!alone.is_whole());
    for readers in [2, 3] {
        let (several, _) = read(&path, readers);
        assert_eq!(several.account, alone.account, "{readers}");
    }
    for row in &alone.account.topics {
        let left_out: u64 = row.left_out.iter().map(|it| it.messages).sum();
        assert_eq!(row.used + left_out, row.messages, "{row:?}");
        assert_eq!(left_out > 0, is_bad(&row.topic), "{row:?}");
    }
}

/// Stamps of states and readings as they are handed on, ns, each with whether it is a state.
fn by_stamp(bag: &Bag) -> Vec<(bool, i64)> {
    let wanted = [
        topics::AXES_STATE.name,
        topics::GRID_POSITION.name,
        topics::TEST_SEGMENT.name,
    ];
    let mut got = vec![];
    let mut last = None;
    let found = reading::read_by_stamp(bag, &wanted, false, |mut taken| {
        if taken.is(&topics::AXES_STATE) {
            got.extend(
                taken
                    .of(&topics::AXES_STATE)
                    .map(|it| (true, it.received_at.nanos())),
            );
        } else if taken.is(&topics::GRID_POSITION) {
            got.extend(
                taken
                    .of(&topics::GRID_POSITION)
                    .map(|it| (false, it.at.nanos())),
            );
        } else if let Some(segment) = taken.of(&topics::TEST_SEGMENT) {
            let now = (segment.run, !segment.begin);
            assert!(last.is_none_or(|before| before < now), "{last:?} {now:?}");
            last = Some(now);
        }
    });
    assert!(found.is_whole(), "{:?}", found.lines());
    got
}

#[test]
fn readings_come_as_they_were_made_however_unevenly_a_topic_was_recorded() {
    let bag = bag_of_tree("grid_circles");
    let wanted = by_stamp(&bag);
    assert!(wanted.len() > 1_000 && wanted.is_sorted_by_key(|(_, nanos)| *nanos));
    const MS: i64 = 1_000_000;
    let late: [fn(&str, i64) -> i64; 3] = [
        |_, number| number * 7_919 % 97 * MS,
        |topic, number| {
            if topic == "/axes/state" {
                number * 31 % 89 * MS
            } else {
                0
            }
        },
        |topic, number| {
            if topic == "/grid/position" {
                number % 190 * 10 * MS
            } else {
                0
            }
        },
    ];
    for (k, late_nanos) in late.into_iter().enumerate() {
        let home = tempfile::tempdir().unwrap();
        let none: fn(&str) -> bool = |_| false;
        let path = copy(home.path(), &bag, (1, none), |topic, number| {
            // Begins and ends keep their order.
            if topic == "/test/segment" {
                0
            } else {
                late_nanos(topic, number)
            }
        });
        let found = by_stamp(&Bag::open(path).unwrap());
        assert!(found == wanted, "{k}: {} of {}", found.len(), wanted.len());
    }
}
