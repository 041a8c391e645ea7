//! Geometric errors of a machine as they are published.

use nalgebra::DMatrix;

use crate::error_component::ErrorComponent;
use crate::stamp::{Host, Stamp};

/// How an error component depends on the position of its axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveForm {
    /// One number: location errors.
    Constant,
    /// `sum c_k (q - origin)^k` over the powers in `power`.
    Polynomial,
    /// Straight between the knots in `position`, constant beyond the outer ones.
    Table,
}

/// One error component. Positions are mm or rad of its axis, values mm or rad, so that the
/// coefficient of power k is mm/mm^k, rad/mm^k, mm/rad^k or rad/rad^k.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorCurve {
    /// Which.
    pub component: ErrorComponent,
    /// Which of the forms below is meant.
    pub form: CurveForm,
    /// Position of the axis at which a polynomial is zero.
    pub origin: f64,
    /// Power of each coefficient; empty for other forms.
    pub power: Vec<u8>,
    /// Knots of a table, ascending; empty for other forms.
    pub position: Vec<f64>,
    /// The constant, the coefficients, or the values at the knots.
    pub coefficient: Vec<f64>,
    /// Standard uncertainty of each coefficient; NaN where it is not estimable by itself.
    pub standard_uncertainty: Vec<f64>,
    /// Whether the recordings determine each coefficient by itself. Where not, the coefficient is that of the
    /// minimum-norm solution and has a meaning only together with the others.
    pub estimable: Vec<bool>,
    /// Least and greatest position of the axis that was recorded.
    pub span: (f64, f64),
}

/// A sum of coefficients that the recordings determine although its members are not, mm.
#[derive(Clone, Debug, PartialEq)]
pub struct EstimableCombination {
    /// (index of the coefficient counted through all curves, weight in mm per unit of the coefficient).
    pub weights: Vec<(u32, f64)>,
    /// Its value, mm.
    pub value_mm: f64,
    /// Its standard uncertainty, mm.
    pub standard_uncertainty_mm: f64,
}

/// Geometric errors of a machine: error = actual minus commanded, tool relative to workpiece.
#[derive(Clone, Debug, PartialEq)]
pub struct GeometryModel {
    /// When it was fitted.
    pub at: Stamp<Host>,
    /// Chain string.
    pub chain: String,
    /// The components.
    pub curves: Vec<ErrorCurve>,
    /// Covariance of all coefficients in the order of the curves; of the minimum-norm solution where not estimable.
    pub covariance: DMatrix<f64>,
    /// What is determined beyond the single coefficients.
    pub combinations: Vec<EstimableCombination>,
    /// Readings behind it.
    pub n_samples: u32,
    /// Unknowns, set-up nuisances included.
    pub n_unknowns: u32,
    /// Rank of the equations.
    pub rank: u32,
    /// Standard deviation of the residuals, mm.
    pub residual_standard_deviation_mm: f64,
    /// Counts models since the node started.
    pub sequence: u32,
}
