//! What stands in a scenario's folder and has no effect on its run.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::Result;
use node_runtime::Setup;
use node_runtime::setup::is_for;
use node_runtime::text_file::{self, Comments};

use super::Scenario;
use crate::node::NODES;

impl Scenario {
    /// Sections of parameter files for nodes that are not launched, and parameter files of such nodes, a line each.
    ///
    /// # Errors
    /// When a node's arguments or parameter file cannot be read.
    pub fn without_effect(&self) -> Result<Vec<String>> {
        let mut setups = vec![];
        for node in &self.nodes {
            setups.push(node.setup()?);
        }
        let names: Vec<String> = setups
            .iter()
            .map(|setup| setup.names().fully_qualified())
            .collect();
        let mut lines = BTreeSet::new();
        for (path, section) in setups.iter().flat_map(Setup::sections_of_others) {
            if !names.iter().any(|name| is_for(section, name)) {
                lines.insert(format!(
                    "parameter file {}: the section {section} has no effect: the scenario has no node of this name (it has {})",
                    path.display(),
                    names.join(", ")
                ));
            }
        }
        for setup in &setups {
            lines.extend(setup.unused_files());
        }
        for (exec, _) in NODES {
            let path = self.folder.join(format!("{exec}.yaml"));
            let is_launched = self.nodes.iter().any(|node| node.exec == *exec);
            if path.is_file() && !is_launched && !self.is_named(&format!("{exec}.yaml")) {
                lines.insert(format!(
                    "parameter file {} has no effect: the scenario launches no {exec}",
                    path.display()
                ));
            }
        }
        Ok(lines.into_iter().collect())
    }

    /// Whether a launch file below the folder, as one for each host, names a parameter file.
    fn is_named(&self, file: &str) -> bool {
        let below = |folder: &Path| -> Vec<PathBuf> {
            let entries = std::fs::read_dir(folder).into_iter().flatten();
            entries
                .filter_map(|entry| Some(entry.ok()?.path()))
                .collect()
        };
        let folders = below(&self.folder).into_iter().filter(|path| path.is_dir());
        let mut launched = folders.flat_map(|folder| below(&folder));
        launched.any(|path| {
            let is_launch = path.to_string_lossy().ends_with(".launch.xml");
            is_launch && text_file::read(&path, Comments::Xml).is_ok_and(|text| text.contains(file))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_of_nodes_that_do_not_run_are_named_and_the_shipped_scenarios_have_none() {
        let home = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../launch_configs");
        let mut folders: Vec<_> = std::fs::read_dir(&home)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.join(super::super::SCENARIO_FILE).is_file())
            .collect();
        folders.sort();
        for folder in folders {
            let lines = Scenario::read(&folder).unwrap().without_effect().unwrap();
            assert_eq!(lines, [""; 0], "{}", folder.display());
        }
        let folder = tempfile::tempdir().unwrap();
        for entry in std::fs::read_dir(home.join("cold_reference")).unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                std::fs::copy(&path, folder.path().join(path.file_name().unwrap())).unwrap();
            }
        }
        std::fs::write(folder.path().join("grid_encoder.yaml"), "").unwrap();
        let probe = folder.path().join("probe.yaml");
        let more = "\n/mill/probe:\n  ros__parameters: {hold_ms: 3.0}\n";
        let text = std::fs::read_to_string(&probe).unwrap() + more;
        std::fs::write(&probe, text).unwrap();
        let lines = Scenario::read(folder.path())
            .unwrap()
            .without_effect()
            .unwrap();
        assert_eq!(lines.len(), 2, "{lines:?}");
        assert!(
            lines[0]
                .contains("grid_encoder.yaml has no effect: the scenario launches no grid_encoder"),
            "{lines:?}"
        );
        assert!(
            lines[1].contains("probe.yaml: the section /mill/probe has no effect"),
            "{lines:?}"
        );
    }
}
