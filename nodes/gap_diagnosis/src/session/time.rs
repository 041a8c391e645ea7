//! The session's time: host stamps made to go on where a clock jumps or another bag begins.

use metrology::stamp::{Host, Span, Stamp};

use super::recent::LATE_S;

/// A sample this much newer than the newest one means that the clock jumped: no session rests longer, and what is held of
/// its past grows with it.
const LONGEST_REST: Span = Span::from_nanos(7 * 86_400 * 1_000_000_000);
/// Between a jump, or a bag that is older than the one before it, and what came before.
const PAUSE: Span = Span::from_nanos(60_000_000_000);

/// Maps stamps to seconds since the session's start.
#[derive(Clone, Debug, Default)]
pub(super) struct SessionTime {
    start: Option<Stamp<Host>>,
    newest: Stamp<Host>,
    shift: Span,
}

/// What a stamp means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum At {
    /// Seconds since the session's start.
    Time(f64),
    /// The clock jumped back, or far ahead; the seconds go on after a pause.
    Jumped(f64),
}

impl SessionTime {
    /// The time of the newest sample.
    pub(super) fn newest_s(&self) -> f64 {
        self.start
            .map_or(0.0, |start| (self.newest - start).as_secs_f64())
    }

    /// The time of something that may be told long after it was.
    pub(super) fn of(&mut self, at: Stamp<Host>) -> f64 {
        let start = *self.start.get_or_insert_with(|| {
            self.newest = at;
            at
        });
        (at + self.shift - start).as_secs_f64().max(0.0)
    }

    /// The time of a sample that drives the clock.
    pub(super) fn take(&mut self, at: Stamp<Host>) -> At {
        let start = *self.start.get_or_insert_with(|| {
            self.newest = at;
            at
        });
        let mut shifted = at + self.shift;
        // A sample that is a little older than the newest one is late; an older one means that the clock jumped.
        let late_s = (self.newest - shifted).as_secs_f64();
        let jumped = late_s > LATE_S || shifted - self.newest > LONGEST_REST;
        if jumped {
            self.shift = self.newest + PAUSE - at;
            shifted = at + self.shift;
        }
        self.newest = self.newest.max(shifted);
        let time_s = (shifted - start).as_secs_f64();
        if jumped {
            At::Jumped(time_s)
        } else {
            At::Time(time_s)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(seconds: i64) -> Stamp<Host> {
        Stamp::from_nanos(seconds * 1_000_000_000)
    }

    #[test]
    fn a_jump_back_goes_on_after_a_pause() {
        let mut time = SessionTime::default();
        assert_eq!(time.take(at(100)), At::Time(0.0));
        assert_eq!(time.take(at(110)), At::Time(10.0));
        assert_eq!(time.take(at(50)), At::Jumped(70.0));
        assert_eq!(time.take(at(55)), At::Time(75.0));
    }

    #[test]
    fn a_jump_far_ahead_goes_on_after_a_pause_and_a_weekend_is_none() {
        let mut time = SessionTime::default();
        assert_eq!(time.take(at(100)), At::Time(0.0));
        assert_eq!(time.take(at(180_100)), At::Time(180_000.0));
        assert_eq!(time.take(at(9_000_000_000)), At::Jumped(180_060.0));
        assert_eq!(time.take(at(9_000_000_005)), At::Time(180_065.0));
        // Back from there to the true time.
        assert_eq!(time.take(at(180_110)), At::Jumped(180_125.0));
    }

    #[test]
    fn a_sample_that_is_a_little_late_keeps_its_time() {
        let mut time = SessionTime::default();
        let _ = time.take(at(100));
        let _ = time.take(at(101));
        assert_eq!(time.take(Stamp::from_nanos(100_500_000_000)), At::Time(0.5));
    }
}
