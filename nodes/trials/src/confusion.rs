//! Who was taken for whom, beside who was predicted to look like whom.
//!
//! The prediction is of the signatures alone: the cosine between what a hidden effect and the effects of another class
//! would show on this recording, and the part of it that no other class can imitate. Where an honest diagnosis errs,
//! the cosine is large.

use std::collections::BTreeMap;

use gap_diagnosis::report::Status;
use serde::{Deserialize, Serialize};

use crate::effect::Class;
use crate::proportion::{Proportion, median};
use crate::verdict::{Likeness, Verdict};

/// A cosine from which two effects are alike.
pub const ALIKE: f64 = 0.9;
/// Part that no other class can imitate from which an effect is isolable.
pub const ISOLABLE: f64 = 0.5;

/// Hidden class, named class (or what was said instead), times; trials with one effect only.
#[must_use]
pub fn observed(own: &[&Verdict]) -> Vec<(String, String, usize)> {
    let mut counts = BTreeMap::<(String, String), usize>::new();
    for verdict in own.iter().filter(|v| v.said.is_some()) {
        let [effect] = &verdict.truth.effects[..] else {
            continue;
        };
        let mut said: Vec<String> = verdict.named().map(|c| c.effect.clone()).collect();
        if said.is_empty() {
            let causes = verdict.said.iter().flat_map(|said| &said.causes);
            let surrogate = causes.into_iter().find(|c| c.status == Status::Surrogate);
            said.push(match (surrogate, verdict.is_flagged()) {
                (Some(cause), _) => format!("({})", cause.effect),
                (None, true) => "unknown".to_owned(),
                (None, false) => "nothing".to_owned(),
            });
        }
        said.sort();
        said.dedup();
        for name in said {
            *counts
                .entry((effect.class.id().to_owned(), name))
                .or_default() += 1;
        }
    }
    counts
        .into_iter()
        .map(|((hidden, said), n)| (hidden, said, n))
        .collect()
}

/// What a hidden class was predicted to look like.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Predicted {
    /// The class.
    pub class: Class,
    /// Trials.
    pub n: usize,
    /// Middle part that no other class can imitate.
    pub sin_alone: f64,
    /// Middle cosine with other classes, the greatest first.
    pub cos: Vec<(String, f64)>,
}

/// The prediction for every hidden class.
#[must_use]
pub fn predicted(own: &[&Verdict]) -> Vec<Predicted> {
    let line = |class: Class| {
        let of = |v: &&&Likeness| v.effect == class.id();
        let all: Vec<&Likeness> = own.iter().flat_map(|v| &v.likeness).collect();
        let all: Vec<&&Likeness> = all.iter().filter(of).collect();
        let sin_alone = median(all.iter().map(|one| one.sin_alone).collect())?;
        let mut by_class = BTreeMap::<&String, Vec<f64>>::new();
        for (name, cos) in all.iter().flat_map(|one| &one.cos) {
            by_class.entry(name).or_default().push(*cos);
        }
        let middle = |(name, values): (&String, Vec<f64>)| Some((name.clone(), median(values)?));
        let mut cos: Vec<(String, f64)> = by_class.into_iter().filter_map(middle).collect();
        cos.sort_by(|a, b| b.1.total_cmp(&a.1));
        Some(Predicted {
            class,
            n: all.len(),
            sin_alone,
            cos,
        })
    };
    Class::ALL.into_iter().filter_map(line).collect()
}

/// How often a hidden effect, alone in its machine, got the name of another class: where some class was predicted to
/// look like it, and where none was.
#[must_use]
pub fn agreement(own: &[&Verdict]) -> [Proportion; 2] {
    let single = own.iter().filter_map(|v| match (&v.likeness[..], &v.said) {
        ([likeness], Some(_)) => Some((*v, likeness)),
        _ => None,
    });
    let mut both = [Proportion::default(); 2];
    for (verdict, likeness) in single {
        let has_double = likeness.cos.values().any(|cos| *cos >= ALIKE);
        let taken = verdict.named().any(|cause| cause.effect != likeness.effect);
        let count = &mut both[usize::from(!has_double)];
        count.k += usize::from(taken);
        count.n += 1;
    }
    both
}
