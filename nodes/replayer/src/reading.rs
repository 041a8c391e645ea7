//! Reads the messages of a bag that are of use, one after another, and keeps an account of them.
//!
//! Every verb that reads what messages say reads through here: a topic is compared with ours once ([`crate::known`]), a
//! message that cannot be used is left out alone and counted, and the rest goes on.

use std::collections::BTreeMap;

use abbe_msgs::topics::{self, Entry, Topic, TopicFamily};
use abbe_msgs::{FieldParts, Message, Wire, from_cdr, parts_of};
use recorder::{Bag, Event, Loss, MessageRef, Order};

use crate::account::{Account, Place, Reason, TopicAccount};
use crate::by_stamp::{AxesClock, ByStamp, READINGS};
use crate::known::{entry_in_any_namespace, unreadable};
use crate::leap::Leaps;
use crate::repeats::{self, Repeats};
use crate::stamps::WrongStamps;
use crate::turned::{Held, Turn, Turned};
use crate::usable;

/// What became of a bag that was read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reading {
    /// The messages of the topics that were asked for.
    pub account: Account,
    /// Parts of the files that could not be read.
    pub losses: Vec<Loss>,
    /// Leaps of the log times of all messages, in the order in which they were read.
    pub leaps: Leaps,
    /// Whether begins and ends of runs were recorded more than 0.25 s before or after the axis states of their stamps.
    pub are_segments_off: bool,
    /// Whether readings of an instrument were, up to the 2 s that a message may be late.
    pub are_readings_off: bool,
}

impl Reading {
    /// Whether nothing was lost or left out.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.account.is_whole() && self.losses.is_empty()
    }

    /// A line for each loss, then for each topic and reason.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let losses = self.losses.iter().map(ToString::to_string);
        losses.chain(self.account.lines()).collect()
    }
}

/// What is done with a topic of the bag.
enum Plan {
    /// It is not a topic of ours, or not asked for.
    Aside,
    /// None of its messages can be used; its place in the account.
    LeftOut {
        place: usize,
        reason: Reason,
        what: String,
    },
    /// Its messages are handed on; its place in the account.
    Read { place: usize, entry: &'static Entry },
}

/// A message that is handed on, and its topic's row of the account.
pub struct Taken<'a> {
    entry: &'static Entry,
    message: MessageRef<'a>,
    row: &'a mut TopicAccount,
    /// Its number among the messages of its topic, from 1.
    number: u64,
    /// Whether it was decoded and counted: who reads it again counts nothing.
    is_counted: bool,
}

/// Reads `bag` in an order and hands on every message of the topics `wanted` (their names in
/// [`abbe_msgs::topics`]), in whatever namespace they are; repeated messages (`repeats`), messages with wrong stamps (`stamps`)
/// and outliers of thermometers (`outliers`) are left out and counted. A begin of a run before the end of the last one at one log
/// time is handed on behind it (`turned`).
pub fn read(bag: &Bag, order: Order, wanted: &[&str], take: impl FnMut(Taken<'_>)) -> Reading {
    read_through(bag, (order, Join::Arrival), wanted, take)
}

/// The same by log time, where axis states and readings of instruments come in the order in which they were made (`by_stamp`);
/// begins and ends of runs, and readings that are late throughout, come by their stamps, or as they were recorded.
pub fn read_by_stamp(
    bag: &Bag,
    wanted: &[&str],
    are_all_by_stamp: bool,
    take: impl FnMut(Taken<'_>),
) -> Reading {
    let join = if are_all_by_stamp {
        Join::AllByStamp
    } else {
        Join::ReadingsByStamp
    };
    read_through(bag, (Order::LogTime, join), wanted, take)
}

/// Which messages come by their stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Join {
    Arrival,
    ReadingsByStamp,
    AllByStamp,
}

fn read_through(
    bag: &Bag,
    (order, join): (Order, Join),
    wanted: &[&str],
    take: impl FnMut(Taken<'_>),
) -> Reading {
    let mut reading = Reading {
        losses: bag.description_losses().to_vec(),
        ..Reading::default()
    };
    let rows = &mut reading.account.topics;
    let plans: Vec<Plan> = (bag.topics().iter())
        .map(|info| plan(info, wanted, rows))
        .collect();
    let is_read = |plan: &Plan| matches!(plan, Plan::Read { .. });
    let wrong_stamps = if plans.iter().any(is_read) {
        WrongStamps::of(bag)
    } else {
        WrongStamps::default()
    };
    let offsets_nanos = wrong_stamps.offsets_nanos();
    let clock = axes_clock(&plans, offsets_nanos);
    reading.are_segments_off = clock.as_ref().is_some_and(|clock| clock.are_segments_off);
    reading.are_readings_off = clock.as_ref().is_some_and(AxesClock::are_readings_off);
    let by_stamp = match (join, clock) {
        (Join::Arrival, _) => None,
        (Join::AllByStamp, Some(clock)) => Some(ByStamp::new(offsets_nanos).by_axes(clock)),
        _ => Some(ByStamp::new(offsets_nanos)),
    };
    let mut reader = Reader {
        rows,
        wrong_stamps,
        passed: Repeats::default(),
        turned: Turned::default(),
        by_stamp,
        take,
    };
    let mut messages = bag.messages(order);
    let mut before = None;
    while let Some(event) = messages.next_event() {
        let message = match event {
            Event::Message(message) => message,
            Event::Loss(loss) => {
                reading.losses.push(loss);
                continue;
            }
        };
        let at = message.log_time_nanos;
        reading.leaps.pass(before.replace(at).unwrap_or(at), at);
        if let Some(overdue) = reader.turned.overdue(at) {
            reader.pass_on(overdue);
        }
        reader.hand_on_due(at);
        reader.message(&plans[message.topic.index()], message);
    }
    if let Some(held) = reader.turned.rest() {
        reader.pass_on(held);
    }
    while let Some(held) = reader.by_stamp.as_mut().and_then(ByStamp::rest) {
        reader.hand_on(&held);
    }
    reading
}

/// How the stamps of begins, ends and readings lie to those of the axis states, where they differ.
fn axes_clock(plans: &[Plan], offsets_nanos: &BTreeMap<usize, (i64, i64)>) -> Option<AxesClock> {
    let number_of = |name: &str| {
        let is_it = |plan: &Plan| matches!(plan, Plan::Read { entry, .. } if entry.name == name);
        plans.iter().position(is_it)
    };
    let axes = number_of(topics::AXES_STATE.name)?;
    let segments = number_of(topics::TEST_SEGMENT.name)?;
    let readings = READINGS.into_iter().filter_map(number_of);
    let readings: Vec<usize> = readings.collect();
    AxesClock::of(offsets_nanos, (axes, segments), &readings)
}

/// Reads one message after another.
struct Reader<'r, F> {
    rows: &'r mut Vec<TopicAccount>,
    wrong_stamps: WrongStamps,
    passed: Repeats,
    turned: Turned,
    by_stamp: Option<ByStamp>,
    take: F,
}

impl<F: FnMut(Taken<'_>)> Reader<'_, F> {
    fn message(&mut self, plan: &Plan, message: MessageRef<'_>) {
        match plan {
            Plan::Aside => {}
            Plan::LeftOut {
                place,
                reason,
                what,
            } => {
                let row = &mut self.rows[*place];
                row.messages += 1;
                let first = place_of(row.messages, &message, None);
                row.leave_out(*reason, first, || what.clone());
            }
            Plan::Read { place, entry } => {
                let row = &mut self.rows[*place];
                row.messages += 1;
                let number = row.messages;
                let misplaced = misplaced(&self.wrong_stamps, &mut self.passed, &message, entry);
                if let Some((reason, what)) = misplaced {
                    let first = place_of(number, &message, Some(&row.type_name));
                    row.leave_out(reason, first, || what);
                    return;
                }
                let turn = self.turned.take(&message, entry, (*place, number));
                if turn == Turn::Later {
                    return;
                }
                if let Some(by_stamp) = &mut self.by_stamp {
                    by_stamp.take(Held::of(&message, entry, (*place, number)));
                } else {
                    (self.take)(Taken {
                        entry,
                        message,
                        row,
                        number,
                        is_counted: false,
                    });
                }
                if turn == Turn::BeforeHeld
                    && let Some(held) = self.turned.rest()
                {
                    self.pass_on(held);
                }
            }
        }
    }

    /// Hands on what waited for earlier messages, when one was recorded at this log time.
    fn hand_on_due(&mut self, log_time_nanos: u64) {
        let due = |by_stamp: &mut ByStamp| by_stamp.due(log_time_nanos);
        while let Some(held) = self.by_stamp.as_mut().and_then(due) {
            self.hand_on(&held);
        }
    }

    /// A message that was held is the next one.
    fn pass_on(&mut self, held: Held) {
        match &mut self.by_stamp {
            Some(by_stamp) => by_stamp.take(held),
            None => self.hand_on(&held),
        }
    }

    /// Hands on a message that was held.
    fn hand_on(&mut self, held: &Held) {
        if let Some(row) = self.rows.get_mut(held.place) {
            (self.take)(Taken {
                entry: held.entry,
                message: held.message(),
                row,
                number: held.number,
                is_counted: false,
            });
        }
    }
}

/// Why a message that can be read is left out all the same: it is repeated, of another time, or an outlier.
fn misplaced(
    wrong_stamps: &WrongStamps,
    passed: &mut Repeats,
    message: &MessageRef<'_>,
    entry: &Entry,
) -> Option<(Reason, String)> {
    if passed.pass(message) {
        return Some((Reason::Repeated, repeats::WHAT.to_owned()));
    }
    if let Some(what) = wrong_stamp(wrong_stamps, message, entry) {
        return Some((Reason::OtherTime, what));
    }
    let what = wrong_stamps.outlier(message, entry.description.type_name)?;
    Some((Reason::Outlier, what))
}

/// What is wrong with the stamp of a message that is right otherwise.
fn wrong_stamp(
    wrong_stamps: &WrongStamps,
    message: &MessageRef<'_>,
    entry: &Entry,
) -> Option<String> {
    let what = wrong_stamps
        .other_clock(message.topic)
        .or_else(|| wrong_stamps.wrong(message, entry.description.type_name))?;
    let usable = usable::of_topic(entry.name);
    let is_right = usable.is_none_or(|usable| usable(message.data).is_ok());
    is_right.then_some(what)
}

fn plan(info: &recorder::TopicInfo, wanted: &[&str], rows: &mut Vec<TopicAccount>) -> Plan {
    let Some(entry) = entry_in_any_namespace(&info.topic) else {
        return Plan::Aside;
    };
    if !wanted.contains(&entry.name) {
        return Plan::Aside;
    }
    let place = rows.len();
    rows.push(TopicAccount::new(&info.topic, &info.type_name));
    match unreadable(info, &entry.description) {
        None => Plan::Read { place, entry },
        Some((reason, what)) => Plan::LeftOut {
            place,
            reason,
            what,
        },
    }
}

impl Taken<'_> {
    /// Whether it is of `topic`.
    #[must_use]
    pub fn is<M: Message>(&self, topic: &Topic<M>) -> bool {
        self.entry.name == topic.name
    }

    /// Whether its topic, or its family of topics, has this name.
    #[must_use]
    pub fn is_named(&self, name: &str) -> bool {
        self.entry.name == name
    }

    /// Full name of its topic.
    #[must_use]
    pub fn topic(&self) -> &str {
        &self.row.topic
    }

    /// When it was recorded, ns.
    #[must_use]
    pub fn log_time_nanos(&self) -> u64 {
        self.message.log_time_nanos
    }

    /// Where it stands.
    #[must_use]
    pub fn place(&self) -> Place {
        let type_name = self.row.type_name.as_str();
        place_of(self.number, &self.message, Some(type_name))
    }

    /// Counts it, which was decoded, as one that cannot be used.
    pub fn leave_out(&mut self, reason: Reason, what: impl FnOnce() -> String) {
        let place = self.place();
        self.row.take_back(reason, 1, place, what);
    }

    /// Counts it, which was decoded, as one that nobody needs.
    pub fn release(&mut self) {
        self.row.release(1);
    }

    /// What it says, as a message of `topic`; `None`: it cannot be used, and is counted as left out.
    pub fn of<M: Message + Wire>(&mut self, _: &Topic<M>) -> Option<M::Inner> {
        self.inner::<M>()
    }

    /// The same of a family's member.
    pub fn of_member<M: Message + Wire>(&mut self, _: &TopicFamily<M>) -> Option<M::Inner> {
        self.inner::<M>()
    }

    fn inner<M: Message + Wire>(&mut self) -> Option<M::Inner> {
        let is_counted = std::mem::replace(&mut self.is_counted, true);
        match from_cdr::<M>(self.message.data).and_then(M::into_inner) {
            Ok(inner) => {
                self.row.used += u64::from(!is_counted);
                Some(inner)
            }
            Err(_) if is_counted => None,
            Err(error) => {
                let first = place_of(self.number, &self.message, Some(M::TYPE_NAME));
                let reason = error.defect().into();
                self.row.leave_out(reason, first, || error.to_string());
                None
            }
        }
    }
}

/// Where a message stands; of a message of type `type_name` its own stamp too.
pub(crate) fn place_of(number: u64, message: &MessageRef<'_>, type_name: Option<&str>) -> Place {
    Place {
        number,
        log_time_nanos: message.log_time_nanos,
        stamp: type_name.and_then(|name| stamp_of(name, message.data)),
    }
}

/// The stamp at the begin of a message, where its type has one and the bytes reach so far.
pub(crate) fn stamp_of(type_name: &str, data: &[u8]) -> Option<(i32, u32)> {
    let FieldParts { nested, .. } = parts_of(type_name)?.fields.first()?;
    if !["std_msgs/msg/Header", "builtin_interfaces/msg/Time"].contains(nested) {
        return None;
    }
    let word = |at: usize| data.get(at..at + 4)?.try_into().ok();
    let (sec, nanosec) = (word(4)?, word(8)?);
    match data {
        [0, 1, ..] => Some((i32::from_le_bytes(sec), u32::from_le_bytes(nanosec))),
        [0, 0, ..] => Some((i32::from_be_bytes(sec), u32::from_be_bytes(nanosec))),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use abbe_msgs::msg::{AxisState, TestSegment};

    use super::*;

    #[test]
    fn the_stamp_of_a_message_is_read_where_its_bytes_reach_so_far() {
        let little = [0, 1, 0, 0, 5, 0, 0, 0, 9, 0, 0, 0];
        let big = [0, 0, 0, 0, 0, 0, 0, 5, 0, 0, 0, 9];
        for bytes in [little, big] {
            assert_eq!(stamp_of(AxisState::TYPE_NAME, &bytes), Some((5, 9)));
            for short in 0..bytes.len() {
                assert_eq!(stamp_of(AxisState::TYPE_NAME, &bytes[..short]), None);
            }
        }
        assert!(stamp_of(TestSegment::TYPE_NAME, &little).is_some());
        assert_eq!(stamp_of("std_msgs/msg/Float64", &little), None);
        assert_eq!(stamp_of("other_msgs/msg/X", &little), None);
    }
}
