//! Metres stay on the wire, topic names in one file, the machine's formulas out of the plant.

use crate::check;
use crate::source::{Found, Source, sources};
use crate::tree::{self, PURE};

/// Whether a name ends in metres, metres per second or metres per second squared.
///
/// `n_m` (torque), `per_m`, `kg_m2` are other units; one letter and `_m` is a symbol with an index.
fn is_in_metres(name: &str) -> bool {
    let name = name.to_lowercase();
    ["_m", "_m2", "_m_s", "_m_s2", "_m_per_s"]
        .iter()
        .any(|unit| {
            let Some(stem) = name.strip_suffix(unit) else {
                return false;
            };
            let other = ["per", "n", "kg"]
                .iter()
                .any(|before| stem == *before || stem.ends_with(&format!("_{before}")));
            stem.len() > 1 && !other
        })
}

fn metres(path: &str, source: &Source) -> Vec<String> {
    let found = source
        .quantities
        .iter()
        .filter(|name| is_in_metres(&name.text));
    found
        .map(|Found { text, line }| format!("{path}:{line}: {text}: lengths inside are mm"))
        .collect()
}

#[test]
fn arch_metres_exist_only_on_the_wire() {
    let mut found = Vec::new();
    let bridges = ["linuxcnc_bridge", "mtconnect_bridge", "opcua_bridge"];
    for name in PURE.iter().chain(&bridges).chain(&["machine_report"]) {
        let sources = sources(&format!("{}/src", tree::folder_of(name)));
        found.extend(
            sources
                .iter()
                .flat_map(|(path, source)| metres(path, source)),
        );
    }
    check(&found);
    let bad = Source::parse(
        "struct A { torque_n_m: f64, reach_m: f64 }\nfn f(feed_m_s: f64, p_m: f64) {}",
    );
    assert_eq!(
        metres("a.rs", &bad),
        [
            "a.rs:1: reach_m: lengths inside are mm",
            "a.rs:2: feed_m_s: lengths inside are mm",
        ]
    );
}

const TOPICS: &str = "msgs/src/topics.rs";

/// Names of topics, families, services and actions: the literals of topics.rs that are ROS names.
fn topic_names(topics: &str) -> Vec<String> {
    let is_part = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || c == '/';
    let is_name = |text: &str| {
        text.len() > 1 && text.chars().all(is_part) && !text.starts_with('_') && text != "//"
    };
    let strings = Source::parse(topics).strings;
    let names = strings
        .into_iter()
        .map(|found| found.text)
        .filter(|text| is_name(text));
    names.collect()
}

/// Literals that are topic names; a name of one word counts in shells only, for it is a word elsewhere.
fn spelled_topics(path: &str, source: &Source, names: &[String]) -> Vec<String> {
    let in_shell = path.contains("/node/src/") || path.starts_with("nodes/libraries/node_runtime/");
    let is_topic = |text: &str| {
        let name = text.trim_start_matches('/');
        let known = names
            .iter()
            .any(|known| known.trim_start_matches('/') == name);
        let family = names
            .iter()
            .any(|known| known.ends_with('/') && text.starts_with(known));
        (known && (in_shell || text.contains('/'))) || family
    };
    let found = source.strings.iter().filter(|found| is_topic(&found.text));
    found
        .map(|Found { text, line }| format!("{path}:{line}: \"{text}\": use {TOPICS}"))
        .collect()
}

#[test]
fn arch_topic_names_exist_in_one_file() {
    let names = topic_names(&tree::text(TOPICS).unwrap());
    for name in [
        "axes/state",
        "/diagnostics",
        "cnc/run_program",
        "temperature/",
        "latency",
    ] {
        assert!(
            names.iter().any(|known| known == name),
            "{name} in {names:?}"
        );
    }
    let mut all = sources("nodes");
    all.extend(
        sources("msgs/src")
            .into_iter()
            .filter(|(path, _)| path != TOPICS),
    );
    let spelled = all
        .iter()
        .flat_map(|(path, source)| spelled_topics(path, source, &names));
    check(&spelled.collect::<Vec<_>>());
    let bad = Source::parse(
        "fn f() { a(\"axes/state\", \"latency\", \"temperature/bed\", \"/axes/state\") }",
    );
    assert_eq!(
        spelled_topics("nodes/probe/src/stage.rs", &bad, &names).len(),
        3
    );
    assert_eq!(
        spelled_topics("nodes/probe/node/src/lib.rs", &bad, &names).len(),
        4
    );
}

/// The libraries with a model of the machine.
const MODELS: [&str; 2] = ["machine::", "twin::"];

/// What plant and trials may take from them: the file that names the machine's axes, never a formula.
const DATA: [&str; 3] = [
    "machine::MachineFile",
    "machine::MachineFileError",
    "machine::file",
];

fn borrowed_formulas(path: &str, source: &Source) -> Vec<String> {
    let of_machine = source
        .paths
        .iter()
        .filter(|found| MODELS.iter().any(|model| found.text.starts_with(model)));
    let formulas = of_machine.filter(|found| {
        let is = |data: &&str| found.text == **data || found.text.starts_with(&format!("{data}::"));
        !DATA.iter().any(is)
    });
    formulas
        .map(|Found { text, line }| {
            format!("{path}:{line}: {text}: the plant has formulas of its own")
        })
        .collect()
}

#[test]
fn arch_the_plant_shares_no_formula_with_the_machine() {
    let mut all = sources("nodes/fake_cnc/src/plant");
    all.extend(
        sources("nodes/fake_cnc/src")
            .into_iter()
            .filter(|(path, _)| path.ends_with("/plant.rs")),
    );
    all.extend(sources("nodes/libraries/trials/src"));
    assert!(all.len() > 4);
    check(
        &all.iter()
            .flat_map(|(path, source)| borrowed_formulas(path, source))
            .collect::<Vec<_>>(),
    );
    let bad = Source::parse(
        "use machine::{MachineFile, chain::Chain, file::AxisEntry};\nuse twin::effects::backlash;",
    );
    assert_eq!(
        borrowed_formulas("a.rs", &bad),
        [
            "a.rs:1: machine::chain::Chain: the plant has formulas of its own",
            "a.rs:2: twin::effects::backlash: the plant has formulas of its own",
        ]
    );
}
