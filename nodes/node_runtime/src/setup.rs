//! What a node is told before it is built: its name, its parameters, and files that these name.
#![expect(
    clippy::disallowed_methods,
    reason = "parameter files and the files they name are read here"
)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use anyhow::Context;
use metrology::ParameterDoc;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::arguments::{Arguments, LogOutputs, ParameterSource};
use crate::clock::HostTime;
use crate::log::{self, Severity};
use crate::names::{NameError, NodeNames};
use crate::node::Node;
use crate::parameter::{Parameter, Value};

mod file;
mod of_every_node;
mod tree;

use of_every_node::OfEveryNode;

pub use tree::{Tree, TreeError};

/// Where a parameter's value comes from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Origin {
    File(PathBuf),
    CommandLine,
}

/// Why a node's parameters cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The node's name or namespace.
    #[error(transparent)]
    Name(#[from] NameError),
    /// A parameter file cannot be opened.
    #[error("parameter file {path}: {source}", path = path.display())]
    Unreadable {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A parameter file cannot be understood.
    #[error("parameter file {path}: {reason}", path = path.display())]
    BadFile {
        /// Which.
        path: PathBuf,
        /// Why.
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
    every: OfEveryNode,
    log_level: Option<Severity>,
    log_outputs: LogOutputs,
    /// Where the parameters go when nothing but these is asked for.
    asked: Option<Arc<OnceLock<Vec<Parameter>>>>,
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
        let text = std::fs::read_to_string(path).map_err(|source| SetupError::Unreadable {
            path: path.to_owned(),
            source,
        })?;
        for section in file::sections(path, &text, &self.names.fully_qualified())? {
            self.origins.extend(file::origins(path, &section));
            if let Tree::Map(entries) = section {
                for (key, value) in entries {
                    self.parameters.insert(&key, value);
                }
            }
        }
        Ok(())
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
        let key = place.split('[').next().unwrap_or_default();
        match self.parameters.get(key) {
            Some(value) if !matches!(value, Tree::Map(_)) => {
                let mut explained = self.bad(key, value, error.reason.clone());
                if let SetupError::BadParameter { name, .. } = &mut explained {
                    *name = place;
                }
                explained
            }
            _ if place.is_empty() => SetupError::Missing {
                origin: self.files(),
                reason: error.reason.clone(),
            },
            _ => SetupError::Missing {
                origin: self.files(),
                reason: format!("parameter `{place}`: {}", error.reason),
            },
        }
    }

    fn files(&self) -> String {
        let mut files: Vec<_> = self.origins.values().map(describe).collect();
        files.sort();
        files.dedup();
        if files.is_empty() {
            "no parameter file".to_owned()
        } else {
            files.join(", ")
        }
    }

    fn where_not_set(&self) -> String {
        match self.files() {
            files if self.origins.is_empty() => format!("{files} (its default)"),
            files => format!("{files} (not set there: its default)"),
        }
    }

    fn bad(&self, name: &str, value: &Tree, reason: String) -> SetupError {
        let below = format!("{name}.");
        let origin = self
            .origins
            .iter()
            .find(|(key, _)| key.as_str() == name || key.starts_with(&below))
            .map_or_else(|| self.where_not_set(), |(_, origin)| describe(origin));
        SetupError::BadParameter {
            origin,
            name: name.to_owned(),
            value: value.to_string(),
            reason,
        }
    }

    /// Path and text of the file that the parameter `key` names; a relative path is relative to the
    /// parameter file that says so.
    ///
    /// # Errors
    /// When the parameter is absent or no text, or the file cannot be read.
    pub fn file_text(&self, key: &str) -> anyhow::Result<(PathBuf, String)> {
        let path = self.file_path(key)?;
        let text = std::fs::read_to_string(&path)
            .with_context(|| format!("parameter `{key}`: file {}", path.display()))?;
        Ok((path, text))
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
            Some(Origin::File(file)) => file.parent().unwrap_or(Path::new("")),
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
    pub fn resolved<T: Serialize>(
        &self,
        config: &T,
        docs: &[ParameterDoc],
    ) -> anyhow::Result<Vec<Parameter>> {
        let resolved: Tree = serde_json::from_value(
            serde_json::to_value(config).context("parameters of the configuration")?,
        )
        .context("parameters of the configuration")?;
        let parameters = self.served(&resolved, docs)?;
        match &self.asked {
            None => Ok(parameters),
            Some(told) => {
                // The first answer counts: a node resolves its parameters once.
                let _ = told.set(parameters);
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
        let told = Arc::<OnceLock<Vec<Parameter>>>::default();
        let asking = Self {
            asked: Some(Arc::clone(&told)),
            ..self.clone()
        };
        let built = build(&asking);
        if let Some(parameters) = told.get() {
            return Ok(parameters.clone());
        }
        Ok(built?.parameters().to_vec())
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
        Origin::File(path) => path.display().to_string(),
        Origin::CommandLine => "command line".to_owned(),
    }
}

fn describe_doc(doc: &ParameterDoc) -> String {
    match doc.unit {
        "" => doc.description.to_owned(),
        unit => format!("{} [{unit}]", doc.description),
    }
}

fn check_range(value: &Value, range: Option<(f64, f64)>) -> Result<(), String> {
    let Some((least, greatest)) = range else {
        return Ok(());
    };
    let inside = |number: f64| (least..=greatest).contains(&number);
    #[expect(clippy::cast_precision_loss, reason = "a limit, far below 2^53")]
    let fits = match value {
        Value::Integer(number) => inside(*number as f64),
        Value::Double(number) => inside(*number),
        Value::IntegerArray(numbers) => numbers.iter().all(|n| inside(*n as f64)),
        Value::DoubleArray(numbers) => numbers.iter().all(|n| inside(*n)),
        _ => true,
    };
    if fits {
        Ok(())
    } else {
        Err(format!("must be {least} to {greatest}"))
    }
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
