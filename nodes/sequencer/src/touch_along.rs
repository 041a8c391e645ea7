//! The step that touches a sphere along given directions of the probe's axis.

use std::num::NonZeroU32;

use machine::MachineFile;
use machine::cycle::{FeatureId, PointedOrder, pointed};
use machine::orientation::Pointing;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::SequencerError;
use crate::job::{Owner, Task};
use crate::task::of_cycle;

/// What the step says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TouchAlongStep {
    /// Name of the sphere.
    pub sphere: String,
    /// Directions from the ball to the spindle, workpiece frame, of any length.
    pub probe_axes: Vec<[f64; 3]>,
    /// Touches along each.
    #[serde(default = "once")]
    pub repeats: u32,
}

const fn once() -> u32 {
    1
}

/// How one direction of the probe's axis is taken.
#[derive(Clone, Debug, PartialEq)]
pub struct PointedTouch {
    /// Name of its touches, `<sphere>.<k>`.
    pub feature_id: String,
    /// The direction as the plan has it.
    pub probe_axis: [f64; 3],
    /// Positions of A and C, both solutions, and whether C is free.
    pub pointing: Pointing,
}

impl TouchAlongStep {
    /// In words, for displays.
    pub(crate) fn activity(&self) -> String {
        format!(
            "touching {} along {} directions of the probe",
            self.sphere,
            self.probe_axes.len()
        )
    }
}

/// The task of the step at place `at` of a plan, and how each direction is taken.
pub(crate) fn task(
    at: usize,
    step: &TouchAlongStep,
    machine: &MachineFile,
) -> Result<(Task, Vec<PointedTouch>), SequencerError> {
    let repeats = NonZeroU32::new(step.repeats).ok_or(SequencerError::NoRepeats { step: at })?;
    let probe_axes: Vec<Vector3<f64>> =
        step.probe_axes.iter().copied().map(Vector3::from).collect();
    let order = PointedOrder {
        sphere: &step.sphere,
        probe_axes: &probe_axes,
        repeats,
    };
    let (cycle, pointings) =
        pointed(machine, &order).map_err(|source| SequencerError::Cycle { step: at, source })?;
    let touches =
        (1..)
            .zip(step.probe_axes.iter().zip(pointings))
            .map(|(index, (probe_axis, pointing))| PointedTouch {
                feature_id: FeatureId::Point {
                    artefact: &step.sphere,
                    index,
                }
                .to_string(),
                probe_axis: *probe_axis,
                pointing,
            });
    let touches = touches.collect();
    Ok((of_cycle(cycle, false, machine, Owner::Step), touches))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use metrology::sample::TestKind;

    use super::*;
    use crate::plan::{Plan, Step};

    fn machine() -> MachineFile {
        let text = include_str!("../../libraries/machine/tests/data/bench.yaml");
        MachineFile::parse(text, "bench.yaml").unwrap()
    }

    fn step(keys: &str) -> Plan {
        let text = format!("title: t\nsteps:\n  - {{do: touch_along, sphere: ball, {keys}}}");
        Plan::from_yaml(&text).unwrap()
    }

    fn said(keys: &str) -> String {
        crate::task::check(&step(keys), &machine(), &BTreeMap::new())
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn val_a_and_c_of_a_table_on_a_table_are_those_of_the_arc_tangents() {
        // d = (sin A sin C, sin A cos C, cos A): A = -25, C = 40 gives (-0.271654, -0.323744, 0.906308). (0, sin 40, cos 40)
        // is A = 40, C = 0, outside the travel of A to 30, or A = -40, C = 180. Along Z C is free and stays.
        let keys = "probe_axes: [[-0.271654, -0.323744, 0.906308], [0.0, 0.642788, 0.766044], [0.0, 0.0, 3.0]]";
        let plan = step(&format!("{keys}, repeats: 2"));
        let Step::TouchAlong(touches) = &plan.steps[0] else {
            panic!("{plan:?}");
        };
        let (task, touches) = task(0, touches, &machine()).unwrap();
        assert_eq!((task.kind, task.planned), (TestKind::Touch, 6));
        let names: Vec<&str> = touches.iter().map(|t| t.feature_id.as_str()).collect();
        assert_eq!(names, ["ball.1", "ball.2", "ball.3"]);
        let expected = [
            ([-25.0, 40.0], [25.0, -140.0], true),
            ([-40.0, 180.0], [40.0, 0.0], false),
            ([0.0, 180.0], [0.0, 180.0], true),
        ];
        for (touch, (taken, other, is_inside)) in touches.iter().zip(expected) {
            let both = touch.pointing.solutions.map(|solution| {
                let at = solution.position;
                [at.a_rad, at.c_rad].map(f64::to_degrees)
            });
            for (found, expected) in both.iter().flatten().zip(taken.iter().chain(&other)) {
                assert!((found - expected).abs() < 1e-3, "{both:?}");
            }
            assert_eq!(touch.pointing.solutions[1].is_inside_travel, is_inside);
            assert_eq!(touch.pointing.singular, touch.feature_id == "ball.3");
        }
        let turns: Vec<[f64; 2]> = task
            .text
            .lines()
            .filter_map(|line| line.strip_prefix("G0 A")?.split_once(" C"))
            .map(|(a, c)| [a.parse().unwrap(), c.parse().unwrap()])
            .collect();
        for (turn, (taken, ..)) in turns.iter().skip(1).zip(expected) {
            assert!((turn[0] - taken[0]).abs() < 1e-3 && (turn[1] - taken[1]).abs() < 1e-3);
        }
        assert_eq!(turns.len(), 4);
    }

    #[test]
    fn a_direction_that_is_none_or_not_reached_is_refused_with_its_place() {
        assert_eq!(
            said("probe_axes: [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]"),
            "steps[0]: probe_axes[1]: probe axis of length 0 has no direction; give a vector from the ball to the spindle"
        );
        assert_eq!(
            said("probe_axes: [[1.0, 0.0, -2.0]]"),
            "steps[0]: probe_axes[0]: no solution inside the travel: A = -153.435 deg or its opposite, travel of A [-120.000, 30.000] deg, of C [-360.000, 360.000] deg"
        );
        assert!(said("probe_axes: []").contains("probe axis in the request"));
        assert_eq!(
            said("probe_axes: [[0.0, 0.0, 1.0]], repeats: 0"),
            "steps[0].repeats = 0: must be above 0"
        );
    }
}
