//! Folder = crate = node; every node has the same files; files are small and named after ideas.

use std::path::Path;

use crate::check;
use crate::packages::{self, Package, Target};
use crate::source::sources;
use crate::tree::{self, File};

/// Longest file, lines.
const LONGEST_FILE: usize = 600;
/// Longest table of topics, lines.
const LONGEST_SHELL: usize = 80;

fn misnamed(member: &Package, targets: &[Target]) -> Vec<String> {
    let folder = member.folder();
    let Some(below) = folder.strip_prefix("nodes/") else {
        return Vec::new();
    };
    let mut found = Vec::new();
    let below = below.strip_prefix("libraries/").unwrap_or(below);
    let (node, is_shell) = match below.strip_suffix("/node") {
        Some(node) => (node, true),
        None => (below, false),
    };
    let name = if is_shell {
        format!("{node}_node")
    } else {
        node.to_owned()
    };
    if member.name != name {
        found.push(format!("{folder}: crate {}: must be {name}", member.name));
    }
    let is_bin = |target: &&Target| target.kind.iter().any(|kind| kind == "bin");
    let bins: Vec<&str> = targets
        .iter()
        .filter(is_bin)
        .map(|target| target.name.as_str())
        .collect();
    if is_shell && !bins.is_empty() {
        found.push(format!(
            "{folder}: programs {bins:?}: `abbe node {node}` is the only one"
        ));
    }
    found
}

#[test]
fn arch_folder_crate_and_program_have_one_name() {
    let members = packages::members();
    let found = members
        .iter()
        .flat_map(|member| misnamed(member, &member.targets));
    check(&found.collect::<Vec<_>>());
    let mut bad = packages::example("nodes/probe/node", &[]);
    bad.name = "probe_shell".to_owned();
    let program = Target {
        name: "probe".to_owned(),
        kind: vec!["bin".to_owned()],
    };
    assert_eq!(
        misnamed(&bad, &[program]),
        [
            "nodes/probe/node: crate probe_shell: must be probe_node",
            "nodes/probe/node: programs [\"probe\"]: `abbe node probe` is the only one",
        ]
    );
}

/// Folders of `nodes/` that are neither a node, a program nor the libraries, and those that its README lacks.
fn misplaced(
    folders: &[String],
    nodes: &[String],
    libraries: &[String],
    readme: &str,
) -> Vec<String> {
    let is_known = |name: &&String| {
        nodes.contains(name) || ["abbe", "abbe_trials", "libraries"].contains(&name.as_str())
    };
    let unknown = folders.iter().filter(|name| !is_known(name)).map(|name| {
        format!(
            "nodes/{name}: no node/ in it: a library belongs to {}",
            tree::LIBRARIES
        )
    });
    let shared = libraries.iter().map(|name| format!("libraries/{name}"));
    let listed = folders.iter().filter(|name| *name != "libraries").cloned();
    let is_absent = |name: &String| !readme.contains(&format!("| [`{name}`]({name}/"));
    let absent = listed.chain(shared).filter(is_absent);
    let absent = absent.map(|name| format!("nodes/README.md: no row of {name}"));
    unknown.chain(absent).collect()
}

#[test]
fn arch_nodes_and_libraries_stand_apart() {
    let libraries = tree::folders(tree::LIBRARIES);
    assert!(libraries.contains(&"metrology".to_owned()));
    let readme = tree::text("nodes/README.md").unwrap();
    check(&misplaced(
        &tree::folders("nodes"),
        &tree::nodes(),
        &libraries,
        &readme,
    ));
    let names = |names: &[&str]| {
        names
            .iter()
            .map(|name| (*name).to_owned())
            .collect::<Vec<_>>()
    };
    assert_eq!(
        misplaced(
            &names(&["fits", "libraries", "probe"]),
            &names(&["probe"]),
            &names(&["machine"]),
            "| [`fits`](fits/README.md) | x |\n",
        ),
        [
            "nodes/fits: no node/ in it: a library belongs to nodes/libraries",
            "nodes/README.md: no row of probe",
            "nodes/README.md: no row of libraries/machine",
        ]
    );
}

fn missing_files(node: &str, has_stage: bool, has: &dyn Fn(&str) -> bool) -> Vec<String> {
    let stage: &[&str] = if has_stage {
        &["src/config.rs", "src/stage.rs", "src/error.rs"]
    } else {
        &[]
    };
    ["README.md", "node/src/lib.rs"]
        .iter()
        .chain(stage)
        .map(|file| format!("nodes/{node}/{file}"))
        .filter(|path| !has(path))
        .map(|path| format!("{path}: is missing"))
        .collect()
}

#[test]
fn arch_every_node_has_the_same_files() {
    let mut found = Vec::new();
    for node in tree::nodes() {
        let sources = sources(&format!("nodes/{node}/src"));
        let is_stage = |name: &String| name == "Stage";
        let has_stage = sources
            .iter()
            .any(|(_, source)| source.implemented.iter().any(is_stage));
        found.extend(missing_files(&node, has_stage, &tree::has));
    }
    check(&found);
    assert_eq!(missing_files("probe", true, &|_| false).len(), 5);
    assert_eq!(
        missing_files("probe", false, &|path| !path.ends_with(".md")),
        ["nodes/probe/README.md: is missing"]
    );
}

fn too_long(file: &File, limit: usize) -> Option<String> {
    let lines = file.text.lines().count();
    (lines > limit).then(|| format!("{}: {lines} lines: at most {limit}", file.path))
}

#[test]
fn arch_no_file_is_over_600_lines() {
    let mut files = tree::files("", ".rs");
    files.extend(tree::files("", ".py"));
    check(
        &files
            .iter()
            .filter_map(|file| too_long(file, LONGEST_FILE))
            .collect::<Vec<_>>(),
    );
    let bad = File {
        path: "a.rs".to_owned(),
        text: "\n".repeat(601),
    };
    assert_eq!(
        too_long(&bad, LONGEST_FILE).unwrap(),
        "a.rs: 601 lines: at most 600"
    );
}

#[test]
fn arch_no_shell_is_over_80_lines() {
    let shells = tree::nodes()
        .into_iter()
        .map(|node| format!("nodes/{node}/node/src/lib.rs"));
    let files = shells.filter_map(|path| {
        Some(File {
            text: tree::text(&path)?,
            path,
        })
    });
    check(
        &files
            .filter_map(|file| too_long(&file, LONGEST_SHELL))
            .collect::<Vec<_>>(),
    );
    let bad = File {
        path: "a.rs".to_owned(),
        text: "\n".repeat(81),
    };
    assert!(too_long(&bad, LONGEST_SHELL).is_some());
}

/// Names that say nothing of what is in a module.
const EMPTY_NAMES: [&str; 9] = [
    "utils", "util", "common", "helpers", "helper", "types", "manager", "misc", "mod",
];

fn empty_name(path: &str) -> Option<String> {
    let parts: Vec<&str> = path.trim_end_matches(".rs").split('/').collect();
    let bad = parts.iter().find(|part| EMPTY_NAMES.contains(part))?;
    Some(format!("{path}: \"{bad}\" says nothing of what is in it"))
}

#[test]
fn arch_modules_are_named_after_ideas() {
    let rust = tree::paths("")
        .into_iter()
        .filter(|path| path.ends_with(".rs"));
    check(
        &rust
            .filter_map(|path| empty_name(&path))
            .collect::<Vec<_>>(),
    );
    assert!(empty_name("nodes/probe/src/utils/a.rs").is_some());
    assert!(empty_name("nodes/probe/src/queue/mod.rs").is_some());
    assert!(empty_name("msgs/src/action_types.rs").is_none());
}

/// What colcon would find in the folder of a Cargo.toml beside the packages that are meant for it.
fn crawled(manifest: &str, has: &dyn Fn(&str) -> bool) -> Option<String> {
    // The root's own is that of the workspace, which is no package.
    let folder = manifest.strip_suffix("/Cargo.toml")?;
    let holds = |folder: &Path, file: &str| folder.join(file).to_str().is_some_and(has);
    let mut above = Path::new(folder).ancestors();
    let is_passed_over = above.any(|folder| holds(folder, "COLCON_IGNORE"));
    let is_meant = holds(Path::new(folder), "package.xml");
    (is_meant == is_passed_over).then(|| {
        let wrong = if is_meant {
            "a package.xml that colcon passes over: no COLCON_IGNORE may stand here or above"
        } else {
            "colcon takes it for a package: COLCON_IGNORE is missing"
        };
        format!("{folder}: {wrong}")
    })
}

#[test]
fn arch_colcon_finds_its_packages_and_no_other_crate() {
    let all = tree::paths("");
    let manifests = all.iter().filter(|path| path.ends_with("Cargo.toml"));
    let found = manifests.filter_map(|manifest| crawled(manifest, &tree::has));
    check(&found.collect::<Vec<_>>());
    let packages = all.iter().filter(|path| path.ends_with("package.xml"));
    assert_eq!(
        packages.collect::<Vec<_>>(),
        ["msgs/package.xml", "nodes/abbe/package.xml"]
    );
    let node = "nodes/probe/node/Cargo.toml";
    assert_eq!(
        crawled(node, &|_| false).unwrap(),
        "nodes/probe/node: colcon takes it for a package: COLCON_IGNORE is missing"
    );
    assert!(crawled(node, &|path| path == "nodes/probe/COLCON_IGNORE").is_none());
    assert!(crawled("msgs/Cargo.toml", &|path| path == "msgs/package.xml").is_none());
    let hidden = crawled("msgs/Cargo.toml", &|path| path != "msgs/COLCON_IGNORE");
    assert!(hidden.unwrap().starts_with("msgs: a package.xml"));
}
