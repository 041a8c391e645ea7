//! Conditions worth reporting, each with the values that belong to it.

use chrono::{DateTime, SecondsFormat};
use metrology::Severity;
use metrology::stamp::{Clock, Stamp};

use crate::alarm::AlarmState;
use crate::document::DocumentFlaw;
use crate::multipart::PartFlaw;
use crate::shdr::Flaw;

/// A stamp as a person reads it, UTC.
#[must_use]
pub fn words<C: Clock>(stamp: Stamp<C>) -> String {
    DateTime::from_timestamp_nanos(stamp.nanos()).to_rfc3339_opts(SecondsFormat::AutoSi, true)
}

/// Why there is no connection.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Lost {
    /// Nobody listens.
    #[error("nobody listens: {reason}")]
    NotConnected {
        /// The system's word for it.
        reason: String,
    },
    /// The other side ended it.
    #[error("closed: {reason}")]
    Closed {
        /// The system's word for it.
        reason: String,
    },
    /// Nothing has come.
    #[error("silent for more than {limit_s} s")]
    Silent {
        /// The limit, s.
        limit_s: f64,
    },
    /// An agent answers with another status.
    #[error("{path}: HTTP status {status}")]
    Status {
        /// What was asked.
        path: String,
        /// What it answered.
        status: u16,
    },
    /// An agent's answer is none.
    #[error("{path}: {flaw}")]
    Document {
        /// What was asked.
        path: String,
        /// Why.
        flaw: DocumentFlaw,
    },
    /// An agent's answer belongs to another question.
    #[error("{path}: an answer to another question")]
    AnotherAnswer {
        /// What was asked.
        path: String,
    },
    /// An agent refuses.
    #[error("{path}: {code}: {text}")]
    Refused {
        /// What was asked.
        path: String,
        /// The agent's code.
        code: String,
        /// Its words.
        text: String,
    },
    /// The parts of an answer cannot be told from each other.
    #[error("parts of the answer: {0}")]
    Parts(PartFlaw),
}

/// A condition of the bridge or of the machine.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Condition {
    /// The connection stands.
    #[error("connected to {address}")]
    Connected {
        /// Whom.
        address: String,
    },
    /// The connection does not stand; it is tried again.
    #[error("not connected to {address}: {lost}; next attempt in {retry_s} s")]
    Disconnected {
        /// Whom.
        address: String,
        /// Why.
        lost: Lost,
        /// Time to the next attempt, s.
        retry_s: f64,
    },
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
        "{value} at {at} between {before} and {after} cannot be: at most {allowed} may lie between two; {count} so far"
    )]
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
    #[error("{key}: the stamp went back by {by_s} s, to {to}; {count} so far")]
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
    /// A line cannot be read.
    #[error("line refused: {flaw}; {count} so far")]
    Malformed {
        /// Why.
        flaw: Flaw,
        /// How many there were.
        count: u64,
    },
    /// A line is too long.
    #[error("line of {length} bytes refused, limit {limit}; {count} so far")]
    LineTooLong {
        /// Its length.
        length: usize,
        /// The limit.
        limit: usize,
        /// How many lines were refused.
        count: u64,
    },
    /// A line is no text.
    #[error("line of {length} bytes refused: no UTF-8; {count} so far")]
    NotText {
        /// Its length.
        length: usize,
        /// How many lines were refused.
        count: u64,
    },
    /// A value is no number where one must be.
    #[error("{key}: {text:?} is not {wanted} finite numbers; {count} so far")]
    NotNumbers {
        /// Which value.
        key: String,
        /// What was told.
        text: String,
        /// How many numbers it must have.
        wanted: usize,
        /// How many there were.
        count: u64,
    },
    /// Observations of an answer cannot be read.
    #[error("{count} observations of an answer have no number, stamp, key or value")]
    MalformedObservations {
        /// How many.
        count: usize,
    },
    /// The machine tells something that the mapping does not have.
    #[error("told, and not in the mapping: {keys}")]
    Unmapped {
        /// Keys, and how many more.
        keys: String,
    },
    /// The mapping has something that the agent does not have.
    #[error("in the mapping, and the agent has it not: {keys}")]
    NotOffered {
        /// Keys.
        keys: String,
    },
    /// All of the mapping is there.
    #[error("the agent has all of the mapping")]
    Offered,
    /// Observations were lost.
    #[error("{lost} observations lost between {from} and {to}; {total} so far")]
    SequenceGap {
        /// First number that was lost.
        from: u64,
        /// First number that came again.
        to: u64,
        /// How many.
        lost: u64,
        /// How many in all.
        total: u64,
    },
    /// The agent has started anew.
    #[error("the agent started anew: instance {now}, was {before}")]
    AgentRestarted {
        /// Instance before.
        before: u64,
        /// Instance now.
        now: u64,
    },
    /// Axes of which only the actual position is told.
    #[error("no commanded position of {axes}: `commanded` of axes/state repeats the actual one")]
    Uncommanded {
        /// Letters.
        axes: String,
    },
}

impl Condition {
    /// Which condition it is; the same name with [`Severity::Info`] clears it.
    #[must_use]
    pub fn name(&self) -> String {
        let plain = match self {
            Self::Connected { .. } | Self::Disconnected { .. } => "connection",
            Self::Absent { name, .. } | Self::Present { name } => {
                return format!("unavailable/{name}");
            }
            Self::Impossible { name, .. } => return format!("impossible/{name}"),
            Self::Unconfirmed { name, .. } => return format!("unconfirmed/{name}"),
            Self::Alarm { name, .. } => return format!("alarm/{name}"),
            Self::ClockBack { .. } => "machine_clock",
            Self::Malformed { .. } | Self::LineTooLong { .. } | Self::NotText { .. } => {
                "refused_line"
            }
            Self::NotNumbers { .. } | Self::MalformedObservations { .. } => "refused_value",
            Self::Unmapped { .. } => "unmapped",
            Self::NotOffered { .. } | Self::Offered => "not_offered",
            Self::SequenceGap { .. } => "sequence_gap",
            Self::AgentRestarted { .. } => "agent_restarted",
            Self::Uncommanded { .. } => "uncommanded",
        };
        plain.to_owned()
    }

    /// How bad it is.
    #[must_use]
    pub const fn severity(&self) -> Severity {
        match self {
            Self::Connected { .. }
            | Self::Present { .. }
            | Self::Offered
            | Self::Unmapped { .. }
            | Self::Uncommanded { .. } => Severity::Info,
            Self::Alarm { state, .. } => state.severity,
            Self::Disconnected { .. } | Self::SequenceGap { .. } => Severity::Error,
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
            | Self::Malformed { count, .. }
            | Self::LineTooLong { count, .. }
            | Self::NotText { count, .. }
            | Self::NotNumbers { count, .. } => Some(*count),
            Self::SequenceGap { total, .. } => Some(*total),
            _ => None,
        }
    }
}
