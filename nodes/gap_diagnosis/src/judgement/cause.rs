//! From signatures to named causes.
//!
//! The catalogue's own forms are tried first, then the wide forms of the effects found (and of their rivals) as well,
//! so that a form that is not quite the catalogue's does not call for a second cause. A member is named where it holds on runs left out, has one size under all conditions,
//! stands off its physical bounds, is not a small part of a gap that stays unexplained, and the noise is the repeats';
//! otherwise it is a surrogate, shown and not added. A named member with rivals is a set.

use std::collections::{BTreeMap, BTreeSet};

use machine::file::EffectEntry;
use nalgebra::DVector;
use twin::Channel;
use twin::effects::{Kind, Moment, Parameter, Role};

use crate::config::GapConfig;
use crate::judgement::aside;
use crate::judgement::at_instant;
use crate::judgement::by_clock::{self, InPlace};
use crate::judgement::by_heat;
use crate::judgement::by_thermometer;
use crate::judgement::form_doubt;
use crate::judgement::plain::{plainest, straightened};
use crate::judgement::rule::Rule;
use crate::judgement::unknown::{self, Leftover};
use crate::judgement::veto::{self, Veto};
use crate::judgement::{self, Check, CheckId};
use crate::judgement::{in_course, one_feed, one_plane, other_thermometer, unresolved, with_heat};
use crate::noise::Noise;
use crate::noise::normal::Normal;
use crate::noise::stack::Stack;
use crate::noise::unrepeated;
use crate::report::figures::Note;
use crate::report::{Cause, Confusable, Constancy, ParameterValue, Status};
use crate::search::families::Slot;
use crate::search::isolability;
use crate::search::lines;
use crate::search::refit::{self, Estimate, Refit};
use crate::search::rows::count;
use crate::search::selection::{Limits, Search, Set};
use crate::search::signature::{Begins, Form, Instance, Library};
use crate::search::widening;
use crate::session::thermal;

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
    /// Rows less floats of what was fitted.
    pub freedom: f64,
    /// Which thermometers the logs go with.
    pub thermometers: Vec<Note>,
}

/// One effect of the best set.
#[derive(Clone, Debug)]
pub struct Member {
    /// Its form among the signatures.
    pub form: usize,
    /// Its values.
    pub estimate: Estimate,
    /// Probability.
    pub confidence: f64,
    /// What looks like it.
    pub confusable: Vec<Confusable>,
    /// Whether it has one size.
    pub constancy: Constancy,
    /// What its status follows from.
    pub checks: Vec<Check>,
    /// The best sets that do without it, and by how much worse each is.
    pub rivals: Vec<(Set, f64)>,
}

impl Member {
    /// How sure.
    pub fn status(&self) -> Status {
        judgement::status(&self.checks)
    }

    /// What speaks against it; a surrogate has one at least.
    pub fn vetoes(&self) -> Vec<Veto> {
        judgement::vetoes(&self.checks, &self.constancy)
    }

    /// Adds a check, or puts it in the place of an earlier one of the same rule.
    pub(crate) fn put(&mut self, check: Check) {
        let mut own = self.checks.iter_mut();
        match own.find(|own| own.check == check.check) {
            Some(own) => *own = check,
            None => self.checks.push(check),
        }
    }
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
    /// First runs after what changed in the session: effects are tried from each of them on as well.
    pub begins: &'s [Begins],
}

pub(crate) struct Best {
    pub(crate) set: Set,
    pub(crate) visited: BTreeMap<Set, f64>,
    pub(crate) refit: Refit,
    pub(crate) left: DVector<f64>,
    pub(crate) leftover: Leftover,
}

impl Best {
    /// C of the set.
    fn score(&self) -> f64 {
        self.visited[&self.set]
    }

    /// Instances of the set.
    pub(crate) fn instances(&self, signatures: &Library) -> BTreeSet<usize> {
        let instance = |form: &usize| signatures.forms[*form].instance;
        self.set.iter().map(instance).collect()
    }
}

/// Lists with each member what reads the same in such a recording and was not in the search.
fn list_look_alikes(
    scope: &Scope<'_, '_>,
    signatures: &Library,
    members: &mut [Member],
    thermometers: &[Note],
) {
    let stack = scope.stack;
    unresolved::list_periodic(stack, signatures, members);
    one_feed::list(stack, signatures, members);
    one_plane::list(stack, signatures, members);
    by_clock::list_drift(stack, signatures, members);
    in_course::list(stack, signatures, members, scope.config);
    other_thermometer::list(stack, signatures, members, thermometers);
    with_heat::list(stack, signatures, members);
    at_instant::list(stack, signatures, members);
    by_heat::list(stack, signatures, members, scope.config);
}

/// Searches the catalogue.
pub fn find(scope: &Scope<'_, '_>, kinds: &[&'static Kind]) -> Found {
    let stack = scope.stack;
    let means = kinds.iter().filter(|kind| kind.moment == Moment::Mean);
    let instances = Instance::all(stack.twin.machine(), means);
    let mut instances = Instance::with_begins(instances, scope.begins);
    let thermometers = thermal::notes(stack);
    instances.retain(|own| !by_thermometer::is_of_another(stack, own, &thermometers));
    instances.extend(by_thermometer::shifts(scope, &thermometers));
    let none = InPlace::default();
    let found = found_among(scope, instances.clone(), &thermometers, &none);
    let shifts = by_clock::in_place(scope, &found);
    if !shifts.instances.is_empty() {
        let mut more = [&*instances, &*shifts.instances].concat();
        more.retain(|own| !shifts.replaces(own));
        let mut warmed = found_among(scope, more, &thermometers, &shifts);
        let is_shift = |member: &Member| warmed.instance(member).kind.id == by_thermometer::SHIFT;
        if warmed.named().any(is_shift) {
            shifts.list_drift(&mut warmed);
            return warmed;
        }
    }
    let hiding = by_thermometer::hiding(stack, &found);
    if hiding.is_empty() {
        return found;
    }
    instances.retain(|own| !by_thermometer::is_driven_by_none(stack, own, &thermometers));
    let mut instead = found_among(scope, instances, &thermometers, &none);
    let has_any = by_thermometer::list_hiding(stack, &mut instead, &hiding);
    if has_any { instead } else { found }
}

/// Searches some instances.
fn found_among(
    scope: &Scope<'_, '_>,
    instances: Vec<Instance>,
    thermometers: &[Note],
    shifts: &InPlace,
) -> Found {
    let stack = scope.stack;
    let mut signatures = Library::new(stack, instances);
    shifts.keep_own(&mut signatures);
    lines::add(stack, scope.slots, &mut signatures);
    widening::widen_curves(stack, &mut signatures);
    let mut normal = signatures.normal(&stack.z);
    [signatures.aside, signatures.shared] = aside::set_aside(stack, &signatures, &normal);
    let mut best = search(scope, &signatures, &normal);
    let is_closed = !best.leftover.flagged();
    if !best.set.is_empty() && scope.config.applies(Rule::FreeShapes) {
        let sizes: Vec<f64> = best.refit.estimates.iter().map(|e| e.d).collect();
        let set = (&best.set, &sizes[..]);
        widening::widen(stack, &mut signatures, set, &best.visited, is_closed);
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
    let mut members = veto::judged(scope, &signatures, &normal, &best, &forms, is_closed);
    by_thermometer::check(scope, &signatures, &mut members, thermometers);
    list_look_alikes(scope, &signatures, &mut members, thermometers);
    resize(stack, &signatures, &normal, &mut members);
    while leave_out_small(stack, &signatures, &mut members) {
        resize(stack, &signatures, &normal, &mut members);
    }
    if unrepeated::is_assumed(scope.noise) {
        for member in &mut members {
            member.confidence *= unrepeated::CONFIDENCE;
        }
    }
    members.sort_by_key(|member| member.status() == Status::Surrogate);
    doubt_forms(stack, &signatures, &mut members);
    check_sizes(&signatures, &mut members);
    resize(stack, &signatures, &normal, &mut members);
    Found {
        signatures,
        normal,
        members,
        left: best.left,
        leftover: best.leftover,
        forms,
        set: best.set,
        freedom: stack.freedom(),
        thermometers: thermometers.to_vec(),
    }
}

/// Sizes what is named without the surrogates, as it will be simulated.
fn resize(stack: &Stack<'_>, signatures: &Library, normal: &Normal, members: &mut [Member]) {
    if members
        .iter()
        .all(|member| member.status() != Status::Surrogate)
    {
        return;
    }
    let named = || {
        members
            .iter()
            .filter(|member| member.status() != Status::Surrogate)
    };
    let forms: Vec<&Form> = named()
        .map(|member| &signatures.forms[member.form])
        .collect();
    let columns: Vec<usize> = forms.iter().flat_map(|form| form.columns.clone()).collect();
    let refit = refit::joint(stack, signatures, &forms, &normal.solve(&columns).sizes);
    let kept = members
        .iter_mut()
        .filter(|member| member.status() != Status::Surrogate);
    for (member, estimate) in kept.zip(refit.estimates) {
        member.estimate = estimate;
    }
}

/// Widens the intervals of what is named by what the sizes owe to their forms.
fn doubt_forms(stack: &Stack<'_>, signatures: &Library, members: &mut [Member]) {
    let kept = || (0..members.len()).filter(|place| members[*place].status() != Status::Surrogate);
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
    form_doubt::round(stack, signatures, &forms, &mut estimates);
    for (place, estimate) in places.into_iter().zip(estimates) {
        members[place].estimate = estimate;
    }
}

/// Checks that the size of a member with one size is known better than from its physical range alone; several sizes may be known by their sum.
fn check_sizes(signatures: &Library, members: &mut [Member]) {
    for member in members.iter_mut() {
        let kind = signatures.instances[signatures.forms[member.form].instance].kind;
        let estimate = &member.estimate;
        let spans: Vec<f64> = kind
            .parameters
            .iter()
            .enumerate()
            .filter_map(|(place, p)| {
                let is_size = p.role == Role::Amplitude && estimate.active.contains(&place);
                let span = (estimate.high[place] - estimate.low[place]) / (p.high - p.low);
                is_size.then_some(span)
            })
            .collect();
        if let [span] = spans[..] {
            let check = Check::new(CheckId::Determined, span < WHOLE_RANGE);
            member.put(check.with(span, WHOLE_RANGE));
            check_sign(kind, member);
        }
    }
}

/// D from which a size is seen whatever its form is.
const FAR_ABOVE_NOISE: f64 = 10.0;

/// Names no size near noise whose interval, with what it owes to its form, does not even determine its sign.
fn check_sign(kind: &'static Kind, member: &mut Member) {
    let estimate = &member.estimate;
    let all: Vec<&Parameter> = kind.parameters.iter().chain(kind.free).collect();
    let sizes = estimate.active.iter().copied();
    let sizes: Vec<usize> = sizes
        .filter(|place| all[*place].role == Role::Amplitude)
        .collect();
    // Of several sizes one may be open where their sum is not.
    let [place] = sizes[..] else {
        return;
    };
    if all[place].low >= 0.0 || estimate.d >= FAR_ABOVE_NOISE {
        return;
    }
    let [value, low, high] =
        [&estimate.values, &estimate.low, &estimate.high].map(|own| own[place]);
    if low < 0.0 && high > 0.0 {
        let sigmas = refit::COVERAGE * value.abs() / (0.5 * (high - low)).max(f64::MIN_POSITIVE);
        member.put(Check::new(CheckId::Sure, false).with(sigmas, veto::MIN_SIZE_DEVIATIONS));
    }
}

/// Leaves out members that, sized without the surrogates, are below what they cost the search, and names none below what is
/// named at all: they were found for what the surrogates left. Whether there were any.
fn leave_out_small(stack: &Stack<'_>, signatures: &Library, members: &mut Vec<Member>) -> bool {
    let log_rows = stack.freedom().max(2.0).ln();
    let log_instances = count(signatures.seen().max(2)).ln();
    let before = members.len();
    members.retain(|member| {
        let price = count(signatures.forms[member.form].price) * log_rows + 2.0 * log_instances;
        member.status() == Status::Surrogate || member.estimate.d.powi(2) >= price
    });
    let mut is_less = members.len() < before;
    let named = members.iter_mut();
    for member in named.filter(|member| member.status() != Status::Surrogate) {
        let check = veto::above_noise(&member.estimate, log_rows);
        if check.has_failed() {
            member.confidence *= 0.5;
            is_less = true;
        }
        member.put(check);
    }
    is_less
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
    let set = plainest(signatures, &search.visited, set);
    let set = straightened(signatures, set, |set| search.score(set));
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

impl Found {
    /// Adds a check that is the same for every member.
    pub fn add_check(&mut self, check: &Check) {
        for member in &mut self.members {
            member.put(check.clone());
        }
    }

    /// Adds a check of one named member; where it fails the others are sized without it.
    pub fn check_named(&mut self, stack: &Stack<'_>, named: usize, check: Check) {
        let has_failed = check.has_failed();
        let mut kept = self.members.iter_mut();
        if let Some(member) = kept
            .by_ref()
            .filter(|member| member.status() != Status::Surrogate)
            .nth(named)
        {
            member.confidence *= if has_failed { 0.5 } else { 1.0 };
            member.put(check);
        }
        if has_failed {
            resize(stack, &self.signatures, &self.normal, &mut self.members);
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
            status: member.status(),
            confidence: member.confidence,
            parameters: whole(instance.kind, &member.estimate)
                .into_iter()
                .chain(
                    parameters
                        .filter(|(place, _)| member.estimate.active.contains(place))
                        .map(|(place, parameter)| value(parameter, &member.estimate, place)),
                )
                .collect(),
            d: member.estimate.d,
            confusable_with: member.confusable.clone(),
            constancy: member.constancy.clone(),
            why: member.checks.clone(),
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
            .filter(|member| member.status() != Status::Surrogate)
    }

    /// The members that stand alone as entries of a machine file.
    pub fn entries(&self) -> Vec<EffectEntry> {
        let alone = self
            .members
            .iter()
            .filter(|member| member.status() == Status::Named);
        alone
            .map(|member| entry(self.instance(member), &member.estimate.values))
            .collect()
    }

    /// The members that are only shown, and why.
    pub fn not_named(&self) -> impl Iterator<Item = Note> {
        let with_vetoes = self.members.iter().map(|member| (member, member.vetoes()));
        let shown = with_vetoes.filter(|(_, vetoes)| !vetoes.is_empty());
        shown.map(|(member, why)| Note::OnlyLooksLike {
            effect: self.instance(member).name(),
            why,
        })
    }

    /// The members whose values are known only together: no size of theirs is surely something by itself.
    pub fn only_together(&self) -> impl Iterator<Item = Note> {
        self.named().filter_map(|member| {
            let cause = self.cause(member);
            let instance = self.instance(member);
            let is_size = |p: &&ParameterValue| {
                let mut all = instance.kind.parameters.iter().chain(instance.kind.free);
                let is_own = all.any(|own| own.name == p.name && own.role == Role::Amplitude);
                is_own || p.name.starts_with(WHOLE)
            };
            let holds_nothing = |p: &ParameterValue| p.low <= 0.0 && p.high >= 0.0;
            let values = &cause.parameters;
            (values.len() > 1 && values.iter().filter(is_size).all(holds_nothing)).then(|| {
                Note::OnlyTogether {
                    effect: instance.name(),
                    parameters: values.iter().map(|p| p.name.clone()).collect(),
                    d: cause.d,
                }
            })
        })
    }

    /// The members that others could stand for: they are reported, and not written to a machine file.
    pub fn not_written(&self) -> Vec<Note> {
        let of_sets = self
            .members
            .iter()
            .filter(|member| member.status() == Status::Set);
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

/// How the size of an effect begins whose shares have forms of their own.
const WHOLE: &str = "whole_";

/// The size of an effect whose shares have forms of their own.
fn whole(kind: &Kind, estimate: &Estimate) -> Option<ParameterValue> {
    let [value, low, high] = estimate.whole?;
    let of = kind.parameters.first()?;
    Some(ParameterValue {
        name: format!("{WHOLE}{}", of.name),
        value,
        low,
        high,
        at_bound: false,
        determined: Some(high - low < WHOLE_RANGE * (of.high - of.low)),
    })
}

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
        determined: Some(high - low < WHOLE_RANGE * (parameter.high - parameter.low)),
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
