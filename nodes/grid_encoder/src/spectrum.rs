//! What a design can see: its singular values, the gap between seen and unseen, and which unknowns it determines.
//!
//! # Model
//!
//! With X the design in units of the span (every unknown in mm at the edge of what was recorded):
//!
//! ```text
//!   X = U Σ Vᵀ,   rank r = number of σ above max(n, p)·ε·σ₁ and t·σ₁                   (1)
//!   X⁺ = V_r Σ_r⁻¹ U_rᵀ,   β = X⁺ y                                                    (2)
//!   X⁺X = V_r V_rᵀ;   kᵀβ is estimable  ⇔  kᵀ = kᵀ X⁺X                                (3)
//!   cov(β) = s² X⁺X⁺ᵀ = s² V_r Σ_r⁻² V_rᵀ                                             (4)
//! ```
//!
//! t is the practical limit: positions that scatter by a micrometre about their circle let columns that
//! are equal on the circle differ by 1e-6, and what is divided by such a difference is no measurement.
//! Columns are scaled by the span alone and never by their own norm: rounding in a column of zeros,
//! brought to length 1, would count as rank.
//!
//! # Agreement
//! `val_numpy_singular_values_and_pseudoinverse` in tests/numpy.rs: 1e-12 relative.
//!
//! # References
//! \[1\] C. R. Rao, S. K. Mitra, Generalized Inverse of Matrices and its Applications, Wiley 1971: (3).

use nalgebra::{DMatrix, DVector};

/// How near the diagonal of (3) must be to 1 (or 0): a null vector may hold 1e-4 of an unknown.
pub(crate) const SEEN_TOLERANCE: f64 = 1e-8;

/// Whether an unknown is determined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visibility {
    /// Determined by itself.
    Estimable,
    /// Only together with others.
    Mixed,
    /// Nothing recorded depends on it.
    Unseen,
}

/// Where the singular values stop counting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Least singular value that counts.
    pub kept: f64,
    /// Greatest that does not; zero where all count.
    pub dropped: f64,
    /// Ratio below which it counts as zero, to the greatest.
    pub tolerance: f64,
}

/// The decomposition of a design.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// Singular values, greatest first.
    pub singular_values: DVector<f64>,
    /// Number that count.
    pub rank: usize,
    /// Where they stop counting.
    pub gap: Gap,
    /// Left vectors of the triangle, one per column.
    u: DMatrix<f64>,
    /// Right vectors, one per row.
    v_t: DMatrix<f64>,
}

impl Spectrum {
    /// Decomposes a triangle that stands for `n_rows` equations; `None`: it did not converge.
    #[must_use]
    pub fn of(triangle: &DMatrix<f64>, n_rows: usize, tolerance: f64) -> Option<Self> {
        let p = triangle.ncols();
        let svd = triangle.clone().try_svd(true, true, f64::EPSILON, 10_000)?;
        let (u, v_t) = (svd.u?, svd.v_t?);
        let greatest = svd.singular_values.max();
        let tolerance = tolerance.max(n_rows.max(p) as f64 * f64::EPSILON);
        let limit = tolerance * greatest; // (1)
        let counts = |s: &&f64| **s > limit;
        let rank = svd.singular_values.iter().filter(counts).count();
        let at = |idx: usize| svd.singular_values.get(idx).copied().unwrap_or(0.0);
        Some(Self {
            gap: Gap {
                kept: if rank > 0 { at(rank - 1) } else { 0.0 },
                dropped: at(rank),
                tolerance,
            },
            rank,
            u,
            v_t,
            singular_values: svd.singular_values,
        })
    }

    /// (2): minimum-norm solution for Qᵀy.
    #[must_use]
    pub fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let p = self.v_t.ncols();
        let mut solution = DVector::zeros(p);
        for k in 0..self.rank {
            let share = self.u.column(k).dot(right) / self.singular_values[k];
            solution += self.v_t.row(k).transpose() * share;
        }
        solution
    }

    /// (4) without s².
    #[must_use]
    pub fn cofactor(&self) -> DMatrix<f64> {
        let half = self.whitener();
        &half * half.transpose()
    }

    /// V_r Σ_r⁻¹: X times it is U_r, whose columns are orthonormal.
    #[must_use]
    pub fn whitener(&self) -> DMatrix<f64> {
        let p = self.v_t.ncols();
        DMatrix::from_fn(p, self.rank, |j, k| {
            self.v_t[(k, j)] / self.singular_values[k]
        })
    }

    /// X⁺X of (3).
    #[must_use]
    pub fn projector(&self) -> DMatrix<f64> {
        let seen = self.v_t.rows(0, self.rank);
        seen.transpose() * seen
    }

    /// Verdict per unknown by the diagonal of (3).
    #[must_use]
    pub fn visibility(&self) -> Vec<Visibility> {
        let seen = |j: usize| -> f64 {
            let column = self.v_t.column(j);
            column.rows(0, self.rank).norm_squared()
        };
        (0..self.v_t.ncols())
            .map(|j| match seen(j) {
                share if share > 1.0 - SEEN_TOLERANCE => Visibility::Estimable,
                share if share < SEEN_TOLERANCE => Visibility::Unseen,
                _ => Visibility::Mixed,
            })
            .collect()
    }

    /// Greatest singular value over the least that counts.
    #[must_use]
    pub fn condition(&self) -> f64 {
        if self.rank > 0 {
            self.singular_values[0] / self.gap.kept
        } else {
            f64::NAN
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spectrum() -> Spectrum {
        // Unknowns 0 and 1 only as their sum, 2 alone, 3 not at all.
        let rows = [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 3.0, 3.0, 1.0, 1e-17];
        let mut square = DMatrix::zeros(4, 4);
        square
            .rows_mut(0, 3)
            .copy_from(&DMatrix::from_row_slice(3, 4, &rows));
        Spectrum::of(&square, 3, 1e-9).unwrap()
    }

    #[test]
    fn eq3_sorts_unknowns_into_estimable_mixed_and_unseen() {
        use Visibility::{Estimable, Mixed, Unseen};
        assert_eq!(spectrum().visibility(), [Mixed, Mixed, Estimable, Unseen]);
        assert_eq!(spectrum().rank, 2);
        assert!(spectrum().gap.dropped < 1e-15 && spectrum().gap.kept > 1.0);
    }

    #[test]
    fn eq2_eq4_the_sum_has_its_value_and_its_variance() {
        let spectrum = spectrum();
        let beta = spectrum.solve(&DVector::from_vec(vec![5.0, 4.0, 17.0, 0.0]));
        assert!((beta[0] - 2.5).abs() < 1e-12 && (beta[1] - 2.5).abs() < 1e-12);
        assert!((beta[2] - 2.0).abs() < 1e-12 && beta[3].abs() < 1e-12);
        // Normal equations of (s, c): [[10, 3], [3, 5]], inverse [[5, -3], [-3, 10]] / 41.
        let cofactor = spectrum.cofactor();
        let of_sum = cofactor[(0, 0)] + 2.0 * cofactor[(0, 1)] + cofactor[(1, 1)];
        assert!((of_sum - 5.0 / 41.0).abs() < 1e-12);
        assert!((cofactor[(2, 2)] - 10.0 / 41.0).abs() < 1e-12);
    }
}
