//! The journal: one line of JSON for each trial that was judged, and for each drawn machine that could not be measured.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use gap_diagnosis::Rule;
use node_runtime::text_file;
use serde::{Deserialize, Serialize};
use trials::{Arm, TrialError, Verdict};

use crate::trial::Which;

/// A drawn machine whose programme did not get to its end: nothing of it was diagnosed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NotMeasured {
    /// Kind of trial.
    pub arm: Arm,
    /// Its number in the arm.
    pub index: u64,
    /// Seed of the series.
    pub seed: u64,
    /// Commit of the program that drew it.
    pub commit: String,
    /// Why it ended.
    pub not_measured: String,
}

impl NotMeasured {
    /// Of a trial that could not be made; none where that is the program's fault or the computer's.
    pub fn of(which: &Which<'_>, error: &anyhow::Error) -> Option<Self> {
        let why = error.downcast_ref::<TrialError>()?;
        why.is_of_the_plant().then(|| Self {
            arm: which.arm,
            index: which.index,
            seed: which.seed,
            commit: abbe::COMMIT.to_owned(),
            not_measured: why.to_string(),
        })
    }
}

impl std::fmt::Display for NotMeasured {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { arm, index, .. } = self;
        write!(
            f,
            "{arm} {index}: could not be measured: {}",
            self.not_measured
        )
    }
}

/// What a line says.
#[derive(Debug)]
enum Line {
    Verdict(Box<Verdict>),
    NotMeasured(NotMeasured),
}

impl Line {
    fn read(text: &str) -> serde_json::Result<Self> {
        match serde_json::from_str(text) {
            Ok(machine) => Ok(Self::NotMeasured(machine)),
            Err(_) => serde_json::from_str(text).map(Self::Verdict),
        }
    }
}

/// A journal that goes on.
pub struct Journal {
    path: PathBuf,
    file: File,
    verdicts: Vec<Verdict>,
    not_measured: Vec<NotMeasured>,
}

impl Journal {
    /// Opens or begins one. A last line that was cut short is taken away: its trial is made again.
    ///
    /// # Errors
    /// When it cannot be read or written, or a line is of no known kind.
    pub fn open(path: &Path) -> Result<Self> {
        let place = || format!("journal {}", path.display());
        let bytes = match text_file::bytes(path) {
            Ok(bytes) => bytes,
            Err(error) if error.is_absent() => Vec::new(),
            Err(error) => return Err(error).context("journal"),
        };
        let text = String::from_utf8(bytes).with_context(place)?;
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        let (mut verdicts, mut not_measured) = (Vec::new(), Vec::new());
        for (number, line) in text[..whole].lines().enumerate() {
            let line =
                Line::read(line).with_context(|| format!("{}, line {}", place(), number + 1))?;
            match line {
                Line::Verdict(verdict) => verdicts.push(*verdict),
                Line::NotMeasured(machine) => not_measured.push(machine),
            }
        }
        let file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(path)
            .with_context(place)?;
        file.set_len(whole as u64).with_context(place)?;
        Ok(Self {
            path: path.to_owned(),
            file,
            verdicts,
            not_measured,
        })
    }

    /// Every verdict so far.
    pub fn verdicts(&self) -> &[Verdict] {
        &self.verdicts
    }

    /// Every machine that could not be measured.
    pub fn not_measured(&self) -> &[NotMeasured] {
        &self.not_measured
    }

    /// Whether a trial was judged already, with all rules or without one, or could not be measured.
    pub fn has(&self, arm: Arm, seed: u64, index: u64, ablated: Option<Rule>) -> bool {
        let is_judged = self.verdicts.iter().any(|verdict| {
            let truth = &verdict.truth;
            (truth.arm, truth.seed, truth.index, verdict.ablated) == (arm, seed, index, ablated)
        });
        let mut machines = self.not_measured.iter();
        is_judged || machines.any(|it| (it.arm, it.seed, it.index) == (arm, seed, index))
    }

    /// Adds a line.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn add(&mut self, verdict: Verdict) -> Result<()> {
        self.write(&verdict)?;
        self.verdicts.push(verdict);
        Ok(())
    }

    /// Adds the line of a machine that could not be measured.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn add_not_measured(&mut self, machine: NotMeasured) -> Result<()> {
        self.write(&machine)?;
        self.not_measured.push(machine);
        Ok(())
    }

    fn write(&mut self, line: &impl Serialize) -> Result<()> {
        let line = serde_json::to_string(line)? + "\n";
        self.file
            .write_all(line.as_bytes())
            .with_context(|| format!("journal {}", self.path.display()))
    }
}

#[cfg(test)]
mod tests {
    use anyhow::Context;

    use super::*;

    #[test]
    fn what_ends_on_the_plant_is_of_the_machine_and_nothing_else_is() {
        let which = Which {
            arm: Arm::Own,
            seed: 5,
            index: 87,
            rules: &[None],
        };
        let closed = TrialError::Failed {
            run: 1,
            message: "probe closed".to_owned(),
        };
        let error = Err::<(), _>(closed).context("bag").unwrap_err();
        let machine = NotMeasured::of(&which, &error).unwrap();
        let told = "own 87: could not be measured: run 1 failed: probe closed";
        assert_eq!(machine.to_string(), told);
        let unknown = TrialError::UnknownArm {
            name: "viii".to_owned(),
        };
        for fault in [unknown.into(), anyhow::anyhow!("no space left on device")] {
            assert_eq!(NotMeasured::of(&which, &fault), None);
        }
    }

    #[test]
    fn a_line_is_read_as_it_was_written_and_a_wrong_one_is_named() {
        let machine = NotMeasured {
            arm: Arm::Own,
            index: 87,
            seed: 5,
            commit: "c".to_owned(),
            not_measured: "run 1 failed".to_owned(),
        };
        let text = serde_json::to_string(&machine).unwrap();
        match Line::read(&text).unwrap() {
            Line::NotMeasured(read) => assert_eq!(read, machine),
            Line::Verdict(verdict) => panic!("{verdict:?}"),
        }
        let error = Line::read(r#"{"truth": {"arm": "own", "colour": 1}}"#).unwrap_err();
        assert!(error.to_string().contains("colour"), "{error}");
    }
}
