//! `abbe new-machine FILE`: a machine file to begin with; axes and travels are enough.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::Args;
use reports::whole_file;

use crate::tell::tell;

/// The template; a line `# key: value` that is commented out states the value that the key has without it.
const TEMPLATE: &str = include_str!("new_machine/machine.yaml");

/// Arguments of `abbe new-machine`.
#[derive(Args)]
pub struct NewMachine {
    /// The file, such as `my_mill/machine.yaml`; it must not exist.
    file: PathBuf,
}

impl NewMachine {
    /// Writes the template.
    ///
    /// # Errors
    /// When the file exists, or cannot be written.
    pub fn execute(self) -> Result<ExitCode> {
        let shown = self.file.display();
        whole_file::create(&self.file, TEMPLATE, "name another file")?;
        tell!("{shown}: enter name, chain and travels, then: abbe validate {shown}");
        Ok(ExitCode::SUCCESS)
    }
}

#[cfg(test)]
mod tests {
    use machine::MachineFile;

    use super::*;

    /// The template with its stated defaults as values.
    fn with_stated_defaults() -> String {
        let stated = |line: &str| line.replacen("# default: ", "", 1);
        TEMPLATE.lines().map(|line| stated(line) + "\n").collect()
    }

    #[test]
    fn the_template_is_accepted_and_its_comments_state_the_defaults() {
        let as_written = MachineFile::parse(TEMPLATE, "machine.yaml").unwrap();
        assert_eq!(as_written.axes.len(), 3);
        let text = with_stated_defaults();
        let stated = MachineFile::parse(&text, "machine.yaml").unwrap();
        assert_eq!(stated, as_written);
        // Every number that has a default is stated, for every axis.
        let left_out = reports::machine_defaults::of(&stated, &text);
        assert_eq!(left_out, Vec::<String>::new());
        assert!(reports::machine_defaults::of(&as_written, TEMPLATE).len() > 20);
    }

    #[test]
    fn every_commented_part_is_accepted_as_well() {
        let stated = with_stated_defaults();
        let all: String = stated
            .lines()
            .map(|line| line.replacen("# optional: ", "", 1) + "\n")
            .collect();
        let file = MachineFile::parse(&all, "machine.yaml").unwrap();
        assert!(file.length_reference.is_some() && file.grid_encoder.is_some());
        assert!(
            file.spindle.is_some()
                && file
                    .linear(metrology::Axis::X)
                    .unwrap()
                    .scale_resolution_um
                    .is_some()
        );
        assert_eq!((file.blocks.len(), file.temperature_sensors.len()), (2, 2));
    }

    #[test]
    fn a_file_that_is_there_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("machine.yaml");
        let make = || NewMachine { file: file.clone() }.execute();
        assert!(make().is_ok());
        std::fs::write(&file, "mine").unwrap();
        let error = format!("{:#}", make().unwrap_err());
        assert!(
            error.contains("not overwritten: name another file"),
            "{error}"
        );
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
    }
}
