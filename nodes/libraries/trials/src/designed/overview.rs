//! What designed programmes reach, by their minutes, by the machine's physics and by class.

use serde::{Deserialize, Serialize};

use super::{DesignedTruth, PROGRAMME_MIN};
use crate::arm::Arm;
use crate::detection::{by_d, size_to_find};
use crate::effect::Class;
use crate::proportion::{Proportion, median};
use crate::tally::{SINGLE_D, has_wrong, to_be_named};
use crate::truth::TrueEffect;
use crate::verdict::{Second, Verdict};

/// D below which a programme shows nothing of an effect.
const NOT_SHOWN_D: f64 = 2.0;

/// Machines with the same minutes and physics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProgrammeLine {
    /// Which.
    pub what: String,
    /// How many.
    pub trials: usize,
    /// Effects that are named: with D below 10, from 10 to 20, and above.
    pub named: [Proportion; 3],
    /// Effects that are named, of those that the common programme shows with a D above 10.
    pub of_common: Proportion,
    /// Machines with one effect of D above 10: it is named, and nothing else.
    pub single: Proportion,
    /// Machines with two or three effects of D above 7: all are named, and nothing else.
    pub several: Proportion,
    /// Machines of which nothing but what is hidden is named, and all of it.
    pub exact: Proportion,
    /// Machines with a wrong name.
    pub wrong: Proportion,
    /// The same, and no unknown flagged.
    pub unflagged: Proportion,
    /// Minutes that the programme takes, the middle.
    pub used_min: Option<f64>,
}

/// A class by the size that programmes of some minutes show well.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizeLine {
    /// The class.
    pub class: Class,
    /// Unit of its size.
    pub unit: String,
    /// Effects of which the programme of 20 and of 40 min shows nothing: D below 2.
    pub not_shown: [Proportion; 2],
    /// Size with a D of 20 in the middle machine, of those that the programme shows.
    pub size: [Option<f64>; 2],
}

/// What a second round changed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoundsLine {
    /// Of which machines.
    pub what: String,
    /// Those that were open after one round: not all that is hidden named, or something else.
    pub open: Proportion,
    /// Of the open ones: those that a second round was designed for.
    pub designed: Proportion,
    /// Of these: exact after both rounds.
    pub exact: Proportion,
    /// Of these with a D above 10 on the first programme: exact after both rounds.
    pub exact_of_large: Proportion,
    /// Of those that were exact and got a second round: not exact after it.
    pub spoilt: Proportion,
}

/// An arm by its programmes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Overview {
    /// The arm.
    pub arm: Arm,
    /// By minutes and physics.
    pub programmes: Vec<ProgrammeLine>,
    /// By class.
    pub sizes: Vec<SizeLine>,
    /// Second rounds, where the arm has them.
    pub rounds: Vec<RoundsLine>,
}

/// A verdict with its programme.
type Judged<'v> = (&'v Verdict, DesignedTruth);

/// Name of the line of all machines of some minutes.
fn of_minutes(minutes: f64) -> String {
    format!("{minutes} min")
}

impl Overview {
    /// Of the verdicts on one arm; refused diagnoses name nothing.
    #[must_use]
    pub fn of(arm: Arm, verdicts: &[Verdict]) -> Self {
        let own = verdicts
            .iter()
            .filter(|v| v.truth.arm == arm && v.ablated.is_none());
        let own: Vec<Judged<'_>> = own.filter_map(|v| Some((v, v.truth.designed?))).collect();
        Self {
            arm,
            programmes: programmes(&own),
            sizes: sizes(&own),
            rounds: rounds(&own),
        }
    }

    /// The line of all machines of some minutes.
    #[must_use]
    pub fn line(&self, minutes: f64) -> Option<&ProgrammeLine> {
        let wanted = of_minutes(minutes);
        self.programmes.iter().find(|line| line.what == wanted)
    }
}

fn has_minutes(programme: DesignedTruth, minutes: f64) -> bool {
    (programme.minutes - minutes).abs() < 0.5
}

fn programmes(own: &[Judged<'_>]) -> Vec<ProgrammeLine> {
    let mut lines = Vec::new();
    for minutes in PROGRAMME_MIN {
        for (physics, wanted) in [
            ("", None),
            (", catalogue's physics", Some(false)),
            (", other physics", Some(true)),
        ] {
            let fits = |(_, programme): &&Judged<'_>| {
                has_minutes(*programme, minutes)
                    && wanted.is_none_or(|wanted| programme.is_foreign == wanted)
            };
            let fitting: Vec<Judged<'_>> = own.iter().filter(fits).copied().collect();
            let what = of_minutes(minutes) + physics;
            lines.push(programme_line(what, &fitting));
        }
    }
    lines
}

fn programme_line(what: String, own: &[Judged<'_>]) -> ProgrammeLine {
    let effects = effects(own);
    let named: Vec<(f64, bool)> = effects.iter().map(|(v, e)| (e.d, v.has(e))).collect();
    let common = effects
        .iter()
        .filter(|(_, e)| e.common_d.is_some_and(|d| d > SINGLE_D));
    let each = |holds: fn(&Verdict) -> bool| Proportion::of(own.iter().map(|(v, _)| holds(v)));
    let is_exact = |v: &Verdict| v.said.is_some() && v.is_exact();
    let all: Vec<&Verdict> = own.iter().map(|(v, _)| *v).collect();
    let [single, several] =
        to_be_named(&all).map(|own| Proportion::of(own.iter().map(|v| is_exact(v))));
    ProgrammeLine {
        what,
        trials: own.len(),
        named: by_d(&named),
        of_common: Proportion::of(common.map(|(v, e)| v.has(e))),
        single,
        several,
        exact: each(is_exact),
        wrong: each(has_wrong),
        unflagged: each(|v| has_wrong(v) && !v.is_flagged()),
        used_min: median(
            own.iter()
                .map(|(_, programme)| programme.used_min)
                .collect(),
        ),
    }
}

fn effects<'v>(own: &[Judged<'v>]) -> Vec<(&'v Verdict, &'v TrueEffect)> {
    let of = |(verdict, _): &Judged<'v>| {
        let verdict = *verdict;
        verdict
            .truth
            .effects
            .iter()
            .map(move |effect| (verdict, effect))
    };
    own.iter().flat_map(of).collect()
}

fn sizes(own: &[Judged<'_>]) -> Vec<SizeLine> {
    let line = |class: Class| {
        let by_minutes = PROGRAMME_MIN.map(|minutes| {
            let fits = |(_, programme): &&Judged<'_>| has_minutes(*programme, minutes);
            let fitting: Vec<Judged<'_>> = own.iter().filter(fits).copied().collect();
            let all = effects(&fitting).into_iter().map(|(_, effect)| effect);
            let all = all.filter(|effect| effect.class == class);
            all.map(|effect| (effect.size, effect.d))
                .collect::<Vec<_>>()
        });
        let shown = |all: &[(f64, f64)]| {
            let shown = all.iter().filter(|(_, d)| *d >= NOT_SHOWN_D);
            size_to_find(shown.copied())
        };
        let not_shown =
            |all: &[(f64, f64)]| Proportion::of(all.iter().map(|(_, d)| *d < NOT_SHOWN_D));
        SizeLine {
            class,
            unit: class.sizes().1.to_owned(),
            not_shown: by_minutes.each_ref().map(|all| not_shown(all)),
            size: by_minutes.each_ref().map(|all| shown(all)),
        }
    };
    let lines = Class::ALL.into_iter().map(line);
    lines
        .filter(|line| line.not_shown.iter().any(|count| count.n > 0))
        .collect()
}

/// Whether a verdict is exact, and whether it is after its second round.
pub(crate) fn by_round(verdict: &Verdict, second: &Second) -> [bool; 2] {
    let after = Verdict {
        said: second.said.clone(),
        ..verdict.clone()
    };
    [verdict, &after].map(|verdict| verdict.said.is_some() && verdict.is_exact())
}

fn rounds(own: &[Judged<'_>]) -> Vec<RoundsLine> {
    let with = own
        .iter()
        .filter(|(v, _)| v.truth.arm == Arm::DesignedTwoRounds && v.said.is_some());
    let with: Vec<Judged<'_>> = with.copied().collect();
    if with.is_empty() {
        return vec![];
    }
    let all: [(&str, Option<bool>); 3] = [
        ("all", None),
        ("look-alikes", Some(false)),
        ("small effects", Some(true)),
    ];
    let line = |(what, wanted): (&str, Option<bool>)| {
        let fits =
            |(_, programme): &&Judged<'_>| wanted.is_none_or(|wanted| programme.is_small == wanted);
        let own: Vec<&Verdict> = with.iter().filter(fits).map(|(v, _)| *v).collect();
        rounds_line(what, &own)
    };
    all.into_iter().map(line).collect()
}

fn rounds_line(what: &str, own: &[&Verdict]) -> RoundsLine {
    let open = || own.iter().filter(|v| !v.is_exact());
    let second = own.iter().filter_map(|v| {
        let [before, after] = by_round(v, v.second.as_ref()?);
        Some((v.least_d(), before, after))
    });
    let second: Vec<(Option<f64>, bool, bool)> = second.collect();
    let after = |least_d: f64| {
        let fits =
            |(d, before, _): &&(Option<f64>, bool, bool)| !before && d.is_some_and(|d| d > least_d);
        Proportion::of(second.iter().filter(fits).map(|(.., after)| *after))
    };
    let whole = second.iter().filter(|(_, before, _)| *before);
    RoundsLine {
        what: what.to_owned(),
        open: Proportion::of(own.iter().map(|v| !v.is_exact())),
        designed: Proportion::of(open().map(|v| v.second.is_some())),
        exact: after(f64::NEG_INFINITY),
        exact_of_large: after(SINGLE_D),
        spoilt: Proportion::of(whole.map(|(.., after)| !after)),
    }
}

#[cfg(test)]
mod tests {
    use gap_diagnosis::report::Status;

    use super::*;
    use crate::sample::{cause, effect, verdict};
    use crate::verdict::SaidCause;

    fn judged(arm: Arm, d: f64, minutes: f64, causes: Vec<SaidCause>) -> Verdict {
        let hidden = TrueEffect {
            common_d: Some(2.0 * d),
            ..effect(Class::Backlash, "X", d)
        };
        let mut verdict = verdict(vec![hidden], causes, false);
        verdict.truth.arm = arm;
        verdict.truth.designed = Some(DesignedTruth {
            minutes,
            used_min: minutes - 1.0,
            is_foreign: false,
            is_small: false,
        });
        verdict
    }

    fn play() -> Vec<SaidCause> {
        vec![cause("backlash", "X", Status::Named, 4.0)]
    }

    fn count(k: usize, n: usize) -> Proportion {
        Proportion { k, n }
    }

    #[test]
    fn programmes_are_counted_by_their_minutes_and_by_both_sizes_of_an_effect() {
        let arm = Arm::Designed;
        let mut refused = judged(arm, 9.0, 20.0, vec![]);
        refused.said = None;
        let all = [
            judged(arm, 30.0, 20.0, play()),
            judged(arm, 8.0, 20.0, vec![]),
            refused,
            judged(
                arm,
                1.0,
                40.0,
                vec![cause("backlash", "Y", Status::Named, 4.0)],
            ),
        ];
        let overview = Overview::of(arm, &all);
        assert_eq!(overview.programmes.len(), 6);
        let short = overview.line(20.0).unwrap();
        assert_eq!(short.named, [count(0, 2), count(0, 0), count(1, 1)]);
        assert_eq!(short.of_common, count(1, 3));
        assert_eq!((short.exact, short.wrong), (count(1, 3), count(0, 3)));
        assert_eq!((short.single, short.several), (count(1, 1), count(0, 0)));
        assert_eq!(short.used_min, Some(19.0));
        let long = overview.line(40.0).unwrap();
        assert_eq!((long.of_common, long.unflagged), (count(0, 0), count(1, 1)));
        let [line] = &overview.sizes[..] else {
            panic!("{:?}", overview.sizes);
        };
        assert_eq!(line.not_shown, [count(0, 3), count(1, 1)]);
        // A play of 4 µm has D 30, 8 and 9: D 20 at 8/3, 10 and 80/9 µm.
        assert!((line.size[0].unwrap() - 80.0 / 9.0).abs() < 1e-12);
        assert_eq!(line.size[1], None);
        assert!(overview.rounds.is_empty());
    }

    #[test]
    fn a_second_round_counts_where_it_was_designed_for_what_was_open() {
        let arm = Arm::DesignedTwoRounds;
        let round = |first: Vec<SaidCause>, then: Option<Vec<SaidCause>>, d: f64| {
            let mut whole = judged(arm, d, 20.0, first);
            whole.second = then.map(|causes| Second {
                run: "circle XY R50 F1000".to_owned(),
                separates: vec![],
                delta: 12.0,
                said: verdict(vec![], causes, false).said,
                refused: None,
            });
            whole
        };
        let all = [
            round(vec![], Some(play()), 30.0),
            round(vec![], Some(play()), 6.0),
            round(vec![], Some(vec![]), 30.0),
            round(vec![], None, 3.0),
            round(play(), Some(vec![]), 30.0),
            round(play(), None, 30.0),
        ];
        let rounds = Overview::of(arm, &all).rounds;
        assert_eq!(rounds[0].open, count(4, 6));
        assert_eq!(rounds[0].designed, count(3, 4));
        assert_eq!(rounds[0].exact, count(2, 3));
        assert_eq!(rounds[0].exact_of_large, count(1, 2));
        assert_eq!(rounds[0].spoilt, count(1, 1));
        assert_eq!(
            rounds[1],
            RoundsLine {
                what: "look-alikes".to_owned(),
                ..rounds[0].clone()
            }
        );
        assert_eq!(rounds[2].open, count(0, 0));
    }
}
