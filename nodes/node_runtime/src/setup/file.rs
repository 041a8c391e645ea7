//! ROS parameter files: which of a file's sections are a node's, and what they say.

use std::path::Path;

use super::tree::Tree;
use super::{Origin, SetupError};
use crate::complaint;

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

fn tokens(name: &str) -> Vec<&str> {
    name.split('/').filter(|token| !token.is_empty()).collect()
}

/// What a file says to the node `/name/space/node`, section by section in the order of the file's keys:
/// wildcards before the node's own section, so that the particular overrides the general.
pub(super) fn sections(
    path: &Path,
    text: &str,
    fully_qualified: &str,
) -> Result<Vec<Tree>, SetupError> {
    let bad = |reason: String| SetupError::BadFile {
        path: path.to_owned(),
        reason,
    };
    let tree: Tree =
        Tree::from_yaml(text).map_err(|error| bad(complaint::of_yaml(&error, text)))?;
    let mut found = Vec::new();
    if tree != Tree::Null {
        walk(&tree, "", &tokens(fully_qualified), &mut found).map_err(bad)?;
    }
    found.sort_by_key(|(general, _)| !*general);
    Ok(found.into_iter().map(|(_, section)| section).collect())
}

fn walk(
    tree: &Tree,
    name: &str,
    node: &[&str],
    found: &mut Vec<(bool, Tree)>,
) -> Result<(), String> {
    let Tree::Map(map) = tree else {
        let shown = if name.is_empty() { "the file" } else { name };
        return Err(format!("{shown} has no {PARAMETERS_KEY}: it is {tree}"));
    };
    for (key, below) in map {
        if key == PARAMETERS_KEY {
            if !matches!(below, Tree::Map(_)) {
                return Err(format!(
                    "{name}.{PARAMETERS_KEY} must hold names and values, got {below}"
                ));
            }
            if fits(&tokens(name), node) {
                found.push((name.contains('*'), below.clone()));
            }
        } else {
            walk(below, &format!("{name}/{key}"), node, found)?;
        }
    }
    Ok(())
}

/// Where each leaf of a section comes from.
pub(super) fn origins(path: &Path, section: &Tree) -> Vec<(String, Origin)> {
    let origin = Origin::File(path.to_owned());
    section
        .leaves()
        .into_iter()
        .map(|(name, _)| (name, origin.clone()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, node: &str) -> Result<Vec<String>, String> {
        sections(Path::new("p.yaml"), text, node)
            .map(|found| {
                found
                    .iter()
                    .flat_map(|s| s.leaves().into_iter().map(|(n, v)| format!("{n}={v}")))
                    .collect()
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
