//! All verdicts of a shop's arm as figures with their intervals.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::judge::{Call, followed, has_alarm, is_found, wrong_names};
use super::truth::{ShopEffect, ShopTruth};
use crate::arm::Arm;
use crate::detection::{MIN_D_TO_FIND, by_d, size_to_find};
use crate::proportion::{Proportion, median};
use crate::verdict::Verdict;

mod shift;

/// Edge between little and much noise that neighbouring readings share.
const MUCH_MEMORY: f64 = 0.5;
/// Errors of lag and growth that are allowed.
const MAX_LAG_ERROR: f64 = 0.25;
const MAX_GROWTH_ERROR: f64 = 0.10;

/// One figure beside its target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// What is counted.
    pub what: String,
    /// How often.
    pub count: Proportion,
    /// Its 95 % interval.
    pub interval: [f64; 2],
    /// The target, a share.
    pub target: Option<f64>,
    /// Whether more is better.
    pub is_high: bool,
    /// The greatest share, where the target is a range.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most: Option<f64>,
}

/// A middle value beside its target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Middle {
    /// What it is.
    pub what: String,
    /// The median; none where nothing was measured.
    pub value: Option<f64>,
    /// Of how many.
    pub n: usize,
    /// The target.
    pub target: f64,
    /// Whether more is better.
    pub is_high: bool,
}

impl Middle {
    fn of(what: &str, values: Vec<f64>, target: f64, is_high: bool) -> Self {
        Self {
            what: what.to_owned(),
            n: values.len(),
            value: median(values),
            target,
            is_high,
        }
    }

    /// Whether the target is met; none where nothing was measured.
    #[must_use]
    pub fn is_met(&self) -> Option<bool> {
        let value = self.value?;
        Some(if self.is_high {
            value >= self.target
        } else {
            value <= self.target
        })
    }
}

impl Line {
    fn of(what: &str, count: Proportion, target: Option<f64>, is_high: bool) -> Self {
        Self {
            what: what.to_owned(),
            count,
            interval: count.wilson(),
            target,
            is_high,
            most: None,
        }
    }

    /// Shares between two ends are met.
    fn within(what: &str, count: Proportion, [least, most]: [f64; 2]) -> Self {
        Self {
            most: Some(most),
            ..Self::of(what, count, Some(least), true)
        }
    }

    /// Met, missed, open (the interval holds the target) or, where nothing was counted, no word.
    #[must_use]
    pub fn verdict(&self) -> &'static str {
        let (Some(share), Some(target)) = (self.count.share(), self.target) else {
            return "";
        };
        let is_met = if self.is_high {
            share >= target
        } else {
            share <= target
        };
        let is_met = is_met && self.most.is_none_or(|most| share <= most);
        let is_inside = |edge: &f64| (self.interval[0]..=self.interval[1]).contains(edge);
        let holds = is_inside(&target) || self.most.as_ref().is_some_and(is_inside);
        match (is_met, holds) {
            (_, true) => "open",
            (true, false) => "met",
            (false, false) => "missed",
        }
    }
}

/// Sessions or effects of one kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Split {
    /// Which.
    pub what: String,
    /// Found below D 10, from 10 to 20, and above.
    pub found: [Proportion; 3],
    /// Sessions with a wrong name.
    pub wrong: Proportion,
    /// Size that has D 20 in the middle session, with its unit.
    pub size_of_d_20: Option<(f64, String)>,
}

/// The table of one arm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShopTally {
    /// The arm.
    pub arm: Arm,
    /// Sessions.
    pub trials: usize,
    /// Figures with targets.
    pub lines: Vec<Line>,
    /// By kind of the hidden effect.
    pub kinds: Vec<Split>,
    /// By session, layout, repeats.
    pub splits: Vec<(String, Vec<Split>)>,
    /// Wrong names, the most frequent first.
    pub wrong: Vec<(String, usize)>,
    /// Refusals with how often.
    pub refused: Vec<(String, usize)>,
    /// Median and longest time of a diagnosis, s.
    pub times_s: [Option<f64>; 2],
    /// Middle values with targets.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub middles: Vec<Middle>,
}

/// A verdict with its truth.
type Judged<'v> = (&'v Verdict, &'v ShopTruth);

impl ShopTally {
    /// Tallies the verdicts of one arm.
    #[must_use]
    pub fn of(arm: Arm, verdicts: &[Verdict]) -> Self {
        let own = verdicts.iter().filter(|verdict| verdict.truth.arm == arm);
        let all: Vec<Judged<'_>> = own
            .filter_map(|v| Some((v, v.truth.shop.as_ref()?)))
            .collect();
        let answered: Vec<Judged<'_>> = { all.iter() }
            .copied()
            .filter(|(verdict, _)| verdict.said.is_some())
            .collect();
        let times: Vec<f64> = answered
            .iter()
            .map(|(verdict, _)| verdict.diagnosis_s)
            .collect();
        Self {
            arm,
            trials: all.len(),
            lines: lines(arm, &all, &answered),
            kinds: kinds(&answered),
            splits: splits(&answered),
            wrong: counted(
                answered
                    .iter()
                    .flat_map(|(verdict, truth)| wrong_words(verdict, truth)),
            ),
            refused: counted(
                all.iter()
                    .filter_map(|(verdict, _)| verdict.refused.clone()),
            ),
            middles: if arm == Arm::ShopShift {
                shift::middles(&answered)
            } else {
                vec![]
            },
            times_s: [median(times.clone()), times.into_iter().reduce(f64::max)],
        }
    }

    /// A figure by what it counts.
    #[must_use]
    pub fn line(&self, what: &str) -> Option<&Line> {
        self.lines.iter().find(|line| line.what == what)
    }
}

fn has_wrong(verdict: &Verdict) -> bool {
    !wrong_names(verdict).is_empty()
}

fn effects<'v>(answered: &[Judged<'v>]) -> Vec<(&'v Verdict, &'v ShopEffect)> {
    let of = |(verdict, truth): &Judged<'v>| {
        let verdict = *verdict;
        truth.effects.iter().map(move |effect| (verdict, effect))
    };
    answered.iter().flat_map(of).collect()
}

/// An effect with the verdict on its session.
type Effect<'v> = (&'v Verdict, &'v ShopEffect);

/// The figures of the protocol.
fn lines(arm: Arm, all: &[Judged<'_>], answered: &[Judged<'_>]) -> Vec<Line> {
    let answers = Proportion::of(all.iter().map(|(verdict, _)| verdict.said.is_some()));
    let mut lines = vec![Line::of("answered", answers, None, true)];
    lines.extend(of_names(answered));
    let large = effects(answered);
    let large: Vec<Effect<'_>> = { large.into_iter() }
        .filter(|(_, effect)| effect.d > MIN_D_TO_FIND)
        .collect();
    lines.extend(of_effects(&large));
    if arm == Arm::ShopLogs {
        lines.extend(of_temperatures(&large));
    }
    if arm == Arm::ShopShift {
        lines.extend(shift::lines(answered));
    }
    lines
}

/// What was named in whole sessions.
fn of_names(answered: &[Judged<'_>]) -> [Line; 5] {
    let nothing = |holds: fn(&Verdict) -> bool| {
        let own = { answered.iter() }.filter(|(_, truth)| truth.effects.is_empty());
        Proportion::of(own.map(|(verdict, _)| holds(verdict)))
    };
    let each = |holds: fn(&Verdict) -> bool| {
        Proportion::of(answered.iter().map(|(verdict, _)| holds(verdict)))
    };
    let only_too_sure = each(|verdict| {
        let wrong = wrong_names(verdict);
        !wrong.is_empty() && wrong.iter().all(|(_, call)| *call == Call::TooSure)
    });
    let named = nothing(|verdict| verdict.named().next().is_some());
    let unflagged = each(|verdict| has_wrong(verdict) && !verdict.is_flagged());
    let too_sure = "of these: a single true name where the set was right";
    [
        Line::of("nothing hidden: a cause named", named, Some(0.005), false),
        Line::of(
            "nothing hidden: any alarm",
            nothing(has_alarm),
            Some(0.02),
            false,
        ),
        Line::of("a wrong name", each(has_wrong), Some(0.02), false),
        Line::of(too_sure, only_too_sure, None, false),
        Line::of(
            "a wrong name, and unknown not flagged",
            unflagged,
            Some(0.01),
            false,
        ),
    ]
}

/// How many of the large effects were found.
fn of_effects(large: &[Effect<'_>]) -> [Line; 2] {
    let found = |fits: fn(&ShopEffect) -> bool| {
        let own = large.iter().filter(|(_, effect)| fits(effect));
        Proportion::of(own.map(|(verdict, effect)| is_found(verdict, effect)))
    };
    let named = found(ShopEffect::is_resolvable);
    let in_set = found(|effect| !effect.is_resolvable() && !effect.names.is_empty());
    [
        Line::of("D above 20, resolvable: named", named, Some(0.90), true),
        Line::of(
            "D above 20, not resolvable: in the set",
            in_set,
            Some(0.97),
            true,
        ),
    ]
}

/// Lag and growth of the large effects that nothing imitates.
fn of_temperatures(large: &[Effect<'_>]) -> [Line; 3] {
    let holds = |holds: &dyn Fn([f64; 2]) -> bool| {
        let own = large
            .iter()
            .filter(|(_, effect)| effect.same_readings.is_empty());
        Proportion::of(own.map(|(verdict, effect)| followed(verdict, effect).is_some_and(holds)))
    };
    let lag = holds(&|[lag, _]| lag.abs() <= MAX_LAG_ERROR);
    let growth = holds(&|[_, growth]| growth.abs() <= MAX_GROWTH_ERROR);
    let seen = holds(&|_| true);
    [
        Line::of("D above 20: lag within 25 %", lag, Some(0.90), true),
        Line::of("D above 20: growth within 10 %", growth, Some(0.90), true),
        Line::of(
            "D above 20: the right thermometer reported",
            seen,
            None,
            true,
        ),
    ]
}

fn bins(all: &[Effect<'_>]) -> [Proportion; 3] {
    let own = all.iter().filter(|(_, effect)| !effect.names.is_empty());
    let own = own.map(|(verdict, effect)| (effect.d, is_found(verdict, effect)));
    by_d(&own.collect::<Vec<_>>())
}

/// By what is hidden; what cannot be told from something else stands apart.
fn kinds(answered: &[Judged<'_>]) -> Vec<Split> {
    let mut by = BTreeMap::<String, Vec<(&Verdict, &ShopEffect)>>::new();
    for (verdict, effect) in effects(answered) {
        let open = match (effect.names.is_empty(), effect.is_resolvable()) {
            (true, _) => " (no name in the catalogue)",
            (false, true) => "",
            (false, false) => " (the set is right)",
        };
        let what = format!("{}{open}", effect.what);
        by.entry(what).or_default().push((verdict, effect));
    }
    let split = |(what, all): (String, Vec<(&Verdict, &ShopEffect)>)| {
        let size = size_to_find(all.iter().map(|(_, effect)| (effect.size, effect.d)));
        let unit = all
            .first()
            .map_or_else(String::new, |(_, effect)| effect.unit.clone());
        Split {
            found: bins(&all),
            wrong: Proportion::of(all.iter().map(|(verdict, _)| has_wrong(verdict))),
            size_of_d_20: size.map(|size| (size, unit)),
            what,
        }
    };
    by.into_iter().map(split).collect()
}

/// By what kind of a session it was.
fn splits(answered: &[Judged<'_>]) -> Vec<(String, Vec<Split>)> {
    type Key = fn(&ShopTruth) -> String;
    let few = |places: usize| match places {
        0..=3 => "2 or 3",
        4..=9 => "4 to 9",
        10..=15 => "10 to 15",
        16..=25 => "16 to 25",
        _ => "26 and more",
    };
    let keys: [(&str, Key); 3] = [
        ("session", |truth| truth.session.clone()),
        ("layout", |truth| truth.layout.clone()),
        ("repeats", |truth| truth.repeats.to_string()),
    ];
    let of = |title: &str, key: &dyn Fn(&ShopTruth) -> String| {
        let mut by = BTreeMap::<String, Vec<Judged<'_>>>::new();
        for judged in answered {
            by.entry(key(judged.1)).or_default().push(*judged);
        }
        let split = |(what, all): (String, Vec<Judged<'_>>)| Split {
            found: bins(&effects(&all)),
            wrong: Proportion::of(all.iter().map(|(verdict, _)| has_wrong(verdict))),
            size_of_d_20: None,
            what,
        };
        (title.to_owned(), by.into_iter().map(split).collect())
    };
    let mut all: Vec<(String, Vec<Split>)> =
        keys.iter().map(|(title, key)| of(title, key)).collect();
    all.push(of("noise that neighbouring readings share", &|truth| {
        let words = if truth.memory >= MUCH_MEMORY {
            "0.5 and more"
        } else if truth.memory > 0.0 {
            "below 0.5"
        } else {
            "none"
        };
        words.to_owned()
    }));
    all.push(of("targets, planes or thermometers", &|truth| {
        few(truth.places).to_owned()
    }));
    all
}

/// Wrong names in words: what was named, and what was hidden.
fn wrong_words(verdict: &Verdict, truth: &ShopTruth) -> Vec<String> {
    let hidden: Vec<&str> = truth
        .effects
        .iter()
        .map(|effect| effect.what.as_str())
        .collect();
    let hidden = if hidden.is_empty() {
        "nothing".to_owned()
    } else {
        hidden.join(", ")
    };
    let words = |((effect, _), call): ((String, String), Call)| {
        let alone = if call == Call::TooSure { " alone" } else { "" };
        format!("{effect}{alone}; hidden: {hidden}")
    };
    wrong_names(verdict).into_iter().map(words).collect()
}

fn counted(all: impl Iterator<Item = String>) -> Vec<(String, usize)> {
    let mut counts = BTreeMap::<String, usize>::new();
    for one in all {
        *counts.entry(one).or_default() += 1;
    }
    let mut sorted: Vec<(String, usize)> = counts.into_iter().collect();
    sorted.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
    sorted
}
