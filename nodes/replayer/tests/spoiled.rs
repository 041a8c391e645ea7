//! One spoiled message after the other, and many at once, on every topic of ours: what cannot be used is left out and
//! counted by topic and reason, and everything else is read as if it were not there.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use abbe_msgs::topics::{self, Topic, TopicFamily};
use abbe_msgs::{Message, Wire, from_cdr};
use recorder::{
    Bag, Channel, ChannelId, Directory, Event, MessageStamp, Order, RecorderConfig, Recording,
};
use replayer::{Reading, Reason, Taken, reading};

/// How a verb reads a message, and what that comes to with its bytes alone.
struct Ours {
    name: &'static str,
    take: fn(&mut Taken<'_>) -> bool,
    alone: fn(&[u8]) -> Option<Reason>,
}

fn alone<M: Message + Wire>(bytes: &[u8]) -> Option<Reason> {
    let read = from_cdr::<M>(bytes).and_then(Wire::into_inner);
    read.err().map(|error| error.defect().into())
}

const fn ours<M: Message + Wire>(topic: &Topic<M>, take: fn(&mut Taken<'_>) -> bool) -> Ours {
    Ours {
        name: topic.name,
        take,
        alone: alone::<M>,
    }
}

const fn family<M: Message + Wire>(
    family: &TopicFamily<M>,
    take: fn(&mut Taken<'_>) -> bool,
) -> Ours {
    Ours {
        name: family.base,
        take,
        alone: alone::<M>,
    }
}

macro_rules! ours {
    ($($topic:ident),*) => {
        [$(ours(&topics::$topic, |taken| taken.of(&topics::$topic).is_some()),)*
         family(&topics::TEMPERATURE, |taken| taken.of_member(&topics::TEMPERATURE).is_some())]
    };
}

/// Topics that the bags of the tree have.
const OURS: [Ours; 16] = ours![
    AXES_STATE,
    PROBE_TRIGGER,
    PROBE_POINT,
    PROBE_FEATURE,
    LATENCY,
    BLOCKS_MEASUREMENT,
    THERMAL_MODEL,
    GRID_POSITION,
    GEOMETRY_MODEL,
    GEOMETRY_ROTARY,
    POSITIONING_TABLE,
    COMPENSATION,
    TEST_SEGMENT,
    PLAN_STATUS,
    HOST_CLOCK
];

/// A topic with a few good messages.
#[derive(Clone)]
struct Good {
    channel: Channel,
    messages: Vec<Vec<u8>>,
}

/// Messages of each topic that are kept.
const FEW: usize = 3;
const BAGS: [&str; 5] = [
    "cold_reference",
    "dual_loop",
    "grid_circles",
    "host_clocks",
    "rotary_sphere",
];

fn of_name(topic: &str) -> Option<&'static Ours> {
    static ALL: [Ours; 16] = OURS;
    let entry = replayer::known::entry_in_any_namespace(topic)?;
    ALL.iter().find(|ours| ours.name == entry.name)
}

/// The first messages of every topic in the bags of the tree.
fn good() -> Vec<Good> {
    let bags = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags");
    let mut found = BTreeMap::<String, Good>::new();
    for name in BAGS {
        let bag = Bag::open(bags.join(name)).unwrap();
        let mut messages = bag.messages(Order::File);
        while let Some(Event::Message(message)) = messages.next_event() {
            let info = bag.topic(message.topic);
            if of_name(&info.topic).is_none() {
                continue;
            }
            let good = found.entry(info.topic.clone()).or_insert_with(|| Good {
                channel: Channel {
                    topic: info.topic.clone(),
                    type_name: info.type_name.clone(),
                    type_hash: info.type_hash.clone(),
                    definition: info.definition.clone(),
                    qos_yaml: info.qos_yaml.clone(),
                },
                messages: Vec::new(),
            });
            if good.messages.len() < FEW {
                good.messages.push(stamped(message.data));
            }
        }
    }
    let names: Vec<_> = OURS.iter().map(|ours| ours.name).collect();
    let has = |name: &&str| found.keys().any(|topic| topic.contains(*name));
    assert!(names.iter().all(has), "{names:?} {:?}", found.keys());
    found.into_values().collect()
}

const FIRST_NANOS: i64 = 1_700_000_000_000_000_000;
const FIRST_S: i32 = 1_700_000_000;

/// A message with the stamp of the begin: each is written in any order, and none goes back.
fn stamped(message: &[u8]) -> Vec<u8> {
    let mut one = message.to_vec();
    one[4..8].copy_from_slice(&FIRST_S.to_le_bytes());
    one[8..12].fill(0);
    one
}

/// Writes messages, each with the place of its channel, a millisecond apart.
fn write(home: &Path, channels: &[Channel], messages: &[(usize, &[u8])]) -> PathBuf {
    let path = home.join("bag");
    let mut recording = Recording::begin(
        Directory::create(&path).unwrap(),
        "bag",
        RecorderConfig::default(),
    )
    .unwrap();
    let ids: Vec<ChannelId> = channels
        .iter()
        .map(|channel| recording.add_channel(channel).unwrap())
        .collect();
    for (number, (place, data)) in messages.iter().enumerate() {
        let nanos = FIRST_NANOS + i64::try_from(number).unwrap() * 1_000_000;
        let stamp = MessageStamp {
            log_time_nanos: nanos,
            publish_time_nanos: nanos,
            sequence: 0,
        };
        recording.write(ids[*place], stamp, data).unwrap();
    }
    recording.finish().unwrap();
    path
}

/// Reads a bag as a verb that wants everything does.
fn read(path: &Path) -> Reading {
    let bag = Bag::open(path).unwrap();
    let wanted: Vec<&str> = OURS.iter().map(|ours| ours.name).collect();
    reading::read(&bag, Order::LogTime, &wanted, |mut taken| {
        let ours = of_name(taken.topic()).unwrap();
        (ours.take)(&mut taken);
    })
}

/// Numbers without a pattern, the same each time.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }
}

/// Most places of one message that are spoiled in one way: long ones are spoiled at every so many bytes.
const MOST_PLACES: usize = 400;

/// Every way in which a message is spoiled.
fn spoiled(good: &[u8], dice: &mut Dice) -> Vec<Vec<u8>> {
    let every = good.len().div_ceil(MOST_PLACES).max(1);
    let mut all: Vec<Vec<u8>> = (0..good.len())
        .step_by(every)
        .map(|length| good[..length].to_vec())
        .collect();
    let mut put = |at: usize, bytes: &[u8]| {
        let mut one = good.to_vec();
        if let Some(place) = one.get_mut(at..at + bytes.len()) {
            place.copy_from_slice(bytes);
            all.push(one);
        }
    };
    for at in (4..good.len()).step_by(8 * every) {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX] {
            put(at, &value.to_le_bytes());
        }
    }
    // Lengths of sequences and texts that lie, numbers of variants, stamps.
    for at in (4..good.len()).step_by(4 * every) {
        for value in [0, 1, 0x7fff_ffff, u32::MAX] {
            put(at, &value.to_le_bytes());
        }
    }
    for kind in [[0, 0], [0, 2], [0, 3], [0, 7], [1, 0], [255, 255]] {
        put(0, &kind);
    }
    for more in [1, 3, 4, 8, 100] {
        all.push([good, &vec![0; more]].concat());
    }
    for byte in [0, 0xff] {
        all.push(vec![byte; good.len()]);
    }
    for _ in 0..50 {
        let mut one = good.to_vec();
        for _ in 0..=dice.roll() % 4 {
            let place = usize::try_from(dice.roll()).unwrap() % one.len();
            one[place] = dice.roll().to_le_bytes()[0];
        }
        all.push(one);
    }
    all
}

/// What an account has to say of bytes: by reason, how many and the number of the first.
fn expected(ours: &Ours, all: &[&[u8]]) -> BTreeMap<String, (u64, u64)> {
    let mut by_reason = BTreeMap::new();
    for (number, bytes) in (1..).zip(all) {
        if let Some(reason) = (ours.alone)(bytes) {
            let (count, _) = by_reason
                .entry(format!("{reason:?}"))
                .or_insert((0, number));
            *count += 1;
        }
    }
    by_reason
}

#[test]
fn every_spoiled_message_is_left_out_alone_and_counted_by_topic_and_reason() {
    let topics = good();
    let channels: Vec<Channel> = topics.iter().map(|good| good.channel.clone()).collect();
    let mut dice = Dice(20_241_126);
    let (mut tried, mut left_out) = (0, 0);
    for (place, good) in topics.iter().enumerate() {
        let ours = of_name(&good.channel.topic).unwrap();
        let bad = spoiled(&good.messages[0], &mut dice);
        // Good ones of every topic before, between and behind.
        let others = topics.iter().enumerate();
        let others: Vec<(usize, &[u8])> = others
            .flat_map(|(place, good)| good.messages.iter().map(move |m| (place, m.as_slice())))
            .collect();
        let mut messages = others.clone();
        for one in &bad {
            messages.push((place, one));
            messages.push(others[messages.len() % others.len()]);
        }
        let home = tempfile::tempdir().unwrap();
        let found = read(&write(home.path(), &channels, &messages));
        assert!(found.losses.is_empty());
        let of_topic: Vec<&[u8]> = messages
            .iter()
            .filter(|(of, _)| *of == place)
            .map(|(_, data)| *data)
            .collect();
        let wanted = expected(ours, &of_topic);
        for row in &found.account.topics {
            if row.topic != good.channel.topic {
                assert!(row.left_out.is_empty(), "{row:?}");
                assert_eq!(row.used, row.messages);
                continue;
            }
            // Readable messages that only fit nothing beside them are left out, too.
            let beside = [Reason::OtherTime, Reason::Outlier];
            let all = row.left_out.iter();
            let spoiled = all.filter(|it| !beside.contains(&it.reason));
            let counted = spoiled.map(|it| {
                let first = it.first.number;
                (format!("{:?}", it.reason), (it.messages, first))
            });
            assert_eq!(counted.collect::<BTreeMap<_, _>>(), wanted, "{}", row.topic);
            let lost: u64 = row.left_out.iter().map(|it| it.messages).sum();
            assert_eq!(row.used + lost, row.messages);
            assert_eq!(row.messages, of_topic.len() as u64);
            left_out += lost;
        }
        tried += bad.len();
    }
    assert!(tried > 7_000 && left_out > 4_000, "{tried} {left_out}");
}

#[test]
fn one_spoiled_message_is_named_with_its_number_times_and_what_is_wrong() {
    let topics = good();
    let channels: Vec<Channel> = topics.iter().map(|good| good.channel.clone()).collect();
    for (place, good) in topics.iter().enumerate() {
        let whole = &good.messages[0];
        let cases = [
            (vec![], Reason::Encoding, "0 bytes"),
            (vec![0, 1], Reason::Encoding, "2 bytes"),
            (
                b"{\"a\": 1}".to_vec(),
                Reason::Encoding,
                "encapsulation 0x7b22",
            ),
            (
                whole[..whole.len() / 2].to_vec(),
                Reason::Malformed,
                "malformed at byte",
            ),
        ];
        for (bytes, reason, words) in cases {
            let home = tempfile::tempdir().unwrap();
            let messages = [(place, whole.as_slice()), (place, &bytes), (place, whole)];
            let found = read(&write(home.path(), &channels, &messages));
            let lines: Vec<String> = found.lines();
            assert_eq!(lines.len(), 1, "{lines:?}");
            let row = found
                .account
                .topics
                .iter()
                .find(|row| row.messages > 0)
                .unwrap();
            assert_eq!((row.messages, row.used), (3, 2), "{lines:?}");
            let first = &row.left_out[0];
            assert_eq!((first.reason, first.messages), (reason, 1), "{lines:?}");
            assert_eq!(first.first.number, 2);
            let at = FIRST_NANOS.unsigned_abs() + 1_000_000;
            assert_eq!(first.first.log_time_nanos, at);
            for word in [good.channel.topic.as_str(), "1 of 3 messages", words] {
                assert!(lines[0].contains(word), "{word}: {lines:?}");
            }
        }
    }
}

#[test]
fn a_topic_of_another_type_or_version_is_left_out_whole_and_the_others_are_read() {
    let topics = good();
    type Spoil = fn(&mut Channel);
    let spoils: [(Spoil, Reason); 4] = [
        (
            |channel| {
                channel.type_name = "std_msgs/msg/Float64".to_owned();
                channel.type_hash.clear();
                channel.definition = "float64 data\n".to_owned();
            },
            Reason::ForeignType,
        ),
        (
            |channel| channel.type_name = "other_pkg/msg/Thing".to_owned(),
            Reason::ForeignType,
        ),
        (
            |channel| channel.type_hash = format!("RIHS01_{}", "1".repeat(64)),
            Reason::OtherVersion,
        ),
        (
            |channel| {
                channel.type_hash.clear();
                channel
                    .definition
                    .insert_str(0, "uint8 of_another_version\n");
            },
            Reason::OtherVersion,
        ),
    ];
    let others = topics.iter().enumerate();
    let messages: Vec<(usize, &[u8])> = others
        .flat_map(|(place, good)| good.messages.iter().map(move |m| (place, m.as_slice())))
        .collect();
    for (place, good) in topics.iter().enumerate() {
        for (spoil, reason) in &spoils {
            let mut channels: Vec<Channel> =
                topics.iter().map(|good| good.channel.clone()).collect();
            spoil(&mut channels[place]);
            let home = tempfile::tempdir().unwrap();
            let found = read(&write(home.path(), &channels, &messages));
            assert_eq!(found.account.left_out(), good.messages.len() as u64);
            for row in &found.account.topics {
                if row.topic == good.channel.topic {
                    assert_eq!((row.used, row.left_out.len()), (0, 1));
                    assert_eq!(row.left_out[0].reason, *reason);
                    assert_eq!(row.left_out[0].first.number, 1);
                } else {
                    assert_eq!(row.used, row.messages, "{row:?}");
                }
            }
        }
    }
}
