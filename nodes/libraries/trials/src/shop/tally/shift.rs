//! Figures of arm s4 alone: instants, intervals, the gap that is closed, time.

use super::super::judge::{has_instant, holds_size};
use super::super::truth::ShopEffect;
use super::{Judged, Line, Middle, effects};
use crate::detection::MIN_D_TO_FIND;
use crate::proportion::Proportion;

/// Ends of the share of 95 % intervals that should hold.
const HOLDING: [f64; 2] = [0.92, 0.98];
/// Least gap closed over that of an oracle.
const MIN_CLOSED_OF_ORACLE: f64 = 0.95;
/// Longest time of a diagnosis, median, s.
const MAX_TIME_S: f64 = 5.0;

/// Instants of changes, and intervals.
pub(super) fn lines(answered: &[Judged<'_>]) -> [Line; 4] {
    let each = |fits: &dyn Fn(&ShopEffect) -> bool| {
        let changed = answered.iter().flat_map(|(verdict, truth)| {
            let times = truth.shift.as_ref()?;
            let own = truth.effects.iter().filter(|effect| {
                effect.change.is_some() && effect.d > MIN_D_TO_FIND && fits(effect)
            });
            Some(own.map(|effect| has_instant(verdict, times, effect)))
        });
        Proportion::of(changed.flatten())
    };
    let sized = effects(answered).into_iter();
    let sized = sized.filter_map(|(verdict, effect)| holds_size(verdict, effect));
    let closed = answered.iter().filter_map(|(verdict, _)| {
        let [_, low, high] = verdict.said.as_ref()?.closed?;
        Some((low..=high).contains(&verdict.later_closed?))
    });
    [
        Line::of(
            "D above 20: a change with its instant, within a test cycle",
            each(&|_| true),
            Some(0.85),
            true,
        ),
        Line::of(
            "of these: changes of what the catalogue has",
            each(&|effect| !effect.names.is_empty()),
            None,
            true,
        ),
        Line::within(
            "95 % intervals that hold the parameter",
            Proportion::of(sized),
            HOLDING,
        ),
        Line::within(
            "95 % intervals of the gap closed that hold it on the shift once more",
            Proportion::of(closed),
            HOLDING,
        ),
    ]
}

/// The gap closed, and time.
pub(super) fn middles(answered: &[Judged<'_>]) -> Vec<Middle> {
    let hidden = answered.iter().filter(|(_, truth)| {
        let least = truth.effects.iter().map(|effect| effect.d).reduce(f64::min);
        least.is_some_and(|d| d > MIN_D_TO_FIND)
    });
    let closed = hidden.filter_map(|(verdict, _)| verdict.closed_of_oracle());
    let times = answered.iter().map(|(verdict, _)| verdict.diagnosis_s);
    vec![
        Middle::of(
            "gap closed over that of an oracle, all effects above D 20",
            closed.collect(),
            MIN_CLOSED_OF_ORACLE,
            true,
        ),
        Middle::of(
            "time of a diagnosis with reading its bag, s",
            times.collect(),
            MAX_TIME_S,
            false,
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::Arm;
    use crate::sample::verdict;
    use crate::shop::{Answer, Change, Reported, ShiftTimes, ShopTally, ShopTruth};
    use crate::verdict::Verdict;

    fn slipped(d: f64, told: Option<u32>, later_closed: f64) -> Verdict {
        let mut verdict = verdict(vec![], vec![], true);
        verdict.truth.arm = Arm::ShopShift;
        verdict.later_closed = Some(later_closed);
        verdict.truth.shop = Some(ShopTruth {
            session: String::new(),
            layout: String::new(),
            repeats: 1,
            places: 1,
            effects: vec![ShopEffect {
                what: "clamp that slips".to_owned(),
                names: vec![],
                besides: vec![],
                same_readings: vec![],
                size: 4.0,
                unit: "µm".to_owned(),
                d,
                d_alone: d,
                follow: None,
                parameter: None,
                change: Some(Change {
                    at_s: 3000.0,
                    between_s: [2000.0, 4000.0],
                }),
            }],
            white_um: 0.2,
            between_runs_um: 0.1,
            memory: 0.0,
            shift: Some(ShiftTimes {
                begins_s: vec![(4, 2000.0), (6, 4000.0), (8, 9000.0)],
                cycle_s: 2000.0,
            }),
        });
        let reported = |run| Reported {
            effect: None,
            run,
            of_set_up: false,
        };
        verdict.shop = Some(Answer {
            changes: told.into_iter().map(reported).collect(),
            ..Answer::default()
        });
        verdict
    }

    #[test]
    fn instants_of_large_changes_and_intervals_of_the_gap_are_counted() {
        let all = [
            slipped(40.0, Some(6), 0.99),
            slipped(40.0, Some(8), 0.5),
            slipped(40.0, None, 0.99),
            slipped(8.0, Some(6), 0.99),
        ];
        let tally = ShopTally::of(Arm::ShopShift, &all);
        let count = |what: &str| {
            let line = tally.line(what).unwrap();
            [line.count.k, line.count.n]
        };
        assert_eq!(
            count("D above 20: a change with its instant, within a test cycle"),
            [1, 3]
        );
        assert_eq!(count("of these: changes of what the catalogue has"), [0, 0]);
        assert_eq!(
            count("95 % intervals of the gap closed that hold it on the shift once more"),
            [3, 4]
        );
        assert_eq!(tally.middles[1].is_met(), Some(true));
        assert_eq!(tally.middles[1].n, 4);
    }

    #[test]
    fn a_range_is_missed_from_above_too() {
        let line = |k, n| Line::within("held", Proportion { k, n }, HOLDING);
        assert_eq!(line(9500, 10_000).verdict(), "met");
        assert_eq!(line(9990, 10_000).verdict(), "missed");
        assert_eq!(line(8000, 10_000).verdict(), "missed");
        assert_eq!(line(19, 20).verdict(), "open");
    }
}
