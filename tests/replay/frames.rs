//! Frames in a bag: fixed ones always, moving ones where they are wanted, and names of frames on what is raw.

use std::collections::BTreeMap;
use std::path::Path;

use abbe_msgs::msg::{AxisState, ProbeTrigger, ProbedPoint, TestSegment};
use abbe_msgs::{Message, from_cdr};
use abbe_tests::scenario::Scenario;

use crate::contract::{check, short_run};

/// Latency and blocks alone.
const PLAN: &str = "\
title: frames
steps:
  - {do: latency, feature: block_1.z, feeds_mm_min: [60.0, 240.0], repeats: 2}
  - {do: blocks, cold: true}
";

/// Messages by topic, and the first of each.
fn said(bag: &Path) -> BTreeMap<String, (u64, Vec<u8>)> {
    let bag = recorder::Bag::open(bag).unwrap();
    let mut messages = bag.messages(recorder::Order::File);
    let mut said = BTreeMap::new();
    while let Some(event) = messages.next_event() {
        let recorder::Event::Message(message) = event else {
            panic!("a whole bag has no loss");
        };
        let topic = bag.topics()[message.topic.index()].topic.clone();
        said.entry(topic)
            .or_insert_with(|| (0, message.data.to_vec()))
            .0 += 1;
    }
    said
}

fn first<M: Message>(said: &BTreeMap<String, (u64, Vec<u8>)>, topic: &str) -> M {
    from_cdr(&said[topic].1).unwrap()
}

#[test]
fn frames_are_no_part_of_a_replay_and_fixed_ones_are_in_every_bag() {
    let short = said(short_run());
    assert_eq!(short["/tf_static"].0, 1);
    assert!(!short.contains_key("/tf"), "hours of it are left out");
    let scenario = Scenario::copy_of("first_run");
    scenario.write("plan.yaml", PLAN);
    scenario.replace("scenario.yaml", "recording: {exclude: [/tf]}", "");
    let bag = scenario.run().join("bag");
    let told = said(&bag);
    assert_eq!(
        told["/tf"].0, told["/joint_states"].0,
        "with every position"
    );
    let (code, outcome) = check(&bag);
    assert_eq!(code, 0, "{outcome:#}");
    let compared = outcome["compared"].as_object().unwrap();
    assert!(compared["/blocks/measurement"]["messages"].as_u64() > Some(0));
    assert!(!compared.contains_key("/tf") && !compared.contains_key("/tf_static"));
}

#[test]
fn touches_and_segments_name_the_machines_frame_and_what_is_computed_stays_as_old_bags_have_it() {
    let short = said(short_run());
    let touch: ProbeTrigger = first(&short, "/probe/trigger");
    assert_eq!(touch.header.frame_id, "machine");
    let segment: TestSegment = first(&short, "/test/segment");
    assert_eq!(segment.header.frame_id, "machine");
    let state: AxisState = first(&short, "/axes/state");
    assert_eq!(state.header.frame_id, "", "no namespace");
    let point: ProbedPoint = first(&short, "/probe/point");
    assert_eq!(point.header.frame_id, "");
}
