//! From one clock to another: an offset that holds at an instant, and a drift.
//!
//! ```text
//!   to = from + offset + drift (from - at)        (1)
//! ```
//!
//! # Holds when
//! Both clocks run evenly between `at` and the stamp that is taken over. Whoever makes a map says how well it is known.

use crate::stamp::{Clock, Span, Stamp};

/// The way from clock `A` to clock `B`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockMap<A: Clock, B: Clock> {
    at: Stamp<A>,
    there: Stamp<B>,
    drift: f64,
}

impl<A: Clock, B: Clock> ClockMap<A, B> {
    /// The map by which clock `B` shows `there` when clock `A` shows `at`, and gains `drift` seconds per second of `A`.
    #[must_use]
    pub const fn new(at: Stamp<A>, there: Stamp<B>, drift: f64) -> Self {
        Self { at, there, drift }
    }

    /// The instant on `A` at which the offset holds as it stands.
    #[must_use]
    pub const fn at(&self) -> Stamp<A> {
        self.at
    }

    /// What `B` shows at that instant.
    #[must_use]
    pub const fn there(&self) -> Stamp<B> {
        self.there
    }

    /// Seconds that `B` gains per second of `A`.
    #[must_use]
    pub const fn drift(&self) -> f64 {
        self.drift
    }

    /// `B` minus `A` when `A` shows `at`, (1).
    #[must_use]
    pub fn offset(&self, at: Stamp<A>) -> Span {
        let constant = self.there.nanos().saturating_sub(self.at.nanos());
        let gained = Span::from_secs_f64(self.drift * (at - self.at).as_secs_f64());
        Span::from_nanos(constant.saturating_add(gained.nanos()))
    }

    /// What `B` shows when `A` shows `stamp`, (1).
    #[must_use]
    pub fn to(&self, stamp: Stamp<A>) -> Stamp<B> {
        let offset = self.offset(stamp).nanos();
        Stamp::from_nanos(stamp.nanos().saturating_add(offset))
    }

    /// What `A` shows when `B` shows `stamp`: (1) turned round, to the nanosecond's rounding.
    #[must_use]
    pub fn from(&self, stamp: Stamp<B>) -> Stamp<A> {
        let since = (stamp - self.there).as_secs_f64();
        let lag = Span::from_secs_f64(since * self.drift / (1.0 + self.drift));
        self.at + Span::from_nanos((stamp - self.there).nanos().saturating_sub(lag.nanos()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Host, Machine};

    fn map() -> ClockMap<Host, Machine> {
        ClockMap::new(
            Stamp::from_nanos(1_700_000_000_000_000_000),
            Stamp::from_nanos(1_700_000_002_500_000_000),
            40e-6,
        )
    }

    #[test]
    fn eq1_an_offset_grows_by_its_drift() {
        let later = map().at() + Span::from_secs_f64(10.0);
        assert_eq!(map().offset(map().at()).nanos(), 2_500_000_000);
        assert_eq!(map().offset(later).nanos(), 2_500_400_000);
        assert_eq!((map().to(later) - map().there()).nanos(), 10_000_400_000);
    }

    #[test]
    fn eq1_turned_round_gives_the_stamp_back() {
        for seconds in [-3600.0, -1.0, 0.0, 0.123_456_789, 5000.0] {
            let stamp = map().at() + Span::from_secs_f64(seconds);
            let back = map().from(map().to(stamp));
            assert!((back - stamp).nanos().abs() <= 1, "{seconds}");
        }
    }
}
