//! The usual case of a drift, for all axes together: each of them is modelled, and the policy takes every coordinate.
//!
//! Where a coordinate is placed depends on the coordinate alone, so that it is looked at once and not by each axis. A coordinate on which a drift
//! does not depend adds a product with zero.

use nalgebra::Vector3;

use super::growth::Relaxed;
use super::{DriftRefusal, Extrapolate, valued};
use crate::axis::Axis;
use crate::sample::{AxisDrift, ThermalModel};

/// Drift of X, Y and Z, mm; `None` where this is not the usual case.
#[inline]
pub(super) fn at_once(
    model: &ThermalModel,
    point_mm: &Vector3<f64>,
    policy: Extrapolate,
    relaxed: &mut Relaxed,
) -> Option<[Result<f64, DriftRefusal>; 3]> {
    let [Some(x), Some(y), Some(z), ..] = &model.axes.0 else {
        return None;
    };
    let drifts: [&AxisDrift; 3] = [x, y, z];
    let mut position_mm = *point_mm;
    for (position_mm, drift) in position_mm.iter_mut().zip(drifts) {
        let (lower_mm, upper_mm) = drift.span_mm;
        if !position_mm.is_finite() {
            return None;
        }
        if !(*position_mm >= lower_mm && *position_mm <= upper_mm) {
            *position_mm = match policy {
                Extrapolate::Linear => *position_mm,
                Extrapolate::Hold if *position_mm < lower_mm => lower_mm,
                Extrapolate::Hold => upper_mm,
                Extrapolate::Refuse => return None,
            };
        }
    }
    let mut of = |drift: &AxisDrift, axis: Axis| {
        let mut origin_mm = drift.cross_origin_mm;
        origin_mm[axis.index()] = drift.p0_mm;
        valued(drift, axis, &(position_mm - origin_mm), relaxed)
    };
    // One after the other: what `map` of an array becomes is not inlined.
    Some([of(x, Axis::X), of(y, Axis::Y), of(z, Axis::Z)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::PerAxis;
    use crate::drift::{axis_drift_at, drift_at};
    use crate::sample::DriftGrowth;
    use crate::stamp::{Span, Stamp};

    #[test]
    fn all_axes_at_once_are_each_axis_by_itself_to_the_last_bit() {
        let mut axes = PerAxis::default();
        for axis in Axis::LINEAR {
            let size = 1.0 + axis.index() as f64;
            let mut drift = AxisDrift {
                p0_mm: -200.0 * size,
                k0_mm: 0.010,
                slope_mm_per_mm: 5e-5,
                span_mm: (-200.0, 200.0),
                ..AxisDrift::default()
            };
            drift.cross_origin_mm = Vector3::new(3.0, -4.0, 5.0) * size;
            drift.cross_slope_mm_per_mm = Vector3::new(1e-5, -2e-5, 0.0) * size;
            drift.cross_slope_mm_per_mm[axis.index()] = 0.0;
            drift.growth[axis.index()] = Some(DriftGrowth {
                rate_mm_s: 1e-6 * size,
                gradient_rate_per_s: Vector3::new(0.0, 1e-9, 2e-9),
                time_constant_s: 900.0 * size,
            });
            axes[axis] = Some(drift);
        }
        let model = ThermalModel {
            at: Stamp::from_nanos(0),
            axes,
            valid_from: Stamp::from_nanos(0),
            valid_until: Stamp::from_nanos(i64::MAX),
            n_blocks: 4,
            lack_of_fit_p: 0.5,
            quarantined: false,
            sequence: 0,
        };
        let at = model.at + Span::from_nanos(1_000_000_000);
        let points = [-1e4, -150.0, 0.0, 33.3, 1e4, f64::NAN, f64::INFINITY];
        for policy in [Extrapolate::Linear, Extrapolate::Hold, Extrapolate::Refuse] {
            for (i, x) in points.iter().enumerate() {
                let point_mm = Vector3::new(*x, points[(i + 2) % 7], points[(3 * i) % 7]);
                let together = drift_at(&model, &point_mm, at, policy);
                for (axis, together) in Axis::LINEAR.into_iter().zip(together) {
                    let alone = axis_drift_at(&model, axis, &point_mm, at, policy);
                    match (together, alone) {
                        (Ok(a), Ok(b)) => assert_eq!(a.to_bits(), b.to_bits()),
                        (a, b) => assert_eq!(format!("{a:?}"), format!("{b:?}")),
                    }
                }
            }
        }
    }
}
