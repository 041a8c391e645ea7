//! Type hashes that a node on Cyclone DDS announces in USER_DATA, as ROS 2 does.

use std::path::Path;
use std::time::Duration;

use abbe_msgs::diagnostic_msgs::msg::DiagnosticArray;
use abbe_msgs::msg::{AxisState, ProbeTrigger, ProbedPoint};
use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Message, Qos};
use abbe_tests::cyclone::{Cyclone, end, named_end};
use abbe_tests::program::{Process, command, domain, root};
use abbe_tests::python::interpreter;
use recorder::{Bag, TopicInfo};
use serde_json::{Value, json};

/// Hash of no type.
const FOREIGN: &str = "RIHS01_1111111111111111111111111111111111111111111111111111111111111111";
/// The condition, of a topic with a foreign hash.
const MISMATCH: &str = "/probe: type_mismatch";

/// A writer with USER_DATA.
fn announcing<M: Message>(topic: &Topic<M>, user_data: &[u8]) -> Value {
    let mut end = end(topic);
    let digits: Vec<String> = user_data.iter().map(|it| format!("{it:02x}")).collect();
    end["user_data"] = json!(digits.concat());
    end
}

fn said(hash: &str) -> Vec<u8> {
    format!("typehash={hash};").into_bytes()
}

fn recorded(bag: &Path, topic: &str) -> TopicInfo {
    let bag = Bag::open(bag).unwrap();
    let mut topics = bag.topics().iter();
    topics.find(|info| info.topic == topic).unwrap().clone()
}

#[test]
fn hashes_that_cyclone_announces_are_compared_and_recorded() {
    let Some(python) = interpreter("hashes that cyclone announces") else {
        return;
    };
    let (home, domain) = (tempfile::tempdir().unwrap(), domain(10));
    let bag = home.path().join("bag");
    let mut record = command(domain, &["record", "-o"]);
    record.arg(&bag);
    let recorder = Process::start(record);
    let file = root().join("launch_configs/first_run/probe.yaml");
    let node = Process::node(domain, "probe", &["--params-file", &file.to_string_lossy()]);
    let writers = [
        announcing(&topics::AXES_STATE, &said(AxisState::TYPE_HASH)),
        announcing(&topics::PROBE_TRIGGER, &said(FOREIGN)),
        announcing(&topics::PROBE_POINT, b"\xfftypehash=RIHS01_;typehash=;"),
    ];
    let diagnostics = Qos::RELIABLE.depth;
    let heard = named_end::<DiagnosticArray>(topics::DIAGNOSTICS.name, true, false, diagnostics);
    let mut cyclone = Cyclone::start(&python, domain, &[heard], &writers);
    for topic in [topics::AXES_STATE.name, topics::PROBE_TRIGGER.name] {
        cyclone.matched_after_s(topic);
    }
    let is_complaint = |status: &Value| status["name"] == MISMATCH && status["level"] != 0;
    let heard = cyclone.sample(topics::DIAGNOSTICS.name, |array| {
        array["status"].as_array().unwrap().iter().any(is_complaint)
    });
    let mut all = heard["status"].as_array().unwrap().iter();
    let message = all.find(|it| is_complaint(it)).unwrap()["message"].as_str();
    let expected = format!(
        "/probe/trigger: abbe_msgs/msg/ProbeTrigger has the hash {} here, {FOREIGN} there",
        ProbeTrigger::TYPE_HASH
    );
    // Of one topic alone, and by whom.
    let by = message.and_then(|message| message.strip_prefix(&expected));
    let guid = by.and_then(|by| by.strip_prefix(" of a program without a node's name, GUID "));
    let is_guid = |guid: &str| guid.len() == 32 && guid.bytes().all(|b| b.is_ascii_hexdigit());
    assert!(guid.is_some_and(is_guid), "{message:?}");
    // Nobody listens to a topic of the bag unless it is recorded: each has a sample.
    for topic in [
        topics::AXES_STATE.name,
        topics::PROBE_TRIGGER.name,
        topics::PROBE_POINT.name,
    ] {
        cyclone.write(topic, &json!({}));
    }
    std::thread::sleep(Duration::from_secs(1));
    cyclone.stop();
    node.stop();
    recorder.stop();
    for (topic, hash, definition) in [
        ("/axes/state", AxisState::TYPE_HASH, AxisState::DEFINITION),
        ("/probe/trigger", FOREIGN, ""),
        (
            "/probe/point",
            ProbedPoint::TYPE_HASH,
            ProbedPoint::DEFINITION,
        ),
    ] {
        let info = recorded(&bag, topic);
        assert_eq!(info.type_hash, hash, "{topic}");
        assert_eq!(info.definition, definition, "{topic}");
        assert_eq!(info.message_count, 1, "{topic}");
    }
}
