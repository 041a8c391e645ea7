//! The table of a series: for a terminal, as JSON, as a page, and as Markdown for the repository.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use anyhow::Result;
use maud::html;
use serde::Serialize;
use trials::tally::{D_BINS, Figure, bin_name, unknown_auroc};
use trials::{Arm, Tally, Verdict};

use crate::report::Report;
use crate::report::section::{Rows, Section};

/// Trials of an arm below which a table says that it is a small run.
const SMALL: usize = 500;
/// Most names in one cell.
const MOST_NAMES: usize = 5;

/// The table.
#[derive(Serialize)]
pub struct Table {
    commit: String,
    seed: u64,
    in_process: bool,
    trials: usize,
    arms: Vec<Tally>,
    unknown: Vec<Figure>,
    refusals: Vec<(String, usize)>,
}

impl Table {
    /// Tallies verdicts arm by arm.
    pub fn of(arms: &BTreeSet<Arm>, seed: u64, verdicts: Vec<Verdict>, in_process: bool) -> Self {
        let commits: BTreeSet<&str> = verdicts.iter().map(|v| v.commit.as_str()).collect();
        let commit = commits.into_iter().collect::<Vec<_>>().join(", ");
        let has_both = [Arm::LeftOut, Arm::Catalogue]
            .iter()
            .all(|arm| arms.contains(arm));
        let mut refusals = Vec::<(String, usize)>::new();
        for reason in verdicts.iter().filter_map(|v| v.refused.clone()) {
            match refusals.iter_mut().find(|(known, _)| *known == reason) {
                Some((_, count)) => *count += 1,
                None => refusals.push((reason, 1)),
            }
        }
        Self {
            commit,
            seed,
            in_process,
            trials: verdicts.len(),
            arms: arms.iter().map(|arm| Tally::of(*arm, &verdicts)).collect(),
            unknown: if has_both {
                [0.0, 10.0].map(|d| unknown_auroc(&verdicts, d)).to_vec()
            } else {
                vec![]
            },
            refusals,
        }
    }

    /// As it stands on a terminal.
    pub fn terminal(&self) -> String {
        let parts: Vec<String> = self.sections().iter().map(Section::terminal).collect();
        format!("{}\n\n{}", self.lines().join("\n"), parts.join("\n"))
    }

    /// As JSON.
    ///
    /// # Errors
    /// When a number is none.
    pub fn json(&self) -> Result<String> {
        Ok(serde_json::to_string_pretty(self)?)
    }

    /// As one HTML file.
    pub fn html(&self) -> String {
        let (lines, sections) = (self.lines(), self.sections());
        let report = Report {
            title: TITLE.to_owned(),
            lines: vec![],
            text: String::new(),
            body: html! {
                h1 { (TITLE) }
                @for line in &lines { p { (line) } }
                @for section in &sections { (section.html()) }
            },
            figures: serde_json::Value::Null,
        };
        report.html()
    }

    /// As Markdown.
    pub fn markdown(&self) -> String {
        let mut text = format!("# {TITLE}\n\n");
        for line in self.lines() {
            let _ = writeln!(text, "{line}\n");
        }
        for section in self.sections() {
            let _ = writeln!(text, "## {}\n", section.title);
            for line in &section.lines {
                let _ = writeln!(text, "{line}\n");
            }
            for rows in &section.tables {
                text.push_str(&markdown_table(rows));
                if !rows.note.is_empty() {
                    let _ = writeln!(text, "{}\n", rows.note);
                }
            }
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
        text
    }

    fn lines(&self) -> Vec<String> {
        let mut lines = vec![format!(
            "{} trials, seed {}, diagnosed by commit {}.",
            self.trials, self.seed, self.commit
        )];
        if self.in_process {
            lines.push(
                "Diagnosed within the process that made the trials: not for publication.".into(),
            );
        }
        let least = self.arms.iter().map(|arm| arm.trials).min().unwrap_or(0);
        if least < SMALL {
            lines.push(format!(
                "A small run: {least} trials in the smallest arm, of at least {SMALL} that are wanted. Intervals are Wilson's, 95 %."
            ));
        }
        for (reason, count) in &self.refusals {
            lines.push(format!("{count} not diagnosed: {reason}"));
        }
        lines
    }

    fn sections(&self) -> Vec<Section> {
        let mut sections: Vec<Section> = self.arms.iter().map(section).collect();
        if !self.unknown.is_empty() {
            let mut section = Section::new("Unknown or known");
            section.tables.push(figures(&self.unknown));
            sections.push(section);
        }
        sections
    }
}

const TITLE: &str = "Blind trials of the diagnosis";

fn section(tally: &Tally) -> Section {
    let mut section = Section::new(format!("Arm {}: {}", tally.arm, tally.arm.title()));
    section.lines.push(format!("{} trials.", tally.trials));
    section.tables.push(Rows {
        head: ["what", "k/n", "95 % interval"].map(str::to_owned).to_vec(),
        rows: tally
            .rates
            .iter()
            .filter(|rate| rate.count.n > 0)
            .map(|rate| {
                let [low, high] = rate.interval.map(|share| 100.0 * share);
                let share = 100.0 * rate.count.share().unwrap_or(0.0);
                let count = format!("{}/{} = {share:.0} %", rate.count.k, rate.count.n);
                vec![rate.what.clone(), count, format!("{low:.0} to {high:.0} %")]
            })
            .collect(),
        note: String::new(),
    });
    section.tables.push(figures(&tally.figures));
    if !tally.classes.is_empty() {
        section.tables.push(classes(tally));
    }
    if !tally.confusion.is_empty() {
        section.tables.push(confusion(tally));
    }
    if !tally.false_names.is_empty() {
        let names = tally
            .false_names
            .iter()
            .map(|(name, n)| vec![name.clone(), n.to_string()]);
        section.tables.push(Rows {
            head: ["named though not hidden", "times"]
                .map(str::to_owned)
                .to_vec(),
            rows: names.collect(),
            note: String::new(),
        });
    }
    if !tally.reliability.is_empty() {
        let rows = tally
            .reliability
            .iter()
            .map(|bin| vec![format!("{:.2}", bin.confidence), bin.right.to_string()]);
        section.tables.push(Rows {
            head: ["mean confidence", "right"].map(str::to_owned).to_vec(),
            rows: rows.collect(),
            note: "Confidence beside precision of what is named.".to_owned(),
        });
    }
    section
}

fn figures(all: &[Figure]) -> Rows {
    let with = all.iter().filter(|figure| figure.n > 0);
    let rows = with.map(|figure| {
        let value = figure
            .value
            .map_or("-".to_owned(), |value| format!("{value:.3}"));
        vec![figure.what.clone(), value, figure.n.to_string()]
    });
    Rows {
        head: ["figure", "value", "of"].map(str::to_owned).to_vec(),
        rows: rows.collect(),
        note: String::new(),
    }
}

fn classes(tally: &Tally) -> Rows {
    let mut head = vec!["class".to_owned()];
    head.extend((0..D_BINS).map(bin_name));
    head.extend(["surrogate", "named besides or instead, alone"].map(str::to_owned));
    let rows = tally.classes.iter().map(|line| {
        let mut row = vec![line.class.id().to_owned()];
        row.extend(line.named.iter().map(|bin| match bin.n {
            0 => String::new(),
            n => format!("{}/{n}", bin.k),
        }));
        row.push(format!("{}/{}", line.surrogate.k, line.surrogate.n));
        row.push(names(&line.taken_for));
        row
    });
    Rows {
        head,
        rows: rows.collect(),
        note: "Named with class and axis, by D.".to_owned(),
    }
}

fn names(all: &[(String, usize)]) -> String {
    let mut told: Vec<String> = all
        .iter()
        .take(MOST_NAMES)
        .map(|(name, n)| format!("{name} {n}"))
        .collect();
    if all.len() > MOST_NAMES {
        told.push("...".to_owned());
    }
    told.join(", ")
}

fn confusion(tally: &Tally) -> Rows {
    let hidden: BTreeSet<&str> = tally.confusion.iter().map(|(h, ..)| h.as_str()).collect();
    let rows = hidden.into_iter().map(|class| {
        let own = tally
            .confusion
            .iter()
            .filter(|(hidden, ..)| hidden == class);
        let mut said: Vec<(String, usize)> = own.map(|(_, said, n)| (said.clone(), *n)).collect();
        said.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        let told: Vec<String> = said.iter().map(|(name, n)| format!("{name} {n}")).collect();
        vec![class.to_owned(), told.join(", ")]
    });
    Rows {
        head: ["one effect hidden", "said"].map(str::to_owned).to_vec(),
        rows: rows.collect(),
        note: "Classes whatever the axis; in brackets: shown as a surrogate, nothing named."
            .to_owned(),
    }
}

fn markdown_table(rows: &Rows) -> String {
    let line = |cells: &[String]| {
        let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "/")).collect();
        format!("| {} |\n", cells.join(" | "))
    };
    let mut text = line(&rows.head);
    text.push_str(&format!("|{}\n", "---|".repeat(rows.head.len())));
    text.extend(rows.rows.iter().map(|row| line(row)));
    text.push('\n');
    text
}
