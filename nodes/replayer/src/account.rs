//! What of a bag's messages was used and what was left out, by topic and reason.

use std::fmt;

use abbe_msgs::Defect;
use metrology::epoch::utc_of_nanos;
use serde::Serialize;

use crate::stamps::nanos_of;

/// Why messages were left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The topic has another type than that of its name here.
    ForeignType,
    /// The topic has our type in another version of it.
    OtherVersion,
    /// The bytes are no plain CDR.
    Encoding,
    /// The bytes are not those of the type.
    Malformed,
    /// NaN or an infinity where a number is needed.
    NotFinite,
    /// An instant that no clock of Abbe shows.
    Stamp,
    /// A value, a length or a name that may not stand there.
    OutOfRange,
    /// A reading along another axis than that of its run.
    OtherAxis,
    /// A reading of another time than the messages beside it.
    OtherTime,
    /// A reading of another zero of its instrument than that of its run.
    OtherZero,
    /// A reading in another plane than that of its run.
    OtherPlane,
    /// A value far from those beside it.
    Outlier,
    /// The bag has the same message already.
    Repeated,
    /// A reading further from its nominal place than any machine is.
    Beyond,
    /// Axis states of other axes than the machine file's, or far outside its travel.
    OtherMachine,
    /// Of a run whose end states otherwise than its begin.
    Contradiction,
    /// Of a run without an end.
    NoEnd,
    /// Of a run without a begin.
    NoBegin,
    /// A reading of a run without positions of the axes.
    NoPlace,
    /// The network did not take it.
    NotSent,
}

impl From<Defect> for Reason {
    fn from(defect: Defect) -> Self {
        match defect {
            Defect::Encoding => Self::Encoding,
            Defect::Malformed => Self::Malformed,
            Defect::NotFinite => Self::NotFinite,
            Defect::Stamp => Self::Stamp,
            Defect::OutOfRange => Self::OutOfRange,
        }
    }
}

impl Reason {
    /// The reason for people.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::ForeignType => "of another type",
            Self::OtherVersion => "of another version of the type",
            Self::Encoding => Defect::Encoding.words(),
            Self::Malformed => Defect::Malformed.words(),
            Self::NotFinite => Defect::NotFinite.words(),
            Self::Stamp => Defect::Stamp.words(),
            Self::OutOfRange => Defect::OutOfRange.words(),
            Self::OtherAxis => "of another axis than its run's",
            Self::OtherTime => "of another time than the messages beside it",
            Self::OtherZero => "of another zero than its run's",
            Self::OtherPlane => "of another plane than its run's",
            Self::Outlier => "far from those beside it",
            Self::Repeated => "repeated",
            Self::Beyond => "too far from its nominal place",
            Self::OtherMachine => "not of the machine of the machine file",
            Self::Contradiction => "of a run whose begin and end contradict each other",
            Self::NoEnd => "of a run without an end",
            Self::NoBegin => "of a run without a begin",
            Self::NoPlace => "of a run without places of the axes",
            Self::NotSent => "not sent",
        }
    }
}

/// Which message of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Place {
    /// Its number among the messages of its topic, from 1.
    pub number: u64,
    /// When it was recorded, ns.
    pub log_time_nanos: u64,
    /// Its own stamp, seconds and nanoseconds as they stand in it; none: it has none, or ends before it.
    pub stamp: Option<(i32, u32)>,
}

/// Messages of one topic that were left out for one reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// Why.
    pub reason: Reason,
    /// How many.
    pub messages: u64,
    /// The first of them.
    pub first: Place,
    /// What is wrong with the first of them, with field, value and limit.
    pub what: String,
}

/// What became of the messages of one topic.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct TopicAccount {
    /// Full name.
    pub topic: String,
    /// The type that the bag says.
    pub type_name: String,
    /// Messages that were read.
    pub messages: u64,
    /// Of those, what was decoded and used; what nobody needed is neither used nor left out.
    pub used: u64,
    /// Of those, what could not be used, by reason.
    pub left_out: Vec<LeftOut>,
}

impl TopicAccount {
    /// A topic of which nothing was read yet.
    #[must_use]
    pub fn new(topic: &str, type_name: &str) -> Self {
        Self {
            topic: topic.to_owned(),
            type_name: type_name.to_owned(),
            messages: 0,
            used: 0,
            left_out: Vec::new(),
        }
    }

    /// Counts a message that cannot be used; `what` is asked of the first one of its reason alone.
    pub fn leave_out(&mut self, reason: Reason, place: Place, what: impl FnOnce() -> String) {
        self.add(reason, 1, place, what);
    }

    /// Counts messages that were decoded and counted as used, and cannot be used after all; `place` is that of the first.
    pub fn take_back(
        &mut self,
        reason: Reason,
        messages: u64,
        place: Place,
        what: impl FnOnce() -> String,
    ) {
        self.used = self.used.saturating_sub(messages);
        self.add(reason, messages, place, what);
    }

    /// Counts messages that were decoded and counted as used as ones that nobody needed after all.
    pub fn release(&mut self, messages: u64) {
        self.used = self.used.saturating_sub(messages);
    }

    fn add(&mut self, reason: Reason, messages: u64, place: Place, what: impl FnOnce() -> String) {
        match self.left_out.iter_mut().find(|it| it.reason == reason) {
            Some(known) => known.messages += messages,
            None => self.left_out.push(LeftOut {
                reason,
                messages,
                first: place,
                what: what(),
            }),
        }
    }

    /// Messages that nobody needed: neither used nor left out.
    #[must_use]
    pub fn not_needed(&self) -> u64 {
        let left_out: u64 = self.left_out.iter().map(|it| it.messages).sum();
        self.messages.saturating_sub(self.used + left_out)
    }

    /// A line for each reason.
    pub fn lines(&self) -> impl Iterator<Item = String> {
        self.left_out.iter().map(move |it| {
            let LeftOut {
                messages, first, ..
            } = it;
            let (topic, all, what) = (&self.topic, self.messages, &it.what);
            let reason = it.reason.words();
            format!("{topic}: {messages} of {all} messages left out, {reason}: {what} ({first})")
        })
    }
}

/// What became of the messages of every topic that was asked for.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Account {
    /// By topic, in the order of the bag.
    pub topics: Vec<TopicAccount>,
}

impl Account {
    /// Whether everything that was needed could be used.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.topics.iter().all(|topic| topic.left_out.is_empty())
    }

    /// Messages that were left out.
    #[must_use]
    pub fn left_out(&self) -> u64 {
        let all = self.topics.iter().flat_map(|topic| &topic.left_out);
        all.map(|it| it.messages).sum()
    }

    /// A line for each topic and reason.
    pub fn lines(&self) -> impl Iterator<Item = String> {
        self.topics.iter().flat_map(TopicAccount::lines)
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let recorded_at = utc_of_nanos(self.log_time_nanos, 9);
        write!(
            f,
            "the first is number {}, recorded at {recorded_at}",
            self.number
        )?;
        match self.stamp {
            Some(stamp) => write!(f, ", stamp {}", utc_of_nanos(nanos_of(stamp), 9)),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_names_topic_counts_reason_and_the_first_message() {
        let mut topic = TopicAccount::new("/axes/state", "abbe_msgs/msg/AxisState");
        topic.messages = 9;
        let place = |number, stamp| Place {
            number,
            log_time_nanos: 1_700_000_000_012_000_000 + number,
            stamp,
        };
        let mut leave_out = |reason, place| {
            topic.leave_out(reason, place, || format!("what of {}", place.number));
        };
        leave_out(Reason::NotFinite, place(3, Some((1_700_000_000, 5))));
        leave_out(Reason::NotFinite, place(4, None));
        leave_out(Reason::Malformed, place(7, None));
        let account = Account {
            topics: vec![topic],
        };
        assert_eq!(
            account.lines().collect::<Vec<_>>(),
            [
                "/axes/state: 2 of 9 messages left out, not finite: what of 3 (the first is number 3, recorded at 2023-11-14 22:13:20.012000003 UTC, stamp 2023-11-14 22:13:20.000000005 UTC)",
                "/axes/state: 1 of 9 messages left out, malformed: what of 7 (the first is number 7, recorded at 2023-11-14 22:13:20.012000007 UTC)",
            ]
        );
        assert_eq!(account.left_out(), 3);
        assert_eq!(account.topics[0].not_needed(), 6);
        assert!(!account.is_whole());
        assert!(Account::default().is_whole());
    }
}
