//! What is wrong with a message, naming the message, the field, the value and the limit.

use std::fmt;

use metrology::Axis;
use metrology::number::number;

/// Where in a field a value stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The field holds one value.
    Whole,
    /// The entry of an axis.
    Axis(Axis),
    /// The entry with this number, from 0.
    Entry(usize),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole => Ok(()),
            Self::Axis(axis) => write!(f, "[{axis}]"),
            Self::Entry(idx) => write!(f, "[{idx}]"),
        }
    }
}

/// Why a message cannot be used, as it is counted: one of few, whatever the message's values are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Defect {
    /// The bytes are no plain CDR.
    Encoding,
    /// They are not those of this type: they end early, go on after the end, or hold a bad boolean or text.
    Malformed,
    /// NaN or an infinity where a number is needed.
    NotFinite,
    /// An instant that no clock of Abbe shows.
    Stamp,
    /// A value, a length or a name that may not stand there, or two that contradict each other.
    OutOfRange,
}

impl Defect {
    /// The defect for machines, snake case.
    #[must_use]
    pub const fn id(self) -> &'static str {
        match self {
            Self::Encoding => "encoding",
            Self::Malformed => "malformed",
            Self::NotFinite => "not_finite",
            Self::Stamp => "stamp",
            Self::OutOfRange => "out_of_range",
        }
    }

    /// The defect for people.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Encoding => "no plain CDR",
            Self::Malformed => "malformed",
            Self::NotFinite => "not finite",
            Self::Stamp => "stamp out of range",
            Self::OutOfRange => "value out of range",
        }
    }
}

/// Bytes that are no message, or a message that says nothing.
#[derive(Debug, thiserror::Error)]
pub enum WireError {
    /// Fewer bytes than the encapsulation header has.
    #[error("{message}: {len} bytes: the encapsulation header alone has {needed}")]
    NoHeader {
        /// Type name of the message.
        message: &'static str,
        /// Bytes there are.
        len: usize,
        /// Bytes of the header.
        needed: usize,
    },
    /// Neither big- nor little-endian plain CDR.
    #[error("{message}: encapsulation {kind:#06x}: must be 0x0000 or 0x0001 (plain CDR)")]
    UnknownEncapsulation {
        /// Type name of the message.
        message: &'static str,
        /// First two bytes, big endian.
        kind: u16,
    },
    /// The bytes are not those of this type.
    #[error("{message}: malformed at byte {at_byte} of {len}: {source}")]
    Malformed {
        /// Type name of the message.
        message: &'static str,
        /// Bytes read until then, header included.
        at_byte: usize,
        /// Bytes there are.
        len: usize,
        /// What was found.
        source: cdr_encoding::Error,
    },
    /// More bytes than the type has, beyond padding: probably another type.
    #[error("{message}: {excess} bytes after the end: at most {limit} may pad it")]
    TooLong {
        /// Type name of the message.
        message: &'static str,
        /// Bytes after the last field.
        excess: usize,
        /// Most that may follow.
        limit: usize,
    },
    /// An array is not as long as the list of axes.
    #[error("{message}: {field}: {len} entries for {axes} axes")]
    LengthDiffers {
        /// Type name of the message.
        message: &'static str,
        /// Field.
        field: &'static str,
        /// Entries of the field.
        len: usize,
        /// Entries of `axis`.
        axes: usize,
    },
    /// An array of another length than its neighbours ask for.
    #[error("{message}: {field}: {len} entries: must be {needed}")]
    WrongLength {
        /// Type name of the message.
        message: &'static str,
        /// Field.
        field: &'static str,
        /// Entries there are.
        len: usize,
        /// Entries there must be.
        needed: usize,
    },
    /// More entries, or a longer text, than anybody means.
    #[error("{message}: {field}: {n} {what}: at most {greatest}")]
    TooMany {
        /// Type name of the message.
        message: &'static str,
        /// Field.
        field: &'static str,
        /// How many there are.
        n: usize,
        /// Of what.
        what: &'static str,
        /// How many there may be.
        greatest: usize,
    },
    /// A name that is no error component.
    #[error("{message}: component \"{name}\": must be an ISO 230-1 name such as EXX or EC0Y")]
    UnknownComponent {
        /// Type name of the message.
        message: &'static str,
        /// What was there.
        name: String,
    },
    /// A combination of coefficients that the model does not have.
    #[error("{message}: coefficient{place}: {value}: the model has {len}")]
    NoSuchCoefficient {
        /// Type name of the message.
        message: &'static str,
        /// Where in the field.
        place: Place,
        /// What was there.
        value: u32,
        /// Coefficients of the model.
        len: usize,
    },
    /// A name that is no axis.
    #[error("{message}: {field}[{idx}]: axis \"{name}\": must be one of {allowed}")]
    UnknownAxis {
        /// Type name of the message.
        message: &'static str,
        /// Field.
        field: &'static str,
        /// Entry, from 0.
        idx: usize,
        /// What was there.
        name: String,
        /// The letters that may stand there.
        allowed: &'static str,
    },
    /// An axis twice.
    #[error("{message}: {field}: axis {axis} appears twice")]
    DuplicateAxis {
        /// Type name of the message.
        message: &'static str,
        /// Field.
        field: &'static str,
        /// The axis.
        axis: Axis,
    },
    /// A number that is none of the message's constants.
    #[error("{message}: {field}{place}: value {value}: must be 0 to {greatest}")]
    UnknownValue {
        /// Type name of the message.
        message: &'static str,
        /// Field.
        field: &'static str,
        /// Where in the field.
        place: Place,
        /// What was there.
        value: u8,
        /// The greatest constant.
        greatest: u8,
    },
    /// NaN or infinite where the message gives that no meaning.
    #[error("{message}: {field}{place}: {value}: must be {allowed}", value = number(*value))]
    NotFinite {
        /// Type name of the message.
        message: &'static str,
        /// Field.
        field: &'static str,
        /// Where in the field.
        place: Place,
        /// NaN or an infinity.
        value: f64,
        /// What may stand there.
        allowed: &'static str,
    },
    /// A finite number that no machine has.
    #[error("{message}: {field}{place}: {value}: at most {greatest} in magnitude", value = number(*value), greatest = number(*greatest))]
    TooLarge {
        /// Type name of the message.
        message: &'static str,
        /// Field.
        field: &'static str,
        /// Where in the field.
        place: Place,
        /// What stands there, in the field's unit.
        value: f64,
        /// The limit.
        greatest: f64,
    },
    /// A number that the quantity of its field never has.
    #[error("{message}: {field}: {source}")]
    Quantity {
        /// Type name of the message.
        message: &'static str,
        /// Field.
        field: &'static str,
        /// Value and range.
        source: metrology::BoundError,
    },
    /// Two fields of one message that cannot both be true.
    #[error("{message}: {field} is {value} but {other} is {other_value}")]
    Contradiction {
        /// Type name of the message.
        message: &'static str,
        /// Field.
        field: &'static str,
        /// Its value.
        value: bool,
        /// The other field.
        other: &'static str,
        /// Its value.
        other_value: u8,
    },
    /// An instant that no clock of Abbe shows.
    #[error(
        "{message}: {field}{place}: stamp {sec} s {nanosec} ns: must be 0 to 4294967295 s (1970 to 2106) and below 1000000000 ns"
    )]
    StampOutOfRange {
        /// Type name of the message.
        message: &'static str,
        /// Field.
        field: &'static str,
        /// Where in the field.
        place: Place,
        /// Seconds.
        sec: u32,
        /// Nanoseconds.
        nanosec: u32,
    },
    /// A name that ROS 2 would not take.
    #[error(
        "topic \"{base}{name}\": \"{name}\" must begin with a letter or underscore and hold only letters, digits and single underscores"
    )]
    BadTopicName {
        /// What stands before it.
        base: &'static str,
        /// What was given.
        name: String,
    },
}

impl WireError {
    /// Why the message cannot be used, as it is counted.
    #[must_use]
    pub const fn defect(&self) -> Defect {
        match self {
            Self::NoHeader { .. } | Self::UnknownEncapsulation { .. } => Defect::Encoding,
            Self::Malformed { .. } | Self::TooLong { .. } => Defect::Malformed,
            Self::NotFinite { .. } => Defect::NotFinite,
            Self::StampOutOfRange { .. } => Defect::Stamp,
            _ => Defect::OutOfRange,
        }
    }
}
