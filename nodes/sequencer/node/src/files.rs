//! A plan and the programs that it names.
use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result, anyhow};
use metrology::yaml;
use node_runtime::text_file::{self, Comments};
use sequencer::{Plan, SequencerError, Step};

/// Reads a plan from the text of the file `path`.
///
/// # Errors
/// With file, line, key, value and limit.
pub fn plan(text: &str, path: &Path) -> Result<Plan> {
    Plan::from_yaml(text).map_err(|error| anyhow!("plan {}:{error}", path.display()))
}

/// An error of the plan with the line of the step that it names.
pub(crate) fn placed(error: &SequencerError, text: &str, path: &Path) -> anyhow::Error {
    let file = path.display().to_string();
    anyhow!("plan {}", yaml::placed(&file, text, &error.to_string()))
}

/// Reads every program of `plan`, by the name that the plan has for it; paths are relative to the plan's file.
///
/// # Errors
/// With the plan's file, the step and why a program cannot be read.
pub fn programs(plan: &Plan, plan_path: &Path) -> Result<BTreeMap<String, String>> {
    let folder = plan_path.parent().unwrap_or_else(|| Path::new(""));
    let mut programs = BTreeMap::new();
    for (at, step) in plan.steps.iter().enumerate() {
        let (Step::Produce { program, .. } | Step::Verify { program, .. } | Step::Run { program }) =
            step
        else {
            continue;
        };
        let path = folder.join(program);
        let text = text_file::read(&path, Comments::Gcode)
            .with_context(|| format!("{}: steps[{at}].program", plan_path.display()))?;
        programs.insert(program.clone(), text);
    }
    Ok(programs)
}
