//! The answer to a shop's session beside its truth.
//!
//! Where two effects make the same readings, the only right answer is a set with both; a single name is wrong there, even if
//! it is the truth's.

use gap_diagnosis::GapReport;
use gap_diagnosis::report::Status;
use serde::{Deserialize, Serialize};

use super::truth::{Follow, Name, ShiftTimes, ShopEffect, ShopTruth};
use crate::verdict::{SaidCause, Verdict};

/// Tests of one visit begin within this time, s.
const SAME_VISIT_S: f64 = 1800.0;

/// What an answer has beside its causes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Answer {
    /// Changes between repeats that no name explains.
    pub does_not_repeat: usize,
    /// Thermometers that the log goes with, by the page's remark.
    pub follows: Vec<Follow>,
    /// First runs of which the report says that something began or changed there.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub changes: Vec<Reported>,
}

/// A run at which something is reported to change.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reported {
    /// The named effect that does; none of a change without a name.
    pub effect: Option<Name>,
    /// The first run after it.
    pub run: u32,
    /// Whether it is reported as the place of a set-up or a reference point.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub of_set_up: bool,
}

/// What a report and its page add to the causes.
#[must_use]
pub fn answer(report: &GapReport, page: &str) -> Answer {
    Answer {
        does_not_repeat: report.does_not_repeat.len(),
        follows: follows_in(page),
        changes: changes(report),
    }
}

/// Runs from which on something is reported to be there, to be another, or not to repeat.
fn changes(report: &GapReport) -> Vec<Reported> {
    let named = report.over_session.iter().flat_map(|own| {
        let effect = Some((own.effect.clone(), own.axis.clone()));
        let runs = [own.from_run, own.changes_from_run].into_iter().flatten();
        runs.map(move |run| Reported {
            effect: effect.clone(),
            run,
            of_set_up: false,
        })
    });
    let nameless = report.does_not_repeat.iter().filter(|own| !own.evenly);
    let nameless = nameless.map(|own| Reported {
        effect: None,
        run: own.from_run,
        of_set_up: own.of_set_up,
    });
    named.chain(nameless).collect()
}

/// Thermometers in the remarks of a page.
#[must_use]
pub fn follows_in(page: &str) -> Vec<Follow> {
    // People read another sign than numbers are written with.
    let page = page.replace('\u{2212}', "-");
    let remarks = page.lines().filter_map(|line| {
        let (channel, rest) = line.split_once(" goes with ")?;
        let is_remark = !channel.trim().contains(' ') && rest.contains("µm/K");
        is_remark.then(|| rest.split_once(": ").map_or(rest, |(terms, _)| terms))
    });
    remarks
        .flat_map(|terms| terms.split(", and with ").filter_map(follow))
        .collect()
}

/// `rear lagged by 44.4 min, 1.20 µm/K`, or `table without a lag, -3.2 µm/K`.
fn follow(term: &str) -> Option<Follow> {
    let (thermometer, rest) = term.split_once(' ')?;
    let (lag, size) = rest.split_once(", ")?;
    let lag_min = match lag.strip_prefix("lagged by ") {
        Some(lag) => lag.strip_suffix(" min")?.parse().ok()?,
        None => 0.0,
    };
    Some(Follow {
        thermometer: thermometer.to_owned(),
        lag_min,
        um_per_k: size.strip_suffix(" µm/K")?.parse().ok()?,
    })
}

/// What a named cause is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Call {
    /// The name of a hidden effect, which nothing imitates.
    Right,
    /// A set with a hidden effect, and with what imitates it where something does.
    InSet,
    /// True beside a hidden effect.
    Beside,
    /// The name of a hidden effect alone, although others make the same readings.
    TooSure,
    /// Neither.
    Wrong,
}

impl Call {
    /// Whether it counts as a wrong name.
    #[must_use]
    pub const fn is_wrong(self) -> bool {
        matches!(self, Self::TooSure | Self::Wrong)
    }
}

/// All that a cause may be by its own words.
fn members(cause: &SaidCause) -> Vec<Name> {
    let mut all = vec![(cause.effect.clone(), cause.axis.clone())];
    if cause.status == Status::Set {
        all.extend(cause.rivals.iter().cloned());
    }
    all
}

/// A named cause as the call that one hidden effect makes of it.
fn call_by(cause: &SaidCause, effect: &ShopEffect) -> Call {
    let members = members(cause);
    let leads = effect.has_name(&members[0]);
    let holds = members.iter().any(|member| effect.has_name(member));
    let has_same = members
        .iter()
        .any(|member| effect.same_readings.contains(member));
    match (effect.same_readings.is_empty(), holds) {
        (true, true) if leads => Call::Right,
        (true, true) => Call::InSet,
        (false, true) if has_same => Call::InSet,
        (false, true) => Call::TooSure,
        (_, false) if effect.besides.contains(&members[0]) => Call::Beside,
        (_, false) => Call::Wrong,
    }
}

/// What a named cause is: the best that a hidden effect makes of it.
#[must_use]
pub fn call(cause: &SaidCause, truth: &ShopTruth) -> Call {
    let calls: Vec<Call> = truth
        .effects
        .iter()
        .map(|effect| call_by(cause, effect))
        .collect();
    let best = [Call::Right, Call::InSet, Call::Beside, Call::TooSure];
    let found = best.into_iter().find(|call| calls.contains(call));
    found.unwrap_or(Call::Wrong)
}

/// Wrong names of a verdict, with what each is.
pub fn wrong_names(verdict: &Verdict) -> Vec<(Name, Call)> {
    let Some(truth) = &verdict.truth.shop else {
        return vec![];
    };
    let called = verdict.named().map(|cause| (cause, call(cause, truth)));
    called
        .filter(|(_, call)| call.is_wrong())
        .map(|(cause, call)| ((cause.effect.clone(), cause.axis.clone()), call))
        .collect()
}

/// Whether a hidden effect was found as far as the session can tell it: by its name, or in the set.
pub fn is_found(verdict: &Verdict, effect: &ShopEffect) -> bool {
    is_found_by_name(verdict, effect) || is_reported_as_set_up(verdict, effect)
}

/// Name of a reference point that shifts.
const REFERENCE: &str = "homing_shift";

/// Whether a shift of a reference point, which other effects imitate, is reported with its instant as one of a reference point
/// or of what is touched: that is a set as well.
fn is_reported_as_set_up(verdict: &Verdict, effect: &ShopEffect) -> bool {
    let is_reference = effect.names.iter().any(|(id, _)| id == REFERENCE);
    let (Some(truth), Some(answer), Some(change)) =
        (&verdict.truth.shop, &verdict.shop, &effect.change)
    else {
        return false;
    };
    is_reference
        && !effect.is_resolvable()
        && answer.changes.iter().any(|own| {
            let begin_s = truth
                .shift
                .as_ref()
                .and_then(|times| times.begin_s(own.run));
            let [before_s, after_s] = change.between_s;
            own.of_set_up && begin_s.is_some_and(|at_s| before_s < at_s && at_s <= after_s)
        })
}

fn is_found_by_name(verdict: &Verdict, effect: &ShopEffect) -> bool {
    let wanted = if effect.is_resolvable() {
        Call::Right
    } else {
        Call::InSet
    };
    verdict
        .named()
        .any(|cause| call_by(cause, effect) == wanted)
}

/// Whether there was any alarm.
pub fn has_alarm(verdict: &Verdict) -> bool {
    let does_not_repeat = verdict
        .shop
        .as_ref()
        .is_some_and(|answer| answer.does_not_repeat > 0);
    verdict.named().next().is_some() || verdict.is_flagged() || does_not_repeat
}

/// Parameters of the catalogue that are instants, min since the first state.
const INSTANT: &str = "at_min";

/// Whether the report gives the instant of a change: within a test cycle, or between the tests about it that show it.
///
/// A change without a name counts for every effect, one of a named effect for that effect and what makes the same readings.
pub fn has_instant(verdict: &Verdict, times: &ShiftTimes, effect: &ShopEffect) -> bool {
    let Some(change) = &effect.change else {
        return false;
    };
    let is_of = |own: &Name| effect.has_name(own) || effect.same_readings.contains(own);
    let runs = { verdict.shop.iter() }
        .flat_map(|answer| &answer.changes)
        .filter(|own| own.effect.as_ref().is_none_or(is_of))
        .filter_map(|own| times.begin_s(own.run));
    let stated = verdict
        .named()
        .filter(|cause| members(cause).iter().any(is_of));
    let stated = stated.flat_map(|cause| &cause.parameters);
    let stated = stated.filter(|(name, ..)| name == INSTANT);
    let stated = stated.map(|(_, at_min, ..)| 60.0 * at_min);
    let is_near = |at_s: f64| {
        let [before_s, after_s] = change.between_s;
        let is_between = before_s < at_s && at_s <= after_s + SAME_VISIT_S;
        is_between || (at_s - change.at_s).abs() <= times.cycle_s
    };
    runs.chain(stated).any(is_near)
}

/// Whether the interval of an effect's parameter holds its size; none where there is no interval.
pub fn holds_size(verdict: &Verdict, effect: &ShopEffect) -> Option<bool> {
    let (name, size) = effect.parameter.as_ref()?;
    let is_own = |cause: &&SaidCause| {
        let own = (cause.effect.clone(), cause.axis.clone());
        effect.has_name(&own)
    };
    let cause = verdict.named().find(is_own)?;
    // Where shares of it have forms of their own, the sum is the size.
    let find = |name: &str| cause.parameters.iter().find(|(own, ..)| own == name);
    let (_, _, low, high) = find(&format!("whole_{name}")).or_else(|| find(name))?;
    Some((*low..=*high).contains(size))
}

/// Relative errors of lag and growth that the page reports for a hidden effect.
pub fn followed(verdict: &Verdict, effect: &ShopEffect) -> Option<[f64; 2]> {
    let right = effect.follow.as_ref()?;
    let mut found = verdict.shop.iter().flat_map(|answer| &answer.follows);
    let own = found.find(|follow| follow.thermometer == right.thermometer)?;
    Some([
        own.lag_min / right.lag_min - 1.0,
        own.um_per_k / right.um_per_k - 1.0,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::cause;
    use crate::shop::truth::{Change, name};

    fn play(same_readings: Vec<Name>) -> ShopTruth {
        ShopTruth {
            session: String::new(),
            layout: String::new(),
            repeats: 5,
            places: 11,
            effects: vec![ShopEffect {
                what: "lost motion".to_owned(),
                names: vec![name("backlash", "X")],
                besides: vec![name("scale_error", "X")],
                same_readings,
                size: 5.0,
                unit: "µm".to_owned(),
                d: 40.0,
                d_alone: 40.0,
                follow: None,
                parameter: None,
                change: None,
            }],
            white_um: 0.2,
            between_runs_um: 0.1,
            memory: 0.0,
            shift: None,
        }
    }

    #[test]
    fn a_single_name_is_wrong_where_another_effect_reads_the_same() {
        let own = cause("backlash", "X", Status::Named, 5.0);
        assert_eq!(call(&own, &play(vec![])), Call::Right);
        let truth = play(vec![name("feed_lost_motion", "X")]);
        assert_eq!(call(&own, &truth), Call::TooSure);
        let mut set = cause("backlash", "X", Status::Set, 5.0);
        assert_eq!(call(&set, &truth), Call::TooSure);
        set.rivals = vec![name("feed_lost_motion", "X")];
        assert_eq!(call(&set, &truth), Call::InSet);
        assert_eq!(call(&set, &play(vec![])), Call::Right);
        let other = cause("cyclic_error", "X", Status::Named, 5.0);
        assert_eq!(call(&other, &truth), Call::Wrong);
        let slope = cause("scale_error", "X", Status::Named, 5.0);
        assert_eq!(call(&slope, &truth), Call::Beside);
    }

    fn shift() -> ShiftTimes {
        ShiftTimes {
            begins_s: vec![
                (3, 100.0),
                (7, 1500.0),
                (9, 2900.0),
                (12, 7200.0),
                (15, 14_000.0),
            ],
            cycle_s: 1400.0,
        }
    }

    fn answered(causes: Vec<SaidCause>, changes: Vec<Reported>) -> Verdict {
        let mut verdict = crate::sample::verdict(vec![], causes, false);
        verdict.shop = Some(Answer {
            changes,
            ..Answer::default()
        });
        verdict
    }

    #[test]
    fn a_reference_that_shifts_is_found_as_a_set_up_or_a_reference_point_at_its_instant() {
        let mut effect = play(vec![]).effects.remove(0);
        effect.names = vec![name("homing_shift", "X")];
        effect.same_readings = vec![name("coolant", "X")];
        effect.change = Some(Change {
            at_s: 1700.0,
            between_s: [1500.0, 2900.0],
        });
        let mut truth = play(vec![]);
        truth.shift = Some(shift());
        let is_found_with = |run: u32, of_set_up: bool, effect: &ShopEffect| {
            let own = Reported {
                effect: None,
                run,
                of_set_up,
            };
            let mut verdict = answered(vec![], vec![own]);
            verdict.truth.shop = Some(truth.clone());
            is_found(&verdict, effect)
        };
        assert!(is_found_with(9, true, &effect));
        assert!(
            !is_found_with(9, false, &effect),
            "a change, of what is open"
        );
        assert!(!is_found_with(12, true, &effect), "another instant");
        effect.same_readings = vec![];
        assert!(!is_found_with(9, true, &effect), "it has a name here");
    }

    #[test]
    fn an_instant_is_right_within_a_cycle_or_between_the_tests_that_show_it() {
        let mut effect = play(vec![]).effects.remove(0);
        effect.change = Some(Change {
            at_s: 1700.0,
            between_s: [1500.0, 2900.0],
        });
        let run = |effect: Option<Name>, run: u32| {
            let of_set_up = false;
            vec![Reported {
                effect,
                run,
                of_set_up,
            }]
        };
        let has = |changes| has_instant(&answered(vec![], changes), &shift(), &effect);
        assert!(has(run(None, 9)) && has(run(Some(name("backlash", "X")), 9)));
        assert!(!has(run(Some(name("backlash", "Y")), 9)), "another axis");
        assert!(!has(run(None, 12)) && !has(run(None, 3)) && !has(vec![]));
        // What circles alone show lies between two of their visits.
        effect.change = Some(Change {
            at_s: 3000.0,
            between_s: [100.0, 7200.0],
        });
        let has = |changes| has_instant(&answered(vec![], changes), &shift(), &effect);
        assert!(has(run(None, 12)) && !has(run(None, 15)));
        let mut stated = cause("backlash", "X", Status::Named, 5.0);
        stated.parameters = vec![("at_min".to_owned(), 51.0, 48.0, 54.0)];
        assert!(has_instant(
            &answered(vec![stated.clone()], vec![]),
            &shift(),
            &effect
        ));
        stated.parameters[0].1 = 230.0;
        assert!(!has_instant(
            &answered(vec![stated], vec![]),
            &shift(),
            &effect
        ));
    }

    #[test]
    fn an_interval_holds_a_size_or_not_and_is_absent_of_what_was_not_named() {
        let mut effect = play(vec![]).effects.remove(0);
        effect.parameter = Some(("width_um".to_owned(), 5.1));
        let own = |value: f64| {
            let cause = cause("backlash", "X", Status::Named, value);
            holds_size(&answered(vec![cause], vec![]), &effect)
        };
        assert_eq!(own(5.0), Some(true));
        assert_eq!(own(5.5), Some(false));
        assert_eq!(holds_size(&answered(vec![], vec![]), &effect), None);
    }

    #[test]
    fn remarks_of_thermometers_are_read_and_tables_are_not() {
        let page = "length.Z goes with rear lagged by 44.4 min, 1.20 µm/K, and with bed without a lag, −3.2 µm/K: on runs\n\
            most of it is in length.Z and goes with time; 3 µm/K\n";
        let found = follows_in(page);
        assert_eq!(found.len(), 2);
        assert_eq!(found[0].thermometer, "rear");
        assert!((found[0].lag_min - 44.4).abs() < 1e-12 && found[1].lag_min.abs() < 1e-12);
        assert!((found[1].um_per_k + 3.2).abs() < 1e-12);
    }
}
