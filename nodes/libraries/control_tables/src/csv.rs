//! A plain table of everything that is known, for other programs and for people.
//!
//! # Rows
//!
//! | `kind` | row |
//! |---|---|
//! | `effect` | what acts in one direction along one axis: positioning, straightness with squareness, angles; each counts once |
//! | `component` | a single component as it was published, in an effect already or in none: listed, not to be added to the effects |
//! | `drift` | thermal drift at the ends of what was touched; straight between them, and of its hour |
//!
//! # Sign
//! Both are given, so that nobody has to guess: `error` is actual minus commanded, `compensation` is what is added to the
//! command, minus the error. A `component` has no compensation of its own.
//!
//! # Uncertainty
//! The last column has the standard uncertainty of a component or a drift at that position, from the covariance of its
//! fit, and is empty where none is known.
//!
//! # Units and rounding
//! mm and rad as inside, unit in a column of its own, not rounded: every number reads back as the same double.
//!
//! # Format
//! RFC 4180 with a header line, without comments; the notes stand beside the file. A constant has no position.

mod known;

pub use known::{Known, covariance_of};

use metrology::Axis;

use super::axis_errors::AxisErrors;
use super::cross_errors::CrossErrors;
use super::file::ExportFile;

const HEADER: &str = "component,base_axis,position,position_unit,error_up,error_down,compensation_up,compensation_down,value_unit,kind,note,standard_uncertainty_if_known\n";

const fn inner_unit(axis: Axis) -> &'static str {
    if axis.is_linear() { "mm" } else { "rad" }
}

/// Every error in one file.
#[must_use]
pub fn table(positioning: &[AxisErrors], others: &[CrossErrors], known: &Known) -> ExportFile {
    let mut text = HEADER.to_owned();
    for errors in positioning {
        let (axis, name) = (errors.axis(), format!("E{0}{0}", errors.axis()));
        let both = errors.up().iter().zip(errors.down());
        for (at, (up, down)) in errors.position().iter().zip(both) {
            push_effect(&mut text, &name, (axis, axis), *at, (*up, *down));
        }
    }
    for errors in others {
        let axes = (errors.base(), errors.direction());
        for (at, e) in errors.position().iter().zip(errors.error()) {
            push_effect(&mut text, &errors.names(), axes, *at, (*e, *e));
        }
    }
    text.push_str(known.rows());
    let mut notes = vec![
        "error = actual - commanded, of the tool relative to the workpiece".to_owned(),
        "compensation = what is added to the command = -error".to_owned(),
        "up and down: motion towards greater and smaller positions of the base axis".to_owned(),
        "kind effect: counts once; kind component: as published, listed and not to be added to the effects; kind drift: of its hour, straight between its rows".to_owned(),
        "standard_uncertainty_if_known, in the unit of the value, k = 1: of components and drift, by their fits; empty where it is not known: of effects (a positioning table states none, a sum of components has those of its component rows, which are correlated), and of what is not estimable or identifiable by itself".to_owned(),
        "no control: the sign is that of this table's words".to_owned(),
    ];
    let remarks = positioning.iter().flat_map(AxisErrors::remarks);
    notes.extend(remarks.cloned());
    ExportFile::new("errors.csv".to_owned(), text, notes)
}

fn push_effect(
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
        "{name},{base},{at},{unit_at},{up},{down},{c_up},{c_down},{unit},effect,,\n"
    ));
}
