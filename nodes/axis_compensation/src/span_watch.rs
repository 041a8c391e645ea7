//! Sees where a drift is used outside the blocks' span, where nothing was measured.
//!
//! ```text
//!   λ = (p − lower)/(upper − lower),   outside  ⇔  λ < −0.01 or λ > 1.01           (1)
//! ```
//!
//! A line through two blocks has u(d) = u √((1 − λ)² + λ²): 1.01 u at λ = 1.01, which is nothing to be told of (touches of a
//! block end where they trigger, a little beyond or before its face), 1.58 u at 1.5, 2.24 u at 2. What is held
//! there instead is wrong by the slope times the way beyond. Either is said once for the touches that a
//! model rests on, and taken back when the touches after next come without another such position: a
//! program that crosses the span's end many times a minute is told of once.

use metrology::sample::AxisDrift;
use metrology::{Host, Stamp};

/// Share of the span by which a position may lie beyond it.
const MARGIN: f64 = 0.01;

/// What is to be said of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpanChange {
    /// A drift is used outside the span.
    Left,
    /// For a whole block cycle none was.
    KeptWithin,
}

/// One axis' positions against the span of its drift.
#[derive(Clone, Copy, Debug, Default)]
pub struct SpanWatch {
    measured_at: Option<Stamp<Host>>,
    is_told: bool,
    was_outside: bool,
}

impl SpanWatch {
    /// Looks at one position at which `drift` is used, mm.
    pub fn look(&mut self, drift: &AxisDrift, position_mm: f64) -> Option<SpanChange> {
        let is_new = self.measured_at != Some(drift.measured_at);
        let ended = is_new && self.is_told && !self.was_outside;
        if is_new {
            self.measured_at = Some(drift.measured_at);
            self.was_outside = false;
        }
        let (lower_mm, upper_mm) = drift.span_mm;
        let margin_mm = MARGIN * (upper_mm - lower_mm);
        let is_inside = position_mm >= lower_mm - margin_mm && position_mm <= upper_mm + margin_mm;
        let is_outside = !is_inside;
        let begins = is_outside && !self.was_outside;
        self.was_outside |= is_outside;
        if begins {
            self.is_told = true;
            return Some(SpanChange::Left);
        }
        if ended {
            self.is_told = false;
            return Some(SpanChange::KeptWithin);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_a_span_left_many_times_is_said_once_a_cycle_and_taken_back_after_a_cycle_within() {
        let mut watch = SpanWatch::default();
        let drift = |cycle: i64| AxisDrift {
            span_mm: (-200.0, 200.0),
            measured_at: Stamp::from_nanos(cycle),
            ..AxisDrift::default()
        };
        for position_mm in [200.0, -203.9] {
            assert_eq!(watch.look(&drift(1), position_mm), None);
        }
        assert_eq!(watch.look(&drift(1), 204.1), Some(SpanChange::Left));
        for position_mm in [0.0, -205.0, 0.0, 300.0] {
            assert_eq!(watch.look(&drift(1), position_mm), None);
        }
        assert_eq!(watch.look(&drift(2), 0.0), None);
        assert_eq!(watch.look(&drift(2), -300.0), Some(SpanChange::Left));
        assert_eq!(watch.look(&drift(3), 0.0), None);
        assert_eq!(watch.look(&drift(4), 0.0), Some(SpanChange::KeptWithin));
        assert_eq!(watch.look(&drift(5), 0.0), None);
    }
}
