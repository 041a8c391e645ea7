//! Whether a curve through targets may be a periodic error that the targets do not resolve.
//!
//! # Model
//!
//! Where the targets resolve no turn of the screw (`resolved`), an error with its period is a curve through them like any other,
//! and it is not sought. With f the signature of a pitch error that was found, and U unit columns that span sine and cosine of the
//! lead at the targets:
//!
//! ```text
//!   cos = |U'f| / |f|                                                     (1)
//! ```
//!
//! From [`MIN_COSINE_LISTED`] on the periodic error is listed with it: the recording cannot separate them.
//!
//! # Holds when
//! The period is the lead. A curve with other waves in it is no periodic error of the screw, whatever the targets resolve.

use std::f64::consts::TAU;

use nalgebra::DVector;
use twin::effects::Target;

use crate::judgement::cause::Member;
use crate::judgement::confidence::ODDS;
use crate::judgement::{Check, CheckId};
use crate::noise::stack::Stack;
use crate::report::{Confusable, Status};

use crate::search::resolved;
use crate::search::rows::position;
use crate::search::signature::Library;

/// The curve, and what it may be.
const CURVE: &str = "pitch_error";
const PERIODIC: &str = "cyclic_error";
/// (1) from which the periodic error is listed.
const MIN_COSINE_LISTED: f64 = 0.9;

/// Lists the periodic error of an axis with a curve that may be one.
pub(crate) fn list_periodic(stack: &Stack<'_>, signatures: &Library, members: &mut [Member]) {
    for member in members {
        let instance = &signatures.instances[signatures.forms[member.form].instance];
        let Target::Axis(axis) = instance.target else {
            continue;
        };
        if instance.kind.id != CURVE
            || member.status() == Status::Surrogate
            || !resolved::is_coarse(stack, axis)
        {
            continue;
        }
        let curve = stack.signature(&*instance.effect(&member.estimate.values));
        let Some(cos) = cosine(stack, axis, &curve).filter(|cos| *cos >= MIN_COSINE_LISTED) else {
            continue;
        };
        member.confusable.retain(|other| other.effect != PERIODIC);
        member.confusable.insert(
            0,
            Confusable {
                effect: PERIODIC.to_owned(),
                axis: instance.target.to_string(),
                cos,
                excluded: false,
            },
        );
        let limit = 2.0 * ODDS.ln();
        member.put(Check::new(CheckId::NoRival, false).with(0.0, limit));
    }
}

/// (1); `None` where the curve is zero or the axis has no lead.
fn cosine(stack: &Stack<'_>, axis: metrology::Axis, curve: &DVector<f64>) -> Option<f64> {
    let lead_mm = stack.twin.machine().linear(axis)?.lead_mm;
    let mut columns = [vec![0.0; stack.rows.len], vec![0.0; stack.rows.len]];
    for block in &stack.rows.blocks {
        let run = &stack.session.runs[block.run];
        for (row, place) in block.rows.iter().zip(block.range()) {
            let at_mm = position(run, row, axis);
            if at_mm.is_finite() {
                let (sin, cos) = (TAU * at_mm / lead_mm).sin_cos();
                columns[0][place] = sin;
                columns[1][place] = cos;
            }
        }
    }
    let [sine, cosine] = columns.map(|column| stack.whitened(column));
    let along = unit(&sine).map_or(0.0, |unit| unit.dot(curve));
    let rest = unit(&sine).map_or(cosine.clone(), |unit| &cosine - &unit * unit.dot(&cosine));
    let across = unit(&rest).map_or(0.0, |unit| unit.dot(curve));
    let whole = curve.norm();
    (whole > 0.0).then(|| along.hypot(across) / whole)
}

fn unit(column: &DVector<f64>) -> Option<DVector<f64>> {
    let norm = column.norm();
    (norm > 1e-9).then(|| column / norm)
}
