//! From text to a checked machine file.

use super::MachineFile;
use crate::error::MachineFileError;

impl MachineFile {
    /// Reads and checks the text of a machine file; `source_name` stands in its errors.
    ///
    /// # Errors
    /// With line and column where the text is no machine file, with the key where a value breaks
    /// a rule.
    pub fn parse(text: &str, source_name: &str) -> Result<Self, MachineFileError> {
        let file: Self = serde_saphyr::from_str(text).map_err(|error| {
            let place = error.location();
            MachineFileError::Syntax {
                source_name: source_name.to_owned(),
                line: place.map_or(0, |l| l.line()),
                column: place.map_or(0, |l| l.column()),
                reason: without_place(&error.without_snippet().to_string()),
            }
        })?;
        file.check(source_name)?;
        Ok(file)
    }
}

/// The reader's sentence without the place that it appends, which stands in front already.
fn without_place(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    line.split_once(" at line ")
        .map_or(line, |(reason, _)| reason)
        .to_owned()
}
