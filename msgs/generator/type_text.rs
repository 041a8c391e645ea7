//! Every type by its parts, for `~/get_type_description`.

use std::collections::BTreeSet;

use ros2msg::msg::{Field, Value};

use crate::interface::{Interfaces, Message};
use crate::rust_code::literal;
use crate::type_hash::{FILLER_FIELD, FILLER_TYPE, collect_references, rihs01, type_number};

/// A table of the types that `is_wanted` picks by full name, sorted by it.
pub fn emit(interfaces: &Interfaces, is_wanted: impl Fn(&str) -> bool) -> String {
    let rows: String = interfaces
        .messages
        .values()
        .filter(|message| is_wanted(&message.full_name))
        .map(|message| row(interfaces, message))
        .collect();
    format!(
        "/// Types by their parts, sorted by type name.\npub const TYPE_PARTS: &[crate::TypeParts] = &[\n{rows}];\n"
    )
}

fn row(interfaces: &Interfaces, message: &Message) -> String {
    let mut fields: String = message
        .spec
        .fields
        .iter()
        .map(|field| field_row(interfaces, message, field))
        .collect();
    if fields.is_empty() {
        fields = parts(FILLER_FIELD, FILLER_TYPE, 0, 0, "", "");
    }
    let mut referenced = BTreeSet::new();
    collect_references(interfaces, message, &mut referenced);
    let implicit = ("implicit", String::new());
    let source = interfaces
        .sources
        .get(&message.full_name)
        .unwrap_or(&implicit);
    format!(
        "crate::TypeParts {{\ntype_name: {:?},\ntype_hash: {:?},\nfields: &[{fields}],\nreferenced: &{:?},\nsource: {source:?},\n}},\n",
        message.full_name,
        rihs01(interfaces, message),
        referenced.iter().collect::<Vec<_>>(),
    )
}

fn field_row(interfaces: &Interfaces, message: &Message, field: &Field) -> String {
    let kind = &field.field_type;
    let default = match &field.default_value {
        None => String::new(),
        Some(Value::Primitive(value)) => literal(value),
        Some(Value::Array(values)) => {
            let values: Vec<String> = values.iter().map(literal).collect();
            format!("[{}]", values.join(", "))
        }
    };
    parts(
        &field.name,
        type_number(kind),
        kind.array_size.unwrap_or(0),
        kind.base_type.string_upper_bound.unwrap_or(0),
        &interfaces.nested(message, field).unwrap_or_default(),
        &default,
    )
}

fn parts(
    name: &str,
    type_id: u32,
    capacity: u32,
    string_capacity: u32,
    nested: &str,
    default: &str,
) -> String {
    format!(
        "crate::FieldParts {{ name: {name:?}, type_id: {type_id}, capacity: {capacity}, string_capacity: {string_capacity}, nested: {nested:?}, default: {default:?} }},\n"
    )
}
