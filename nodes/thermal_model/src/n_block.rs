//! Drift over the whole work space from any number of blocks.
//!
//! # Model
//!
//! With r from the fixed mean of all touch points:
//!
//! ```text
//!   d(r) = t + S r + ω × r + G r                                                 (1)
//!   S = diag(s_x, s_y, s_z),   G symmetric with a zero diagonal
//! ```
//!
//! that is three offsets, three scales, three rotations and three shears. Each touch gives one
//! equation of one component of (1). Terms are taken in the order offsets, scales, rotations,
//! shears; each is kept if the design stays of full rank and the term's standard uncertainty times
//! the travel stays under a limit:
//!
//! ```text
//!   u(term) · W ≤ limit                                                          (2)
//! ```
//!
//! Geometry and the probe's uncertainty decide, not the drifts measured, so the terms do not change
//! from update to update. Two blocks yield offsets and scales, which is [`crate::two_block`]; three
//! on a sloping plane add all rotations; three at one height give up the vertical scale instead; four
//! that span a volume make (1) complete.
//!
//! Lack of fit: χ² of the residuals on n − rank degrees of freedom, where there are any.
//!
//! # Holds when
//! The drift is affine in position. Four blocks follow every affine field exactly and can no longer
//! show what is not affine; a fifth can.
//!
//! # Agreement
//! `eq1_two_blocks_give_the_published_line`, `eq1_four_blocks_reproduce_any_affine_drift`: below
//! 1e-12 mm. `lack_of_fit_is_uniform_for_true_models`: 5 % level rejects 3 to 7 % of 1,000 seeds.

use metrology::least_squares::{WeightedFit, solve};
use metrology::sample::AxisDrift;
use metrology::{Axis, PerAxis};
use nalgebra::{DMatrix, DVector, Matrix2, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::error::ThermalModelError;
use crate::reference::FaceDrift;
use crate::two_block::SlopeLimit;

/// One unknown of (1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Term {
    /// t of one axis.
    Offset(Axis),
    /// s of one axis.
    Scale(Axis),
    /// ω about one axis.
    Rotation(Axis),
    /// Shear in the plane whose normal is the axis.
    Shear(Axis),
}

impl Term {
    /// All terms in the order in which they are tried.
    pub const ALL: [Self; 12] = [
        Self::Offset(Axis::X),
        Self::Offset(Axis::Y),
        Self::Offset(Axis::Z),
        Self::Scale(Axis::X),
        Self::Scale(Axis::Y),
        Self::Scale(Axis::Z),
        Self::Rotation(Axis::Z),
        Self::Rotation(Axis::X),
        Self::Rotation(Axis::Y),
        Self::Shear(Axis::Z),
        Self::Shear(Axis::X),
        Self::Shear(Axis::Y),
    ];

    /// Contribution of a unit of this term to the drift of `axis` at `r`.
    fn column(self, axis: Axis, r: &Vector3<f64>) -> f64 {
        match self {
            Self::Offset(own) => f64::from(own == axis),
            _ => self.gradient(axis).dot(r),
        }
    }

    /// ∂d_axis/∂r for a unit of this term.
    fn gradient(self, axis: Axis) -> Vector3<f64> {
        let mut gradient = Vector3::zeros();
        let row = self.axis().index();
        let (next, previous) = ((row + 1) % 3, (row + 2) % 3);
        match self {
            Self::Offset(_) => {}
            Self::Scale(own) if own == axis => gradient[row] = 1.0,
            Self::Scale(_) => {}
            // ω × r about axis k: the next axis receives ω times the previous one's coordinate with
            // a minus, the previous receives ω times the next one's.
            Self::Rotation(_) | Self::Shear(_) => {
                let sign = if matches!(self, Self::Rotation(_)) {
                    -1.0
                } else {
                    1.0
                };
                if axis.index() == next {
                    gradient[previous] = sign;
                } else if axis.index() == previous {
                    gradient[next] = 1.0;
                }
            }
        }
        gradient
    }

    fn axis(self) -> Axis {
        match self {
            Self::Offset(a) | Self::Scale(a) | Self::Rotation(a) | Self::Shear(a) => a,
        }
    }

    /// The travel over which an error of this term acts.
    fn limit(self, limits: &PerAxis<SlopeLimit>) -> SlopeLimit {
        match self {
            Self::Offset(a) | Self::Scale(a) => limits[a],
            Self::Rotation(a) | Self::Shear(a) => Axis::LINEAR
                .into_iter()
                .filter(|other| *other != a)
                .map(|other| limits[other])
                .max_by(|a, b| a.travel_mm.total_cmp(&b.travel_mm))
                .unwrap_or(limits[a]),
        }
    }
}

/// The fitted model.
#[derive(Clone, Debug)]
pub struct NBlockFit {
    /// Model per axis; `None` where no face was measured.
    pub axes: PerAxis<Option<AxisDrift>>,
    /// The terms that are estimated.
    pub terms: Vec<Term>,
    /// The terms that the geometry or (2) left out.
    pub left_out: Vec<Term>,
    /// Faces behind it.
    pub n_faces: usize,
    /// Degrees of freedom of the lack-of-fit test.
    pub degrees_of_freedom: usize,
    /// Its p value; NaN without degrees of freedom.
    pub lack_of_fit_p: f64,
    /// Root mean square of the residuals at the faces, mm.
    pub residual_rms_mm: f64,
    origin_mm: Vector3<f64>,
    covariance: DMatrix<f64>,
}

impl NBlockFit {
    /// Standard uncertainty of the drift of `axis` at a point, mm, every term included.
    #[must_use]
    pub fn standard_uncertainty_mm(&self, axis: Axis, point_mm: &Vector3<f64>) -> f64 {
        let r = point_mm - self.origin_mm;
        let row = DVector::from_iterator(
            self.terms.len(),
            self.terms.iter().map(|term| term.column(axis, &r)),
        );
        (&self.covariance * &row).dot(&row).max(0.0).sqrt()
    }
}

/// Fits (1) about `origin_mm`.
///
/// # Errors
/// When there is no face or a number of one is unusable.
pub fn fit(
    faces: &[FaceDrift],
    origin_mm: Vector3<f64>,
    limits: &PerAxis<SlopeLimit>,
) -> Result<NBlockFit, ThermalModelError> {
    let y = DVector::from_iterator(faces.len(), faces.iter().map(|f| f.drift_mm));
    let u = DVector::from_iterator(faces.len(), faces.iter().map(|f| f.standard_uncertainty_mm));
    let mut terms: Vec<Term> = Vec::new();
    let mut left_out = Vec::new();
    let mut kept: Option<WeightedFit> = None;
    for term in Term::ALL {
        if !faces.iter().any(|f| f.axis == term.axis()) && matches!(term, Term::Offset(_)) {
            continue;
        }
        terms.push(term);
        let design = DMatrix::from_fn(faces.len(), terms.len(), |i, j| {
            terms[j].column(faces[i].axis, &(faces[i].point_mm - origin_mm))
        });
        let trial = solve(&design, &y, &u)?;
        if trial.rank == terms.len() && certain(&terms, &trial, limits) {
            kept = Some(trial);
        } else {
            terms.pop();
            left_out.push(term);
        }
    }
    match kept {
        Some(solution) => Ok(assemble(faces, origin_mm, terms, left_out, solution)),
        // Without a face there is no offset; the fit of nothing names the reason.
        None => Err(
            solve(&DMatrix::zeros(0, 0), &y, &u).map_or_else(Into::into, |_| {
                metrology::least_squares::FitError::Empty {
                    n_rows: faces.len(),
                    n_columns: 0,
                }
                .into()
            }),
        ),
    }
}

/// Whether every slope-like term fulfils (2).
fn certain(terms: &[Term], fit: &WeightedFit, limits: &PerAxis<SlopeLimit>) -> bool {
    terms.iter().enumerate().all(|(j, term)| {
        let limit = term.limit(limits);
        matches!(term, Term::Offset(_))
            || fit.covariance[(j, j)].sqrt() * limit.travel_mm <= limit.error_mm
    })
}

fn assemble(
    faces: &[FaceDrift],
    origin_mm: Vector3<f64>,
    terms: Vec<Term>,
    left_out: Vec<Term>,
    solution: WeightedFit,
) -> NBlockFit {
    let axes = PerAxis::from_fn(|axis| axis_drift(axis, faces, origin_mm, &terms, &solution));
    let degrees_of_freedom = solution.degrees_of_freedom;
    let lack_of_fit_p = ChiSquared::new(degrees_of_freedom as f64)
        .map_or(f64::NAN, |chi_squared| chi_squared.sf(solution.chi_square));
    NBlockFit {
        axes,
        terms,
        left_out,
        n_faces: faces.len(),
        degrees_of_freedom,
        lack_of_fit_p,
        residual_rms_mm: (solution.residuals.norm_squared() / faces.len() as f64).sqrt(),
        origin_mm,
        covariance: solution.covariance,
    }
}

fn axis_drift(
    axis: Axis,
    faces: &[FaceDrift],
    origin_mm: Vector3<f64>,
    terms: &[Term],
    solution: &WeightedFit,
) -> Option<AxisDrift> {
    let offset = terms.iter().position(|t| *t == Term::Offset(axis))?;
    let scale = terms.iter().position(|t| *t == Term::Scale(axis));
    let own = faces
        .iter()
        .filter(|f| f.axis == axis)
        .map(|f| f.point_mm[axis.index()]);
    let span_mm = own.fold((f64::INFINITY, f64::NEG_INFINITY), |(lower, upper), p| {
        (lower.min(p), upper.max(p))
    });
    let mut gradient = Vector3::zeros();
    for (term, value) in terms.iter().zip(solution.parameters.iter()) {
        gradient += term.gradient(axis) * *value;
    }
    let mut cross = gradient;
    cross[axis.index()] = 0.0;
    let c = &solution.covariance;
    let covariance = scale.map_or_else(
        || Matrix2::new(c[(offset, offset)], 0.0, 0.0, 0.0),
        |s| {
            Matrix2::new(
                c[(offset, offset)],
                c[(offset, s)],
                c[(s, offset)],
                c[(s, s)],
            )
        },
    );
    Some(AxisDrift {
        p0_mm: origin_mm[axis.index()],
        k0_mm: solution.parameters[offset],
        slope_mm_per_mm: gradient[axis.index()],
        covariance,
        cross_slope_mm_per_mm: cross,
        cross_origin_mm: origin_mm,
        span_mm,
        offset_identifiable: true,
        slope_identifiable: scale.is_some(),
        rate_mm_s: 0.0,
        slope_rate_per_s: 0.0,
        time_constant_s: f64::INFINITY,
    })
}

#[cfg(test)]
#[expect(clippy::print_stdout, reason = "figures that the header quotes")]
mod tests {
    use super::*;
    use metrology::Stamp;
    use nalgebra::Matrix3;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};
    use rand_pcg::Pcg64Mcg;

    const U_MM: f64 = 3e-4;

    fn limits() -> PerAxis<SlopeLimit> {
        PerAxis::from_fn(|_| SlopeLimit {
            travel_mm: 600.0,
            error_mm: 0.005,
        })
    }

    fn faces(corners: &[[f64; 3]], drift: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Vec<FaceDrift> {
        let face = |(block, corner): (usize, &[f64; 3])| {
            let point_mm = Vector3::from(*corner);
            let d = drift(point_mm);
            Axis::LINEAR.map(|axis| FaceDrift {
                block,
                axis,
                point_mm,
                drift_mm: d[axis.index()],
                standard_uncertainty_mm: U_MM,
                hot_uncertainty_mm: U_MM,
                at: Stamp::from_nanos(0),
            })
        };
        corners.iter().enumerate().flat_map(face).collect()
    }

    fn origin(corners: &[[f64; 3]]) -> Vector3<f64> {
        corners
            .iter()
            .map(|c| Vector3::from(*c))
            .sum::<Vector3<f64>>()
            / corners.len() as f64
    }

    fn value_mm(drift: &AxisDrift, axis: Axis, r: &Vector3<f64>) -> f64 {
        drift.k0_mm
            + drift.slope_mm_per_mm * (r[axis.index()] - drift.p0_mm)
            + drift
                .cross_slope_mm_per_mm
                .dot(&(r - drift.cross_origin_mm))
    }

    const TWO: [[f64; 3]; 2] = [[-220.0, -180.0, 20.0], [220.0, 180.0, 200.0]];
    const THREE: [[f64; 3]; 3] = [TWO[0], TWO[1], [220.0, -180.0, 300.0]];
    const FLAT: [[f64; 3]; 3] = [
        [-220.0, -180.0, 20.0],
        [220.0, 180.0, 20.0],
        [220.0, -180.0, 20.0],
    ];
    const FOUR: [[f64; 3]; 4] = [
        TWO[0],
        TWO[1],
        [220.0, -180.0, 60.0],
        [-220.0, 180.0, 300.0],
    ];

    fn affine(r: Vector3<f64>) -> Vector3<f64> {
        let m = Matrix3::new(40.0, -12.0, 7.0, 25.0, 31.0, -9.0, 3.0, 14.0, -22.0) * 1e-6;
        Vector3::new(0.011, -0.004, 0.023) + m * r
    }

    #[test]
    fn eq1_two_blocks_give_the_published_line() {
        let faces = faces(&TWO, affine);
        let fit = fit(&faces, origin(&TWO), &limits()).unwrap();
        assert_eq!(fit.terms, Term::ALL[..6]);
        assert!(fit.lack_of_fit_p.is_nan());
        for (i, axis) in Axis::LINEAR.into_iter().enumerate() {
            let line = crate::two_block::line(axis, &faces[i], &faces[3 + i], limits()[axis]).drift;
            for p in [-300.0, 0.0, 130.0] {
                let mut r = Vector3::new(5.0, 6.0, 7.0);
                r[i] = p;
                let (a, b) = (fit.axes[axis].unwrap(), line);
                assert!((value_mm(&a, axis, &r) - value_mm(&b, axis, &r)).abs() < 1e-12);
                let u = |d| metrology::drift::drift_standard_uncertainty_mm(d, p);
                assert!((u(&a) - u(&b)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn eq1_four_blocks_reproduce_any_affine_drift() {
        let fit = fit(&faces(&FOUR, affine), origin(&FOUR), &limits()).unwrap();
        assert_eq!(fit.terms.len(), 12);
        for r in [
            Vector3::new(300.0, -200.0, 400.0),
            Vector3::new(-10.0, 20.0, 30.0),
        ] {
            for axis in Axis::LINEAR {
                let model_mm = value_mm(&fit.axes[axis].unwrap(), axis, &r);
                assert!((model_mm - affine(r)[axis.index()]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn eq1_three_blocks_on_a_slope_show_all_rotations_and_no_shear() {
        let turn = Vector3::new(11e-6, -7e-6, 23e-6);
        let fit = fit(
            &faces(&THREE, |r| turn.cross(&r)),
            origin(&THREE),
            &limits(),
        )
        .unwrap();
        assert_eq!(fit.terms, Term::ALL[..9]);
        assert_eq!(fit.left_out, Term::ALL[9..]);
        let corner = Vector3::new(-220.0, 180.0, 100.0);
        for axis in Axis::LINEAR {
            let model_mm = value_mm(&fit.axes[axis].unwrap(), axis, &corner);
            assert!((model_mm - turn.cross(&corner)[axis.index()]).abs() < 1e-12);
        }
    }

    #[test]
    fn eq1_three_blocks_at_one_height_give_up_the_vertical_scale() {
        let fit = fit(
            &faces(&FLAT, |_| Vector3::zeros()),
            origin(&FLAT),
            &limits(),
        )
        .unwrap();
        assert!(fit.left_out.contains(&Term::Scale(Axis::Z)));
        assert!(fit.terms.contains(&Term::Rotation(Axis::X)));
        assert!(!fit.axes[Axis::Z].unwrap().slope_identifiable);
    }

    #[test]
    fn eq2_a_term_that_would_be_uncertain_over_the_travel_is_left_out() {
        let near = [[0.0, 0.0, 0.0], [200.0, 200.0, 30.0]];
        let fit = fit(
            &faces(&near, |_| Vector3::zeros()),
            origin(&near),
            &limits(),
        )
        .unwrap();
        assert_eq!(fit.left_out[0], Term::Scale(Axis::Z));
        assert!(fit.terms.contains(&Term::Scale(Axis::X)));
    }

    #[test]
    fn missing_faces_cost_their_axis_only() {
        let mut some = faces(&TWO, affine);
        some.retain(|f| f.axis != Axis::Y);
        let fit_without = fit(&some, origin(&TWO), &limits()).unwrap();
        assert!(fit_without.axes[Axis::Y].is_none());
        let whole = fit(&faces(&TWO, affine), origin(&TWO), &limits()).unwrap();
        let (a, b) = (
            fit_without.axes[Axis::X].unwrap(),
            whole.axes[Axis::X].unwrap(),
        );
        assert!(
            (a.k0_mm - b.k0_mm).abs() < 1e-12
                && (a.slope_mm_per_mm - b.slope_mm_per_mm).abs() < 1e-12
        );
        assert!(fit(&[], Vector3::zeros(), &limits()).is_err());
    }

    #[test]
    fn lack_of_fit_is_uniform_for_true_models() {
        let six = [
            FOUR[0],
            FOUR[1],
            FOUR[2],
            FOUR[3],
            [0.0, 0.0, 100.0],
            [100.0, -100.0, 250.0],
        ];
        let noise = Normal::new(0.0, U_MM).unwrap();
        let mut rng = Pcg64Mcg::seed_from_u64(20);
        let rejected = (0..1000)
            .filter(|_| {
                let mut noisy = faces(&six, affine);
                noisy
                    .iter_mut()
                    .for_each(|f| f.drift_mm += noise.sample(&mut rng));
                fit(&noisy, origin(&six), &limits()).unwrap().lack_of_fit_p < 0.05
            })
            .count();
        println!("rejected {rejected} of 1000");
        assert!((30..=70).contains(&rejected), "{rejected}");
    }

    #[test]
    fn a_drift_that_is_not_affine_fails_the_lack_of_fit_test() {
        let five = [FOUR[0], FOUR[1], FOUR[2], FOUR[3], [0.0, 0.0, 100.0]];
        let hot_zone =
            |r: Vector3<f64>| Vector3::new(0.012 * (-(r.x / 120.0).powi(2)).exp(), 0.0, 0.0);
        let fit = fit(&faces(&five, hot_zone), origin(&five), &limits()).unwrap();
        assert_eq!(fit.degrees_of_freedom, 3);
        assert!(fit.lack_of_fit_p < 1e-6);
    }

    #[test]
    fn the_stated_uncertainty_covers_the_truth_in_95_percent_of_seeds() {
        let noise = Normal::new(0.0, U_MM).unwrap();
        let mut rng = Pcg64Mcg::seed_from_u64(21);
        let points = [
            Vector3::new(0.0, 0.0, 110.0),
            Vector3::new(300.0, -200.0, 350.0),
        ];
        let mut covered = [0; 2];
        for _ in 0..1000 {
            let mut noisy = faces(&FOUR, affine);
            noisy
                .iter_mut()
                .for_each(|f| f.drift_mm += noise.sample(&mut rng));
            let fit = fit(&noisy, origin(&FOUR), &limits()).unwrap();
            for (point, count) in points.iter().zip(&mut covered) {
                let error_mm =
                    value_mm(&fit.axes[Axis::X].unwrap(), Axis::X, point) - affine(*point).x;
                *count += usize::from(
                    error_mm.abs() < 1.96 * fit.standard_uncertainty_mm(Axis::X, point),
                );
            }
        }
        println!("covered {covered:?} of 1000");
        assert!(
            covered.iter().all(|c| (930..=970).contains(c)),
            "{covered:?}"
        );
    }
}
