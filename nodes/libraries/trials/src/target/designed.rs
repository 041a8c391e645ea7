//! What designed programmes should reach.

use serde::{Deserialize, Serialize};

use super::{
    AtLeast, AtMost, Sheet, Target, Within, area, has_name, isolable, later_held, limit,
    of_sets_of, of_wrong_names, opened, sized,
};
use crate::arm::Arm;
use crate::designed::PROGRAMME_MIN;
use crate::tally::{MIN_D_OF_FOREIGN, beyond};
use crate::verdict::Verdict;

/// Effects that a designed programme names beside a shop's of the same minutes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ratio {
    /// Machines that both measured.
    pub machines: usize,
    /// Minutes of each.
    pub minutes: f64,
    /// Effects that are named by the designed one.
    pub designed: usize,
    /// Effects that are named by a shop's.
    pub shop: usize,
}

impl Ratio {
    /// Designed over a shop's; none where a shop's names nothing.
    #[must_use]
    pub fn value(self) -> Option<f64> {
        (self.shop > 0).then(|| self.designed as f64 / self.shop as f64)
    }
}

/// The ratio that is wanted.
pub const TARGET_RATIO: f64 = 1.5;

/// The table of the arms of designed programmes; `ratio` is of another journal.
#[must_use]
pub fn of_designed(verdicts: &[Verdict], ratio: Option<Ratio>) -> Vec<Target> {
    let of = |arm: Arm| -> Vec<&Verdict> {
        let own = |v: &&Verdict| v.truth.arm == arm && v.ablated.is_none() && v.said.is_some();
        verdicts.iter().filter(own).collect()
    };
    let mut sheet = Sheet(vec![]);
    let (known, left_out) = (of(Arm::Designed), of(Arm::DesignedLeftOut));
    of_nothing(&mut sheet, &known);
    of_short(&mut sheet, &known);
    sheet.figure(
        "s5: effects named over those of a shop's programme of the same minutes",
        AtLeast(TARGET_RATIO),
        ratio.and_then(Ratio::value),
        ratio.map_or(0, |ratio| ratio.machines),
    );
    of_wrong_names(&mut sheet, "s6", &left_out, 0.15);
    let (value, n) = area(&isolable(&left_out), &known);
    sheet.figure(
        "s6: AUROC of unknown beside s5, D > 10, isolable classes",
        AtLeast(0.97),
        value,
        n,
    );
    sheet.share(
        "s7: open after round one, exact after round two",
        AtLeast(0.85),
        opened(&of(Arm::DesignedTwoRounds), |_| true).into_iter(),
    );
    of_sizes_and_gaps(&mut sheet, &known);
    sheet.0
}

fn of_nothing(sheet: &mut Sheet, known: &[&Verdict]) {
    let empty = || known.iter().filter(|v| v.truth.effects.is_empty());
    sheet.share(
        "s5: nothing hidden, any cause named",
        AtMost(0.005),
        empty().map(|v| has_name(v)),
    );
    sheet.share(
        "s5: nothing hidden, any alarm, unknown included",
        AtMost(0.02),
        empty().map(|v| has_name(v) || v.is_flagged()),
    );
}

/// Of the shorter programme.
fn of_short(sheet: &mut Sheet, known: &[&Verdict]) {
    let [minutes, _] = PROGRAMME_MIN;
    let is_short = |v: &&&Verdict| {
        let programme = v.truth.designed;
        programme.is_some_and(|programme| (programme.minutes - minutes).abs() < 0.5)
    };
    let short: Vec<&Verdict> = known.iter().filter(is_short).copied().collect();
    let arm = format!("s5, {minutes} min");
    let _ = of_sets_of(sheet, &arm, &short);
    sheet.limit(
        &format!("{arm}: D named in 95 %, all classes together"),
        10.0,
        limit(&short, None),
        short.len(),
    );
}

fn of_sizes_and_gaps(sheet: &mut Sheet, known: &[&Verdict]) {
    let large = beyond(known, MIN_D_OF_FOREIGN);
    sheet.middle(
        "s5: gap closed over that of an oracle, median, D > 20",
        AtLeast(0.98),
        large.iter().filter_map(|v| v.closed_of_oracle()).collect(),
    );
    sheet.share(
        "s5: 95 % intervals that hold the parameter, D > 20",
        Within(0.92, 0.98),
        sized(known).iter().map(|(_, covered)| *covered),
    );
    sheet.share(
        "s5: intervals of the gap closed that hold it on later runs",
        Within(0.92, 0.98),
        later_held(known.iter()),
    );
}

#[cfg(test)]
mod tests {
    use gap_diagnosis::report::Status;

    use super::*;
    use crate::designed::DesignedTruth;
    use crate::effect::Class;
    use crate::sample::{cause, effect, verdict};
    use crate::verdict::{SaidCause, Second};

    fn judged(arm: Arm, minutes: f64, d: f64, causes: Vec<SaidCause>) -> Verdict {
        let mut verdict = verdict(vec![effect(Class::Backlash, "X", d)], causes, false);
        verdict.truth.arm = arm;
        verdict.truth.designed = Some(DesignedTruth {
            minutes,
            used_min: minutes,
            is_foreign: false,
            is_small: false,
        });
        verdict
    }

    fn play() -> Vec<SaidCause> {
        vec![cause("backlash", "X", Status::Named, 4.0)]
    }

    fn told(verdicts: &[Verdict], ratio: Option<Ratio>, metric: &str) -> (String, usize) {
        let all = of_designed(verdicts, ratio);
        let found = all.iter().find(|target| target.metric == metric).unwrap();
        let value = found
            .value
            .map_or("-".to_owned(), |value| format!("{value:.3}"));
        (value, found.n)
    }

    #[test]
    fn without_trials_nothing_is_met_and_nothing_missed() {
        let all = of_designed(&[], None);
        assert_eq!(all.len(), 13);
        assert!(all.iter().all(|target| target.met.is_none()), "{all:#?}");
    }

    #[test]
    fn targets_of_twenty_minutes_count_no_longer_programme() {
        let arm = Arm::Designed;
        let all = [
            judged(arm, 20.0, 12.0, play()),
            judged(arm, 20.0, 9.0, vec![]),
            judged(arm, 40.0, 30.0, vec![]),
        ];
        let exact = told(&all, None, "s5, 20 min: 1 effect, D > 10, exact");
        assert_eq!(exact, ("1.000".to_owned(), 1));
    }

    #[test]
    fn a_ratio_is_of_the_other_journal_and_met_from_its_target_on() {
        let metric = "s5: effects named over those of a shop's programme of the same minutes";
        let ratio = |designed, shop| Ratio {
            machines: 8,
            minutes: 60.0,
            designed,
            shop,
        };
        assert_eq!(
            told(&[], Some(ratio(12, 8)), metric),
            ("1.500".to_owned(), 8)
        );
        assert_eq!(told(&[], Some(ratio(3, 0)), metric), ("-".to_owned(), 8));
        let met = |ratio| {
            of_designed(&[], Some(ratio))
                .iter()
                .find_map(|target| target.met)
        };
        assert_eq!(met(ratio(12, 8)), Some(true));
        assert_eq!(met(ratio(11, 8)), Some(false));
    }

    #[test]
    fn a_second_round_that_is_refused_decides_nothing() {
        let arm = Arm::DesignedTwoRounds;
        let second = |said: Option<Vec<SaidCause>>| {
            let mut open = judged(arm, 20.0, 30.0, vec![]);
            open.second = Some(Second {
                run: String::new(),
                separates: vec![],
                delta: 0.0,
                said: said.and_then(|causes| verdict(vec![], causes, false).said),
                refused: None,
            });
            open
        };
        let all = [
            second(Some(play())),
            second(None),
            judged(arm, 20.0, 30.0, vec![]),
            judged(arm, 20.0, 30.0, play()),
        ];
        let metric = "s7: open after round one, exact after round two";
        assert_eq!(told(&all, None, metric), ("0.500".to_owned(), 2));
    }

    #[test]
    fn wrong_names_of_a_class_that_is_left_out_are_of_large_effects() {
        let wrong = |d: f64| {
            let causes = vec![cause("reversal_spike", "X", Status::Named, 1.0)];
            let mut verdict = judged(Arm::DesignedLeftOut, 20.0, d, causes);
            verdict.truth.left_out = Some("backlash".to_owned());
            verdict
        };
        let all = [wrong(30.0), wrong(12.0), wrong(25.0)];
        let metric = "s6: wrong cause named, D > 20";
        assert_eq!(told(&all, None, metric), ("1.000".to_owned(), 2));
    }
}
