//! Keeps back a geometry model that is of another machine, senseless, or differs from the one in use.

use std::f64::consts::{PI, TAU};

use machine::volumetric::{VolumetricError, VolumetricModel};
use machine::{Kinematics, MachineFile};
use metrology::drift::Extrapolate;
use metrology::sample::{CurveForm, GeometryModel};
use metrology::{Axis, PerAxis};
use nalgebra::Vector3;

use super::GeometrySource;

/// What becomes of a model.
#[derive(Clone, Debug, PartialEq)]
pub enum GeometryPassage {
    /// It is used from now on.
    Accepted,
    /// It is used: the one kept back before was like it.
    Confirmed,
    /// It is kept back.
    Quarantined {
        /// Greatest change of the tip's error, mm.
        change_mm: f64,
        /// What is allowed, mm.
        limit_mm: f64,
    },
    /// An axis was not moved yet while it was recorded: its errors are not in the model.
    Incomplete {
        /// The axis.
        axis: Axis,
    },
    /// It is no model of this machine.
    Refused {
        /// Why.
        cause: Box<VolumetricError>,
    },
}

/// The gate and the models behind it.
#[derive(Clone, Debug)]
pub struct GeometryGate {
    kinematics: Kinematics,
    policy: Extrapolate,
    jump_limit_mm: f64,
    tool_offset_mm: Vector3<f64>,
    poses: Vec<PerAxis<f64>>,
    published: [Option<GeometryModel>; 2],
    kept: [Option<GeometryModel>; 2],
    current: Option<VolumetricModel>,
}

impl GeometryGate {
    /// A gate for changes of the tip's error up to `jump_limit_mm` at these poses; what passes has this
    /// policy.
    #[must_use]
    pub const fn new(
        kinematics: Kinematics,
        policy: Extrapolate,
        jump_limit_mm: f64,
        tool_offset_mm: Vector3<f64>,
        poses: Vec<PerAxis<f64>>,
    ) -> Self {
        Self {
            poses,
            kinematics,
            policy,
            jump_limit_mm,
            tool_offset_mm,
            published: [None, None],
            kept: [None, None],
            current: None,
        }
    }

    /// What to compensate with.
    #[must_use]
    pub const fn current(&self) -> Option<&VolumetricModel> {
        self.current.as_ref()
    }

    /// Judges a new model.
    pub fn offer(&mut self, source: GeometrySource, model: GeometryModel) -> GeometryPassage {
        if let Some(axis) = standing(&model) {
            return GeometryPassage::Incomplete { axis };
        }
        let place = source as usize;
        let with = |one: &GeometryModel| {
            let other = self.published[1 - place].as_ref();
            let models: Vec<_> = std::iter::once(one).chain(other).collect();
            VolumetricModel::merged(&self.kinematics, &models)
        };
        let merged = match with(&model) {
            Ok(merged) => merged,
            Err(cause) => {
                let cause = Box::new(cause);
                return GeometryPassage::Refused { cause };
            }
        };
        let limit_mm = self.jump_limit_mm;
        let change_mm = match &self.published[place] {
            Some(before) => self.change_mm(before, &model),
            None => 0.0,
        };
        let kept = self.kept[place].take();
        let passage = if change_mm <= limit_mm {
            GeometryPassage::Accepted
        } else if kept.is_some_and(|kept| {
            kept.sequence != model.sequence && self.change_mm(&kept, &model) <= limit_mm
        }) {
            GeometryPassage::Confirmed
        } else {
            self.kept[place] = Some(model);
            return GeometryPassage::Quarantined {
                change_mm,
                limit_mm,
            };
        };
        self.current = Some(merged.with_extrapolate(self.policy));
        self.published[place] = Some(model);
        passage
    }

    /// Greatest difference of the tip's errors at the poses, mm; infinite where one of them has no answer, or one that is no
    /// number.
    fn change_mm(&self, old: &GeometryModel, new: &GeometryModel) -> f64 {
        let model = |one| {
            let model = VolumetricModel::new(&self.kinematics, one);
            model.map(|model| model.with_extrapolate(Extrapolate::Hold))
        };
        let (Ok(before), Ok(after)) = (model(old), model(new)) else {
            return f64::INFINITY;
        };
        let error = |model: &VolumetricModel, at: &PerAxis<f64>| {
            model.tip_error_mm(at, &self.tool_offset_mm)
        };
        self.poses
            .iter()
            .map(|at| match (error(&before, at), error(&after, at)) {
                (Ok(before_mm), Ok(after_mm)) => (after_mm - before_mm).norm(),
                _ => f64::INFINITY,
            })
            .map(|change_mm| {
                if change_mm.is_nan() {
                    f64::INFINITY
                } else {
                    change_mm
                }
            })
            .fold(0.0, f64::max)
    }
}

/// Ends and middle of each axis' travel, every combination; of a rotary axis within a turn, since both
/// ends of more than one are the same place.
#[must_use]
pub fn poses(machine: &MachineFile) -> Vec<PerAxis<f64>> {
    const TURN_RAD: (f64, f64) = (-TAU / 3.0, PI);
    let travel = PerAxis::from_fn(|axis| {
        let linear = machine.linear(axis).map(|linear| linear.travel_mm);
        let rotary = machine.rotary_axis(axis).map(|rotary| {
            let [least, greatest] = rotary.travel_deg.map(f64::to_radians);
            [least.max(TURN_RAD.0), greatest.min(TURN_RAD.1)]
        });
        linear.or(rotary)
    });
    let mut poses = vec![PerAxis::default()];
    for axis in Axis::ALL {
        let Some([least, greatest]) = travel[axis] else {
            continue;
        };
        let places = [least, f64::midpoint(least, greatest), greatest];
        let with = |pose: PerAxis<f64>| {
            places.map(|place| {
                let mut placed = pose;
                placed[axis] = place;
                placed
            })
        };
        poses = poses.into_iter().flat_map(with).collect();
    }
    poses
}

/// The first axis whose errors are told at one position alone: it stood while it was recorded.
fn standing(model: &GeometryModel) -> Option<Axis> {
    let mut motions = model
        .curves
        .iter()
        .filter(|curve| curve.form != CurveForm::Constant);
    let at_one = |span: (f64, f64)| span.0.is_finite() && span.0.to_bits() == span.1.to_bits();
    let found = motions.find(|curve| at_one(curve.span));
    found.map(|curve| curve.component.of)
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::Stamp;
    use metrology::sample::ErrorCurve;
    use nalgebra::DMatrix;

    const CHAIN: &str = "[w C' A' Y' b X Z t]";
    const MACHINE: &str = include_str!("../../../libraries/machine/tests/data/bench.yaml");

    fn model(sequence: u32, chain: &str, name: &str, value: f64) -> GeometryModel {
        let curve = ErrorCurve {
            component: name.parse().unwrap(),
            form: CurveForm::Constant,
            origin: 0.0,
            power: Vec::new(),
            position: Vec::new(),
            coefficient: vec![value],
            standard_uncertainty: vec![f64::NAN],
            estimable: vec![true],
            span: (0.0, 0.0),
        };
        GeometryModel {
            at: Stamp::from_nanos(0),
            chain: chain.to_owned(),
            curves: vec![curve],
            covariance: DMatrix::zeros(1, 1),
            combinations: Vec::new(),
            n_samples: 100,
            n_unknowns: 1,
            rank: 1,
            residual_standard_deviation_mm: 0.0,
            sequence,
        }
    }

    fn gate() -> GeometryGate {
        let kinematics = Kinematics::of_chain(CHAIN.parse().unwrap(), PerAxis::default());
        let machine: MachineFile = serde_saphyr::from_str(MACHINE).unwrap();
        let poses = poses(&machine);
        assert_eq!(poses.len(), 3_usize.pow(5));
        GeometryGate::new(
            kinematics,
            Extrapolate::Refuse,
            0.005,
            Vector3::zeros(),
            poses,
        )
    }

    fn exx_in_use(gate: &GeometryGate) -> Option<f64> {
        gate.current()?.component_value("EXX".parse().unwrap(), 0.0)
    }

    #[test]
    fn eq2_a_jump_waits_for_a_second_model_that_agrees() {
        use GeometrySource::Linear;
        let mut gate = gate();
        let exx = |sequence, value| model(sequence, CHAIN, "EXX", value);
        assert_eq!(gate.offer(Linear, exx(1, 0.010)), GeometryPassage::Accepted);
        assert_eq!(gate.offer(Linear, exx(2, 0.014)), GeometryPassage::Accepted);
        let jumped = gate.offer(Linear, exx(3, 0.040));
        assert!(
            matches!(jumped, GeometryPassage::Quarantined { .. }),
            "{jumped:?}"
        );
        assert_eq!(exx_in_use(&gate), Some(0.014));
        // A latched topic read twice confirms nothing.
        let again = gate.offer(Linear, exx(3, 0.040));
        assert!(matches!(again, GeometryPassage::Quarantined { .. }));
        assert_eq!(
            gate.offer(Linear, exx(4, 0.041)),
            GeometryPassage::Confirmed
        );
        assert_eq!(exx_in_use(&gate), Some(0.041));
    }

    #[test]
    fn a_displaced_table_is_a_jump_although_it_is_none_at_zero() {
        let mut gate = gate();
        let line = |sequence, value| model(sequence, CHAIN, "EX0C", value);
        gate.offer(GeometrySource::Rotary, line(1, 0.0));
        let jumped = gate.offer(GeometrySource::Rotary, line(2, 0.003));
        let GeometryPassage::Quarantined { change_mm, .. } = jumped else {
            panic!("{jumped:?}");
        };
        assert!((change_mm - 0.006).abs() < 1e-12, "{change_mm}");
    }

    #[test]
    fn models_of_both_kinds_are_used_together_and_never_the_same_component_twice() {
        let mut gate = gate();
        gate.offer(GeometrySource::Linear, model(1, CHAIN, "EXX", 0.01));
        let rotary = gate.offer(GeometrySource::Rotary, model(1, CHAIN, "EX0C", 0.05));
        assert_eq!(rotary, GeometryPassage::Accepted);
        assert_eq!(exx_in_use(&gate), Some(0.01));
        let twice = gate.offer(GeometrySource::Rotary, model(2, CHAIN, "EXX", 0.01));
        let cause = Box::new(VolumetricError::Duplicate {
            component: "EXX".parse().unwrap(),
        });
        assert_eq!(twice, GeometryPassage::Refused { cause });
    }

    #[test]
    fn a_model_whose_errors_are_no_numbers_never_takes_the_place_of_a_good_one() {
        let mut gate = gate();
        let (exx, ecy) = (("EXX", 0.010), ("ECY", 1e200));
        let with = |sequence, (name, value)| model(sequence, CHAIN, name, value);
        gate.offer(GeometrySource::Linear, with(1, exx));
        for sequence in [2, 3] {
            let passage = gate.offer(GeometrySource::Linear, with(sequence, ecy));
            let GeometryPassage::Quarantined { change_mm, .. } = passage else {
                panic!("{passage:?}");
            };
            assert!(change_mm.is_infinite(), "{change_mm}");
        }
        assert_eq!(exx_in_use(&gate), Some(0.010));
    }

    #[test]
    fn a_model_of_recordings_in_which_an_axis_stood_waits_for_more() {
        let mut gate = gate();
        let mut early = model(1, CHAIN, "EXX", 0.01);
        early.curves[0].form = CurveForm::Polynomial;
        early.curves[0].power = vec![1];
        early.curves[0].span = (40.0, 40.0);
        let passage = gate.offer(GeometrySource::Linear, early);
        assert_eq!(passage, GeometryPassage::Incomplete { axis: Axis::X });
        assert!(gate.current().is_none());
    }

    #[test]
    fn models_of_another_machine_or_with_numbers_that_are_none_never_pass() {
        let mut gate = gate();
        for wrong in [
            model(1, "[w X' Y' b Z t]", "EXX", 0.0),
            model(2, CHAIN, "EXX", f64::NAN),
            model(3, CHAIN, "EXB", 0.0),
        ] {
            let passage = gate.offer(GeometrySource::Linear, wrong);
            assert!(
                matches!(passage, GeometryPassage::Refused { .. }),
                "{passage:?}"
            );
        }
        assert!(gate.current().is_none());
    }
}
