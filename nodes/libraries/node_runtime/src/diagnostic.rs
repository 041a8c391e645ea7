//! A condition worth reporting, on its way to `/diagnostics`, the log and the bag.

use std::borrow::Cow;

use abbe_msgs::diagnostic_msgs::msg::{DiagnosticStatus, KeyValue};
use metrology::Severity;

/// Severity, with the values of `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// As it should be.
    Ok = 0,
    /// It goes on, but not as told.
    Warn = 1,
    /// Data is lost or a function has stopped.
    Error = 2,
    /// Nothing has been heard.
    Stale = 3,
}

impl From<Severity> for Level {
    fn from(severity: Severity) -> Self {
        match severity {
            Severity::Info => Self::Ok,
            Severity::Warn => Self::Warn,
            Severity::Error => Self::Error,
        }
    }
}

/// One condition of a node. It stays on `/diagnostics` until the same `name` is reported `Ok`.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// Severity.
    pub level: Level,
    /// Which condition, snake case, with what it is about where there are several, e.g.
    /// `model_stale` or `limited/X`; the node's name is put in front.
    pub name: Cow<'static, str>,
    /// One line with place, value, unit and limit.
    pub message: String,
    /// Values by name, unit in the name.
    pub values: Vec<(&'static str, String)>,
    /// Whether it stays on `/diagnostics` although it is `Ok`: a figure that people look for.
    pub stays: bool,
}

impl Diagnostic {
    /// A condition without values.
    #[must_use]
    pub fn new(level: Level, name: impl Into<Cow<'static, str>>, message: String) -> Self {
        Self {
            level,
            name: name.into(),
            message,
            values: Vec::new(),
            stays: false,
        }
    }

    /// The same with one more value.
    #[must_use]
    pub fn with(mut self, name: &'static str, value: impl ToString) -> Self {
        self.values.push((name, value.to_string()));
        self
    }

    /// The same, shown while it is `Ok` as well.
    #[must_use]
    pub fn staying(mut self) -> Self {
        self.stays = true;
        self
    }

    /// The condition as `node` reports it on `/diagnostics`.
    pub(crate) fn status(&self, node: &str) -> DiagnosticStatus {
        let value = |(key, value): &(&'static str, String)| KeyValue {
            key: (*key).to_owned(),
            value: value.clone(),
        };
        DiagnosticStatus {
            level: self.level as u8,
            name: format!("{node}: {}", self.name),
            message: self.message.clone(),
            hardware_id: String::new(),
            values: self.values.iter().map(value).collect(),
        }
    }
}
