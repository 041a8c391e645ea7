//! The step that touches a sphere at several poses of the rotary axes.

use std::num::NonZeroU32;

use machine::cycle::{RotaryOrder, rotary};
use machine::poses::{ReachLimits, calibration_poses, verification_poses};
use machine::{CycleError, MachineFile};
use metrology::{Axis, PerAxis};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::SequencerError;
use crate::job::{Owner, Task};
use crate::plan::Step;
use crate::task::of_cycle;

/// What a rotary step says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RotaryStep {
    /// Name of the sphere.
    pub sphere: String,
    /// Poses, each with the positions of the machine's rotary axes in the order A B C, deg.
    #[serde(default)]
    pub poses: Vec<Vec<f64>>,
    /// Poses to be planned instead; those of a verification differ from those of the steps before.
    #[serde(default)]
    pub planned: u32,
    /// Touches at each pose.
    pub points: u32,
    /// Visits of each pose.
    #[serde(default = "once")]
    pub repeats: u32,
    /// Whether a model is judged, not found.
    #[serde(default)]
    pub verification: bool,
    /// Whether the sphere was put elsewhere since the rotary step before.
    #[serde(default)]
    pub set_up_anew: bool,
}

const fn once() -> u32 {
    1
}

impl RotaryStep {
    /// In words, for displays.
    pub(crate) fn activity(&self) -> String {
        let what = if self.verification {
            "verifying"
        } else {
            "calibrating"
        };
        format!("{what} the rotary axes on {}", self.sphere)
    }
}

/// The task of the rotary step at place `at` of a plan.
pub(crate) fn task(
    at: usize,
    step: &RotaryStep,
    before: &[Step],
    machine: &MachineFile,
) -> Result<Task, SequencerError> {
    let poses_rad = poses(at, step, before, machine)?;
    let repeats = NonZeroU32::new(step.repeats).ok_or(SequencerError::NoRepeats { step: at })?;
    let order = RotaryOrder {
        sphere: &step.sphere,
        poses_rad: &poses_rad,
        points: step.points,
        repeats,
        verification: step.verification,
    };
    let mut task = rotary(machine, &order)
        .map(|cycle| of_cycle(cycle, false, machine, Owner::Step))
        .map_err(|source| SequencerError::Cycle { step: at, source })?;
    task.trace.setup_id = setup_id(step, before.get(..at).unwrap_or(before));
    Ok(task)
}

/// Number of the sphere's set-up, from 1.
fn setup_id(step: &RotaryStep, before: &[Step]) -> u32 {
    let is_new = |step: &Step| matches!(step, Step::Rotary(step) if step.set_up_anew);
    let earlier = before.iter().filter(|step| is_new(step)).count();
    u32::try_from(1 + earlier + usize::from(step.set_up_anew)).unwrap_or(u32::MAX)
}

/// The poses of a step, rad.
fn poses(
    at: usize,
    step: &RotaryStep,
    before: &[Step],
    machine: &MachineFile,
) -> Result<Vec<PerAxis<f64>>, SequencerError> {
    match (step.poses.is_empty(), step.planned) {
        (false, 0) => given(at, step, machine),
        (true, planned) if planned > 0 => planned_poses(at, step, before, machine)
            .map_err(|source| SequencerError::Cycle { step: at, source }),
        _ => Err(SequencerError::PosesOrPlanned {
            step: at,
            poses: step.poses.len(),
            planned: step.planned,
        }),
    }
}

fn given(
    at: usize,
    step: &RotaryStep,
    machine: &MachineFile,
) -> Result<Vec<PerAxis<f64>>, SequencerError> {
    let axes: Vec<Axis> = Axis::ROTARY
        .into_iter()
        .filter(|axis| machine.rotary_axis(*axis).is_some())
        .collect();
    let of_one = |(pose, positions): (usize, &Vec<f64>)| {
        if positions.len() != axes.len() {
            return Err(SequencerError::PoseLength {
                step: at,
                pose,
                n: positions.len(),
                axes: axes
                    .iter()
                    .map(|axis| axis.letter())
                    .collect::<Vec<_>>()
                    .join(" "),
            });
        }
        let mut pose_rad = PerAxis::default();
        for (&axis, position_deg) in axes.iter().zip(positions) {
            pose_rad[axis] = position_deg.to_radians();
        }
        Ok(pose_rad)
    };
    step.poses.iter().enumerate().map(of_one).collect()
}

fn planned_poses(
    at: usize,
    step: &RotaryStep,
    before: &[Step],
    machine: &MachineFile,
) -> Result<Vec<PerAxis<f64>>, CycleError> {
    let limits = ReachLimits::default();
    let n = usize::try_from(step.planned).unwrap_or(usize::MAX);
    let found = if step.verification {
        let mut used = Vec::new();
        for (place, earlier) in before.iter().enumerate().take(at) {
            if let Step::Rotary(earlier) = earlier
                && !earlier.verification
                && earlier.sphere == step.sphere
                && let Ok(poses) = poses(place, earlier, before, machine)
            {
                used.extend(poses);
            }
        }
        verification_poses(machine, &step.sphere, n, &used, &limits)
    } else {
        calibration_poses(machine, &step.sphere, n, &limits)
    };
    found.map_err(|source| CycleError::Pose { source })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use metrology::sample::TestKind;

    use super::*;
    use crate::plan::Plan;

    fn machine() -> MachineFile {
        let text = include_str!("../../libraries/machine/tests/data/bench.yaml");
        MachineFile::parse(text, "bench.yaml").unwrap()
    }

    fn plan(steps: &str) -> Plan {
        serde_saphyr::from_str(&format!("title: test\nsteps:\n{steps}")).unwrap()
    }

    fn said(steps: &str) -> String {
        crate::task::check(&plan(steps), &machine(), &BTreeMap::new())
            .unwrap_err()
            .to_string()
    }

    fn tasks(steps: &str) -> Vec<Task> {
        let steps = plan(steps).steps;
        let of_step = |(at, step): (usize, &Step)| match step {
            Step::Rotary(step) => task(at, step, &steps, &machine()).unwrap(),
            other => panic!("{other:?}"),
        };
        steps.iter().enumerate().map(of_step).collect()
    }

    fn turns(task: &Task) -> Vec<String> {
        let lines = task.text.lines().filter(|line| line.starts_with("G0 A"));
        lines.skip(1).map(str::to_owned).collect()
    }

    #[test]
    fn given_poses_are_visited_and_visited_again_backwards() {
        let tasks = tasks(
            "  - {do: rotary, sphere: ball, poses: [[-30.0, 15.0], [10.0, 90.0]], points: 5, repeats: 2}",
        );
        assert_eq!(
            turns(&tasks[0]),
            ["G0 A-30 C15", "G0 A10 C90", "G0 A10 C90", "G0 A-30 C15"]
        );
        assert_eq!((tasks[0].kind, tasks[0].planned), (TestKind::Rotary, 20));
    }

    #[test]
    fn planned_poses_of_a_verification_are_others() {
        let tasks = tasks(
            "  - {do: rotary, sphere: ball, planned: 10, points: 6}\n  - {do: rotary, sphere: ball, planned: 5, points: 6, verification: true}",
        );
        assert_eq!(tasks[1].kind, TestKind::RotaryVerification);
        let used = turns(&tasks[0]);
        assert_eq!((used.len(), turns(&tasks[1]).len()), (10, 5));
        assert!(turns(&tasks[1]).iter().all(|turn| !used.contains(turn)));
    }

    #[test]
    fn a_sphere_that_was_put_elsewhere_has_a_set_up_of_its_own() {
        let step = "  - {do: rotary, sphere: ball, planned: 5, points: 6";
        let tasks = tasks(&format!(
            "{step}}}\n{step}, set_up_anew: true}}\n{step}, verification: true}}"
        ));
        let setups: Vec<u32> = tasks.iter().map(|task| task.trace.setup_id).collect();
        assert_eq!(setups, [1, 2, 2]);
    }

    #[test]
    fn bad_rotary_steps_are_refused_with_their_place() {
        assert_eq!(
            said("  - {do: rotary, sphere: ball, points: 6}"),
            "steps[0]: 0 poses and planned = 0: exactly one of the two must be given"
        );
        assert_eq!(
            said("  - {do: rotary, sphere: ball, poses: [[0.0]], points: 6}"),
            "steps[0].poses[0]: 1 positions, the rotary axes are A C"
        );
        assert_eq!(
            said("  - {do: rotary, sphere: ball, poses: [[40.0, 0.0]], points: 6}"),
            "steps[0]: poses[0]: axis A would go to 40.0000 deg, travel is [-120, 30] deg"
        );
        assert!(
            said("  - {do: rotary, sphere: bull, planned: 8, points: 6}")
                .contains("sphere \"bull\"")
        );
        assert!(
            said("  - {do: rotary, sphere: ball, planned: 3, points: 6}").contains("at least 4")
        );
        assert!(
            said("  - {do: rotary, sphere: ball, planned: 8, points: 4}").contains("at least 5")
        );
        assert_eq!(
            said("  - {do: rotary, sphere: ball, planned: 8, points: 6, repeats: 0}"),
            "steps[0].repeats = 0: must be above 0"
        );
        let unknown = serde_saphyr::from_str::<Plan>(
            "title: t\nsteps:\n  - {do: rotary, sphere: ball, planned: 8, points: 6, pose: 1}",
        );
        assert!(unknown.unwrap_err().to_string().contains("pose"));
    }
}
