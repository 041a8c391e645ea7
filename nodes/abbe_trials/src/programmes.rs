//! `abbe-trials programmes`: the designed programme beside others of the same minutes, on the same machines, before the same judge.
//!
//! Each machine is drawn as in arm i, its effects sized by the common programme of the trials. Every programme is measured on it
//! and diagnosed within this process; a programme is designed by `abbe preflight --design` of the same build, as a process
//! that is given the machine file alone. The design knows no machine of the series before it is drawn.
//!
//! ```text
//!   ballbar = |(u + u_0, v + v_0) - centre|                               (1)
//! ```
//!
//! A shop's circles are read as a ballbar reads them: (u, v) of the plate with (u_0, v_0), the place of its zero, from the
//! centre of the circle. Wherever the drawn machine records its motors, every programme has them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::OpenOptions;
use std::io::Write as _;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::Args;
use gap_diagnosis::session::{SessionBuilder, SessionConfig};
use machine::MachineFile;
use node_runtime::{complain, text_file};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use sequencer::Plan;
use serde::{Deserialize, Serialize};
use trials::target::Ratio;
use trials::{Arm, Compared, Rig, Trial, Verdict, judge, timed};

use crate::blind::{self, Question};
use crate::design;

mod bar;
mod result;

use bar::Bar;
pub use result::ratio_words;

/// Machines: each is measured four times for as long as the programmes take.
const MACHINES: RangeInclusive<u64> = 1..=100_000;
/// Minutes of a programme.
const PROGRAMME_MIN: [f64; 2] = [1.0, 240.0];
/// What a random programme is drawn with besides the seed of its machine.
const RANDOM_SALT: u64 = 0x7261_6e64;

/// Arguments of `abbe-trials programmes`.
#[derive(Args)]
pub struct Programmes {
    /// Machines.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(MACHINES))]
    n: u64,
    /// Seed of the machines.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Minutes of every programme, set-ups included.
    #[arg(long, default_value_t = 60.0)]
    minutes: f64,
    /// Folder of the journal and of the designed programmes; a series that was interrupted goes on.
    #[arg(long, default_value = "runs/programmes")]
    out: PathBuf,
    /// Measure nothing: tabulate the journal.
    #[arg(long)]
    tabulate: bool,
    /// Write the table as Markdown.
    #[arg(long)]
    markdown: Option<PathBuf>,
}

/// One programme on one machine: a line of the journal.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Judged {
    programme: Compared,
    /// That every programme may take, min.
    minutes: f64,
    /// That it took, set-ups included, min.
    used_min: f64,
    verdict: Verdict,
}

impl Programmes {
    /// Measures, diagnoses, judges, prints the table.
    ///
    /// # Errors
    /// When a machine cannot be drawn or measured, a programme does not fit the minutes, or a file cannot be written.
    pub fn execute(&self) -> Result<ExitCode> {
        let [least, most] = PROGRAMME_MIN;
        if !(least..=most).contains(&self.minutes) {
            bail!(
                "--minutes {}: must be from {least} to {most} min",
                self.minutes
            );
        }
        std::fs::create_dir_all(&self.out).with_context(|| format!("{}", self.out.display()))?;
        let path = self.out.join("programmes.jsonl");
        let mut all = journal(&path)?;
        if !self.tabulate {
            self.make(&path, &mut all)?;
        }
        all.retain(|judged| self.is_wanted(judged));
        let table = result::Table::of(self.seed, self.minutes, &all);
        abbe::tell::line(format_args!("{}", table.terminal()));
        if let Some(path) = &self.markdown {
            std::fs::write(path, table.markdown())
                .with_context(|| format!("{}", path.display()))?;
        }
        Ok(ExitCode::SUCCESS)
    }

    fn is_wanted(&self, judged: &Judged) -> bool {
        let truth = &judged.verdict.truth;
        let is_same = (judged.minutes - self.minutes).abs() < 1e-9;
        is_same && truth.seed == self.seed && truth.index < self.n
    }

    /// What the journal lacks.
    fn make(&self, path: &Path, all: &mut Vec<Judged>) -> Result<()> {
        let file = OpenOptions::new().create(true).append(true).open(path);
        let mut file = file.with_context(|| format!("{}", path.display()))?;
        for index in 0..self.n {
            let has = |which: Compared| {
                let mut own = all.iter().filter(|judged| self.is_wanted(judged));
                own.any(|judged| judged.programme == which && judged.verdict.truth.index == index)
            };
            let lacking: Vec<Compared> = Compared::ALL
                .into_iter()
                .filter(|which| !has(*which))
                .collect();
            if lacking.is_empty() {
                continue;
            }
            let trial = Trial::draw(Arm::Catalogue, self.seed, index)?;
            for which in lacking {
                let judged = self
                    .judged(&trial, which)
                    .with_context(|| format!("machine {index}, seed {}: {which}", self.seed))?;
                let line = serde_json::to_string(&judged)? + "\n";
                file.write_all(line.as_bytes())
                    .with_context(|| format!("{}", path.display()))?;
                complain!("{}", result::sentence(&judged));
                all.push(judged);
            }
        }
        Ok(())
    }

    fn judged(&self, trial: &Trial, which: Compared) -> Result<Judged> {
        let began = Instant::now();
        let rig = self.rig(trial, which)?;
        let machine = MachineFile::parse(&rig.machine_text()?, "machine.yaml")?;
        let mut builder = SessionBuilder::new(&machine, SessionConfig::default())?;
        let mut bar = which.reads_bar().then(Bar::default);
        builder.next_bag();
        let program_min = timed(&rig, &mut |_, sample| {
            let read = match &mut bar {
                Some(bar) => bar.read(sample),
                None => Some(sample),
            };
            if let Some(sample) = read {
                builder.take(blind::input(sample));
            }
        })?;
        builder.end_bag();
        let recording = match builder.finish() {
            Ok((session, _)) => Ok((machine, session)),
            Err(error) => Err(error.to_string()),
        };
        let making_s = began.elapsed().as_secs_f64();
        let began = Instant::now();
        let diagnosed = recording.and_then(|it| blind::in_process(&it, &Question::default()));
        let (said, refused) = match diagnosed {
            Ok(answer) => (Some(judge(&answer.report)), None),
            Err(reason) => (None, Some(reason)),
        };
        Ok(Judged {
            programme: which,
            minutes: self.minutes,
            used_min: which.set_up_min(&rig.plan) + program_min,
            verdict: Verdict {
                truth: trial.truth.clone(),
                truth_sha256: String::new(),
                commit: abbe::COMMIT.to_owned(),
                said,
                refused,
                diagnosis_s: began.elapsed().as_secs_f64(),
                making_s,
                ablated: None,
                baselines: BTreeMap::new(),
                likeness: vec![],
                later_closed: None,
                second: None,
                shop: None,
            },
        })
    }

    /// The drawn machine with a programme.
    fn rig(&self, trial: &Trial, which: Compared) -> Result<Rig> {
        let mut rig = trial.rig.clone();
        let mut random =
            Pcg64Mcg::seed_from_u64(self.seed ^ RANDOM_SALT ^ trial.truth.index.rotate_left(32));
        let bare = &trial.bare;
        let time_min = |plan: &Plan| {
            let mut alone = bare.clone();
            alone.plan = plan.clone();
            timed(&alone, &mut |_, _| ())
        };
        let planned = which.plan(&rig.machine, self.minutes, &mut random, &time_min)?;
        (rig.plan, rig.programs) = match planned {
            Some(plan) => (plan, BTreeMap::new()),
            None => {
                let designed = design::programme(&self.out, &rig.machine_text()?, self.minutes)?;
                (designed.plan, designed.programs)
            }
        };
        Ok(rig)
    }
}

/// Effects that the designed programme names beside a shop's, by a journal of one series.
///
/// # Errors
/// When it cannot be read, is empty, or is of several series.
pub fn ratio(path: &Path) -> Result<Ratio> {
    let all = journal(path)?;
    let Some(first) = all.first() else {
        bail!(
            "--programmes {}: no programme was judged there: make it with `abbe-trials programmes`",
            path.display()
        );
    };
    let seed = first.verdict.truth.seed;
    let is_same = |judged: &Judged| {
        judged.verdict.truth.seed == seed && (judged.minutes - first.minutes).abs() < 1e-9
    };
    if !all.iter().all(is_same) {
        bail!(
            "--programmes {}: has several seeds or minutes: name the journal of one series",
            path.display()
        );
    }
    let minutes = first.minutes;
    let both = beside_a_shop(all);
    Ok(result::Table::of(seed, minutes, &both).ratio())
}

/// Machines that were measured by the designed programme and by a shop's.
fn beside_a_shop(mut all: Vec<Judged>) -> Vec<Judged> {
    let of = |wanted: Compared| -> BTreeSet<u64> {
        let own = all.iter().filter(|judged| judged.programme == wanted);
        own.map(|judged| judged.verdict.truth.index).collect()
    };
    let [designed, shop] = [Compared::Designed, Compared::Shop].map(of);
    all.retain(|judged| {
        let index = judged.verdict.truth.index;
        designed.contains(&index) && shop.contains(&index)
    });
    all
}

/// The lines of a journal; a last one that was cut short is an error that names it.
fn journal(path: &Path) -> Result<Vec<Judged>> {
    let text = match text_file::bytes(path) {
        Ok(bytes) => String::from_utf8(bytes).with_context(|| format!("{}", path.display()))?,
        Err(error) if error.is_absent() => return Ok(vec![]),
        Err(error) => return Err(error).context("journal"),
    };
    let read = |(number, line): (usize, &str)| {
        serde_json::from_str(line)
            .with_context(|| format!("journal {}, line {}", path.display(), number + 1))
    };
    text.lines().enumerate().map(read).collect()
}
