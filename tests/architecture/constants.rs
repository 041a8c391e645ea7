//! A constant's name says of what: within a crate, one bare name has one value.

use std::collections::BTreeMap;

use crate::check;
use crate::source::{Source, sources};
use crate::tree;

/// Values of a name, each with the places that have it.
type Values = BTreeMap<String, Vec<String>>;

/// The folder of the crate that a file belongs to.
fn crate_of(path: &str) -> &str {
    path.split_once("/src/").map_or(path, |(folder, _)| folder)
}

/// Names that have several values in one crate; a constant of a type is named by its type and is none of them.
fn ambiguous<'s>(files: impl Iterator<Item = (&'s str, &'s Source)>) -> Vec<String> {
    let mut known: BTreeMap<(&str, &str), Values> = BTreeMap::new();
    for (path, source) in files {
        for constant in &source.constants {
            let values = known
                .entry((crate_of(path), constant.name.text.as_str()))
                .or_default();
            let place = format!("{path}:{}", constant.name.line);
            values
                .entry(constant.value.clone())
                .or_default()
                .push(place);
        }
    }
    let several = known.into_iter().filter(|(_, values)| values.len() > 1);
    let line = |((folder, name), values): ((&str, &str), Values)| {
        let places: Vec<String> = values.into_values().flatten().collect();
        format!(
            "{folder}: {name} has several values, at {}: name each after its use",
            places.join(" and ")
        )
    };
    several.map(line).collect()
}

#[test]
fn arch_a_constants_name_has_one_value_in_a_crate() {
    let mut all = sources("nodes");
    all.extend(sources("msgs/src"));
    let files = || all.iter().map(|(path, source)| (path.as_str(), source));
    let counted: usize = files().map(|(_, source)| source.constants.len()).sum();
    assert!(counted > 1_000, "{counted} constants");
    assert!(tree::has(crate_of(&all[0].0)));
    check(&ambiguous(files()));
    let a = Source::parse(
        "const LEAST_D: f64 = 3.0;\nconst N: usize = 1_000;\nimpl A { const ALL: u8 = 1; }\nfn f() { const K: [u8; 2] = [1, 2]; }",
    );
    let b = Source::parse(
        "pub const LEAST_D: f64 = 6.0;\nconst N: u32 = 1000;\nimpl B { const ALL: u8 = 2; }\nconst K: [u8; 2] = [\n    1,\n    2,\n];",
    );
    let files = [("a/src/a.rs", &a), ("a/src/b.rs", &b), ("c/src/b.rs", &b)];
    assert_eq!(
        ambiguous(files.into_iter()),
        [
            "a: LEAST_D has several values, at a/src/a.rs:1 and a/src/b.rs:1: name each after its use"
        ]
    );
}
