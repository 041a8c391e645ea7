//! A mapping proposed from what an agent says it has, for a person to go over.
//!
//! A position becomes an axis where its component's name begins with an ISO 841 letter; a rotary axis in
//! degrees is taken by `ANGLE` as well. Positions are those in machine coordinates (`MACHINE`, or none said, which means
//! the same): one in work coordinates jumps with every work offset, and is proposed as ignored, with a remark. What has
//! no meaning here is listed with the reason. Names are those of the data items. One device has one mapping: its keys
//! do not name the device. A rule of change is not proposed: an agent does not know how fast its machine warms up.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use metrology::{Axis, AxisSet};

use crate::document::DataItem;
use crate::mapping::{
    AxisEntry, MapFile, Meaning, Nothing, NumberEntry, PathEntry, TextEntry, name_of,
};
use crate::offer::plain_unit;
use crate::unit::Unit;

mod device;

pub use device::of_device;

/// A data item that the mapping does not tell, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Remark {
    /// Its key and what it is.
    pub item: String,
    /// Why it is not told.
    pub reason: String,
}

/// A proposed mapping.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Proposal {
    /// The mapping.
    pub map: MapFile,
    /// Items that it ignores.
    pub ignored: Vec<Remark>,
    /// Items that it does not have.
    pub left_out: Vec<Remark>,
}

/// A proposal in the making.
#[derive(Default)]
struct Proposing {
    values: BTreeMap<String, Meaning>,
    /// The key that tells an axis, actual and commanded.
    actual: BTreeMap<Axis, String>,
    commanded: BTreeMap<Axis, String>,
    names: BTreeSet<(String, bool)>,
    left_out: Vec<Remark>,
}

/// A mapping for all items that have a meaning here.
#[must_use]
pub fn propose(all: &[DataItem]) -> Proposal {
    let mut proposing = Proposing::default();
    let (items, without_id): (Vec<_>, Vec<_>) = all.iter().partition(|item| !item.id.is_empty());
    for item in without_id {
        let reason = "it has no id: no value of an agent can be told to be its";
        proposing.leave(item, reason.to_owned());
    }
    let (in_work, plain): (Vec<_>, Vec<_>) = items.into_iter().partition(|item| is_in_work(item));
    // Axes first, so that a path's position is proposed only where it tells something new.
    let (paths, single): (Vec<_>, Vec<_>) = plain
        .into_iter()
        .partition(|item| item.kind == "PATH_POSITION");
    for item in single.into_iter().chain(paths) {
        match meaning(item) {
            Ok(meaning) => proposing.take(item, meaning),
            Err(reason) => proposing.leave(item, reason),
        }
    }
    proposing.drop_commanded_alone(all);
    let mut ignored = Vec::new();
    for item in in_work {
        let reason = proposing.why_not_in_work(item);
        proposing
            .values
            .insert(item.id.clone(), Meaning::Ignored(Nothing {}));
        ignored.push(remark(item, reason));
    }
    Proposal {
        map: MapFile {
            values: proposing.values,
        },
        ignored,
        left_out: proposing.left_out,
    }
}

fn is_position(item: &DataItem) -> bool {
    ["POSITION", "ANGLE", "PATH_POSITION"].contains(&item.kind.as_str())
}

fn is_in_work(item: &DataItem) -> bool {
    is_position(item) && item.coordinates == "WORK" && item.category != "CONDITION"
}

fn remark(item: &DataItem, reason: String) -> Remark {
    Remark {
        item: format!("{}{}", item.id, described(item)),
        reason,
    }
}

/// What a data item is, behind its id.
fn described(item: &DataItem) -> String {
    let mut text = String::new();
    if !item.name.is_empty() {
        let _ = write!(text, " ({})", item.name);
    }
    for part in [&item.kind, &item.sub_kind] {
        if !part.is_empty() {
            let _ = write!(text, " {part}");
        }
    }
    if !item.component.is_empty() {
        let _ = write!(text, " of {}", item.component);
    }
    text
}

impl Proposing {
    fn leave(&mut self, item: &DataItem, reason: String) {
        self.left_out.push(remark(item, reason));
    }

    fn take(&mut self, item: &DataItem, mut meaning: Meaning) {
        let taken = match &mut meaning {
            Meaning::Position(entry) => taken(&mut self.actual, entry.axis, &item.id),
            Meaning::CommandedPosition(entry) => taken(&mut self.commanded, entry.axis, &item.id),
            Meaning::PathPosition(_) => self.take_path(&item.id),
            other => {
                self.name(item, other);
                Ok(())
            }
        };
        match taken {
            Ok(()) => {
                self.values.insert(item.id.clone(), meaning);
            }
            Err(reason) => self.leave(item, reason),
        }
    }

    fn take_path(&mut self, key: &str) -> Result<(), String> {
        let told = Axis::LINEAR
            .into_iter()
            .find_map(|axis| Some((axis, self.actual.get(&axis)?)));
        if let Some((axis, by)) = told {
            return Err(format!("{axis} is told by {by}"));
        }
        for axis in Axis::LINEAR {
            self.actual.insert(axis, key.to_owned());
        }
        Ok(())
    }

    fn name(&mut self, item: &DataItem, meaning: &mut Meaning) {
        let is_alarm = matches!(meaning, Meaning::Condition(_));
        let wanted = if item.name.is_empty() {
            &item.id
        } else {
            &item.name
        };
        let mut name = name_of(wanted);
        let mut n = 2;
        while name.is_empty() || !self.names.insert((name.clone(), is_alarm)) {
            name = name_of(&format!("{wanted}_{n}"));
            n += 1;
        }
        meaning.set_name(name);
    }

    /// A commanded position alone makes no state.
    fn drop_commanded_alone(&mut self, items: &[DataItem]) {
        let actual: AxisSet = self.actual.keys().copied().collect();
        let mut dropped = Vec::new();
        self.values.retain(|key, meaning| match meaning {
            Meaning::CommandedPosition(entry) if !actual.contains(entry.axis) => {
                dropped.push((key.clone(), entry.axis));
                false
            }
            _ => true,
        });
        for (key, axis) in dropped {
            if let Some(item) = items.iter().find(|item| item.id == key) {
                self.leave(item, format!("{axis} has no actual position here"));
            }
        }
    }

    fn why_not_in_work(&self, item: &DataItem) -> String {
        let offset = "work coordinates: it jumps with every work offset";
        let told = match axis(item) {
            Some(axis) if item.kind != "PATH_POSITION" => self.actual.get(&axis),
            _ => self.actual.get(&Axis::X),
        };
        told.map_or_else(
            || format!("{offset}; no position in machine coordinates is told: map it only where no work offset is ever used"),
            |by| format!("{offset}; {by} is in machine coordinates"),
        )
    }
}

fn taken(told: &mut BTreeMap<Axis, String>, axis: Axis, key: &str) -> Result<(), String> {
    if let Some(by) = told.get(&axis) {
        return Err(format!("{axis} is told by {by}"));
    }
    told.insert(axis, key.to_owned());
    Ok(())
}

fn unit(item: &DataItem) -> Result<Unit, String> {
    let word = plain_unit(&item.units);
    let known = Unit::ALL.into_iter().find(|unit| unit.word() == word);
    known.ok_or_else(|| match word {
        "" => "it has no unit".to_owned(),
        word => format!("unit {word} is not known here"),
    })
}

fn axis(item: &DataItem) -> Option<Axis> {
    let (_, name) = item.component.split_once(' ')?;
    let letter: String = name.chars().take(1).collect();
    let rest_is_plain = name.chars().skip(1).all(|c| !c.is_ascii_digit());
    letter.parse().ok().filter(|_| rest_is_plain)
}

fn is_commanded(item: &DataItem) -> bool {
    ["COMMANDED", "PROGRAMMED"].contains(&item.sub_kind.as_str())
}

/// A position of one axis, or the reason why it is not one.
fn position(item: &DataItem) -> Result<Meaning, String> {
    let axis = axis(item).ok_or_else(|| match item.component.as_str() {
        "" => "its component has no name".to_owned(),
        component => format!("{component} is no axis by its name"),
    })?;
    let unit = unit(item)?;
    if !unit.measures_position(axis.is_linear()) {
        return Err(format!("{} does not measure axis {axis}", unit.word()));
    }
    let entry = AxisEntry { axis, unit };
    match item.sub_kind.as_str() {
        "" | "ACTUAL" => Ok(Meaning::Position(entry)),
        _ if is_commanded(item) => Ok(Meaning::CommandedPosition(entry)),
        other => Err(format!(
            "{other} is neither where the axis is nor where it is commanded"
        )),
    }
}

fn meaning(item: &DataItem) -> Result<Meaning, String> {
    let text = TextEntry::default;
    if item.category == "CONDITION" {
        return Ok(Meaning::Condition(text()));
    }
    if !item.statistic.is_empty() {
        return Err(format!("{} is formed over an interval", item.statistic));
    }
    if ["DATA_SET", "TABLE"].contains(&item.representation.as_str()) {
        return Err(format!("{} is not one value", item.representation));
    }
    let number = || -> Result<NumberEntry, String> {
        Ok(NumberEntry {
            name: None,
            unit: unit(item)?,
            series: item.representation == "TIME_SERIES",
            change: None,
        })
    };
    let nothing = || Err("it has no meaning here".to_owned());
    Ok(match item.kind.as_str() {
        "POSITION" | "ANGLE" => return position(item),
        "PATH_POSITION" => match item.sub_kind.as_str() {
            "" | "ACTUAL" => Meaning::PathPosition(PathEntry { unit: unit(item)? }),
            other => return Err(format!("{other} is not where the path is")),
        },
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
        _ => return nothing(),
    })
}

/// The mapping file's text, with what is ignored and left out in comments.
///
/// # Errors
/// When it has no text, which no mapping is known for.
pub fn text_of(proposal: &Proposal) -> Result<String, serde_saphyr::ser::Error> {
    let mut text = serde_saphyr::to_string(&proposal.map)?;
    for (head, remarks) in [
        ("ignored:", &proposal.ignored),
        ("left out:", &proposal.left_out),
    ] {
        if remarks.is_empty() {
            continue;
        }
        if !text.ends_with('\n') {
            text.push('\n');
        }
        let _ = writeln!(text, "# {head}");
        for Remark { item, reason } in remarks {
            // A name with a line's end would end the comment.
            let (item, reason) = (item.escape_debug(), reason.escape_debug());
            let _ = writeln!(text, "#   {item}: {reason}");
        }
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::Device;
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
            ..DataItem::default()
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
        let proposal = propose(&items);
        Mapping::new(&proposal.map).unwrap();
        let keys: Vec<_> = proposal.map.values.keys().map(String::as_str).collect();
        assert_eq!(keys, ["ba", "c_load", "ex", "fo", "srpm", "st", "xa", "xc"]);
        let text = text_of(&proposal).unwrap();
        assert_eq!(MapFile::from_yaml(&text).unwrap(), proposal.map);
        let remarks = "# left out:
#   z2 (Z2) POSITION ACTUAL of Linear Z2: Linear Z2 is no axis by its name
#   v (V) VOLTAGE of Systems x: it has no meaning here
#   pp (PP) PATH_POSITION ACTUAL of Path path: X is told by xa
";
        assert!(text.ends_with(remarks), "{text}");
    }

    #[test]
    fn machine_coordinates_come_before_work_coordinates_whatever_their_order() {
        let position = |id: &str, coordinates: &str| DataItem {
            coordinates: coordinates.to_owned(),
            ..item("Linear X", id, "POSITION", "ACTUAL", "MILLIMETER")
        };
        let told = |items: &[DataItem]| {
            let proposal = propose(items);
            Mapping::new(&proposal.map).unwrap();
            let of = |wanted: fn(&Meaning) -> bool| -> Vec<String> {
                let chosen = proposal.map.values.iter().filter(|(_, one)| wanted(one));
                chosen.map(|(key, _)| key.clone()).collect()
            };
            (
                of(|one| matches!(one, Meaning::Position(_))),
                of(|one| matches!(one, Meaning::Ignored(_))),
                proposal.left_out.len(),
            )
        };
        let keys = |all: &[&str]| all.iter().map(|key| (*key).to_owned()).collect::<Vec<_>>();
        let (work, machine, plain) = (
            position("w", "WORK"),
            position("m", "MACHINE"),
            position("p", ""),
        );
        for items in [[&work, &machine], [&machine, &work]] {
            let items = items.map(Clone::clone);
            assert_eq!(told(&items), (keys(&["m"]), keys(&["w"]), 0));
        }
        let items = [work.clone(), plain, machine];
        assert_eq!(told(&items), (keys(&["p"]), keys(&["w"]), 1));
        assert_eq!(
            told(std::slice::from_ref(&work)),
            (keys(&[]), keys(&["w"]), 0)
        );
        let text = text_of(&propose(&[work])).unwrap();
        assert!(
            text.contains("#   w (W) POSITION ACTUAL of Linear X: work coordinates"),
            "{text}"
        );
    }

    fn devices(names: &[&str]) -> Vec<Device> {
        let device = |name: &&str| Device {
            name: (*name).to_owned(),
            is_of_agent: *name == "agent",
        };
        names.iter().map(device).collect()
    }

    #[test]
    #[expect(clippy::type_complexity, reason = "a table of cases")]
    fn one_device_has_one_mapping_also_where_devices_have_no_items() {
        let of = |(n, device): (usize, &&str)| DataItem {
            device: (*device).to_owned(),
            is_of_agent: *device == "agent",
            id: format!("i{n}"),
            ..DataItem::default()
        };
        let several = "the agent has 2 devices: choose one by --device: lathe, mill";
        let table: [(&[&str], &[&str], Option<&str>, Result<usize, &str>); 11] = [
            (&["agent", "mill"], &["agent", "mill"], None, Ok(1)),
            (&["agent", "mill"], &["agent", "mill"], Some("agent"), Ok(1)),
            (&["mill"], &[], None, Ok(0)),
            (&["agent"], &["agent"], None, Ok(1)),
            (&[], &[], None, Ok(0)),
            (
                &["mill", "lathe"],
                &["mill", "lathe", "mill"],
                None,
                Err(several),
            ),
            (
                &["mill", "lathe"],
                &["mill", "lathe", "mill"],
                Some("mill"),
                Ok(2),
            ),
            (&["mill", "lathe"], &[], None, Err(several)),
            (&["mill", "lathe"], &["mill"], None, Err(several)),
            (
                &["mill", "lathe"],
                &["mill"],
                Some("saw"),
                Err("the agent has no device \"saw\": it has lathe, mill"),
            ),
            (
                &["mill", "mill"],
                &["mill"],
                Some("mill"),
                Err(
                    "the agent has 2 devices \"mill\": give each a name of its own in the agent's device file",
                ),
            ),
        ];
        for (named, items, chosen, wanted) in table {
            let items: Vec<DataItem> = items.iter().enumerate().map(of).collect();
            let found = of_device(&devices(named), &items, chosen);
            let found = found.map(|items| items.len()).map_err(|e| e.to_string());
            assert_eq!(found, wanted.map_err(str::to_owned), "{named:?} {chosen:?}");
        }
    }

    #[test]
    fn an_id_that_two_data_items_have_is_refused_with_both() {
        let mill = devices(&["mill"]);
        let one = item("Linear X", "x", "POSITION", "ACTUAL", "MILLIMETER");
        let other = item("Rotary S", "x", "TEMPERATURE", "", "CELSIUS");
        let third = item("Rotary S", "s", "TEMPERATURE", "", "CELSIUS");
        let ids = |items: &[&DataItem], name| {
            let items: Vec<DataItem> = items.iter().map(|item| (*item).clone()).collect();
            of_device(&mill, &items, name).map(|items| items.len())
        };
        assert_eq!(ids(&[&one, &third], None).unwrap(), 2);
        for items in [
            &[&one, &other, &third][..],
            &[&one, &one],
            &[&third, &other, &one],
        ] {
            for name in [None, Some("mill")] {
                let error = ids(items, name).unwrap_err().to_string();
                assert!(
                    error.contains("\"x\": (X) POSITION ACTUAL of Linear X")
                        || error.contains("\"x\": (X) TEMPERATURE"),
                    "{error}"
                );
            }
        }
        // Another device's ids are its own.
        let elsewhere = DataItem {
            device: "lathe".to_owned(),
            ..one.clone()
        };
        let both = devices(&["mill", "lathe"]);
        let found = of_device(&both, &[one, elsewhere], Some("mill"));
        assert_eq!(found.unwrap().len(), 1);
    }

    #[test]
    fn a_name_with_a_line_end_ends_no_comment() {
        let odd = DataItem {
            name: "a\nvalues: {}".to_owned(),
            ..item("Systems x", "v", "VOLTAGE", "", "VOLT")
        };
        let proposal = propose(&[odd]);
        let text = text_of(&proposal).unwrap();
        assert_eq!(MapFile::from_yaml(&text).unwrap(), proposal.map);
    }
}
