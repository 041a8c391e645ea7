//! Bags of the tree are of older builds than this one, and are never recorded anew.

use std::path::{Path, PathBuf};

use abbe_tests::program::root;
use sha2::{Digest, Sha256};

use crate::contract::check;
use crate::other_recorders::is_of_another;

/// Bags of format 1 and the SHA-256 of their `bag_0.mcap`. A line that is here stays as it is.
const FORMAT_V1: &[(&str, &str)] = &[
    (
        "cold_reference",
        "fe8e36ae63b4a8605567f05b7c55cdcf80b633ee7cc8d1cc0319d239e7fe19a7",
    ),
    (
        "dual_loop",
        "d4b812ea6cd7dcac3836d55b13cea92df456691c39dc4d05de30e91d9119d7ae",
    ),
    (
        "grid_circles",
        "bac9d621c16b859ef2e7bf4d0bedacb207a791a27159a4cf19c16579f3198dfe",
    ),
    (
        "host_clocks",
        "1d0410e62c31ff9dcb5fab91dd19d56d37e74021f6d34fdc6bfb212be41aa259",
    ),
    (
        "lifecycle",
        "d3098feb781d474ae3e18a49f1c92e605d0a37a04c80faa72c6ecfa1f0f4d51b",
    ),
    (
        "rotary_sphere",
        "2b5c6a716b7af07ae482bb655fb5a96eedca9990277c5d4213857af336d08ac0",
    ),
];

/// The folders in `bags/` that our own recorder wrote.
pub fn kept() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(root().join("bags")).unwrap();
    let mut folders: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    folders.retain(|path| path.is_dir() && !is_of_another(path));
    folders.sort();
    folders
}

/// SHA-256 of a file, in hexadecimal digits.
pub fn sha256(file: &Path) -> String {
    let digits = Sha256::digest(std::fs::read(file).unwrap());
    digits.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn compat_format_v1_replays() {
    for bag in kept() {
        let (code, outcome) = check(&bag);
        assert_eq!(code, 0, "{}: {outcome:#}", bag.display());
        let compared = outcome["compared"].as_object().unwrap();
        assert!(!compared.is_empty(), "{}", bag.display());
    }
}

#[test]
fn compat_format_v1_bags_are_never_recorded_anew() {
    let readme = std::fs::read_to_string(root().join("bags/README.md")).unwrap();
    for (name, expected) in FORMAT_V1 {
        let file = root().join("bags").join(name).join("bag_0.mcap");
        assert_eq!(sha256(&file), *expected, "bags/{name} is another file");
        assert!(readme.contains(expected), "bags/README.md: {name}");
    }
    let names: Vec<_> = kept();
    assert_eq!(
        names.len(),
        FORMAT_V1.len(),
        "a bag without a line here: {names:?}"
    );
}
