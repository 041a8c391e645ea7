//! Shapes fitted to measured points: line, plane, circle and sphere, each with its covariance.
//!
//! Distances are orthogonal and weighted with 1/u². Covariances are those that the given standard
//! uncertainties imply; they are not rescaled by the residuals, which are judged by their χ².

mod lack_of_fit;
mod line;
mod plane;
mod round;

pub use lack_of_fit::{PureError, chi_square_p, f_test_p, lack_of_fit};
pub use line::{LineFit, fit_line};
pub use plane::{PlaneFit, fit_plane, plane_basis};
pub use round::{CircleFit, RoundFit, SphereFit, fit_round};

use crate::least_squares::FitError;
use crate::number::number;

/// Why a shape is not fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ShapeError {
    /// Too few points for the shape.
    #[error("{n} points were given: a {shape} needs at least {least}")]
    TooFewPoints {
        /// Which shape.
        shape: &'static str,
        /// How many were given.
        n: usize,
        /// How many are needed.
        least: usize,
    },
    /// The lists differ in length.
    #[error("{n} points and {n_uncertainties} uncertainties were given")]
    Lengths {
        /// Points.
        n: usize,
        /// Uncertainties.
        n_uncertainties: usize,
    },
    /// The points lie so that the shape is not determined.
    #[error("the {n} points do not determine a {shape}")]
    Degenerate {
        /// Which shape.
        shape: &'static str,
        /// How many were given.
        n: usize,
    },
    /// The iteration did not settle.
    #[error("the {shape} did not settle in {iterations} iterations, last step {last_step_mm} mm", last_step_mm = number(*last_step_mm))]
    NotSettled {
        /// Which shape.
        shape: &'static str,
        /// Iterations made.
        iterations: usize,
        /// Length of the last step, mm.
        last_step_mm: f64,
    },
    /// A number cannot be used.
    #[error(transparent)]
    LeastSquares(#[from] FitError),
}

/// Refuses lists of different length, numbers that cannot be used and too few points.
fn check_points(
    shape: &'static str,
    least: usize,
    mut rows: impl ExactSizeIterator<Item = bool>,
    standard_uncertainties: &[f64],
) -> Result<(), ShapeError> {
    let n = rows.len();
    if n != standard_uncertainties.len() {
        return Err(ShapeError::Lengths {
            n,
            n_uncertainties: standard_uncertainties.len(),
        });
    }
    let unusable = |u: &f64| !(u.is_finite() && *u > 0.0);
    let row = rows
        .position(|finite| !finite)
        .or_else(|| standard_uncertainties.iter().position(unusable));
    if let Some(row) = row {
        return Err(FitError::NotUsable { row }.into());
    }
    if n < least {
        return Err(ShapeError::TooFewPoints { shape, n, least });
    }
    Ok(())
}
