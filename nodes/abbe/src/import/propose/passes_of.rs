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

#[cfg(test)]
mod tests {
    use metrology::yaml;

    use super::super::super::map::Map;
    use super::super::of;
    use super::*;

    /// The units of the columns of a table of passes, and remarks on them.
    fn units(names: [&str; 4]) -> (Vec<Option<Unit>>, String) {
        let home = tempfile::tempdir().expect("a folder");
        let path = home.path().join("a.csv");
        let head = names.join(",");
        let rows =
            "0,0.011,0.012,0.013,0.014\n100,0.021,0.022,0.023,0.024\n200,0.031,0.032,0.033,0.034\n";
        std::fs::write(&path, format!("target_mm,{head}\n{rows}")).expect("a file");
        let proposal = of(&path).expect("a map");
        let map: Map = yaml::read_letters(&proposal.map).expect("a map");
        let units = names.map(|name| map.units.get(name).copied());
        (units.to_vec(), proposal.needed.join("\n"))
    }

    #[test]
    fn the_unit_of_one_pass_is_that_of_those_without() {
        let (found, said) = units(["run 1 up [mm]", "run 1 down", "run 2 up", "run 2 down"]);
        assert_eq!(found, [Some(Unit::Mm); 4]);
        let words = "column \"run 2 down\": no unit in its name, read in mm as the passes whose names have one";
        assert!(said.contains(words), "{said}");
        let (found, said) = units(["run 1 up", "run 1 down", "run 2 up", "run 2 down [µm]"]);
        assert_eq!(found, [None; 4]);
        assert_eq!(
            said.matches("read in um as the passes").count(),
            3,
            "{said}"
        );
        // Two units say nothing of a third pass.
        let (found, said) = units([
            "run 1 up [mm]",
            "run 1 down [um]",
            "run 2 up",
            "run 2 down [mm]",
        ]);
        assert_eq!(found[0], Some(Unit::Mm));
        assert_eq!(found[3], Some(Unit::Mm));
        assert!(!said.contains("as the passes"), "{said}");
    }
}
