//! What a node is told before it is built: its name, its parameters, and files that these name.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use anyhow::Context;
use metrology::number::{number, unit_of};
use metrology::yaml::Place;
use metrology::{ArrivalClock, ParameterDoc, parameters_of};
use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::arguments::{Arguments, LogOutputs, ParameterSource};
use crate::clock::HostTime;
use crate::log::{self, Severity};
use crate::names::{NameError, NodeNames};
use crate::node::Node;
use crate::parameter::{Parameter, Value};
use crate::text_file::{self, TextFileError};

mod file;
mod of_every_node;
mod tree;

pub use file::is_for;
use of_every_node::OfEveryNode;
pub use of_every_node::PARAMETERS_OF_EVERY_NODE;

pub use tree::{Tree, TreeError};

/// Where a parameter's value comes from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Origin {
    /// A file, and where in it.
    File(PathBuf, Option<Place>),
    CommandLine,
}

/// Why a node's parameters cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The node's name or namespace.
    #[error(transparent)]
    Name(#[from] NameError),
    /// A parameter file cannot be read.
    #[error("parameter file {0}")]
    Unreadable(#[from] TextFileError),
    /// A parameter file cannot be understood.
    #[error("parameter file {reason}")]
    BadFile {
        /// File, line, column, and what is wrong.
        reason: String,
    },
    /// A parameter that the node cannot take.
    #[error("{origin}: parameter `{name}` = {value}: {reason}")]
    BadParameter {
        /// File, or "command line".
        origin: String,
        /// Dotted name.
        name: String,
        /// What stands there.
        value: String,
        /// Why.
        reason: String,
    },
    /// A parameter that the node needs.
    #[error("{origin}: {reason}")]
    Missing {
        /// Files, or "no parameter file".
        origin: String,
        /// Which, and where.
        reason: String,
    },
}

/// A node's name and resolved parameters.
#[derive(Clone, Debug)]
pub struct Setup {
    names: NodeNames,
    parameters: Tree,
    origins: BTreeMap<String, Origin>,
    /// Parameter files without a section for this node, with the sections that they have.
    unfitting: Vec<(PathBuf, Vec<String>)>,
    /// Sections of its files that are for other nodes.
    of_others: Vec<(PathBuf, String)>,
    every: OfEveryNode,
    log_level: Option<Severity>,
    log_outputs: LogOutputs,
    /// Where the parameters go when nothing but these is asked for.
    asked: Option<Arc<OnceLock<Described>>>,
}

/// A node's parameters without the node.
#[derive(Clone, Debug, Default)]
pub struct Described {
    /// What the node's table says of each.
    pub docs: Vec<ParameterDoc>,
    /// Those that have a value, defaults included.
    pub parameters: Vec<Parameter>,
}

/// How building a node ends when nothing but its parameters was asked for.
#[derive(Debug, thiserror::Error)]
#[error("only the parameters were asked for")]
struct ParametersOnly;

impl Setup {
    /// Resolves what a node that calls itself `default_name` is told by the arguments.
    ///
    /// # Errors
    /// When a parameter file cannot be read or a name breaks the rules of ROS.
    pub fn new(default_name: &str, arguments: &Arguments) -> Result<Self, SetupError> {
        let names = NodeNames::new(default_name, &arguments.remaps)?;
        let mut setup = Self {
            names,
            parameters: Tree::empty(),
            origins: BTreeMap::new(),
            unfitting: Vec::new(),
            of_others: Vec::new(),
            every: OfEveryNode::default(),
            log_level: None,
            log_outputs: arguments.log_outputs,
            asked: None,
        };
        let logger = log::logger(&setup.names.fully_qualified());
        let mut named = arguments.log_levels.iter().rev();
        setup.log_level = named
            .find(|(name, _)| name.as_ref() == Some(&logger))
            .and_then(|(_, level)| Severity::of_word(level));
        for source in &arguments.parameters {
            match source {
                ParameterSource::File(path) => setup.add_file(path)?,
                ParameterSource::Value { node, name, value } => {
                    if node
                        .as_ref()
                        .is_none_or(|n| n == default_name || *n == setup.names.name)
                    {
                        setup.origins.insert(name.clone(), Origin::CommandLine);
                        setup.parameters.insert(name, value.clone());
                    }
                }
            }
        }
        setup.every = OfEveryNode::take_from(&mut setup)?;
        Ok(setup)
    }

    fn add_file(&mut self, path: &Path) -> Result<(), SetupError> {
        let text = text_file::read(path, text_file::Comments::Yaml)?;
        let sections = file::sections(path, &text, &self.names.fully_qualified())?;
        let others = sections.of_others.iter();
        self.of_others
            .extend(others.map(|name| (path.to_owned(), name.clone())));
        if sections.fitting.is_empty() {
            let others = sections.of_others.clone();
            self.unfitting.push((path.to_owned(), others));
        }
        for section in &sections.fitting {
            self.origins.extend(sections.origins(path, section));
            if let Tree::Map(entries) = &section.values {
                for (key, value) in entries {
                    self.parameters.insert(key, value.clone());
                }
            }
        }
        Ok(())
    }

    /// Sections of this node's parameter files that are for other nodes: the file, and the name in front of them.
    #[must_use]
    pub fn sections_of_others(&self) -> &[(PathBuf, String)] {
        &self.of_others
    }

    /// Parameter files that were given and have nothing for this node, each with what it has.
    #[must_use]
    pub fn unused_files(&self) -> Vec<String> {
        let own = self.names.fully_qualified();
        let line = |(path, sections): &(PathBuf, Vec<String>)| {
            let has = match sections.as_slice() {
                [] => "it has no sections".to_owned(),
                several => format!("its sections are for {}", several.join(", ")),
            };
            format!(
                "parameter file {} has no section for {own}: {has}; write `{own}:`, or `/**/{}:` for any namespace",
                path.display(),
                self.name()
            )
        };
        self.unfitting.iter().map(line).collect()
    }

    /// The node's name on the graph, without namespace.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.names.name
    }

    /// The node's namespace, `/` or `/a/b`.
    #[must_use]
    pub fn namespace(&self) -> &str {
        &self.names.namespace
    }

    /// The absolute name of a topic after remapping.
    #[must_use]
    pub fn topic(&self, name: &str) -> String {
        let resolved = self.names.resolve(name);
        resolved.unwrap_or_else(|_| name.to_owned())
    }

    /// Whether time comes from `/clock`.
    #[must_use]
    pub const fn use_sim_time(&self) -> bool {
        self.every.use_sim_time
    }

    /// The host by whose map stamps are taken over; empty: they are left as they are.
    pub(crate) fn clock_host(&self) -> &str {
        &self.every.clock_host
    }

    /// The clock by which this node stamps where time is not simulated; its copies are one clock.
    #[must_use]
    pub fn host_time(&self) -> HostTime {
        self.every.host_time.clone()
    }

    /// The clock by which this node stamps what it hears outside the graph. Where time is simulated, it counts as come when it is taken.
    #[must_use]
    pub fn arrival_clock(&self) -> ArrivalClock {
        let (time, is_simulated) = (self.host_time(), self.use_sim_time());
        ArrivalClock::new(move |taken_at, came_at| match is_simulated {
            true => taken_at,
            false => time.shown(came_at),
        })
    }

    /// From where on the node's lines are said, where its logger is named on the command line.
    pub(crate) const fn log_level(&self) -> Option<Severity> {
        self.log_level
    }

    /// Where the node's lines go.
    pub(crate) const fn log_outputs(&self) -> LogOutputs {
        self.log_outputs
    }

    /// The parameters as given, without those of every node.
    #[must_use]
    pub const fn tree(&self) -> &Tree {
        &self.parameters
    }

    /// The node's names and rules.
    #[must_use]
    pub const fn names(&self) -> &NodeNames {
        &self.names
    }

    /// The name of a frame of this node's machine; see [`NodeNames::frame`].
    #[must_use]
    pub fn frame(&self, name: &str) -> String {
        self.names.frame(name)
    }

    /// Reads the node's configuration out of its parameters.
    ///
    /// # Errors
    /// Names the file, the parameter, its value and what is wrong with it.
    pub fn config<T: DeserializeOwned>(&self) -> anyhow::Result<T> {
        tree::read(&self.parameters).map_err(|error| self.explain(&error).into())
    }

    fn explain(&self, error: &TreeError) -> SetupError {
        let place = error.place();
        let reason = error.reason();
        match self.parameters.at(&place) {
            Some(value) if !place.is_empty() && !matches!(value, Tree::Map(_)) => {
                self.bad(&place, value, reason)
            }
            _ if place.is_empty() => SetupError::Missing {
                origin: self.files(),
                reason,
            },
            _ => SetupError::Missing {
                origin: self.origin(&place).unwrap_or_else(|| self.files()),
                reason: format!("parameter `{place}`: {reason}"),
            },
        }
    }

    /// The files that parameters come from, and those that have nothing for this node.
    fn files(&self) -> String {
        let file = |origin: &Origin| match origin {
            Origin::File(path, _) => path.display().to_string(),
            Origin::CommandLine => describe(origin),
        };
        let mut files: Vec<_> = self.origins.values().map(file).collect();
        files.sort();
        files.dedup();
        files.extend(self.unused_files());
        if files.is_empty() {
            "no parameter file".to_owned()
        } else {
            files.join(", ")
        }
    }

    /// File, line and column of a parameter, of a part of it, or of what is below it.
    fn origin(&self, place: &str) -> Option<String> {
        let key = place.split('[').next().unwrap_or_default();
        let below = format!("{key}.");
        let own = self.origins.get(key);
        let found = own.or_else(|| {
            let mut all = self.origins.iter();
            let (_, origin) = all.find(|(name, _)| name.starts_with(&below))?;
            Some(origin)
        });
        found.map(describe)
    }

    /// A message that begins with the name of a parameter, with file, line and column in front.
    #[must_use]
    pub fn placed(&self, message: &str) -> String {
        let name = message.split([' ', ':', ',']).next().unwrap_or_default();
        match self.origin(name) {
            Some(origin) => format!("{origin}: {message}"),
            None => message.to_owned(),
        }
    }

    /// What was built of the parameters. A reason that begins with the name of a parameter gets file, line and column in front.
    ///
    /// # Errors
    /// The reason.
    pub fn built<T, E>(&self, built: Result<T, E>) -> anyhow::Result<T>
    where
        E: std::error::Error + Send + Sync + 'static,
    {
        built.map_err(|error| {
            let message = error.to_string();
            let placed = self.placed(&message);
            if placed == message {
                error.into()
            } else {
                anyhow::anyhow!(placed)
            }
        })
    }

    fn where_not_set(&self) -> String {
        match self.files() {
            files if self.origins.is_empty() => format!("{files} (its default)"),
            files => format!("{files} (not set there: its default)"),
        }
    }

    fn bad(&self, name: &str, value: &Tree, reason: String) -> SetupError {
        let value = match (value, unit_of(name)) {
            (Tree::Integer(_) | Tree::Double(_), Some(unit)) => format!("{value} {unit}"),
            _ => value.to_string(),
        };
        SetupError::BadParameter {
            origin: self.origin(name).unwrap_or_else(|| self.where_not_set()),
            name: name.to_owned(),
            value,
            reason,
        }
    }

    /// Path and text of the file that the parameter `key` names, or of the base of that file; a relative path is relative to the
    /// parameter file that says so.
    ///
    /// # Errors
    /// When the parameter is absent or no text, or the file cannot be read.
    pub fn file_text(&self, key: &str) -> anyhow::Result<(PathBuf, String)> {
        let path = self.file_path(key)?;
        let file = text_file::yaml_file(&path).with_context(|| format!("parameter `{key}`"))?;
        Ok((file.path, file.text))
    }

    /// The file that the parameter `key` names, open, and its length: it is read in pieces, however long it is.
    ///
    /// # Errors
    /// When the parameter is absent or no text, or the file cannot be opened or is no regular file.
    pub fn file_opened(&self, key: &str) -> anyhow::Result<(File, u64)> {
        let path = self.file_path(key)?;
        text_file::open(&path).with_context(|| format!("parameter `{key}`"))
    }

    /// The path that the parameter `key` names; a relative path is relative to the parameter file that
    /// says so.
    ///
    /// # Errors
    /// When the parameter is absent or no text.
    pub fn file_path(&self, key: &str) -> anyhow::Result<PathBuf> {
        let path = match self.parameters.get(key) {
            Some(Tree::String(path)) => Path::new(path),
            Some(other) => {
                return Err(self
                    .bad(key, other, "must be the path of a file".to_owned())
                    .into());
            }
            None => anyhow::bail!(
                "{}: parameter `{key}` is missing: path of a file",
                self.files()
            ),
        };
        let directory = match self.origins.get(key) {
            Some(Origin::File(file, _)) => file.parent().unwrap_or(Path::new("")),
            _ => Path::new(""),
        };
        Ok(directory.join(path))
    }

    /// The parameters as they were given, as ROS serves them, with what `docs` say of them.
    ///
    /// # Errors
    /// When a value has no form among the parameter types of ROS, or is outside of its range.
    pub fn parameters(&self, docs: &[ParameterDoc]) -> anyhow::Result<Vec<Parameter>> {
        self.served(&self.parameters, docs)
    }

    /// The parameters of a configuration, defaults included, as ROS serves them.
    ///
    /// # Errors
    /// As [`Self::parameters`].
    pub fn resolved<T: JsonSchema + Serialize>(
        &self,
        config: &T,
    ) -> anyhow::Result<Vec<Parameter>> {
        let docs = parameters_of::<T>();
        let resolved: Tree = serde_json::from_value(
            serde_json::to_value(config).context("parameters of the configuration")?,
        )
        .context("parameters of the configuration")?;
        let parameters = self.served(&resolved, &docs)?;
        match &self.asked {
            None => Ok(parameters),
            Some(told) => {
                // The first answer counts: a node resolves its parameters once.
                let _ = told.set(Described { docs, parameters });
                Err(ParametersOnly.into())
            }
        }
    }

    /// The parameters that `build` would give its node, defaults included, without the node: building ends
    /// where they are resolved, which is before a node reads, starts or opens anything else.
    ///
    /// # Errors
    /// When the node could not be built that far.
    pub fn resolved_by(
        &self,
        build: impl FnOnce(&Self) -> anyhow::Result<Box<dyn Node>>,
    ) -> anyhow::Result<Vec<Parameter>> {
        self.described_by(build)
            .map(|described| described.parameters)
    }

    /// The same with the table in which the node says what each parameter is.
    ///
    /// # Errors
    /// As [`Self::resolved_by`].
    pub fn described_by(
        &self,
        build: impl FnOnce(&Self) -> anyhow::Result<Box<dyn Node>>,
    ) -> anyhow::Result<Described> {
        let told = Arc::<OnceLock<Described>>::default();
        let asking = Self {
            asked: Some(Arc::clone(&told)),
            ..self.clone()
        };
        let built = build(&asking);
        if let Some(described) = told.get() {
            return Ok(described.clone());
        }
        Ok(Described {
            docs: vec![],
            parameters: built?.parameters().to_vec(),
        })
    }

    /// The parameters that the runtime gives to every node.
    pub(crate) fn runtime_parameters(&self) -> Vec<Parameter> {
        self.every.parameters()
    }

    fn served(&self, tree: &Tree, docs: &[ParameterDoc]) -> anyhow::Result<Vec<Parameter>> {
        let mut parameters = self.runtime_parameters();
        for (name, leaf) in tree.leaves() {
            let bad = |reason| anyhow::Error::from(self.bad(&name, leaf, reason));
            let Some(value) = value(leaf).map_err(bad)? else {
                continue;
            };
            let doc = docs.iter().find(|doc| doc.name == name);
            let range = doc.and_then(|doc| doc.range);
            check_range(&value, range).map_err(bad)?;
            parameters.push(Parameter {
                value,
                description: doc.map(describe_doc).unwrap_or_default(),
                range,
                name,
            });
        }
        parameters.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(parameters)
    }
}

fn describe(origin: &Origin) -> String {
    match origin {
        Origin::File(path, Some(at)) => format!("{}:{}:{}", path.display(), at.line, at.column),
        Origin::File(path, None) => path.display().to_string(),
        Origin::CommandLine => "command line".to_owned(),
    }
}

fn describe_doc(doc: &ParameterDoc) -> String {
    match doc.unit.as_ref() {
        "" => doc.description.to_string(),
        unit => format!("{} [{unit}]", doc.description),
    }
}

fn check_range(value: &Value, range: Option<(f64, f64)>) -> Result<(), String> {
    let Some((least, greatest)) = range else {
        return Ok(());
    };
    let inside = |number: f64| (least..=greatest).contains(&number);
    let entry = |at: usize, value: String| format!("entry [{at}] = {value}: ");
    #[expect(clippy::cast_precision_loss, reason = "a limit, far below 2^53")]
    let outside = match value {
        Value::Integer(number) => (!inside(*number as f64)).then(String::new),
        Value::Double(number) => (!inside(*number)).then(String::new),
        Value::IntegerArray(numbers) => numbers
            .iter()
            .position(|n| !inside(*n as f64))
            .map(|at| entry(at, numbers[at].to_string())),
        Value::DoubleArray(numbers) => numbers
            .iter()
            .position(|n| !inside(*n))
            .map(|at| entry(at, format!("{:?}", numbers[at]))),
        _ => None,
    };
    outside.map_or(Ok(()), |place| {
        let limits = format!("{} to {}", number(least), number(greatest));
        Err(format!("{place}must be {limits}"))
    })
}

/// A leaf as a ROS parameter; `None` where nothing stands.
fn value(leaf: &Tree) -> Result<Option<Value>, String> {
    macro_rules! array {
        ($values:expr, $leaf:ident, $kind:ident) => {
            $values
                .iter()
                .map(|value| match value {
                    Tree::$leaf(value) => Some(value.clone()),
                    _ => None,
                })
                .collect::<Option<Vec<_>>>()
                .map(|values| Some(Value::$kind(values)))
                .ok_or_else(|| "the entries of a list must be of one type".to_owned())
        };
    }
    Ok(match leaf {
        Tree::Null | Tree::Map(_) => None,
        Tree::Bool(value) => Some(Value::Bool(*value)),
        Tree::Integer(value) => Some(Value::Integer(*value)),
        Tree::Double(value) => Some(Value::Double(*value)),
        Tree::String(value) => Some(Value::String(value.clone())),
        Tree::List(values) => match values.first() {
            None => Some(Value::StringArray(Vec::new())),
            Some(Tree::Bool(_)) => array!(values, Bool, BoolArray)?,
            Some(Tree::Integer(_)) => array!(values, Integer, IntegerArray)?,
            Some(Tree::Double(_)) => array!(values, Double, DoubleArray)?,
            Some(Tree::String(_)) => array!(values, String, StringArray)?,
            Some(other) => return Err(format!("a list of ROS parameters cannot hold {other}")),
        },
    })
}

#[cfg(test)]
mod tests;
