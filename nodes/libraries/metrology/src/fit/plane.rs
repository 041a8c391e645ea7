//! A plane through points by least orthogonal distances.
//!
//! # Model
//!
//! ```text
//!   q = Σ w p / Σ w,   M = Σ w (p − q)(p − q)ᵀ = E Λ Eᵀ,  λ1 ≥ λ2 ≥ λ3               (1)
//!   normal n = e3,  distance d_i = n·(p_i − q)                                      (2)
//!   var(q·n) = 1/Σw,  var(tilt along e1) = 1/λ1,  along e2 = 1/λ2                   (3)
//! ```
//!
//! # Agreement
//! `eq1_finds_a_tilted_plane`: 1e-12. `eq3_tilt_scatter_matches_theory`: within 10 % over 2,000 fits.
//!
//! # References
//! \[1\] A. B. Forbes, Least-squares best-fit geometric elements, NPL report DITC 140/89, 1991.

use nalgebra::{Matrix3, Vector3};

use super::{ShapeError, check_points};

/// Below this ratio of squared extents the second direction is rounding: the points lie on a line.
const COLLINEAR: f64 = 1e-14;

/// A plane.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaneFit {
    /// Weighted middle of the points, mm.
    pub centroid_mm: Vector3<f64>,
    /// Unit normal; its sign is that of the hint.
    pub normal: Vector3<f64>,
    /// Standard uncertainty of the plane's place at the centroid, along the normal, mm.
    pub offset_standard_uncertainty_mm: f64,
    /// Standard uncertainty of the normal's direction, the larger of two, rad.
    pub tilt_standard_uncertainty_rad: f64,
    /// Orthogonal distances, along the normal, mm.
    pub residuals_mm: Vec<f64>,
    /// Greatest minus least distance, mm.
    pub form_mm: f64,
    /// Sum of squared weighted distances.
    pub chi_square: f64,
    /// Observations minus 3.
    pub degrees_of_freedom: usize,
}

/// Fits a plane; its normal points to the side of `outward`.
///
/// # Errors
/// Fewer than three points, points on one line, numbers that cannot be used.
pub fn fit_plane(
    points_mm: &[Vector3<f64>],
    standard_uncertainties_mm: &[f64],
    outward: &Vector3<f64>,
) -> Result<PlaneFit, ShapeError> {
    let rows = points_mm.iter().map(|p| p.iter().all(|c| c.is_finite()));
    check_points("plane", 3, rows, standard_uncertainties_mm)?;
    let weights: Vec<f64> = standard_uncertainties_mm
        .iter()
        .map(|u| 1.0 / (u * u))
        .collect();
    let total: f64 = weights.iter().sum();
    let weighted = || points_mm.iter().zip(&weights);
    let centroid_mm = weighted().fold(Vector3::zeros(), |sum, (p, w)| sum + p * *w) / total;
    let scatter = weighted().fold(Matrix3::zeros(), |sum, (p, w)| {
        let arm = p - centroid_mm;
        sum + arm * arm.transpose() * *w
    });
    let eigen = scatter.symmetric_eigen();
    let mode = |k: usize| {
        (
            eigen.eigenvalues[k],
            eigen.eigenvectors.column(k).into_owned(),
        )
    };
    let mut modes = [mode(0), mode(1), mode(2)];
    modes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let [(_, normal), (across, _), (along, _)] = modes;
    if across <= along * COLLINEAR {
        return Err(ShapeError::Degenerate {
            shape: "plane",
            n: points_mm.len(),
        });
    }
    let normal = if normal.dot(outward) < 0.0 {
        -normal
    } else {
        normal
    };
    let residuals_mm: Vec<f64> = points_mm
        .iter()
        .map(|p| normal.dot(&(p - centroid_mm))) // (2)
        .collect();
    Ok(PlaneFit {
        centroid_mm,
        normal,
        offset_standard_uncertainty_mm: (1.0 / total).sqrt(), // (3)
        tilt_standard_uncertainty_rad: (1.0 / across).sqrt(),
        form_mm: super::round::range(&residuals_mm),
        chi_square: residuals_mm
            .iter()
            .zip(&weights)
            .map(|(d, w)| w * d * d)
            .sum(),
        degrees_of_freedom: points_mm.len() - 3,
        residuals_mm,
    })
}

/// Two directions that with a normal make a right-handed frame; of the normal Z they are X and Y.
#[must_use]
pub fn plane_basis(normal: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let first = Vector3::ith((normal.iamax() + 1) % 3, 1.0);
    let across = (first - normal * first.dot(normal)).normalize();
    [across, normal.cross(&across)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};
    use rand_pcg::Pcg64Mcg;

    /// A 3 x 3 grid of 10 mm steps in the plane through `q` with the in-plane directions e1, e2.
    fn grid(q: Vector3<f64>, e1: Vector3<f64>, e2: Vector3<f64>) -> Vec<Vector3<f64>> {
        let steps = [-10.0, 0.0, 10.0];
        let pairs = steps.iter().flat_map(|a| steps.iter().map(move |b| (a, b)));
        pairs.map(|(a, b)| q + e1 * *a + e2 * *b).collect()
    }

    #[test]
    fn eq1_finds_a_tilted_plane() {
        let normal = Vector3::new(0.1, -0.2, 0.9).normalize();
        let e1 = normal.cross(&Vector3::x()).normalize();
        let q = Vector3::new(200.0, -150.0, 20.0);
        let points = grid(q, e1, normal.cross(&e1));
        let fit = fit_plane(&points, &[0.001; 9], &Vector3::z()).unwrap();
        assert!((fit.normal - normal).norm() < 1e-12);
        assert!((fit.centroid_mm - q).norm() < 1e-12 && fit.form_mm < 1e-12);
        let below = fit_plane(&points, &[0.001; 9], &-Vector3::z()).unwrap();
        assert!((below.normal + normal).norm() < 1e-12);
    }

    #[test]
    fn eq3_tilt_scatter_matches_theory() {
        let points = grid(Vector3::zeros(), Vector3::x(), Vector3::y());
        let mut rng = Pcg64Mcg::seed_from_u64(41);
        let noise = Normal::new(0.0, 0.002).unwrap();
        let (mut tilt2, mut offset2, mut u) = (0.0, 0.0, (0.0, 0.0));
        for _ in 0..2000 {
            let noisy: Vec<_> = points
                .iter()
                .map(|p| p + Vector3::z() * noise.sample(&mut rng))
                .collect();
            let fit = fit_plane(&noisy, &[0.002; 9], &Vector3::z()).unwrap();
            tilt2 += fit.normal.x.powi(2) / 2000.0;
            offset2 += fit.centroid_mm.z.powi(2) / 2000.0;
            u = (
                fit.tilt_standard_uncertainty_rad,
                fit.offset_standard_uncertainty_mm,
            );
        }
        // u / sqrt(sum of squared arms) = 0.002 / sqrt(600); u / 3.
        assert!((u.0 - 0.002 / 600_f64.sqrt()).abs() < 1e-8);
        assert!((u.1 - 0.002 / 3.0).abs() < 1e-12);
        assert!((tilt2.sqrt() / u.0 - 1.0).abs() < 0.1);
        assert!((offset2.sqrt() / u.1 - 1.0).abs() < 0.1);
    }

    #[test]
    fn points_on_one_line_are_refused() {
        let line: Vec<_> = (0..5)
            .map(|k| Vector3::new(1.0, 2.0, 3.0) * f64::from(k))
            .collect();
        assert_eq!(
            fit_plane(&line, &[1.0; 5], &Vector3::z()),
            Err(ShapeError::Degenerate {
                shape: "plane",
                n: 5
            })
        );
        assert!(matches!(
            fit_plane(&line[..2], &[1.0; 2], &Vector3::z()),
            Err(ShapeError::TooFewPoints { .. })
        ));
    }
}
