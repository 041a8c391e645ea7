//! The nodes of a scenario are about one machine: their machine files mean the same, and so does that of the bag.
//!
//! Files are compared by their meaning: layout, comments and values that are the defaults make no difference. Nodes of
//! different namespaces may be those of different machines.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use machine::MachineFile;
use metrology::number::quantity;
use node_runtime::text_file;
use serde_json::Value;

use crate::launch::LaunchNode;

/// What goes into the bag of a run.
const MACHINE_FILE: &str = "machine.yaml";
/// Nodes of which a cell may have several.
const PLURAL: [&str; 3] = ["host_clock", "recorder", "replayer"];
/// Longest value that a message shows, characters.
const SHOWN: usize = 60;

/// A node that reads a machine file, and the file's content.
struct Reader {
    who: String,
    path: PathBuf,
    machine: Value,
    /// Keys that may differ.
    own: &'static [&'static str],
}

/// Refuses two nodes of one kind in a namespace, nodes of one namespace whose machine files differ, and a `machine.yaml` of the folder, which the run's bag
/// gets, that differs from theirs. Who cannot be read is left to who builds the nodes.
///
/// # Errors
/// The two readers, their files, and the first key that differs with both values.
pub fn check(folder: &Path, nodes: &[LaunchNode]) -> Result<()> {
    let spaces: BTreeSet<&str> = nodes.iter().map(namespace).collect();
    for space in &spaces {
        check_single(nodes.iter().filter(|node| namespace(node) == *space))?;
        let of_space = nodes.iter().filter(|node| namespace(node) == *space);
        let mut readers: Vec<Reader> = of_space.filter_map(reader).collect();
        if spaces.len() == 1 && !readers.is_empty() {
            readers.extend(of_bag(folder));
        }
        compare(&readers)?;
    }
    Ok(())
}

/// Refuses two nodes of one kind in a namespace: both would publish the same, and each measurement would stand twice.
fn check_single<'n>(nodes: impl Iterator<Item = &'n LaunchNode>) -> Result<()> {
    let mut first = BTreeMap::<&str, &str>::new();
    for node in nodes.filter(|node| !PLURAL.contains(&node.exec.as_str())) {
        let other = first.insert(&node.exec, &node.name);
        // Launch files of one cell name the same node; a name that is there twice is refused by who composes it.
        if let Some(other) = other.filter(|other| *other != node.name) {
            bail!(
                "nodes {other} and {} are both a {} of one namespace, and would publish the same topics: take one out, or give it a \
                 namespace of its own",
                node.name,
                node.exec
            );
        }
    }
    Ok(())
}

fn namespace(node: &LaunchNode) -> &str {
    node.namespace.trim_matches('/')
}

fn reader(node: &LaunchNode) -> Option<Reader> {
    let setup = node.setup().ok()?;
    let (path, text) = setup.file_text("machine_file").ok()?;
    // A simulator that has effects the machine's own file does not list.
    let own: &[&str] = match node.exec.as_str() {
        "gap_diagnosis" => &["effects"],
        _ => &[],
    };
    read(format!("node {}", node.name), path, &text, own)
}

fn of_bag(folder: &Path) -> Option<Reader> {
    let file = text_file::yaml_file(&folder.join(MACHINE_FILE)).ok()?;
    read("the run's bag".to_owned(), file.path, &file.text, &[])
}

fn read(who: String, path: PathBuf, text: &str, own: &'static [&'static str]) -> Option<Reader> {
    let machine = MachineFile::parse(text, &path.display().to_string()).ok()?;
    let machine = serde_json::to_value(machine).ok()?;
    Some(Reader {
        who,
        path,
        machine,
        own,
    })
}

fn compare(readers: &[Reader]) -> Result<()> {
    for (place, one) in readers.iter().enumerate() {
        for other in &readers[place + 1..] {
            let allowed = |key: &str| [one, other].iter().any(|it| it.own.contains(&key));
            let Some((key, values)) = first_difference("", &one.machine, &other.machine, &allowed)
            else {
                continue;
            };
            let shown = |reader: &Reader, value| {
                let path = reader.path.display().to_string().replace("/hosts/../", "/");
                format!("{} reads {path}, where it is {value}", reader.who)
            };
            let [of_one, of_other] = values;
            bail!(
                "machine files differ: {key}: {}; {}: give both the same machine_file",
                shown(one, of_one),
                shown(other, of_other)
            );
        }
    }
    Ok(())
}

/// The first key whose values differ, and both values as text.
fn first_difference(
    key: &str,
    one: &Value,
    other: &Value,
    allowed: &dyn Fn(&str) -> bool,
) -> Option<(String, [String; 2])> {
    if one == other || allowed(key) {
        return None;
    }
    let below = |name: &str| match key {
        "" => name.to_owned(),
        key => format!("{key}.{name}"),
    };
    match (one, other) {
        (Value::Object(one), Value::Object(other)) => {
            let names: BTreeSet<&String> = one.keys().chain(other.keys()).collect();
            let value = |map: &serde_json::Map<String, Value>, name: &str| {
                map.get(name).cloned().unwrap_or_default()
            };
            names.into_iter().find_map(|name| {
                let (one, other) = (value(one, name), value(other, name));
                first_difference(&below(name), &one, &other, allowed)
            })
        }
        (Value::Array(one), Value::Array(other)) if one.len() == other.len() => {
            let mut pairs = one.iter().zip(other).enumerate();
            pairs.find_map(|(place, (one, other))| {
                first_difference(&format!("{key}[{place}]"), one, other, allowed)
            })
        }
        _ => Some((key.to_owned(), [one, other].map(|value| shown(key, value)))),
    }
}

/// A value as a message shows it: a number with the unit of its key, a long text cut.
fn shown(key: &str, value: &Value) -> String {
    match (value, value.as_f64()) {
        (Value::Null, _) => "absent".to_owned(),
        (_, Some(number)) => quantity(key, number),
        _ => {
            let text = value.to_string();
            match text.char_indices().nth(SHOWN) {
                Some((end, _)) => format!("{}…", &text[..end]),
                None => text,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = include_str!("../../../../launch_configs/first_run/machine.yaml");

    /// A folder with the machine file, another one with one text replaced, and nodes that read them.
    struct Cell {
        folder: tempfile::TempDir,
        nodes: Vec<LaunchNode>,
    }

    impl Cell {
        fn new() -> Self {
            let folder = tempfile::tempdir().unwrap();
            std::fs::write(folder.path().join(MACHINE_FILE), MACHINE).unwrap();
            Self {
                folder,
                nodes: vec![],
            }
        }

        fn other(&self, from: &str, to: &str) {
            assert!(MACHINE.contains(from), "{from}");
            let text = MACHINE.replacen(from, to, 1);
            std::fs::write(self.folder.path().join("m2.yaml"), text).unwrap();
        }

        fn node(&mut self, exec: &str, namespace: &str, machine: &str) {
            let name = format!("{exec}{}.yaml", self.nodes.len());
            let path = self.folder.path().join(name);
            let text = format!("/**:\n  ros__parameters: {{machine_file: {machine}}}\n");
            std::fs::write(&path, text).unwrap();
            self.nodes.push(LaunchNode {
                exec: exec.to_owned(),
                name: exec.to_owned(),
                namespace: namespace.to_owned(),
                parameter_files: vec![path],
                parameters: vec![],
                ends_within: None,
                place: String::new(),
            });
        }

        fn said(&self) -> String {
            match check(self.folder.path(), &self.nodes) {
                Ok(()) => String::new(),
                Err(error) => format!("{error:#}"),
            }
        }
    }

    #[test]
    fn a_namespace_has_one_node_of_a_kind_but_recorders() {
        let folder = tempfile::tempdir().unwrap();
        let node = |exec: &str, name: &str, namespace: &str| LaunchNode {
            exec: exec.to_owned(),
            name: name.to_owned(),
            namespace: namespace.to_owned(),
            parameter_files: vec![],
            parameters: vec![],
            ends_within: None,
            place: String::new(),
        };
        let two = |exec, spaces: [&str; 2]| {
            let nodes = [node(exec, "a", spaces[0]), node(exec, "b", spaces[1])];
            check(folder.path(), &nodes)
        };
        for exec in [
            "fake_cnc",
            "axis_compensation",
            "sequencer",
            "probe",
            "thermal_model",
        ] {
            let error = two(exec, ["", "/"]).unwrap_err().to_string();
            assert!(error.contains("nodes a and b are both a "), "{error}");
            assert!(two(exec, ["left", "right"]).is_ok(), "{exec}");
        }
        assert!(two("recorder", ["", ""]).is_ok());
    }

    #[test]
    fn nodes_with_machine_files_of_another_meaning_are_refused_with_key_and_values() {
        for (exec, from, to, words) in [
            (
                "sequencer",
                "corner_mm: [-220.0, -180.0, 20.0]",
                "corner_mm: [-220.0, -180.0, 15.0]",
                ["blocks[0].corner_mm[2]", "20 mm", "15 mm"],
            ),
            (
                "probe",
                "radius_mm: 3.0, length",
                "radius_mm: 2.9, length",
                ["probe.styli.ruby_6.radius_mm", "3 mm", "2.9 mm"],
            ),
            (
                "thermal_model",
                "name: vmc_5x",
                "name: vmc_5y",
                ["name", "\"vmc_5x\"", "\"vmc_5y\""],
            ),
            (
                "axis_compensation",
                "pulse_equivalent_um: 0.1",
                "pulse_equivalent_um: 1.0",
                ["control.pulse_equivalent_um", "0.1 µm", "1 µm"],
            ),
            (
                "latency_calibrator",
                "spindle: {max_speed_rpm: 12000.0}\n",
                "",
                ["spindle", "12000", "absent"],
            ),
            (
                "machine_frames",
                "[w C' A' Y' b X Z t]",
                "[w C' A' b Y X Z t]",
                ["chain", "Y' b X", "b Y X"],
            ),
            (
                "recorder",
                "  - {id: ambient, place: ambient, period_s: 10.0}\n",
                "",
                ["temperature_sensors", "ambient", "nut_z"],
            ),
        ] {
            let mut cell = Cell::new();
            cell.other(from, to);
            cell.node("fake_cnc", "", "machine.yaml");
            assert_eq!(cell.said(), "", "{exec}");
            cell.node(exec, "", "m2.yaml");
            let said = cell.said();
            let nodes = ["node fake_cnc", &format!("node {exec}")].map(str::to_owned);
            let files = ["machine.yaml", "m2.yaml", "same machine_file"].map(str::to_owned);
            let words = words.map(str::to_owned);
            for word in nodes.iter().chain(&files).chain(&words[..1]) {
                assert!(said.contains(word.as_str()), "{exec}: {word}: {said}");
            }
            if exec != "recorder" {
                assert!(words.iter().all(|word| said.contains(word)), "{said}");
            }
        }
    }

    #[test]
    fn files_of_one_meaning_and_machines_of_two_namespaces_are_allowed() {
        let mut cell = Cell::new();
        // Another layout, comments, and a default that is written out.
        cell.other("effects: []\n", "# none\nartefacts: []\n");
        cell.node("fake_cnc", "", "machine.yaml");
        cell.node("sequencer", "", "m2.yaml");
        assert_eq!(cell.said(), "");
        cell.other("name: vmc_5x", "name: another");
        let mut two = Cell::new();
        two.other("name: vmc_5x", "name: another");
        for (namespace, machine) in [("/m1", "machine.yaml"), ("/m2", "m2.yaml")] {
            two.node("fake_cnc", namespace, machine);
            two.node("sequencer", namespace, machine);
        }
        assert_eq!(two.said(), "");
        two.node("probe", "/m2", "machine.yaml");
        assert!(two.said().contains("node probe"), "{}", two.said());
    }

    #[test]
    fn a_diagnosis_may_have_effects_of_its_own_and_no_other_machine() {
        let effects = "effects: [{kind: backlash, axis: X, width_um: 0.7}]";
        for (from, to, is_allowed) in [
            ("effects: []", effects, true),
            ("lead_mm: 10.0", "lead_mm: 5.0", false),
        ] {
            let mut cell = Cell::new();
            cell.other(from, to);
            cell.node("fake_cnc", "", "machine.yaml");
            cell.node("gap_diagnosis", "", "m2.yaml");
            assert_eq!(cell.said().is_empty(), is_allowed, "{to}: {}", cell.said());
        }
    }

    #[test]
    fn a_bag_gets_the_machine_file_that_the_nodes_read() {
        let mut cell = Cell::new();
        cell.other("lead_mm: 10.0", "lead_mm: 5.0");
        cell.node("fake_cnc", "", "m2.yaml");
        cell.node("sequencer", "", "m2.yaml");
        let said = cell.said();
        for word in ["the run's bag", "axes.X.lead_mm", "5 mm", "10 mm"] {
            assert!(said.contains(word), "{word}: {said}");
        }
        std::fs::remove_file(cell.folder.path().join(MACHINE_FILE)).unwrap();
        assert_eq!(cell.said(), "", "a bag without one");
    }

    #[test]
    fn what_cannot_be_read_is_left_to_who_builds_the_nodes() {
        let mut cell = Cell::new();
        cell.other("name: vmc_5x", "nam: vmc_5x");
        for machine in ["machine.yaml", "m2.yaml", "absent.yaml", "''"] {
            cell.node("probe", "", machine);
        }
        cell.node("no_such_node", "", "machine.yaml");
        assert_eq!(cell.said(), "");
    }
}
