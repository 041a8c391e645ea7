//! The conditions of one data item: several may be active at a time, told apart by the machine's code.
//!
//! `NORMAL` with a code ends the condition of that code, `NORMAL` without one ends all; `WARNING` and `FAULT`
//! begin or change the condition of their code; `UNAVAILABLE` ends all, and nothing is known.
//!
//! # References
//! \[1\] MTConnect information model, version 2.4, ObservationInformationModel, Condition.

use std::collections::BTreeMap;

use metrology::Severity;
use metrology::stamp::{Machine, Stamp};

use crate::observation::{AlarmLevel, AlarmReport};

/// Codes that one data item may have active; more are no machine's.
pub const ACTIVE_LIMIT: usize = 256;

#[derive(Clone, Debug, PartialEq)]
struct Active {
    since: Stamp<Machine>,
    report: AlarmReport,
}

/// What is active of one data item.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Alarms {
    active: BTreeMap<String, Active>,
    absent_since: Option<Stamp<Machine>>,
    told: bool,
}

/// The state of one data item for `/diagnostics`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AlarmState {
    /// How bad it is.
    pub severity: Severity,
    /// In words: each active condition with its code.
    pub words: String,
    /// How many are active.
    pub active: usize,
}

impl Alarms {
    /// Takes a report; says the state when it changed.
    pub fn hear(&mut self, at: Stamp<Machine>, report: AlarmReport) -> Option<AlarmState> {
        let before = self.told.then(|| self.state());
        match report.level {
            AlarmLevel::Unavailable => {
                self.active.clear();
                self.absent_since.get_or_insert(at);
            }
            AlarmLevel::Normal if report.code.is_empty() => {
                self.absent_since = None;
                self.active.clear();
            }
            AlarmLevel::Normal => {
                self.absent_since = None;
                self.active.remove(&report.code);
            }
            AlarmLevel::Warning | AlarmLevel::Fault => {
                self.absent_since = None;
                let is_known = self.active.contains_key(&report.code);
                if is_known || self.active.len() < ACTIVE_LIMIT {
                    let since = self
                        .active
                        .get(&report.code)
                        .map_or(at, |known| known.since);
                    self.active
                        .insert(report.code.clone(), Active { since, report });
                }
            }
        }
        self.told = true;
        let state = self.state();
        (before.as_ref() != Some(&state)).then_some(state)
    }

    fn state(&self) -> AlarmState {
        if let Some(since) = self.absent_since {
            return AlarmState {
                severity: Severity::Warn,
                words: format!("unavailable since {}", crate::condition::words(since)),
                active: 0,
            };
        }
        let has_fault = self
            .active
            .values()
            .any(|active| active.report.level == AlarmLevel::Fault);
        let severity = match (self.active.is_empty(), has_fault) {
            (true, _) => Severity::Info,
            (false, false) => Severity::Warn,
            (false, true) => Severity::Error,
        };
        let each = self.active.values().map(|active| words(&active.report));
        let words: Vec<_> = each.collect();
        AlarmState {
            severity,
            words: if words.is_empty() {
                "normal".to_owned()
            } else {
                words.join("; ")
            },
            active: self.active.len(),
        }
    }
}

/// `FAULT 417 (HIGH): spindle too hot`.
fn words(report: &AlarmReport) -> String {
    let level = match report.level {
        AlarmLevel::Fault => "FAULT",
        _ => "WARNING",
    };
    let mut words = level.to_owned();
    for part in [&report.code, &report.severity] {
        if !part.is_empty() {
            words.push(' ');
            words.push_str(part);
        }
    }
    if !report.qualifier.is_empty() {
        words.push_str(&format!(" ({})", report.qualifier));
    }
    if !report.text.is_empty() {
        words.push_str(": ");
        words.push_str(&report.text);
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(level: AlarmLevel, code: &str) -> AlarmReport {
        AlarmReport {
            level,
            code: code.to_owned(),
            severity: String::new(),
            qualifier: String::new(),
            text: String::new(),
        }
    }

    fn at(s: i64) -> Stamp<Machine> {
        Stamp::from_nanos(s * 1_000_000_000)
    }

    #[test]
    fn each_code_begins_and_ends_for_itself_and_normal_alone_ends_all() {
        let mut alarms = Alarms::default();
        let mut hear = |level, code: &str| {
            alarms
                .hear(at(1), report(level, code))
                .map(|state| (state.severity, state.words))
        };
        let said = |severity, words: &str| Some((severity, words.to_owned()));
        assert_eq!(hear(AlarmLevel::Normal, ""), said(Severity::Info, "normal"));
        assert_eq!(
            hear(AlarmLevel::Warning, "12"),
            said(Severity::Warn, "WARNING 12")
        );
        assert_eq!(
            hear(AlarmLevel::Fault, "417"),
            said(Severity::Error, "WARNING 12; FAULT 417")
        );
        assert_eq!(hear(AlarmLevel::Fault, "417"), None);
        assert_eq!(
            hear(AlarmLevel::Normal, "417"),
            said(Severity::Warn, "WARNING 12")
        );
        assert_eq!(
            hear(AlarmLevel::Fault, ""),
            said(Severity::Error, "FAULT; WARNING 12")
        );
        assert_eq!(hear(AlarmLevel::Normal, ""), said(Severity::Info, "normal"));
        let absent = hear(AlarmLevel::Unavailable, "");
        assert_eq!(
            absent,
            said(Severity::Warn, "unavailable since 1970-01-01T00:00:01Z")
        );
    }
}
