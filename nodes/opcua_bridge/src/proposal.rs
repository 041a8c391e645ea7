//! A mapping that is proposed out of what a server has, for a person to go over.

use std::collections::BTreeSet;

use machine_report::mapping::{AxisEntry, MapFile, Meaning, NumberEntry, TextEntry, name_of};
use machine_report::unit::Unit;
use metrology::Axis;

use crate::error::BridgeError;
use crate::node_key::{NodeKey, PREFIXES};

/// A variable of a server.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Which node.
    pub node: NodeKey,
    /// Browse names from `Objects` on, the variable's own last.
    pub path: Vec<String>,
    /// Namespace of its browse name.
    pub namespace: String,
    /// Its unit as the server shows it; empty: none.
    pub unit: String,
}

/// What a server has.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Survey {
    /// Its variables.
    pub variables: Vec<Variable>,
    /// Nodes that were looked at.
    pub nodes: usize,
    /// Why the search ended before all nodes were seen.
    pub stopped: Option<String>,
}

/// A mapping, and what is not in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Proposal {
    /// The mapping.
    pub map: MapFile,
    /// Key and path of what has no meaning here, as far as is known.
    pub left_out: Vec<(String, String)>,
}

/// Left out variables that are listed at most.
const LISTED: usize = 500;

/// Units as servers show them, with ours.
pub(crate) const UNITS: [(&str, Unit); 14] = [
    ("mm", Unit::Millimeter),
    ("in", Unit::Inch),
    ("°", Unit::Degree),
    ("deg", Unit::Degree),
    ("mm/min", Unit::MillimeterPerMinute),
    ("mm/s", Unit::MillimeterPerSecond),
    ("in/min", Unit::InchPerMinute),
    ("r/min", Unit::RevolutionPerMinute),
    ("1/min", Unit::RevolutionPerMinute),
    ("rpm", Unit::RevolutionPerMinute),
    ("°C", Unit::Celsius),
    ("C", Unit::Celsius),
    ("°F", Unit::Fahrenheit),
    ("%", Unit::Percent),
];

/// Proposes a mapping of all that has a meaning here.
#[must_use]
pub fn propose(survey: &Survey) -> Proposal {
    let mut proposal = Proposal::default();
    let (mut axes, mut names) = (BTreeSet::new(), BTreeSet::new());
    for variable in &survey.variables {
        let key = variable.node.text();
        let meaning = companion(variable).or_else(|| by_unit(variable));
        let named = meaning.and_then(|meaning| unique(meaning, variable, &mut axes, &mut names));
        match named {
            Some(meaning) => {
                proposal.map.values.insert(key, meaning);
            }
            None => proposal.left_out.push((key, variable.path.join("/"))),
        }
    }
    proposal
}

/// A percentage, a text or an execution of a companion specification.
fn companion(variable: &Variable) -> Option<Meaning> {
    let prefix = PREFIXES.iter().find(|(_, uri)| *uri == variable.namespace);
    let name = variable.path.last()?.as_str();
    let parent = variable.path.iter().rev().nth(1).map_or("", String::as_str);
    let text = |words: &[(&str, &str)]| TextEntry {
        name: None,
        words: words
            .iter()
            .map(|(from, to)| ((*from).to_owned(), (*to).to_owned()))
            .collect(),
    };
    let share = || NumberEntry {
        name: None,
        unit: Unit::Percent,
        series: false,
        change: None,
    };
    match (prefix?.0, name) {
        ("machine_tool", "FeedOverride" | "RapidOverride" | "Override") => {
            Some(Meaning::Override(share()))
        }
        ("machine_tool", "ChannelState") => Some(Meaning::Execution(text(&[
            ("0", "ACTIVE"),
            ("1", "INTERRUPTED"),
            ("2", "READY"),
        ]))),
        ("machine_tool", "ChannelMode") => Some(Meaning::ControllerMode(text(&[
            ("0", "AUTOMATIC"),
            ("1", "MANUAL_DATA_INPUT"),
            ("2", "MANUAL"),
            ("3", "MANUAL"),
            ("4", "MANUAL"),
        ]))),
        ("machine_tool", "OperationMode" | "IsRotating") => Some(Meaning::Text(text(&[]))),
        ("machine_tool", "Name") if parent == "ActiveProgram" => Some(Meaning::Text(text(&[]))),
        ("ua", "CurrentState") if parent == "MachineryItemState" => {
            Some(Meaning::Execution(text(&[
                ("Executing", "ACTIVE"),
                ("NotExecuting", "READY"),
            ])))
        }
        ("ua", "CurrentState") if parent == "MachineryOperationMode" => {
            Some(Meaning::Text(text(&[])))
        }
        _ => None,
    }
}

/// What a number with a unit is: a temperature by its unit, a position by its unit and a letter.
fn by_unit(variable: &Variable) -> Option<Meaning> {
    let shown = variable.unit.trim();
    let (_, unit) = UNITS.iter().find(|(known, _)| *known == shown)?;
    let number = NumberEntry {
        name: None,
        unit: *unit,
        series: false,
        change: None,
    };
    match unit {
        Unit::Celsius | Unit::Fahrenheit => Some(Meaning::Temperature(number)),
        Unit::MillimeterPerMinute | Unit::MillimeterPerSecond | Unit::InchPerMinute => {
            Some(Meaning::Feed(number))
        }
        Unit::RevolutionPerMinute => Some(Meaning::SpindleSpeed(number)),
        Unit::Percent => {
            let name = variable.path.last()?.to_ascii_lowercase();
            if name.contains("override") {
                Some(Meaning::Override(number))
            } else if name.contains("load") {
                Some(Meaning::Load(number))
            } else {
                None
            }
        }
        Unit::Millimeter | Unit::Inch | Unit::Degree => {
            let axis = axis_of(variable)?;
            let unit = *unit;
            unit.measures_position(axis.is_linear())
                .then_some(Meaning::Position(AxisEntry { axis, unit }))
        }
        _ => None,
    }
}

/// The axis of a position: its own name, or that of the node above it, is a letter.
fn axis_of(variable: &Variable) -> Option<Axis> {
    let letter = |name: &str| Axis::ALL.into_iter().find(|axis| name == axis.letter());
    variable.path.iter().rev().take(2).find_map(|name| {
        let last = name.rsplit(['_', '.', ' ']).next().unwrap_or_default();
        letter(last)
    })
}

/// The meaning with a name that no other has; `None`: another key reports its axis.
fn unique(
    mut meaning: Meaning,
    variable: &Variable,
    axes: &mut BTreeSet<Axis>,
    names: &mut BTreeSet<String>,
) -> Option<Meaning> {
    let mut name = String::new();
    // As much of the path as makes it the only one.
    for step in variable.path.iter().rev() {
        name = match name.as_str() {
            "" => name_of(step),
            behind => format!("{}_{behind}", name_of(step)),
        };
        let fits = name.starts_with(|c: char| c.is_ascii_lowercase()) && !name.contains("__");
        if fits && !names.contains(&name) {
            break;
        }
    }
    if let Meaning::Position(entry) = &meaning {
        return axes.insert(entry.axis).then_some(meaning);
    }
    meaning.set_name(name.clone());
    names.insert(name).then_some(meaning)
}

/// The proposal as a mapping file, with what was left out as remarks.
///
/// # Errors
/// When it cannot be written as YAML.
pub fn text_of(proposal: &Proposal) -> Result<String, BridgeError> {
    let mut text = serde_saphyr::to_string(&proposal.map).map_err(|error| BridgeError::Client {
        action: "writing the mapping",
        reason: error.to_string(),
    })?;
    if !proposal.left_out.is_empty() {
        text.push_str("\n# Left out, without a meaning that is known from name or unit:\n");
    }
    for (key, path) in proposal.left_out.iter().take(LISTED) {
        text.push_str(&format!("# {}  {}\n", in_line(key), in_line(path)));
    }
    if proposal.left_out.len() > LISTED {
        let more = proposal.left_out.len() - LISTED;
        text.push_str(&format!("# and {more} more\n"));
    }
    Ok(text)
}

/// A text without letters that would end a remark.
fn in_line(text: &str) -> String {
    text.chars()
        .map(|letter| if letter.is_control() { ' ' } else { letter })
        .collect()
}

#[cfg(test)]
mod tests {
    use machine_report::Mapping;

    use super::*;

    fn variable(id: &str, path: &str, namespace: &str, unit: &str) -> Variable {
        Variable {
            node: NodeKey::read(&format!("nsu=urn:mill;s={id}")).unwrap(),
            path: path.split('/').map(str::to_owned).collect(),
            namespace: namespace.to_owned(),
            unit: unit.to_owned(),
        }
    }

    #[test]
    fn what_is_proposed_is_a_mapping_and_the_rest_is_listed() {
        let machine_tool = "http://opcfoundation.org/UA/MachineTool/";
        let survey = Survey {
            variables: vec![
                variable(
                    "1",
                    "Machines/M/Monitoring/C1/ChannelState",
                    machine_tool,
                    "",
                ),
                variable(
                    "2",
                    "Machines/M/Monitoring/C1/FeedOverride",
                    machine_tool,
                    "%",
                ),
                variable(
                    "3",
                    "Machines/M/Monitoring/C2/FeedOverride",
                    machine_tool,
                    "%",
                ),
                variable("4", "Axes/X/ActPos", "urn:mill", "mm"),
                variable("5", "Axes/X/Setpoint", "urn:mill", "mm"),
                variable("6", "Axes/C/ActPos", "urn:mill", "°"),
                variable("7", "Spindle/Temperature", "urn:mill", "°C"),
                variable("8", "Spindle/Speed", "urn:mill", "1/min"),
                variable("9", "Spindle/Note", "urn:mill", ""),
            ],
            ..Survey::default()
        };
        let proposal = propose(&survey);
        let mapping = Mapping::new(&proposal.map).unwrap();
        assert_eq!(mapping.uses().count(), 7);
        let left: Vec<&str> = proposal
            .left_out
            .iter()
            .map(|(_, path)| path.as_str())
            .collect();
        assert_eq!(left, ["Axes/X/Setpoint", "Spindle/Note"]);
        let text = text_of(&proposal).unwrap();
        assert_eq!(MapFile::from_yaml(&text).unwrap(), proposal.map);
        assert!(text.contains("# nsu=urn:mill;s=9  Spindle/Note"), "{text}");
        assert!(text.contains("c2_feedoverride"), "{text}");
    }

    #[test]
    fn a_letter_that_ends_a_line_stays_in_its_remark() {
        let survey = Survey {
            variables: vec![variable("a\nvalues:", "b\nc", "urn:mill", "")],
            ..Survey::default()
        };
        let text = text_of(&propose(&survey)).unwrap();
        assert!(text.contains("# nsu=urn:mill;s=a values:  b c\n"), "{text}");
    }
}
