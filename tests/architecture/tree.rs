//! The files of the tree, without what is built or ignored.

use std::path::{Path, PathBuf};

use walkdir::WalkDir;

/// Crates without clock, file, environment, entropy, log or ROS.
pub const PURE: [&str; 17] = [
    "metrology",
    "iso230",
    "machine",
    "twin",
    "control_tables",
    "machine_frames",
    "probe",
    "host_clock",
    "latency_calibrator",
    "thermal_model",
    "grid_encoder",
    "axis_compensation",
    "rotary_axes",
    "sequencer",
    "gap_diagnosis",
    "fake_cnc",
    "trials",
];

/// Folders that no file of the project is in.
const OUTSIDE: [&str; 5] = ["target", "runs", ".git", ".venv", "__pycache__"];

/// One file.
pub struct File {
    /// Path below the root, with slashes.
    pub path: String,
    /// Its text.
    pub text: String,
}

/// The root of the workspace.
pub fn root() -> PathBuf {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    tests.parent().unwrap().to_owned()
}

/// Paths of all files below `folder` of the root, in order; empty when there is no such folder.
pub fn paths(folder: &str) -> Vec<String> {
    let root = root();
    let start = root.join(folder);
    if !start.exists() {
        return Vec::new();
    }
    WalkDir::new(start)
        .sort_by_file_name()
        .into_iter()
        .filter_entry(|entry| {
            let name = entry.file_name().to_string_lossy();
            !OUTSIDE.contains(&name.as_ref())
        })
        .map(|entry| entry.unwrap())
        .filter(|entry| entry.file_type().is_file())
        .map(|entry| {
            let path = entry.path().strip_prefix(&root).unwrap();
            path.to_string_lossy().replace('\\', "/")
        })
        .collect()
}

/// All files below `folder` whose names end with `ending` and which are text.
pub fn files(folder: &str, ending: &str) -> Vec<File> {
    let text = |path: String| {
        let bytes = std::fs::read(root().join(&path)).unwrap();
        let text = String::from_utf8(bytes).ok()?;
        Some(File { path, text })
    };
    paths(folder)
        .into_iter()
        .filter(|path| path.ends_with(ending))
        .filter_map(text)
        .collect()
}

/// One file by its path below the root; `None` when it is not there.
pub fn text(path: &str) -> Option<String> {
    std::fs::read_to_string(root().join(path)).ok()
}

/// Whether a file or folder is there.
pub fn has(path: &str) -> bool {
    root().join(path).exists()
}

/// Names of the folders in `folder` of the root, in order.
pub fn folders(folder: &str) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(root().join(folder)) else {
        return Vec::new();
    };
    let mut names: Vec<_> = entries
        .map(|entry| entry.unwrap())
        .filter(|entry| entry.path().is_dir())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .filter(|name| !OUTSIDE.contains(&name.as_str()))
        .collect();
    names.sort();
    names
}

/// Folders in `nodes/` that are ROS nodes: those with a shell.
pub fn nodes() -> Vec<String> {
    folders("nodes")
        .into_iter()
        .filter(|name| has(&format!("nodes/{name}/node")))
        .collect()
}

/// Folder of libraries that nodes and programs share.
pub const LIBRARIES: &str = "nodes/libraries";

/// Folder of a crate that is a node's mathematics or a shared library.
pub fn folder_of(crate_name: &str) -> String {
    let shared = format!("{LIBRARIES}/{crate_name}");
    if has(&shared) {
        shared
    } else {
        format!("nodes/{crate_name}")
    }
}

#[test]
fn a_file_of_each_kind_is_found_and_nothing_built() {
    let all = paths("");
    for path in [
        "Cargo.toml",
        "nodes/libraries/metrology/src/lib.rs",
        "clippy.toml",
    ] {
        assert!(all.iter().any(|found| found == path), "{path}");
    }
    assert!(!all.iter().any(|path| path.starts_with("target/")));
    assert!(nodes().contains(&"thermal_model".to_owned()));
    assert!(paths("no_such_folder").is_empty());
}
