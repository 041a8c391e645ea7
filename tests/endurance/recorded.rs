//! What a recorder wrote against what a witness of the same graph heard.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::{Duration, Instant};

use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Message, to_cdr};
use abbe_tests::graph::Graph;
use recorder::{Bag, Event, Order};

/// Messages of a bag by topic, and its losses.
struct Content {
    messages: BTreeMap<String, Vec<Vec<u8>>>,
    losses: Vec<String>,
}

fn content(bag: &Path) -> Content {
    let bag = Bag::open(bag).unwrap();
    let names: Vec<String> = bag.topics().iter().map(|t| t.topic.clone()).collect();
    let mut content = Content {
        messages: BTreeMap::new(),
        losses: Vec::new(),
    };
    let mut events = bag.messages(Order::File);
    while let Some(event) = events.next_event() {
        match event {
            Event::Message(message) => {
                let topic = names[message.topic.index()].trim_start_matches('/');
                let of_topic = content.messages.entry(topic.to_owned()).or_default();
                of_topic.push(message.data.to_vec());
            }
            Event::Loss(loss) => content.losses.push(loss.to_string()),
        }
    }
    content
}

/// What ended a recording.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum End {
    Killed,
    Stopped,
}

/// A recording that ended at `until`: everything of the two busiest topics that the witness heard from the bag's first
/// message on, up to what a killed recorder may hold, is in the bag. Gives how many messages were compared.
pub fn check(bag: &Path, graph: &Graph, since: Instant, until: Instant, end: End) -> usize {
    if !bag.join("metadata.yaml").is_file() {
        assert!(end == End::Killed, "{}: no bag was begun", bag.display());
        return 0;
    }
    // A killed recorder holds a chunk of a second; what follows is how long anything may be on its way.
    let held = match end {
        End::Killed => Duration::from_millis(2500),
        End::Stopped => Duration::from_millis(500),
    };
    let content = content(bag);
    match end {
        End::Killed => assert_eq!(content.losses.len(), 1, "{:?}", content.losses),
        End::Stopped => assert!(content.losses.is_empty(), "{:?}", content.losses),
    }
    let Some(until) = until.checked_sub(held) else {
        return 0;
    };
    same(&content, &topics::AXES_STATE, graph, since, until)
        + same(&content, &topics::COMPENSATION, graph, since, until)
}

fn same<M: Message>(
    content: &Content,
    topic: &Topic<M>,
    graph: &Graph,
    since: Instant,
    until: Instant,
) -> usize {
    let Some(recorded) = content.messages.get(topic.name) else {
        return 0;
    };
    let heard = graph.since(topic, since);
    let in_time = heard.iter().take_while(|(at, _)| *at < until);
    // Re-encoded, so that padding at the end does not count.
    let bytes = |message: &M| to_cdr(message);
    let recorded: BTreeSet<Vec<u8>> = recorded
        .iter()
        .map(|data| bytes(&abbe_msgs::from_cdr::<M>(data).unwrap()))
        .collect();
    let of_bag = in_time
        .map(|(_, message)| bytes(message))
        .skip_while(|message| !recorded.contains(message));
    let mut compared = 0;
    let mut missing = Vec::new();
    for message in of_bag {
        if !recorded.contains(&message) {
            missing.push(compared);
        }
        compared += 1;
    }
    let name = topic.name;
    // A loss on the network is said, and counts no more than what was said.
    let said = graph.hears_condition("recorder", "messages_lost", &["lost on the network"], since);
    assert!(
        missing.is_empty() || said.is_some(),
        "{name}: of {compared} heard these are not in the bag: {missing:?}"
    );
    if !missing.is_empty() {
        eprintln!("{name}: not in the bag {missing:?} of {compared}; {said:?}");
    }
    compared
}
