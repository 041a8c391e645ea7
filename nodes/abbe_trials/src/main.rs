//! `abbe-trials`: blind trials of the diagnosis, and the table of what it found.
//!
//! For each trial a machine is drawn and its session written as a bag; what is hidden in the plant goes into a sealed
//! file of another folder, whose SHA-256 is printed before the diagnosis starts. The diagnosis is `abbe diagnose`
//! of the same build, as a process that receives the bag and the machine file and that may not read the seal. Then the
//! seal is opened and one line added to the journal; a series that was interrupted goes on behind its last line.

#![cfg_attr(not(test), warn(clippy::print_stderr))]
#![expect(
    clippy::disallowed_methods,
    reason = "the program writes bags, journals and tables, and starts the diagnosis"
)]

use std::collections::BTreeSet;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use abbe::diagnose::Diagnose;
use abbe::import::Import;
use abbe::preflight::Preflight;
use anyhow::{Context, Result, bail};
use clap::{Args, Parser, Subcommand};
use gap_diagnosis::Rule;
use sha2::{Digest, Sha256};
use trials::target::Ratio;
use trials::truth::MEASURE;
use trials::{Arm, Verdict};

mod blind;
mod design;
mod journal;
mod later;
mod programmes;
mod seal;
mod second_round;
mod series;
mod session_bag;
mod shop;
mod table;
mod tree;
mod trial;

use journal::{Journal, NotMeasured};
use programmes::Programmes;
use series::Series;
use trial::How;

/// Trials of one arm: a week of every core at a second each, and each leaves a line in the journal.
const TRIALS: RangeInclusive<u64> = 1..=1_000_000;
/// Trials at a time: each is a process, of which a computer takes some hundreds.
const JOBS: RangeInclusive<u64> = 0..=256;
/// Seed of the trials that the diagnosis is developed with; those of `--final` are others.
const DEVELOPMENT_SEED: u64 = 1;

/// Judges the diagnosis blindly on machines with a sealed hidden effect.
#[derive(Parser)]
#[command(name = "abbe-trials", version, args_conflicts_with_subcommands = true)]
struct Arguments {
    #[command(flatten)]
    trials: Trials,
    #[command(subcommand)]
    verb: Option<Verb>,
}

#[derive(Subcommand)]
enum Verb {
    /// `abbe diagnose`: the process that this program starts for each trial.
    #[command(hide = true)]
    Diagnose(Diagnose),
    /// `abbe import`: the process that makes bags of a shop's tables.
    #[command(hide = true)]
    Import(Import),
    /// `abbe preflight`: the process that designs a programme for a drawn machine file.
    #[command(hide = true)]
    Preflight(Preflight),
    /// Compare the designed programme with others of the same minutes, on the same machines, before the same judge.
    Programmes(Programmes),
}

/// Which trials are made, and where their files are.
#[derive(Args)]
struct Trials {
    /// Arms, by number: i catalogue, ii a class left out, iii different physics, iv null, v null with worse noise,
    /// vi confusable pairs, vii the same with one more run of the diagnosis' choice; alone: each class in turn, large enough to be named;
    /// limit: each class in turn, about as small as can be named; own, own-left-out: classes with programmes of their own;
    /// s1 a shop's ISO 230-2 run, s2 its ballbar, s3 its logs, s4 its shift of four hours: with a table of their own; s5 a designed programme, s6 the same with
    /// a class left out, s7 the same with a designed second round: with a table of their own.
    #[arg(long, value_delimiter = ',', default_value = "i")]
    arm: Vec<Arm>,
    /// Trials in each arm.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(TRIALS))]
    n: u64,
    /// Seed of the series.
    #[arg(long, conflicts_with = "final_series")]
    seed: Option<u64>,
    /// Draw the seed from the commit of this program: a series that nobody could have tuned to. Refused where the
    /// working tree is not that commit.
    #[arg(long = "final")]
    final_series: bool,
    /// Trials at a time; 0: as many as there are cores.
    #[arg(long, default_value_t = 0, conflicts_with = "tabulate", value_parser = clap::value_parser!(u64).range(JOBS))]
    jobs: u64,
    /// Folder of the journal and of the trials under way.
    #[arg(long, default_value = "runs/trials")]
    out: PathBuf,
    /// Folder of the sealed truths; beside `--out` where it is not named.
    #[arg(long, conflicts_with_all = ["in_process", "tabulate"])]
    sealed: Option<PathBuf>,
    /// Diagnose within this process, without bag and seal: for development, never for a published table.
    #[arg(long)]
    in_process: bool,
    /// Switch a rule of the diagnosis off, in a diagnosis of its own beside the whole one: constancy, free_shapes,
    /// swap_search, held_out, recalibration.
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "RULE",
        conflicts_with = "tabulate"
    )]
    ablate: Vec<Rule>,
    /// Put other methods before the same judge, and predict who looks like whom.
    #[arg(long, conflicts_with = "tabulate")]
    baselines: bool,
    /// Keep bags and reports.
    #[arg(long, conflicts_with_all = ["in_process", "tabulate"])]
    keep: bool,
    /// Journal of `abbe-trials programmes`, of which the table of s5 says what a designed programme names beside a shop's.
    #[arg(long, value_name = "JOURNAL")]
    programmes: Option<PathBuf>,
    /// Make no trials: tabulate the journal.
    #[arg(long)]
    tabulate: bool,
    /// Write the table as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Write the table as one HTML file.
    #[arg(long)]
    html: Option<PathBuf>,
    /// Write the table as Markdown.
    #[arg(long)]
    markdown: Option<PathBuf>,
}

fn main() -> ExitCode {
    let Arguments { trials, verb } = Arguments::parse();
    let outcome = match verb {
        Some(Verb::Diagnose(diagnose)) => diagnose.execute(),
        Some(Verb::Import(import)) => import.execute(),
        Some(Verb::Preflight(preflight)) => preflight.execute(),
        Some(Verb::Programmes(programmes)) => programmes.execute(),
        None => trials.execute(),
    };
    outcome.unwrap_or_else(|error| abbe::report_failure("abbe-trials", &error))
}

impl Trials {
    /// Makes the trials and prints the table.
    ///
    /// # Errors
    /// When a trial cannot be made or a file not written.
    fn execute(self) -> Result<ExitCode> {
        let seed = match (self.final_series, self.seed) {
            (true, _) => {
                // What is in the journal was made by this commit already.
                if !self.tabulate {
                    tree::check(abbe::COMMIT)?;
                }
                seed_of(abbe::COMMIT)
            }
            (false, seed) => seed.unwrap_or(DEVELOPMENT_SEED),
        };
        std::fs::create_dir_all(&self.out).with_context(|| format!("{}", self.out.display()))?;
        let mut journal = Journal::open(&self.out.join("journal.jsonl"))?;
        let arms: BTreeSet<Arm> = self.arm.iter().copied().collect();
        let is_of_a_shop = self.is_of_a_shop(&arms)?;
        let ratio = self.ratio(&arms)?;
        let made_now = (!self.tabulate).then_some(MEASURE);
        one_measure(journal.verdicts(), seed, made_now)
            .with_context(|| format!("{}", self.out.join("journal.jsonl").display()))?;
        if !self.tabulate {
            let how = How {
                in_process: self.in_process,
                keep: self.keep,
                baselines: self.baselines,
                out: self.out.clone(),
                sealed: self.sealed.clone().unwrap_or_else(|| beside(&self.out)),
            };
            let series = Series {
                seed,
                n: self.n,
                ablated: &blind::once(&self.ablate),
                jobs: usize::try_from(self.jobs).expect("at most the bound of the argument"),
                how: &how,
            };
            for arm in &arms {
                series.run(*arm, &mut journal)?;
            }
        }
        let own = |verdict: &&Verdict| {
            let truth = &verdict.truth;
            truth.seed == seed && truth.index < self.n && arms.contains(&truth.arm)
        };
        let verdicts: Vec<Verdict> = journal.verdicts().iter().filter(own).cloned().collect();
        let is_own =
            |it: &&NotMeasured| it.seed == seed && it.index < self.n && arms.contains(&it.arm);
        let machines = journal.not_measured().iter().filter(is_own);
        let not_measured: Vec<NotMeasured> = machines.cloned().collect();
        if is_of_a_shop {
            self.publish(&shop::Table::of(&arms, seed, &verdicts).contents()?)?;
        } else {
            let table = table::Table::of(&arms, seed, &verdicts, self.in_process, ratio)
                .without(not_measured);
            let [terminal, json] = [table.terminal()?, table.json()?];
            self.publish(&[terminal, json, table.html()?, table.markdown()?])?;
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Whether the arms are those of a shop, whose sessions need bags and have a table of their own.
    fn is_of_a_shop(&self, arms: &BTreeSet<Arm>) -> Result<bool> {
        let of_a_shop = arms.iter().filter(|arm| arm.is_of_a_shop()).count();
        if of_a_shop == 0 {
            return Ok(false);
        }
        if of_a_shop < arms.len() {
            bail!(
                "--arm: s1, s2, s3 and s4 have a table of their own; run them without other arms"
            );
        }
        if self.in_process || self.baselines || !self.ablate.is_empty() {
            bail!(
                "--arm s1, s2, s3, s4: sessions of shops are diagnosed as processes with all rules; \
                 leave out --in-process, --baselines and --ablate"
            );
        }
        Ok(true)
    }

    /// Checks that arms of designed programmes stand alone, and reads the journal that stands beside them.
    fn ratio(&self, arms: &BTreeSet<Arm>) -> Result<Option<Ratio>> {
        let designed = arms.iter().filter(|arm| arm.is_designed()).count();
        if designed > 0 && designed < arms.len() {
            bail!("--arm: s5, s6 and s7 have a table of their own; run them without other arms");
        }
        if self.in_process && arms.contains(&Arm::DesignedTwoRounds) {
            bail!("--arm s7: the second round is written by a process; leave out --in-process");
        }
        match &self.programmes {
            Some(path) if designed == 0 => bail!(
                "--programmes {}: belongs to the table of s5, s6 and s7; leave it out",
                path.display()
            ),
            Some(path) => programmes::ratio(path).map(Some),
            None => Ok(None),
        }
    }

    /// Prints a table and writes it: for a terminal, as JSON, as a page and as Markdown.
    fn publish(&self, [terminal, json, html, markdown]: &[String; 4]) -> Result<()> {
        abbe::tell::line(format_args!("{terminal}"));
        for (path, contents) in [
            (&self.json, json),
            (&self.html, html),
            (&self.markdown, markdown),
        ] {
            if let Some(path) = path {
                std::fs::write(path, contents).with_context(|| format!("{}", path.display()))?;
            }
        }
        Ok(())
    }
}

/// Refuses trials of one series whose D are of different measures, `made_now` among them.
fn one_measure(verdicts: &[Verdict], seed: u64, made_now: Option<u32>) -> Result<()> {
    let own = verdicts.iter().map(|verdict| &verdict.truth);
    let own = own.filter(|truth| truth.seed == seed);
    let known = own.map(|truth| truth.measure).chain(made_now);
    let measures: BTreeSet<u32> = known.collect();
    if measures.len() > 1 {
        let all: Vec<String> = measures.iter().map(u32::to_string).collect();
        bail!(
            "seed {seed}: D of its trials are of the measures {}, which one table cannot have; {}",
            all.join(" and "),
            "go on with the program that began the series, or begin another (--out, --seed)"
        );
    }
    Ok(())
}

/// A seed that follows from a commit and from nothing else.
fn seed_of(commit: &str) -> u64 {
    let hash = Sha256::digest(format!("blind trials of {commit}"));
    hash.iter()
        .take(8)
        .fold(0, |seed, byte| seed << 8 | u64::from(*byte))
}

/// The folder of the seals for a folder of trials.
fn beside(out: &Path) -> PathBuf {
    let mut name = out.file_name().unwrap_or_default().to_owned();
    name.push("-sealed");
    out.with_file_name(name)
}
