//! `abbe report BAG`: the tests of a bag, evaluated.

use node_runtime::complain;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::Args;
use maud::html;
use recorder::{Bag, Loss};

use crate::evaluate::Tests;
use crate::evaluate::budget::Budget;
use crate::evaluate::limits::Limits;
use crate::report::section::Section;
use crate::report::{self, Report};
use crate::tell::tell;

/// Arguments of `abbe report`.
#[derive(Args)]
pub struct ReportBag {
    /// Folder of the bag.
    bag: PathBuf,
    /// What is not known about the measurements: the expanded uncertainties of ISO 230-2, -4 and -6 come from it and are not
    /// stated without it. What fits say of themselves (geometric errors, causes of circles) is stated in any case.
    #[arg(long)]
    budget: Option<PathBuf>,
    /// Limits of figures, which are then judged by ISO 14253-1 with the uncertainties of --budget, which it needs; an example
    /// is launch_configs/dual_loop/limits.yaml.
    #[arg(long, requires = "budget")]
    limits: Option<PathBuf>,
    /// Folder to write `report.html` and `report.json` into; without it the terminal alone.
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
        let limits = self.limits.as_deref().map(read_limits).transpose()?;
        complain!("Evaluating the tests of {}", self.bag.display());
        let bag = Bag::open(&self.bag)?;
        let tests = Tests::of(&bag).with_context(|| format!("bag {}", self.bag.display()))?;
        for loss in &tests.losses {
            complain!("abbe: {loss}");
        }
        let title = format!("Tests in {}", self.bag.display());
        let report = judged_page(&title, &tests, budget.as_ref(), limits.as_ref())?;
        if self.json {
            tell!("{}", serde_json::to_string_pretty(&report.figures)?);
        } else {
            tell!("{}", report.terminal());
        }
        if let Some(out) = &self.out {
            std::fs::create_dir_all(out).with_context(|| format!("folder {}", out.display()))?;
            report.write(out)?;
        }
        Ok(if tests.losses.is_empty() {
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

fn read_limits(path: &Path) -> Result<Limits> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("limits file {}", path.display()))?;
    Limits::read(&text, path)
}

/// The page of everything that `tests` hold.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn page(title: &str, tests: &Tests, budget: Option<&Budget>) -> Result<Report> {
    judged_page(title, tests, budget, None)
}

/// The same with the figures judged by their limits.
fn judged_page(
    title: &str,
    tests: &Tests,
    budget: Option<&Budget>,
    limits: Option<&Limits>,
) -> Result<Report> {
    let mut sections = sections(tests, budget)?;
    let mut lines = losses_in_words(&tests.losses);
    if sections.is_empty() {
        lines.push("The bag holds no test that can be evaluated.".to_owned());
    }
    let mut figures: Vec<serde_json::Value> = sections
        .iter()
        .map(|section| section.figures.clone())
        .filter(|figures| !figures.is_null())
        .collect();
    if budget.is_none() {
        figures.iter_mut().for_each(unstate);
    }
    let judged = limits.map(|limits| limits.section(&figures)).transpose()?;
    let conformance = judged.as_ref().map(|section| section.figures.clone());
    sections.extend(judged);
    Ok(Report {
        title: title.to_owned(),
        text: sections
            .iter()
            .map(Section::terminal)
            .collect::<Vec<_>>()
            .join("\n"),
        body: html! {
            @if !title.is_empty() { h1 { (title) } }
            @for line in &lines { p.bad[!tests.losses.is_empty()] { (line) } }
            @for section in &sections { (section.html()) }
        },
        figures: serde_json::json!({
            "title": title,
            "loss": losses(&tests.losses),
            "uncertainty": uncertainty(budget.is_some()),
            "tests": figures,
            "conformance": conformance,
        }),
        lines,
    })
}

/// The head of a page whose bag is not whole.
fn losses_in_words(losses: &[Loss]) -> Vec<String> {
    let Some(last) = losses.last() else {
        return Vec::new();
    };
    let n = last.messages_read;
    let mut lines = vec![format!(
        "NOT WHOLE: a part of this bag was lost. Everything below comes from what could be read, {n} messages before the last gap; a test that was cut off is missing or has fewer readings."
    )];
    lines.extend(losses.iter().map(|loss| format!("Lost: {loss}.")));
    lines
}

/// The same for machines; null: the bag is whole.
fn losses(losses: &[Loss]) -> serde_json::Value {
    let places: Vec<serde_json::Value> = losses
        .iter()
        .map(|loss| {
            serde_json::json!({
                "file": loss.file.display().to_string(),
                "at_byte": loss.at_byte,
                "reason": loss.reason.to_string(),
                "messages_read_before": loss.messages_read,
            })
        })
        .collect();
    if places.is_empty() {
        serde_json::Value::Null
    } else {
        serde_json::json!({ "places": places })
    }
}

fn uncertainty(stated: bool) -> serde_json::Value {
    if stated {
        serde_json::json!({ "stated": true })
    } else {
        serde_json::json!({
            "stated": false,
            "reason": "no budget was given (--budget): the expanded uncertainties of ISO 230-2, -4 and -6 are null; standard uncertainties are those of fits, which need none",
        })
    }
}

/// Figures that had no budget to be computed from have no expanded uncertainty, not one of zero.
fn unstate(figures: &mut serde_json::Value) {
    match figures {
        serde_json::Value::Object(entries) => {
            for (key, value) in entries {
                if key.starts_with("expanded_uncertainty") {
                    *value = serde_json::Value::Null;
                } else {
                    unstate(value);
                }
            }
        }
        serde_json::Value::Array(values) => values.iter_mut().for_each(unstate),
        _ => {}
    }
}

fn sections(tests: &Tests, budget: Option<&Budget>) -> Result<Vec<Section>> {
    let mut sections = report::positioning::sections(&tests.linear, budget)?;
    sections.extend(report::stops::section(&tests.stops));
    sections.extend(report::geometry::tables(&tests.tables));
    sections.extend(report::circular::sections(&tests.circles, budget)?);
    if let Some(circle) = &tests.station_circle {
        sections.extend(report::published::sections(circle, tests.geometry.as_ref()));
    }
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

#[cfg(test)]
mod tests {
    use recorder::LossReason;

    use super::*;

    fn cut() -> Loss {
        Loss {
            file: "bag_0.mcap".into(),
            at_byte: 4000,
            reason: LossReason::Cut {
                opcode: 6,
                end_byte: 4096,
            },
            messages_read: 17,
        }
    }

    #[test]
    fn a_bag_that_was_cut_is_marked_at_the_head_of_every_form() {
        let tests = Tests {
            losses: vec![cut()],
            ..Tests::default()
        };
        let report = page("Tests in bag", &tests, None).unwrap();
        let terminal = report.terminal();
        let head: Vec<&str> = terminal.lines().skip(2).take(2).collect();
        assert!(head[0].starts_with("NOT WHOLE: "), "{terminal}");
        let place = "bag_0.mcap, byte 4000: the file was read up to its end at byte 4096";
        assert!(head[1].contains(place), "{terminal}");
        assert!(head[1].contains("what followed is unknown"), "{terminal}");
        let html = report.body.into_string();
        assert!(html.contains("<p class=\"bad\">NOT WHOLE"), "{html}");
        let place = &report.figures["loss"]["places"][0];
        assert_eq!(place["at_byte"], 4000);
        assert_eq!(place["messages_read_before"], 17);
        let whole = page("", &Tests::default(), None).unwrap();
        assert!(whole.figures["loss"].is_null());
        assert!(!whole.terminal().contains("NOT WHOLE"));
    }

    #[test]
    fn without_a_budget_no_figure_has_an_expanded_uncertainty() {
        let mut figures = serde_json::json!({
            "a": {"value_mm": 0.1, "expanded_uncertainty_mm": 0.0},
            "b": [{"expanded_uncertainty_rad": 0.0, "standard_uncertainty_mm": 0.2}],
        });
        unstate(&mut figures);
        let expected = serde_json::json!({
            "a": {"value_mm": 0.1, "expanded_uncertainty_mm": null},
            "b": [{"expanded_uncertainty_rad": null, "standard_uncertainty_mm": 0.2}],
        });
        assert_eq!(figures, expected);
        let report = page("", &Tests::default(), None).unwrap();
        assert_eq!(report.figures["uncertainty"]["stated"], false);
        let reason = report.figures["uncertainty"]["reason"].as_str().unwrap();
        assert!(reason.contains("--budget"), "{reason}");
        assert!(reason.contains("ISO 230-2, -4 and -6"), "{reason}");
        assert!(reason.contains("those of fits"), "{reason}");
    }
}
