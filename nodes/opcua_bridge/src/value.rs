//! Values of nodes, and the text that the mapping reads.

use metrology::stamp::{Machine, Stamp};

use crate::status::Status;

/// Elements of an array in one value at most; more is no position.
pub const ARRAY_LIMIT: usize = 64;

/// What a node holds, of the types that have a meaning here.
#[derive(Clone, Debug, PartialEq)]
pub enum Payload {
    /// No value.
    Null,
    /// A truth value.
    Boolean(bool),
    /// A number of any of the integer types, and of an enumeration.
    Integer(i128),
    /// A `Float`; it is read by its shortest decimal form.
    Float(f32),
    /// A `Double`.
    Double(f64),
    /// A text of any kind.
    Text(String),
    /// An array of numbers, row by row.
    Numbers(Vec<f64>),
    /// Of a type that has no meaning here, or larger than the limit: which.
    Refused(String),
}

impl Payload {
    /// The text that the mapping reads; `None`: no value. Numbers of an array are parted by spaces.
    ///
    /// # Errors
    /// What cannot be read: a type without a meaning here, or an array above [`ARRAY_LIMIT`].
    pub fn text(&self) -> Result<Option<String>, String> {
        Ok(Some(match self {
            Self::Null => return Ok(None),
            Self::Boolean(value) => value.to_string(),
            Self::Integer(value) => value.to_string(),
            Self::Float(value) => value.to_string(),
            Self::Double(value) => value.to_string(),
            Self::Text(text) => text.clone(),
            Self::Numbers(values) if values.len() > ARRAY_LIMIT => {
                return Err(format!(
                    "an array of {} numbers, limit {ARRAY_LIMIT}",
                    values.len()
                ));
            }
            Self::Numbers(values) => {
                let words: Vec<String> = values.iter().map(ToString::to_string).collect();
                words.join(" ")
            }
            Self::Refused(what) => return Err(what.clone()),
        }))
    }

    /// Whether a condition stands: true, a number other than 0, or a text. `None`: not decided by the value.
    #[must_use]
    pub fn is_alarm(&self) -> Option<bool> {
        match self {
            Self::Boolean(value) => Some(*value),
            Self::Integer(value) => Some(*value != 0),
            Self::Text(text) => Some(!text.trim().is_empty()),
            _ => None,
        }
    }
}

/// A change of a node.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Which key of the mapping, in order.
    pub item: usize,
    /// The value.
    pub payload: Payload,
    /// Its status.
    pub status: Status,
    /// When it was, by its source, else by the server; `None`: neither gives a stamp, or it is outside 1970 to 2106.
    pub machine_at: Option<Stamp<Machine>>,
    /// Whether it is what holds, read after a break, and its stamp may be of long ago.
    pub is_held: bool,
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn values_become_the_text_that_a_mapping_reads() {
        for (payload, text) in [
            (Payload::Null, None),
            (Payload::Boolean(true), Some("true")),
            (
                Payload::Integer(i128::from(u64::MAX)),
                Some("18446744073709551615"),
            ),
            (Payload::Float(0.1), Some("0.1")),
            (Payload::Double(f64::NAN), Some("NaN")),
            (Payload::Numbers(vec![1.0, -2.5, 0.0]), Some("1 -2.5 0")),
            (Payload::Text(String::new()), Some("")),
        ] {
            assert_eq!(payload.text().unwrap().as_deref(), text, "{payload:?}");
        }
        let long = Payload::Numbers(vec![0.0; ARRAY_LIMIT + 1]);
        assert_eq!(long.text().unwrap_err(), "an array of 65 numbers, limit 64");
    }

    proptest! {
        /// What a mapping reads is the number that was sent, to the last bit.
        #[test]
        fn numbers_go_through_their_text_unchanged(double in any::<f64>(), single in any::<f32>()) {
            prop_assume!(double.is_finite() && single.is_finite());
            let text = |payload: Payload| payload.text().unwrap().unwrap();
            let read: f64 = text(Payload::Double(double)).parse().unwrap();
            prop_assert_eq!(read.to_bits(), double.to_bits());
            let read: f32 = text(Payload::Float(single)).parse().unwrap();
            prop_assert_eq!(read.to_bits(), single.to_bits());
        }
    }
}
