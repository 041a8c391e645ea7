//! What lines above the names of the columns, comments and lines of text between rows state: units, the axis, the plane.
//!
//! A line of units holds for columns whose names have none. Text between rows that states another axis, plane or unit begins
//! another test.

use std::fmt::Display;

use anyhow::{Result, bail};
use metrology::Axis;
use metrology::yaml::shown;

use super::beside::plane_of;
use super::map::{Column, Map, Test};
use super::sheet::Sheet;
use super::stated::{self, Stated};
use super::units::Unit;

/// Words behind which units stand.
const UNIT_NAMES: &[&str] = &[
    "unit",
    "units",
    "einheit",
    "einheiten",
    "unité",
    "unités",
    "unite",
    "unites",
    "unidad",
    "unidades",
    "unità",
];
/// Words behind which units stand after `in`.
const VALUE_NAMES: &[&str] = &[
    "dimensions",
    "dimension",
    "values",
    "lengths",
    "readings",
    "maße",
    "masse",
    "werte",
    "angaben",
    "längen",
    "messwerte",
];
/// Words of a comment that states an axis or a plane and nothing else.
const LABEL_WORDS: usize = 2;

/// The axis of a word that is its letter.
pub fn letter(word: &str) -> Option<Axis> {
    word.parse::<Axis>().ok().filter(|_| word.len() == 1)
}

fn words(text: &str) -> Vec<&str> {
    let words = text.split(|letter: char| !letter.is_alphanumeric());
    words.filter(|word| !word.is_empty()).collect()
}

/// The axis that a text states; in a sentence "a axis" names none.
pub fn axis(text: &str, is_prose: bool) -> Option<Axis> {
    let names = |word: &str| matches!(word.to_uppercase().as_str(), "AXIS" | "ACHSE");
    let axis = |word: &str| {
        let upper = || word.to_uppercase();
        letter(&if is_prose { word.to_owned() } else { upper() })
    };
    words(text).windows(2).find_map(|two| match two {
        [name, other] if names(name) && axis(other).is_some() => axis(other),
        [other, name] if names(name) => axis(other),
        _ => None,
    })
}

/// The units that a line of text lists; empty where it lists none.
fn units(text: &str) -> Vec<(Unit, String)> {
    let lower = text.to_lowercase();
    let is_part = |letter: char| letter.is_alphanumeric() || "µμ°".contains(letter);
    let starts = |names: &[&str]| {
        let mut parts = lower.split(|letter: char| !is_part(letter));
        parts.any(|part| names.contains(&part))
    };
    let is_of_values = starts(VALUE_NAMES);
    if !starts(UNIT_NAMES) && !is_of_values {
        return vec![];
    }
    let mut found: Vec<(Unit, String)> = vec![];
    let mut rest = text;
    let mut is_behind_in = false;
    while let Some(from) = rest.find(is_part) {
        let behind = &rest[from..];
        let end = behind
            .find(|letter| !is_part(letter))
            .unwrap_or(behind.len());
        let (word, after) = behind.split_at(end);
        rest = after;
        let is_in = word.eq_ignore_ascii_case("in");
        // `values in mm` has a preposition, `units: in / thou` inches.
        let next = after.trim_start();
        let is_preposition = is_in && next.starts_with(is_part);
        let unit = Unit::of_word(word).filter(|_| !is_preposition);
        let is_stated = !is_of_values || starts(UNIT_NAMES) || is_behind_in || !found.is_empty();
        found.extend(
            unit.filter(|_| is_stated)
                .map(|unit| (unit, word.to_owned())),
        );
        is_behind_in = is_preposition;
    }
    found
}

/// The units of a line: of text, or of cells that are units.
fn units_of(cells: &[String]) -> Vec<(Unit, String)> {
    let filled = || cells.iter().filter(|cell| !cell.is_empty());
    let of_cells: Option<Vec<(Unit, String)>> = filled()
        .map(|cell| match stated::of_cell(cell) {
            Stated::Unit(unit, word) => Some((unit, word)),
            Stated::Nothing | Stated::Unknown(_) => None,
        })
        .collect();
    match of_cells {
        Some(units) if units.len() > 1 => units,
        _ => units(&cells.join(" ")),
    }
}

/// Looks at the text round the rows; `at`: place of the line of names; `has_units`: units stand below the names. What is
/// doubtful is returned, a sentence each.
///
/// # Errors
/// With line and words, where a unit above the names is not the one that a column is read in, or where text between rows begins
/// another test.
pub fn check(map: &Map, sheet: &Sheet, at: usize, has_units: bool) -> Result<Vec<String>> {
    let (head, above, below) = match (sheet.lines.get(at), sheet.lines.split_at_checked(at)) {
        (Some((head, _)), Some((above, below))) => (*head, above, below),
        _ => return Ok(vec![]),
    };
    let is_above = |line: u64| line < head;
    let comment = |(line, text): &(u64, String)| (*line, vec![text.clone()]);
    let comments: Vec<(u64, Vec<String>)> = sheet.comments.iter().map(comment).collect();
    let of_names = above
        .iter()
        .chain(comments.iter().filter(|(line, _)| is_above(*line)));
    if !has_units {
        for (line, cells) in of_names {
            check_units(map, (*line, cells), false)?;
        }
    }
    let filled = |cells: &[String]| cells.iter().filter(|cell| !cell.is_empty()).count();
    let texts = below.iter().skip(1).filter(|(_, cells)| filled(cells) == 1);
    let behind = texts.chain(comments.iter().filter(|(line, _)| !is_above(*line)));
    // Behind the last row nothing begins.
    let last = sheet.lines.last().map_or(head, |(line, _)| *line);
    let mut doubts = vec![];
    for (line, cells) in behind.filter(|(line, _)| *line < last) {
        check_units(map, (*line, cells), true)?;
        doubts.extend(check_test(map, *line, cells.join(" ").trim())?);
    }
    Ok(doubts)
}

/// Refuses units of a line that are not those that columns are read in: above the names of columns whose names have none, between rows
/// of every column.
fn check_units(map: &Map, (line, cells): (u64, &[String]), is_between: bool) -> Result<()> {
    let listed = units_of(cells);
    let used = |column: &Column<'_>| {
        let of_map = map.units.get(column.name).copied();
        of_map
            .or_else(|| stated::of(column.name).unit())
            .or_else(|| column.what.unit())
    };
    let is_open = |column: &&Column<'_>| {
        is_between
            || (!map.units.contains_key(column.name) && stated::of(column.name) == Stated::Nothing)
    };
    for column in map.test.columns().iter().filter(is_open) {
        let Some(wanted) = used(column) else {
            continue;
        };
        let alike = || {
            listed
                .iter()
                .filter(|(unit, _)| unit.kind() == wanted.kind())
        };
        let is_listed = alike().any(|(unit, _)| *unit == wanted);
        let Some((unit, word)) = alike().next().filter(|_| !is_listed) else {
            continue;
        };
        let text = shown(cells.join(" ").trim()).to_string();
        if is_between {
            bail!(
                "line {line}: \"{text}\": another unit begins there, column \"{}\" is read in {}: write the rows of each unit into a table of \
                 their own",
                shown(column.name),
                wanted.name()
            );
        }
        let place = format!("line {line} (\"{text}\")");
        stated::check(*column, &Stated::Unit(*unit, word.clone()), &place)?;
    }
    Ok(())
}

/// Refuses text between rows that states another axis or plane than the map; of longer text a doubt.
fn check_test(map: &Map, line: u64, text: &str) -> Result<Option<String>> {
    match &map.test {
        Test::Positioning { axis: own, .. } | Test::Log { axis: own, .. } => same(
            line,
            text,
            ("axis", *own),
            axis(text, true),
            &["axis", "achse"],
        ),
        Test::Touches { .. } => Ok(None),
        Test::Circle { plane, .. } => {
            let other = words(text).into_iter().find_map(plane_of);
            same(line, text, ("plane", *plane), other, &["plane", "ebene"])
        }
    }
}

fn same<T: PartialEq + Display>(
    line: u64,
    text: &str,
    (key, own): (&str, T),
    stated: Option<T>,
    names: &[&str],
) -> Result<Option<String>> {
    let Some(other) = stated.filter(|other| *other != own) else {
        return Ok(None);
    };
    let words = words(text);
    let first = words.first().map(|word| word.to_lowercase());
    let is_label =
        words.len() <= LABEL_WORDS || first.is_some_and(|first| names.contains(&first.as_str()));
    let text = shown(text);
    if is_label {
        bail!(
            "line {line}: \"{text}\": rows of {key} {other} begin there, and the table is read as {key} {own}: write the rows of each {key} \
             into a table of their own, or correct {key} in the map"
        );
    }
    Ok(Some(format!(
        "warning, line {line}: \"{text}\" names {key} {other}, and every row is read as {key} {own}: where another test begins there, \
         write its rows into a table of their own"
    )))
}

#[cfg(test)]
mod tests {
    use super::super::table::Table;
    use super::*;

    const TEST: &str = "positioning: {axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 1.0, run: n, target_mm: t, deviation_um: d}";
    const ROWS: &str = "n,t,d\n1,0,0.5\n1,10,0.7\n";

    fn read(text: &str, units: &str) -> Result<Vec<String>, String> {
        let text_of_map = format!("start_s: 0\nunits: {units}\ntest:\n  {TEST}\n");
        let map: Map = serde_saphyr::from_str(&text_of_map).expect("a map");
        let sheet = Sheet::of_text(text, ',').expect("rows");
        let table = Table::of(&sheet, &map, &[None; 3]);
        let table = table.map_err(|error| format!("{error:#}"))?;
        Ok(table.left_out)
    }

    #[test]
    fn a_unit_above_the_names_that_is_not_used_is_refused_with_line_and_column() {
        for (line, column, unit) in [
            ("Units: inch / thou", "t", "inch"),
            ("Unit,inch", "t", "inch"),
            ("# units: inch, thou", "t", "inch"),
            ("Einheiten: mm", "d", "mm"),
            ("Units: in", "t", "in"),
            ("unit = um", "t", "um"),
            ("All dimensions in inches", "t", "inches"),
            ("Maße in mm", "d", "mm"),
            (",inch,thou", "t", "inch"),
        ] {
            let said = read(&format!("{line}\n{ROWS}"), "{}").expect_err(line);
            let words = format!("column \"{column}\": line 1 (\"");
            assert!(said.contains(&words), "{line}: {said}");
            assert!(
                said.contains(&format!("\") says {unit}, the map ")),
                "{said}"
            );
            assert!(said.contains("state `units: {"), "{said}");
        }
    }

    #[test]
    fn units_that_are_used_and_texts_without_units_are_taken() {
        for (line, units) in [
            ("Units: mm and um", "{}"),
            ("Units: inch / thou", "{t: inch, d: thou}"),
            ("# units: mm; µm", "{}"),
            (",mm,um", "{}"),
            ("Measuring unit XL-80 in room 3", "{}"),
            ("Control unit: 840D", "{}"),
            ("Operator in charge: M", "{}"),
            ("Temperature unit: degF", "{}"),
        ] {
            let said = read(&format!("{line}\n{ROWS}"), units);
            assert!(said.is_ok(), "{line}: {said:?}");
        }
    }

    #[test]
    fn text_between_rows_that_begins_another_axis_or_unit_is_refused_with_its_line() {
        for (line, words) in [
            (
                "# Axis: Y",
                "line 4: \"Axis: Y\": rows of axis Y begin there",
            ),
            ("# Y axis", "rows of axis Y begin there"),
            ("## Achse Z, Lauf 3", "rows of axis Z begin there"),
            ("Y axis,,", "line 4: \"Y axis\": rows of axis Y begin there"),
            (
                "# Units: inch",
                "line 4: \"Units: inch\": another unit begins there",
            ),
        ] {
            let said = read(&format!("{ROWS}{line}\n2,0,0.5\n2,10,0.7\n"), "{}");
            let said = said.expect_err(line);
            assert!(said.contains(words), "{line}: {said}");
        }
        for line in [
            "# Axis: X",
            "# run 2",
            "# Units: mm, um",
            "# at a axis stop",
        ] {
            let said = read(&format!("{ROWS}{line}\n2,0,0.5\n2,10,0.7\n"), "{}");
            assert_eq!(said, Ok(vec![]), "{line}");
        }
        for line in ["# Axis: Y", "# Units: inch", "# Y axis"] {
            let said = read(&format!("{ROWS}{line}\n"), "{}");
            assert_eq!(said, Ok(vec![]), "{line} behind the rows");
        }
        let parked = format!("{ROWS}# parked the Y axis at 200\n2,0,0.5\n2,10,0.7\n");
        let said = read(&parked, "{}").expect("rows");
        assert!(said[0].starts_with("warning, line 4: "), "{said:?}");
    }
}
