//! Every key of every kind of file that people write, spoiled in every way: the message names file, line, key and unit.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use fake_cnc::PlantFile;
use machine::MachineFile;
use metrology::number::unit_of;
use metrology::yaml::{self, Place, Places};
use mtconnect_bridge::mapping::MapFile;
use node_runtime::Setup;
use node_runtime::arguments::Arguments;
use reports::evaluate::budget::Budget;
use reports::evaluate::limits::Limits;
use sequencer::Plan;

use crate::import::map::Map;
use crate::node;
use crate::scenario::Scenario;

/// Reads a text as its kind of file; why not, as a person sees it.
type Reader = fn(&Path, &str) -> Result<(), String>;

fn scenarios() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../launch_configs")
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn shown(file: &Path, text: &str, error: &dyn std::fmt::Display) -> String {
    yaml::placed(&file.display().to_string(), text, &error.to_string())
}

fn machine(file: &Path, text: &str) -> Result<(), String> {
    let read = MachineFile::parse(text, &file.display().to_string());
    read.map(drop).map_err(|error| error.to_string())
}

fn plan(file: &Path, text: &str) -> Result<(), String> {
    let read = Plan::from_yaml(text);
    read.map(drop).map_err(|error| shown(file, text, &error))
}

fn plant(file: &Path, text: &str) -> Result<(), String> {
    let read = PlantFile::from_yaml(text);
    read.map(drop).map_err(|error| shown(file, text, &error))
}

fn map(file: &Path, text: &str) -> Result<(), String> {
    let read = yaml::read_letters::<Map>(text);
    read.map(drop).map_err(|error| shown(file, text, &error))
}

fn mapping(file: &Path, text: &str) -> Result<(), String> {
    let read = MapFile::from_yaml(text);
    read.map(drop).map_err(|error| shown(file, text, &error))
}

fn budget(file: &Path, text: &str) -> Result<(), String> {
    let read = Budget::read(text, file);
    read.map(drop).map_err(|error| format!("{error:#}"))
}

fn limits(file: &Path, text: &str) -> Result<(), String> {
    let read = Limits::read(text, file);
    read.map(drop).map_err(|error| format!("{error:#}"))
}

fn scenario(_: &Path, text: &str) -> Result<(), String> {
    let folder = tempfile::tempdir().expect("a folder");
    let home = scenarios().join("cold_reference");
    let name = "cold_reference.launch.xml";
    std::fs::copy(home.join(name), folder.path().join(name)).expect("a copy");
    std::fs::write(folder.path().join("scenario.yaml"), text).expect("a file");
    let read = Scenario::read(folder.path());
    let before = format!("{}/", folder.path().display());
    read.map(drop)
        .map_err(|error| format!("{error:#}").replace(&before, ""))
}

/// A parameter file of the scenario `first_run`, read by the node of its name.
fn parameters(file: &Path, text: &str) -> Result<(), String> {
    let folder = tempfile::tempdir().expect("a folder");
    for entry in std::fs::read_dir(scenarios().join("first_run")).expect("a scenario") {
        let path = entry.expect("a file").path();
        if path.is_file() {
            let name = path.file_name().expect("a name");
            std::fs::copy(&path, folder.path().join(name)).expect("a copy");
        }
    }
    let own = folder.path().join(file);
    std::fs::write(&own, text).expect("a file");
    let exec = file.file_stem().expect("a name").to_str().expect("a name");
    let words = ["--ros-args", "--params-file", own.to_str().expect("a path")];
    let arguments = Arguments::parse(words.map(str::to_owned)).expect("arguments");
    let build = node::builder(exec).expect("a node");
    let read = Setup::new(exec, &arguments)
        .map_err(anyhow::Error::from)
        .and_then(|setup| build(&setup));
    let before = format!("{}/", folder.path().display());
    read.map(drop)
        .map_err(|error| node_runtime::complaint::in_words(&error).replace(&before, ""))
}

/// Every kind of file, with one that is right.
fn files() -> Vec<(PathBuf, String, Reader)> {
    let home = scenarios();
    let nodes = home.join("../nodes/mtconnect_bridge/tests/data/mazak01_map.yaml");
    let import = home.join("../tests/import");
    let named = |path: PathBuf, reader: Reader| {
        let name = PathBuf::from(path.file_name().expect("a name"));
        (name, text(&path), reader)
    };
    let mut all = vec![
        named(home.join("first_run/machine.yaml"), machine),
        named(home.join("five_axis/machine.yaml"), machine),
        named(home.join("first_run/plan.yaml"), plan),
        named(home.join("grid_xy/plan.yaml"), plan),
        named(home.join("first_run/plant.yaml"), plant),
        named(home.join("first_run/scenario.yaml"), scenario),
        named(home.join("dual_loop/budget.yaml"), budget),
        named(home.join("dual_loop/limits.yaml"), limits),
        named(nodes, mapping),
    ];
    for name in ["positioning", "ballbar", "drift"] {
        all.push(named(import.join(format!("{name}.yaml")), map));
    }
    for name in [
        "probe",
        "latency_calibrator",
        "thermal_model",
        "axis_compensation",
        "fake_cnc",
        "sequencer",
    ] {
        all.push(named(
            home.join(format!("first_run/{name}.yaml")),
            parameters,
        ));
    }
    all
}

/// The byte at which a place stands.
fn offset(text: &str, place: Place) -> usize {
    let before: usize = text
        .split_inclusive('\n')
        .take(place.line - 1)
        .map(str::len)
        .sum();
    let line = &text[before..];
    let columns = line.char_indices().nth(place.column - 1);
    before + columns.map_or(line.len(), |(at, _)| at)
}

/// One key of a file.
struct Key<'t> {
    text: &'t str,
    path: String,
    key: Place,
    value: Place,
    shown: &'t str,
}

impl Key<'_> {
    fn name(&self) -> &str {
        self.path.rsplit('.').next().unwrap_or(&self.path)
    }

    /// The text with another value.
    fn with_value(&self, value: &str) -> Option<String> {
        let at = offset(self.text, self.value);
        let rest = self.text[at..].strip_prefix(self.shown)?;
        Some(format!("{}{value}{rest}", &self.text[..at]))
    }

    /// The text with another name of the key.
    fn renamed(&self, name: &str) -> Option<String> {
        let at = offset(self.text, self.key);
        let rest = self.text[at..].strip_prefix(self.name())?;
        Some(format!("{}{name}{rest}", &self.text[..at]))
    }

    /// The text with the key there twice.
    fn doubled(&self) -> Option<String> {
        let at = offset(self.text, self.key);
        let before = &self.text[..at];
        let pair = format!("{}: {}", self.name(), self.shown);
        let is_flow = before.trim_end().ends_with(['{', ',']);
        let indent = " ".repeat(self.key.column - 1);
        let end = if is_flow {
            ", ".to_owned()
        } else {
            format!("\n{indent}")
        };
        Some(format!("{before}{pair}{end}{}", &self.text[at..]))
    }
}

/// Words of libraries that no message has.
const LIBRARY_WORDS: [&str; 17] = [
    "Option",
    "DuplicateKeyPolicy",
    "from_str",
    "struct ",
    "invalid type",
    "unit variant",
    "missing field",
    "unknown field",
    "deserialize",
    "scalar",
    "f64",
    "u32",
    "variant",
    "tuple",
    "untagged",
    "serde",
    "saphyr",
];

/// The longest number with decimals in a message, in significant digits.
fn digits(message: &str) -> usize {
    let is_part = |letter: char| letter.is_ascii_digit() || letter == '.';
    message
        .split(|letter: char| !is_part(letter))
        .filter(|number| number.trim_matches('.').contains('.'))
        .map(|number| number.replace('.', "").trim_start_matches('0').len())
        .max()
        .unwrap_or(0)
}

/// What is wrong with a message about one key.
fn flaws(message: &str, file: &Path, key: &Key<'_>, wants_line: bool) -> Vec<String> {
    let mut flaws = vec![];
    let file = file.display().to_string();
    match message.split_once(&format!("{file}:")) {
        Some((_, rest)) => {
            let line = rest
                .split(':')
                .next()
                .and_then(|line| line.parse::<usize>().ok());
            match line {
                None => flaws.push("no line".to_owned()),
                Some(line) if wants_line && line != key.key.line => {
                    flaws.push(format!("line {line} and not {}", key.key.line));
                }
                Some(_) => {}
            }
        }
        None => flaws.push("no file with a line".to_owned()),
    }
    if !message.contains(key.name()) {
        flaws.push(format!("no key {}", key.name()));
    }
    for word in LIBRARY_WORDS.iter().filter(|word| message.contains(*word)) {
        flaws.push(format!("the word {word}"));
    }
    if digits(message) > 7 {
        flaws.push("a number with noise".to_owned());
    }
    if message.lines().count() != 1 {
        flaws.push("more than one line".to_owned());
    }
    flaws
}

#[test]
#[expect(clippy::too_many_lines, reason = "one case after another")]
fn every_wrong_key_of_every_file_is_named_with_file_line_key_and_unit() {
    let mut wrong = vec![];
    let mut refused: BTreeMap<&str, usize> = BTreeMap::new();
    for (file, text, read) in files() {
        assert_eq!(read(&file, &text), Ok(()), "{}", file.display());
        let places = Places::of(&text);
        for (path, key, value, shown) in places.values() {
            let key = Key {
                text: &text,
                path,
                key,
                value,
                shown,
            };
            let is_number = shown.parse::<f64>().is_ok();
            let unit = unit_of(&key.path).filter(|_| is_number);
            let ways = [
                ("type", key.with_value("[{a: b}]"), true),
                ("word", key.with_value("lots").filter(|_| is_number), true),
                ("nothing", key.with_value("").filter(|_| is_number), true),
                (
                    "range",
                    key.with_value("-1.0e+300").filter(|_| is_number),
                    true,
                ),
                (
                    "no number",
                    key.with_value(".nan").filter(|_| is_number),
                    true,
                ),
                ("unknown", key.renamed(&format!("{}_x", key.name())), false),
                ("twice", key.doubled(), false),
            ];
            for (way, spoiled, wants_line) in ways {
                let Some(spoiled) = spoiled else { continue };
                let Err(message) = read(&file, &spoiled) else {
                    let must = matches!(way, "word" | "twice") || (way == "type" && is_number);
                    if must {
                        wrong.push(format!(
                            "{way} of {} in {}: taken",
                            key.path,
                            file.display()
                        ));
                    }
                    continue;
                };
                *refused.entry(way).or_default() += 1;
                let mut found = flaws(&message, &file, &key, wants_line);
                if let Some(unit) = unit.as_ref().filter(|unit| {
                    way != "unknown" && way != "twice" && !message.contains(unit.as_str())
                }) {
                    found.push(format!("no unit {unit}"));
                }
                if !found.is_empty() {
                    wrong.push(format!(
                        "{way} of {}: {}\n    {message}",
                        key.path,
                        found.join(", ")
                    ));
                }
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "{} of {refused:?} messages:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
    for way in ["type", "word", "range", "unknown", "twice"] {
        assert!(refused.get(way).is_some_and(|n| *n > 100), "{refused:?}");
    }
}
