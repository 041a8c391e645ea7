//! What the columns of passes have in common: a number of the run in each row, and one unit.

use std::collections::BTreeSet;

use super::super::map::Direction;
use super::super::recognise::{Known, Recognised, Role};
use super::super::stated::quoted;
use super::super::units::Unit;
use super::Text;

/// The column of the run of rows that have one column up and one down, where targets come again.
pub(super) fn run<'f>(found: &'f Recognised, passes: &[(&Known, Direction)]) -> Option<&'f Known> {
    let run = found.first(Role::Run)?;
    let targets = found.first(Role::Target)?;
    let distinct: BTreeSet<u64> = targets.numbers.iter().map(|mm| mm.to_bits()).collect();
    let is_both = match passes {
        [(_, one), (_, other)] => one != other,
        _ => false,
    };
    (is_both && distinct.len() < targets.numbers.len()).then_some(run)
}

/// The unit that the names of other passes state, for one whose name has no unit.
pub(super) fn unit(passes: &[(&Known, Direction)], own: &Known) -> Option<Unit> {
    let mut stated = passes.iter().filter_map(|(column, _)| column.unit);
    let first = stated.next()?;
    let is_bare = own.unit.is_none() && own.unknown.is_none();
    (is_bare && stated.all(|unit| unit == first)).then_some(first)
}

impl Text<'_> {
    /// States the unit of other passes for one without.
    pub(super) fn unit_of_others(&mut self, column: &Known, (unit, wanted): (Unit, Unit)) {
        let name = &column.name;
        if unit != wanted {
            self.units
                .push(format!("{}: {}", quoted(name), unit.name()));
        }
        self.needed.push(format!(
            "column \"{name}\": no unit in its name, read in {} as the passes whose names have one",
            unit.name()
        ));
    }
}
