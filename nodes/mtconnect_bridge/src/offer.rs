//! What the mapping wants, compared with what an agent says it has.

use crate::condition::Condition;
use crate::document::DataItem;
use crate::mapping::{Mapping, Use};
use crate::unit::Unit;

/// One key of the mapping.
#[derive(Clone, Debug)]
struct Key {
    key: String,
    unit: Option<Unit>,
    is_position: bool,
    /// Whether the agent had it in another unit.
    differs: bool,
}

/// What the mapping wants.
#[derive(Clone, Debug)]
pub struct Wanted {
    keys: Vec<Key>,
    was_in_work: bool,
}

/// An agent's unit without what says that it has three numbers.
#[must_use]
pub fn plain_unit(units: &str) -> &str {
    units.strip_suffix("_3D").unwrap_or(units)
}

impl Wanted {
    /// All keys of a mapping that are not ignored.
    #[must_use]
    pub fn new(mapping: &Mapping) -> Self {
        let wanted = mapping.uses().filter(|(_, used)| **used != Use::Nothing);
        let key = |(key, used): (&str, &Use)| Key {
            key: key.to_owned(),
            unit: mapping.unit(key),
            is_position: matches!(used, Use::Position { .. }),
            differs: false,
        };
        Self {
            keys: wanted.map(key).collect(),
            was_in_work: false,
        }
    }

    /// What an agent has not, has in another unit, or in work coordinates; or has right, after it had it wrong.
    #[must_use]
    pub fn compare(&mut self, items: &[DataItem]) -> Vec<Condition> {
        let offered = |key: &Key| {
            items
                .iter()
                .find(|item| item.id == key.key || item.name == key.key)
        };
        let (mut missing, mut in_work, mut found) = (Vec::new(), Vec::new(), Vec::new());
        for key in &mut self.keys {
            let Some(item) = offered(key) else {
                missing.push(key.key.as_str());
                continue;
            };
            if key.is_position && item.coordinates == "WORK" {
                in_work.push(key.key.as_str());
            }
            let offered = plain_unit(&item.units);
            let mapped = key.unit.map(Unit::word);
            let other = mapped.filter(|mapped| !offered.is_empty() && offered != *mapped);
            let differed = std::mem::replace(&mut key.differs, other.is_some());
            if let Some(mapped) = other {
                found.push(Condition::UnitDiffers {
                    key: key.key.clone(),
                    mapped,
                    offered: offered.to_owned(),
                });
            } else if differed {
                let key = key.key.clone();
                found.push(Condition::UnitAgrees { key });
            }
        }
        let was_in_work = std::mem::replace(&mut self.was_in_work, !in_work.is_empty());
        if in_work.is_empty() && was_in_work {
            found.push(Condition::MachineCoordinates);
        }
        if !in_work.is_empty() {
            let keys = in_work.join(", ");
            found.push(Condition::WorkCoordinates { keys });
        }
        found.push(if missing.is_empty() {
            Condition::Offered
        } else {
            let keys = missing.join(", ");
            Condition::NotOffered { keys }
        });
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mapping::MapFile;

    fn item(id: &str, units: &str, coordinates: &str) -> DataItem {
        DataItem {
            id: id.to_owned(),
            units: units.to_owned(),
            coordinates: coordinates.to_owned(),
            ..DataItem::default()
        }
    }

    #[test]
    fn units_coordinates_and_absent_items_are_compared() {
        let map = "values:\n  x: {is: position, axis: X, unit: MILLIMETER}\n  p: {is: commanded_position, axis: X, unit: INCH}\n  f: {is: feed, unit: MILLIMETER/SECOND}\n  e: {is: execution}\n  i: {is: ignored}\n";
        let mapping = Mapping::new(&MapFile::from_yaml(map).unwrap()).unwrap();
        let items = [
            item("x", "INCH", "WORK"),
            item("p", "INCH_3D", ""),
            item("f", "", ""),
        ];
        let mut all = Wanted::new(&mapping);
        let mut compared = |items: &[DataItem]| -> Vec<String> {
            let said = all.compare(items).into_iter();
            said.map(|condition| format!("{}: {condition}", condition.name()))
                .collect()
        };
        let said = compared(&items);
        let wanted = [
            "unit/x: x: the mapping has MILLIMETER, the agent's probe INCH: told as the mapping says; correct the mapping or the agent's device file",
            "work_coordinates: positions in work coordinates, which every work offset moves: x; map those in machine coordinates",
            "not_offered: in the mapping, and the agent has it not: e",
        ];
        assert_eq!(said, wanted);
        let right = [
            item("x", "MILLIMETER", ""),
            item("p", "INCH", ""),
            item("f", "MILLIMETER/SECOND", ""),
            item("e", "", ""),
        ];
        let wanted = [
            "unit/x: x: the agent's probe has the mapping's unit",
            "work_coordinates: no position of the mapping is in work coordinates",
            "not_offered: the agent has all of the mapping",
        ];
        assert_eq!(compared(&right), wanted);
        assert_eq!(compared(&right).len(), 1);
    }
}
