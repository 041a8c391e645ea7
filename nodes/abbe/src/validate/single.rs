//! One file, read by what reads it at run time.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow};
use fake_cnc::PlantFile;
use machine::MachineFile;
use metrology::yaml;
use mtconnect_bridge::mapping::{MapFile, Mapping};
use node_runtime::arguments::Arguments;
use node_runtime::text_file::{self, Comments};
use node_runtime::{Setup, complaint};
use reports::evaluate::budget::Budget;
use reports::evaluate::limits::Limits;
use reports::machine_defaults;
use sequencer_node::read_plan;

use super::Findings;
use crate::import::limits;
use crate::import::map::Map;
use crate::import_shift::OrderFile;
use crate::launch;
use crate::node;
use crate::scenario::ScenarioFile;

/// Kinds of files that people write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Machine,
    Plan,
    Plant,
    Scenario,
    Limits,
    Budget,
    /// Columns of a table, for `abbe import`.
    ImportMap,
    /// Keys of a machine, for `mtconnect_bridge`.
    Mapping,
    /// Part of a log, for `abbe import-shift`.
    Order,
    Launch,
    /// Parameters of nodes.
    Parameters,
}

/// Kinds by the name of the file.
const FILE_NAMES: [(&str, Kind); 6] = [
    ("machine", Kind::Machine),
    ("plan", Kind::Plan),
    ("plant", Kind::Plant),
    ("scenario", Kind::Scenario),
    ("limits", Kind::Limits),
    ("budget", Kind::Budget),
];
/// Kinds by a key at the top of the file.
const KEYS: [(&str, Kind); 8] = [
    ("chain", Kind::Machine),
    ("steps", Kind::Plan),
    ("test", Kind::ImportMap),
    ("values", Kind::Mapping),
    ("bin_s", Kind::Order),
    ("limits", Kind::Limits),
    ("limit_min", Kind::Scenario),
    ("misalignment_mm", Kind::Budget),
];

/// A file and what it seems to be.
pub struct File {
    pub path: PathBuf,
    /// By its name, or else by its keys; `None`: nothing that is known.
    pub kind: Option<Kind>,
}

impl File {
    /// The kind of a file: by its name, else by its keys at the top level.
    pub fn named(path: &Path) -> Self {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let stem = name.trim_end_matches(".yaml");
        let kind = if name.ends_with(".launch.xml") {
            Some(Kind::Launch)
        } else if let Some((_, kind)) = FILE_NAMES.iter().find(|(known, _)| *known == stem) {
            Some(*kind)
        } else if node::builder(stem).is_some() {
            Some(Kind::Parameters)
        } else {
            text_file::yaml(path).ok().and_then(|text| by_keys(&text))
        };
        Self {
            path: path.to_owned(),
            kind,
        }
    }

    /// Why a file of no known kind is not looked at.
    pub fn unknown(&self) -> String {
        let shown = self.path.display();
        if let Err(error) = text_file::yaml(&self.path) {
            return error.to_string();
        }
        let names = FILE_NAMES
            .map(|(name, _)| format!("{name}.yaml"))
            .join(", ");
        format!(
            "{shown}: neither its name nor its keys are those of a known file: name it {names}, or NODE.yaml for the parameters of a node"
        )
    }
}

fn by_keys(text: &str) -> Option<Kind> {
    if text.contains("ros__parameters:") {
        return Some(Kind::Parameters);
    }
    let has = |key: &str| {
        text.lines()
            .any(|line| line.starts_with(&format!("{key}:")))
    };
    let found = KEYS.iter().find(|(key, _)| has(key));
    found.map(|(_, kind)| *kind)
}

/// Reads a file as its kind; a machine that is known bounds maps and orders. Returns the machine of a machine file.
pub fn check(
    file: &File,
    kind: Kind,
    machine: Option<&MachineFile>,
    findings: &mut Findings,
) -> Option<MachineFile> {
    let path = &file.path;
    findings.files.insert(path.clone());
    if kind == Kind::Machine {
        match machine_of(path) {
            Ok((machine, text)) => {
                let left_out = machine_defaults::of(&machine, &text);
                if !left_out.is_empty() {
                    let shown = path.display();
                    findings.note(format!("{shown}: defaults in use: {}", left_out.join(", ")));
                }
                return Some(machine);
            }
            Err(error) => findings.mistake(complaint::in_words(&error)),
        }
    } else if let Err(error) = read(path, kind, machine) {
        findings.mistake(complaint::in_words(&error));
    }
    None
}

fn machine_of(path: &Path) -> Result<(MachineFile, String)> {
    let file = text_file::yaml_file(path).context("machine file")?;
    let machine = MachineFile::parse(&file.text, &file.path.display().to_string())?;
    Ok((machine, file.text))
}

fn read(path: &Path, kind: Kind, machine: Option<&MachineFile>) -> Result<()> {
    if kind == Kind::Launch {
        return launched(path);
    }
    if kind == Kind::Parameters {
        return parameters(path);
    }
    let file = text_file::yaml_file(path)?;
    let (path, text) = (file.path.as_path(), file.text);
    let placed = |what: &str, message: &str| {
        let place = path.display().to_string();
        anyhow!("{what} {}", yaml::placed(&place, &text, message))
    };
    match kind {
        Kind::Plan => read_plan(&text, path).map(drop),
        Kind::Plant => PlantFile::from_yaml(&text)
            .map(drop)
            .map_err(|error| placed("plant file", &error.to_string())),
        Kind::Scenario => ScenarioFile::read(path).map(drop),
        Kind::Limits => Limits::read(&text, path).map(drop),
        Kind::Budget => Budget::read(&text, path).map(drop),
        Kind::ImportMap => {
            let map: Map =
                yaml::read_letters(&text).map_err(|error| placed("map", &error.to_string()))?;
            let bounded = match machine {
                Some(machine) => limits::check(&map, machine),
                None => limits::check_alone(&map),
            };
            bounded.map_err(|error| placed("map", &error.to_string()))
        }
        Kind::Mapping => MapFile::from_yaml(&text)
            .and_then(|map| Mapping::new(&map))
            .map(drop)
            .map_err(|error| placed("mapping", &error.to_string())),
        Kind::Order => {
            let order: OrderFile =
                yaml::read_letters(&text).map_err(|error| placed("order", &error.to_string()))?;
            let checked = machine.map_or(Ok(()), |machine| order.checked(machine).map(drop));
            checked.map_err(|error| placed("order", &format!("{error:#}")))
        }
        Kind::Machine | Kind::Launch | Kind::Parameters => Ok(()),
    }
}

/// A launch file without its folder: each node is known, has a name of its own, and its parameter files can be read.
fn launched(path: &Path) -> Result<()> {
    let nodes = launch::read(path)?;
    let wrong = |reason: String| anyhow!("launch file {}: {reason}", path.display());
    for node in nodes {
        if node::builder(&node.exec).is_none() {
            return Err(wrong(format!(
                "exec=\"{}\": there is no such node (nodes: {})",
                node.exec,
                node::names()
            )));
        }
        node.setup()?;
    }
    Ok(())
}

/// The parameters of one node, without the node: its machine file may stand elsewhere.
fn parameters(path: &Path) -> Result<()> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let build = node::builder(&name).with_context(|| {
        format!(
            "{}: no node has the name of this file (nodes: {}): validate the folder of its scenario",
            path.display(),
            node::names()
        )
    })?;
    text_file::read(path, Comments::Yaml).context("parameter file")?;
    let words = ["--ros-args", "--params-file"].map(str::to_owned);
    let arguments = words.into_iter().chain([path.display().to_string()]);
    let setup = Setup::new(&name, &Arguments::parse(arguments)?)?;
    setup.resolved_by(build).map(drop)
}
