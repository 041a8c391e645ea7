//! Evidence from the graph: absolute names, and conditions as `/diagnostics` repeats them.

use std::collections::BTreeMap;

use abbe_msgs::diagnostic_msgs::msg::DiagnosticArray;
use abbe_msgs::{from_cdr, topics};
use metrology::stamp::{Host, Stamp};
use node_runtime::tap::Tapped;
use node_runtime::{Diagnostic, Level};
use reports::evidence::Evidence;

/// Gathers evidence from what a tap hears.
#[derive(Default)]
pub struct GraphEvidence {
    evidence: Evidence,
    /// Level that each condition had last, by its name on the board.
    levels: BTreeMap<String, u8>,
}

/// The topic by its name in `topics`, whatever namespace it is in; `None`: nothing for evidence.
fn wanted(name: &str) -> Option<&'static str> {
    let entries = topics::all().iter().filter(|entry| !entry.is_family);
    entries
        .map(|entry| entry.name)
        .filter(|known| Evidence::wants(known))
        .find(|known| {
            let before = name.strip_suffix(known);
            before.is_some_and(|before| before.ends_with('/'))
        })
}

impl GraphEvidence {
    /// What has been gathered.
    pub const fn evidence(&self) -> &Evidence {
        &self.evidence
    }

    /// Ends gathering.
    pub fn into_evidence(self) -> Evidence {
        self.evidence
    }

    /// Takes one sample.
    pub fn take(&mut self, sample: &Tapped) {
        if sample.topic.name == topics::DIAGNOSTICS.name {
            self.diagnostics(sample.received, &sample.bytes);
        } else if let Some(topic) = wanted(&sample.topic.name) {
            self.evidence.message(topic, sample.received, &sample.bytes);
        }
    }

    fn diagnostics(&mut self, at: Stamp<Host>, bytes: &[u8]) {
        let array: DiagnosticArray = match from_cdr(bytes) {
            Ok(array) => array,
            Err(error) => {
                let name = topics::DIAGNOSTICS.name;
                self.evidence.cannot_use(name, at, &error);
                return;
            }
        };
        for status in array.status {
            let before = self.levels.insert(status.name.clone(), status.level);
            if before.unwrap_or(0) == status.level {
                continue;
            }
            // `node: condition`; the node itself, without a condition, repeats the worst of them.
            if let Some((node, condition)) = status.name.split_once(": ") {
                let diagnostic =
                    Diagnostic::new(level(status.level), condition.to_owned(), status.message);
                self.evidence.condition(at, node, &diagnostic);
            }
        }
    }
}

const fn level(number: u8) -> Level {
    match number {
        0 => Level::Ok,
        1 => Level::Warn,
        2 => Level::Error,
        _ => Level::Stale,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_topic_is_known_in_any_namespace() {
        assert_eq!(wanted("/latency"), Some(topics::LATENCY.name));
        assert_eq!(wanted("/m1/probe/point"), Some(topics::PROBE_POINT.name));
        assert_eq!(wanted("/excellency"), None);
        assert_eq!(wanted("/axes/state"), None);
    }
}
