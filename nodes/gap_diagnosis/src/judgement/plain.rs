//! Of causes that a recording cannot tell apart, the one that a machine has by itself leads.
//!
//! One line along one axis is a scale error, the bow of a guide or a yaw behind a lever, a wavelength: which of them is best
//! by a hair is a matter of noise. What ISO 230 gives an axis as its own error comes before what reaches a reading through
//! a lever, an instrument or time.

use std::collections::{BTreeMap, BTreeSet};

use crate::judgement::confidence::ODDS;
use crate::search::selection::{Set, with};
use crate::search::signature::Library;

/// Errors that an axis or a probe has by itself, the first before the others.
const OWN: [&str; 7] = [
    "scale_error",
    "backlash",
    "squareness",
    "probe_latency",
    "servo_lag",
    "pitch_error",
    "straightness",
];

/// Sets whose C differs by less are as good as each other: a ratio of probabilities of e.
const TIE: f64 = 2.0;

/// The best set with each member replaced by the plainest cause that does as well in its place.
pub fn plainest(signatures: &Library, visited: &BTreeMap<Set, f64>, best: Set) -> Set {
    let most = visited[&best] + TIE;
    let mut now = best;
    for member in now.clone() {
        let rivals = visited
            .iter()
            .filter(|(set, score)| **score <= most && set.len() == now.len());
        let instead = rivals.filter_map(|(set, score)| {
            let other = exchanged(set, &now, member)?;
            let is_own = !signatures.forms[other].wide;
            is_own.then_some((rank(signatures, other), *score, set))
        });
        let first = instead.min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        if let Some((plain, _, set)) = first
            && plain < rank(signatures, member)
        {
            now.clone_from(set);
        }
    }
    now
}

/// Curves, and the lines that each may be taken for where only a part of a travel was read.
const LINES_OF_CURVES: [(&str, &[&str]); 2] = [
    ("pitch_error", &["scale_error"]),
    ("straightness", &["squareness"]),
];

/// The set with each curve replaced by a line in whose place it would not be named: the search may never have come by the line, for a
/// curve with more amplitudes is better by more than the first of them. The curve is then listed with the line.
pub fn straightened(signatures: &Library, best: Set, mut score: impl FnMut(&Set) -> f64) -> Set {
    let id = |form: usize| {
        signatures.instances[signatures.forms[form].instance]
            .kind
            .id
    };
    let mut now = best;
    for member in now.clone() {
        let Some((_, lines)) = LINES_OF_CURVES
            .iter()
            .find(|(curve, _)| *curve == id(member))
        else {
            continue;
        };
        let others: Vec<usize> = now.iter().copied().filter(|form| *form != member).collect();
        let taken = |form: usize| {
            let instance = signatures.forms[form].instance;
            others
                .iter()
                .any(|other| signatures.forms[*other].instance == instance)
        };
        let plain = (0..signatures.forms.len()).filter(|form| {
            !signatures.forms[*form].wide && lines.contains(&id(*form)) && !taken(*form)
        });
        let straight = plain
            .map(|form| with(&others, form))
            .map(|set| (score(&set), set));
        let first = straight.min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((line, set)) = first
            && line <= score(&now) + 2.0 * ODDS.ln()
        {
            now = set;
        }
    }
    now
}

/// What a set has in the place of a member where it is alike otherwise.
fn exchanged(set: &Set, from: &Set, member: usize) -> Option<usize> {
    let (own, other): (BTreeSet<_>, BTreeSet<_>) = (from.iter().collect(), set.iter().collect());
    let is_out = own.difference(&other).all(|form| **form == member);
    let mut come = other.difference(&own);
    match (is_out, come.next(), come.next()) {
        (true, Some(form), None) => Some(**form),
        _ => None,
    }
}

/// Place among [`OWN`], behind all of them for anything else.
fn rank(signatures: &Library, form: usize) -> usize {
    let id = signatures.instances[signatures.forms[form].instance]
        .kind
        .id;
    OWN.iter().position(|own| *own == id).unwrap_or(OWN.len())
}

#[cfg(test)]
mod tests {
    use metrology::Axis;
    use twin::effects::{self, Target};

    use super::*;
    use crate::search::signature::{Form, Instance};

    /// A guide's bow, a play, a scale error, and a scale error in a wide form.
    fn library() -> Library {
        let instance = |id: &str| Instance {
            kind: effects::kind(id).unwrap(),
            target: Target::Axis(Axis::X),
            begins: None,
        };
        let form = |instance, wide| Form {
            instance,
            values: vec![],
            amplitudes: vec![0],
            columns: vec![],
            price: 1,
            wide,
        };
        Library {
            curves: Default::default(),
            aside: Default::default(),
            shared: Default::default(),
            instances: ["guide_bow", "backlash", "scale_error"]
                .map(instance)
                .to_vec(),
            forms: vec![
                form(0, false),
                form(1, false),
                form(2, false),
                form(2, true),
            ],
            columns: vec![],
            excited: vec![true; 3],
        }
    }

    #[test]
    fn a_scale_error_leads_before_a_bow_that_is_better_by_a_hair_alone() {
        let library = library();
        let visited = |scale: f64| BTreeMap::from([(vec![0, 1], 10.0), (vec![1, 2], scale)]);
        assert_eq!(plainest(&library, &visited(11.5), vec![0, 1]), [1, 2]);
        assert_eq!(plainest(&library, &visited(12.5), vec![0, 1]), [0, 1]);
    }

    #[test]
    fn a_wide_form_and_another_size_of_set_do_not_lead() {
        let library = library();
        let visited = BTreeMap::from([(vec![0, 1], 10.0), (vec![1, 3], 9.5), (vec![2], 9.5)]);
        assert_eq!(plainest(&library, &visited, vec![0, 1]), [0, 1]);
    }

    #[test]
    fn a_curve_gives_way_to_a_line_that_is_not_decided_against_and_to_none_that_is_worse() {
        let mut library = library();
        library.instances[0].kind = effects::kind("pitch_error").unwrap();
        let scores = |line: f64| move |set: &Set| if set.contains(&2) { line } else { 10.0 };
        assert_eq!(straightened(&library, vec![0, 1], scores(15.9)), [1, 2]);
        assert_eq!(straightened(&library, vec![0, 1], scores(16.1)), [0, 1]);
        // A scale error that is in the set already leaves the curve as it is.
        assert_eq!(straightened(&library, vec![0, 2], scores(0.0)), [0, 2]);
    }
}
