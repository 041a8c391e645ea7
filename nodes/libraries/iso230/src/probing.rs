//! Measuring performance of a touch probe on a machine tool (ISO 230-10).
//!
//! # Model
//!
//! ```text
//!   single point:   R = max x_k − min x_k of one surface touched n times              (1)
//!   ring, sphere:   P = max r_k − min r_k about the least-squares circle or sphere    (2)
//!   size:           S = 2 r − calibrated diameter                                     (3)
//!   location:       R_x = max c_x − min c_x of the same feature measured m times, y and z alike (4)
//! ```
//!
//! | here | standard's name, as the literature gives it | usual numbers |
//! |---|---|---|
//! | [`single_point`] | single-point probing repeatability, R_SPT | 10 touches |
//! | [`ring`] | 2-D probing error, P_FTU,2D | 36 points |
//! | [`sphere`] | 3-D probing error, P_FTU,3D | 25 points |
//! | [`location`] | circle or sphere centre location repeatability, R_CIR, R_SPH | 10 features |
//!
//! Uncertainties, with u_V of the drift of one touch and the artefact's roundness f; q is the variance factor of r in the
//! least-squares fit of p unknowns (3 of a circle, 4 of a sphere) to n touches, (Xᵀ X)⁻¹_rr with rows (direction, 1) of X:
//!
//! ```text
//!   (1):  u² = 2 u_V²;    (2):  u² = 2 u_V² (1 − p/n) + (f² + u_f²)/6                 (5)
//!   (3):  u² = u_d² + u_T² + 4 q u_V²                                                 (6)
//!   (4):  u² = 2 u_V²                                                                 (7)
//! ```
//!
//! (f² + u_f²)/6: each of the two touches whose difference is P lies anywhere within the artefact's form, rectangular with the
//! half width f/2: f²/12 each. 1 − p/n: the fit takes p of n parts of what is new at every touch. (6): 2r is twice the
//! least-squares radius.
//!
//! # Holds when
//! Diameters are those of one temperature: (3) takes no expansion out, and u_T has what is not known of the scale where the
//! artefact is as warm as stated and of the same coefficient. Points are centres of the stylus ball, so radii hold the ball's radius: (3) needs it taken off
//! by `stylus_radius_mm`. Points lie all round: for that the least-squares shape must be determined.
//!
//! # Agreement
//! Second implementation: `val_iso230_10_sphere_scipy`, 25 points with three lobes and noise, below
//! 5e-12 mm. Closed form: `eq1_eq3_eq5_of_probing_by_hand`, three lobes on a ring, below 1e-14 mm.
//! No published example was at hand.
//!
//! # References
//! \[1\] ISO 230-10:2022; names from the literature, the text was not at hand.

use nalgebra::{DMatrix, DVector, SVector, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::budget::{DeviceUncertainty, Expansion, combined, drift_mm};
use super::extent::{
    check_finite, check_not_negative, check_points, check_positive, range, standard_deviation,
};
use super::{ExpandedLength, Iso230Error};
use metrology::fit::fit_round;

/// Usual number of touches of one surface, and of features measured for their location.
pub const REPETITIONS: usize = 10;
/// Usual number of points on a ring.
pub const RING_POINTS: usize = 36;
/// Usual number of points on a sphere.
pub const SPHERE_POINTS: usize = 25;

/// Whether a hole or a body is touched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// A ring from within: the ball's centre runs on a smaller radius.
    Inside,
    /// A sphere or plug from without: the ball's centre runs on a greater radius.
    Outside,
}

/// What is known of the ring or sphere that is touched.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Artefact {
    /// Calibrated diameter, mm.
    pub diameter_mm: f64,
    /// Calibration of the diameter.
    pub diameter_uncertainty: DeviceUncertainty,
    /// Departure from roundness or sphericity, mm.
    pub form_mm: f64,
    /// Standard uncertainty of that departure, mm.
    pub form_standard_uncertainty_mm: f64,
    /// Temperature and expansion of the artefact against the machine.
    pub expansion: Expansion,
    /// Radius of the stylus ball, mm; 0 where points are already on the surface.
    pub stylus_radius_mm: f64,
    /// Whether it is touched from within.
    pub side: Side,
}

/// Fewer or more readings than usual.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct UnusualNumber {
    /// Readings given.
    pub n: usize,
    /// What the standard asks.
    pub usual: usize,
}

/// One surface touched again and again.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SinglePointResult {
    /// Touches.
    pub n: usize,
    /// R, (1).
    pub repeatability: ExpandedLength,
    /// Standard deviation of one touch, mm.
    pub standard_deviation_mm: f64,
    /// Unlike the standard.
    pub unusual_number: Option<UnusualNumber>,
}

/// Form and size of a ring or a sphere.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FormResult {
    /// Points.
    pub n: usize,
    /// Least-squares centre, mm.
    pub centre_mm: Vec<f64>,
    /// P, (2).
    pub form_error: ExpandedLength,
    /// S, (3).
    pub size_error: ExpandedLength,
    /// Unlike the standard.
    pub unusual_number: Option<UnusualNumber>,
}

/// One feature measured again and again.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LocationResult {
    /// Features.
    pub n: usize,
    /// R of each coordinate, (4).
    pub repeatability: Vec<ExpandedLength>,
    /// Unlike the standard.
    pub unusual_number: Option<UnusualNumber>,
}

/// Single-point repeatability: touches of one surface along its normal, mm.
///
/// # Errors
/// Fewer than two touches, a number that is none, a negative drift.
pub fn single_point(
    touches_mm: &[f64],
    environmental_drift_mm: f64,
) -> Result<SinglePointResult, Iso230Error> {
    check_points("touches_mm", touches_mm.len(), 2)?;
    check_finite("touches_mm", 0, touches_mm)?;
    let u_mm = difference_mm(environmental_drift_mm)?;
    Ok(SinglePointResult {
        n: touches_mm.len(),
        repeatability: ExpandedLength::new(range(touches_mm.iter().copied()), u_mm),
        standard_deviation_mm: standard_deviation(touches_mm),
        unusual_number: unusual(touches_mm.len(), REPETITIONS),
    })
}

/// Two-dimensional probing error on a ring.
///
/// # Errors
/// Points that determine no circle, numbers that cannot be used.
pub fn ring(
    points_mm: &[Vector2<f64>],
    artefact: &Artefact,
    environmental_drift_mm: f64,
) -> Result<FormResult, Iso230Error> {
    form(points_mm, artefact, environmental_drift_mm, RING_POINTS)
}

/// Three-dimensional probing error on a sphere.
///
/// # Errors
/// Points that determine no sphere, numbers that cannot be used.
pub fn sphere(
    points_mm: &[Vector3<f64>],
    artefact: &Artefact,
    environmental_drift_mm: f64,
) -> Result<FormResult, Iso230Error> {
    form(points_mm, artefact, environmental_drift_mm, SPHERE_POINTS)
}

/// Location repeatability of centres (two or three coordinates), mm.
///
/// # Errors
/// Fewer than two centres, a number that is none, a negative drift.
pub fn location<const D: usize>(
    centres_mm: &[SVector<f64, D>],
    environmental_drift_mm: f64,
) -> Result<LocationResult, Iso230Error> {
    check_points("centres_mm", centres_mm.len(), 2)?;
    for (row, centre) in centres_mm.iter().enumerate() {
        check_finite("centres_mm", row, centre.as_slice())?;
    }
    let u_mm = difference_mm(environmental_drift_mm)?;
    let of = |axis: usize| range(centres_mm.iter().map(move |c| c[axis]));
    Ok(LocationResult {
        n: centres_mm.len(),
        repeatability: (0..D).map(|k| ExpandedLength::new(of(k), u_mm)).collect(),
        unusual_number: unusual(centres_mm.len(), REPETITIONS),
    })
}

fn form<const D: usize>(
    points_mm: &[SVector<f64, D>],
    artefact: &Artefact,
    environmental_drift_mm: f64,
    usual: usize,
) -> Result<FormResult, Iso230Error> {
    artefact.check()?;
    let difference_mm = difference_mm(environmental_drift_mm)?;
    let round = fit_round(points_mm, &vec![1.0; points_mm.len()])?;
    let ball_mm = match artefact.side {
        Side::Inside => artefact.stylus_radius_mm,
        Side::Outside => -artefact.stylus_radius_mm,
    };
    let size_mm = 2.0 * (round.radius_mm + ball_mm) - artefact.diameter_mm; // (3)
    let n = points_mm.len() as f64;
    let left = (1.0 - (D as f64 + 1.0) / n).max(0.0);
    let of_form_mm = artefact
        .form_mm
        .hypot(artefact.form_standard_uncertainty_mm);
    let u_form_mm = (left.sqrt() * difference_mm).hypot(of_form_mm / 6.0_f64.sqrt());
    let u_drift_mm = drift_mm(environmental_drift_mm);
    let q = radius_variance(points_mm, &round.centre_mm).unwrap_or(1.0);
    let u_size_mm = combined(&[
        artefact
            .diameter_uncertainty
            .standard_mm(artefact.diameter_mm),
        artefact.expansion.standard_mm(artefact.diameter_mm),
        2.0 * q.sqrt() * u_drift_mm,
    ]);
    Ok(FormResult {
        n: points_mm.len(),
        centre_mm: round.centre_mm.iter().copied().collect(),
        form_error: ExpandedLength::new(round.form_mm, u_form_mm),
        size_error: ExpandedLength::new(size_mm, u_size_mm),
        unusual_number: unusual(points_mm.len(), usual),
    })
}

/// q of (6), of points about their centre; `None` where they do not determine it.
fn radius_variance<const D: usize>(
    points_mm: &[SVector<f64, D>],
    centre_mm: &SVector<f64, D>,
) -> Option<f64> {
    let mut normal = DMatrix::<f64>::zeros(D + 1, D + 1);
    for point in points_mm {
        let apart_mm = point - centre_mm;
        let direction = apart_mm / apart_mm.norm();
        let row = DVector::from_fn(D + 1, |i, _| if i < D { direction[i] } else { 1.0 });
        normal += &row * row.transpose();
    }
    let q = normal.try_inverse()?[(D, D)];
    q.is_finite().then_some(q)
}

impl Artefact {
    fn check(&self) -> Result<(), Iso230Error> {
        check_positive("artefact.diameter_mm", self.diameter_mm)?;
        self.diameter_uncertainty.check()?;
        check_not_negative("artefact.form_mm", self.form_mm)?;
        check_not_negative(
            "artefact.form_standard_uncertainty_mm",
            self.form_standard_uncertainty_mm,
        )?;
        self.expansion.check()?;
        check_not_negative("artefact.stylus_radius_mm", self.stylus_radius_mm)
    }
}

/// Standard uncertainty of the difference of two touches by drift, mm.
fn difference_mm(environmental_drift_mm: f64) -> Result<f64, Iso230Error> {
    check_not_negative("environmental_drift_mm", environmental_drift_mm)?;
    Ok(2.0_f64.sqrt() * drift_mm(environmental_drift_mm))
}

fn unusual(n: usize, usual: usize) -> Option<UnusualNumber> {
    (n != usual).then_some(UnusualNumber { n, usual })
}
