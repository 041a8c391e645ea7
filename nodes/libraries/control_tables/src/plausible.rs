//! What no table may hold, whatever the control takes: errors that no machine has, and points that its axis cannot reach.
//!
//! ```text
//!   |e(p)| <= e_max                                  5 mm, 1 degree          (1)
//!   |e(p_k) - e(p_k-1)| <= (p_k - p_k-1) / 64                                (2)
//!   travel_least <= p_k <= travel_greatest                                   (3)
//! ```
//!
//! An error beyond (1) or (2) is one of the recording: a mistyped cell, a lost count, another unit. By (2) actual positions
//! p + e(p) ascend with p; a table that breaks it drives the axis backwards. 1/64 is the steepest that HEIDENHAIN's control takes
//! (see [`super::heidenhain`]). (2) is for errors of the kind of the axis' own motion, a length along a length.

use metrology::sample::{AxisDrift, CurveForm, ErrorCurve};
use metrology::{Axis, PerAxis};

use machine::volumetric::{Alone, check_curve};

use super::axis_errors::AxisErrors;
use super::cross_errors::CrossErrors;
use super::error::ExportError;
use super::grid::{Grid, SAME};

/// (1) of linear directions, mm.
const GREATEST_MM: f64 = 5.0;
/// (1) of rotary directions, degrees.
const GREATEST_DEG: f64 = 1.0;
/// (2).
const STEEPEST: f64 = 1.0 / 64.0;

/// Travel of each axis as far as it is known, mm or rad.
pub type Travels = PerAxis<Option<(f64, f64)>>;

/// (1) to (3) of the positioning of an axis.
pub(super) fn positioning(errors: &AxisErrors, travels: &Travels) -> Result<(), ExportError> {
    let axis = errors.axis();
    within_travel(axis, errors.position(), travels)?;
    sizes_of(errors)?;
    for error in [errors.up(), errors.down()] {
        slopes((axis, axis), errors.position(), error)?;
    }
    Ok(())
}

/// (1) of both directions of an axis.
pub(super) fn sizes_of(errors: &AxisErrors) -> Result<(), ExportError> {
    let axis = errors.axis();
    sizes((axis, axis), errors.position(), errors.up())?;
    sizes((axis, axis), errors.position(), errors.down())
}

/// (1) to (3) of the errors of an axis in another direction.
pub(super) fn cross(errors: &CrossErrors, travels: &Travels) -> Result<(), ExportError> {
    let axes = (errors.base(), errors.direction());
    within_travel(axes.0, errors.position(), travels)?;
    sizes(axes, errors.position(), errors.error())?;
    slopes(axes, errors.position(), errors.error())
}

/// (1) and (3) of a component every `spacing` of where it was recorded; a location error is no error along an axis.
pub(super) fn curve(
    curve: &ErrorCurve,
    spacing: f64,
    travels: &Travels,
) -> Result<(), ExportError> {
    if curve.component.is_location || curve.form == CurveForm::Constant {
        return Ok(());
    }
    check_curve(curve)?;
    let (base, direction) = (curve.component.of, curve.component.direction);
    let mut positions = vec![curve.span.0, curve.span.1];
    within_travel(base, &positions, travels)?;
    if let Ok(grid) = Grid::inside(base, spacing, curve.span) {
        positions.extend(grid.positions());
    }
    let alone = Alone::new(curve);
    let errors: Vec<f64> = positions.iter().map(|at| alone.at(*at)).collect();
    sizes((base, direction), &positions, &errors)
}

/// (1) of a thermal drift where it was touched.
pub(super) fn drift(axis: Axis, drift: &AxisDrift) -> Result<(), ExportError> {
    let ends = [drift.span_mm.0, drift.span_mm.1];
    let errors = ends.map(|at| -(drift.k0_mm + drift.slope_mm_per_mm * (at - drift.p0_mm)));
    sizes((axis, axis), &ends, &errors)
}

fn sizes(
    (base, direction): (Axis, Axis),
    position: &[f64],
    error: &[f64],
) -> Result<(), ExportError> {
    let limit = if direction.is_linear() {
        GREATEST_MM
    } else {
        GREATEST_DEG.to_radians()
    };
    let mut pairs = position.iter().zip(error);
    match pairs.find(|(_, error)| error.abs() > limit) {
        Some((&position, &error)) => Err(ExportError::Implausible {
            axis: base,
            direction,
            position,
            error,
            limit,
        }),
        None => Ok(()),
    }
}

fn slopes(
    (base, direction): (Axis, Axis),
    position: &[f64],
    error: &[f64],
) -> Result<(), ExportError> {
    if base.is_linear() != direction.is_linear() {
        return Ok(());
    }
    for (at, e) in position.windows(2).zip(error.windows(2)) {
        let limit = (at[1] - at[0]) * STEEPEST;
        let change = e[1] - e[0];
        if change.abs() > limit {
            return Err(ExportError::TooSteep {
                axis: base,
                direction,
                change,
                from: at[0],
                to: at[1],
                limit,
            });
        }
    }
    Ok(())
}

fn within_travel(axis: Axis, position: &[f64], travels: &Travels) -> Result<(), ExportError> {
    let Some((least, greatest)) = travels[axis] else {
        return Ok(());
    };
    let inside = least - SAME..=greatest + SAME;
    match position.iter().find(|at| !inside.contains(at)) {
        Some(&position) => Err(ExportError::OutsideTravel {
            axis,
            position,
            least,
            greatest,
        }),
        None => Ok(()),
    }
}
