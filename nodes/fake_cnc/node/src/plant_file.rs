//! The plant file, as a person is told of what is wrong with it.

use anyhow::{Result, anyhow};
use fake_cnc::{PlantError, PlantFile};
use node_runtime::complaint;

/// Reads it; what cannot be read is told with the line that has it.
///
/// # Errors
/// Key, value and place.
pub(crate) fn read(text: &str) -> Result<PlantFile> {
    PlantFile::from_yaml(text).map_err(|error| match &error {
        PlantError::Syntax { source } => anyhow!("{}", complaint::of_yaml(source, text)),
        _ => error.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_is_no_number_is_told_with_its_key() {
        let text = include_str!("../../../../launch_configs/first_run/plant.yaml");
        assert!(read(text).is_ok());
        let wrong = text.replacen("latency_ms: 3.7", "latency_ms: lots", 1);
        let error = read(&wrong).unwrap_err().to_string();
        assert!(error.contains("in `latency_ms: lots"), "{error}");
    }
}
