//! What more columns would take off the sum of squares, all columns of a fit refitted.
//!
//! # Model
//!
//! With X the fitted columns, W their weights, G = XᵀWX = L Lᵀ and r the residuals:
//!
//! ```text
//!   u_c = L⁻¹ XᵀWc,  u_r = L⁻¹ XᵀWr                                              (1)
//!   c_i beside X:  c_iᵀWc_j − u_i·u_j;  its share of r:  c_iᵀWr − u_i·u_r        (2)
//!   Δ = |M⁻¹ s|²,  M Mᵀ of the first of (2), s of the second                      (3)
//!   F = (Δ/m) / ((S − Δ)/(ν − m)),   chance = trials · P(F_{m, ν−m} > F)          (4)
//! ```

use std::rc::Rc;

use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use super::columns::{Column, Columns};
use super::distinguish::Triangle;
use super::robust::{Fit, with_less_weight};
use super::scene::Scene;
use super::term::Term;

/// Arc after a reversal in which a spike may be, rad (20°).
pub(super) const LONGEST_DECAY_RAD: f64 = 0.35;
/// Sine below which a fitted column that the weights changed is in the span of the others.
const IN_THE_SPAN: f64 = 1e-6;

/// Residuals and design of a fit, ready for (3).
pub(super) struct Projector<'a> {
    pub columns: &'a Columns<'a>,
    pub fit: &'a Fit,
    kept: Vec<Rc<Column>>,
    triangle: Triangle,
    weights: Vec<f64>,
    weighted_residuals: Vec<f64>,
    /// u_r of (1).
    of_residuals: Vec<f64>,
    /// S of (4).
    sum: f64,
    least_sine: f64,
}

impl<'a> Projector<'a> {
    pub fn new(columns: &'a Columns<'a>, fit: &'a Fit, least_sine: f64) -> Self {
        let weights: Vec<f64> = columns
            .scene
            .rows()
            .zip(&fit.weights)
            .map(|((_, point), weight)| {
                let just_reversed = point.arc_rad.iter().any(|arc| *arc < LONGEST_DECAY_RAD);
                // Where a spike may be, its height is no reason to weigh less.
                if just_reversed && *weight > 0.0 {
                    1.0
                } else {
                    *weight
                }
            })
            .collect();
        let (gram, _) = with_less_weight(&fit.columns, &fit.gram, &weights);
        let mut triangle = Triangle::default();
        let mut places: Vec<usize> = Vec::new();
        for column in 0..gram.ncols() {
            let products: Vec<f64> = places.iter().map(|p| gram[(column, *p)]).collect();
            // A column that the weights put into the span of the others takes nothing off (3).
            if triangle
                .take(&products, gram[(column, column)], IN_THE_SPAN)
                .is_ok()
            {
                places.push(column);
            }
        }
        let kept: Vec<Rc<Column>> = places.iter().map(|p| Rc::clone(&fit.columns[*p])).collect();
        let pairs = fit.residuals_mm.iter().zip(&weights);
        let weighted_residuals: Vec<f64> = pairs.map(|(r, w)| r * w).collect();
        let products: Vec<f64> = kept
            .iter()
            .map(|column| column.dot_rows(&weighted_residuals))
            .collect();
        let of_residuals = triangle.coordinates(&products);
        let whole: f64 = fit
            .residuals_mm
            .iter()
            .zip(&weighted_residuals)
            .map(|(r, wr)| r * wr)
            .sum();
        let seen: f64 = of_residuals.iter().map(|u| u * u).sum();
        Self {
            columns,
            fit,
            kept,
            triangle,
            weights,
            weighted_residuals,
            of_residuals,
            sum: whole - seen,
            least_sine,
        }
    }

    pub fn scene(&self) -> &'a Scene {
        self.columns.scene
    }

    /// [`Self::gain`] of terms whose columns are needed again.
    pub fn gain_of_known(&self, terms: &[Term]) -> Option<(f64, f64)> {
        let columns = terms.iter().map(|term| self.columns.get(term));
        self.gain(columns)
    }

    /// [`Self::gain`] of terms whose columns are needed once.
    pub fn gain_of(&self, terms: &[Term]) -> Option<(f64, f64)> {
        let columns = terms
            .iter()
            .map(|term| Rc::new(Column::of(self.scene(), term)));
        self.gain(columns)
    }

    /// Δ of (3) and the mean square of a column beside the design; none where a column is in its span.
    fn gain(&self, columns: impl Iterator<Item = Rc<Column>>) -> Option<(f64, f64)> {
        let mut beside = Triangle::default();
        let mut before: Vec<(Rc<Column>, Vec<f64>)> = Vec::new();
        let mut shares: Vec<f64> = Vec::new();
        let mut greatest = 0.0_f64;
        for column in columns {
            let weighted = column.times(&self.weights);
            let products: Vec<f64> = self.kept.iter().map(|k| weighted.dot(k)).collect();
            let own = self.triangle.coordinates(&products);
            let inner = |u: &[f64]| own.iter().zip(u).map(|(a, b)| a * b).sum::<f64>();
            let whole = weighted.dot(&column);
            let left = whole - inner(&own);
            if left < self.least_sine.powi(2) * whole || whole <= 0.0 {
                return None;
            }
            let others: Vec<f64> = before
                .iter()
                .map(|(other, u)| weighted.dot(other) - inner(u))
                .collect(); // (2)
            beside.take(&others, left, self.least_sine).ok()?;
            shares.push(column.dot_rows(&self.weighted_residuals) - inner(&self.of_residuals));
            greatest = greatest.max(left);
            before.push((column, own));
        }
        let gain = beside.coordinates(&shares).iter().map(|s| s * s).sum();
        Some((gain, greatest))
    }

    /// (4)
    pub fn chance(&self, gain: f64, n_columns: usize, trials: f64) -> f64 {
        let (m, freedom) = (
            n_columns as f64,
            self.fit.degrees_of_freedom as f64 - n_columns as f64,
        );
        let left = (self.sum - gain).max(self.sum * f64::EPSILON);
        let ratio = (gain / m) / (left / freedom);
        FisherSnedecor::new(m, freedom).map_or(1.0, |f| (trials * f.sf(ratio)).min(1.0))
    }

    /// Amplitude of a column of this square that (4) would believe, mm.
    pub fn detectable_mm(
        &self,
        square: f64,
        n_columns: usize,
        trials: f64,
        false_alarm: f64,
    ) -> f64 {
        let needed = ChiSquared::new(n_columns as f64)
            .map_or(f64::NAN, |c| c.inverse_cdf(1.0 - false_alarm / trials));
        (needed * self.fit.variance_mm2 / square).sqrt()
    }
}
