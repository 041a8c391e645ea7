//! What the uncertainty of a length consists of, term by term, as a table.

use iso230::positioning::budget::PositioningContributions;

use crate::evaluate::correction::Measured;
use crate::section::{Rows, head};
use crate::svg::short;

/// How the limits of a term are distributed.
const RECTANGULAR: &str = "rectangular";
const NORMAL: &str = "normal";
/// Share of the squares from which on a term is named as most of U.
const MOST_OF_U: f64 = 0.5;

/// Name, distribution and standard uncertainty of each term, mm.
fn terms(of: &PositioningContributions) -> [(&'static str, &'static str, Option<f64>); 8] {
    [
        ("certificate of the instrument", NORMAL, Some(of.device_mm)),
        ("alignment", RECTANGULAR, Some(of.alignment_mm)),
        (
            "temperature of the machine",
            RECTANGULAR,
            Some(of.machine_temperature_mm),
        ),
        (
            "expansion of the machine",
            RECTANGULAR,
            Some(of.machine_expansion_mm),
        ),
        (
            "temperature of the instrument",
            RECTANGULAR,
            Some(of.device_temperature_mm),
        ),
        (
            "expansion of the instrument",
            RECTANGULAR,
            Some(of.device_expansion_mm),
        ),
        ("drift of a reading", RECTANGULAR, Some(of.drift_mm)),
        ("unrest of a reading", NORMAL, of.unrest_mm),
    ]
}

/// The term that makes most of U, in words; `None` where none does, or where no uncertainty of lengths is stated.
pub(super) fn largest(
    contributions: &PositioningContributions,
    measured: &Measured,
) -> Option<String> {
    if !measured.are_lengths_stated {
        return None;
    }
    largest_of(&terms(contributions), contributions.length_mm)
}

fn largest_of(terms: &[(&str, &str, Option<f64>)], length_mm: f64) -> Option<String> {
    let stated = || {
        terms
            .iter()
            .filter_map(|(name, _, mm)| Some((*name, (*mm)?)))
    };
    let all_mm2: f64 = stated().map(|(_, mm)| mm.powi(2)).sum();
    let (name, mm) = stated().max_by(|a, b| a.1.total_cmp(&b.1))?;
    (mm.powi(2) > MOST_OF_U * all_mm2).then(|| {
        format!(
            "Most of U is the {name}: u = {} µm of {} µm over {length_mm:.0} mm.",
            short(mm * 1e3),
            short(all_mm2.sqrt() * 1e3)
        )
    })
}

/// The terms of a budget over the whole travel; `None` where no uncertainty of lengths is stated.
pub(super) fn table(contributions: &PositioningContributions, measured: &Measured) -> Option<Rows> {
    if !measured.are_lengths_stated {
        return None;
    }
    let of = contributions;
    let terms = terms(of);
    let rows = terms.into_iter().map(|(name, distribution, standard_mm)| {
        let cell = standard_mm.map_or_else(
            || "not stated".to_owned(),
            |standard_mm| format!("{:.3}", standard_mm * 1e3),
        );
        vec![name.to_owned(), distribution.to_owned(), cell]
    });
    Some(Rows {
        head: head(&["term of U", "distribution", "standard uncertainty / µm"]),
        rows: rows.collect(),
        note: format!(
            "Over {:.0} mm. Terms that grow with length enter E, A and M at the distance of the two readings that are farthest apart in value, which is often shorter. Drift and unrest are those of one reading; a mean of several has less.",
            of.length_mm
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_term_that_makes_most_of_u_is_named() {
        let terms = |temperature_mm| {
            [
                ("certificate of the instrument", NORMAL, Some(0.0002)),
                (
                    "temperature of the machine",
                    RECTANGULAR,
                    Some(temperature_mm),
                ),
                ("unrest of a reading", NORMAL, None),
            ]
        };
        assert_eq!(
            largest_of(&terms(0.008), 600.0).unwrap(),
            "Most of U is the temperature of the machine: u = 8.00 µm of 8.00 µm over 600 mm."
        );
        assert!(largest_of(&terms(0.0002), 600.0).is_none());
    }
}
