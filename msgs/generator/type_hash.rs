//! The RIHS01 hash of an interface.
//!
//! SHA-256 over a JSON text of the type's description: its fields in order and every type it refers
//! to, sorted by name; comments, constants and default values do not enter. Spaces follow colons and
//! commas as Python's `json.dumps` sets them.
//!
//! # References
//! REP-2011 and its appendix on type description hashing; `type_description_interfaces/FieldType`
//! for the numbers of the types.

use std::collections::BTreeSet;

use ros2msg::msg::{Field, Type};
use sha2::{Digest, Sha256};

use crate::interface::{Interfaces, Message};

const ARRAY: u32 = 48;
const BOUNDED_SEQUENCE: u32 = 96;
const UNBOUNDED_SEQUENCE: u32 = 144;

/// What ROS 2 puts into a message that would otherwise be empty.
pub const FILLER_FIELD: &str = "structure_needs_at_least_one_member";
/// An octet.
pub const FILLER_TYPE: u32 = 3;

/// `RIHS01_` and the hash in hexadecimal.
pub fn rihs01(interfaces: &Interfaces, message: &Message) -> String {
    let mut referenced = BTreeSet::new();
    collect_references(interfaces, message, &mut referenced);
    let referenced = referenced
        .iter()
        .map(|name| describe(interfaces, &interfaces.messages[name]))
        .collect::<Vec<_>>()
        .join(", ");
    let json = format!(
        r#"{{"type_description": {}, "referenced_type_descriptions": [{referenced}]}}"#,
        describe(interfaces, message)
    );
    let hash = Sha256::digest(json.as_bytes());
    let hex: String = hash.iter().map(|byte| format!("{byte:02x}")).collect();
    format!("RIHS01_{hex}")
}

/// Adds the full names of everything that `message` holds, directly or not.
pub fn collect_references(
    interfaces: &Interfaces,
    message: &Message,
    found: &mut BTreeSet<String>,
) {
    for field in &message.spec.fields {
        if let Some(name) = interfaces.nested(message, field)
            && found.insert(name.clone())
        {
            collect_references(interfaces, &interfaces.messages[&name], found);
        }
    }
}

fn describe(interfaces: &Interfaces, message: &Message) -> String {
    let mut fields: Vec<String> = message
        .spec
        .fields
        .iter()
        .map(|field| {
            let nested = interfaces.nested(message, field).unwrap_or_default();
            describe_field(field, &nested)
        })
        .collect();
    if fields.is_empty() {
        fields.push(field_json(FILLER_FIELD, FILLER_TYPE, 0, 0, ""));
    }
    format!(
        r#"{{"type_name": "{}", "fields": [{}]}}"#,
        message.full_name,
        fields.join(", ")
    )
}

fn describe_field(field: &Field, nested: &str) -> String {
    let kind = &field.field_type;
    let capacity = kind.array_size.unwrap_or(0);
    let string_capacity = kind.base_type.string_upper_bound.unwrap_or(0);
    field_json(
        &field.name,
        type_number(kind),
        capacity,
        string_capacity,
        nested,
    )
}

fn field_json(
    name: &str,
    number: u32,
    capacity: u32,
    string_capacity: u32,
    nested: &str,
) -> String {
    format!(
        r#"{{"name": "{name}", "type": {{"type_id": {number}, "capacity": {capacity}, "string_capacity": {string_capacity}, "nested_type_name": "{nested}"}}}}"#
    )
}

/// The number of a type in `type_description_interfaces/FieldType`.
pub fn type_number(kind: &Type) -> u32 {
    let base = match kind.base_type.type_name.as_str() {
        _ if !kind.is_primitive_type() => 1,
        "int8" => 2,
        // A char of a .msg file is an octet that counts, not a character.
        "uint8" | "char" => 3,
        "int16" => 4,
        "uint16" => 5,
        "int32" => 6,
        "uint32" => 7,
        "int64" => 8,
        "uint64" => 9,
        "float32" => 10,
        "float64" => 11,
        "bool" => 15,
        "byte" => 16,
        _ if kind.base_type.string_upper_bound.is_some() => 21,
        _ => 17,
    };
    let container = match (kind.is_array, kind.array_size, kind.is_upper_bound) {
        (false, _, _) => 0,
        (true, None, _) => UNBOUNDED_SEQUENCE,
        (true, Some(_), true) => BOUNDED_SEQUENCE,
        (true, Some(_), false) => ARRAY,
    };
    base + container
}
