//! `abbe validate PATH...`: reads scenarios and single files as a run would, and prints every mistake. Nothing is run.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::Args;

use crate::scenario::places;
use crate::tell::tell;

mod folder;
mod programs;
mod single;
mod unknown_latency;

/// Arguments of `abbe validate`.
#[derive(Args)]
pub struct Validate {
    /// Scenarios (name or folder), folders of files, or single files: machine, plan, scenario, limits, budget, plant, parameters of a
    /// node, import map, mapping.
    #[arg(required = true)]
    paths: Vec<PathBuf>,
}

/// What was found in one or several files.
#[derive(Debug, Default)]
struct Findings {
    /// Files that were read.
    files: BTreeSet<PathBuf>,
    /// Mistakes, each with its file and place.
    mistakes: Vec<String>,
    /// What is right and worth knowing.
    notes: Vec<String>,
}

impl Findings {
    fn mistake(&mut self, message: String) {
        if !self.mistakes.contains(&message) {
            self.mistakes.push(message);
        }
    }

    fn note(&mut self, message: String) {
        if !self.notes.contains(&message) {
            self.notes.push(message);
        }
    }
}

impl Validate {
    /// Prints the mistakes; exit code 1 where there are some.
    ///
    /// # Errors
    /// When a path or a folder cannot be looked at.
    pub fn execute(self) -> Result<ExitCode> {
        let mut findings = Findings::default();
        for path in &self.paths {
            // A name with an ending is that of a file.
            let path = match path.extension() {
                Some(_) => path.clone(),
                None => places::find(path)?,
            };
            look(&path, &mut findings)?;
        }
        for mistake in &findings.mistakes {
            tell!("{mistake}");
        }
        for note in &findings.notes {
            tell!("note: {note}");
        }
        let files = counted(findings.files.len(), "file");
        if findings.mistakes.is_empty() {
            tell!("{files}: no mistake found");
            return Ok(ExitCode::SUCCESS);
        }
        tell!("{files}: {}", counted(findings.mistakes.len(), "mistake"));
        Ok(ExitCode::FAILURE)
    }
}

/// The mistakes of a scenario's folder.
///
/// # Errors
/// When the folder cannot be looked at.
pub fn mistakes(folder: &Path) -> Result<Vec<String>> {
    let mut findings = Findings::default();
    look(folder, &mut findings)?;
    Ok(findings.mistakes)
}

fn counted(n: usize, what: &str) -> String {
    match n {
        1 => format!("1 {what}"),
        n => format!("{n} {what}s"),
    }
}

/// Looks at a file, a scenario, a folder of files, or a folder of these.
fn look(path: &Path, findings: &mut Findings) -> Result<()> {
    if !path.is_dir() {
        let file = single::File::named(path);
        if let Some(kind) = file.kind {
            single::check(&file, kind, None, findings);
        } else {
            findings.mistake(file.unknown());
        }
        return Ok(());
    }
    if folder::files(path)?.is_empty() {
        let entries = std::fs::read_dir(path).with_context(|| path.display().to_string())?;
        let mut below: Vec<PathBuf> = vec![];
        for entry in entries {
            let entry = entry.with_context(|| path.display().to_string())?.path();
            if entry.is_dir() && !folder::files(&entry)?.is_empty() {
                below.push(entry);
            }
        }
        below.sort();
        if below.is_empty() {
            let shown = path.display();
            findings.mistake(format!(
                "{shown}: it holds no .yaml and no .launch.xml: give the folder of a scenario"
            ));
        }
        return below
            .iter()
            .try_for_each(|folder| folder::check(folder, findings));
    }
    folder::check(path, findings)
}

#[cfg(test)]
mod tests;
