//! Whether a curve through targets may be a periodic error that the targets do not resolve, or the other way round.
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
//! From [`MIN_COSINE_LISTED`] on the periodic error is listed with it: the recording cannot separate them. The same holds for what
//! a smooth curve, a cubic over the travel, leaves of f, with the waves of a turn and of half a turn, and of the periods near a turn: from
//! [`MIN_COSINE_ROUGH`] on, where that is itself as large as what is named. An error that begins with one wave a turn can be in a
//! curve of any shape beside a smooth lead error.
//!
//! A periodic error that was found is listed with the curve, where it has too few targets:
//!
//! ```text
//!   n < 2.5 L/p + 4  or  L < 4 p,   L the length that n targets span, p the period        (2)
//! ```
//!
//! A wave has two parameters a period: with hardly more targets a curve goes through them as well. Of three periods a curve of slower
//! waves follows more than half. Where a curve of the same axis was found beside it, the wave may be part of that.
//!
//! # Holds when
//! The period is the lead. A curve with other waves in it is no periodic error of the screw, whatever the targets resolve.

use std::f64::consts::TAU;

use metrology::Axis;
use nalgebra::DVector;
use twin::effects::Target;

use crate::judgement::cause::Member;
use crate::judgement::confidence::ODDS;
use crate::judgement::{Check, CheckId};
use crate::noise::stack::Stack;
use crate::report::{Confusable, Status};

use crate::judgement::veto::MIN_D_TO_NAME;
use crate::search::nuisance::orthonormal;
use crate::search::resolved;
use crate::search::rows::{count, position};
use crate::search::signature::{Instance, Library};

/// The curve, and what it may be.
const CURVE: &str = "pitch_error";
const PERIODIC: &str = "cyclic_error";
/// (1) from which the periodic error is listed.
const MIN_COSINE_LISTED: f64 = 0.9;
/// The same of what a smooth curve leaves, with four waves: four of many targets are far below it by chance.
const MIN_COSINE_ROUGH: f64 = 0.8;
/// Periods a turn of what turns with the screw, or a gear or belt beside it.
const PER_TURN: [f64; 9] = [0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.4, 1.6];
/// Degree of a smooth curve.
const SMOOTH_DEGREE: i32 = 3;
/// Targets of a period, and those of what else is fitted, below which a curve goes through them as well.
const TARGETS_A_PERIOD: f64 = 2.5;
const TARGETS_MORE: f64 = 4.0;
/// Periods of which a curve of slower waves follows half.
const MIN_PERIODS_ALONE: f64 = 4.0;

/// Lists the periodic error of an axis with a curve that may be one, and the curve with a periodic error of few targets.
pub(crate) fn list_periodic(stack: &Stack<'_>, signatures: &Library, members: &mut [Member]) {
    let curves: Vec<Target> = { members.iter() }
        .filter(|member| member.status() != Status::Surrogate)
        .map(|member| &signatures.instances[signatures.forms[member.form].instance])
        .filter(|instance| instance.kind.id == CURVE)
        .map(|instance| instance.target.clone())
        .collect();
    for member in members {
        let instance = &signatures.instances[signatures.forms[member.form].instance];
        let Target::Axis(axis) = instance.target else {
            continue;
        };
        if member.status() == Status::Surrogate {
            continue;
        }
        let rival = match instance.kind.id {
            CURVE => {
                let curve = stack.signature(&*instance.effect(&member.estimate.values));
                let whole = cosine(stack, axis, &curve)
                    .filter(|cos| *cos >= MIN_COSINE_LISTED && resolved::is_coarse(stack, axis));
                let rough = || rough_cosine(stack, axis, &curve);
                whole.or_else(rough).map(|cos| (PERIODIC, cos))
            }
            PERIODIC => {
                let is_beside = curves.contains(&instance.target);
                is_part_of_curve(stack, instance, &member.estimate.values, is_beside)
                    .then_some((CURVE, 1.0))
            }
            _ => None,
        };
        if let Some((effect, cos)) = rival {
            list(member, effect, &instance.target.to_string(), cos);
        }
    }
}

/// Lists an effect with a member that the recording cannot tell from it.
pub(crate) fn list(member: &mut Member, effect: &str, axis: &str, cos: f64) {
    let is_other = |other: &Confusable| other.effect != effect || other.axis != axis;
    member.confusable.retain(is_other);
    member.confusable.insert(
        0,
        Confusable {
            effect: effect.to_owned(),
            axis: axis.to_owned(),
            cos,
            excluded: false,
        },
    );
    let limit = 2.0 * ODDS.ln();
    member.put(Check::new(CheckId::NoRival, false).with(0.0, limit));
}

/// (1); `None` where the curve is zero or the axis has no lead.
fn cosine(stack: &Stack<'_>, axis: Axis, curve: &DVector<f64>) -> Option<f64> {
    let waves = waves(stack, axis, &[1.0])?.into_iter().filter(is_seen);
    let waves = orthonormal(stack.rows.len, waves);
    let whole = curve.norm();
    (whole > 0.0).then(|| waves.tr_mul(curve).norm() / whole)
}

/// The cosine of what a smooth curve leaves of this one with waves of a turn and of half a turn, where it is rough at targets, and they
/// are nearly all of it.
fn rough_cosine(stack: &Stack<'_>, axis: Axis, curve: &DVector<f64>) -> Option<f64> {
    if !resolved::is_at_targets(stack, axis) {
        return None;
    }
    let [low, high] = resolved::extent_mm(stack, axis)?;
    let smooth = (0..=SMOOTH_DEGREE).map(|power| {
        column(stack, axis, |at_mm| {
            (2.0 * (at_mm - low) / (high - low) - 1.0).powi(power)
        })
    });
    let smooth = orthonormal(stack.rows.len, smooth);
    let without = |column: &DVector<f64>| column - &smooth * smooth.tr_mul(column);
    let rough = without(curve);
    let size = rough.norm();
    let share = |per_turn: f64| {
        let waves = waves(stack, axis, &[per_turn, 2.0 * per_turn])?;
        let waves = waves.iter().map(without).filter(is_seen);
        let waves = orthonormal(stack.rows.len, waves);
        Some(waves.tr_mul(&rough).norm() / size.max(f64::MIN_POSITIVE))
    };
    // Far targets make every wave also one of some period near a turn: only that of a turn is looked for.
    let periods: &[f64] = if resolved::is_coarse(stack, axis) {
        &[1.0]
    } else {
        &PER_TURN
    };
    let shares = periods.iter().filter_map(|per_turn| share(*per_turn));
    let cos = shares.fold(0.0, f64::max);
    (size >= MIN_D_TO_NAME && cos >= MIN_COSINE_ROUGH).then_some(cos)
}

/// Whether a periodic error at targets may be part of a curve: (2), or a curve of that axis was found beside it.
fn is_part_of_curve(
    stack: &Stack<'_>,
    instance: &Instance,
    values: &[f64],
    is_beside: bool,
) -> bool {
    let Target::Axis(axis) = instance.target else {
        return false;
    };
    if !resolved::is_at_targets(stack, axis) {
        return false;
    }
    let span =
        resolved::extent_mm(stack, axis).zip(resolved::period_mm(stack, instance, axis, values));
    let (Some(targets), Some(([low, high], period_mm))) = (resolved::targets(stack, axis), span)
    else {
        return false;
    };
    let periods = (high - low) / period_mm;
    let is_short = periods < MIN_PERIODS_ALONE;
    let needed = TARGETS_A_PERIOD * periods + TARGETS_MORE;
    is_beside || is_short || count(targets.len()) < needed
}

/// Sine and cosine of so many periods a turn over the places, whitened.
fn waves(stack: &Stack<'_>, axis: Axis, per_turn: &[f64]) -> Option<Vec<DVector<f64>>> {
    let lead_mm = stack.twin.machine().linear(axis)?.lead_mm;
    let rad = |at_mm: f64, n: f64| TAU * n * at_mm / lead_mm;
    let waves = per_turn.iter().flat_map(|n| {
        [
            column(stack, axis, |at_mm| rad(at_mm, *n).sin()),
            column(stack, axis, |at_mm| rad(at_mm, *n).cos()),
        ]
    });
    Some(waves.collect())
}

/// Whether a wave is more than rounding at the places: at whole leads it is a constant, which the zero of a run takes.
fn is_seen(wave: &DVector<f64>) -> bool {
    wave.norm() > 1e-6
}

/// A function of an axis' place over the rows, whitened.
pub(crate) fn column(stack: &Stack<'_>, axis: Axis, of: impl Fn(f64) -> f64) -> DVector<f64> {
    let mut column = vec![0.0; stack.rows.len];
    for block in &stack.rows.blocks {
        let run = &stack.session.runs[block.run];
        for (row, place) in block.rows.iter().zip(block.range()) {
            let at_mm = position(run, row, axis);
            if at_mm.is_finite() {
                column[place] = of(at_mm);
            }
        }
    }
    stack.whitened(column)
}
