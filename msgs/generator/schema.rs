//! The `ros2msg` schema text of MCAP: a message's text, then that of everything it holds.

use std::collections::BTreeSet;
use std::fmt::Write;

use crate::interface::{Interfaces, Message};
use crate::type_hash::collect_references;

const SEPARATOR_LEN: usize = 80;

/// The text of `message` and, after a line of `=` and `MSG: package/Name`, of each type it refers to
/// once, sorted by name.
pub fn definition(interfaces: &Interfaces, message: &Message) -> String {
    let mut text = message.text.clone();
    let mut referenced = BTreeSet::new();
    collect_references(interfaces, message, &mut referenced);
    for name in referenced {
        let separator = "=".repeat(SEPARATOR_LEN);
        let short = short_name(&name);
        let body = &interfaces.messages[&name].text;
        write!(text, "{separator}\nMSG: {short}\n{body}").expect("writing to a String cannot fail");
    }
    text
}

/// `package/Name`, as fields write it.
fn short_name(full_name: &str) -> String {
    let mut parts = full_name.split('/');
    let package = parts.next().unwrap_or_default();
    let name = parts.next_back().unwrap_or_default();
    format!("{package}/{name}")
}
