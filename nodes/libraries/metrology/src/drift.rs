//! Where a thermal model says that a machine's readings have drifted to, for one pose and instant.
//!
//! Both the node that fits the model and the node that compensates with it evaluate it here, so
//! that one number can never mean two things.
//!
//! # Model
//!
//! With the levers l_i = r_i − p0_i along the own axis and l_j = r_j − o_ij along the others:
//!
//! ```text
//!   d_i(r, t) = k0_i + g_i·l + Σ_a [k0'_ia + g'_ia·l] h(t − t0; τ_a)              (1)
//!   h(e; τ) = τ (1 − exp(−e/τ)),   h = e for τ = ∞                                (2)
//!   u²(d_i) = bᵀ C_i b,   b = (1, l)                                              (3)
//!   held beyond the span by v:   u² = (3) at its end + Σ_j (g_ij² + var g_ij) v_j²   (4)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | k0, g | `k0_mm`; `slope_mm_per_mm` and `cross_slope_mm_per_mm` | mm, mm/mm |
//! | C | `covariance` of (k0, g) | mm², mm, 1 |
//! | k0'_a, g'_a, τ_a | `growth` by the faces of axis a | mm/s, 1/s, s |
//!
//! Rotations and shears make a face of one axis move the drift of another, and each axis' faces have
//! their own time constant: hence the sum over a in (1).
//!
//! Sign: d is the drift of the *reading* of a fixed physical place, hot minus cold. To reach that
//! place again the axis must be commanded to p + d(p); the machine's position error is −d(p).
//!
//! # Holds when
//! The readings' drift is affine, inside the blocks' span and, for a line that is continued, outside.
//! (3) is for the model's instant; what a time constant or a hold adds until later is not in it, nor a
//! gradient that the fit supposes to be zero. Outside the span (3) grows with the distance as METROLOGY
//! says: 1.58 times u of a block at λ = 1.5, 2.24 at 2. p may be the commanded or the drifted position:
//! the difference changes d by s·d, some 1e-4 of d.
//!
//! # Agreement
//! `eq1_is_the_line_through_both_blocks`: below 1e-15 mm. `eq3_grows_with_distance_from_the_blocks`:
//! factors 0.71, 1, 1.58, 2.24 and 3.61 at λ = 0.5, 1, 1.5, 2 and 3.

mod at_once;
mod growth;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use at_once::at_once;
pub use growth::relaxed_s;
use growth::{Relaxed, growth_mm};

use crate::axis::Axis;
use crate::number::number;
use crate::sample::{AxisDrift, DriftGrowth, ThermalModel};
use crate::stamp::{Host, Stamp};

/// What to do with a position outside the blocks' span.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
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
    #[error("model is valid only in {early_s} s", early_s = number(*early_s))]
    NotYetValid {
        /// Time that is missing, s.
        early_s: f64,
    },
    /// The instant is after the model's validity.
    #[error("model expired {late_s} s ago", late_s = number(*late_s))]
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
        "position {position_mm} mm of axis {axis} is outside the blocks' span {lower_mm} to {upper_mm} mm", position_mm = number(*position_mm), lower_mm = number(*lower_mm), upper_mm = number(*upper_mm))]
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
    /// Where the axis may go, the drift is not known well enough.
    #[error(
        "axis {axis}: expanded uncertainty of the drift reaches {expanded_uncertainty_mm} mm at the travel's corners, limit is {limit_mm} mm", expanded_uncertainty_mm = number(*expanded_uncertainty_mm), limit_mm = number(*limit_mm))]
    TooUncertain {
        /// The axis.
        axis: Axis,
        /// Expanded uncertainty there (k = 2), mm.
        expanded_uncertainty_mm: f64,
        /// Greatest one allowed, mm.
        limit_mm: f64,
    },
}

/// Drift of X, Y and Z at a point of the machine frame (mm), (1) for each. Allocates nothing. Axes that share a time constant share (2),
/// which is most of the work.
///
/// # Errors
/// For an axis about which the model says nothing usable at this point and instant.
pub fn drift_at(
    model: &ThermalModel,
    point_mm: &Vector3<f64>,
    at: Stamp<Host>,
    policy: Extrapolate,
) -> [Result<f64, DriftRefusal>; 3] {
    if let Err(refusal) = valid(model, at) {
        return [Err(refusal); 3];
    }
    let mut relaxed = Relaxed::since((at - model.at).as_secs_f64());
    if let Some(all) = at_once(model, point_mm, policy, &mut relaxed) {
        return all;
    }
    Axis::LINEAR.map(|axis| evaluated(model, axis, point_mm, policy, &mut relaxed))
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
    valid(model, at)?;
    axis_drift_whenever(model, axis, point_mm, at, policy)
}

fn valid(model: &ThermalModel, at: Stamp<Host>) -> Result<(), DriftRefusal> {
    if at < model.valid_from {
        let early_s = (model.valid_from - at).as_secs_f64();
        return Err(DriftRefusal::NotYetValid { early_s });
    }
    if at > model.valid_until {
        let late_s = (at - model.valid_until).as_secs_f64();
        return Err(DriftRefusal::Expired { late_s });
    }
    Ok(())
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
    let mut relaxed = Relaxed::since((at - model.at).as_secs_f64());
    evaluated(model, axis, point_mm, policy, &mut relaxed)
}

#[inline]
fn evaluated(
    model: &ThermalModel,
    axis: Axis,
    point_mm: &Vector3<f64>,
    policy: Extrapolate,
    relaxed: &mut Relaxed,
) -> Result<f64, DriftRefusal> {
    let (drift, levers) = levers(model, axis, point_mm, policy)?;
    valued(drift, axis, &levers.inside_mm, relaxed)
}

/// (1) with its levers.
#[inline]
fn valued(
    drift: &AxisDrift,
    axis: Axis,
    lever_mm: &Vector3<f64>,
    relaxed: &mut Relaxed,
) -> Result<f64, DriftRefusal> {
    let mut gradient = drift.cross_slope_mm_per_mm;
    gradient[axis.index()] = drift.slope_mm_per_mm;
    let mut grown_mm = 0.0;
    for growth in drift.growth.iter().flatten() {
        grown_mm += growth_mm(growth, lever_mm, relaxed);
    }
    let drift_mm = drift.k0_mm + gradient.dot(lever_mm) + grown_mm;
    if drift_mm.is_finite() {
        Ok(drift_mm)
    } else {
        Err(DriftRefusal::NotFinite { axis })
    }
}

/// Standard uncertainty of the drift of one axis at a point and the model's instant, mm: (3), with
/// (4) where it is held. Infinite away from the blocks where their slope is not known at all.
///
/// # Errors
/// As [`axis_drift_whenever`].
pub fn drift_standard_uncertainty_mm(
    model: &ThermalModel,
    axis: Axis,
    point_mm: &Vector3<f64>,
    policy: Extrapolate,
) -> Result<f64, DriftRefusal> {
    let (drift, levers) = levers(model, axis, point_mm, policy)?;
    let (inside, beyond) = (levers.inside_mm, levers.beyond_mm);
    let c = &drift.covariance;
    let mut variance_mm2 = c[(0, 0)];
    for j in 0..3 {
        // An infinite variance says nothing where its lever is zero.
        if inside[j] != 0.0 {
            variance_mm2 += (c[(0, j + 1)] + c[(j + 1, 0)]) * inside[j];
            variance_mm2 += (0..3)
                .filter(|k| inside[*k] != 0.0)
                .map(|k| c[(j + 1, k + 1)] * inside[j] * inside[k])
                .sum::<f64>();
        }
        if beyond[j] != 0.0 {
            let slope = if j == axis.index() {
                drift.slope_mm_per_mm
            } else {
                drift.cross_slope_mm_per_mm[j]
            };
            variance_mm2 += (slope * slope + c[(j + 1, j + 1)]) * beyond[j] * beyond[j]; // (4)
        }
    }
    if variance_mm2.is_nan() {
        return Err(DriftRefusal::NotFinite { axis });
    }
    Ok(variance_mm2.max(0.0).sqrt())
}

/// Where a drift is evaluated.
struct Levers {
    /// From the reference to the place of evaluation, mm.
    inside_mm: Vector3<f64>,
    /// From there to the point itself where the span's end is held, mm.
    beyond_mm: Vector3<f64>,
}

/// The drift of `axis` and its levers to a point; a coordinate of which nothing depends has none.
fn levers<'a>(
    model: &'a ThermalModel,
    axis: Axis,
    point_mm: &Vector3<f64>,
    policy: Extrapolate,
) -> Result<(&'a AxisDrift, Levers), DriftRefusal> {
    let (true, Some(drift)) = (axis.is_linear(), &model.axes[axis]) else {
        return Err(DriftRefusal::NotModelled { axis });
    };
    let mut levers = Levers {
        inside_mm: Vector3::zeros(),
        beyond_mm: Vector3::zeros(),
    };
    for other in Axis::LINEAR {
        let idx = other.index();
        if other != axis && !depends_on(drift, idx) {
            continue;
        }
        let origin_mm = if other == axis {
            drift.p0_mm
        } else {
            drift.cross_origin_mm[idx]
        };
        let span_mm = model.axes[other].as_ref().map(|d| d.span_mm);
        let position_mm = match (span_mm, policy) {
            (None, Extrapolate::Hold) if point_mm[idx].is_finite() => origin_mm,
            _ => placed(other, point_mm[idx], span_mm, policy)?,
        };
        levers.inside_mm[idx] = position_mm - origin_mm;
        levers.beyond_mm[idx] = point_mm[idx] - position_mm;
    }
    Ok((drift, levers))
}

/// Whether a drift depends on another coordinate, by value, by growth or by what is not known of it.
fn depends_on(drift: &AxisDrift, idx: usize) -> bool {
    let grows = |growth: &DriftGrowth| growth.gradient_rate_per_s[idx] != 0.0;
    drift.cross_slope_mm_per_mm[idx] != 0.0
        || drift.covariance[(idx + 1, idx + 1)] != 0.0
        || drift.growth.iter().flatten().any(grows)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::PerAxis;
    use nalgebra::Matrix4;

    fn line() -> AxisDrift {
        let (u2, length_mm) = (1.0, 400.0);
        let mut covariance = Matrix4::zeros();
        covariance[(0, 0)] = u2;
        covariance[(0, 1)] = -u2 / length_mm;
        covariance[(1, 0)] = -u2 / length_mm;
        covariance[(1, 1)] = 2.0 * u2 / (length_mm * length_mm);
        AxisDrift {
            p0_mm: -200.0,
            k0_mm: 0.010,
            slope_mm_per_mm: 5e-5,
            covariance,
            span_mm: (-200.0, 200.0),
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
    fn axes_that_share_time_constants_drift_as_each_by_itself() {
        let growth = |rate_mm_s: f64, time_constant_s: f64| {
            Some(DriftGrowth {
                rate_mm_s,
                gradient_rate_per_s: Vector3::new(1e-9, 0.0, -2e-9),
                time_constant_s,
            })
        };
        let mut drifts = model(line());
        for (axis, taus) in [
            (Axis::X, [900.0, 1800.0, f64::INFINITY]),
            (Axis::Y, [900.0, 1800.0, f64::INFINITY]),
            (Axis::Z, [600.0, 1800.0, 2400.0]),
        ] {
            drifts.axes[axis] = Some(AxisDrift {
                growth: taus.map(|tau_s| growth(1e-6 + 1e-9 * tau_s.min(1e4), tau_s)),
                ..line()
            });
        }
        let point_mm = Vector3::new(10.0, -50.0, 120.0);
        let at = Stamp::from_nanos(700_000_000_000);
        let together = drift_at(&drifts, &point_mm, at, Extrapolate::Hold);
        for (axis, shared_mm) in Axis::LINEAR.into_iter().zip(together) {
            let alone_mm = axis_drift_at(&drifts, axis, &point_mm, at, Extrapolate::Hold);
            assert_eq!(shared_mm.unwrap().to_bits(), alone_mm.unwrap().to_bits());
        }
        drifts.valid_until = Stamp::from_nanos(600_000_000_000);
        let late = drift_at(&drifts, &point_mm, at, Extrapolate::Hold);
        assert_eq!(late, [Err(DriftRefusal::Expired { late_s: 100.0 }); 3]);
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
            growth: [
                Some(DriftGrowth {
                    rate_mm_s: 1e-5,
                    gradient_rate_per_s: Vector3::new(1e-8, 0.0, 0.0),
                    time_constant_s: 100.0,
                }),
                None,
                None,
            ],
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
            let u = u_at_x(line(), -200.0 + 400.0 * lambda, Extrapolate::Linear);
            assert!((u - factor).abs() < 0.005, "{lambda} {u}");
        }
    }

    fn u_at_x(drift: AxisDrift, x_mm: f64, policy: Extrapolate) -> f64 {
        let point_mm = Vector3::new(x_mm, 7.0, 9.0);
        drift_standard_uncertainty_mm(&model(drift), Axis::X, &point_mm, policy).unwrap()
    }

    #[test]
    fn eq4_what_is_held_beyond_the_span_may_be_wrong_by_the_slope_times_the_distance() {
        let end = u_at_x(line(), 200.0, Extrapolate::Hold);
        let held = u_at_x(line(), 300.0, Extrapolate::Hold);
        let slope2 = 5e-5_f64.powi(2) + 2.0 / (400.0 * 400.0);
        assert!((held - (end * end + slope2 * 1e4).sqrt()).abs() < 1e-12);
        let point_mm = Vector3::new(300.0, 0.0, 0.0);
        let refused =
            drift_standard_uncertainty_mm(&model(line()), Axis::X, &point_mm, Extrapolate::Refuse);
        assert!(matches!(refused, Err(DriftRefusal::OutOfSpan { .. })));
    }

    #[test]
    fn eq3_an_unknown_slope_leaves_nothing_known_away_from_the_block() {
        let mut shift = AxisDrift {
            slope_mm_per_mm: 0.0,
            slope_identifiable: false,
            ..line()
        };
        shift.covariance = Matrix4::zeros();
        shift.covariance[(0, 0)] = 4.0;
        shift.covariance[(1, 1)] = f64::INFINITY;
        assert!((u_at_x(shift, -200.0, Extrapolate::Linear) - 2.0).abs() < 1e-12);
        assert!(u_at_x(shift, -199.0, Extrapolate::Linear).is_infinite());
    }

    #[test]
    fn eq1_faces_of_another_axis_make_a_drift_grow_by_their_own_time_constant() {
        let grow = |rate_per_s, time_constant_s| {
            Some(DriftGrowth {
                rate_mm_s: 0.0,
                gradient_rate_per_s: Vector3::new(0.0, rate_per_s, 0.0),
                time_constant_s,
            })
        };
        let drift = AxisDrift {
            growth: [grow(1e-9, 100.0), grow(-4e-9, 900.0), None],
            ..line()
        };
        let grown = at_x(drift, 0.0, 300, Extrapolate::Linear).unwrap() - 0.020;
        let expected = 7.0 * (1e-9 * relaxed_s(300.0, 100.0) - 4e-9 * relaxed_s(300.0, 900.0));
        assert!((grown - expected).abs() < 1e-15, "{grown} {expected}");
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
            all[Axis::Y.index()],
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
