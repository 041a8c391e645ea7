//! Errors of the place that a drift in the order of the readings reads like, and the other way round.
//!
//! # Model
//!
//! An axis that steps from target to target drifts as it goes: what goes with time goes with the place as well. With f the signature of
//! what was found, and U unit columns that span its rivals,
//!
//! ```text
//!   |f - U U'f| < D of what is named                                      (1)
//! ```
//!
//! lists the rival with it.
//!
//! | found | U | listed |
//! |---|---|---|
//! | scale, pitch error | t, t^2, 1 - exp(-t/tau) for tau of 1, 4, 16 and 64 min | slow drift |
//! | slow drift | every function of the target | pitch error, or the scale where it is (1) alone |
//! | slow drift | every function of the target and of the side of approach | backlash |
//! | slow drift of a vertical tool, no thermometer read | 1 - exp(-t/tau), tau from 0.5 to 100 min | growth of the spindle |
//!
//! A table that was not in the order of the measurement may be of a step cycle: any scale or pitch error in it may be a drift.
//!
//! # Holds when
//! Nothing but positions at targets of one axis was read.

use metrology::Axis;
use nalgebra::DVector;
use twin::effects::{self, Target};

use crate::config::GapConfig;
use crate::judgement::cause::Member;
use crate::judgement::unresolved;
use crate::judgement::veto::MIN_D_TO_NAME;
use crate::noise::stack::Stack;
use crate::report::Status;
use crate::search::nuisance::orthonormal;
use crate::search::resolved;
use crate::search::rows::{count, time_s};
use crate::search::signature::Library;

const DRIFT: &str = "ambient_drift";
const SCALE: &str = "scale_error";
const PITCH: &str = "pitch_error";
const PLAY: &str = "backlash";
const GROWTH: &str = "spindle_growth";
/// Time constants of a drift, s.
const DRIFT_S: [f64; 4] = [60.0, 240.0, 960.0, 3840.0];
/// Those of a spindle's growth, s.
const GROWTH_S: [f64; 6] = [30.0, 120.0, 360.0, 900.0, 2400.0, 6000.0];

/// Lists the drift with errors of the place, and these with the drift.
pub(crate) fn list(
    stack: &Stack<'_>,
    signatures: &Library,
    members: &mut [Member],
    config: &GapConfig,
) {
    for member in members {
        let instance = &signatures.instances[signatures.forms[member.form].instance];
        let Target::Axis(axis) = instance.target else {
            continue;
        };
        if member.status() == Status::Surrogate || !resolved::is_at_targets(stack, axis) {
            continue;
        }
        let found = stack.signature(&*instance.effect(&member.estimate.values));
        let rival = match instance.kind.id {
            SCALE | PITCH if !config.is_order_known => Some((DRIFT, axis.to_string(), 1.0)),
            SCALE | PITCH => {
                let cos = cosine(&found, &courses(stack, &DRIFT_S, true));
                cos.map(|cos| (DRIFT, axis.to_string(), cos))
            }
            DRIFT => of_drift(stack, axis, &found, config.is_order_known),
            _ => None,
        };
        if let Some((effect, target, cos)) = rival {
            unresolved::list(member, effect, &target, cos);
        }
    }
}

/// What a drift may be instead.
fn of_drift(
    stack: &Stack<'_>,
    axis: Axis,
    found: &DVector<f64>,
    is_order_known: bool,
) -> Option<(&'static str, String, f64)> {
    let on_axis = |effect, cos| (effect, axis.to_string(), cos);
    let targets = resolved::targets(stack, axis)?;
    if is_order_known {
        let scale = [unresolved::column(stack, axis, |at_mm| at_mm)];
        if let Some(cos) = cosine(found, &scale) {
            return Some(on_axis(SCALE, cos));
        }
        let any_form: Vec<DVector<f64>> = { targets.iter() }
            .map(|rows| indicator(stack, rows))
            .collect();
        if let Some(cos) = cosine(found, &any_form) {
            return Some(on_axis(PITCH, cos));
        }
        let sides = sides(stack, axis)?;
        let of_sides = targets.iter().flat_map(|rows| {
            let (up, down): (Vec<usize>, Vec<usize>) =
                rows.iter().partition(|row| sides[**row] > 0.0);
            [indicator(stack, &up), indicator(stack, &down)]
        });
        if let Some(cos) = cosine(found, &of_sides.collect::<Vec<_>>()) {
            return Some(on_axis(PLAY, cos));
        }
    }
    let has_thermometer = !stack.session.history.temperature_degc.is_empty();
    if axis != Axis::Z || has_thermometer {
        return None;
    }
    let cos = cosine(found, &courses(stack, &GROWTH_S, false))?;
    Some((GROWTH, String::new(), cos))
}

/// The cosine of a signature with a span, where (1) holds.
fn cosine(found: &DVector<f64>, columns: &[DVector<f64>]) -> Option<f64> {
    let seen = columns
        .iter()
        .filter(|column| column.norm() > 1e-9)
        .cloned();
    let span = orthonormal(found.len(), seen);
    let within = span.tr_mul(found).norm();
    let left = (found.norm_squared() - within * within).max(0.0).sqrt();
    (left < MIN_D_TO_NAME).then(|| within / found.norm().max(f64::MIN_POSITIVE))
}

/// Courses of a drift over the rows, whitened.
fn courses(stack: &Stack<'_>, relaxes_s: &[f64], has_powers: bool) -> Vec<DVector<f64>> {
    let of = |course: &dyn Fn(f64) -> f64| {
        let mut column = vec![0.0; stack.rows.len];
        for block in &stack.rows.blocks {
            let run = &stack.session.runs[block.run];
            for (row, place) in block.rows.iter().zip(block.range()) {
                column[place] = course(time_s(run, row));
            }
        }
        stack.whitened(column)
    };
    let relaxing = relaxes_s
        .iter()
        .map(|s| of(&|at_s: f64| 1.0 - (-at_s.max(0.0) / s).exp()));
    let mut all: Vec<DVector<f64>> = relaxing.collect();
    if has_powers {
        all.extend([
            of(&|at_s| at_s / 3600.0),
            of(&|at_s| (at_s / 3600.0).powi(2)),
        ]);
    }
    all
}

/// One at some rows, whitened.
fn indicator(stack: &Stack<'_>, rows: &[usize]) -> DVector<f64> {
    let mut column = vec![0.0; stack.rows.len];
    rows.iter().for_each(|row| column[*row] = 1.0);
    stack.whitened(column)
}

/// On which side of a play each row lies.
fn sides(stack: &Stack<'_>, axis: Axis) -> Option<Vec<f64>> {
    let kind = effects::kind(PLAY)?;
    let mut values = vec![0.0; kind.parameters.len() + kind.free.len()];
    values[0] = 1.0;
    let play = (kind.build)(Target::Axis(axis), &values);
    let rows = stack.simulate(&[&*play]);
    let middle = rows.iter().sum::<f64>() / count(rows.len().max(1));
    Some(rows.iter().map(|mm| mm - middle).collect())
}
