//! The page that a run ends with: on the terminal and as one self-contained HTML file.

use std::path::Path;

use anyhow::{Context, Result};
use maud::Markup;

use crate::evidence::Evidence;
use crate::scenario::ReportKind;

mod blocks;
pub mod circular;
mod conditions;
mod feeds;
pub mod gap;
pub mod geometry;
mod latency;
mod page;
pub mod plot;
pub mod positioning;
pub mod probing;
pub mod published;
mod rotary;
pub mod section;
pub mod stops;
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
    /// Tables for a terminal.
    pub text: String,
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
            text: seen.map_or_else(String::new, section::Section::terminal),
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
        self.text.push('\n');
        self.text.push_str(&tests.text);
        self.body = maud::html! { (self.body) (tests.body) };
        for key in ["tests", "loss", "uncertainty"] {
            self.figures[key] = tests.figures[key].clone();
        }
    }

    /// The report as it stands on a terminal.
    pub fn terminal(&self) -> String {
        let mut text = format!("{}\n\n", self.title);
        for line in &self.lines {
            text.push_str(line);
            text.push('\n');
        }
        text.push('\n');
        text.push_str(&self.text);
        text
    }

    /// This report with another section behind it; its figures as `key`.
    pub fn add(&mut self, key: &str, section: &section::Section) {
        self.text.push('\n');
        self.text.push_str(&section.terminal());
        self.body = maud::html! { (self.body) (section.html()) };
        self.figures[key] = section.figures.clone();
    }

    /// This report with the diagnosis of its bag behind it.
    pub fn join_gap(&mut self, gap: &Self) {
        self.text.push_str("\n\n");
        self.text.push_str(&gap.terminal());
        self.body = maud::html! { (self.body) (gap.body) };
        self.figures["gap"] = gap.figures.clone();
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
            std::fs::write(&path, text).with_context(|| format!("report {}", path.display()))?;
        }
        Ok(())
    }
}
