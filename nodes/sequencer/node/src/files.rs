//! Programs that a plan names.
#![expect(
    clippy::disallowed_methods,
    reason = "the shell reads the files that parameters name"
)]

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result};
use sequencer::{Plan, Step};

/// Reads every program of `plan`; paths are relative to the plan's file.
pub(crate) fn programs(plan: &Plan, plan_path: &Path) -> Result<BTreeMap<String, String>> {
    let folder = plan_path.parent().unwrap_or_else(|| Path::new(""));
    let mut programs = BTreeMap::new();
    for (at, step) in plan.steps.iter().enumerate() {
        let (Step::Produce { program, .. } | Step::Verify { program, .. } | Step::Run { program }) =
            step
        else {
            continue;
        };
        let path = folder.join(program);
        let text = std::fs::read_to_string(&path).with_context(|| {
            format!(
                "{}: steps[{at}].program: {}",
                plan_path.display(),
                path.display()
            )
        })?;
        programs.insert(program.clone(), text);
    }
    Ok(programs)
}
