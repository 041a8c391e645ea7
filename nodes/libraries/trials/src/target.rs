//! What the diagnosis should reach, and whether it does: the protocol's table.
//!
//! A share meets its target where its whole 95 % interval does and misses it where none of the interval does. Where
//! the interval holds the target's edge the trials are too few to tell: not measured, as shares of nothing and figures without a
//! trial are, which is neither met nor missed. Figures without an interval are judged by themselves.

use serde::{Deserialize, Serialize};

use crate::arm::Arm;
use crate::calibration::calibration;
use crate::confusion::ISOLABLE;
use crate::covariate;
use crate::designed::by_round;
use crate::detection::{Limit, d95};
use crate::effect::Class;
use crate::proportion::{Proportion, auroc, median};
use crate::tally::{MIN_D_OF_FOREIGN, SINGLE_D, beyond, has_wrong, is_reproduced, to_be_named};
use crate::truth::TrueEffect;
use crate::verdict::{Second, Verdict};

pub use designed::{Ratio, TARGET_RATIO, of_designed};

mod designed;

/// One line of the protocol's table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Target {
    /// What is counted or taken.
    pub metric: String,
    /// Where it should be.
    pub wanted: String,
    /// How often, where it is a share.
    pub count: Option<Proportion>,
    /// Its 95 % interval.
    pub interval: Option<[f64; 2]>,
    /// The figure; none where nothing was measured.
    pub value: Option<f64>,
    /// Where the figure lies, if it is a detection limit: the trials may bound it on one side only.
    #[serde(default)]
    pub limit: Option<Limit>,
    /// Of how many.
    pub n: usize,
    /// Whether it is where it should be; none: not measured, or by too few trials to tell.
    pub met: Option<bool>,
}

/// Where a figure should be.
#[derive(Clone, Copy)]
enum Bound {
    AtLeast(f64),
    AtMost(f64),
    Within(f64, f64),
}

use Bound::{AtLeast, AtMost, Within};

impl Bound {
    fn holds(self, value: f64) -> bool {
        match self {
            AtLeast(low) => value >= low,
            AtMost(high) => value <= high,
            Within(low, high) => (low..=high).contains(&value),
        }
    }

    /// Whether all of an interval is where it should be, or none of it; none: the interval cannot tell.
    fn decides(self, [least, greatest]: [f64; 2]) -> Option<bool> {
        let (low, high) = match self {
            AtLeast(low) => (low, f64::INFINITY),
            AtMost(high) => (f64::NEG_INFINITY, high),
            Within(low, high) => (low, high),
        };
        if low <= least && greatest <= high {
            Some(true)
        } else if greatest < low || high < least {
            Some(false)
        } else {
            None
        }
    }

    fn words(self, as_percent: bool) -> String {
        let number = |value: f64| {
            if as_percent {
                let percent = (1e3 * value).round() / 10.0;
                format!("{percent} %")
            } else {
                format!("{value}")
            }
        };
        match self {
            AtLeast(low) => format!("≥ {}", number(low)),
            AtMost(high) => format!("≤ {}", number(high)),
            Within(low, high) => format!("{} to {}", number(low), number(high)),
        }
    }
}

/// Time that a diagnosis should not take longer than, s.
pub(crate) const LONGEST_DIAGNOSIS_S: f64 = 60.0;

/// The table as it fills.
struct Sheet(Vec<Target>);

impl Sheet {
    fn share(&mut self, metric: &str, bound: Bound, all: impl Iterator<Item = bool>) {
        let count = Proportion::of(all);
        let value = count.share();
        let interval = value.map(|_| count.wilson());
        self.0.push(Target {
            metric: metric.to_owned(),
            wanted: bound.words(true),
            count: Some(count),
            interval,
            value,
            limit: None,
            n: count.n,
            met: interval.and_then(|interval| bound.decides(interval)),
        });
    }

    fn figure(&mut self, metric: &str, bound: Bound, value: Option<f64>, n: usize) {
        self.0.push(Target {
            metric: metric.to_owned(),
            wanted: bound.words(false),
            count: None,
            interval: None,
            value,
            limit: None,
            n,
            met: value.map(|value| bound.holds(value)),
        });
    }

    /// A detection limit, which is where it should be if all of where it may lie is, and is not if none of it is.
    fn limit(&mut self, metric: &str, most: f64, limit: Option<Limit>, n: usize) {
        self.figure(metric, AtMost(most), limit.and_then(Limit::value), n);
        if let Some(target) = self.0.last_mut() {
            target.limit = limit;
            target.met = limit.and_then(|limit| AtMost(most).decides(limit.ends()));
        }
    }

    fn middle(&mut self, metric: &str, bound: Bound, values: Vec<f64>) {
        let n = values.len();
        self.figure(metric, bound, median(values), n);
    }
}

/// The whole table; verdicts of a diagnosis without one of its rules are not in it.
#[must_use]
pub fn targets(verdicts: &[Verdict]) -> Vec<Target> {
    let of = |arm: Arm| -> Vec<&Verdict> {
        let own = |v: &&Verdict| v.truth.arm == arm && v.ablated.is_none() && v.said.is_some();
        verdicts.iter().filter(own).collect()
    };
    let mut sheet = Sheet(vec![]);
    of_nulls(&mut sheet, &of(Arm::Null), &of(Arm::HeavyNull));
    let (known, foreign) = (of(Arm::Catalogue), of(Arm::Foreign));
    of_limits(&mut sheet, &of(Arm::Limit), &known);
    of_known(&mut sheet, &known);
    of_foreign(&mut sheet, &foreign);
    of_left_out(&mut sheet, &of(Arm::LeftOut), &known);
    of_sets(&mut sheet, &known);
    of_calibration(&mut sheet, &known, &foreign);
    of_sizes(&mut sheet, &known);
    of_shrink(&mut sheet, &known, &foreign);
    of_two_rounds(&mut sheet, &of(Arm::TwoRounds));
    let times = verdicts.iter().filter(|v| v.ablated.is_none());
    let times = times.filter_map(|v| Some(v.said.as_ref()?.runtime_s));
    sheet.middle(
        "time of a diagnosis with all its simulations, median, s",
        AtMost(LONGEST_DIAGNOSIS_S),
        times.collect(),
    );
    sheet.0
}

fn has_name(verdict: &Verdict) -> bool {
    verdict.named().next().is_some()
}

fn of_nulls(sheet: &mut Sheet, null: &[&Verdict], heavy: &[&Verdict]) {
    sheet.share(
        "iv: any cause named",
        AtMost(0.01),
        null.iter().map(|v| has_name(v)),
    );
    sheet.share(
        "iv: any alarm, unknown included",
        AtMost(0.02),
        null.iter().map(|v| has_name(v) || v.is_flagged()),
    );
    sheet.share(
        "v: any cause named",
        AtMost(0.05),
        heavy.iter().map(|v| has_name(v)),
    );
    sheet.share(
        "v: floor not reproduced said",
        AtLeast(0.9),
        heavy.iter().map(|v| !is_reproduced(v)),
    );
}

/// Every hidden effect with its verdict.
pub(crate) fn pairs<'v>(
    own: &[&'v Verdict],
) -> impl Iterator<Item = (&'v Verdict, &'v TrueEffect)> {
    let all: Vec<(&Verdict, &TrueEffect)> = own
        .iter()
        .flat_map(|v| v.truth.effects.iter().map(move |e| (*v, e)))
        .collect();
    all.into_iter()
}

/// Least trials that a detection limit is taken of.
const FEWEST: usize = 12;

/// The detection limit of a class, or of all together; none of too few trials.
pub(crate) fn limit(own: &[&Verdict], class: Option<Class>) -> Option<Limit> {
    let own = pairs(own).filter(|(_, e)| class.is_none_or(|class| e.class == class));
    let trials: Vec<(f64, bool)> = own.map(|(v, e)| (e.d, v.has(e))).collect();
    if trials.len() < FEWEST {
        return None;
    }
    d95(&trials)
}

/// Of the arm that is made for it; of the catalogue's, whose least physical sizes are large for some classes, without it.
fn of_limits(sheet: &mut Sheet, small: &[&Verdict], known: &[&Verdict]) {
    let (arm, own) = if small.is_empty() {
        (Arm::Catalogue, known)
    } else {
        (Arm::Limit, small)
    };
    let by_class = Class::every().map(|class| limit(own, Some(class)));
    let by_class: Vec<Limit> = by_class.flatten().collect();
    let (whole, n) = (limit(own, None), by_class.len());
    let metric = |of: &str| format!("{arm}: D named in 95 %, {of}");
    sheet.limit(&metric("all classes together"), 8.0, whole, own.len());
    let middle = Limit::middle(&by_class);
    sheet.limit(&metric("median of the classes"), 8.0, middle, n);
    let largest = Limit::largest(&by_class);
    sheet.limit(&metric("worst class"), 10.0, largest, n);
}

/// Machines with one large effect, and those with several: whether nothing but them is named, and all of them. Those with
/// several.
fn of_sets_of<'v>(sheet: &mut Sheet, arm: &str, known: &[&'v Verdict]) -> Vec<&'v Verdict> {
    let [single, several] = to_be_named(known);
    sheet.share(
        &format!("{arm}: 1 effect, D > 10, exact"),
        AtLeast(0.98),
        single.iter().map(|v| v.is_exact()),
    );
    sheet.share(
        &format!("{arm}: 2 or 3 effects, each D > 7, exact set"),
        AtLeast(0.9),
        several.iter().map(|v| v.is_exact()),
    );
    several
}

fn of_known(sheet: &mut Sheet, known: &[&Verdict]) {
    let several = of_sets_of(sheet, "i", known);
    let each = pairs(&several).map(|(v, e)| v.has(e));
    sheet.share(
        "i: each of 2 or 3 effects, D > 7, named",
        AtLeast(0.96),
        each,
    );
}

fn of_foreign(sheet: &mut Sheet, foreign: &[&Verdict]) {
    let large = pairs(foreign).filter(|(_, e)| e.d > MIN_D_OF_FOREIGN);
    sheet.share(
        "iii: true class named on its axis, D > 20",
        AtLeast(0.93),
        large.map(|(v, e)| v.has(e)),
    );
    let all = beyond(foreign, MIN_D_OF_FOREIGN);
    sheet.share(
        "iii: exact set, D > 20",
        AtLeast(0.75),
        all.iter().map(|v| v.is_exact()),
    );
    let wrong = foreign.iter().map(|v| has_wrong(v) && !v.is_flagged());
    sheet.share("iii: wrong cause named, unflagged", AtMost(0.08), wrong);
}

/// AUROC of the unknown score of machines whose class is left out beside others, D > 10, and of how many.
fn area(left_out: &[&Verdict], known: &[&Verdict]) -> (Option<f64>, usize) {
    let score = |v: &&Verdict| v.said.as_ref().map(|said| said.unknown_ratio);
    let large =
        |all: &[&Verdict]| -> Vec<f64> { beyond(all, SINGLE_D).iter().filter_map(score).collect() };
    let (positive, negative) = (large(left_out), large(known));
    (auroc(&positive, &negative), positive.len() + negative.len())
}

/// Those of whose effects other classes cannot imitate half.
fn isolable<'v>(left_out: &[&'v Verdict]) -> Vec<&'v Verdict> {
    let is_isolable = |v: &&&Verdict| v.likeness.iter().any(|one| one.sin_alone >= ISOLABLE);
    left_out.iter().filter(is_isolable).copied().collect()
}

/// Wrong names where a class with a D above 20 is left out, and those that are not flagged.
fn of_wrong_names(sheet: &mut Sheet, arm: &str, left_out: &[&Verdict], most: f64) {
    let large = beyond(left_out, MIN_D_OF_FOREIGN);
    sheet.share(
        &format!("{arm}: wrong cause named, D > 20"),
        AtMost(most),
        large.iter().map(|v| has_wrong(v)),
    );
    sheet.share(
        &format!("{arm}: the same, and not flagged unknown"),
        AtMost(0.05),
        large.iter().map(|v| has_wrong(v) && !v.is_flagged()),
    );
}

fn of_left_out(sheet: &mut Sheet, left_out: &[&Verdict], known: &[&Verdict]) {
    let (value, n) = area(left_out, known);
    sheet.figure("ii: AUROC of unknown, D > 10", AtLeast(0.95), value, n);
    let (value, n) = area(&isolable(left_out), known);
    sheet.figure("ii: the same, isolable classes", AtLeast(0.985), value, n);
    of_wrong_names(sheet, "ii", left_out, 0.2);
    let described = left_out.iter().filter(|v| v.is_flagged()).filter_map(|v| {
        let covariate = &v.said.as_ref()?.covariate;
        let effect = v.truth.effects.first()?;
        Some(covariate::is_right(effect, covariate))
    });
    sheet.share(
        "ii: covariate of a flagged leftover right",
        AtLeast(0.9),
        described,
    );
}

fn of_sets(sheet: &mut Sheet, known: &[&Verdict]) {
    let told = pairs(known).filter(|(v, e)| e.d > SINGLE_D && has_name(v));
    sheet.share(
        "i: truth among the named and their rivals, D > 10",
        AtLeast(0.98),
        told.map(|(v, e)| v.named().any(|cause| cause.may_be(e))),
    );
    let sizes = known.iter().flat_map(|v| v.named());
    let sizes: Vec<f64> = sizes.map(|cause| 1.0 + cause.rivals.len() as f64).collect();
    let n = sizes.len();
    let mean = (n > 0).then(|| sizes.iter().sum::<f64>() / n as f64);
    sheet.figure("i: mean size of a set", AtMost(1.3), mean, n);
}

fn of_calibration(sheet: &mut Sheet, known: &[&Verdict], foreign: &[&Verdict]) {
    for (arm, own, most) in [("i", known, [0.03, 0.03]), ("iii", foreign, [0.08, 0.12])] {
        for (figure, most) in calibration(own).into_iter().zip(most) {
            let metric = format!("{arm}: {}", figure.what);
            sheet.figure(&metric, AtMost(most), figure.value, figure.n);
        }
    }
    for (arm, own, least) in [("i", known, 0.9), ("iii", foreign, 0.75)] {
        let confidences: Vec<f64> = pairs(own).filter_map(|(v, e)| on_truth(v, e)).collect();
        let n = confidences.len();
        let mean = (n > 0).then(|| confidences.iter().sum::<f64>() / n as f64);
        let metric = format!("{arm}: mean probability on the truth where anything was detected");
        sheet.figure(&metric, AtLeast(least), mean, n);
    }
}

/// Confidence in a hidden effect; none where nothing was detected.
fn on_truth(verdict: &Verdict, effect: &TrueEffect) -> Option<f64> {
    let said = verdict.said.as_ref()?;
    let detected = !said.causes.is_empty() || said.is_unknown;
    let own = said.causes.iter().find(|cause| cause.is(effect));
    detected.then(|| own.map_or(0.0, |cause| cause.confidence))
}

/// Relative errors of parameters times D, and whether their intervals hold them; D > 20.
fn sized(known: &[&Verdict]) -> Vec<(f64, bool)> {
    let large = pairs(known).filter(|(_, e)| e.d > MIN_D_OF_FOREIGN);
    let sized = large.filter_map(|(v, e)| {
        v.sized(e)
            .map(|(error, covered)| (error.abs() * e.d, covered))
    });
    sized.collect()
}

/// Whether intervals of the gap closed hold what is closed on later runs.
fn later_held<'v>(own: impl Iterator<Item = &'v &'v Verdict>) -> impl Iterator<Item = bool> {
    own.filter_map(|v| {
        let [_, low, high] = v.said.as_ref()?.closed?;
        let best = v.later_closed?;
        Some((low..=high).contains(&best))
    })
}

fn of_sizes(sheet: &mut Sheet, known: &[&Verdict]) {
    let sized = sized(known);
    sheet.middle(
        "i: relative error of a parameter times D, median, D > 20",
        AtMost(2.0),
        sized.iter().map(|(error, _)| *error).collect(),
    );
    sheet.share(
        "i: 95 % intervals that hold the parameter, D > 20",
        Within(0.92, 0.97),
        sized.iter().map(|(_, covered)| *covered),
    );
}

fn of_shrink(sheet: &mut Sheet, known: &[&Verdict], foreign: &[&Verdict]) {
    for (arm, own, closed, left) in [("i", known, 0.98, 0.03), ("iii", foreign, 0.9, 0.1)] {
        let large = beyond(own, MIN_D_OF_FOREIGN);
        let of = |ratio: &dyn Fn(&Verdict) -> Option<f64>| -> Vec<f64> {
            large.iter().filter_map(|v| ratio(v)).collect()
        };
        sheet.middle(
            &format!("{arm}: gap closed over that of an oracle, median, D > 20"),
            AtLeast(closed),
            of(&Verdict::closed_of_oracle),
        );
        sheet.middle(
            &format!("{arm}: gap after over before, held out, without what a machine that hides nothing leaves, median, D > 20"),
            AtMost(left),
            of(&Verdict::left_of_gap),
        );
    }
    sheet.share(
        "i, iii: intervals of the gap closed that hold it on later runs",
        Within(0.9, 0.98),
        later_held(known.iter().chain(foreign)),
    );
}

/// Squared distance from which a run was to decide.
const DECIDES: f64 = 9.0;

/// Of machines that were open after one round: whether they are exact after a second one of some kind.
fn opened(own: &[&Verdict], counts: fn(&Second) -> bool) -> Vec<bool> {
    let all = own.iter().filter_map(|v| {
        let second = v.second.as_ref().filter(|second| counts(second))?;
        let [before, after] = by_round(v, second);
        (!before).then_some(after)
    });
    all.collect()
}

fn of_two_rounds(sheet: &mut Sheet, own: &[&Verdict]) {
    let asked = opened(own, |second| {
        second.delta >= DECIDES && second.said.is_some()
    });
    sheet.share(
        "vii: open after one round, exact after the run asked for (Δ ≥ 9)",
        AtLeast(0.85),
        asked.into_iter(),
    );
}

#[cfg(test)]
mod tests {
    use gap_diagnosis::report::Status;

    use super::*;
    use crate::sample::{cause, effect, verdict};
    use crate::verdict::SaidCause;

    #[test]
    fn without_trials_nothing_is_met_and_nothing_missed() {
        let all = targets(&[]);
        assert!(all.len() >= 28, "{}", all.len());
        assert!(all.iter().all(|target| target.met.is_none()), "{all:#?}");
    }

    #[test]
    fn a_limit_beyond_what_was_tried_is_missed_and_one_of_too_few_trials_not_measured() {
        let trials = |n: usize, of: fn(f64) -> Vec<SaidCause>| -> Vec<Verdict> {
            let trial = |index: usize| {
                let d = 2.0 + index as f64;
                verdict(vec![effect(Class::Backlash, "X", d)], of(d), false)
            };
            (0..n).map(trial).collect()
        };
        let told = |verdicts: &[Verdict]| -> Vec<(Option<String>, Option<bool>)> {
            let all = targets(verdicts);
            let limits = all.iter().filter(|target| target.metric.contains("95 %, "));
            let told = limits.map(|target| (target.limit.map(|l| l.to_string()), target.met));
            told.collect()
        };
        let never = told(&trials(40, |_| vec![]));
        assert_eq!(never, vec![(Some("> 41.000".to_owned()), Some(false)); 3]);
        let always = told(&trials(40, |_| {
            vec![cause("backlash", "X", Status::Named, 4.0)]
        }));
        assert_eq!(always, vec![(Some("< 2.000".to_owned()), Some(true)); 3]);
        assert_eq!(told(&trials(5, |_| vec![])), vec![(None, None); 3]);
    }

    #[test]
    fn the_limit_is_that_of_its_own_arm_where_it_has_trials() {
        let named = |d: f64| match d < 6.0 {
            true => vec![],
            false => vec![cause("backlash", "X", Status::Named, 4.0)],
        };
        let mut all = vec![];
        for index in 0..40 {
            let d = 2.0 + f64::from(index);
            let play = || vec![effect(Class::Backlash, "X", d)];
            all.push(verdict(play(), vec![], false));
            let mut own = verdict(play(), named(d), false);
            own.truth.arm = Arm::Limit;
            all.push(own);
        }
        let told = targets(&all);
        for target in told.iter().filter(|target| target.limit.is_some()) {
            assert!(target.metric.starts_with("limit: "), "{target:?}");
            let at = target.value.unwrap();
            assert!((5.0..12.0).contains(&at), "{at}");
        }
        assert_eq!(
            told.iter().filter(|target| target.limit.is_some()).count(),
            3
        );
    }

    #[test]
    fn a_share_whose_interval_holds_its_target_is_not_measured() {
        // Wilson's 95 % intervals by hand, z = 1.96: 0 of 20: 0 to z2/(n + z2) = 3.8416/23.8416 = 0.1611.
        // 0 of 1000: 0 to 3.8416/1003.84 = 0.0038. 20 of 100: (0.2 + 0.019208 +- 1.96 sqrt(0.0016 + 0.00009604))/1.038416
        // = 0.1334 to 0.2888. 132 of 136: 0.9269 to 0.9885.
        let told = |k: usize, n: usize, bound: Bound| {
            let mut sheet = Sheet(vec![]);
            sheet.share("", bound, (0..n).map(|index| index < k));
            (sheet.0[0].interval.unwrap(), sheet.0[0].met)
        };
        for (k, n, bound, interval, met) in [
            (0, 20, AtMost(0.01), [0.0, 0.1611], None),
            (0, 1000, AtMost(0.01), [0.0, 0.0038], Some(true)),
            (20, 100, AtMost(0.01), [0.1334, 0.2888], Some(false)),
            (20, 100, AtMost(0.15), [0.1334, 0.2888], None),
            (132, 136, AtLeast(0.98), [0.9269, 0.9885], None),
            (20, 100, Within(0.1, 0.3), [0.1334, 0.2888], Some(true)),
            (20, 100, Within(0.19, 0.21), [0.1334, 0.2888], None),
            (20, 100, Within(0.3, 0.4), [0.1334, 0.2888], Some(false)),
        ] {
            let (seen, seen_met) = told(k, n, bound);
            for (seen, by_hand) in seen.iter().zip(interval) {
                assert!((seen - by_hand).abs() < 1e-4, "{k}/{n}: {seen} {by_hand}");
            }
            assert_eq!(seen_met, met, "{k}/{n} {}", bound.words(true));
        }
    }

    #[test]
    fn bounds_are_met_on_their_edge() {
        assert!(AtLeast(0.98).holds(0.98) && !AtLeast(0.98).holds(0.979));
        assert!(AtMost(2.0).holds(2.0) && !AtMost(2.0).holds(2.1));
        assert!(Within(0.9, 0.98).holds(0.95) && !Within(0.9, 0.98).holds(0.99));
        assert_eq!(Within(0.92, 0.97).words(true), "92 % to 97 %");
        assert_eq!(AtMost(0.005).words(true), "≤ 0.5 %");
    }
}
