//! Where a thermal model says that a machine's readings have drifted to, for one pose and instant.
//!
//! Both the node that fits the model and the node that compensates with it evaluate it here, so
//! that one number can never mean two things.
//!
//! # Model
//!
//! ```text
//!   d_i(r, t) = k0_i + s_i (r_i − p0_i) + Σ_{j≠i} c_ij (r_j − o_ij)
//!               + [k0'_i + s'_i (r_i − p0_i)] g(t − t0)                       (1)
//!   g(e) = τ (1 − exp(−e/τ)),   g(e) = e for τ = ∞                            (2)
//!   u²(d_i) = var(k0) + 2 cov(k0, s) (r_i − p0_i) + var(s) (r_i − p0_i)²      (3)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | k0, s | `k0_mm`, `slope_mm_per_mm` | mm, mm/mm |
//! | c | `cross_slope_mm_per_mm` | mm/mm |
//! | k0', s' | `rate_mm_s`, `slope_rate_per_s` | mm/s, 1/s |
//! | τ | `time_constant_s` | s |
//!
//! Sign: d is the drift of the *reading* of a fixed physical place, hot minus cold. To reach that
//! place again the axis must be commanded to p + d(p); the machine's position error is −d(p).
//!
//! # Holds when
//! The readings' drift is affine inside the blocks' span. (3) holds for the line along the own axis;
//! the cross terms' share is known to the fit only. p may be the commanded or the drifted position:
//! the difference changes d by s·d, some 1e-4 of d.
//!
//! # Agreement
//! `eq1_is_the_line_through_both_blocks`: below 1e-15 mm. `eq3_grows_with_distance_from_the_blocks`:
//! factors 0.71, 1, 1.58, 2.24 and 3.61 at λ = 0.5, 1, 1.5, 2 and 3.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::axis::{Axis, PerAxis};
use crate::sample::{AxisDrift, ThermalModel};
use crate::stamp::{Host, Stamp};

/// What to do with a position outside the blocks' span.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Extrapolate {
    /// Continue the line.
    Linear,
    /// Use the drift at the nearest end of the span.
    Hold,
    /// Give no drift.
    Refuse,
}

/// Why a model gives no drift.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum DriftRefusal {
    /// The blocks said nothing about this axis.
    #[error("no drift is known for axis {axis}")]
    NotModelled {
        /// The axis.
        axis: Axis,
    },
    /// The instant is before the model's validity.
    #[error("model is valid only in {early_s} s")]
    NotYetValid {
        /// Time that is missing, s.
        early_s: f64,
    },
    /// The instant is after the model's validity.
    #[error("model expired {late_s} s ago")]
    Expired {
        /// Time since then, s.
        late_s: f64,
    },
    /// A number of the model or of the pose is not finite.
    #[error("drift of axis {axis} is not a finite number")]
    NotFinite {
        /// The axis.
        axis: Axis,
    },
    /// The policy refuses positions outside the span.
    #[error(
        "position {position_mm} mm of axis {axis} is outside the blocks' span {lower_mm} to {upper_mm} mm"
    )]
    OutOfSpan {
        /// The coordinate that is outside.
        axis: Axis,
        /// Its position, mm.
        position_mm: f64,
        /// Least block position, mm; NaN where no block was measured along this coordinate.
        lower_mm: f64,
        /// Greatest block position, mm.
        upper_mm: f64,
    },
}

/// Drift of all linear axes at a point of the machine frame (mm): (1) for each. Rotary axes are not modelled.
#[must_use]
pub fn drift_at(
    model: &ThermalModel,
    point_mm: &Vector3<f64>,
    at: Stamp<Host>,
    policy: Extrapolate,
) -> PerAxis<Result<f64, DriftRefusal>> {
    PerAxis::from_fn(|axis| axis_drift_at(model, axis, point_mm, at, policy))
}

/// Drift of one axis at a point of the machine frame, mm: (1). Allocates nothing.
///
/// # Errors
/// When the model says nothing usable about this axis at this point and instant.
pub fn axis_drift_at(
    model: &ThermalModel,
    axis: Axis,
    point_mm: &Vector3<f64>,
    at: Stamp<Host>,
    policy: Extrapolate,
) -> Result<f64, DriftRefusal> {
    if at < model.valid_from {
        let early_s = (model.valid_from - at).as_secs_f64();
        return Err(DriftRefusal::NotYetValid { early_s });
    }
    if at > model.valid_until {
        let late_s = (at - model.valid_until).as_secs_f64();
        return Err(DriftRefusal::Expired { late_s });
    }
    axis_drift_whenever(model, axis, point_mm, at, policy)
}

/// The same whether the model is valid at that instant or not: for comparing two models.
///
/// # Errors
/// When the model says nothing usable about this axis at this point.
pub fn axis_drift_whenever(
    model: &ThermalModel,
    axis: Axis,
    point_mm: &Vector3<f64>,
    at: Stamp<Host>,
    policy: Extrapolate,
) -> Result<f64, DriftRefusal> {
    let (true, Some(drift)) = (axis.is_linear(), &model.axes[axis]) else {
        return Err(DriftRefusal::NotModelled { axis });
    };
    let own_mm = placed(axis, point_mm[axis.index()], Some(drift.span_mm), policy)?;
    let lever_mm = own_mm - drift.p0_mm;
    let mut drift_mm = drift.k0_mm + drift.slope_mm_per_mm * lever_mm;
    for other in Axis::LINEAR {
        let slope = drift.cross_slope_mm_per_mm[other.index()];
        if other == axis || slope == 0.0 {
            continue;
        }
        let span_mm = model.axes[other].as_ref().map(|d| d.span_mm);
        let origin_mm = drift.cross_origin_mm[other.index()];
        let position_mm = match (span_mm, policy) {
            (None, Extrapolate::Hold) => origin_mm,
            _ => placed(other, point_mm[other.index()], span_mm, policy)?,
        };
        drift_mm += slope * (position_mm - origin_mm);
    }
    drift_mm += growth_mm(drift, lever_mm, (at - model.at).as_secs_f64());
    if drift_mm.is_finite() {
        Ok(drift_mm)
    } else {
        Err(DriftRefusal::NotFinite { axis })
    }
}

/// Where the model is evaluated for a coordinate at `position_mm`.
fn placed(
    axis: Axis,
    position_mm: f64,
    span_mm: Option<(f64, f64)>,
    policy: Extrapolate,
) -> Result<f64, DriftRefusal> {
    if !position_mm.is_finite() {
        return Err(DriftRefusal::NotFinite { axis });
    }
    let (lower_mm, upper_mm) = span_mm.unwrap_or((f64::NAN, f64::NAN));
    let inside = position_mm >= lower_mm && position_mm <= upper_mm;
    match policy {
        _ if inside => Ok(position_mm),
        Extrapolate::Linear => Ok(position_mm),
        Extrapolate::Hold => Ok(if position_mm < lower_mm {
            lower_mm
        } else {
            upper_mm
        }),
        Extrapolate::Refuse => Err(DriftRefusal::OutOfSpan {
            axis,
            position_mm,
            lower_mm,
            upper_mm,
        }),
    }
}

/// What has been added to the drift since the model was fitted, mm: the second line of (1).
fn growth_mm(drift: &AxisDrift, lever_mm: f64, elapsed_s: f64) -> f64 {
    let rate_mm_s = drift.rate_mm_s + drift.slope_rate_per_s * lever_mm;
    if rate_mm_s == 0.0 {
        return 0.0;
    }
    rate_mm_s * relaxed_s(elapsed_s, drift.time_constant_s)
}

/// Effective time for which an initial rate has acted after `elapsed_s`, s: (2).
#[must_use]
pub fn relaxed_s(elapsed_s: f64, time_constant_s: f64) -> f64 {
    if time_constant_s.is_infinite() {
        return elapsed_s;
    }
    // exp_m1 keeps the difference exact while the elapsed time is a small part of the time constant.
    -time_constant_s * (-elapsed_s / time_constant_s).exp_m1()
}

/// Standard uncertainty of the drift at a position along the axis itself, mm: (3).
#[must_use]
pub fn drift_standard_uncertainty_mm(drift: &AxisDrift, position_mm: f64) -> f64 {
    let lever_mm = position_mm - drift.p0_mm;
    let c = &drift.covariance;
    let variance_mm2 =
        c[(0, 0)] + (c[(0, 1)] + c[(1, 0)]) * lever_mm + c[(1, 1)] * lever_mm * lever_mm;
    variance_mm2.max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix2;

    fn line() -> AxisDrift {
        let (u2, length_mm) = (1.0, 400.0);
        AxisDrift {
            p0_mm: -200.0,
            k0_mm: 0.010,
            slope_mm_per_mm: 5e-5,
            covariance: Matrix2::new(
                u2,
                -u2 / length_mm,
                -u2 / length_mm,
                2.0 * u2 / (length_mm * length_mm),
            ),
            span_mm: (-200.0, 200.0),
            time_constant_s: f64::INFINITY,
            offset_identifiable: true,
            slope_identifiable: true,
            ..AxisDrift::default()
        }
    }

    fn model(drift: AxisDrift) -> ThermalModel {
        let mut axes = PerAxis::default();
        axes[Axis::X] = Some(drift);
        ThermalModel {
            at: Stamp::from_nanos(0),
            axes,
            valid_from: Stamp::from_nanos(0),
            valid_until: Stamp::from_nanos(1_000_000_000_000),
            n_blocks: 2,
            lack_of_fit_p: f64::NAN,
            quarantined: false,
            sequence: 0,
        }
    }

    fn at_x(
        drift: AxisDrift,
        x_mm: f64,
        at_s: i64,
        policy: Extrapolate,
    ) -> Result<f64, DriftRefusal> {
        let at = Stamp::from_nanos(at_s * 1_000_000_000);
        axis_drift_at(
            &model(drift),
            Axis::X,
            &Vector3::new(x_mm, 7.0, 9.0),
            at,
            policy,
        )
    }

    #[test]
    fn eq1_is_the_line_through_both_blocks() {
        for (x_mm, expected_mm) in [(-200.0, 0.010), (200.0, 0.030), (0.0, 0.020)] {
            let d_mm = at_x(line(), x_mm, 0, Extrapolate::Refuse).unwrap();
            assert!((d_mm - expected_mm).abs() < 1e-15, "{d_mm}");
        }
    }

    #[test]
    fn outside_the_span_each_policy_does_what_it_says() {
        let linear = at_x(line(), 300.0, 0, Extrapolate::Linear).unwrap();
        assert!((linear - 0.035).abs() < 1e-15);
        let held = at_x(line(), 300.0, 0, Extrapolate::Hold).unwrap();
        assert!((held - 0.030).abs() < 1e-15);
        assert_eq!(
            at_x(line(), 300.0, 0, Extrapolate::Refuse),
            Err(DriftRefusal::OutOfSpan {
                axis: Axis::X,
                position_mm: 300.0,
                lower_mm: -200.0,
                upper_mm: 200.0
            })
        );
    }

    #[test]
    fn eq2_relaxes_from_the_rate_towards_rate_times_time_constant() {
        let drift = AxisDrift {
            rate_mm_s: 1e-5,
            slope_rate_per_s: 1e-8,
            time_constant_s: 100.0,
            ..line()
        };
        let early = at_x(drift, -200.0, 1, Extrapolate::Linear).unwrap() - 0.010;
        assert!((early - 0.995e-5).abs() < 1e-8, "{early}");
        let late = at_x(drift, 0.0, 1000, Extrapolate::Linear).unwrap() - 0.020;
        let settled = (1e-5 + 1e-8 * 200.0) * 100.0;
        assert!((late - settled).abs() < 1e-7, "{late}");
        assert!((relaxed_s(5.0, f64::INFINITY) - 5.0).abs() < f64::EPSILON);
    }

    #[test]
    fn eq3_grows_with_distance_from_the_blocks() {
        for (lambda, factor) in [
            (0.5, 0.71),
            (0.0, 1.0),
            (1.0, 1.0),
            (1.5, 1.58),
            (2.0, 2.24),
            (3.0, 3.61),
        ] {
            let u = drift_standard_uncertainty_mm(&line(), -200.0 + 400.0 * lambda);
            assert!((u - factor).abs() < 0.005, "{lambda} {u}");
        }
    }

    #[test]
    fn an_instant_outside_validity_and_a_pose_that_is_no_number_are_refused() {
        assert_eq!(
            at_x(line(), 0.0, 1001, Extrapolate::Hold),
            Err(DriftRefusal::Expired { late_s: 1.0 })
        );
        assert_eq!(
            at_x(line(), 0.0, -2, Extrapolate::Hold),
            Err(DriftRefusal::NotYetValid { early_s: 2.0 })
        );
        assert_eq!(
            at_x(line(), f64::NAN, 0, Extrapolate::Hold),
            Err(DriftRefusal::NotFinite { axis: Axis::X })
        );
        let broken = AxisDrift {
            k0_mm: f64::NAN,
            ..line()
        };
        assert_eq!(
            at_x(broken, 0.0, 0, Extrapolate::Hold),
            Err(DriftRefusal::NotFinite { axis: Axis::X })
        );
        let all = drift_at(
            &model(line()),
            &Vector3::zeros(),
            Stamp::from_nanos(0),
            Extrapolate::Hold,
        );
        assert_eq!(
            all[Axis::Y],
            Err(DriftRefusal::NotModelled { axis: Axis::Y })
        );
    }

    #[test]
    fn a_cross_term_is_bounded_by_the_other_axis_span() {
        let cross = AxisDrift {
            cross_slope_mm_per_mm: Vector3::new(0.0, 1e-4, 0.0),
            ..line()
        };
        let mut m = model(cross);
        m.axes[Axis::Y] = Some(AxisDrift {
            span_mm: (-50.0, 50.0),
            ..line()
        });
        let point = Vector3::new(0.0, 100.0, 0.0);
        let value = |m: &ThermalModel, policy| {
            axis_drift_at(m, Axis::X, &point, Stamp::from_nanos(0), policy)
        };
        assert!((value(&m, Extrapolate::Linear).unwrap() - 0.030).abs() < 1e-15);
        assert!((value(&m, Extrapolate::Hold).unwrap() - 0.025).abs() < 1e-15);
        assert!(matches!(
            value(&m, Extrapolate::Refuse),
            Err(DriftRefusal::OutOfSpan { axis: Axis::Y, .. })
        ));
        m.axes[Axis::Y] = None;
        assert!((value(&m, Extrapolate::Hold).unwrap() - 0.020).abs() < 1e-15);
        assert!(matches!(
            value(&m, Extrapolate::Refuse),
            Err(DriftRefusal::OutOfSpan { axis: Axis::Y, .. })
        ));
    }
}
