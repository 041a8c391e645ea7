//! `abbe run SCENARIO`: its nodes, its plan, a bag and a page at the end.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::Args;
use recorder::Bag;

use crate::diagnose;
use crate::evaluate::Tests;
use crate::evidence::Evidence;
use crate::report::Report;
use crate::report_bag;
use crate::scenario::{ReportKind, Scenario};

mod bag;
mod composed;
mod live;
mod mirror;

/// Arguments of `abbe run`.
#[derive(Args)]
pub struct Run {
    /// Folder of the scenario, e.g. `launch_configs/first_run`.
    scenario: PathBuf,
    /// Where runs are kept.
    #[arg(long, default_value = "runs")]
    out: PathBuf,
    /// Stay off the network: nothing is published on DDS.
    #[arg(long)]
    no_dds: bool,
    /// Go no faster than this many times real time (0: as fast as it can).
    #[arg(long, default_value_t = 0.0)]
    pace: f64,
    /// Run every node as a process of its own, on DDS and in real time.
    #[arg(long)]
    separate: bool,
}

/// What a runner leaves behind.
pub struct Outcome {
    /// What was seen.
    pub evidence: Evidence,
    /// Why the plan did not run to its end.
    pub failure: Option<String>,
    /// Messages in the bag.
    pub recorded: u64,
    /// Messages lost on their way to the bag.
    pub lost: u64,
}

impl Run {
    /// Runs the scenario; exit code 1 when its plan failed.
    ///
    /// # Errors
    /// When the scenario cannot be read, a node not built, or the bag not written.
    pub fn execute(self) -> Result<ExitCode> {
        if !(self.pace.is_finite() && self.pace >= 0.0) {
            bail!("--pace {}: must be 0 or a finite number above", self.pace);
        }
        let scenario = Scenario::read(&self.scenario)?;
        let folder = new_folder(&self.out, &scenario.name)?;
        let bag = folder.join("bag");
        let outcome = match scenario.file.simulated_start_s {
            Some(start_s) if !self.separate => {
                composed::run(&scenario, start_s, &bag, self.pace, !self.no_dds)?
            }
            _ => live::run(&scenario, &bag, self.separate)?,
        };
        let title = format!("{}: {}", scenario.name, scenario.file.title);
        let mut report = Report::of(scenario.file.report, &title, &outcome.evidence)?;
        if scenario.file.report == ReportKind::Tests && outcome.recorded > 0 {
            let tests = Tests::of(&Bag::open(&bag)?)?;
            report.join(report_bag::page("", &tests, scenario.budget()?.as_ref())?);
        }
        if scenario.file.diagnose && outcome.recorded > 0 {
            let machine = scenario.folder.join("machine.yaml");
            report.join_gap(&diagnose::of_run(&bag, &folder, &machine)?);
        }
        let kept = format!(
            "Bag: {} ({} messages, {} lost).",
            bag.display(),
            outcome.recorded,
            outcome.lost
        );
        report.body = maud::html! { (report.body) h2 { "Recording" } p { (kept) } };
        report.write(&folder)?;
        println!("{}", report.terminal());
        println!(
            "Bag:  {} ({} messages, {} lost)",
            bag.display(),
            outcome.recorded,
            outcome.lost
        );
        println!("Page: {}", folder.join("report.html").display());
        match outcome.failure {
            None => Ok(ExitCode::SUCCESS),
            Some(reason) => {
                eprintln!("abbe: the plan failed: {reason}");
                Ok(ExitCode::FAILURE)
            }
        }
    }
}

/// A fresh folder `<out>/<scenario>-<time>`.
fn new_folder(out: &Path, name: &str) -> Result<PathBuf> {
    let time = chrono::Local::now().format("%Y%m%d-%H%M%S");
    for attempt in 1..100 {
        let suffix = if attempt == 1 {
            String::new()
        } else {
            format!("-{attempt}")
        };
        let folder = out.join(format!("{name}-{time}{suffix}"));
        std::fs::create_dir_all(out).with_context(|| format!("folder {}", out.display()))?;
        match std::fs::create_dir(&folder) {
            Ok(()) => return Ok(folder),
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error).with_context(|| format!("{}", folder.display())),
        }
    }
    bail!(
        "{}: 99 runs of this second are there already",
        out.display()
    );
}
