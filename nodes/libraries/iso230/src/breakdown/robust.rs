//! The linear fit of one set of columns, hardened against spikes of the reader.
//!
//! # Model
//!
//! ```text
//!   minimise Σ ψ(r_i/s) with weights w_i = min(1, k s/|r_i|)        Huber, iterated          (1)
//!   s by the median of |r|; left out: single samples (one or two in a row) beyond the outlier
//!   limit whose neighbours are within half of it, away from reversals                       (2)
//!   variance = Σ w r²/(n − p)                                                                (3)
//!   cov(β) = g variance (Xᵀ W X)⁻¹ + Σ u_l² z_l z_lᵀ,   z_l = (Xᵀ W X)⁻¹ Xᵀ W x_l            (4)
//! ```
//!
//! In (4) g is the inflation for residuals that drag on, x_l is 1 on the traces measured against the
//! calibrated length l and u_l its standard uncertainty: an error of it is common to all their samples.

use std::rc::Rc;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::columns::{Column, Columns};
use super::config::BreakdownConfig;
use super::distinguish::{Reduction, reduce};
use super::error::BreakdownError;
use super::noise;
use super::scene::{Point, Scene};
use super::term::Term;
use metrology::least_squares::FitError;

/// Iterations of (1).
const WEIGHT_ITERATIONS: usize = 30;
/// Passes of (2).
const PASSES: usize = 3;
/// Weights that change less end (1).
const SETTLED_WEIGHT: f64 = 1e-3;
/// Below this a residual is rounding, mm.
const ROUNDING_MM: f64 = 1e-12;
/// Half width of the zone about a reversal where a peak may be friction, rad (3°).
const REVERSAL_ZONE_RAD: f64 = 0.052;

/// A fit of the kept columns of some terms.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub terms: Vec<Term>,
    pub reduction: Reduction,
    /// The kept columns.
    pub columns: Vec<Rc<Column>>,
    /// Their products, every row with weight 1.
    pub gram: DMatrix<f64>,
    /// One for each kept column.
    pub parameters: DVector<f64>,
    /// (4)
    pub covariance: DMatrix<f64>,
    /// (XᵀWX)⁻¹.
    pub inverse: DMatrix<f64>,
    /// Of every sample, also of those left out, mm.
    pub residuals_mm: Vec<f64>,
    /// 0 where a sample is left out.
    pub weights: Vec<f64>,
    /// (3), mm².
    pub variance_mm2: f64,
    pub degrees_of_freedom: usize,
    /// g of (4).
    pub inflation: f64,
}

/// Fits what can be told apart of `terms`.
pub(super) fn fit(
    columns: &Columns,
    terms: Vec<Term>,
    config: &BreakdownConfig,
) -> Result<Fit, BreakdownError> {
    let scene = columns.scene;
    let (all, gram) = columns.gram(&terms);
    let reduction = reduce(&gram, config.least_sine);
    let kept = &reduction.kept;
    let n_parameters = kept.len();
    if scene.n_rows <= n_parameters {
        return Err(BreakdownError::TooFewForModel {
            n: scene.n_rows,
            n_parameters,
        });
    }
    let system = System::new(
        kept.iter().map(|column| Rc::clone(&all[*column])).collect(),
        gram.select_columns(kept).select_rows(kept),
        &columns.observed_mm,
    );
    let mut weights = vec![1.0; scene.n_rows];
    let mut residuals_mm = system.settle(&mut weights, config)?;
    for _ in 0..PASSES {
        let outliers = single_spikes(scene, &residuals_mm, &weights, config);
        if outliers.is_empty() {
            break;
        }
        for row in outliers {
            weights[row] = 0.0;
        }
        residuals_mm = system.settle(&mut weights, config)?;
    }
    let n = weights.iter().filter(|w| **w > 0.0).count();
    if n <= n_parameters {
        return Err(BreakdownError::TooFewForModel { n, n_parameters });
    }
    let Solution {
        parameters,
        covariance,
        residuals_mm,
    } = system.solved(&weights)?;
    let weighted = residuals_mm.iter().zip(&weights);
    let sum: f64 = weighted.map(|(r, w)| w * r * r).sum();
    let degrees_of_freedom = n - n_parameters;
    let mut fit = Fit {
        terms,
        columns: system.columns,
        gram: system.gram,
        reduction,
        parameters,
        inverse: covariance.clone(),
        covariance,
        residuals_mm,
        weights,
        variance_mm2: (sum / degrees_of_freedom as f64).max(ROUNDING_MM * ROUNDING_MM),
        degrees_of_freedom,
        inflation: 1.0,
    };
    fit.inflation = noise::inflation(&fit.residuals_by_trace(scene));
    fit.complete_covariance(scene);
    Ok(fit)
}

impl Fit {
    /// Residuals of the samples that are used, mm.
    pub fn residuals_by_trace(&self, scene: &Scene) -> Vec<Vec<f64>> {
        let used = |row: &usize| self.weights[*row] > 0.0;
        let of = |rows: std::ops::Range<usize>| rows.filter(used).map(|row| self.residuals_mm[row]);
        scene
            .traces
            .iter()
            .map(|trace| of(trace.rows()).collect())
            .collect()
    }

    /// Contribution of some kept columns, mm.
    pub fn contribution(&self, columns: &[usize]) -> DVector<f64> {
        let mut sum = DVector::zeros(self.residuals_mm.len());
        for &column in columns {
            self.columns[column].add_to(self.parameters[column], sum.as_mut_slice());
        }
        sum
    }

    /// From (XᵀWX)⁻¹ to (4).
    fn complete_covariance(&mut self, scene: &Scene) {
        let inverse = self.covariance.clone();
        self.covariance *= self.variance_mm2 * self.inflation;
        for (certificate, uncertainty_mm) in scene.certificates_mm.iter().enumerate() {
            let mut against = vec![0.0; self.weights.len()];
            for trace in scene
                .traces
                .iter()
                .filter(|t| t.certificate == Some(certificate))
            {
                for row in trace.rows() {
                    let root = trace.root(row - trace.first_row);
                    against[row] = self.weights[row] * root;
                }
            }
            let moment = self.columns.iter().map(|column| column.dot_rows(&against));
            let moment = DVector::from_iterator(self.columns.len(), moment);
            let response = &inverse * moment;
            self.covariance += &response * response.transpose() * uncertainty_mm.powi(2);
        }
    }
}

/// Products of columns with one another, weighted, and the rows that weigh less than 1 with how much less.
pub(super) fn with_less_weight(
    columns: &[Rc<Column>],
    gram: &DMatrix<f64>,
    weights: &[f64],
) -> (DMatrix<f64>, Vec<(usize, f64)>) {
    let less = weights.iter().enumerate().filter(|(_, w)| **w < 1.0);
    let less: Vec<(usize, f64)> = less.map(|(row, w)| (row, 1.0 - w)).collect();
    let n = columns.len();
    let mut entries = vec![0.0; n];
    // What the rows lose, row by row of the lower triangle.
    let mut lost = vec![0.0; n * n];
    for (row, by) in &less {
        for (entry, column) in entries.iter_mut().zip(columns) {
            *entry = column.at(*row);
        }
        for ((i, a), line) in entries.iter().enumerate().zip(lost.chunks_exact_mut(n)) {
            let factor = by * a;
            for (sum, b) in line[..=i].iter_mut().zip(&entries) {
                *sum += factor * b;
            }
        }
    }
    let lost = DMatrix::from_row_slice(n, n, &lost);
    let mut weighted = gram - lost;
    weighted.fill_upper_triangle_with_lower_triangle();
    (weighted, less)
}

/// What a weighted fit gives.
struct Solution {
    parameters: DVector<f64>,
    /// (XᵀWX)⁻¹.
    covariance: DMatrix<f64>,
    residuals_mm: Vec<f64>,
}

/// Kept columns and what was measured.
struct System<'a> {
    columns: Vec<Rc<Column>>,
    gram: DMatrix<f64>,
    moment: DVector<f64>,
    observed: &'a [f64],
}

impl<'a> System<'a> {
    fn new(columns: Vec<Rc<Column>>, gram: DMatrix<f64>, observed: &'a [f64]) -> Self {
        let moment = columns.iter().map(|column| column.dot_rows(observed));
        let moment = DVector::from_iterator(columns.len(), moment);
        Self {
            columns,
            gram,
            moment,
            observed,
        }
    }

    /// Solution of the weighted normal equations, and what solves them for other right-hand sides.
    fn solve(&self, weights: &[f64]) -> Result<(DVector<f64>, Normal), FitError> {
        let (gram, less) = with_less_weight(&self.columns, &self.gram, weights);
        let mut moment = self.moment.clone();
        for (row, by) in less {
            for (sum, column) in moment.iter_mut().zip(&self.columns) {
                *sum -= by * self.observed[row] * column.at(row);
            }
        }
        let normal = Normal::new(&gram)?;
        Ok((normal.solve(&moment), normal))
    }

    fn residuals(&self, parameters: &DVector<f64>) -> Vec<f64> {
        let mut residuals = self.observed.to_vec();
        for (column, parameter) in self.columns.iter().zip(parameters.iter()) {
            column.add_to(-parameter, &mut residuals);
        }
        residuals
    }

    /// Parameters, (XᵀWX)⁻¹ and residuals, rounding in the products taken out.
    fn solved(&self, weights: &[f64]) -> Result<Solution, FitError> {
        let (mut parameters, normal) = self.solve(weights)?;
        let residuals = self.residuals(&parameters);
        let weighted: Vec<f64> = residuals.iter().zip(weights).map(|(r, w)| r * w).collect();
        let left = self.columns.iter().map(|column| column.dot_rows(&weighted));
        // What rounding in the products left in the residuals is fitted once more.
        parameters += normal.solve(&DVector::from_iterator(self.columns.len(), left));
        let residuals_mm = self.residuals(&parameters);
        Ok(Solution {
            covariance: normal.inverse(),
            parameters,
            residuals_mm,
        })
    }

    /// Iterates (1); samples of weight 0 stay out. Gives the residuals.
    fn settle(
        &self,
        weights: &mut [f64],
        config: &BreakdownConfig,
    ) -> Result<Vec<f64>, BreakdownError> {
        let mut residuals = Vec::new();
        for _ in 0..WEIGHT_ITERATIONS {
            let (parameters, _) = self.solve(weights)?;
            residuals = self.residuals(&parameters);
            let used = residuals
                .iter()
                .zip(weights.iter())
                .filter(|(_, w)| **w > 0.0);
            let scale = noise::by_median(used.map(|(r, _)| *r)).max(ROUNDING_MM);
            let mut change = 0.0_f64;
            for (weight, r) in weights.iter_mut().zip(&residuals) {
                if *weight > 0.0 {
                    let new = (config.huber_limit * scale / r.abs().max(ROUNDING_MM)).min(1.0);
                    change = change.max((new - *weight).abs());
                    *weight = new;
                }
            }
            if change < SETTLED_WEIGHT {
                break;
            }
        }
        Ok(residuals)
    }
}

/// Normal equations, columns scaled to unit length.
struct Normal {
    scale: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
}

impl Normal {
    fn new(gram: &DMatrix<f64>) -> Result<Self, FitError> {
        let scale = gram
            .diagonal()
            .map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 1.0 });
        let unit = DMatrix::from_fn(gram.nrows(), gram.ncols(), |i, j| {
            gram[(i, j)] * scale[i] * scale[j]
        });
        let factor = unit.cholesky().ok_or(FitError::NoDecomposition)?;
        Ok(Self { scale, factor })
    }

    fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let solved = self.factor.solve(&right.component_mul(&self.scale));
        solved.component_mul(&self.scale)
    }

    fn inverse(&self) -> DMatrix<f64> {
        let unit = self.factor.inverse();
        DMatrix::from_fn(unit.nrows(), unit.ncols(), |i, j| {
            unit[(i, j)] * self.scale[i] * self.scale[j]
        })
    }
}

/// Rows that (2) leaves out.
fn single_spikes(
    scene: &Scene,
    residuals_mm: &[f64],
    weights: &[f64],
    config: &BreakdownConfig,
) -> Vec<usize> {
    let used = residuals_mm.iter().zip(weights).filter(|(_, w)| **w > 0.0);
    let scale = noise::by_median(used.map(|(r, _)| *r)).max(ROUNDING_MM);
    let limit = config.outlier_limit * scale;
    let mut found = Vec::new();
    for trace in &scene.traces {
        let rows: Vec<usize> = trace.rows().filter(|row| weights[*row] > 0.0).collect();
        let far = |at: usize| {
            rows.get(at)
                .is_some_and(|row| residuals_mm[*row].abs() > limit)
        };
        let near = |at: Option<usize>| {
            let row = at.and_then(|at| rows.get(at));
            row.is_none_or(|row| residuals_mm[*row].abs() < 0.5 * limit)
        };
        let spacing_rad = trace.spacing_rad;
        for (at, row) in rows.iter().enumerate() {
            let alone = near(at.checked_sub(1)) && near(Some(at + 1));
            let first_of_two = near(at.checked_sub(1)) && far(at + 1) && near(Some(at + 2));
            let second_of_two =
                at > 0 && far(at - 1) && near(at.checked_sub(2)) && near(Some(at + 1));
            let reverses = is_near_reversal(&trace.points[row - trace.first_row], spacing_rad);
            if far(at) && !reverses && (alone || first_of_two || second_of_two) {
                found.push(*row);
            }
        }
    }
    found
}

fn is_near_reversal(point: &Point, spacing_rad: f64) -> bool {
    let zone = REVERSAL_ZONE_RAD.max(3.0 * spacing_rad);
    point
        .arc_rad
        .iter()
        .any(|arc| *arc < zone || *arc > std::f64::consts::PI - zone)
}
