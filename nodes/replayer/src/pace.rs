//! When each message of a bag is due while it is played: faster, slower, paused, step by step.
//!
//! # Model
//!
//! The bag's clock b runs against a steady clock w from an anchor that moves with every change of pace:
//!
//! ```text
//!   b(w) = b0 + r (w - w0),   w(b) = w0 + (b - b0) / r                    (1)
//! ```
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | b | time of the bag | ns |
//! | w | time of a steady clock | ns |
//! | r | rate, bag time over steady time | 1 |
//!
//! While paused b stands. Without a rate nothing is waited for: b is the time of the last message.

use metrology::stamp::{Host, Span, Stamp};

/// When a message is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Due {
    /// At once.
    Now,
    /// After so long.
    In(Span),
    /// When somebody lets the bag go on.
    Paused,
}

/// How the bag's clock runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    rate: Option<f64>,
    paused: bool,
    bag: Stamp<Host>,
    steady_nanos: i64,
}

impl Pace {
    /// Begins at the bag's time `first`, at `rate` (`None`: as fast as can be); `steady_nanos` is the steady clock.
    #[must_use]
    pub fn new(first: Stamp<Host>, steady_nanos: i64, rate: Option<f64>) -> Self {
        Self {
            rate,
            paused: false,
            bag: first,
            steady_nanos,
        }
    }

    /// The bag's time, equation (1).
    #[must_use]
    pub fn bag_time(&self, steady_nanos: i64) -> Stamp<Host> {
        match self.rate {
            Some(rate) if !self.paused => {
                let passed_s = Span::from_nanos(steady_nanos - self.steady_nanos).as_secs_f64();
                self.bag + Span::from_secs_f64(passed_s * rate)
            }
            _ => self.bag,
        }
    }

    /// When a message of the bag's time `at` is due.
    #[must_use]
    pub fn due(&self, at: Stamp<Host>, steady_nanos: i64) -> Due {
        if self.paused {
            return Due::Paused;
        }
        let Some(rate) = self.rate else {
            return Due::Now;
        };
        let wait_s = (at - self.bag_time(steady_nanos)).as_secs_f64() / rate;
        if wait_s > 0.0 {
            Due::In(Span::from_secs_f64(wait_s))
        } else {
            Due::Now
        }
    }

    /// A message of this time was sent: what is never waited for, or stands, goes on to it.
    pub fn sent(&mut self, at: Stamp<Host>) {
        if self.paused || self.rate.is_none() {
            self.bag = at;
        }
    }

    /// Lets the bag's time stand; true when it ran.
    pub fn pause(&mut self, steady_nanos: i64) -> bool {
        let ran = !self.paused;
        self.anchor(steady_nanos);
        self.paused = true;
        ran
    }

    /// Lets it run on from where it stands; true when it stood.
    pub fn resume(&mut self, steady_nanos: i64) -> bool {
        let stood = self.paused;
        self.anchor(steady_nanos);
        self.paused = false;
        stood
    }

    /// Whether it stands.
    #[must_use]
    pub fn is_paused(&self) -> bool {
        self.paused
    }

    /// Begins at the bag's time `first` again, paused or not as it is.
    pub fn again(&mut self, first: Stamp<Host>, steady_nanos: i64) {
        self.bag = first;
        self.steady_nanos = steady_nanos;
    }

    fn anchor(&mut self, steady_nanos: i64) {
        self.bag = self.bag_time(steady_nanos);
        self.steady_nanos = steady_nanos;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    fn at(s: i64) -> Stamp<Host> {
        Stamp::from_nanos(s * S)
    }

    #[test]
    fn eq1_a_message_is_due_after_its_time_in_the_bag_over_the_rate() {
        let pace = Pace::new(at(100), 5 * S, Some(4.0));
        assert_eq!(pace.due(at(108), 5 * S), Due::In(Span::from_nanos(2 * S)));
        assert_eq!(pace.due(at(108), 7 * S), Due::Now);
        assert_eq!(pace.bag_time(6 * S), at(104));
    }

    #[test]
    fn a_pause_moves_every_later_message_by_its_length() {
        let mut pace = Pace::new(at(0), 0, Some(1.0));
        assert!(pace.pause(2 * S));
        assert!(!pace.pause(3 * S));
        assert_eq!(pace.due(at(1), 9 * S), Due::Paused);
        assert_eq!(pace.bag_time(9 * S), at(2));
        assert!(pace.resume(10 * S));
        assert_eq!(pace.due(at(3), 10 * S), Due::In(Span::from_nanos(S)));
    }

    #[test]
    fn a_step_takes_the_standing_clock_to_its_message() {
        let mut pace = Pace::new(at(0), 0, Some(1.0));
        pace.pause(S);
        pace.sent(at(7));
        assert_eq!(pace.bag_time(90 * S), at(7));
        pace.resume(90 * S);
        assert_eq!(pace.due(at(8), 90 * S), Due::In(Span::from_nanos(S)));
    }

    #[test]
    fn without_a_rate_nothing_is_waited_for_and_the_clock_is_the_last_message() {
        let mut pace = Pace::new(at(0), 0, None);
        assert_eq!(pace.due(at(1_000), 0), Due::Now);
        pace.sent(at(1_000));
        assert_eq!(pace.bag_time(0), at(1_000));
        pace.again(at(0), 0);
        assert_eq!(pace.bag_time(0), at(0));
    }
}
