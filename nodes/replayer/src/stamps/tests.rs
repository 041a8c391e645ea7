use abbe_msgs::Message;
use abbe_msgs::msg::{AxisState, GeometryModel, ProbeTrigger, TestSegment};
use abbe_msgs::sensor_msgs::msg::Temperature;
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

/// A topic, its type, its messages.
type Of<'t> = (&'t str, &'t str, Vec<Times>);

/// A bag of `topics`.
fn bag_of(home: &tempfile::TempDir, topics: &[Of<'_>]) -> Bag {
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
    Bag::open(&path).unwrap()
}

/// Numbers, from 0, of each topic's messages that are found in a bag of `topics`.
fn found(topics: &[Of<'_>]) -> Vec<Vec<usize>> {
    let home = tempfile::tempdir().unwrap();
    let bag = bag_of(&home, topics);
    let wrong = WrongStamps::of(&bag);
    let place = |name: &str| {
        bag.topics()
            .iter()
            .position(|info| info.topic == name)
            .unwrap()
    };
    let of = |(topic, _, messages): &Of<'_>| {
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

/// The words for each topic of a bag whose stamps are all of another time.
fn other_clocks(topics: &[Of<'_>]) -> Vec<(String, String)> {
    let home = tempfile::tempdir().unwrap();
    let bag = bag_of(&home, topics);
    let wrong = WrongStamps::of(&bag);
    assert!(wrong.found.is_empty(), "{:?}", wrong.found);
    let mut messages = bag.messages(Order::File);
    let mut said = BTreeMap::new();
    while let Some(Event::Message(message)) = messages.next_event() {
        if let Some(what) = wrong.other_clock(message.topic) {
            said.insert(bag.topic(message.topic).topic.clone(), what);
        }
    }
    said.into_iter().collect()
}

const SESSION: [(&str, &str); 5] = [
    ("/axes/state", AxisState::TYPE_NAME),
    ("/probe/trigger", ProbeTrigger::TYPE_NAME),
    ("/temperature/bed", Temperature::TYPE_NAME),
    ("/temperature/nut_z", Temperature::TYPE_NAME),
    ("/test/segment", TestSegment::TYPE_NAME),
];

/// A session whose topics that begin with one of `names` are stamped `by_s` later.
fn session(names: &[&str], by_s: f64) -> Vec<Of<'static>> {
    let every = |s: f64| {
        let times = (1..).map(move |n| f64::from(n) * s);
        times.take_while(|at| *at < 20.0).collect::<Vec<f64>>()
    };
    let topic = |(name, type_name): (&'static str, &'static str)| {
        let is_late = names.iter().any(|late| name.starts_with(*late));
        let by_s = if is_late { by_s } else { 0.0 };
        let at = match name {
            "/axes/state" => every(0.01),
            "/probe/trigger" => every(1.0),
            _ => every(4.5),
        };
        let times: Vec<Times> = at.into_iter().map(|at| (at, at + by_s)).collect();
        (name, type_name, times)
    };
    SESSION.into_iter().map(topic).collect()
}

/// First and last stamp of the topics of a session, in words.
fn span(names: &[&str], by_s: f64, is_of: impl Fn(&str) -> bool) -> String {
    let session = session(names, by_s);
    let of = session.iter().filter(|(name, ..)| is_of(name));
    let stamps = of.flat_map(|(.., times)| times.iter().map(|(_, stamp)| nanos(*stamp)));
    let (first, last) = stamps.fold((i64::MAX, 0), |(a, b), at| (a.min(at), b.max(at)));
    format!("{} to {}", date(first), date(last))
}

#[test]
fn a_topic_whose_stamps_are_all_of_another_time_than_those_of_the_others_is_named() {
    for (by_s, words) in [
        (
            3_600.0,
            "its stamps are 60 min later than those of the other topics",
        ),
        (
            7_200.0,
            "its stamps are 2.0 h later than those of the other topics",
        ),
        (
            -90.0,
            "its stamps are 90.0 s earlier than those of the other topics",
        ),
        (
            -DAY_S,
            "its stamps are 24.0 h earlier than those of the other topics",
        ),
    ] {
        for names in [
            &["/probe/trigger"][..],
            &["/test/segment"],
            &["/axes/state"],
            &["/temperature/bed"],
            &["/temperature/nut_z"],
            &["/temperature/bed", "/temperature/nut_z"],
        ] {
            let said = other_clocks(&session(names, by_s));
            let topics: Vec<&str> = said.iter().map(|(topic, _)| topic.as_str()).collect();
            assert_eq!(topics, names, "{by_s}");
            for (topic, what) in &said {
                assert!(what.starts_with(words), "{topic}: {what}");
                let own = span(names, by_s, |name| name == topic);
                let others = span(names, by_s, |name| !names.contains(&name));
                let both = format!("topics: {own}, those {others}; set the clock");
                assert!(what.contains(&both), "{topic}: {what}, not {both}");
            }
        }
    }
}

#[test]
fn topics_of_one_clock_and_topics_without_a_steady_offset_are_not_named() {
    for by_s in [0.0, DAY_S, -DAY_S] {
        let said = other_clocks(&session(&["/"], by_s));
        assert!(said.is_empty(), "{by_s}: {said:?}");
    }
    // A clock that was set for the second half of every topic; the thermometers begin only then.
    let mut set = session(&[], 0.0);
    for (name, _, times) in &mut set {
        if name.starts_with("/temperature/") {
            times.retain(|(log, _)| *log >= 10.0);
        }
        let late = times.iter_mut().filter(|(log, _)| *log >= 10.0);
        late.for_each(|(_, stamp)| *stamp += DAY_S);
    }
    let said = other_clocks(&set);
    assert!(said.is_empty(), "{said:?}");
    // A latched model is as old as it likes to be.
    let mut latched = session(&[], 0.0);
    let model = vec![(5.0, -DAY_S), (6.0, 1.0 - DAY_S)];
    latched.push(("/geometry/model", GeometryModel::TYPE_NAME, model));
    let said = other_clocks(&latched);
    assert!(said.is_empty(), "{said:?}");
}

#[test]
fn one_wrong_stamp_among_four_readings_of_a_thermometer_is_found() {
    for by_s in [100.0, 3_600.0, -3_600.0, DAY_S, -DAY_S] {
        for place in 0..4 {
            let mut all = session(&[], 0.0);
            let (name, _, readings) = &mut all[3];
            assert_eq!((*name, readings.len()), ("/temperature/nut_z", 4));
            readings[place].1 += by_s;
            let mut wanted: Vec<Vec<usize>> = vec![vec![]; SESSION.len()];
            wanted[3] = vec![place];
            assert_eq!(found(&all), wanted, "{by_s} at {place}");
        }
    }
}
