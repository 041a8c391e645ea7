//! `abbe diagnose BAG...`: where simulator and machine differ, which effect causes it, how far it shrinks.

use node_runtime::complain;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::Args;
use gap_diagnosis::{Diagnosis, GapConfig, Rule, diagnose};
use machine::MachineFile;
use machine::effects::CATALOGUE;
use sha2::{Digest, Sha256};

use crate::report::{Report, gap};
use crate::tell::tell;

pub mod bags;
mod machine_text;

use bags::Recorded;

/// Exit code for a diagnosis of bags of which a part was lost.
const DONE_WITH_LOSS: u8 = 3;

/// Arguments of `abbe diagnose`.
#[derive(Args)]
pub struct Diagnose {
    /// Folders of the bags, in the order of their recording.
    #[arg(required = true)]
    bags: Vec<PathBuf>,
    /// Machine file that the simulator runs on; without it the one in the first bag.
    #[arg(long)]
    machine: Option<PathBuf>,
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
    /// Rule that is switched off, to see what it is worth: constancy, free_shapes, swap_search, held_out,
    /// recalibration; may be given several times.
    #[arg(long, value_name = "RULE")]
    ablate: Vec<Rule>,
}

/// A diagnosis of bags, with what could not be used of them.
pub struct Diagnosed {
    /// What was found.
    pub diagnosis: Diagnosis,
    /// What was left out, in words.
    pub remarks: Vec<String>,
    /// Parts of the bags that could not be read, in words.
    pub losses: Vec<String>,
}

impl Diagnose {
    /// Diagnoses; exit code 3 when a part of a bag was lost.
    ///
    /// # Errors
    /// When a bag or the machine file cannot be read, nothing was repeated, or the bag is another machine's.
    pub fn execute(self) -> Result<ExitCode> {
        let (name, text) = match &self.machine {
            Some(path) => (
                path.display().to_string(),
                std::fs::read_to_string(path)
                    .with_context(|| format!("machine file {}", path.display()))?,
            ),
            None => bags::machine_text(&self.bags[0])?,
        };
        // An empty file is a place that was made for it.
        let holds = |path: &&PathBuf| std::fs::metadata(path).is_ok_and(|file| file.len() > 0);
        if let Some(path) = self.write_machine.as_ref().filter(holds) {
            bail!(
                "--write-machine {}: is there already, and nothing is overwritten: name a new file",
                path.display()
            );
        }
        let config = GapConfig {
            left_out: self.without.clone(),
            ablated: self.ablate.iter().copied().collect(),
            ..GapConfig::default()
        };
        let diagnosed = of(&self.bags, &name, &text, &config)?;
        let title = format!("Simulator against machine: {}", listed(&self.bags));
        let page = gap::page(&title, &diagnosed)?;
        let json = serde_json::to_string_pretty(&diagnosed.diagnosis.report)?;
        let on_terminal = self.json.as_deref() == Some(Path::new("-"));
        if on_terminal {
            tell!("{json}");
        } else {
            tell!("{}", page.terminal());
        }
        for (path, contents) in [
            (self.json.as_ref().filter(|_| !on_terminal), &json),
            (self.html.as_ref(), &page.html()),
        ] {
            if let Some(path) = path {
                std::fs::write(path, contents).with_context(|| format!("{}", path.display()))?;
            }
        }
        if let Some(path) = &self.write_machine {
            let new = machine_text::with_effects(&text, &name, &diagnosed.diagnosis.effects)?;
            std::fs::write(path, new).with_context(|| format!("{}", path.display()))?;
            let added = diagnosed.diagnosis.effects.len();
            complain!(
                "abbe: {}: the machine file with {added} effects added",
                path.display()
            );
        }
        for remark in diagnosed.losses.iter().chain(&diagnosed.remarks) {
            complain!("abbe: {remark}");
        }
        Ok(if diagnosed.losses.is_empty() {
            ExitCode::SUCCESS
        } else {
            ExitCode::from(DONE_WITH_LOSS)
        })
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
    let began = Instant::now();
    let machine = MachineFile::parse(machine_text, name)?;
    let recorded = Recorded::read(paths, &machine)?;
    let mut diagnosis = diagnose(&machine, &recorded.session, config)
        .map_err(|error| bags::not_whole(error.into(), &recorded.losses))?;
    diagnosis.report.inputs.bags = recorded.bags;
    diagnosis.report.inputs.machine_sha256 = format!("{:x}", Sha256::digest(machine_text));
    diagnosis.report.runtime_s = began.elapsed().as_secs_f64();
    Ok(Diagnosed {
        diagnosis,
        remarks: recorded.remarks,
        losses: recorded.losses,
    })
}

/// The diagnosis of a run's own bag as a part of its page; without one, why.
///
/// # Errors
/// When a plot cannot be drawn or the report not written.
pub fn of_run(bag: &Path, folder: &Path, machine: &Path) -> Result<Report> {
    let text = std::fs::read_to_string(machine)
        .with_context(|| format!("machine file {}", machine.display()))?;
    let name = machine.display().to_string();
    match of(&[bag.to_owned()], &name, &text, &GapConfig::default()) {
        Ok(diagnosed) => {
            let json = serde_json::to_string_pretty(&diagnosed.diagnosis.report)?;
            let path = folder.join("gap.json");
            std::fs::write(&path, json).with_context(|| format!("{}", path.display()))?;
            gap::page("Simulator against machine", &diagnosed)
        }
        Err(error) => Ok(gap::without(
            "Simulator against machine",
            &format!("{error:#}"),
        )),
    }
}
