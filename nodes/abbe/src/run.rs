//! `abbe run SCENARIO`: its nodes, its plan, a bag and a page at the end.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::Args;
use live_view_node::View;
use node_runtime::Interruption;
use node_runtime::complain;
use node_runtime::environment::Environment;
use recorder::Bag;
use reports::Report;
use reports::ReportKind;
use reports::evaluate::Tests;
use reports::evaluate::test_conditions::TestConditions;
use reports::evidence::Evidence;
use reports::loss;
use reports::page::fold;
use reports::probing;
use reports::screen::Made;
use reports::section::Section;
use reports::terminal::{MOST_LINES, Room};
use reports::test_conditions;

use crate::SOFTWARE;
use crate::alarm;
use crate::diagnose;
use crate::history::alarms::{self, Alarms, LimitsOption};
use crate::history::keep::Keep;
use crate::history::origin::Origin;
use crate::report_bag;
use crate::scenario::{Scenario, check_machines, places};
use crate::tell::tell;
use crate::usage::refused;

mod bag;
mod composed;
mod live;
mod mirror;
mod serve;
mod shortcomings;
mod simulated_latency;
mod table_trial;
mod true_causes;
mod unwritten;

use serve::ServeOptions;
use table_trial::TableTrial;
use unwritten::Unwritten;

/// Arguments of `abbe run`.
#[derive(Args)]
pub struct Run {
    /// Name of a scenario, such as `first_run`, or its folder; `--list` lists those that are found by name.
    #[arg(required_unless_present = "list")]
    scenario: Option<PathBuf>,
    /// List the scenarios that are found by name, each with its title.
    #[arg(long, conflicts_with = "scenario")]
    list: bool,
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
    /// Print why each cause of a diagnosis has its status: every check with value, limit and verdict.
    #[arg(long)]
    explain: bool,
    /// Print every table and remark, instead of the answer and three tables in at most 40 lines; `--explain` does too.
    #[arg(long)]
    full: bool,
    #[command(flatten)]
    served: ServeOptions,
    #[command(flatten)]
    keep: Keep,
    #[command(flatten)]
    limits: LimitsOption,
}

fn renamed(_: &str) -> Result<String, &'static str> {
    Err(
        "for `run` it is called --runs: the folder in which runs are kept; --out is where `report` and `export` write",
    )
}

/// Who states on `/diagnostics` how figures stand to their limits.
const RUN_NAME: &str = "abbe_run";
/// Why a plan that was called off did not run to its end.
const INTERRUPTED: &str = "it was interrupted";
/// How many times real time a run may be held to: slower than a thousandth nobody waits, and faster none is.
const PACES: RangeInclusive<f64> = 1e-3..=1e6;
/// Why a plan was called off whose recording failed; the reason follows.
const NOT_RECORDED: &str = "called off, since the bag cannot be written any more";
/// Why the figures of a plan that ran to its end are not kept.
const NOTHING_TO_KEEP: &str = "--keep: the plan ran to its end, but its bag holds no message, so there is no figure to keep: record the topics of its tests (scenario.yaml: recording.exclude)";
/// Exit code of a plan that was called off and ended in good order: what shells give a program that Ctrl-C ended.
const CALLED_OFF: u8 = 130;

/// Prints the scenarios that are found by name.
fn list() -> Result<ExitCode> {
    let homes = places::list()?;
    if homes.is_empty() {
        bail!(
            "no scenario is found by name: change to a folder with launch_configs, or give the path of a scenario"
        );
    }
    for (n, (home, scenarios)) in homes.iter().enumerate() {
        if n > 0 {
            tell!("");
        }
        tell!("{}", home.display());
        let width = scenarios.iter().map(|one| one.name.chars().count()).max();
        let width = width.unwrap_or_default();
        for one in scenarios {
            tell!("  {:width$}  {}", one.name, one.title);
        }
    }
    Ok(ExitCode::SUCCESS)
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
    /// What is wrong with the bag although every message is in it.
    pub trouble: Option<String>,
}

impl Run {
    /// Runs the scenario; exit code 1 when its plan failed, 130 when it was called off.
    ///
    /// # Errors
    /// When the scenario cannot be read, a node not built, or the bag not written.
    pub fn execute(self) -> Result<ExitCode> {
        let Some(given) = self.scenario.as_deref().filter(|_| !self.list) else {
            return list();
        };
        if self.pace != 0.0 && !PACES.contains(&self.pace) {
            let reason = format!(
                "--pace {}: must be 0 or a finite number above, from {} to {}",
                self.pace,
                PACES.start(),
                PACES.end()
            );
            return Err(refused("run", reason));
        }
        let scenario = Scenario::read(&places::find(given)?)?;
        if self.no_dds && !self.is_composed(&scenario) {
            let reason = "--no-dds: the nodes of a run in real time meet on the network; only a scenario with simulated_start_s can do without, and not with --separate";
            return Err(refused("run", reason));
        }
        if self.explain && !scenario.file.diagnose {
            let reason = "--explain: does nothing for a scenario without `diagnose: true`; `abbe diagnose BAG --explain` explains any bag";
            return Err(refused("run", reason));
        }
        if self.pace > 0.0 && !self.is_composed(&scenario) {
            let reason = "--pace: does nothing for a run in real time; only a scenario with simulated_start_s has a pace, and not with --separate";
            return Err(refused("run", reason));
        }
        for line in scenario.without_effect()? {
            complain!("abbe: {line}");
        }
        check_machines(&scenario.folder, &scenario.nodes)
            .with_context(|| format!("scenario {}", scenario.folder.display()))?;
        // A mistake in the limits ends the run before it begins.
        self.limits.open()?;
        let interruption = Interruption::listen("the bag is closed, no page is written")?;
        let view = self.served.open(&scenario)?;
        let folder = new_folder(&self.runs, &scenario.name)?;
        let ended = self.run_into(&folder, &scenario, view.as_ref(), &interruption);
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

    /// Runs the nodes of a scenario until its plan ends, and records them.
    fn record(
        &self,
        scenario: &Scenario,
        bag: &Path,
        view: Option<&View>,
        interruption: &Interruption,
    ) -> Result<Outcome> {
        let feed = view.map(View::feed);
        let start_s = scenario.file.simulated_start_s;
        let Some(start_s) = start_s.filter(|_| self.is_composed(scenario)) else {
            return live::run(scenario, bag, self.separate, feed, interruption);
        };
        let how = composed::How {
            pace: self.pace,
            on_dds: !self.no_dds,
            feed: feed.as_ref(),
            interruption,
        };
        composed::run(scenario, start_s, bag, how)
    }

    fn run_into(
        &self,
        folder: &Path,
        scenario: &Scenario,
        view: Option<&View>,
        interruption: &Interruption,
    ) -> Result<ExitCode> {
        let bag = folder.join("bag");
        let mut outcome = self.record(scenario, &bag, view, interruption)?;
        if interruption.is_forced() {
            tell!("Bag:  {}", outcome.kept(&bag));
            complain!("abbe: the end was forced: no page was written");
            return Ok(ExitCode::FAILURE);
        }
        simulated_latency::state(&mut outcome.evidence, scenario);
        let title = format!("{}: {}", scenario.name, scenario.file.title);
        let mut report = Report::of(scenario.file.report, &title, &outcome.evidence)?;
        let Measured {
            between,
            is_evaluated,
        } = add_measured(&mut report, scenario, &bag, outcome.recorded)?;
        if outcome.failure.is_none() {
            match self.try_table(scenario, folder, interruption) {
                Ok(Some(section)) => report.add("linuxcnc_table", &section),
                Ok(None) => {}
                Err(error) => outcome.failure = Some(format!("{error:#}")),
            }
        }
        if scenario.file.diagnose && outcome.recorded > 0 {
            let machine = scenario.folder.join("machine.yaml");
            let plant = true_causes::plant_of(scenario);
            let truth = |effect: &str, axis: &str| {
                let plant = plant.as_ref()?;
                Some(true_causes::truth(plant, effect, axis).in_table())
            };
            match diagnose::of_run(&bag, folder, &machine, self.explain, truth) {
                Ok(gap) => report.join_gap(gap),
                Err(error) => outcome.fail(format!("{error:#}")),
            }
        }
        // The page is written whatever is wrong with the limits.
        let alarms = self.alarms(&mut report, &outcome, scenario, (&bag, between));
        state_origin(&mut report, &outcome, &bag, between)?;
        let written = report.write(folder);
        // Each file is there whole or not at all, in a folder that is new.
        let page = Some(folder.join("report.html")).filter(|page| page.is_file());
        self.tell(&report, &outcome, &bag, page.as_deref());
        let kept = self.keep_figures(&report, &outcome, scenario, &bag);
        let has_bag = outcome.recorded > 0;
        let unwritten = written.err().map(|error| Unwritten {
            error,
            is_plan_whole: outcome.failure.is_none(),
            bag: Some(bag.as_path()).filter(|_| has_bag),
            page: page.as_deref(),
        });
        let ended = outcome.end(is_evaluated);
        let code = unwritten.map_or(ended, |it| it.complain());
        let (alarms, kept) = match alarms {
            Ok(alarms) => (alarms, kept),
            Err(error) => (None, kept.and(Err(error))),
        };
        self.publish(alarms.as_ref());
        alarms::ended(alarms.as_ref(), kept, code)
    }

    /// The report on the terminal; without a page the whole of it, for then it stands nowhere else.
    fn tell(&self, report: &Report, outcome: &Outcome, bag: &Path, page: Option<&Path>) {
        let kept = format!("Bag:  {}", outcome.kept(bag));
        let Some(page) = page.filter(|_| !self.full && !self.explain) else {
            tell!("{}", report.terminal());
            tell!("{kept}");
            if let Some(page) = page {
                tell!("Page: {}", page.display());
            }
            return;
        };
        let room = Room {
            lines: MOST_LINES.saturating_sub(outcome.lines_at_end()),
            tail: &[kept],
            page: Some(page),
        };
        tell!("{}", report.short(&room));
    }

    /// The figures of a plan that ran to its end beside their limits, behind the report.
    fn alarms(
        &self,
        report: &mut Report,
        outcome: &Outcome,
        scenario: &Scenario,
        (bag, between): (&Path, Option<(i64, i64)>),
    ) -> Result<Option<Alarms>> {
        let is_whole = outcome.failure.is_none() && outcome.recorded > 0;
        let Some(limits) = self.limits.open()?.filter(|_| is_whole) else {
            return Ok(None);
        };
        let machine = Origin::of_run(bag, &scenario.folder.join("machine.yaml"))?.machine;
        let of = (machine.as_deref(), between, bag);
        let alarms = self.keep.judge_report(limits, &report.figures, of)?;
        alarms.add_to(report);
        Ok(Some(alarms))
    }

    /// States on `/diagnostics` how the figures stand to their limits; the nodes have ended by then.
    fn publish(&self, alarms: Option<&Alarms>) {
        let Some(alarms) = alarms else { return };
        if self.no_dds {
            complain!("abbe: --no-dds: the alarms are not on /diagnostics");
            return;
        }
        let conditions = alarms.conditions(RUN_NAME);
        let environment = Environment::read().map_err(anyhow::Error::from);
        let published = environment.and_then(|it| alarm::publish(&it, RUN_NAME, &conditions));
        if let Err(error) = published {
            complain!("abbe: the alarms are not on /diagnostics: {error:#}");
        }
    }

    /// Keeps the figures of a plan that ran to its end, where that is wanted.
    fn keep_figures(
        &self,
        report: &Report,
        outcome: &Outcome,
        scenario: &Scenario,
        bag: &Path,
    ) -> Result<()> {
        if !self.keep.is_wanted() {
            return Ok(());
        }
        if outcome.failure.is_some() {
            complain!("abbe: --keep: nothing is kept of a plan that did not run to its end");
            return Ok(());
        }
        if outcome.recorded == 0 {
            bail!(NOTHING_TO_KEEP);
        }
        let machine = scenario.folder.join("machine.yaml");
        let origin = Origin::of_run(bag, &machine)?;
        self.keep.report(&report.figures, origin)
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

    /// Notes why the run failed; the first reason stays the first.
    fn fail(&mut self, reason: String) {
        self.failure = Some(match self.failure.take() {
            None => reason,
            Some(first) => format!("{first}; {reason}"),
        });
    }

    /// What did not work, a line each.
    fn shortcomings(&self) -> Vec<String> {
        let mut shortcomings = shortcomings::of(&self.evidence, self.lost);
        shortcomings.extend(
            self.trouble
                .iter()
                .map(|trouble| format!("the bag: {trouble}")),
        );
        shortcomings
    }

    /// Lines that [`Self::end`] prints.
    fn lines_at_end(&self) -> usize {
        let n = self.shortcomings().len();
        n + usize::from(n > 0) + usize::from(self.failure.is_some())
    }

    /// Whether a node kept something back that its readers could not have taken.
    fn lacks_outputs(&self) -> bool {
        let mut conditions = self.evidence.conditions.iter();
        conditions.any(|it| it.diagnostic.name.starts_with("output_refused/"))
    }

    /// Says what did not work; the exit code, also by whether every run that was measured is evaluated.
    fn end(self, is_evaluated: bool) -> ExitCode {
        let shortcomings = self.shortcomings();
        if !shortcomings.is_empty() {
            complain!("abbe: what did not go as planned:");
        }
        for line in &shortcomings {
            complain!("abbe:   {line}");
        }
        match self.failure {
            None => {
                let is_whole = self.trouble.is_none() && !self.lacks_outputs();
                loss::exit_code(is_whole && is_evaluated)
            }
            // Also where the table's own run was.
            Some(reason) if reason.ends_with(INTERRUPTED) => {
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

/// What the bag of a run holds beside what its witness saw.
struct Measured {
    /// Begin and end of its tests, ns.
    between: Option<(i64, i64)>,
    /// Whether every run that was measured is evaluated.
    is_evaluated: bool,
}

/// Adds the tests of a bag, or its touches, and their conditions.
fn add_measured(
    report: &mut Report,
    scenario: &Scenario,
    bag: &Path,
    n_recorded: u64,
) -> Result<Measured> {
    let mut found = Measured {
        between: None,
        is_evaluated: true,
    };
    if n_recorded == 0 {
        return Ok(found);
    }
    match scenario.file.report {
        ReportKind::Tests => {
            complain!("Evaluating the tests of {}", bag.display());
            let tests = Tests::of(&Bag::open(bag)?);
            found.between = tests.conditions.nanos();
            let page = report_bag::page("", &tests, scenario.budget()?.as_ref())?;
            found.is_evaluated = report_bag::is_whole(&tests, &page);
            report.join(page);
        }
        ReportKind::Rotary => {
            let tests = Tests::of(&Bag::open(bag)?);
            found.between = tests.conditions.nanos();
            found.is_evaluated = tests.is_whole();
            add_probing(report, scenario, &tests)?;
        }
        _ => {
            let seen = TestConditions::of(&Bag::open(bag)?);
            found.between = seen.nanos();
            let budget = scenario.budget()?;
            report.add_conditions(&test_conditions::of(&seen, budget.as_ref(), None));
        }
    }
    Ok(found)
}

/// Adds what ISO 230-10 says of the touches, with the conditions.
fn add_probing(report: &mut Report, scenario: &Scenario, tests: &Tests) -> Result<()> {
    let budget = scenario.budget()?;
    budget
        .as_ref()
        .map_or(Ok(()), |budget| budget.check_tests(tests))?;
    let sections = probing::sections(tests, budget.as_ref());
    report.add_tests(&sections, budget.is_some());
    report.add_conditions(&test_conditions::of(
        &tests.conditions,
        budget.as_ref(),
        Some(tests),
    ));
    Ok(())
}

/// States machine, time, software, the recording and what did not go as planned.
fn state_origin(
    report: &mut Report,
    outcome: &Outcome,
    bag: &Path,
    between: Option<(i64, i64)>,
) -> Result<()> {
    let kept = maud::html! { p { "Bag: " (outcome.kept(bag)) "." } };
    report
        .screen
        .behind
        .push(fold("Recording", None, false, &kept));
    if outcome.recorded > 0 {
        let opened = Bag::open(bag)?;
        // The bag of a run has the machine file of its scenario.
        report.made(Made::of(
            SOFTWARE,
            &opened,
            &bag.display().to_string(),
            None,
            between,
        ));
    }
    report.state_shortcomings(outcome.failure.as_deref(), outcome.shortcomings());
    Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_measured_what_is_not_evaluated_ends_as_the_report_of_its_bag() {
        let outcome = || Outcome {
            evidence: Evidence::default(),
            failure: None,
            recorded: 1,
            lost: 0,
            trouble: None,
        };
        let shown = |code: ExitCode| format!("{code:?}");
        assert_eq!(shown(outcome().end(true)), shown(ExitCode::SUCCESS));
        assert_eq!(shown(outcome().end(false)), shown(loss::exit_code(false)));
    }
}
