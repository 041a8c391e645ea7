//! A touch of the probe, before and after correction, and the latency that corrects it.

use std::cmp::Ordering;

use nalgebra::Vector3;

use crate::axis::{AxisSet, PerAxis};
use crate::stamp::{Host, Machine, Span, Stamp};

/// A touch as the controller reports it, uncorrected.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbeTrigger {
    /// When the host received it.
    pub received_at: Stamp<Host>,
    /// The controller's stamp of its latch.
    pub controller_at: Stamp<Machine>,
    /// What was touched: the last `(feature: NAME)` comment of the program before the touch.
    pub feature_id: String,
    /// Unit vector of the approach, of the tool relative to the workpiece, machine frame.
    pub approach: Vector3<f64>,
    /// Feed along the approach when the latch came, mm/s.
    pub feed_mm_s: f64,
    /// The axes that the machine has.
    pub axes: AxisSet,
    /// Feedback positions that the controller latched (mm, rad): where the motors were, compensation included.
    pub latched: PerAxis<f64>,
    /// Counts touches since the controller started.
    pub sequence: u32,
}

/// Which touches are new, where a topic may tell one twice, late or out of order.
///
/// A touch is new when it comes after the last new one by its receipt, by the controller's stamp or by its number, or is
/// another one of the same instant. A controller that was started anew, or a clock that was set back, takes back one or two
/// of the three, never all.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NewTouches {
    last: Option<ProbeTrigger>,
}

/// Receipts so far in the future are those of a time line that was left: a bag that is played again.
const AHEAD: Span = Span::from_nanos(1_000_000_000);

impl NewTouches {
    /// Whether a touch that comes `at` an instant is new; it is the last one then.
    pub fn is_new(&mut self, at: Stamp<Host>, trigger: &ProbeTrigger) -> bool {
        let is_left = |last: &ProbeTrigger| last.received_at - at > AHEAD;
        if self.last.as_ref().is_some_and(is_left) {
            self.last = None;
        }
        self.is_later(trigger)
    }

    /// The same of touches whose time line is never left.
    pub fn is_later(&mut self, trigger: &ProbeTrigger) -> bool {
        let is_new = self.last.as_ref().is_none_or(|last| {
            let order = [
                trigger.received_at.cmp(&last.received_at),
                trigger.controller_at.cmp(&last.controller_at),
                trigger.sequence.cmp(&last.sequence),
            ];
            let at_once = order == [Ordering::Equal; 3] && trigger != last;
            at_once || order.contains(&Ordering::Greater)
        });
        if is_new {
            self.last = Some(trigger.clone());
        }
        is_new
    }
}

/// Why a touch was not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rejection {
    /// The touch is usable.
    None,
    /// The wanted instant is older than the oldest queued position.
    BeforeQueue,
    /// The wanted instant is newer than the newest queued position.
    AfterQueue,
    /// The queue has a hole at the wanted instant.
    Gap,
    /// A position or feed was not a finite number.
    NotFinite,
    /// The controller's stamps ran backwards.
    ClockWentBack,
    /// The stand-off was too short to reach the programmed feed.
    StandoffTooShort,
    /// No latency is known and none was given.
    NoLatency,
}

/// How the latency was taken out of a touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Correction {
    /// It was not.
    None,
    /// The queued position at the instant of contact.
    Queue,
    /// The latched position less feed times latency.
    Feed,
}

/// A touch after correction.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbedPoint {
    /// When the host received the touch.
    pub received_at: Stamp<Host>,
    /// Same as in the trigger.
    pub feature_id: String,
    /// Corrected feedback positions at contact (mm, rad), stylus radius not removed.
    pub axes_at_contact: PerAxis<f64>,
    /// The axes that the machine has.
    pub axes: AxisSet,
    /// Surface point in the machine frame, stylus radius removed, mm.
    pub point_in_machine_mm: Vector3<f64>,
    /// The same point in the workpiece frame, which coincides with the machine frame when all axes
    /// are at zero, mm.
    pub point_in_workpiece_mm: Vector3<f64>,
    /// Latency that was taken out, s.
    pub applied_latency_s: f64,
    /// How it was taken out.
    pub correction: Correction,
    /// Standard uncertainty along the approach, mm.
    pub standard_uncertainty_mm: f64,
    /// Unit vector of the approach.
    pub approach: Vector3<f64>,
    /// Feed at contact, mm/s.
    pub feed_mm_s: f64,
    /// Whether and why it must not be used.
    pub rejection: Rejection,
    /// Same as in the trigger.
    pub sequence: u32,
}

/// How a latency was estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LatencyMethod {
    /// |Pa - Pb| / |fa - fb| of one touch at each of two feeds.
    TwoFeedSingle,
    /// The same with the means of several touches.
    TwoFeedMulti,
    /// Signed weighted least squares over three feeds or more.
    WeightedLeastSquares,
}

/// Estimated transmission latency of the probe signal.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbeLatency {
    /// When it was estimated.
    pub at: Stamp<Host>,
    /// The method whose value is in `latency_s`.
    pub method: LatencyMethod,
    /// Latency to use, s; negative means stamps in the future or a wrong sign.
    pub latency_s: f64,
    /// Its standard uncertainty, s.
    pub standard_uncertainty_s: f64,
    /// The two-feed value of the published method, s; NaN where it could not be formed.
    pub two_feed_latency_s: f64,
    /// The weighted least-squares value, s; NaN where there were fewer than three feeds.
    pub least_squares_latency_s: f64,
    /// Feeds at contact, mean per level, mm/s, ascending.
    pub feeds_mm_s: Vec<f64>,
    /// Touches used.
    pub n: u32,
    /// Surface position at zero feed along the approach, mm.
    pub intercept_mm: f64,
    /// Standard uncertainty of the intercept, mm.
    pub intercept_uncertainty_mm: f64,
    /// p value of the lack-of-fit test; NaN where there are no degrees of freedom.
    pub lack_of_fit_p: f64,
    /// Whether the signed estimate was below zero.
    pub negative: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: i64) -> Stamp<Host> {
        Stamp::from_nanos(seconds * 1_000_000_000)
    }

    /// A touch by its receipt and the controller's stamp, s, and its number.
    fn touch(received: i64, controller: i64, sequence: u32) -> ProbeTrigger {
        ProbeTrigger {
            received_at: at(received),
            controller_at: Stamp::from_nanos(controller * 1_000_000_000),
            feature_id: "block_1.z".to_owned(),
            approach: -Vector3::z(),
            feed_mm_s: 2.0,
            axes: AxisSet::XYZ,
            latched: PerAxis::default(),
            sequence,
        }
    }

    #[test]
    fn a_touch_counts_once_however_often_and_late_it_is_told() {
        let mut touches = NewTouches::default();
        let told = [
            (touch(10, 100, 1), true),
            (touch(10, 100, 1), false),
            (touch(20, 110, 2), true),
            (touch(10, 100, 1), false),
            (touch(30, 120, 3), true),
        ];
        for (touch, is_new) in told {
            assert_eq!(touches.is_new(at(31), &touch), is_new, "{touch:?}");
        }
    }

    #[test]
    fn a_controller_that_starts_anew_and_clocks_that_are_set_back_are_no_repetition() {
        let mut touches = NewTouches::default();
        assert!(touches.is_new(at(10), &touch(10, 100, 7)));
        assert!(touches.is_new(at(20), &touch(20, 1, 1)), "started anew");
        assert!(
            touches.is_new(at(15), &touch(15, 6, 2)),
            "its host set back"
        );
        assert!(touches.is_new(at(3), &touch(3, 1, 1)), "a bag played again");
        assert!(!touches.is_new(at(3), &touch(3, 1, 1)));
    }
}
