//! The controller's clock against the host's.
//!
//! ```text
//!   t_machine[k] = t_machine[0] + k T                                 (1)
//!   t_host[k]    = t_host[0] + k T / (1 + d)                          (2)
//! ```
//!
//! T is the servo period by the controller's own clock and d the drift of that clock against the
//! host's.

use metrology::stamp::Span;
use metrology::{Host, Machine, Stamp};

/// Counts servo periods on both clocks.
#[derive(Clone, Debug, PartialEq)]
pub struct Clocks {
    period: Span,
    offset: Span,
    host_per_machine: f64,
    machine_start: Stamp<Machine>,
    host_anchor: Option<(Stamp<Host>, u64)>,
    count: u64,
}

impl Clocks {
    /// Clocks of a controller whose time is the host's plus `offset` at the first tick.
    #[must_use]
    pub fn new(period: Span, offset: Span, drift: f64) -> Self {
        Self {
            period,
            offset,
            host_per_machine: 1.0 / (1.0 + drift),
            machine_start: Stamp::default(),
            host_anchor: None,
            count: 0,
        }
    }

    /// Servo periods simulated so far.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// Goes one period on.
    pub const fn advance(&mut self) {
        self.count += 1;
    }

    /// The present period ends at this host time from now on; the controller's own time goes on.
    pub fn anchor(&mut self, at: Stamp<Host>) {
        if self.host_anchor.is_none() {
            self.machine_start = Stamp::from_nanos(at.nanos()) + self.offset;
        }
        self.host_anchor = Some((at, self.count));
    }

    /// Controller time at the end of the present period, by (1).
    #[must_use]
    pub fn machine_now(&self) -> Stamp<Machine> {
        #[expect(clippy::cast_possible_wrap, reason = "292 years of nanoseconds")]
        let elapsed = self.period.nanos() * self.count as i64;
        self.machine_start + Span::from_nanos(elapsed)
    }

    /// Host time at which the period `ahead` of the present one ends, by (2); `None` before the first tick.
    #[must_use]
    pub fn host_ahead(&self, ahead: u64) -> Option<Stamp<Host>> {
        let (at, count) = self.host_anchor?;
        let periods = (self.count + ahead - count) as f64;
        #[expect(clippy::cast_possible_truncation, reason = "292 years of nanoseconds")]
        let nanos = (periods * self.period.nanos() as f64 * self.host_per_machine).round() as i64;
        Some(at + Span::from_nanos(nanos))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_and_eq2_give_stamps_with_offset_and_drift() {
        let mut clocks = Clocks::new(
            Span::from_nanos(1_000_000),
            Span::from_nanos(-5_000_000_000),
            100e-6,
        );
        assert_eq!(clocks.host_ahead(1), None);
        clocks.anchor(Stamp::from_nanos(10_000_000_000));
        (0..1_000_000).for_each(|_| clocks.advance());
        assert_eq!(clocks.machine_now().nanos(), 1_005_000_000_000);
        // 1000 s by a clock that is 100 ppm fast are 1000 s / 1.0001 by the host's.
        assert_eq!(
            clocks.host_ahead(0),
            Some(Stamp::from_nanos(10_000_000_000 + 999_900_009_999))
        );
    }
}
