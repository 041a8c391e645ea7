//! `abbe run SCENARIO`: its nodes, its plan, a bag and a page at the end.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::Args;
use node_runtime::Interruption;
use node_runtime::complain;
use recorder::Bag;

use crate::diagnose;
use crate::evaluate::Tests;
use crate::evidence::Evidence;
use crate::report::Report;
use crate::report::section::Section;
use crate::report_bag;
use crate::scenario::{ReportKind, Scenario};
use crate::tell::tell;
use crate::usage::refused;

mod bag;
mod composed;
mod live;
mod mirror;
mod shortcomings;
mod table_trial;

use table_trial::TableTrial;

/// Arguments of `abbe run`.
#[derive(Args)]
pub struct Run {
    /// Folder of the scenario, e.g. `launch_configs/first_run`.
    scenario: PathBuf,
    /// Folder in which runs are kept, each in a new one of its own.
    #[arg(long, default_value = "runs")]
    runs: PathBuf,
    /// Was the name of `--runs`.
    #[arg(long, hide = true, value_parser = renamed)]
    out: Option<String>,
    /// Stay off the network: nothing is published on DDS. Only in simulated time, for in real time the nodes meet there.
    #[arg(long)]
    no_dds: bool,
    /// Go no faster than this many times real time (0: as fast as it can).
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pace: f64,
    /// Run every node as a process of its own, on DDS and in real time.
    #[arg(long)]
    separate: bool,
}

fn renamed(_: &str) -> Result<String, &'static str> {
    Err(
        "for `run` it is called --runs: the folder in which runs are kept; --out is where `report` and `export` write",
    )
}

/// Why a plan that was called off did not run to its end.
const INTERRUPTED: &str = "it was interrupted";
/// Exit code of a plan that was called off and ended in good order: what shells give a program that Ctrl-C ended.
const CALLED_OFF: u8 = 130;

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
    /// Runs the scenario; exit code 1 when its plan failed, 130 when it was called off.
    ///
    /// # Errors
    /// When the scenario cannot be read, a node not built, or the bag not written.
    pub fn execute(self) -> Result<ExitCode> {
        if !(self.pace.is_finite() && self.pace >= 0.0) {
            let reason = format!("--pace {}: must be 0 or a finite number above", self.pace);
            return Err(refused("run", reason));
        }
        let scenario = Scenario::read(&self.scenario)?;
        if self.no_dds && !self.is_composed(&scenario) {
            let reason = "--no-dds: the nodes of a run in real time meet on the network; only a scenario with simulated_start_s can do without, and not with --separate";
            return Err(refused("run", reason));
        }
        let interruption = Interruption::listen("the bag is closed, no page is written")?;
        let folder = new_folder(&self.runs, &scenario.name)?;
        let ended = self.run_into(&folder, &scenario, &interruption);
        if ended.is_err() {
            // Where nothing came into it, it tells nothing; one that holds something is not taken away.
            let _ = std::fs::remove_dir(&folder);
        }
        ended
    }

    /// Whether it runs in simulated time, within one process.
    fn is_composed(&self, scenario: &Scenario) -> bool {
        scenario.file.simulated_start_s.is_some() && !self.separate
    }

    fn run_into(
        &self,
        folder: &Path,
        scenario: &Scenario,
        interruption: &Interruption,
    ) -> Result<ExitCode> {
        let bag = folder.join("bag");
        let mut outcome = match scenario.file.simulated_start_s {
            Some(start_s) if self.is_composed(scenario) => {
                let how = composed::How {
                    pace: self.pace,
                    on_dds: !self.no_dds,
                    interruption,
                };
                composed::run(scenario, start_s, &bag, how)?
            }
            _ => live::run(scenario, &bag, self.separate, interruption)?,
        };
        if interruption.is_forced() {
            tell!("Bag:  {}", outcome.kept(&bag));
            complain!("abbe: the end was forced: no page was written");
            return Ok(ExitCode::FAILURE);
        }
        let title = format!("{}: {}", scenario.name, scenario.file.title);
        let mut report = Report::of(scenario.file.report, &title, &outcome.evidence)?;
        if scenario.file.report == ReportKind::Tests && outcome.recorded > 0 {
            complain!("Evaluating the tests of {}", bag.display());
            let tests = Tests::of(&Bag::open(&bag)?)?;
            report.join(report_bag::page("", &tests, scenario.budget()?.as_ref())?);
        }
        if outcome.failure.is_none() {
            match self.try_table(scenario, folder, interruption) {
                Ok(Some(section)) => report.add("linuxcnc_table", &section),
                Ok(None) => {}
                Err(error) => outcome.failure = Some(format!("{error:#}")),
            }
        }
        if scenario.file.diagnose && outcome.recorded > 0 {
            let machine = scenario.folder.join("machine.yaml");
            report.join_gap(&diagnose::of_run(&bag, folder, &machine)?);
        }
        let kept = format!("Bag: {}.", outcome.kept(&bag));
        report.body = maud::html! { (report.body) h2 { "Recording" } p { (kept) } };
        report.write(folder)?;
        tell!("{}", report.terminal());
        tell!("Bag:  {}", outcome.kept(&bag));
        tell!("Page: {}", folder.join("report.html").display());
        Ok(outcome.end())
    }

    fn try_table(
        &self,
        scenario: &Scenario,
        folder: &Path,
        interruption: &Interruption,
    ) -> Result<Option<Section>> {
        let Some(table) = &scenario.file.linuxcnc_table else {
            return Ok(None);
        };
        let trial = TableTrial {
            scenario,
            table,
            folder,
            separate: self.separate,
            interruption,
        };
        trial.run(&folder.join("bag")).map(Some)
    }
}

impl Outcome {
    /// The bag in a few words.
    fn kept(&self, bag: &Path) -> String {
        let (recorded, lost) = (self.recorded, self.lost);
        format!("{} ({recorded} messages, {lost} lost)", bag.display())
    }

    /// Says what did not work; the exit code.
    fn end(self) -> ExitCode {
        let shortcomings = shortcomings::of(&self.evidence, self.lost);
        if !shortcomings.is_empty() {
            complain!("abbe: what did not go as told:");
        }
        for line in &shortcomings {
            complain!("abbe:   {line}");
        }
        match self.failure {
            None => ExitCode::SUCCESS,
            Some(reason) if reason == INTERRUPTED => {
                complain!("abbe: the plan did not run to its end: {reason}");
                ExitCode::from(CALLED_OFF)
            }
            Some(reason) => {
                complain!("abbe: the plan failed: {reason}");
                ExitCode::FAILURE
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
