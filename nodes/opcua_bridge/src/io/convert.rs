//! Between the client's values and ours.

use metrology::stamp::{Machine, Stamp};
use opcua::types::{Array, DataValue, DateTime, Guid, NodeId, StatusCode, UAString, Variant};

use crate::node_key::Identifier;
use crate::status::Status;
use crate::value::{ARRAY_LIMIT, Change, Payload};

/// Ticks of 100 ns from 1601 to 1970.
const TO_1970: i64 = 116_444_736_000_000_000;

/// A change out of what the server sent for an item.
pub(super) fn change(item: usize, value: DataValue, is_held: bool) -> Change {
    let stamp = value.source_timestamp.or(value.server_timestamp);
    Change {
        item,
        payload: value.value.map_or(Payload::Null, payload),
        status: Status(value.status.map_or(0, |status| status.bits())),
        machine_at: stamp.and_then(|stamp| instant(&stamp)),
        is_held,
    }
}

fn instant(stamp: &DateTime) -> Option<Stamp<Machine>> {
    let nanos = stamp.ticks().checked_sub(TO_1970)?.checked_mul(100)?;
    Some(Stamp::from_nanos(nanos))
}

fn text(text: UAString) -> Payload {
    text.value()
        .as_ref()
        .map_or(Payload::Null, |text| Payload::Text(text.clone()))
}

fn payload(value: Variant) -> Payload {
    match value {
        Variant::Empty => Payload::Null,
        Variant::Boolean(value) => Payload::Boolean(value),
        Variant::SByte(value) => Payload::Integer(value.into()),
        Variant::Byte(value) => Payload::Integer(value.into()),
        Variant::Int16(value) => Payload::Integer(value.into()),
        Variant::UInt16(value) => Payload::Integer(value.into()),
        Variant::Int32(value) => Payload::Integer(value.into()),
        Variant::UInt32(value) => Payload::Integer(value.into()),
        Variant::Int64(value) => Payload::Integer(value.into()),
        Variant::UInt64(value) => Payload::Integer(value.into()),
        Variant::Float(value) => Payload::Float(value),
        Variant::Double(value) => Payload::Double(value),
        Variant::String(value) => text(value),
        Variant::LocalizedText(value) => text(value.text),
        Variant::QualifiedName(value) => text(value.name),
        Variant::DateTime(value) => Payload::Text(value.to_rfc3339()),
        Variant::Guid(value) => Payload::Text(value.to_string()),
        Variant::StatusCode(value) => Payload::Integer(value.bits().into()),
        Variant::Array(array) => numbers(&array),
        Variant::ByteString(_) => refused("ByteString"),
        Variant::XmlElement(_) => refused("XmlElement"),
        Variant::NodeId(_) | Variant::ExpandedNodeId(_) => refused("NodeId"),
        Variant::ExtensionObject(_) => refused("structure"),
        Variant::Variant(_) | Variant::DataValue(_) | Variant::DiagnosticInfo(_) => {
            refused("value within a value")
        }
    }
}

fn refused(what: &str) -> Payload {
    Payload::Refused(format!("a {what} has no meaning here"))
}

/// Numbers of an array. One more than the limit is enough to be refused for its length.
fn numbers(array: &Array) -> Payload {
    if array.values.len() > ARRAY_LIMIT {
        let length = array.values.len();
        return Payload::Refused(format!("an array of {length} values, limit {ARRAY_LIMIT}"));
    }
    let number = |value: &Variant| match value {
        Variant::Float(value) => Some(f64::from(*value)),
        Variant::Double(value) => Some(*value),
        Variant::SByte(value) => Some(f64::from(*value)),
        Variant::Byte(value) => Some(f64::from(*value)),
        Variant::Int16(value) => Some(f64::from(*value)),
        Variant::UInt16(value) => Some(f64::from(*value)),
        Variant::Int32(value) => Some(f64::from(*value)),
        Variant::UInt32(value) => Some(f64::from(*value)),
        _ => None,
    };
    let numbers: Option<Vec<f64>> = array.values.iter().map(number).collect();
    numbers.map_or_else(|| refused("array of other than numbers"), Payload::Numbers)
}

/// The client's form of an identifier in a namespace; `None`: a GUID or bytes that the client cannot read.
pub(super) fn node_id(namespace: u16, identifier: &Identifier) -> Option<NodeId> {
    Some(match identifier {
        Identifier::Number(number) => NodeId::new(namespace, *number),
        Identifier::Text(text) => NodeId::new(namespace, text.as_str()),
        Identifier::Guid(text) => NodeId::new(namespace, text.parse::<Guid>().ok()?),
        Identifier::Bytes(text) => {
            let bytes = opcua::types::ByteString::from_base64(text)?;
            NodeId::new(namespace, bytes)
        }
    })
}

/// Our form of the client's identifier.
pub(super) fn identifier(node: &NodeId) -> Identifier {
    use opcua::types::Identifier as Theirs;
    match &node.identifier {
        Theirs::Numeric(number) => Identifier::Number(*number),
        Theirs::String(text) => Identifier::Text(text.value().clone().unwrap_or_default()),
        Theirs::Guid(guid) => Identifier::Guid(guid.to_string().to_ascii_lowercase()),
        Theirs::ByteString(bytes) => Identifier::Bytes(bytes.as_base64()),
    }
}

/// A status of the client in words.
pub(super) fn words(status: StatusCode) -> String {
    let name = status.sub_code().name();
    if name == "Invalid" {
        Status(status.bits()).to_string()
    } else {
        name.to_owned()
    }
}

/// The words of an error of the client, without what only its programmers read: of an error of the system its message.
pub(super) fn reason(error: &impl ToString) -> String {
    let text = error.to_string();
    let Some((before, system)) = text.split_once("Os { code: ") else {
        return text;
    };
    let message = system
        .split_once("message: \"")
        .and_then(|(_, rest)| rest.split_once("\" }"));
    message.map_or_else(
        || text.clone(),
        |(message, after)| format!("{before}{message}{after}"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_keeps_its_number_its_status_and_the_stamp_of_its_source() {
        let value = DataValue {
            value: Some(Variant::from(12.5_f64)),
            status: Some(StatusCode::UncertainSensorNotAccurate),
            source_timestamp: Some(DateTime::ymd_hms(2016, 11, 29, 9, 28, 49)),
            server_timestamp: Some(DateTime::ymd_hms(2026, 1, 1, 0, 0, 0)),
            ..DataValue::default()
        };
        let change = change(3, value, false);
        assert_eq!(change.item, 3);
        assert_eq!(change.payload, Payload::Double(12.5));
        assert_eq!(change.status, Status(0x4093_0000));
        // `date -u -d 2016-11-29T09:28:49 +%s`
        assert_eq!(
            change.machine_at,
            Some(Stamp::from_nanos(1_480_411_729_000_000_000))
        );
    }

    #[test]
    fn the_servers_stamp_stands_in_where_the_source_gives_none() {
        let value = DataValue {
            server_timestamp: Some(DateTime::ymd_hms(1970, 1, 1, 0, 0, 1)),
            ..DataValue::default()
        };
        let change = change(0, value, true);
        assert_eq!(change.machine_at, Some(Stamp::from_nanos(1_000_000_000)));
        assert_eq!((change.payload, change.is_held), (Payload::Null, true));
    }

    #[test]
    fn an_error_of_the_system_is_told_by_its_message() {
        let debug = r#"BadCommunicationError: Could not connect to host a:1, Os { code: 111, kind: ConnectionRefused, message: "Connection refused" }"#;
        let plain = "BadCommunicationError: Could not connect to host a:1, Connection refused";
        assert_eq!(reason(&debug), plain);
        for other in ["BadTimeout: The operation timed out.", "Os { code: 5"] {
            assert_eq!(reason(&other), other);
        }
    }

    #[test]
    fn identifiers_go_both_ways() {
        for one in [
            Identifier::Number(7),
            Identifier::Text("/Channel/State".to_owned()),
            Identifier::Guid("72962b91-fa75-4ae6-8d28-b404dc7daf63".to_owned()),
            Identifier::Bytes("M/RbKBsRVkePCePcx24oRA==".to_owned()),
        ] {
            assert_eq!(identifier(&node_id(4, &one).unwrap()), one);
        }
    }
}
