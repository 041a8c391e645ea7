//! Makes the Rust types, schema texts and type hashes from the `.msg`, `.srv` and `.action` files.
//!
//! `msg/`, `srv/` and `action/` are this package's own interfaces (colcon builds the same files);
//! `standard/<package>/` holds the interfaces of ROS 2 Jazzy that Abbe uses, `standard_lyrical/<package>/` those that
//! Lyrical defines otherwise. `ros2msg` parses all.

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

use std::collections::BTreeSet;
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
    read_packages(&mut interfaces, &root.join("standard"))?;
    interfaces.check_references()?;
    let mut code =
        rust_code::emit(&interfaces, OWN_PACKAGE) + &type_text::emit(&interfaces, |_| true);
    let changed = read_packages(&mut interfaces, &root.join("standard_lyrical"))?;
    code += &emit_release("lyrical", "Lyrical", &interfaces, &changed)?;
    let out = env::var("OUT_DIR").context("cargo sets OUT_DIR")?;
    let out = Path::new(&out).join("interfaces.rs");
    fs::write(&out, code).with_context(|| format!("writing {}", out.display()))
}

/// A module with the messages that a later release of ROS 2 defines otherwise.
fn emit_release(
    module: &str,
    release: &str,
    interfaces: &Interfaces,
    changed: &BTreeSet<String>,
) -> Result<String> {
    interfaces.check_references()?;
    interfaces.check_unreferenced(changed)?;
    let code = rust_code::emit_messages(interfaces, changed);
    let parts = type_text::emit(interfaces, |name| changed.contains(name));
    Ok(format!(
        "/// Messages that ROS 2 {release} defines otherwise.\npub mod {module} {{\n{code}{parts}}}\n"
    ))
}

/// Reads every package of `folder`; the full names of its messages.
fn read_packages(interfaces: &mut Interfaces, folder: &Path) -> Result<BTreeSet<String>> {
    watch(folder);
    let mut names = BTreeSet::new();
    for package in sorted_entries(folder)? {
        names.extend(read_package(interfaces, &package, &folder.join(&package))?);
    }
    Ok(names)
}

fn watch(folder: &Path) {
    println!("cargo::rerun-if-changed={}", folder.display());
}

fn read_package(
    interfaces: &mut Interfaces,
    package: &str,
    parent: &Path,
) -> Result<BTreeSet<String>> {
    let mut names = BTreeSet::new();
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
            names.insert(format!("{package}/{kind}/{name}"));
        }
    }
    Ok(names)
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
