//! Which column of a circle is the radial deviation, and which the nominal radius.

use anyhow::{Context, Result, bail};
use metrology::number::number;

use super::super::recognise::{Known, Recognised, Role};
use super::super::units::{Kind, Unit};

/// Radial deviations that are all beyond it, mm, are radii.
const WHOLE_RADIUS_MM: f64 = 1.0;

/// A column of the feed whose number is one, in mm/min: named so, or without a unit.
pub fn feed(found: &Recognised) -> Option<(&Known, f64)> {
    let mut feeds = found.columns.iter().filter_map(|column| {
        let lower = column.name.to_lowercase();
        let words = lower.split(|letter: char| !letter.is_alphanumeric());
        let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
        let rest = match words.as_slice() {
            ["feed" | "feedrate" | "vorschub", rest @ ..] => rest,
            _ => return None,
        };
        let is_mm_min = matches!(rest, [] | ["rate"] | [.., "mm", "min"]);
        let first = column.numbers.first().copied()?;
        let is_one = column
            .numbers
            .iter()
            .all(|other| other.total_cmp(&first).is_eq());
        (is_mm_min && is_one && first > 0.0).then_some((column, first))
    });
    feeds.next()
}

/// The column of radial deviations of circles; and one of their nominal radius with it, mm.
pub fn columns(found: &Recognised) -> Result<(&Known, Option<(&Known, f64)>)> {
    let says = |column: &&Known, words: &[&str]| {
        let lower = column.name.to_lowercase();
        words.iter().any(|word| lower.contains(word))
    };
    let is_radius = |column: &&Known| {
        says(column, &["radius"]) && !says(column, &["radial", "dev", "abw", "err"])
    };
    let radii = || found.all(Role::Radial).filter(is_radius);
    let read = found
        .first(Role::Radial)
        .filter(|column| !is_radius(column));
    let read = read.or_else(|| found.all(Role::Radial).find(|column| !is_radius(column)));
    let Some(read) = read.or_else(|| found.first(Role::Deviation)) else {
        let read = radii().next().context("no column of radial deviations")?;
        let unit = read.unit.filter(|unit| unit.kind() == Kind::Length);
        let least = read.numbers.iter().copied().fold(f64::INFINITY, f64::min);
        let least_mm = unit.unwrap_or(Unit::Um).convert(least, Unit::Mm);
        if least_mm > WHOLE_RADIUS_MM {
            bail!(
                "column \"{}\": its numbers are whole radii, {} mm at least: subtract the nominal radius from them",
                read.name,
                number(least_mm)
            );
        }
        return Ok((read, None));
    };
    let nominal = radii().find_map(|column| {
        let first = column.numbers.first().copied()?;
        let is_one = column
            .numbers
            .iter()
            .all(|other| other.total_cmp(&first).is_eq());
        let unit = column.unit.filter(|unit| unit.kind() == Kind::Length)?;
        is_one.then(|| (column, unit.convert(first, Unit::Mm)))
    });
    Ok((read, nominal))
}

#[cfg(test)]
mod tests {
    use super::super::super::recognise::of_text;
    use super::*;

    #[test]
    fn a_column_of_one_feed_gives_it_and_others_do_not() {
        for (name, cells, wanted) in [
            ("feed_mm_min", ["500", "500"], Some(500.0)),
            ("Feed rate [mm/min]", ["1500.5", "1500.5"], Some(1500.5)),
            ("Vorschub", ["800", "800"], Some(800.0)),
            ("feed", ["500", "5000"], None),
            ("feed [m/min]", ["5", "5"], None),
            ("feed inch/min", ["20", "20"], None),
            ("feed", ["0", "0"], None),
            ("speed", ["500", "500"], None),
        ] {
            let [first, second] = cells;
            let text =
                format!("{name},run,angle_deg,radial_um\n{first},1,0,0.2\n{second},1,10,0.3\n");
            let found = of_text(&text).unwrap().unwrap();
            let taken = feed(&found).map(|(_, feed)| feed);
            assert_eq!(taken, wanted, "{name}");
        }
    }
}
