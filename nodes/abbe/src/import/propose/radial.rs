//! Which column of a circle is the radial deviation, and which the nominal radius.

use std::fmt::Write as _;

use anyhow::{Context, Result, bail};
use metrology::number::number;

use super::super::map::Plane;
use super::super::recognise::{Known, Recognised, Role};
use super::super::titles;
use super::super::units::{Kind, Unit};
use super::super::vocabulary::words;
use super::Text;

/// Radial deviations that are all beyond it, mm, are radii.
const WHOLE_RADIUS_MM: f64 = 1.0;

impl Text<'_> {
    /// The plane of circles: of a column, a line above the names, or the file's name.
    pub(super) fn plane(&mut self, stem: &str) -> Result<()> {
        let found = self.found;
        let of_column = found.plane_column.as_ref();
        let plane = match of_column {
            Some((name, plane)) => {
                self.used.push(name.clone());
                Some(*plane)
            }
            None => titles::plane(found, stem)?,
        };
        match plane {
            Some(plane) => {
                let _ = writeln!(self.test, "    plane: {plane}");
                self.recognised.push(format!("plane {plane}"));
            }
            None => self.stated("plane", &Plane::Xy.to_string(), "plane of the circles"),
        }
        Ok(())
    }

    /// The nominal radius: of a column, a line above the names, or the file's name.
    pub(super) fn radius(&mut self, of_column: Option<(&Known, f64)>, stem: &str) {
        let of_title = || titles::radius_mm(self.found, stem);
        let radius_mm = of_column.map(|(_, radius_mm)| radius_mm).or_else(of_title);
        let Some(radius_mm) = radius_mm else {
            self.stated(
                "radius_mm",
                "100.0",
                "nominal radius; lengths that follow from it (scale, squareness) depend on it",
            );
            return;
        };
        let _ = writeln!(self.test, "    radius_mm: {radius_mm:?}");
        match of_column {
            Some((column, _)) => self.note("radius_mm", column),
            None => self.recognised.push(format!("radius {radius_mm} mm")),
        }
    }
}

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
    // `R mm` is a length without a word for a radius.
    let is_letter = |column: &&Known| {
        let own = words(&column.name);
        own.first().is_some_and(|word| word == "r") && own.len() <= 2
    };
    let of_letter = found.columns.iter().filter(is_letter);
    let of_letter = of_letter.filter(|column| column.name != read.name);
    let nominal = radii().chain(of_letter).find_map(|column| {
        let first = column.numbers.first().copied()?;
        let is_one = column
            .numbers
            .iter()
            .all(|other| other.total_cmp(&first).is_eq());
        let unit = column.unit.unwrap_or(Unit::Mm);
        let is_length = unit.kind() == Kind::Length && column.unknown.is_none();
        let radius_mm = unit.convert(first, Unit::Mm);
        let is_radius = is_one && is_length && radius_mm > WHOLE_RADIUS_MM;
        is_radius.then_some((column, radius_mm))
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
