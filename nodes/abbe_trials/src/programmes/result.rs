//! The table of the programmes, for a terminal and as Markdown.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use reports::section::{Rows, Section, head};
use trials::Compared;
use trials::proportion::{Proportion, median};
use trials::target::{Ratio, TARGET_RATIO};

use super::Judged;
use crate::table;

/// D from which an effect should be named in any case.
const LARGE_D: f64 = 10.0;

/// One programme on every machine.
struct Line {
    programme: Compared,
    machines: usize,
    right: Proportion,
    right_of_large: Proportion,
    exact: Proportion,
    wrong: Proportion,
    unknown: Proportion,
    refused: usize,
    used_min: Option<f64>,
}

impl Line {
    fn of(programme: Compared, all: &[Judged]) -> Self {
        let own: Vec<&Judged> = all.iter().filter(|it| it.programme == programme).collect();
        let effects = |least_d: f64| {
            let each = own.iter().flat_map(|judged| {
                let verdict = &judged.verdict;
                let large = verdict.truth.effects.iter();
                let large = large.filter(move |effect| effect.d >= least_d);
                large.map(move |effect| verdict.has(effect))
            });
            Proportion::of(each)
        };
        let verdicts = || own.iter().map(|judged| &judged.verdict);
        Self {
            programme,
            machines: own.len(),
            right: effects(0.0),
            right_of_large: effects(LARGE_D),
            exact: Proportion::of(verdicts().map(|it| it.said.is_some() && it.is_exact())),
            wrong: Proportion::of(verdicts().map(|it| it.wrong().next().is_some())),
            unknown: Proportion::of(verdicts().map(trials::Verdict::is_flagged)),
            refused: verdicts().filter(|it| it.refused.is_some()).count(),
            used_min: median(own.iter().map(|judged| judged.used_min).collect()),
        }
    }

    fn cells(&self) -> Vec<String> {
        vec![
            self.programme.to_string(),
            self.right.to_string(),
            self.right_of_large.to_string(),
            self.exact.to_string(),
            self.wrong.to_string(),
            self.unknown.to_string(),
            self.refused.to_string(),
            self.used_min
                .map_or_else(|| "-".to_owned(), |min| format!("{min:.0}")),
        ]
    }
}

/// The table.
pub(super) struct Table {
    seed: u64,
    minutes: f64,
    commits: BTreeSet<String>,
    lines: Vec<Line>,
}

impl Table {
    pub(super) fn of(seed: u64, minutes: f64, all: &[Judged]) -> Self {
        let lines = Compared::ALL.map(|programme| Line::of(programme, all));
        Self {
            seed,
            minutes,
            commits: all.iter().map(|it| it.verdict.commit.clone()).collect(),
            lines: lines.into(),
        }
    }

    pub(super) fn terminal(&self) -> String {
        format!(
            "{}\n\n{}",
            self.sentences().join("\n"),
            self.section().terminal()
        )
    }

    pub(super) fn markdown(&self) -> String {
        let mut text = format!("# {PROGRAMMES_TITLE}\n\n");
        for line in self.sentences() {
            let _ = writeln!(text, "{line}\n");
        }
        for rows in &self.section().tables {
            text.push_str(&table::markdown_table(rows));
            let _ = writeln!(text, "{}", rows.note);
        }
        text
    }

    fn sentences(&self) -> Vec<String> {
        let commits: Vec<&str> = self.commits.iter().map(String::as_str).collect();
        let machines = self.lines.iter().map(|line| line.machines);
        vec![
            format!(
                "{} machines, seed {}, {} min for each programme with its set-ups, diagnosed within one process by commit {}.",
                machines.min().unwrap_or(0),
                self.seed,
                self.minutes,
                commits.join(", ")
            ),
            ratio_words(self.ratio()),
        ]
    }

    /// What the designed programme names beside what a shop's does.
    pub(super) fn ratio(&self) -> Ratio {
        let of = |programme: Compared| self.lines.iter().find(|line| line.programme == programme);
        let named = |programme: Compared| of(programme).map_or(0, |line| line.right.k);
        let machines = [Compared::Designed, Compared::Shop]
            .map(|programme| of(programme).map_or(0, |line| line.machines));
        Ratio {
            machines: machines[0].min(machines[1]),
            minutes: self.minutes,
            designed: named(Compared::Designed),
            shop: named(Compared::Shop),
        }
    }

    fn section(&self) -> Section {
        let mut section = Section::new(PROGRAMMES_TITLE);
        section.tables.push(Rows {
            head: head(&[
                "programme",
                "effects named right",
                "the same, D of 10 or more",
                "machines exact",
                "machines with a wrong name",
                "machines flagged unknown",
                "not diagnosed",
                "minutes, median",
            ]),
            rows: self.lines.iter().map(Line::cells).collect(),
            note: "Shares with Wilson's intervals of 95 %. D is the size of an effect on the common programme of the trials, not on the one of the row.".to_owned(),
        });
        section
    }
}

/// What the designed programme names, over what a shop's does.
pub fn ratio_words(ratio: Ratio) -> String {
    let Ratio { designed, shop, .. } = ratio;
    let Some(value) = ratio.value() else {
        return format!("The designed programme names {designed} effects, a shop's none.");
    };
    let reached = if value >= TARGET_RATIO {
        "reached"
    } else {
        "missed"
    };
    format!(
        "The designed programme names {designed} effects, a shop's {shop}: {value:.2} times as many; the target of {TARGET_RATIO} is {reached}."
    )
}

const PROGRAMMES_TITLE: &str = "Programmes of the same minutes";

/// One programme on one machine in a line.
pub(super) fn sentence(judged: &Judged) -> String {
    let verdict = &judged.verdict;
    let effects = verdict.truth.effects.iter();
    let hidden: Vec<String> = effects
        .map(|effect| {
            let right = if verdict.has(effect) {
                "named"
            } else {
                "missed"
            };
            format!(
                "{} {} D {:.0} {right}",
                effect.class.id(),
                effect.axis,
                effect.d
            )
        })
        .collect();
    let wrong: Vec<String> = verdict
        .wrong()
        .map(|cause| format!("{} {}", cause.effect, cause.axis))
        .collect();
    format!(
        "machine {}, {}, {:.1} min ({:.0} s to measure, {:.0} s to diagnose): {}{}{}",
        verdict.truth.index,
        judged.programme,
        judged.used_min,
        verdict.making_s,
        verdict.diagnosis_s,
        if hidden.is_empty() {
            "nothing hidden".to_owned()
        } else {
            hidden.join(", ")
        },
        if wrong.is_empty() {
            String::new()
        } else {
            format!("; wrong: {}", wrong.join(", "))
        },
        verdict
            .refused
            .as_ref()
            .map_or_else(String::new, |reason| format!("; refused: {reason}"))
    )
}
