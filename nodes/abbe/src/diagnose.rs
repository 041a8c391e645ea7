//! `abbe diagnose BAG...`, or tables: where simulator and machine differ, which effect causes it, how far it shrinks.

use node_runtime::complain;
use node_runtime::text_file;
use reports::evaluate::budget::Budget;
use reports::evaluate::limits::Limits;
use reports::evaluate::test_conditions::TestConditions;
use reports::gap::diagnosed::{Diagnosed, InPlant};
use reports::loss;
use reports::machine_defaults;
use reports::screen::Made;
use reports::terminal::Room;
use reports::whole_file::{self, Form, Output, check_outputs};
use reports::{Report, gap, test_conditions};

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::Args;
use gap_diagnosis::{GapConfig, OWN_TIME, Rule, diagnose};
use machine::MachineFile;
use recorder::Bag;
use sha2::{Digest, Sha256};
use twin::effects::CATALOGUE;

use crate::SOFTWARE;
use crate::history::alarms::{self, Alarms, LimitsOption};
use crate::history::keep::Keep;
use crate::history::origin::Origin;
use crate::import::Named;
use crate::pdf;
use crate::report_bag::from_table;
use crate::tell::tell;

pub mod bags;
mod machine_text;
mod no_machine;
mod opened;
mod second_round;
pub mod simulated;

use bags::Recorded;
use opened::Opened;
use second_round::Round;
use simulated::Beside;

/// Arguments of `abbe diagnose`.
#[derive(Args)]
pub struct Diagnose {
    /// Folders of the bags, in the order of their recording; tables too.
    #[arg(required = true)]
    bags: Vec<PathBuf>,
    /// Map of the tables among them; without it their columns are recognised.
    #[arg(long)]
    map: Option<PathBuf>,
    /// Machine file that the simulator runs on; without it the one in the first bag, or of tables a plain machine.
    #[arg(long)]
    machine: Option<PathBuf>,
    /// Bag or table that your own simulator made of the same tests, in the place of the twin's prediction; may be given several times.
    #[arg(long, value_name = "SIM", conflicts_with = "write_machine")]
    simulated: Vec<PathBuf>,
    /// Write the report as JSON (abbe.gap/1); `-` for standard output instead of the page.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Write the page as one HTML file.
    #[arg(long)]
    html: Option<PathBuf>,
    /// Write the machine file with the named effects added, to a file that is not there yet.
    #[arg(long)]
    write_machine: Option<PathBuf>,
    /// Id of an effect that is not considered; may be given several times.
    #[arg(long, value_name = "EFFECT", value_parser = effect)]
    without: Vec<String>,
    /// Print why each cause has its status: every check with value, limit and verdict.
    #[arg(long)]
    explain: bool,
    /// Print every table and remark, instead of the answer and three tables in at most 40 lines; `--explain` does too.
    #[arg(long)]
    full: bool,
    /// Rule that is switched off, to see what it is worth: constancy, free_shapes, swap_search, held_out,
    /// recalibration; may be given several times.
    #[arg(long, value_name = "RULE")]
    ablate: Vec<Rule>,
    /// Write the best small programme for what is still open as a scenario's folder.
    #[arg(long, requires = "out")]
    design_next: bool,
    /// Minutes that this programme may take, set-ups included.
    #[arg(
        long,
        value_name = "MIN",
        default_value_t = 15.0,
        allow_negative_numbers = true,
        requires = "design_next"
    )]
    minutes: f64,
    /// Plan that was run, from which touches and the session's own tests are repeated.
    #[arg(long, value_name = "FILE", requires = "design_next")]
    plan: Option<PathBuf>,
    /// Folder of this programme; new or empty.
    #[arg(short, long, value_name = "FOLDER", requires = "design_next")]
    out: Option<PathBuf>,
    /// Write the page as a PDF of A4 sheets; Chromium prints it.
    #[arg(long, value_name = "FILE")]
    pdf: Option<PathBuf>,
    /// Budget file whose operator, warm-up and instruments stand among the conditions and at the head of the PDF.
    #[arg(long)]
    budget: Option<PathBuf>,
    #[command(flatten)]
    keep: Keep,
    #[command(flatten)]
    limits: LimitsOption,
}

impl Diagnose {
    /// Diagnoses; exit code 3 when a part of a bag was lost or left out.
    ///
    /// # Errors
    /// When a bag or the machine file cannot be read, nothing was repeated, or the bag is another machine's.
    pub fn execute(self) -> Result<ExitCode> {
        self.refuse_outputs()?;
        let (opened, machine_file) = self.opened()?;
        let (name, text) = (&machine_file.place, &machine_file.text);
        let round = self.round(name, text)?;
        let config = GapConfig {
            left_out: self.without.clone(),
            ablated: self.ablate.iter().copied().collect(),
            ..GapConfig::default()
        };
        let budget = self.budget.as_deref().map(Budget::open).transpose()?;
        let limits = self.limits.open()?;
        let simulated = self.opened_simulated(&machine_file)?;
        let diagnosed = beside(&opened.bags, &simulated.bags, name, text, &config);
        let mut diagnosed = diagnosed.map_err(|error| opened.named(&error, &self.bags))?;
        opened.forget_time_between(&mut diagnosed);
        opened.name_as_given(&mut diagnosed, &self.bags);
        simulated.name_simulated(&mut diagnosed, &self.simulated);
        let machine = MachineFile::parse(text, name)?.name;
        let title = format!("Simulator against machine: {machine}");
        let mut page = gap::page(&title, &diagnosed, self.explain)?;
        let mut between = None;
        for path in &opened.bags {
            let seen = TestConditions::of(&Bag::open(path)?);
            page.add_conditions(&test_conditions::of(&seen, budget.as_ref(), None));
            between = joined(between, seen.nanos());
        }
        if opened.has_tables() {
            page.begin_with_table(&opened.lines());
            page.state_shortcomings(None, opened.warnings());
        }
        let first = Bag::open(&opened.bags[0])?;
        page.screen.made = Some(Made::of(
            SOFTWARE,
            &first,
            &listed(&self.bags),
            Some(&machine),
            between,
        ));
        // Tables of several machines would be one series in the history.
        let kept_as = Some(machine.as_str()).filter(|name| *name != no_machine::NAME);
        let (json, alarms) = self.judged(limits, &mut page, &diagnosed, (kept_as, between))?;
        self.print(&page, &json);
        self.write(&page, &json)?;
        self.write_machine(&diagnosed, name, text)?;
        if let Some(round) = &round {
            for line in round.write(&diagnosed.diagnosis.report)? {
                complain!("abbe: {line}");
            }
        }
        for remark in diagnosed.losses().iter().chain(&diagnosed.remarks) {
            complain!("abbe: {remark}");
        }
        let kept = self.print_and_keep(&page, &diagnosed, (&opened, &machine, kept_as));
        let are_whole = opened.is_whole() && simulated.is_whole();
        let code = loss::exit_code(diagnosed.losses().is_empty() && are_whole);
        alarms::ended(alarms.as_ref(), kept, code)
    }

    /// The bags to read, and the machine file.
    fn opened(&self) -> Result<(Opened, Named)> {
        let map = self.map.as_deref();
        let (opened, machine) = match &self.machine {
            None => Opened::without_machine(&self.bags, map)?,
            Some(path) => {
                let file = text_file::yaml_file(path).context("machine file")?;
                let machine = Named {
                    place: file.path.display().to_string(),
                    text: file.text,
                };
                (Opened::of(&self.bags, map, &machine)?, machine)
            }
        };
        Ok((opened, machine))
    }

    /// The bags and tables of another simulator, for the same machine file.
    fn opened_simulated(&self, machine: &Named) -> Result<Opened> {
        let has_tables = self.simulated.iter().any(|path| from_table::is_table(path));
        let map = self.map.as_deref().filter(|_| has_tables);
        Opened::of(&self.simulated, map, machine).context("--simulated")
    }

    /// The JSON, and the figures that are kept beside their limits, which are behind page and JSON.
    fn judged(
        &self,
        limits: Option<Limits>,
        page: &mut Report,
        diagnosed: &Diagnosed,
        (machine, between): (Option<&str>, Option<(i64, i64)>),
    ) -> Result<(String, Option<Alarms>)> {
        let mut json = diagnosed.json()?;
        let of = (machine, between, self.bags[0].as_path());
        let judge = |limits: Limits| self.keep.judge_diagnosis(limits, &json, of);
        let alarms = limits.map(judge).transpose()?;
        if let Some(alarms) = &alarms {
            alarms.add_to(page);
            json["alarms"] = alarms.json();
        }
        Ok((serde_json::to_string_pretty(&json)?, alarms))
    }

    /// Where the second round goes, where it is wanted.
    fn round<'r>(&'r self, name: &'r str, text: &'r str) -> Result<Option<Round<'r>>> {
        let out = self.out.as_deref().filter(|_| self.design_next);
        let round = out.map(|out| Round {
            bags: &self.bags,
            plan: self.plan.as_deref(),
            machine: (name, text),
            minutes: self.minutes,
            out,
        });
        round.as_ref().map_or(Ok(()), Round::check)?;
        Ok(round)
    }

    fn has_json_on_terminal(&self) -> bool {
        self.json.as_deref() == Some(Path::new("-"))
    }

    /// Prints the JSON, all tables or the answer with three of them.
    fn print(&self, page: &Report, json: &str) {
        if self.has_json_on_terminal() {
            tell!("{json}");
        } else if self.full || self.explain {
            tell!("{}", page.terminal());
        } else {
            tell!("{}", page.short(&Room::with_page(self.html.as_deref())));
        }
    }

    /// Writes JSON and page.
    fn write(&self, page: &Report, json: &str) -> Result<()> {
        let on_terminal = self.has_json_on_terminal();
        for (path, contents) in [
            (self.json.as_ref().filter(|_| !on_terminal), json),
            (self.html.as_ref(), page.html().as_str()),
        ] {
            if let Some(path) = path {
                whole_file::write(path, contents)?;
            }
        }
        Ok(())
    }

    /// Writes the machine file with the named effects.
    fn write_machine(&self, diagnosed: &Diagnosed, name: &str, text: &str) -> Result<()> {
        if let Some(path) = &self.write_machine {
            let new = machine_text::with_effects(text, name, &diagnosed.diagnosis.effects)?;
            whole_file::write(path, &new)?;
            let added = diagnosed.diagnosis.effects.len();
            complain!(
                "abbe: {}: the machine file with {added} effects added",
                path.display()
            );
        }
        Ok(())
    }

    /// The page as a PDF, and its figures in the history, where that is wanted.
    fn print_and_keep(
        &self,
        page: &Report,
        diagnosed: &Diagnosed,
        (opened, machine, kept_as): (&Opened, &str, Option<&str>),
    ) -> Result<()> {
        let conditions = &page.figures["conditions"];
        if let Some(path) = &self.pdf {
            let head = pdf::Head::of(Some(machine), conditions);
            pdf::write(path, &page.html(), &head)?;
        }
        if self.keep.is_wanted() {
            let mut origin = Origin::of_bags(&opened.bags, kept_as.map(str::to_owned))?;
            if opened.has_tables() {
                origin.source = listed(&self.bags);
            }
            let origin = origin.with_conditions(conditions);
            self.keep.diagnosis(&diagnosed.json()?, origin)?;
        }
        Ok(())
    }

    /// Refuses outputs that are no files, or over inputs or what is no page, and a machine file to write that holds something,
    /// before the work begins.
    fn refuse_outputs(&self) -> Result<()> {
        let json = self.json.as_ref().filter(|path| *path != Path::new("-"));
        let all = [
            ("--json", json, Form::Json),
            ("--html", self.html.as_ref(), Form::Html),
            ("--pdf", self.pdf.as_ref(), Form::Pdf),
            ("--write-machine", self.write_machine.as_ref(), Form::Any),
        ];
        let outputs = all.into_iter().filter_map(|(option, path, form)| {
            path.map(|path| Output::new(option, path.clone(), form))
        });
        let outputs: Vec<Output> = outputs.collect();
        let files = [&self.machine, &self.map, &self.plan, &self.budget];
        let files = files.into_iter().filter_map(|file| file.as_deref());
        let files = files.chain(self.limits.path());
        let bags = self.bags.iter().chain(&self.simulated);
        let inputs = bags.map(PathBuf::as_path).chain(files);
        check_outputs(&outputs, inputs.chain(self.keep.store()))?;
        // An empty file is a place that was made for it.
        let holds = |path: &&PathBuf| std::fs::metadata(path).is_ok_and(|file| file.len() > 0);
        if let Some(path) = self.write_machine.as_ref().filter(holds) {
            bail!(
                "--write-machine {}: is there already, and nothing is overwritten: name a new file",
                path.display()
            );
        }
        Ok(())
    }
}

/// The id of an effect of the catalogue.
fn effect(text: &str) -> Result<String, String> {
    if CATALOGUE.iter().any(|kind| kind.id == text) {
        return Ok(text.to_owned());
    }
    let ids: Vec<&str> = CATALOGUE.iter().map(|kind| kind.id).collect();
    Err(format!(
        "the catalogue has no such effect, but {}",
        ids.join(", ")
    ))
}

/// From the earlier begin to the later end.
fn joined(a: Option<(i64, i64)>, b: Option<(i64, i64)>) -> Option<(i64, i64)> {
    match (a, b) {
        (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
        _ => a.or(b),
    }
}

fn listed(paths: &[PathBuf]) -> String {
    let names: Vec<String> = paths.iter().map(|p| p.display().to_string()).collect();
    names.join(", ")
}

/// Diagnoses bags against a machine file; `name` is its path, for messages.
///
/// # Errors
/// As [`Diagnose::execute`].
pub fn of(
    paths: &[PathBuf],
    name: &str,
    machine_text: &str,
    config: &GapConfig,
) -> Result<Diagnosed> {
    beside(paths, &[], name, machine_text, config)
}

/// The same against the bags of another simulator, where there are any.
fn beside(
    paths: &[PathBuf],
    simulated: &[PathBuf],
    name: &str,
    machine_text: &str,
    config: &GapConfig,
) -> Result<Diagnosed> {
    let began = Instant::now();
    let machine = MachineFile::parse(machine_text, name)?;
    let left_out = machine_defaults::of(&machine, machine_text);
    let recorded = Recorded::read(paths, &machine)?;
    let beside = simulated::beside(simulated, &machine, &recorded)?;
    let session = beside.as_ref().map_or(&recorded.session, |it| &it.session);
    let (config, in_no_order) = without_time(paths, config)?;
    let lacks = || [loss::lines(&recorded.readings), recorded.omitted.clone()].concat();
    let mut diagnosis = diagnose(&machine, session, &config)
        .map_err(|error| bags::not_whole(error.into(), &lacks()))?;
    diagnosis.report.inputs.bags = recorded.bags;
    diagnosis.report.inputs.machine_sha256 = format!("{:x}", Sha256::digest(machine_text));
    diagnosis.report.runtime_s = began.elapsed().as_secs_f64();
    let report = &diagnosis.report;
    let defaults = machine_defaults::of_diagnosis(&machine, &left_out, session, report);
    let leaps = recorded.readings.iter().filter_map(|it| it.leaps.line());
    let (simulated, of_simulator) = beside.map_or((None, vec![]), |it: Beside| {
        (Some(it.simulated), it.remarks)
    });
    let remarks = in_no_order.into_iter().chain(recorded.remarks).chain(leaps);
    Ok(Diagnosed {
        diagnosis,
        omitted: recorded.omitted,
        remarks: remarks.chain(of_simulator).collect(),
        readings: recorded.readings,
        defaults,
        simulated,
        in_plant: vec![],
        without: config.left_out,
        ablated: config
            .ablated
            .iter()
            .map(|rule| rule.id().to_owned())
            .collect(),
    })
}

/// What shows from run to run, in the order of their numbers.
const BY_RUNS: &str = "ambient_drift";

/// The settings without what goes with time, and a remark, where a bag's table was not in the order of the measurement.
fn without_time(paths: &[PathBuf], config: &GapConfig) -> Result<(GapConfig, Option<String>)> {
    let mut config = config.clone();
    let mut unknown = vec![];
    for path in paths {
        if bags::is_in_no_order(path)? {
            unknown.push(path.clone());
        }
    }
    if unknown.is_empty() {
        return Ok((config, None));
    }
    config.is_order_known = false;
    let own_time = OWN_TIME
        .iter()
        .filter(|id| **id != BY_RUNS && effect(id).is_ok());
    for id in own_time {
        if !config.left_out.iter().any(|known| known == id) {
            config.left_out.push((*id).to_owned());
        }
    }
    let remark = format!(
        "{}: the table's rows were not in the order of the measurement, so nothing that goes with time or temperature is judged but a drift from run to run in the order of their numbers",
        listed(&unknown)
    );
    Ok((config, Some(remark)))
}

/// The diagnosis of a run's own bag as a part of its page, for `explain` as [`gap::page`] has it; without one, why. `truth`
/// says of an effect and its axis whether the machine has it, where that is known.
///
/// # Errors
/// When a plot cannot be drawn or the report not written.
pub fn of_run(
    bag: &Path,
    folder: &Path,
    machine: &Path,
    explain: bool,
    truth: impl Fn(&str, &str) -> Option<InPlant>,
) -> Result<Report> {
    let file = text_file::yaml_file(machine).context("machine file")?;
    let name = file.path.display().to_string();
    match of(&[bag.to_owned()], &name, &file.text, &GapConfig::default()) {
        Ok(mut diagnosed) => {
            let causes = diagnosed.diagnosis.report.causes.iter();
            diagnosed.in_plant = causes
                .filter_map(|cause| truth(&cause.effect, &cause.axis))
                .collect();
            let json = serde_json::to_string_pretty(&diagnosed.json()?)?;
            let path = folder.join("gap.json");
            whole_file::write(&path, &json)?;
            gap::page("Simulator against machine", &diagnosed, explain)
        }
        Err(error) => Ok(gap::without(
            "Simulator against machine",
            &format!("{error:#}"),
        )),
    }
}
