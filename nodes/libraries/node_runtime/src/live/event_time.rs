//! The time of a node's events: it does not go back unless the clock was set back.

use metrology::stamp::{Host, Span, Stamp};

/// A clock that goes back by less is waited for: time stands still until it has caught up.
const MAX_WAIT_BACK: Span = Span::from_nanos(100_000_000);

/// The time of the last event, and what the clock showed at it.
///
/// A sample's time is that of its arrival. It may have waited while later things happened, for as long as the computer had no
/// time for the node: such a sample has the time of the last event. That the clock was set back shows in the clock alone, which
/// is read anew for each event.
pub(super) struct EventTime {
    last: Stamp<Host>,
    shown: Stamp<Host>,
}

impl EventTime {
    pub const fn new() -> Self {
        Self {
            last: Stamp::from_nanos(i64::MIN),
            shown: Stamp::from_nanos(i64::MIN),
        }
    }

    /// The time of an event that arrived at `arrived` and is handed on when the clock shows `now`; with it by how much the clock
    /// was set back, if it was.
    pub fn of(
        &mut self,
        now: Stamp<Host>,
        arrived: Option<Stamp<Host>>,
    ) -> (Stamp<Host>, Option<Span>) {
        let back = Span::from_nanos(self.shown.nanos().saturating_sub(now.nanos()));
        let was_set = back > MAX_WAIT_BACK;
        if was_set {
            self.last = now;
        }
        self.shown = if was_set { now } else { self.shown.max(now) };
        let at = arrived.map_or(now, |arrived| arrived.min(now));
        self.last = self.last.max(at);
        (self.last, was_set.then_some(back))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> Stamp<Host> {
        Stamp::from_nanos(1_700_000_000_000_000_000) + Span::from_secs_f64(seconds)
    }

    #[test]
    fn a_sample_that_waited_for_a_stalled_computer_is_no_clock_that_went_back() {
        let mut time = EventTime::new();
        assert_eq!(time.of(at(10.0), None), (at(10.0), None));
        let waited = time.of(at(10.001), Some(at(9.2)));
        assert_eq!(waited, (at(10.0), None));
        assert_eq!(time.of(at(10.1), Some(at(10.05))), (at(10.05), None));
    }

    #[test]
    fn a_clock_that_is_set_back_is_followed_and_told_once() {
        let mut time = EventTime::new();
        time.of(at(10.0), None);
        let (now, back) = time.of(at(7.5), None);
        assert_eq!((now, back), (at(7.5), Some(Span::from_secs_f64(2.5))));
        assert_eq!(time.of(at(7.6), None), (at(7.6), None));
    }

    #[test]
    fn a_sample_stamped_before_the_clock_was_set_back_is_of_now() {
        let mut time = EventTime::new();
        time.of(at(10.0), None);
        let (now, back) = time.of(at(5.0), Some(at(10.002)));
        assert_eq!((now, back), (at(5.0), Some(Span::from_secs_f64(5.0))));
        assert_eq!(time.of(at(5.1), None), (at(5.1), None));
    }

    #[test]
    fn a_clock_that_goes_back_a_little_is_waited_for() {
        let mut time = EventTime::new();
        time.of(at(10.0), None);
        assert_eq!(time.of(at(9.95), None), (at(10.0), None));
        assert_eq!(time.of(at(10.02), None), (at(10.02), None));
    }
}
