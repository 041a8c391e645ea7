//! Why a member of the best set is named, or only shown.
//!
//! A member is named where nothing of [`Veto`] speaks against it (`judgement`). What does not hold by itself (one size under all
//! conditions, off its bounds, above the form error, sure) is set aside before the others are judged, so that a
//! look-alike in the set does not take a cause's gain from it.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use twin::Channel;
use twin::effects::{self, Parameter, Role};

use crate::config::GapConfig;
use crate::judgement::by_clock;
use crate::judgement::cause::{Best, Member, Scope};
use crate::judgement::confidence::{Rivals, adequacy};
use crate::judgement::confirm;
use crate::judgement::guard;
use crate::judgement::in_common::{self, alike};
use crate::judgement::recalibration::recalibrated;
use crate::judgement::rule::Rule;
use crate::judgement::{self, Check, CheckId};
use crate::noise::form_error::FormError;
use crate::noise::normal::Normal;
use crate::noise::stack::Stack;
use crate::report::{Confusable, Constancy, Status};
use crate::search::challenge::{self, Cost};
use crate::search::field;
use crate::search::isolability;
use crate::search::nuisance::orthonormal;
use crate::search::refit::{self, Estimate};
use crate::search::rows::{Block, count};
use crate::search::selection::{MOST_CANCELLING, Set};
use crate::search::signature::{INSTANT, Instance, Library, OWN_TIME};

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
    /// With it the held-out runs are predicted worse than without it.
    WorseHeldOut,
    /// Its size is not determined.
    NotDetermined,
    /// It explains less than twice what stays unexplained.
    SmallBesideLeft,
    /// The log goes with other thermometers.
    OtherThermometer,
    /// A shift with a temperature explains more.
    Heat,
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
            Self::WorseHeldOut => f.write_str("the held-out runs come out worse with it"),
            Self::NotDetermined => f.write_str("the recording does not determine its size"),
            Self::SmallBesideLeft => f.write_str("much more than it explains stays unexplained"),
            Self::OtherThermometer => {
                f.write_str("no thermometer that the log goes with drives it")
            }
            Self::Heat => f.write_str("a shift with a temperature explains more"),
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
pub(crate) const MIN_D_TO_NAME: f64 = 6.5;

/// D^2 below which a member with so many columns is not named, by the logarithm of the rows.
pub(crate) fn least_d_squared(columns: usize, log_rows: f64) -> f64 {
    MIN_D_TO_NAME.powi(2) + count(columns.saturating_sub(1)) * log_rows
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
    let (constancies, checks) = checks(scope, signatures, best, &rivals, is_closed);
    let [before, after] = [scope.stack.z.norm_squared(), best.left.norm_squared()];
    let flagged = best.leftover.flagged();
    let adequacy = adequacy(flagged, before, after, scope.stack.freedom());
    let instances = best.instances(signatures);
    let judged = constancies.into_iter().zip(checks);
    let member = |((place, form), (constancy, checks)): ((usize, &usize), (_, Vec<Check>))| {
        let instance = signatures.forms[*form].instance;
        let mut instead = rivals.instead_of(&instances, instance);
        instead.extend(signatures.set_aside_for(instance));
        let holds = judgement::holds(&checks);
        Member {
            form: *form,
            confidence: recalibrated(
                scope.config,
                rivals.probability(instance) * adequacy * if holds { 1.0 } else { 0.5 },
            ),
            confusable: confusable(signatures, normal, &instead, *form, forms),
            constancy,
            checks,
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
    let rank = |member: &Member| (member.status() == Status::Surrogate, -member.estimate.d);
    members.sort_by(|a, b| rank(a).partial_cmp(&rank(b)).expect("D is a number"));
    members
}

/// Constancy of each member, and all its checks.
fn checks(
    scope: &Scope<'_, '_>,
    signatures: &Library,
    best: &Best,
    rivals: &Rivals,
    is_closed: bool,
) -> (Vec<Constancy>, Vec<Vec<Check>>) {
    let (constancies, mut checks) = own_checks(scope, signatures, best);
    add_shares(scope, best, is_closed, &mut checks);
    for (place, n) in counts_alike(signatures, best, &checks) {
        let most = in_common::MAX_OF_ONE_KIND;
        let check = Check::new(CheckId::OwnCause, n <= most);
        checks[place].push(check.with(count(n), count(most)));
    }
    let [before, after] = [scope.stack.z.norm_squared(), best.left.norm_squared()];
    let instances = best.instances(signatures);
    for (place, checks) in checks.iter_mut().enumerate() {
        let instance = signatures.forms[best.set[place]].instance;
        let (own, most) = (
            best.refit.estimates[place].d.powi(2),
            MOST_CANCELLING * (before - after),
        );
        checks.push(Check::new(CheckId::NotCancelled, own <= most).with(own, most));
        // A curve through targets is any shape itself.
        if !is_closed && !signatures.curves.contains(&instance) {
            checks.push(beside_shapes(scope, signatures, best, place));
        }
        checks.extend(by_clock::check(
            scope,
            signatures,
            best,
            place,
            &others(best, place),
        ));
        let is_shared = signatures.set_aside_for(instance).next().is_some();
        checks.extend(rivals.checks(&instances, instance, is_shared));
    }
    (constancies, checks)
}

/// Adds the checks of what each member gains, the others that hold by themselves beside it.
fn add_shares(scope: &Scope<'_, '_>, best: &Best, is_closed: bool, checks: &mut [Vec<Check>]) {
    let kept: Vec<usize> = (0..checks.len())
        .filter(|place| judgement::holds(&checks[*place]))
        .collect();
    let parts: Vec<DVector<f64>> = kept
        .iter()
        .map(|place| best.refit.parts[*place].clone())
        .collect();
    let confirmed = confirm::held_out_gains(scope.stack, &parts);
    let gains = drop_one_gains(scope.stack, &parts);
    let unexplained = (best.left.norm_squared() - scope.stack.freedom()).max(0.0);
    let shares = kept.into_iter().zip(confirmed).zip(gains);
    for ((place, held_out), gain) in shares {
        checks[place].extend(scope.config.tried(Rule::HeldOut, held_out));
        if !is_closed {
            let least = LEAST_RATIO * unexplained;
            let check = Check::new(CheckId::BesideUnexplained, gain >= least);
            checks[place].push(check.with(gain, least));
        }
    }
}

/// Constancy of each member, and the checks that it passes or fails whatever the others are.
fn own_checks(
    scope: &Scope<'_, '_>,
    signatures: &Library,
    best: &Best,
) -> (Vec<Constancy>, Vec<Vec<Check>>) {
    let stack = scope.stack;
    let of = |(place, ((form, estimate), relative_u)): (usize, ((&usize, &Estimate), f64))| {
        let instance = &signatures.instances[signatures.forms[*form].instance];
        let raw = stack.simulate(&[&*instance.effect(&estimate.values)]);
        let (jacobian, left) = (&best.refit.jacobian, &best.left);
        let limits = confirm::Limits::of(scope.config, instance.kind);
        let (constancy, one_size) = confirm::constancy(stack, &raw, jacobian, left, limits);
        let railed = railed(instance, estimate, best, place);
        let off_bounds = Check::new(CheckId::OffBounds, railed == 0).with(count(railed), 0.0);
        let bend = bend(stack, instance, estimate)
            .map(|(bend, least)| Check::new(CheckId::Curved, bend >= least).with(bend, least));
        let begins = since_begin(stack, instance, estimate).map(|changed| {
            Check::new(CheckId::Begins, changed >= SAME_SIGNATURE).with(changed, SAME_SIGNATURE)
        });
        let last = [
            above_noise(estimate, stack.freedom().ln()),
            above_form(stack, raw, scope.config, is_slow(instance)),
            Check::new(CheckId::Sure, relative_u * MIN_SIZE_DEVIATIONS < 1.0)
                .with(1.0 / relative_u, MIN_SIZE_DEVIATIONS),
        ];
        let first = [one_size, off_bounds];
        let checks = first.into_iter().chain(bend).chain(begins).chain(last);
        (constancy, checks.collect())
    };
    let members = best.set.iter().zip(&best.refit.estimates);
    let members = members.zip(relative_uncertainties(stack, best));
    members.enumerate().map(of).unzip()
}

/// Whether a member is larger than what noise makes now and then.
pub(crate) fn above_noise(estimate: &Estimate, log_rows: f64) -> Check {
    let least = least_d_squared(estimate.active.len(), log_rows);
    Check::new(CheckId::AboveNoise, estimate.d.powi(2) >= least).with(estimate.d, least.sqrt())
}

/// Of the members that hold so far, how many of one kind have the size that a member has.
fn counts_alike(
    signatures: &Library,
    best: &Best,
    checks: &[Vec<Check>],
) -> BTreeMap<usize, usize> {
    let members: Vec<(usize, &Instance, &Estimate)> = (0..checks.len())
        .filter(|place| judgement::holds(&checks[*place]))
        .map(|place| {
            let instance = signatures.forms[best.set[place]].instance;
            let estimate = &best.refit.estimates[place];
            (place, &signatures.instances[instance], estimate)
        })
        .collect();
    alike(&members)
}

/// Derivatives of the members beside the one at `place`.
fn others(best: &Best, place: usize) -> Vec<DVector<f64>> {
    let estimates = best.refit.estimates.iter();
    let first: usize = { estimates.take(place).map(|e| e.active.len()) }.sum();
    let own = first..first + best.refit.estimates[place].active.len();
    let columns = best.refit.jacobian.iter().enumerate();
    columns
        .filter(|(column, _)| !own.contains(column))
        .map(|(_, column)| column.clone())
        .collect()
}

/// Whether no shape without a physics does better in the place of a member.
fn beside_shapes(scope: &Scope<'_, '_>, signatures: &Library, best: &Best, place: usize) -> Check {
    let others = others(best, place);
    let cost = Cost {
        price: signatures.forms[best.set[place]].price,
        log_rows: scope.stack.freedom().ln(),
        log_instances: count(signatures.seen().max(2)).ln(),
    };
    challenge::check(
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
pub const MIN_SIZE_DEVIATIONS: f64 = 4.5;

/// Standard uncertainty of the size of each member over that size, by how it differs from run to run: noise that a dozen
/// touches show too small makes any D.
fn relative_uncertainties(stack: &Stack<'_>, best: &Best) -> Vec<f64> {
    if best.refit.parts.is_empty() {
        return vec![];
    }
    let parts = DMatrix::from_columns(&best.refit.parts);
    refit::standard_uncertainties(stack, &parts, &best.left)
}

/// A block with fewer stations shows no waves.
const MIN_STATIONS_OF_WAVES: usize = 24;

/// Kinds of [`OWN_TIME`] that show with the speed of the path, and so jump with it.
const WITH_SPEED: [&str; 2] = ["clock_drift", "latency_drift"];

/// Whether an effect wanders with time or heat, whatever the path is.
fn is_slow(instance: &Instance) -> bool {
    OWN_TIME.contains(&instance.kind.id) && !WITH_SPEED.contains(&instance.kind.id)
}

/// Whether a signature rises somewhere above the error of form that every simulator has: below it nothing is named,
/// however often it was measured. What smooth waves over the test do not tell of it (steps, ripple of a screw) is held
/// against the part of that error which is not smooth either. What wanders with time or heat has no
/// waves over the path: it is held against all of that error.
fn above_form(stack: &Stack<'_>, raw: Vec<f64>, config: &GapConfig, is_slow: bool) -> Check {
    let base = FormError::base(config);
    let floated = stack.floated(raw);
    let height = |rows: &[f64]| rows.iter().fold(0.0_f64, |most, row| most.max(row.abs()));
    let plain = |block: &Block| Height {
        unit: unit(&block.channel),
        value: height(&floated[block.range()]),
        limit: base.of(block),
    };
    let blocks = || stack.rows.blocks.iter();
    let mut best = Height::best(blocks().map(plain));
    if !is_slow && !best.as_ref().is_some_and(Height::is_above) {
        let is_path = |block: &&Block| {
            block.channel != Channel::Touch && block.range().len() >= MIN_STATIONS_OF_WAVES
        };
        let rough = |block: &Block| Height {
            value: height(&rough(stack, block, &floated[block.range()])),
            limit: guard::ROUGH_FORM_SHARE * base.of(block),
            ..plain(block)
        };
        best = Height::best(best.into_iter().chain(blocks().filter(is_path).map(rough)));
    }
    let check = Check::new(
        CheckId::AboveForm,
        best.as_ref().is_some_and(Height::is_above),
    );
    match best {
        // Inside mm, K and rad; for people thousandths of them.
        Some(best) => check
            .with(1e3 * best.value, 1e3 * best.limit)
            .in_unit(best.unit),
        None => check,
    }
}

/// Greatest height of a signature in a block with what it must be above.
struct Height {
    unit: &'static str,
    value: f64,
    limit: f64,
}

impl Height {
    fn is_above(&self) -> bool {
        self.value > self.limit
    }

    /// One that is above its limit before others, the farthest first; those without a limit last.
    fn best(all: impl Iterator<Item = Self>) -> Option<Self> {
        let rank = |one: &Self| {
            let ratio = one.value / one.limit;
            let ratio = if ratio.is_finite() { ratio } else { 0.0 };
            (one.is_above(), ratio)
        };
        all.max_by(|a, b| {
            let (a, b) = (rank(a), rank(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        })
    }
}

/// Thousandths of the unit that a channel's readings have inside.
fn unit(channel: &Channel) -> &'static str {
    match channel {
        Channel::Thermometer(_) => "mK",
        Channel::Motor(axis) | Channel::Scale(axis) if !axis.is_linear() => "mrad",
        _ => "µm",
    }
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

/// Number of parameters of a member that lie at the end of their range: amplitudes at an end other than zero, and shapes
/// that the recording determines at an end that no machine has. A form at such an end is that of another effect. Exempt
/// are a symmetric range, whose ends are the ends of an axis, and time constants of heat, of which a model has one or two.
fn railed(instance: &Instance, estimate: &Estimate, best: &Best, member: usize) -> usize {
    let own = instance.kind.parameters;
    let all: Vec<&Parameter> = own.iter().chain(instance.kind.free).collect();
    let widths = best.refit.estimates.iter().map(|e| e.active.len());
    let first: usize = widths.take(member).sum();
    let active = estimate.active.iter().enumerate();
    let is_railed = |(k, place): &(usize, &usize)| {
        let (k, place) = (*k, **place);
        let parameter = all[place];
        let is_told = || match parameter.role {
            Role::Amplitude => true,
            Role::Shape { .. } | Role::Frequency { .. } => {
                let told = beside_others(&best.refit.jacobian, first + k) * parameter.typical;
                let is_end = parameter.low + parameter.high <= 0.0;
                !is_end && !parameter.name.ends_with(LAG) && told > SAME_SIGNATURE
            }
        };
        let is_open = OPEN_BELOW.contains(&parameter.name)
            && estimate.values[place] < parameter.low.midpoint(parameter.high);
        estimate.at_bound[place] && estimate.values[place] != 0.0 && !is_open && is_told()
    };
    active.filter(is_railed).count()
}

/// Shapes that may be at their lower end: the friction of a drive that turns over at once is friction.
const OPEN_BELOW: [&str; 1] = ["length_mm"];

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

/// What a curve over the travel has beside a line where it was read, whitened, and the least that it must have: the slope of
/// a line is another matter's. None for what is no curve.
fn bend(stack: &Stack<'_>, instance: &Instance, estimate: &Estimate) -> Option<(f64, f64)> {
    let line = effects::line(instance.kind, &instance.target)?;
    let whole = stack.signature(&*instance.effect(&estimate.values));
    let line = stack.signature(&*line);
    let bend = &whole - &line * (whole.dot(&line) / line.norm_squared().max(f64::MIN_POSITIVE));
    Some((bend.norm(), SAME_SIGNATURE.max(LEAST_BEND * whole.norm())))
}

/// Whitened distance below which two signatures are the same.
pub(crate) const SAME_SIGNATURE: f64 = 3.0;

/// Whitened distance of a step in time from the same at the very beginning: where it is small, what is there does not change.
/// None for what is no step.
fn since_begin(stack: &Stack<'_>, instance: &Instance, estimate: &Estimate) -> Option<f64> {
    let own = instance.kind.parameters;
    let shapes = || own.iter().filter(|p| p.role != Role::Amplitude);
    let is_step = shapes().count() == 1 && estimate.active.iter().all(|place| *place < own.len());
    let begins = own.iter().position(|parameter| parameter.name == INSTANT);
    let begins = begins.filter(|_| is_step)?;
    let mut values = estimate.values.clone();
    values[begins] = own[begins].low;
    let of = |values: &[f64]| stack.signature(&*instance.effect(values));
    Some((of(&values) - of(&estimate.values)).norm())
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
        assert!((least_d_squared(1, log_rows).sqrt() - MIN_D_TO_NAME).abs() < 1e-12);
        assert!((least_d_squared(3, log_rows).sqrt() - 7.6996).abs() < 1e-3);
        assert!(least_d_squared(0, log_rows) >= MIN_D_TO_NAME.powi(2));
    }
}
