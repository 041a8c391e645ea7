//! Which column of a circle is the radial deviation, and which the nominal radius.

use anyhow::{Context, Result, bail};
use metrology::number::number;

use super::super::recognise::{Known, Recognised, Role};
use super::super::units::{Kind, Unit};

/// Radial deviations that are all beyond it, mm, are radii.
const WHOLE_RADIUS_MM: f64 = 1.0;

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
    let read = found.all(Role::Radial).find(|column| !is_radius(column));
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
