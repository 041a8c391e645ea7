//! `abbe install-ros PREFIX`: this program as an ament package, without colcon.
//!
//! `ros2 run abbe NODE` looks for `lib/abbe/NODE` below the prefixes that the ament index knows, and
//! `ros2 launch abbe FILE` for a file of that name below `share/abbe`. That is all that is made here.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::Args;
use node_runtime::text_file::{self, Comments};

use crate::tell::tell;
use crate::{launch, node};

/// Arguments of `abbe install-ros`.
#[derive(Args)]
pub struct InstallRos {
    /// Folder to install into; it is made, and may hold other packages.
    prefix: PathBuf,
    /// Folder of scenarios to install as launch files.
    #[arg(long, default_value = "launch_configs")]
    scenarios: PathBuf,
}

const PROGRAM: &str = "abbe";
const PACKAGE: &str = include_str!("../package.xml");
/// Starts the node that it is named after.
const NODE: &[u8] = include_bytes!("install_ros/node");
const SETUP: &str = include_str!("install_ros/local_setup.sh");
/// What `ros2` takes for a program.
const EXECUTABLE: u32 = 0o755;
const FILE_MODE: u32 = 0o644;

impl InstallRos {
    /// Installs; says what and how it is used.
    ///
    /// # Errors
    /// When a file cannot be written, or a scenario has no launch file that can be read.
    pub fn execute(self) -> Result<ExitCode> {
        let own = std::env::current_exe().context("this program's own file")?;
        fs::create_dir_all(&self.prefix)
            .with_context(|| format!("prefix {}", self.prefix.display()))?;
        let prefix = fs::canonicalize(&self.prefix)
            .with_context(|| format!("prefix {}", self.prefix.display()))?;
        let program = fs::read(&own).with_context(|| format!("reading {}", own.display()))?;
        let scenarios = scenarios(&self.scenarios)?;
        package(&prefix, &program)?;
        for scenario in &scenarios {
            let name = scenario.file_name().context("a scenario's folder")?;
            let to = prefix.join("share/abbe/launch_configs").join(name);
            copy_folder(scenario, &to)?;
        }
        setup(&prefix)?;
        tell!(
            "{} nodes and {} scenarios are in {}",
            node::NODES.len(),
            scenarios.len(),
            prefix.display()
        );
        tell!("  . {}/local_setup.sh", prefix.display());
        tell!("  ros2 run abbe probe --ros-args --params-file probe.yaml");
        if let Some(first) = scenarios.first() {
            let file = launch::find(first)?;
            let file = file.file_name().unwrap_or_default();
            tell!("  ros2 launch abbe {}", file.to_string_lossy());
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Folders of scenarios, each with a launch file that can be read.
fn scenarios(folder: &Path) -> Result<Vec<PathBuf>> {
    let place = || format!("--scenarios {}", folder.display());
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).with_context(place)? {
        let path = entry.with_context(place)?.path();
        if path.is_dir() {
            launch::read(&launch::find(&path)?)?;
            found.push(path);
        }
    }
    if found.is_empty() {
        bail!("{}: it holds no scenario", place());
    }
    found.sort();
    Ok(found)
}

fn package(prefix: &Path, program: &[u8]) -> Result<()> {
    let programs = prefix.join("lib").join(PROGRAM);
    put(&programs.join(PROGRAM), program, EXECUTABLE)?;
    for (name, _) in node::NODES {
        put(&programs.join(name), NODE, EXECUTABLE)?;
    }
    let index = prefix.join("share/ament_index/resource_index/packages");
    put(&index.join(PROGRAM), b"", FILE_MODE)?;
    let share = prefix.join("share").join(PROGRAM);
    put(&share.join("package.xml"), PACKAGE.as_bytes(), FILE_MODE)
}

/// Makes the prefix known to a shell, unless it is a workspace that has its own way.
fn setup(prefix: &Path) -> Result<()> {
    let path = prefix.join("local_setup.sh");
    let shown = prefix.display().to_string();
    if shown.contains('\'') {
        bail!("prefix {shown}: a quote in its name cannot stand in local_setup.sh");
    }
    let text = SETUP.replace("@PREFIX@", &shown);
    if text_file::read(&path, Comments::None).is_ok_and(|present| present != text) {
        return Ok(());
    }
    put(&path, text.as_bytes(), FILE_MODE)
}

fn copy_folder(from: &Path, to: &Path) -> Result<()> {
    let place = || format!("copying {}", from.display());
    for entry in fs::read_dir(from).with_context(place)? {
        let path = entry.with_context(place)?.path();
        let target = to.join(path.file_name().with_context(place)?);
        if path.is_dir() {
            copy_folder(&path, &target)?;
        } else {
            let mode = fs::metadata(&path)
                .with_context(place)?
                .permissions()
                .mode();
            put(&target, &text_file::bytes(&path)?, mode & 0o777)?;
        }
    }
    Ok(())
}

/// Writes a file beside its place and moves it there: a program that runs is not written into.
fn put(path: &Path, bytes: &[u8], mode: u32) -> Result<()> {
    let place = || format!("writing {}", path.display());
    let folder = path.parent().with_context(place)?;
    fs::create_dir_all(folder).with_context(place)?;
    let mut beside = path.as_os_str().to_owned();
    beside.push(".new");
    let put = fs::write(&beside, bytes)
        .and_then(|()| fs::set_permissions(&beside, fs::Permissions::from_mode(mode)))
        .and_then(|()| fs::rename(&beside, path));
    if put.is_err() {
        // What could not be written whole must not stay beside the old file.
        let _ = fs::remove_file(&beside);
    }
    put.with_context(place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_package_has_what_ros2_run_looks_for() {
        let prefix = tempfile::tempdir().unwrap();
        package(prefix.path(), b"#!/bin/sh\necho \"$@\"\n").unwrap();
        // Once more over itself: an update.
        package(prefix.path(), b"#!/bin/sh\necho \"$@\"\n").unwrap();
        let lib = prefix.path().join("lib/abbe");
        assert_eq!(
            fs::read_dir(&lib).unwrap().count(),
            node::NODES.len() + 1,
            "nothing is left beside"
        );
        let said = std::process::Command::new(lib.join("probe"))
            .args(["--ros-args", "-r", "__ns:=/a b"])
            .output()
            .unwrap();
        let said = String::from_utf8(said.stdout).unwrap();
        assert_eq!(said, "node probe --ros-args -r __ns:=/a b\n");
        let description = fs::read_to_string(prefix.path().join("share/abbe/package.xml")).unwrap();
        let document = roxmltree::Document::parse(&description).unwrap();
        let version = document
            .descendants()
            .find(|element| element.has_tag_name("version"));
        assert_eq!(version.unwrap().text(), Some(env!("CARGO_PKG_VERSION")));
        let marker = "share/ament_index/resource_index/packages/abbe";
        assert!(prefix.path().join(marker).is_file());
    }

    #[test]
    fn colcon_installs_the_same_nodes() {
        let manifest = include_str!("../Cargo.toml");
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("ament");
        for (name, _) in node::NODES {
            assert!(
                manifest.contains(&format!("    \"ament/{name}\",\n")),
                "{name}"
            );
            assert_eq!(fs::read(folder.join(name)).unwrap(), NODE, "{name}");
        }
        assert_eq!(fs::read_dir(folder).unwrap().count(), node::NODES.len());
    }

    #[test]
    fn a_setup_file_of_another_workspace_stays() {
        let prefix = tempfile::tempdir().unwrap();
        let path = prefix.path().join("local_setup.sh");
        fs::write(&path, "echo workspace\n").unwrap();
        setup(prefix.path()).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "echo workspace\n");
    }

    #[test]
    fn a_folder_without_scenarios_is_refused_by_name() {
        let empty = tempfile::tempdir().unwrap();
        let error = scenarios(empty.path()).unwrap_err().to_string();
        assert!(error.contains("it holds no scenario"), "{error}");
        fs::create_dir(empty.path().join("cell")).unwrap();
        let error = scenarios(empty.path()).unwrap_err().to_string();
        assert!(error.contains("cell: it has no *.launch.xml"), "{error}");
    }
}
