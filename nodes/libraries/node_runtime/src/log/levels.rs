//! Which lines are said: the program's filter, and above it the level that was chosen for a node.

use std::sync::atomic::{AtomicU8, Ordering};

use tracing::level_filters::LevelFilter;
use tracing::span::{Attributes, Id, Record};
use tracing::subscriber::Interest;
use tracing::{Metadata, Subscriber};
use tracing_subscriber::layer::Context;
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::{EnvFilter, Layer};

use super::speakers;

/// A level as ROS 2 counts them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub(crate) enum Severity {
    Debug = 10,
    Info = 20,
    Warn = 30,
    Error = 40,
    Fatal = 50,
}

const SEVERITIES: [(&str, Severity); 5] = [
    ("debug", Severity::Debug),
    ("info", Severity::Info),
    ("warn", Severity::Warn),
    ("error", Severity::Error),
    ("fatal", Severity::Fatal),
];

impl Severity {
    /// By the number in `rcl_interfaces/LoggerLevel`.
    pub fn of_number(number: u32) -> Option<Self> {
        let mut all = SEVERITIES.into_iter().map(|(_, severity)| severity);
        all.find(|severity| u32::from(severity.number()) == number)
    }

    /// By the word after `--log-level`; what is below debug is debug to ROS.
    pub fn of_word(word: &str) -> Option<Self> {
        let word = if word == "trace" { "debug" } else { word };
        let mut all = SEVERITIES.into_iter();
        all.find(|(name, _)| *name == word)
            .map(|(_, severity)| severity)
    }

    /// The number in `rcl_interfaces/LoggerLevel`.
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// No line of ours is fatal: who ends, says so as an error.
    const fn filter(self) -> LevelFilter {
        match self {
            Self::Debug => LevelFilter::DEBUG,
            Self::Info => LevelFilter::INFO,
            Self::Warn => LevelFilter::WARN,
            Self::Error => LevelFilter::ERROR,
            Self::Fatal => LevelFilter::OFF,
        }
    }
}

/// The most talkative of the levels that were chosen, as its number; this when there is none.
static LOWEST: AtomicU8 = AtomicU8::new(NONE_CHOSEN);
const NONE_CHOSEN: u8 = u8::MAX;

/// Looks at all choices again, and has every line of the program judged anew.
pub(super) fn changed() {
    let lowest = speakers()
        .values()
        .filter_map(|speaker| speaker.chosen)
        .min();
    let lowest = lowest.map_or(NONE_CHOSEN, Severity::number);
    if LOWEST.swap(lowest, Ordering::SeqCst) != lowest {
        tracing::callsite::rebuild_interest_cache();
    }
}

fn most_talkative() -> Option<LevelFilter> {
    let lowest = LOWEST.load(Ordering::SeqCst);
    Severity::of_number(u32::from(lowest)).map(Severity::filter)
}

/// Whose lines are not a node's, wherever they are said.
const FOREIGN: [&str; 6] = [
    "rustdds",
    "ros2_client",
    "mio",
    "opcua_client",
    "opcua_core",
    "opcua_crypto",
];
/// What the names of all of Zenoh's crates begin with.
const ZENOH: &str = "zenoh";

fn is_ours(metadata: &Metadata<'_>) -> bool {
    let owner = metadata.target().split("::").next().unwrap_or_default();
    metadata.is_event() && !FOREIGN.contains(&owner) && !owner.starts_with(ZENOH)
}

/// The span that says whose lines are said inside it; without it a node could not be told from others.
fn is_node(metadata: &Metadata<'_>) -> bool {
    metadata.is_span() && metadata.name() == NODE_SPAN && is_from_here(metadata)
}

fn is_from_here(metadata: &Metadata<'_>) -> bool {
    let own = module_path!().split("::").next();
    metadata.target().split("::").next() == own
}

/// What the span of a node is called, and below which level it lies.
pub(crate) const NODE_SPAN: &str = "node";
const NODE_SPAN_LEVEL: LevelFilter = LevelFilter::ERROR;

/// The program's filter with the nodes' levels above it.
pub(super) struct Levels {
    program: EnvFilter,
}

impl Levels {
    pub fn above(program: EnvFilter) -> Self {
        Self { program }
    }
}

/// What was chosen for the node in whose span the program is.
fn chosen_here<S>(context: &Context<'_, S>) -> Option<LevelFilter>
where
    S: Subscriber + for<'lookup> LookupSpan<'lookup>,
{
    most_talkative()?;
    let speakers = speakers();
    let mut spans = context.lookup_current()?.scope();
    spans
        .find_map(|span| {
            speakers
                .get(&span.id().into_u64())
                .map(|found| found.chosen)
        })
        .flatten()
        .map(Severity::filter)
}

impl<S> Layer<S> for Levels
where
    S: Subscriber + for<'lookup> LookupSpan<'lookup>,
{
    fn register_callsite(&self, metadata: &'static Metadata<'static>) -> Interest {
        let program = Layer::<S>::register_callsite(&self.program, metadata);
        if is_node(metadata) {
            Interest::always()
        } else if most_talkative().is_some() && is_ours(metadata) {
            Interest::sometimes()
        } else {
            program
        }
    }

    fn enabled(&self, metadata: &Metadata<'_>, context: Context<'_, S>) -> bool {
        if is_node(metadata) {
            return true;
        }
        let chosen = is_ours(metadata).then(|| chosen_here(&context)).flatten();
        match chosen {
            Some(most) => *metadata.level() <= most,
            None => Layer::<S>::enabled(&self.program, metadata, context),
        }
    }

    fn max_level_hint(&self) -> Option<LevelFilter> {
        let program = Layer::<S>::max_level_hint(&self.program)?;
        let least = program.max(NODE_SPAN_LEVEL);
        Some(most_talkative().map_or(least, |most| most.max(least)))
    }

    fn on_new_span(&self, attributes: &Attributes<'_>, id: &Id, context: Context<'_, S>) {
        self.program.on_new_span(attributes, id, context);
    }

    fn on_record(&self, id: &Id, values: &Record<'_>, context: Context<'_, S>) {
        Layer::<S>::on_record(&self.program, id, values, context);
    }

    fn on_enter(&self, id: &Id, context: Context<'_, S>) {
        Layer::<S>::on_enter(&self.program, id, context);
    }

    fn on_exit(&self, id: &Id, context: Context<'_, S>) {
        Layer::<S>::on_exit(&self.program, id, context);
    }

    fn on_close(&self, id: Id, context: Context<'_, S>) {
        self.program.on_close(id, context);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_have_the_numbers_and_words_of_ros() {
        for (word, number) in [("debug", 10), ("info", 20), ("warn", 30), ("error", 40)] {
            let severity = Severity::of_word(word).unwrap();
            assert_eq!(u32::from(severity.number()), number);
            assert_eq!(Severity::of_number(number), Some(severity));
        }
        assert_eq!(Severity::of_word("trace"), Some(Severity::Debug));
        assert_eq!(Severity::of_number(0), None);
        assert_eq!(Severity::of_number(11), None);
    }
}
