//! What becomes of the readings of one key of the mapping.

use metrology::sample::{MachineValue, Quantity, TemperatureSample, Verdict};
use metrology::stamp::{Machine, Stamp};

use super::Channel;
use crate::condition::{ValueCondition, words};
use crate::mapping::Use;
use crate::observation::AlarmReport;
use crate::plausibility::Reading;
use crate::report::{Report, Sink};

impl Channel {
    pub(super) fn name(&self, key: &str) -> String {
        match &self.used {
            Use::Number { name, .. } | Use::Text { name, .. } | Use::Alarm { name } => name.clone(),
            Use::Position { .. } | Use::Nothing => crate::mapping::name_of(key),
        }
    }

    /// Takes a condition of the machine; whether it is kept.
    pub(super) fn alarm(
        &mut self,
        key: &str,
        at: Stamp<Machine>,
        report: AlarmReport,
        out: &mut impl Sink,
    ) -> bool {
        let name = self.name(key);
        let has_room = self.alarms.has_room(&report);
        let state = self.alarms.hear(at, report);
        self.present = true;
        out.extend(state.map(|state| Report::Condition(ValueCondition::Alarm { name, state })));
        has_room
    }

    pub(super) fn appear(&mut self, key: &str, out: &mut impl Sink) {
        self.present = true;
        if std::mem::take(&mut self.absent) {
            let name = self.name(key);
            out.push(Report::Condition(ValueCondition::Present { name }));
        }
    }

    pub(super) fn judge(
        &mut self,
        reading: Reading,
        judged: &mut Vec<(Reading, Verdict)>,
        out: &mut impl Sink,
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
    pub(super) fn tell(
        &mut self,
        judged: &mut Vec<(Reading, Verdict)>,
        before: Option<Reading>,
        out: &mut impl Sink,
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
            out.extend(condition.map(Report::Condition));
            if quantity == Quantity::Temperature && verdict == Verdict::Good {
                out.push(Report::Temperature(TemperatureSample {
                    at: reading.received_at,
                    sensor: name.clone(),
                    temperature_degc: reading.value,
                    variance_k2: 0.0,
                }));
            }
            out.push(Report::Value(MachineValue {
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
    ) -> Option<ValueCondition> {
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
                Some(ValueCondition::Impossible {
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
                Some(ValueCondition::Unconfirmed {
                    name,
                    value,
                    at,
                    count,
                })
            }
        }
    }
}
