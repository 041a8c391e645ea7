//! Readings that were recorded late or early, with stamps that are right, and runs that are no repetitions of one another.

use abbe_msgs::msg::{GridSample, LengthSample, TestSegment};
use abbe_msgs::sensor_msgs::msg::Temperature;
use abbe_tests::program::root;
use serde_json::Value;

use crate::contract::{changed_of, edited};
use crate::out_of_run::{LENGTH, SEGMENT, STATE, changed, imported, imported_of, places, told};
use crate::rewrite::{Change, Copied};
use crate::spoiled::report;

/// Records the messages of topics later by so many seconds.
fn late(messages: &mut [Copied], topics: &[&str], late_s: f64) {
    let late_nanos = (late_s * 1e9) as i64;
    // They are written in the order of their log times.
    for message in messages.iter_mut() {
        if topics.contains(&message.topic.as_str()) {
            let at = &mut message.header.log_time;
            *at = at.saturating_add_signed(late_nanos);
        }
    }
    messages.sort_by_key(|it| it.header.log_time);
}

#[test]
fn stops_are_read_by_the_stamps_of_a_topic_that_came_late_throughout() {
    let home = imported();
    let sound = report(&home.path().join("bag"));
    assert_eq!(sound.code, 0, "{}", sound.said);
    let wanted = sound.json["tests"][0]["iso230_2"].clone();
    for (topics, late_s) in [
        (&[STATE][..], 0.8),
        (&[STATE], 1.0),
        (&[STATE], 1.5),
        (&[STATE], 1.3),
        (&[STATE, SEGMENT], 1.5),
        (&[LENGTH], -1.0),
        (&[STATE], -1.0),
        (&[STATE], 1.9),
        (&[STATE], 2.0),
        (&[STATE], -2.0),
        (&[LENGTH], 1.5),
        (&[LENGTH], 2.0),
        (&[LENGTH], -2.0),
        (&[SEGMENT], 6.0),
        (&[SEGMENT], 30.0),
        (&[SEGMENT], -30.0),
    ] {
        let bag = changed(&home, &|messages| {
            late(messages, topics, late_s);
        });
        let found = report(bag.path());
        let figures = &found.json["tests"][0]["iso230_2"];
        for name in ["accuracy", "systematic_error", "repeatability"] {
            let [found_mm, wanted_mm] = [figures, &wanted].map(|it| it[name]["value_mm"].as_f64());
            let off_mm = found_mm.zip(wanted_mm).map(|(a, b)| (a - b).abs());
            assert!(
                off_mm.is_some_and(|mm| mm < 2e-5),
                "{topics:?} {late_s} s: {name} {found_mm:?}: {}",
                found.said
            );
        }
        assert_eq!(found.code, 0, "{topics:?} {late_s} s: {}", found.said);
    }
}

fn with_lengths(change: impl Fn(usize, &mut LengthSample)) -> (i32, String) {
    let home = imported();
    let bag = changed(&home, &|messages| {
        for (k, place) in places(messages, LENGTH).into_iter().enumerate() {
            edited(&mut messages[place].data, |it| change(k, it));
        }
    });
    let found = report(bag.path());
    (found.code, found.said)
}

#[test]
fn a_laser_that_counts_the_other_way_gives_no_figure() {
    let (code, said) = with_lengths(|_, it| it.displacement_m = -it.displacement_m);
    assert_eq!(code, 3, "{said}");
    let words = "the reading runs against the axis: correct the sign or the direction of the beam";
    assert!(
        said.contains(words) && !said.contains("accuracy A"),
        "{said}"
    );
}

#[test]
fn a_bag_without_a_completed_run_or_any_run_ends_with_3() {
    let home = imported();
    let broken_off = changed(&home, &|messages| {
        for place in places(messages, SEGMENT) {
            edited(&mut messages[place].data, |it: &mut TestSegment| {
                it.completed = false
            });
        }
    });
    let found = report(broken_off.path());
    assert_eq!(found.code, 3, "{}", found.said);
    let without = changed(&home, &|messages| messages.retain(|it| it.topic != SEGMENT));
    let found = report(without.path());
    assert_eq!(found.code, 3, "{}", found.said);
    assert_eq!(told(&found.json, LENGTH), ("no_begin".to_owned(), 750));
}

#[test]
fn runs_with_another_offset_set_up_or_feed_are_other_tests() {
    let home = imported();
    let changes: [fn(&mut TestSegment); 3] = [
        |it| it.tool_offset.x = f64::from(it.repeat / 2) * 0.1,
        |it| it.setup_id = it.repeat / 2 + 1,
        |it| it.feed_m_s = f64::from(it.repeat / 2 + 1) * 0.01,
    ];
    for change in changes {
        let bag = changed(&home, &|messages| {
            for place in places(messages, SEGMENT) {
                edited(&mut messages[place].data, change);
            }
        });
        let found = report(bag.path());
        let tests = found.json["tests"].as_array().unwrap();
        let n_runs: Vec<Option<u64>> = { tests.iter() }
            .filter(|it| it["iso230_2"].is_object())
            .map(|it| it["iso230_2"]["n_runs"].as_u64())
            .collect();
        assert_eq!(n_runs[..2], [Some(2), Some(2)], "{}", found.said);
    }
}

#[test]
fn two_readings_of_one_stamp_that_differ_leave_their_run_out() {
    let home = imported();
    for (apart_m, is_used) in [(2e-6, true), (3e-5, false)] {
        let bag = changed(&home, &|messages| {
            for place in places(messages, LENGTH).into_iter().rev() {
                let mut second = messages[place].clone();
                edited(&mut second.data, |it: &mut LengthSample| {
                    it.displacement_m += apart_m
                });
                messages.insert(place + 1, second);
            }
        });
        let found = report(bag.path());
        assert_eq!(found.code == 0, is_used, "{}", found.said);
        let words = "two readings of one stamp at the stop at ";
        assert_eq!(found.said.contains(words), !is_used, "{}", found.said);
    }
}

/// Two recordings of a circle, a log and a thermometer with one time base: each reading is followed by another one of its stamp.
#[test]
fn circles_and_logs_with_two_differing_readings_of_each_stamp_are_not_evaluated() {
    let ballbar = imported_of("ballbar", "gap_first");
    let log = imported_of("drift", "first_run");
    let grid = root().join("bags/grid_circles");
    type Twice<'t> = &'t dyn Fn(&mut Copied, f64);
    let length: Twice =
        &|it, m| edited(&mut it.data, |it: &mut LengthSample| it.displacement_m += m);
    let place: Twice = &|it, m| edited(&mut it.data, |it: &mut GridSample| it.u_m += m);
    for (bag, topic, twice) in [
        (ballbar.path().join("bag"), LENGTH, length),
        (log.path().join("bag"), LENGTH, length),
        (grid, "/grid/position", place),
    ] {
        let whole = report(&bag);
        assert_eq!(whole.code, 0, "{}", whole.said);
        for (apart_m, is_used) in [(2e-6, true), (3e-5, false)] {
            let double = |messages: &mut Vec<Copied>| {
                for place in places(messages, topic).into_iter().rev() {
                    let mut second = messages[place].clone();
                    twice(&mut second, apart_m);
                    messages.insert(place + 1, second);
                }
            };
            let change = Change {
                messages: Some(&double),
                ..Change::default()
            };
            let found = report(changed_of(&bag, &change).path());
            assert_eq!(found.code == 0, is_used, "{topic}: {}", found.said);
            let words = "times two readings of one stamp differ, by up to 30 µm, at most 5 µm";
            assert_eq!(found.said.contains(words), !is_used, "{}", found.said);
            let n_tests = |json: &Value| json["tests"].as_array().map_or(0, Vec::len);
            let [found, whole] = [&found, &whole].map(|it| n_tests(&it.json));
            assert_eq!(found == whole, is_used, "{topic}: {found} {whole}");
        }
    }
}

#[test]
fn a_second_temperature_of_a_stamp_is_left_out_where_it_differs() {
    let home = imported_of("drift", "first_run");
    let whole = report(&home.path().join("bag"));
    for (apart_k, is_used) in [(0.3, true), (3.0, false)] {
        let bag = changed(&home, &|messages| {
            let is_temperature = |it: &Copied| it.topic.starts_with("/temperature/");
            let place = messages.iter().rposition(is_temperature).unwrap();
            let mut second = messages[place].clone();
            edited(&mut second.data, |it: &mut Temperature| {
                it.temperature += apart_k
            });
            messages.insert(place + 1, second);
        });
        let found = report(bag.path());
        assert_eq!(found.code == 0, is_used, "{}", found.said);
        let words = "two readings of one stamp differ by 3 K, at most 0.5 K";
        assert_eq!(found.said.contains(words), !is_used, "{}", found.said);
        if !is_used {
            assert_eq!(found.json["tests"], whole.json["tests"]);
        }
    }
}
