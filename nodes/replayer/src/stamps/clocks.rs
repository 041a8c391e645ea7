//! Topics whose stamps are all of another time than those of the other topics, as a thermometer's whose host has another
//! time zone.
//!
//! Raw messages are stamped when they are made, so their offsets to the log times agree from topic to topic. The offset
//! that most kinds of topics have is the common one. A topic with a steady offset of its own, which no topic of another
//! kind has, is of another clock.
//!
//! Holds where at least two kinds of topics agree; of two topics that differ, that with fewer messages is named. Several
//! kinds of topics that are wrong by the same time agree with one another and are not found.

use std::collections::BTreeMap;

use abbe_msgs::Durability;
use abbe_msgs::topics::{self, Entry, Origin};

use super::{Level, MARGIN_NANOS, TopicStamps, merged};

/// Least and greatest offset, ns.
type Offsets = (i64, i64);

/// The stamps of a topic that is of another clock.
#[derive(Clone, Copy, Debug)]
pub(super) struct OtherClock {
    /// Offset of its stamps from the common one, ns.
    pub offset_nanos: i64,
    /// Its first and last stamp, ns.
    pub own: (i64, i64),
    /// First and last stamp of the topics with the common offset, ns.
    pub others: (i64, i64),
}

/// Such topics with their stamps.
pub(super) fn others(topics: &[TopicStamps]) -> BTreeMap<usize, OtherClock> {
    let clocks = clocks(topics);
    let Some(common) = common(&clocks) else {
        return BTreeMap::new();
    };
    let is_common = |topic: &&TopicStamps| steady(topic).is_some_and(|own| meets(common, own));
    let of_common = topics.iter().filter(is_common);
    let stamps_of_common = of_common.filter_map(stamps).reduce(joined);
    let other = |topic: &TopicStamps| {
        let own = steady(topic)?;
        let mut others = clocks.iter().filter(|(name, _)| **name != topic.entry.name);
        let is_met = meets(common, own) || others.any(|(_, levels)| meets_any(levels, own));
        let stamps = stamps(topic)?;
        (!is_met).then(|| OtherClock {
            offset_nanos: own.0.saturating_sub(common.0),
            own: stamps,
            others: stamps_of_common.unwrap_or(stamps),
        })
    };
    let found = topics
        .iter()
        .filter_map(|topic| Some((topic.topic, other(topic)?)));
    found.collect()
}

/// First and last stamp of a topic, ns.
fn stamps(topic: &TopicStamps) -> Option<(i64, i64)> {
    let groups = topic.groups.iter().filter(|group| group.is_firm);
    groups.map(|group| group.stamps).reduce(joined)
}

fn joined(a: (i64, i64), b: (i64, i64)) -> (i64, i64) {
    (a.0.min(b.0), a.1.max(b.1))
}

/// Whether messages are stamped when they are made; the answers of another host's clock are not.
fn is_timely(entry: &Entry) -> bool {
    entry.origin == Origin::Raw
        && entry.qos.durability != Durability::TransientLocal
        && entry.name != topics::CLOCK_ANSWER.name
}

/// The offsets of each kind of topic, in rising order, those within the margin as one.
fn clocks(topics: &[TopicStamps]) -> BTreeMap<&'static str, Vec<Level>> {
    let mut clocks: BTreeMap<&'static str, Vec<Level>> = BTreeMap::new();
    for topic in topics.iter().filter(|topic| is_timely(topic.entry)) {
        let firm = topic.groups.iter().filter(|group| group.is_firm);
        let levels = firm.map(|group| Level {
            offsets: group.offsets,
            messages: group.messages,
        });
        clocks.entry(topic.entry.name).or_default().extend(levels);
    }
    let each = clocks.into_iter();
    each.map(|(name, levels)| (name, merged(levels, MARGIN_NANOS)))
        .collect()
}

/// The offsets that most kinds of topics have; of equally many, those of most messages.
fn common(clocks: &BTreeMap<&'static str, Vec<Level>>) -> Option<Offsets> {
    let all = clocks.values().flatten();
    let most = all.max_by_key(|level| (kinds(clocks, level.offsets), level.messages))?;
    Some(most.offsets)
}

/// How many kinds of topics have these offsets.
fn kinds(clocks: &BTreeMap<&'static str, Vec<Level>>, offsets: Offsets) -> usize {
    let having = clocks.values().filter(|levels| meets_any(levels, offsets));
    having.count()
}

/// The offsets of a topic, where they stay within the margin.
fn steady(topic: &TopicStamps) -> Option<Offsets> {
    let firm = topic.groups.iter().filter(|group| group.is_firm);
    let offsets = firm.map(|group| group.offsets);
    let all = offsets.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
    let is_steady = all.1.saturating_sub(all.0) <= MARGIN_NANOS;
    (is_timely(topic.entry) && is_steady).then_some(all)
}

fn meets(a: Offsets, b: Offsets) -> bool {
    a.0 <= b.1.saturating_add(MARGIN_NANOS) && b.0 <= a.1.saturating_add(MARGIN_NANOS)
}

/// Whether one of `levels`, in rising order, meets `own`.
fn meets_any(levels: &[Level], own: Offsets) -> bool {
    let low = own.0.saturating_sub(MARGIN_NANOS);
    let place = levels.partition_point(|it| it.offsets.1 < low);
    levels.get(place).is_some_and(|it| meets(it.offsets, own))
}
