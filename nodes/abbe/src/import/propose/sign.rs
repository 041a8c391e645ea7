//! The sign of a deviation, which is the measured position less the target.

use anyhow::{Result, bail};

use super::super::recognise::{Known, Recognised, Role};
use super::super::units::Unit;
use super::super::vocabulary::{is_correction, is_reversed};

/// Columns whose rows differ by less of the greatest number are each other's negative.
const SAME_SHARE: f64 = 0.01;

/// A sentence on columns whose names leave the sign open; empty without any.
pub fn unsure(found: &Recognised) -> String {
    let columns = found.columns.iter().map(|column| column.name.as_str());
    let names = columns.filter(|name| is_correction(name) || is_reversed(name));
    let names: Vec<String> = names.map(|name| format!("\"{name}\"")).collect();
    if names.is_empty() {
        return String::new();
    }
    format!(
        "column {}: is no deviation (measured position less target) by its name, and may have its negative: turn its sign where it \
         has, and name it as deviation_um in a map; ",
        names.join(", ")
    )
}

/// Refuses a column of deviations beside which another one has their negatives.
///
/// # Errors
/// With both names.
pub fn check(found: &Recognised, read: &Known) -> Result<()> {
    let others = found.all(Role::Deviation);
    let mut others = others.filter(|other| other.name != read.name);
    let Some(other) = others.find(|other| is_negative(read, other)) else {
        return Ok(());
    };
    bail!(
        "columns \"{}\" and \"{}\": one is the negative of the other: name the one that is the measured position less the target \
         in a map (abbe import --propose without the other one prints it)",
        read.name,
        other.name
    );
}

/// Whether each number of one column is the negative of that of the other, in whatever unit.
fn is_negative(one: &Known, other: &Known) -> bool {
    let greatest = |column: &Known| {
        let sizes = column.numbers.iter().map(|number| number.abs());
        sizes.fold(0.0, f64::max)
    };
    let (most, most_other) = (greatest(one), greatest(other));
    let size = |column: &Known| column.unit.map_or(1.0, Unit::size);
    let is_one_size =
        (size(one) * most - size(other) * most_other).abs() <= SAME_SHARE * size(one) * most;
    let is_unsized = one.unit.is_none() || other.unit.is_none();
    let has_numbers = one.numbers.len() == other.numbers.len() && most > 0.0 && most_other > 0.0;
    has_numbers
        && (is_one_size || is_unsized)
        && one
            .numbers
            .iter()
            .zip(&other.numbers)
            .all(|(a, b)| (a / most + b / most_other).abs() <= SAME_SHARE)
}

#[cfg(test)]
mod tests {
    use super::super::super::recognise::of_text;
    use super::*;

    #[test]
    fn a_column_of_the_negatives_makes_the_sign_unsure_and_others_do_not() {
        for (name, of, is_refused) in [
            ("error_um", [-0.5, 1.25, 3.0], true),
            ("error_mm", [-0.0005, 0.00125, 0.003], true),
            ("Fehler", [-0.5, 1.25, 3.0], true),
            ("error_um", [0.5, -1.25, -3.0], false),
            ("max error um", [3.0, 3.0, 3.0], false),
            ("error_um", [-0.5, 1.0, 3.0], false),
        ] {
            let rows = [0.5, -1.25, -3.0].iter().zip(of).enumerate();
            let rows: String = rows
                .map(|(k, (d, e))| format!("{},{d},{e}\n", 100 * k))
                .collect();
            let found = of_text(&format!("target_mm,deviation_um,{name}\n{rows}"))
                .unwrap()
                .unwrap();
            let read = found.first(Role::Deviation).unwrap();
            let checked = check(&found, read);
            assert_eq!(checked.is_err(), is_refused, "{name} {of:?}");
        }
    }

    #[test]
    fn names_of_corrections_are_named_where_nothing_else_is_a_deviation() {
        for name in [
            "error compensation um",
            "correction",
            "Soll-Ist",
            "target - actual [um]",
        ] {
            let text = format!("run,target_mm,{name}\n1,0,0.5\n1,100,-0.5\n");
            let found = of_text(&text).unwrap().unwrap();
            assert_eq!(found.first(Role::Deviation), None, "{name}");
            let words = unsure(&found);
            assert!(words.contains(&format!("\"{name}\"")), "{words}");
        }
        let found = of_text("run,target_mm,deviation_um\n1,0,0.5\n1,100,-0.5\n");
        assert_eq!(unsure(&found.unwrap().unwrap()), "");
    }
}
