//! A scenario's folder: its launch file, and how the suite runs and reports it.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use metrology::number::number;
use metrology::{Axis, Host, epoch, yaml};
use node_runtime::tap::Selection;
use node_runtime::text_file;
use recorder::{ChunkCompression, RecorderConfig};
use reports::ReportKind;
use reports::evaluate::budget::Budget;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::launch::{self, LaunchNode};
use crate::usage::topics;

mod machines;
pub mod places;
mod without_effect;

/// `scenario.yaml` beside the launch file.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
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
    /// A table made of the run's own stops, which LinuxCNC then loads in two more runs.
    #[serde(default)]
    pub linuxcnc_table: Option<LinuxcncTable>,
    /// How the run's bag is written.
    #[serde(default)]
    pub recording: RecordingFile,
}

/// Longest time that can be given to a plan, min: two years.
const LONGEST_MIN: f64 = 1e6;
/// Simulated time that a run takes beyond its limit to wind down and to be evaluated, and a clock's offset, s.
const AFTER_PLAN_S: i64 = 86_400;

impl ScenarioFile {
    /// Reads and checks the file `path`.
    ///
    /// # Errors
    /// With file, line, key and value.
    pub fn read(path: &Path) -> Result<Self> {
        let text = text_file::yaml(path).context("scenario file")?;
        let shown = path.display().to_string();
        let wrong =
            |message: &str| anyhow!("scenario file {}", yaml::placed(&shown, &text, message));
        let file: Self = yaml::read_letters(&text).map_err(|error| wrong(&error.to_string()))?;
        file.check().map_err(|error| wrong(&error.to_string()))?;
        Ok(file)
    }

    /// Refuses a value that is out of its range.
    fn check(&self) -> Result<()> {
        let limit_min = self.limit_min;
        if !(limit_min > 0.0 && limit_min <= LONGEST_MIN) {
            bail!(
                "limit_min = {} min: must be above 0 and at most {LONGEST_MIN} min",
                number(limit_min)
            );
        }
        for (k, pattern) in self.recording.exclude.iter().enumerate() {
            if let Err(rule) = topics(pattern) {
                bail!("recording.exclude[{k}] = \"{pattern}\": {rule}");
            }
        }
        let exclude = &self.recording.exclude;
        if Selection::leaves_nothing(&["*".to_owned()], exclude) {
            bail!(
                "recording.exclude = {exclude:?}: leaves out every topic, so that nothing would be recorded: exclude less"
            );
        }
        if let Err(rule) = self.recording.config().checked() {
            bail!("recording.{rule}");
        }
        if let Some(start_s) = self.simulated_start_s {
            let room_s = (limit_min * 60.0).ceil() as i64 + AFTER_PLAN_S;
            epoch::whole_seconds::<Host>(start_s, room_s)
                .map_err(|error| anyhow!("simulated_start_s = {error}"))?;
        }
        Ok(())
    }
}

/// How a run's bag is written; keys that are absent have the general defaults.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecordingFile {
    /// Inside the chunks.
    pub compression: ChunkCompression,
    /// A new file is begun at this size; 0: one file.
    pub max_file_bytes: u64,
    /// A new file is begun when this one spans so much log time, s; 0: one file.
    pub max_file_s: f64,
    /// Absolute names of topics that are left out; `*` stands for any run of characters. A bag without its inputs cannot be computed again.
    pub exclude: Vec<String>,
}

impl RecordingFile {
    /// As the recorder takes it, with its defaults for the rest.
    #[must_use]
    pub fn config(&self) -> RecorderConfig {
        RecorderConfig {
            compression: self.compression,
            max_file_bytes: self.max_file_bytes,
            max_file_s: self.max_file_s,
            ..RecorderConfig::default()
        }
    }
}

/// A screw-compensation file that is tried on the control that it is made for.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LinuxcncTable {
    /// The axis.
    pub axis: Axis,
    /// The file that its INI file names, of type 0, below the scenario's folder.
    pub loads: PathBuf,
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

/// Refuses nodes of one cell that are about different machines; see [`machines::check`].
///
/// # Errors
/// The two nodes, their files, and the first key that differs with both values.
pub fn check_machines(folder: &Path, nodes: &[LaunchNode]) -> Result<()> {
    machines::check(folder, nodes)
}

impl Scenario {
    /// `budget.yaml` in its folder, where there is one.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn budget(&self) -> Result<Option<Budget>> {
        let path = self.folder.join("budget.yaml");
        if !path.exists() {
            return Ok(None);
        }
        let text = text_file::yaml(&path).context("budget file")?;
        Budget::read(&text, &path).map(Some)
    }

    /// Reads the scenario in `folder`.
    ///
    /// # Errors
    /// With file, key and value when something is missing or unknown.
    pub fn read(folder: &Path) -> Result<Self> {
        let name = name_of(folder)?;
        let path = folder.join(SCENARIO_FILE);
        if !path.exists() {
            bail!("{}", no_scenario(folder));
        }
        let file = ScenarioFile::read(&path)?;
        let nodes = launch::read(&launch::find(folder)?)?;
        Ok(Self {
            folder: folder.to_owned(),
            name,
            file,
            nodes,
        })
    }
}

/// Name of a folder, however it is told: `.` and `..` too.
fn name_of(folder: &Path) -> Result<String> {
    let context = || format!("scenario {}", folder.display());
    let name = match folder.file_name() {
        Some(name) => name.to_owned(),
        None => folder
            .canonicalize()
            .with_context(context)?
            .file_name()
            .context("has no name")
            .with_context(context)?
            .to_owned(),
    };
    Ok(name.to_string_lossy().into_owned())
}

/// The file that makes a folder a scenario.
pub const SCENARIO_FILE: &str = "scenario.yaml";
/// Where a clone of the tree has its scenarios.
const USUAL_HOME: &str = "launch_configs";

/// What was looked for in vain, and what is near it.
fn no_scenario(folder: &Path) -> String {
    let shown = folder.display();
    let what = if folder.is_dir() {
        format!("scenario {shown}: the folder has no {SCENARIO_FILE}")
    } else if folder.exists() {
        format!("scenario {shown}: it is a file; must be the folder that has {SCENARIO_FILE}")
    } else {
        format!(
            "scenario {shown}: there is no such folder (a folder with {SCENARIO_FILE} is looked for)"
        )
    };
    let parent = folder
        .parent()
        .filter(|parent| !parent.as_os_str().is_empty());
    let beside = parent.unwrap_or(Path::new(".")).to_owned();
    if folder.is_file() && beside.join(SCENARIO_FILE).is_file() {
        return format!("{what}: give {}", beside.display());
    }
    let homes = [
        folder.to_owned(),
        beside.clone(),
        beside.join(USUAL_HOME),
        PathBuf::from(USUAL_HOME),
    ];
    let near = homes.iter().find_map(|home| {
        let found = scenarios_in(home);
        (!found.is_empty()).then(|| format!("in {} are: {}", home.display(), found.join(", ")))
    });
    match near {
        Some(near) => format!("{what}; {near}"),
        None => format!("{what}; none is near it"),
    }
}

/// Names of the folders in `home` that are scenarios, in order.
fn scenarios_in(home: &Path) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(home) else {
        return Vec::new();
    };
    let mut found: Vec<String> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.join(SCENARIO_FILE).is_file())
        .filter_map(|path| Some(path.file_name()?.to_string_lossy().into_owned()))
        .collect();
    found.sort();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_has_its_name_however_it_is_told() {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path().join("cell_3");
        std::fs::create_dir_all(folder.join("programs")).unwrap();
        let from_below = folder.join("programs").join("..");
        for told in [folder, from_below] {
            assert_eq!(name_of(&told).unwrap(), "cell_3", "{}", told.display());
        }
        let root = name_of(Path::new("/")).unwrap_err();
        assert!(format!("{root:#}").contains("scenario /"), "{root:#}");
        let absent = name_of(&home.path().join("absent").join("..")).unwrap_err();
        assert!(format!("{absent:#}").contains("absent"), "{absent:#}");
    }

    /// As the recorder's own: what `validate` accepts a run takes.
    #[test]
    fn recording_keys_are_checked_where_the_file_is_read() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join(SCENARIO_FILE);
        for (key, is_right) in [
            ("max_file_s: 0", true),
            ("max_file_s: 3600", true),
            ("max_file_s: .nan", false),
            ("max_file_s: .inf", false),
            ("max_file_s: -1", false),
            ("max_file_s: 1.0e-320", false),
            ("max_file_s: 1.0e+308", false),
        ] {
            std::fs::write(
                &path,
                format!("title: t\nreport: tests\nlimit_min: 1.0\nrecording: {{{key}}}\n"),
            )
            .unwrap();
            let read = ScenarioFile::read(&path);
            assert_eq!(read.is_ok(), is_right, "{key}: {read:?}");
            let words = read.err().map(|error| format!("{error:#}"));
            assert!(
                words.is_none_or(|words| words.contains("recording.max_file_s")),
                "{key}"
            );
        }
    }

    #[test]
    fn a_wrong_path_says_what_was_looked_for_and_what_is_near() {
        let home = tempfile::tempdir().unwrap();
        for name in ["a", "b"] {
            let folder = home.path().join("launch_configs").join(name);
            std::fs::create_dir_all(&folder).unwrap();
            std::fs::write(folder.join(SCENARIO_FILE), "").unwrap();
        }
        let configs = home.path().join("launch_configs");
        let near = format!("in {} are: a, b", configs.display());
        for (wrong, word) in [
            (configs.join("c"), "no such folder"),
            (configs.clone(), "has no scenario.yaml"),
            (configs.join("a").join(SCENARIO_FILE), "it is a file"),
            (home.path().join("c"), "no such folder"),
        ] {
            let error = Scenario::read(&wrong).unwrap_err().to_string();
            assert!(error.contains(&wrong.display().to_string()), "{error}");
            assert!(error.contains(word), "{error}");
            let end = if wrong.ends_with(SCENARIO_FILE) {
                format!("give {}", configs.join("a").display())
            } else {
                near.clone()
            };
            assert!(error.ends_with(&end), "{error}");
        }
    }

    #[test]
    fn a_recording_of_nothing_is_refused_and_one_of_a_part_is_not() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join(SCENARIO_FILE);
        let read = |exclude: &str| {
            let recording = format!("recording: {{exclude: {exclude}}}\n");
            let text = format!("title: a\nreport: blocks\nlimit_min: 1.0\n{recording}");
            std::fs::write(&path, text).unwrap();
            ScenarioFile::read(&path)
        };
        for nothing in [r#"["*"]"#, r#"["/*"]"#, r#"["/tf", "*"]"#, r#"["**"]"#] {
            let error = format!("{:#}", read(nothing).unwrap_err());
            for word in [
                "scenario.yaml:4",
                "recording.exclude",
                "nothing would be recorded",
            ] {
                assert!(error.contains(word), "{nothing}: {error}");
            }
        }
        for part in ["[]", "[/tf]", r#"["/a*", "*state"]"#, r#"["/*/*"]"#] {
            assert!(read(part).is_ok(), "{part}");
        }
    }

    #[test]
    fn a_limit_that_no_run_can_keep_is_refused_with_file_key_value_and_limit() {
        let home = tempfile::tempdir().unwrap();
        for value in ["-1", "0", ".nan", ".inf"] {
            let text = format!("title: a\nreport: blocks\nlimit_min: {value}\n");
            std::fs::write(home.path().join(SCENARIO_FILE), text).unwrap();
            let error = format!("{:#}", Scenario::read(home.path()).unwrap_err());
            for word in [
                SCENARIO_FILE,
                "limit_min = ",
                "above 0 and at most 1000000 min",
            ] {
                assert!(error.contains(word), "{value}: {error}");
            }
        }
    }
}
