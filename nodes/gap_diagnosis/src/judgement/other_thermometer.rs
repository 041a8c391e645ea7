//! Thermometers that a log goes with as well as with the one of a named effect.
//!
//! # Model
//!
//! Bodies that are heated by one source warm alike. With f what an effect shows that follows a thermometer, and L(tau) T the warming of
//! another one behind a lag, all beside what the other named effects show,
//!
//! ```text
//!   min over tau_1, tau_2 of |f - P(L(tau_1) T, L(tau_2) T) f| < D of what is named      (1)
//! ```
//!
//! lists the effect of that other thermometer: what tells them apart is less than what is named.
//!
//! # Holds when
//! Only logs were read. A body answers with two times at most, and more than two bodies together imitate nothing.

use machine::file::SensorPlace;
use nalgebra::DVector;
use twin::Channel;
use twin::effects::Target;

use crate::judgement::by_thermometer::{SHIFT, first_at};
use crate::judgement::cause::Member;
use crate::judgement::unresolved;
use crate::judgement::veto::MIN_D_TO_NAME;
use crate::noise::stack::Stack;
use crate::report::Status;
use crate::search::nuisance::orthonormal;
use crate::search::rows::time_s;
use crate::search::signature::Library;
use crate::session::log;

/// Effects that follow thermometers.
const FOLLOWING: [&str; 3] = [SPINDLE, "column_bend", SHIFT];
const SPINDLE: &str = "spindle_growth";
/// Lags that are tried, min.
const LAGS_OF_OTHERS_MIN: [f64; 11] = [
    0.0, 3.0, 6.0, 12.0, 20.0, 33.0, 55.0, 90.0, 150.0, 250.0, 420.0,
];

/// Lists other thermometers with the members that follow one.
pub(crate) fn list(stack: &Stack<'_>, signatures: &Library, members: &mut [Member]) {
    if !log::is_of_logs(stack) {
        return;
    }
    let of = |member: &Member| {
        let instance = &signatures.instances[signatures.forms[member.form].instance];
        (instance.kind.id, instance.target.clone())
    };
    let kept: Vec<usize> = (0..members.len())
        .filter(|place| members[*place].status() != Status::Surrogate)
        .collect();
    let shown: Vec<DVector<f64>> = { kept.iter() }
        .map(|place| {
            let instance = &signatures.instances[signatures.forms[members[*place].form].instance];
            stack.signature(&*instance.effect(&members[*place].estimate.values))
        })
        .collect();
    for (own, place) in kept.iter().enumerate() {
        let (id, target) = of(&members[*place]);
        if !FOLLOWING.contains(&id) {
            continue;
        }
        let others = shown.iter().enumerate().filter(|(k, _)| *k != own);
        let basis = orthonormal(stack.z.len(), others.map(|(_, column)| column.clone()));
        let beside = |column: &DVector<f64>| column - &basis * basis.tr_mul(column);
        let found = beside(&shown[own]);
        for thermometer in stack.session.history.temperature_degc.keys() {
            let (effect, axis) = named(stack, thermometer);
            let is_own = match &target {
                Target::Thermometer(id) => id == thermometer,
                _ => (effect, axis.as_str()) == (id, ""),
            };
            if is_own || is_of_bend(stack, id, thermometer) {
                continue;
            }
            let columns = columns(stack, thermometer);
            let columns: Vec<DVector<f64>> = columns.iter().map(beside).collect();
            let left = left_of(&found, &columns);
            if left < MIN_D_TO_NAME {
                let cos = (1.0 - (left / found.norm()).powi(2)).max(0.0).sqrt();
                unresolved::list(&mut members[*place], effect, &axis, cos);
            }
        }
    }
}

/// The effect of the catalogue that follows a thermometer in a log.
fn named(stack: &Stack<'_>, thermometer: &str) -> (&'static str, String) {
    let at = |place| first_at(stack, place).is_some_and(|id| id == thermometer);
    match (at(SensorPlace::SpindleFront), at(SensorPlace::SpindleRear)) {
        (true, _) => (SPINDLE, String::new()),
        (false, true) if first_at(stack, SensorPlace::SpindleFront).is_none() => {
            (SPINDLE, String::new())
        }
        (false, true) => (SPINDLE, thermometer.to_owned()),
        (false, false) => (SHIFT, thermometer.to_owned()),
    }
}

/// Whether a thermometer drives the bend of the column, which is the effect `id`.
fn is_of_bend(stack: &Stack<'_>, id: &str, thermometer: &str) -> bool {
    let places = [SensorPlace::Column, SensorPlace::Ambient, SensorPlace::Bed];
    let drives = |place| first_at(stack, place).is_some_and(|own| own == thermometer);
    id == FOLLOWING[1] && places.into_iter().any(drives)
}

/// The warming of a thermometer behind each lag, whitened.
fn columns(stack: &Stack<'_>, thermometer: &str) -> Vec<DVector<f64>> {
    let history = &stack.session.history;
    let Some(warming_k) = history.warming_k(thermometer) else {
        return vec![];
    };
    let of = |lag_min: &f64| {
        let lagged = match *lag_min > 0.0 {
            true => history.lagged_temperature(&warming_k, 60.0 * lag_min),
            false => warming_k.clone(),
        };
        let mut column = vec![0.0; stack.rows.len];
        for block in &stack.rows.blocks {
            if !matches!(block.channel, Channel::Length(_)) {
                continue;
            }
            let run = &stack.session.runs[block.run];
            for (row, value) in block.rows.iter().zip(&mut column[block.range()]) {
                *value = history.at(&lagged, time_s(run, row));
            }
        }
        stack.whitened(column)
    };
    LAGS_OF_OTHERS_MIN.iter().map(of).collect()
}

/// Left side of (1).
fn left_of(found: &DVector<f64>, columns: &[DVector<f64>]) -> f64 {
    let mut least = found.norm();
    for (k, first) in columns.iter().enumerate() {
        for second in &columns[k..] {
            let span = orthonormal(found.len(), [first.clone(), second.clone()].into_iter());
            let within = span.tr_mul(found).norm_squared();
            least = least.min((found.norm_squared() - within).max(0.0).sqrt());
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_what_two_lags_together_show_leaves_nothing() {
        let columns = [
            DVector::from_vec(vec![1.0, 0.0, 0.0]),
            DVector::from_vec(vec![0.0, 1.0, 0.0]),
        ];
        let found = DVector::from_vec(vec![3.0, 4.0, 2.0]);
        assert!((left_of(&found, &columns) - 2.0).abs() < 1e-12);
        assert!((left_of(&found, &columns[..1]) - 20.0_f64.sqrt()).abs() < 1e-12);
        assert!((left_of(&found, &[]) - 29.0_f64.sqrt()).abs() < 1e-12);
    }
}
