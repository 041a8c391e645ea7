//! The published model: per axis a line through the drifts at two blocks.
//!
//! # Model
//!
//! Cold the blocks read x1 and x2, now x1' and x2'; with d1 = x1' − x1, d2 = x2' − x2:
//!
//! ```text
//!   d(p) = d1 + (d2 − d1) (p − x1) / (x2 − x1)                                   (1)
//!   u²(d(p)) = (1 − λ)² u1² + λ² u2²,   λ = (p − x1) / (x2 − x1)                 (2)
//!   L_min = √(u1² + u2²) W / limit                                               (3)
//! ```
//!
//! The publication's formula is lost (an image that the text does not carry); (1) is derived from
//! its symbols: two cold points, two present points, the axis position p, one value per axis in mm,
//! and is the only linear one. Sign by physics: the block is the artefact. The control now reads x'
//! where it read x, so the axis has to be commanded to p + d(p) to reach the same place; the
//! publication may print −d(p) for a control that subtracts. Each control's own sign belongs to that
//! control's exporter.
//!
//! With |L| = |x2 − x1| under (3), W the travel, a slope would be uncertain by more than `limit`
//! over the travel: the model is the pure shift (d1 + d2)/2, the slope is marked unidentifiable and
//! |d1 − d2| is told as the blocks' inconsistency. L = 0 is inside that case and never divides.
//!
//! # Holds when
//! Drift is linear along each axis and depends on no other coordinate. A rotation passes unseen: on
//! the blocks' diagonal it looks like a scale, and leaves its whole differential drift at the two
//! other corners. Hot zones on a screw, growth of the table and of the probe enter as they are.
//!
//! # Agreement
//! `eq1_passes_through_both_blocks`: below 1e-15 mm. `eq2_matches_the_closed_form`: below 1e-12 mm.
//! `eq1_a_rotation_is_invisible_on_the_diagonal_and_whole_at_the_other_corners`: below 1e-12 mm.

use metrology::Axis;
use metrology::sample::AxisDrift;
use nalgebra::{Matrix2, Vector3};

use crate::reference::FaceDrift;

/// How far a slope may be wrong: the travel over which it acts and the error allowed there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlopeLimit {
    /// Travel W of the axis, mm.
    pub travel_mm: f64,
    /// Standard uncertainty of slope times travel that is allowed, mm.
    pub error_mm: f64,
}

/// The line, or the pure shift where no line can be known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// The model of the axis.
    pub drift: AxisDrift,
    /// Span |L|, mm.
    pub span_mm: f64,
    /// L_min of (3), mm.
    pub least_span_mm: f64,
    /// |d1 − d2| where the slope is not identifiable, mm.
    pub inconsistency_mm: Option<f64>,
}

/// Model of `axis` through two faces: (1), or the shift under (3).
#[must_use]
pub fn line(axis: Axis, first: &FaceDrift, second: &FaceDrift, limit: SlopeLimit) -> Line {
    let (x1_mm, x2_mm) = (first.point_mm[axis.index()], second.point_mm[axis.index()]);
    let (u1, u2) = (
        first.standard_uncertainty_mm,
        second.standard_uncertainty_mm,
    );
    let length_mm = x2_mm - x1_mm;
    let least_span_mm = u1.hypot(u2) * limit.travel_mm / limit.error_mm;
    let common = AxisDrift {
        span_mm: (x1_mm.min(x2_mm), x1_mm.max(x2_mm)),
        offset_identifiable: true,
        time_constant_s: f64::INFINITY,
        cross_slope_mm_per_mm: Vector3::zeros(),
        ..AxisDrift::default()
    };
    if length_mm == 0.0 || length_mm.abs() < least_span_mm {
        return Line {
            drift: AxisDrift {
                p0_mm: x1_mm.midpoint(x2_mm),
                k0_mm: first.drift_mm.midpoint(second.drift_mm),
                covariance: Matrix2::new((u1 * u1 + u2 * u2) / 4.0, 0.0, 0.0, 0.0),
                ..common
            },
            span_mm: length_mm.abs(),
            least_span_mm,
            inconsistency_mm: Some((first.drift_mm - second.drift_mm).abs()),
        };
    }
    let covariance_mm = -u1 * u1 / length_mm;
    Line {
        drift: AxisDrift {
            p0_mm: x1_mm,
            k0_mm: first.drift_mm,
            slope_mm_per_mm: (second.drift_mm - first.drift_mm) / length_mm,
            covariance: Matrix2::new(
                u1 * u1,
                covariance_mm,
                covariance_mm,
                (u1 * u1 + u2 * u2) / (length_mm * length_mm),
            ),
            slope_identifiable: true,
            ..common
        },
        span_mm: length_mm.abs(),
        least_span_mm,
        inconsistency_mm: None,
    }
}

/// Model of `axis` from one face alone: the shift d1.
#[must_use]
pub fn shift(axis: Axis, face: &FaceDrift) -> AxisDrift {
    let x_mm = face.point_mm[axis.index()];
    AxisDrift {
        p0_mm: x_mm,
        k0_mm: face.drift_mm,
        covariance: Matrix2::new(face.standard_uncertainty_mm.powi(2), 0.0, 0.0, 0.0),
        span_mm: (x_mm, x_mm),
        offset_identifiable: true,
        time_constant_s: f64::INFINITY,
        ..AxisDrift::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::Stamp;
    use metrology::drift::drift_standard_uncertainty_mm;

    const LIMIT: SlopeLimit = SlopeLimit {
        travel_mm: 640.0,
        error_mm: 0.003,
    };

    fn face(point_mm: Vector3<f64>, axis: Axis, drift_mm: f64) -> FaceDrift {
        FaceDrift {
            block: 0,
            axis,
            point_mm,
            drift_mm,
            standard_uncertainty_mm: 4e-4,
            hot_uncertainty_mm: 3e-4,
            at: Stamp::from_nanos(0),
        }
    }

    fn at_x(x_mm: f64, drift_mm: f64) -> FaceDrift {
        face(Vector3::new(x_mm, 0.0, 0.0), Axis::X, drift_mm)
    }

    fn value_mm(drift: &AxisDrift, p_mm: f64) -> f64 {
        drift.k0_mm + drift.slope_mm_per_mm * (p_mm - drift.p0_mm)
    }

    #[test]
    fn eq1_passes_through_both_blocks() {
        let line = line(Axis::X, &at_x(-220.0, 0.004), &at_x(220.0, 0.026), LIMIT).drift;
        for (p_mm, d_mm) in [
            (-220.0, 0.004),
            (220.0, 0.026),
            (0.0, 0.015),
            (440.0, 0.037),
        ] {
            assert!((value_mm(&line, p_mm) - d_mm).abs() < 1e-15, "{p_mm}");
        }
        assert!(line.slope_identifiable && (line.p0_mm + 220.0).abs() < 1e-15);
    }

    #[test]
    fn eq2_matches_the_closed_form() {
        let mut second = at_x(200.0, 0.0);
        second.standard_uncertainty_mm = 9e-4;
        let line = line(Axis::X, &at_x(-200.0, 0.0), &second, LIMIT).drift;
        for lambda in [-1.0, 0.0, 0.5, 1.0, 3.0_f64] {
            let closed = ((1.0 - lambda) * 4e-4).hypot(lambda * 9e-4);
            let u = drift_standard_uncertainty_mm(&line, -200.0 + 400.0 * lambda);
            assert!((u - closed).abs() < 1e-12, "{lambda}");
        }
    }

    #[test]
    fn eq3_a_short_span_gives_the_mean_and_says_so() {
        let least_mm = 4e-4 * 2_f64.sqrt() * 640.0 / 0.003;
        let inside = line(
            Axis::X,
            &at_x(0.0, 0.010),
            &at_x(least_mm * 0.999, 0.012),
            LIMIT,
        );
        assert!(!inside.drift.slope_identifiable);
        assert!((inside.drift.k0_mm - 0.011).abs() < 1e-15);
        assert!(inside.drift.slope_mm_per_mm == 0.0);
        assert!((inside.inconsistency_mm.unwrap() - 0.002).abs() < 1e-15);
        assert!((inside.least_span_mm - least_mm).abs() < 1e-9);
        let outside = line(
            Axis::X,
            &at_x(0.0, 0.010),
            &at_x(least_mm * 1.001, 0.012),
            LIMIT,
        );
        assert!(outside.drift.slope_identifiable && outside.inconsistency_mm.is_none());
    }

    #[test]
    fn blocks_at_one_coordinate_never_divide_even_without_uncertainty() {
        let (mut first, mut second) = (at_x(5.0, 0.010), at_x(5.0, 0.020));
        first.standard_uncertainty_mm = 0.0;
        second.standard_uncertainty_mm = 0.0;
        let line = line(Axis::X, &first, &second, LIMIT);
        assert!((line.drift.k0_mm - 0.015).abs() < 1e-15);
        assert!(line.drift.covariance.iter().all(|c| c.is_finite()));
    }

    #[test]
    fn eq1_a_rotation_is_invisible_on_the_diagonal_and_whole_at_the_other_corners() {
        let (wz, half) = (30e-6, Vector3::new(220.0, 180.0, 90.0));
        let turned_x_mm = |r: Vector3<f64>| -wz * r.y;
        let line = line(
            Axis::X,
            &face(-half, Axis::X, turned_x_mm(-half)),
            &face(half, Axis::X, turned_x_mm(half)),
            LIMIT,
        );
        let residual_mm = |r: Vector3<f64>| turned_x_mm(r) - value_mm(&line.drift, r.x);
        for lambda in [-1.0, 0.3, 1.0] {
            assert!(residual_mm(half * lambda).abs() < 1e-12);
        }
        // Whole differential drift between the blocks: wz (y2 − y1).
        let corner = Vector3::new(half.x, -half.y, 0.0);
        assert!((residual_mm(corner) - wz * 2.0 * half.y).abs() < 1e-12);
    }
}
