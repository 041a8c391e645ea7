//! Why a member of the best set is named, or only shown.
//!
//! A member is named where nothing of [`Veto`] speaks against it. What does not hold by itself (one size under all
//! conditions, off its bounds, above the form error, sure) is set aside before the others are judged, so that a
//! look-alike in the set does not take a cause's gain from it.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use machine::effects::{self, Parameter, Role};
use machine::twin::Channel;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::cause::{Best, Member, Scope};
use crate::challenge::{self, Cost};
use crate::confidence::{Rivals, adequacy};
use crate::config::GapConfig;
use crate::confirm;
use crate::field;
use crate::form_error::FormError;
use crate::guard;
use crate::in_common::in_common;
use crate::isolability;
use crate::normal::Normal;
use crate::nuisance::orthonormal;
use crate::recalibration::recalibrated;
use crate::refit::{self, Estimate};
use crate::report::{Confusable, Constancy, Status};
use crate::rows::{Block, count};
use crate::rule::Rule;
use crate::selection::{MOST_CANCELLING, Set};
use crate::signature::{Instance, Library};
use crate::stack::Stack;

/// What speaks against naming an effect that was found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Veto {
    /// It has another size under another condition.
    Constancy {
        /// The condition.
        split_by: String,
    },
    /// A size or a shape stands at the end of its physical range.
    AtBound,
    /// It is to have begun before anything that shows it was measured.
    NoChange,
    /// A curve that is a line where it was read.
    Straight,
    /// Every axis has the same size: one cause common to all.
    InCommon,
    /// It is so small that noise makes as much now and then.
    NearNoise,
    /// Nowhere is it larger than what every simulator is off by.
    BelowForm,
    /// From run to run its size differs so much that it may be nothing.
    NotSure,
    /// Most of it is taken away again by the other effects of the set.
    Cancels,
    /// A shape without a physics fits better in its place.
    Shape,
    /// Without it the rest explains nearly as much.
    NotNeeded,
    /// It does not hold on runs left out.
    HeldOut,
    /// It explains less than twice what stays unexplained.
    SmallBesideLeft,
    /// The noise is not that of the repeats.
    NoiseFloor,
}

impl fmt::Display for Veto {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Constancy { split_by } => {
                write!(f, "its size is not the same for every {split_by}")
            }
            Self::AtBound => f.write_str("its size stands at the end of its physical range"),
            Self::NoChange => f.write_str("nothing was measured before it is to have begun"),
            Self::Straight => f.write_str("its curve is a straight line where it was read"),
            Self::InCommon => f.write_str("every axis has the same: one cause common to all"),
            Self::NearNoise => f.write_str("noise makes as much now and then"),
            Self::BelowForm => {
                f.write_str("it is nowhere larger than the simulator's own error of form")
            }
            Self::NotSure => f.write_str("its size differs too much from run to run"),
            Self::Cancels => f.write_str("other effects found take most of it away again"),
            Self::Shape => f.write_str("a shape without a physics fits better in its place"),
            Self::NotNeeded => f.write_str("without it the rest explains nearly as much"),
            Self::HeldOut => f.write_str("it does not hold on runs left out"),
            Self::SmallBesideLeft => f.write_str("much more than it explains stays unexplained"),
            Self::NoiseFloor => f.write_str("the noise is not that of the repeats"),
        }
    }
}

/// A member of an insufficient set must gain this many times what is left unexplained. A share of the whole gain
/// instead would withdraw the smaller of two true causes (plays of 5 and 3 µm).
const LEAST_RATIO: f64 = 2.0;

/// D below which nothing is named. In some 550 blind trials 15 of 19 names below it were wrong, and 27 of 330 above 8: a price that
/// holds for white noise is too small for the noise of machines, of which only a few repeats tell. It holds for one column;
/// each further one fits noise as well, and costs what it costs in the score (`least_d_squared`).
pub(crate) const LEAST_D: f64 = 6.5;

/// D^2 below which a member with so many columns is not named, by the logarithm of the rows.
pub(crate) fn least_d_squared(columns: usize, log_rows: f64) -> f64 {
    LEAST_D.powi(2) + count(columns.saturating_sub(1)) * log_rows
}

/// The members of the best set, those that are named first.
pub(crate) fn judged(
    scope: &Scope<'_, '_>,
    signatures: &Library,
    normal: &Normal,
    best: &Best,
    forms: &[usize],
    is_closed: bool,
) -> Vec<Member> {
    let rivals = Rivals::new(signatures, &best.visited);
    let (constancies, vetoes) = vetoes(scope, signatures, best, &rivals, is_closed);
    let [before, after] = [scope.stack.z.norm_squared(), best.left.norm_squared()];
    let flagged = best.leftover.flagged();
    let adequacy = adequacy(flagged, before, after, scope.stack.freedom());
    let instances = best.instances(signatures);
    let judged = constancies.into_iter().zip(vetoes);
    let member = |((place, form), (constancy, vetoes)): ((usize, &usize), (_, Vec<Veto>))| {
        let instance = signatures.forms[*form].instance;
        let instead = rivals.instead_of(&instances, instance);
        let holds = vetoes.is_empty();
        Member {
            form: *form,
            status: match (holds, rivals.is_alone(instance)) {
                (false, _) => Status::Surrogate,
                (true, true) => Status::Named,
                (true, false) => Status::Set,
            },
            confidence: recalibrated(
                scope.config,
                rivals.probability(instance) * adequacy * if holds { 1.0 } else { 0.5 },
            ),
            confusable: confusable(signatures, normal, &instead, *form, forms),
            constancy,
            vetoes,
            rivals: without(signatures, best, instance),
            estimate: best.refit.estimates[place].clone(),
        }
    };
    let mut members: Vec<Member> = best
        .set
        .iter()
        .enumerate()
        .zip(judged)
        .map(member)
        .collect();
    let rank = |member: &Member| (member.status == Status::Surrogate, -member.estimate.d);
    members.sort_by(|a, b| rank(a).partial_cmp(&rank(b)).expect("D is a number"));
    members
}

/// Constancy of each member, and all that speaks against it.
fn vetoes(
    scope: &Scope<'_, '_>,
    signatures: &Library,
    best: &Best,
    rivals: &Rivals,
    is_closed: bool,
) -> (Vec<Constancy>, Vec<Vec<Veto>>) {
    let (constancies, mut vetoes) = own_vetoes(scope, signatures, best);
    let kept: Vec<usize> = (0..vetoes.len())
        .filter(|place| vetoes[*place].is_empty())
        .collect();
    let parts: Vec<DVector<f64>> = kept
        .iter()
        .map(|place| best.refit.parts[*place].clone())
        .collect();
    let confirmed = confirm::held_out_gains(scope.stack, &parts);
    let gains = drop_one_gains(scope.stack, &parts);
    let [before, after] = [scope.stack.z.norm_squared(), best.left.norm_squared()];
    let unexplained = (after - scope.stack.freedom()).max(0.0);
    for (k, place) in kept.into_iter().enumerate() {
        if !confirmed[k] && scope.config.applies(Rule::HeldOut) {
            vetoes[place].push(Veto::HeldOut);
        }
        if !is_closed && gains[k] < LEAST_RATIO * unexplained {
            vetoes[place].push(Veto::SmallBesideLeft);
        }
    }
    for place in common(signatures, best, &vetoes) {
        vetoes[place].push(Veto::InCommon);
    }
    let instances = best.instances(signatures);
    for (place, vetoes) in vetoes.iter_mut().enumerate() {
        let instance = signatures.forms[best.set[place]].instance;
        if best.refit.estimates[place].d.powi(2) > MOST_CANCELLING * (before - after) {
            vetoes.push(Veto::Cancels);
        }
        if !is_closed && is_beaten(scope, signatures, best, place) {
            vetoes.push(Veto::Shape);
        }
        if !rivals.is_needed(&instances, instance) {
            vetoes.push(Veto::NotNeeded);
        }
    }
    (constancies, vetoes)
}

/// Constancy of each member, and what speaks against it whatever the others are.
fn own_vetoes(
    scope: &Scope<'_, '_>,
    signatures: &Library,
    best: &Best,
) -> (Vec<Constancy>, Vec<Vec<Veto>>) {
    let of = |(place, ((form, estimate), sure)): (usize, ((&usize, &Estimate), bool))| {
        let instance = &signatures.instances[signatures.forms[*form].instance];
        let raw = scope.stack.simulate(&[&*instance.effect(&estimate.values)]);
        let (jacobian, left) = (&best.refit.jacobian, &best.left);
        let limits = confirm::Limits::of(scope.config, instance.kind);
        let constancy = confirm::constancy(scope.stack, &raw, jacobian, left, limits);
        let mut vetoes = Vec::new();
        if !constancy.passed {
            let split_by = constancy.split_by.clone();
            vetoes.push(Veto::Constancy { split_by });
        }
        if railed(instance, estimate, best, place) {
            vetoes.push(Veto::AtBound);
        }
        if is_straight(scope.stack, instance, estimate) {
            vetoes.push(Veto::Straight);
        }
        if is_before_all(scope.stack, instance, estimate) {
            vetoes.push(Veto::NoChange);
        }
        let least = least_d_squared(estimate.active.len(), scope.stack.freedom().ln());
        if estimate.d.powi(2) < least {
            vetoes.push(Veto::NearNoise);
        }
        if !rises(scope.stack, raw, scope.config) {
            vetoes.push(Veto::BelowForm);
        }
        if !sure {
            vetoes.push(Veto::NotSure);
        }
        (constancy, vetoes)
    };
    let members = best.set.iter().zip(&best.refit.estimates);
    let members = members.zip(surely(scope.stack, best));
    members.enumerate().map(of).unzip()
}

/// Members that hold by themselves and are one cause that every axis shows.
fn common(signatures: &Library, best: &Best, vetoes: &[Vec<Veto>]) -> BTreeSet<usize> {
    let members: Vec<(usize, &Instance, &Estimate)> = (0..vetoes.len())
        .filter(|place| vetoes[*place].is_empty())
        .map(|place| {
            let instance = signatures.forms[best.set[place]].instance;
            let estimate = &best.refit.estimates[place];
            (place, &signatures.instances[instance], estimate)
        })
        .collect();
    in_common(&members)
}

/// Whether a shape without a physics does better in the place of a member.
fn is_beaten(scope: &Scope<'_, '_>, signatures: &Library, best: &Best, place: usize) -> bool {
    let widths = || {
        best.refit
            .estimates
            .iter()
            .map(|estimate| estimate.active.len())
    };
    let first: usize = widths().take(place).sum();
    let own = first..first + best.refit.estimates[place].active.len();
    let columns = best.refit.jacobian.iter().enumerate();
    let others: Vec<DVector<f64>> = columns
        .filter(|(column, _)| !own.contains(column))
        .map(|(_, column)| column.clone())
        .collect();
    let cost = Cost {
        price: signatures.forms[best.set[place]].price,
        log_rows: scope.stack.freedom().ln(),
        log_instances: count(signatures.seen().max(2)).ln(),
    };
    challenge::is_beaten(
        scope.slots,
        &best.left,
        &best.refit.parts[place],
        &others,
        cost,
    )
}

/// Sets that are kept for each member.
const RIVALS: usize = 4;

/// The best sets that were visited without an instance, one for each set of instances.
fn without(signatures: &Library, best: &Best, instance: usize) -> Vec<(Set, f64)> {
    let least = best.visited[&best.set];
    let instances = |set: &Set| -> BTreeSet<usize> {
        set.iter()
            .map(|form| signatures.forms[*form].instance)
            .collect()
    };
    let mut found = BTreeMap::<BTreeSet<usize>, (Set, f64)>::new();
    for (set, score) in best.visited.iter().filter(|(_, score)| score.is_finite()) {
        let own = instances(set);
        let is_better = found.get(&own).is_none_or(|(_, known)| score < known);
        if !own.contains(&instance) && is_better {
            found.insert(own, (set.clone(), *score));
        }
    }
    let mut rivals: Vec<(Set, f64)> = found
        .into_values()
        .map(|(set, score)| (set, score - least))
        .collect();
    rivals.sort_by(|a, b| a.1.total_cmp(&b.1));
    rivals.truncate(RIVALS);
    rivals
}

/// Standard uncertainties by which a size must be off zero.
pub const SURE: f64 = 4.5;

/// Whether the size of each member is surely not zero by how it differs from run to run: noise that a dozen touches
/// show too small makes any D.
fn surely(stack: &Stack<'_>, best: &Best) -> Vec<bool> {
    if best.refit.parts.is_empty() {
        return vec![];
    }
    let parts = DMatrix::from_columns(&best.refit.parts);
    let relative = refit::standard_uncertainties(stack, &parts, &best.left);
    relative.into_iter().map(|u| u * SURE < 1.0).collect()
}

/// A block with fewer stations shows no waves.
const FEWEST_STATIONS: usize = 24;

/// Whether a signature rises anywhere above the error of form that every simulator has: below it nothing is named,
/// however often it was measured. What smooth waves over the test do not tell of it (steps, ripple of a screw) is held
/// against the part of that error which is not smooth either.
fn rises(stack: &Stack<'_>, raw: Vec<f64>, config: &GapConfig) -> bool {
    let base = FormError::base(config);
    let floated = stack.floated(raw);
    let above = |rows: &[f64], least: f64| rows.iter().any(|row| row.abs() > least);
    stack.rows.blocks.iter().any(|block| {
        let least = base.of(block);
        let rows = &floated[block.range()];
        above(rows, least)
            || (block.channel != Channel::Touch
                && rows.len() >= FEWEST_STATIONS
                && above(&rough(stack, block, rows), guard::ROUGH * least))
    })
}

/// What smooth waves over a block leave of its rows.
fn rough(stack: &Stack<'_>, block: &Block, rows: &[f64]) -> Vec<f64> {
    let (_, modes) = field::modes(&stack.session.runs[block.run], block);
    let columns = modes.column_iter().map(|column| column.into_owned());
    let basis = orthonormal(rows.len(), columns);
    let rows = DVector::from_column_slice(rows);
    let told = &basis * basis.tr_mul(&rows);
    (rows - told).iter().copied().collect()
}

/// Whether an amplitude of a member stands at a bound that is not zero, or a shape that the recording tells of at one that is
/// no machine's: a form that wants to be beyond is another's. A range as far below zero as above tells an end of an
/// axis, and either is as good as the middle; warmth flows with every time constant, of which a model has one or two.
fn railed(instance: &Instance, estimate: &Estimate, best: &Best, member: usize) -> bool {
    let own = instance.kind.parameters;
    let all: Vec<&Parameter> = own.iter().chain(instance.kind.free).collect();
    let widths = best.refit.estimates.iter().map(|e| e.active.len());
    let first: usize = widths.take(member).sum();
    estimate.active.iter().enumerate().any(|(k, place)| {
        let parameter = all[*place];
        let is_told = || match parameter.role {
            Role::Amplitude => true,
            Role::Shape { .. } | Role::Frequency { .. } => {
                let told = beside_others(&best.refit.jacobian, first + k) * parameter.typical;
                let is_end = parameter.low + parameter.high <= 0.0;
                !is_end && !parameter.name.ends_with(LAG) && told > SAME
            }
        };
        estimate.at_bound[*place] && estimate.values[*place] != 0.0 && is_told()
    })
}

/// End of the names of time constants of heat.
const LAG: &str = "_min";

/// What a derivative has beside all others, its norm.
fn beside_others(jacobian: &[DVector<f64>], own: usize) -> f64 {
    let others = jacobian.iter().enumerate().filter(|(k, _)| *k != own);
    let basis = orthonormal(
        jacobian[own].len(),
        others.map(|(_, column)| column.clone()),
    );
    (&jacobian[own] - &basis * basis.tr_mul(&jacobian[own])).norm()
}

/// Share of a curve's D that must be left beside a line. Of 30 curves in trials 22 true ones leave 0.7 and more, 8 that took
/// the place of a scale or a squareness 0.10 and less.
const LEAST_BEND: f64 = 0.2;

/// Whether a curve over the travel is a line where it was read: its slope is another matter's.
fn is_straight(stack: &Stack<'_>, instance: &Instance, estimate: &Estimate) -> bool {
    let Some(line) = effects::line(instance.kind, &instance.target) else {
        return false;
    };
    let whole = stack.signature(&*instance.effect(&estimate.values));
    let line = stack.signature(&*line);
    let bend = &whole - &line * (whole.dot(&line) / line.norm_squared().max(f64::MIN_POSITIVE));
    bend.norm() < SAME.max(LEAST_BEND * whole.norm())
}

/// Parameter that tells when an effect begins, min.
const BEGINS: &str = "at_min";
/// Whitened distance below which two signatures are the same.
const SAME: f64 = 3.0;

/// Whether a step in time would look the same at the very beginning: then what is there does not change.
fn is_before_all(stack: &Stack<'_>, instance: &Instance, estimate: &Estimate) -> bool {
    let own = instance.kind.parameters;
    let shapes = || own.iter().filter(|p| p.role != Role::Amplitude);
    let is_step = shapes().count() == 1 && estimate.active.iter().all(|place| *place < own.len());
    let begins = own.iter().position(|parameter| parameter.name == BEGINS);
    let Some(begins) = begins.filter(|_| is_step) else {
        return false;
    };
    let mut values = estimate.values.clone();
    values[begins] = own[begins].low;
    let of = |values: &[f64]| stack.signature(&*instance.effect(values));
    (of(&values) - of(&estimate.values)).norm() < SAME
}

/// What is lost when each member alone is left out, the others refitted.
fn drop_one_gains(stack: &Stack<'_>, parts: &[DVector<f64>]) -> Vec<f64> {
    if parts.is_empty() {
        return vec![];
    }
    let normal = Normal::new(&DMatrix::from_columns(parts), &stack.z);
    let all: Vec<usize> = (0..parts.len()).collect();
    let whole = normal.solve(&all).gain;
    let without = |out: &usize| -> f64 {
        let others: Vec<usize> = all.iter().copied().filter(|k| k != out).collect();
        normal.solve(&others).gain
    };
    all.iter().map(|out| whole - without(out)).collect()
}

/// What has a smaller cosine than this looks like nothing of the kind.
const LEAST_COS: f64 = 0.05;

/// What looks like a form, among one form of each instance; `instead` is what can stand in its place.
pub fn confusable(
    signatures: &Library,
    normal: &Normal,
    instead: &BTreeSet<usize>,
    form: usize,
    forms: &[usize],
) -> Vec<Confusable> {
    let instance = signatures.forms[form].instance;
    let mut all: Vec<Confusable> = forms
        .iter()
        .filter(|other| signatures.forms[**other].instance != instance)
        .map(|other| {
            let own = signatures.forms[*other].instance;
            Confusable {
                effect: signatures.instances[own].kind.id.to_owned(),
                axis: signatures.instances[own].target.to_string(),
                cos: isolability::cos(signatures, normal, form, *other),
                excluded: !instead.contains(&own),
            }
        })
        .filter(|other| other.cos > 0.4 || (!other.excluded && other.cos > LEAST_COS))
        .collect();
    all.sort_by(|a, b| a.excluded.cmp(&b.excluded).then(b.cos.total_cmp(&a.cos)));
    all.truncate(6);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_further_column_must_bring_what_it_costs_in_the_score() {
        let log_rows = 5_000_f64.ln();
        assert!((least_d_squared(1, log_rows).sqrt() - LEAST_D).abs() < 1e-12);
        assert!((least_d_squared(3, log_rows).sqrt() - 7.6996).abs() < 1e-3);
        assert!(least_d_squared(0, log_rows) >= LEAST_D.powi(2));
    }
}
