//! Conditions that stand.

use metrology::stamp::{Host, Stamp};
use serde_json::{Value, json};

use super::{MOST_CONDITIONS, Page, ms, short};

/// A condition as `/diagnostics` has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Condition {
    /// Node and condition.
    pub name: String,
    /// 0: it is over; 1: a warning; 2: an error; 3: stale.
    pub level: u8,
    /// In words.
    pub message: String,
}

/// A condition that stands.
#[derive(Clone, Debug)]
pub(super) struct Standing {
    since: Stamp<Host>,
    level: u8,
    message: String,
}

const fn word(level: u8) -> &'static str {
    match level {
        0 => "ok",
        1 => "warning",
        2 => "error",
        _ => "stale",
    }
}

impl Page {
    pub(super) fn hear_condition(&mut self, at: Stamp<Host>, condition: Condition) {
        let Condition {
            name,
            level,
            message,
        } = condition;
        let (name, message) = (short(&name), short(&message));
        if level == 0 {
            self.conditions.remove(&name);
        } else if let Some(standing) = self.conditions.get_mut(&name) {
            (standing.level, standing.message) = (level, message);
        } else if self.conditions.len() >= MOST_CONDITIONS {
            self.left_out = self.left_out.saturating_add(1);
        } else {
            let since = at;
            let standing = Standing {
                since,
                level,
                message,
            };
            self.conditions.insert(name, standing);
        }
    }

    /// The worst first; an empty list is shown too, for it is good news.
    pub(super) fn conditions_part(&self) -> Value {
        let mut all: Vec<_> = self.conditions.iter().collect();
        all.sort_by_key(|(_, standing)| std::cmp::Reverse(standing.level));
        let one = |(name, standing): (&String, &Standing)| {
            json!({
                "name": name,
                "level": word(standing.level),
                "message": standing.message,
                "since_ms": ms(standing.since),
            })
        };
        all.into_iter().map(one).collect()
    }
}
