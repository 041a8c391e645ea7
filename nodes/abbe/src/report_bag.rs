//! `abbe report BAG`: the tests of a bag, evaluated.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::Args;
use maud::html;
use recorder::Bag;

use crate::evaluate::Tests;
use crate::evaluate::budget::Budget;
use crate::report::section::Section;
use crate::report::{self, Report};

/// Arguments of `abbe report`.
#[derive(Args)]
pub struct ReportBag {
    /// Folder of the bag.
    bag: PathBuf,
    /// What is not known about the measurements; without it no uncertainty is stated.
    #[arg(long)]
    budget: Option<PathBuf>,
    /// Folder for `report.html` and `report.json`; without it the terminal alone.
    #[arg(long)]
    out: Option<PathBuf>,
    /// The figures as JSON instead of text.
    #[arg(long)]
    json: bool,
}

/// Exit code for a bag that was read with loss.
const DONE_WITH_LOSS: u8 = 3;

impl ReportBag {
    /// Evaluates the bag; exit code 3 when a part of it was lost.
    ///
    /// # Errors
    /// When bag or budget cannot be read, or the page not written.
    pub fn execute(self) -> Result<ExitCode> {
        let budget = self.budget.as_deref().map(read_budget).transpose()?;
        let bag = Bag::open(&self.bag).with_context(|| format!("bag {}", self.bag.display()))?;
        let tests = Tests::of(&bag).with_context(|| format!("bag {}", self.bag.display()))?;
        let title = format!("Tests in {}", self.bag.display());
        let report = page(&title, &tests, budget.as_ref())?;
        if self.json {
            println!("{}", serde_json::to_string_pretty(&report.figures)?);
        } else {
            println!("{}", report.terminal());
        }
        if let Some(out) = &self.out {
            std::fs::create_dir_all(out).with_context(|| format!("folder {}", out.display()))?;
            report.write(out)?;
        }
        for remark in &tests.remarks {
            eprintln!("abbe: {remark}");
        }
        Ok(if tests.remarks.is_empty() {
            ExitCode::SUCCESS
        } else {
            ExitCode::from(DONE_WITH_LOSS)
        })
    }
}

fn read_budget(path: &Path) -> Result<Budget> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("budget file {}", path.display()))?;
    Budget::read(&text, path)
}

/// The page of everything that `tests` hold.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn page(title: &str, tests: &Tests, budget: Option<&Budget>) -> Result<Report> {
    let sections = sections(tests, budget)?;
    let lines = if sections.is_empty() {
        vec!["The bag holds no test that can be evaluated.".to_owned()]
    } else {
        Vec::new()
    };
    let figures: Vec<&serde_json::Value> = sections
        .iter()
        .map(|section| &section.figures)
        .filter(|figures| !figures.is_null())
        .collect();
    Ok(Report {
        title: title.to_owned(),
        text: sections
            .iter()
            .map(Section::terminal)
            .collect::<Vec<_>>()
            .join("\n"),
        body: html! {
            @if !title.is_empty() { h1 { (title) } }
            @for line in &lines { p { (line) } }
            @for section in &sections { (section.html()) }
        },
        figures: serde_json::json!({ "title": title, "tests": figures }),
        lines,
    })
}

fn sections(tests: &Tests, budget: Option<&Budget>) -> Result<Vec<Section>> {
    let mut sections = report::positioning::sections(&tests.linear, budget)?;
    sections.extend(report::geometry::tables(&tests.tables));
    sections.extend(report::circular::sections(&tests.circles, budget)?);
    for (name, model) in [
        ("Geometric errors of the linear axes", &tests.geometry),
        ("Geometric errors of the rotary axes", &tests.rotary),
    ] {
        sections.extend(
            model
                .as_ref()
                .map(|model| report::geometry::section(name, model)),
        );
    }
    sections.extend(report::probing::sections(
        &tests.touches,
        &tests.features,
        &tests.blocks,
    )?);
    Ok(sections)
}
