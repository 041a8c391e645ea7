//! Thermometers that a log goes with as well as with the one of a named effect.
//!
//! # Model
//!
//! Bodies that are heated by one source warm alike. With z the readings, f what an effect shows that follows a thermometer, and L(tau) T
//! the warming of another one behind a lag, all beside what the other named effects show,
//!
//! ```text
//!   min over tau_1, tau_2 of |z - a_1 L(tau_1) T - a_2 L(tau_2) T|^2 - |z - f|^2 < D^2 of what is named      (1)
//! ```
//!
//! lists the effect of that other thermometer: the readings prefer neither by what is named. a_1 and a_2 are those of least squares;
//! together they are no larger than those of a machine. They may have two signs: a body behind another one follows with
//! (tau_1 L(tau_1) - tau_2 L(tau_2)) / (tau_1 - tau_2).
//!
//! A slow drift follows the clock. With it a thermometer is listed that the log goes with on time that was held out (`thermal`).
//!
//! # Holds when
//! Only logs were read. A thermometer has moved by more than its noise. A body answers with two times at most, and more than two bodies
//! together imitate nothing.

use std::collections::BTreeMap;

use metrology::Axis;
use nalgebra::{DMatrix, DVector};
use twin::Channel;
use twin::effects::Target;

use crate::judgement::by_clock::BY_CLOCK;
use crate::judgement::by_thermometer::{self, SHIFT};
use crate::judgement::cause::Member;
use crate::judgement::unresolved;
use crate::judgement::veto::MIN_D_TO_NAME;
use crate::noise::stack::Stack;
use crate::report::Status;
use crate::report::figures::Note;
use crate::search::nuisance::orthonormal;
use crate::search::rows::time_s;
use crate::search::signature::Library;
use crate::session::log;
use crate::session::thermal::{MOST_UM_PER_K, moved};

/// Effects that follow thermometers, and the one that follows the clock.
const FOLLOWING: [&str; 4] = ["spindle_growth", "column_bend", SHIFT, BY_CLOCK];
/// Lags that are tried, min.
const LAGS_OF_OTHERS_MIN: [f64; 11] = [
    0.0, 3.0, 6.0, 12.0, 20.0, 33.0, 55.0, 90.0, 150.0, 250.0, 420.0,
];
/// Most thermometers that are tried.
const MOST_THERMOMETERS: usize = 40;
/// Two columns with less of the second beside the first are one.
const LEAST_OWN: f64 = 1e-9;

/// Lists other thermometers with the members that follow one.
pub(crate) fn list(
    stack: &Stack<'_>,
    signatures: &Library,
    members: &mut [Member],
    thermometers: &[Note],
) {
    if !log::is_of_logs(stack) {
        return;
    }
    let kept: Vec<usize> = (0..members.len())
        .filter(|place| members[*place].status() != Status::Surrogate)
        .collect();
    let instance = |member: &Member| &signatures.instances[signatures.forms[member.form].instance];
    let shown: Vec<DVector<f64>> = { kept.iter().map(|place| &members[*place]) }
        .map(|member| stack.signature(&*instance(member).effect(&member.estimate.values)))
        .collect();
    let following: Vec<(usize, usize)> = { kept.iter().copied().enumerate() }
        .filter(|(_, place)| FOLLOWING.contains(&instance(&members[*place]).kind.id))
        .collect();
    if following.is_empty() {
        return;
    }
    let warming = Warming::new(stack);
    for (own, place) in following {
        let others = shown.iter().enumerate().filter(|(k, _)| *k != own);
        let basis = orthonormal(stack.z.len(), others.map(|(_, column)| column.clone()));
        let beside = |column: &DVector<f64>| column - &basis * basis.tr_mul(column);
        let found = beside(&shown[own]);
        if found.norm() < MIN_D_TO_NAME {
            continue;
        }
        let read = beside(&stack.z);
        let of_own = (&read - &found).norm_squared();
        let of = instance(&members[place]);
        let (id, target) = (of.kind.id, of.target.clone());
        let is_open = |thermometer: &str| match id {
            BY_CLOCK => by_thermometer::goes_with(thermometers).any(|own| own == thermometer),
            _ => !drives(stack, (id, &target), thermometer),
        };
        for (thermometer, by_axis) in &warming.columns {
            if !is_open(thermometer) {
                continue;
            }
            let mut left = read.clone();
            for columns in by_axis.values() {
                let columns: Vec<DVector<f64>> = columns.iter().map(beside).collect();
                left = left_of(&left, &columns);
            }
            if left.norm_squared() - of_own < MIN_D_TO_NAME.powi(2) {
                let (effect, axis) =
                    by_thermometer::effect_of(stack, thermometer, by_axis.keys().copied());
                let both = (&read - &left).dot(&found);
                let cos = both / ((&read - &left).norm() * found.norm()).max(f64::MIN_POSITIVE);
                unresolved::list(&mut members[place], effect, &axis, cos);
            }
        }
    }
}

/// Whether a thermometer is the one, or one of those, that an effect follows.
fn drives(stack: &Stack<'_>, (id, target): (&str, &Target), thermometer: &str) -> bool {
    let drivers = by_thermometer::drivers_of(stack, id, target);
    drivers.iter().any(|own| own == thermometer)
}

/// What each thermometer that moved shows behind each lag, by the axis that is read, whitened; for 1 K as 1 mm.
struct Warming {
    columns: BTreeMap<String, BTreeMap<Axis, Vec<DVector<f64>>>>,
}

impl Warming {
    fn new(stack: &Stack<'_>) -> Self {
        let axes = { stack.rows.blocks.iter() }.filter_map(|block| match block.channel {
            Channel::Length(axis) => Some(axis),
            _ => None,
        });
        let axes: std::collections::BTreeSet<Axis> = axes.collect();
        let read = stack.session.history.temperature_degc.iter();
        let moved = read.filter(|(_, degc)| moved::has_moved(degc));
        let of = |id: &String| {
            let by_axis = axes.iter().map(|axis| (*axis, columns(stack, id, *axis)));
            (id.clone(), by_axis.collect())
        };
        Self {
            columns: { moved.take(MOST_THERMOMETERS) }
                .map(|(id, _)| of(id))
                .collect(),
        }
    }
}

/// The warming of a thermometer behind each lag at the rows of an axis.
fn columns(stack: &Stack<'_>, thermometer: &str, axis: Axis) -> Vec<DVector<f64>> {
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
            if block.channel != Channel::Length(axis) {
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

/// What (1) leaves of f.
fn left_of(found: &DVector<f64>, columns: &[DVector<f64>]) -> DVector<f64> {
    let along: Vec<f64> = columns.iter().map(|column| column.dot(found)).collect();
    let gram = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
        columns[i].dot(&columns[j])
    });
    let mut best = (0.0, [(0, 0.0); 2]);
    for i in 0..columns.len() {
        for j in i..columns.len() {
            let Some([a, b]) = sizes(&gram, &along, [i, j]) else {
                continue;
            };
            let gain = a * along[i] + b * along[j];
            if gain > best.0 {
                best = (gain, [(i, a), (j, b)]);
            }
        }
    }
    let mut left = found.clone();
    if best.0 > 0.0 {
        for (place, size) in best.1 {
            left.axpy(-size, &columns[place], 1.0);
        }
    }
    left
}

/// a_1 and a_2 of two lags, or of one; `None`: they are not determined, or larger than a machine's.
fn sizes(gram: &DMatrix<f64>, along: &[f64], [i, j]: [usize; 2]) -> Option<[f64; 2]> {
    let (own, other, both) = (gram[(i, i)], gram[(j, j)], gram[(i, j)]);
    let [a, b] = if i == j {
        (own > 0.0).then(|| [along[i] / own, 0.0])?
    } else {
        let determinant = own * other - both * both;
        if determinant <= LEAST_OWN * own * other {
            return None;
        }
        let a = (other * along[i] - both * along[j]) / determinant;
        let b = (own * along[j] - both * along[i]) / determinant;
        [a, b]
    };
    let most_mm = 1e-3 * MOST_UM_PER_K;
    (a.abs() + b.abs() <= most_mm).then_some([a, b])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn left(found: [f64; 3], columns: &[[f64; 3]]) -> f64 {
        let of = |values: [f64; 3]| DVector::from_vec(values.to_vec());
        let columns: Vec<DVector<f64>> = columns.iter().map(|column| of(*column)).collect();
        left_of(&of(found), &columns).norm()
    }

    #[test]
    fn eq1_two_lags_of_a_machines_size_take_what_they_show() {
        let near = |found: f64, by_hand: f64| assert!((found - by_hand).abs() < 1e-12, "{found}");
        // Columns of 100 for 1 K as 1 mm: 3 and 4 are 0.03 and 0.04 mm/K.
        let [first, second] = [[100.0, 0.0, 0.0], [0.0, 100.0, 0.0]];
        near(left([1.0, 2.0, 2.0], &[first, second]), 2.0);
        near(left([1.0, 2.0, 2.0], &[first]), 8.0_f64.sqrt());
        near(left([1.0, 2.0, 2.0], &[]), 3.0);
        near(left([1.0, -2.0, 2.0], &[first, second]), 2.0);
        // 70 µm/K together: no machine; the better one alone is 40.
        near(left([3.0, 4.0, 0.0], &[first, second]), 3.0);
        near(left([3.0, -4.0, 0.0], &[first, second]), 3.0);
        near(left([0.0, 0.0, 6.0], &[[0.0, 0.0, 100.0]]), 6.0);
    }
}
