//! The contract once more, over every bag that is kept: what older builds wrote is noticed, stripped, slowed and stopped alike.

use std::path::PathBuf;
use std::time::Duration;

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::msg::{ClockAnswer, GridSample};
use abbe_tests::program::root;
use serde_json::{Value, json};

use crate::contract::{changed_of, check, edited, touch_by_one_ulp, with_another};
use crate::lifecycle::drift_by_one_ulp;
use crate::old_bags::kept;
use crate::positioning::{averaged, scale_by_a_picometre};
use crate::recorded_output::{stripped_of, sums};
use crate::rewrite::{Change, Copied};
use crate::rotary::{at_contact, positions_by_one_ulp};
use crate::wall_clock::replayed;

/// What of one bag is changed, each of which its replay must notice.
struct Spoils {
    bag: &'static str,
    /// An input that comes into a result.
    topic: &'static str,
    /// Which message of it, counted from 0.
    nth: fn(&std::path::Path) -> usize,
    /// How far behind it the message of that topic is with which it is swapped: those that are averaged together
    /// commute, and a stamp 2 s off is left out.
    behind: usize,
    /// The least change of that message that can be seen in a result.
    least: fn(&mut Vec<u8>),
    /// A node's parameter as it stands in the bag, and another value of it.
    parameter: (&'static str, &'static str, &'static str),
}

const SPOILS: [Spoils; 6] = [
    Spoils {
        bag: "cold_reference",
        topic: "/probe/trigger",
        nth: |_| 0,
        behind: 1,
        least: touch_by_one_ulp,
        parameter: (
            "params/thermal_model.yaml",
            "validity_min: 40.0",
            "validity_min: 41.0",
        ),
    },
    Spoils {
        bag: "dual_loop",
        topic: "/axes/state",
        nth: averaged,
        behind: 1,
        least: scale_by_a_picometre,
        parameter: (
            "params/axis_compensation.yaml",
            "positioning.X.weight: 0.3",
            "positioning.X.weight: 0.2",
        ),
    },
    Spoils {
        bag: "grid_circles",
        topic: "/grid/position",
        nth: |_| 2_000,
        behind: 90,
        least: |data| edited(data, |read: &mut GridSample| read.u_m = read.u_m.next_up()),
        parameter: (
            "params/grid_encoder.yaml",
            "plate_scale_um_per_m: 2.0",
            "plate_scale_um_per_m: 2.1",
        ),
    },
    Spoils {
        bag: "host_clocks",
        topic: "/host_clock/answer",
        nth: |_| 40,
        behind: 1,
        least: |data| {
            edited(data, |answer: &mut ClockAnswer| {
                next_nano(&mut answer.received)
            })
        },
        parameter: (
            "params/clock_of_models.yaml",
            "least_exchanges: 20",
            "least_exchanges: 21",
        ),
    },
    Spoils {
        bag: "lifecycle",
        topic: "/thermal/model",
        nth: |_| 0,
        behind: 1,
        least: drift_by_one_ulp,
        parameter: (
            "params/axis_compensation.yaml",
            "shutdown_fade_s: 2.0",
            "shutdown_fade_s: 3.0",
        ),
    },
    Spoils {
        bag: "rotary_sphere",
        topic: "/axes/state",
        nth: at_contact,
        behind: 1,
        least: positions_by_one_ulp,
        parameter: (
            "params/rotary_axes.yaml",
            "allowance.setup_um: 0.3",
            "allowance.setup_um: 0.4",
        ),
    },
];

fn next_nano(stamp: &mut Time) {
    stamp.nanosec += 1;
}

/// Every kept bag with what is changed of it.
fn spoils() -> impl Iterator<Item = (PathBuf, &'static Spoils)> {
    let names = SPOILS
        .iter()
        .map(|spoils| root().join("bags").join(spoils.bag));
    let names: Vec<PathBuf> = names.collect();
    assert_eq!(kept(), names, "each kept bag has a row in SPOILS, by name");
    names.into_iter().zip(&SPOILS)
}

/// Checks that a changed bag is computed to its end, and differs.
fn is_noticed(changed: &std::path::Path, what: &str) {
    let (code, outcome) = check(changed);
    assert_eq!(code, 1, "{what}: {outcome:#}");
    assert_eq!(outcome["equal"], false, "{what}: {outcome:#}");
    let first = &outcome["first_difference"];
    eprintln!("{what}: first {} {}", first["topic"], first["discrepancy"]);
    assert!(first["topic"].is_string(), "{what}: {outcome:#}");
}

#[test]
fn replay_of_kept_bags_notices_the_least_change_of_an_input() {
    for (bag, spoils) in spoils() {
        let message = (spoils.topic, (spoils.nth)(&bag));
        let changed = with_another(&bag, message, spoils.least);
        is_noticed(changed.path(), &format!("{}: one input", spoils.bag));
    }
}

#[test]
fn replay_of_kept_bags_notices_the_order_of_two_events() {
    for (bag, spoils) in spoils() {
        let nth = (spoils.nth)(&bag);
        let swap = |messages: &mut Vec<Copied>| {
            let of_topic: Vec<usize> = (0..messages.len())
                .filter(|place| messages[*place].topic == spoils.topic)
                .collect();
            let (one, other) = (of_topic[nth], of_topic[nth + spoils.behind]);
            let data = std::mem::take(&mut messages[one].data);
            assert_ne!(data, messages[other].data, "they are the same");
            messages[one].data = std::mem::replace(&mut messages[other].data, data);
        };
        let changed = changed_of(
            &bag,
            &Change {
                messages: Some(&swap),
                ..Change::default()
            },
        );
        is_noticed(changed.path(), &format!("{}: order", spoils.bag));
    }
}

#[test]
fn replay_of_kept_bags_notices_a_parameter() {
    for (bag, spoils) in spoils() {
        let changed = changed_of(
            &bag,
            &Change {
                attachment: Some(spoils.parameter),
                ..Change::default()
            },
        );
        is_noticed(changed.path(), &format!("{}: parameter", spoils.bag));
    }
}

#[test]
fn replay_of_kept_bags_does_not_read_their_recorded_output() {
    for bag in kept() {
        let (_, whole) = check(&bag);
        let compared = whole["compared"].as_object().unwrap();
        let is_result = |topic: &str| compared.contains_key(topic);
        // What is not in the bag as it is kept, such as compensation that was left out, is summed up either way.
        let mut expected = whole["not_in_bag"].as_object().unwrap().clone();
        let Value::Object(recorded) = sums(&bag, &is_result) else {
            panic!("sums are by topic");
        };
        assert!(!recorded.is_empty(), "{}", bag.display());
        expected.extend(recorded);
        let (code, outcome) = check(stripped_of(&bag, &is_result).path());
        let found = &outcome["not_in_bag"];
        assert_eq!(*found, Value::Object(expected), "{}", bag.display());
        assert_eq!((code, &outcome["compared"]), (1, &json!({})));
    }
}

#[test]
fn replay_of_kept_bags_slowly_quickly_and_stopped_midway_computes_the_same() {
    let millis = Duration::from_millis;
    for bag in kept() {
        let (_, whole) = check(&bag);
        let compared = whole["compared"].as_object().unwrap();
        let stripped = stripped_of(&bag, &|topic| compared.contains_key(topic));
        let (quick, _) = replayed(stripped.path(), (millis(0), millis(0)), 0);
        assert!(quick.contains("sha256"), "{quick}");
        let (slow, steps) = replayed(stripped.path(), (millis(15), millis(3)), u32::MAX);
        let (stopped, stops) = replayed(stripped.path(), (millis(700), millis(3)), 1);
        eprintln!("{}: stood {steps} times, and {stops}", bag.display());
        assert!(steps > 0 && stops == 1, "{steps} and {stops}");
        assert_eq!(slow, quick, "{}", bag.display());
        assert_eq!(stopped, quick, "{}", bag.display());
    }
}
