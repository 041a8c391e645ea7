//! The `ros2msg` schema text of MCAP: a message's text, then that of everything it holds.

use std::collections::BTreeSet;
use std::fmt::Write;

use crate::interface::{Interfaces, Message};
use crate::type_hash::collect_references;

const SEPARATOR_LEN: usize = 80;

/// The text of `message` and, after a line of `=` and `MSG: package/Name`, of each type it refers to
/// once, sorted by name.
pub fn definition(interfaces: &Interfaces, message: &Message) -> String {
    let mut text = own_text(interfaces, message);
    let mut referenced = BTreeSet::new();
    collect_references(interfaces, message, &mut referenced);
    for name in referenced {
        let separator = "=".repeat(SEPARATOR_LEN);
        let short = short_name(&name);
        let body = own_text(interfaces, &interfaces.messages[&name]);
        write!(text, "{separator}\nMSG: {short}\n{body}").expect("writing to a String cannot fail");
    }
    text
}

/// The text as written, or the fields of a message that ROS 2 derives.
fn own_text(interfaces: &Interfaces, message: &Message) -> String {
    if let Some(text) = &message.text {
        return text.clone();
    }
    let mut text = String::new();
    for field in &message.spec.fields {
        let mut kind = field.field_type.to_string();
        if let Some(nested) = interfaces.nested(message, field) {
            let base = field.field_type.base_type.to_string();
            kind = kind.replacen(&base, &short_name(&nested), 1);
        }
        text.push_str(&format!("{kind} {}\n", field.name));
    }
    text
}

/// `package/Name` of a message file's type; the parts of services and actions keep their kind, or a
/// reader would look for them among the messages.
fn short_name(full_name: &str) -> String {
    full_name.replace("/msg/", "/")
}
