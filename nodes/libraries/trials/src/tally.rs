//! All verdicts of an arm as one table: rates with their intervals, by class and D, and who was taken for whom.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::arm::Arm;
use crate::calibration::{Reliability, reliability};
use crate::comparison::{MethodLine, methods};
use crate::confusion::{Pair, Predicted, agreement, pairs, predicted};
use crate::proportion::{Proportion, auroc};
use crate::truth::TrueEffect;
use crate::verdict::Verdict;

mod classes;
mod figures;

pub use classes::ClassLine;
pub use figures::Figure;

/// Edges of the bins of D.
pub const D_EDGES: [f64; 4] = [5.0, 10.0, 20.0, 50.0];
/// Bins of D.
pub const D_BINS: usize = D_EDGES.len() + 1;
/// D beyond which a single effect should be named.
pub(crate) const SINGLE_D: f64 = 10.0;
/// D beyond which each of several effects should be named.
pub(crate) const SEVERAL_D: f64 = 7.0;
/// D beyond which other physics should be named.
pub(crate) const MIN_D_OF_FOREIGN: f64 = 20.0;

/// One line of the table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    /// What is counted.
    pub what: String,
    /// How often.
    pub count: Proportion,
    /// Its 95 % interval.
    pub interval: [f64; 2],
}

/// The table of one arm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    /// The arm.
    pub arm: Arm,
    /// Trials.
    pub trials: usize,
    /// Rates.
    pub rates: Vec<Rate>,
    /// Other figures.
    pub figures: Vec<Figure>,
    /// By class.
    pub classes: Vec<ClassLine>,
    /// Who was taken for whom, beside who was predicted to look like whom.
    pub confusion: Vec<Pair>,
    /// What each hidden class was predicted to look like.
    pub predicted: Vec<Predicted>,
    /// How often one got the name of another class: with a predicted double, and without.
    pub agreement: [Proportion; 2],
    /// Other methods before the same judge.
    pub methods: Vec<MethodLine>,
    /// What was named though nothing of it was hidden, the most frequent first.
    pub false_names: Vec<(String, usize)>,
    /// Confidence beside precision.
    pub reliability: Vec<Reliability>,
}

/// The bin of a D.
#[must_use]
pub fn bin(d: f64) -> usize {
    D_EDGES.iter().filter(|edge| d >= **edge).count()
}

/// Name of a bin.
#[must_use]
pub fn bin_name(bin: usize) -> String {
    match bin {
        0 => format!("D < {}", D_EDGES[0]),
        _ if bin == D_EDGES.len() => format!("> {}", D_EDGES[bin - 1]),
        _ => format!("{}-{}", D_EDGES[bin - 1], D_EDGES[bin]),
    }
}

impl Tally {
    /// Tallies the verdicts of one arm.
    #[must_use]
    pub fn of(arm: Arm, verdicts: &[Verdict]) -> Self {
        let own: Vec<&Verdict> = verdicts.iter().filter(|v| v.truth.arm == arm).collect();
        Self {
            arm,
            trials: own.len(),
            rates: rates(arm, &own),
            figures: figures::of(&own),
            classes: classes::of(arm, &own),
            confusion: pairs(&own),
            predicted: predicted(&own),
            agreement: agreement(&own),
            methods: methods(arm, &own),
            false_names: false_names(&own),
            reliability: reliability(&own),
        }
    }

    /// A rate by what it counts.
    #[must_use]
    pub fn rate(&self, what: &str) -> Option<&Rate> {
        self.rates.iter().find(|rate| rate.what == what)
    }
}

/// Area under the curve of the unknown score: trials of an arm with a class left out against those of one with known classes
/// only.
#[must_use]
pub fn unknown_auroc(verdicts: &[Verdict], [left_out, known]: [Arm; 2], least_d: f64) -> Figure {
    let scores = |arm: Arm| -> Vec<f64> {
        let own = verdicts
            .iter()
            .filter(|v| v.truth.arm == arm && v.least_d().is_some_and(|d| d >= least_d));
        own.filter_map(|v| Some(v.said.as_ref()?.unknown_ratio))
            .collect()
    };
    let (positive, negative) = (scores(left_out), scores(known));
    Figure::new(
        &format!("AUROC of unknown, D > {least_d}"),
        auroc(&positive, &negative),
        positive.len() + negative.len(),
    )
}

fn rates(arm: Arm, own: &[&Verdict]) -> Vec<Rate> {
    let said: Vec<&Verdict> = own.iter().copied().filter(|v| v.said.is_some()).collect();
    let mut rates = Rates::default();
    rates.add("diagnosed", own, |v| v.said.is_some());
    rates.add("floor reproduced", &said, is_reproduced);
    let motors = |wanted: bool| -> Vec<&Verdict> {
        let fits = |v: &&&Verdict| v.truth.has_motors == wanted;
        said.iter().filter(fits).copied().collect()
    };
    for (what, wanted) in [("recorded", true), ("not recorded", false)] {
        let what = format!("floor reproduced, motors {what}");
        rates.add(&what, &motors(wanted), is_reproduced);
    }
    rates.add("a cause named that is none", &said, has_wrong);
    rates.add("wrong and not flagged unknown", &said, |v| {
        has_wrong(v) && !v.is_flagged()
    });
    rates.add("unknown flagged", &said, Verdict::is_flagged);
    if arm.is_null() {
        rates.add("nothing named", &said, Verdict::is_exact);
    } else if arm.leaves_out() {
        let large = beyond(&said, MIN_D_OF_FOREIGN);
        rates.add(
            &format!("unknown flagged, D > {MIN_D_OF_FOREIGN}"),
            &large,
            Verdict::is_flagged,
        );
        rates.add(
            &format!("wrong cause named, D > {MIN_D_OF_FOREIGN}"),
            &large,
            has_wrong,
        );
    } else {
        rates.of_sets(&said);
        rates.of_effects(&said);
    }
    rates.0
}

pub(crate) fn is_reproduced(verdict: &Verdict) -> bool {
    verdict.said.as_ref().is_some_and(|said| said.is_reproduced)
}

pub(crate) fn has_wrong(verdict: &Verdict) -> bool {
    verdict.wrong().next().is_some()
}

/// Those that hide so many effects.
fn hiding<'v>(all: &[&'v Verdict], least: usize, most: usize) -> Vec<&'v Verdict> {
    let fits = |v: &&&Verdict| (least..=most).contains(&v.truth.effects.len());
    all.iter().filter(fits).copied().collect()
}

/// Those with one effect that should be named, and those with several.
pub(crate) fn to_be_named<'v>(all: &[&'v Verdict]) -> [Vec<&'v Verdict>; 2] {
    [
        beyond(&hiding(all, 1, 1), SINGLE_D),
        beyond(&hiding(all, 2, usize::MAX), SEVERAL_D),
    ]
}

/// Those of which everything that is hidden is larger than `d`.
pub(crate) fn beyond<'v>(all: &[&'v Verdict], d: f64) -> Vec<&'v Verdict> {
    let is_large = |v: &&&Verdict| v.least_d().is_some_and(|least| least > d);
    all.iter().filter(is_large).copied().collect()
}

#[derive(Default)]
struct Rates(Vec<Rate>);

impl Rates {
    fn add(&mut self, what: &str, of: &[&Verdict], holds: impl Fn(&Verdict) -> bool) {
        self.push(what, Proportion::of(of.iter().map(|v| holds(v))));
    }

    fn push(&mut self, what: &str, count: Proportion) {
        self.0.push(Rate {
            what: what.to_owned(),
            count,
            interval: count.wilson(),
        });
    }

    /// Whole sets, by how many effects are hidden.
    fn of_sets(&mut self, said: &[&Verdict]) {
        self.add(
            "nothing hidden: nothing named",
            &hiding(said, 0, 0),
            Verdict::is_exact,
        );
        let [single, several] = to_be_named(said);
        self.add(
            &format!("1 effect, D > {SINGLE_D}: exact"),
            &single,
            Verdict::is_exact,
        );
        let what = format!("2-3 effects, each D > {SEVERAL_D}: exact");
        self.add(&what, &several, Verdict::is_exact);
        let large = beyond(said, MIN_D_OF_FOREIGN);
        self.add(
            &format!("all D > {MIN_D_OF_FOREIGN}: exact"),
            &large,
            Verdict::is_exact,
        );
    }

    /// Every hidden effect by itself.
    fn of_effects(&mut self, said: &[&Verdict]) {
        type Holds = fn(&Verdict, &TrueEffect) -> bool;
        let questions: [(&str, Holds); 4] = [
            ("named, class and axis", Verdict::has),
            ("class named, on some axis", |v, e| {
                v.named().any(|cause| cause.effect == e.class.id())
            }),
            ("in a reported set", |v, e| {
                v.named().any(|cause| cause.may_be(e))
            }),
            ("shown as a surrogate", Verdict::shows),
        ];
        for least in [SEVERAL_D, MIN_D_OF_FOREIGN] {
            for (question, holds) in questions {
                let pairs = said
                    .iter()
                    .flat_map(|v| v.truth.effects.iter().map(move |e| (v, e)));
                let large = pairs.filter(|(_, effect)| effect.d > least);
                let count = Proportion::of(large.map(|(v, effect)| holds(v, effect)));
                self.push(&format!("each effect, D > {least}: {question}"), count);
            }
        }
    }
}

fn name(cause: &crate::verdict::SaidCause) -> String {
    format!("{} {}", cause.effect, cause.axis).trim().to_owned()
}

fn most_frequent(names: impl Iterator<Item = String>) -> Vec<(String, usize)> {
    let mut counts = BTreeMap::<String, usize>::new();
    for name in names {
        *counts.entry(name).or_default() += 1;
    }
    let mut sorted: Vec<(String, usize)> = counts.into_iter().collect();
    sorted.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
    sorted
}

fn false_names(own: &[&Verdict]) -> Vec<(String, usize)> {
    most_frequent(
        own.iter()
            .flat_map(|v| v.wrong().map(name).collect::<Vec<_>>()),
    )
}

#[cfg(test)]
mod tests {
    use gap_diagnosis::report::Status;

    use super::*;
    use crate::effect::Class;
    use crate::sample::{cause, effect, verdict};

    #[test]
    fn a_right_name_a_wrong_axis_and_a_surrogate_are_told_apart() {
        let play = || vec![effect(Class::Backlash, "X", 30.0)];
        let verdicts = [
            verdict(
                play(),
                vec![cause("backlash", "X", Status::Named, 4.1)],
                false,
            ),
            verdict(
                play(),
                vec![cause("backlash", "Y", Status::Named, 4.1)],
                false,
            ),
            verdict(
                play(),
                vec![cause("backlash", "X", Status::Surrogate, 4.1)],
                true,
            ),
            verdict(vec![], vec![], false),
        ];
        let tally = Tally::of(Arm::Catalogue, &verdicts);
        let count = |what: &str| tally.rate(what).unwrap().count;
        assert_eq!(count("1 effect, D > 10: exact"), Proportion { k: 1, n: 3 });
        assert_eq!(
            count("wrong and not flagged unknown"),
            Proportion { k: 1, n: 4 }
        );
        assert_eq!(
            count("nothing hidden: nothing named"),
            Proportion { k: 1, n: 1 }
        );
        let class_of_any = count("each effect, D > 20: class named, on some axis");
        assert_eq!(class_of_any, Proportion { k: 2, n: 3 });
        assert_eq!(tally.classes.len(), 1);
        assert_eq!(tally.classes[0].named[3], Proportion { k: 1, n: 3 });
        assert_eq!(tally.classes[0].surrogate, Proportion { k: 1, n: 3 });
        assert_eq!(tally.classes[0].taken_for, [("backlash Y".to_owned(), 1)]);
        assert_eq!(tally.false_names, [("backlash Y".to_owned(), 1)]);
        let own = |said: &str| tally.confusion.iter().find(|pair| pair.said == said);
        let shown = own("(backlash)").unwrap();
        assert_eq!(shown.observed, Proportion { k: 1, n: 3 });
        assert_eq!(tally.reliability.len(), 1);
        assert_eq!(tally.reliability[0].right, Proportion { k: 1, n: 2 });
    }

    #[test]
    fn a_parameter_is_covered_where_its_interval_holds_the_truth() {
        let play = effect(Class::Backlash, "X", 30.0);
        let near = verdict(
            vec![play.clone()],
            vec![cause("backlash", "X", Status::Named, 4.1)],
            false,
        );
        let (error, covered) = near.sized(&play).unwrap();
        assert!((error - 0.025).abs() < 1e-12 && covered);
        let far = verdict(
            vec![play.clone()],
            vec![cause("backlash", "X", Status::Named, 4.5)],
            false,
        );
        assert!(!far.sized(&play).unwrap().1);
    }

    #[test]
    fn a_class_that_was_left_out_is_never_rightly_named() {
        let mut verdict = verdict(
            vec![effect(Class::Backlash, "X", 30.0)],
            vec![cause("reversal_spike", "X", Status::Named, 1.0)],
            true,
        );
        verdict.truth.arm = Arm::LeftOut;
        verdict.truth.left_out = Some("backlash".to_owned());
        let tally = Tally::of(Arm::LeftOut, &[verdict]);
        let count = |what: &str| tally.rate(what).unwrap().count;
        assert_eq!(count("unknown flagged, D > 20"), Proportion { k: 1, n: 1 });
        assert_eq!(
            count("wrong cause named, D > 20"),
            Proportion { k: 1, n: 1 }
        );
    }

    #[test]
    fn what_a_foreign_form_brings_along_is_no_wrong_name_and_no_stand_in_for_the_effect() {
        let lean = TrueEffect {
            besides: vec![("straightness".to_owned(), "XZ".to_owned())],
            ..effect(Class::Squareness, "XZ", 30.0)
        };
        let named = |ids: &[&str]| {
            let all = ids.iter().map(|id| cause(id, "XZ", Status::Named, 1.0));
            verdict(vec![lean.clone()], all.collect(), false)
        };
        assert!(named(&["squareness", "straightness"]).is_exact());
        assert!(named(&["squareness"]).is_exact());
        let bow_only = named(&["straightness"]);
        assert!(!bow_only.is_exact() && bow_only.wrong().next().is_none());
        assert!(named(&["squareness", "guide_bow"]).wrong().next().is_some());
    }

    #[test]
    fn a_set_that_holds_the_truth_is_not_wrong_and_not_exact() {
        let play = effect(Class::Backlash, "X", 30.0);
        let mut spike = cause("reversal_spike", "X", Status::Set, 1.0);
        spike.rivals = vec![("backlash".to_owned(), "X".to_owned())];
        let open = verdict(vec![play.clone()], vec![spike.clone()], false);
        assert!(open.wrong().next().is_none() && !open.is_exact());
        let twice = cause("backlash", "X", Status::Named, 4.0);
        let doubled = verdict(vec![play.clone()], vec![twice, spike.clone()], false);
        assert!(doubled.wrong().next().is_some());
        spike.status = Status::Named;
        let sure = verdict(vec![play], vec![spike], false);
        assert!(sure.wrong().next().is_some());
    }

    #[test]
    fn bins_cover_every_size() {
        assert_eq!((bin(0.0), bin(5.0), bin(19.9), bin(50.0)), (0, 1, 2, 4));
        assert_eq!(bin_name(bin(70.0)), "> 50");
        assert_eq!(bin_name(0), "D < 5");
    }
}
