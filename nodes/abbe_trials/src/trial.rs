//! One trial from the drawing of its machine to its verdicts.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use gap_diagnosis::Rule;
use gap_diagnosis::report::Status;
use trials::designed::SECOND_ROUND_MIN;
use trials::{Arm, Rig, Second, Trial, Truth, Verdict, judge, likeness};

use crate::blind::{self, Beside, Diagnosed, Question};
use crate::seal::Seal;
use crate::second_round::second;
use crate::{design, later, session_bag, shop};

/// How trials are made.
pub struct How {
    /// Without bag, seal and process.
    pub in_process: bool,
    /// Whether bags and reports stay.
    pub keep: bool,
    /// Whether other methods are asked as well.
    pub baselines: bool,
    /// Folder of the trials.
    pub out: PathBuf,
    /// Folder of the seals.
    pub sealed: PathBuf,
}

/// Which trial, and which diagnoses of it.
pub struct Which<'w> {
    /// Arm.
    pub arm: Arm,
    /// Seed of its series.
    pub seed: u64,
    /// Its number.
    pub index: u64,
    /// Rules that are switched off, one at a time; none: with all rules.
    pub rules: &'w [Option<Rule>],
}

impl Which<'_> {
    /// What its folder and its seal are called.
    pub fn name(&self) -> String {
        format!("{}-{}-{:05}", self.arm, self.seed, self.index)
    }

    /// Whether what is left on held-out runs is compared with a machine that hides nothing.
    fn has_oracle(&self) -> bool {
        matches!(
            self.arm,
            Arm::Catalogue | Arm::Foreign | Arm::Alone | Arm::Own | Arm::Designed
        )
    }

    /// Whether its interval of the gap closed is judged on later runs.
    fn has_later_runs(&self) -> bool {
        matches!(self.arm, Arm::Catalogue | Arm::Foreign | Arm::Designed)
    }

    /// How the diagnosis is asked without a rule, or with all.
    fn question<'q>(&self, left_out: Option<&'q str>, rule: Option<Rule>) -> Question<'q> {
        let is_whole = rule.is_none();
        let has_rounds = is_whole && self.arm == Arm::DesignedTwoRounds;
        Question {
            left_out,
            ablated: rule,
            writes_machine: is_whole && self.has_later_runs(),
            second_round_min: has_rounds.then_some(SECOND_ROUND_MIN),
        }
    }
}

/// A diagnosis with the rule that was off and the time it took with its program and bag, s.
pub type Answer = (Option<Rule>, Diagnosed, f64);

/// Everything that was said of a trial before its seal is opened.
struct Said {
    answers: Vec<Answer>,
    second: Option<Second>,
    later_closed: Option<f64>,
    beside: Option<Beside>,
    making_s: f64,
}

impl How {
    /// Makes a trial; `tell` gets the seal of its truth first.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn trial(&self, which: &Which<'_>, tell: &dyn Fn(&str)) -> Result<Vec<Verdict>> {
        if which.arm.is_of_a_shop() {
            return shop::trial(self, which, tell);
        }
        let began = Instant::now();
        let mut trial = self.drawn(which)?;
        if which.has_oracle() && !trial.truth.effects.is_empty() {
            trial.truth.bare_um = blind::bare_um(&trial.bare)?;
        }
        if self.in_process {
            return self.within(which, trial, began);
        }
        let name = which.name();
        let folder = self.out.join(&name);
        if folder.exists() {
            std::fs::remove_dir_all(&folder)?;
        }
        std::fs::create_dir_all(&folder).with_context(|| format!("{}", folder.display()))?;
        let machine_text = trial.rig.machine_text()?;
        std::fs::write(folder.join("machine.yaml"), &machine_text)?;
        session_bag::write(&trial.rig, &folder.join("bag"), machine_text.clone())?;
        if which.arm == Arm::DesignedTwoRounds {
            std::fs::write(folder.join(blind::PLAN), trial.rig.plan_text()?)?;
            blind::make_told(&folder)?;
        }
        let seal = Seal::write(&self.sealed, &name, &trial.truth)?;
        let left_out = trial.truth.left_out.clone();
        let rig = trial.rig;
        tell(&format!("sealed {name}: sha256 {}", seal.sha256));
        let making_s = began.elapsed().as_secs_f64();
        let mut answers = vec![];
        for rule in which.rules {
            let question = which.question(left_out.as_deref(), *rule);
            let began = Instant::now();
            let diagnosed = blind::as_process(&folder, &["bag"], &question)?;
            answers.push((*rule, diagnosed, began.elapsed().as_secs_f64()));
        }
        if self.keep {
            keep(&folder, &answers)?;
        }
        let second = second(which.arm, &answers, (&rig, &folder), &|later| {
            session_bag::write(later, &folder.join("bag_2"), machine_text.clone())?;
            blind::as_process(&folder, &["bag", "bag_2"], &Question::default())
        })?;
        let beside = self.asks(which).then(|| -> Result<Beside> {
            let recording = blind::read(&folder, &["bag"], &machine_text)?;
            Ok(blind::beside(&recording, left_out.as_deref()))
        });
        let later_closed = later_closed(&answers, &rig)?;
        let said = Said {
            answers,
            second,
            later_closed,
            beside: beside.transpose()?,
            making_s,
        };
        if !self.keep {
            std::fs::remove_dir_all(&folder)?;
        }
        Ok(verdicts(&seal.open()?, &seal.sha256, said))
    }

    /// Takes away the folder of a trial that was not made to its end.
    ///
    /// # Errors
    /// When that cannot be done.
    pub fn tidy(&self, which: &Which<'_>) -> Result<()> {
        let folder = self.out.join(which.name());
        if !self.keep && folder.exists() {
            std::fs::remove_dir_all(&folder).with_context(|| format!("{}", folder.display()))?;
        }
        Ok(())
    }

    /// The machine with what it hides and the programme that measures it.
    fn drawn(&self, which: &Which<'_>) -> Result<Trial> {
        let trial = Trial::draw(which.arm, which.seed, which.index)?;
        if !which.arm.is_designed() {
            return Ok(trial);
        }
        let minutes = trials::designed::minutes(which.index);
        let programme = design::programme(&self.out, &trial.rig.machine_text()?, minutes)?;
        Ok(trial.measured_by(&programme)?)
    }

    /// Without bag, seal and process.
    fn within(&self, which: &Which<'_>, trial: Trial, began: Instant) -> Result<Vec<Verdict>> {
        let left_out = trial.truth.left_out.clone();
        let recording = blind::recorded(&[&trial.rig])?;
        let making_s = began.elapsed().as_secs_f64();
        let answer = |rule: &Option<Rule>| {
            let question = which.question(left_out.as_deref(), *rule);
            let began = Instant::now();
            let diagnosed = match &recording {
                Ok(recording) => blind::in_process(recording, &question),
                Err(reason) => Err(reason.clone()),
            };
            (*rule, diagnosed, began.elapsed().as_secs_f64())
        };
        let answers: Vec<Answer> = which.rules.iter().map(answer).collect();
        let nowhere = Path::new("");
        let second = second(which.arm, &answers, (&trial.rig, nowhere), &|later| {
            Ok(match blind::recorded(&[&trial.rig, later])? {
                Ok(recording) => blind::in_process(&recording, &Question::default()),
                Err(reason) => Err(reason),
            })
        })?;
        let asked = recording.as_ref().ok().filter(|_| self.asks(which));
        let later_closed = later_closed(&answers, &trial.rig)?;
        let said = Said {
            answers,
            second,
            later_closed,
            beside: asked.map(|recording| blind::beside(recording, left_out.as_deref())),
            making_s,
        };
        Ok(verdicts(&trial.truth, "", said))
    }

    /// Whether other methods are asked: once a trial, beside the diagnosis with all its rules.
    fn asks(&self, which: &Which<'_>) -> bool {
        self.baselines && which.rules.contains(&None)
    }
}

fn keep(folder: &Path, answers: &[Answer]) -> Result<()> {
    for (rule, diagnosed, _) in answers {
        if let Ok(answer) = diagnosed {
            let name = rule.map_or("gap.json".to_owned(), |rule| {
                format!("gap_without_{rule}.json")
            });
            let json = serde_json::to_string_pretty(&answer.report)?;
            std::fs::write(folder.join(name), json)?;
        }
    }
    Ok(())
}

/// What the named effects close on later runs, where each of them stands alone.
fn later_closed(answers: &[Answer], rig: &Rig) -> Result<Option<f64>> {
    let whole = answers.iter().find(|(rule, ..)| rule.is_none());
    let Some((_, Ok(answer), _)) = whole else {
        return Ok(None);
    };
    let causes = &answer.report.causes;
    let is_open = causes.iter().any(|cause| cause.status == Status::Set);
    let is_named = causes.iter().any(|cause| cause.status == Status::Named);
    match &answer.machine {
        Some(machine) if is_named && !is_open => later::closed(rig, machine),
        _ => Ok(None),
    }
}

fn verdicts(truth: &Truth, sha256: &str, said: Said) -> Vec<Verdict> {
    let Said {
        answers,
        mut second,
        later_closed,
        beside,
        making_s,
    } = said;
    let signatures = beside
        .as_ref()
        .and_then(|beside| beside.signatures.as_ref());
    let mut likeness = signatures.map_or_else(Vec::new, |signatures| likeness(truth, signatures));
    let mut baselines = beside.map_or_else(BTreeMap::new, |beside| beside.baselines);
    let of = |(rule, diagnosed, diagnosis_s): Answer| {
        let (said, refused) = match diagnosed {
            Ok(answer) => (Some(judge(&answer.report)), None),
            Err(reason) => (None, Some(reason)),
        };
        let is_whole = rule.is_none();
        Verdict {
            truth: truth.clone(),
            truth_sha256: sha256.to_owned(),
            commit: abbe::COMMIT.to_owned(),
            said,
            refused,
            diagnosis_s,
            making_s,
            ablated: rule,
            baselines: if is_whole {
                std::mem::take(&mut baselines)
            } else {
                BTreeMap::new()
            },
            likeness: if is_whole {
                std::mem::take(&mut likeness)
            } else {
                vec![]
            },
            later_closed: later_closed.filter(|_| is_whole),
            second: second.take().filter(|_| is_whole),
            shop: None,
        }
    };
    answers.into_iter().map(of).collect()
}
