//! From the sampler's count of servo periods to stamps of the machine's clock.
//!
//! ```text
//!   t(n) = t_0 + (n - n_0) Δ                                                          (1)
//!   lag(n) = received(n) - t(n),   slip = d(min lag)/dt                               (2)
//! ```
//!
//! `t_0` is the host's instant at which the first record of a run of records came, so that stamps go
//! on when LinuxCNC is started anew; `n` counts servo periods and wraps at 2³¹. Records arrive in
//! lumps, late by up to some 20 ms, never early: the least lag of a block of records is what shows whether
//! the servo thread keeps its period.
//!
//! # Holds when
//! The servo thread runs at its nominal period. Without a real-time kernel it may stand still and
//! not catch up: the slip (2) says so.

use metrology::stamp::{Host, Machine, Span, Stamp};

/// Records in one block of the slip estimate.
const BLOCK: u32 = 1000;

/// How a record follows the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Succession {
    /// The first of all.
    First,
    /// The next one.
    Next,
    /// Records between were lost.
    Lost(u32),
    /// The count began anew, or jumped by more than a minute.
    Restarted,
}

/// Stamps records by their number.
#[derive(Clone, Debug)]
pub struct SampleClock {
    period: Span,
    last: Option<(i32, Stamp<Machine>)>,
    interrupted: bool,
    block: u32,
    least_lag: Span,
    previous: Option<(Span, Stamp<Machine>)>,
    slip: Option<f64>,
}

impl SampleClock {
    /// For records every `period`.
    #[must_use]
    pub fn new(period: Span) -> Self {
        Self {
            period,
            last: None,
            interrupted: false,
            block: 0,
            least_lag: Span::from_nanos(i64::MAX),
            previous: None,
            slip: None,
        }
    }

    /// The count stood still for an unknown time: the next record begins anew.
    pub fn interrupt(&mut self) {
        self.interrupted = true;
    }

    /// Stamp of record `number` that the host received at `received`, by (1).
    pub fn stamp(&mut self, number: i32, received: Stamp<Host>) -> (Stamp<Machine>, Succession) {
        let arrival = Stamp::<Machine>::from_nanos(received.nanos());
        let (stamp, succession) = match self.last {
            None => (arrival, Succession::First),
            Some((last_number, last)) => self.follow(number, last_number, last, arrival),
        };
        self.interrupted = false;
        if matches!(succession, Succession::First | Succession::Restarted) {
            self.restart_slip();
        }
        self.last = Some((number, stamp));
        self.observe_lag(arrival - stamp, stamp);
        (stamp, succession)
    }

    /// How much faster the host's clock runs than the servo thread's, once per second of records; 1.
    pub fn take_slip(&mut self) -> Option<f64> {
        self.slip.take()
    }

    fn follow(
        &self,
        number: i32,
        last_number: i32,
        last: Stamp<Machine>,
        arrival: Stamp<Machine>,
    ) -> (Stamp<Machine>, Succession) {
        let steps = number.wrapping_sub(last_number);
        let advance = Span::from_nanos(self.period.nanos().saturating_mul(i64::from(steps)));
        let minute = 60_000_000_000;
        if self.interrupted || steps < 1 || advance.nanos() > minute {
            let next = last + self.period;
            return (next.max(arrival), Succession::Restarted);
        }
        let succession = match u32::try_from(steps - 1) {
            Ok(0) | Err(_) => Succession::Next,
            Ok(lost) => Succession::Lost(lost),
        };
        (last + advance, succession)
    }

    fn restart_slip(&mut self) {
        self.block = 0;
        self.least_lag = Span::from_nanos(i64::MAX);
        self.previous = None;
    }

    fn observe_lag(&mut self, lag: Span, at: Stamp<Machine>) {
        self.least_lag = self.least_lag.min(lag);
        self.block += 1;
        if self.block < BLOCK {
            return;
        }
        if let Some((previous_lag, previous_at)) = self.previous {
            let change_s = self.least_lag.as_secs_f64() - previous_lag.as_secs_f64();
            self.slip = Some(change_s / (at - previous_at).as_secs_f64());
        }
        self.previous = Some((self.least_lag, at));
        self.block = 0;
        self.least_lag = Span::from_nanos(i64::MAX);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Span = Span::from_nanos(1_000_000);

    fn host(ms: i64) -> Stamp<Host> {
        Stamp::from_nanos(ms * 1_000_000)
    }

    #[test]
    fn eq1_stamps_count_periods_whatever_the_arrival() {
        let mut clock = SampleClock::new(PERIOD);
        let (first, _) = clock.stamp(7, host(100));
        let (second, step) = clock.stamp(8, host(140));
        assert_eq!((second - first, step), (PERIOD, Succession::Next));
        let (third, step) = clock.stamp(11, host(141));
        assert_eq!((third - first).nanos(), 4_000_000);
        assert_eq!(step, Succession::Lost(2));
    }

    #[test]
    fn the_count_may_wrap() {
        let mut clock = SampleClock::new(PERIOD);
        clock.stamp(i32::MAX, host(0));
        assert_eq!(clock.stamp(i32::MIN, host(1)).1, Succession::Next);
    }

    #[test]
    fn stamps_never_run_back_when_the_count_begins_anew() {
        let mut clock = SampleClock::new(PERIOD);
        let (before, _) = clock.stamp(5_000, host(10));
        let (after, step) = clock.stamp(0, host(9));
        assert_eq!(step, Succession::Restarted);
        assert_eq!(after - before, PERIOD);
        assert_eq!(clock.stamp(0, host(20_000)).1, Succession::Restarted);
    }

    #[test]
    fn eq2_a_thread_at_99_percent_of_its_speed_slips_by_one_percent() {
        let mut clock = SampleClock::new(PERIOD);
        let mut slips = Vec::new();
        for n in 0..5_000 {
            // Lumps of 10 records; each period lasts 1/0.99 ms of the host's time.
            let lump_end = f64::from(n / 10 * 10 + 10) / 0.99;
            clock.stamp(n, host(1000) + Span::from_secs_f64(lump_end / 1000.0));
            slips.extend(clock.take_slip());
        }
        assert_eq!(slips.len(), 4);
        for slip in slips {
            assert!((slip - 0.0101).abs() < 0.0005, "{slip}");
        }
    }
}
