//! What a reader has taken, and what it has left out, by reason.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use metrology::stamp::{Host, Span, Stamp};

use crate::values::UNMAPPED_LIMIT;

/// How often something was left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Left {
    /// How often.
    pub count: u64,
    /// The log's line that had it first; 0: not of a log.
    pub first_line: usize,
}

impl Left {
    /// Notes one more.
    pub const fn note(&mut self, line: usize) {
        self.note_many(1, line);
    }

    /// Notes so many more.
    pub const fn note_many(&mut self, n: u64, line: usize) {
        if self.count == 0 {
            self.first_line = line;
        }
        // Numbers of an agent reach to the greatest.
        self.count = self.count.saturating_add(n);
    }
}

/// The account of a log or a connection.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Account {
    /// Lines that were taken; of an agent, answers.
    pub lines: u64,
    /// Whether it is of an agent.
    pub is_of_agent: bool,
    /// Values and conditions of the mapping that were published.
    pub told: u64,
    /// Values whose key is not in the mapping.
    pub unmapped: u64,
    /// The first keys that are not in the mapping, at most [`UNMAPPED_LIMIT`].
    pub keys: BTreeSet<String>,
    /// Assets, which are not read here.
    pub assets: u64,
    /// Invalid letters that were replaced.
    pub replaced: u64,
    /// What was left out or taken otherwise than it was written.
    pub left: BTreeMap<&'static str, Left>,
}

impl Account {
    /// Notes that something was left out.
    pub fn leave(&mut self, reason: &'static str, line: usize) {
        self.leave_many(reason, 1, line);
    }

    /// Notes that so many were left out.
    pub fn leave_many(&mut self, reason: &'static str, n: u64, line: usize) {
        if n > 0 {
            self.left.entry(reason).or_default().note_many(n, line);
        }
    }

    /// Notes a value whose key is not in the mapping.
    pub fn pass_over(&mut self, key: &str) {
        self.unmapped += 1;
        if self.keys.len() < UNMAPPED_LIMIT && !self.keys.contains(key) {
            self.keys.insert(key.to_owned());
        }
    }

    /// Whether everything with a meaning here was published.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.left.is_empty() && self.replaced == 0
    }
}

impl fmt::Display for Account {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (lines, told) = (self.lines, self.told);
        let noun = if self.is_of_agent { "answers" } else { "lines" };
        write!(f, "{lines} {noun} taken, {told} values published")?;
        let counts = [
            (self.unmapped, "values of keys that are not in the mapping"),
            (self.assets, "assets"),
            (
                self.replaced,
                "letters replaced that were no UTF-8 or may not stand there",
            ),
        ];
        for (count, what) in counts {
            if count > 0 {
                write!(f, "; {count} {what}")?;
            }
        }
        for (reason, left) in &self.left {
            write!(f, "; {} {reason}", left.count)?;
            if left.first_line > 0 {
                write!(f, " (first in line {})", left.first_line)?;
            }
        }
        if self.told == 0 {
            write!(f, "; {}", self.nothing())?;
        }
        Ok(())
    }
}

impl Account {
    /// Why nothing was published.
    fn nothing(&self) -> String {
        let keys: Vec<&str> = self.keys.iter().map(String::as_str).collect();
        let keys = match keys.len() {
            0 => return "nothing is published: no key with a value was read".to_owned(),
            UNMAPPED_LIMIT.. => format!("{} and perhaps more", keys.join(", ")),
            _ => keys.join(", "),
        };
        format!(
            "nothing is published: the mapping has none of the keys {keys}; name them in map_file"
        )
    }
}

/// The account of a connection is reported again this long after the last report, where it has changed.
const PERIOD: Span = Span::from_nanos(60_000_000_000);

/// When an account is reported.
#[derive(Clone, Debug, Default)]
pub struct Reporting {
    told: Option<(Stamp<Host>, Account)>,
}

impl Reporting {
    /// Whether it is time to look.
    #[must_use]
    pub fn is_due(&self, at: Stamp<Host>) -> bool {
        let told = self.told.as_ref();
        told.is_none_or(|(told_at, _)| at - *told_at >= PERIOD)
    }

    /// Takes what is reported at `at` where it is not what was reported before; whether it is.
    pub fn is_news(&mut self, at: Stamp<Host>, account: &Account) -> bool {
        let is_news = self.told.as_ref().is_none_or(|(_, told)| told != account);
        self.told = Some((at, account.clone()));
        is_news
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_account_says_what_was_taken_and_what_was_not_and_where_first() {
        let mut account = Account {
            lines: 12,
            told: 9,
            ..Account::default()
        };
        assert_eq!(account.to_string(), "12 lines taken, 9 values published");
        assert!(account.is_whole());
        account.unmapped = 3;
        account.leave("lines without a bar", 7);
        account.leave("lines without a bar", 9);
        let words = "12 lines taken, 9 values published; 3 values of keys that are not in the mapping; 2 lines without a bar (first in line 7)";
        assert_eq!(account.to_string(), words);
        assert!(!account.is_whole());
    }
}
