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

use nalgebra::{DMatrix, DVector};

use super::config::BreakdownConfig;
use super::distinguish::{Reduction, design, reduce};
use super::error::BreakdownError;
use super::noise;
use super::scene::{Point, Scene};
use super::term::Term;
use crate::least_squares::{self, FitError};

/// Iterations of (1).
const ITERATIONS: usize = 30;
/// Passes of (2).
const PASSES: usize = 3;
/// Weights that change less end (1).
const SETTLED: f64 = 1e-3;
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
    pub design: DMatrix<f64>,
    /// One for each kept column.
    pub parameters: DVector<f64>,
    /// (4)
    pub covariance: DMatrix<f64>,
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
    scene: &Scene,
    terms: Vec<Term>,
    config: &BreakdownConfig,
) -> Result<Fit, BreakdownError> {
    let all = design(scene, &terms);
    let reduction = reduce(&all, config.least_sine);
    let kept = all.select_columns(&reduction.kept);
    let observed = DVector::from_iterator(scene.n_rows, scene.rows().map(|(_, p)| p.observed_mm));
    let n_parameters = kept.ncols();
    if scene.n_rows <= n_parameters {
        return Err(BreakdownError::TooFewForModel {
            n: scene.n_rows,
            n_parameters,
        });
    }
    let mut weights = vec![1.0; scene.n_rows];
    let mut residuals_mm = settle(&kept, &observed, &mut weights, config)?;
    for _ in 0..PASSES {
        let outliers = single_spikes(scene, &residuals_mm, &weights, config);
        if outliers.is_empty() {
            break;
        }
        for row in outliers {
            weights[row] = 0.0;
        }
        residuals_mm = settle(&kept, &observed, &mut weights, config)?;
    }
    let n = weights.iter().filter(|w| **w > 0.0).count();
    if n <= n_parameters {
        return Err(BreakdownError::TooFewForModel { n, n_parameters });
    }
    let roots = DVector::from_iterator(weights.len(), weights.iter().map(|w| w.sqrt()));
    let weighted = scaled_rows(&kept, &roots);
    let qr = weighted.qr();
    let mut projected = observed.component_mul(&roots);
    qr.q_tr_mul(&mut projected);
    let ones = DVector::from_element(n_parameters, 1.0);
    let top = projected.rows(0, n_parameters).into_owned();
    let solved = least_squares::solve(&qr.r(), &top, &ones)?;
    let residuals = &observed - &kept * &solved.parameters;
    let sum: f64 = residuals.iter().zip(&weights).map(|(r, w)| w * r * r).sum();
    let degrees_of_freedom = n - n_parameters;
    let mut fit = Fit {
        terms,
        reduction,
        design: kept,
        parameters: solved.parameters,
        covariance: solved.covariance,
        residuals_mm: residuals.iter().copied().collect(),
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
        let mut sum = DVector::zeros(self.design.nrows());
        for &column in columns {
            sum.axpy(self.parameters[column], &self.design.column(column), 1.0);
        }
        sum
    }

    /// From (XᵀWX)⁻¹ to (4).
    fn complete_covariance(&mut self, scene: &Scene) {
        let inverse = self.covariance.clone();
        self.covariance *= self.variance_mm2 * self.inflation;
        for (certificate, uncertainty_mm) in scene.certificates_mm.iter().enumerate() {
            let mut moment = DVector::zeros(self.design.ncols());
            for trace in scene
                .traces
                .iter()
                .filter(|t| t.certificate == Some(certificate))
            {
                for row in trace.rows() {
                    moment.axpy(self.weights[row], &self.design.row(row).transpose(), 1.0);
                }
            }
            let response = &inverse * moment;
            self.covariance += &response * response.transpose() * uncertainty_mm.powi(2);
        }
    }
}

/// Rows times their factors.
pub(super) fn scaled_rows(design: &DMatrix<f64>, factors: &DVector<f64>) -> DMatrix<f64> {
    let mut scaled = design.clone();
    for mut column in scaled.column_iter_mut() {
        column.component_mul_assign(factors);
    }
    scaled
}

/// Iterates (1); samples of weight 0 stay out. Gives the residuals.
fn settle(
    design: &DMatrix<f64>,
    observed: &DVector<f64>,
    weights: &mut [f64],
    config: &BreakdownConfig,
) -> Result<Vec<f64>, BreakdownError> {
    let mut residuals = observed.clone();
    for _ in 0..ITERATIONS {
        let w = DVector::from_column_slice(weights);
        let weighted = scaled_rows(design, &w);
        let parameters = solve_normal(&weighted.tr_mul(design), &weighted.tr_mul(observed))?;
        residuals = observed - design * parameters;
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
        if change < SETTLED {
            break;
        }
    }
    Ok(residuals.iter().copied().collect())
}

/// Solves normal equations, columns scaled to unit length.
fn solve_normal(gram: &DMatrix<f64>, right: &DVector<f64>) -> Result<DVector<f64>, FitError> {
    let scale = gram
        .diagonal()
        .map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 1.0 });
    let unit = DMatrix::from_fn(gram.nrows(), gram.ncols(), |i, j| {
        gram[(i, j)] * scale[i] * scale[j]
    });
    let factor = unit.cholesky().ok_or(FitError::NoDecomposition)?;
    Ok(factor
        .solve(&right.component_mul(&scale))
        .component_mul(&scale))
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
        let spacing_rad = trace.spacing_rad();
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
