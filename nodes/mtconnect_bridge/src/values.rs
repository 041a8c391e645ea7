//! What becomes of an observation: a value on a topic, a position, a temperature, or a condition.

use std::collections::{BTreeMap, BTreeSet};

use metrology::sample::{MachineValue, Quantity, TemperatureSample, Verdict};
use metrology::stamp::{Host, Machine, Span, Stamp};

use crate::alarm::Alarms;
use crate::condition::{Condition, words};
use crate::mapping::{Mapping, Use};
use crate::observation::{AlarmLevel, AlarmReport, MachineClock, Observation, Told};
use crate::plausibility::{Judge, Reading};
use crate::positions::Positions;
use crate::stage::Output;

/// Unknown keys are named up to this many.
const UNMAPPED_LIMIT: usize = 40;

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
    stamps_back: u64,
    not_numbers: u64,
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
            mapping,
            channels,
            positions: Positions::default(),
            clock: MachineClock::default(),
            unmapped: BTreeSet::new(),
            stamps_back: 0,
            not_numbers: 0,
            judged: Vec::new(),
        }
    }

    /// The mapping.
    #[must_use]
    pub const fn mapping(&self) -> &Mapping {
        &self.mapping
    }

    /// Takes an observation that came at `received_at`.
    pub fn hear(
        &mut self,
        observation: Observation,
        received_at: Stamp<Host>,
        out: &mut Vec<Output>,
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
        self.watch_clock(&key, &mut channel, machine_at, out);
        let moment = (machine_at, received_at);
        match observation.told {
            Told::Unavailable => self.absent(&key, &mut channel, machine_at, out),
            Told::Alarm(report) if matches!(channel.used, Use::Alarm { .. }) => {
                channel.alarm(&key, machine_at, report, out);
            }
            Told::Alarm(_) => {}
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
        out: &mut Vec<Output>,
    ) {
        // A condition matters also where nobody has described it.
        if let Told::Alarm(report) = observation.told {
            let name = crate::mapping::name_of(&observation.key);
            let machine_at = self.clock.stamp(observation.time, received_at);
            if self.channels.len() < 4096 {
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
                channel.alarm("", machine_at, report, out);
            }
            return;
        }
        if self.unmapped.len() < UNMAPPED_LIMIT && self.unmapped.insert(observation.key) {
            let keys: Vec<_> = self.unmapped.iter().map(String::as_str).collect();
            let keys = keys.join(", ");
            out.push(Output::Condition(Condition::Unmapped { keys }));
        }
    }

    fn watch_clock(
        &mut self,
        key: &str,
        channel: &mut Channel,
        machine_at: Stamp<Machine>,
        out: &mut Vec<Output>,
    ) {
        if let Some(before) = channel.stamp.replace(machine_at)
            && machine_at < before
        {
            self.stamps_back += 1;
            out.push(Output::Condition(Condition::ClockBack {
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
        out: &mut Vec<Output>,
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
                return channel.alarm(key, machine_at, report, out);
            }
            Use::Position {
                axes, commanded, ..
            } => {
                for axis in axes {
                    let whole = self.positions.absent(*axis, *commanded);
                    out.extend(whole.map(Output::State));
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
            out.push(Output::Condition(Condition::Absent {
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
        out: &mut Vec<Output>,
    ) {
        let wanted = match &channel.used {
            Use::Nothing | Use::Alarm { .. } => return,
            Use::Text { .. } => 0,
            Use::Number { .. } => 1,
            Use::Position { axes, .. } => axes.len(),
        };
        let numbers = numbers(&text);
        if wanted > 0
            && numbers
                .as_ref()
                .is_none_or(|numbers| numbers.len() != wanted)
        {
            return self.refuse(key, text, wanted, out);
        }
        let numbers = numbers.unwrap_or_default();
        channel.appear(key, out);
        match &channel.used {
            Use::Position {
                axes,
                commanded,
                factor,
            } => {
                for (axis, number) in axes.iter().zip(numbers) {
                    let position = number * factor;
                    let positions = &mut self.positions;
                    let whole =
                        positions.hear(*axis, *commanded, position, machine_at, received_at);
                    out.extend(whole.map(Output::State));
                }
            }
            Use::Number { to_inner, .. } => {
                let value = numbers
                    .first()
                    .map_or(f64::NAN, |n| n * to_inner.0 + to_inner.1);
                let reading = Reading {
                    machine_at,
                    received_at,
                    value,
                    text,
                };
                channel.judge(reading, &mut self.judged, out);
            }
            _ => {
                let value = f64::NAN;
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

    fn refuse(&mut self, key: &str, text: String, wanted: usize, out: &mut Vec<Output>) {
        self.not_numbers += 1;
        out.push(Output::Condition(Condition::NotNumbers {
            key: key.to_owned(),
            text,
            wanted,
            count: self.not_numbers,
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
        out: &mut Vec<Output>,
    ) {
        let Use::Number { to_inner, .. } = channel.used else {
            return self.refuse(key, format!("a series of {}", values.len()), 1, out);
        };
        channel.appear(key, out);
        let n_before = match rate_hz {
            Some(_) => values.len().saturating_sub(1),
            None => 0,
        };
        let first = values.len().saturating_sub(n_before + 1);
        for (at, value) in values.iter().enumerate().skip(first) {
            let n_after = (values.len() - 1 - at) as f64;
            let before = Span::from_secs_f64(rate_hz.map_or(0.0, |rate_hz| n_after / rate_hz));
            let reading = Reading {
                machine_at: Stamp::from_nanos((machine_at - before).nanos().max(0)),
                received_at,
                value: value * to_inner.0 + to_inner.1,
                text: value.to_string(),
            };
            channel.judge(reading, &mut self.judged, out);
        }
    }

    /// Time has passed on the host.
    pub fn wait(&mut self, now: Stamp<Host>, out: &mut Vec<Output>) {
        out.extend(self.positions.settled(now).map(Output::State));
        for channel in self.channels.values_mut() {
            if let Some(judge) = &mut channel.judge {
                judge.wait(now, &mut self.judged);
                channel.tell(&mut self.judged, None, out);
            }
        }
    }

    /// The bridge stops: what waits is told.
    pub fn finish(&mut self, out: &mut Vec<Output>) {
        out.extend(self.positions.take().map(Output::State));
        for channel in self.channels.values_mut() {
            if let Some(judge) = &mut channel.judge {
                judge.absent(&mut self.judged);
                channel.tell(&mut self.judged, None, out);
            }
        }
    }

    /// The connection is lost: nothing is known.
    pub fn absent_all(&mut self, now: Stamp<Host>, out: &mut Vec<Output>) {
        out.extend(self.positions.take().map(Output::State));
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
        self.clock.forget();
    }
}

/// All numbers in a text, where it has nothing else and all are finite.
fn numbers(text: &str) -> Option<Vec<f64>> {
    let number = |word: &str| word.parse::<f64>().ok().filter(|number| number.is_finite());
    text.split_whitespace().map(number).collect()
}

impl Channel {
    fn name(&self, key: &str) -> String {
        match &self.used {
            Use::Number { name, .. } | Use::Text { name, .. } | Use::Alarm { name } => name.clone(),
            Use::Position { .. } | Use::Nothing => crate::mapping::name_of(key),
        }
    }

    fn alarm(&mut self, key: &str, at: Stamp<Machine>, report: AlarmReport, out: &mut Vec<Output>) {
        let name = self.name(key);
        let state = self.alarms.hear(at, report);
        self.present = true;
        out.extend(state.map(|state| Output::Condition(Condition::Alarm { name, state })));
    }

    fn appear(&mut self, key: &str, out: &mut Vec<Output>) {
        self.present = true;
        if std::mem::take(&mut self.absent) {
            let name = self.name(key);
            out.push(Output::Condition(Condition::Present { name }));
        }
    }

    fn judge(
        &mut self,
        reading: Reading,
        judged: &mut Vec<(Reading, Verdict)>,
        out: &mut Vec<Output>,
    ) {
        let before = match &mut self.judge {
            None => {
                judged.push((reading, Verdict::Good));
                None
            }
            Some(judge) => {
                let before = judge.base().cloned();
                judge.hear(reading, judged);
                before
            }
        };
        self.tell(judged, before, out);
    }

    /// Tells what has been judged; `before` is the last good reading before all of it.
    fn tell(
        &mut self,
        judged: &mut Vec<(Reading, Verdict)>,
        before: Option<Reading>,
        out: &mut Vec<Output>,
    ) {
        if judged.is_empty() {
            return;
        }
        let (name, quantity) = match &self.used {
            Use::Number { name, quantity, .. } | Use::Text { name, quantity, .. } => {
                (name.clone(), *quantity)
            }
            _ => return judged.clear(),
        };
        let after = judged.last().map(|(reading, _)| reading.text.clone());
        for (reading, verdict) in judged.drain(..) {
            let condition = self.count(&name, &reading, verdict, before.as_ref(), after.as_deref());
            out.extend(condition.map(Output::Condition));
            if quantity == Quantity::Temperature && verdict == Verdict::Good {
                out.push(Output::Temperature(TemperatureSample {
                    at: reading.received_at,
                    sensor: name.clone(),
                    temperature_degc: reading.value,
                    variance_k2: 0.0,
                }));
            }
            out.push(Output::Value(MachineValue {
                received_at: reading.received_at,
                machine_at: reading.machine_at,
                name: name.clone(),
                quantity,
                verdict,
                value: reading.value,
                text: reading.text,
            }));
        }
    }

    fn count(
        &mut self,
        name: &str,
        reading: &Reading,
        verdict: Verdict,
        before: Option<&Reading>,
        after: Option<&str>,
    ) -> Option<Condition> {
        let (name, value, at) = (
            name.to_owned(),
            reading.text.clone(),
            words(reading.machine_at),
        );
        match verdict {
            Verdict::Good => None,
            Verdict::Impossible => {
                self.impossible += 1;
                let judge = self.judge.as_ref();
                Some(Condition::Impossible {
                    name,
                    value,
                    before: before.map(|before| before.text.clone()).unwrap_or_default(),
                    after: after.unwrap_or_default().to_owned(),
                    allowed: before
                        .zip(judge)
                        .map_or(f64::NAN, |(before, judge)| judge.allowed(before, reading)),
                    at,
                    count: self.impossible,
                })
            }
            Verdict::Unconfirmed => {
                self.unconfirmed += 1;
                let count = self.unconfirmed;
                Some(Condition::Unconfirmed {
                    name,
                    value,
                    at,
                    count,
                })
            }
        }
    }
}
