//! No topic that is computed goes without a replay that has it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use abbe_msgs::topics::{self, Origin};
use abbe_tests::program::root;

use crate::contract::{check, count, short_run};
use crate::{host_clocks, positioning, rotary, update_requests};

/// A bag and the topics of it that are computed again.
type Replay = (fn() -> PathBuf, &'static [&'static str]);

/// Each computed topic of `msgs/src/topics.rs` stands here, beside a bag that has messages of it.
const REPLAYS: [Replay; 6] = [
    (
        || short_run().to_owned(),
        &[
            "probe/point",
            "latency",
            "blocks/measurement",
            "thermal/model",
            "compensation",
        ],
    ),
    (
        || rotary::run().to_owned(),
        &["probe/feature", "geometry/rotary"],
    ),
    (|| positioning::run().to_owned(), &["positioning/table"]),
    (
        || update_requests::run().to_owned(),
        &["thermal/update_request"],
    ),
    (|| host_clocks::run().to_owned(), &["host_clock/map"]),
    (|| root().join("bags/grid_circles"), &["geometry/model"]),
];

/// Topics of `wanted` of which the bag has no message, or one that differs.
fn missing<'t>(bag: &Path, wanted: &[&'t str]) -> Vec<&'t str> {
    let (code, outcome) = check(bag);
    assert_eq!(code, 0, "{}: {outcome:#}", bag.display());
    let is_missing = |topic: &&str| {
        let topic = format!("/{topic}");
        let messages = count(&outcome, &topic, "messages");
        eprintln!("{topic}: {messages} messages");
        messages == 0 || count(&outcome, &topic, "differing") > 0
    };
    wanted.iter().copied().filter(is_missing).collect()
}

#[test]
fn replay_computes_every_topic_that_is_told_to_be_computed() {
    let mut asserted = BTreeSet::<&str>::new();
    for (bag, wanted) in REPLAYS {
        let bag = bag();
        assert_eq!(missing(&bag, wanted), [""; 0], "{}", bag.display());
        asserted.extend(wanted);
    }
    for entry in topics::all() {
        let name = entry.name;
        let is_asserted = asserted
            .iter()
            .any(|topic| *topic == name || entry.is_family && topic.starts_with(name));
        let is_computed = entry.origin == Origin::Computed;
        assert!(
            is_asserted || !is_computed,
            "{name} is computed, and no bag of REPLAYS has it"
        );
        assert!(
            is_computed || !is_asserted,
            "{name} of REPLAYS is not computed"
        );
    }
}
