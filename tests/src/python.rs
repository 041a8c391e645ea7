//! Python with other people's software.

use std::path::PathBuf;
use std::process::{Command, Output};

use crate::program::root;

/// The interpreter that has the peers: `ABBE_PYTHON`, else `.venv/bin/python`.
///
/// Where there is none the test's name and the reason are printed, and `None` tells the test to end.
///
/// # Panics
/// When there is none and `CI=true`.
#[must_use]
pub fn interpreter(test: &str) -> Option<PathBuf> {
    let python = std::env::var("ABBE_PYTHON")
        .map_or_else(|_| root().join(".venv/bin/python"), PathBuf::from);
    let modules = "import asyncua, cyclonedds, jsonschema, mcap, mcap_ros2, numpy, rosbags, zenoh";
    let lack = match Command::new(&python).args(["-c", modules]).output() {
        Ok(output) if output.status.success() => return Some(python),
        Ok(output) => String::from_utf8_lossy(&output.stderr).trim().to_owned(),
        Err(error) => error.to_string(),
    };
    let reason = format!("{}: {lack} (tests/run installs it)", python.display());
    assert!(std::env::var("CI").as_deref() != Ok("true"), "{reason}");
    eprintln!("NOT TESTED: {test}: {reason}");
    None
}

/// A script of tests/peers with arguments.
#[must_use]
pub fn script(python: &PathBuf, name: &str) -> Command {
    let mut command = Command::new(python);
    command.arg(root().join("tests/peers").join(name));
    command
}

/// Its standard output.
///
/// # Panics
/// When it did not end with exit code 0.
#[must_use]
pub fn succeeded(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}{error}");
    text
}
