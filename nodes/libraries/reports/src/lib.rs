//! Reports: what bags hold, evaluated, and laid out for a terminal and as one self-contained HTML file.
#![cfg_attr(not(test), warn(clippy::print_stderr))]

use std::path::Path;

use anyhow::{Context, Result};
use maud::Markup;
use schemars::JsonSchema;
use serde::Deserialize;

use minus::with_minus_signs;
use screen::{Made, Screen, Tone};
use terminal::{Part, Room};

use evidence::Evidence;

pub mod angular;
mod bars;
mod blocks;
pub mod circular;
mod conditions;
pub mod drift;
pub mod evaluate;
pub mod evidence;
mod feeds;
pub mod gap;
pub mod geometry;
mod latency;
pub mod lines;
pub mod loss;
pub mod machine_defaults;
pub mod machine_of_bag;
mod minus;
mod over_time;
pub mod page;
pub mod paths;
pub mod periodic;
pub mod plot;
mod pointed;
pub mod positioning;
mod predictions;
pub mod probing;
pub mod published;
mod rotary;
pub mod screen;
pub mod section;
pub mod stops;
mod svg;
pub mod terminal;
pub mod test_conditions;
mod thermal;
mod tool_error;
mod trace;
mod vectors;
pub mod verification;
pub mod whole_file;

/// Which page a run ends with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReportKind {
    /// Latency, drift at the blocks, tool error against the truth.
    Thermal,
    /// Latency and corrected points per feed.
    Latency,
    /// Block cycles.
    Blocks,
    /// Location errors of the rotary axes, tool error before and after their compensation.
    Rotary,
    /// The diagnosis of simulator against machine alone (with `diagnose`).
    Gap,
    /// Every test that the bag holds, and the tool error where it was verified.
    Tests,
}

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
    /// The page's first screen.
    pub screen: Screen,
    /// The page's body below it.
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
        let mut screen = verification::screen(&evidence.verifications);
        screen.behind.push(conditions::section(evidence));
        Self {
            title: title.to_owned(),
            lines: Vec::new(),
            parts: seen.map(Part::of).into_iter().collect(),
            screen,
            body: maud::html! { @if let Some(section) = seen { (section.html()) } },
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
        self.screen.join(tests.screen);
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
        let text = format!("{}{}", self.head(), terminal::whole(&self.parts));
        with_minus_signs(&text).into_owned()
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

    /// This report with tests of its bag behind it, but for details; without a budget nothing of them has an uncertainty.
    pub fn add_tests(&mut self, sections: &[section::Section], is_budget_stated: bool) {
        let shown = sections
            .iter()
            .filter(|one| one.rank < terminal::Rank::Detail);
        let shown: Vec<&section::Section> = shown.collect();
        for section in &shown {
            self.parts.push(Part::plain("\n"));
            self.parts.push(Part::of(section));
        }
        self.body = maud::html! { (self.body) @for section in &shown { (section.html()) } };
        let mut figures: Vec<serde_json::Value> =
            shown.iter().map(|one| one.figures.clone()).collect();
        if !is_budget_stated {
            figures.iter_mut().for_each(evaluate::budget::unstate);
        }
        self.figures["tests"] = figures.into();
    }

    /// This report with the conditions of its tests behind it.
    pub fn add_conditions(&mut self, conditions: &test_conditions::Conditions) {
        let text = format!("\n{}", conditions.terminal());
        self.parts.push(Part::plain(text));
        self.screen.behind.push(conditions.section.html());
        self.screen.conditions.clone_from(&conditions.facts);
        self.figures["conditions"] = conditions.section.figures.clone();
    }

    /// This report with the diagnosis of its bag behind it.
    pub fn join_gap(&mut self, gap: Self) {
        let head = format!("\n\n{}", gap.head());
        self.parts.push(Part::answers(head, gap.lines));
        self.parts.extend(gap.parts);
        // A page with a verdict of its own is about that; otherwise the diagnosis comes before the tests that it rests on.
        let has_verdict = self.screen.verdict.is_some();
        let below = gap.screen.picture.as_ref();
        let below = below.filter(|_| self.screen.picture.is_some());
        let diagnosis = maud::html! {
            h2 { (gap.title) }
            @if let Some(picture) = below { (picture) }
            (gap.body)
        };
        self.body = maud::html! {
            @if !has_verdict { (diagnosis) }
            (self.body)
            @if has_verdict { (diagnosis) }
        };
        self.screen.join(gap.screen);
        self.figures["gap"] = gap.figures;
    }

    /// This report with what was recognised in its table at its beginning; the lines as `table`.
    pub fn begin_with_table(&mut self, lines: &[String]) {
        self.lines.splice(0..0, lines.iter().cloned());
        let recognised = maud::html! { ul { @for line in lines { li { (line) } } } };
        let folded = page::fold("The table", None, false, &recognised);
        self.screen.behind.insert(0, folded);
        self.figures["table"] = serde_json::json!(lines);
    }

    /// States machine, time and software on the first screen, and as `made` of the figures.
    pub fn made(&mut self, made: Made) {
        self.figures["made"] = made.as_json();
        self.screen.made = Some(made);
    }

    /// States on the first screen what did not go as planned; `failure`: why the plan did not run to its end.
    pub fn state_shortcomings(&mut self, failure: Option<&str>, shortcomings: Vec<String>) {
        if let Some(failure) = failure {
            let sentence = format!("The plan did not run to its end: {failure}.");
            self.screen.lacks.insert(0, sentence.clone());
            self.screen.verdict = Some((sentence, Tone::Bad));
        }
        self.screen.lacks.extend(shortcomings);
    }

    /// The page as one HTML text: the first screen, the parts, and at the end under which conditions they were measured.
    pub fn html(&self) -> String {
        let body = maud::html! {
            (self.screen.html(&self.title))
            (self.body)
            @for part in &self.screen.behind { (part) }
        };
        page::page(&self.title, &body)
    }

    /// Writes `report.html` and `report.json` into `folder`, the page first.
    ///
    /// # Errors
    /// When a file cannot be written, by its path; one that was written before it stays.
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
