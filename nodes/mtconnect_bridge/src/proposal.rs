//! A mapping proposed from what an agent says it has, for a person to go over.
//!
//! A position becomes an axis where its component's name begins with an ISO 841 letter; a rotary axis in
//! degrees is taken by `ANGLE` as well. What has no meaning here is left out. Names are those of the data items.
//! A rule of change is not proposed: an agent does not know how fast its machine warms up.

use std::collections::{BTreeMap, BTreeSet};

use metrology::{Axis, AxisSet};

use crate::document::DataItem;
use crate::mapping::{AxisEntry, MapFile, Meaning, NumberEntry, PathEntry, TextEntry, name_of};
use crate::unit::Unit;

/// A mapping for all items that have a meaning here.
#[must_use]
pub fn propose(items: &[DataItem]) -> MapFile {
    let mut values = BTreeMap::new();
    let (mut actual, mut commanded) = (AxisSet::default(), AxisSet::default());
    let mut names = BTreeSet::new();
    // Axes first, so that a path's position is proposed only where it tells something new.
    let (mut sorted, mut paths) = (Vec::new(), Vec::new());
    for item in items {
        if item.kind == "PATH_POSITION" {
            paths.push(item)
        } else {
            sorted.push(item)
        }
    }
    sorted.extend(paths);
    for item in sorted {
        let Some(meaning) = meaning(item) else {
            continue;
        };
        let (key, mut meaning) = (item.id.clone(), meaning);
        match &mut meaning {
            Meaning::Position(entry) if actual.contains(entry.axis) => continue,
            Meaning::Position(entry) => actual = actual.with(entry.axis),
            Meaning::CommandedPosition(entry) if commanded.contains(entry.axis) => continue,
            Meaning::CommandedPosition(entry) => commanded = commanded.with(entry.axis),
            Meaning::PathPosition(_) if Axis::LINEAR.iter().any(|axis| actual.contains(*axis)) => {
                continue;
            }
            Meaning::PathPosition(_) => {
                actual = Axis::LINEAR
                    .iter()
                    .fold(actual, |axes, axis| axes.with(*axis));
            }
            other => {
                let is_alarm = matches!(other, Meaning::Condition(_));
                let wanted = if item.name.is_empty() {
                    &item.id
                } else {
                    &item.name
                };
                let mut name = name_of(wanted);
                let mut n = 2;
                while name.is_empty() || !names.insert((name.clone(), is_alarm)) {
                    name = name_of(&format!("{wanted}_{n}"));
                    n += 1;
                }
                other.set_name(name);
            }
        }
        values.insert(key, meaning);
    }
    // A commanded position alone makes no state.
    values.retain(|_, meaning| match meaning {
        Meaning::CommandedPosition(entry) => actual.contains(entry.axis),
        _ => true,
    });
    MapFile { values }
}

impl Meaning {
    fn set_name(&mut self, new: String) {
        match self {
            Self::Feed(entry)
            | Self::SpindleSpeed(entry)
            | Self::Temperature(entry)
            | Self::Load(entry)
            | Self::Override(entry) => entry.name = Some(new),
            Self::Execution(entry)
            | Self::ControllerMode(entry)
            | Self::Text(entry)
            | Self::Message(entry)
            | Self::Condition(entry) => entry.name = Some(new),
            Self::Position(_)
            | Self::CommandedPosition(_)
            | Self::PathPosition(_)
            | Self::Ignored(_) => {}
        }
    }
}

fn unit(item: &DataItem) -> Option<Unit> {
    // Three numbers have a unit with `_3D` behind it.
    let word = item.units.strip_suffix("_3D").unwrap_or(&item.units);
    Unit::ALL.into_iter().find(|unit| unit.word() == word)
}

fn axis(item: &DataItem) -> Option<Axis> {
    let (_, name) = item.component.split_once(' ')?;
    let letter: String = name.chars().take(1).collect();
    let rest_is_plain = name.chars().skip(1).all(|c| !c.is_ascii_digit());
    letter.parse().ok().filter(|_| rest_is_plain)
}

fn meaning(item: &DataItem) -> Option<Meaning> {
    let text = TextEntry::default;
    if item.category == "CONDITION" {
        return Some(Meaning::Condition(text()));
    }
    let is_commanded = ["COMMANDED", "PROGRAMMED"].contains(&item.sub_kind.as_str());
    let number = || {
        Some(NumberEntry {
            name: None,
            unit: unit(item)?,
            series: item.representation == "TIME_SERIES",
            change: None,
        })
    };
    let meaning = match item.kind.as_str() {
        "POSITION" | "ANGLE" => {
            let entry = AxisEntry {
                axis: axis(item)?,
                unit: unit(item)?,
            };
            let fits = entry.unit.measures_position(entry.axis.is_linear());
            let meaning = if is_commanded {
                Meaning::CommandedPosition
            } else {
                Meaning::Position
            };
            return fits.then(|| meaning(entry));
        }
        "PATH_POSITION" if !is_commanded => Meaning::PathPosition(PathEntry { unit: unit(item)? }),
        "PATH_FEEDRATE" | "AXIS_FEEDRATE" if item.units != "PERCENT" => Meaning::Feed(number()?),
        "ROTARY_VELOCITY" | "SPINDLE_SPEED" if item.units != "PERCENT" => {
            Meaning::SpindleSpeed(number()?)
        }
        "TEMPERATURE" => Meaning::Temperature(number()?),
        "LOAD" => Meaning::Load(number()?),
        "PATH_FEEDRATE" | "AXIS_FEEDRATE" | "ROTARY_VELOCITY" | "SPINDLE_SPEED" => {
            Meaning::Override(number()?)
        }
        "EXECUTION" => Meaning::Execution(text()),
        "CONTROLLER_MODE" => Meaning::ControllerMode(text()),
        "PROGRAM" | "LINE" | "LINE_NUMBER" | "TOOL_NUMBER" | "TOOL_ASSET_ID" | "BLOCK"
        | "EMERGENCY_STOP" | "AVAILABILITY" => Meaning::Text(text()),
        "PATH_FEEDRATE_OVERRIDE" | "ROTARY_VELOCITY_OVERRIDE" | "AXIS_FEEDRATE_OVERRIDE" => {
            // These have no unit of their own: the standard says percent.
            Meaning::Override(NumberEntry {
                name: None,
                unit: Unit::Percent,
                series: false,
                change: None,
            })
        }
        "MESSAGE" => Meaning::Message(text()),
        _ => return None,
    };
    Some(meaning)
}

/// The mapping file's text.
///
/// # Errors
/// When it has no text, which no mapping is known for.
pub fn text_of(map: &MapFile) -> Result<String, serde_saphyr::ser::Error> {
    serde_saphyr::to_string(map)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mapping::Mapping;

    fn item(component: &str, id: &str, kind: &str, sub_kind: &str, units: &str) -> DataItem {
        DataItem {
            device: "mill".to_owned(),
            component: component.to_owned(),
            id: id.to_owned(),
            name: id.to_uppercase(),
            category: if units.is_empty() { "EVENT" } else { "SAMPLE" }.to_owned(),
            kind: kind.to_owned(),
            sub_kind: sub_kind.to_owned(),
            units: units.to_owned(),
            representation: String::new(),
        }
    }

    #[test]
    fn a_proposal_holds_what_has_a_meaning_and_is_a_mapping() {
        let mut alarm = item("Rotary C", "c_load", "LOAD", "", "");
        alarm.category = "CONDITION".to_owned();
        let items = [
            item(
                "Path path",
                "pp",
                "PATH_POSITION",
                "ACTUAL",
                "MILLIMETER_3D",
            ),
            item("Linear X", "xa", "POSITION", "ACTUAL", "MILLIMETER"),
            item("Linear X", "xc", "POSITION", "COMMANDED", "MILLIMETER"),
            item("Linear Z2", "z2", "POSITION", "ACTUAL", "MILLIMETER"),
            item("Rotary B", "ba", "ANGLE", "ACTUAL", "DEGREE"),
            item(
                "Rotary S",
                "srpm",
                "ROTARY_VELOCITY",
                "ACTUAL",
                "REVOLUTION/MINUTE",
            ),
            item("Rotary S", "st", "TEMPERATURE", "", "CELSIUS"),
            item(
                "Path path",
                "fo",
                "PATH_FEEDRATE_OVERRIDE",
                "PROGRAMMED",
                "",
            ),
            item("Path path", "ex", "EXECUTION", "", ""),
            item("Systems x", "v", "VOLTAGE", "", "VOLT"),
            alarm,
        ];
        let map = propose(&items);
        Mapping::new(&map).unwrap();
        let keys: Vec<_> = map.values.keys().map(String::as_str).collect();
        assert_eq!(keys, ["ba", "c_load", "ex", "fo", "srpm", "st", "xa", "xc"]);
        let again = MapFile::from_yaml(&text_of(&map).unwrap()).unwrap();
        assert_eq!(again, map);
    }
}
