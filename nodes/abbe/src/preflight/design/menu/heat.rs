//! A test before and after one axis, or the spindle, warmed alone; after the spindle once more when it has cooled.

use machine::MachineFile;
use metrology::Axis;

use super::super::instruments::Means;
use super::super::programs;
use super::{Heat, Offer, short};

/// Time of warming, min.
const WARM_MIN: f64 = 10.0;
/// Time of cooling, min.
const COOL_MIN: f64 = 5.0;

/// Beside the other tests, of which the first that suits is what is tested before and after.
pub(super) fn offers(machine: &MachineFile, others: &[Offer]) -> Vec<Offer> {
    let mut all: Vec<Offer> = Axis::LINEAR
        .into_iter()
        .filter_map(|axis| of_axis(machine, others, axis))
        .collect();
    all.extend(of_spindle(machine, others));
    all
}

fn of_axis(machine: &MachineFile, others: &[Offer], axis: Axis) -> Option<Offer> {
    let text = programs::warm(machine, axis)?;
    let test = tested(others, &[Means::Grid, Means::Probe, Means::Laser])?;
    let program = format!("warm_{}.ngc", axis.letter().to_lowercase());
    let title = format!(
        "{}, before and after {} min of {axis} to and fro",
        test.title,
        short(WARM_MIN)
    );
    Some(around(test, title, program, text, Heat::Axis(axis)))
}

fn of_spindle(machine: &MachineFile, others: &[Offer]) -> Option<Offer> {
    let text = programs::spin(machine)?;
    let all_faces = others.iter().find(|offer| offer.steps == ["{do: blocks}"]);
    let test = all_faces.or_else(|| tested(others, &[Means::Probe]))?;
    let title = format!(
        "{}, before and after {} min of the spindle alone, and after {} min of cooling",
        test.title,
        short(WARM_MIN),
        short(COOL_MIN)
    );
    let mut offer = around(test, title, "spin.ngc".to_owned(), text, Heat::Spindle);
    offer
        .steps
        .push(format!("{{do: wait, seconds: {:.1}}}", 60.0 * COOL_MIN));
    offer.steps.extend(test.steps.iter().cloned());
    Some(offer)
}

/// The first test of the first of some instruments that there is.
fn tested<'o>(others: &'o [Offer], means: &[Means]) -> Option<&'o Offer> {
    means.iter().find_map(|means| {
        let mut of_means = others.iter().filter(|offer| offer.set_up.means == *means);
        of_means.next()
    })
}

fn around(test: &Offer, title: String, program: String, text: String, heat: Heat) -> Offer {
    let mut offer = test.clone();
    offer.title = title;
    offer.steps.push(format!(
        "{{do: produce, program: {program:?}, minutes: {WARM_MIN:.1}, serve_updates: false}}"
    ));
    offer.steps.extend(test.steps.iter().cloned());
    let _ = offer.programs.insert(program, text);
    offer.most_repeats = 1;
    offer.heat = Some(heat);
    offer
}
