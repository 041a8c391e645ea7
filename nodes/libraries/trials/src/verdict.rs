//! One trial judged: what was hidden beside what was said.
//!
//! A cause counts as *named* where its status is `named` or `set`; a surrogate is shown, not named. It is right where
//! class and axis are those of a hidden effect.

use std::collections::BTreeMap;

use gap_diagnosis::regression::Regression;
use gap_diagnosis::report::Status;
use gap_diagnosis::{GapReport, Rule};
use serde::{Deserialize, Serialize};

use crate::baseline::{Method, Names};
use crate::shop::Answer;
use crate::truth::{TrueEffect, Truth};

/// Least share of the squared gap that the truth must close for a ratio to mean something.
const LEAST_CLOSED: f64 = 0.1;

/// The verdict on one trial: a line of the journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Verdict {
    /// What was hidden.
    pub truth: Truth,
    /// SHA-256 of the sealed file that said so, hexadecimal.
    pub truth_sha256: String,
    /// Commit of the program that diagnosed.
    pub commit: String,
    /// What was said; none where the diagnosis was refused.
    pub said: Option<Said>,
    /// Why it was refused.
    pub refused: Option<String>,
    /// Time that the diagnosis took with all reading, s.
    pub diagnosis_s: f64,
    /// Time that making the trial took, s.
    pub making_s: f64,
    /// Rule of the diagnosis that was switched off.
    #[serde(default)]
    pub ablated: Option<Rule>,
    /// What other methods named on the same session, where they were asked.
    #[serde(default)]
    pub baselines: BTreeMap<Method, Names>,
    /// What each hidden effect was predicted to look like, where that was asked.
    #[serde(default)]
    pub likeness: Vec<Likeness>,
    /// Share of the gap that the named effects close on the same programme measured once more, where that was asked.
    #[serde(default)]
    pub later_closed: Option<f64>,
    /// What one more run, of the diagnosis' choice, changed.
    #[serde(default)]
    pub second: Option<Second>,
    /// What the answer to a shop's session has beside its causes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shop: Option<Answer>,
}

/// What a hidden effect looks like on the recording, by the signatures alone, before anything is measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Likeness {
    /// Id of its class.
    pub effect: String,
    /// What it acts on.
    pub axis: String,
    /// Part of its signature that no other class can imitate, 0 to 1.
    pub sin_alone: f64,
    /// Greatest cosine with an effect of each other class.
    pub cos: BTreeMap<String, f64>,
}

/// A second round: the diagnosis of the session and of one more run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Second {
    /// The run that was asked for.
    pub run: String,
    /// What it was to tell apart.
    pub separates: Vec<String>,
    /// Squared distance that it was to put between them.
    pub delta: f64,
    /// What was said of both; none where the run could not be made or the diagnosis was refused.
    pub said: Option<Said>,
    /// Why there is nothing.
    pub refused: Option<String>,
}

/// The part of a report that is judged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Said {
    /// Every cause, also surrogates.
    pub causes: Vec<SaidCause>,
    /// Whether something unknown is left.
    pub is_unknown: bool,
    /// Score over threshold of what is left.
    pub unknown_ratio: f64,
    /// What it goes with.
    pub covariate: String,
    /// Whether every channel's scatter is that of its repeats.
    pub is_reproduced: bool,
    /// Whether there is a gap at all.
    pub above_floor: bool,
    /// Gap and floor, µm.
    pub gap_um: [f64; 2],
    /// On held-out runs before and after, µm.
    pub held_out_um: [Option<f64>; 2],
    /// Share of the gap that was closed, with its interval.
    pub closed: Option<[f64; 3]>,
    /// Time that the diagnosis itself took, without starting a program, s.
    #[serde(default)]
    pub runtime_s: f64,
    /// The first run that was asked for: what, what it tells apart, and the squared distance that it puts between.
    #[serde(default)]
    pub next: Option<(String, Vec<String>, f64)>,
}

/// A cause as it was said.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SaidCause {
    /// Id of its class.
    pub effect: String,
    /// What it acts on.
    pub axis: String,
    /// How sure.
    pub status: Status,
    /// Probability.
    pub confidence: f64,
    /// Size against the noise floor.
    #[serde(rename = "D")]
    pub d: f64,
    /// Parameters: name, value, low, high.
    pub parameters: Vec<(String, f64, f64, f64)>,
    /// What else it may be, by class and axis, where the data do not exclude it.
    pub rivals: Vec<(String, String)>,
    /// Whether it has one size under all conditions, and by how many sigma it has not.
    pub constancy: (bool, f64, String),
}

/// What a report says.
#[must_use]
pub fn judge(report: &GapReport) -> Said {
    let causes = report.causes.iter().map(|cause| SaidCause {
        effect: cause.effect.clone(),
        axis: cause.axis.clone(),
        status: cause.status,
        confidence: cause.confidence,
        d: cause.d,
        parameters: cause
            .parameters
            .iter()
            .map(|p| (p.name.clone(), p.value, p.low, p.high))
            .collect(),
        rivals: cause
            .confusable_with
            .iter()
            .filter(|rival| !rival.excluded)
            .map(|rival| (rival.effect.clone(), rival.axis.clone()))
            .collect(),
        constancy: (
            cause.constancy.passed,
            cause.constancy.worst_z,
            cause.constancy.split_by.clone(),
        ),
    });
    Said {
        causes: causes.collect(),
        is_unknown: report.unknown.flagged,
        unknown_ratio: report.unknown.score / report.unknown.threshold.max(1e-9),
        covariate: report.unknown.description.covariate.clone(),
        is_reproduced: report.noise_floor.iter().all(|floor| floor.reproduced),
        above_floor: report.gap.above_floor,
        gap_um: [report.gap.rms_um, report.gap.floor_um],
        held_out_um: [report.shrink.rms_um.before, report.shrink.rms_um.after],
        closed: report
            .shrink
            .gap_closed
            .map(|closed| [closed.value, closed.low, closed.high]),
        runtime_s: report.runtime_s,
        next: report.next_experiments.first().map(|next| {
            let separates = next.separates.clone();
            (next.run.clone(), separates, next.delta)
        }),
    }
}

/// What the hidden effects look like, by the signatures of a session.
#[must_use]
pub fn likeness(truth: &Truth, regression: &Regression) -> Vec<Likeness> {
    let matrix = &regression.isolability;
    let class = |name: &str| name.split(' ').next().unwrap_or(name).to_owned();
    let of = |effect: &TrueEffect| {
        let (id, axis) = (effect.class.id(), &effect.axis);
        let own = format!("{id} {axis}");
        let row = matrix.names.iter().position(|name| name == own.trim())?;
        let mut cos = BTreeMap::<String, f64>::new();
        for (name, value) in matrix.names.iter().zip(&matrix.cos[row]) {
            if class(name) != id {
                let most = cos.entry(class(name)).or_default();
                *most = most.max(*value);
            }
        }
        Some(Likeness {
            effect: id.to_owned(),
            axis: axis.clone(),
            sin_alone: matrix.sin_alone[row],
            cos,
        })
    };
    truth.effects.iter().filter_map(of).collect()
}

impl SaidCause {
    /// Whether it is named at all.
    #[must_use]
    pub fn is_named(&self) -> bool {
        self.status != Status::Surrogate
    }

    /// Whether it is this effect: class and axis.
    #[must_use]
    pub fn is(&self, effect: &TrueEffect) -> bool {
        self.effect == effect.class.id() && self.axis == effect.axis
    }

    /// Whether it is what the form of this effect brings along.
    #[must_use]
    pub fn is_beside(&self, effect: &TrueEffect) -> bool {
        let own = |(id, axis): &(String, String)| *id == self.effect && *axis == self.axis;
        effect.besides.iter().any(own)
    }

    /// Whether this effect is it or among its rivals.
    #[must_use]
    pub fn may_be(&self, effect: &TrueEffect) -> bool {
        let rival = |(id, axis): &(String, String)| id == effect.class.id() && *axis == effect.axis;
        self.is(effect) || self.rivals.iter().any(rival)
    }
}

impl Verdict {
    /// What the verdict would be on another method; none where it was not asked.
    #[must_use]
    pub fn by(&self, method: Method) -> Option<Self> {
        let names = match method {
            Method::AlwaysUnknown => Names::new(),
            Method::Oracle => {
                let hidden = self.truth.effects.iter();
                let known = hidden.filter(|e| self.truth.left_out.as_deref() != Some(e.class.id()));
                known
                    .map(|e| (e.class.id().to_owned(), e.axis.clone()))
                    .collect()
            }
            _ => self.baselines.get(&method)?.clone(),
        };
        let cause = |(effect, axis): (String, String)| SaidCause {
            effect,
            axis,
            status: Status::Named,
            confidence: 1.0,
            d: 0.0,
            parameters: vec![],
            rivals: vec![],
            constancy: (true, 0.0, String::new()),
        };
        let said = self.said.clone()?;
        let is_unknown = match method {
            Method::AlwaysUnknown => true,
            Method::Oracle => self.truth.left_out.is_some(),
            _ => false,
        };
        Some(Self {
            said: Some(Said {
                causes: names.into_iter().map(cause).collect(),
                is_unknown,
                ..said
            }),
            ..self.clone()
        })
    }

    /// Share of the gap that the named effects close, over that which the truth would close; none without held-out
    /// runs, or where the truth closes none.
    #[must_use]
    pub fn closed_of_oracle(&self) -> Option<f64> {
        let [before, after] = self.said.as_ref()?.held_out_um;
        let (before, after, bare) = (before?, after?, self.truth.bare_um?);
        let closes = 1.0 - (bare / before).powi(2);
        (closes > LEAST_CLOSED).then(|| (1.0 - (after / before).powi(2)) / closes)
    }

    /// What is left of the gap on held-out runs, as a share: root mean squares after and before with what the same runs
    /// leave of a machine that hides nothing taken out of both squares. At D = 20 the latter is half of what is seen
    /// before, and no simulator of any quality goes below it.
    #[must_use]
    pub fn left_of_gap(&self) -> Option<f64> {
        let [before, after] = self.said.as_ref()?.held_out_um;
        open_share([before?, after?, self.truth.bare_um?])
    }

    /// Whether a cause says that it cannot be told from a hidden effect which is not named itself: a set is right as far
    /// as the truth is in it.
    fn holds_truth(&self, cause: &SaidCause) -> bool {
        let is_left_out = |effect: &TrueEffect| {
            self.truth.left_out.as_deref() == Some(effect.class.id()) || self.has(effect)
        };
        let mut open = self.truth.effects.iter().filter(|e| !is_left_out(e));
        let brings =
            |effect: &TrueEffect| effect.besides.iter().any(|own| cause.rivals.contains(own));
        cause.status == Status::Set && open.any(|effect| cause.may_be(effect) || brings(effect))
    }

    /// Causes that were named.
    pub fn named(&self) -> impl Iterator<Item = &SaidCause> {
        let causes = self.said.iter().flat_map(|said| &said.causes);
        causes.filter(|cause| cause.is_named())
    }

    /// Whether a named cause is right.
    #[must_use]
    pub fn is_right(&self, cause: &SaidCause) -> bool {
        let is_left_out = self.truth.left_out.as_deref() == Some(cause.effect.as_str());
        let is_own = |effect: &TrueEffect| cause.is(effect) || cause.is_beside(effect);
        !is_left_out && self.truth.effects.iter().any(is_own)
    }

    /// Named causes that are not hidden in the machine, nor members of a set that holds one that is.
    pub fn wrong(&self) -> impl Iterator<Item = &SaidCause> {
        self.named()
            .filter(|cause| !self.is_right(cause) && !self.holds_truth(cause))
    }

    /// Whether the hidden effects are named and nothing else.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.wrong().next().is_none() && self.truth.effects.iter().all(|effect| self.has(effect))
    }

    /// Whether an effect is named, class and axis.
    #[must_use]
    pub fn has(&self, effect: &TrueEffect) -> bool {
        self.named().any(|cause| cause.is(effect))
    }

    /// Whether an effect is shown as a surrogate.
    #[must_use]
    pub fn shows(&self, effect: &TrueEffect) -> bool {
        let mut causes = self.said.iter().flat_map(|said| &said.causes);
        causes.any(|cause| !cause.is_named() && cause.is(effect))
    }

    /// Whether something unknown was flagged.
    #[must_use]
    pub fn is_flagged(&self) -> bool {
        self.said.as_ref().is_some_and(|said| said.is_unknown)
    }

    /// Least D of what is hidden; none where nothing is.
    #[must_use]
    pub fn least_d(&self) -> Option<f64> {
        self.truth
            .effects
            .iter()
            .map(|effect| effect.d)
            .reduce(f64::min)
    }

    /// Relative error of a parameter that was sized, and whether its interval holds the truth.
    #[must_use]
    pub fn sized(&self, effect: &TrueEffect) -> Option<(f64, bool)> {
        let name = effect.parameter.as_ref()?;
        let cause = self.named().find(|cause| cause.is(effect))?;
        // Where shares of it have forms of their own, the sum is the size.
        let named = |name: &str| cause.parameters.iter().find(|(own, ..)| own == name);
        let (_, value, low, high) = named(&format!("whole_{name}")).or_else(|| named(name))?;
        let error = (value - effect.size) / effect.size;
        Some((error, (*low..=*high).contains(&effect.size)))
    }
}

fn open_share([before, after, bare]: [f64; 3]) -> Option<f64> {
    let square = |um: f64| um * um - bare * bare;
    let gap = square(before);
    (gap > LEAST_CLOSED * before * before).then(|| (square(after).max(0.0) / gap).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_of_a_gap_is_taken_without_what_a_bare_machine_leaves() {
        // From 1 - 0.16 to 0.25 - 0.16 in squares.
        let left = open_share([1.0, 0.5, 0.4]).unwrap();
        assert!((left - (0.09_f64 / 0.84).sqrt()).abs() < 1e-12, "{left}");
        assert!(open_share([1.0, 0.39, 0.4]).unwrap() <= 0.0);
        assert!(open_share([1.0, 0.97, 0.96]).is_none(), "hardly any gap");
    }
}
