//! What a geometric error component does to the tip along a run, machine frame.
//!
//! The sensitivities of `volumetric::sensitivity` are affine in the linear positions while the rotary
//! axes stand, so that they are taken at four poses only:
//!
//! ```text
//!   s(p) = s(0) + sum_i p_i (s(e_i) - s(0))                               (1)
//! ```
//!
//! They are turned from the workpiece frame into the machine frame, in which a response keeps the tip.

use metrology::{Axis, ErrorComponent, PerAxis};
use nalgebra::{Matrix3, Vector3};

use super::Scene;
use crate::Response;
use machine::volumetric::sensitivity;

/// Adds the value of a component (mm or rad) at each tick, times its lever, to the tip; nothing where the run
/// did not record the component's axis.
pub(super) fn add(
    scene: &Scene<'_>,
    component: ErrorComponent,
    response: &mut Response,
    value_at: impl Fn(usize) -> f64,
) {
    if !scene.run.motion.axes.contains(component.of) {
        return;
    }
    let mut lever = Lever::new(scene, component);
    let moves = lever.moves();
    let mut k = 0;
    let mut sums = response.tip_mm.each_mut().map(|series| {
        k += 1;
        if moves[k - 1] {
            &mut series[..]
        } else {
            &mut []
        }
    });
    for tick in 0..scene.run.motion.len() {
        let value = value_at(tick);
        let arm = lever.at(tick);
        for (sum, along) in sums.iter_mut().zip(&arm) {
            if let Some(sum) = sum.get_mut(tick) {
                *sum += value * along;
            }
        }
    }
}

/// mm per µm of a displacement, rad per µrad of a turn.
pub(super) const fn per_micro(component: ErrorComponent) -> f64 {
    if component.is_angular() { 1e-6 } else { 1e-3 }
}

struct Lever<'a> {
    scene: &'a Scene<'a>,
    component: ErrorComponent,
    tool_offset_mm: Vector3<f64>,
    /// Which rotary axes the run has, in the order A B C.
    turns: [bool; 3],
    rotary: [f64; 3],
    affine: Option<(Vector3<f64>, Matrix3<f64>)>,
}

impl<'a> Lever<'a> {
    fn new(scene: &'a Scene<'a>, component: ErrorComponent) -> Self {
        let axes = scene.run.motion.axes;
        Self {
            scene,
            component,
            tool_offset_mm: scene.run.segment.tool_offset_mm,
            turns: Axis::ROTARY.map(|axis| axes.contains(axis)),
            rotary: [0.0; 3],
            affine: None,
        }
    }

    /// Which coordinates of the tip it can move: all while rotary axes turn.
    fn moves(&mut self) -> [bool; 3] {
        let position = &self.scene.run.motion.position;
        let turns = Axis::ROTARY.into_iter().any(|axis| {
            let first = position[axis].first();
            position[axis].iter().any(|here| Some(here) != first)
        });
        if turns || self.scene.run.motion.is_empty() {
            return [true; 3];
        }
        self.at(0);
        let (at_zero, per_mm) = self.renewed();
        std::array::from_fn(|k| at_zero[k] != 0.0 || per_mm.row(k).iter().any(|x| *x != 0.0))
    }

    fn at(&mut self, tick: usize) -> Vector3<f64> {
        let position = &self.scene.run.motion.position;
        let mut stands = true;
        for (k, axis) in Axis::ROTARY.into_iter().enumerate() {
            if self.turns[k] && self.rotary[k].to_bits() != position[axis][tick].to_bits() {
                self.rotary[k] = position[axis][tick];
                stands = false;
            }
        }
        let linear = Axis::LINEAR.map(|axis| position[axis].get(tick).copied().unwrap_or(0.0));
        if !stands {
            self.affine = None;
            return self.of(linear);
        }
        let (at_zero, per_mm) = match self.affine {
            Some(affine) => affine,
            None => *self.affine.insert(self.renewed()),
        };
        at_zero + per_mm * Vector3::from(linear) // (1)
    }

    fn renewed(&self) -> (Vector3<f64>, Matrix3<f64>) {
        let at_zero = self.of([0.0; 3]);
        let column = |k: usize| {
            let mut one = [0.0; 3];
            one[k] = 1.0;
            self.of(one) - at_zero
        };
        let per_mm = Matrix3::from_columns(&[column(0), column(1), column(2)]);
        (at_zero, per_mm)
    }

    fn of(&self, linear: [f64; 3]) -> Vector3<f64> {
        let [x, y, z] = linear;
        let [a, b, c] = self.rotary;
        let pose = PerAxis([x, y, z, a, b, c]);
        let kinematics = self.scene.kinematics;
        let in_workpiece = sensitivity(kinematics, &pose, &self.tool_offset_mm, self.component);
        kinematics.direction_in_machine(&pose, &in_workpiece)
    }
}
