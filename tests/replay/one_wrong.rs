//! One wrong message in a recording: it is left out, or its run is, by topic, number and reason, and the report of everything
//! else is that of the whole recording.

use abbe_msgs::msg::{AxisState, GridSample, LengthSample, TestSegment};
use abbe_tests::program::root;
use serde_json::Value;

use crate::contract::{changed_of, edited};
use crate::out_of_run::{LENGTH, SEGMENT, STATE, changed, imported, imported_of, places, told};
use crate::rewrite::{Change, Copied};
use crate::spoiled::{report, run};

const GRID: &str = "/grid/position";

fn titles(json: &Value) -> Vec<&str> {
    let tests = json["tests"].as_array().unwrap().iter();
    tests
        .map(|test| test["test"].as_str().unwrap_or_default())
        .collect()
}

#[test]
fn one_reading_of_another_zero_or_plane_costs_no_circle() {
    let bag = root().join("bags/grid_circles");
    let whole = report(&bag);
    assert_eq!(whole.code, 0, "{}", whole.said);
    type Way = fn(&mut GridSample);
    let ways: [(Way, &str); 2] = [
        (|it| it.zero_id += 1, "other_zero"),
        (|it| it.plane = GridSample::PLANE_ZX, "other_plane"),
    ];
    for (change, reason) in ways {
        let one = |messages: &mut Vec<Copied>| {
            let place = places(messages, GRID)[1999];
            edited(&mut messages[place].data, change);
        };
        let change = Change {
            messages: Some(&one),
            ..Change::default()
        };
        let found = report(changed_of(&bag, &change).path());
        assert_eq!(found.code, 3, "{reason}: {}", found.said);
        assert_eq!(told(&found.json, GRID), (reason.to_owned(), 1));
        assert!(
            found.said.contains("the first is number 2000,"),
            "{}",
            found.said
        );
        assert_eq!(titles(&found.json), titles(&whole.json), "{reason}");
    }
}

#[test]
fn one_state_of_another_machine_or_place_costs_no_target() {
    let home = imported();
    let whole = report(&home.path().join("bag"));
    type Way = fn(&mut AxisState);
    let ways: [(Way, &str); 2] = [
        (
            |it| it.axis = ["Y", "Z", "A"].map(str::to_owned).to_vec(),
            "other_machine",
        ),
        (|it| it.commanded[0] = 0.0, "outlier"),
    ];
    for (change, reason) in ways {
        let found = report(
            changed(&home, &|messages| {
                let states = places(messages, STATE);
                let place = states[states.len() / 2];
                edited(&mut messages[place].data, change);
            })
            .path(),
        );
        assert_eq!(found.code, 3, "{reason}: {}", found.said);
        assert_eq!(told(&found.json, STATE), (reason.to_owned(), 1));
        assert_eq!(found.json["tests"], whole.json["tests"], "{reason}");
    }
}

/// The begin of run 2 of a ballbar, changed; what it costs in words.
type WrongBegin = (fn(&mut TestSegment), &'static str);

#[test]
fn one_wrong_field_of_a_segment_costs_its_run_and_names_it_and_no_other() {
    let home = imported_of("ballbar", "gap_first");
    let whole = report(&home.path().join("bag"));
    assert_eq!(whole.code, 0, "{}", whole.said);
    let ways: [WrongBegin; 4] = [
        (
            |it| it.radius_m = 0.0,
            "radius_m = 0: must be above 0 for a circle",
        ),
        (
            |it| it.feed_m_s = -1.0,
            "feed_m_s = -1: must be from 0 to 10",
        ),
        (|it| it.sense = 0, "sense = 0: must be 1 or 2 for a circle"),
        (|it| it.plane = 3, "plane = 3 at its begin and 1 at its end"),
    ];
    for (change, words) in ways {
        let found = report(
            changed(&home, &|messages| {
                let begin = places(messages, SEGMENT)[2];
                edited(&mut messages[begin].data, |it: &mut TestSegment| {
                    assert_eq!((it.run, it.begin), (2, true));
                    change(it);
                });
            })
            .path(),
        );
        assert_eq!(found.code, 3, "{words}: {}", found.said);
        let named = &found.json["not_evaluated"][0];
        assert_eq!(named["run"], 2, "{words}: {named}");
        assert_eq!(named["reason"], words);
        let causes = |json: &Value| {
            let tests = json["tests"].as_array().unwrap().iter();
            let planes = tests.filter(|test| !test["breakdown"].is_null());
            let planes: Vec<usize> = planes
                .map(|test| test["breakdown"]["recordings"].as_array().unwrap().len())
                .collect();
            planes
        };
        let fewer: Vec<usize> = causes(&whole.json).iter().map(|n| n - 1).collect();
        assert_eq!(causes(&found.json), fewer, "{words}");
    }
}

#[test]
fn a_lost_beam_costs_its_run_alone() {
    let home = imported();
    let lost = changed(&home, &|messages| {
        let reading = places(messages, LENGTH)[400];
        edited(&mut messages[reading].data, |it: &mut LengthSample| {
            it.displacement_m = 0.0;
        });
    });
    let found = report(lost.path());
    assert_eq!(found.code, 3, "{}", found.said);
    assert_eq!(found.json["tests"][0]["iso230_2"]["n_runs"], 4);
    let named = &found.json["not_evaluated"][0];
    // 150 readings a run.
    assert_eq!(named["run"], 3, "{named}");
    let reason = named["reason"].as_str().unwrap();
    // The other four readings of the stop contradict it.
    assert!(reason.starts_with("readings of the stop at "), "{reason}");
}

#[test]
fn a_begin_before_the_end_of_the_last_run_at_one_instant_costs_nothing() {
    let home = imported();
    let whole = report(&home.path().join("bag"));
    let turned = changed(&home, &|messages| {
        let segments = places(messages, SEGMENT);
        for pair in segments[1..segments.len() - 1].chunks_exact(2) {
            let [end, begin] = [messages[pair[0]].clone(), messages[pair[1]].clone()];
            let (mut end, header) = (end, begin.header);
            let mut stamp = None;
            edited(&mut begin.data.clone(), |it: &mut TestSegment| {
                stamp = Some(it.header.stamp.clone());
            });
            edited(&mut end.data, |it: &mut TestSegment| {
                it.header.stamp = stamp.clone().unwrap();
            });
            end.header.log_time = header.log_time;
            end.header.publish_time = header.publish_time;
            messages.remove(pair[0]);
            // The begin has moved one place to the front.
            messages.insert(pair[1], end);
        }
    });
    let found = report(turned.path());
    assert_eq!(found.code, 0, "{}", found.said);
    assert_eq!(found.json["tests"], whole.json["tests"]);
}

#[test]
fn a_diagnosis_that_left_readings_out_ends_with_3() {
    let bag = root().join("bags/grid_circles");
    let other = |messages: &mut Vec<Copied>| {
        let place = places(messages, GRID)[1999];
        edited(&mut messages[place].data, |it: &mut GridSample| {
            it.zero_id += 1
        });
    };
    let change = Change {
        messages: Some(&other),
        ..Change::default()
    };
    let changed = changed_of(&bag, &change);
    for (bag, code) in [(bag.as_path(), 0), (changed.path(), 3)] {
        let (found, said) = run(&["diagnose", &bag.display().to_string()]);
        assert_eq!(found, code, "{said}");
        assert_eq!(
            said.contains("1 readings belong to another zero"),
            code == 3
        );
    }
}
