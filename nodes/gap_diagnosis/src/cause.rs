//! From signatures to named causes.
//!
//! The catalogue's own forms are tried first, then the wide forms of the effects found (and of their rivals) as well,
//! so that a form that is not quite the catalogue's does not call for a second cause. A member is named where it holds on runs left out, has one size under all conditions,
//! stands off its physical bounds, is not a small part of a gap that stays unexplained, and the noise is the repeats';
//! otherwise it is a surrogate, shown and not added. A named member with rivals is a set.

use std::collections::{BTreeMap, BTreeSet};

use machine::effects::{Kind, Moment, Parameter, Role};
use machine::file::EffectEntry;
use machine::twin::Channel;
use nalgebra::{DMatrix, DVector};

use crate::challenge::{self, Cost};
use crate::confidence::{Rivals, adequacy};
use crate::config::GapConfig;
use crate::confirm;
use crate::families::Slot;
use crate::figures::Note;
use crate::form_doubt;
use crate::form_error::FormError;
use crate::isolability;
use crate::noise::Noise;
use crate::normal::Normal;
use crate::recalibration::recalibrated;
use crate::refit::{self, Estimate, Refit};
use crate::report::{Cause, Confusable, Constancy, ParameterValue, Status};
use crate::rows::count;
use crate::rule::Rule;
use crate::selection::{Limits, MOST_CANCELLING, Search, Set};
use crate::signature::{Form, Instance, Library};
use crate::stack::Stack;
use crate::unknown::{self, Leftover};
use crate::widening;

/// Everything that the search found.
pub struct Found {
    /// Signatures.
    pub signatures: Library,
    /// Their Gram matrix.
    pub normal: Normal,
    /// Members of the best set with their values.
    pub members: Vec<Member>,
    /// What the set leaves.
    pub left: DVector<f64>,
    /// Its scores.
    pub leftover: Leftover,
    /// One form of each instance, the best set's where it has one.
    pub forms: Vec<usize>,
    /// The best set, places among the forms.
    pub set: Set,
}

/// One effect of the best set.
#[derive(Clone, Debug)]
pub struct Member {
    /// Its form among the signatures.
    pub form: usize,
    /// Its values.
    pub estimate: Estimate,
    /// How sure.
    pub status: Status,
    /// Probability.
    pub confidence: f64,
    /// What looks like it.
    pub confusable: Vec<Confusable>,
    /// Whether it has one size.
    pub constancy: Constancy,
    /// The best sets that do without it, and by how much worse each is.
    pub rivals: Vec<(Set, f64)>,
}

/// What a search is made with.
pub struct Scope<'s, 'a> {
    /// The runs that are fitted.
    pub stack: &'s Stack<'a>,
    /// Families of those runs.
    pub slots: &'s [Slot],
    /// The noise floor.
    pub noise: &'s BTreeMap<Channel, Noise>,
    /// Settings.
    pub config: &'s GapConfig,
}

struct Best {
    set: Set,
    visited: BTreeMap<Set, f64>,
    refit: Refit,
    left: DVector<f64>,
    leftover: Leftover,
}

impl Best {
    /// C of the set.
    fn score(&self) -> f64 {
        self.visited[&self.set]
    }
}

/// A member of an insufficient set must gain this many times what is left unexplained. A share of the whole gain
/// instead would withdraw the smaller of two true causes (plays of 5 and 3 µm).
const LEAST_RATIO: f64 = 2.0;

/// Searches the catalogue.
pub fn find(scope: &Scope<'_, '_>, kinds: &[&'static Kind]) -> Found {
    let stack = scope.stack;
    let means = kinds.iter().filter(|kind| kind.moment == Moment::Mean);
    let instances = Instance::all(stack.twin.machine(), means);
    let mut signatures = Library::new(stack, instances);
    let mut normal = signatures.normal(&stack.z);
    let mut best = search(scope, &signatures, &normal);
    let is_closed = !best.leftover.flagged();
    if !best.set.is_empty() && scope.config.applies(Rule::FreeShapes) {
        let sizes: Vec<f64> = best.refit.estimates.iter().map(|e| e.d).collect();
        widening::widen(stack, &mut signatures, &best.set, &sizes, &best.visited);
        normal = signatures.normal(&stack.z);
        let wide = search(scope, &signatures, &normal);
        let is_better = if is_closed {
            wide.score() < best.score() - 1e-9 && !wide.leftover.flagged()
        } else {
            wide.leftover.score < best.leftover.score
        };
        if is_better {
            best = wide;
        }
    }
    let forms = isolability::forms(&signatures, &normal, &best.set);
    let mut members = judged(scope, &signatures, &normal, &best, &forms, is_closed);
    resize(stack, &signatures, &normal, &mut members);
    while leave_out_small(stack, &signatures, &mut members) {
        resize(stack, &signatures, &normal, &mut members);
    }
    doubt_forms(stack, &signatures, &mut members);
    Found {
        signatures,
        normal,
        members,
        left: best.left,
        leftover: best.leftover,
        forms,
        set: best.set,
    }
}

/// Sizes what is named without the surrogates, as it will be simulated.
fn resize(stack: &Stack<'_>, signatures: &Library, normal: &Normal, members: &mut [Member]) {
    if members
        .iter()
        .all(|member| member.status != Status::Surrogate)
    {
        return;
    }
    let named = || {
        members
            .iter()
            .filter(|member| member.status != Status::Surrogate)
    };
    let forms: Vec<&Form> = named()
        .map(|member| &signatures.forms[member.form])
        .collect();
    let columns: Vec<usize> = forms.iter().flat_map(|form| form.columns.clone()).collect();
    let refit = refit::joint(stack, signatures, &forms, &normal.solve(&columns).sizes);
    let kept = members
        .iter_mut()
        .filter(|member| member.status != Status::Surrogate);
    for (member, estimate) in kept.zip(refit.estimates) {
        member.estimate = estimate;
    }
}

/// Widens the intervals of what is named by what the sizes owe to their forms.
fn doubt_forms(stack: &Stack<'_>, signatures: &Library, members: &mut [Member]) {
    let kept = || (0..members.len()).filter(|place| members[*place].status != Status::Surrogate);
    let places: Vec<usize> = kept().collect();
    let forms: Vec<&Form> = places
        .iter()
        .map(|place| &signatures.forms[members[*place].form])
        .collect();
    let mut estimates: Vec<Estimate> = places
        .iter()
        .map(|place| members[*place].estimate.clone())
        .collect();
    form_doubt::widen(stack, signatures, &forms, &mut estimates);
    for (place, estimate) in places.into_iter().zip(estimates) {
        members[place].estimate = estimate;
    }
}

/// Leaves out members that, sized without the surrogates, are below what they cost the search: they were found for
/// what the surrogates left. Whether there were any.
fn leave_out_small(stack: &Stack<'_>, signatures: &Library, members: &mut Vec<Member>) -> bool {
    let log_rows = stack.freedom().max(2.0).ln();
    let log_instances = count(signatures.seen().max(2)).ln();
    let before = members.len();
    members.retain(|member| {
        let price = count(signatures.forms[member.form].price) * log_rows + 2.0 * log_instances;
        member.status == Status::Surrogate || member.estimate.d.powi(2) >= price
    });
    members.len() < before
}

fn search(scope: &Scope<'_, '_>, signatures: &Library, normal: &Normal) -> Best {
    let stack = scope.stack;
    let mut search = Search::new(signatures, normal, stack.z.norm_squared(), stack.freedom());
    let set = search.run(Limits {
        beam: scope.config.beam,
        most_effects: scope.config.most_effects,
        swaps: scope.config.applies(Rule::SwapSearch),
    });
    search.alternatives(&set, 8);
    let sizes = search.fit(&set).sizes;
    let forms: Vec<&Form> = set.iter().map(|form| &signatures.forms[*form]).collect();
    let refit = refit::joint(stack, signatures, &forms, &sizes);
    let left = refit.left(stack);
    let leftover = unknown::leftover(
        stack,
        scope.slots,
        scope.noise,
        &left,
        &refit.jacobian,
        scope.config,
    );
    Best {
        set,
        visited: search.visited,
        refit,
        left,
        leftover,
    }
}

fn judged(
    scope: &Scope<'_, '_>,
    signatures: &Library,
    normal: &Normal,
    best: &Best,
    forms: &[usize],
    is_closed: bool,
) -> Vec<Member> {
    let rivals = Rivals::new(signatures, &best.visited);
    let steady = steady(scope, signatures, best);
    let kept: Vec<usize> = (0..steady.len()).filter(|place| steady[*place].1).collect();
    let parts: Vec<DVector<f64>> = kept
        .iter()
        .map(|place| best.refit.parts[*place].clone())
        .collect();
    let confirmed = confirm::held_out_gains(scope.stack, &parts);
    let gains = drop_one_gains(scope.stack, &parts);
    let [before, after] = [scope.stack.z.norm_squared(), best.left.norm_squared()];
    let freedom = scope.stack.freedom();
    let adequacy = adequacy(best.leftover.flagged(), before, after, freedom);
    let beaten: Vec<bool> = (0..best.set.len())
        .map(|place| !is_closed && is_beaten(scope, signatures, best, place))
        .collect();
    let unexplained = (after - freedom).max(0.0);
    let instances: BTreeSet<usize> = best
        .set
        .iter()
        .map(|form| signatures.forms[*form].instance)
        .collect();
    let member = |(place, form): (usize, &usize)| {
        let instance = signatures.forms[*form].instance;
        let estimate = best.refit.estimates[place].clone();
        let constancy = steady[place].0.clone();
        let among = kept.iter().position(|other| *other == place);
        let instead = rivals.instead_of(&instances, instance);
        let cancels = estimate.d.powi(2) > MOST_CANCELLING * (before - after);
        let holds = !cancels
            && !beaten[place]
            && rivals.is_needed(&instances, instance)
            && among.is_some_and(|k| {
                (confirmed[k] || !scope.config.applies(Rule::HeldOut))
                    && (is_closed || gains[k] >= LEAST_RATIO * unexplained)
            });
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
            rivals: without(signatures, best, instance),
            estimate,
        }
    };
    let mut members: Vec<Member> = best.set.iter().enumerate().map(member).collect();
    let rank = |member: &Member| (member.status == Status::Surrogate, -member.estimate.d);
    members.sort_by(|a, b| rank(a).partial_cmp(&rank(b)).expect("D is a number"));
    members
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

/// Constancy of each member, and whether it has one size and stands off its bounds. What does not is set aside
/// before the others are judged, so that a look-alike in the set does not take a cause's gain from it.
fn steady(scope: &Scope<'_, '_>, signatures: &Library, best: &Best) -> Vec<(Constancy, bool)> {
    let of = |(form, estimate): (&usize, &Estimate)| {
        let instance = &signatures.instances[signatures.forms[*form].instance];
        let raw = scope.stack.simulate(&[&*instance.effect(&estimate.values)]);
        let (jacobian, left) = (&best.refit.jacobian, &best.left);
        let constancy = confirm::constancy(scope.stack, &raw, jacobian, left, scope.config);
        let holds = constancy.passed
            && !railed(signatures, *form, estimate)
            && rises(scope.stack, raw, scope.config);
        (constancy, holds)
    };
    let members = best.set.iter().zip(&best.refit.estimates);
    let sure = surely(scope.stack, best);
    let steady = members.map(of).zip(sure);
    steady
        .map(|((constancy, holds), sure)| (constancy, holds && sure))
        .collect()
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

/// Whether a signature rises anywhere above the error of form that every simulator has: below it nothing is named,
/// however often it was measured.
fn rises(stack: &Stack<'_>, raw: Vec<f64>, config: &GapConfig) -> bool {
    let base = FormError::base(config);
    let floated = stack.floated(raw);
    stack.rows.blocks.iter().any(|block| {
        let least = base.of(block);
        floated[block.range()].iter().any(|row| row.abs() > least)
    })
}

/// Whether an amplitude stands at a bound that is not zero.
fn railed(signatures: &Library, form: usize, estimate: &Estimate) -> bool {
    signatures.forms[form]
        .amplitudes
        .iter()
        .any(|place| estimate.at_bound[*place] && estimate.values[*place] != 0.0)
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

impl Found {
    /// Takes the names away where the noise is not that of the repeats.
    pub fn withdraw(&mut self) {
        for member in &mut self.members {
            member.status = Status::Surrogate;
        }
    }

    /// The causes of the report.
    pub fn causes(&self) -> Vec<Cause> {
        self.members
            .iter()
            .map(|member| self.cause(member))
            .collect()
    }

    fn cause(&self, member: &Member) -> Cause {
        let instance = self.instance(member);
        let parameters = instance
            .kind
            .parameters
            .iter()
            .chain(instance.kind.free)
            .enumerate();
        Cause {
            effect: instance.kind.id.to_owned(),
            axis: instance.target.to_string(),
            status: member.status,
            confidence: member.confidence,
            parameters: parameters
                .filter(|(place, _)| member.estimate.active.contains(place))
                .map(|(place, parameter)| value(parameter, &member.estimate, place))
                .collect(),
            d: member.estimate.d,
            confusable_with: member.confusable.clone(),
            constancy: member.constancy.clone(),
        }
    }

    /// Instance of a member.
    pub fn instance(&self, member: &Member) -> &Instance {
        &self.signatures.instances[self.signatures.forms[member.form].instance]
    }

    /// Members that are no surrogates.
    pub fn named(&self) -> impl Iterator<Item = &Member> {
        self.members
            .iter()
            .filter(|member| member.status != Status::Surrogate)
    }

    /// The members that stand alone as entries of a machine file.
    pub fn entries(&self) -> Vec<EffectEntry> {
        let alone = self
            .members
            .iter()
            .filter(|member| member.status == Status::Named);
        alone
            .map(|member| entry(self.instance(member), &member.estimate.values))
            .collect()
    }

    /// The members that others could stand for: they are reported, and not written to a machine file.
    pub fn not_written(&self) -> Vec<Note> {
        let of_sets = self
            .members
            .iter()
            .filter(|member| member.status == Status::Set);
        let note = |member: &Member| {
            let open = member.confusable.iter().filter(|other| !other.excluded);
            Note::NotWritten {
                effect: self.instance(member).name(),
                others: open
                    .map(|o| format!("{} {}", o.effect, o.axis).trim_end().to_owned())
                    .collect(),
            }
        };
        of_sets.map(note).collect()
    }
}

/// Share of its physical range from which an interval says nothing of a parameter.
const WHOLE_RANGE: f64 = 0.9;

/// A parameter as it is reported: of a shape nothing is said beyond its physical range.
fn value(parameter: &Parameter, estimate: &Estimate, place: usize) -> ParameterValue {
    let (mut low, mut high) = (estimate.low[place], estimate.high[place]);
    if parameter.role != Role::Amplitude {
        low = low.max(parameter.low);
        high = high.min(parameter.high);
    }
    ParameterValue {
        name: parameter.name.to_owned(),
        value: estimate.values[place],
        low,
        high,
        at_bound: estimate.at_bound[place],
        determined: high - low < WHOLE_RANGE * (parameter.high - parameter.low),
    }
}

/// An effect as a machine file lists it.
pub fn entry(instance: &Instance, values: &[f64]) -> EffectEntry {
    let target = instance.target.to_string();
    let own = instance.kind.parameters.len();
    let parameters: BTreeMap<String, f64> = instance
        .kind
        .parameters
        .iter()
        .chain(instance.kind.free)
        .zip(values)
        .enumerate()
        .filter(|(place, (_, value))| *place < own || **value != 0.0)
        .map(|(_, (parameter, value))| (parameter.name.to_owned(), *value))
        .collect();
    EffectEntry {
        kind: instance.kind.id.to_owned(),
        axis: (!target.is_empty()).then_some(target),
        parameters,
    }
}
