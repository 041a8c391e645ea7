//! Effects that set in at one instant and read alike from there on.
//!
//! # Model
//!
//! A reference point that shifts, coolant that begins to flow and a stylus that is bumped are steps. Between two tests that are far
//! apart each has come to its end. With f the signature of the one that was found and U unit columns of another one that sets
//! in at the same instant, all its sizes free,
//!
//! ```text
//!   |f - U U'f| < 3                                                       (1)
//! ```
//!
//! lists the other with it, whatever its form costs. Wear that begins where touches alone show a change is another one.
//!
//! # Holds when
//! The instant of what was found is that of a change of the session (`changes`).

use nalgebra::DVector;
use twin::effects::Role;

use crate::judgement::cause::Member;
use crate::judgement::unresolved;
use crate::judgement::veto::SAME_SIGNATURE;
use crate::noise::stack::Stack;
use crate::report::Status;
use crate::search::nuisance::orthonormal;
use crate::search::signature::{Begins, INSTANT, Instance, Library, begin_s, shapes};

/// Lists what sets in at the instant of a named effect and reads like it.
pub(crate) fn list(stack: &Stack<'_>, signatures: &Library, members: &mut [Member]) {
    let instances = &signatures.instances;
    for member in members {
        let own = &instances[signatures.forms[member.form].instance];
        if member.status() == Status::Surrogate {
            continue;
        }
        let Some(span_s) = span_s(stack, own, &member.estimate.values) else {
            continue;
        };
        let found = stack.signature(&*own.effect(&member.estimate.values));
        let is_other = |rival: &&Instance| {
            let is_begun = |begins: Begins| {
                begins.is_touched_alone && span_s[0] < begins.at_s && begins.at_s <= span_s[1]
            };
            rival.name() != own.name()
                && rival
                    .begins
                    .map_or_else(|| instant(rival).is_some(), is_begun)
        };
        for rival in instances.iter().filter(is_other) {
            if let Some(cos) = cosine(stack, &found, rival, span_s[0] / 60.0) {
                unresolved::list(member, rival.kind.id, &rival.target.to_string(), cos);
            }
        }
    }
}

/// Between which ends of runs, seconds since the session's start, what was found sets in; none of what was there all the time.
fn span_s(stack: &Stack<'_>, own: &Instance, values: &[f64]) -> Option<[f64; 2]> {
    let begins = |run: &usize| begin_s(&stack.session.runs[*run]);
    let all = || stack.runs.iter().filter_map(begins);
    match (own.begins, instant(own)) {
        (Some(begun), _) if begun.is_touched_alone => {
            let events = stack.events_s.iter().copied();
            let before = events.filter(|at_s| *at_s < begun.at_s).reduce(f64::max);
            before.map(|at_s| [at_s, begun.at_s])
        }
        (None, Some(place)) => {
            let at_s = 60.0 * values[place];
            let next = all().filter(|begin_s| *begin_s > at_s).reduce(f64::min);
            Some([at_s, next.unwrap_or(at_s)])
        }
        _ => None,
    }
}

/// Place of the instant among the parameters of what sets in at one.
fn instant(instance: &Instance) -> Option<usize> {
    let parameters = instance.kind.parameters.iter();
    parameters.clone().position(|own| own.name == INSTANT)
}

/// Cosine of what was found and the best form of another step at its instant, where (1) holds.
fn cosine(stack: &Stack<'_>, found: &DVector<f64>, rival: &Instance, at_min: f64) -> Option<f64> {
    let mut tried: Vec<Vec<f64>> = vec![];
    for mut values in shapes(rival.kind) {
        if let Some(place) = instant(rival) {
            values[place] = at_min;
        }
        if !tried.contains(&values) {
            tried.push(values);
        }
    }
    let left = |values: &Vec<f64>| {
        let columns = orthonormal(found.len(), columns(stack, rival, values));
        let left = found - &columns * columns.tr_mul(found);
        left.norm()
    };
    let least = tried.iter().map(left).fold(f64::INFINITY, f64::min);
    let share = least / found.norm().max(f64::MIN_POSITIVE);
    (least < SAME_SIGNATURE).then(|| (1.0 - share * share).max(0.0).sqrt())
}

/// One column for each size of an effect.
fn columns<'s>(
    stack: &'s Stack<'_>,
    of: &'s Instance,
    values: &'s [f64],
) -> impl Iterator<Item = DVector<f64>> + 's {
    let parameters = of.kind.parameters.iter().chain(of.kind.free).enumerate();
    let sizes = parameters.filter(|(_, own)| own.role == Role::Amplitude);
    sizes.map(move |(place, own)| {
        let mut on = values.to_vec();
        on[place] = own.typical;
        stack.signature(&*of.effect(&on))
    })
}
