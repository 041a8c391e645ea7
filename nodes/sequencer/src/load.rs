//! How much a plan measures, before anything of it is run.
//!
//! Whoever rehearses a plan holds all that it would record. Counts and the least time follow from the plan alone, so that
//! a plan too large for a rehearsal is refused before the rehearsal begins.

use std::collections::BTreeMap;

use machine::MachineFile;

use crate::bounds;
use crate::error::SequencerError;
use crate::plan::{Plan, Step};
use crate::rotary;
use crate::task;
use crate::touch_along;

/// What the steps of a plan add up to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Runs of measuring steps, both ways of a bidirectional one counted.
    pub runs: u64,
    /// Stops of measuring steps.
    pub stops: u64,
    /// Touches of the probe; those of block cycles that production asks for are not known before.
    pub touches: u64,
    /// Rest, production and the way of measuring steps at their feed: the plan takes longer, min.
    pub least_min: f64,
}

/// Adds up a plan; `programs` are those that it names.
///
/// # Errors
/// As the plan itself would be refused, with step and key.
pub fn load(
    plan: &Plan,
    machine: &MachineFile,
    programs: &BTreeMap<String, String>,
) -> Result<Load, SequencerError> {
    let sum = bounds::of_plan(plan)?;
    let mut touches = 0;
    for (at, step) in plan.steps.iter().enumerate() {
        let task = match step {
            Step::Rotary(step) => rotary::task(at, step, &plan.steps, machine)?,
            Step::TouchAlong(step) => touch_along::task(at, step, machine)?.0,
            Step::Blocks { .. } | Step::Latency { .. } | Step::Artefact { .. } => {
                task::of_step(at, step, machine, programs)?
            }
            _ => continue,
        };
        touches += u64::from(task.planned);
    }
    Ok(Load {
        runs: sum.runs,
        stops: sum.stops,
        touches,
        least_min: sum.rest_min,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = include_str!("../../../launch_configs/four_blocks/machine.yaml");

    fn of(steps: &str) -> Load {
        let machine = MachineFile::parse(MACHINE, "machine.yaml").unwrap();
        let plan = Plan::from_yaml(&format!("title: t\nsteps:\n{steps}")).unwrap();
        load(&plan, &machine, &BTreeMap::new()).unwrap()
    }

    /// Sums by hand: 2 feeds of 30 touches, 4 blocks of 3 faces; 2 senses, 5 repeats; 5 runs of 2 ways over 3 targets.
    #[test]
    fn counts_and_least_time_are_those_of_a_sum_by_hand() {
        let touched = of(
            "  - {do: latency, feature: block_1.z, feeds_mm_min: [300.0, 600.0], repeats: 30}\n  - {do: blocks}\n",
        );
        assert_eq!((touched.runs, touched.touches), (0, 60 + 12));
        let measured = of(
            "  - {do: wait, seconds: 90.0}\n  - {do: positioning, axis: X, targets_mm: [-50.0, 0.0, 50.0], runs: 5, dwell_s: 2.0, feed_mm_min: 1000.0, overrun_mm: 5.0, at_mm: [0.0, 0.0, 200.0]}\n",
        );
        assert_eq!(
            (measured.runs, measured.stops, measured.touches),
            (10, 30, 0)
        );
        // 1.5 min of waiting, 30 stops of 2 s, 5 times 2 ways of 100 mm at 1000 mm/min.
        assert!((measured.least_min - (1.5 + 1.0 + 1.0)).abs() < 1e-9);
    }
}
