//! The page that a run ends with: on the terminal and as one self-contained HTML file.

use std::path::Path;

use anyhow::{Context, Result};
use maud::Markup;

use terminal::{Part, Room};

use crate::evidence::Evidence;
use crate::scenario::ReportKind;
use crate::whole_file;

pub mod angular;
mod blocks;
pub mod circular;
mod conditions;
pub mod drift;
mod feeds;
pub mod gap;
pub mod geometry;
mod latency;
pub mod lines;
mod page;
pub mod periodic;
pub mod plot;
mod pointed;
pub mod positioning;
pub mod probing;
pub mod published;
mod rotary;
pub mod section;
pub mod stops;
pub mod terminal;
pub mod test_conditions;
mod thermal;
mod tool_error;
mod trace;
pub mod verification;

/// A body as one self-contained HTML text.
pub fn html(title: &str, body: &Markup) -> String {
    page::page(title, body)
}

/// A report before it is laid out.
pub struct Report {
    /// Title.
    pub title: String,
    /// What it found, a sentence each.
    pub lines: Vec<String>,
    /// Its text for a terminal, part by part.
    pub parts: Vec<Part>,
    /// The page's body.
    pub body: Markup,
    /// The figures of the sentences, for machines; lengths in mm, times in s.
    pub figures: serde_json::Value,
}

impl Report {
    /// Writes the report of `kind`.
    ///
    /// # Errors
    /// When a plot cannot be drawn.
    pub fn of(kind: ReportKind, title: &str, evidence: &Evidence) -> Result<Self> {
        match kind {
            ReportKind::Thermal => thermal::write(title, evidence),
            ReportKind::Rotary => rotary::write(title, evidence),
            ReportKind::Latency | ReportKind::Blocks => latency::write(title, evidence),
            ReportKind::Tests | ReportKind::Gap => Ok(Self::of_verifications(title, evidence)),
        }
    }

    /// What a witness saw; the tests themselves are evaluated from the bag.
    fn of_verifications(title: &str, evidence: &Evidence) -> Self {
        let section = verification::section(&evidence.verifications);
        let seen = section.as_ref();
        Self {
            title: title.to_owned(),
            lines: Vec::new(),
            parts: seen.map(Part::of).into_iter().collect(),
            body: maud::html! {
                h1 { (title) }
                @if let Some(section) = seen { (section.html()) }
                (conditions::section(evidence))
            },
            figures: serde_json::json!({
                "title": title,
                "verification": seen.map(|section| &section.figures),
            }),
        }
    }

    /// This report with the tests of its bag behind it.
    pub fn join(&mut self, tests: Self) {
        self.lines.extend(tests.lines);
        self.parts.push(Part::plain("\n"));
        self.parts.extend(tests.parts);
        self.body = maud::html! { (self.body) (tests.body) };
        for key in [
            "conditions",
            "machine_defaults",
            "tests",
            "loss",
            "account",
            "uncertainty",
        ] {
            self.figures[key] = tests.figures[key].clone();
        }
    }

    /// All of the report as it stands on a terminal.
    pub fn terminal(&self) -> String {
        format!("{}{}", self.head(), terminal::whole(&self.parts))
    }

    /// The report in a few lines: the answer, and the tables that matter.
    pub fn short(&self, room: &Room<'_>) -> String {
        terminal::short(&self.lines, &self.parts, room)
    }

    /// What [`Self::terminal`] has before its parts.
    fn head(&self) -> String {
        let lines = self.lines.iter().map(|line| format!("{line}\n"));
        format!("{}\n\n{}\n", self.title, lines.collect::<String>())
    }

    /// This report with another section behind it; its figures as `key`.
    pub fn add(&mut self, key: &str, section: &section::Section) {
        self.parts.push(Part::plain("\n"));
        self.parts.push(Part::of(section));
        self.body = maud::html! { (self.body) (section.html()) };
        self.figures[key] = section.figures.clone();
    }

    /// This report with the conditions of its tests behind it.
    pub fn add_conditions(&mut self, conditions: &test_conditions::Conditions) {
        let text = format!("\n{}", conditions.terminal());
        self.parts.push(Part::plain(text));
        self.body = maud::html! { (self.body) (conditions.section.html()) };
        self.figures["conditions"] = conditions.section.figures.clone();
    }

    /// This report with the diagnosis of its bag behind it.
    pub fn join_gap(&mut self, gap: Self) {
        let head = format!("\n\n{}", gap.head());
        self.parts.push(Part::answers(head, gap.lines));
        self.parts.extend(gap.parts);
        self.body = maud::html! { (self.body) (gap.body) };
        self.figures["gap"] = gap.figures;
    }

    /// This report with what was recognised in its table at its beginning; the lines as `table`.
    pub fn begin_with_table(&mut self, lines: &[String]) {
        self.lines.splice(0..0, lines.iter().cloned());
        self.body = maud::html! {
            (self.body)
            h2 { "The table" }
            ul { @for line in lines { li { (line) } } }
        };
        self.figures["table"] = serde_json::json!(lines);
    }

    /// The page as one HTML text.
    pub fn html(&self) -> String {
        page::page(&self.title, &self.body)
    }

    /// Writes `report.html` and `report.json` into `folder`.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let html = self.html();
        let figures = serde_json::to_string_pretty(&self.figures)?;
        for (name, text) in [("report.html", html), ("report.json", figures)] {
            let path = folder.join(name);
            whole_file::write(&path, &text).context("report")?;
        }
        Ok(())
    }
}
