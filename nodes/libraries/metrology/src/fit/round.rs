//! A circle (two dimensions) or a sphere (three) by least orthogonal distances.
//!
//! # Model
//!
//! ```text
//!   start:  |p|² = 2 c·p + (r² − |c|²),  linear in c and the bracket                 (1)
//!   d_i = |p_i − c| − r,   ∂d_i/∂c = −(p_i − c)/|p_i − c|,   ∂d_i/∂r = −1            (2)
//!   Gauss-Newton on Σ (d_i/u_i)², covariance of its last step                       (3)
//! ```
//!
//! (1) weighs points by their distance from the centre and is biased on short arcs, so it only
//! begins the iteration (3). A step that would enlarge the sum is halved.
//!
//! # Holds when
//! Deviations from roundness are small beside the radius.
//!
//! # Agreement
//! `val_gander_golub_strebel_circle`: the published centre and radius to 4 decimals.
//!
//! # References
//! \[1\] W. Gander, G. H. Golub, R. Strebel, BIT 34 (1994) 558-578, doi:10.1007/BF01934268.

use nalgebra::{DMatrix, DVector, SVector};

use super::{ShapeError, check_points};
use crate::least_squares;

/// Iterations after which a fit is given up.
const FIT_ITERATIONS: usize = 100;
/// A step shorter than this share of the radius ends the iteration.
const SETTLED_STEP: f64 = 1e-14;
/// How often one step is halved.
const HALVINGS: usize = 40;
/// Below this ratio of singular values the start is not determined.
const DETERMINED: f64 = 1e-9;

/// A circle or sphere in D dimensions.
#[derive(Clone, Debug, PartialEq)]
pub struct RoundFit<const D: usize> {
    /// Centre, mm.
    pub centre_mm: SVector<f64, D>,
    /// Radius, mm.
    pub radius_mm: f64,
    /// Covariance of (centre, radius), mm².
    pub covariance_mm2: DMatrix<f64>,
    /// Distances from the shape, outward positive, mm.
    pub residuals_mm: Vec<f64>,
    /// Greatest minus least distance, mm.
    pub form_mm: f64,
    /// Sum of squared weighted distances.
    pub chi_square: f64,
    /// Observations minus D + 1.
    pub degrees_of_freedom: usize,
}

/// A circle.
pub type CircleFit = RoundFit<2>;
/// A sphere.
pub type SphereFit = RoundFit<3>;

/// Fits a circle or a sphere.
///
/// # Errors
/// Fewer than D + 1 points, points on one line or plane, numbers that cannot be used, an iteration
/// that does not settle.
pub fn fit_round<const D: usize>(
    points_mm: &[SVector<f64, D>],
    standard_uncertainties_mm: &[f64],
) -> Result<RoundFit<D>, ShapeError> {
    let rows = points_mm.iter().map(|p| p.iter().all(|c| c.is_finite()));
    check_points(shape::<D>(), D + 1, rows, standard_uncertainties_mm)?;
    let mean = points_mm.iter().sum::<SVector<f64, D>>() / points_mm.len() as f64;
    let centred: Vec<_> = points_mm.iter().map(|p| p - mean).collect();
    let u = DVector::from_column_slice(standard_uncertainties_mm);
    let mut round = start(&centred, &u)?;
    let mut last_step_mm = f64::INFINITY;
    for _ in 0..FIT_ITERATIONS {
        let fit = least_squares::solve(&design(&centred, &round), &round.distances(&centred), &u)?;
        last_step_mm = round.improve(&centred, &u, &fit.parameters);
        if last_step_mm <= SETTLED_STEP * round.radius_mm {
            break;
        }
    }
    // Rounding in the distances keeps the step from ending below this.
    if last_step_mm > 1e-9 * round.radius_mm || round.radius_mm <= 0.0 {
        return Err(ShapeError::NotSettled {
            shape: shape::<D>(),
            iterations: FIT_ITERATIONS,
            last_step_mm,
        });
    }
    let distances = round.distances(&centred);
    let fit = least_squares::solve(&design(&centred, &round), &distances, &u)?;
    if fit.rank <= D {
        return Err(degenerate::<D>(points_mm.len()));
    }
    let residuals_mm: Vec<f64> = distances.iter().copied().collect();
    Ok(RoundFit {
        centre_mm: mean + round.centre_mm,
        radius_mm: round.radius_mm,
        covariance_mm2: fit.covariance,
        form_mm: range(&residuals_mm),
        residuals_mm,
        chi_square: distances.component_div(&u).norm_squared(),
        degrees_of_freedom: points_mm.len() - D - 1,
    })
}

const fn shape<const D: usize>() -> &'static str {
    if D == 2 { "circle" } else { "sphere" }
}

const fn degenerate<const D: usize>(n: usize) -> ShapeError {
    ShapeError::Degenerate {
        shape: shape::<D>(),
        n,
    }
}

struct Round<const D: usize> {
    centre_mm: SVector<f64, D>,
    radius_mm: f64,
}

impl<const D: usize> Round<D> {
    fn distances(&self, points: &[SVector<f64, D>]) -> DVector<f64> {
        let distance = |p: &SVector<f64, D>| (p - self.centre_mm).norm() - self.radius_mm;
        DVector::from_iterator(points.len(), points.iter().map(distance))
    }

    /// Takes a step, halved until the sum of squares does not grow; gives its length, mm.
    fn improve(
        &mut self,
        points: &[SVector<f64, D>],
        u: &DVector<f64>,
        step: &DVector<f64>,
    ) -> f64 {
        let sum = |round: &Self| round.distances(points).component_div(u).norm_squared();
        let before = sum(self);
        let mut share = 1.0;
        for _ in 0..HALVINGS {
            let tried = Self {
                centre_mm: self.centre_mm + SVector::from_fn(|k, _| share * step[k]),
                radius_mm: self.radius_mm + share * step[D],
            };
            if sum(&tried) <= before {
                *self = tried;
                return share * step.norm();
            }
            share /= 2.0;
        }
        0.0
    }
}

/// Algebraic start, equation (1).
fn start<const D: usize>(
    points: &[SVector<f64, D>],
    u: &DVector<f64>,
) -> Result<Round<D>, ShapeError> {
    let design = DMatrix::from_fn(points.len(), D + 1, |i, j| {
        if j < D { 2.0 * points[i][j] } else { 1.0 }
    });
    let squares = points.iter().map(SVector::norm_squared);
    let observed = DVector::from_iterator(points.len(), squares);
    let fit = least_squares::solve(&design, &observed, u)?;
    let values = &fit.singular_values;
    if fit.rank <= D || values.min() < DETERMINED * values.max() {
        return Err(degenerate::<D>(points.len()));
    }
    let centre_mm = SVector::<f64, D>::from_fn(|k, _| fit.parameters[k]);
    Ok(Round {
        radius_mm: (fit.parameters[D] + centre_mm.norm_squared())
            .max(0.0)
            .sqrt(),
        centre_mm,
    })
}

/// Minus the derivatives of (2), so that the solution is the step itself.
fn design<const D: usize>(points: &[SVector<f64, D>], round: &Round<D>) -> DMatrix<f64> {
    DMatrix::from_fn(points.len(), D + 1, |i, j| {
        let arm = points[i] - round.centre_mm;
        let length = arm.norm();
        match (j < D, length > 0.0) {
            (true, true) => arm[j] / length,
            (true, false) => 0.0,
            (false, _) => 1.0,
        }
    })
}

/// Greatest minus least.
pub(super) fn range(values: &[f64]) -> f64 {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    greatest - least
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Vector2, Vector3};

    #[test]
    fn val_gander_golub_strebel_circle() {
        // source: [1], section 5: six points, geometric fit (4.7398, 2.9835), r = 4.7142.
        let points = [
            (1.0, 7.0),
            (2.0, 6.0),
            (5.0, 8.0),
            (7.0, 7.0),
            (9.0, 5.0),
            (3.0, 7.0),
        ]
        .map(|(x, y)| Vector2::new(x, y));
        let fit = fit_round(&points, &[1.0; 6]).unwrap();
        assert!((fit.centre_mm.x - 4.7398).abs() < 5e-5, "{}", fit.centre_mm);
        assert!((fit.centre_mm.y - 2.9835).abs() < 5e-5, "{}", fit.centre_mm);
        assert!((fit.radius_mm - 4.7142).abs() < 5e-5, "{}", fit.radius_mm);
    }

    #[test]
    fn eq2_an_exact_sphere_is_found_far_from_the_origin() {
        let centre = Vector3::new(1e4, -2e4, 300.0);
        let points: Vec<_> = [
            Vector3::x(),
            -Vector3::x(),
            Vector3::y(),
            -Vector3::y(),
            Vector3::z(),
        ]
        .map(|n| centre + n * 12.5)
        .to_vec();
        let fit = fit_round(&points, &[0.001; 5]).unwrap();
        assert!((fit.centre_mm - centre).norm() < 1e-10);
        assert!((fit.radius_mm - 12.5).abs() < 1e-10 && fit.form_mm < 1e-10);
        // The pole alone ties Z to the radius: var(z) = var(pole) + var(r), var(r) = u²/4.
        assert!((fit.covariance_mm2[(3, 3)] - 0.25e-6).abs() < 1e-12);
        assert!((fit.covariance_mm2[(2, 2)] - 1.25e-6).abs() < 1e-12);
        assert!((fit.covariance_mm2[(0, 0)] - 0.5e-6).abs() < 1e-12);
    }

    #[test]
    fn eq3_four_even_points_on_a_circle_have_closed_covariances() {
        let points = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]
            .map(|(x, y)| Vector2::new(20.0 * x, 20.0 * y));
        let fit = fit_round(&points, &[0.002; 4]).unwrap();
        assert!((fit.covariance_mm2[(0, 0)] - 2e-6).abs() < 1e-12);
        assert!((fit.covariance_mm2[(2, 2)] - 1e-6).abs() < 1e-12);
        assert!(fit.covariance_mm2[(0, 2)].abs() < 1e-12);
    }

    #[test]
    fn a_lobed_circle_keeps_its_centre_and_shows_its_form() {
        let points: Vec<_> = (0..36)
            .map(|k| {
                let angle = f64::from(k).to_radians() * 10.0;
                let radius = 20.0 + 0.004 * (3.0 * angle).cos();
                Vector2::new(5.0 + radius * angle.cos(), radius * angle.sin())
            })
            .collect();
        let fit = fit_round(&points, &[0.001; 36]).unwrap();
        assert!((fit.centre_mm - Vector2::new(5.0, 0.0)).norm() < 1e-6);
        assert!((fit.form_mm - 0.008).abs() < 1e-6);
    }

    #[test]
    fn points_that_determine_nothing_are_refused() {
        let line = [0.0, 1.0, 2.0, 3.0].map(|x| Vector2::new(x, 2.0 * x));
        assert_eq!(
            fit_round(&line, &[1.0; 4]).unwrap_err().to_string(),
            "the 4 points do not determine a circle"
        );
        let flat = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.6, 0.8)]
            .map(|(x, y)| Vector3::new(x, y, 4.0));
        assert!(matches!(
            fit_round(&flat, &[1.0; 5]),
            Err(ShapeError::Degenerate {
                shape: "sphere",
                n: 5
            })
        ));
        assert!(matches!(
            fit_round(&line[..2], &[1.0; 2]),
            Err(ShapeError::TooFewPoints { least: 3, .. })
        ));
        let same = [Vector2::new(1.0, 1.0); 4];
        assert!(fit_round(&same, &[1.0; 4]).is_err());
        let nan = [Vector2::new(f64::NAN, 1.0); 4];
        assert!(matches!(
            fit_round(&nan, &[1.0; 4]),
            Err(ShapeError::LeastSquares(_))
        ));
    }
}
