//! The plant file, with the place of what is wrong with it.

use std::path::Path;

use anyhow::{Context, Result, anyhow};
use fake_cnc::{Plant, PlantError, PlantFile};
use machine::MachineFile;
use metrology::yaml;
use node_runtime::Setup;

/// The plant that the parameter `plant_file` names.
///
/// # Errors
/// As [`read`], and what a plant of this machine cannot be.
pub(crate) fn plant(setup: &Setup, machine: &MachineFile) -> Result<Plant> {
    let (path, text) = setup.file_text("plant_file")?;
    let truth = read(&path, &text).context("plant file")?;
    let plant = Plant::new(machine, &truth).map_err(|error| placed(&path, &text, &error));
    plant.context("plant file")
}

/// Reads it.
///
/// # Errors
/// File, line, column, key, value and what belongs there.
fn read(path: &Path, text: &str) -> Result<PlantFile> {
    PlantFile::from_yaml(text).map_err(|error| placed(path, text, &error))
}

/// What is wrong with a plant, with its place in the file.
fn placed(path: &Path, text: &str, error: &PlantError) -> anyhow::Error {
    let file = path.display().to_string();
    anyhow!("{}", yaml::placed(&file, text, &error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_is_no_number_is_named_with_its_key_and_place() {
        let text = include_str!("../../../../launch_configs/first_run/plant.yaml");
        let path = Path::new("plant.yaml");
        assert!(read(path, text).is_ok());
        let wrong = text.replacen("latency_ms: 3.7", "latency_ms: lots", 1);
        let error = read(path, &wrong).unwrap_err().to_string();
        assert!(error.starts_with("plant.yaml:"), "{error}");
        let words = "latency_ms = lots: must be a number, in ms";
        assert!(error.ends_with(words), "{error}");
    }
}
