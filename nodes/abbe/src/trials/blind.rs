//! The diagnosis of one trial: as a process that sees the bag and the machine file, or within this one.

use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result};
use gap_diagnosis::session::{Input, SessionBuilder, SessionConfig};
use gap_diagnosis::{GapConfig, GapReport, diagnose};
use machine::MachineFile;
use trials::{Rig, Sample, measure};

/// A user that owns nothing: whom the diagnosis runs as where this program runs as one who may read everything.
const NOBODY: u32 = 65_534;

/// What came of a diagnosis: a report, or the reason why there is none.
pub type Diagnosed = Result<GapReport, String>;

/// Runs `abbe diagnose` on a bag in its own folder.
///
/// # Errors
/// When the process cannot be started, or says what is no report.
pub fn as_process(folder: &Path, left_out: Option<&str>) -> Result<Diagnosed> {
    let program = std::env::current_exe().context("path of this program")?;
    let mut command = Command::new(program);
    command
        .args([
            "diagnose",
            "bag",
            "--machine",
            "machine.yaml",
            "--json",
            "-",
        ])
        .current_dir(folder)
        .env_clear()
        .stdin(Stdio::null());
    if let Some(class) = left_out {
        command.args(["--without", class]);
    }
    if nix::unistd::geteuid().is_root() {
        command.uid(NOBODY).gid(NOBODY);
    }
    let output = command.output().context("abbe diagnose")?;
    if !output.status.success() {
        let told = String::from_utf8_lossy(&output.stderr).trim().to_owned();
        return Ok(Err(format!("{}: {told}", output.status)));
    }
    let report = serde_json::from_slice(&output.stdout).context("report of abbe diagnose")?;
    Ok(Ok(report))
}

/// Diagnoses a rig's session without a bag.
///
/// # Errors
/// When the rig cannot be measured.
pub fn in_process(rig: &Rig, left_out: Option<&str>) -> Result<Diagnosed> {
    let machine = MachineFile::parse(&rig.machine_text()?, "machine.yaml")?;
    let mut builder = SessionBuilder::new(&machine, SessionConfig::default())?;
    measure(rig, &mut |_, sample| builder.take(input(sample)))?;
    let config = GapConfig {
        left_out: left_out.map(str::to_owned).into_iter().collect(),
        ..GapConfig::default()
    };
    let session = match builder.finish() {
        Ok((session, _)) => session,
        Err(error) => return Ok(Err(error.to_string())),
    };
    Ok(match diagnose(&machine, &session, &config) {
        Ok(diagnosis) => Ok(diagnosis.report),
        Err(error) => Err(error.to_string()),
    })
}

fn input(sample: Sample) -> Input {
    match sample {
        Sample::State(state) => Input::State(state),
        Sample::Grid(sample) => Input::Grid(sample),
        Sample::Length(sample) => Input::Length(sample),
        Sample::Trigger(trigger) => Input::Trigger(trigger),
        Sample::Temperature(sample) => Input::Temperature(sample),
        Sample::Segment(segment) => Input::Segment(segment),
    }
}
