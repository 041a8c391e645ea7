//! Conditions worth reporting, each with the values that belong to it.

use machine_report::ValueCondition;
use machine_report::account::Account;
use machine_report::mapping::name_of;
use metrology::Severity;
use metrology::number::number;

use crate::status::{Quality, Status};

/// A condition of the bridge or of the machine.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Condition {
    /// Of a value.
    #[error(transparent)]
    Value(#[from] ValueCondition),
    /// The connection stands.
    #[error("connected to {endpoint}: {security}, user {user}")]
    Connected {
        /// Whom.
        endpoint: String,
        /// Policy and mode of the endpoint.
        security: String,
        /// As whom.
        user: String,
    },
    /// The connection does not stand; it is tried again.
    #[error("not connected to {endpoint}: {reason}; next attempt in {retry_s} s", retry_s = number(*retry_s))]
    Disconnected {
        /// Whom.
        endpoint: String,
        /// Why.
        reason: String,
        /// Time to the next attempt, s.
        retry_s: f64,
    },
    /// The connection is broken; the session may live on.
    #[error(
        "the connection to {endpoint} is broken: {reason}; the session is taken up again where the server keeps it"
    )]
    Broken {
        /// Whom.
        endpoint: String,
        /// Why.
        reason: String,
    },
    /// The connection was taken up again.
    #[error(
        "connected to {endpoint} again, in the same session; {count} messages of the break were sent again"
    )]
    Resumed {
        /// Whom.
        endpoint: String,
        /// Messages that the server had kept.
        count: u64,
    },
    /// No endpoint of the server is one that the parameters allow.
    #[error("{endpoint} is refused: {reason}; next attempt in {retry_s} s", retry_s = number(*retry_s))]
    Refused {
        /// Whom.
        endpoint: String,
        /// What was asked for, and what there is.
        reason: String,
        /// Time to the next attempt, s.
        retry_s: f64,
    },
    /// The quality of a value has changed.
    #[error("{status}; {count} values so far that were not good")]
    Quality {
        /// Which.
        name: String,
        /// Its status now.
        status: Status,
        /// How many values of this node were uncertain or bad.
        count: u64,
    },
    /// A value cannot be read.
    #[error("{key}: {what}: left out; {count} so far")]
    Unreadable {
        /// Key of the mapping.
        key: String,
        /// Why.
        what: String,
        /// How many there were.
        count: u64,
    },
    /// The mapping has nodes that the server does not have.
    #[error("in the mapping, and the server has it not: {keys}")]
    NotOffered {
        /// Keys with the reason, and how many more.
        keys: String,
    },
    /// All of the mapping is there.
    #[error("the server has all of the mapping")]
    Offered,
    /// The server shows a number in another unit than the mapping.
    #[error(
        "{key}: the mapping has {mapped}, the server's EngineeringUnits {offered}: published as the mapping says; correct the mapping or the server"
    )]
    UnitDiffers {
        /// Key of the mapping.
        key: String,
        /// The mapping's unit.
        mapped: &'static str,
        /// The server's unit.
        offered: String,
    },
    /// It does not any more.
    #[error("{key}: the server's EngineeringUnits are the mapping's unit")]
    UnitAgrees {
        /// Key of the mapping.
        key: String,
    },
    /// The server looks less often, or keeps less, than it was asked to.
    #[error(
        "asked to look every {asked_ms} ms and to keep {asked_queue} changes, the server looks every {given_ms} ms at some nodes and keeps {given_queue}",
        asked_ms = number(*asked_ms), given_ms = number(*given_ms)
    )]
    Revised {
        /// Sampling interval that was asked for, ms.
        asked_ms: f64,
        /// Longest that was granted, ms.
        given_ms: f64,
        /// Queue that was asked for.
        asked_queue: u32,
        /// Shortest that was granted.
        given_queue: u32,
    },
    /// The server does as it was asked.
    #[error("the server looks and keeps as it was asked")]
    AsAsked,
    /// Messages of the server were lost.
    #[error(
        "{lost} messages of the server lost, from number {from} on; {total} so far. Every node is read again; changes between are missing"
    )]
    SequenceGap {
        /// First number that was lost.
        from: u32,
        /// How many.
        lost: u64,
        /// How many in all.
        total: u64,
    },
    /// The server's queue of a node ran over.
    #[error(
        "{key}: the server's queue ran over, so changes are lost; {count} times so far: raise subscription.queue"
    )]
    Overflow {
        /// Key of the mapping.
        key: String,
        /// How often, of all nodes.
        count: u64,
    },
    /// More came than could be taken.
    #[error("{count} messages came faster than they could be taken: left out; {total} so far")]
    Dropped {
        /// How many.
        count: u64,
        /// How many in all.
        total: u64,
    },
    /// Values without a stamp of 1970 to 2106.
    #[error("{key}: no stamp of 1970 to 2106: published with the time of receipt; {count} so far")]
    Unstamped {
        /// Key of the mapping.
        key: String,
        /// How many there were.
        count: u64,
    },
    /// What was taken and left out.
    #[error("{account}")]
    Account {
        /// The account so far.
        account: Account,
    },
}

impl Condition {
    /// Which condition it is; the same name with [`Severity::Info`] clears it.
    #[must_use]
    pub fn name(&self) -> String {
        let plain = match self {
            Self::Value(condition) => return condition.name(),
            Self::Quality { name, .. } => return format!("quality/{name}"),
            Self::UnitDiffers { key, .. } | Self::UnitAgrees { key } => {
                return format!("unit/{}", name_of(key));
            }
            Self::Connected { .. }
            | Self::Disconnected { .. }
            | Self::Broken { .. }
            | Self::Resumed { .. }
            | Self::Refused { .. } => "connection",
            Self::Unreadable { .. } => "refused_value",
            Self::NotOffered { .. } | Self::Offered => "not_offered",
            Self::Revised { .. } | Self::AsAsked => "sampling",
            Self::SequenceGap { .. } | Self::Dropped { .. } => "sequence_gap",
            Self::Overflow { .. } => "queue_overflow",
            Self::Unstamped { .. } => "machine_clock",
            Self::Account { .. } => "account",
        };
        plain.to_owned()
    }

    /// How bad it is.
    #[must_use]
    pub fn severity(&self) -> Severity {
        match self {
            Self::Value(condition) => condition.severity(),
            Self::Account { account } if account.is_whole() => Severity::Info,
            Self::Quality { status, .. } if status.quality() == Quality::Good => Severity::Info,
            Self::Connected { .. }
            | Self::Resumed { .. }
            | Self::Offered
            | Self::UnitAgrees { .. }
            | Self::AsAsked => Severity::Info,
            Self::Disconnected { .. }
            | Self::Broken { .. }
            | Self::Refused { .. }
            | Self::SequenceGap { .. }
            | Self::Dropped { .. }
            | Self::Overflow { .. } => Severity::Error,
            _ => Severity::Warn,
        }
    }

    /// How many there were, where it counts.
    #[must_use]
    pub const fn count(&self) -> Option<u64> {
        match self {
            Self::Value(condition) => condition.count(),
            Self::Quality { count, .. }
            | Self::Unreadable { count, .. }
            | Self::Overflow { count, .. }
            | Self::Unstamped { count, .. } => Some(*count),
            Self::SequenceGap { total, .. } | Self::Dropped { total, .. } => Some(*total),
            _ => None,
        }
    }
}
