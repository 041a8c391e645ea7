//! A touch of the probe, before and after correction, and the latency that corrects it.

use nalgebra::Vector3;

use crate::axis::{AxisSet, PerAxis};
use crate::stamp::{Host, Machine, Stamp};

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
