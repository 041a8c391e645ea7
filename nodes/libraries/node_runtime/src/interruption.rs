//! SIGINT, SIGTERM and SIGHUP: the first asks for an end in good order, a second SIGINT for one at once.
//!
//! SIGHUP comes when the terminal or the connection to it is closed. A program that was started with it ignored (`nohup`) goes
//! on ignoring it.

use crate::complain;

use std::future::pending;
use std::process;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use anyhow::Context as _;
use procfs::process::Process;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::time::Instant;

/// A terminal and a launcher may both pass one Ctrl-C on: what comes within this is the same one.
const SAME: Duration = Duration::from_millis(500);
/// What has not ended this long after it was forced to is left as it is.
const LAST_PATIENCE: Duration = Duration::from_secs(5);
/// Exit code of a process that was left as it was.
const LEFT: i32 = 1;

/// How urgently the process has been asked to end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
enum Asked {
    #[default]
    No,
    ToEnd,
    AtOnce,
}

#[derive(Default)]
struct State {
    asked: Mutex<Asked>,
    changed: Condvar,
}

impl State {
    fn asked(&self) -> MutexGuard<'_, Asked> {
        self.asked.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Whether this process has been asked to end. From [`Self::listen`] on, the signals do nothing else.
#[derive(Clone, Default)]
pub struct Interruption(Arc<State>);

impl Interruption {
    /// Begins to listen, for the rest of the process' life.
    ///
    /// SIGHUP is left alone where it was ignored before this process began. A second SIGINT is reported on standard error, and
    /// `to_keep` names there what will be saved. A process that has not ended 5 s after it exits with code 1.
    ///
    /// # Errors
    /// When the signals or a thread cannot be had.
    pub fn listen(to_keep: &'static str) -> anyhow::Result<Self> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .context("tokio runtime")?;
        let (mut interrupt, mut terminate, mut hangup) = {
            let _inside = runtime.enter();
            let interrupt = signal(SignalKind::interrupt()).context("SIGINT")?;
            let terminate = signal(SignalKind::terminate()).context("SIGTERM")?;
            (interrupt, terminate, hangups()?)
        };
        let interruption = Self::default();
        let told = interruption.clone();
        let listen = async move {
            tokio::select! {
                _ = interrupt.recv() => {}
                _ = terminate.recv() => {}
                () = received(hangup.as_mut()) => {}
            }
            told.ask(Asked::ToEnd);
            let first = Instant::now();
            loop {
                interrupt.recv().await;
                if first.elapsed() > SAME {
                    break;
                }
            }
            told.ask(Asked::AtOnce);
            complain!("second SIGINT: ending at once; {to_keep}");
            tokio::time::sleep(LAST_PATIENCE).await;
            let patience_s = LAST_PATIENCE.as_secs();
            complain!("not ended within {patience_s} s of the second SIGINT: left as it is");
            process::exit(LEFT);
        };
        std::thread::Builder::new()
            .name("signals".to_owned())
            .spawn(move || runtime.block_on(listen))
            .context("thread of the signals")?;
        Ok(interruption)
    }

    /// One that nobody will ever ask.
    #[must_use]
    pub fn never() -> Self {
        Self::default()
    }

    fn ask(&self, how: Asked) {
        *self.0.asked() = how;
        self.0.changed.notify_all();
    }

    /// Whether an end was asked for.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        *self.0.asked() >= Asked::ToEnd
    }

    /// Whether an end at once was asked for.
    #[must_use]
    pub fn is_forced(&self) -> bool {
        *self.0.asked() == Asked::AtOnce
    }

    /// Waits until an end is asked for, `at_most` so long; whether it was.
    #[must_use]
    pub fn wait(&self, at_most: Duration) -> bool {
        self.wait_for(Asked::ToEnd, at_most)
    }

    /// Waits until an end at once is asked for, `at_most` so long; whether it was.
    #[must_use]
    pub fn wait_until_forced(&self, at_most: Duration) -> bool {
        self.wait_for(Asked::AtOnce, at_most)
    }

    fn wait_for(&self, least: Asked, at_most: Duration) -> bool {
        let not_yet = |asked: &mut Asked| *asked < least;
        let waited = self
            .0
            .changed
            .wait_timeout_while(self.0.asked(), at_most, not_yet);
        let (asked, _) = waited.unwrap_or_else(PoisonError::into_inner);
        *asked >= least
    }
}

/// Number of SIGHUP.
const HANGUP: u32 = 1;

/// The signal of a closed terminal; `None`: it was ignored when this process began.
fn hangups() -> anyhow::Result<Option<Signal>> {
    let status = Process::myself().and_then(|own| own.status());
    // Where the system does not say, it is listened to: an end in good order is the safe one.
    let ignored = status.map_or(0, |status| status.sigign);
    if is_in(ignored, HANGUP) {
        return Ok(None);
    }
    let hangup = signal(SignalKind::hangup()).context("SIGHUP")?;
    Ok(Some(hangup))
}

/// Whether a mask of `/proc` names a signal; its lowest bit is signal 1.
const fn is_in(mask: u64, number: u32) -> bool {
    (mask >> (number - 1)) & 1 == 1
}

/// Waits for a signal; for ever where it is not listened to.
async fn received(signal: Option<&mut Signal>) {
    match signal {
        Some(signal) => {
            let _ = signal.recv().await;
        }
        None => pending().await,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_names_signals_from_its_lowest_bit_on() {
        assert!(is_in(0x1, HANGUP) && is_in(0x4001, HANGUP) && is_in(0x4001, 15));
        assert!(!is_in(0x4000, HANGUP) && !is_in(0, HANGUP) && !is_in(0x1, 15));
    }

    #[test]
    fn a_waiter_wakes_when_it_is_asked_and_not_before() {
        let interruption = Interruption::never();
        assert!(!interruption.wait(Duration::from_millis(5)));
        let asking = interruption.clone();
        let asked = std::thread::spawn(move || asking.ask(Asked::ToEnd));
        assert!(interruption.wait(Duration::from_secs(10)));
        asked.join().unwrap();
        assert!(interruption.is_asked() && !interruption.is_forced());
        assert!(!interruption.wait_until_forced(Duration::from_millis(5)));
        interruption.ask(Asked::AtOnce);
        assert!(interruption.wait_until_forced(Duration::ZERO) && interruption.is_asked());
    }
}
