//! What a host's clock is, is computed from the recorded answers.

use abbe_msgs::msg::ClockAnswer;
use abbe_msgs::{from_cdr, to_cdr};
use abbe_tests::scenario::{Scenario, mcap_file};

use crate::contract::check;
use crate::rewrite::{Change, Copied, rewrite};
use crate::snapshot::resumes_halfway;

/// A cell in simulated time whose hosts ask each other for the time.
fn cell() -> Scenario {
    let scenario = Scenario::copy_of("cold_reference");
    let mut nodes = String::new();
    for host in ["controller", "models"] {
        nodes += &format!(
            "  <node pkg=\"abbe\" exec=\"host_clock\" name=\"clock_of_{host}\"><param from=\"$(dirname)/clock_of_{host}.yaml\"/></node>\n"
        );
        let names = format!("    host: {host}\n    reference: controller\n");
        let parameters = format!("/**:\n  ros__parameters:\n{names}    period_ms: 250.0\n");
        scenario.write(&format!("clock_of_{host}.yaml"), &parameters);
    }
    let launch = "cold_reference.launch.xml";
    scenario.replace(launch, "</launch>", &format!("{nodes}</launch>"));
    scenario
}

/// The answers of a time pass for later by a microsecond.
fn later(messages: &mut [Copied]) {
    let answers = messages
        .iter_mut()
        .filter(|message| message.topic == "/host_clock/answer");
    for message in answers.skip(40) {
        let mut answer: ClockAnswer = from_cdr(&message.data).unwrap();
        for stamp in [&mut answer.received, &mut answer.header.stamp] {
            let nanos = stamp.nanosec + 1_000;
            stamp.sec += i32::try_from(nanos / 1_000_000_000).unwrap();
            stamp.nanosec = nanos % 1_000_000_000;
        }
        message.data = to_cdr(&answer);
    }
}

#[test]
fn replay_computes_the_maps_of_host_clocks_and_notices_answers_that_are_a_microsecond_later() {
    let scenario = cell();
    let bag = scenario.run().join("bag");
    let (code, outcome) = check(&bag);
    assert_eq!(code, 0, "{outcome:#}");
    let maps = outcome["compared"]["/host_clock/map"]["messages"].as_u64();
    eprintln!("/host_clock/map: {maps:?} messages");
    assert!(maps.unwrap() > 10);
    resumes_halfway(&bag);
    let home = tempfile::tempdir().unwrap();
    let change = Change {
        messages: Some(&|messages| later(messages)),
        ..Change::default()
    };
    rewrite(&mcap_file(&bag), home.path(), &change);
    let (code, outcome) = check(home.path());
    assert_eq!(code, 1, "{outcome:#}");
    assert_eq!(outcome["first_difference"]["topic"], "/host_clock/map");
}
