//! Conditions worth reporting, each with the values that belong to it.

use machine_report::condition::place;
pub use machine_report::condition::{ValueCondition, words};
use metrology::Severity;
use metrology::number::number;

use crate::account::Account;
use crate::document::DocumentFlaw;
use crate::multipart::PartFlaw;
use crate::shdr::Flaw;

const fn at_least(is_all: bool) -> &'static str {
    if is_all { "" } else { "at least " }
}

/// Why there is no connection.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Lost {
    /// The connection is refused, or the answer is not HTTP or has no end.
    #[error("{reason}")]
    NotConnected {
        /// The reason that the system or the reader of HTTP gives.
        reason: String,
    },
    /// The other side ended it.
    #[error("closed: {reason}")]
    Closed {
        /// The reason that the system gives.
        reason: String,
    },
    /// Nothing has come.
    #[error("silent for more than {limit_s} s", limit_s = number(*limit_s))]
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
    /// Of a value.
    #[error(transparent)]
    Value(#[from] ValueCondition),
    /// The connection stands.
    #[error("connected to {address}")]
    Connected {
        /// Whom.
        address: String,
    },
    /// The connection does not stand; it is tried again.
    #[error("not connected to {address}: {lost}; next attempt in {retry_s} s", retry_s = number(*retry_s))]
    Disconnected {
        /// Whom.
        address: String,
        /// Why.
        lost: Lost,
        /// Time to the next attempt, s.
        retry_s: f64,
    },
    /// A log has been replayed.
    #[error("the log has been told: {account}")]
    LogEnded {
        /// What was taken and left out.
        account: Account,
    },
    /// The bridge ends before its log does.
    #[error("{}{lines} lines of the log were not replayed: the next one is due in {next_s} s; {account}", at_least(*is_all), next_s = number(*next_s))]
    LogLeft {
        /// How many.
        lines: usize,
        /// Whether there are none beyond these.
        is_all: bool,
        /// Time to the next of them, s.
        next_s: f64,
        /// What was taken and left out before.
        account: Account,
    },
    /// A log cannot be read on.
    #[error(
        "the log cannot be read from byte {at_byte} on: {reason}; what stands behind is not replayed"
    )]
    LogUnreadable {
        /// The reason that the system gives.
        reason: String,
        /// Bytes that were read before.
        at_byte: u64,
    },
    /// What was taken and left out of a connection.
    #[error("{account}")]
    Account {
        /// The account so far.
        account: Account,
    },
    /// Invalid letters were replaced.
    #[error(
        "{letters} letters that are no UTF-8 or may not stand there are replaced by U+FFFD; {count} so far"
    )]
    Replaced {
        /// How many in this line or answer.
        letters: usize,
        /// How many in all.
        count: u64,
    },
    /// The agent describes a value in another unit than the mapping.
    #[error(
        "{key}: the mapping has {mapped}, the agent's probe {offered}: told as the mapping says; correct the mapping or the agent's device file"
    )]
    UnitDiffers {
        /// Which value.
        key: String,
        /// The mapping's unit.
        mapped: &'static str,
        /// The agent's unit.
        offered: String,
    },
    /// The agent describes a value as the mapping does, after it did not.
    #[error("{key}: the agent's probe has the mapping's unit")]
    UnitAgrees {
        /// Which value.
        key: String,
    },
    /// Positions are in machine coordinates, after they were not.
    #[error("no position of the mapping is in work coordinates")]
    MachineCoordinates,
    /// Positions that a work offset moves.
    #[error(
        "positions in work coordinates, which every work offset moves: {keys}; map those in machine coordinates"
    )]
    WorkCoordinates {
        /// Keys.
        keys: String,
    },
    /// A line, or a part of it, cannot be read.
    #[error("{}{flaw}; {count} so far", place(*.line))]
    Malformed {
        /// Number of the log's line; 0: of a connection.
        line: usize,
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
    /// A part of an agent's stream cannot be read.
    #[error("{path}: a part is left out: {flaw}; {count} so far")]
    PartLeftOut {
        /// What was asked.
        path: String,
        /// Why.
        flaw: DocumentFlaw,
        /// How many parts were refused.
        count: u64,
    },
    /// Observations of an answer cannot be read.
    #[error(
        "{count} observations of an answer left out: no number, key or value, or a level that is none"
    )]
    MalformedObservations {
        /// How many.
        count: usize,
    },
    /// Observations of an answer without a stamp of 1970 to 2106.
    #[error(
        "{count} observations of an answer have no stamp of 1970 to 2106: published with the time of receipt"
    )]
    Unstamped {
        /// How many.
        count: usize,
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
    /// Numbers were lost that the agent gives to all of its devices, while one device is asked for.
    #[error(
        "the numbers from {from} to {to} of all the agent's devices were lost; how many observations of {device} are among them is not known: none is counted as lost, and what holds is asked again; {count} such gaps so far"
    )]
    DeviceGap {
        /// The device that is asked for.
        device: String,
        /// First number that was lost.
        from: u64,
        /// First number that came again.
        to: u64,
        /// How many gaps there were.
        count: u64,
    },
    /// The agent's numbers go back without another instance.
    #[error(
        "the agent's numbers go back from {from} to {to} while its instance stays: what holds is asked anew; {count} so far"
    )]
    SequenceBack {
        /// The number that was next.
        from: u64,
        /// The number that the agent says is next.
        to: u64,
        /// How many there were.
        count: u64,
    },
    /// The agent has started anew.
    #[error("the agent started anew: instance {now}, was {before}")]
    AgentRestarted {
        /// Instance before.
        before: u64,
        /// Instance now.
        now: u64,
    },
}

impl Condition {
    /// Which condition it is; the same name with [`Severity::Info`] clears it.
    #[must_use]
    pub fn name(&self) -> String {
        let plain = match self {
            Self::Connected { .. } | Self::Disconnected { .. } => "connection",
            Self::Value(condition) => return condition.name(),
            Self::UnitDiffers { key, .. } | Self::UnitAgrees { key } => {
                return format!("unit/{}", crate::mapping::name_of(key));
            }
            Self::Unstamped { .. } => "machine_clock",
            Self::LogEnded { .. } | Self::LogLeft { .. } => "log",
            Self::LogUnreadable { .. } => "log_unreadable",
            Self::Account { .. } => "account",
            Self::Replaced { .. } => "replaced_letters",
            Self::WorkCoordinates { .. } | Self::MachineCoordinates => "work_coordinates",
            Self::Malformed { .. } | Self::LineTooLong { .. } => "refused_line",
            Self::PartLeftOut { .. } => "refused_part",
            Self::MalformedObservations { .. } => "refused_value",
            Self::NotOffered { .. } | Self::Offered => "not_offered",
            Self::SequenceGap { .. } | Self::DeviceGap { .. } | Self::SequenceBack { .. } => {
                "sequence_gap"
            }
            Self::AgentRestarted { .. } => "agent_restarted",
        };
        plain.to_owned()
    }

    /// How bad it is.
    #[must_use]
    pub fn severity(&self) -> Severity {
        match self {
            Self::LogEnded { account } if account.is_whole() && account.told > 0 => Severity::Info,
            Self::Account { account } if account.is_whole() => Severity::Info,
            Self::Connected { .. }
            | Self::Offered
            | Self::UnitAgrees { .. }
            | Self::MachineCoordinates => Severity::Info,
            Self::Value(condition) => condition.severity(),
            Self::Disconnected { .. } | Self::SequenceGap { .. } | Self::LogUnreadable { .. } => {
                Severity::Error
            }
            _ => Severity::Warn,
        }
    }

    /// How many there were, where it counts.
    #[must_use]
    pub const fn count(&self) -> Option<u64> {
        match self {
            Self::Value(condition) => condition.count(),
            Self::Replaced { count, .. }
            | Self::Malformed { count, .. }
            | Self::LineTooLong { count, .. }
            | Self::PartLeftOut { count, .. }
            | Self::DeviceGap { count, .. }
            | Self::SequenceBack { count, .. } => Some(*count),
            Self::SequenceGap { total, .. } => Some(*total),
            _ => None,
        }
    }
}
