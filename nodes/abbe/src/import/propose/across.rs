//! Deviations across the motion, which are those of a straightness.

use anyhow::{Result, bail};
use metrology::Axis;

use super::super::recognise::{Known, Recognised, Role};
use super::super::units::Unit;

/// Refuses deviations of another axis than that of the targets.
///
/// # Errors
/// With both names.
pub fn check(found: &Recognised, read: &Known) -> Result<()> {
    let Some(target) = found.first(Role::Target) else {
        return Ok(());
    };
    match (axis(&target.name), axis(&read.name)) {
        (Some(moved), Some(other)) if moved != other => bail!(
            "columns \"{}\" and \"{}\": the targets are of {moved} and the deviations of {other}: a deviation across the motion is a \
             straightness error (ISO 230-1), and no positioning deviation; name deviations along {moved} as deviation_um in a map",
            target.name,
            read.name
        ),
        _ => Ok(()),
    }
}

/// Numbers that follow the targets closer than this share of their range are positions and no deviations.
const SAME_SHARE: f64 = 0.01;
/// Fewest targets by which that is seen.
const LEAST_TARGETS: usize = 3;

/// Refuses columns of deviations that hold the measured positions themselves.
///
/// # Errors
/// With the name and the remedy.
pub fn check_positions(found: &Recognised, columns: &[&Known]) -> Result<()> {
    let Some(target) = found.first(Role::Target) else {
        return Ok(());
    };
    let targets = &target.numbers;
    let range = range(targets);
    let are_same = |column: &&&Known| {
        let pairs = || targets.iter().zip(&column.numbers);
        column.numbers.len() == targets.len()
            && targets.len() >= LEAST_TARGETS
            && range > 0.0
            && pairs().all(|(target, number)| (number - target).abs() < SAME_SHARE * range)
    };
    match columns.iter().find(are_same) {
        Some(column) => bail!(
            "column \"{}\": its numbers are the targets of \"{}\" within {} % of their range: measured positions and no deviations; \
             subtract the targets, or write a row for each reading and name the column as measured_mm in a map",
            column.name,
            target.name,
            100.0 * SAME_SHARE
        ),
        None => Ok(()),
    }
}

/// Measured positions are closer to their targets than this share of the targets' range.
const NEAR_SHARE: f64 = 0.1;

/// Refuses columns of measured positions that are far from the targets of their rows: deviations, or of another unit.
///
/// # Errors
/// With both names and the remedy.
pub fn check_measured(found: &Recognised, read: &Known) -> Result<()> {
    let Some(target) = found.first(Role::Target) else {
        return Ok(());
    };
    let size = |column: &Known| column.unit.map_or(1.0, Unit::size);
    let is_stated = target.unit.is_some() == read.unit.is_some();
    let (of_target, of_read) = (size(target), size(read));
    let range = range(&target.numbers) * of_target;
    let mut pairs = target.numbers.iter().zip(&read.numbers);
    let far = |(target, number): (&f64, &f64)| {
        (number * of_read - target * of_target).abs() > NEAR_SHARE * range
    };
    let is_same = read.numbers.len() == target.numbers.len() && is_stated && range > 0.0;
    if is_same && pairs.any(far) {
        bail!(
            "column \"{}\": its numbers are not near those of \"{}\": measured positions are; where they are deviations name the column \
             as deviation_um in a map",
            read.name,
            target.name
        );
    }
    Ok(())
}

/// Greatest less least.
fn range(numbers: &[f64]) -> f64 {
    let ends = numbers
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], one| {
            [low.min(*one), high.max(*one)]
        });
    ends[1] - ends[0]
}

/// The one axis whose letter stands in a name.
fn axis(name: &str) -> Option<Axis> {
    let words = name.split(|letter: char| !letter.is_alphanumeric());
    let is_letter = |word: &&str| matches!(*word, "X" | "Y" | "Z" | "x" | "y" | "z");
    let mut axes = words
        .filter(is_letter)
        .filter_map(|word| word.to_uppercase().parse::<Axis>().ok());
    let first = axes.next()?;
    axes.all(|axis| axis == first).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::super::super::recognise::of_text;
    use super::*;

    #[test]
    fn targets_and_deviations_of_two_axes_are_a_straightness() {
        for (head, is_across) in [
            ("run,X target (mm),Y deviation (um)", true),
            ("run,Position X [mm],Abweichung in Z [um]", true),
            ("run,X target (mm),X deviation (um)", false),
            ("run,target (mm),Y deviation (um)", false),
            ("run,Y position mm,deviation um", false),
        ] {
            let found = of_text(&format!("{head}\n1,0,0.5\n1,10,0.7\n"))
                .unwrap()
                .unwrap();
            let read = found.first(Role::Deviation).unwrap();
            let checked = check(&found, read).map_err(|error| error.to_string());
            assert_eq!(checked.is_err(), is_across, "{head}: {checked:?}");
        }
    }

    #[test]
    fn numbers_that_are_the_targets_are_positions() {
        let table = |head: &str, rows: &[[f64; 2]]| {
            let rows: String = rows.iter().map(|[a, b]| format!("{a},{b}\n")).collect();
            of_text(&format!("{head}\n{rows}")).unwrap().unwrap()
        };
        let head = "target_mm,1 up";
        for (rows, is_position) in [
            ([[-280.0, -280.008], [0.0, 0.002], [280.0, 280.009]], true),
            ([[-280.0, -8.0], [0.0, 2.0], [280.0, 9.0]], false),
            ([[0.0, 0.5], [10.0, 4.0], [20.0, 9.0]], false),
        ] {
            let found = table(head, &rows);
            let passes: Vec<&Known> = found.passes().into_iter().map(|(one, _)| one).collect();
            assert_eq!(
                check_positions(&found, &passes).is_err(),
                is_position,
                "{rows:?}"
            );
        }
    }
}
