//! Makes the Rust types, schema texts and type hashes from the `.msg`, `.srv` and `.action` files.
//!
//! `msg/`, `srv/` and `action/` are this package's own interfaces (colcon builds the same files);
//! `standard/<package>/` holds the interfaces of ROS 2 Jazzy that Abbe uses. `ros2msg` parses both.

#![expect(
    clippy::disallowed_methods,
    clippy::print_stdout,
    reason = "a build script reads files and cargo's variables and answers on stdout"
)]

mod interface;
mod rust_code;
mod schema;
mod type_hash;
mod type_text;

use std::env;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

use interface::Interfaces;

/// Packages whose interfaces are emitted at the crate's root rather than in a module of their name.
const OWN_PACKAGE: &str = "abbe_msgs";

fn main() -> Result<()> {
    let root = env::var("CARGO_MANIFEST_DIR").context("cargo sets CARGO_MANIFEST_DIR")?;
    let root = Path::new(&root);
    let mut interfaces = Interfaces::default();
    read_package(&mut interfaces, OWN_PACKAGE, root)?;
    let standard = root.join("standard");
    for package in sorted_entries(&standard)? {
        read_package(&mut interfaces, &package, &standard.join(&package))?;
    }
    interfaces.check_references()?;
    let out = env::var("OUT_DIR").context("cargo sets OUT_DIR")?;
    let out = Path::new(&out).join("interfaces.rs");
    let code = rust_code::emit(&interfaces, OWN_PACKAGE) + &type_text::emit(&interfaces);
    fs::write(&out, code).with_context(|| format!("writing {}", out.display()))
}

fn watch(folder: &Path) {
    println!("cargo::rerun-if-changed={}", folder.display());
}

fn read_package(interfaces: &mut Interfaces, package: &str, parent: &Path) -> Result<()> {
    for kind in ["msg", "srv", "action"] {
        let folder = parent.join(kind);
        if !folder.is_dir() {
            // To watch what is not there would make every build begin anew: its parent is watched for it.
            watch(parent);
            continue;
        }
        watch(&folder);
        for file in sorted_entries(&folder)? {
            let path = folder.join(&file);
            let place = || format!("reading {}", path.display());
            let text = fs::read_to_string(&path).with_context(place)?;
            let name = file
                .strip_suffix(&format!(".{kind}"))
                .with_context(|| format!("{}: must end in .{kind}", path.display()))?;
            match kind {
                "msg" => interfaces.add_message_file(package, name, &text),
                "srv" => interfaces.add_service_file(package, name, &text),
                _ => interfaces.add_action_file(package, name, &text),
            }
            .with_context(place)?;
        }
    }
    Ok(())
}

/// Names in a folder, sorted so that the output does not depend on the file system.
fn sorted_entries(folder: &Path) -> Result<Vec<String>> {
    let place = || format!("listing {}", folder.display());
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).with_context(place)? {
        names.push(
            entry
                .with_context(place)?
                .file_name()
                .to_string_lossy()
                .into_owned(),
        );
    }
    names.sort();
    Ok(names)
}
