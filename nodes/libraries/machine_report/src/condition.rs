//! Conditions of values worth reporting, each with the numbers that belong to it.

use chrono::{DateTime, SecondsFormat};
use metrology::Severity;
use metrology::number::number;
use metrology::stamp::{Clock, Stamp};

use crate::alarm::AlarmState;
use crate::possible::Possible;

/// A stamp as a person reads it, UTC.
#[must_use]
pub fn words<C: Clock>(stamp: Stamp<C>) -> String {
    DateTime::from_timestamp_nanos(stamp.nanos()).to_rfc3339_opts(SecondsFormat::AutoSi, true)
}

/// Where something stood: a line of a log, or nothing for a connection's line 0.
#[must_use]
pub fn place(line: usize) -> String {
    match line {
        0 => String::new(),
        line => format!("log line {line}: "),
    }
}

fn behind(passed_s: Option<f64>) -> String {
    passed_s.map_or_else(
        || ": its lines go on without a pause".to_owned(),
        |passed_s| format!(", while {passed_s} s passed here"),
    )
}

fn are_none(wanted: usize) -> String {
    match wanted {
        1 => "is no finite number".to_owned(),
        wanted => format!("is not {wanted} finite numbers"),
    }
}

/// A condition of a value, an axis or a clock of the machine.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueCondition {
    /// A value is not known.
    #[error("unavailable since {since}")]
    Absent {
        /// Which.
        name: String,
        /// By the machine's clock, or the host's when the connection was lost.
        since: String,
    },
    /// It is known (again).
    #[error("known")]
    Present {
        /// Which.
        name: String,
    },
    /// A reading cannot be.
    #[error(
        "{value} at {at} between {before} and {after} cannot be: at most {allowed} may lie between two; {count} so far", allowed = number(*allowed))]
    Impossible {
        /// Which value.
        name: String,
        /// The reading, in the machine's words.
        value: String,
        /// The good reading before it.
        before: String,
        /// The good reading after it.
        after: String,
        /// Greatest change from the one before; inner unit.
        allowed: f64,
        /// When, by the machine.
        at: String,
        /// How many there were of this value.
        count: u64,
    },
    /// A reading that nothing confirms.
    #[error(
        "{value} at {at} differs from its one neighbour by more than it can change; {count} so far"
    )]
    Unconfirmed {
        /// Which value.
        name: String,
        /// The reading, in the machine's words.
        value: String,
        /// When, by the machine.
        at: String,
        /// How many there were of this value.
        count: u64,
    },
    /// A condition of the machine.
    #[error("{}", .state.words)]
    Alarm {
        /// Which.
        name: String,
        /// How it stands.
        state: AlarmState,
    },
    /// A stamp of a value lies before the one before.
    #[error("{key}: the stamp went back by {by_s} s, to {to}; {count} so far", by_s = number(*by_s))]
    ClockBack {
        /// Which value.
        key: String,
        /// By how much, s.
        by_s: f64,
        /// Where to.
        to: String,
        /// How many there were.
        count: u64,
    },
    /// The machine's clock leaps.
    #[error("the machine's clock leaps by {by_s} s, from {from} to {to}{}; {count} so far", behind(*passed_s), by_s = number(*by_s))]
    ClockLeap {
        /// The stamp before.
        from: String,
        /// The stamp behind.
        to: String,
        /// By how much, s.
        by_s: f64,
        /// Host's time between both, s; `None`: of a log, whose lines go on without the pause.
        passed_s: Option<f64>,
        /// How many there were.
        count: u64,
    },
    /// A value is longer than a message holds.
    #[error(
        "{}{key}: a value of {length} bytes, limit {limit}: left out; {count} so far",
        place(*.line)
    )]
    ValueTooLong {
        /// Number of the log's line; 0: of a connection.
        line: usize,
        /// Key of the value.
        key: String,
        /// Its length.
        length: usize,
        /// The limit.
        limit: usize,
        /// How many there were.
        count: u64,
    },
    /// A number beyond the range of its quantity.
    #[error("{}{key}: {text}: {possible}; {count} so far", place(*.line))]
    OutOfRange {
        /// Number of the log's line; 0: of a connection.
        line: usize,
        /// Key of the value.
        key: String,
        /// What was sent.
        text: String,
        /// What it would have to be.
        possible: Possible,
        /// Values refused so far.
        count: u64,
    },
    /// A value is no number where one must be.
    #[error("{}{key}: {text:?} {}; {count} so far", place(*.line), are_none(*.wanted))]
    NotNumbers {
        /// Number of the log's line; 0: of a connection.
        line: usize,
        /// Which value.
        key: String,
        /// What was reported.
        text: String,
        /// How many numbers it must have.
        wanted: usize,
        /// How many there were.
        count: u64,
    },
    /// The machine reports something that the mapping does not have.
    #[error("reported, and not in the mapping: {keys}")]
    Unmapped {
        /// Keys, and how many more.
        keys: String,
    },
    /// Axes of which only the actual position is reported.
    #[error("no commanded position of {axes}: `commanded` of axes/state repeats the actual one")]
    Uncommanded {
        /// Letters.
        axes: String,
    },
    /// The bridge was stopped while values waited to be handed on.
    #[error(
        "{count} values and conditions were heard and not handed on when the bridge was stopped"
    )]
    LeftWaiting {
        /// How many.
        count: usize,
    },
}

impl ValueCondition {
    /// Which condition it is; the same name with [`Severity::Info`] clears it.
    #[must_use]
    pub fn name(&self) -> String {
        let plain = match self {
            Self::Absent { name, .. } | Self::Present { name } => {
                return format!("unavailable/{name}");
            }
            Self::Impossible { name, .. } => return format!("impossible/{name}"),
            Self::Unconfirmed { name, .. } => return format!("unconfirmed/{name}"),
            Self::Alarm { name, .. } => return format!("alarm/{name}"),
            Self::ClockBack { .. } | Self::ClockLeap { .. } => "machine_clock",
            Self::NotNumbers { .. } | Self::ValueTooLong { .. } | Self::OutOfRange { .. } => {
                "refused_value"
            }
            Self::Unmapped { .. } => "unmapped",
            Self::Uncommanded { .. } => "uncommanded",
            Self::LeftWaiting { .. } => "left_waiting",
        };
        plain.to_owned()
    }

    /// How bad it is.
    #[must_use]
    pub const fn severity(&self) -> Severity {
        match self {
            Self::Present { .. } | Self::Unmapped { .. } | Self::Uncommanded { .. } => {
                Severity::Info
            }
            Self::Alarm { state, .. } => state.severity,
            _ => Severity::Warn,
        }
    }

    /// How many there were, where it counts.
    #[must_use]
    pub const fn count(&self) -> Option<u64> {
        match self {
            Self::Impossible { count, .. }
            | Self::Unconfirmed { count, .. }
            | Self::ClockBack { count, .. }
            | Self::ClockLeap { count, .. }
            | Self::ValueTooLong { count, .. }
            | Self::NotNumbers { count, .. }
            | Self::OutOfRange { count, .. } => Some(*count),
            _ => None,
        }
    }
}
