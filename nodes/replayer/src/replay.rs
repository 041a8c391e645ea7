//! Runs a bag's inputs through its nodes and holds what comes out against what was recorded.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use abbe_msgs::topics::Origin;
use metrology::stamp::{Host, Stamp};
use node_runtime::{Harness, Node};
use recorder::{Bag, Event, MessageOrder, MessageRef, Order, RecordedCall, RecordedRun, TopicInfo};
use serde::Serialize;

use crate::account::{Reason, TopicAccount};
use crate::difference::{Difference, Discrepancy};
use crate::error::ReplayError;
use crate::inputs;
use crate::known::unreadable;
use crate::leap::{self, LEAST};
use crate::listening::{Ear, Listening, NotInBag};
use crate::reading::{Reading, place_of};
use crate::repeats::{self, Repeats};
use crate::stamps::WrongStamps;
use crate::usable::{self, Usable};

/// Messages of one topic that were held against computed ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Compared {
    /// Messages in the bag.
    pub messages: u64,
    /// Messages that differ, are missing, or are too many.
    pub differing: u64,
}

/// What a replay came to.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// By topic.
    pub compared: BTreeMap<String, Compared>,
    /// What was computed on topics that the bag does not have, by topic.
    pub not_in_bag: BTreeMap<String, NotInBag>,
    /// The first difference, `None`: the bag was computed again byte for byte.
    pub first: Option<Difference>,
    /// Messages and service calls that were put in.
    pub inputs: u64,
    /// What of the bag was read, lost and left out.
    pub reading: Reading,
    /// What differs behind the first input that was lost or left out, which may come of that.
    pub doubtful: Option<Doubtful>,
}

/// Differences that may come of what was lost or left out before them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Doubtful {
    /// How many.
    pub messages: u64,
    /// The first of them.
    pub first: Difference,
}

impl Outcome {
    /// Whether nothing that the nodes compute is in the bag, though the whole bag was read.
    #[must_use]
    pub fn compared_nothing(&self) -> bool {
        self.compared.is_empty() && self.reading.is_whole()
    }

    /// Whether what the bag has was computed again byte for byte, as far as its inputs were there.
    #[must_use]
    pub fn is_equal(&self) -> bool {
        self.first.is_none() && !self.compared_nothing()
    }
}

/// Fresh nodes that take a run over in its middle, with the state of those that they follow.
pub struct Relay {
    /// Messages of the bag before it.
    pub after_messages: u64,
    /// As [`check`] takes them.
    pub nodes: Vec<Box<dyn Node>>,
}

/// What is done with a topic of the bag.
enum Role {
    Input {
        route: usize,
        row: usize,
        usable: Option<Usable>,
    },
    Result {
        route: usize,
        row: usize,
        usable: Option<Usable>,
    },
    /// None of its messages can be used.
    LeftOut {
        row: usize,
        is_input: bool,
        reason: Reason,
        what: String,
    },
    /// Nobody here hears it, or it is about the programs themselves.
    Aside,
}

struct Replay<'b> {
    bag: &'b Bag,
    harness: Harness,
    listening: Listening,
    roles: Vec<Role>,
    wrong_stamps: WrongStamps,
    passed: Repeats,
    /// Messages that are repeated: those who made the bag did not count them.
    repeated: u64,
    relays: VecDeque<Relay>,
    /// The last relay's turn: after how many messages, and how many inputs had been put in by then.
    resumed: Option<(u64, u64)>,
    start: Stamp<Host>,
    stop: Option<Stamp<Host>>,
    /// An input was lost or left out, or the log times leaped: what differs from here on may come of that.
    is_doubtful: bool,
    outcome: Outcome,
}

/// Replays a bag on `nodes`, which are all nodes of the run but its sources, with their recorded parameters, in their
/// recorded order. Nodes that publish nothing that is computed are left out. Each of `relays` takes over when its
/// turn comes.
///
/// # Errors
/// When the bag is not of a composed run; when a node's state cannot be handed on, or no input follows a relay's turn.
pub fn check(
    bag: &Bag,
    run: &RecordedRun,
    nodes: Vec<Box<dyn Node>>,
    mut relays: Vec<Relay>,
) -> Result<Outcome, ReplayError> {
    if run.order != MessageOrder::Total {
        return Err(ReplayError::Arrival);
    }
    if !leap::is_start(run.start_time_nanos) {
        return Err(ReplayError::Start {
            nanos: run.start_time_nanos,
        });
    }
    let nodes = computing(nodes);
    let ports = nodes.iter().flat_map(|node| &node.ports().publications);
    let computed: Vec<String> = ports.map(|port| port.topic.clone()).collect();
    let mut harness = Harness::compose(nodes, stamp(run.start_time_nanos))?;
    let mut outcome = Outcome::default();
    let rows = &mut outcome.reading.account.topics;
    let infos = bag.topics().iter();
    let roles: Vec<Role> = infos
        .map(|info| role(info, &harness, &computed, rows))
        .collect();
    let listening = Listening::new(ears(&harness, &roles, &computed));
    listening.attend(&mut harness);
    relays.sort_by_key(|relay| relay.after_messages);
    let mut replay = Replay {
        bag,
        harness,
        listening,
        roles,
        wrong_stamps: WrongStamps::of(bag),
        passed: Repeats::numbered(),
        repeated: 0,
        relays: relays.into(),
        resumed: None,
        start: stamp(run.start_time_nanos),
        stop: run.stop_time_nanos.map(stamp),
        is_doubtful: false,
        outcome,
    };
    replay.run()?;
    Ok(replay.summed_up())
}

/// The nodes that publish what is computed.
fn computing(nodes: Vec<Box<dyn Node>>) -> Vec<Box<dyn Node>> {
    let nodes = nodes.into_iter();
    nodes
        .filter(|node| inputs::computes(node.as_ref()))
        .collect()
}

/// What is done with a topic of the bag; its row of the account is added.
fn role(
    info: &TopicInfo,
    harness: &Harness,
    computed: &[String],
    rows: &mut Vec<TopicAccount>,
) -> Role {
    let name = info.topic.trim_start_matches('/');
    let (Some(entry), Some(route)) = (inputs::entry_of(name), harness.place_of_topic(name)) else {
        return Role::Aside;
    };
    if entry.origin == Origin::Housekeeping {
        return Role::Aside;
    }
    let row = rows.len();
    rows.push(TopicAccount::new(&info.topic, &info.type_name));
    let is_input = !computed.iter().any(|own| own == name);
    let usable = usable::of_topic(entry.name);
    match unreadable(info, &entry.description) {
        Some((reason, what)) => Role::LeftOut {
            row,
            is_input,
            reason,
            what,
        },
        None if is_input => Role::Input { route, row, usable },
        None => Role::Result { route, row, usable },
    }
}

/// What is done with what the nodes say, by topic of the harness.
fn ears(harness: &Harness, roles: &[Role], computed: &[String]) -> Vec<Ear> {
    let mut ears: Vec<Ear> = harness
        .topics()
        .map(|port| {
            let is_ours = computed.contains(&port.topic);
            let entry = inputs::entry_of(&port.topic).filter(|_| is_ours);
            let is_result = entry.is_some_and(|entry| entry.origin == Origin::Computed);
            if is_result { Ear::SumUp } else { Ear::Deaf }
        })
        .collect();
    for role in roles {
        if let Role::Result { route, .. } = role {
            ears[*route] = Ear::Compare;
        }
    }
    ears
}

/// The order in which a bag is replayed, and the messages whose log time alone is wrong.
///
/// A composed run is recorded in the order of its log times. Where a file is there twice, they put each message beside its
/// copy, as in a report; a wrong log time would move its message, so the order of the files holds otherwise.
fn order_of(bag: &Bag, start: Stamp<Host>) -> (Order, BTreeSet<u64>) {
    let strays = leap::strays(bag, Order::File, start);
    if bag.has_doubled_file() || (bag.has_overlapping_files() && strays.is_empty()) {
        return (Order::LogTime, leap::strays(bag, Order::LogTime, start));
    }
    (Order::File, strays)
}

/// The service calls of a bag in their order; those of a file that is there twice are put in once.
fn calls_of(bag: &Bag) -> VecDeque<RecordedCall> {
    let mut calls = RecordedCall::all_of(bag);
    if bag.has_doubled_file() {
        calls.sort_by_key(|call| call.after_messages);
        let mut seen = BTreeSet::new();
        calls.retain(|call| {
            seen.insert((call.after_messages, call.topic.clone(), call.event.clone()))
        });
    }
    calls.into()
}

fn stamp(nanos: u64) -> Stamp<Host> {
    Stamp::from_nanos(i64::try_from(nanos).unwrap_or(i64::MAX))
}

impl Replay<'_> {
    fn run(&mut self) -> Result<(), ReplayError> {
        let (order, strays) = order_of(self.bag, self.start);
        let mut messages = self.bag.messages(order);
        let mut last = None;
        let mut calls = calls_of(self.bag);
        let mut read = 0;
        while let Some(event) = messages.next_event() {
            let message = match event {
                Event::Message(message) => message,
                Event::Loss(loss) => {
                    self.outcome.reading.losses.push(loss);
                    self.is_doubtful = true;
                    continue;
                }
            };
            let now = last.unwrap_or(self.start);
            let is_stray = strays.contains(&read);
            let at = if is_stray {
                now
            } else {
                stamp(message.log_time_nanos)
            };
            self.is_doubtful |= is_stray;
            let (before, after) = (now.nanos().unsigned_abs(), message.log_time_nanos);
            self.outcome.reading.leaps.pass(before, after);
            // Where messages were taken out of a bag, the count stands too high and the time tells.
            let own = read - self.repeated;
            self.put_calls(&mut calls, &mut last, at, |call| {
                call.after_messages <= own || stamp(call.time_nanos) < at
            });
            self.hand_over_after(read)?;
            read += 1;
            self.arrive(at, &mut last);
            self.take(at, &message, is_stray);
        }
        // What a cut file would have gone on with is not known.
        if let (Some(end), true) = (last, self.outcome.reading.losses.is_empty()) {
            self.put_calls(&mut calls, &mut last, end, |call| {
                stamp(call.time_nanos) <= end
            });
            self.go_on(|due| due <= end);
            self.nothing_is_left();
        }
        if let Some(&Relay { after_messages, .. }) = self.relays.front() {
            return Err(ReplayError::ResumedAfterEnd {
                after_messages,
                messages: read,
            });
        }
        match self.resumed {
            Some((after_messages, inputs)) if inputs == self.outcome.inputs => {
                Err(ReplayError::ResumedAfterInputs { after_messages })
            }
            _ => Ok(()),
        }
    }

    /// Why a message cannot be used; a wrong log time says nothing of its stamp.
    fn defect(
        &self,
        message: &MessageRef<'_>,
        usable: Option<Usable>,
        is_stray: bool,
    ) -> Option<(Reason, String)> {
        let tried = usable.map_or(Ok(()), |usable| usable(message.data));
        if let Err(error) = tried {
            return Some((error.defect().into(), error.to_string()));
        }
        let info = self.bag.topic(message.topic);
        let what = self.wrong_stamps.wrong(message, &info.type_name);
        what.filter(|_| !is_stray)
            .map(|what| (Reason::OtherTime, what))
    }

    /// Leaves out a message that the bag has already; which of the two is right is not known where what follows differs.
    fn is_repeated(&mut self, message: &MessageRef<'_>) -> bool {
        if !self.passed.pass(message) {
            return false;
        }
        self.repeated += 1;
        let topic = message.topic.index();
        let (Role::Input { row, .. } | Role::Result { row, .. } | Role::LeftOut { row, .. }) =
            &self.roles[topic]
        else {
            return true;
        };
        self.is_doubtful = true;
        let row = &mut self.outcome.reading.account.topics[*row];
        row.messages += 1;
        let what = repeats::WHAT.to_owned();
        leave_out(
            row,
            message,
            &self.bag.topics()[topic],
            (Reason::Repeated, what),
        );
        true
    }

    /// Puts in an input, or compares a result; what cannot be used is left out.
    fn take(&mut self, at: Stamp<Host>, message: &MessageRef<'_>, is_stray: bool) {
        let topic = message.topic.index();
        if self.is_repeated(message) {
            return;
        }
        let defect = match &self.roles[topic] {
            Role::Input { usable, .. } | Role::Result { usable, .. } => {
                self.defect(message, *usable, is_stray)
            }
            Role::LeftOut { .. } | Role::Aside => None,
        };
        let rows = &mut self.outcome.reading.account.topics;
        match &self.roles[topic] {
            Role::Input { route, row, .. } => {
                let row = &mut rows[*row];
                row.messages += 1;
                if let Some(defect) = defect {
                    leave_out(row, message, &self.bag.topics()[topic], defect);
                    self.is_doubtful = true;
                    return;
                }
                row.used += 1;
                self.outcome.inputs += 1;
                self.harness.put(*route, message.data);
            }
            Role::Result { route, row, .. } => {
                rows[*row].messages += 1;
                let (route, row) = (*route, *row);
                self.compare((route, row, defect), at, message);
            }
            Role::LeftOut {
                row,
                is_input,
                reason,
                what,
            } => {
                let row = &mut rows[*row];
                row.messages += 1;
                let first = place_of(row.messages, message, None);
                row.leave_out(*reason, first, || what.clone());
                self.is_doubtful |= is_input;
            }
            Role::Aside => {}
        }
    }

    /// Puts in the next service calls as long as they are due; none is later than what follows it at `next`.
    fn put_calls(
        &mut self,
        calls: &mut VecDeque<RecordedCall>,
        last: &mut Option<Stamp<Host>>,
        next: Stamp<Host>,
        is_due: impl Fn(&RecordedCall) -> bool,
    ) {
        while calls.front().is_some_and(&is_due)
            && let Some(call) = calls.pop_front()
        {
            self.arrive(stamp(call.time_nanos).min(next), last);
            let is_request = self.harness.put_request(&call.topic, &call.event);
            self.outcome.inputs += u64::from(is_request);
        }
    }

    /// Lets fresh nodes in a fresh harness go on from here, where a relay's turn has come.
    fn hand_over_after(&mut self, read: u64) -> Result<(), ReplayError> {
        let has_turn = |relay: &Relay| relay.after_messages <= read;
        while self.relays.front().is_some_and(has_turn)
            && let Some(relay) = self.relays.pop_front()
        {
            self.resumed = Some((relay.after_messages, self.outcome.inputs));
            let snapshot = self.harness.save()?;
            let mut fresh = Harness::compose(computing(relay.nodes), Stamp::from_nanos(0))?;
            fresh.resume(&snapshot)?;
            self.listening.attend(&mut fresh);
            self.harness = fresh;
        }
        Ok(())
    }

    fn summed_up(mut self) -> Outcome {
        // No message is lost by a wrong description, and those that were taken out were compared: no difference is doubtful by them.
        let description = self.bag.description_losses().iter().cloned();
        self.outcome.reading.losses.extend(description);
        for (route, sum) in self.listening.sums() {
            self.outcome.not_in_bag.insert(self.name_of(route), sum);
        }
        self.outcome
    }

    /// The full name of a topic of the harness.
    fn name_of(&self, route: usize) -> String {
        let port = self.harness.topics().nth(route);
        port.map_or_else(String::new, |port| format!("/{}", port.topic))
    }

    /// Lets everything happen that is due before `at`, when time goes on.
    fn arrive(&mut self, at: Stamp<Host>, last: &mut Option<Stamp<Host>>) {
        if last.is_none_or(|last| at > last) {
            if at - last.unwrap_or(self.start) > LEAST {
                self.leap_to(at);
            }
            self.go_on(|due| due < at);
            self.nothing_is_left();
            self.harness.wait_until(at);
            *last = Some(at);
        }
    }

    /// Delivers what waits and leaves out the ticks before `at`: nothing was recorded for so long that the log times leaped.
    fn leap_to(&mut self, at: Stamp<Host>) {
        while self.harness.deliver_next() {}
        self.nothing_is_left();
        self.harness.skip_ticks_before(at);
        self.is_doubtful = true;
    }

    /// Delivers what waits and hands out the ticks (and the end of the run) that are due.
    fn go_on(&mut self, is_due: impl Fn(Stamp<Host>) -> bool) {
        while self.step(&is_due) {}
    }

    /// The next delivery, tick, or the end of the run; false when nothing is due.
    fn step(&mut self, is_due: &impl Fn(Stamp<Host>) -> bool) -> bool {
        if self.harness.deliver_next() {
            return true;
        }
        let tick = self.harness.next_tick();
        match self.stop {
            Some(stop) if is_due(stop) && tick.is_none_or(|tick| tick > stop) => {
                self.stop = None;
                self.harness.wait_until(stop);
                self.harness.ask_to_stop();
                true
            }
            _ if tick.is_some_and(is_due) => {
                self.harness.tick_next();
                true
            }
            _ => false,
        }
    }

    /// Lets the nodes go on until they say something on the recorded message's topic, and compares.
    fn compare(
        &mut self,
        (route, row, defect): (usize, usize, Option<(Reason, String)>),
        at: Stamp<Host>,
        message: &MessageRef<'_>,
    ) {
        let recorded = message.data;
        let found = loop {
            let found = self.listening.take(route);
            if found.is_some() || !self.step(&|due| due <= at) {
                break found;
            }
        };
        let info = self.bag.topic(message.topic);
        let discrepancy = match found {
            None => Some(Discrepancy::NotComputed),
            Some((_, said)) if *said.bytes != *recorded => {
                Some(Discrepancy::between(info, recorded, &said.bytes))
            }
            Some((0, _)) => None,
            Some(_) => Some(Discrepancy::Order),
        };
        let row = &mut self.outcome.reading.account.topics[row];
        // What differs because it cannot be read tells nothing of what was computed.
        if let (Some(_), Some(defect)) = (&discrepancy, defect) {
            leave_out(row, message, info, defect);
            return;
        }
        row.used += 1;
        let name = info.topic.clone();
        self.outcome
            .compared
            .entry(name.clone())
            .or_default()
            .messages += 1;
        if let Some(discrepancy) = discrepancy {
            self.differs(name, at, discrepancy);
        }
    }

    /// What was said and not met in the bag before time went on.
    fn nothing_is_left(&mut self) {
        while let Some(said) = self.listening.take_next() {
            let name = self.name_of(said.route);
            self.differs(name, said.at, Discrepancy::NotRecorded);
        }
    }

    fn differs(&mut self, topic: String, at: Stamp<Host>, discrepancy: Discrepancy) {
        let compared = self.outcome.compared.entry(topic.clone()).or_default();
        compared.differing += 1;
        let message = compared.messages.saturating_sub(1);
        let difference = Difference {
            at_nanos: at.nanos(),
            topic,
            message,
            discrepancy,
        };
        if !self.is_doubtful {
            self.outcome.first.get_or_insert(difference);
            return;
        }
        let doubtful = self.outcome.doubtful.get_or_insert(Doubtful {
            messages: 0,
            first: difference,
        });
        doubtful.messages += 1;
    }
}

fn leave_out(
    row: &mut TopicAccount,
    message: &MessageRef<'_>,
    info: &TopicInfo,
    (reason, what): (Reason, String),
) {
    let first = place_of(row.messages, message, Some(&info.type_name));
    row.leave_out(reason, first, || what);
}
