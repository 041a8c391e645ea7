//! The Python in which the peers are installed.

use std::path::{Path, PathBuf};
use std::process::Command;

/// A command that runs a script of tests/peers, or `None`, having said so, where there is no Python.
pub fn peer(script: &str) -> Option<Command> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let python = std::env::var("ABBE_PYTHON");
    let python = python.map_or_else(|_| root.join(".venv/bin/python"), PathBuf::from);
    if !python.exists() {
        let python = python.display();
        println!("peer not run: no {python} (set ABBE_PYTHON, or let tests/run install it)");
        return None;
    }
    let mut command = Command::new(python);
    command.arg(root.join("tests/peers").join(script));
    Some(command)
}
