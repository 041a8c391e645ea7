//! Options without which every file would be the same: a person who gives one expects that it does something.
//!
//! What is exported is made again without each option in turn, and compared. So nothing has to be known of what an option
//! is about, and one that is added later only needs its line here.

use control_tables::Travels;
use control_tables::selection::{Measured, Selected, select};

use super::{Export, Format};

/// An option: its name, whether it was given, and how it is taken back.
type Undone = (&'static str, fn(&Export) -> bool, fn(&mut Export));

/// An option with a value.
macro_rules! valued {
    ($name:literal, $($field:ident).+) => {
        ($name, |e| e.$($field).+.is_some(), |e| e.$($field).+ = None)
    };
}

/// An option without one.
macro_rules! flag {
    ($name:literal, $($field:ident).+) => {
        ($name, |e| e.$($field).+, |e| e.$($field).+ = false)
    };
}

const OPTIONS: &[Undone] = &[
    valued!("--spacing-mm", spacing_mm),
    valued!("--spacing-deg", spacing_deg),
    (
        "--reference",
        |e| !e.reference.is_empty(),
        |e| e.reference.clear(),
    ),
    flag!("--absolute", absolute),
    flag!("--accept-unestimable", accept_unestimable),
    valued!("--file-type", set_up.file_type),
    valued!("--max-points", set_up.max_points),
    valued!("--max-tables", set_up.max_tables),
    valued!("--max-sum-mm", set_up.max_sum_mm),
    valued!("--max-slope", set_up.max_slope),
    flag!("--each-direction", set_up.each_direction),
    flag!("--leave-out-other-axes", set_up.leave_out_other_axes),
    valued!("--detection-unit", set_up.detection_unit),
    valued!("--magnification", set_up.magnification),
    valued!("--max-pulses", set_up.max_pulses),
    valued!("--max-number", set_up.max_number),
    flag!("--marked", set_up.marked),
    valued!("--pitch-tables", set_up.pitch_tables),
];

/// The message for an option that changed nothing.
fn line(option: &str) -> String {
    format!("{option} has no effect: with what this bag holds, every file is the same without it")
}

/// A line for each option that was given and changed nothing.
pub(super) fn without_effect(
    export: &Export,
    format: Format,
    (measured, travels): (&Measured, &Travels),
    selected: &Selected,
) -> Vec<String> {
    let is_same = |other: &Export| {
        let again = select(
            measured,
            &other.wanted(*travels),
            &other.set_up.control(format),
        );
        again.files == selected.files && again.left_out == selected.left_out
    };
    let given = OPTIONS.iter().filter(|(_, is_given, _)| is_given(export));
    let mut lines: Vec<String> = given
        .filter(|(_, _, undo)| {
            let mut other = export.clone();
            undo(&mut other);
            is_same(&other)
        })
        .map(|(option, ..)| line(option))
        .collect();
    // Each axis has a number of its own.
    for place in 0..export.set_up.reference_number.len() {
        let mut other = export.clone();
        let (axis, number) = other.set_up.reference_number.remove(place);
        if is_same(&other) {
            lines.push(line(&format!("--reference-number {axis}={number}")));
        }
    }
    lines
}
