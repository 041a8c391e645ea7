//! What becomes of an observation: a value on a topic, a position, a temperature, or a condition.

use std::collections::{BTreeMap, BTreeSet};

use metrology::number::number;
use metrology::sample::Verdict;
use metrology::stamp::{Host, Machine, Span, Stamp};
use metrology::yaml::shown;

use crate::account::{Account, Left};
use crate::alarm::Alarms;
use crate::condition::{ValueCondition, words};
use crate::leap::{Leap, Watch};
use crate::mapping::{Mapping, Use};
use crate::observation::{
    AlarmLevel, AlarmReport, MachineClock, MachineTime, Observation, Shape, Told,
};
use crate::plausibility::{Judge, Reading};
use crate::positions::Positions;
use crate::possible::Possible;
use crate::report::{Report, Sink};

mod channel;

/// Unknown keys are named up to this many.
pub const UNMAPPED_LIMIT: usize = 40;

/// A longer value has no place in a message, bytes: the limit of a text in `abbe_msgs`.
pub const VALUE_LIMIT: usize = 65_536;

/// Keys of which something is kept: those of the mapping, and conditions that nobody described up to this many.
const ALARM_KEY_LIMIT: usize = 4096;

/// What is kept of one key of the mapping.
#[derive(Clone, Debug)]
struct Channel {
    used: Use,
    judge: Option<Judge>,
    alarms: Alarms,
    stamp: Option<Stamp<Machine>>,
    absent: bool,
    present: bool,
    impossible: u64,
    unconfirmed: u64,
}

/// The state of all that a machine tells.
#[derive(Clone, Debug)]
pub struct Values {
    mapping: Mapping,
    channels: BTreeMap<String, Channel>,
    positions: Positions,
    clock: MachineClock,
    unmapped: BTreeSet<String>,
    watch: Watch,
    stamps_back: u64,
    leaps: Left,
    not_numbers: Left,
    too_long: Left,
    /// Conditions of too many keys or codes.
    crowded: Left,
    /// Values for keys of conditions, and conditions for keys of values.
    misplaced: Left,
    /// The log's line that is heard; 0: of a connection.
    line: usize,
    told: u64,
    passed_over: u64,
    judged: Vec<(Reading, Verdict)>,
}

impl Values {
    /// Of a machine that has told nothing yet.
    #[must_use]
    pub fn new(mapping: Mapping) -> Self {
        let channel = |used: &Use| Channel {
            used: used.clone(),
            judge: match used {
                Use::Number { rule, .. } => rule.map(Judge::new),
                _ => None,
            },
            alarms: Alarms::default(),
            stamp: None,
            absent: false,
            present: false,
            impossible: 0,
            unconfirmed: 0,
        };
        let channels = mapping
            .uses()
            .map(|(key, used)| (key.to_owned(), channel(used)))
            .collect();
        Self {
            positions: Positions::awaiting(mapping.axes(false)),
            mapping,
            channels,
            clock: MachineClock::default(),
            unmapped: BTreeSet::new(),
            watch: Watch::default(),
            stamps_back: 0,
            leaps: Left::default(),
            not_numbers: Left::default(),
            too_long: Left::default(),
            crowded: Left::default(),
            misplaced: Left::default(),
            line: 0,
            told: 0,
            passed_over: 0,
            judged: Vec::new(),
        }
    }

    /// The mapping.
    #[must_use]
    pub const fn mapping(&self) -> &Mapping {
        &self.mapping
    }

    /// How the fields behind a key are to be read; `None`: nothing is known of it.
    #[must_use]
    pub fn shape(&self, key: &str) -> Option<Shape> {
        let found = self.mapping.find(key, None);
        let has_alarmed = || self.channels.get(key).map(|channel| channel.used.shape());
        found.map(|(_, used)| used.shape()).or_else(has_alarmed)
    }

    /// Values that were refused, by reason.
    const fn refused(&self) -> [(&'static str, Left); 4] {
        [
            ("values that are no numbers", self.not_numbers),
            ("values over the limit", self.too_long),
            ("conditions over the limit", self.crowded),
            (
                "values that the mapping takes for conditions, or the reverse",
                self.misplaced,
            ),
        ]
    }

    /// The account of a bridge with what the values count.
    #[must_use]
    pub fn account(&self, beside: &Account) -> Account {
        let refused = self.refused();
        let n_refused: u64 = refused.iter().map(|(_, left)| left.count).sum();
        let mut account = Account {
            told: self.told.saturating_sub(n_refused),
            unmapped: self.passed_over,
            keys: self.unmapped.clone(),
            ..beside.clone()
        };
        // Values go on over a leap: it is counted and refuses none.
        let leaps = ("leaps of the machine's clock", self.leaps);
        let left = refused.into_iter().chain([leaps]);
        account.left.extend(left.filter(|(_, left)| left.count > 0));
        account
    }

    /// What is heard next stands in this line of a log; 0: it is of a connection.
    pub const fn at_line(&mut self, line: usize) {
        self.line = line;
    }

    /// Takes an observation that came at `received_at`, and watches the machine's clock by it.
    pub fn hear(
        &mut self,
        observation: Observation,
        received_at: Stamp<Host>,
        out: &mut impl Sink,
    ) {
        let is_stamped = observation.time != MachineTime::Absent;
        let is_mapped = self
            .mapping
            .find(&observation.key, observation.name.as_deref())
            .is_some();
        if is_stamped && is_mapped {
            let machine_at = self.clock.stamp(observation.time, received_at);
            let leap = self.watch.hear(machine_at, received_at);
            out.extend(leap.map(|leap| self.leap(leap)));
        }
        self.hear_held(observation, received_at, out);
    }

    /// Counts and reports a leap of the machine's clock.
    pub fn leap(&mut self, leap: Leap) -> Report {
        self.leaps.note(self.line);
        Report::Condition(ValueCondition::ClockLeap {
            from: words(leap.from),
            to: words(leap.to),
            by_s: (leap.to - leap.from).as_secs_f64(),
            passed_s: leap.passed.map(Span::as_secs_f64),
            count: self.leaps.count,
        })
    }

    /// Takes an observation whose stamp may be of long ago, since it still holds.
    pub fn hear_held(
        &mut self,
        observation: Observation,
        received_at: Stamp<Host>,
        out: &mut impl Sink,
    ) {
        let found = self
            .mapping
            .find(&observation.key, observation.name.as_deref());
        let Some(key) = found.map(|(key, _)| key.to_owned()) else {
            return self.hear_unmapped(observation, received_at, out);
        };
        let machine_at = self.clock.stamp(observation.time, received_at);
        let Some(mut channel) = self.channels.remove(&key) else {
            return;
        };
        let is_published = channel.used != Use::Nothing && observation.told != Told::Unavailable;
        self.told += u64::from(is_published);
        self.watch_clock(&key, &mut channel, machine_at, out);
        let moment = (machine_at, received_at);
        match observation.told {
            Told::Unavailable => self.absent(&key, &mut channel, machine_at, out),
            Told::Alarm(report) if matches!(channel.used, Use::Alarm { .. }) => {
                if !channel.alarm(&key, machine_at, report, out) {
                    self.crowded.note(self.line);
                }
            }
            Told::Alarm(_) if channel.used == Use::Nothing => {}
            Told::Alarm(_) => self.misplaced.note(self.line),
            Told::Series { .. } if channel.used == Use::Nothing => {}
            Told::Series { rate_hz, values } => {
                self.series(&key, &mut channel, moment, rate_hz, &values, out);
            }
            Told::Value(text) => self.value(&key, &mut channel, moment, text, out),
        }
        self.channels.insert(key, channel);
    }

    fn hear_unmapped(
        &mut self,
        observation: Observation,
        received_at: Stamp<Host>,
        out: &mut impl Sink,
    ) {
        // A condition matters also where nobody has described it.
        if let Told::Alarm(report) = observation.told {
            let name = crate::mapping::name_of(&observation.key);
            let machine_at = self.clock.stamp(observation.time, received_at);
            self.told += 1;
            let has_room = self.channels.len() < ALARM_KEY_LIMIT
                || self.channels.contains_key(&observation.key);
            let is_kept = has_room && {
                let channel = self
                    .channels
                    .entry(observation.key)
                    .or_insert_with(|| Channel {
                        used: Use::Alarm { name },
                        judge: None,
                        alarms: Alarms::default(),
                        stamp: None,
                        absent: false,
                        present: false,
                        impossible: 0,
                        unconfirmed: 0,
                    });
                channel.alarm("", machine_at, report, out)
            };
            if !is_kept {
                self.crowded.note(self.line);
            }
            return;
        }
        self.passed_over += 1;
        if self.unmapped.len() < UNMAPPED_LIMIT && self.unmapped.insert(observation.key) {
            let keys: Vec<_> = self.unmapped.iter().map(String::as_str).collect();
            let keys = keys.join(", ");
            out.push(Report::Condition(ValueCondition::Unmapped { keys }));
        }
    }

    fn watch_clock(
        &mut self,
        key: &str,
        channel: &mut Channel,
        machine_at: Stamp<Machine>,
        out: &mut impl Sink,
    ) {
        if let Some(before) = channel.stamp.replace(machine_at)
            && machine_at < before
        {
            self.stamps_back += 1;
            out.push(Report::Condition(ValueCondition::ClockBack {
                key: key.to_owned(),
                by_s: (before - machine_at).as_secs_f64(),
                to: words(machine_at),
                count: self.stamps_back,
            }));
        }
    }

    fn absent(
        &mut self,
        key: &str,
        channel: &mut Channel,
        machine_at: Stamp<Machine>,
        out: &mut impl Sink,
    ) {
        match &channel.used {
            Use::Nothing => return,
            Use::Alarm { .. } => {
                let report = AlarmReport {
                    level: AlarmLevel::Unavailable,
                    code: String::new(),
                    severity: String::new(),
                    qualifier: String::new(),
                    text: String::new(),
                };
                // That nothing is known finds room.
                channel.alarm(key, machine_at, report, out);
                return;
            }
            Use::Position {
                axes, commanded, ..
            } => {
                for axis in axes {
                    let whole = self.positions.absent(*axis, *commanded);
                    out.extend(whole.map(Report::State));
                }
            }
            Use::Number { .. } | Use::Text { .. } => {}
        }
        if let Some(judge) = &mut channel.judge {
            judge.absent(&mut self.judged);
        }
        channel.tell(&mut self.judged, None, out);
        if !channel.absent {
            channel.absent = true;
            channel.present = false;
            out.push(Report::Condition(ValueCondition::Absent {
                name: channel.name(key),
                since: words(machine_at),
            }));
        }
    }

    fn value(
        &mut self,
        key: &str,
        channel: &mut Channel,
        (machine_at, received_at): (Stamp<Machine>, Stamp<Host>),
        text: String,
        out: &mut impl Sink,
    ) {
        let wanted = match &channel.used {
            Use::Nothing => return,
            Use::Alarm { .. } => return self.misplaced.note(self.line),
            Use::Text { .. } => 0,
            Use::Number { .. } => 1,
            Use::Position { axes, .. } => axes.len(),
        };
        if text.len() > VALUE_LIMIT {
            self.refuse_long(key, text.len(), out);
            return self.absent(key, channel, machine_at, out);
        }
        let text = channel.used.word(text);
        let numbers = numbers(&text);
        if wanted > 0
            && numbers
                .as_ref()
                .is_none_or(|numbers| numbers.len() != wanted)
        {
            self.refuse(key, text, wanted, out);
            // What it is instead nobody knows: the last good one is over.
            return self.absent(key, channel, machine_at, out);
        }
        let numbers = numbers.unwrap_or_default();
        let impossible = numbers.iter().find_map(|one| channel.used.refuses(*one));
        if let Some(possible) = impossible {
            self.refuse_impossible(key, text, possible, out);
            return self.absent(key, channel, machine_at, out);
        }
        channel.appear(key, out);
        match &channel.used {
            Use::Position {
                axes, commanded, ..
            } => {
                for (axis, number) in axes.iter().zip(numbers) {
                    let position = channel.used.inner(number);
                    let positions = &mut self.positions;
                    let whole =
                        positions.hear(*axis, *commanded, position, machine_at, received_at);
                    out.extend(whole.map(Report::State));
                }
            }
            used => {
                let is_number = matches!(used, Use::Number { .. });
                let first = numbers.first().filter(|_| is_number);
                let value = first.map_or(f64::NAN, |one| used.inner(*one));
                let reading = Reading {
                    machine_at,
                    received_at,
                    value,
                    text,
                };
                channel.judge(reading, &mut self.judged, out);
            }
        }
    }

    fn refuse_long(&mut self, key: &str, length: usize, out: &mut impl Sink) {
        self.too_long.note(self.line);
        out.push(Report::Condition(ValueCondition::ValueTooLong {
            line: self.line,
            key: key.to_owned(),
            length,
            limit: VALUE_LIMIT,
            count: self.too_long.count,
        }));
    }

    fn refuse(&mut self, key: &str, text: String, wanted: usize, out: &mut impl Sink) {
        self.not_numbers.note(self.line);
        out.push(Report::Condition(ValueCondition::NotNumbers {
            line: self.line,
            key: key.to_owned(),
            text: shown(&text),
            wanted,
            count: self.not_numbers.count,
        }));
    }

    fn refuse_impossible(
        &mut self,
        key: &str,
        text: String,
        possible: Possible,
        out: &mut impl Sink,
    ) {
        self.not_numbers.note(self.line);
        out.push(Report::Condition(ValueCondition::OutOfRange {
            line: self.line,
            key: key.to_owned(),
            text: shown(&text),
            possible,
            count: self.not_numbers.count,
        }));
    }

    /// A series ends at its stamp; where its rate is not told only the last value has a stamp.
    fn series(
        &mut self,
        key: &str,
        channel: &mut Channel,
        (machine_at, received_at): (Stamp<Machine>, Stamp<Host>),
        rate_hz: Option<f64>,
        values: &[f64],
        out: &mut impl Sink,
    ) {
        let Use::Number { .. } = channel.used else {
            return self.refuse(key, format!("a series of {}", values.len()), 1, out);
        };
        channel.appear(key, out);
        let n_before = match rate_hz {
            Some(_) => values.len().saturating_sub(1),
            None => 0,
        };
        let first = values.len().saturating_sub(n_before + 1);
        for (at, value) in values.iter().enumerate().skip(first) {
            if let Some(possible) = channel.used.refuses(*value) {
                self.refuse_impossible(key, number(*value), possible, out);
                continue;
            }
            let n_after = (values.len() - 1 - at) as f64;
            let before = Span::from_secs_f64(rate_hz.map_or(0.0, |rate_hz| n_after / rate_hz));
            let reading = Reading {
                machine_at: Stamp::from_nanos((machine_at - before).nanos().max(0)),
                received_at,
                value: channel.used.inner(*value),
                text: value.to_string(),
            };
            channel.judge(reading, &mut self.judged, out);
        }
    }

    /// Time has passed on the host.
    pub fn wait(&mut self, now: Stamp<Host>, out: &mut impl Sink) {
        out.extend(self.positions.settled(now).map(Report::State));
        for channel in self.channels.values_mut() {
            if let Some(judge) = &mut channel.judge {
                judge.wait(now, &mut self.judged);
                channel.tell(&mut self.judged, None, out);
            }
        }
    }

    /// The bridge stops: what waits is told.
    pub fn finish(&mut self, out: &mut impl Sink) {
        out.extend(self.positions.take().map(Report::State));
        for channel in self.channels.values_mut() {
            if let Some(judge) = &mut channel.judge {
                judge.absent(&mut self.judged);
                channel.tell(&mut self.judged, None, out);
            }
        }
    }

    /// The connection is lost: nothing is known.
    pub fn absent_all(&mut self, now: Stamp<Host>, out: &mut impl Sink) {
        out.extend(self.positions.take().map(Report::State));
        let keys: Vec<_> = self.channels.keys().cloned().collect();
        for key in keys {
            let Some(mut channel) = self.channels.remove(&key) else {
                continue;
            };
            if channel.stamp.is_some() || channel.present {
                // By the host's clock: the machine did not say it.
                let at = Stamp::from_nanos(now.nanos());
                self.absent(&key, &mut channel, at, out);
            }
            self.channels.insert(key, channel);
        }
        self.positions.forget(self.mapping.axes(false));
        self.clock.forget();
        self.watch.forget();
    }
}

/// All numbers in a text, where it has nothing else and all are finite.
fn numbers(text: &str) -> Option<Vec<f64>> {
    let parsed = |word: &str| word.parse::<f64>().ok().filter(|number| number.is_finite());
    text.split_whitespace().map(parsed).collect()
}
