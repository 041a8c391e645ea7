//! What a node could not use of what it was sent: counted by port and reason, with the time of the first.

use std::collections::BTreeMap;

use metrology::Stamp;
use metrology::stamp::Host;

use crate::diagnostic::{Diagnostic, Level};

/// Inputs of one port that were refused for one reason.
#[derive(Clone, Copy, Debug)]
struct Refused {
    inputs: u64,
    first: Stamp<Host>,
}

/// By port and reason; both are few.
#[derive(Debug, Default)]
pub(super) struct Refusals(BTreeMap<String, BTreeMap<&'static str, Refused>>);

/// The counter of a port and a reason, for the node's own values.
pub(super) struct Counter {
    pub name: String,
    pub inputs: u64,
}

impl Refusals {
    /// Counts an input that came `at` and was refused; `what` is wrong with it. The condition `name/PORT`, and the
    /// port's counter for this reason.
    pub fn add(
        &mut self,
        (name, port): (&str, &str),
        reason: &'static str,
        at: Stamp<Host>,
        what: &str,
    ) -> (Diagnostic, Counter) {
        let of_port = self.0.entry(port.to_owned()).or_default();
        let refused = of_port.entry(reason).or_insert(Refused {
            inputs: 0,
            first: at,
        });
        refused.inputs += 1;
        let counter = Counter {
            name: format!("{port} refused, {reason}"),
            inputs: refused.inputs,
        };
        let counts: Vec<String> = of_port
            .iter()
            .map(|(reason, it)| {
                let first_s = it.first.as_secs_f64();
                format!("{} {reason}, the first at {first_s:.3} s", it.inputs)
            })
            .collect();
        let all: u64 = of_port.values().map(|it| it.inputs).sum();
        let first = of_port.values().map(|it| it.first).min().unwrap_or(at);
        let message = format!("{what}; refused since the start: {}", counts.join("; "));
        let name = format!("{name}/{}", port.trim_start_matches('/'));
        let diagnostic = Diagnostic::new(Level::Error, name, message)
            .with("port", port)
            .with("reason", reason)
            .with("refused", all)
            .with("first_s", format!("{:.3}", first.as_secs_f64()));
        (diagnostic, counter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_are_counted_by_port_and_reason_with_the_first_time() {
        let mut refusals = Refusals::default();
        let at = |s: i64| Stamp::from_nanos(s * 1_000_000_000);
        let add = |refusals: &mut Refusals, port, reason, s| {
            refusals.add(("input_refused", port), reason, at(s), "bad")
        };
        add(&mut refusals, "axes/state", "malformed", 5);
        add(&mut refusals, "latency", "malformed", 6);
        add(&mut refusals, "axes/state", "not finite", 7);
        let (told, counter) = add(&mut refusals, "axes/state", "malformed", 8);
        assert_eq!(told.name, "input_refused/axes/state");
        assert_eq!(
            told.message,
            "bad; refused since the start: 2 malformed, the first at 5.000 s; 1 not finite, the first at 7.000 s"
        );
        assert!(told.values.contains(&("refused", "3".to_owned())));
        assert!(told.values.contains(&("first_s", "5.000".to_owned())));
        let counter = (counter.name.as_str(), counter.inputs);
        assert_eq!(counter, ("axes/state refused, malformed", 2));
    }
}
