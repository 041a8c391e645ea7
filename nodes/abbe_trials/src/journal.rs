//! The journal: one line of JSON for each trial that was judged.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use gap_diagnosis::Rule;
use node_runtime::text_file;
use trials::{Arm, Verdict};

/// A journal that goes on.
pub struct Journal {
    path: PathBuf,
    file: File,
    verdicts: Vec<Verdict>,
}

impl Journal {
    /// Opens or begins one. A last line that was cut short is taken away: its trial is made again.
    ///
    /// # Errors
    /// When it cannot be read or written, or a line is no verdict.
    pub fn open(path: &Path) -> Result<Self> {
        let place = || format!("journal {}", path.display());
        let bytes = match text_file::bytes(path) {
            Ok(bytes) => bytes,
            Err(error) if error.is_absent() => Vec::new(),
            Err(error) => return Err(error).context("journal"),
        };
        let text = String::from_utf8(bytes).with_context(place)?;
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        let mut verdicts = Vec::new();
        for (number, line) in text[..whole].lines().enumerate() {
            let verdict = serde_json::from_str(line)
                .with_context(|| format!("{}, line {}", place(), number + 1))?;
            verdicts.push(verdict);
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
        })
    }

    /// Every verdict so far.
    pub fn verdicts(&self) -> &[Verdict] {
        &self.verdicts
    }

    /// Whether a trial was judged already, with all rules or without one.
    pub fn has(&self, arm: Arm, seed: u64, index: u64, ablated: Option<Rule>) -> bool {
        self.verdicts.iter().any(|verdict| {
            let truth = &verdict.truth;
            (truth.arm, truth.seed, truth.index, verdict.ablated) == (arm, seed, index, ablated)
        })
    }

    /// Adds a line.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn add(&mut self, verdict: Verdict) -> Result<()> {
        let line = serde_json::to_string(&verdict)? + "\n";
        self.file
            .write_all(line.as_bytes())
            .with_context(|| format!("journal {}", self.path.display()))?;
        self.verdicts.push(verdict);
        Ok(())
    }
}
