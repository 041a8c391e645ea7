//! From text to a checked machine file.

use metrology::yaml::{self, Places};

use super::MachineFile;
use crate::error::MachineFileError;

impl MachineFile {
    /// Reads and checks the text of a machine file; `source_name` stands in its errors.
    ///
    /// # Errors
    /// With file, line, column and key.
    pub fn parse(text: &str, source_name: &str) -> Result<Self, MachineFileError> {
        let file: Self = yaml::read(text).map_err(|source| MachineFileError::Syntax {
            source_name: source_name.to_owned(),
            source,
        })?;
        file.check(source_name).map_err(|error| {
            let place = Places::of(text).find(&error.key());
            match place {
                Some(at) => error.placed(&format!("{source_name}:{}:{}", at.line, at.column)),
                None => error,
            }
        })?;
        Ok(file)
    }
}
