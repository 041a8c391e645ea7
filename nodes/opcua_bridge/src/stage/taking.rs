//! What becomes of changes: observations for the mapping, and counts of what was left out.

use std::collections::BTreeMap;

use machine_report::account::{Account, Reporting};
use machine_report::mapping::Use;
use machine_report::observation::{AlarmLevel, AlarmReport, MachineTime, Observation, Told};
use machine_report::values::Values;
use metrology::epoch;
use metrology::stamp::{Host, Stamp};

use super::Output;
use crate::condition::Condition;
use crate::status::{Quality, Status};
use crate::value::{Change, Payload};

/// What is kept of one node.
#[derive(Clone, Debug)]
struct Node {
    key: String,
    name: String,
    status: Status,
    not_good: u64,
}

/// Takes changes.
#[derive(Clone, Debug)]
pub(super) struct Taking {
    /// The values published so far.
    pub values: Values,
    /// What was taken and left out, without what the values count.
    pub account: Account,
    nodes: Vec<Node>,
    unreadable: u64,
    unstamped: u64,
    overflows: u64,
    lost: u64,
    dropped: u64,
    reporting: Reporting,
}

impl Taking {
    /// Of a machine that has reported nothing yet; `keys` in the order of the items.
    pub(super) fn new(values: Values, keys: Vec<String>) -> Self {
        let node = |key: String| {
            let used = values.mapping().find(&key, None).map(|(_, used)| used);
            let name = match used {
                Some(Use::Number { name, .. } | Use::Text { name, .. } | Use::Alarm { name }) => {
                    name.clone()
                }
                _ => machine_report::mapping::name_of(&key),
            };
            Node {
                key,
                name,
                status: Status::default(),
                not_good: 0,
            }
        };
        let nodes = keys.into_iter().map(node).collect();
        Self {
            values,
            account: Account {
                is_of_agent: true,
                ..Account::default()
            },
            nodes,
            unreadable: 0,
            unstamped: 0,
            overflows: 0,
            lost: 0,
            dropped: 0,
            reporting: Reporting::default(),
        }
    }

    /// Takes the changes of one message.
    pub(super) fn take_all(
        &mut self,
        changes: Vec<Change>,
        at: Stamp<Host>,
        out: &mut Vec<Output>,
    ) {
        self.account.lines += 1;
        for change in in_time(changes) {
            self.take(change, at, out);
        }
    }

    /// Takes one change.
    fn take(&mut self, change: Change, at: Stamp<Host>, out: &mut Vec<Output>) {
        let Some(node) = self.nodes.get(change.item) else {
            return self
                .account
                .leave("values of nodes that were not asked for", 0);
        };
        let key = node.key.clone();
        self.watch_quality(change.item, change.status, out);
        if change.status.has_overflow() {
            self.overflows += 1;
            self.account.leave("overflows of the server's queues", 0);
            let (key, count) = (key.clone(), self.overflows);
            out.push(Condition::Overflow { key, count }.into());
        }
        let time = self.time(&key, &change, out);
        let told = self.told(&key, change.status, &change.payload, out);
        let observation = Observation {
            time,
            key,
            name: None,
            told,
        };
        if change.is_held {
            self.values.hear_held(observation, at, out);
        } else {
            self.values.hear(observation, at, out);
        }
    }

    /// Counts values that are not good, and reports where the quality has changed.
    fn watch_quality(&mut self, item: usize, status: Status, out: &mut Vec<Output>) {
        let node = &mut self.nodes[item];
        let quality = status.quality();
        if quality != Quality::Good {
            node.not_good += 1;
            self.account.leave(
                match quality {
                    Quality::Uncertain => "values of uncertain quality, published",
                    _ => "values of bad quality",
                },
                0,
            );
        }
        let is_other = |status: Status| status.0 & 0xFFFF_0000;
        let before = std::mem::replace(&mut node.status, status);
        let both_good = before.quality() == Quality::Good && quality == Quality::Good;
        if !both_good && is_other(before) != is_other(status) {
            out.push(
                Condition::Quality {
                    name: node.name.clone(),
                    status,
                    count: node.not_good,
                }
                .into(),
            );
        }
    }

    fn time(&mut self, key: &str, change: &Change, out: &mut Vec<Output>) -> MachineTime {
        match change.machine_at.filter(|stamp| epoch::holds(*stamp)) {
            Some(stamp) => MachineTime::Absolute(stamp),
            None => {
                self.unstamped += 1;
                // Said the first time and then at powers of two: a server without stamps has none at all.
                if self.unstamped.is_power_of_two() {
                    let (key, count) = (key.to_owned(), self.unstamped);
                    out.push(Condition::Unstamped { key, count }.into());
                }
                MachineTime::Absent
            }
        }
    }

    /// The value that was reported: a bad status is absence, whatever value stands beside it.
    fn told(
        &mut self,
        key: &str,
        status: Status,
        payload: &Payload,
        out: &mut Vec<Output>,
    ) -> Told {
        if status.quality() == Quality::Bad {
            return Told::Unavailable;
        }
        let is_alarm = self.values.mapping().find(key, None);
        let is_alarm = is_alarm.is_some_and(|(_, used)| matches!(used, Use::Alarm { .. }));
        let read = match payload {
            Payload::Null => return Told::Unavailable,
            payload if is_alarm => alarm(payload),
            payload => payload.text().map(|text| text.map(Told::Value)),
        };
        match read {
            Ok(Some(reported)) => reported,
            Ok(None) => Told::Unavailable,
            Err(what) => {
                self.unreadable += 1;
                self.account.leave("values that cannot be read", 0);
                let (key, count) = (key.to_owned(), self.unreadable);
                out.push(Condition::Unreadable { key, what, count }.into());
                Told::Unavailable
            }
        }
    }

    /// Counts messages that nobody has any more.
    pub(super) fn lost(&mut self, from: u32, lost: u64, out: &mut Vec<Output>) {
        self.lost = self.lost.saturating_add(lost);
        self.account.leave("gaps in the server's messages", 0);
        let total = self.lost;
        out.push(Condition::SequenceGap { from, lost, total }.into());
    }

    /// Counts messages that came too fast.
    pub(super) fn dropped(&mut self, count: u64, out: &mut Vec<Output>) {
        self.dropped = self.dropped.saturating_add(count);
        self.account.leave("bursts that came too fast", 0);
        let total = self.dropped;
        out.push(Condition::Dropped { count, total }.into());
    }

    /// Nothing is known: the connection is lost.
    pub(super) fn absent_all(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        self.values.absent_all(at, out);
        for node in &mut self.nodes {
            if node.status.quality() != Quality::Good {
                // The condition `unavailable` reports what it is now.
                node.status = Status::default();
                out.push(
                    Condition::Quality {
                        name: node.name.clone(),
                        status: node.status,
                        count: node.not_good,
                    }
                    .into(),
                );
            }
        }
    }

    /// Reports the account where it has changed.
    pub(super) fn tell_account(&mut self, at: Stamp<Host>, out: &mut Vec<Output>) {
        if self.account.lines == 0 || !self.reporting.is_due(at) {
            return;
        }
        let account = self.values.account(&self.account);
        if self.reporting.is_news(at, &account) {
            out.push(Condition::Account { account }.into());
        }
    }
}

/// Changes of a message in the order of their stamps, those of one node in the order in which they came.
///
/// Servers may send all changes of one node before those of the next; taken so, positions of different instants would make
/// one state.
fn in_time(changes: Vec<Change>) -> Vec<Change> {
    let mut latest = BTreeMap::new();
    let mut keyed: Vec<_> = changes
        .into_iter()
        .map(|change| {
            let latest = latest.entry(change.item).or_insert(None);
            *latest = (*latest).max(change.machine_at.map(Stamp::nanos));
            (*latest, change)
        })
        .collect();
    keyed.sort_by_key(|(at, _)| *at);
    keyed.into_iter().map(|(_, change)| change).collect()
}

/// A condition's report: true, a number other than 0 and a text are faults.
///
/// A node has one condition at a time, so none has a code: another number or text takes the place of the one before.
fn alarm(payload: &Payload) -> Result<Option<Told>, String> {
    let Some(stands) = payload.is_alarm() else {
        return Err("a condition must be a truth value, an integer or a text".to_owned());
    };
    let text = match payload {
        Payload::Boolean(_) => String::new(),
        _ => payload.text()?.filter(|_| stands).unwrap_or_default(),
    };
    let level = if stands {
        AlarmLevel::Fault
    } else {
        AlarmLevel::Normal
    };
    Ok(Some(Told::Alarm(AlarmReport {
        level,
        code: String::new(),
        severity: String::new(),
        qualifier: String::new(),
        text,
    })))
}
