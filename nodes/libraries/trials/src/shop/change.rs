//! What changes during a shift beside the change points of a report.
//!
//! A change at once is found where a change point begins with a run within one test cycle of it; one that goes on for a while
//! where one lies in that while, or where the report says that the effect grows. A change point of another effect's name does
//! not count.

use gap_diagnosis::GapReport;
use serde::{Deserialize, Serialize};

use super::truth::{Name, ShiftTruth, ShopEffect, TrueChange};
use crate::verdict::Verdict;

/// A change that a report has.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReportedChange {
    /// The first run after it; none of what grows evenly.
    pub from_run: Option<u32>,
    /// The named effect that changes; none where nothing is named.
    pub effect: Option<Name>,
}

/// The change points of a report, and what it says to grow.
pub(super) fn changes_of(report: &GapReport) -> Vec<ReportedChange> {
    let unnamed = report.does_not_repeat.iter().map(|own| ReportedChange {
        from_run: Some(own.from_run),
        effect: None,
    });
    let named = report.over_session.iter().flat_map(|own| {
        let of = |from_run: Option<u32>| ReportedChange {
            from_run,
            effect: Some((own.effect.clone(), own.axis.clone())),
        };
        let steps = [own.from_run, own.changes_from_run];
        let grows = own.growth_share_per_h.map(|_| of(None));
        steps
            .into_iter()
            .flatten()
            .map(move |run| of(Some(run)))
            .chain(grows)
            .collect::<Vec<_>>()
    });
    unnamed.chain(named).collect()
}

impl TrueChange {
    /// Whether an instant is within one test cycle of it.
    fn is_near(&self, at_s: f64) -> bool {
        let until_s = self.until_s.unwrap_or(self.from_s);
        (self.from_s - self.cycle_s..=until_s + self.cycle_s).contains(&at_s)
    }

    fn is(&self, reported: &ReportedChange, effect: &ShopEffect, shift: &ShiftTruth) -> bool {
        let is_own = |name: &Name| {
            effect.has_name(name)
                || effect.besides.contains(name)
                || effect.same_readings.contains(name)
        };
        if !reported.effect.as_ref().is_none_or(is_own) {
            return false;
        }
        match reported.from_run {
            None => self.until_s.is_some(),
            Some(run) => {
                let mut runs = shift.runs_s.iter();
                runs.any(|(own, at_s)| *own == run && self.is_near(*at_s))
            }
        }
    }
}

/// Changes of a shift with their effects and whether the report has each with its time.
pub(super) fn reported(verdict: &Verdict) -> Vec<(&TrueChange, &ShopEffect, bool)> {
    let Some(truth) = &verdict.truth.shop else {
        return vec![];
    };
    let Some(shift) = &truth.shift else {
        return vec![];
    };
    let of = |change| -> Option<(&TrueChange, &ShopEffect, bool)> {
        let change: &TrueChange = change;
        let effect = truth.effects.get(change.effect)?;
        let mut answers = verdict.shop.iter().flat_map(|answer| &answer.changes);
        Some((
            change,
            effect,
            answers.any(|own| change.is(own, effect, shift)),
        ))
    };
    shift.changes.iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::super::truth::name;
    use super::*;

    fn effect() -> ShopEffect {
        ShopEffect {
            what: "lost motion steps up".to_owned(),
            names: vec![name("backlash", "X")],
            besides: vec![],
            same_readings: vec![],
            size: 4.0,
            unit: "µm".to_owned(),
            d: 60.0,
            d_alone: 60.0,
            follow: None,
        }
    }

    /// Blocks every twenty minutes: runs 3, 5, 7 begin at 1200, 2400 and 3600 s.
    fn shift() -> ShiftTruth {
        ShiftTruth {
            runs_s: vec![(3, 1200.0), (5, 2400.0), (7, 3600.0), (9, 4800.0)],
            changes: vec![],
        }
    }

    fn at(run: Option<u32>, effect: Option<&str>) -> ReportedChange {
        ReportedChange {
            from_run: run,
            effect: effect.map(|id| name(id, "X")),
        }
    }

    #[test]
    fn a_step_is_found_within_one_test_cycle_and_under_its_own_name_or_none() {
        let step = TrueChange {
            effect: 0,
            from_s: 2000.0,
            until_s: None,
            cycle_s: 1200.0,
        };
        let is = |reported: &ReportedChange| step.is(reported, &effect(), &shift());
        for run in [3, 5] {
            assert!(is(&at(Some(run), None)) && is(&at(Some(run), Some("backlash"))));
        }
        assert!(!is(&at(Some(7), None)), "1600 s later");
        assert!(!is(&at(Some(5), Some("homing_shift"))));
        assert!(!is(&at(Some(6), None)), "no such run");
        assert!(!is(&at(None, Some("backlash"))), "a growth is no step");
    }

    #[test]
    fn what_goes_on_for_a_while_is_found_anywhere_in_it_or_as_a_growth() {
        let drift = TrueChange {
            effect: 0,
            from_s: 2500.0,
            until_s: Some(3500.0),
            cycle_s: 600.0,
        };
        let is = |reported: &ReportedChange| drift.is(reported, &effect(), &shift());
        assert!(is(&at(Some(5), None)) && is(&at(Some(7), None)));
        assert!(!is(&at(Some(3), None)) && !is(&at(Some(9), None)));
        assert!(is(&at(None, Some("backlash"))) && !is(&at(None, Some("scale_error"))));
    }
}
