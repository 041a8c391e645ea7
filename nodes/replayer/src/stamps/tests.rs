use abbe_msgs::Message;
use abbe_msgs::msg::{AxisState, GeometryModel, TestSegment};
use recorder::{Channel, Directory, MessageStamp, RecorderConfig, Recording};

use super::*;

const START_S: i64 = 1_700_000_000;
const YEAR_2035_S: i64 = 2_051_222_400;
const DAY_S: f64 = 86_400.0;

/// Times of a message, s after the start: of its recording, of its stamp.
type Times = (f64, f64);

fn nanos(s: f64) -> i64 {
    START_S * NANOS_PER_S + (s * 1e9) as i64
}

/// A message of which nothing but its stamp is there.
fn bytes(stamp_nanos: i64) -> Vec<u8> {
    let sec = u32::try_from(stamp_nanos / NANOS_PER_S).unwrap();
    let nanosec = u32::try_from(stamp_nanos % NANOS_PER_S).unwrap();
    [
        &[0, 1, 0, 0][..],
        &sec.to_le_bytes(),
        &nanosec.to_le_bytes(),
    ]
    .concat()
}

/// Numbers, from 0, of each topic's messages that are found in a bag of `topics`.
fn found(topics: &[(&str, &str, Vec<Times>)]) -> Vec<Vec<usize>> {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("bag");
    let directory = Directory::create(&path).unwrap();
    let mut recording = Recording::begin(directory, "bag", RecorderConfig::default()).unwrap();
    let mut all = Vec::new();
    for (topic, type_name, messages) in topics {
        let channel = Channel {
            topic: (*topic).to_owned(),
            type_name: (*type_name).to_owned(),
            type_hash: String::new(),
            definition: String::new(),
            qos_yaml: String::new(),
        };
        let id = recording.add_channel(&channel).unwrap();
        all.extend(
            messages
                .iter()
                .map(|times| (nanos(times.0), id, nanos(times.1))),
        );
    }
    all.sort_by_key(|(log, ..)| *log);
    for (log, id, stamp) in all {
        let at = MessageStamp {
            log_time_nanos: log,
            publish_time_nanos: log,
            sequence: 0,
        };
        recording.write(id, at, &bytes(stamp)).unwrap();
    }
    recording.finish().unwrap();
    let bag = Bag::open(&path).unwrap();
    let wrong = WrongStamps::of(&bag);
    let place = |name: &str| {
        bag.topics()
            .iter()
            .position(|info| info.topic == name)
            .unwrap()
    };
    let of = |(topic, _, messages): &(&str, &str, Vec<Times>)| {
        let is_found = |(log, stamp): &Times| {
            let key = (place(topic), nanos(*log).unsigned_abs(), nanos(*stamp));
            wrong.found.contains_key(&key)
        };
        let numbers = messages.iter().enumerate();
        numbers
            .filter(|(_, it)| is_found(it))
            .map(|(number, _)| number)
            .collect()
    };
    topics.iter().map(of).collect()
}

/// States every 10 ms for 20 s.
fn states() -> Vec<Times> {
    (0..2_000)
        .map(|n| (f64::from(n) * 0.01, f64::from(n) * 0.01))
        .collect()
}

fn of_states(states: Vec<Times>) -> Vec<usize> {
    found(&[("/axes/state", AxisState::TYPE_NAME, states)]).remove(0)
}

#[test]
fn stamps_that_do_not_fit_those_beside_them_are_found_wherever_they_stand() {
    let epoch_s = -(START_S as f64);
    let far_s = (YEAR_2035_S - START_S) as f64;
    for stamp_s in [
        far_s,
        epoch_s,
        epoch_s + 7.5,
        -100.0,
        -3.0,
        35.0,
        600.0,
        -DAY_S,
        DAY_S,
    ] {
        for place in [0, 1, 5, 1_000, 1_998, 1_999] {
            let mut one = states();
            one[place].1 += if stamp_s.abs() < 1e8 {
                stamp_s
            } else {
                stamp_s - one[place].1
            };
            // The first or last one cannot be held against both sides: a minute is allowed there.
            let is_at_an_end = [0, 1_999].contains(&place);
            let wanted = if is_at_an_end
                && stamp_s.abs() < 60.0
                && !(place == 0 && stamp_s > 0.0 || place == 1_999 && stamp_s < 0.0)
            {
                vec![]
            } else {
                vec![place]
            };
            assert_eq!(of_states(one), wanted, "{stamp_s} at {place}");
        }
    }
}

#[test]
fn many_wrong_stamps_and_groups_of_them_are_found() {
    let mut all = states();
    for place in [3, 4, 5, 700, 900, 1_500] {
        all[place].1 = (YEAR_2035_S - START_S) as f64;
    }
    (1_000..1_100).for_each(|place| all[place].1 = -(START_S as f64));
    let wanted: Vec<usize> = [3, 4, 5, 700, 900]
        .into_iter()
        .chain(1_000..1_100)
        .chain([1_500])
        .collect();
    assert_eq!(of_states(all), wanted);
}

#[test]
fn late_messages_clocks_of_another_zero_and_pauses_are_no_wrong_stamps() {
    // Nothing arrives for 40 s, and then everything at once.
    let late = |n: i32| {
        let at = f64::from(n) * 0.01;
        let burst = 45.0 + f64::from(n - 500) * 0.001;
        (if n < 500 { at } else { at.max(burst) }, at)
    };
    let cases: [(&str, Vec<Times>); 6] = [
        ("as they are", states()),
        (
            "stamped by another zero",
            states()
                .into_iter()
                .map(|(log, at)| (log, at - DAY_S))
                .collect(),
        ),
        (
            "never stamped",
            states()
                .into_iter()
                .map(|(log, _)| (log, -(START_S as f64)))
                .collect(),
        ),
        (
            "twice as fast",
            states()
                .into_iter()
                .map(|(log, at)| (log, at * 2.0))
                .collect(),
        ),
        ("late after a pause", (0..2_000).map(late).collect()),
        (
            "a clock that was set",
            states()
                .into_iter()
                .map(|(log, at)| (log, if log < 8.0 { at } else { at + DAY_S }))
                .collect(),
        ),
    ];
    for (name, times) in cases {
        assert_eq!(of_states(times), Vec::<usize>::new(), "{name}");
    }
}

#[test]
fn topics_of_one_or_two_messages_are_held_against_the_bag() {
    let segment = |times: Vec<Times>| ("/test/segment", TestSegment::TYPE_NAME, times);
    let model = |times: Vec<Times>| ("/geometry/model", GeometryModel::TYPE_NAME, times);
    let far_s = (YEAR_2035_S - START_S) as f64;
    let zero_s = -(START_S as f64);
    for (times, wanted) in [
        (vec![(1.0, 1.0), (9.0, far_s)], vec![1]),
        (vec![(1.0, zero_s), (9.0, 9.0)], vec![0]),
        (vec![(1.0, far_s)], vec![0]),
        (vec![(1.0, 1.0), (9.0, 9.0)], vec![]),
        (
            vec![(1.0, 1.0), (5.0, zero_s), (9.0, 9.0), (12.0, 12.0)],
            vec![1],
        ),
    ] {
        let all = [
            ("/axes/state", AxisState::TYPE_NAME, states()),
            segment(times.clone()),
        ];
        assert_eq!(found(&all), [vec![], wanted], "{times:?}");
    }
    // A latched model is older than the bag; the epoch and the future are not its stamp.
    for (stamp_s, wanted) in [(-30.0 * DAY_S, vec![]), (zero_s, vec![0]), (far_s, vec![0])] {
        let all = [
            ("/axes/state", AxisState::TYPE_NAME, states()),
            model(vec![(0.0, stamp_s)]),
        ];
        assert_eq!(found(&all), [vec![], wanted], "{stamp_s}");
    }
}

#[test]
fn a_wrong_log_time_is_no_wrong_stamp() {
    let mut all = states();
    all[1_999].0 = 10.0 * DAY_S;
    assert_eq!(of_states(all), Vec::<usize>::new());
}
