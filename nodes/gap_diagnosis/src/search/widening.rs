//! Wide forms of the effects that were found, whole and in parts.
//!
//! # Model
//!
//! A catalogue's form is rarely quite the machine's. The wide form of each member, and of what stood nearly as well in
//! its place, joins the signatures; and with it the forms that have only those free amplitudes that are worth their
//! price, taken one after another:
//!
//! ```text
//!   gain of the amplitude beside the others > ln n                        (1)
//! ```
//!
//! once beside all other members, once beside the larger ones only, whose form the smaller ones may stand for. A soft
//! edge of a play is then one more number for ln n, and not a second cause.

use std::collections::{BTreeMap, BTreeSet};

use metrology::Axis;
use nalgebra::{DMatrix, DVector};
use twin::effects::{Kind, Target};

use crate::noise::normal::Normal;
use crate::noise::stack::Stack;
use crate::search::resolved;
use crate::search::selection::Set;
use crate::search::signature::{Instance, Library};

/// Most instances that are widened.
const MOST_WIDENED: usize = 12;
/// The effect that is a curve along an axis at the point that is read.
const CURVE: &str = "pitch_error";
/// Most free amplitudes that are taken one after another.
const MOST_PARTS: usize = 6;
/// The same of a curve through targets, which may need all of its heights.
const MOST_OF_CURVE: usize = 17;
/// Sets whose C is worse by this share of what the best one explains stand nearly as well.
const NEAR_SHARE: f64 = 0.1;

/// Effects that are any curve of a guide. Where a search leaves something open, their wide forms are tried by themselves: of a
/// guide that is dented where it was measured the two lowest orders are a small part, and are never near the best set.
const GUIDES: [&str; 2] = ["straightness", "angular_error"];

/// Adds the wide forms; `sizes` are the members' D, and `is_closed` whether they leave nothing.
pub fn widen(
    stack: &Stack<'_>,
    signatures: &mut Library,
    (set, sizes): (&Set, &[f64]),
    visited: &BTreeMap<Set, f64>,
    is_closed: bool,
) {
    let least = visited[set];
    let explained = (stack.z.norm_squared() - least).max(0.0);
    let reach = NEAR_SHARE * explained;
    let near = visited.iter().filter(|(_, score)| **score <= least + reach);
    let forms: BTreeSet<usize> = near.flat_map(|(set, _)| set.iter().copied()).collect();
    let mut added = BTreeMap::new();
    for form in set.iter().copied().chain(forms) {
        let instance = signatures.forms[form].instance;
        let has_free = !signatures.instances[instance].kind.free.is_empty();
        if has_free && added.len() < MOST_WIDENED && !added.contains_key(&instance) {
            let values = signatures.forms[form].values.clone();
            let values = through_targets(stack, &signatures.instances[instance], values);
            let wide = signatures.add(stack, instance, values, true);
            added.insert(instance, wide);
        }
    }
    let curves = if is_closed {
        vec![]
    } else {
        open_curves(stack, signatures, explained)
    };
    let normal = signatures.normal(&stack.z);
    let log_rows = stack.freedom().ln();
    for wide in curves {
        add_parts(signatures, &normal, &[], wide, (log_rows, MOST_PARTS));
    }
    for (instance, wide) in added {
        let Some(wide) = wide else { continue };
        let of = |form: &usize| signatures.forms[*form].instance;
        let own = set.iter().position(|form| of(form) == instance);
        let others = |least: f64| -> Vec<usize> {
            let larger = set.iter().zip(sizes).filter(|(_, size)| **size > least);
            larger
                .map(|(form, _)| *form)
                .filter(|form| of(form) != instance)
                .collect()
        };
        let mut beside = vec![others(0.0)];
        beside.extend(own.map(|own| others(sizes[own])));
        beside.dedup();
        for others in beside {
            add_parts(signatures, &normal, &others, wide, (log_rows, MOST_PARTS));
        }
    }
}

/// An open curve is tried where it alone explains this share of what the best set explains.
const MIN_SHARE_ALONE: f64 = 0.5;

/// Adds the wide forms of the guides' curves that were read on paths, each over the part of the travel where it was seen, which
/// explain most of the `explained` squares alone. Turns are rolls alone: others show along their own axis, too, as a screw does.
fn open_curves(stack: &Stack<'_>, signatures: &mut Library, explained: f64) -> Vec<usize> {
    let mut open = BTreeMap::new();
    for form in &signatures.forms {
        let own = &signatures.instances[form.instance];
        let Target::Component(component) = own.target else {
            continue;
        };
        let rolls = [(Axis::A, Axis::X), (Axis::B, Axis::Y), (Axis::C, Axis::Z)];
        let is_turn = component.is_angular();
        let is_across = !is_turn || rolls.contains(&(component.direction, component.of));
        if !GUIDES.contains(&own.kind.id) || own.begins.is_some() || !is_across {
            continue;
        }
        let shown: Vec<&DVector<f64>> = form
            .columns
            .iter()
            .map(|k| &signatures.columns[*k])
            .collect();
        if let Some(part_mm) = resolved::seen_mm(stack, component.of, &shown) {
            let mut values = form.values.clone();
            put_ends(own, part_mm, &mut values);
            open.insert(form.instance, values);
        }
    }
    let mut kept = vec![];
    for (instance, values) in open {
        let Some(wide) = signatures.add(stack, instance, values, true) else {
            continue;
        };
        let columns = signatures.forms[wide].columns.iter();
        let columns: Vec<DVector<f64>> = columns.map(|k| signatures.columns[*k].clone()).collect();
        let all: Vec<usize> = (0..columns.len()).collect();
        let alone = Normal::new(&DMatrix::from_columns(&columns), &stack.z).solve(&all);
        if alone.gain >= MIN_SHARE_ALONE * explained {
            kept.push(wide);
        } else {
            signatures.forms.pop();
        }
    }
    kept
}

/// Amplitudes that a curve of a guide over a part of its travel has beside its own, so that each has the orders 1 to 3: a guide that
/// turns and one that is not straight cost the same, and neither is named where both read alike.
const FIRST_ORDERS: [&str; 2] = ["free_p1_um", "free_p3_urad"];
/// Names of the ends of the part of a travel that a curve is over.
const ENDS: [&str; 2] = ["free_from_mm", "free_to_mm"];

/// Values of an instance whose curve along its axis is over the targets, where the axis was read at targets only: any form that
/// they show is a curve over their own extent, however short a part of the travel that is.
fn through_targets(stack: &Stack<'_>, instance: &Instance, mut values: Vec<f64>) -> Vec<f64> {
    let Some(axis) = axis_at_targets(stack, instance) else {
        return values;
    };
    if let Some(part_mm) = resolved::extent_mm(stack, axis) {
        put_ends(instance, part_mm, &mut values);
    }
    values
}

/// Whether a curve is over a part of its axis' travel: one whose ends are both zero is over all of it.
fn is_over_part(kind: &Kind, values: &[f64]) -> bool {
    let names = kind.parameters.iter().chain(kind.free).map(|p| p.name);
    names
        .zip(values)
        .any(|(name, value)| ENDS.contains(&name) && *value != 0.0)
}

/// Lets a curve be over a part of its axis' travel, mm.
fn put_ends(instance: &Instance, [low_mm, high_mm]: [f64; 2], values: &mut [f64]) {
    let own = instance.kind.parameters.iter().chain(instance.kind.free);
    for (parameter, value) in own.zip(values) {
        match ENDS.iter().position(|end| *end == parameter.name) {
            Some(0) => *value = low_mm,
            Some(_) => *value = high_mm,
            None => {}
        }
    }
}

/// The axis that an instance acts on, where it was read at targets only.
pub fn axis_at_targets(stack: &Stack<'_>, instance: &Instance) -> Option<Axis> {
    let Target::Axis(axis) = instance.target else {
        return None;
    };
    resolved::is_at_targets(stack, axis).then_some(axis)
}

/// Free amplitudes that only targets along the whole curve tell apart: circles and paths are over a part of it.
const AT_TARGETS_ALONE: [&str; 7] = [
    "free_by_place3_um",
    "free_by_place4_um",
    "free_by_place5_um",
    "free_by_place6_um",
    "free_in_1_min_um",
    "free_in_4_min_um",
    "free_in_16_min_um",
];

/// An effect, and the first part of the names of its free amplitudes that only targets determine. On paths its feeds determine it.
const BY_FEED: (&str, &str) = ("feed_lost_motion", "free_by_place");

/// Whether a free amplitude of an instance may be in its wide form.
pub fn is_free_here(stack: &Stack<'_>, instance: &Instance, name: &str) -> bool {
    let is_by_feed = instance.kind.id == BY_FEED.0 && name.starts_with(BY_FEED.1);
    let needs_targets = is_by_feed || AT_TARGETS_ALONE.contains(&name);
    !needs_targets || axis_at_targets(stack, instance).is_some()
}

/// Adds the curve of any form to the pitch error of every axis that was read at targets only. Its plain curve may be
/// absent from the error that the targets show alike upwards and downwards.
pub fn widen_curves(stack: &Stack<'_>, signatures: &mut Library) {
    let is_curve = |instance: &Instance| {
        instance.kind.id == CURVE && axis_at_targets(stack, instance).is_some()
    };
    let curves: Vec<usize> = (0..signatures.instances.len())
        .filter(|place| is_curve(&signatures.instances[*place]))
        .collect();
    let mut added = vec![];
    for instance in curves {
        let kind = signatures.instances[instance].kind;
        let values = vec![0.0; kind.parameters.len() + kind.free.len()];
        let values = through_targets(stack, &signatures.instances[instance], values);
        // Its plain form over the whole travel is a line over a part of it, and would stand for the slope.
        signatures.forms.retain(|form| form.instance != instance);
        added.extend(signatures.add(stack, instance, values, true));
        signatures.curves.insert(instance);
    }
    if added.is_empty() {
        return;
    }
    // Places of forms have moved.
    let added: Vec<usize> = (0..signatures.forms.len())
        .filter(|form| {
            signatures
                .curves
                .contains(&signatures.forms[*form].instance)
        })
        .collect();
    let normal = signatures.normal(&stack.z);
    let log_rows = stack.freedom().ln();
    for wide in added {
        let form = &signatures.forms[wide];
        let (curve, kind) = (form.instance, signatures.instances[form.instance].kind);
        let plain: Vec<usize> = (0..form.amplitudes.len())
            .filter(|k| form.amplitudes[*k] < kind.parameters.len())
            .collect();
        if !plain.is_empty() {
            signatures.add_part(wide, &plain);
        }
        // A curve has no slope: its parts are chosen beside that of the scale, and alone.
        let slope: Vec<usize> = signatures.slope_of(curve).into_iter().collect();
        for beside in [&slope[..], &[]] {
            add_parts(signatures, &normal, beside, wide, (log_rows, MOST_OF_CURVE));
        }
    }
}

/// Adds a wide form with the free amplitudes, so many at most, that hold (1) beside other forms.
fn add_parts(
    signatures: &mut Library,
    normal: &Normal,
    others: &[usize],
    wide: usize,
    (log_rows, most): (f64, usize),
) {
    let form = signatures.forms[wide].clone();
    let own = signatures.instances[form.instance].kind.parameters.len();
    let others: Vec<usize> = others
        .iter()
        .flat_map(|other| signatures.forms[*other].columns.clone())
        .collect();
    let all = 0..form.amplitudes.len();
    let kind = signatures.instances[form.instance].kind;
    let names = || kind.parameters.iter().chain(kind.free).map(|p| p.name);
    let is_part = is_over_part(kind, &form.values);
    let is_first = |place: usize| {
        let name = names().nth(place);
        place < own || (is_part && name.is_some_and(|name| FIRST_ORDERS.contains(&name)))
    };
    let (mut taken, mut open): (Vec<usize>, Vec<usize>) =
        all.partition(|k| is_first(form.amplitudes[*k]));
    if taken.is_empty() {
        return;
    }
    for _ in 0..most {
        let columns = taken.iter().map(|k| form.columns[*k]);
        let beside: Vec<usize> = others.iter().copied().chain(columns).collect();
        let groups = open.iter().map(|k| std::slice::from_ref(&form.columns[*k]));
        let gains = normal.gains_beside(&beside, groups);
        let best = gains.into_iter().enumerate();
        match best.max_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((place, gain)) if gain > log_rows => taken.push(open.remove(place)),
            _ => return,
        }
        taken.sort_unstable();
        signatures.add_part(wide, &taken);
    }
}

#[cfg(test)]
mod tests {
    use metrology::ErrorComponent;
    use twin::effects;

    use super::*;

    #[test]
    fn a_part_that_begins_or_ends_at_the_machines_zero_is_a_part() {
        let kind = effects::kind("straightness").unwrap();
        let instance = Instance {
            kind,
            target: Target::Component(ErrorComponent::SQUARENESS[0]),
            begins: None,
        };
        let of = |part_mm: [f64; 2]| {
            let mut values = vec![0.0; kind.parameters.len() + kind.free.len()];
            put_ends(&instance, part_mm, &mut values);
            is_over_part(kind, &values)
        };
        assert!(of([0.0, 90.0]) && of([-90.0, 0.0]) && of([-40.0, 90.0]));
        assert!(!of([0.0, 0.0]));
    }
}
