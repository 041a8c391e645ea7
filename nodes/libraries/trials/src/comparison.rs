//! Methods side by side on the same trials: the diagnosis, itself without one of its rules, and others.

use gap_diagnosis::Rule;
use serde::{Deserialize, Serialize};

use crate::arm::Arm;
use crate::baseline::Method;
use crate::calibration::calibration;
use crate::proportion::Proportion;
use crate::tally::{MIN_D_OF_FOREIGN, beyond, has_wrong};
use crate::verdict::Verdict;

/// One method's line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MethodLine {
    /// Its name.
    pub method: String,
    /// Nothing else than what is hidden named, everything of D > 20.
    pub exact: Proportion,
    /// Hidden effects of D > 20 that it named, class and axis.
    pub named: Proportion,
    /// Machines with a name that is none.
    pub wrong: Proportion,
    /// The same, and no unknown flagged.
    pub unflagged: Proportion,
    /// Expected calibration error of what it named, 1; a method that gives no probabilities is sure of every
    /// name. None where nothing was named.
    #[serde(default)]
    pub calibration_error: Option<f64>,
}

impl MethodLine {
    fn of(method: &str, own: &[&Verdict]) -> Self {
        let said: Vec<&Verdict> = own.iter().copied().filter(|v| v.said.is_some()).collect();
        let large = beyond(&said, MIN_D_OF_FOREIGN);
        let pairs = said
            .iter()
            .flat_map(|v| v.truth.effects.iter().map(move |e| (v, e)));
        let large_pairs = pairs.filter(|(_, effect)| effect.d > MIN_D_OF_FOREIGN);
        Self {
            method: method.to_owned(),
            exact: Proportion::of(large.iter().map(|v| v.is_exact())),
            named: Proportion::of(large_pairs.map(|(v, effect)| v.has(effect))),
            wrong: Proportion::of(said.iter().map(|v| has_wrong(v))),
            unflagged: Proportion::of(said.iter().map(|v| has_wrong(v) && !v.is_flagged())),
            calibration_error: calibration(&said)[0].value,
        }
    }
}

/// The diagnosis and the other methods on one arm; none where no other was asked.
#[must_use]
pub fn methods(arm: Arm, own: &[&Verdict]) -> Vec<MethodLine> {
    let asked: Vec<&Verdict> = own
        .iter()
        .copied()
        .filter(|v| !v.baselines.is_empty() && v.truth.arm == arm)
        .collect();
    if asked.is_empty() {
        return vec![];
    }
    let mut lines = vec![MethodLine::of("this diagnosis", &asked)];
    for method in Method::ALL {
        let judged: Vec<Verdict> = asked.iter().filter_map(|v| v.by(method)).collect();
        let judged: Vec<&Verdict> = judged.iter().collect();
        lines.push(MethodLine::of(method.title(), &judged));
    }
    lines
}

/// The diagnosis with all its rules and without each, on the trials of an arm that all of them had.
#[must_use]
pub fn ablations(arm: Arm, verdicts: &[Verdict]) -> Vec<MethodLine> {
    let of = |rule: Option<Rule>| -> Vec<&Verdict> {
        let own = |v: &&Verdict| v.truth.arm == arm && v.ablated == rule;
        verdicts.iter().filter(own).collect()
    };
    let tried: Vec<(Rule, Vec<&Verdict>)> = Rule::ALL
        .into_iter()
        .map(|rule| (rule, of(Some(rule))))
        .filter(|(_, own)| !own.is_empty())
        .collect();
    if tried.is_empty() {
        return vec![];
    }
    let in_all = |v: &&Verdict| {
        tried
            .iter()
            .all(|(_, own)| own.iter().any(|other| other.truth.index == v.truth.index))
    };
    let whole: Vec<&Verdict> = of(None).into_iter().filter(in_all).collect();
    let has = |v: &&Verdict| whole.iter().any(|other| other.truth.index == v.truth.index);
    let mut lines = vec![MethodLine::of("all rules", &whole)];
    for (rule, own) in tried {
        let own: Vec<&Verdict> = own.into_iter().filter(has).collect();
        lines.push(MethodLine::of(&format!("without {rule}"), &own));
    }
    lines
}

#[cfg(test)]
mod tests {
    use gap_diagnosis::report::Status;

    use super::*;
    use crate::effect::Class;
    use crate::sample::{cause, effect, verdict};

    #[test]
    fn a_rule_is_worth_what_the_same_trials_lose_without_it() {
        let said = |ablated, confidence, index| {
            let mut cause = cause("backlash", "X", Status::Named, 4.0);
            cause.confidence = confidence;
            let hidden = effect(Class::Backlash, "X", 30.0);
            let mut verdict = verdict(vec![hidden], vec![cause], false);
            verdict.ablated = ablated;
            verdict.truth.index = index;
            verdict
        };
        // The third was not diagnosed without the rule and does not count.
        let all = [
            said(None, 0.97, 0),
            said(Some(Rule::Recalibration), 0.6, 0),
            said(None, 0.2, 1),
        ];
        let lines = ablations(Arm::Catalogue, &all);
        let told = |line: &MethodLine| (line.method.clone(), line.named.n);
        let told: Vec<_> = lines.iter().map(told).collect();
        let expected = ["all rules", "without recalibration"];
        assert_eq!(told, expected.map(|method| (method.to_owned(), 1)));
        let errors: Vec<f64> = lines.iter().filter_map(|l| l.calibration_error).collect();
        assert!((errors[0] - 0.03).abs() < 1e-12, "{errors:?}");
        assert!((errors[1] - 0.4).abs() < 1e-12, "{errors:?}");
    }
}
