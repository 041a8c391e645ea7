//! The table of a series: for a terminal, as JSON, as a page, and as Markdown for the repository.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use anyhow::Result;
use maud::html;
use reports::Report;
use reports::screen::Screen;
use reports::section::{Rows, Section};
use serde::Serialize;
use trials::comparison::{MethodLine, ablations};
use trials::designed::Overview;
use trials::proportion::Proportion;
use trials::tally::{Figure, unknown_auroc};
use trials::target::{Ratio, Target, of_designed, targets};
use trials::{Arm, Tally, Verdict};

use crate::journal::NotMeasured;

mod arm;
mod confusion;
mod designed;
mod protocol;
mod reliability;

/// Trials of an arm below which a table says that it is a small run: of all arms, and of those of designed programmes.
const SMALL: [usize; 2] = [500, 300];
/// Arms with a class left out, each beside the one that its unknown score is compared with.
const UNKNOWN: [[Arm; 2]; 2] = [
    [Arm::LeftOut, Arm::Catalogue],
    [Arm::DesignedLeftOut, Arm::Designed],
];

/// The table.
#[derive(Serialize)]
pub struct Table {
    commit: String,
    seed: u64,
    in_process: bool,
    trials: usize,
    machine: String,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    first_lines: Vec<String>,
    targets: Vec<Target>,
    arms: Vec<Tally>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    programmes: Vec<Overview>,
    ablations: Vec<(Arm, Vec<MethodLine>)>,
    unknown: Vec<Figure>,
    refusals: Vec<(String, usize)>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    not_measured: Vec<NotMeasured>,
}

impl Table {
    /// Tallies verdicts arm by arm; `ratio` is of the journal of programmes.
    pub fn of(
        arms: &BTreeSet<Arm>,
        seed: u64,
        all: &[Verdict],
        in_process: bool,
        ratio: Option<Ratio>,
    ) -> Self {
        let whole = all.iter().filter(|v| v.ablated.is_none());
        let verdicts: Vec<Verdict> = whole.cloned().collect();
        let commits: BTreeSet<&str> = verdicts.iter().map(|v| v.commit.as_str()).collect();
        let commit = commits.into_iter().collect::<Vec<_>>().join(", ");
        let is_designed = arms.iter().any(|arm| arm.is_designed());
        let unknown = UNKNOWN
            .into_iter()
            .filter(|both| both.iter().all(|arm| arms.contains(arm)));
        let mut table = Self {
            commit,
            seed,
            in_process,
            trials: verdicts.len(),
            machine: computer(),
            first_lines: vec![],
            targets: if is_designed {
                of_designed(&verdicts, ratio)
            } else {
                targets(&verdicts)
            },
            ablations: arms
                .iter()
                .map(|arm| (*arm, ablations(*arm, all)))
                .filter(|(_, lines)| !lines.is_empty())
                .collect(),
            arms: arms.iter().map(|arm| Tally::of(*arm, &verdicts)).collect(),
            programmes: arms
                .iter()
                .filter(|arm| arm.is_designed())
                .map(|arm| Overview::of(*arm, &verdicts))
                .collect(),
            unknown: unknown
                .flat_map(|both| [0.0, 10.0].map(|d| unknown_auroc(&verdicts, both, d)))
                .collect(),
            refusals: refusals(&verdicts),
            not_measured: vec![],
        };
        if is_designed {
            table.first_lines = designed::ten_lines(&table, ratio);
        }
        table
    }

    /// The same with the machines that are in no rate, for they could not be measured.
    pub fn without(mut self, not_measured: Vec<NotMeasured>) -> Self {
        self.not_measured = not_measured;
        self
    }

    /// As it stands on a terminal.
    ///
    /// # Errors
    /// When a diagram cannot be drawn.
    pub fn terminal(&self) -> Result<String> {
        let parts = self.parts()?.into_iter().map(Part::in_text);
        let parts: Vec<String> = parts.map(|section| section.terminal()).collect();
        Ok(format!(
            "{}\n\n{}",
            self.lines().join("\n"),
            parts.join("\n")
        ))
    }

    /// As JSON.
    ///
    /// # Errors
    /// When a number is not finite.
    pub fn json(&self) -> Result<String> {
        Ok(serde_json::to_string_pretty(self)?)
    }

    /// As one HTML file.
    ///
    /// # Errors
    /// When a diagram cannot be drawn.
    pub fn html(&self) -> Result<String> {
        let (lines, parts) = (self.lines(), self.parts()?);
        let report = Report {
            title: self.title().to_owned(),
            lines: vec![],
            parts: vec![],
            screen: Screen::default(),
            body: html! {
                @if !self.first_lines.is_empty() {
                    ol { @for line in &self.first_lines { li { (line) } } }
                }
                @for line in &lines { p { (line) } }
                @for part in &parts {
                    (part.section.html())
                    @if let Some(tally) = part.confused { (confusion::matrix(tally)) }
                }
            },
            figures: serde_json::Value::Null,
        };
        Ok(report.html())
    }

    /// As Markdown.
    ///
    /// # Errors
    /// When a diagram cannot be drawn.
    pub fn markdown(&self) -> Result<String> {
        let mut text = format!("# {}\n\n", self.title());
        append_numbered(&mut text, &self.first_lines);
        for line in self.lines() {
            let _ = writeln!(text, "{line}\n");
        }
        let sections: Vec<Section> = self.parts()?.into_iter().map(Part::in_text).collect();
        append_markdown(&mut text, &sections);
        Ok(text)
    }

    fn is_designed(&self) -> bool {
        !self.programmes.is_empty()
    }

    fn title(&self) -> &'static str {
        if self.is_designed() {
            DESIGNED_TITLE
        } else {
            TITLE
        }
    }

    fn lines(&self) -> Vec<String> {
        let mut lines = vec![format!(
            "{} trials, seed {}, diagnosed by commit {} on {}.",
            self.trials, self.seed, self.commit, self.machine
        )];
        if self.in_process {
            lines.push(
                "Diagnosed within the process that made the trials: not for publication.".into(),
            );
        }
        let least = self.arms.iter().map(|arm| arm.trials).min().unwrap_or(0);
        let wanted = SMALL[usize::from(self.is_designed())];
        if least < wanted {
            lines.push(format!(
                "A small run: {least} trials in the smallest arm, of at least {wanted} that are wanted. Intervals are Wilson's, 95 %."
            ));
        }
        for (reason, count) in &self.refusals {
            lines.push(format!("{count} not diagnosed: {reason}"));
        }
        if !self.not_measured.is_empty() {
            lines.push(format!(
                "{} of {} drawn machines could not be measured and are in no rate.",
                self.not_measured.len(),
                self.not_measured.len() + self.trials
            ));
        }
        lines.extend(self.not_measured.iter().map(ToString::to_string));
        lines
    }

    fn parts(&self) -> Result<Vec<Part<'_>>> {
        let mut parts = vec![Part::plain(protocol::section(&self.targets))];
        let programmes = self.programmes.iter();
        parts.extend(programmes.map(|overview| Part::plain(designed::section(overview))));
        for tally in &self.arms {
            parts.push(Part {
                section: arm::section(tally)?,
                confused: (!tally.confusion.is_empty()).then_some(tally),
            });
        }
        if !self.unknown.is_empty() {
            let mut section = Section::new("Unknown or known");
            section.tables.push(arm::figures(&self.unknown));
            parts.push(Part::plain(section));
        }
        let ablations = self.ablations.iter();
        parts.extend(ablations.map(|(arm, lines)| Part::plain(protocol::ablated(*arm, lines))));
        Ok(parts)
    }
}

/// A section, and the arm of which it tells who was taken for whom.
struct Part<'t> {
    section: Section,
    confused: Option<&'t Tally>,
}

impl Part<'_> {
    fn plain(section: Section) -> Self {
        Self {
            section,
            confused: None,
        }
    }

    /// For where there are only characters.
    fn in_text(self) -> Section {
        let mut section = self.section;
        section.tables.extend(self.confused.map(confusion::pairs));
        section
    }
}

const TITLE: &str = "Blind trials of the diagnosis";
const DESIGNED_TITLE: &str = "Blind trials of designed programmes";

/// Reasons of refusals, each with how often.
fn refusals(verdicts: &[Verdict]) -> Vec<(String, usize)> {
    let mut refusals = Vec::<(String, usize)>::new();
    for reason in verdicts.iter().filter_map(|v| v.refused.clone()) {
        match refusals.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, count)) => *count += 1,
            None => refusals.push((reason, 1)),
        }
    }
    refusals
}

/// A share for a sentence.
pub(crate) fn percent(count: Proportion) -> String {
    let share = count.share();
    share.map_or_else(
        || NOT_TRIED.to_owned(),
        |share| format!("{:.0} %", 100.0 * share),
    )
}

/// What stands where nothing was tried.
pub(crate) const NOT_TRIED: &str = "not tried";

/// What it ran on.
pub(crate) fn computer() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let name = model.map_or("a processor without a name", |(_, name)| name.trim());
    format!("{cores} cores of {name}")
}

/// Appends the lines that a page begins with, numbered.
pub(crate) fn append_numbered(text: &mut String, lines: &[String]) {
    for (number, line) in lines.iter().enumerate() {
        let _ = writeln!(text, "{}. {line}", number + 1);
    }
    if !lines.is_empty() {
        text.push('\n');
    }
}

/// Appends sections as Markdown, which ends with one line break.
pub fn append_markdown(text: &mut String, sections: &[Section]) {
    for section in sections {
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
}

pub(crate) fn markdown_table(rows: &Rows) -> String {
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
