//! `abbe history add`: figures of bags, folders of runs, and JSON of reports and diagnoses.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::Args;
use gap_diagnosis::GapConfig;
use history::{Kind, Store, gap_figures, report_figures};
use node_runtime::{complain, complaint};
use recorder::Bag;
use replayer::machines;
use reports::evaluate::Tests;
use reports::evaluate::budget::Budget;
use reports::loss;
use serde_json::Value;

use super::dates::{Moment, moment};
use super::keep::{add, complain_of_left_out, entry};
use super::origin::{Origin, joined, json, made_with};
use super::{open_to_write, unmake};
use crate::diagnose::{self, bags};
use crate::report_bag;
use crate::tell::tell;

/// Arguments of `abbe history add`.
#[derive(Args)]
pub struct Add {
    /// Bags, folders of runs (with `report.json` and `bag`), or JSON of `abbe report`, of a run or of `abbe diagnose`.
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// Name of the machine; without it that of the machine file in the bag.
    #[arg(long)]
    machine: Option<String>,
    /// Time of the measurement, for JSON without one: 2026-03-01 or 2026-03-01T12:00:00Z.
    #[arg(long, value_parser = moment)]
    at: Option<Moment>,
    /// Uncertainties for the figures of bags, as `abbe report` takes them.
    #[arg(long)]
    budget: Option<PathBuf>,
    /// Diagnose bags as well, as `abbe diagnose BAG` does.
    #[arg(long)]
    diagnose: bool,
    /// The history: a file, or `postgres://USER@HOST/DATABASE`; without it `~/.local/share/abbe/history.sqlite`.
    #[arg(long, value_name = "STORE")]
    store: Option<PathBuf>,
}

impl Add {
    /// Adds every input; one that fails leaves the others. Exit code 1 when one failed, 3 when a part of one was lost or a figure is no finite number.
    ///
    /// # Errors
    /// When budget or store cannot be opened.
    pub fn execute(self) -> Result<ExitCode> {
        let budget = self.budget.as_deref().map(Budget::open).transpose()?;
        let (mut store, place, is_new) = open_to_write(self.store.as_deref())?;
        let (mut is_whole, mut n_failed) = (true, 0_usize);
        for path in &self.inputs {
            match self.add(path, budget.as_ref(), &mut store) {
                Ok(whole) => is_whole &= whole,
                Err(error) => {
                    n_failed += 1;
                    complain!("abbe: {}", named_once(path, &complaint::in_words(&error)));
                }
            }
        }
        drop(store);
        if is_new && n_failed == self.inputs.len() {
            unmake(&place);
        } else {
            tell!("History: {}", place.display());
        }
        if n_failed > 0 {
            complain!(
                "abbe: {n_failed} of {} inputs were not added",
                self.inputs.len()
            );
            return Ok(ExitCode::FAILURE);
        }
        Ok(loss::exit_code(is_whole))
    }

    /// Adds one input; whether it was whole.
    fn add(&self, path: &Path, budget: Option<&Budget>, store: &mut Store) -> Result<bool> {
        let report = path.join("report.json");
        if path.is_dir() && report.is_file() && path.join("bag").exists() {
            return self.add_run(path, &report, store);
        }
        if path.extension().is_some_and(|ending| ending == "json") {
            return self.add_json(path, store);
        }
        self.add_bag(path, budget, store)
    }

    /// With machine and time as given.
    fn stated(&self, origin: Origin) -> Result<Origin> {
        origin.stated(self.machine.clone(), self.at, "--at")
    }

    fn add_run(&self, folder: &Path, report: &Path, store: &mut Store) -> Result<bool> {
        let (_, figures) = json(report)?;
        let origin = Origin::of_bag(&folder.join("bag"), folder, true)?;
        self.add_report(&figures, origin, store)
    }

    /// Adds a report; whether each of its figures could be kept.
    fn add_report(&self, figures: &Value, origin: Origin, store: &mut Store) -> Result<bool> {
        let origin = self.stated(origin.with_conditions(&figures["conditions"]))?;
        let entry = entry(Kind::Report, report_figures(figures)?, origin)?;
        tell!("{}: {}", entry.source, add(store, &entry)?);
        Ok(complain_of_left_out(figures, &entry.source))
    }

    fn add_json(&self, path: &Path, store: &mut Store) -> Result<bool> {
        let (text, value) = json(path)?;
        let origin = Origin::of_text(&text, path);
        if value.get("schema").is_some() {
            return self.add_gap(&value, origin, store);
        }
        self.add_report(&value, origin.with_made(&value["made"]), store)
    }

    fn add_gap(&self, value: &Value, origin: Origin, store: &mut Store) -> Result<bool> {
        let gap = gap_figures(value)?;
        let mut origin = self.stated(origin)?;
        // A diagnosis is recognised by its bags: its text has the time that it took.
        if !gap.bags.is_empty() {
            origin.sha256 = made_with(&joined(&gap.bags), &gap.made_with);
        }
        origin.machine_sha256 = gap.machine_sha256.or(origin.machine_sha256);
        let entry = entry(Kind::Diagnosis, gap.figures, origin)?;
        tell!("{}: {}", entry.source, add(store, &entry)?);
        Ok(complain_of_left_out(value, &entry.source))
    }

    fn add_bag(&self, path: &Path, budget: Option<&Budget>, store: &mut Store) -> Result<bool> {
        let bag = Bag::open(path)?;
        machines::check(bag.topics())?;
        let tests = Tests::of(&bag);
        loss::complain_of(&tests.reading);
        let page = report_bag::page("", &tests, budget)?;
        let origin = Origin::of_bag(path, path, true)?;
        let mut is_whole = self.add_report(&page.figures, origin.clone(), store)?;
        if self.diagnose {
            let (name, text) = bags::machine_text(path)?;
            let paths = [path.to_owned()];
            let found =
                diagnose::of(&paths, &name, &text, &GapConfig::default()).context("diagnosis")?;
            is_whole &= self.add_gap(&found.json()?, origin, store)? && found.omitted.is_empty();
        }
        for run in &tests.not_evaluated {
            complain!("abbe: {run}");
        }
        Ok(is_whole && tests.is_whole())
    }
}

/// What is wrong with an input, with its path once.
fn named_once(path: &Path, said: &str) -> String {
    let path = path.display().to_string();
    if said.starts_with(&path) {
        said.to_owned()
    } else {
        format!("{path}: {said}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_no_json_is_named_once_with_line_column_and_remedy() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("report.json");
        for (text, place) in [
            ("{\"a\": NaN}", "line 1, column 7"),
            ("{\n\"a\": 1,\n}", "line 3, column 1"),
            ("hello", "line 1, column 1"),
            ("", "line 1, column 0"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = json(&path).unwrap_err();
            let said = named_once(&path, &complaint::in_words(&error));
            let name = path.display().to_string();
            assert_eq!(said.matches(&name).count(), 1, "{said}");
            for words in [place, ": is no JSON (", "abbe report --json"] {
                assert!(said.contains(words), "{said}");
            }
        }
        let other = named_once(&path, "names no machine");
        assert_eq!(other, format!("{}: names no machine", path.display()));
    }
}
