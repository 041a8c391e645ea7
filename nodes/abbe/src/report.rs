//! The page that a run ends with: on the terminal and as one self-contained HTML file.

use std::path::Path;

use anyhow::{Context, Result};
use maud::Markup;

use crate::evidence::Evidence;
use crate::scenario::ReportKind;

mod blocks;
mod conditions;
mod feeds;
mod latency;
mod page;
mod plot;
mod rotary;
mod thermal;
mod tool_error;

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

    /// Writes `report.html` and `report.json` into `folder`.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let html = page::page(&self.title, &self.body);
        let figures = serde_json::to_string_pretty(&self.figures)?;
        for (name, text) in [("report.html", html), ("report.json", figures)] {
            let path = folder.join(name);
            std::fs::write(&path, text).with_context(|| format!("report {}", path.display()))?;
        }
        Ok(())
    }
}
