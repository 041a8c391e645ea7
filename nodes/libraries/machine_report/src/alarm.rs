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

/// Bytes of the words of one condition that are kept.
const TEXT_BYTES: usize = 16 * 1024;
/// Bytes of a code, a severity or a qualifier that are kept.
const CODE_BYTES: usize = 128;
/// Bytes of the words of all conditions of a data item together; beyond it each keeps [`LEAST_BYTES`].
const ITEM_BYTES: usize = 32 * 1024;
/// Bytes that the words of each condition may have in any case.
const LEAST_BYTES: usize = 256;
/// Bytes of a state in words: below the 64 KiB that a sentence of a message may have.
const STATE_BYTES: usize = 48 * 1024;

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
        let report = self.bounded(report);
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
                if self.has_room_for(&report.code) {
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

    /// Whether a report is kept: it begins nothing new, or fewer conditions are active than may be.
    #[must_use]
    pub fn has_room(&self, report: &AlarmReport) -> bool {
        let begins = matches!(report.level, AlarmLevel::Warning | AlarmLevel::Fault);
        let mut code = report.code.clone();
        shorten(&mut code, CODE_BYTES);
        !begins || self.has_room_for(&code)
    }

    fn has_room_for(&self, code: &str) -> bool {
        self.active.len() < ACTIVE_LIMIT || self.active.contains_key(code)
    }

    /// A report with words and codes of bounded length.
    fn bounded(&self, mut report: AlarmReport) -> AlarmReport {
        for code in [
            &mut report.code,
            &mut report.severity,
            &mut report.qualifier,
        ] {
            shorten(code, CODE_BYTES);
        }
        let others = self.active.iter();
        let others = others.filter(|(code, _)| **code != report.code);
        let kept: usize = others.map(|(_, active)| active.report.text.len()).sum();
        let room = ITEM_BYTES.saturating_sub(kept);
        shorten(&mut report.text, room.clamp(LEAST_BYTES, TEXT_BYTES));
        report
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
        AlarmState {
            severity,
            words: self.words(),
            active: self.active.len(),
        }
    }

    fn words(&self) -> String {
        let mut all = String::new();
        let mut n_left = 0;
        for active in self.active.values() {
            let words = words(&active.report);
            if all.len() + words.len() > STATE_BYTES {
                n_left += 1;
                continue;
            }
            if !all.is_empty() {
                all.push_str("; ");
            }
            all.push_str(&words);
        }
        match (self.active.is_empty(), n_left) {
            (true, _) => "normal".to_owned(),
            (false, 0) => all,
            (false, n_left) => {
                format!(
                    "{all}; {n_left} more conditions, whose words are longer than a message holds"
                )
            }
        }
    }
}

/// Shortens a text to so many bytes, with a note.
fn shorten(text: &mut String, limit: usize) {
    let length = text.len();
    if length > limit {
        let mut ends = (0..=limit).rev();
        let end = ends.find(|at| text.is_char_boundary(*at)).unwrap_or(0);
        *text = format!("{} [cut: {length} bytes, limit {limit}]", &text[..end]);
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

    /// A message holds a sentence of 64 KiB.
    #[test]
    fn words_of_any_length_are_cut_to_what_a_message_holds_and_that_is_told() {
        let long = |code: &str, bytes: usize| AlarmReport {
            text: "ö".repeat(bytes / 2),
            ..report(AlarmLevel::Fault, code)
        };
        let mut alarms = Alarms::default();
        let state = alarms.hear(at(1), long("1", 1_000_000)).unwrap();
        let words = &state.words;
        assert!(words.starts_with("FAULT 1: öö"), "{:.40}", words);
        assert!(words.ends_with("ö [cut: 1000000 bytes, limit 16384]"));
        let told_again = alarms.hear(at(2), long("1", 1_000_000));
        assert_eq!(told_again, None);
        // Many of them, each with a code of a megabyte besides.
        for k in 0..ACTIVE_LIMIT {
            let code = format!("{k}{}", "9".repeat(1_000_000 + k));
            let _ = alarms.hear(at(3), long(&code, 100_000));
        }
        let state = alarms.state();
        assert_eq!(state.active, ACTIVE_LIMIT);
        assert!(state.words.len() < 64 * 1024, "{}", state.words.len());
        assert!(state.words.ends_with("longer than a message holds"));
        let kept: usize = alarms
            .active
            .values()
            .map(|one| one.report.text.len())
            .sum();
        assert!(kept < 128 * 1024, "{kept}");
        // What is short is whole.
        let mut alarms = Alarms::default();
        let state = alarms.hear(at(1), long("2", 16_000)).unwrap();
        assert_eq!(state.words.len(), "FAULT 2: ".len() + 16_000);
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
