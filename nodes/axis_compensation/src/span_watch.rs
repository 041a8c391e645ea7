//! Sees where a drift is used so far outside the blocks' span, where nothing was measured, that it matters.
//!
//! ```text
//!   λ = (p − lower)/(upper − lower),   beyond  ⇔  λ < −0.01 or λ > 1.01             (1)
//!   E(p)² = U(p)² − U(p_end)²,         matters  ⇔  beyond and E(p) > U(p_end)       (2)
//! ```
//!
//! U is the expanded uncertainty (k = 2) of the drift, at the position and at the end of the span next to it; E is what
//! the extrapolation alone can be wrong by. It matters from where it outweighs what is stated at the block. A line
//! through two blocks has U(d) = U √((1 − λ)² + λ²), so that it matters from λ = 1.37 on, or a third of the span beyond a
//! block; what is held there instead is wrong by the slope times the way beyond. Either is reported once for the touches
//! that a model rests on, and taken back when the touches after next come without another such position: a program that
//! crosses the limit many times a minute is reported once.

use metrology::sample::AxisDrift;
use metrology::{Host, Stamp};

/// Share of the span by which a position may lie beyond it without a look at the uncertainty.
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
    /// Looks at one position at which `drift` is used, mm; `matters` is asked beyond the span, (2).
    pub fn look(
        &mut self,
        drift: &AxisDrift,
        position_mm: f64,
        matters: impl FnOnce() -> bool,
    ) -> Option<SpanChange> {
        let is_new = self.measured_at != Some(drift.measured_at);
        let ended = is_new && self.is_told && !self.was_outside;
        if is_new {
            self.measured_at = Some(drift.measured_at);
            self.was_outside = false;
        }
        let (lower_mm, upper_mm) = drift.span_mm;
        let margin_mm = MARGIN * (upper_mm - lower_mm);
        let is_inside = position_mm >= lower_mm - margin_mm && position_mm <= upper_mm + margin_mm;
        let begins = !is_inside && !self.was_outside && matters();
        self.was_outside |= begins;
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
        struct Always(SpanWatch);
        impl Always {
            fn look(&mut self, drift: &AxisDrift, position_mm: f64) -> Option<SpanChange> {
                self.0.look(drift, position_mm, || true)
            }
        }
        let mut watch = Always(SpanWatch::default());
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
