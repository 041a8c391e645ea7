//! What is right for a recording: the file `expected.yaml` of its folder.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;

/// A recording's right answers.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expected {
    /// The recording in a few words.
    pub title: String,
    /// Where it comes from.
    pub source: String,
    /// The right answer in words.
    pub right: String,
    /// The table, or the log, from the folder.
    pub input: PathBuf,
    /// The map, from the folder.
    pub map: Option<PathBuf>,
    /// The machine file, from the folder.
    pub machine: Option<PathBuf>,
    /// `abbe import`; where it is absent an import must succeed.
    pub import: Option<Told>,
    /// `abbe report`.
    pub report: Option<Report>,
    /// `abbe diagnose` of the imported bag.
    pub diagnose: Option<Diagnose>,
    /// `abbe export` of the imported bag.
    pub export: Option<Export>,
    /// `abbe` with other arguments; `INPUT` and `OUT` in them are the input and a new folder.
    pub other: Option<Other>,
    /// Names of checks that fail today, each with the reason. A `*` at the end of a name stands for any rest of it.
    #[serde(default)]
    pub known_wrong: BTreeMap<String, String>,
    /// Figures by numpy, one entry for each evaluated test, in µm or arcsec; `null`: the figure does not exist.
    #[serde(default)]
    pub numpy: Vec<BTreeMap<String, Option<f64>>>,
}

/// How a command ends, and words that it prints.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Told {
    /// Exit code.
    #[serde(default)]
    pub exit: i32,
    /// Words that its output contains.
    #[serde(default)]
    pub says: Vec<String>,
}

/// What `abbe report` is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Of {
    /// The table alone.
    Table,
    /// The table with its map.
    Map,
    /// The imported bag.
    Bag,
}

impl Of {
    /// Its word in names of checks.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Table => "table",
            Self::Map => "map",
            Self::Bag => "bag",
        }
    }
}

/// What `abbe report` must print.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Report {
    /// What it is given, each with the same figures.
    pub of: Vec<Of>,
    /// Exit code.
    #[serde(default)]
    pub exit: i32,
    /// Words that its output contains.
    #[serde(default)]
    pub says: Vec<String>,
    /// Key of the evaluated test in `report.json`.
    pub test: String,
    /// Figures of the first such test.
    #[serde(default)]
    pub figures: BTreeMap<String, Figure>,
}

/// A right figure.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figure {
    /// Its value.
    pub value: f64,
    /// Its unit.
    pub unit: String,
    /// Largest difference.
    pub within: f64,
}

/// What `abbe diagnose` must find.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Diagnose {
    /// Exit code.
    #[serde(default)]
    pub exit: i32,
    /// Words that its output contains.
    #[serde(default)]
    pub says: Vec<String>,
    /// Causes that must be named, or stand in a set with what cannot be told from them.
    #[serde(default)]
    pub must: Vec<Must>,
    /// Thermometers that the log goes with.
    #[serde(default)]
    pub follows: Vec<Follow>,
    /// Causes that may be named, as `backlash X`; `backlash *` is that of any axis.
    #[serde(default)]
    pub may: Vec<String>,
    /// Causes that were named wrongly at a time; what is listed nowhere must not be named either.
    #[serde(default)]
    pub must_not: Vec<String>,
}

/// A cause that must be named.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Must {
    /// The cause, or several of which one is enough.
    pub one_of: Vec<String>,
    /// Parameters with their right values.
    #[serde(default)]
    pub sizes: BTreeMap<String, Figure>,
}

/// A thermometer that a log goes with.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Follow {
    /// Its name.
    pub thermometer: String,
    /// How long the log lags behind it, min.
    pub lag: Figure,
    /// Change of the log, µm/K.
    pub size: Figure,
}

/// What `abbe export` must write.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Export {
    /// Arguments behind the bag and before `--out`.
    pub arguments: Vec<String>,
    /// Exit code.
    #[serde(default)]
    pub exit: i32,
    /// File below the folder.
    pub file: PathBuf,
    /// Lines of numbers that it contains.
    pub rows: Vec<Vec<f64>>,
    /// Largest difference of a number.
    pub within: f64,
}

/// Another command.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Other {
    /// Its arguments.
    pub arguments: Vec<String>,
    /// Exit code.
    #[serde(default)]
    pub exit: i32,
    /// Words that its output contains.
    #[serde(default)]
    pub says: Vec<String>,
}

/// A folder with its right answers.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Name of the folder.
    pub name: String,
    /// Its path.
    pub folder: PathBuf,
    /// The right answers.
    pub expected: Expected,
}

/// Every recording below a folder, by name.
///
/// # Panics
/// When a folder has no readable `expected.yaml`.
pub fn recordings(folder: &Path) -> Vec<Recording> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut folders: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    folders.sort();
    folders.into_iter().map(recording).collect()
}

fn recording(folder: PathBuf) -> Recording {
    let file = folder.join("expected.yaml");
    let text = std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let expected =
        serde_saphyr::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    Recording {
        name: folder.file_name().unwrap().to_string_lossy().into_owned(),
        folder,
        expected,
    }
}
