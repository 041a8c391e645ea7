//! A trigger becomes a point on the surface.
//!
//! # Model
//!
//! ```text
//!   q = queue(t − T)                     positions of the axes at contact               (1)
//!   q = q_latched − n f T                where the queue has no answer and it is allowed (2)
//!   p = ball(q) + n r                    surface point                                  (3)
//!   u² = u_rep² + (f T_c)²/12 [polled latch] + f² u(T)²                                 (4)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | t, T | controller's stamp of the latch, latency | s |
//! | n, f | approach, feed along it at the latch | 1, mm/s |
//! | r | effective radius of the stylus ball | mm |
//! | u_rep, T_c | repeatability of the probe, servo period | mm, s |
//!
//! (1) is right whatever the axes did; (2) supposes that the feed was constant from contact to latch.
//! The first two terms of (4) are independent from touch to touch, the last is common to all touches
//! of one feed.
//!
//! # References
//! Derived from the queue at t − T of the published two-feed method, whose formulas are lost.

use machine::Kinematics;
use metrology::sample::{Correction, ProbeTrigger, ProbedPoint, Rejection};
use metrology::stamp::Span;
use metrology::{Axis, PerAxis};
use nalgebra::Vector3;

use crate::latency_in_use::LatencyInUse;
use crate::queue::{CoordinateQueue, QueueMiss};

/// Independent and common standard uncertainty of one touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TouchUncertainty {
    /// Independent from touch to touch, mm.
    pub independent_mm: f64,
    /// Common to touches of this feed, mm.
    pub common_mm: f64,
}

/// What a correction needs to know of the machine.
#[derive(Clone, Debug)]
pub struct TouchModel {
    /// Kinematics.
    pub kinematics: Kinematics,
    /// Repeatability of one touch, mm.
    pub repeatability_mm: f64,
    /// Servo period where the latch is polled, else zero, s.
    pub poll_period_s: f64,
}

/// Where the axes were at contact, and how that is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AtContact {
    /// From the queue, (1).
    Queued(PerAxis<f64>),
    /// From the latched position, (2), since the queue had no answer.
    Extrapolated(PerAxis<f64>, QueueMiss),
    /// Not known.
    Unknown(Rejection),
}

impl TouchModel {
    /// Standard uncertainties of one touch, (4).
    #[must_use]
    pub fn uncertainty(&self, feed_mm_s: f64, latency: &LatencyInUse) -> TouchUncertainty {
        let polled_mm = feed_mm_s * self.poll_period_s / 12_f64.sqrt();
        TouchUncertainty {
            independent_mm: self.repeatability_mm.hypot(polled_mm),
            common_mm: feed_mm_s.abs() * latency.standard_uncertainty_s,
        }
    }

    /// A usable point, (3).
    #[must_use]
    pub fn point(
        &self,
        trigger: &ProbeTrigger,
        contact: (&PerAxis<f64>, Correction),
        latency: &LatencyInUse,
        ball_radius_mm: f64,
    ) -> ProbedPoint {
        let (axes, correction) = contact;
        let approach = &trigger.approach;
        let u = self.uncertainty(trigger.feed_mm_s, latency);
        let on_machine = self
            .kinematics
            .surface_in_machine_mm(axes, approach, ball_radius_mm);
        let on_workpiece = self
            .kinematics
            .surface_in_workpiece_mm(axes, approach, ball_radius_mm);
        ProbedPoint {
            axes_at_contact: *axes,
            point_in_machine_mm: on_machine,
            point_in_workpiece_mm: on_workpiece,
            applied_latency_s: latency.latency_s,
            correction,
            standard_uncertainty_mm: u.independent_mm.hypot(u.common_mm),
            ..rejected(trigger, Rejection::None)
        }
    }
}

/// Where the axes were at contact; `None`: wait, the positions around the instant are yet to come.
#[must_use]
pub fn axes_at_contact(
    queue: &CoordinateQueue,
    trigger: &ProbeTrigger,
    latency: &LatencyInUse,
    allow_feed_correction: bool,
    may_wait: bool,
) -> Option<AtContact> {
    let instant = trigger.controller_at - Span::from_secs_f64(latency.latency_s);
    let miss = match queue.at(instant) {
        Ok(axes) => return Some(AtContact::Queued(axes)), // (1)
        Err(QueueMiss::AfterNewest { .. } | QueueMiss::Empty) if may_wait => return None,
        Err(miss) => miss,
    };
    if !allow_feed_correction {
        return Some(AtContact::Unknown(rejection(&miss)));
    }
    let travelled_mm = trigger.feed_mm_s * latency.latency_s;
    let mut axes = trigger.latched;
    for axis in Axis::LINEAR {
        axes[axis] -= trigger.approach[axis.index()] * travelled_mm; // (2)
    }
    Some(AtContact::Extrapolated(axes, miss))
}

/// A point that must not be used: what is not known is NaN.
#[must_use]
pub fn rejected(trigger: &ProbeTrigger, rejection: Rejection) -> ProbedPoint {
    let nowhere = Vector3::repeat(f64::NAN);
    ProbedPoint {
        received_at: trigger.received_at,
        feature_id: trigger.feature_id.clone(),
        axes_at_contact: trigger.latched,
        axes: trigger.axes,
        point_in_machine_mm: nowhere,
        point_in_workpiece_mm: nowhere,
        applied_latency_s: f64::NAN,
        correction: Correction::None,
        standard_uncertainty_mm: f64::NAN,
        approach: trigger.approach,
        feed_mm_s: trigger.feed_mm_s,
        rejection,
        sequence: trigger.sequence,
    }
}

const fn rejection(miss: &QueueMiss) -> Rejection {
    match miss {
        QueueMiss::BeforeOldest { .. } => Rejection::BeforeQueue,
        QueueMiss::AfterNewest { .. } | QueueMiss::Empty => Rejection::AfterQueue,
        QueueMiss::Gap { .. } => Rejection::Gap,
        QueueMiss::NotFinite => Rejection::NotFinite,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq4_adds_polling_and_latency_in_quadrature() {
        let file = machine::MachineFile::parse(
            include_str!("../../libraries/machine/tests/data/bench.yaml"),
            "bench.yaml",
        )
        .unwrap();
        let model = TouchModel {
            kinematics: Kinematics::new(&file).unwrap(),
            repeatability_mm: 0.0003,
            poll_period_s: 0.001,
        };
        let latency = LatencyInUse {
            latency_s: 0.008,
            standard_uncertainty_s: 25e-6,
        };
        let u = model.uncertainty(12.0, &latency);
        // 12 mm/s for 1 ms is 12 µm wide, 3.464 µm standard; 12 mm/s times 25 µs is 0.3 µm.
        assert!((u.independent_mm - 0.0003_f64.hypot(0.012 / 12_f64.sqrt())).abs() < 1e-12);
        assert!((u.common_mm - 0.0003).abs() < 1e-12);
    }
}
