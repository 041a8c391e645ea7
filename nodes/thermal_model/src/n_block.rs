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
//! The drifts share what an error of the latency makes of all of them ([`crate::latency_share`]), so
//! that the fit is generalised least squares:
//!
//! ```text
//!   V = diag(u²) + Σ_T u²(T) s_T s_Tᵀ = R Rᵀ,   R⁻¹ d = R⁻¹ X β + ε               (3)
//!   cov(k0, ∂d_i/∂r) = M cov(β) Mᵀ                                                (4)
//! ```
//!
//! (4) is what is published for each axis: with it u(d_i) is that of the whole fit at every point. What
//! the drifts of two axes have in common is not published. A scale that is left out is not known to be
//! zero: its published variance is its mean square, β² + u²(β), and infinite where the geometry says
//! nothing. Rotations and shears that are left out are supposed to be zero, as by the published method.
//!
//! Lack of fit: χ² of the residuals on n − rank degrees of freedom, where there are any.
//!
//! # Holds when
//! The drift is affine in position. Four blocks follow every affine field exactly and can no longer
//! show what is not affine; a fifth can.
//!
//! # Agreement
//! `eq1_two_blocks_give_the_published_line`, `eq1_four_blocks_reproduce_any_affine_drift`: below
//! 1e-12 mm. `eq4_covers_the_truth_in_every_direction`: 1.96 u held the truth in 93.9 to 96.0 % of 2,000
//! runs, with one latency and with two. `lack_of_fit_is_uniform_for_true_models`: 5 % level rejects 3 to 7 % of 1,000 seeds.

use metrology::least_squares::{FitError, WeightedFit, solve};
use metrology::sample::AxisDrift;
use metrology::{Axis, PerAxis};
use nalgebra::{DMatrix, DVector, Matrix4, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::error::ThermalModelError;
use crate::latency_share::latencies;
use crate::reference::FaceDrift;
use crate::two_block::SlopeLimit;

mod term;

pub use term::Term;

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
}

/// Rows of (1) made independent and of unit variance: (3).
struct Whitened {
    roots: Option<DMatrix<f64>>,
    uncertainties_mm: DVector<f64>,
}

impl Whitened {
    fn new(faces: &[FaceDrift]) -> Result<Self, FitError> {
        let uncertainties_mm =
            DVector::from_iterator(faces.len(), faces.iter().map(|f| f.standard_uncertainty_mm));
        let shared = latencies(faces);
        if shared.is_empty() {
            return Ok(Self {
                roots: None,
                uncertainties_mm,
            });
        }
        let mut covariance = DMatrix::from_diagonal(&uncertainties_mm.map(|u| u * u));
        for latency in shared {
            let sensitivities = faces.iter().map(|f| f.latency.sensitivity_mm_s(&latency));
            let s = DVector::from_iterator(faces.len(), sensitivities);
            covariance += &s * s.transpose() * latency.standard_uncertainty_s.powi(2);
        }
        let roots = covariance.cholesky().ok_or(FitError::NoDecomposition)?;
        Ok(Self {
            roots: Some(roots.l()),
            uncertainties_mm: DVector::from_element(faces.len(), 1.0),
        })
    }

    fn solve(&self, design: &DMatrix<f64>, y: &DVector<f64>) -> Result<WeightedFit, FitError> {
        let Some(roots) = &self.roots else {
            return solve(design, y, &self.uncertainties_mm);
        };
        let no_inverse = FitError::NoDecomposition;
        let design_white = roots.solve_lower_triangular(design).ok_or(no_inverse)?;
        let no_inverse = FitError::NoDecomposition;
        let y_white = roots.solve_lower_triangular(y).ok_or(no_inverse)?;
        let mut fit = solve(&design_white, &y_white, &self.uncertainties_mm)?;
        fit.residuals = y - design * &fit.parameters;
        Ok(fit)
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
    let white = Whitened::new(faces)?;
    let mut terms: Vec<Term> = Vec::new();
    let mut left_out: Vec<LeftOut> = Vec::new();
    let mut kept: Option<WeightedFit> = None;
    for term in Term::ALL {
        if !faces.iter().any(|f| f.axis == term.axis()) && matches!(term, Term::Offset(_)) {
            continue;
        }
        terms.push(term);
        let design = DMatrix::from_fn(faces.len(), terms.len(), |i, j| {
            terms[j].column(faces[i].axis, &(faces[i].point_mm - origin_mm))
        });
        let trial = white.solve(&design, &y)?;
        let is_of_full_rank = trial.rank == terms.len();
        if is_of_full_rank && certain(&terms, &trial, limits) {
            kept = Some(trial);
        } else {
            let last = terms.len() - 1;
            left_out.push(LeftOut {
                term,
                mean_square: if is_of_full_rank {
                    trial.parameters[last].powi(2) + trial.covariance[(last, last)]
                } else {
                    f64::INFINITY
                },
            });
            terms.pop();
        }
    }
    match kept {
        Some(solution) => Ok(assemble(faces, origin_mm, terms, &left_out, solution)),
        None => Err(FitError::Empty {
            n_rows: faces.len(),
            n_columns: 0,
        }
        .into()),
    }
}

/// A term that is not estimated, and the mean square that the faces allow it.
#[derive(Clone, Copy, Debug)]
struct LeftOut {
    term: Term,
    mean_square: f64,
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
    left_out: &[LeftOut],
    solution: WeightedFit,
) -> NBlockFit {
    let axes = PerAxis::from_fn(|axis| {
        let unknown = left_out.iter().find(|l| l.term == Term::Scale(axis));
        let drift = axis_drift(axis, faces, origin_mm, &terms, &solution)?;
        Some(unknown.map_or(drift, |left| without_slope(drift, axis, faces, left)))
    });
    let degrees_of_freedom = solution.degrees_of_freedom;
    let lack_of_fit_p = ChiSquared::new(degrees_of_freedom as f64)
        .map_or(f64::NAN, |chi_squared| chi_squared.sf(solution.chi_square));
    NBlockFit {
        axes,
        terms,
        left_out: left_out.iter().map(|l| l.term).collect(),
        n_faces: faces.len(),
        degrees_of_freedom,
        lack_of_fit_p,
        residual_rms_mm: (solution.residuals.norm_squared() / faces.len() as f64).sqrt(),
    }
}

/// A drift whose own slope is not known: it acts from the middle of the axis' faces.
fn without_slope(drift: AxisDrift, axis: Axis, faces: &[FaceDrift], left: &LeftOut) -> AxisDrift {
    let own = || faces.iter().filter(|f| f.axis == axis);
    let sum_mm: f64 = own().map(|f| f.point_mm[axis.index()]).sum();
    let mut covariance = drift.covariance;
    covariance[(axis.index() + 1, axis.index() + 1)] = left.mean_square;
    AxisDrift {
        p0_mm: sum_mm / own().count() as f64,
        covariance,
        ..drift
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
    let own = faces
        .iter()
        .filter(|f| f.axis == axis)
        .map(|f| f.point_mm[axis.index()]);
    let span_mm = own.fold((f64::INFINITY, f64::NEG_INFINITY), |(lower, upper), p| {
        (lower.min(p), upper.max(p))
    });
    // Rows of M in (4): the offset, then the change with X, Y and Z.
    let mut rows = DMatrix::zeros(4, terms.len());
    rows[(0, offset)] = 1.0;
    for (j, term) in terms.iter().enumerate() {
        rows.fixed_view_mut::<3, 1>(1, j)
            .copy_from(&term.gradient(axis));
    }
    let gradient = rows.fixed_rows::<3>(1) * &solution.parameters;
    let covariance = &rows * &solution.covariance * rows.transpose();
    let mut cross = Vector3::from_fn(|row, _| gradient[row]);
    cross[axis.index()] = 0.0;
    Some(AxisDrift {
        p0_mm: origin_mm[axis.index()],
        k0_mm: solution.parameters[offset],
        slope_mm_per_mm: gradient[axis.index()],
        covariance: Matrix4::from_fn(|i, j| covariance[(i, j)]),
        cross_slope_mm_per_mm: cross,
        cross_origin_mm: origin_mm,
        span_mm,
        offset_identifiable: true,
        slope_identifiable: terms.contains(&Term::Scale(axis)),
        growth: [None; 3],
        measured_at: faces
            .iter()
            .filter(|f| f.axis == axis)
            .map(|f| f.at)
            .max()
            .unwrap_or_default(),
    })
}

#[cfg(test)]
#[expect(clippy::print_stdout, reason = "figures that the header quotes")]
mod tests {
    use super::*;
    use crate::latency_share::LatencyShares;
    use metrology::Stamp;
    use metrology::drift::{Extrapolate, drift_standard_uncertainty_mm};
    use metrology::sample::{LatencyShare, ThermalModel};
    use nalgebra::Matrix3;
    use rand::{Rng, SeedableRng};
    use rand_distr::{Distribution, Normal, StandardNormal};
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
                latency: LatencyShares::default(),
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

    fn u_mm(drift: &AxisDrift, axis: Axis, r: &Vector3<f64>) -> f64 {
        let at = Stamp::from_nanos(0);
        let mut axes = PerAxis::default();
        axes[axis] = Some(*drift);
        let model = ThermalModel {
            at,
            axes,
            valid_from: at,
            valid_until: at,
            n_blocks: 2,
            lack_of_fit_p: f64::NAN,
            quarantined: false,
            sequence: 0,
        };
        drift_standard_uncertainty_mm(&model, axis, r, Extrapolate::Linear).unwrap()
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
                assert!((u_mm(&a, axis, &r) - u_mm(&b, axis, &r)).abs() < 1e-12);
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
    fn eq4_covers_the_truth_in_every_direction() {
        let mut rng = Pcg64Mcg::seed_from_u64(21);
        let points = [
            Vector3::new(0.0, 0.0, 110.0),
            Vector3::new(300.0, -200.0, 350.0),
            Vector3::new(-220.0, 260.0, 0.0),
        ];
        let (feed_mm_s, u_s) = (20.0, 60e-6);
        for hot_s in [0.008, 0.0081] {
            let mut covered = [[0; 3]; 3];
            for _ in 0..2000 {
                let mut normal = || rng.sample::<f64, _>(StandardNormal);
                let cold_error_s = u_s * normal();
                let hot_error_s = if hot_s > 0.008 {
                    u_s * normal()
                } else {
                    cold_error_s
                };
                let mut noisy = faces(&FOUR, affine);
                for face in &mut noisy {
                    let sign = if face.block % 2 == 0 { 1.0 } else { -1.0 };
                    let share = |latency_s| LatencyShare {
                        latency_s,
                        standard_uncertainty_s: u_s,
                        sensitivity_mm_s: -sign * feed_mm_s,
                    };
                    face.latency = LatencyShares::of_difference(&share(hot_s), &share(0.008));
                    face.drift_mm += U_MM * normal();
                    face.drift_mm -= sign * feed_mm_s * (hot_error_s - cold_error_s);
                }
                let fit = fit(&noisy, origin(&FOUR), &wide()).unwrap();
                assert_eq!(fit.terms.len(), 12);
                for (point, counts) in points.iter().zip(&mut covered) {
                    for axis in Axis::LINEAR {
                        let drift = fit.axes[axis].unwrap();
                        let truth_mm = affine(*point)[axis.index()];
                        let error_mm = value_mm(&drift, axis, point) - truth_mm;
                        let within = error_mm.abs() < 1.96 * u_mm(&drift, axis, point);
                        counts[axis.index()] += usize::from(within);
                    }
                }
            }
            println!("hot latency {hot_s} s: covered {covered:?} of 2000");
            let mut all = covered.iter().flatten();
            assert!(all.all(|c| (1860..=1940).contains(c)), "{covered:?}");
        }
    }

    #[test]
    fn a_scale_that_is_left_out_is_not_known_to_be_zero() {
        let flat = fit(&faces(&FLAT, affine), origin(&FLAT), &limits()).unwrap();
        let z = flat.axes[Axis::Z].unwrap();
        assert!(z.covariance[(3, 3)].is_infinite());
        let high = Vector3::new(0.0, 0.0, 300.0);
        assert!(u_mm(&z, Axis::Z, &high).is_infinite());
        // 30 mm apart in Z: the slope is bounded by what the blocks say, not known.
        let near = [[0.0, 0.0, 0.0], [200.0, 200.0, 30.0]];
        let low = fit(&faces(&near, affine), origin(&near), &limits()).unwrap();
        let z = low.axes[Axis::Z].unwrap();
        assert!(!z.slope_identifiable && (z.p0_mm - 15.0).abs() < 1e-12);
        // No more than what both blocks differ by, over the 30 mm between them.
        let apart_mm = affine(Vector3::from(near[1])).z - affine(Vector3::zeros()).z;
        let mean_square = (apart_mm * apart_mm + 2.0 * U_MM * U_MM) / 900.0;
        assert!((z.covariance[(3, 3)] / mean_square - 1.0).abs() < 1e-9);
        let mean_alone_mm2 = mean_square * 285.0_f64.powi(2);
        assert!(u_mm(&z, Axis::Z, &high).powi(2) > mean_alone_mm2);
    }

    fn wide() -> PerAxis<SlopeLimit> {
        PerAxis::from_fn(|_| SlopeLimit {
            travel_mm: 600.0,
            error_mm: 1.0,
        })
    }
}
