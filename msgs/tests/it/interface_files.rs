//! The interface package itself: every field explained, every dependency declared.

#![expect(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    reason = "reads the package's own files to check them and fails by panicking"
)]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

const NUMBERS: [&str; 12] = [
    "byte", "char", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64",
    "float32", "float64",
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: impl AsRef<Path>) -> String {
    let path = root().join(path);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// This package's own .msg, .srv and .action files.
fn files() -> Vec<PathBuf> {
    let mut files = Vec::new();
    for kind in ["msg", "srv", "action"] {
        let Ok(folder) = fs::read_dir(root().join(kind)) else {
            continue;
        };
        files.extend(folder.map(|entry| entry.unwrap().path()));
    }
    assert!(files.len() > 12, "{files:?}");
    files
}

struct FieldLine {
    kind: String,
    name: String,
    comment: String,
    constants: Vec<String>,
}

/// Fields of a file with the comment above each and the constants of its part.
fn fields(path: &Path) -> Vec<FieldLine> {
    let (mut fields, mut comment, mut constants) = (Vec::new(), String::new(), Vec::new());
    for line in read(path).lines().map(str::trim) {
        if let Some(words) = line.strip_prefix('#') {
            comment.push_str(words);
        } else if line == "---" {
            constants.clear();
            comment.clear();
        } else if line.is_empty() {
            comment.clear();
        } else if let Some((left, _)) = line.split_once('=').filter(|_| !line.contains("<=")) {
            constants.push(left.split_whitespace().last().unwrap().to_owned());
            comment.clear();
        } else {
            let mut words = line.split_whitespace().map(str::to_owned);
            fields.push(FieldLine {
                kind: words.next().unwrap(),
                name: words.next().unwrap(),
                comment: std::mem::take(&mut comment),
                constants: constants.clone(),
            });
        }
    }
    fields
}

/// Whether the comment names constants that the file has, such as `one of STATE_*`.
fn names_constants(field: &FieldLine) -> bool {
    let Some((_, after)) = field.comment.split_once("one of ") else {
        return false;
    };
    let prefix = after.split('*').next().unwrap_or_default();
    let found = field.constants.iter().any(|name| name.starts_with(prefix));
    prefix.ends_with('_') && found
}

#[test]
fn arch_every_field_has_a_comment_and_every_number_a_unit() {
    let mut n_fields = 0;
    for path in files() {
        for field in fields(&path) {
            let place = format!("{}: {}", path.display(), field.name);
            assert!(!field.comment.trim().is_empty(), "{place}: no comment");
            let base = field.kind.split('[').next().unwrap_or_default();
            let has_unit = field.comment.contains('[') && field.comment.ends_with(']');
            if NUMBERS.contains(&base) {
                assert!(
                    has_unit || names_constants(&field),
                    "{place}: no [unit] at the end of \"{}\" and no constants",
                    field.comment
                );
            }
            n_fields += 1;
        }
    }
    assert!(n_fields > 100, "{n_fields}");
}

#[test]
fn arch_every_file_opens_with_what_it_is() {
    for path in files() {
        let text = read(&path);
        let mut lines = text.lines();
        let first = lines.next().unwrap_or_default();
        assert!(
            first.starts_with("# ") && first.ends_with('.'),
            "{}",
            path.display()
        );
        assert_eq!(lines.next(), Some(""), "{}", path.display());
    }
}

#[test]
fn arch_package_and_cmake_name_every_package_that_is_used() {
    let mut used = BTreeSet::from(["action_msgs".to_owned()]);
    for path in files() {
        for field in fields(&path) {
            if let Some((package, _)) = field.kind.split_once('/') {
                used.insert(package.to_owned());
            }
        }
    }
    let package = read("package.xml");
    let declared: BTreeSet<_> = package
        .lines()
        .filter_map(|line| {
            line.trim()
                .strip_prefix("<depend>")?
                .strip_suffix("</depend>")
        })
        .map(str::to_owned)
        .collect();
    assert_eq!(declared, used);
    let cmake = read("CMakeLists.txt");
    let found: BTreeSet<_> = cmake
        .lines()
        .filter_map(|line| {
            line.strip_prefix("find_package(")?
                .strip_suffix(" REQUIRED)")
        })
        .filter(|name| !["ament_cmake", "rosidl_default_generators"].contains(name))
        .map(str::to_owned)
        .collect();
    assert_eq!(found, used);
    let (_, after) = cmake.split_once("DEPENDENCIES ").unwrap();
    let (listed, _) = after.split_once(')').unwrap();
    let listed: BTreeSet<_> = listed.split_whitespace().map(str::to_owned).collect();
    assert_eq!(listed, used);
    assert!(cmake.contains("msg/*.msg srv/*.srv action/*.action"));
    let name = format!("<name>{}</name>", env!("CARGO_PKG_NAME"));
    assert!(package.contains(&name));
    assert!(package.contains(&format!("<version>{}</version>", env!("CARGO_PKG_VERSION"))));
}

#[test]
fn arch_the_standard_packages_are_no_ros_packages_of_their_own() {
    for entry in fs::read_dir(root().join("standard")).unwrap() {
        let folder = entry.unwrap().path();
        // colcon would build a second std_msgs.
        assert!(!folder.join("package.xml").exists(), "{}", folder.display());
    }
}

#[test]
fn what_the_generator_watches_is_there_so_that_a_second_build_has_nothing_to_do() {
    let said = Path::new(env!("OUT_DIR")).with_file_name("output");
    let said = fs::read_to_string(&said).unwrap();
    let watched: Vec<&str> = said
        .lines()
        .filter_map(|line| line.strip_prefix("cargo::rerun-if-changed="))
        .collect();
    assert!(watched.len() > 10, "{said}");
    for path in watched {
        assert!(Path::new(path).exists(), "{path}");
    }
}
