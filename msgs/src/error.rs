//! What is wrong with a message, naming the message, the field, the value and the limit.

use std::fmt;

use metrology::Axis;

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
    #[error("{message}: {field}{place}: {value}: must be {allowed}")]
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
        "{message}: {field}{place}: stamp {sec} s {nanosec} ns: must be 0 to 2147483647 s and below 1000000000 ns"
    )]
    StampOutOfRange {
        /// Type name of the message.
        message: &'static str,
        /// Field.
        field: &'static str,
        /// Where in the field.
        place: Place,
        /// Seconds.
        sec: i32,
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
