//! Keeps back a thermal model that changed faster than heat can, until the next one agrees with it.
//!
//! ```text
//!   |d_new(p, t) − d_old(p, t)| > r |t_new − t_old| + margin   at a span's end   ⇒  a jump   (1)
//! ```
//!
//! t is the new model's instant, the ends are those of both models' spans on each axis, r is the
//! fastest physical drift. Where a model fell away (an axis is missing) there is nothing to compare.

use metrology::Axis;
use metrology::drift::{Extrapolate, axis_drift_whenever};
use metrology::sample::{AxisDrift, ThermalModel};
use nalgebra::Vector3;

/// What becomes of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Passage {
    /// It is used from now on.
    Accepted,
    /// It is used: the one kept back before was like it.
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
}

/// The gate and the model behind it.
#[derive(Clone, Debug)]
pub struct ModelGate {
    physical_rate_mm_s: f64,
    margin_mm: f64,
    current: Option<ThermalModel>,
    kept: Option<ThermalModel>,
}

impl ModelGate {
    /// A gate for drifts up to `physical_rate_mm_s`.
    #[must_use]
    pub fn new(physical_rate_mm_s: f64, margin_mm: f64) -> Self {
        Self {
            physical_rate_mm_s,
            margin_mm,
            current: None,
            kept: None,
        }
    }

    /// The model to use.
    #[must_use]
    pub fn current(&self) -> Option<&ThermalModel> {
        self.current.as_ref()
    }

    /// Judges a new model.
    pub fn offer(&mut self, model: ThermalModel) -> Passage {
        if let Some(axis) = not_finite(&model) {
            return Passage::NotFinite { axis };
        }
        let jump = self.current.as_ref().and_then(|old| self.jump(old, &model));
        let kept = self.kept.take();
        let Some((axis, change_mm, limit_mm)) = jump else {
            self.current = Some(model);
            return Passage::Accepted;
        };
        if kept.is_some_and(|kept| {
            kept.sequence != model.sequence && self.jump(&kept, &model).is_none()
        }) {
            self.current = Some(model);
            return Passage::Confirmed;
        }
        self.kept = Some(model);
        Passage::Quarantined {
            axis,
            change_mm,
            limit_mm,
        }
    }

    /// The greatest change beyond (1).
    fn jump(&self, old: &ThermalModel, new: &ThermalModel) -> Option<(Axis, f64, f64)> {
        let apart_s = (new.at - old.at).as_secs_f64().abs();
        let limit_mm = self.physical_rate_mm_s * apart_s + self.margin_mm;
        let mut worst: Option<(Axis, f64, f64)> = None;
        for axis in Axis::LINEAR {
            for corner_mm in corners(old, new) {
                // Validity is judged when the model is used; here only its numbers count.
                let value = |model: &ThermalModel| {
                    axis_drift_whenever(model, axis, &corner_mm, new.at, Extrapolate::Linear)
                };
                let (Ok(before_mm), Ok(after_mm)) = (value(old), value(new)) else {
                    continue;
                };
                let change_mm = after_mm - before_mm;
                let beyond = change_mm.abs() > limit_mm;
                if beyond && worst.is_none_or(|(_, w, _)| change_mm.abs() > w.abs()) {
                    worst = Some((axis, change_mm, limit_mm));
                }
            }
        }
        worst
    }
}

/// The eight corners of the box that both models' spans share.
fn corners(old: &ThermalModel, new: &ThermalModel) -> [Vector3<f64>; 8] {
    let ends = Axis::LINEAR.map(|axis| {
        let span = |m: &ThermalModel| m.axes[axis].map(|d| d.span_mm);
        match (span(old), span(new)) {
            (Some(a), Some(b)) => (a.0.min(b.0), a.1.max(b.1)),
            (Some(one), None) | (None, Some(one)) => one,
            (None, None) => (0.0, 0.0),
        }
    });
    std::array::from_fn(|corner| {
        Vector3::from_fn(|row, _| {
            if corner >> row & 1 == 0 {
                ends[row].0
            } else {
                ends[row].1
            }
        })
    })
}

fn not_finite(model: &ThermalModel) -> Option<Axis> {
    Axis::ALL
        .into_iter()
        .find(|&axis| model.axes[axis].is_some_and(|drift| !is_sound(&drift)))
}

fn is_sound(drift: &AxisDrift) -> bool {
    let numbers = [
        drift.p0_mm,
        drift.k0_mm,
        drift.slope_mm_per_mm,
        drift.span_mm.0,
        drift.span_mm.1,
        drift.rate_mm_s,
        drift.slope_rate_per_s,
    ];
    numbers.iter().all(|x| x.is_finite())
        && drift.cross_slope_mm_per_mm.iter().all(|x| x.is_finite())
        && drift.cross_origin_mm.iter().all(|x| x.is_finite())
        && drift.time_constant_s > 0.0
        && drift.span_mm.0 <= drift.span_mm.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::{PerAxis, Stamp};

    fn model(sequence: u32, at_s: i64, k0_mm: f64) -> ThermalModel {
        let mut axes = PerAxis::default();
        axes[Axis::X] = Some(AxisDrift {
            k0_mm,
            span_mm: (-200.0, 200.0),
            time_constant_s: f64::INFINITY,
            ..AxisDrift::default()
        });
        let at = Stamp::from_nanos(at_s * 1_000_000_000);
        ThermalModel {
            at,
            axes,
            valid_from: at,
            valid_until: at,
            n_blocks: 2,
            lack_of_fit_p: f64::NAN,
            quarantined: false,
            sequence,
        }
    }

    fn gate() -> ModelGate {
        ModelGate::new(3e-3 / 60.0, 1e-3)
    }

    #[test]
    fn eq1_a_jump_waits_for_a_second_model_that_agrees() {
        let mut gate = gate();
        assert_eq!(gate.offer(model(1, 0, 0.0)), Passage::Accepted);
        assert_eq!(gate.offer(model(2, 60, 0.0039)), Passage::Accepted);
        let jumped = gate.offer(model(3, 120, 0.060));
        assert!(
            matches!(jumped, Passage::Quarantined { axis: Axis::X, .. }),
            "{jumped:?}"
        );
        assert_eq!(gate.current().unwrap().sequence, 2);
        // The same model again (a latched topic read twice) confirms nothing.
        assert!(matches!(
            gate.offer(model(3, 120, 0.060)),
            Passage::Quarantined { .. }
        ));
        assert_eq!(gate.offer(model(4, 180, 0.061)), Passage::Confirmed);
        assert_eq!(gate.current().unwrap().sequence, 4);
    }

    #[test]
    fn a_model_that_returns_to_the_old_state_is_accepted() {
        let mut gate = gate();
        gate.offer(model(1, 0, 0.0));
        gate.offer(model(2, 60, 0.1));
        assert_eq!(gate.offer(model(3, 120, 0.001)), Passage::Accepted);
    }

    #[test]
    fn a_model_with_a_number_that_is_none_never_passes() {
        assert_eq!(
            gate().offer(model(1, 0, f64::NAN)),
            Passage::NotFinite { axis: Axis::X }
        );
        let mut timeless = model(1, 0, 0.0);
        timeless.axes[Axis::X].as_mut().unwrap().time_constant_s = f64::NAN;
        assert_eq!(gate().offer(timeless), Passage::NotFinite { axis: Axis::X });
    }
}
