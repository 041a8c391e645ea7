//! The table of a shop's arms: for a terminal, as JSON, as a page and as Markdown.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use anyhow::Result;
use maud::html;
use reports::Report;
use reports::screen::Screen;
use reports::section::{Rows, Section};
use serde::Serialize;
use trials::proportion::Proportion;
use trials::shop::{Line, Middle, ShopTally, Split};
use trials::{Arm, Verdict};

use super::ten_lines::ten_lines;
use crate::table::{append_markdown, append_numbered, computer};

const SHOP_TITLE: &str = "Blind trials on the sessions that shops have";
/// Trials of an arm that the protocol wants.
const WANTED: usize = 300;
/// Rows of lists of names.
const MAX_LISTED: usize = 12;

/// The table.
#[derive(Serialize)]
pub struct Table {
    commit: String,
    seed: u64,
    machine: String,
    arms: Vec<ShopTally>,
}

impl Table {
    /// Tallies verdicts arm by arm.
    pub fn of(arms: &BTreeSet<Arm>, seed: u64, verdicts: &[Verdict]) -> Self {
        let commits: BTreeSet<&str> = verdicts.iter().map(|v| v.commit.as_str()).collect();
        Self {
            commit: commits.into_iter().collect::<Vec<_>>().join(", "),
            seed,
            machine: computer(),
            arms: arms
                .iter()
                .map(|arm| ShopTally::of(*arm, verdicts))
                .collect(),
        }
    }

    /// For a terminal, as JSON, as a page and as Markdown.
    ///
    /// # Errors
    /// When a number is not finite.
    pub fn contents(&self) -> Result<[String; 4]> {
        let parts: Vec<Section> = self.arms.iter().map(section).collect();
        let lines = self.lines();
        let terminal: Vec<String> = parts.iter().map(Section::terminal).collect();
        let report = Report {
            title: SHOP_TITLE.to_owned(),
            lines: vec![],
            parts: vec![],
            screen: Screen::default(),
            body: html! {
                ol { @for line in &ten_lines(&self.arms) { li { (line) } } }
                @for line in &lines { p { (line) } }
                @for part in &parts { (part.html()) }
            },
            figures: serde_json::Value::Null,
        };
        Ok([
            format!("{}\n\n{}", lines.join("\n"), terminal.join("\n")),
            serde_json::to_string_pretty(self)?,
            report.html(),
            self.markdown(&lines, &parts),
        ])
    }

    fn lines(&self) -> Vec<String> {
        let trials: usize = self.arms.iter().map(|arm| arm.trials).sum();
        let mut lines = vec![format!(
            "{trials} trials, seed {}, diagnosed by commit {} on {}. Intervals are Wilson's, 95 %.",
            self.seed, self.commit, self.machine
        )];
        let least = self.arms.iter().map(|arm| arm.trials).min().unwrap_or(0);
        if least < WANTED {
            lines.push(format!(
                "A small run: {least} trials in the smallest arm, of {WANTED} that are wanted."
            ));
        }
        lines
    }

    fn markdown(&self, lines: &[String], parts: &[Section]) -> String {
        let mut text = format!("# {SHOP_TITLE}\n\n");
        append_numbered(&mut text, &ten_lines(&self.arms));
        for line in lines {
            let _ = writeln!(text, "{line}\n");
        }
        append_markdown(&mut text, parts);
        text
    }
}

fn words(all: &[&str]) -> Vec<String> {
    all.iter().map(|word| (*word).to_owned()).collect()
}

fn section(tally: &ShopTally) -> Section {
    let mut section = Section::new(format!("Arm {}: {}", tally.arm, tally.arm.title()));
    let [middle, longest] = tally.times_s.map(|time| time.unwrap_or(0.0));
    section.lines.push(format!(
        "{} sessions; import and diagnosis took {middle:.1} s in the middle, {longest:.0} s at most.",
        tally.trials
    ));
    section.tables.push(Rows {
        head: words(&["figure", "k/n", "95 % interval", "target", ""]),
        rows: tally.lines.iter().map(figure).collect(),
        note:
            "Open: the interval holds the target. Unanswered sessions count in the first row alone."
                .to_owned(),
    });
    if !tally.middles.is_empty() {
        section.tables.push(Rows {
            head: words(&["median", "value", "of", "target", ""]),
            rows: tally.middles.iter().map(middle_row).collect(),
            note: String::new(),
        });
    }
    section.tables.push(Rows {
        head: words(&["hidden", "found, D < 10", "10 to 20", "> 20", "with a wrong name", "size of D 20"]),
        rows: tally.kinds.iter().map(|kind| split(kind, true)).collect(),
        note: "Found: named, or in the set where that is the right answer. Size of D 20: in the middle session.".to_owned(),
    });
    for (title, splits) in &tally.splits {
        section.tables.push(Rows {
            head: words(&[
                title.as_str(),
                "found, D < 10",
                "10 to 20",
                "> 20",
                "with a wrong name",
            ]),
            rows: splits.iter().map(|own| split(own, false)).collect(),
            note: String::new(),
        });
    }
    for (title, counts) in [("wrong name", &tally.wrong), ("no answer", &tally.refused)] {
        if !counts.is_empty() {
            let listed = counts.iter().take(MAX_LISTED);
            section.tables.push(Rows {
                head: words(&[title, "times"]),
                rows: listed
                    .map(|(what, n)| vec![what.clone(), n.to_string()])
                    .collect(),
                note: String::new(),
            });
        }
    }
    section
}

fn figure(line: &Line) -> Vec<String> {
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let sign = if line.is_high { "≥" } else { "≤" };
    let share = line.count.share().map_or("-".to_owned(), percent);
    let [low, high] = line.interval.map(|share| 100.0 * share);
    vec![
        line.what.clone(),
        format!("{}/{} = {share}", line.count.k, line.count.n),
        format!("{low:.1} to {high:.1} %"),
        match (line.target, line.most) {
            (None, _) => String::new(),
            (Some(least), Some(most)) => format!("{} to {}", percent(least), percent(most)),
            (Some(target), None) => format!("{sign} {}", percent(target)),
        },
        line.verdict().to_owned(),
    ]
}

fn middle_row(middle: &Middle) -> Vec<String> {
    let sign = if middle.is_high { "≥" } else { "≤" };
    let verdict = match middle.is_met() {
        Some(true) => "met",
        Some(false) => "missed",
        None => "",
    };
    vec![
        middle.what.clone(),
        middle
            .value
            .map_or("-".to_owned(), |value| format!("{value:.3}")),
        middle.n.to_string(),
        format!("{sign} {}", middle.target),
        verdict.to_owned(),
    ]
}

fn split(split: &Split, has_size: bool) -> Vec<String> {
    let count = |count: &Proportion| match count.n {
        0 => "-".to_owned(),
        n => format!("{}/{n}", count.k),
    };
    let mut cells = vec![split.what.clone()];
    cells.extend(split.found.iter().map(count));
    cells.push(count(&split.wrong));
    if has_size {
        let size = split.size_of_d_20.as_ref();
        cells.push(size.map_or(String::new(), |(size, unit)| format!("{size:.2} {unit}")));
    }
    cells
}
