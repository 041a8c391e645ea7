//! Which of the effects of scatter that were found may be named.
//!
//! As effects of the mean: an effect must hold on runs left out, have one size under all conditions, stand off its bound,
//! be worth more than its price by the odds that exclude a rival, and be surely off zero by how it differs from run to
//! run. Besides it must explain more than a scatter of its own for each run does.

use std::collections::{BTreeMap, BTreeSet};

use machine::effects::Kind;
use nalgebra::{DMatrix, DVector};

use super::{Fit, Scattered, Squares, parameters, spread, weigh};
use crate::cause::{self, Scope};
use crate::confidence::Rivals;
use crate::confirm;
use crate::normal::Normal;
use crate::recalibration::recalibrated;
use crate::report::{Cause, Constancy, ParameterValue, Status};
use crate::rows::count;
use crate::rule::Rule;
use crate::selection::Set;
use crate::signature::{Form, Instance, Library};
use crate::veto;

/// A set that was found, with what it is judged by.
pub(super) struct Judge<'j, 's, 'a> {
    pub(super) scope: &'j Scope<'s, 'a>,
    pub(super) squares: &'j Squares,
    pub(super) signatures: &'j Library,
    pub(super) normal: &'j Normal,
    pub(super) visited: &'j BTreeMap<Set, f64>,
}

impl Judge<'_, '_, '_> {
    /// Judges each member of a set, and adds it to what was found.
    pub(super) fn judge(&self, set: &Set, found: &mut Scattered) {
        let stack = self.scope.stack;
        let of = |form: &usize| &self.signatures.forms[*form];
        let forms: Vec<&Form> = set.iter().map(of).collect();
        let fit = self.fit(&forms);
        found.spread = fit.level.map(f64::sqrt);
        let parts = self.parts(&forms, &fit);
        let confirmed = confirm::held_out_gains_of(stack, &self.squares.y, &parts);
        let config = self.scope.config;
        let is_confirmed = |place: usize| confirmed[place] || !config.applies(Rule::HeldOut);
        let beats_runs = self.visited[set] < self.of_runs();
        let rivals = Rivals::new(self.signatures, self.visited);
        let columns = forms.iter().flat_map(|form| &form.columns);
        let columns: Vec<DVector<f64>> = columns
            .map(|column| self.signatures.columns[*column].clone())
            .collect();
        let rest = self.squares.y.clone();
        let left = parts.iter().fold(rest, |left, part| left - part);
        let instances: BTreeSet<usize> = forms.iter().map(|form| form.instance).collect();
        let of_set = self.one_of_each(set);
        let mut first = 0;
        for (place, form) in forms.iter().enumerate() {
            let own = first..first + form.columns.len();
            first = own.end;
            let instance = &self.signatures.instances[form.instance];
            let (parameters, values) = sized(instance.kind, form, &fit, own.clone());
            let constancy = self.constancy(instance, &values, &columns, &left);
            let railed = parameters.iter().any(|p| p.at_bound && p.value > 0.0);
            let is_sure = own_sizes(&fit, &own).any(|(size, doubt)| size > veto::SURE * doubt);
            let is_needed = rivals.is_needed(&instances, form.instance);
            let holds = is_confirmed(place)
                && beats_runs
                && constancy.passed
                && !railed
                && is_sure
                && is_needed;
            let status = match (holds, rivals.is_alone(form.instance)) {
                (false, _) => Status::Surrogate,
                (true, true) => Status::Named,
                (true, false) => Status::Set,
            };
            if status == Status::Named {
                found.entries.push(cause::entry(instance, &values));
            }
            let instead = rivals.instead_of(&instances, form.instance);
            let probability = rivals.probability(form.instance) * if holds { 1.0 } else { 0.5 };
            let (signatures, normal) = (self.signatures, self.normal);
            found.causes.push(Cause {
                effect: instance.kind.id.to_owned(),
                axis: instance.target.to_string(),
                status,
                confidence: recalibrated(config, probability),
                parameters,
                d: self.distance(&forms, place, &fit),
                confusable_with: veto::confusable(
                    signatures, normal, &instead, set[place], &of_set,
                ),
                constancy,
            });
        }
    }

    /// (4) of `scatter` of one form among those of a set.
    fn distance(&self, forms: &[&Form], place: usize, fit: &Fit) -> f64 {
        let mut others = forms.to_vec();
        others.remove(place);
        let without = self.fit(&others).level;
        let squares = &self.squares.squares;
        let of = |level: &DVector<f64>| squares.component_div(level);
        let (with, less) = (of(&fit.level), of(&without));
        let surprise =
            less.sum() - with.sum() + without.map(f64::ln).sum() - fit.level.map(f64::ln).sum();
        let k = with.map(|square| (square - 1.0).powi(2)).mean();
        (surprise.max(0.0) / (0.5 * k).max(1.0)).sqrt()
    }

    /// What each form makes of the squares.
    fn parts(&self, forms: &[&Form], fit: &Fit) -> Vec<DVector<f64>> {
        let mut sizes = fit.sizes.iter();
        let part = |form: &&Form| {
            let own = form.columns.iter().zip(sizes.by_ref());
            own.fold(
                DVector::zeros(self.squares.y.len()),
                |sum, (column, size)| sum + &self.signatures.columns[*column] * *size,
            )
        };
        forms.iter().map(part).collect()
    }

    /// One form of each instance that could be seen.
    fn one_of_each(&self, set: &Set) -> Vec<usize> {
        crate::isolability::forms(self.signatures, self.normal, set)
    }

    fn constancy(
        &self,
        instance: &Instance,
        values: &[f64],
        columns: &[DVector<f64>],
        left: &DVector<f64>,
    ) -> Constancy {
        let raw = spread(self.scope, &*instance.effect(values));
        let column = |part: Vec<f64>| self.squares.column(part);
        confirm::constancy_of(
            self.scope.stack,
            &raw,
            &column,
            columns,
            left,
            self.scope.config,
        )
    }

    /// C of a scatter of its own for each run.
    fn of_runs(&self) -> f64 {
        let stack = self.scope.stack;
        let of_run = |run: &usize| {
            let mut own = vec![0.0; stack.rows.len];
            for block in stack.rows.blocks.iter().filter(|block| block.run == *run) {
                own[block.range()].fill(1.0);
            }
            self.squares.column(own)
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
        let normal = Normal::new(&DMatrix::from_columns(&columns), &self.squares.y);
        let gain = normal.solve(&(0..columns.len()).collect::<Vec<_>>()).gain;
        self.squares.y.norm_squared() - gain + count(columns.len()) * stack.freedom().ln()
    }

    /// (1) by iterated weights.
    fn fit(&self, forms: &[&Form]) -> Fit {
        let stack = self.scope.stack;
        let mut columns: Vec<DVector<f64>> = self
            .squares
            .levels
            .column_iter()
            .map(|c| c.into_owned())
            .collect();
        let first = columns.len();
        for form in forms {
            let instance = &self.signatures.instances[form.instance];
            for place in &form.amplitudes {
                let mut on = form.values.clone();
                on[*place] = parameters(instance.kind)
                    .nth(*place)
                    .map_or(0.0, |p| p.high);
                columns.push(DVector::from_vec(spread(
                    self.scope,
                    &*instance.effect(&on),
                )));
            }
        }
        let design = DMatrix::from_columns(&columns);
        let all: Vec<usize> = (0..columns.len()).collect();
        let squares = &self.squares.squares;
        let mut level = DVector::from_element(stack.rows.len, 1.0);
        let mut sizes = vec![0.0; columns.len()];
        for _ in 0..8 {
            let (weighted, right) = weigh(&design, squares, &level);
            sizes = Normal::new(&weighted, &right).solve(&all).sizes;
            for size in &mut sizes[first..] {
                *size = size.max(0.0);
            }
            level = (&design * DVector::from_vec(sizes.clone())).map(|v| v.max(0.1));
        }
        let (weighted, right) = weigh(&design, squares, &level);
        let left = &right - &weighted * DVector::from_vec(sizes.clone());
        let doubts = crate::refit::standard_uncertainties(stack, &weighted, &left);
        Fit {
            sizes: sizes.split_off(first),
            doubts: doubts[first..].to_vec(),
            level,
        }
    }
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
    (listed, values)
}
