//! Where the playing thread and those who steer it meet.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use metrology::stamp::{Host, Span, Stamp};
use replayer::pace::{Due, Pace};
use replayer::pause::Pause;

use crate::player::Played;

/// How far the playing is.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    /// Time of the bag.
    pub at: Stamp<Host>,
    /// Messages sent so far.
    pub sent: u64,
    /// Whether it stands.
    pub paused: bool,
    /// Where nothing was recorded for long: the last such pause that has begun, and how many have.
    pub pause: Option<(usize, Pause)>,
    /// What it came to, or why it failed, once it has come to its end.
    pub over: Option<Result<Played, String>>,
}

struct State {
    pace: Pace,
    steps: u32,
    sent: u64,
    pause: Option<(usize, Pause)>,
    stop: bool,
    over: Option<Result<Played, String>>,
}

/// State of a playing bag, shared.
pub struct Desk {
    began: Instant,
    state: Mutex<State>,
    changed: Condvar,
}

/// What the playing thread does next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Send the message.
    Send,
    /// Tell the time, then ask again.
    TellTime(Stamp<Host>),
    /// End.
    Stop,
}

impl Desk {
    /// Begins at `from`.
    #[expect(clippy::disallowed_methods, reason = "a bag is played against a clock")]
    pub(crate) fn new(from: Stamp<Host>, rate: Option<f64>, paused: bool) -> Self {
        let mut pace = Pace::new(from, 0, rate);
        if paused {
            pace.pause(0);
        }
        Self {
            began: Instant::now(),
            state: Mutex::new(State {
                pace,
                steps: 0,
                sent: 0,
                pause: None,
                stop: false,
                over: None,
            }),
            changed: Condvar::new(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now_nanos(&self) -> i64 {
        i64::try_from(self.began.elapsed().as_nanos()).unwrap_or(i64::MAX)
    }

    /// How far it is.
    #[must_use]
    pub fn progress(&self) -> Progress {
        let state = self.state();
        Progress {
            at: state.pace.bag_time(self.now_nanos()),
            sent: state.sent,
            paused: state.pace.is_paused(),
            pause: state.pause,
            over: state.over.clone(),
        }
    }

    /// Lets the bag's time stand; false when it stood already.
    pub fn pause(&self) -> bool {
        self.change(|state, now| state.pace.pause(now))
    }

    /// Lets it run on; false when it ran already.
    pub fn resume(&self) -> bool {
        self.change(|state, now| {
            state.steps = 0;
            state.pace.resume(now)
        })
    }

    /// Sends the next message of a bag that stands; false when it runs.
    pub fn step(&self) -> bool {
        self.change(|state, _| {
            let stands = state.pace.is_paused();
            state.steps += u32::from(stands);
            stands
        })
    }

    /// A long time begins in which nothing was recorded.
    pub(crate) fn begin_pause(&self, pause: Pause) {
        self.change(|state, _| {
            let before = state.pause.map_or(0, |(n, _)| n);
            state.pause = Some((before + 1, pause));
        });
    }

    pub(crate) fn stop(&self) {
        self.change(|state, _| state.stop = true);
    }

    pub(crate) fn end(&self, outcome: Result<Played, String>) {
        self.change(|state, _| state.over = Some(outcome));
    }

    pub(crate) fn again(&self, from: Stamp<Host>) {
        self.change(|state, now| state.pace.again(from, now));
    }

    fn change<T>(&self, act: impl FnOnce(&mut State, i64) -> T) -> T {
        let result = act(&mut self.state(), self.now_nanos());
        self.changed.notify_all();
        result
    }

    /// Waits until the message of time `at` is due, at most `patience`.
    pub(crate) fn next(&self, at: Stamp<Host>, patience: Duration) -> Next {
        let mut state = self.state();
        let mut waited = false;
        loop {
            if state.stop {
                return Next::Stop;
            }
            let now = self.now_nanos();
            let wait = match state.pace.due(at, now) {
                Due::Now => Duration::ZERO,
                Due::Paused if state.steps > 0 => {
                    state.steps -= 1;
                    Duration::ZERO
                }
                Due::Paused => patience,
                Due::In(span) => patience.min(duration(span)),
            };
            if wait.is_zero() {
                state.pace.sent(at);
                state.sent += 1;
                return Next::Send;
            }
            if waited {
                return Next::TellTime(state.pace.bag_time(now));
            }
            waited = wait == patience;
            state = self
                .changed
                .wait_timeout(state, wait)
                .unwrap_or_else(PoisonError::into_inner)
                .0;
        }
    }
}

fn duration(span: Span) -> Duration {
    Duration::from_nanos(u64::try_from(span.nanos()).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATIENCE: Duration = Duration::from_millis(5);

    fn at(s: i64) -> Stamp<Host> {
        Stamp::from_nanos(s * 1_000_000_000)
    }

    #[test]
    fn a_bag_that_stands_sends_one_message_a_step_and_tells_the_time_meanwhile() {
        let desk = Desk::new(at(10), Some(1.0), true);
        assert_eq!(desk.next(at(11), PATIENCE), Next::TellTime(at(10)));
        assert!(desk.step());
        assert_eq!(desk.next(at(11), PATIENCE), Next::Send);
        assert_eq!(desk.next(at(12), PATIENCE), Next::TellTime(at(11)));
        assert!(!desk.pause(), "it stands already");
        assert!(desk.resume());
        assert!(!desk.step(), "it runs");
        assert_eq!(desk.progress().sent, 1);
    }

    #[test]
    fn whoever_waits_is_told_to_stop_at_once() {
        let desk = std::sync::Arc::new(Desk::new(at(0), Some(1.0), false));
        let waiting = std::sync::Arc::clone(&desk);
        let thread = std::thread::spawn(move || waiting.next(at(1_000), Duration::from_secs(60)));
        desk.stop();
        assert_eq!(thread.join().unwrap(), Next::Stop);
    }
}
