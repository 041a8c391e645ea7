//! Breaks: a link that is cut or falls silent, at rest and in the middle of a flood, and a server that begins anew.

use std::collections::BTreeMap;

use metrology::sample::MachineValue;
use opcua_bridge::{Condition, Output};
use serde_json::json;

use super::peer::{Machine, Proxy, free_port, interpreter};
use super::{MAP, config, flood, heard, is_condition, is_loss, is_text, open, value};

#[test]
fn a_link_that_is_cut_is_absence_and_comes_back_with_what_was_missed() {
    let Some(python) = interpreter("opcua cut") else {
        return;
    };
    let port = free_port();
    let mut machine = Machine::start(&python, port, &["urn:abbe:machine"], &json!({}));
    let proxy = Proxy::start(port);
    let mut bridge = open(&config(proxy.port()), MAP);
    heard(&mut bridge, |output| is_text(output, "20"));
    proxy.cut();
    heard(&mut bridge, |output| {
        is_condition(output, "unavailable/spindle", "since")
    });
    machine.tell(&json!({"write": "T", "value": 22.5, "at_s": 1_480_411_729}));
    proxy.mend();
    let said = heard(&mut bridge, |output| is_text(output, "22.5"));
    let is_back = |one: &Output| {
        matches!(
            one,
            Output::Condition(Condition::Resumed { .. } | Condition::Connected { .. })
        )
    };
    assert!(said.iter().any(is_back), "{said:?}");
    let lost = |one: &&Output| matches!(one, Output::Condition(Condition::SequenceGap { .. }));
    assert_eq!(said.iter().find(lost), None);
}

#[test]
fn a_server_that_begins_anew_with_other_indices_is_understood() {
    let Some(python) = interpreter("opcua restart") else {
        return;
    };
    let port = free_port();
    let machine = Machine::start(&python, port, &["urn:abbe:machine"], &json!({}));
    let mut bridge = open(&config(port), MAP);
    heard(&mut bridge, |output| is_text(output, "20"));
    drop(machine);
    heard(&mut bridge, |output| {
        is_condition(output, "unavailable/spindle", "since")
    });
    // What was the index of the machine is that of another namespace now.
    let others = ["urn:new", "urn:other", "urn:abbe:machine"];
    let mut machine = Machine::start(&python, port, &others, &json!({}));
    heard(&mut bridge, |output| is_text(output, "20"));
    machine.tell(&json!({"write": "T", "value": 23.5, "at_s": 1_480_411_729}));
    heard(&mut bridge, |output| is_text(output, "23.5"));
}

#[test]
fn a_link_that_falls_silent_is_noticed_by_the_keep_alive() {
    let Some(python) = interpreter("opcua silence") else {
        return;
    };
    let port = free_port();
    let _machine = Machine::start(&python, port, &["urn:abbe:machine"], &json!({}));
    let proxy = Proxy::start(port);
    let mut config = config(proxy.port());
    config.connection.keep_alive_s = 0.2;
    config.connection.reply_timeout_s = 0.5;
    let mut bridge = open(&config, MAP);
    heard(&mut bridge, |output| is_text(output, "20"));
    proxy.fall_silent();
    heard(&mut bridge, |output| {
        is_condition(output, "unavailable/spindle", "since")
    });
    proxy.mend();
    heard(&mut bridge, |output| is_text(output, "20"));
}

/// Values of each node ascend without a gap, whatever was cut between; a value may be published again after the break.
#[test]
fn a_link_that_is_cut_in_the_middle_of_a_flood_loses_nothing_and_keeps_the_order() {
    const COUNT: usize = 10_000;
    let Some(python) = interpreter("opcua cut flood") else {
        return;
    };
    let (names, map) = flood();
    let port = free_port();
    let mut machine = Machine::start(&python, port, &["urn:abbe:machine"], &json!({}));
    let proxy = Proxy::start(port);
    let mut flooded = config(proxy.port());
    flooded.subscription.queue = 10_000;
    let mut bridge = open(&flooded, &map);
    heard(&mut bridge, |output| is_text(output, "-10"));
    machine.ask(&json!({"burst": COUNT, "names": names, "per_s": 4000}));
    let mut n_values = 0;
    let mut is_third = |output: &Output| {
        n_values += usize::from(value(output).is_some());
        n_values > COUNT / 3
    };
    let mut said = heard(&mut bridge, &mut is_third);
    proxy.cut();
    said.extend(heard(&mut bridge, |output| {
        is_condition(output, "connection", "is broken")
    }));
    proxy.mend();
    let last: Vec<String> = (0..names.len())
        .map(|n| (COUNT - 1 - n).to_string())
        .collect();
    let mut open_ends = last.len();
    said.extend(heard(&mut bridge, |output| {
        open_ends -= usize::from(value(output).is_some_and(|one| last.contains(&one.text)));
        open_ends == 0
    }));
    let resumed = |one: &Output| matches!(one, Output::Condition(Condition::Resumed { .. }));
    assert!(said.iter().any(resumed), "{said:?}");
    assert_eq!(said.iter().find(is_loss), None);
    let mut nodes: BTreeMap<&str, Vec<&MachineValue>> = BTreeMap::new();
    for one in said.iter().filter_map(value) {
        nodes.entry(&one.name).or_default().push(one);
    }
    for (at, (name, told)) in nodes.iter().enumerate() {
        let mut numbers: Vec<f64> = told.iter().map(|one| one.text.parse().unwrap()).collect();
        numbers.dedup();
        let wanted = (at..COUNT).step_by(names.len()).map(|n| n as f64);
        let wanted: Vec<f64> = wanted.collect();
        let from = numbers.iter().position(|one| *one >= 0.0).unwrap();
        assert_eq!(numbers[from..], wanted, "{name}");
    }
}
