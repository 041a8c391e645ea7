//! Plans whose touches can give no point: the probe's latency is neither measured before them nor stated.

use anyhow::Result;
use machine::MachineFile;
use sequencer::plan::{Plan, Step};
use sequencer_node::read_plan;
use serde::Deserialize;

use super::Findings;
use crate::launch::LaunchNode;

/// What is read of the probe's parameters.
#[derive(Deserialize)]
struct Stated {
    latency_ms: Option<f64>,
}

/// Notes of every sequencer whose probe has no latency at its first touch.
pub fn check(launched: &[LaunchNode], findings: &mut Findings) {
    for sequencer in launched.iter().filter(|node| node.exec == "sequencer") {
        // What cannot be read here was reported by building the node.
        let Ok(Some(step)) = first_unmeasured(sequencer) else {
            continue;
        };
        let is_its =
            |node: &&LaunchNode| node.exec == "probe" && node.namespace == sequencer.namespace;
        for probe in launched.iter().filter(is_its) {
            if matches!(is_stated(probe), Ok(false)) {
                findings.note(format!(
                    "steps[{step}] touches before any latency step, and no latency_ms is stated: touches give no point until the latency is known; put a latency step before"
                ));
            }
        }
    }
}

/// The first touching step of a plan, from 0, where no latency step is before it.
fn first_unmeasured(sequencer: &LaunchNode) -> Result<Option<usize>> {
    let setup = sequencer.setup()?;
    let config: sequencer::Config = setup.config()?;
    if config.plan_file.is_empty() {
        return Ok(None);
    }
    let (path, text) = setup.file_text("plan_file")?;
    Ok(first_touch(&read_plan(&text, &path)?))
}

fn first_touch(plan: &Plan) -> Option<usize> {
    let is_measured = |step: &Step| matches!(step, Step::Latency { .. });
    let touches = |step: &Step| {
        matches!(
            step,
            Step::Blocks { .. } | Step::Artefact { .. } | Step::Rotary(_) | Step::TouchAlong(_)
        )
    };
    let first = { plan.steps.iter() }.position(|step| is_measured(step) || touches(step))?;
    plan.steps.get(first).is_some_and(touches).then_some(first)
}

/// Whether the parameters of a probe, or its machine file, state a latency.
fn is_stated(probe: &LaunchNode) -> Result<bool> {
    let setup = probe.setup()?;
    let stated: Stated = setup.config()?;
    let (path, text) = setup.file_text("machine_file")?;
    let machine = MachineFile::parse(&text, &path.display().to_string())?;
    Ok(stated.latency_ms.or(machine.probe.latency_ms).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_touch_without_a_latency_step_before_it_is_found() {
        let latency = "  - {do: latency, feature: block_1.z, feeds_mm_min: [100.0], repeats: 5}\n";
        let touch = "  - {do: artefact, id: high, points: 25}\n";
        let wait = "  - {do: wait, seconds: 1.0}\n";
        for (steps, wanted) in [
            ([wait, touch, latency].concat(), Some(1)),
            ([wait, latency, touch].concat(), None),
            ([wait, wait].concat(), None),
        ] {
            let plan = Plan::from_yaml(&format!("title: t\nsteps:\n{steps}")).unwrap();
            assert_eq!(first_touch(&plan), wanted, "{steps}");
        }
    }
}
