//! Deviations across the motion, which are those of a straightness.

use anyhow::{Result, bail};
use metrology::Axis;

use super::super::recognise::{Known, Recognised, Role};

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
}
