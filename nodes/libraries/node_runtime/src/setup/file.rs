//! ROS parameter files: which of a file's sections are a node's, and what they say.

use std::path::Path;

use metrology::yaml::{self, Places};

use super::tree::Tree;
use super::{Origin, SetupError};

const PARAMETERS_KEY: &str = "ros__parameters";

/// Whether a section's name fits a node; `*` is one token, `**` any number of them.
fn fits(pattern: &[&str], name: &[&str]) -> bool {
    match (pattern.split_first(), name.split_first()) {
        (None, None) => true,
        (Some((&"**", rest)), _) => {
            fits(rest, name)
                || name
                    .split_first()
                    .is_some_and(|(_, below)| fits(pattern, below))
        }
        (Some((token, rest)), Some((head, below))) => {
            (*token == "*" || token == head) && fits(rest, below)
        }
        _ => false,
    }
}

/// Whether a section of a parameter file, such as `/mill/*`, is for the node `/mill/probe`.
#[must_use]
pub fn is_for(section: &str, fully_qualified: &str) -> bool {
    fits(&tokens(section), &tokens(fully_qualified))
}

fn tokens(name: &str) -> Vec<&str> {
    name.split('/').filter(|token| !token.is_empty()).collect()
}

/// A part of a file that is for one node or several.
#[derive(Debug)]
pub(super) struct Section {
    /// The name that it is for, with `*` for any word of it.
    pub name: String,
    /// Path of its values in the file.
    path: String,
    /// Its values.
    pub values: Tree,
}

/// What a file has for the node `/name/space/node`.
#[derive(Debug)]
pub(super) struct Sections {
    /// Those that fit, in the order of the file's keys: wildcards before the node's own, so that the particular
    /// overrides the general.
    pub fitting: Vec<Section>,
    /// Names of the others.
    pub of_others: Vec<String>,
    places: Places,
}

/// The sections of a file.
pub(super) fn sections(
    path: &Path,
    text: &str,
    fully_qualified: &str,
) -> Result<Sections, SetupError> {
    let bad = |reason: String| SetupError::BadFile {
        reason: yaml::placed(&path.display().to_string(), text, &reason),
    };
    let tree: Tree = if text.lines().all(is_blank) {
        Tree::Null
    } else {
        yaml::read(text).map_err(|error| bad(error.to_string()))?
    };
    let mut found = Vec::new();
    if tree != Tree::Null {
        walk(&tree, "", "", &mut found).map_err(bad)?;
    }
    let node = tokens(fully_qualified);
    let (mut fitting, others): (Vec<Section>, Vec<Section>) = found
        .into_iter()
        .partition(|section| fits(&tokens(&section.name), &node));
    fitting.sort_by_key(|section| !section.name.contains('*'));
    Ok(Sections {
        fitting,
        of_others: others.into_iter().map(|section| section.name).collect(),
        places: Places::of(text),
    })
}

fn is_blank(line: &str) -> bool {
    let line = line.trim();
    line.is_empty() || line.starts_with('#')
}

fn walk(tree: &Tree, name: &str, path: &str, found: &mut Vec<Section>) -> Result<(), String> {
    let Tree::Map(map) = tree else {
        let shown = if path.is_empty() { "the file" } else { path };
        return Err(format!(
            "{shown}: must hold {PARAMETERS_KEY} below the name of a node, got {tree}"
        ));
    };
    for (key, below) in map {
        let path = if path.is_empty() {
            key.clone()
        } else {
            format!("{path}.{key}")
        };
        if key == PARAMETERS_KEY {
            if !matches!(below, Tree::Map(_)) {
                return Err(format!("{path}: must hold names and values, got {below}"));
            }
            found.push(Section {
                name: if name.is_empty() { "/" } else { name }.to_owned(),
                path,
                values: below.clone(),
            });
        } else {
            let name = format!("{name}/{}", key.trim_start_matches('/'));
            walk(below, &name, &path, found)?;
        }
    }
    Ok(())
}

impl Sections {
    /// Where each value of a section comes from.
    pub(super) fn origins(&self, path: &Path, section: &Section) -> Vec<(String, Origin)> {
        let leaves = section.values.leaves().into_iter();
        leaves
            .map(|(name, _)| {
                let place = self.places.find(&format!("{}.{name}", section.path));
                (name, Origin::File(path.to_owned(), place))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, node: &str) -> Result<Vec<String>, String> {
        sections(Path::new("p.yaml"), text, node)
            .map(|found| {
                let leaves = found.fitting.iter().flat_map(|s| s.values.leaves());
                leaves.map(|(n, v)| format!("{n}={v}")).collect()
            })
            .map_err(|error| error.to_string())
    }

    #[test]
    fn sections_fit_as_in_ros() {
        let text = "
probe: {ros__parameters: {own: 1}}
/**: {ros__parameters: {all: 2}}
/cell/*: {ros__parameters: {in_cell: 3}}
/**/probe: {ros__parameters: {any_probe: 4}}
cell: {probe: {ros__parameters: {nested: 5}}}
other: {ros__parameters: {not: 6}}
";
        let mut root = read(text, "/probe").unwrap();
        assert_eq!(root.last().unwrap(), "own=1");
        root.sort();
        assert_eq!(root, ["all=2", "any_probe=4", "own=1"]);
        let mut cell = read(text, "/cell/probe").unwrap();
        cell.sort();
        assert_eq!(cell, ["all=2", "any_probe=4", "in_cell=3", "nested=5"]);
    }

    #[test]
    fn a_file_without_sections_is_refused() {
        let error = read("rate_hz: 1.0", "/probe").unwrap_err();
        assert!(
            error.contains("p.yaml") && error.contains("rate_hz"),
            "{error}"
        );
        assert!(read("probe: {ros__parameters: 3}", "/probe").is_err());
        assert!(read("a: [", "/probe").unwrap_err().contains("p.yaml"));
        assert!(read("", "/probe").unwrap().is_empty());
    }
}
