//! The identification as it is published: curves, covariance, flags and combinations.
//!
//! Knots of a table that are held at zero are in the message with value and uncertainty zero, so that whoever
//! reads it needs to know nothing of the gauge.

use metrology::sample::{CurveForm, ErrorCurve, EstimableCombination, GeometryModel};
use metrology::{Host, Stamp};
use nalgebra::DMatrix;

use crate::basis::{Basis, ModelComponent};
use crate::identify::Identification;
use crate::spectrum::Visibility;

/// The model of an identification.
#[must_use]
pub fn geometry_model(
    identification: &Identification,
    chain: &str,
    at: Stamp<Host>,
    sequence: u32,
) -> GeometryModel {
    let mut curves = Vec::new();
    // Column of each published coefficient; `None` for a knot at zero.
    let mut columns: Vec<Option<usize>> = Vec::new();
    let mut next = 0;
    for model in &identification.components {
        let own = published_columns(&model.basis, next);
        next += model.basis.len();
        curves.push(curve(identification, model, &own));
        columns.extend(own);
    }
    let entry = |i: usize, j: usize| match (columns[i], columns[j]) {
        (Some(a), Some(b)) => identification.covariance[(a, b)],
        _ => 0.0,
    };
    let published = |column: usize| columns.iter().position(|c| *c == Some(column));
    let combinations = identification.combinations.iter().map(|combination| {
        let weights = combination.weights.iter().filter_map(|(column, weight)| {
            let idx = u32::try_from(published(*column)?).ok()?;
            Some((idx, *weight))
        });
        EstimableCombination {
            weights: weights.collect(),
            value_mm: combination.value_mm,
            standard_uncertainty_mm: combination.standard_uncertainty_mm,
        }
    });
    let count = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    GeometryModel {
        at,
        chain: chain.to_owned(),
        covariance: DMatrix::from_fn(columns.len(), columns.len(), entry),
        combinations: combinations.collect(),
        curves,
        n_samples: count(identification.n_readings),
        n_unknowns: count(identification.unknowns.len()),
        rank: count(identification.rank),
        residual_standard_deviation_mm: identification.residual_standard_deviation_mm,
        sequence,
    }
}

fn published_columns(basis: &Basis, first: usize) -> Vec<Option<usize>> {
    match basis {
        Basis::Table { knots, free } => (0..knots.len())
            .map(|knot| free.iter().position(|idx| *idx == knot).map(|k| first + k))
            .collect(),
        _ => (first..first + basis.len()).map(Some).collect(),
    }
}

fn curve(
    identification: &Identification,
    model: &ModelComponent,
    columns: &[Option<usize>],
) -> ErrorCurve {
    let (form, origin, power, position) = match &model.basis {
        Basis::Constant => (CurveForm::Constant, 0.0, Vec::new(), Vec::new()),
        Basis::Polynomial { origin, powers } => {
            (CurveForm::Polynomial, *origin, powers.clone(), Vec::new())
        }
        Basis::Table { knots, .. } => (CurveForm::Table, 0.0, Vec::new(), knots.clone()),
    };
    let of = |column: &Option<usize>| match column {
        Some(idx) => (
            identification.values[*idx],
            identification.estimate(*idx).map_or(f64::NAN, |(_, u)| u),
            identification.visibility[*idx] == Visibility::Estimable,
        ),
        None => (0.0, 0.0, true),
    };
    let coefficients: Vec<(f64, f64, bool)> = columns.iter().map(of).collect();
    ErrorCurve {
        component: model.component,
        form,
        origin,
        power,
        position,
        coefficient: coefficients.iter().map(|c| c.0).collect(),
        standard_uncertainty: coefficients.iter().map(|c| c.1).collect(),
        estimable: coefficients.iter().map(|c| c.2).collect(),
        span: identification.spans[model.component.of],
    }
}
