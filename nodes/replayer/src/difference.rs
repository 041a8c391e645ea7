//! Where a recorded and a computed message differ, field by field.

use recorder::{Reflector, TopicInfo, Value};
use serde::Serialize;

/// The first place where a replay and its bag differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// When, ns on the clock of the log times.
    pub at_nanos: i64,
    /// Which topic.
    pub topic: String,
    /// Which message of this topic, from 0.
    pub message: u64,
    /// What.
    pub discrepancy: Discrepancy,
}

/// How a recorded and a computed message differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Discrepancy {
    /// A field has another value.
    Field {
        /// Its name, with the names of what holds it, e.g. `drift[2].p0`.
        field: String,
        /// What the bag has.
        recorded: String,
        /// What was computed.
        computed: String,
        /// Representable numbers from one to the other, for numbers of one kind.
        ulps: Option<u64>,
    },
    /// Fields are equal, bytes are not (padding, or the bits of a NaN).
    Bytes,
    /// The bag has a message that was not computed.
    NotComputed,
    /// A message was computed that the bag does not have.
    NotRecorded,
    /// The bag has another message before this one.
    Order,
    /// The bag's definition cannot be read.
    Unreadable {
        /// Why.
        reason: String,
    },
}

impl Discrepancy {
    /// Compares two messages of one topic that are not the same bytes.
    #[must_use]
    pub fn between(topic: &TopicInfo, recorded: &[u8], computed: &[u8]) -> Self {
        let (encoding, text) = (&topic.definition_encoding, &topic.definition);
        let decoded = Reflector::new(&topic.type_name, encoding, text)
            .and_then(|reflector| Ok((reflector.decode(recorded)?, reflector.decode(computed)?)));
        match decoded {
            Ok((recorded, computed)) => {
                first_field("", &recorded, &computed).unwrap_or(Self::Bytes)
            }
            Err(error) => Self::Unreadable {
                reason: error.to_string(),
            },
        }
    }
}

fn first_field(path: &str, recorded: &Value, computed: &Value) -> Option<Discrepancy> {
    match (recorded, computed) {
        (Value::Message(a), Value::Message(b)) => a
            .iter()
            .zip(b)
            .find_map(|((name, a), (_, b))| first_field(&join(path, name), a, b)),
        (Value::List(a), Value::List(b)) => {
            let items = a.iter().zip(b).enumerate();
            let mut items =
                items.filter_map(|(i, (a, b))| first_field(&format!("{path}[{i}]"), a, b));
            let length = || differs(&format!("{path}.length"), a.len(), b.len(), None);
            items.next().or_else(|| (a.len() != b.len()).then(length))
        }
        (Value::Float64(a), Value::Float64(b)) if a.to_bits() != b.to_bits() => {
            let ulps = ulps(order(a.to_bits(), 63), order(b.to_bits(), 63));
            Some(differs(
                path,
                a,
                b,
                ulps.filter(|_| !a.is_nan() && !b.is_nan()),
            ))
        }
        (Value::Float32(a), Value::Float32(b)) if a.to_bits() != b.to_bits() => {
            let bits = |value: &f32| order(u64::from(value.to_bits()), 31);
            let ulps = ulps(bits(a), bits(b));
            Some(differs(
                path,
                a,
                b,
                ulps.filter(|_| !a.is_nan() && !b.is_nan()),
            ))
        }
        (Value::Float64(_) | Value::Float32(_), _) => None,
        (Value::Int(a), Value::Int(b)) if a != b => Some(differs(path, a, b, None)),
        (Value::Uint(a), Value::Uint(b)) if a != b => Some(differs(path, a, b, None)),
        (Value::Bool(a), Value::Bool(b)) if a != b => Some(differs(path, a, b, None)),
        (Value::Text(a), Value::Text(b)) if a != b => Some(differs(path, a, b, None)),
        _ => None,
    }
}

fn join(path: &str, name: &str) -> String {
    if path.is_empty() {
        name.to_owned()
    } else {
        format!("{path}.{name}")
    }
}

fn differs<T: std::fmt::Debug>(
    field: &str,
    recorded: T,
    computed: T,
    ulps: Option<u64>,
) -> Discrepancy {
    Discrepancy::Field {
        field: field.to_owned(),
        recorded: format!("{recorded:?}"),
        computed: format!("{computed:?}"),
        ulps,
    }
}

/// The bits of a number in the order of the numbers; both zeros are one.
fn order(bits: u64, sign: u32) -> i128 {
    let size = i128::from(bits & ((1 << sign) - 1));
    if bits >> sign == 1 { -size } else { size }
}

fn ulps(a: i128, b: i128) -> Option<u64> {
    u64::try_from((a - b).abs()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(recorded: Value, computed: Value) -> Option<Discrepancy> {
        let message = |value| Value::Message(vec![("a".into(), Value::List(vec![value]))]);
        first_field("", &message(recorded), &message(computed))
    }

    #[test]
    fn a_number_is_told_with_its_place_and_its_distance() {
        let next = f64::from_bits(1.5_f64.to_bits() + 3);
        let expected = Discrepancy::Field {
            field: "a[0]".to_owned(),
            recorded: "1.5".to_owned(),
            computed: format!("{next:?}"),
            ulps: Some(3),
        };
        assert_eq!(
            of(Value::Float64(1.5), Value::Float64(next)),
            Some(expected)
        );
        assert_eq!(of(Value::Float64(f64::NAN), Value::Float64(f64::NAN)), None);
        let zeros = of(Value::Float64(0.0), Value::Float64(-0.0));
        assert!(matches!(
            zeros,
            Some(Discrepancy::Field { ulps: Some(0), .. })
        ));
        let across = of(Value::Float32(1e-45), Value::Float32(-1e-45));
        assert!(matches!(
            across,
            Some(Discrepancy::Field { ulps: Some(2), .. })
        ));
    }

    #[test]
    fn lists_of_different_length_differ_behind_their_common_part() {
        let list = |n: u64| Value::List((0..n).map(Value::Uint).collect());
        let Some(Discrepancy::Field {
            field,
            recorded,
            computed,
            ..
        }) = first_field("b", &list(2), &list(3))
        else {
            panic!("no difference")
        };
        assert_eq!(
            (field.as_str(), recorded.as_str(), computed.as_str()),
            ("b.length", "2", "3")
        );
        assert_eq!(first_field("b", &list(2), &list(2)), None);
    }
}
