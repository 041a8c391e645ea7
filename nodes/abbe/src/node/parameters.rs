//! `abbe node NAME --help`: the node's parameters, from its own table and its own defaults.

use anyhow::{Context, Result};
use metrology::number::number;
use metrology::{Axis, ParameterDoc};
use node_runtime::arguments::Arguments;
use node_runtime::parameter::{Parameter, Value};
use node_runtime::setup::PARAMETERS_OF_EVERY_NODE;
use node_runtime::{Node, Setup};

use super::Builder;

/// Values for the keys without a default, so that a node resolves the others. Every key is needed: a node without it is refused.
/// `AXIS` stands for each of X, Y and Z.
const SAMPLES: &[(&str, &[(&str, &str)])] = &[
    (
        "axis_compensation",
        &[
            ("axes.AXIS.size_limit_um", "50.0"),
            ("axes.AXIS.rate_limit_um_per_s", "1.0"),
            ("axes.AXIS.acceleration_limit_um_per_s2", "10.0"),
            ("extrapolate", "linear"),
            ("physical_rate_um_per_min", "5.0"),
            ("jump_margin_um", "1.0"),
            ("expanded_uncertainty_limit_um", "5.0"),
            ("hold_s", "60.0"),
            ("fade_s", "60.0"),
            ("positioning.AXIS.reading", "refreshed_table"),
            ("positioning.AXIS.weight", "0.1"),
            ("positioning.AXIS.directions", "together"),
            ("positioning.AXIS.thermal_part", "false"),
            ("positioning.AXIS.measured_limit_um", "50.0"),
            ("geometry.tool_offset_mm", "[0.0, 0.0, 0.0]"),
            ("geometry.jump_limit_um", "10.0"),
        ],
    ),
    ("host_clock", &[("host", "a"), ("reference", "b")]),
    (
        "linuxcnc_bridge",
        &[
            ("machine_file", "machine.yaml"),
            ("joints", "['X', 'Y', 'Z']"),
            ("prepare", "observe"),
            ("compensation.limit_um", "50.0"),
            ("compensation.limit_arcsec", "10.0"),
            ("compensation.stale_after_ms", "500.0"),
        ],
    ),
    (
        "mtconnect_bridge",
        &[("source", "shdr"), ("map_file", "map.yaml")],
    ),
    (
        "opcua_bridge",
        &[
            ("endpoint", "opc.tcp://127.0.0.1:4840"),
            ("map_file", "map.yaml"),
        ],
    ),
    ("recorder", &[("bag", "bag"), ("ring.window_s", "600.0")]),
    ("replayer", &[("bag", "bag")]),
    (
        "thermal_model",
        &[
            ("method", "n_block"),
            ("update_period_min", "10.0"),
            ("validity_min", "20.0"),
            ("slope_error_limit_um", "5.0"),
            ("physical_rate_um_per_min", "5.0"),
            ("drift_limit_um", "5.0"),
        ],
    ),
];

/// Keys whose group may be absent as a whole; a key without a default is required within its group.
const OPTIONAL_GROUPS: [&str; 4] = ["positioning.", "geometry.", "ring.", "allowance."];

/// The sample of a node, axes written out.
fn sample(exec: &str) -> Vec<(String, &'static str)> {
    let mut all = SAMPLES.iter().filter(|(name, _)| *name == exec);
    let keys = all.next().map_or(&[][..], |(_, keys)| *keys);
    let mut written = vec![];
    for (key, value) in keys {
        if key.contains("AXIS") {
            let of_axis = |axis: &Axis| (key.replace("AXIS", &axis.to_string()), *value);
            written.extend(Axis::LINEAR.iter().map(of_axis));
        } else {
            written.push(((*key).to_owned(), *value));
        }
    }
    written
}

/// One line of the help.
#[derive(Debug, PartialEq)]
struct Row {
    name: String,
    unit: String,
    default: String,
    range: String,
    description: String,
}

/// The node's table of parameters, then those of every node.
fn rows(exec: &str, build: Builder) -> Result<Vec<Row>> {
    let sample = sample(exec);
    let described = setup(exec, &sample)?.described_by(build)?;
    let docs = described.docs.iter().chain(&PARAMETERS_OF_EVERY_NODE);
    Ok(docs
        .map(|doc| {
            let of_name = |parameter: &&Parameter| parameter.name == doc.name;
            let resolved = described.parameters.iter().find(of_name);
            let is_required = sample.iter().any(|(key, _)| *key == doc.name);
            Row {
                name: doc.name.to_string(),
                unit: if doc.unit.is_empty() {
                    "-".to_owned()
                } else {
                    doc.unit.to_string()
                },
                default: match resolved {
                    _ if is_required => required(doc),
                    Some(parameter) => shown(&parameter.value),
                    None => "none".to_owned(),
                },
                range: doc.range.map_or_else(
                    || "-".to_owned(),
                    |(least, greatest)| format!("{} to {}", number(least), number(greatest)),
                ),
                description: doc.description.to_string(),
            }
        })
        .collect())
}

fn required(doc: &ParameterDoc) -> String {
    let mut optional = OPTIONAL_GROUPS.iter();
    let is_optional = optional.any(|group| doc.name.starts_with(group));
    match doc.name.rsplit_once('.') {
        Some((group, _)) if is_optional => format!("required with {group}"),
        _ => "required".to_owned(),
    }
}

fn setup(exec: &str, values: &[(String, &str)]) -> Result<Setup> {
    let mut arguments = vec!["--ros-args".to_owned()];
    for (key, value) in values {
        arguments.extend(["-p".to_owned(), format!("{key}:={value}")]);
    }
    Ok(Setup::new(exec, &Arguments::parse(arguments)?)?)
}

fn shown(value: &Value) -> String {
    let list = |all: Vec<String>| format!("[{}]", all.join(", "));
    match value {
        Value::Bool(value) => value.to_string(),
        Value::Integer(value) => value.to_string(),
        Value::Double(value) => number(*value).to_string(),
        Value::String(value) => format!("\"{value}\""),
        Value::BoolArray(all) => list(all.iter().map(ToString::to_string).collect()),
        Value::IntegerArray(all) => list(all.iter().map(ToString::to_string).collect()),
        Value::DoubleArray(all) => list(all.iter().map(|one| number(*one).to_string()).collect()),
        Value::StringArray(all) => list(all.iter().map(|one| format!("\"{one}\"")).collect()),
    }
}

/// The help of a node: how it is started, and its parameters.
///
/// # Errors
/// When the node's table cannot be had.
pub fn help(exec: &str, build: fn(&Setup) -> Result<Box<dyn Node>>) -> Result<String> {
    let rows = rows(exec, build).with_context(|| format!("parameters of {exec}"))?;
    let mut text = format!(
        "Usage: abbe node {exec} --ros-args [--params-file FILE] [-p NAME:=VALUE] [-r FROM:=TO] ...\n\nParameters (name, unit, default, range):\n"
    );
    for row in &rows {
        text.push_str(&format!(
            "\n  {}  [{}]  default {}  range {}\n      {}\n",
            row.name, row.unit, row.default, row.range, row.description
        ));
    }
    text.push_str(
        "\nParameters are read once, at the start. A value out of range stops the start.\n",
    );
    Ok(text)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::node::NODES;

    fn cells(line: &str) -> Vec<&str> {
        let cells = line.trim().trim_matches('|').split('|');
        cells.map(|cell| cell.trim().trim_matches('`')).collect()
    }

    /// A README with the table of parameters that `rows` make, in the order that it has; new ones come last.
    fn with_table(readme: &str, rows: &[Row]) -> String {
        let lines: Vec<&str> = readme.lines().collect();
        let is_head = |line: &&str| {
            ["unit", "default"]
                .iter()
                .all(|name| cells(line).contains(name))
        };
        let head = lines.iter().position(is_head).unwrap();
        let is_row = |line: &&&str| line.starts_with('|');
        let after = head + lines[head..].iter().take_while(is_row).count();
        let place = |row: &&Row| {
            let is_of_row = |line: &&str| cells(line)[0] == row.name;
            lines[head..after]
                .iter()
                .position(is_of_row)
                .unwrap_or(usize::MAX)
        };
        let mut rows: Vec<&Row> = rows.iter().collect();
        rows.sort_by_key(place);
        let mut written = lines[..head].to_vec();
        written.extend([
            "| parameter | unit | default | limits | meaning |",
            "|---|---|---|---|---|",
        ]);
        let table: Vec<String> = rows
            .iter()
            .map(|row| {
                let Row {
                    name,
                    unit,
                    default,
                    range,
                    description,
                } = row;
                format!("| `{name}` | {unit} | {default} | {range} | {description} |")
            })
            .collect();
        written.extend(table.iter().map(String::as_str));
        written.extend(&lines[after..]);
        written.join("\n") + "\n"
    }

    /// With ABBE_WRITE_TABLES in the environment the tables are written.
    #[test]
    fn every_readme_has_the_table_of_its_node() {
        let mut different = vec![];
        for (exec, build) in NODES {
            let mut rows = rows(exec, *build).unwrap();
            rows.truncate(rows.len() - PARAMETERS_OF_EVERY_NODE.len());
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../{exec}/README.md"));
            let readme = std::fs::read_to_string(&path).unwrap();
            let right = with_table(&readme, &rows);
            if std::env::var_os("ABBE_WRITE_TABLES").is_some() {
                std::fs::write(&path, &right).unwrap();
            } else if right != readme {
                let line = right.lines().find(|line| !readme.contains(line));
                different.push(format!(
                    "{exec}: {}",
                    line.unwrap_or("order or an extra row")
                ));
            }
        }
        assert_eq!(different, Vec::<String>::new());
    }

    #[test]
    fn every_key_that_is_called_required_is() {
        for (exec, build) in NODES {
            let all = sample(exec);
            for without in 0..all.len() {
                let mut fewer = all.clone();
                let (key, _) = fewer.remove(without);
                // Its group is there all the same.
                if key == "ring.window_s" {
                    fewer.push(("ring.save_on_error".to_owned(), "true"));
                }
                let built = setup(exec, &fewer).unwrap().described_by(*build);
                let refused = built.map(|_| ()).unwrap_err().to_string();
                let last = key.rsplit('.').next().unwrap();
                assert!(refused.contains(last), "{exec}: {key}: {refused}");
            }
            for group in OPTIONAL_GROUPS {
                let mut fewer = all.clone();
                fewer.retain(|(key, _)| !key.starts_with(group));
                assert!(
                    setup(exec, &fewer).unwrap().described_by(*build).is_ok(),
                    "{exec}: {group}"
                );
            }
        }
    }

    #[test]
    fn the_help_has_unit_default_range_and_description() {
        let (_, build) = NODES.iter().find(|(name, _)| *name == "probe").unwrap();
        let help = help("probe", *build).unwrap();
        // As the README of probe states it, with the range of its table.
        let row = "  longest_gap_ms  [ms]  default 5  range 0.01 to 1000\n      Longest time between two positions that are interpolated.\n";
        assert!(help.contains(row), "{help}");
    }
}
