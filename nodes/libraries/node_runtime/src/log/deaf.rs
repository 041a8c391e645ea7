//! Whether the DDS library of this process still listens.
//!
//! RustDDS 0.15 ends an event loop for ever when its poll is interrupted, as by SIGSTOP and SIGCONT, a debugger or a
//! container's pause. The process then lives on, hears nothing and sends nothing; the library reports it in one line of its
//! log. That line is recognised here, and whoever looks after the nodes ends the process.

use std::fmt::Debug;
use std::sync::OnceLock;

use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Context;

/// Target of the line by which the library reports the end of a loop, and how that line begins.
const LAST_WORDS: [(&str, &str); 2] = [
    ("rustdds::rtps::dp_event_loop", "dp_event_loop poll failed"),
    (
        "rustdds::discovery::discovery",
        "Failed in waiting of poll in discovery",
    ),
];

/// The line with which a loop of this process ended.
static ENDED: OnceLock<String> = OnceLock::new();

/// Why this process neither hears nor sends any more, and what to do; `None`: as far as is known it does.
#[must_use]
pub fn deafness() -> Option<String> {
    ENDED.get().map(|line| sentence(line))
}

fn sentence(line: &str) -> String {
    format!(
        "the DDS library's event loop has ended for good ({line}), as happens when the process is paused (SIGSTOP, a debugger, a container's pause): it neither hears nor sends any more and must be started again"
    )
}

/// Directives under which the last words are heard; a filter that names the library is its author's choice.
pub(super) fn heard(directives: &str) -> String {
    if directives.trim().is_empty() || directives.contains("rustdds") {
        return directives.to_owned();
    }
    let mut all = directives.to_owned();
    for (target, _) in LAST_WORDS {
        all.push_str(&format!(",{target}=error"));
    }
    all
}

/// Keeps the last words of a loop.
pub(super) struct LastWords {
    kept: &'static OnceLock<String>,
}

impl LastWords {
    /// Those of this process.
    pub const fn of_process() -> Self {
        Self { kept: &ENDED }
    }
}

impl<S: Subscriber> Layer<S> for LastWords {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        if *event.metadata().level() != Level::ERROR {
            return;
        }
        let line = Line::of(event);
        if is_last(line.target_of(event), &line.message) {
            let _ = self.kept.set(line.message);
        }
    }
}

/// Whether a line of the library reports the end of a loop.
fn is_last(target: &str, message: &str) -> bool {
    let mut all = LAST_WORDS.into_iter();
    all.any(|(place, begin)| target == place && message.starts_with(begin))
}

/// What a line of a library says.
#[derive(Default)]
pub(super) struct Line {
    target: Option<String>,
    pub message: String,
}

impl Line {
    /// That of an event.
    pub fn of(event: &Event<'_>) -> Self {
        let mut line = Self::default();
        event.record(&mut line);
        line
    }

    /// What comes from the crate `log` names its target in a field.
    fn target_of<'a>(&'a self, event: &'a Event<'_>) -> &'a str {
        let target = self.target.as_deref();
        target.unwrap_or_else(|| event.metadata().target())
    }

    /// Whether it is from there.
    pub fn is_from(&self, event: &Event<'_>, target: &str) -> bool {
        self.target_of(event) == target
    }
}

impl Visit for Line {
    fn record_str(&mut self, field: &Field, value: &str) {
        match field.name() {
            "message" => value.clone_into(&mut self.message),
            "log.target" => self.target = Some(value.to_owned()),
            _ => {}
        }
    }

    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            self.message = format!("{value:?}");
        }
    }
}

#[cfg(test)]
mod tests {
    use tracing::error;
    use tracing_subscriber::layer::SubscriberExt as _;

    use super::*;

    /// As RustDDS 0.15.1 words it (`src/rtps/dp_event_loop.rs`, `src/discovery/discovery.rs`), with EINTR.
    const LOOP: &str = "dp_event_loop poll failed: Os { code: 4, kind: Interrupted, message: \"Interrupted system call\" }";
    const DISCOVERY: &str = "Failed in waiting of poll in discovery. Os { code: 4, kind: Interrupted, message: \"Interrupted system call\" }";

    /// What is kept of the lines that `say` writes.
    fn kept(say: impl FnOnce()) -> Option<String> {
        let kept: &'static OnceLock<String> = Box::leak(Box::new(OnceLock::new()));
        let subscriber = tracing_subscriber::registry().with(LastWords { kept });
        tracing::subscriber::with_default(subscriber, say);
        kept.get().cloned()
    }

    #[test]
    fn the_end_of_an_event_loop_is_recognised_by_its_target_and_words() {
        let of_log = || {
            error!(target: "log", { log.target = "rustdds::rtps::dp_event_loop" }, "{LOOP}");
        };
        assert_eq!(kept(of_log).as_deref(), Some(LOOP));
        let of_discovery = || {
            error!(target: "log", { log.target = "rustdds::discovery::discovery" }, "{DISCOVERY}");
        };
        assert_eq!(kept(of_discovery).as_deref(), Some(DISCOVERY));
        let direct = || error!(target: "rustdds::rtps::dp_event_loop", "{LOOP}");
        assert_eq!(kept(direct).as_deref(), Some(LOOP));
    }

    #[test]
    fn no_other_line_ends_a_process() {
        let others = || {
            error!(target: "log", { log.target = "rustdds::rtps::dp_event_loop" }, "Token too big");
            error!(target: "log", { log.target = "rustdds::rtps::writer" }, "{LOOP}");
            error!("{LOOP}");
            tracing::warn!(target: "log", { log.target = "rustdds::rtps::dp_event_loop" }, "{LOOP}");
        };
        assert_eq!(kept(others), None);
    }

    #[test]
    fn a_person_is_told_what_happened_and_what_to_do() {
        let said = sentence(LOOP);
        for words in ["Interrupted", "SIGSTOP", "must be started again"] {
            assert!(said.contains(words), "{said}");
        }
    }

    #[test]
    fn a_filter_for_other_lines_lets_the_last_words_through() {
        let all =
            "abbe=info,rustdds::rtps::dp_event_loop=error,rustdds::discovery::discovery=error";
        assert_eq!(heard("abbe=info"), all);
        assert_eq!(heard("info,rustdds=off"), "info,rustdds=off");
        assert_eq!(heard(""), "");
    }
}
