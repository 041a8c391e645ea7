//! A scenario's folder: its launch file, and how the suite runs and reports it.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde::Deserialize;

use crate::evaluate::budget::Budget;
use crate::launch::{self, LaunchNode};

/// `scenario.yaml` beside the launch file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScenarioFile {
    /// One line for displays and reports.
    pub title: String,
    /// Which page is written at the end.
    pub report: ReportKind,
    /// Whether the run ends with the diagnosis of its own bag.
    #[serde(default)]
    pub diagnose: bool,
    /// First instant of simulated time, seconds since the epoch; `None`: the scenario runs on real time.
    #[serde(default)]
    pub simulated_start_s: Option<i64>,
    /// Longest simulated (or real) time that the plan may take.
    pub limit_min: f64,
}

/// Which page a run ends with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReportKind {
    /// Latency, drift at the blocks, tool error against the truth.
    Thermal,
    /// Latency and corrected points per feed.
    Latency,
    /// Block cycles.
    Blocks,
    /// Location errors of the rotary axes, tool error before and after their compensation.
    Rotary,
    /// The diagnosis of simulator against machine alone (with `diagnose`).
    Gap,
    /// Every test that the bag holds, and the tool error where it was verified.
    Tests,
}

/// A scenario, read.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// Its folder.
    pub folder: PathBuf,
    /// Name: that of the folder.
    pub name: String,
    /// `scenario.yaml`.
    pub file: ScenarioFile,
    /// Nodes of the launch file.
    pub nodes: Vec<LaunchNode>,
}

impl Scenario {
    /// `budget.yaml` in its folder, where there is one.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn budget(&self) -> Result<Option<Budget>> {
        let path = self.folder.join("budget.yaml");
        if !path.is_file() {
            return Ok(None);
        }
        let text = std::fs::read_to_string(&path)
            .with_context(|| format!("budget file {}", path.display()))?;
        Budget::read(&text, &path).map(Some)
    }

    /// Reads the scenario in `folder`.
    ///
    /// # Errors
    /// With file, key and value when something is missing or unknown.
    pub fn read(folder: &Path) -> Result<Self> {
        let name = folder
            .file_name()
            .with_context(|| format!("scenario {}: no folder name", folder.display()))?
            .to_string_lossy()
            .into_owned();
        let path = folder.join("scenario.yaml");
        let text = std::fs::read_to_string(&path)
            .with_context(|| format!("scenario file {}", path.display()))?;
        let file: ScenarioFile = serde_saphyr::from_str(&text)
            .with_context(|| format!("scenario file {}", path.display()))?;
        let nodes = launch::read(&launch::find(folder)?)?;
        Ok(Self {
            folder: folder.to_owned(),
            name,
            file,
            nodes,
        })
    }
}
