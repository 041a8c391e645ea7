//! Writes the Rust types.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use ros2msg::msg::{Annotations, Constant, Field, PrimitiveValue, Value};

use crate::interface::{Compound, Interfaces, Message, comment_lines, unit};
use crate::schema::definition;
use crate::type_hash::{FILLER_FIELD, rihs01};

/// Longest array for which serde and `Default` are implemented by their crates.
const LONGEST_PLAIN_ARRAY: u32 = 32;

/// Source text: per package (its own at the root) a module per kind with its types.
pub fn emit(interfaces: &Interfaces, own_package: &str) -> String {
    let mut modules: BTreeMap<(String, String), String> = BTreeMap::new();
    for message in interfaces.messages.values().filter(|m| m.text.is_some()) {
        let code = emit_message(interfaces, message, own_package);
        module_of(&mut modules, &message.full_name).push_str(&code);
    }
    for service in &interfaces.services {
        let code = emit_service(interfaces, service, own_package);
        module_of(&mut modules, &service.full_name).push_str(&code);
    }
    for action in &interfaces.actions {
        let code = emit_action(interfaces, action, own_package);
        module_of(&mut modules, &action.full_name).push_str(&code);
    }
    let mut packages: BTreeMap<String, String> = BTreeMap::new();
    for ((package, kind), code) in modules {
        let module = format!(
            "/// `{package}/{kind}`: made from the .{kind} files.\npub mod {kind} {{\n{code}}}\n"
        );
        packages.entry(package).or_default().push_str(&module);
    }
    let mut out = packages.remove(own_package).unwrap_or_default();
    for (package, code) in packages {
        put(
            &mut out,
            format_args!(
                "/// Interfaces of the ROS 2 package `{package}`.\npub mod {package} {{\n{code}}}\n"
            ),
        );
    }
    out.push_str(&emit_table(interfaces, own_package));
    out
}

/// Source text of the messages `names`, in modules of their packages, and a table of them.
pub fn emit_messages(interfaces: &Interfaces, names: &BTreeSet<String>) -> String {
    let mut packages: BTreeMap<&str, String> = BTreeMap::new();
    let mut rows = Vec::new();
    for message in names.iter().map(|name| &interfaces.messages[name]) {
        let package = message.full_name.split('/').next().unwrap_or_default();
        let code = emit_message(interfaces, message, "");
        packages.entry(package).or_default().push_str(&code);
        let name = rust_name(&message.full_name);
        rows.push(format!(
            "<{package}::msg::{name} as crate::Message>::DESCRIPTION,\n"
        ));
    }
    let mut out = String::new();
    for (package, code) in packages {
        put(
            &mut out,
            format_args!(
                "/// Of the ROS 2 package `{package}`.\npub mod {package} {{\n/// Messages.\npub mod msg {{\n{code}}}\n}}\n"
            ),
        );
    }
    let rows = rows.concat();
    put(
        &mut out,
        format_args!(
            "/// These messages, sorted by type name.\npub const DESCRIPTIONS: &[crate::Description] = &[\n{rows}];\n"
        ),
    );
    out
}

/// The constants of an action that describe what ROS 2 derives from it, with the names' suffixes.
const DERIVED: [(&str, &str); 9] = [
    ("SEND_GOAL", "_SendGoal"),
    ("SEND_GOAL_REQUEST", "_SendGoal_Request"),
    ("SEND_GOAL_RESPONSE", "_SendGoal_Response"),
    ("SEND_GOAL_EVENT", "_SendGoal_Event"),
    ("GET_RESULT", "_GetResult"),
    ("GET_RESULT_REQUEST", "_GetResult_Request"),
    ("GET_RESULT_RESPONSE", "_GetResult_Response"),
    ("GET_RESULT_EVENT", "_GetResult_Event"),
    ("FEEDBACK_MESSAGE", "_FeedbackMessage"),
];

/// Every message that can travel, sorted by full name.
fn emit_table(interfaces: &Interfaces, own_package: &str) -> String {
    let mut rows = BTreeMap::new();
    for message in interfaces.messages.values().filter(|m| m.text.is_some()) {
        let path = rust_path(&message.full_name, own_package);
        let row = format!("<{path} as crate::Message>::DESCRIPTION");
        rows.insert(message.full_name.clone(), row);
    }
    for action in &interfaces.actions {
        let path = rust_path(&action.full_name, own_package);
        for (constant, suffix) in DERIVED {
            if !["SEND_GOAL", "GET_RESULT"].contains(&constant) {
                let row = format!("<{path} as crate::Action>::{constant}");
                rows.insert(format!("{}{suffix}", action.full_name), row);
            }
        }
    }
    for service in &interfaces.services {
        let path = rust_path(&service.full_name, own_package);
        let row = format!("<{path} as crate::Service>::EVENT");
        rows.insert(format!("{}_Event", service.full_name), row);
    }
    let rows: Vec<_> = rows.into_values().collect();
    format!(
        "/// Every message that can travel on a topic or in a service or action, sorted by type name.\npub const DESCRIPTIONS: &[crate::Description] = &[\n{},\n];\n",
        rows.join(",\n")
    )
}

fn put(out: &mut String, text: std::fmt::Arguments<'_>) {
    out.write_fmt(text)
        .expect("writing to a String cannot fail");
}

fn module_of<'a>(
    modules: &'a mut BTreeMap<(String, String), String>,
    full_name: &str,
) -> &'a mut String {
    let mut parts = full_name.split('/').map(str::to_owned);
    let package = parts.next().unwrap_or_default();
    let kind = parts.next().unwrap_or_default();
    modules.entry((package, kind)).or_default()
}

fn emit_message(interfaces: &Interfaces, message: &Message, own_package: &str) -> String {
    let name = rust_name(&message.full_name);
    let mut out = docs(
        &message.spec.annotations,
        &format!("`{}`.", message.full_name),
    );
    let has_defaults = message.spec.fields.iter().any(needs_written_default);
    let default = if has_defaults { "" } else { "Default, " };
    put(
        &mut out,
        format_args!(
            "#[derive(Clone, Debug, {default}PartialEq, ::serde::Serialize, ::serde::Deserialize)]\npub struct {name} {{\n"
        ),
    );
    for field in &message.spec.fields {
        out.push_str(&docs(&field.annotations, &format!("`{}`.", field.name)));
        if is_long_array(field) {
            out.push_str("#[serde(with = \"::serde_big_array::BigArray\")]\n");
        }
        let kind = rust_type(interfaces, message, field, own_package);
        put(
            &mut out,
            format_args!("pub {}: {kind},\n", identifier(&field.name)),
        );
    }
    if message.spec.fields.is_empty() {
        put(
            &mut out,
            format_args!(
                "/// Zero: ROS 2 puts one octet into a message without fields.\npub {FILLER_FIELD}: u8,\n"
            ),
        );
    }
    out.push_str("}\n");
    if has_defaults {
        out.push_str(&emit_default(message, &name));
    }
    out.push_str(&emit_constants(&message.spec.constants, &name));
    put(
        &mut out,
        format_args!(
            "impl crate::Message for {name} {{\n{}}}\n",
            description_consts(interfaces, message)
        ),
    );
    out
}

fn description_consts(interfaces: &Interfaces, message: &Message) -> String {
    format!(
        "const TYPE_NAME: &'static str = {:?};\nconst TYPE_HASH: &'static str = {:?};\nconst DEFINITION: &'static str = {:?};\n",
        message.full_name,
        rihs01(interfaces, message),
        definition(interfaces, message)
    )
}

fn emit_default(message: &Message, name: &str) -> String {
    let mut out = format!("impl Default for {name} {{\nfn default() -> Self {{\nSelf {{\n");
    for field in &message.spec.fields {
        let value = match &field.default_value {
            Some(Value::Primitive(value)) => owned_literal(value),
            Some(Value::Array(values)) => {
                let values: Vec<_> = values.iter().map(owned_literal).collect();
                let list = values.join(", ");
                if is_fixed_array(field) {
                    format!("[{list}]")
                } else {
                    format!("vec![{list}]")
                }
            }
            None if is_long_array(field) => "[Default::default(); _]".to_owned(),
            None => "Default::default()".to_owned(),
        };
        put(
            &mut out,
            format_args!("{}: {value},\n", identifier(&field.name)),
        );
    }
    out.push_str("}\n}\n}\n");
    out
}

fn emit_constants(constants: &[Constant], name: &str) -> String {
    if constants.is_empty() {
        return String::new();
    }
    let mut out = format!("impl {name} {{\n");
    for constant in constants {
        out.push_str(&docs(
            &constant.annotations,
            &format!("Value of `{}`.", constant.name),
        ));
        let kind = match constant.type_name.as_str() {
            "string" => "&'static str",
            other => primitive(other),
        };
        put(
            &mut out,
            format_args!(
                "pub const {}: {kind} = {};\n",
                constant.name,
                literal(&constant.value)
            ),
        );
    }
    out.push_str("}\n");
    out
}

fn emit_service(interfaces: &Interfaces, service: &Compound, own_package: &str) -> String {
    let name = rust_name(&service.full_name);
    let part = |suffix: &str| rust_path(&format!("{}{suffix}", service.full_name), own_package);
    format!(
        "{}#[derive(Clone, Copy, Debug, Default, PartialEq)]\npub struct {name};\nimpl crate::Service for {name} {{\ntype Request = {};\ntype Response = {};\nconst TYPE_NAME: &'static str = {:?};\nconst TYPE_HASH: &'static str = {:?};\n{}}}\n",
        doc_lines(&service.comment, None, &service.full_name),
        part("_Request"),
        part("_Response"),
        service.full_name,
        rihs01(interfaces, &interfaces.messages[&service.full_name]),
        described(interfaces, "EVENT", &format!("{}_Event", service.full_name)),
    )
}

/// A constant that describes a message that ROS 2 derives.
fn described(interfaces: &Interfaces, constant: &str, full_name: &str) -> String {
    let message = &interfaces.messages[full_name];
    format!(
        "const {constant}: crate::Description = crate::Description {{\ntype_name: {:?},\ntype_hash: {:?},\ndefinition: {:?},\n}};\n",
        message.full_name,
        rihs01(interfaces, message),
        definition(interfaces, message)
    )
}

fn emit_action(interfaces: &Interfaces, action: &Compound, own_package: &str) -> String {
    let name = rust_name(&action.full_name);
    let full = |suffix: &str| format!("{}{suffix}", action.full_name);
    let mut out = format!(
        "{}#[derive(Clone, Copy, Debug, Default, PartialEq)]\npub struct {name};\nimpl crate::Action for {name} {{\n",
        doc_lines(&action.comment, None, &action.full_name),
    );
    for part in ["Goal", "Result", "Feedback"] {
        let path = rust_path(&full(&format!("_{part}")), own_package);
        put(&mut out, format_args!("type {part} = {path};\n"));
    }
    put(
        &mut out,
        format_args!(
            "const TYPE_NAME: &'static str = {:?};\nconst TYPE_HASH: &'static str = {:?};\n",
            action.full_name,
            rihs01(interfaces, &interfaces.messages[&action.full_name])
        ),
    );
    for (constant, suffix) in DERIVED {
        out.push_str(&described(interfaces, constant, &full(suffix)));
    }
    out.push_str("}\n");
    out
}

fn docs(annotations: &Annotations, otherwise: &str) -> String {
    doc_lines(&comment_lines(annotations), unit(annotations), otherwise)
}

fn doc_lines(comment: &[String], unit: Option<&str>, otherwise: &str) -> String {
    let mut lines = comment.to_vec();
    if lines.is_empty() {
        lines.push(otherwise.to_owned());
    }
    if let (Some(unit), Some(last)) = (unit, lines.last_mut()) {
        last.push_str(&format!(" [{unit}]"));
    }
    lines
        .iter()
        .map(|line| format!("#[doc = {:?}]\n", format!(" {}", escape_markdown(line))))
        .collect()
}

/// Square brackets would be taken for links and angle brackets for HTML.
fn escape_markdown(line: &str) -> String {
    let mut out = String::new();
    for c in line.chars() {
        if "[]<>*_".contains(c) {
            out.push('\\');
        }
        out.push(c);
    }
    out
}

fn rust_type(
    interfaces: &Interfaces,
    message: &Message,
    field: &Field,
    own_package: &str,
) -> String {
    let base = match interfaces.nested(message, field) {
        Some(name) => rust_path(&name, own_package),
        None => primitive(&field.field_type.base_type.type_name).to_owned(),
    };
    match field.field_type.array_size {
        Some(len) if is_fixed_array(field) => format!("[{base}; {len}]"),
        _ if field.field_type.is_array => format!("::std::vec::Vec<{base}>"),
        _ => base,
    }
}

fn primitive(name: &str) -> &'static str {
    match name {
        "bool" => "bool",
        "byte" | "char" | "uint8" => "u8",
        "int8" => "i8",
        "int16" => "i16",
        "uint16" => "u16",
        "int32" => "i32",
        "uint32" => "u32",
        "int64" => "i64",
        "uint64" => "u64",
        "float32" => "f32",
        "float64" => "f64",
        _ => "::std::string::String",
    }
}

fn is_fixed_array(field: &Field) -> bool {
    field.field_type.array_size.is_some() && !field.field_type.is_upper_bound
}

fn is_long_array(field: &Field) -> bool {
    is_fixed_array(field)
        && field
            .field_type
            .array_size
            .is_some_and(|len| len > LONGEST_PLAIN_ARRAY)
}

fn needs_written_default(field: &Field) -> bool {
    let differs = match &field.default_value {
        None => false,
        Some(Value::Primitive(value)) => !is_rust_default(value),
        Some(Value::Array(values)) => !values.iter().all(is_rust_default) || !is_fixed_array(field),
    };
    differs || is_long_array(field)
}

/// Whether `Default` gives the same.
fn is_rust_default(value: &PrimitiveValue) -> bool {
    ["false", "0", "0.0", "\"\""].contains(&literal(value).as_str())
}

/// A value as Rust and interface files write it.
pub fn literal(value: &PrimitiveValue) -> String {
    match value {
        PrimitiveValue::Bool(v) => v.to_string(),
        PrimitiveValue::Int8(v) => v.to_string(),
        PrimitiveValue::UInt8(v) => v.to_string(),
        PrimitiveValue::Int16(v) => v.to_string(),
        PrimitiveValue::UInt16(v) => v.to_string(),
        PrimitiveValue::Int32(v) => v.to_string(),
        PrimitiveValue::UInt32(v) => v.to_string(),
        PrimitiveValue::Int64(v) => v.to_string(),
        PrimitiveValue::UInt64(v) => v.to_string(),
        PrimitiveValue::Float32(v) => format!("{v:?}"),
        PrimitiveValue::Float64(v) => format!("{v:?}"),
        PrimitiveValue::String(v) => format!("{v:?}"),
    }
}

fn owned_literal(value: &PrimitiveValue) -> String {
    match value {
        PrimitiveValue::String(v) => format!("{v:?}.to_owned()"),
        other => literal(other),
    }
}

/// Field names that are words of Rust.
fn identifier(name: &str) -> String {
    match name {
        "type" | "match" | "move" | "ref" | "use" | "loop" | "in" | "where" | "enum" | "struct"
        | "final" | "box" | "abstract" | "priv" | "virtual" | "override" => format!("r#{name}"),
        other => other.to_owned(),
    }
}

fn rust_name(full_name: &str) -> String {
    full_name
        .rsplit('/')
        .next()
        .unwrap_or_default()
        .replace('_', "")
}

fn rust_path(full_name: &str, own_package: &str) -> String {
    let mut parts = full_name.split('/');
    let package = parts.next().unwrap_or_default();
    let kind = parts.next().unwrap_or_default();
    let name = rust_name(full_name);
    if package == own_package {
        format!("crate::{kind}::{name}")
    } else {
        format!("crate::{package}::{kind}::{name}")
    }
}
