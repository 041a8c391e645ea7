//! Which of the effects of scatter that were found may be named.
//!
//! As effects of the mean: an effect must hold on runs left out, have one size under all conditions, stand off its bound,
//! be worth more than its price by the odds that exclude a rival, and be surely off zero by how it differs from run to
//! run. Besides it must explain more than a scatter of its own for each run does.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, DVector};
use twin::effects::{Effect, Kind, Parameter};

use super::squares::Squares;
use super::{Bench, SHAPE_STEP, Scattered, is_tried, parameters};
use crate::judgement::cause;
use crate::judgement::confidence::Rivals;
use crate::judgement::confirm;
use crate::judgement::recalibration::recalibrated;
use crate::judgement::rule::Rule;
use crate::judgement::veto;
use crate::judgement::{self, Check, CheckId};
use crate::noise::normal::Normal;
use crate::report::{Cause, Constancy, ParameterValue};
use crate::search::rows::count;
use crate::search::selection::Set;
use crate::search::signature::{Form, Instance};

/// A set that was found, with what it is judged by.
pub(super) struct Judge<'j, 's, 'a> {
    pub(super) bench: &'j Bench<'j, 's, 'a>,
    /// What the effects of the mean leave.
    pub(super) left: &'j DVector<f64>,
    pub(super) visited: &'j BTreeMap<Set, f64>,
}

impl Judge<'_, '_, '_> {
    /// Judges each member of a set, and adds it to what was found.
    pub(super) fn judge(&self, set: &Set, found: &mut Scattered) {
        let stack = self.bench.scope.stack;
        let of = |form: &usize| &self.bench.signatures.forms[*form];
        let forms: Vec<&Form> = set.iter().map(of).collect();
        let fit = self.fit(&forms);
        found.spread = self.of_rows(&forms, &fit);
        let parts = self.parts(&forms, &fit);
        let confirmed = confirm::held_out_gains_of(stack, &self.bench.squares.y, &parts);
        let config = self.bench.scope.config;
        let (own, of_runs) = (self.visited[set], self.of_runs());
        let beats_runs = Check::new(CheckId::BeatsRuns, own < of_runs).with(own, of_runs);
        let rivals = Rivals::new(&self.bench.signatures, self.visited);
        let columns = forms.iter().flat_map(|form| &form.columns);
        let columns: Vec<DVector<f64>> = columns
            .map(|column| self.bench.signatures.columns[*column].clone())
            .collect();
        let rest = self.bench.squares.y.clone();
        let left = parts.iter().fold(rest, |left, part| left - part);
        let instances: BTreeSet<usize> = forms.iter().map(|form| form.instance).collect();
        let of_set = self.one_of_each(set);
        let mut first = 0;
        for (place, (form, held_out)) in forms.iter().zip(confirmed).enumerate() {
            let own = first..first + form.columns.len();
            first = own.end;
            let instance = &self.bench.signatures.instances[form.instance];
            let (parameters, values) = sized(instance.kind, form, &fit, own.clone());
            let (constancy, one_size) = self.constancy(instance, &values, &columns, &left);
            let mut why = config.tried(Rule::HeldOut, held_out);
            why.extend([beats_runs.clone(), one_size, off_bounds(&parameters)]);
            why.push(sure(&fit, &own));
            why.extend(rivals.checks(&instances, form.instance, false));
            let holds = judgement::holds(&why);
            found.entries.push(cause::entry(instance, &values));
            let instead = rivals.instead_of(&instances, form.instance);
            let probability = rivals.probability(form.instance) * if holds { 1.0 } else { 0.5 };
            let (signatures, normal) = (&self.bench.signatures, &self.bench.normal);
            found.causes.push(Cause {
                effect: instance.kind.id.to_owned(),
                axis: instance.target.to_string(),
                status: judgement::status(&why),
                confidence: recalibrated(config, probability),
                parameters,
                d: self.distance(&forms, place, &fit),
                confusable_with: veto::confusable(
                    signatures, normal, &instead, set[place], &of_set,
                ),
                constancy,
                why,
            });
        }
    }

    /// (3) of `scatter` of one form among those of a set.
    fn distance(&self, forms: &[&Form], place: usize, fit: &Fit) -> f64 {
        let mut others = forms.to_vec();
        others.remove(place);
        let without = self.fit(&others).level;
        self.bench
            .squares
            .distance(self.bench.scope, &without, &fit.level)
    }

    /// Standard deviation of the rows that the search for effects of the mean is made on, in units of the floor: each
    /// effect's share of it is open, for readings of a row may go together.
    fn of_rows(&self, forms: &[&Form], fit: &Fit) -> DVector<f64> {
        let rows = Squares::of_rows(self.bench.scope, self.left);
        let mut sizes = fit.sizes.iter();
        let of_form = |form: &&Form| {
            let of_size = |(place, size): (&usize, &f64)| {
                rows.spread(self.bench.scope, &*self.greatest(form, *place)) * *size
            };
            let own = form.amplitudes.iter().zip(sizes.by_ref());
            own.map(of_size).sum::<DVector<f64>>()
        };
        let columns: Vec<DVector<f64>> = forms.iter().map(of_form).collect();
        rows.fit(&columns.iter().collect::<Vec<_>>())
            .level
            .map(f64::sqrt)
    }

    /// The effect of a form at the greatest size of one of its amplitudes.
    fn greatest(&self, form: &Form, place: usize) -> Box<dyn Effect> {
        let instance = &self.bench.signatures.instances[form.instance];
        let mut on = form.values.clone();
        on[place] = parameters(instance.kind).nth(place).map_or(0.0, |p| p.high);
        instance.effect(&on)
    }

    /// What each form makes of the squares.
    fn parts(&self, forms: &[&Form], fit: &Fit) -> Vec<DVector<f64>> {
        let mut sizes = fit.sizes.iter();
        let part = |form: &&Form| {
            let own = form.columns.iter().zip(sizes.by_ref());
            own.fold(
                DVector::zeros(self.bench.squares.y.len()),
                |sum, (column, size)| sum + &self.bench.signatures.columns[*column] * *size,
            )
        };
        forms.iter().map(part).collect()
    }

    /// One form of each instance that could be seen.
    fn one_of_each(&self, set: &Set) -> Vec<usize> {
        crate::search::isolability::forms(&self.bench.signatures, &self.bench.normal, set)
    }

    fn constancy(
        &self,
        instance: &Instance,
        values: &[f64],
        columns: &[DVector<f64>],
        left: &DVector<f64>,
    ) -> (Constancy, Check) {
        let raw = self
            .bench
            .squares
            .spread(self.bench.scope, &*instance.effect(values));
        let column = |part: Vec<f64>| self.bench.squares.column(&DVector::from_vec(part));
        confirm::constancy_of(
            self.bench.scope.stack,
            raw.as_slice(),
            &column,
            columns,
            left,
            confirm::Limits::of(self.bench.scope.config, instance.kind),
        )
    }

    /// C of a scatter of its own for each run.
    fn of_runs(&self) -> f64 {
        let stack = self.bench.scope.stack;
        let of_run = |run: &usize| {
            let mut own = vec![0.0; stack.rows.len];
            for block in stack.rows.blocks.iter().filter(|block| block.run == *run) {
                own[block.range()].fill(1.0);
            }
            self.bench.squares.column(&DVector::from_vec(own))
        };
        let columns: Vec<DVector<f64>> = stack
            .runs
            .iter()
            .map(of_run)
            .filter(|column| column.norm() > 1e-6)
            .collect();
        if columns.is_empty() {
            return f64::INFINITY;
        }
        let normal = Normal::new(&DMatrix::from_columns(&columns), &self.bench.squares.y);
        let gain = normal.solve(&(0..columns.len()).collect::<Vec<_>>()).gain;
        self.bench.squares.y.norm_squared() - gain + count(columns.len()) * stack.freedom().ln()
    }

    /// Sizes of the amplitudes of some forms.
    fn fit(&self, forms: &[&Form]) -> Fit {
        let columns: Vec<&DVector<f64>> = forms
            .iter()
            .flat_map(|form| form.columns.iter())
            .map(|column| &self.bench.variances[*column])
            .collect();
        let sized = self.bench.squares.fit(&columns);
        let doubts = self
            .bench
            .squares
            .doubts(self.bench.scope, &columns, &sized);
        Fit {
            sizes: sized.sizes,
            doubts,
            level: sized.level,
        }
    }
}

/// Sizes b of (1) of `scatter` with their standard uncertainties, and E s.
struct Fit {
    sizes: Vec<f64>,
    doubts: Vec<f64>,
    level: DVector<f64>,
}

/// Whether no size of an effect is at its bound.
fn off_bounds(parameters: &[ParameterValue]) -> Check {
    let railed = parameters.iter().filter(|p| p.at_bound && p.value > 0.0);
    let railed = railed.count();
    Check::new(CheckId::OffBounds, railed == 0).with(count(railed), 0.0)
}

/// Whether a size of an effect is surely off zero.
fn sure(fit: &Fit, own: &std::ops::Range<usize>) -> Check {
    let is_sure = own_sizes(fit, own).any(|(size, doubt)| size > veto::MIN_SIZE_DEVIATIONS * doubt);
    let ratios = own_sizes(fit, own).map(|(size, doubt)| size / doubt);
    let most = ratios.fold(f64::NEG_INFINITY, f64::max);
    Check::new(CheckId::Sure, is_sure).with(most, veto::MIN_SIZE_DEVIATIONS)
}

/// Sizes of some columns with their standard uncertainties.
fn own_sizes(fit: &Fit, own: &std::ops::Range<usize>) -> impl Iterator<Item = (f64, f64)> {
    let sizes = fit.sizes[own.clone()].iter().copied();
    sizes.zip(fit.doubts[own.clone()].iter().copied())
}

/// Amplitudes with their intervals, and all values of the effect.
fn sized(
    kind: &'static Kind,
    form: &Form,
    fit: &Fit,
    own: std::ops::Range<usize>,
) -> (Vec<ParameterValue>, Vec<f64>) {
    let mut values = form.values.clone();
    let mut listed = Vec::new();
    for (place, k) in form.amplitudes.iter().zip(own) {
        let Some(parameter) = parameters(kind).nth(*place) else {
            continue;
        };
        let amplitude = |size: f64| parameter.high * size.max(0.0).sqrt();
        let by = 1.96 * fit.doubts[k];
        let value = amplitude(fit.sizes[k]).min(parameter.high);
        values[*place] = value;
        let (low, high) = (amplitude(fit.sizes[k] - by), amplitude(fit.sizes[k] + by));
        listed.push(ParameterValue {
            name: parameter.name.to_owned(),
            value,
            low,
            high,
            determined: Some(high - low < parameter.high - parameter.low),
            at_bound: fit.sizes[k] >= 1.0 || fit.sizes[k] <= 0.0,
        });
    }
    listed.extend(parameters(kind).zip(&values).filter_map(tried));
    (listed, values)
}

/// The value of a shape out of those that are tried, between the ones beside it.
fn tried((parameter, value): (&Parameter, &f64)) -> Option<ParameterValue> {
    let is_told = is_tried(parameter) && *value > 0.0;
    is_told.then(|| ParameterValue {
        name: parameter.name.to_owned(),
        value: *value,
        low: (value / SHAPE_STEP).max(parameter.low),
        high: (value * SHAPE_STEP).min(parameter.high),
        at_bound: false,
        determined: Some(true),
    })
}
