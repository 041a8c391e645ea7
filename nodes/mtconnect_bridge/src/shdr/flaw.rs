//! What can be wrong with a line; what else stands in it is read.

/// Why a line, or a part of it, cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Flaw {
    /// There is no bar in it.
    #[error("no bar in it: left out")]
    NoFields,
    /// The stamp is invalid.
    #[error(
        "stamp {text:?}: must be a date of 1970 to 2106, milliseconds or empty; published with the time of receipt, in a log with the stamp of the line beside it"
    )]
    Stamp {
        /// What stands there.
        text: String,
    },
    /// A key without what belongs to it.
    #[error("key {key:?}: {fields} fields behind it, needs {needed}: taken as not known")]
    Fields {
        /// Key.
        key: String,
        /// Fields behind it.
        fields: usize,
        /// Fields that it needs.
        needed: usize,
    },
    /// An unknown level.
    #[error(
        "key {key:?}: level {level:?}: must be NORMAL, WARNING, FAULT or UNAVAILABLE: left out"
    )]
    Level {
        /// Key.
        key: String,
        /// What stands there.
        level: String,
    },
    /// A time series with invalid numbers, or not as many as it states.
    #[error("key {key:?}: time series of {count:?} values, with other values or rate: left out")]
    Series {
        /// Key.
        key: String,
        /// How many it says.
        count: String,
    },
    /// Fields behind a condition, message or series, which SHDR 1 lets go.
    #[error(
        "{fields} fields behind those of {key:?} left out: a bar in its text, or `* shdrVersion: 2` is missing"
    )]
    Behind {
        /// The key whose fields came before.
        key: String,
        /// How many.
        fields: usize,
    },
    /// A quote that opens a field and does not end.
    #[error(
        "field {field} opens a quote that does not end: read up to the next bar, what follows may be read as other fields"
    )]
    Quote {
        /// Which field, the stamp being the first.
        field: usize,
    },
    /// A value whose key is empty.
    #[error("value {value:?} without a key: left out")]
    Key {
        /// The value.
        value: String,
    },
    /// A line over the limit.
    #[error("line of {length} bytes refused, limit {limit}: left out")]
    TooLong {
        /// Its length.
        length: usize,
        /// The limit.
        limit: usize,
    },
    /// A line that the end of its connection has cut.
    #[error("line cut after {bytes} bytes by the end of the connection: left out")]
    Cut {
        /// Its bytes so far.
        bytes: usize,
    },
    /// A block of several lines without its end.
    #[error("block {mark:?} without its end after {lines} lines: left out")]
    Block {
        /// Its mark.
        mark: String,
        /// Lines so far.
        lines: usize,
    },
}

impl Flaw {
    /// What of the line it is, for an account.
    #[must_use]
    pub const fn reason(&self) -> &'static str {
        match self {
            Self::NoFields => "lines without a bar",
            Self::Stamp { .. } => "stamps that are none",
            Self::Fields { .. } => "keys without a value",
            Self::Level { .. } => "levels that are none",
            Self::Series { .. } => "time series that are none",
            Self::Behind { .. } => "fields behind a condition",
            Self::Quote { .. } => "quotes that do not end",
            Self::Key { .. } => "values without a key",
            Self::TooLong { .. } => "lines over the limit",
            Self::Cut { .. } => "lines cut by the end of the connection",
            Self::Block { .. } => "blocks without their end",
        }
    }
}
