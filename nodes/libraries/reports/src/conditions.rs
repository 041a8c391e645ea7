//! What nodes complained about during the run.

use std::collections::BTreeMap;

use maud::{Markup, html};
use node_runtime::Level;

use super::page::{fold, table};
use crate::evidence::Evidence;

/// Each condition once, with how often and the last message.
pub fn section(evidence: &Evidence) -> Markup {
    let mut found: BTreeMap<(&str, &str), (usize, Level, &str)> = BTreeMap::new();
    for condition in &evidence.conditions {
        let entry = found
            .entry((condition.node.as_str(), condition.diagnostic.name.as_ref()))
            .or_insert((0, Level::Ok, ""));
        entry.0 += 1;
        entry.1 = entry.1.max(condition.diagnostic.level);
        entry.2 = condition.diagnostic.message.as_str();
    }
    let rows: Vec<Vec<String>> = found
        .iter()
        .map(|((node, name), (times, level, message))| {
            vec![
                format!("{node}: {name}"),
                format!("{level:?}").to_lowercase(),
                times.to_string(),
                (*message).to_owned(),
            ]
        })
        .collect();
    let content = html! {
        @if rows.is_empty() && evidence.undecoded.is_empty() { p { "None was reported." } }
        @else { (table(&["node: condition", "level", "times", "last message"], &rows)) }
        @for line in evidence.not_used() { p.bad { "Left out: " (line) "." } }
    };
    fold("Conditions that nodes reported", None, false, &content)
}
