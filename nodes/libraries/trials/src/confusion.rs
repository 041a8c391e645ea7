//! Who was taken for whom, beside who was predicted to look like whom.
//!
//! The prediction is of the signatures alone: the cosine between what a hidden effect and the effects of another class
//! would show on this recording, and the part of it that no other class can imitate. Where an honest diagnosis errs,
//! the cosine is large.

use std::collections::{BTreeMap, BTreeSet};

use gap_diagnosis::report::Status;
use serde::{Deserialize, Serialize};

use crate::effect::Class;
use crate::proportion::{Proportion, median};
use crate::verdict::{Likeness, Verdict};

/// A cosine from which two effects are alike.
pub const ALIKE: f64 = 0.9;
/// Part that no other class can imitate from which an effect is isolable.
pub const ISOLABLE: f64 = 0.5;

/// Median cosine from which a class is told though nothing was ever taken for it.
pub const NOTICED: f64 = 0.3;
/// What is said where nothing is named or shown.
pub const NOTHING: &str = "nothing";
/// What is said where only something unknown is flagged.
pub const UNKNOWN: &str = "unknown";

/// A hidden class and what was said of it or could have been.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// The class, in a trial that hides nothing else.
    pub hidden: Class,
    /// A class whatever its axis, in brackets where it was shown as a surrogate and nothing named; or `nothing`, or
    /// `unknown`.
    pub said: String,
    /// How often that was said, of the trials that hide the class alone.
    pub observed: Proportion,
    /// Middle of the predicted cosines between the two, of all trials that hide the class; none with itself, and where
    /// nothing was predicted.
    pub cosine: Option<f64>,
}

impl Pair {
    /// The class that was said or shown.
    #[must_use]
    pub fn class(&self) -> &str {
        class_of(&self.said)
    }

    /// Whether it was shown as a surrogate.
    #[must_use]
    pub fn is_surrogate(&self) -> bool {
        self.said.starts_with('(')
    }
}

fn class_of(said: &str) -> &str {
    said.trim_matches(['(', ')'])
}

/// Everything that was said where a class is hidden alone, and everything that it was predicted to look like from
/// [`NOTICED`] on; for each class the most frequent first.
#[must_use]
pub fn pairs(own: &[&Verdict]) -> Vec<Pair> {
    let counts = observed(own);
    let predicted = predicted(own);
    let of = |hidden: Class| -> Vec<Pair> {
        let line = predicted.iter().find(|line| line.class == hidden);
        let cosines: &[(String, f64)] = line.map_or(&[], |line| &line.cos);
        let (n, said) = counts.get(&hidden).cloned().unwrap_or_default();
        let noticed = cosines.iter().filter(|(_, cosine)| *cosine >= NOTICED);
        let unsaid = noticed
            .filter(|(name, _)| said.keys().all(|own| class_of(own) != name))
            .map(|(name, _)| (name.clone(), 0));
        let all = said.clone().into_iter().chain(unsaid);
        let mut all: Vec<Pair> = all
            .map(|(said, k)| Pair {
                hidden,
                cosine: cosines
                    .iter()
                    .find_map(|(name, cosine)| (name == class_of(&said)).then_some(*cosine)),
                said,
                observed: Proportion { k, n },
            })
            .collect();
        let cosine = |pair: &Pair| pair.cosine.unwrap_or(0.0);
        all.sort_by(|a, b| {
            let frequent = b.observed.k.cmp(&a.observed.k);
            frequent.then_with(|| cosine(b).total_cmp(&cosine(a)))
        });
        all
    };
    Class::every().flat_map(of).collect()
}

/// Of every class that is hidden alone: in how many trials, and what was said how often.
fn observed(own: &[&Verdict]) -> BTreeMap<Class, (usize, BTreeMap<String, usize>)> {
    let mut counts = BTreeMap::<Class, (usize, BTreeMap<String, usize>)>::new();
    for verdict in own.iter().filter(|v| v.said.is_some()) {
        let [effect] = &verdict.truth.effects[..] else {
            continue;
        };
        let (n, said) = counts.entry(effect.class).or_default();
        *n += 1;
        for name in said_of(verdict) {
            *said.entry(name).or_default() += 1;
        }
    }
    counts
}

/// Every class that was named; where none was, the first that was shown.
fn said_of(verdict: &Verdict) -> BTreeSet<String> {
    let named: BTreeSet<String> = verdict.named().map(|c| c.effect.clone()).collect();
    if !named.is_empty() {
        return named;
    }
    let causes = verdict.said.iter().flat_map(|said| &said.causes);
    let surrogate = causes.into_iter().find(|c| c.status == Status::Surrogate);
    BTreeSet::from([match (surrogate, verdict.is_flagged()) {
        (Some(cause), _) => format!("({})", cause.effect),
        (None, true) => UNKNOWN.to_owned(),
        (None, false) => NOTHING.to_owned(),
    }])
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
    Class::every().filter_map(line).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::{cause, effect, verdict};

    /// A hidden play of which something is said, with what it was predicted to look like.
    fn trial(causes: &[(&str, Status)], is_unknown: bool) -> Verdict {
        let causes = causes
            .iter()
            .map(|(id, status)| cause(id, "X", *status, 4.0));
        let play = effect(Class::Backlash, "X", 30.0);
        let mut verdict = verdict(vec![play], causes.collect(), is_unknown);
        let cos = [
            ("drive_windup", 0.4),
            ("coolant", 0.31),
            ("scale_error", 0.29),
        ];
        verdict.likeness = vec![Likeness {
            effect: "backlash".to_owned(),
            axis: "X".to_owned(),
            sin_alone: 0.8,
            cos: cos.map(|(name, cos)| (name.to_owned(), cos)).into(),
        }];
        verdict
    }

    #[test]
    fn what_was_said_and_what_was_predicted_stand_beside_each_other() {
        let verdicts = [
            trial(&[("backlash", Status::Named)], false),
            trial(
                &[("backlash", Status::Named), ("scale_error", Status::Named)],
                false,
            ),
            trial(&[("drive_windup", Status::Surrogate)], true),
            trial(&[], true),
            trial(&[], false),
        ];
        let own: Vec<&Verdict> = verdicts.iter().collect();
        let told: Vec<String> = pairs(&own)
            .iter()
            .map(|pair| {
                let cosine = pair
                    .cosine
                    .map_or(String::new(), |cosine| cosine.to_string());
                let count = pair.observed;
                format!("{} {}/{} {cosine}", pair.said, count.k, count.n)
            })
            .collect();
        let wanted = [
            "backlash 2/5 ",
            "(drive_windup) 1/5 0.4",
            "scale_error 1/5 0.29",
            "nothing 1/5 ",
            "unknown 1/5 ",
            "coolant 0/5 0.31",
        ];
        assert_eq!(told, wanted);
    }

    #[test]
    fn what_is_hidden_with_others_is_predicted_and_not_counted() {
        let mut verdict = trial(&[], false);
        let other = effect(Class::ServoLag, "X", 9.0);
        verdict.truth.effects.push(other);
        let all = pairs(&[&verdict]);
        assert_eq!(all.len(), 2);
        assert!(
            all.iter()
                .all(|pair| pair.observed == Proportion::default())
        );
        assert_eq!(
            (all[0].class(), all[0].is_surrogate()),
            ("drive_windup", false)
        );
    }
}
