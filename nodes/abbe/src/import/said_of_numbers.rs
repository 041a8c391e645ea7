//! Columns that say the unit, the sign or a factor of the numbers beside them.

use metrology::yaml::shown;

use super::recognise::{Known, Role};
use super::table::number_of;
use super::units::Unit;
use super::vocabulary::{is_foreign, words};

/// Lines of cells with their numbers.
type Lines = [(u64, Vec<String>)];

/// Names of such columns, as one of the words of a name.
const UNIT_COLUMN_NAMES: &[&str] = &[
    "unit",
    "units",
    "einheit",
    "einheiten",
    "unité",
    "unités",
    "unite",
    "unidad",
    "unità",
];
const SIGN_NAMES: &[&str] = &["sign", "vorzeichen", "signe", "segno", "signo"];
const FACTOR_NAMES: &[&str] = &[
    "factor",
    "faktor",
    "facteur",
    "fattore",
    "multiplier",
    "multiplikator",
    "scaling",
];

/// What is wrong with a column that says the unit, the sign or a factor of others: another unit than they are read in, a
/// minus, or a factor that is not 1.
pub fn odd(columns: &[Known], head: &[String], lines: &Lines) -> Option<String> {
    let place = |names: &[&str], k: usize| {
        let words = head.get(k).map(|name| words(name)).unwrap_or_default();
        let is_one = words.iter().any(|word| names.contains(&word.as_str()));
        is_one && words.len() <= 2
    };
    let at = |names: &'static [&'static str]| (0..head.len()).filter(move |k| place(names, *k));
    let unit = at(UNIT_COLUMN_NAMES).find_map(|k| odd_unit(columns, head, (lines, k)));
    let sign = || at(SIGN_NAMES).find_map(|k| odd_sign(columns, head, (lines, k)));
    let factor = || at(FACTOR_NAMES).find_map(|k| odd_factor(head, (lines, k)));
    unit.or_else(sign).or_else(factor)
}

fn cells(lines: &Lines, k: usize) -> impl Iterator<Item = (u64, &str)> {
    let cells = lines
        .iter()
        .filter_map(move |(line, cells)| Some((*line, cells.get(k)?.as_str())));
    cells.filter(|(_, cell)| !cell.is_empty())
}

/// A unit that no column of its kind has, or two of one kind.
fn odd_unit(columns: &[Known], head: &[String], (lines, k): (&Lines, usize)) -> Option<String> {
    let units = cells(lines, k).map(|(line, cell)| (line, cell, Unit::of_word(cell)));
    let name = head.get(k)?;
    let mut first: Option<(u64, &str, Unit)> = None;
    for (line, cell, unit) in units {
        let Some(unit) = unit else {
            return no_unit(name, (line, cell));
        };
        let Some((first_line, first_cell, first_unit)) = first else {
            first = Some((line, cell, unit));
            continue;
        };
        if unit != first_unit {
            return Some(format!(
                "line {line}, column \"{}\": \"{}\", and \"{}\" in line {first_line}: write the numbers of a column in one unit, and the unit into \
                 its name",
                shown(name),
                shown(cell),
                shown(first_cell)
            ));
        }
    }
    let (line, cell, unit) = first?;
    let is_read = |column: &&Known| {
        let role = column.role;
        matches!(
            role,
            Some(
                Role::Target
                    | Role::Deviation
                    | Role::Measured
                    | Role::Displacement
                    | Role::Radial
                    | Role::Pass(_)
            )
        )
    };
    let own: Vec<&Known> = columns
        .iter()
        .filter(is_read)
        .filter(|column| is_of(column, &words(name)))
        .collect();
    let is_reading = |column: &&Known| column.role != Some(Role::Target);
    let has_reading = own.iter().any(is_reading);
    let own = own
        .iter()
        .filter(|column| is_reading(column) || !has_reading);
    let mut alike = own
        .map(|column| used(column))
        .filter(|own| own.kind() == unit.kind())
        .peekable();
    let is_used = alike.peek().is_none() || alike.any(|own| own == unit);
    (!is_used).then(|| {
        format!(
            "line {line}, column \"{}\": \"{}\": the numbers beside it are read in another unit: write the unit into the name of its column, \
             such as \"deviation [{}]\", or state it in units of a map",
            shown(name),
            shown(cell),
            shown(cell)
        )
    })
}

/// A cell with a unit that is not known, such as `0.1 mm`; none of other texts and of rates.
fn no_unit(name: &str, (line, cell): (u64, &str)) -> Option<String> {
    let is_unit = |word: &String| Unit::of_word(word).is_some() || is_foreign(word);
    let is_one = !cell.contains('/') && words(cell).iter().any(is_unit);
    is_one.then(|| {
        format!(
            "line {line}, column \"{}\": \"{}\": is no unit that is known: convert the numbers beside it, and write their unit into the name of \
             their column",
            shown(name),
            shown(cell)
        )
    })
}

/// Whether a column of units may be that of a column: it shares a word, or it names no column and the other has no unit.
fn is_of(column: &Known, words_of_unit: &[String]) -> bool {
    match words_of_unit {
        [_] => column.unit.is_none() && column.unknown.is_none(),
        several => {
            let own = words(&column.name);
            own.iter().any(|word| several.contains(word))
        }
    }
}

/// The unit that a column is read in.
fn used(column: &Known) -> Unit {
    let default = match column.role {
        Some(Role::Target | Role::Measured) => Unit::Mm,
        _ => Unit::Um,
    };
    column.unit.unwrap_or(default)
}

/// A minus beside numbers that have none.
fn odd_sign(columns: &[Known], head: &[String], (lines, k): (&Lines, usize)) -> Option<String> {
    let is_sign = |cell: &str| matches!(cell, "+" | "-" | "\u{2212}" | "\u{2013}" | "1" | "-1");
    if !cells(lines, k).all(|(_, cell)| is_sign(cell)) {
        return None;
    }
    let (line, cell) = cells(lines, k).find(|(_, cell)| !matches!(*cell, "+" | "1"))?;
    let is_unsigned = |column: &Known| {
        column.role == Some(Role::Deviation) && column.numbers.iter().all(|number| *number >= 0.0)
    };
    let has_deviations = |column: &Known| column.role == Some(Role::Deviation);
    let is_of_them = columns.iter().any(is_unsigned) || !columns.iter().any(has_deviations);
    is_of_them.then(|| {
        format!(
            "line {line}, column \"{}\": \"{}\": write the sign before the number that it belongs to, and remove the column",
            shown(head.get(k).map_or("", String::as_str)),
            shown(cell)
        )
    })
}

/// A factor that is not 1.
fn odd_factor(head: &[String], (lines, k): (&Lines, usize)) -> Option<String> {
    let odd = cells(lines, k).find_map(|(line, cell)| {
        let number = number_of(cell, '.')?;
        (number - 1.0)
            .abs()
            .total_cmp(&0.0)
            .is_gt()
            .then_some((line, cell))
    });
    let (line, cell) = odd?;
    Some(format!(
        "line {line}, column \"{}\": \"{}\": multiply the numbers that it belongs to, and remove the column; or rename it where it says \
         something else",
        shown(head.get(k)?),
        shown(cell)
    ))
}

#[cfg(test)]
mod tests {
    use super::super::recognise::of_text;

    fn odd(text: &str) -> Option<String> {
        of_text(text).expect("rows").expect("names").odd
    }

    /// Four rows of a positioning test with another column; `cells` are its cells.
    fn table(deviation: &str, name: &str, cells: [&str; 4]) -> String {
        let rows = cells
            .iter()
            .zip(1..)
            .map(|(cell, k)| format!("1,up,{},{k}.5,{cell}\n", 50 * k));
        format!(
            "run,direction,target_mm,{deviation},{name}\n{}",
            rows.collect::<String>()
        )
    }

    #[test]
    fn a_unit_a_sign_or_a_factor_beside_the_numbers_is_refused_with_its_line() {
        for (deviation, name, cells, words) in [
            (
                "deviation",
                "unit",
                ["thou"; 4],
                "line 2, column \"unit\": \"thou\"",
            ),
            (
                "deviation",
                "Einheit",
                ["mm"; 4],
                "line 2, column \"Einheit\"",
            ),
            (
                "deviation",
                "unit",
                ["0.1 mm"; 4],
                "line 2, column \"unit\": \"0.1 mm\": is no unit",
            ),
            ("deviation", "deviation unit", ["mm"; 4], "line 2"),
            (
                "deviation",
                "unit",
                ["um", "um", "mm", "mm"],
                "line 4, column \"unit\": \"mm\", and \"um\" in line 2",
            ),
            (
                "deviation_um",
                "sign",
                ["-", "+", "+", "-"],
                "line 2, column \"sign\"",
            ),
            (
                "deviation_um",
                "factor",
                ["10"; 4],
                "line 2, column \"factor\": \"10\"",
            ),
        ] {
            let said = odd(&table(deviation, name, cells)).expect(name);
            assert!(said.starts_with(words), "{said}");
        }
        for (deviation, name, cells) in [
            ("deviation", "unit", ["um"; 4]),
            ("deviation", "unit", ["mm/min"; 4]),
            ("deviation_mm", "unit", ["mm"; 4]),
            ("deviation_um", "unit", ["1"; 4]),
            ("deviation_um", "target unit", ["mm"; 4]),
            ("deviation_um", "sign", ["+"; 4]),
            ("deviation_um", "factor", ["1", "1.0", "1", "1"]),
        ] {
            assert_eq!(
                odd(&table(deviation, name, cells)),
                None,
                "{name} {cells:?}"
            );
        }
    }
}
