//! Which thermal model is used: not one that changed faster than heat can before a second measurement
//! agrees, not one of the past, and on no axis one that is too uncertain where the axis may go.
//!
//! ```text
//!   |d_new(p, t) − d_old(p, t)| > r Δt + margin   at a corner   ⇒  a jump         (1)
//!   Δt = max(|t_new − t_old|, |m_new − m_old|)
//!   2 u(d(p)) > limit   at a corner of the travel   ⇒  the axis is refused        (2)
//! ```
//!
//! t is a model's instant and m that of the touches which the axis rests on: what was predicted in
//! between may have been wrong by what heat can do since the last touches. r is the fastest physical
//! drift. A jump is confirmed by a model that agrees and whose own touches are later; one that is only
//! published again, or extrapolated anew, rests on the same touches and confirms nothing.
//!
//! The corners are those of the travel where lines are continued. Otherwise drifts act within the spans
//! only: (1) holds at their ends, and (2) for what is held beyond them. An axis whose slope the blocks
//! do not show moves by their mean drift alone, and of what is far from them nothing is known: (2) asks at
//! the blocks there, and the thermal model says that there is no slope. Coverage factor 2. Where a
//! model fell away (an axis is missing) there is nothing to compare.
//!
//! A model that has expired, or that is older than the one in use, is history of a latched topic. If the
//! one in use lies in the future, the clock was set back and says nothing of their order.

use metrology::drift::{
    DriftRefusal, Extrapolate, axis_drift_whenever, drift_at, drift_standard_uncertainty_mm,
};
use metrology::sample::{AxisDrift, ThermalModel};
use metrology::{Axis, Host, PerAxis, Stamp};
use nalgebra::Vector3;

/// Of the expanded uncertainty in (2).
pub const COVERAGE_FACTOR: f64 = 2.0;

/// What becomes of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Passage {
    /// It is used from now on.
    Accepted,
    /// It is used: the one kept back before was like it, and measured before.
    Confirmed,
    /// It is kept back.
    Quarantined {
        /// Where it jumps most.
        axis: Axis,
        /// By how much, mm.
        change_mm: f64,
        /// What (1) allows, mm.
        limit_mm: f64,
    },
    /// It has a number that is not finite.
    NotFinite {
        /// The axis.
        axis: Axis,
    },
    /// It may no longer be used.
    Expired {
        /// Since then, s.
        late_s: f64,
    },
    /// It was measured or fitted before the one in use.
    Older {
        /// By this much, s.
        by_s: f64,
    },
}

/// What the gate allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GateLimits {
    /// Fastest physical drift, mm/s.
    pub physical_rate_mm_s: f64,
    /// Change that is never a jump, mm.
    pub margin_mm: f64,
    /// Greatest expanded uncertainty of a drift (k = 2), mm.
    pub expanded_uncertainty_mm: f64,
    /// What happens outside the blocks' span.
    pub policy: Extrapolate,
    /// Least and greatest position of each linear axis, mm.
    pub travel_mm: [(f64, f64); 3],
}

/// The gate and the model behind it.
#[derive(Clone, Debug)]
pub struct ModelGate {
    limits: GateLimits,
    current: Option<ThermalModel>,
    kept: Option<ThermalModel>,
    /// Greatest expanded uncertainty of the model in use, mm.
    expanded_mm: PerAxis<f64>,
}

impl ModelGate {
    /// A gate without a model.
    #[must_use]
    pub fn new(limits: GateLimits) -> Self {
        Self {
            limits,
            current: None,
            kept: None,
            expanded_mm: PerAxis::default(),
        }
    }

    /// The model to use.
    #[must_use]
    pub fn current(&self) -> Option<&ThermalModel> {
        self.current.as_ref()
    }

    /// Greatest expanded uncertainty of the drift of `axis` at the travel's corners, mm.
    #[must_use]
    pub fn expanded_uncertainty_mm(&self, axis: Axis) -> f64 {
        self.expanded_mm[axis]
    }

    /// What happens outside the blocks' span.
    #[must_use]
    pub fn policy(&self) -> Extrapolate {
        self.limits.policy
    }

    /// Drifts of X, Y and Z by the model in use, mm. Allocates nothing.
    ///
    /// # Errors
    /// When there is no model, when (2) refuses the axis, or when the model gives no drift there.
    pub fn drifts_mm(
        &self,
        point_mm: &Vector3<f64>,
        at: Stamp<Host>,
    ) -> [Result<f64, DriftRefusal>; 3] {
        let Some(model) = &self.current else {
            return Axis::LINEAR.map(|axis| Err(DriftRefusal::NotModelled { axis }));
        };
        let mut drifts_mm = drift_at(model, point_mm, at, self.limits.policy);
        for (axis, drift_mm) in Axis::LINEAR.into_iter().zip(&mut drifts_mm) {
            *drift_mm = drift_mm.and_then(|drift_mm| self.certain(axis, drift_mm));
        }
        drifts_mm
    }

    /// (2).
    fn certain(&self, axis: Axis, drift_mm: f64) -> Result<f64, DriftRefusal> {
        let (expanded_mm, limit_mm) = (self.expanded_mm[axis], self.limits.expanded_uncertainty_mm);
        if expanded_mm > limit_mm {
            return Err(DriftRefusal::TooUncertain {
                axis,
                expanded_uncertainty_mm: expanded_mm,
                limit_mm,
            });
        }
        Ok(drift_mm)
    }

    /// Judges a new model.
    pub fn offer(&mut self, now: Stamp<Host>, model: ThermalModel) -> Passage {
        if let Some(axis) = not_finite(&model) {
            return Passage::NotFinite { axis };
        }
        if now > model.valid_until {
            let late_s = (now - model.valid_until).as_secs_f64();
            return Passage::Expired { late_s };
        }
        // One of the future, or of touches that are yet to be made, shuts no other out.
        let is_past = |current: &&ThermalModel| {
            current.at <= now && current.measured_at().is_none_or(|at| at <= now)
        };
        let in_order = self.current.as_ref().filter(is_past);
        if let Some(by_s) = in_order.and_then(|current| older_by_s(&model, current)) {
            return Passage::Older { by_s };
        }
        let jumps = self
            .current
            .as_ref()
            .map_or(PerAxis::default(), |old| self.jumps(old, &model));
        let worst = Axis::LINEAR
            .into_iter()
            .filter_map(|axis| jumps[axis].map(|jump| (axis, jump)))
            .max_by(|a, b| a.1.change_mm.abs().total_cmp(&b.1.change_mm.abs()));
        let kept = self.kept.take();
        let Some((
            axis,
            Jump {
                change_mm,
                limit_mm,
            },
        )) = worst
        else {
            self.take(model);
            return Passage::Accepted;
        };
        if kept.is_some_and(|kept| self.confirms(&jumps, &kept, &model)) {
            self.take(model);
            return Passage::Confirmed;
        }
        self.kept = Some(model);
        Passage::Quarantined {
            axis,
            change_mm,
            limit_mm,
        }
    }

    fn take(&mut self, model: ThermalModel) {
        self.expanded_mm = PerAxis::from_fn(|axis| self.greatest_expanded_mm(&model, axis));
        self.current = Some(model);
    }

    /// Whether `model` agrees with the one kept back and has later touches on every axis that jumps.
    fn confirms(
        &self,
        jumps: &PerAxis<Option<Jump>>,
        kept: &ThermalModel,
        model: &ThermalModel,
    ) -> bool {
        let measured = |model: &ThermalModel, axis| model.axes[axis].map(|d| d.measured_at);
        let is_later =
            |axis: &Axis| jumps[*axis].is_none() || measured(model, *axis) > measured(kept, *axis);
        let agrees = self.jumps(kept, model).0.iter().all(Option::is_none);
        agrees && Axis::LINEAR.iter().all(is_later)
    }

    /// The greatest change beyond (1) of each axis.
    fn jumps(&self, old: &ThermalModel, new: &ThermalModel) -> PerAxis<Option<Jump>> {
        PerAxis::from_fn(|axis| {
            let (before, after) = (old.axes[axis]?, new.axes[axis]?);
            let apart_s = (new.at - old.at).as_secs_f64().abs();
            let touches_s = (after.measured_at - before.measured_at).as_secs_f64().abs();
            let limit_mm =
                self.limits.physical_rate_mm_s * apart_s.max(touches_s) + self.limits.margin_mm;
            // Validity is judged when the model is used; here only its numbers count.
            let value = |model: &ThermalModel, corner_mm: &Vector3<f64>| {
                axis_drift_whenever(model, axis, corner_mm, new.at, Extrapolate::Linear).ok()
            };
            self.corners_in_use(old, new)
                .iter()
                .filter_map(|corner_mm| Some(value(new, corner_mm)? - value(old, corner_mm)?))
                .filter(|change_mm| change_mm.abs() > limit_mm)
                .max_by(|a, b| a.abs().total_cmp(&b.abs()))
                .map(|change_mm| Jump {
                    change_mm,
                    limit_mm,
                })
        })
    }

    /// Expanded uncertainty at the worst corner of (2), mm; zero for an axis without drift.
    fn greatest_expanded_mm(&self, model: &ThermalModel, axis: Axis) -> f64 {
        let has_slope = model.axes[axis].is_some_and(|drift| drift.slope_identifiable);
        let corners_mm = match self.limits.policy {
            Extrapolate::Linear | Extrapolate::Hold if has_slope => corners(&self.limits.travel_mm),
            _ => corners_of_spans(model, model),
        };
        let expanded_mm = corners_mm.iter().filter_map(|corner_mm| {
            let u_mm = drift_standard_uncertainty_mm(model, axis, corner_mm, self.limits.policy);
            Some(COVERAGE_FACTOR * u_mm.ok()?)
        });
        expanded_mm.fold(0.0, f64::max)
    }

    /// Corners of the box in which two models act: the travel, or the spans of both.
    fn corners_in_use(&self, old: &ThermalModel, new: &ThermalModel) -> [Vector3<f64>; 8] {
        if self.limits.policy == Extrapolate::Linear {
            return corners(&self.limits.travel_mm);
        }
        corners_of_spans(old, new)
    }
}

/// A change beyond (1).
#[derive(Clone, Copy, Debug, PartialEq)]
struct Jump {
    change_mm: f64,
    limit_mm: f64,
}

/// By how much `model` was measured, or with the same touches fitted, before `current`, s.
fn older_by_s(model: &ThermalModel, current: &ThermalModel) -> Option<f64> {
    let order = |m: &ThermalModel| (m.measured_at().unwrap_or(m.at), m.at);
    let (own, used) = (order(model), order(current));
    let by = if own.0 == used.0 {
        used.1 - own.1
    } else {
        used.0 - own.0
    };
    (own < used).then(|| by.as_secs_f64())
}

/// Corners of the box of the spans of two models.
fn corners_of_spans(old: &ThermalModel, new: &ThermalModel) -> [Vector3<f64>; 8] {
    corners(&Axis::LINEAR.map(|axis| {
        let span = |m: &ThermalModel| m.axes[axis].map(|d| d.span_mm);
        match (span(old), span(new)) {
            (Some(a), Some(b)) => (a.0.min(b.0), a.1.max(b.1)),
            (Some(one), None) | (None, Some(one)) => one,
            (None, None) => (0.0, 0.0),
        }
    }))
}

fn corners(ends_mm: &[(f64, f64); 3]) -> [Vector3<f64>; 8] {
    std::array::from_fn(|corner| {
        Vector3::from_fn(|row, _| {
            if corner >> row & 1 == 0 {
                ends_mm[row].0
            } else {
                ends_mm[row].1
            }
        })
    })
}

fn not_finite(model: &ThermalModel) -> Option<Axis> {
    Axis::ALL
        .into_iter()
        .find(|&axis| model.axes[axis].is_some_and(|drift| !is_sound(axis, &drift)))
}

fn is_sound(axis: Axis, drift: &AxisDrift) -> bool {
    let numbers = [
        drift.p0_mm,
        drift.k0_mm,
        drift.slope_mm_per_mm,
        drift.span_mm.0,
        drift.span_mm.1,
    ];
    let slope = axis.index() + 1;
    let is_known = |row: usize, column: usize| {
        let value = drift.covariance[(row, column)];
        let unknown_slope = (row, column) == (slope, slope) && !drift.slope_identifiable;
        value.is_finite() || unknown_slope && value == f64::INFINITY
    };
    let grows_soundly = drift.growth.iter().flatten().all(|growth| {
        growth.rate_mm_s.is_finite()
            && growth.gradient_rate_per_s.iter().all(|x| x.is_finite())
            && growth.time_constant_s > 0.0
    });
    numbers.iter().all(|x| x.is_finite())
        && drift.cross_slope_mm_per_mm.iter().all(|x| x.is_finite())
        && drift.cross_origin_mm.iter().all(|x| x.is_finite())
        && (0..16).all(|entry| is_known(entry / 4, entry % 4))
        && grows_soundly
        && drift.span_mm.0 <= drift.span_mm.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::sample::DriftGrowth;
    use metrology::stamp::Span;

    fn at(at_s: i64) -> Stamp<Host> {
        Stamp::from_nanos(at_s * 1_000_000_000)
    }

    /// A model of X fitted at `at_s` to touches at `measured_s`, valid for 40 min after them.
    fn model(sequence: u32, at_s: i64, measured_s: i64, k0_mm: f64) -> ThermalModel {
        let mut axes = PerAxis::default();
        axes[Axis::X] = Some(AxisDrift {
            k0_mm,
            span_mm: (-200.0, 200.0),
            slope_identifiable: true,
            measured_at: at(measured_s),
            ..AxisDrift::default()
        });
        ThermalModel {
            at: at(at_s),
            axes,
            valid_from: at(measured_s),
            valid_until: at(measured_s) + Span::from_secs_f64(2400.0),
            n_blocks: 2,
            lack_of_fit_p: f64::NAN,
            quarantined: false,
            sequence,
        }
    }

    fn gate_with(policy: Extrapolate) -> ModelGate {
        ModelGate::new(GateLimits {
            physical_rate_mm_s: 3e-3 / 60.0,
            margin_mm: 1e-3,
            expanded_uncertainty_mm: 0.010,
            policy,
            travel_mm: [(-320.0, 320.0), (-270.0, 270.0), (-60.0, 440.0)],
        })
    }

    fn offer(gate: &mut ModelGate, model: ThermalModel) -> Passage {
        gate.offer(model.at, model)
    }

    #[test]
    fn eq1_a_jump_waits_for_a_second_measurement_that_agrees() {
        let gate = &mut gate_with(Extrapolate::Linear);
        assert_eq!(offer(gate, model(1, 0, 0, 0.0)), Passage::Accepted);
        assert_eq!(offer(gate, model(2, 60, 60, 0.0039)), Passage::Accepted);
        let jumped = offer(gate, model(3, 120, 120, 0.060));
        assert!(
            matches!(jumped, Passage::Quarantined { axis: Axis::X, .. }),
            "{jumped:?}"
        );
        assert_eq!(gate.current().unwrap().sequence, 2);
        // The same model read twice, published again, extrapolated anew: the touches are the same.
        for (sequence, at_s) in [(3, 120), (4, 120), (5, 130), (6, 700)] {
            let again = offer(gate, model(sequence, at_s, 120, 0.060));
            assert!(
                matches!(again, Passage::Quarantined { .. }),
                "{sequence} {again:?}"
            );
            assert_eq!(gate.current().unwrap().sequence, 2);
        }
        assert_eq!(offer(gate, model(7, 180, 180, 0.061)), Passage::Confirmed);
        assert_eq!(gate.current().unwrap().sequence, 7);
    }

    #[test]
    fn an_axis_that_was_not_touched_again_is_not_confirmed_by_one_that_was() {
        let gate = &mut gate_with(Extrapolate::Linear);
        let both = |at_s, x_measured_s, x_mm| {
            let mut model = model(1, at_s, x_measured_s, x_mm);
            model.axes[Axis::Y] = model.axes[Axis::X];
            let y = model.axes[Axis::Y].as_mut().unwrap();
            (y.k0_mm, y.measured_at) = (0.0, at(at_s));
            model
        };
        offer(gate, both(0, 0, 0.0));
        offer(gate, both(60, 60, 0.1));
        let kept_on = offer(gate, both(120, 60, 0.1));
        assert!(
            matches!(kept_on, Passage::Quarantined { .. }),
            "{kept_on:?}"
        );
        assert_eq!(offer(gate, both(180, 180, 0.1)), Passage::Confirmed);
    }

    #[test]
    fn a_new_measurement_may_correct_a_prediction_by_what_heat_can_do_since_the_last() {
        let gate = &mut gate_with(Extrapolate::Linear);
        offer(gate, model(1, 0, 0, 0.0));
        // Predicted every ten seconds from the touches at 0, wrong by 8 µm after a quarter of an hour.
        for (k, at_s) in (10..=890).step_by(10).enumerate() {
            let predicted = model(2, at_s, 0, 1e-4 * k as f64);
            assert_eq!(offer(gate, predicted), Passage::Accepted);
        }
        assert_eq!(offer(gate, model(3, 900, 900, 0.017)), Passage::Accepted);
    }

    #[test]
    fn history_of_a_latched_topic_is_not_used() {
        let gate = &mut gate_with(Extrapolate::Linear);
        let expired = gate.offer(at(3000), model(1, 0, 0, 0.0));
        assert_eq!(expired, Passage::Expired { late_s: 600.0 });
        assert!(gate.current().is_none());
        gate.offer(at(3000), model(2, 2900, 2900, 0.010));
        let older = gate.offer(at(3001), model(1, 2000, 2000, 0.009));
        assert_eq!(older, Passage::Older { by_s: 900.0 });
        let earlier_fit = gate.offer(at(3001), model(1, 2890, 2900, 0.009));
        assert_eq!(earlier_fit, Passage::Older { by_s: 10.0 });
        assert_eq!(gate.current().unwrap().sequence, 2);
        // A clock set back by half an hour makes the one in use a model of the future.
        let set_back = gate.offer(at(1500), model(3, 1400, 1400, 0.010));
        assert_eq!(set_back, Passage::Accepted);
    }

    #[test]
    fn a_model_of_touches_that_are_yet_to_be_made_shuts_no_later_one_out() {
        let gate = &mut gate_with(Extrapolate::Linear);
        gate.offer(at(1000), model(1, 1000, 900_000, 0.010));
        let later = gate.offer(at(1100), model(2, 1090, 1090, 0.010));
        assert!(!matches!(later, Passage::Older { .. }), "{later:?}");
    }

    #[test]
    fn a_confirmed_jump_is_told_by_both_measurements_after_predictions_in_between() {
        let gate = &mut gate_with(Extrapolate::Linear);
        offer(gate, model(1, 0, 0, 0.0));
        offer(gate, model(2, 990, 0, 0.001));
        let now = at(1000);
        let first = gate.offer(now, model(3, 900, 900, 0.100));
        assert!(matches!(first, Passage::Quarantined { .. }), "{first:?}");
        assert_eq!(
            gate.offer(now, model(4, 1000, 1000, 0.101)),
            Passage::Confirmed
        );
    }

    #[test]
    fn a_model_that_returns_to_the_old_state_is_accepted() {
        let gate = &mut gate_with(Extrapolate::Linear);
        offer(gate, model(1, 0, 0, 0.0));
        offer(gate, model(2, 60, 60, 0.1));
        assert_eq!(offer(gate, model(3, 120, 120, 0.001)), Passage::Accepted);
    }

    #[test]
    fn eq1_a_line_that_is_continued_is_judged_where_it_acts() {
        // 0 at the blocks' ends, 12 µm more at the end of the travel.
        let turned = |at_s| {
            let mut model = model(2, at_s, at_s, 0.0);
            model.axes[Axis::X].as_mut().unwrap().slope_mm_per_mm = 1.2e-5;
            model
        };
        let passage = |policy| {
            let gate = &mut gate_with(policy);
            offer(gate, model(1, 0, 0, 0.0));
            offer(gate, turned(30))
        };
        // 2.5 µm are allowed after 30 s: 2.4 µm at the span's end, 3.84 µm at the travel's.
        assert_eq!(passage(Extrapolate::Hold), Passage::Accepted);
        let linear = passage(Extrapolate::Linear);
        assert!(
            matches!(linear, Passage::Quarantined { change_mm, .. } if (change_mm.abs() - 3.84e-3).abs() < 1e-9),
            "{linear:?}"
        );
    }

    #[test]
    fn eq2_an_axis_that_is_too_uncertain_at_the_travels_corners_is_refused_and_no_other() {
        let uncertain = |slope_u: f64| {
            let mut model = model(1, 0, 0, 0.010);
            model.axes[Axis::Y] = model.axes[Axis::X];
            let x = model.axes[Axis::X].as_mut().unwrap();
            x.covariance[(0, 0)] = 1e-6;
            x.covariance[(1, 1)] = slope_u * slope_u;
            x.slope_identifiable = slope_u.is_finite();
            model
        };
        let judged = |policy, slope_u: f64| {
            let gate = &mut gate_with(policy);
            assert_eq!(offer(gate, uncertain(slope_u)), Passage::Accepted);
            let origin = Vector3::zeros();
            let [x, y, _] = gate.drifts_mm(&origin, at(0));
            assert_eq!(y, Ok(0.010));
            x
        };
        // 2 √(1² + (320 · 0.0153)²) µm is just below 10 µm, a little more is above.
        assert_eq!(judged(Extrapolate::Linear, 1.53e-5), Ok(0.010));
        let refused = judged(Extrapolate::Linear, 1.60e-5).unwrap_err();
        let expanded_mm = 2e-3 * (1.0 + (320.0 * 0.016_f64).powi(2)).sqrt();
        match refused {
            DriftRefusal::TooUncertain {
                axis: Axis::X,
                expanded_uncertainty_mm,
                limit_mm: 0.010,
            } => assert!((expanded_uncertainty_mm - expanded_mm).abs() < 1e-12),
            other => panic!("{other:?}"),
        }
        // Where nothing is done outside the span, nothing there counts.
        assert_eq!(judged(Extrapolate::Refuse, 2.0e-5), Ok(0.010));
        let unknown = judged(Extrapolate::Hold, f64::INFINITY).unwrap_err();
        assert_eq!(
            unknown.to_string(),
            "axis X: expanded uncertainty of the drift reaches inf mm at the travel's corners, limit is 0.01 mm"
        );
    }

    #[test]
    fn a_model_with_a_number_that_is_none_never_passes() {
        let judged = |spoil: fn(&mut AxisDrift)| {
            let mut model = model(1, 0, 0, 0.0);
            spoil(model.axes[Axis::X].as_mut().unwrap());
            offer(&mut gate_with(Extrapolate::Linear), model)
        };
        let refused = Passage::NotFinite { axis: Axis::X };
        assert_eq!(judged(|x| x.k0_mm = f64::NAN), refused);
        assert_eq!(judged(|x| x.covariance[(2, 2)] = f64::INFINITY), refused);
        assert_eq!(judged(|x| x.covariance[(1, 1)] = f64::INFINITY), refused);
        let timeless = |x: &mut AxisDrift| {
            x.growth[1] = Some(DriftGrowth {
                rate_mm_s: 1e-6,
                gradient_rate_per_s: Vector3::zeros(),
                time_constant_s: f64::NAN,
            });
        };
        assert_eq!(judged(timeless), refused);
        assert_eq!(judged(|_| {}), Passage::Accepted);
    }
}
