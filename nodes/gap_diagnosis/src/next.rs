//! What to measure next: the run that puts most between two explanations, for the time it takes.
//!
//! # Model
//!
//! Two explanations are the best set of effects and the best set without one of its members. An experiment is
//! simulated as `experiment` describes it, a set-up of its own, so that what it adds to the information adds up:
//!
//! ```text
//!   S = S_session + S_experiment                                          (1)
//!   worth = sum w (2 Phi(sqrt(Delta(S) - Delta(S_session)) / 2) - 1) / minutes   (2)
//! ```
//!
//! with Delta of `distance` both ways, the smaller, summed over the pairs of explanations that the experiment
//! decides ([`DECISION`] or more is added). The experiment of greatest worth is taken, the pairs that it decides are
//! taken out, and so on: a distance beyond a decision is worth no more minutes. For an effect that fails a check
//! without a rival, the other explanation is the same signature with a size of its own in the experiment: a cause
//! has one size everywhere. For one that is only too small to be told from noise it is noise, Delta is what the experiment
//! adds to D^2, and it decides where D then is three standard deviations above the least D_0 that is named; its chance
//! in (2) is Phi(D - D_0). w is D of the effect over D_0, at most 1: what hardly matters is asked last.
//!
//! # Holds when
//! The experiment's noise is the session's; an instrument that the session lacks is taken to be as noisy as the
//! noisiest that it has. Thermometers stay at their last reading.

mod distance;
mod future;
mod lever;

use std::collections::{BTreeMap, BTreeSet};

use machine::MachineFile;
use machine::effects::Role;
use machine::twin::{Channel, Session, Twin};
use nalgebra::{DMatrix, DVector};
use statrs::distribution::ContinuousCDF;

use crate::cause::{Found, Member};
use crate::confidence::ODDS;
use crate::experiment::{Experiment, library};
use crate::figures::Note;
use crate::form_error::FormError;
use crate::noise::Noise;
use crate::normal::Normal;
use crate::report::{NextExperiment, Status};
use crate::selection::Set;
use crate::signature::{Form, Library};
use crate::stack::Stack;
use crate::veto::{LEAST_D as LEAST_NAMED_D, Veto};
use crate::whitener::Autoregression;
use distance::{Explanation, distance};

/// Squared distance that decides: three standard deviations.
pub const DECISION: f64 = 9.0;
/// Most questions that an experiment is sought for.
const MOST_QUESTIONS: usize = 10;
/// A rival within this of the best set still asks for an experiment where its member fails a check.
const NEAR: f64 = 30.0;
/// Stations of a pass: enough for what the run-to-run field leaves.
const STATIONS: usize = 120;

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
}

/// What was proposed.
#[derive(Debug, Default)]
pub struct Proposed {
    /// The report's list, the most telling per minute first.
    pub entries: Vec<NextExperiment>,
    /// The same as experiments, in the same order.
    pub experiments: Vec<Experiment>,
    /// Where nothing helps.
    pub notes: Vec<Note>,
}

/// Two explanations, as forms of the library.
struct Question {
    names: Vec<String>,
    ids: Vec<&'static str>,
    ours: Vec<usize>,
    theirs: Vec<usize>,
    /// Whether one of the two is the best set.
    is_of_the_best: bool,
    /// The form whose size may be another in the experiment; then `theirs` is `ours`.
    resized: Option<usize>,
    /// Whether the other explanation is noise.
    is_noise: bool,
    /// D of the effect that is not named.
    d: f64,
}

/// An experiment with its minutes and the information that it adds.
type Tried = (Experiment, f64, DMatrix<f64>);

/// Experiments for everything that the search left open.
pub fn propose(bench: &Bench<'_>, found: &Found) -> Proposed {
    let questions = questions(found);
    if questions.is_empty() {
        return Proposed::default();
    }
    let signatures = &found.signatures;
    let used: BTreeSet<usize> = questions
        .iter()
        .flat_map(|question| question.ours.iter().chain(&question.theirs))
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
            let added = information(bench, &future.session, &noise, signatures, &forms)?;
            Some((experiment, future.minutes, added))
        })
        .collect();
    answers(&questions, signatures, &known, &tried)
}

/// The session's information on the columns in question.
struct Known {
    gram: DMatrix<f64>,
    along: DVector<f64>,
    columns: Vec<usize>,
}

impl Known {
    /// The best sizes of some forms, and what is not known of them with the catalogue's typical sizes as prior.
    fn explanation(&self, signatures: &Library, forms: &[usize]) -> Explanation {
        let columns: Vec<usize> = forms
            .iter()
            .flat_map(|form| &signatures.forms[*form].columns)
            .filter_map(|column| self.columns.iter().position(|own| own == column))
            .collect();
        let normal = Normal {
            gram: self.gram.clone(),
            along: self.along.clone(),
        };
        let sizes = DVector::from_vec(normal.solve(&columns).sizes);
        let mut precision = self.gram.select_rows(&columns).select_columns(&columns);
        for k in 0..columns.len() {
            precision[(k, k)] += 1.0;
        }
        let doubt = precision.cholesky().map_or_else(
            || DMatrix::zeros(sizes.len(), sizes.len()),
            |factor| factor.inverse(),
        );
        Explanation {
            columns,
            sizes,
            doubt,
        }
    }
}

fn questions(found: &Found) -> Vec<Question> {
    let mut all = Vec::<Question>::new();
    for member in found
        .members
        .iter()
        .filter(|member| member.status != Status::Named)
    {
        if member.vetoes == [Veto::NearNoise] {
            all.push(resized(found, member));
            continue;
        }
        let is_open = |behind: f64| {
            member.status == Status::Set && behind <= 2.0 * ODDS.ln() || behind < NEAR
        };
        let near = member.rivals.iter().filter(|(_, behind)| is_open(*behind));
        let sets: Vec<&Set> = std::iter::once(&found.set)
            .chain(near.map(|(set, _)| set))
            .collect();
        if sets.len() < 2 {
            all.push(resized(found, member));
        }
        for (k, ours) in sets.iter().enumerate() {
            for theirs in &sets[k + 1..] {
                let Some(question) = between(found, member, ours, theirs) else {
                    continue;
                };
                if all.len() < MOST_QUESTIONS
                    && all.iter().all(|other| other.names != question.names)
                {
                    all.push(question);
                }
            }
        }
    }
    all
}

/// Two sets of which neither holds the other.
fn between(found: &Found, member: &Member, ours: &Set, theirs: &Set) -> Option<Question> {
    let signatures = &found.signatures;
    let instance = |form: &usize| signatures.forms[*form].instance;
    let only = |one: &Set, other: &Set| -> Vec<usize> {
        let missing = |form: &usize| other.iter().all(|o| instance(o) != instance(form));
        one.iter()
            .copied()
            .filter(missing)
            .map(|form| instance(&form))
            .collect()
    };
    let sides = [only(ours, theirs), only(theirs, ours)];
    if sides.iter().any(Vec::is_empty) {
        return None;
    }
    let name = |side: &Vec<usize>| {
        let names: Vec<String> = side
            .iter()
            .map(|k| signatures.instances[*k].name())
            .collect();
        names.join(" with ")
    };
    Some(Question {
        names: sides.iter().map(name).collect(),
        ids: sides
            .iter()
            .flatten()
            .map(|k| signatures.instances[*k].kind.id)
            .collect(),
        ours: ours.clone(),
        theirs: theirs.clone(),
        is_of_the_best: *ours == found.set,
        resized: None,
        is_noise: false,
        d: member.estimate.d,
    })
}

/// A member that fails a check without a rival.
fn resized(found: &Found, member: &Member) -> Question {
    let instance = found.instance(member);
    let is_noise = member.vetoes == [Veto::NearNoise];
    let other = if is_noise {
        "noise"
    } else {
        "what only looks like it here"
    };
    Question {
        names: vec![instance.name(), other.to_owned()],
        ids: vec![instance.kind.id],
        ours: found.set.clone(),
        theirs: found.set.clone(),
        is_of_the_best: true,
        resized: Some(member.form),
        is_noise,
        d: member.estimate.d,
    }
}

impl Question {
    /// w of (2).
    fn weight(&self) -> f64 {
        (self.d / LEAST_NAMED_D).min(1.0)
    }

    /// What an experiment has to add for a decision.
    fn needed(&self) -> f64 {
        if self.is_noise {
            // A form of many columns is held to more than D_0.
            ((LEAST_NAMED_D + DECISION.sqrt()).powi(2) - self.d.powi(2)).max(DECISION)
        } else {
            DECISION
        }
    }

    /// The chance of a decision with what an experiment adds.
    fn chance(&self, added: f64) -> f64 {
        let normal = statrs::distribution::Normal::standard();
        if self.is_noise {
            normal.cdf((self.d.powi(2) + added).sqrt() - LEAST_NAMED_D)
        } else {
            2.0 * normal.cdf(0.5 * added.max(0.0).sqrt()) - 1.0
        }
    }

    /// Delta on the session alone, and with an experiment.
    fn distances(&self, signatures: &Library, known: &Known, added: &DMatrix<f64>) -> [f64; 2] {
        let ours = known.explanation(signatures, &self.ours);
        if let Some(form) = self.resized {
            let own = known.explanation(signatures, &[form]);
            let sizes: Vec<f64> = own
                .columns
                .iter()
                .map(|column| {
                    let place = ours.columns.iter().position(|c| c == column);
                    place.map_or(0.0, |place| ours.sizes[place])
                })
                .collect();
            let others: Vec<usize> = ours
                .columns
                .iter()
                .copied()
                .filter(|column| !own.columns.contains(column))
                .collect();
            let doubt = if self.is_noise { 0.0 } else { 1.0 } * own.doubt;
            let own = Explanation {
                sizes: DVector::from_vec(sizes),
                doubt,
                ..own
            };
            return [0.0, distance(added, &own, &others)];
        }
        let theirs = known.explanation(signatures, &self.theirs);
        let both = |information: &DMatrix<f64>| {
            let there = distance(information, &ours, &theirs.columns);
            there.min(distance(information, &theirs, &ours.columns))
        };
        [both(&known.gram), both(&(&known.gram + added))]
    }
}

/// Experiments of greatest worth (2) until no pair is left that one of them decides.
fn answers(
    questions: &[Question],
    signatures: &Library,
    known: &Known,
    tried: &[Tried],
) -> Proposed {
    let table: Vec<Vec<[f64; 2]>> = tried
        .iter()
        .map(|(.., added)| {
            questions
                .iter()
                .map(|q| q.distances(signatures, known, added))
                .collect()
        })
        .collect();
    let mut proposed = Proposed::default();
    let mut open: Vec<usize> = (0..questions.len()).collect();
    loop {
        let decided = |row: &[[f64; 2]]| -> Vec<usize> {
            open.iter()
                .copied()
                .filter(|q| row[*q][1] - row[*q][0] >= questions[*q].needed())
                .collect()
        };
        let worth = |place: usize| -> f64 {
            let row = &table[place];
            let sum: f64 = decided(row)
                .iter()
                .map(|q| (&questions[*q], row[*q][1] - row[*q][0]))
                .map(|(question, added)| question.weight() * question.chance(added))
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
    let most = |q: usize| {
        table
            .iter()
            .map(|row| row[q][1] - row[q][0])
            .fold(0.0, f64::max)
    };
    proposed.notes = open
        .into_iter()
        .filter(|q| questions[*q].is_of_the_best)
        .map(|q| Note::NoRunSeparates {
            effects: questions[q].names.clone(),
            delta: most(q),
            lever: lever::lever(&questions[q].ids),
        })
        .collect();
    proposed
}

impl Proposed {
    /// An experiment with the questions that it decides.
    fn add(&mut self, questions: &[Question], decided: &[usize], row: &[[f64; 2]], tried: &Tried) {
        let (experiment, minutes, _) = tried;
        let mut separates = Vec::<String>::new();
        for name in decided.iter().flat_map(|q| &questions[*q].names) {
            if !separates.contains(name) {
                separates.push(name.clone());
            }
        }
        let deltas = decided.iter().map(|q| row[*q][1]);
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
        assumed.pace = crate::pace::Pace::default();
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

/// What an experiment would tell of some forms' columns.
fn information(
    bench: &Bench<'_>,
    future: &Session,
    noise: &BTreeMap<Channel, Noise>,
    signatures: &Library,
    forms: &[&Form],
) -> Option<DMatrix<f64>> {
    let runs: Vec<usize> = (0..future.runs.len()).collect();
    let nothing: Vec<Vec<f64>> = future
        .runs
        .iter()
        .map(|run| vec![0.0; run.readings.len()])
        .collect();
    let form = FormError::default();
    let stack = Stack::new(future, bench.twin, &runs, STATIONS, noise, &form, &nothing);
    let mut columns = Vec::new();
    for form in forms {
        let instance = &signatures.instances[form.instance];
        for place in &form.amplitudes {
            let parameter = instance
                .kind
                .parameters
                .iter()
                .chain(instance.kind.free)
                .nth(*place)?;
            debug_assert_eq!(parameter.role, Role::Amplitude);
            let mut values = form.values.clone();
            values[*place] = parameter.typical;
            columns.push(stack.signature(&*instance.effect(&values)));
        }
    }
    if stack.rows.len == 0 || columns.is_empty() {
        return None;
    }
    let columns = DMatrix::from_columns(&columns);
    let gram = columns.tr_mul(&columns);
    gram.iter().all(|entry| entry.is_finite()).then_some(gram)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn question(d: f64, is_noise: bool) -> Question {
        Question {
            names: vec![],
            ids: vec![],
            ours: vec![],
            theirs: vec![],
            is_of_the_best: true,
            resized: None,
            is_noise,
            d,
        }
    }

    #[test]
    fn what_is_too_small_wants_a_d_that_is_surely_named_and_a_rival_three_standard_deviations() {
        let small = question(6.1, true);
        let after = (6.1_f64.powi(2) + small.needed()).sqrt();
        assert!((after - (LEAST_NAMED_D + 3.0)).abs() < 1e-12, "{after}");
        // A run that adds what decides between rivals leaves it at an even chance.
        let even = LEAST_NAMED_D.powi(2) - 6.1_f64.powi(2);
        assert!((small.chance(even) - 0.5).abs() < 1e-9 && even < DECISION);
        assert!(question(9.6, true).needed() >= DECISION);
        let rivals = question(40.0, false);
        assert!((rivals.needed() - DECISION).abs() < 1e-12);
        assert!((rivals.chance(DECISION) - 0.8664).abs() < 1e-4);
    }

    #[test]
    fn what_hardly_matters_weighs_by_its_d() {
        assert!((question(1.3, false).weight() - 0.2).abs() < 1e-12);
        assert!((question(84.0, false).weight() - 1.0).abs() < 1e-12);
    }
}
