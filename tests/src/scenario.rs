//! Scenarios of a test's own: a copy of one of launch_configs with texts replaced.

use std::path::{Path, PathBuf};
use std::time::Duration;

use node_runtime::text_file;
use tempfile::TempDir;

use crate::program::{Ended, Process, command, root};

/// Files that scenarios share by the key `base`.
const SHARED: [&str; 2] = ["machine.yaml", "plant.yaml"];

/// A copy of a scenario in a temporary folder.
pub struct Scenario {
    /// Removed with the test.
    home: TempDir,
}

impl Scenario {
    /// Copies the files of `launch_configs/<name>`.
    ///
    /// # Panics
    /// When it cannot be copied.
    #[must_use]
    pub fn copy_of(name: &str) -> Self {
        let home = tempfile::tempdir().unwrap();
        let scenario = Self { home };
        std::fs::create_dir(scenario.folder()).unwrap();
        for entry in std::fs::read_dir(root().join("launch_configs").join(name)).unwrap() {
            let from = entry.unwrap().path();
            if from.is_file() {
                let name = from.file_name().unwrap().to_string_lossy().into_owned();
                // A copy stands elsewhere: what its base has is its own.
                let held = SHARED
                    .contains(&name.as_str())
                    .then(|| text_file::yaml_file(&from));
                let held = held.map_or(from, |file| file.unwrap().path);
                std::fs::copy(held, scenario.path(&name)).unwrap();
            }
        }
        scenario
    }

    /// Its folder.
    #[must_use]
    pub fn folder(&self) -> PathBuf {
        self.home.path().join("scenario")
    }

    /// A folder beside it, for what runs leave.
    #[must_use]
    pub fn out(&self) -> PathBuf {
        self.home.path().join("runs")
    }

    /// A file of it.
    #[must_use]
    pub fn path(&self, file: &str) -> PathBuf {
        self.folder().join(file)
    }

    /// The path of a file as an argument.
    #[must_use]
    pub fn argument(&self, file: &str) -> String {
        self.path(file).display().to_string()
    }

    /// Writes a file.
    ///
    /// # Panics
    /// When it cannot be written.
    pub fn write(&self, file: &str, text: &str) {
        std::fs::write(self.path(file), text).unwrap();
    }

    /// Replaces `from`, which must be there, everywhere in a file.
    ///
    /// # Panics
    /// When it is not there.
    pub fn replace(&self, file: &str, from: &str, to: &str) {
        let text = std::fs::read_to_string(self.path(file)).unwrap();
        assert!(text.contains(from), "{file} does not hold \"{from}\"");
        self.write(file, &text.replace(from, to));
    }

    /// Adds text at the end of a file.
    ///
    /// # Panics
    /// When it cannot be read.
    pub fn append(&self, file: &str, more: &str) {
        let text = std::fs::read_to_string(self.path(file)).unwrap();
        self.write(file, &format!("{text}{more}"));
    }

    /// Runs it, off the network where its time is simulated; the run's folder.
    ///
    /// # Panics
    /// When it does not end with exit code 0 within two minutes.
    #[must_use]
    pub fn run(&self) -> PathBuf {
        let known = self.runs();
        let ended = self.run_to_end(&[]);
        assert_eq!(ended.status.code(), Some(0), "{}", ended.said);
        self.new_run(&known)
    }

    /// Runs it with more arguments, off the network where its time is simulated.
    ///
    /// # Panics
    /// When it does not end within two minutes.
    #[must_use]
    pub fn run_to_end(&self, more: &[&str]) -> Ended {
        self.start(more).ended_within(Duration::from_secs(600))
    }

    /// Starts it with more arguments, off the network where its time is simulated.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn start(&self, more: &[&str]) -> Process {
        let (folder, out) = (self.folder(), self.out());
        let text = std::fs::read_to_string(self.path("scenario.yaml")).unwrap_or_default();
        let mut command = command(0, &["run"]);
        if text.contains("simulated_start_s:") && !more.contains(&"--separate") {
            command.arg("--no-dds");
        }
        command.arg(folder).arg("--runs").arg(out).args(more);
        Process::start(command)
    }

    /// Runs it and reads its `report.json`.
    ///
    /// # Panics
    /// As [`Self::run`], and when there is no report.
    #[must_use]
    pub fn run_for_report(&self) -> serde_json::Value {
        let text = std::fs::read_to_string(self.run().join("report.json")).unwrap();
        serde_json::from_str(&text).unwrap()
    }

    fn runs(&self) -> Vec<PathBuf> {
        let Ok(entries) = std::fs::read_dir(self.out()) else {
            return Vec::new();
        };
        entries.map(|entry| entry.unwrap().path()).collect()
    }

    /// The folder of the one run in [`Self::out`] that is not in `known`.
    ///
    /// # Panics
    /// When there is none or more.
    #[must_use]
    pub fn new_run(&self, known: &[PathBuf]) -> PathBuf {
        let mut found: Vec<PathBuf> = std::fs::read_dir(self.out())
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| !known.contains(path))
            .collect();
        assert_eq!(found.len(), 1, "{found:?}");
        found.remove(0)
    }
}

/// The one MCAP file of a bag.
#[must_use]
pub fn mcap_file(bag: &Path) -> PathBuf {
    let file = bag.join("bag_0.mcap");
    if file.exists() {
        return file;
    }
    // As rosbag2 names it: after the folder.
    bag.join(format!("{}_0.mcap", bag.file_name().unwrap().display()))
}

/// Latency, cold reference, three minutes of production with compensation, blocks again.
pub const SHORT_PLAN: &str = "\
title: short
steps:
  - {do: latency, feature: block_1.z, feeds_mm_min: [60.0, 240.0, 960.0], repeats: 2}
  - {do: blocks, cold: true}
  - {do: compensation, enable: true}
  - {do: produce, program: production.ngc, minutes: 3.0, serve_updates: true}
  - {do: blocks}
";
