//! What a search left open: two explanations of one effect, and what would decide between them.

use nalgebra::DMatrix;
use statrs::distribution::ContinuousCDF;

use super::distance::distance;
use super::known::Known;
use super::lever;
use crate::judgement::cause::{Found, Member};
use crate::judgement::confidence::ODDS;
use crate::judgement::veto::{Veto, least_d_squared};
use crate::report::Status;
use crate::report::figures::NoRun;
use crate::search::selection::Set;
use crate::search::signature::Library;

/// Squared distance that decides: three standard deviations.
pub const DECISION: f64 = 9.0;
/// An effect is surely named where its D is so many standard deviations above the least that is named.
const SURELY: f64 = 3.0;
/// Most questions that an experiment is sought for.
const MOST_QUESTIONS: usize = 10;
/// A rival within this of the best set still asks for an experiment where its member fails a check.
const RIVAL_DISTANCE: f64 = 30.0;

/// Two explanations of what was found.
pub struct Question {
    /// What is to be told apart, in words.
    pub names: Vec<String>,
    /// Ids of the effects in question.
    pub ids: Vec<&'static str>,
    /// One explanation, as forms of the library.
    pub ours: Vec<usize>,
    /// The other one.
    pub theirs: Vec<usize>,
    /// Whether one of the two is the best set.
    pub is_of_the_best: bool,
    /// The form whose size may be another in the experiment; then `theirs` is `ours`.
    resized: Option<usize>,
    /// Whether the other explanation is noise.
    is_noise: bool,
    /// The form of the effect where it is too small besides, and the set that it is sized in.
    pub too_small: Option<(usize, Set)>,
    /// The effect that is not named.
    effect: String,
    /// Its D.
    d: f64,
    /// The least D at which it is named: a form of many columns is held to more.
    least_d: f64,
}

/// What an experiment would tell of a question.
#[derive(Clone, Copy, Debug)]
pub struct Answer {
    /// Delta on the session alone, and with the experiment.
    pub distances: [f64; 2],
    /// What is added to D^2 of an effect that is too small besides.
    lift: Option<f64>,
}

impl Answer {
    /// What the experiment adds to Delta.
    pub fn added(&self) -> f64 {
        self.distances[1] - self.distances[0]
    }
}

/// Everything that the search left open.
pub fn questions(found: &Found) -> Vec<Question> {
    let mut all = Vec::<Question>::new();
    for member in found
        .members
        .iter()
        .filter(|member| member.status() != Status::Named)
    {
        if member.vetoes() == [Veto::NearNoise] {
            all.push(resized(found, member));
            continue;
        }
        let is_open = |behind: f64| {
            member.status() == Status::Set && behind <= 2.0 * ODDS.ln() || behind < RIVAL_DISTANCE
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
                let is_full = all.len() >= MOST_QUESTIONS;
                match all.iter_mut().find(|other| other.names == question.names) {
                    Some(known) => known.also_of(question),
                    None if is_full => {}
                    None => all.push(question),
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
        too_small: too_small(found, member),
        effect: found.instance(member).name(),
        d: member.estimate.d,
        least_d: least_d(found, member),
    })
}

/// A member that fails a check without a rival.
fn resized(found: &Found, member: &Member) -> Question {
    let instance = found.instance(member);
    let is_noise = member.vetoes() == [Veto::NearNoise];
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
        too_small: too_small(found, member).filter(|_| !is_noise),
        effect: instance.name(),
        d: member.estimate.d,
        least_d: least_d(found, member),
    }
}

/// The least D at which a member is named.
fn least_d(found: &Found, member: &Member) -> f64 {
    let log_rows = found.freedom.max(2.0).ln();
    least_d_squared(member.estimate.active.len(), log_rows).sqrt()
}

/// The form of a member near noise, and the set that it is sized in.
fn too_small(found: &Found, member: &Member) -> Option<(usize, Set)> {
    let is_near = member.vetoes().contains(&Veto::NearNoise);
    is_near.then(|| (member.form, found.set.clone()))
}
impl Question {
    /// w of `next`, (2).
    pub fn weight(&self) -> f64 {
        (self.d / self.least_d).min(1.0)
    }

    /// The same question, asked of another effect: what is the smaller of the two has to become large enough.
    fn also_of(&mut self, other: Self) {
        let is_smaller = other.d / other.least_d < self.d / self.least_d;
        if other.too_small.is_some() && (self.too_small.is_none() || is_smaller) {
            *self = other;
        }
    }

    /// What an experiment has to add for a decision.
    fn needed(&self) -> f64 {
        if self.is_noise {
            self.needed_lift()
        } else {
            DECISION
        }
    }

    /// What has to be added to D^2 of an effect that is too small.
    fn needed_lift(&self) -> f64 {
        ((self.least_d + SURELY).powi(2) - self.d.powi(2)).max(DECISION)
    }

    /// D from which it is surely named, and that a run must make it in any case.
    fn wanted_d(&self) -> f64 {
        self.d.hypot(self.needed_lift().sqrt())
    }

    /// What is told where none of some experiments, by their titles, decides.
    pub fn unanswered(&self, runs: &[(&str, Answer)]) -> NoRun {
        let lift_of = |answer: &Answer| answer.lift.unwrap_or_else(|| answer.added());
        let (separates, delta) = greatest(runs, Answer::added);
        let (raises, lift) = greatest(runs, lift_of);
        let is_only_small = self.is_noise || (self.too_small.is_some() && delta >= self.needed());
        if !is_only_small {
            return NoRun::Separates {
                effects: self.names.clone(),
                delta,
                lever: lever::lever(&self.ids),
            };
        }
        let (effect, d, wanted_d) = (self.effect.clone(), self.d, self.wanted_d());
        if lift >= self.needed_lift() {
            return NoRun::DoesBoth {
                effect,
                d,
                wanted_d,
                separates: separates.to_owned(),
                raises: raises.to_owned(),
            };
        }
        NoRun::Raises {
            effect,
            d,
            most_d: d.hypot(lift.sqrt()),
            wanted_d,
        }
    }

    /// Whether the experiment decides.
    pub fn is_decided(&self, answer: &Answer) -> bool {
        let is_raised = |lift: f64| lift >= self.needed_lift();
        answer.added() >= self.needed() && answer.lift.is_none_or(is_raised)
    }

    /// The chance of a decision with what an experiment adds.
    pub fn chance(&self, answer: &Answer) -> f64 {
        let normal = statrs::distribution::Normal::standard();
        let is_named = |lift: f64| normal.cdf((self.d.powi(2) + lift).sqrt() - self.least_d);
        if self.is_noise {
            return is_named(answer.added());
        }
        let between = 2.0 * normal.cdf(0.5 * answer.added().max(0.0).sqrt()) - 1.0;
        between * answer.lift.map_or(1.0, is_named)
    }

    /// Of an experiment, by what it adds to the information.
    pub fn answer(&self, signatures: &Library, known: &Known, added: &DMatrix<f64>) -> Answer {
        let raised = |(form, set): &(usize, Set)| known.of_one(signatures, set, *form, added, 0.0);
        Answer {
            distances: self.distances(signatures, known, added),
            lift: self.too_small.as_ref().map(raised),
        }
    }

    /// Delta on the session alone, and with an experiment.
    fn distances(&self, signatures: &Library, known: &Known, added: &DMatrix<f64>) -> [f64; 2] {
        if let Some(form) = self.resized {
            let doubt = if self.is_noise { 0.0 } else { 1.0 };
            let alone = known.of_one(signatures, &self.ours, form, added, doubt);
            return [0.0, alone];
        }
        let ours = known.explanation(signatures, &self.ours);
        let theirs = known.explanation(signatures, &self.theirs);
        let both = |information: &DMatrix<f64>| {
            let there = distance(information, &ours, &theirs.columns);
            there.min(distance(information, &theirs, &ours.columns))
        };
        [both(&known.gram), both(&(&known.gram + added))]
    }
}

/// The run that gives most of something, by its title, and how much; nothing below zero.
fn greatest<'t>(runs: &[(&'t str, Answer)], of: impl Fn(&Answer) -> f64) -> (&'t str, f64) {
    let all = runs.iter().map(|(title, answer)| (*title, of(answer)));
    all.fold(
        ("", 0.0),
        |best, one| if one.1 > best.1 { one } else { best },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judgement::veto::MIN_D_TO_NAME;

    fn question(d: f64, is_noise: bool) -> Question {
        Question {
            names: vec![],
            ids: vec![],
            ours: vec![],
            theirs: vec![],
            is_of_the_best: true,
            resized: None,
            is_noise,
            too_small: None,
            effect: "backlash Z".to_owned(),
            d,
            least_d: MIN_D_TO_NAME,
        }
    }

    fn answer(added: f64, lift: Option<f64>) -> Answer {
        Answer {
            distances: [0.0, added],
            lift,
        }
    }

    #[test]
    fn what_is_too_small_wants_a_d_that_is_surely_named_and_a_rival_three_standard_deviations() {
        let small = question(6.1, true);
        let after = (6.1_f64.powi(2) + small.needed()).sqrt();
        assert!((after - (MIN_D_TO_NAME + 3.0)).abs() < 1e-12, "{after}");
        // A run that adds what decides between rivals leaves it at an even chance.
        let even = MIN_D_TO_NAME.powi(2) - 6.1_f64.powi(2);
        let chance = small.chance(&answer(even, None));
        assert!((chance - 0.5).abs() < 1e-9 && even < DECISION);
        assert!(question(9.6, true).needed() >= DECISION);
        let rivals = question(40.0, false);
        assert!((rivals.needed() - DECISION).abs() < 1e-12);
        let chance = rivals.chance(&answer(DECISION, None));
        assert!((chance - 0.8664).abs() < 1e-4);
    }

    #[test]
    fn what_has_rivals_and_is_too_small_wants_a_run_that_does_both() {
        let small = question(5.8, false);
        let enough = small.needed_lift();
        assert!(!small.is_decided(&answer(400.0, Some(0.0))));
        assert!(!small.is_decided(&answer(0.0, Some(enough))));
        assert!(small.is_decided(&answer(DECISION, Some(enough))));
        let both = small.chance(&answer(400.0, Some(enough)));
        assert!(both > 0.99 && small.chance(&answer(400.0, Some(0.0))) < 0.25);
    }

    #[test]
    fn what_hardly_matters_weighs_by_its_d() {
        assert!((question(1.3, false).weight() - 0.2).abs() < 1e-12);
        assert!((question(84.0, false).weight() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn where_a_run_separates_and_none_raises_enough_that_is_what_is_told() {
        let small = Question {
            too_small: Some((0, vec![0])),
            ..question(6.0, false)
        };
        let runs = |all: &[Answer]| -> Vec<(&str, Answer)> {
            ["a", "b"].into_iter().zip(all.iter().copied()).collect()
        };
        let told = small.unanswered(&runs(&[answer(400.0, Some(13.0)), answer(2.0, Some(0.0))]));
        let wanted = NoRun::Raises {
            effect: "backlash Z".to_owned(),
            d: 6.0,
            most_d: 7.0,
            wanted_d: 9.5,
        };
        assert_eq!(told, wanted);
        let alike = small.unanswered(&runs(&[answer(2.0, Some(90.0))]));
        assert!(matches!(alike, NoRun::Separates { .. }), "{alike}");
        let each = small.unanswered(&runs(&[answer(400.0, Some(13.0)), answer(2.0, Some(90.0))]));
        let both = NoRun::DoesBoth {
            effect: "backlash Z".to_owned(),
            d: 6.0,
            wanted_d: 9.5,
            separates: "a".to_owned(),
            raises: "b".to_owned(),
        };
        assert_eq!(each, both);
    }

    #[test]
    fn of_two_effects_with_one_question_the_smaller_has_to_become_large_enough() {
        let small = |d| Question {
            too_small: Some((0, vec![0])),
            ..question(d, false)
        };
        let mut large = question(9.0, false);
        large.also_of(small(5.0));
        assert!(large.too_small.is_some() && large.needed_lift() > DECISION);
        large.also_of(small(6.0));
        assert!((large.d - 5.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_said_to_be_wanted_is_more_than_what_a_run_would_make_it() {
        for (d, least_d) in [(9.3, MIN_D_TO_NAME), (6.0, MIN_D_TO_NAME), (8.9, 8.5)] {
            let small = Question {
                least_d,
                ..question(d, true)
            };
            let told = small.unanswered(&[("a", answer(small.needed() - 0.1, None))]);
            let NoRun::Raises {
                most_d, wanted_d, ..
            } = told
            else {
                panic!("{told}");
            };
            assert!(
                most_d < wanted_d && wanted_d >= least_d + SURELY,
                "{d}: {most_d} {wanted_d}"
            );
        }
    }
}
