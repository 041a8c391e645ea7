//! A series of trials of one arm, several at a time.

use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::Instant;

use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use trials::{Arm, Trial, Verdict, judge};

use super::journal::Journal;
use super::seal::Seal;
use super::{blind, session_bag};

/// How trials are made.
pub struct How {
    /// Without bag, seal and process.
    pub in_process: bool,
    /// Whether bags and reports stay.
    pub keep: bool,
    /// Folder of the trials.
    pub out: PathBuf,
    /// Folder of the seals.
    pub sealed: PathBuf,
}

/// A series.
pub struct Series<'a> {
    /// Its seed.
    pub seed: u64,
    /// Trials in it.
    pub n: u64,
    /// How many at a time; 0: as many as there are cores.
    pub jobs: usize,
    /// How.
    pub how: &'a How,
}

impl Series<'_> {
    /// Makes what is not in the journal.
    ///
    /// # Errors
    /// When a trial cannot be made or the journal not written.
    pub fn run(&self, arm: Arm, journal: &mut Journal) -> Result<()> {
        let wanted: Vec<u64> = (0..self.n)
            .filter(|index| !journal.has(arm, self.seed, *index))
            .collect();
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let jobs = if self.jobs == 0 { cores() } else { self.jobs };
        let bar = bar(arm, wanted.len());
        let next = AtomicUsize::new(0);
        let (said, heard) = mpsc::channel();
        std::thread::scope(|scope| {
            for _ in 0..jobs.min(wanted.len()) {
                let (said, next, wanted, bar) = (said.clone(), &next, &wanted, &bar);
                scope.spawn(move || {
                    while let Some(index) = wanted.get(next.fetch_add(1, Ordering::Relaxed)) {
                        let verdict = self
                            .trial(arm, *index, bar)
                            .with_context(|| format!("trial {arm} {index}, seed {}", self.seed));
                        if said.send(verdict).is_err() {
                            return;
                        }
                    }
                });
            }
            drop(said);
            for verdict in &heard {
                let verdict = verdict?;
                tell(&bar, &sentence(&verdict));
                bar.inc(1);
                journal.add(verdict)?;
            }
            drop(heard);
            Ok::<(), anyhow::Error>(())
        })?;
        bar.finish_and_clear();
        Ok(())
    }

    fn trial(&self, arm: Arm, index: u64, bar: &ProgressBar) -> Result<Verdict> {
        let began = Instant::now();
        let trial = Trial::draw(arm, self.seed, index)?;
        let left_out = trial.truth.left_out.clone();
        let name = format!("{arm}-{}-{index:05}", self.seed);
        if self.how.in_process {
            let making_s = began.elapsed().as_secs_f64();
            let began = Instant::now();
            let diagnosed = blind::in_process(&trial.rig, left_out.as_deref())?;
            let times_s = [making_s, began.elapsed().as_secs_f64()];
            return Ok(verdict(trial.truth, String::new(), diagnosed, times_s));
        }
        let folder = self.how.out.join(&name);
        if folder.exists() {
            std::fs::remove_dir_all(&folder)?;
        }
        std::fs::create_dir_all(&folder).with_context(|| format!("{}", folder.display()))?;
        let machine_text = trial.rig.machine_text()?;
        std::fs::write(folder.join("machine.yaml"), &machine_text)?;
        session_bag::write(&trial.rig, &folder.join("bag"), machine_text)?;
        let seal = Seal::write(&self.how.sealed, &name, &trial.truth)?;
        drop(trial);
        tell(bar, &format!("sealed {name}: sha256 {}", seal.sha256));
        let making_s = began.elapsed().as_secs_f64();
        let began = Instant::now();
        let diagnosed = blind::as_process(&folder, left_out.as_deref())?;
        let diagnosis_s = began.elapsed().as_secs_f64();
        if self.how.keep {
            if let Ok(report) = &diagnosed {
                let json = serde_json::to_string_pretty(report)?;
                std::fs::write(folder.join("gap.json"), json)?;
            }
        } else {
            std::fs::remove_dir_all(&folder)?;
        }
        let truth = seal.open()?;
        Ok(verdict(
            truth,
            seal.sha256,
            diagnosed,
            [making_s, diagnosis_s],
        ))
    }
}

fn verdict(
    truth: trials::Truth,
    truth_sha256: String,
    diagnosed: blind::Diagnosed,
    [making_s, diagnosis_s]: [f64; 2],
) -> Verdict {
    let (said, refused) = match diagnosed {
        Ok(report) => (Some(judge(&report)), None),
        Err(reason) => (None, Some(reason)),
    };
    Verdict {
        truth,
        truth_sha256,
        commit: env!("ABBE_COMMIT").to_owned(),
        said,
        refused,
        diagnosis_s,
        making_s,
    }
}

fn bar(arm: Arm, trials: usize) -> ProgressBar {
    let bar = ProgressBar::new(trials as u64);
    let style = ProgressStyle::with_template("{prefix}\n[{bar:40}] {pos} of {len}, {eta} left");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.set_prefix(format!("arm {arm}: {}", arm.title()));
    bar
}

/// A line above the bar; a plain line where there is no terminal.
fn tell(bar: &ProgressBar, line: &str) {
    if bar.is_hidden() {
        eprintln!("{line}");
    } else {
        bar.println(line);
    }
}

/// One trial in a line.
fn sentence(verdict: &Verdict) -> String {
    let truth = &verdict.truth;
    let effects: Vec<String> = truth
        .effects
        .iter()
        .map(|e| {
            format!(
                "{} {} {:.3} {} (D {:.0})",
                e.class.id(),
                e.axis,
                e.size,
                e.unit,
                e.d
            )
        })
        .collect();
    let hidden = if effects.is_empty() {
        "nothing".to_owned()
    } else {
        effects.join(", ")
    };
    let said = match &verdict.said {
        None => format!("refused: {}", verdict.refused.as_deref().unwrap_or("")),
        Some(said) => {
            let causes: Vec<String> = said
                .causes
                .iter()
                .map(|c| {
                    let status = if c.is_named() { "" } else { "?" };
                    format!("{} {}{status}", c.effect, c.axis)
                })
                .collect();
            let unknown = if said.is_unknown { " + unknown" } else { "" };
            let floor = if said.is_reproduced {
                ""
            } else {
                " (floor not reproduced)"
            };
            let causes = if causes.is_empty() {
                "nothing".to_owned()
            } else {
                causes.join(", ")
            };
            format!("{causes}{unknown}{floor}")
        }
    };
    let (making_s, diagnosis_s) = (verdict.making_s, verdict.diagnosis_s);
    format!(
        "{} {}: {hidden} -> {said}  [{making_s:.1} + {diagnosis_s:.1} s]",
        truth.arm, truth.index
    )
}
