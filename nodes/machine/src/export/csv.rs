//! A plain table of errors and compensations, for other programs and for people.
//!
//! # Sign
//! Both are given, so that nobody has to guess: `error` is actual minus commanded, `compensation` is what is added to the
//! command, minus the error.
//!
//! # Units and rounding
//! mm and rad as inside, unit in a column of its own, not rounded: every number reads back as the same double.
//!
//! # Format
//! RFC 4180 with a header line, without comments; the notes stand beside the file.

use metrology::Axis;

use super::axis_errors::AxisErrors;
use super::cross_errors::CrossErrors;
use super::file::ExportFile;

const HEADER: &str = "component,base_axis,position,position_unit,error_up,error_down,compensation_up,compensation_down,value_unit\n";

const fn inner_unit(axis: Axis) -> &'static str {
    if axis.is_linear() { "mm" } else { "rad" }
}

/// Every error in one file.
#[must_use]
pub fn table(positioning: &[AxisErrors], others: &[CrossErrors]) -> ExportFile {
    let mut text = HEADER.to_owned();
    for errors in positioning {
        let (axis, name) = (errors.axis(), format!("E{0}{0}", errors.axis()));
        let both = errors.up().iter().zip(errors.down());
        for (at, (up, down)) in errors.position().iter().zip(both) {
            push_row(&mut text, &name, (axis, axis), *at, (*up, *down));
        }
    }
    for errors in others {
        let axes = (errors.base(), errors.direction());
        for (at, e) in errors.position().iter().zip(errors.error()) {
            push_row(&mut text, &errors.names(), axes, *at, (*e, *e));
        }
    }
    let notes = vec![
        "error = actual - commanded, of the tool relative to the workpiece".to_owned(),
        "compensation = what is added to the command = -error".to_owned(),
        "up and down: motion towards greater and smaller positions of the base axis".to_owned(),
    ];
    ExportFile::new("errors.csv".to_owned(), text, notes)
}

fn push_row(
    text: &mut String,
    name: &str,
    (base, direction): (Axis, Axis),
    at: f64,
    (up, down): (f64, f64),
) {
    // Zero minus x, not -x: an error of 0 has the compensation 0.
    let (c_up, c_down) = (0.0 - up, 0.0 - down);
    let (unit_at, unit) = (inner_unit(base), inner_unit(direction));
    text.push_str(&format!(
        "{name},{base},{at},{unit_at},{up},{down},{c_up},{c_down},{unit}\n"
    ));
}
