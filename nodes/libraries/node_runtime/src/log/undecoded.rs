//! Whether a participant of a secured graph sends what cannot be decrypted.
//!
//! Two participants that agree their keys by finite-field Diffie-Hellman, as Fast DDS asks for, agree different ones in about
//! one handshake of 170: where the secret number begins with a byte 0, the library `openssl` of this process hashes it with
//! that byte at its end, Fast DDS without it. Both then hold each other for authenticated, and hear nothing of each other. The
//! DDS library reports each message in a line of its own; they are counted here, and whoever looks after the nodes reports them once.

use std::sync::atomic::{AtomicU64, Ordering};

use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Context;

use super::deaf::Line;

/// Target of the library's line, and how it begins.
pub(super) const TARGET: &str = "rustdds::rtps::message_receiver";
const BEGIN: &str = "Submessage decoding failed";
/// Messages without which nothing is reported: one handshake in progress leaves a few.
const MIN_MESSAGES: u64 = 50;

/// Lines of this process so far.
static SO_FAR: AtomicU64 = AtomicU64::new(0);

/// Counts the library's lines.
pub(super) struct Count {
    so_far: &'static AtomicU64,
}

impl Count {
    /// Those of this process.
    pub const fn of_process() -> Self {
        Self { so_far: &SO_FAR }
    }
}

impl<S: Subscriber> Layer<S> for Count {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        if *event.metadata().level() == Level::ERROR && is_one(event) {
            self.so_far.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// Whether an event is the library's line about such a message.
fn is_one(event: &Event<'_>) -> bool {
    let line = Line::of(event);
    line.is_from(event, TARGET) && line.message.starts_with(BEGIN)
}

/// Whether an event comes from the part of the library that complains of strangers.
pub(super) fn is_of_strangers(event: &Event<'_>) -> bool {
    Line::of(event).is_from(event, TARGET)
}

/// Looks without a new message after which the next ones are those of another participant: a minute at 20 ms a look.
const QUIET_LOOKS: u32 = 3000;

/// Reports messages that cannot be decrypted, once for each time that they come.
#[derive(Debug, Default)]
pub struct Undecoded {
    is_reported: bool,
    /// Messages when they last began to come, and at the last look.
    before: u64,
    last: u64,
    /// Looks since the last message.
    quiet: u32,
}

impl Undecoded {
    /// A sentence for people when enough of them have come; `None` until others come after a pause.
    pub fn news(&mut self) -> Option<String> {
        let n = SO_FAR.load(Ordering::Relaxed);
        self.news_of(n)
    }

    fn news_of(&mut self, n: u64) -> Option<String> {
        self.quiet = if n == self.last { self.quiet + 1 } else { 0 };
        self.last = n;
        if self.quiet >= QUIET_LOOKS {
            *self = Self {
                before: n,
                last: n,
                ..Self::default()
            };
        }
        let came = n - self.before;
        if self.is_reported || came < MIN_MESSAGES {
            return None;
        }
        self.is_reported = true;
        Some(format!(
            "{came} messages on the secured graph could not be decrypted. Either the keys that were agreed with a participant do not fit, as in one handshake of 170 with Fast DDS (start the one that is not heard again), or somebody sends forged messages"
        ))
    }
}

#[cfg(test)]
mod tests {
    use tracing::error;
    use tracing_subscriber::layer::SubscriberExt as _;

    use super::*;

    /// As RustDDS 0.15.1 words it (`src/rtps/message_receiver.rs`).
    const LINE: &str = "Submessage decoding failed: SecurityError { msg: \"The ring crypto library gives 'Unspecified' error. That's all we are authorized to know. Sorry.\" }";

    fn counted(say: impl FnOnce()) -> u64 {
        let so_far: &'static AtomicU64 = Box::leak(Box::default());
        let subscriber = tracing_subscriber::registry().with(Count { so_far });
        tracing::subscriber::with_default(subscriber, say);
        so_far.load(Ordering::Relaxed)
    }

    #[test]
    fn the_library_s_line_is_counted_and_no_other() {
        let lines = || {
            error!(target: "log", { log.target = TARGET }, "{LINE}");
            error!(target: "rustdds::rtps::message_receiver", "{LINE}");
            error!(target: "log", { log.target = TARGET }, "Destination GUID did not match");
            error!("{LINE}");
        };
        assert_eq!(counted(lines), 2);
    }

    #[test]
    fn a_person_is_told_once_each_time_and_not_of_a_handshake_in_progress() {
        let mut undecoded = Undecoded::default();
        assert_eq!(undecoded.news_of(MIN_MESSAGES - 1), None);
        let said = undecoded.news_of(137).unwrap();
        for words in ["137 messages", "start the one", "forged"] {
            assert!(said.contains(words), "{said}");
        }
        assert_eq!(undecoded.news_of(1000), None);
        // Others come after a pause.
        for _ in 0..=QUIET_LOOKS {
            assert_eq!(undecoded.news_of(1000), None);
        }
        let said = undecoded.news_of(1060).unwrap();
        assert!(said.starts_with("60 messages"), "{said}");
    }
}
