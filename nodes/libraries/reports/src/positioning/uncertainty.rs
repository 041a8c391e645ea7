//! What the uncertainty of a length consists of, term by term, as a table.

use iso230::positioning::budget::PositioningContributions;

use crate::evaluate::correction::Measured;
use crate::section::{Rows, head};

/// How the limits of a term are distributed.
const RECTANGULAR: &str = "rectangular";
const NORMAL: &str = "normal";

/// The terms of a budget over the whole travel; `None` where no uncertainty of lengths is stated.
pub(super) fn table(contributions: &PositioningContributions, measured: &Measured) -> Option<Rows> {
    if !measured.are_lengths_stated {
        return None;
    }
    let of = contributions;
    let terms = [
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
    ];
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
