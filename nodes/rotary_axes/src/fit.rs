//! Weighted least squares of the visits, with the spheres' places projected out, that says what it
//! cannot see.
//!
//! # Model
//!
//! ```text
//!   y_k = c_k - p_k(w) - known_k = R_k dw + sum_j X_kj b_j + e_k,   cov(e_k) = L_k L_k^T      (1)
//!   D = (1 - N N+) L^-1 X S = U diag(sigma) V^T,   z = (1 - N N+) L^-1 y                      (2)
//!   b = S V diag(1/sigma) U^T z,   cov(b) = S V diag(1/sigma^2) V^T S                         (3)
//!   dw = N+ L^-1 (y - X b),   chi^2 = |L^-1 (y - X b - R dw)|^2,   nu = 3 n - 3 spheres - rank (4)
//!   b_j is estimable  <=>  (V_r V_r^T)_jj = 1                                                  (5)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | c_k, p_k(w) | centre read, centre at the nominal place, machine frame | mm |
//! | N | L^-1 R, stacked for each sphere | 1/mm |
//! | S | 1 for a length, 1/arm for an angle: every unknown is a length at the sphere | 1, 1/mm |
//!
//! Singular values under a thousandth of the greatest count as zero: rotary positions are read with a
//! noise of arc seconds, and poses that differ by no more must not count as different.
//!
//! # References
//! \[1\] G. H. Golub, C. F. Van Loan, Matrix Computations, 4th ed., 5.5. \[2\] JCGM 100:2008 (GUM), H.3.

use machine::SphereDesign;
use metrology::fit::chi_square_p;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::error::EstimateError;
use crate::unknown::Unknown;
use crate::visit::SphereVisit;

/// Share of the greatest singular value below which a combination is not seen.
const SEEN: f64 = 1e-3;
/// How near to 1 the diagonal of (5) must be.
const ESTIMABLE: f64 = 1.0 - 1e-6;

/// Several unknowns whose sum is seen though they are not.
#[derive(Clone, Debug, PartialEq)]
pub struct Combination {
    /// Place among the unknowns, and weight in mm per unit.
    pub weights: Vec<(usize, f64)>,
    /// Its value, mm.
    pub value_mm: f64,
    /// Its standard uncertainty, mm.
    pub standard_uncertainty_mm: f64,
}

/// Solution of (1) for spheres near given places.
#[derive(Clone, Debug, PartialEq)]
pub struct SphereFit {
    /// b of (3), mm and rad; of the minimum-norm solution where not estimable.
    pub values: DVector<f64>,
    /// Its covariance.
    pub covariance: DMatrix<f64>,
    /// (5).
    pub estimable: Vec<bool>,
    /// Change of each unknown per mm of each reading, machine frame: b = G y of (3).
    pub gain: DMatrix<f64>,
    /// Change of each sphere's place per mm of each reading, machine frame, the unknowns held: N+ L^-1 of (4).
    pub place_gain: Vec<DMatrix<f64>>,
    /// What is seen of the unknowns that are not estimable alone.
    pub combinations: Vec<Combination>,
    /// Step of each sphere's place, workpiece frame, mm.
    pub place_steps_mm: Vec<Vector3<f64>>,
    /// Covariance of each sphere's place, the location errors held, mm².
    pub place_covariances_mm2: Vec<Matrix3<f64>>,
    /// Shift of each sphere's place with each unknown, by the visits: it takes up N+ L^-1 X of it, mm
    /// per unit.
    pub place_per_unknown: Vec<Vec<Vector3<f64>>>,
    /// Residual of each visit, machine frame, mm.
    pub residuals_mm: Vec<Vector3<f64>>,
    /// The same divided by its standard uncertainty.
    pub standardised: Vec<Vector3<f64>>,
    /// Unknowns and places that are seen.
    pub rank: usize,
    /// Singular values of D, greatest first.
    pub singular_values: Vec<f64>,
    /// (4).
    pub chi_square: f64,
    /// nu of (4).
    pub degrees_of_freedom: usize,
}

impl SphereFit {
    /// Probability of a chi-square as great as this if the stated uncertainties are right.
    #[must_use]
    pub fn p(&self) -> f64 {
        chi_square_p(self.chi_square, self.degrees_of_freedom)
    }
}

/// One visit, whitened.
struct Row {
    sphere: usize,
    turn: Matrix3<f64>,
    effects: Vec<Vector3<f64>>,
    reading: Vector3<f64>,
    /// L.
    deviation: Matrix3<f64>,
    /// Its inverse.
    whitener: Matrix3<f64>,
}

/// Solves (1) for `spheres` (name and place, workpiece frame, mm).
///
/// # Errors
/// When a covariance is not positive definite or the decomposition does not converge.
pub fn fit(
    design: &SphereDesign,
    visits: &[SphereVisit],
    spheres: &[(String, Vector3<f64>)],
    unknowns: &[Unknown],
) -> Result<SphereFit, EstimateError> {
    let scale = scales(design, spheres, unknowns);
    let rows = visits
        .iter()
        .enumerate()
        .map(|(index, visit)| whiten(design, (index, visit), spheres, unknowns, &scale))
        .collect::<Result<Vec<_>, _>>()?;
    let weights: Vec<Matrix3<f64>> = (0..spheres.len())
        .map(|sphere| {
            let own = rows.iter().filter(|row| row.sphere == sphere);
            let information: Matrix3<f64> = own.map(|row| row.turn.transpose() * row.turn).sum();
            information.try_inverse().unwrap_or_else(Matrix3::zeros)
        })
        .collect();
    let (reduced, reading) = project(&rows, &weights, unknowns.len());
    let seen = Decomposition::of(&reduced)?;
    let values = seen.solve(&reading);
    Ok(assemble(&rows, &weights, &seen, &values, &scale))
}

/// S of (2).
fn scales(
    design: &SphereDesign,
    spheres: &[(String, Vector3<f64>)],
    unknowns: &[Unknown],
) -> Vec<f64> {
    let arm_mm = spheres
        .iter()
        .flat_map(|(_, place)| {
            let axes = design.rotary_axes().iter();
            axes.map(move |&axis| (place - design.kinematics().origin_mm(axis)).norm())
        })
        .fold(1.0, f64::max);
    let of = |unknown: &Unknown| {
        if unknown.is_angular() {
            1.0 / arm_mm
        } else {
            1.0
        }
    };
    unknowns.iter().map(of).collect()
}

fn whiten(
    design: &SphereDesign,
    (index, visit): (usize, &SphereVisit),
    spheres: &[(String, Vector3<f64>)],
    unknowns: &[Unknown],
    scale: &[f64],
) -> Result<Row, EstimateError> {
    let unusable = || EstimateError::UnusableVisit {
        index,
        sphere: visit.sphere.clone(),
    };
    let sphere = spheres
        .iter()
        .position(|(name, _)| *name == visit.sphere)
        .ok_or_else(unusable)?;
    let deviation = visit.covariance_mm2.cholesky().ok_or_else(unusable)?.l();
    let whitener = deviation.try_inverse().ok_or_else(unusable)?;
    let row = design.row(&spheres[sphere].1, &visit.pose_rad);
    let reading = whitener * (visit.centre_mm - visit.known_mm - row.centre_mm);
    if !reading.iter().all(|value| value.is_finite()) {
        return Err(unusable());
    }
    Ok(Row {
        sphere,
        turn: whitener * row.machine_from_workpiece,
        effects: unknowns
            .iter()
            .zip(scale)
            .map(|(unknown, s)| whitener * unknown.effect(design, &row, &visit.pose_rad) * *s)
            .collect(),
        reading,
        deviation,
        whitener,
    })
}

/// D and z of (2).
fn project(rows: &[Row], weights: &[Matrix3<f64>], p: usize) -> (DMatrix<f64>, DVector<f64>) {
    let mut reduced = DMatrix::zeros(3 * rows.len(), p);
    let mut reading = DVector::zeros(3 * rows.len());
    let left_over = |pick: &dyn Fn(&Row) -> Vector3<f64>, row: &Row| {
        let own = rows.iter().filter(|other| other.sphere == row.sphere);
        let seen: Vector3<f64> = own.map(|other| other.turn.transpose() * pick(other)).sum();
        pick(row) - row.turn * (weights[row.sphere] * seen)
    };
    for (k, row) in rows.iter().enumerate() {
        for j in 0..p {
            let left = left_over(&|row| row.effects[j], row);
            reduced.fixed_view_mut::<3, 1>(3 * k, j).copy_from(&left);
        }
        let left = left_over(&|row| row.reading, row);
        reading.fixed_rows_mut::<3>(3 * k).copy_from(&left);
    }
    (reduced, reading)
}

/// Singular value decomposition with what is seen of it.
struct Decomposition {
    /// Columns of U diag(1/sigma) that are seen.
    left: DMatrix<f64>,
    /// Rows of V^T that are seen.
    seen: DMatrix<f64>,
    inverse: Vec<f64>,
    singular_values: Vec<f64>,
}

impl Decomposition {
    fn of(reduced: &DMatrix<f64>) -> Result<Self, EstimateError> {
        let p = reduced.ncols();
        if p == 0 || reduced.nrows() == 0 {
            return Ok(Self {
                left: DMatrix::zeros(reduced.nrows(), 0),
                seen: DMatrix::zeros(0, p),
                inverse: Vec::new(),
                singular_values: Vec::new(),
            });
        }
        let svd = reduced
            .clone()
            .try_svd(true, true, f64::EPSILON, 0)
            .ok_or(EstimateError::NoDecomposition)?;
        let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
            return Err(EstimateError::NoDecomposition);
        };
        let limit = SEEN * svd.singular_values.max();
        let order: Vec<usize> = (0..svd.singular_values.len())
            .filter(|&k| svd.singular_values[k] > limit)
            .collect();
        let inverse: Vec<f64> = order
            .iter()
            .map(|&k| 1.0 / svd.singular_values[k])
            .collect();
        let mut left = u.select_columns(&order);
        for (k, factor) in inverse.iter().enumerate() {
            left.column_mut(k).scale_mut(*factor);
        }
        Ok(Self {
            left,
            seen: v_t.select_rows(&order),
            inverse,
            singular_values: svd.singular_values.iter().copied().collect(),
        })
    }

    /// Minimum-norm solution, scaled unknowns.
    fn solve(&self, reading: &DVector<f64>) -> DVector<f64> {
        self.seen.transpose() * (self.left.transpose() * reading)
    }

    /// V_r V_r^T.
    fn projector(&self) -> DMatrix<f64> {
        self.seen.transpose() * &self.seen
    }

    /// V diag(1/sigma).
    fn half(&self) -> DMatrix<f64> {
        let mut half = self.seen.transpose();
        for (k, factor) in self.inverse.iter().enumerate() {
            half.column_mut(k).scale_mut(*factor);
        }
        half
    }
}

/// (3) to (5) from the scaled solution.
fn assemble(
    rows: &[Row],
    weights: &[Matrix3<f64>],
    seen: &Decomposition,
    scaled: &DVector<f64>,
    scale: &[f64],
) -> SphereFit {
    let mut place_steps_mm = vec![Vector3::zeros(); weights.len()];
    let left: Vec<Vector3<f64>> = rows
        .iter()
        .map(|row| {
            let effects = row.effects.iter().zip(scaled.iter());
            row.reading - effects.map(|(effect, b)| effect * *b).sum::<Vector3<f64>>()
        })
        .collect();
    for (row, left) in rows.iter().zip(&left) {
        place_steps_mm[row.sphere] += weights[row.sphere] * (row.turn.transpose() * left); // (4)
    }
    let standardised: Vec<Vector3<f64>> = rows
        .iter()
        .zip(&left)
        .map(|(row, left)| left - row.turn * place_steps_mm[row.sphere])
        .collect();
    let projector = seen.projector();
    let estimable: Vec<bool> = (0..scale.len())
        .map(|j| projector[(j, j)] > ESTIMABLE)
        .collect();
    let scales = DVector::from_column_slice(scale);
    let half = seen.half();
    let scaled_covariance = &half * half.transpose();
    let rank = seen.inverse.len() + 3 * weights.len();
    SphereFit {
        combinations: combinations(&projector, &estimable, scaled, &scaled_covariance, scale),
        values: scaled.component_mul(&scales),
        covariance: DMatrix::from_fn(scale.len(), scale.len(), |i, j| {
            scaled_covariance[(i, j)] * scale[i] * scale[j]
        }),
        estimable,
        gain: gain(rows, weights, seen, scale),
        place_gain: place_gain(rows, weights),
        place_per_unknown: place_per_unknown(rows, weights, scale),
        place_steps_mm,
        place_covariances_mm2: weights.to_vec(),
        residuals_mm: rows
            .iter()
            .zip(&standardised)
            .map(|(row, residual)| row.deviation * residual)
            .collect(),
        chi_square: standardised.iter().map(Vector3::norm_squared).sum(),
        standardised,
        degrees_of_freedom: (3 * rows.len()).saturating_sub(rank),
        rank,
        singular_values: seen.singular_values.clone(),
    }
}

/// S V diag(1/sigma) U^T (1 - N N+) L^-1: what (3) does to a reading.
fn gain(
    rows: &[Row],
    weights: &[Matrix3<f64>],
    seen: &Decomposition,
    scale: &[f64],
) -> DMatrix<f64> {
    let whole = seen.seen.transpose() * seen.left.transpose();
    let mut gain = DMatrix::zeros(scale.len(), 3 * rows.len());
    for (j, s) in scale.iter().enumerate() {
        let own = |k: usize| Vector3::from_fn(|i, _| whole[(j, 3 * k + i)]);
        let mut of_places = vec![Vector3::zeros(); weights.len()];
        for (k, row) in rows.iter().enumerate() {
            of_places[row.sphere] += row.turn.transpose() * own(k);
        }
        for (k, row) in rows.iter().enumerate() {
            let free = own(k) - row.turn * (weights[row.sphere] * of_places[row.sphere]);
            let per_mm = row.whitener.transpose() * free * *s;
            for i in 0..3 {
                gain[(j, 3 * k + i)] = per_mm[i];
            }
        }
    }
    gain
}

/// N+ L^-1, a matrix of three rows for each sphere.
fn place_gain(rows: &[Row], weights: &[Matrix3<f64>]) -> Vec<DMatrix<f64>> {
    let mut gains = vec![DMatrix::zeros(3, 3 * rows.len()); weights.len()];
    for (k, row) in rows.iter().enumerate() {
        let own = weights[row.sphere] * row.turn.transpose() * row.whitener;
        gains[row.sphere]
            .fixed_view_mut::<3, 3>(0, 3 * k)
            .copy_from(&own);
    }
    gains
}

fn place_per_unknown(
    rows: &[Row],
    weights: &[Matrix3<f64>],
    scale: &[f64],
) -> Vec<Vec<Vector3<f64>>> {
    let mut shifts = vec![vec![Vector3::zeros(); scale.len()]; weights.len()];
    for row in rows {
        for (j, (effect, s)) in row.effects.iter().zip(scale).enumerate() {
            shifts[row.sphere][j] += weights[row.sphere] * (row.turn.transpose() * effect) / *s;
        }
    }
    shifts
}

/// What is seen of the unknowns that are not estimable alone: the projector of (5) leaves those that
/// are to themselves, so its block of the others is a projector too.
fn combinations(
    projector: &DMatrix<f64>,
    estimable: &[bool],
    scaled: &DVector<f64>,
    covariance: &DMatrix<f64>,
    scale: &[f64],
) -> Vec<Combination> {
    let open: Vec<usize> = (0..scale.len()).filter(|&j| !estimable[j]).collect();
    if open.is_empty() {
        return Vec::new();
    }
    let block = projector.select_rows(&open).select_columns(&open);
    let eigen = block.symmetric_eigen();
    let seen = (0..open.len()).filter(|&k| eigen.eigenvalues[k] > 0.5);
    seen.map(|k| {
        let direction = eigen.eigenvectors.column(k);
        let mut value_mm = 0.0;
        let mut variance_mm2 = 0.0;
        for (a, &i) in open.iter().enumerate() {
            value_mm += direction[a] * scaled[i];
            for (b, &j) in open.iter().enumerate() {
                variance_mm2 += direction[a] * covariance[(i, j)] * direction[b];
            }
        }
        Combination {
            weights: open
                .iter()
                .enumerate()
                .map(|(a, &i)| (i, direction[a] / scale[i]))
                .collect(),
            value_mm,
            standard_uncertainty_mm: variance_mm2.max(0.0).sqrt(),
        }
    })
    .collect()
}
