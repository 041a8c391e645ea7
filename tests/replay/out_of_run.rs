//! Readings that do not belong to their run, and runs that are not whole: a report leaves them out, names topic, reason and
//! number, ends with 3, and says of everything else what it says without them.

use std::path::Path;

use abbe_msgs::msg::{AngleSample, AxisState, LengthSample, TestSegment};
use abbe_tests::program::root;
use serde_json::Value;
use tempfile::TempDir;

use crate::contract::{changed_of, edited};
use crate::rewrite::{Change, Copied};
use crate::spoiled::{report, run};

pub const LENGTH: &str = "/length/position";
const ANGLE: &str = "/angle/position";
pub const SEGMENT: &str = "/test/segment";
pub const STATE: &str = "/axes/state";
/// Readings of one stop of `tests/import/positioning.csv`: the second of the first run.
const STOP: std::ops::Range<usize> = 5..10;
/// Five at each of 15 targets, from both sides, in five runs.
const READINGS: u64 = 750;

/// The table of a laser along X as a bag.
pub fn imported() -> TempDir {
    imported_of("positioning", "gap_first")
}

/// A table of `tests/import` as a bag of a machine of `launch_configs`.
pub fn imported_of(table: &str, machine: &str) -> TempDir {
    let home = tempfile::tempdir().unwrap();
    let [table, map, machine] = [
        format!("tests/import/{table}.csv"),
        format!("tests/import/{table}.yaml"),
        format!("launch_configs/{machine}/machine.yaml"),
    ]
    .map(|path| root().join(path).display().to_string());
    let bag = home.path().join("bag").display().to_string();
    let (code, said) = run(&[
        "import",
        &table,
        "--map",
        &map,
        "--machine",
        &machine,
        "--output",
        &bag,
    ]);
    assert_eq!(code, 0, "{said}");
    home
}

pub fn changed(home: &TempDir, change: &dyn Fn(&mut Vec<Copied>)) -> TempDir {
    changed_of(
        &home.path().join("bag"),
        &Change {
            messages: Some(change),
            ..Change::default()
        },
    )
}

/// Places of a topic's messages among all.
pub fn places(messages: &[Copied], topic: &str) -> Vec<usize> {
    let all = messages.iter().enumerate();
    all.filter(|(_, message)| message.topic == topic)
        .map(|(place, _)| place)
        .collect()
}

/// A bag with the readings of one stop changed.
fn with_stop(home: &TempDir, change: fn(&mut LengthSample)) -> TempDir {
    changed(home, &|messages| {
        for place in &places(messages, LENGTH)[STOP] {
            edited(&mut messages[*place].data, change);
        }
    })
}

/// The row of a topic, which must add up.
fn row(json: &Value, topic: &str) -> Value {
    let rows = json["account"].as_array().unwrap();
    for row in rows {
        let [messages, used, left_out, not_needed] =
            ["messages", "used", "left_out", "not_needed"].map(|key| row[key].as_u64().unwrap());
        assert_eq!(messages, used + left_out + not_needed, "{row:#}");
    }
    let mut rows = rows.iter().filter(|row| row["topic"] == topic);
    rows.next().cloned().unwrap()
}

pub fn told(json: &Value, topic: &str) -> (String, u64) {
    let left_out = json["loss"]["left_out"].as_array().unwrap();
    let mut of_topic = left_out.iter().filter(|it| it["topic"] == topic);
    let one = of_topic.next().unwrap_or_else(|| panic!("{left_out:#?}"));
    assert!(of_topic.next().is_none(), "{left_out:#?}");
    let reason = one["reason"].as_str().unwrap().to_owned();
    (reason, one["messages"].as_u64().unwrap())
}

/// Ways in which a reading does not belong to its run, and the reason in the account.
type Strange = (&'static str, fn(&mut LengthSample), &'static str);
const STRANGE: [Strange; 8] = [
    ("axis", |it| it.axis = "Y".to_owned(), "other_axis"),
    ("zero", |it| it.zero_id += 1, "other_zero"),
    (
        "2033",
        |it| it.header.stamp.sec = 2_000_000_000,
        "other_time",
    ),
    ("1970", |it| it.header.stamp.sec = 0, "other_time"),
    (
        "a day back",
        |it| it.header.stamp.sec -= 86_400,
        "other_time",
    ),
    (
        "five seconds ahead",
        |it| it.header.stamp.sec += 5,
        "other_time",
    ),
    ("millimetres", |it| it.displacement_m *= 1e3, "beyond"),
    ("far", |it| it.displacement_m = 1e12, "beyond"),
];

#[test]
fn readings_of_another_axis_time_or_size_are_left_out_and_told() {
    let home = imported();
    let without = changed(&home, &|messages| {
        let of_stop = places(messages, LENGTH)[STOP].to_vec();
        for place in of_stop.into_iter().rev() {
            messages.remove(place);
        }
    });
    let without = report(without.path());
    assert_eq!(without.code, 0, "{}", without.said);
    assert_eq!(row(&without.json, LENGTH)["used"], READINGS - 5);
    for (how, change, reason) in STRANGE {
        let found = report(with_stop(&home, change).path());
        assert_eq!(found.code, 3, "{how}: {}", found.said);
        let wanted = (reason.to_owned(), 5);
        assert_eq!(told(&found.json, LENGTH), wanted, "{how}");
        assert_eq!(found.json["tests"], without.json["tests"], "{how}");
        let line = format!("abbe: {LENGTH}: 5 of {READINGS} messages left out");
        assert!(found.said.contains(&line), "{how}: {}", found.said);
        assert!(found.said.contains("the first is number 6,"), "{how}");
        assert_eq!(row(&found.json, LENGTH)["left_out"], 5, "{how}");
    }
}

#[test]
fn readings_of_a_clock_that_is_an_hour_off_are_all_left_out() {
    let home = imported();
    let later = changed(&home, &|messages| {
        for place in places(messages, LENGTH) {
            let late = |it: &mut LengthSample| it.header.stamp.sec += 3600;
            edited(&mut messages[place].data, late);
        }
    });
    let found = report(later.path());
    assert_eq!(found.code, 3, "{}", found.said);
    let wanted = ("other_time".to_owned(), READINGS);
    assert_eq!(told(&found.json, LENGTH), wanted);
    let words = "its stamps are 60 min later than those of the other topics";
    assert!(found.said.contains(words), "{}", found.said);
    assert!(found.json["tests"][0]["iso230_2"].is_null());
}

#[test]
fn states_far_outside_the_travel_are_left_out_and_told_and_the_rest_is_evaluated() {
    let home = imported();
    let whole = report(&home.path().join("bag"));
    assert_eq!(whole.code, 0, "{}", whole.said);
    // Of a second machine: one, and as many as a third of all.
    for (every, far_m) in [(usize::MAX, 100.0), (3, 100.0), (3, -1e6)] {
        let strange = changed(&home, &|messages| {
            let states = places(messages, STATE);
            let every = every.min(states.len() / 2);
            for place in states.into_iter().step_by(every).skip(1).rev() {
                let mut far = messages[place].clone();
                edited(&mut far.data, |it: &mut AxisState| it.commanded[0] = far_m);
                messages.insert(place + 1, far);
            }
        });
        let found = report(strange.path());
        assert_eq!(found.code, 3, "{every} {far_m}: {}", found.said);
        let (reason, n) = told(&found.json, STATE);
        assert_eq!(reason, "other_machine", "{every} {far_m}");
        assert_eq!(row(&found.json, STATE)["left_out"], n);
        let words = "axis X was commanded to";
        assert!(found.said.contains(words), "{}", found.said);
        assert_eq!(found.json["tests"], whole.json["tests"], "{every} {far_m}");
    }
}

/// The same of an angle.
type StrangeAngle = (fn(&mut AngleSample), &'static str);

#[test]
fn angles_of_another_axis_or_time_are_left_out_and_told() {
    let home = imported_of("rotary", "five_axis");
    let ways: [StrangeAngle; 2] = [
        (|it| it.axis = "A".to_owned(), "other_axis"),
        (|it| it.header.stamp.sec += 3600, "other_time"),
    ];
    for (change, reason) in ways {
        let strange = changed(&home, &|messages| {
            for place in &places(messages, ANGLE)[STOP] {
                edited(&mut messages[*place].data, change);
            }
        });
        let found = report(strange.path());
        assert_eq!(found.code, 3, "{reason}: {}", found.said);
        assert_eq!(told(&found.json, ANGLE), (reason.to_owned(), 5));
        row(&found.json, ANGLE);
    }
}

/// X moves, Y stands at 0 and Z at 120 mm.
#[test]
fn a_tracker_that_reads_further_axes_beside_the_runs_own_leaves_a_whole_report() {
    let home = imported();
    let once = report(&home.path().join("bag"));
    let tracked = changed(&home, &|messages| {
        for place in places(messages, LENGTH).into_iter().rev() {
            for (axis, displacement_m) in [("Y", 2e-6), ("Z", 0.12)] {
                let mut further = messages[place].clone();
                edited(&mut further.data, |it: &mut LengthSample| {
                    it.axis = axis.to_owned();
                    it.displacement_m = displacement_m;
                });
                messages.insert(place + 1, further);
            }
        }
    });
    let found = report(tracked.path());
    assert_eq!(found.code, 0, "{}", found.said);
    assert_eq!(found.json["tests"], once.json["tests"]);
    let row = row(&found.json, LENGTH);
    assert_eq!(row["used"], READINGS);
    assert_eq!(row["not_needed"], 2 * READINGS);
    // Without a reading of X nothing was measured along it.
    let renamed = changed(&home, &|messages| {
        for place in places(messages, LENGTH) {
            let rename = |it: &mut LengthSample| it.axis = "Y".to_owned();
            edited(&mut messages[place].data, rename);
        }
    });
    let found = report(renamed.path());
    assert_eq!(found.code, 3, "{}", found.said);
    let wanted = ("other_axis".to_owned(), READINGS);
    assert_eq!(told(&found.json, LENGTH), wanted);
}

#[test]
fn a_run_that_was_not_completed_is_told_with_its_number_test_and_reason() {
    let home = imported();
    let broken = changed(&home, &|messages| {
        let end = places(messages, SEGMENT)[1];
        edited(&mut messages[end].data, |it: &mut TestSegment| {
            assert_eq!((it.run, it.begin), (1, false));
            it.completed = false;
        });
    });
    let found = report(broken.path());
    assert_eq!(found.code, 3, "{}", found.said);
    let words = "Not evaluated: run 1, positioning along or about X: its end says that it was not completed";
    assert!(found.said.contains(words), "{}", found.said);
    let told = &found.json["not_completed"][0];
    assert_eq!(told["run"], 1, "{told}");
    assert_eq!(told["test"], "positioning along or about X");
    assert_eq!(found.json["tests"][0]["iso230_2"]["n_runs"], 4);
    // A fifth of the readings is of the first of five runs.
    let row = row(&found.json, LENGTH);
    assert_eq!(row["used"], READINGS / 5 * 4);
    assert_eq!(row["not_needed"], READINGS / 5);
    assert!(page(broken.path()).contains(words));
}

/// The bag without the begin, or the end, of its first run.
fn without_segment(home: &TempDir, nth: usize) -> TempDir {
    changed(home, &|messages| {
        let place = places(messages, SEGMENT)[nth];
        let mut data = messages.remove(place).data;
        edited(&mut data, |it: &mut TestSegment| {
            assert_eq!((it.run, it.begin), (1, nth == 0));
        });
    })
}

#[test]
fn a_run_without_an_end_or_a_begin_is_told_and_its_readings_are_not_used() {
    let home = imported();
    for (nth, reason, words) in [
        (1, "no_end", "run 1 begins and has no end"),
        (0, "no_begin", "run 1 ends and has not begun"),
    ] {
        let found = report(without_segment(&home, nth).path());
        assert_eq!(found.code, 3, "{reason}: {}", found.said);
        assert_eq!(told(&found.json, SEGMENT), (reason.to_owned(), 1));
        assert!(found.said.contains(words), "{}", found.said);
        // A fifth of the readings is of the first of five runs.
        assert_eq!(row(&found.json, LENGTH)["used"], READINGS / 5 * 4);
        if reason == "no_end" {
            let wanted = (reason.to_owned(), READINGS / 5);
            assert_eq!(told(&found.json, LENGTH), wanted);
        }
    }
}

#[test]
fn segments_that_are_told_twice_change_nothing() {
    let home = imported();
    let once = report(&home.path().join("bag"));
    let twice = changed(&home, &|messages| {
        for place in places(messages, SEGMENT).into_iter().rev() {
            let again = messages[place].clone();
            messages.insert(place, again);
        }
    });
    let twice = report(twice.path());
    assert_eq!((once.code, twice.code), (0, 3), "{}", twice.said);
    assert_eq!(once.json["tests"], twice.json["tests"]);
    assert_eq!(row(&once.json, LENGTH)["used"], READINGS);
    row(&twice.json, LENGTH);
}

fn page(bag: &Path) -> String {
    let bag = bag.display().to_string();
    run(&["report", &bag]).1
}

#[test]
fn without_the_places_of_the_axes_the_missing_topic_is_named() {
    let home = imported();
    let without = changed(&home, &|messages| {
        messages.retain(|message| message.topic != STATE);
    });
    let found = report(without.path());
    assert_eq!(found.code, 3, "{}", found.said);
    let wanted = ("no_place".to_owned(), READINGS);
    assert_eq!(told(&found.json, LENGTH), wanted);
    let page = page(without.path());
    let why = "no message of the topic axes/state can be used";
    assert!(page.contains(why), "{page}");
    assert!(!page.contains("linear scale"), "{page}");
    assert!(!page.contains("0 points"), "{page}");
}
