//! A model held against a sphere at other poses than those it was made from.
//!
//! ```text
//!   before: c_k - p_k(w1),          w1: the place that suits these visits best          (1)
//!   after:  c_k - [p_k(w) + X_k b], w: the place of the calibration                     (2)
//! ```
//!
//! (1) is what is left of a machine without compensation after a workpiece datum was taken there; (2)
//! what the model does not explain. Both are in the motors' readings, in which a sphere is found at
//! the same place whether a compensation acts or not. Where the sphere was not part of the
//! calibration, or was set up anew, its place is fitted in (2) too. `expectation` says what (2) may be, and why it is
//! more where it is.

use machine::SphereDesign;
use nalgebra::{Matrix3, Vector3};

use crate::allowance::Known;
use crate::error::EstimateError;
use crate::estimate::{RotaryEstimate, prediction_covariance_mm2};
use crate::expectation::{Held, Judged, judge};
use crate::fit::fit;
use crate::visit::SphereVisit;

/// One visit, before and after.
#[derive(Clone, Debug, PartialEq)]
pub struct VerifiedVisit {
    /// The visit.
    pub visit: SphereVisit,
    /// (1), machine frame, mm.
    pub before_mm: Vector3<f64>,
    /// (2), machine frame, mm.
    pub after_mm: Vector3<f64>,
    /// Standard uncertainty of (2) in all three directions together from the stated noise alone, mm.
    pub standard_uncertainty_mm: f64,
}

/// A verification.
#[derive(Clone, Debug, PartialEq)]
pub struct Verification {
    /// Every visit.
    pub visits: Vec<VerifiedVisit>,
    /// Root mean square of the size of (1), mm.
    pub rms_before_mm: f64,
    /// Root mean square of the size of (2), mm.
    pub rms_after_mm: f64,
    /// Greatest size of (2), mm.
    pub greatest_after_mm: f64,
    /// Root mean square of the standard uncertainty of (2), mm: what the stated noise alone would leave.
    pub expected_mm: f64,
    /// The same with the scatter that repeats showed and the allowances, mm.
    pub allowed_mm: f64,
    /// (2) against that.
    pub judged: Judged,
    /// Whether the spheres' places are those of the calibration.
    pub same_places: bool,
}

/// Verifies an estimate; `same_setup`: the spheres stand where they stood during the calibration; `known` is what the
/// estimate was made with.
///
/// # Errors
/// When a visit cannot be used.
pub fn verify(
    design: &SphereDesign,
    found: &RotaryEstimate,
    known: Known<'_>,
    visits: &[SphereVisit],
    spheres: &[(String, Vector3<f64>)],
    same_setup: bool,
) -> Result<Verification, EstimateError> {
    let nominal = places(design, visits, spheres, |visit, _| visit.clone())?;
    let calibrated = |name: &str| found.spheres.iter().find(|(known, _)| known == name);
    let same_places = same_setup && spheres.iter().all(|(name, _)| calibrated(name).is_some());
    let modelled = if same_places {
        let kept = spheres
            .iter()
            .filter_map(|(name, _)| calibrated(name).cloned());
        kept.collect()
    } else {
        // What the model adds is taken off the readings; the rest is a nominal machine.
        places(design, visits, spheres, |visit, place| {
            let nominal_mm = design.row(place, &visit.pose_rad).centre_mm + visit.known_mm;
            let mut corrected = visit.clone();
            corrected.centre_mm -= found.predicted_mm(design, place, visit) - nominal_mm;
            corrected
        })?
    };
    let verified = visits.iter().filter_map(|visit| {
        let of = |places: &[(String, Vector3<f64>)]| {
            let found = places.iter().find(|(name, _)| *name == visit.sphere);
            found.map(|(_, place)| *place)
        };
        let nominal_mm = design.row(&of(&nominal)?, &visit.pose_rad).centre_mm + visit.known_mm;
        let predicted = if same_places {
            prediction_covariance_mm2(design, found, visit)
        } else {
            None
        };
        let variance = visit.covariance_mm2 + predicted.unwrap_or_else(Matrix3::zeros);
        Some(VerifiedVisit {
            before_mm: visit.centre_mm - nominal_mm,
            after_mm: visit.centre_mm - found.predicted_mm(design, &of(&modelled)?, visit),
            standard_uncertainty_mm: variance.trace().sqrt(),
            visit: visit.clone(),
        })
    });
    let visits: Vec<VerifiedVisit> = verified.collect();
    let left_mm: Vec<Vector3<f64>> = visits.iter().map(|v| v.after_mm).collect();
    let of_all: Vec<SphereVisit> = visits.iter().map(|v| v.visit.clone()).collect();
    let held = Held {
        visits: &of_all,
        spheres: &modelled,
        same_places,
        left_mm: &left_mm,
    };
    let judged = judge(design, found, known, &held)?;
    let allowed = judged.standard_uncertainty_mm.iter().map(|u| u * u);
    let allowed_mm = (allowed.sum::<f64>() / visits.len() as f64).sqrt();
    let rms = |size: &dyn Fn(&VerifiedVisit) -> f64| {
        (visits.iter().map(|v| size(v).powi(2)).sum::<f64>() / visits.len() as f64).sqrt()
    };
    Ok(Verification {
        rms_before_mm: rms(&|v| v.before_mm.norm()),
        rms_after_mm: rms(&|v| v.after_mm.norm()),
        greatest_after_mm: visits.iter().map(|v| v.after_mm.norm()).fold(0.0, f64::max),
        expected_mm: rms(&|v| v.standard_uncertainty_mm),
        allowed_mm,
        judged,
        same_places,
        visits,
    })
}

/// Places that suit the visits best on a nominal machine, after a change to each.
fn places(
    design: &SphereDesign,
    visits: &[SphereVisit],
    spheres: &[(String, Vector3<f64>)],
    change: impl Fn(&SphereVisit, &Vector3<f64>) -> SphereVisit,
) -> Result<Vec<(String, Vector3<f64>)>, EstimateError> {
    let changed: Vec<SphereVisit> = visits
        .iter()
        .map(|visit| {
            let place = spheres.iter().find(|(name, _)| *name == visit.sphere);
            place.map_or_else(|| visit.clone(), |(_, place)| change(visit, place))
        })
        .collect();
    let mut places = spheres.to_vec();
    // A nominal machine moves the centre rigidly with the place: one step is exact.
    let steps = fit(design, &changed, &places, &[])?.place_steps_mm;
    for ((_, place), step) in places.iter_mut().zip(steps) {
        *place += step;
    }
    Ok(places)
}
