//! What to measure next: the run that puts most between two explanations, for the time it takes.
//!
//! # Model
//!
//! Two explanations are the best set of effects and the best set without one of its members. An experiment is
//! simulated as `experiment` describes it, a set-up of its own, so that what it adds to the information adds up:
//!
//! ```text
//!   S = S_session + S_experiment   (`information`)                        (1)
//!   worth = sum w (2 Phi(sqrt(Delta(S) - Delta(S_session)) / 2) - 1) / minutes   (2)
//! ```
//!
//! with Delta of `distance` both ways, the smaller, summed over the pairs of explanations that the experiment
//! decides ([`question::DECISION`] or more is added). The experiment of greatest worth is taken, the pairs that it decides are
//! taken out, and so on: a distance beyond a decision is worth no more minutes. For an effect that fails a check
//! without a rival, the other explanation is the same signature with a size of its own in the experiment: a cause
//! has one size everywhere. For one that is only too small to be told from noise it is noise, Delta is what the experiment
//! adds to D^2, and it decides where D then is three standard deviations above the least D_0 at which a form of so many
//! columns is named; its chance in (2) is Phi(D - D_0). What has rivals and is too small besides is not named by losing its rivals: an experiment
//! decides of it where it does both, and its chance is the product. w is D of the effect over D_0, at most 1: what hardly
//! matters is asked last.
//!
//! # Holds when
//! The experiment's noise is the session's, and the simulator is off in form there by as much as in the session: in a condition
//! that the session has as it is there (`information`), elsewhere otherwise. An instrument that the session lacks is taken to be as noisy as the noisiest that it has. Thermometers stay at their last reading.

mod distance;
mod future;
mod information;
mod known;
mod lever;
mod question;

use std::collections::{BTreeMap, BTreeSet};

use machine::MachineFile;
use nalgebra::DMatrix;
use twin::{Channel, Session, Twin};

use crate::experiment::{Experiment, library};
use crate::judgement::cause::Found;
use crate::noise::Noise;
use crate::noise::form_error::FormError;
use crate::noise::unrepeated;
use crate::noise::whitener::Autoregression;
use crate::report::NextExperiment;
use crate::report::figures::Note;
use crate::search::signature::{Form, Library};
use crate::session::unread;
use known::Known;
use question::{Answer, Question, questions};

pub(crate) use lever::lever;
pub(crate) use question::DECISION;

/// What experiments are simulated with.
pub struct Bench<'b> {
    /// The machine.
    pub machine: &'b MachineFile,
    /// The session so far.
    pub session: &'b Session,
    /// The simulator.
    pub twin: &'b Twin<'b>,
    /// The noise floor.
    pub noise: &'b BTreeMap<Channel, Noise>,
    /// What the simulator is off by in form, before any effect was found.
    pub form: FormError,
}

/// What was proposed.
#[derive(Debug, Default)]
pub struct Proposed {
    /// The report's list, the most telling per minute first.
    pub entries: Vec<NextExperiment>,
    /// The same as experiments, in the same order.
    pub experiments: Vec<Experiment>,
    /// Where nothing helps, and what the recording lacked.
    pub notes: Vec<Note>,
}
/// An experiment with its minutes and the information that it adds.
type Tried = (Experiment, f64, DMatrix<f64>);

/// Experiments for everything that the search left open, and what the recording itself lacked.
pub fn propose(bench: &Bench<'_>, found: &Found) -> Proposed {
    let mut proposed = experiments(bench, found);
    proposed.notes.extend(found.thermometers.iter().cloned());
    proposed
        .notes
        .extend(unrepeated::notes(bench.session, bench.noise));
    proposed.notes.extend(unread::notes(bench.session));
    proposed
}

fn experiments(bench: &Bench<'_>, found: &Found) -> Proposed {
    let questions = questions(found);
    if questions.is_empty() {
        return Proposed::default();
    }
    let signatures = &found.signatures;
    let used: BTreeSet<usize> = questions
        .iter()
        .flat_map(|question| {
            let small = question.too_small.iter().flat_map(|(_, set)| set);
            question.ours.iter().chain(&question.theirs).chain(small)
        })
        .copied()
        .collect();
    let forms: Vec<&Form> = used.iter().map(|form| &signatures.forms[*form]).collect();
    let columns: Vec<usize> = forms.iter().flat_map(|form| form.columns.clone()).collect();
    let known = Known {
        gram: found
            .normal
            .gram
            .select_rows(&columns)
            .select_columns(&columns),
        along: found.normal.along.select_rows(&columns),
        columns,
    };
    let noise = bench.noise_of_all();
    let tried: Vec<Tried> = library::experiments(bench.machine, bench.session)
        .into_iter()
        .filter_map(|experiment| {
            let future = future::future(bench, &experiment, &noise)?;
            let added = information::added(bench, &future.session, &noise, signatures, &forms)?;
            Some((experiment, future.minutes, added))
        })
        .collect();
    answers(&questions, signatures, &known, &tried)
}
/// Experiments of greatest worth (2) until no pair is left that one of them decides.
fn answers(
    questions: &[Question],
    signatures: &Library,
    known: &Known,
    tried: &[Tried],
) -> Proposed {
    let table: Vec<Vec<Answer>> = tried
        .iter()
        .map(|(.., added)| {
            questions
                .iter()
                .map(|question| question.answer(signatures, known, added))
                .collect()
        })
        .collect();
    let mut proposed = Proposed::default();
    let mut open: Vec<usize> = (0..questions.len()).collect();
    loop {
        let decided = |row: &[Answer]| -> Vec<usize> {
            open.iter()
                .copied()
                .filter(|q| questions[*q].is_decided(&row[*q]))
                .collect()
        };
        let worth = |place: usize| -> f64 {
            let row = &table[place];
            let sum: f64 = decided(row)
                .iter()
                .map(|q| questions[*q].weight() * questions[*q].chance(&row[*q]))
                .sum();
            sum / tried[place].1
        };
        let best = (0..tried.len()).max_by(|a, b| worth(*a).total_cmp(&worth(*b)));
        let Some(best) = best.filter(|place| worth(*place) > 0.0) else {
            break;
        };
        let now = decided(&table[best]);
        proposed.add(questions, &now, &table[best], &tried[best]);
        open.retain(|q| !now.contains(q));
    }
    proposed.notes = open
        .into_iter()
        .filter(|q| questions[*q].is_of_the_best)
        .map(|q| {
            let titles = tried.iter().map(|(experiment, ..)| &*experiment.title);
            let runs: Vec<(&str, Answer)> = titles.zip(table.iter().map(|row| row[q])).collect();
            Note::NoRun(questions[q].unanswered(&runs))
        })
        .collect();
    proposed
}

impl Proposed {
    /// An experiment with the questions that it decides.
    fn add(&mut self, questions: &[Question], decided: &[usize], row: &[Answer], tried: &Tried) {
        let (experiment, minutes, _) = tried;
        let mut separates = Vec::<String>::new();
        for name in decided.iter().flat_map(|q| &questions[*q].names) {
            if !separates.contains(name) {
                separates.push(name.clone());
            }
        }
        let deltas = decided.iter().map(|q| row[*q].distances[1]);
        self.entries.push(NextExperiment {
            run: experiment.title.clone(),
            separates,
            delta: deltas.fold(f64::INFINITY, f64::min),
            minutes: *minutes,
        });
        self.experiments.push(experiment.clone());
    }
}

impl Bench<'_> {
    /// The noise of every channel that an experiment may read.
    fn noise_of_all(&self) -> BTreeMap<Channel, Noise> {
        let mut all = self.noise.clone();
        let lengths = self.noise.iter().filter(|(channel, _)| match channel {
            Channel::Motor(axis) | Channel::Scale(axis) => axis.is_linear(),
            Channel::Thermometer(_) => false,
            _ => true,
        });
        let noisiest = lengths
            .map(|(_, noise)| noise)
            .max_by(|a, b| a.total_mm().total_cmp(&b.total_mm()));
        let Some(noisiest) = noisiest else { return all };
        let mut assumed = noisiest.clone();
        assumed.within = Autoregression::white(noisiest.row_sigma_mm.powi(2));
        assumed.pace = crate::noise::pace::Pace::default();
        let linear = metrology::Axis::LINEAR.into_iter().map(Channel::Length);
        for channel in [
            Channel::GridU,
            Channel::GridV,
            Channel::Radial,
            Channel::Touch,
        ]
        .into_iter()
        .chain(linear)
        {
            all.entry(channel).or_insert_with(|| assumed.clone());
        }
        all
    }
}
