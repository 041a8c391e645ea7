//! Messages whose own stamp does not fit: one wrong stamp must not move the time of everything that is read behind it.
//!
//! Every verb that reads or replays a bag asks here, so that all leave out the same messages. The stamps of a topic are
//! held against the times at which its messages were recorded:
//!
//! ```text
//!   d = stamp - log time                                                          (1)
//!   |d_i - d_(i-1)| <= T,  or  0 <= s_i - s_(i-1) <= log_i - log_(i-1) + T        (2)
//! ```
//!
//! Successive messages that fulfil (2) are one group: the clocks go on, or the messages come late. The offsets (1) of a
//! topic that at least a third as many messages have as the most common one are its clock, whatever its zero is. A group
//! of another offset is kept where its stamps lie between those before and behind it in its topic; where nothing stands
//! on one side, between the first stamp of the bag and the time of recording. Otherwise its messages are left out.
//!
//! Holds when most stamps of a topic are right. A clock that was set for more than a third of a recording is no wrong stamp.
//! A topic whose stamps are all of another time than those of the others is found by [`clocks`]. Outliers of thermometers
//! ([`crate::outliers`]) are found in the same pass.

use std::collections::{BTreeMap, BTreeSet};

use abbe_msgs::sensor_msgs::msg::Temperature;
use abbe_msgs::topics::{self, Entry};
use abbe_msgs::{Durability, Wire, from_cdr};
use metrology::epoch::utc_of_nanos;
use metrology::stamp::{NANOS_PER_S, Span};
use recorder::{Bag, Event, MessageRef, Order, TopicId};

use crate::known::entry_in_any_namespace;
use crate::leap::{self, LEAST};
use crate::outliers::{Course, Outlier};
use crate::pause::duration;
use crate::reading::stamp_of;

mod clocks;

use clocks::OtherClock;

/// T of (2), ns: what a session of a diagnosis takes as the lateness of a sample, too.
pub(crate) const TOLERANCE_NANOS: i64 = 2 * NANOS_PER_S;
/// How far outside the bag's own times a stamp may lie where no message of its topic stands beside it, ns: messages of one
/// test are stamped with its begin, and clocks of two hosts differ.
const MARGIN_NANOS: i64 = 60 * NANOS_PER_S;
/// How much older than the bag a latched message may be, ns: ten years. A model is published once and received by every
/// later subscription.
const OLDEST_LATCHED_NANOS: i64 = 3_653 * 86_400 * NANOS_PER_S;
/// A group is of the topic's clock when its offset has at least this part of the messages of the most common one.
const LEAST_SHARE: u64 = 3;

/// Stamps between which a message of a topic would fit, ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Limits {
    low_nanos: i64,
    high_nanos: i64,
}

impl Limits {
    fn holds(self, group: &Group) -> bool {
        self.low_nanos <= group.stamps.0 && group.stamps.1 <= self.high_nanos
    }
}

/// Which message: its topic, its log time and its stamp, ns.
type Key = (usize, u64, i64);

/// The messages of a bag whose stamps do not fit.
#[derive(Debug, Default)]
pub(crate) struct WrongStamps {
    found: BTreeMap<Key, Limits>,
    /// Readings of thermometers that are no temperatures.
    outliers: BTreeMap<Key, Outlier>,
    /// The topics that are of another clock.
    other_clocks: BTreeMap<usize, OtherClock>,
    /// Least and greatest offset (1) of each topic's clock, ns.
    offsets_nanos: BTreeMap<usize, (i64, i64)>,
}

/// Successive messages of a topic whose stamps go on with its log times (2).
#[derive(Clone, Copy, Debug)]
struct Group {
    /// Number of its first message among all of the bag, from 0.
    first: u64,
    messages: u64,
    /// First and last stamp, ns.
    stamps: (i64, i64),
    /// Least and greatest offset (1), ns.
    offsets: (i64, i64),
    /// Log time of its last message, ns.
    log_nanos: i64,
    /// Whether its offset is of its topic's clock.
    is_firm: bool,
}

impl Group {
    fn new(number: u64, stamp: i64, log: i64) -> Self {
        let offset = stamp.saturating_sub(log);
        Self {
            first: number,
            messages: 1,
            stamps: (stamp, stamp),
            offsets: (offset, offset),
            log_nanos: log,
            is_firm: false,
        }
    }

    /// Takes the next message of the topic, where it goes on (2).
    fn take(&mut self, stamp: i64, log: i64) -> bool {
        let (last, last_log) = (self.stamps.1, self.log_nanos);
        let offset = stamp.saturating_sub(log);
        let is_steady =
            offset.abs_diff(last.saturating_sub(last_log)) <= TOLERANCE_NANOS.unsigned_abs();
        let (step, passed) = (stamp.saturating_sub(last), log.saturating_sub(last_log));
        let is_late =
            step >= 0 && passed <= LEAST.nanos() && step <= passed.saturating_add(TOLERANCE_NANOS);
        if !is_steady && !is_late {
            return false;
        }
        self.messages += 1;
        self.stamps.1 = stamp;
        self.log_nanos = log;
        self.offsets = (self.offsets.0.min(offset), self.offsets.1.max(offset));
        true
    }
}

/// An offset with the messages that have it.
#[derive(Clone, Copy, Debug)]
struct Level {
    offsets: (i64, i64),
    messages: u64,
}

/// Offsets that overlap within the tolerance are one.
fn merged(mut sorted: Vec<Level>, tolerance_nanos: i64) -> Vec<Level> {
    sorted.sort_by_key(|level| level.offsets);
    let mut levels = Vec::<Level>::new();
    for next in sorted {
        match levels.last_mut() {
            Some(level) if next.offsets.0 <= level.offsets.1.saturating_add(tolerance_nanos) => {
                level.offsets.1 = level.offsets.1.max(next.offsets.1);
                level.messages += next.messages;
            }
            _ => levels.push(next),
        }
    }
    levels
}

/// The offsets of a clock: those that have enough messages.
fn levels<'a>(groups: impl Iterator<Item = &'a Group>) -> Vec<Level> {
    let each = groups.map(|group| Level {
        offsets: group.offsets,
        messages: group.messages,
    });
    let mut levels = merged(each.collect(), TOLERANCE_NANOS);
    let most = levels.iter().map(|level| level.messages).max().unwrap_or(0);
    levels.retain(|it| it.messages > 1 && it.messages.saturating_mul(LEAST_SHARE) > most);
    levels
}

fn is_of(levels: &[Level], group: &Group) -> bool {
    let holds = |it: &Level| it.offsets.0 <= group.offsets.0 && group.offsets.1 <= it.offsets.1;
    levels.iter().any(holds)
}

/// A topic of ours with its groups, in the order of recording.
struct TopicStamps {
    topic: usize,
    entry: &'static Entry,
    groups: Vec<Group>,
    fastest: Fastest,
}

impl TopicStamps {
    /// Its number with least and greatest offset (1) of its clock, ns.
    fn offsets_nanos(&self) -> Option<(usize, (i64, i64))> {
        let firm = || self.groups.iter().filter(|group| group.is_firm);
        let least = firm().map(|group| group.offsets.0).min()?;
        let greatest = firm().map(|group| group.offsets.1).max()?;
        let fastest = self.fastest.offset_nanos()?;
        Some((self.topic, (least, fastest.min(greatest))))
    }
}

/// The greatest offsets (1) of a topic: those of the messages that were recorded soonest.
#[derive(Debug, Default)]
struct Fastest {
    /// Greatest first, ns.
    offsets_nanos: Vec<i64>,
    messages: u64,
}

impl Fastest {
    /// Offsets that are kept: stamps of so few messages may be ahead.
    const KEPT: usize = 8;
    /// Messages for each of them from which on the last one counts.
    const MESSAGES_EACH: u64 = 100;

    fn take(&mut self, offset_nanos: i64) {
        self.messages += 1;
        let place = self.offsets_nanos.partition_point(|it| *it > offset_nanos);
        if place < Self::KEPT {
            self.offsets_nanos.insert(place, offset_nanos);
            self.offsets_nanos.truncate(Self::KEPT);
        }
    }

    /// The least lateness of a topic, as the offset of its clock, ns; of a long one without its few soonest messages.
    fn offset_nanos(&self) -> Option<i64> {
        let is_long = self.messages >= Self::MESSAGES_EACH * Self::KEPT as u64;
        let counts = if is_long {
            self.offsets_nanos.last()
        } else {
            self.offsets_nanos.first()
        };
        counts.copied()
    }
}

/// Times of the clock that most messages of a bag have.
#[derive(Clone, Copy, Debug)]
struct BagTimes {
    /// First stamp, ns.
    first_nanos: i64,
    /// Greatest offset (1), ns.
    offset_nanos: i64,
}

impl BagTimes {
    /// `None` where no clock has more messages than one.
    fn of(topics: &[TopicStamps]) -> Option<Self> {
        let firm = || {
            let groups = topics.iter().flat_map(|topic| &topic.groups);
            groups.filter(|group| group.is_firm)
        };
        let levels = levels(firm());
        let of_clock = || firm().filter(|group| is_of(&levels, group));
        Some(Self {
            first_nanos: of_clock().map(|group| group.stamps.0).min()?,
            offset_nanos: of_clock().map(|group| group.offsets.1).max()?,
        })
    }
}

impl WrongStamps {
    /// Reads the stamps of every message of a topic of ours.
    pub(crate) fn of(bag: &Bag) -> Self {
        let entries: Vec<Option<&'static Entry>> = (bag.topics().iter())
            .map(|info| {
                let entry = entry_in_any_namespace(&info.topic)?;
                (entry.description.type_name == info.type_name).then_some(entry)
            })
            .collect();
        let (mut topics, strays, outliers) = read(bag, &entries);
        for topic in &mut topics {
            let levels = levels(topic.groups.iter());
            let groups = topic.groups.iter_mut();
            groups.for_each(|group| group.is_firm = is_of(&levels, group));
        }
        let Some(times) = BagTimes::of(&topics) else {
            return Self {
                outliers,
                ..Self::default()
            };
        };
        let other_clocks = clocks::others(&topics);
        let offsets_nanos = topics
            .iter()
            .filter_map(TopicStamps::offsets_nanos)
            .collect();
        let wrong: BTreeMap<usize, Vec<(Group, Limits)>> = topics
            .iter()
            .map(|topic| (topic.topic, judge(topic, times, &strays)))
            .filter(|(_, wrong)| !wrong.is_empty())
            .collect();
        Self {
            found: Self::found(bag, &entries, &wrong),
            outliers,
            other_clocks,
            offsets_nanos,
        }
    }

    /// Least and greatest offset (1) of each topic's clock, ns.
    pub(crate) const fn offsets_nanos(&self) -> &BTreeMap<usize, (i64, i64)> {
        &self.offsets_nanos
    }

    /// The messages of the groups that do not fit.
    fn found(
        bag: &Bag,
        entries: &[Option<&'static Entry>],
        wrong: &BTreeMap<usize, Vec<(Group, Limits)>>,
    ) -> BTreeMap<Key, Limits> {
        let mut found = BTreeMap::new();
        if wrong.is_empty() {
            return found;
        }
        // How many messages of the group at hand are still to come, by topic.
        let mut open: BTreeMap<usize, (u64, Limits)> = BTreeMap::new();
        let mut messages = bag.messages(Order::File);
        let mut number = 0;
        while let Some(event) = messages.next_event() {
            let Event::Message(message) = event else {
                continue;
            };
            let topic = message.topic.index();
            let at = number;
            number += 1;
            let Some((groups, key)) = wrong.get(&topic).zip(key(&message, entries)) else {
                continue;
            };
            if let Ok(place) = groups.binary_search_by_key(&at, |(group, _)| group.first) {
                let (group, limits) = groups[place];
                open.insert(topic, (group.messages, limits));
            }
            if let Some((left @ 1.., limits)) = open.get_mut(&topic) {
                *left -= 1;
                found.insert(key, *limits);
            }
        }
        found
    }

    /// What is wrong with all stamps of a topic; `None`: they are of the same time as those of the others.
    pub(crate) fn other_clock(&self, topic: TopicId) -> Option<String> {
        let OtherClock {
            offset_nanos,
            own: (first, last),
            others: (from, to),
        } = *self.other_clocks.get(&topic.index())?;
        let offset = Span::from_nanos(offset_nanos.saturating_abs());
        let way = if offset_nanos < 0 { "earlier" } else { "later" };
        Some(format!(
            "its stamps are {} {way} than those of the other topics: {} to {}, those {} to {}; set the clock that stamped it",
            duration(offset.as_secs_f64()),
            date(first),
            date(last),
            date(from),
            date(to)
        ))
    }

    /// What is wrong with what a thermometer says in a message of type `type_name`; `None`: nothing, or it is of no thermometer.
    pub(crate) fn outlier(&self, message: &MessageRef<'_>, type_name: &str) -> Option<String> {
        if self.outliers.is_empty() {
            return None;
        }
        let stamp = nanos_of(stamp_of(type_name, message.data)?);
        let key = (message.topic.index(), message.log_time_nanos, stamp);
        self.outliers.get(&key).map(|outlier| outlier.in_words())
    }

    /// What is wrong with the stamp of a message of type `type_name`; `None`: it fits.
    pub(crate) fn wrong(&self, message: &MessageRef<'_>, type_name: &str) -> Option<String> {
        if self.found.is_empty() {
            return None;
        }
        let stamp = nanos_of(stamp_of(type_name, message.data)?);
        let key = (message.topic.index(), message.log_time_nanos, stamp);
        let limits = self.found.get(&key)?;
        Some(format!(
            "header.stamp = {}: must be from {} to {} by the messages beside it; set the clock that stamped it",
            date(stamp),
            date(limits.low_nanos),
            date(limits.high_nanos)
        ))
    }
}

/// What is read of the stamps of a bag: the groups of each topic of ours, which messages have a wrong log time, and the
/// outliers of thermometers.
type Found = (Vec<TopicStamps>, BTreeSet<u64>, BTreeMap<Key, Outlier>);

fn read(bag: &Bag, entries: &[Option<&'static Entry>]) -> Found {
    let mut thermometers: BTreeMap<usize, Course<Key>> = BTreeMap::new();
    let mut outliers = BTreeMap::new();
    let mut groups: Vec<(Vec<Group>, Fastest)> =
        entries.iter().map(|_| Default::default()).collect();
    let mut messages = bag.messages(Order::File);
    let mut number = 0_u64;
    let times = std::iter::from_fn(|| {
        loop {
            let Event::Message(message) = messages.next_event()? else {
                continue;
            };
            let at = number;
            number += 1;
            if let Some(key) = key(&message, entries) {
                let (topic, log_nanos, stamp) = key;
                if let Some(degc) = temperature(&message, entries) {
                    let course = thermometers.entry(topic).or_default();
                    outliers.extend(course.take(key, degc));
                }
                let log = i64::try_from(log_nanos).unwrap_or(i64::MAX);
                let (of_topic, fastest) = &mut groups[topic];
                fastest.take(stamp.saturating_sub(log));
                if !of_topic.last_mut().is_some_and(|it| it.take(stamp, log)) {
                    of_topic.push(Group::new(at, stamp, log));
                }
            }
            break Some(message.log_time_nanos);
        }
    });
    let strays = leap::strays_of(times, 0);
    outliers.extend(thermometers.into_values().flat_map(Course::end));
    let topics = groups.into_iter().zip(entries).enumerate();
    let topics = topics.filter_map(|(topic, ((groups, fastest), entry))| {
        Some(TopicStamps {
            topic,
            entry: (*entry)?,
            groups,
            fastest,
        })
    });
    (topics.collect(), strays, outliers)
}

/// What a message of a thermometer says, °C.
fn temperature(message: &MessageRef<'_>, entries: &[Option<&'static Entry>]) -> Option<f64> {
    let entry = entries.get(message.topic.index()).copied().flatten()?;
    (entry.name == topics::TEMPERATURE.base).then_some(())?;
    let wire = from_cdr::<Temperature>(message.data).ok()?;
    Some(wire.to_inner().ok()?.temperature_degc)
}

/// The groups of a topic that do not fit, each with the limits of its stamps.
fn judge(topic: &TopicStamps, times: BagTimes, strays: &BTreeSet<u64>) -> Vec<(Group, Limits)> {
    let groups = &topic.groups;
    // First stamp of the next group of the topic's clock behind each.
    let mut behind = vec![None; groups.len()];
    let mut next = None;
    for (place, group) in groups.iter().enumerate().rev() {
        behind[place] = next;
        next = if group.is_firm {
            Some(group.stamps.0)
        } else {
            next
        };
    }
    let is_latched = topic.entry.qos.durability == Durability::TransientLocal;
    let oldest = if is_latched {
        OLDEST_LATCHED_NANOS
    } else {
        MARGIN_NANOS
    };
    let own = groups.iter().filter(|group| group.is_firm);
    let own = own.map(|group| group.offsets.1).max();
    let offset = own.map_or(times.offset_nanos, |own| own.max(times.offset_nanos));
    let mut before: Option<i64> = None;
    let mut wrong = Vec::new();
    for (group, next) in groups.iter().zip(behind) {
        // A message whose log time is wrong says nothing of its stamp.
        let is_kept = group.is_firm || (group.messages == 1 && strays.contains(&group.first));
        let low = match (before, next) {
            (Some(before), Some(next)) => before.min(next).saturating_sub(TOLERANCE_NANOS),
            (Some(before), None) => before.saturating_sub(TOLERANCE_NANOS),
            (None, _) => times.first_nanos.saturating_sub(oldest).max(0),
        };
        let recorded = group.log_nanos.saturating_add(offset);
        let high = match next {
            Some(next) => before
                .map_or(next, |it| it.max(next))
                .saturating_add(TOLERANCE_NANOS),
            None => recorded.saturating_add(MARGIN_NANOS),
        };
        let limits = Limits {
            low_nanos: low,
            high_nanos: high,
        };
        if is_kept || limits.holds(group) {
            before = Some(group.stamps.1);
        } else {
            wrong.push((*group, limits));
        }
    }
    wrong
}

/// Which message it is, where it has a stamp and its topic is one of ours.
fn key(message: &MessageRef<'_>, entries: &[Option<&'static Entry>]) -> Option<Key> {
    let topic = message.topic.index();
    let entry = entries.get(topic).copied().flatten()?;
    let stamp = stamp_of(entry.description.type_name, message.data)?;
    Some((topic, message.log_time_nanos, nanos_of(stamp)))
}

/// A stamp in ns since 1970; its seconds are the bits of an unsigned number.
pub(crate) fn nanos_of((sec, nanosec): (i32, u32)) -> i64 {
    i64::from(sec.cast_unsigned()) * NANOS_PER_S + i64::from(nanosec)
}

fn date(nanos: i64) -> String {
    utc_of_nanos(nanos, 3)
}

#[cfg(test)]
mod tests;
