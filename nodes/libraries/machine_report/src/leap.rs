//! Leaps of a machine's clock: it is set, it starts without a battery in 1970, one stamp is wrong.
//!
//! A stamp leaps when it goes on by more, or by less, than the host's time did since the one before it:
//!
//! ```text
//!   |(t_k − t_{k−1}) − (T_k − T_{k−1})| > L                                                  (1)
//! ```
//!
//! with t by the machine and T by the host. What an adapter tells when it is asked first are values that hold, whose
//! stamps may be days old and in no order: for that while only years are a leap.

use metrology::stamp::{Host, Machine, Span, Stamp};

/// L in (1); a clock that moves by less is reported per value where it goes back.
pub const LEAP: Span = Span::from_nanos(3_600_000_000_000);
/// For so long after its first stamp a connection tells values that hold.
const OPENING: Span = Span::from_nanos(10_000_000_000);
/// L in (1) for that while: three years.
const OPENING_LEAP: Span = Span::from_nanos(3 * 31_557_600_000_000_000);

/// A leap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leap {
    /// The stamp before it.
    pub from: Stamp<Machine>,
    /// The stamp behind it.
    pub to: Stamp<Machine>,
    /// Host's time between both; `None`: of a log.
    pub passed: Option<Span>,
}

/// Watches the stamps of a connection.
#[derive(Clone, Copy, Debug, Default)]
pub struct Watch {
    began: Option<Stamp<Host>>,
    last: Option<(Stamp<Machine>, Stamp<Host>)>,
}

impl Watch {
    /// Takes a stamp of the machine's that came at `received_at`.
    pub fn hear(&mut self, at: Stamp<Machine>, received_at: Stamp<Host>) -> Option<Leap> {
        let began = *self.began.get_or_insert(received_at);
        let (from, since) = self.last.replace((at, received_at))?;
        let passed = received_at - since;
        let off = (at - from).nanos().saturating_sub(passed.nanos());
        let limit = if received_at - began < OPENING {
            OPENING_LEAP
        } else {
            LEAP
        };
        (off.saturating_abs() > limit.nanos()).then_some(Leap {
            from,
            to: at,
            passed: Some(passed),
        })
    }

    /// The connection has ended.
    pub fn forget(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at<C: metrology::Clock>(second: i64) -> Stamp<C> {
        Stamp::from_nanos(second * 1_000_000_000)
    }

    /// Leaps among pairs of the machine's and the host's second.
    fn leaps(heard: &[(i64, i64)]) -> usize {
        let mut watch = Watch::default();
        let leaps = heard
            .iter()
            .filter(|(machine, host)| watch.hear(at(*machine), at(*host)).is_some());
        leaps.count()
    }

    #[test]
    fn eq1_a_clock_that_is_set_leaps_and_a_pause_does_not() {
        let (then, year) = (1_767_600_000, 31_557_600);
        let quiet = [(then, 0), (then + 20, 20), (then + 50_000, 50_000)];
        assert_eq!(leaps(&quiet), 0);
        // Old values at the begin are no leap either; an empty battery makes one.
        assert_eq!(leaps(&[(then, 0), (then - 500_000, 1), (then + 2, 2)]), 0);
        assert_eq!(leaps(&[(0, 0), (then, 1)]), 1);
        assert_eq!(
            leaps(&[(then, 0), (then + 9 * year, 20), (then + 21, 21)]),
            2
        );
        // An hour and a bit, either way.
        for by in [-4000, 4000] {
            assert_eq!(leaps(&[(then, 0), (then + 20 + by, 20)]), 1);
        }
        assert_eq!(leaps(&[(i64::MIN / 2_000_000_000, 0), (then, 1)]), 1);
    }
}
