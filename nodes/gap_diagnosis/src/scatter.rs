//! Effects that move no mean and only scatter readings: jitter, vibration of random phase, stick-slip.
//!
//! # Model
//!
//! What the effects of the mean leave, squared, against the variance that the twin gives the readings:
//!
//! ```text
//!   E s_i = g_c + sum_k b_k h_ik,   b = (amplitude / greatest)2                      (1)
//!   score = h'(s / f - 1) / sqrt(k h'h),   k the variance of s / f                   (2)
//!   D^2 = sum_i 2/k_i (s_i/f_i - s_i/g_i + ln f_i/g_i),   k_i that of s / g          (3)
//! ```
//!
//! | symbol | here |
//! |---|---|
//! | s_i | of a touch the square of the whitened row, of a path the mean square of the readings of a row (`squares`) |
//! | g_c | free for each channel, of a path for each run: how noisy an instrument is belongs to the floor |
//! | h_ik | variance by the twin, as s is made of readings |
//! | f | what g alone makes of s; h is over it as well. In (3) what all but one effect make of it, g what all do |
//!
//! The search, its price and its rules are those of the mean (`selection`, `confirm`, `confidence`); one more is
//! that the effect must beat a scatter of its own for every run. The size is from (1) by iterated weights
//! 1 / (k (E s)2), its interval the greater of model and clusters of runs. (3) is by how much the effect makes what was read
//! more likely, as D^2 of an effect of the mean is; the score (2) is short of it where the variance changes manifold.
//!
//! # Holds when
//! Effects that scatter a channel evenly within every run are part of its noise floor, so that they are listed as not shown.
//!
//! # References
//! \[1\] L. G. Godfrey, J. Econometrics 8, 1978 (score test of a variance that goes with covariates). \[2\] P. McCullagh,
//! J. A. Nelder, Generalized linear models, 2nd ed., Chapman & Hall 1989, chapters 9 and 10 (quasi-likelihood, a variance's model).

use std::collections::BTreeMap;
use std::ops::Range;

use machine::file::EffectEntry;
use nalgebra::DVector;
use twin::effects::{Kind, Moment, Parameter, Role};

use crate::judgement::cause::Scope;
use crate::judgement::rule::Rule;
use crate::judgement::{self, Check, CheckId};
use crate::noise::normal::Normal;
use crate::report::{Cause, Status};
use crate::search::selection::{Limits, Search, Set, without};
use crate::search::signature::{Form, Instance, Library};

mod judge;
mod levels;
mod squares;

use judge::Judge;
use squares::{Part, Sized, Squares};

/// Effects of scatter that were found.
pub struct Scattered {
    /// As the report has them.
    pub causes: Vec<Cause>,
    /// Each of them as a machine file lists it.
    entries: Vec<EffectEntry>,
    /// Standard deviation of each row with them, in units of the floor.
    pub spread: DVector<f64>,
    /// Kinds of which an instance could have been seen.
    pub seen: Vec<&'static str>,
}

impl Scattered {
    /// Whether anything was found that all rules let be named, alone or as one of a set.
    pub fn is_named(&self) -> bool {
        self.causes
            .iter()
            .any(|cause| cause.status != Status::Surrogate)
    }

    /// What is named, as a machine file lists it.
    pub fn entries(&self) -> Vec<EffectEntry> {
        let all = self.causes.iter().zip(&self.entries);
        let named = all.filter(|(cause, _)| cause.status == Status::Named);
        named.map(|(_, entry)| entry.clone()).collect()
    }

    /// Checks that each effect is found by a search within the stations alone as well.
    pub fn check_within(&mut self, other: &Self) {
        for cause in &mut self.causes {
            let mut all = other.causes.iter();
            let is_found = all.any(|other| {
                let is_same = other.effect == cause.effect && other.axis == cause.axis;
                is_same && other.status != Status::Surrogate
            });
            add(cause, Check::new(CheckId::WithinStations, is_found));
        }
    }

    /// Adds a check that is the same for every effect.
    pub fn add_check(&mut self, check: &Check) {
        for cause in &mut self.causes {
            add(cause, check.clone());
        }
    }
}

fn add(cause: &mut Cause, check: Check) {
    cause.why.push(check);
    cause.status = judgement::status(&cause.why);
}

/// An effect that would stay below this D at its greatest size is not shown.
const MIN_D_TO_SHOW: f64 = 6.0;

/// Steps of a shape beside the one found, to one less than this many to both sides.
const SHAPE_STEP: f64 = 1.189_207_115_002_721;
const SHAPE_STEPS: i32 = 4;
/// How often shapes are sought anew, one after the other.
const SHAPE_ROUNDS: usize = 3;

/// Searches for effects of scatter in what the effects of the mean leave.
pub fn find(scope: &Scope<'_, '_>, kinds: &[&'static Kind], left: &DVector<f64>) -> Scattered {
    find_in(scope, kinds, left, Part::Whole)
}

/// The same in the scatter of readings within their rows alone.
pub fn find_within(
    scope: &Scope<'_, '_>,
    kinds: &[&'static Kind],
    left: &DVector<f64>,
) -> Scattered {
    find_in(scope, kinds, left, Part::Within)
}

fn find_in(
    scope: &Scope<'_, '_>,
    kinds: &[&'static Kind],
    left: &DVector<f64>,
    part: Part,
) -> Scattered {
    let stack = scope.stack;
    let squares = Squares::of_readings(scope, left, part);
    let variances = kinds.iter().filter(|kind| kind.moment == Moment::Variance);
    let instances = Instance::all(stack.twin.machine(), variances);
    let mut bench = Bench::new(scope, squares, instances);
    let (mut set, mut visited) = bench.search();
    if !set.is_empty() {
        let refined = bench.refine(&set);
        bench.weigh(&refined);
        (set, visited) = bench.search();
    }
    let forms = bench.signatures.forms.iter();
    let mut found = Scattered {
        causes: vec![],
        entries: vec![],
        spread: DVector::from_element(stack.rows.len, 1.0),
        seen: forms
            .map(|form| bench.signatures.instances[form.instance].kind.id)
            .collect(),
    };
    if !set.is_empty() {
        let judge = Judge {
            bench: &bench,
            left,
            visited: &visited,
        };
        judge.judge(&set, &mut found);
    }
    found
}

/// Squares with the signatures of effects in them.
struct Bench<'b, 's, 'a> {
    scope: &'b Scope<'s, 'a>,
    squares: Squares,
    signatures: Library,
    /// Variance by each column of the signatures, of each square.
    variances: Vec<DVector<f64>>,
    normal: Normal,
}

impl<'b, 's, 'a> Bench<'b, 's, 'a> {
    fn new(scope: &'b Scope<'s, 'a>, squares: Squares, instances: Vec<Instance>) -> Self {
        let signatures = Library {
            curves: Default::default(),
            aside: Default::default(),
            shared: Default::default(),
            excited: vec![false; instances.len()],
            instances,
            forms: vec![],
            columns: vec![],
        };
        let normal = signatures.normal(&squares.y);
        let mut bench = Self {
            scope,
            squares,
            signatures,
            variances: vec![],
            normal,
        };
        for instance in 0..bench.signatures.instances.len() {
            for values in
                crate::search::signature::shapes(bench.signatures.instances[instance].kind)
            {
                bench.add_forms(instance, &values);
            }
        }
        bench.normal = bench.signatures.normal(&bench.squares.y);
        bench
    }

    /// The best set, and C of all that were looked at.
    fn search(&self) -> (Set, BTreeMap<Set, f64>) {
        let config = self.scope.config;
        let square = self.squares.y.norm_squared();
        let freedom = self.scope.stack.freedom();
        let mut search = Search::new(&self.signatures, &self.normal, square, freedom);
        let set = search.run(Limits {
            beam: config.beam,
            most_effects: 3,
            swaps: config.applies(Rule::SwapSearch),
        });
        search.alternatives(&set, 6);
        (set, search.visited)
    }

    /// Lets each square weigh by what a set makes of it: where an effect is strong the score alone would fit it only where
    /// it is strongest.
    fn weigh(&mut self, set: &[usize]) {
        let level = self.fit(set.iter().copied()).level;
        self.squares.weigh_by(self.scope, &level);
        let over = |variance: &DVector<f64>| self.squares.column(variance);
        self.signatures.columns = self.variances.iter().map(over).collect();
        self.normal = self.signatures.normal(&self.squares.y);
    }

    /// The set with the shapes, between those that were tried, that make what was read likeliest.
    fn refine(&mut self, set: &[usize]) -> Set {
        let mut set = set.to_vec();
        for _ in 0..SHAPE_ROUNDS {
            let before = set.clone();
            for member in 0..set.len() {
                let form = &self.signatures.forms[set[member]];
                let (instance, values) = (form.instance, form.values.clone());
                let kind = self.signatures.instances[instance].kind;
                for (place, parameter) in parameters(kind).enumerate() {
                    if is_tried(parameter) {
                        for finer in beside(parameter, values[place]) {
                            let mut beside = values.clone();
                            beside[place] = finer;
                            self.add_forms(instance, &beside);
                        }
                    }
                }
                let others = without(&set, set[member]);
                let own = (0..self.signatures.forms.len())
                    .filter(|form| self.signatures.forms[*form].instance == instance);
                let surprise = |form: usize| {
                    let level = self.fit(others.iter().copied().chain([form])).level;
                    self.squares.surprise(&level)
                };
                let scored = own.map(|form| (surprise(form), form));
                if let Some((_, best)) = scored.min_by(|a, b| a.0.total_cmp(&b.0)) {
                    set[member] = best;
                }
            }
            if set == before {
                break;
            }
        }
        set.sort_unstable();
        set
    }

    /// Sizes of some forms.
    fn fit(&self, forms: impl Iterator<Item = usize>) -> Sized {
        let columns: Vec<&DVector<f64>> = forms
            .flat_map(|form| &self.signatures.forms[form].columns)
            .map(|column| &self.variances[*column])
            .collect();
        self.squares.fit(&columns)
    }

    /// Adds an effect of some shape in the catalogue's form, in the wide one, and in what widens it alone: variances add
    /// up, so that no part can make up for too much of the other.
    fn add_forms(&mut self, instance: usize, values: &[f64]) {
        let mut known = self.signatures.forms.iter();
        let is_same = |a: &f64, b: &f64| (a - b).abs() <= 1e-9 * b.abs();
        let is_known = |form: &Form| {
            form.instance == instance && form.values.iter().zip(values).all(|(a, b)| is_same(a, b))
        };
        if known.any(is_known) {
            return;
        }
        let kind = self.signatures.instances[instance].kind;
        let (own, all) = (
            kind.parameters.len(),
            kind.parameters.len() + kind.free.len(),
        );
        self.add(instance, values, 0..own);
        if all > own {
            self.add(instance, values, 0..all);
            self.add(instance, values, own..all);
        }
    }

    fn add(&mut self, instance: usize, values: &[f64], shown: Range<usize>) {
        let signatures = &mut self.signatures;
        let kind = signatures.instances[instance].kind;
        let wide = shown.end > kind.parameters.len();
        let (mut amplitudes, mut columns) = (vec![], vec![]);
        for (place, parameter) in parameters(kind).enumerate() {
            if parameter.role != Role::Amplitude || !shown.contains(&place) {
                continue;
            }
            let mut on = values.to_vec();
            on[place] = parameter.high;
            let effect = signatures.instances[instance].effect(&on);
            let variance = self.squares.spread(self.scope, &*effect);
            let column = self.squares.column(&variance);
            if column.norm().is_finite() && column.norm() > MIN_D_TO_SHOW {
                amplitudes.push(place);
                columns.push(column);
                self.variances.push(variance);
            }
        }
        if columns.is_empty() {
            return;
        }
        signatures.excited[instance] = true;
        let free = kind.free.iter().zip(&values[kind.parameters.len()..]);
        let is_widened = |(p, value): &(&Parameter, &f64)| is_tried(p) && **value != 0.0;
        let tried = kind.shapes().filter(|shape| is_tried(shape)).count();
        let choices = tried + free.filter(is_widened).count();
        let first = signatures.columns.len();
        signatures.forms.push(Form {
            instance,
            values: values.to_vec(),
            price: amplitudes.len() + choices,
            columns: (first..first + columns.len()).collect(),
            amplitudes,
            wide,
        });
        signatures.columns.extend(columns);
    }
}

fn parameters(kind: &'static Kind) -> impl Iterator<Item = &'static Parameter> {
    kind.parameters.iter().chain(kind.free)
}

/// Values of a shape beside one: a little less and more of it; of what widens a form all that may be.
fn beside(parameter: &Parameter, value: f64) -> Vec<f64> {
    if parameter.low > 0.0 {
        let powers = (1 - SHAPE_STEPS..SHAPE_STEPS).filter(|power| *power != 0);
        let finer = powers.map(|power| value * SHAPE_STEP.powi(power));
        return finer
            .map(|finer| finer.clamp(parameter.low, parameter.high))
            .collect();
    }
    parameter.role.grid().unwrap_or_default().to_vec()
}

/// Whether a parameter is a shape of which several values are tried.
fn is_tried(parameter: &Parameter) -> bool {
    parameter.role.grid().is_some_and(|grid| grid.len() > 1)
}
