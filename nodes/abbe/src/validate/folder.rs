//! A folder: every file by itself, then the nodes that its launch files start, each built and not run.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use node_runtime::complaint;

use super::Findings;
use super::programs;
use super::single::{self, File, Kind};
use super::unknown_latency;
use crate::launch::{self, LaunchNode};
use crate::node;
use crate::scenario::{SCENARIO_FILE, Scenario, check_machines};

/// Nodes whose building opens a file, a connection or a program: of these the parameters are read, and no more.
const OPENING: [&str; 6] = [
    "linuxcnc_bridge",
    "live_view",
    "mtconnect_bridge",
    "opcua_bridge",
    "recorder",
    "replayer",
];

/// Files of a folder that may be looked at, in order.
pub fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let context = || folder.display().to_string();
    let mut found = vec![];
    for entry in std::fs::read_dir(folder).with_context(context)? {
        let path = entry.with_context(context)?.path();
        let name = path.to_string_lossy();
        if (name.ends_with(".yaml") || name.ends_with(".launch.xml")) && path.is_file() {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// Looks at a scenario, or at a folder of files without a launch file.
pub fn check(folder: &Path, findings: &mut Findings) -> Result<()> {
    let files: Vec<File> = files(folder)?
        .iter()
        .map(|path| File::named(path))
        .collect();
    let launched = launched(folder, &files, findings)?;
    let before = findings.mistakes.len();
    let mut machine = None;
    for file in files.iter().filter(|file| file.kind == Some(Kind::Machine)) {
        machine = machine.or(single::check(file, Kind::Machine, None, findings));
    }
    for file in &files {
        match file.kind {
            // Read by the node that is started with them, below.
            Some(Kind::Parameters) if is_read(&launched, &file.path) => {
                findings.files.insert(file.path.clone());
            }
            Some(Kind::Machine | Kind::Launch) => {}
            Some(kind) => {
                single::check(file, kind, machine.as_ref(), findings);
            }
            None => findings.note(format!("not looked at: {}", file.unknown())),
        }
    }
    let mistakes = &findings.mistakes[before..];
    let spoiled: Vec<&Path> = files
        .iter()
        .map(|file| file.path.as_path())
        .filter(|path| mistakes.iter().any(|said| names(said, path)))
        .collect();
    let planned = planned(folder, &files, &launched);
    let mut held_up = vec![];
    for node in launched.iter().chain(&planned) {
        let Err(error) = built(node) else { continue };
        let message = complaint::in_words(&error).replace("/hosts/../", "/");
        if spoiled.iter().any(|path| names(&message, path)) {
            held_up.push(node.name.clone());
        } else {
            findings.mistake(message);
        }
    }
    if let Err(error) = check_machines(folder, &launched) {
        findings.mistake(complaint::in_words(&error));
    }
    programs::check(&launched, findings);
    unknown_latency::check(&launched, findings);
    if !held_up.is_empty() {
        findings.note(format!(
            "{}: looked at as far as the files above permit: {}; mend these, and validate again",
            folder.display(),
            held_up.join(", ")
        ));
    }
    if let Ok(scenario) = Scenario::read(folder)
        && let Ok(lines) = scenario.without_effect()
    {
        lines.into_iter().for_each(|line| findings.note(line));
    }
    Ok(())
}

/// The nodes of the launch files of a folder and of the folders in it, as one for each host.
fn launched(folder: &Path, files: &[File], findings: &mut Findings) -> Result<Vec<LaunchNode>> {
    let mut paths: Vec<PathBuf> = { files.iter() }
        .filter(|file| file.kind == Some(Kind::Launch))
        .map(|file| file.path.clone())
        .collect();
    let is_scenario = !paths.is_empty() || folder.join(SCENARIO_FILE).is_file();
    if is_scenario {
        let name = folder.display();
        if !folder.join(SCENARIO_FILE).is_file() {
            findings.mistake(format!(
                "{name}: it has a launch file and no {SCENARIO_FILE}: add it"
            ));
        }
        if let Err(error) = launch::find(folder) {
            findings.mistake(complaint::in_words(&error));
        }
    }
    let context = || folder.display().to_string();
    for entry in std::fs::read_dir(folder).with_context(context)? {
        let below = entry.with_context(context)?.path();
        if is_scenario && below.is_dir() {
            let launches = self::files(&below)?.into_iter();
            paths.extend(launches.filter(|path| path.to_string_lossy().ends_with(".launch.xml")));
        }
    }
    let mut nodes = vec![];
    for path in paths {
        findings.files.insert(path.clone());
        match launch::read(&path) {
            Ok(read) => nodes.extend(read),
            Err(error) => findings.mistake(complaint::in_words(&error)),
        }
    }
    Ok(nodes)
}

/// Whether a node that is launched reads a parameter file.
fn is_read(launched: &[LaunchNode], path: &Path) -> bool {
    let mut files = launched.iter().flat_map(|node| &node.parameter_files);
    files.any(|file| is_same(file, path))
}

/// Whether two paths lead to one file, however they are written.
fn is_same(one: &Path, other: &Path) -> bool {
    one == other
        || one
            .canonicalize()
            .and_then(|one| Ok(one == other.canonicalize()?))
            .unwrap_or(false)
}

/// Whether a message names the file at a path: the whole path as it is written, or another one that leads there.
fn names(message: &str, path: &Path) -> bool {
    let shown = path.display().to_string();
    let is_of_name = |letter: char| letter.is_alphanumeric() || "/._-".contains(letter);
    let stands = message.match_indices(&shown).any(|(at, _)| {
        let before = message[..at].chars().next_back();
        let mut behind = message[at + shown.len()..].chars();
        let (next, second) = (behind.next(), behind.next());
        // A point may end the sentence.
        let goes_on = match next {
            Some('.') => second.is_some_and(char::is_alphanumeric),
            next => next.is_some_and(is_of_name),
        };
        !goes_on && !before.is_some_and(is_of_name)
    });
    let words = message.split(|letter: char| letter.is_whitespace() || "\"',;()".contains(letter));
    let mut paths = words.map(|word| word.split(':').next().unwrap_or(word));
    let is_path =
        |word: &str| word.contains('/') && Path::new(word).file_name() == path.file_name();
    stands || paths.any(|word| is_path(word) && is_same(Path::new(word), path))
}

/// A sequencer for the plan of a folder without one, so that plan and machine are held against each other.
fn planned(folder: &Path, files: &[File], launched: &[LaunchNode]) -> Option<LaunchNode> {
    let has = |kind| files.iter().any(|file| file.kind == Some(kind));
    let (machine, plan) = (folder.join("machine.yaml"), folder.join("plan.yaml"));
    if has(Kind::Launch) || !launched.is_empty() || !machine.is_file() || !plan.is_file() {
        return None;
    }
    let file =
        |key: &str, path: &Path| (key.to_owned(), format!("{:?}", path.display().to_string()));
    Some(LaunchNode {
        exec: "sequencer".to_owned(),
        name: "sequencer".to_owned(),
        namespace: String::new(),
        parameter_files: vec![],
        parameters: vec![file("machine_file", &machine), file("plan_file", &plan)],
        ends_within: None,
        place: String::new(),
    })
}

/// Builds a node as a run would, or reads its parameters where building would open something.
fn built(node: &LaunchNode) -> Result<()> {
    let build = node::builder(&node.exec).with_context(|| {
        format!(
            "launch file: exec=\"{}\": there is no such node (nodes: {})",
            node.exec,
            node::names()
        )
    })?;
    let setup = node.setup()?;
    if !OPENING.contains(&node.exec.as_str()) {
        return build(&setup).map(drop);
    }
    let parameters = setup.resolved_by(build)?;
    for key in ["machine_file", "map_file"] {
        let is_given = parameters.iter().any(|parameter| {
            let is_empty = matches!(&parameter.value, node_runtime::parameter::Value::String(path) if path.is_empty());
            parameter.name == key && !is_empty
        });
        if is_given {
            setup.file_text(key)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_names_a_file_by_its_whole_path() {
        let path = Path::new("cell/probe.yaml");
        for message in [
            "cell/probe.yaml:3:7: period_s = 0 s",
            "parameters \"cell/probe.yaml\"",
            "in cell/probe.yaml.",
            "cell/probe.yaml",
        ] {
            assert!(names(message, path), "{message}");
        }
        for message in [
            "old/cell/probe.yaml:3:7: period_s = 0 s",
            "cell/probe.yaml.bak:1:1: no YAML",
            "cell/probe.yaml_2",
            "probe.yaml:3",
            "touch-cell/probe.yaml",
        ] {
            assert!(!names(message, path), "{message}");
        }
    }

    #[test]
    fn a_file_of_the_same_name_in_another_folder_is_another_file() {
        let home = tempfile::tempdir().unwrap();
        for folder in ["a", "b"] {
            std::fs::create_dir(home.path().join(folder)).unwrap();
            std::fs::write(home.path().join(folder).join("probe.yaml"), "").unwrap();
        }
        let [a, b] = ["a/probe.yaml", "b/probe.yaml"].map(|path| home.path().join(path));
        let node = LaunchNode {
            exec: "probe".to_owned(),
            name: "probe".to_owned(),
            namespace: String::new(),
            parameter_files: vec![home.path().join("b/../a/probe.yaml")],
            parameters: vec![],
            ends_within: None,
            place: String::new(),
        };
        assert!(is_read(std::slice::from_ref(&node), &a));
        assert!(!is_read(&[node], &b));
        let message = format!(
            "{}: no YAML",
            home.path().join("b/../a/probe.yaml").display()
        );
        assert!(names(&message, &a) && !names(&message, &b));
    }
}
