//! Conditions in force.

use metrology::stamp::{Host, Stamp};
use serde_json::{Value, json};

use super::{Page, keep, ms, short};

/// A condition from `/diagnostics`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Condition {
    /// Node and condition.
    pub name: String,
    /// 0: over; 1: a warning; 2: an error; 3: stale.
    pub level: u8,
    /// Text of the condition.
    pub message: String,
}

/// A condition in force.
#[derive(Clone, Debug)]
pub(super) struct ConditionState {
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
    pub(super) fn take_condition(&mut self, at: Stamp<Host>, condition: Condition) {
        let (name, level) = (short(&condition.name), condition.level);
        if level == 0 {
            self.conditions.remove(&name);
            return;
        }
        let since = self.conditions.get(&name).map_or(at, |state| state.since);
        let message = short(&condition.message);
        let state = ConditionState {
            since,
            level,
            message,
        };
        keep(&mut self.conditions, &mut self.left_out, name, state);
    }

    /// The worst first; an empty list is shown too.
    pub(super) fn conditions_part(&self) -> Value {
        let mut all: Vec<_> = self.conditions.iter().collect();
        all.sort_by_key(|(_, state)| std::cmp::Reverse(state.level));
        let one = |(name, state): (&String, &ConditionState)| {
            json!({
                "name": name,
                "level": word(state.level),
                "message": state.message,
                "since_ms": ms(state.since),
            })
        };
        all.into_iter().map(one).collect()
    }
}
