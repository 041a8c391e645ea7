//! Units that the size of numbers makes likely.

use metrology::number::number;

use super::super::recognise::Known;
use super::super::stated::quoted;
use super::super::units::Unit;

/// Deviations below this are no micrometres (seconds of arc), greatest of a table.
const LEAST_UM: f64 = 0.05;
/// Targets that reach less far are no millimetres.
const LEAST_MM: f64 = 2.0;

fn greatest(numbers: &[f64]) -> f64 {
    numbers
        .iter()
        .fold(0.0, |most: f64, number| most.max(number.abs()))
}

/// Metres, where targets without a unit reach less far than any test in mm.
pub fn likely_target(column: &Known, wanted: Unit) -> Option<Unit> {
    let most = greatest(&column.numbers);
    (wanted == Unit::Mm && column.unit.is_none() && most > 0.0 && most < LEAST_MM)
        .then_some(Unit::Metre)
}

/// Millimetres, where all deviations without a unit are below what any machine has in µm.
pub fn likely_deviation(columns: &[&Known], wanted: Unit) -> Option<Unit> {
    let most = columns.iter().map(|column| greatest(&column.numbers));
    let most = most.fold(0.0, f64::max);
    let is_bare = |column: &&Known| column.unit.is_none();
    let is_small = most > 0.0 && most < LEAST_UM;
    (wanted == Unit::Um && columns.iter().all(is_bare) && is_small).then_some(Unit::Mm)
}

/// Asks about deviations that are too small for the unit that they are read in; `likely` is the one that they could be in.
pub fn doubt(numbers: &[f64], name: &str, [unit, likely]: [&str; 2]) -> Option<String> {
    let most = greatest(numbers);
    (most > 0.0 && most < LEAST_UM).then(|| {
        format!(
            "column \"{name}\": all its numbers are at most {} {unit}, below what machines have: are they {likely}? Then the map needs `units: {{{}: {likely}}}`",
            number(most),
            quoted(name)
        )
    })
}

/// Asks about targets of a linear axis, mm, that all lie closer to zero than any but the shortest test has them.
pub fn doubt_of_targets(targets_mm: &[f64], name: &str) -> Option<String> {
    let most = greatest(targets_mm);
    (most > 0.0 && most < LEAST_MM).then(|| {
        format!(
            "column \"{name}\": its targets reach to {} mm alone: are they m? Then the map needs `units: {{{}: m}}`",
            number(most),
            quoted(name)
        )
    })
}
