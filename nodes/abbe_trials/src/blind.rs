//! The diagnosis of one trial: as a process that sees bags and the machine file, or within this one.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::os::fd::AsRawFd;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use gap_diagnosis::regression::{Regression, regression};
use gap_diagnosis::session::{Input, SessionBuilder, SessionConfig};
use gap_diagnosis::{GapConfig, GapReport, Rule, diagnose};
use machine::MachineFile;
use node_runtime::text_file;
use trials::baseline::{self, Names};
use trials::shop::Samples;
use trials::{Method, Rig, Sample, measure};
use twin::Session;

use crate::later;
use abbe::diagnose::bags::Recorded;

/// A user that owns nothing: whom the diagnosis runs as where this program runs as one who may read everything.
const NOBODY: u32 = 65_534;

/// The machine file with the named effects, in a trial's folder.
pub const FOUND: &str = "found.yaml";
/// The plan that was measured, in the folder of a trial that has a second round.
pub const PLAN: &str = "plan.yaml";
/// Folder that the diagnosis may write into.
pub const TOLD: &str = "told";
/// Folder of a second round, in the folder of a trial.
pub const SECOND_ROUND: &str = "told/second_round";

/// Done, and done with a part of the input left out.
const DONE: [i32; 2] = [0, 3];

/// Whether a process did what it was asked.
pub fn is_done(status: ExitStatus) -> bool {
    status.code().is_some_and(|code| DONE.contains(&code))
}

/// What a diagnosis said.
#[derive(Debug)]
pub struct Answer {
    /// The report.
    pub report: GapReport,
    /// The machine file with the named effects, where it was asked for.
    pub machine: Option<MachineFile>,
}

/// What came of a diagnosis: an answer, or the reason why there is none.
pub type Diagnosed = Result<Answer, String>;

/// How a diagnosis is asked.
#[derive(Clone, Copy, Debug, Default)]
pub struct Question<'q> {
    /// The class that it may not name.
    pub left_out: Option<&'q str>,
    /// The rule that is switched off.
    pub ablated: Option<Rule>,
    /// Whether the machine file with the named effects is wanted.
    pub writes_machine: bool,
    /// Minutes of a second round, where one is wanted.
    pub second_round_min: Option<f64>,
}

impl Question<'_> {
    fn config(&self) -> GapConfig {
        GapConfig {
            left_out: self.left_out.map(str::to_owned).into_iter().collect(),
            ablated: self.ablated.into_iter().collect(),
            ..GapConfig::default()
        }
    }
}

/// The first folder on the way to a place that not everybody may pass.
fn closed_to_others(place: &Path) -> Result<Option<PathBuf>> {
    let whole = place
        .canonicalize()
        .with_context(|| format!("{}", place.display()))?;
    let mut all: Vec<&Path> = whole.ancestors().collect();
    all.reverse();
    for on_the_way in all {
        let known = std::fs::metadata(on_the_way);
        let known = known.with_context(|| format!("{}", on_the_way.display()))?;
        if known.permissions().mode() & 0o001 == 0 {
            return Ok(Some(on_the_way.to_owned()));
        }
    }
    Ok(None)
}

/// This program in a trial's folder, without an environment.
pub struct Process {
    /// Its command, to which arguments are added.
    pub command: Command,
    /// The program itself, where it is handed over: open until it has ended.
    _handed: Option<File>,
}

/// Makes the folder that the diagnosis may write into, in a trial's folder.
///
/// # Errors
/// When it cannot be made.
pub fn make_told(folder: &Path) -> Result<()> {
    let told = folder.join(TOLD);
    std::fs::create_dir(&told).with_context(|| format!("{}", told.display()))?;
    std::fs::set_permissions(&told, std::fs::Permissions::from_mode(0o777))?;
    Ok(())
}

/// Makes the file that the named effects go to, in a trial's folder that the diagnosis may not write into.
///
/// # Errors
/// When it cannot be made.
pub fn make_found(folder: &Path) -> Result<()> {
    let found = folder.join(FOUND);
    std::fs::write(&found, "")?;
    std::fs::set_permissions(&found, std::fs::Permissions::from_mode(0o666))?;
    Ok(())
}

/// The machine file with the named effects that a diagnosis wrote.
///
/// # Errors
/// When the file cannot be read, or is no machine file.
pub fn read_found(folder: &Path) -> Result<MachineFile> {
    let text = text_file::yaml(&folder.join(FOUND))?;
    Ok(MachineFile::parse(&text, FOUND)?)
}

/// The diagnosis in a folder: as nobody, where this program runs as root.
///
/// # Errors
/// When nobody may look into the folder.
pub fn process(folder: &Path) -> Result<Process> {
    let is_root = nix::unistd::geteuid().is_root();
    if is_root && let Some(closed) = closed_to_others(folder)? {
        bail!(
            "{}: the diagnosis runs as nobody where this program runs as root, and only the owner may pass {} (chmod o+x): \
             another --out does, or another user",
            folder.display(),
            closed.display()
        );
    }
    let program = std::env::current_exe().context("path of this program")?;
    // Whoever may not pass a folder on the way to it is handed the program itself.
    let is_handed = is_root && closed_to_others(&program)?.is_some();
    let handed = is_handed.then(|| File::open(&program)).transpose();
    let handed = handed.context("this program")?;
    let of_handed = |file: &File| PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd()));
    let mut command = Command::new(handed.as_ref().map_or(program, of_handed));
    command
        .arg("diagnose")
        .current_dir(folder)
        .env_clear()
        .stdin(Stdio::null());
    if is_root {
        command.uid(NOBODY).gid(NOBODY);
    }
    Ok(Process {
        command,
        _handed: handed,
    })
}

/// Runs `abbe diagnose` on bags in its own folder.
///
/// # Errors
/// When the process cannot be started, or says what is no report.
pub fn as_process(folder: &Path, bags: &[&str], question: &Question<'_>) -> Result<Diagnosed> {
    let mut process = process(folder)?;
    let command = &mut process.command;
    command
        .args(bags)
        .args(["--machine", "machine.yaml", "--json", "-"]);
    if let Some(class) = question.left_out {
        command.args(["--without", class]);
    }
    if question.writes_machine {
        make_found(folder)?;
        command.args(["--write-machine", FOUND]);
    }
    if let Some(rule) = question.ablated {
        command.args(["--ablate", rule.id()]);
    }
    if let Some(minutes) = question.second_round_min {
        command.args(["--design-next", "--minutes", &minutes.to_string()]);
        command.args(["--plan", PLAN, "-o", SECOND_ROUND]);
    }
    let output = command.output().context("abbe diagnose")?;
    if !is_done(output.status) {
        let told = String::from_utf8_lossy(&output.stderr).trim().to_owned();
        return Ok(Err(format!("{}: {told}", output.status)));
    }
    let report = serde_json::from_slice(&output.stdout).context("report of abbe diagnose")?;
    let machine = if question.writes_machine {
        Some(read_found(folder)?)
    } else {
        None
    };
    Ok(Ok(Answer { report, machine }))
}

/// A machine with its session.
pub type Recording = (MachineFile, Session);

/// The sessions of rigs of one machine, without a bag; or the reason why they cannot be made.
///
/// # Errors
/// When a rig cannot be measured.
pub fn recorded(rigs: &[&Rig]) -> Result<Result<Recording, String>> {
    let [first, ..] = rigs else {
        return Ok(Err("nothing was measured".to_owned()));
    };
    let machine = MachineFile::parse(&first.machine_text()?, "machine.yaml")?;
    let mut builder = SessionBuilder::new(&machine, SessionConfig::default())?;
    for rig in rigs {
        builder.next_bag();
        measure(rig, &mut |_, sample| builder.take(input(sample)))?;
        builder.end_bag();
    }
    Ok(match builder.finish() {
        Ok((session, _)) => Ok((machine, session)),
        Err(error) => Err(error.to_string()),
    })
}

/// Diagnoses within this process.
pub fn in_process((machine, session): &Recording, question: &Question<'_>) -> Diagnosed {
    let began = Instant::now();
    let diagnosis = diagnose(machine, session, &question.config());
    let diagnosis = diagnosis.map_err(|error| error.to_string())?;
    let mut with = machine.clone();
    with.effects.extend(diagnosis.effects);
    let mut report = diagnosis.report;
    report.runtime_s = began.elapsed().as_secs_f64();
    Ok(Answer {
        report,
        machine: question.writes_machine.then_some(with),
    })
}

/// What is left on held-out runs where nothing is hidden, µm.
///
/// # Errors
/// When the rig cannot be measured.
pub fn bare_um(rig: &Rig) -> Result<Option<f64>> {
    let recording = recorded(&[rig])?;
    Ok(recording.ok().as_ref().and_then(left_um))
}

/// What is left on held-out runs of a recording of a machine that hides nothing, µm.
pub fn left_um((machine, session): &Recording) -> Option<f64> {
    let diagnosis = diagnose(machine, session, &later::nothing_named()).ok()?;
    diagnosis.report.shrink.rms_um.before
}

/// The session of samples of a machine, or the reason why it cannot be made.
///
/// # Errors
/// When the text is no machine file.
pub fn taken(machine_text: &str, samples: &Samples) -> Result<Result<Recording, String>> {
    let machine = MachineFile::parse(machine_text, "machine.yaml")?;
    let mut builder = SessionBuilder::new(&machine, SessionConfig::default())?;
    for (_, sample) in samples {
        builder.take(input(sample.clone()));
    }
    Ok(match builder.finish() {
        Ok((session, _)) => Ok((machine, session)),
        Err(error) => Err(error.to_string()),
    })
}

/// What other methods name, and the signatures of the whole catalogue.
pub struct Beside {
    /// Names of each method.
    pub baselines: BTreeMap<Method, Names>,
    /// Signatures, classes that are left out included.
    pub signatures: Option<Regression>,
}

/// Asks other methods about a recording.
pub fn beside((machine, session): &Recording, left_out: Option<&str>) -> Beside {
    let question = Question {
        left_out,
        ..Question::default()
    };
    let ask = |question: &Question<'_>| regression(machine, session, &question.config()).ok();
    let asked = ask(&question);
    Beside {
        baselines: asked.as_ref().map(baseline::named).unwrap_or_default(),
        signatures: match left_out {
            None => asked,
            Some(_) => ask(&Question::default()),
        },
    }
}

/// The recording that bags in a folder hold.
///
/// # Errors
/// When they cannot be read.
pub fn read(folder: &Path, bags: &[&str], machine_text: &str) -> Result<Recording> {
    let machine = MachineFile::parse(machine_text, "machine.yaml")?;
    let paths: Vec<PathBuf> = bags.iter().map(|bag| folder.join(bag)).collect();
    let recorded = Recorded::read(&paths, &machine)?;
    Ok((machine, recorded.session))
}

/// The rules in the order of the command line, each once.
#[must_use]
pub fn once(rules: &[Rule]) -> Vec<Rule> {
    let rules: BTreeSet<Rule> = rules.iter().copied().collect();
    rules.into_iter().collect()
}

/// A sample as a session takes it.
pub fn input(sample: Sample) -> Input {
    match sample {
        Sample::State(state) => Input::State(state),
        Sample::Grid(sample) => Input::Grid(sample),
        Sample::Length(sample) => Input::Length(sample),
        Sample::Trigger(trigger) => Input::Trigger(trigger),
        Sample::Temperature(sample) => Input::Temperature(sample),
        Sample::Segment(segment) => Input::Segment(segment),
    }
}
