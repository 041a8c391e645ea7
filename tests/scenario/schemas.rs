//! The JSON Schemas of `abbe schema` take every file of the repository, by PyPI jsonschema, and refuse spoiled ones.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use abbe_tests::program::{as_given, root};
use abbe_tests::python::{interpreter, script, succeeded};
use metrology::yaml;
use serde_json::{Value, json};
use tempfile::TempDir;
use walkdir::WalkDir;

/// Folders with files that people write.
const FOLDERS: [&str; 4] = ["bags", "launch_configs", "nodes", "tests"];
/// Schemas, each with a key that only its files have at the top, and how many files there are at least.
const SCHEMAS: [(&str, &str, usize); 6] = [
    ("machine", "chain:", 21),
    ("plan", "steps:", 23),
    ("scenario", "limit_min:", 18),
    ("limits", "limits:", 1),
    ("budget", "misalignment_mm:", 5),
    ("import-map", "test:", 5),
];

/// The schema of a file, by its name or else by its keys.
fn schema_of(path: &Path, text: &str) -> Option<&'static str> {
    let stem = path.file_stem().unwrap().to_string_lossy();
    let by_name = SCHEMAS.iter().find(|(name, ..)| *name == stem);
    let has = |key: &str| text.lines().any(|line| line.starts_with(key));
    let found = by_name.or_else(|| SCHEMAS.iter().find(|(_, key, _)| has(key)));
    found.map(|(name, ..)| *name)
}

/// Every file that has a schema, by its name.
fn files() -> BTreeMap<&'static str, Vec<(PathBuf, Value)>> {
    let mut files: BTreeMap<&str, Vec<(PathBuf, Value)>> = BTreeMap::new();
    for folder in FOLDERS {
        for entry in WalkDir::new(root().join(folder)).sort_by_file_name() {
            let path = entry.unwrap().into_path();
            if path.extension().is_none_or(|extension| extension != "yaml") {
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            if let Some(name) = schema_of(&path, &text) {
                let value = yaml::read_letters(&text).unwrap();
                files.entry(name).or_default().push((path, value));
            }
        }
    }
    files
}

/// What is wrong with JSON values by a schema, one line each with the number of the value.
fn errors(python: &PathBuf, home: &TempDir, name: &str, values: &[Value]) -> Vec<String> {
    let printed = as_given(0, &["schema", name]).output().unwrap();
    let schema = home.path().join(format!("{name}.json"));
    std::fs::write(&schema, succeeded(&printed)).unwrap();
    let mut validate = script(python, "validate_json.py");
    validate.arg(&schema);
    for (number, value) in values.iter().enumerate() {
        let path = home.path().join(format!("{name}_{number}.json"));
        std::fs::write(&path, value.to_string()).unwrap();
        validate.arg(path);
    }
    let lines = succeeded(&validate.output().unwrap());
    lines.lines().map(str::to_owned).collect()
}

#[test]
fn every_file_of_the_repository_is_as_its_schema_says() {
    let Some(python) = interpreter("files by their schemas and PyPI jsonschema") else {
        return;
    };
    let files = files();
    for (name, _, least) in SCHEMAS {
        let home = tempfile::tempdir().unwrap();
        let (paths, values): (Vec<&PathBuf>, Vec<Value>) = { files[name].iter() }
            .map(|(path, value)| (path, value.clone()))
            .unzip();
        assert!(values.len() >= least, "{name}: {paths:?}");
        let found = errors(&python, &home, name, &values);
        assert_eq!(found, Vec::<String>::new(), "{name}: {paths:#?}");
    }
}

/// A value with one of its keys, by a JSON pointer, replaced.
fn with(value: &Value, pointer: &str, new: Value) -> Value {
    let mut spoiled = value.clone();
    *spoiled.pointer_mut(pointer).unwrap() = new;
    spoiled
}

/// A value with one more key at the top.
fn with_more(value: &Value) -> Value {
    let mut spoiled = value.clone();
    spoiled["unheard_of"] = json!(1);
    spoiled
}

#[test]
fn spoiled_files_are_refused_with_their_place() {
    let Some(python) = interpreter("spoiled files by their schemas and PyPI jsonschema") else {
        return;
    };
    let files = files();
    let own = |(_, value): &&(PathBuf, Value)| value.get("base").is_none();
    let first = |name: &str| files[name].iter().find(own).unwrap().1.clone();
    let spoiled = [
        (
            "machine",
            with(&first("machine"), "/axes/X/travel_mm", json!([1.0])),
            "$.axes.X",
        ),
        (
            "machine",
            with(&first("machine"), "/axes/X", json!({"travel_deg": [0, 1]})),
            "$.axes.X",
        ),
        (
            "machine",
            json!({"base": "../first_run/machine.yaml", "name": "mill"}),
            "$",
        ),
        (
            "plan",
            with(&first("plan"), "/steps/0/do", json!("dance")),
            "$.steps[0]",
        ),
        (
            "scenario",
            with(&first("scenario"), "/report", json!("all")),
            "$.report",
        ),
        (
            "limits",
            with(&first("limits"), "/rule", json!("by eye")),
            "$.rule",
        ),
        (
            "budget",
            with(&first("budget"), "/misalignment_mm", json!("none")),
            "$.misalignment_mm",
        ),
        (
            "import-map",
            with(&first("import-map"), "/start_s", json!(0.5)),
            "$.start_s",
        ),
    ];
    for (name, value, place) in spoiled {
        let home = tempfile::tempdir().unwrap();
        let found = errors(&python, &home, name, &[value, with_more(&first(name))]);
        let is_at = |line: &String, place: &str| line.contains(&format!(".json: {place}"));
        assert!(
            found.iter().any(|line| is_at(line, place)),
            "{name}: {found:#?}"
        );
        let unknown = found.iter().find(|line| line.contains("unheard_of"));
        assert!(unknown.is_some(), "{name}: {found:#?}");
    }
}
