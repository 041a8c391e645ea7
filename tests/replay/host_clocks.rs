//! What a host's clock is, is computed from the recorded answers.

use std::path::Path;
use std::sync::OnceLock;

use abbe_msgs::msg::ClockAnswer;
use abbe_msgs::{from_cdr, to_cdr};
use abbe_tests::scenario::Scenario;

use crate::contract::{Run, changed_of, check, count, recorded};
use crate::rewrite::{Change, Copied};
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

/// The bag of its run.
pub fn run() -> &'static Path {
    static RUN: OnceLock<Run> = OnceLock::new();
    recorded(&RUN, cell)
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
    let (code, outcome) = check(run());
    assert_eq!(code, 0, "{outcome:#}");
    let maps = count(&outcome, "/host_clock/map", "messages");
    eprintln!("/host_clock/map: {maps} messages");
    assert!(maps > 10);
    resumes_halfway(run());
    let change = Change {
        messages: Some(&|messages| later(messages)),
        ..Change::default()
    };
    let home = changed_of(run(), &change);
    let (code, outcome) = check(home.path());
    assert_eq!(code, 1, "{outcome:#}");
    assert_eq!(outcome["first_difference"]["topic"], "/host_clock/map");
}
