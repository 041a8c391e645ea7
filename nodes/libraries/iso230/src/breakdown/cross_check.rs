//! Figures that need no fit: circularity, squareness of four points, diameters beside the reversals.
//!
//! # Model
//!
//! With ρ the deviation about the least-squares centre, read within 1.5° of an angle:
//!
//! ```text
//!   squareness = −s (ρ45 + ρ225 − ρ135 − ρ315)/(2 R)                          (1)
//!   diameter 1 = (ρ5 + ρ355 + ρ175 + ρ185)/2                                  (2)
//!   diameter 2 = (ρ85 + ρ95 + ρ265 + ρ275)/2                                  (3)
//! ```
//!
//! (1) is the difference of the diameters at 45° and 135° over the nominal diameter \[1\], as the component of ISO 230-1:
//! s is its sign in the enclosed angle ([`metrology::squareness`]). On one sense
//! it holds servo mismatch and backlash as well; the mean over both senses does not. 5° off the reversals,
//! backlash steps and spikes have passed.
//!
//! # References
//! \[1\] MTS Northwest, "Analyzing your results", ball bar inspection, rows Axes Squareness and Diameter Deviation.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::contribution::{circularity_mm, one_turn};
use super::scene::{Scene, Trace};
use super::squareness::sign;
use metrology::Axis;

/// Samples nearer than this to an angle stand for it, rad (1.5°).
const WINDOW_RAD: f64 = 0.026_179_938_779_914_94;

/// Robust figures of one recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CrossCheck {
    /// Place in the caller's list.
    pub recording: usize,
    /// Greatest minus least deviation about the least-squares centre, mm.
    pub circularity_mm: f64,
    /// Mean radius minus nominal, mm; none where the reference is not calibrated.
    pub mean_radial_deviation_mm: Option<f64>,
    /// (1), rad; holds servo mismatch and backlash as they are in this sense.
    pub four_point_squareness_rad: Option<f64>,
    /// (2) and (3), mm; none where the reference is not calibrated.
    pub diameter_deviation_mm: [Option<f64>; 2],
    /// (2) − (3), mm.
    pub diameter_difference_mm: Option<f64>,
}

/// One recording; `deviations_mm` are about the fitted centre, of free references also about their length.
pub(super) fn cross_check(
    trace: &Trace,
    deviations_mm: &DVector<f64>,
    weights: &[f64],
    axes: [Axis; 2],
) -> CrossCheck {
    let sign = sign(axes);
    let turn = one_turn(trace, weights);
    let at = |degrees: f64| {
        let near = |row: &&usize| {
            let off = trace.points[**row - trace.first_row].angle_rad - degrees.to_radians();
            let (sin, cos) = off.sin_cos();
            sin.atan2(cos).abs() <= WINDOW_RAD
        };
        let found: Vec<f64> = turn
            .iter()
            .filter(near)
            .map(|row| deviations_mm[*row])
            .collect();
        (!found.is_empty()).then(|| found.iter().sum::<f64>() / found.len() as f64)
    };
    let sum = |angles: [f64; 4], signs: [f64; 4]| {
        angles
            .into_iter()
            .zip(signs)
            .map(|(angle, sign)| at(angle).map(|d| sign * d))
            .sum::<Option<f64>>()
    };
    let across = sum([45.0, 225.0, 135.0, 315.0], [1.0, 1.0, -1.0, -1.0]);
    let diameters = [[5.0, 355.0, 175.0, 185.0], [85.0, 95.0, 265.0, 275.0]]
        .map(|angles| sum(angles, [1.0; 4]).map(|four| 0.5 * four));
    let calibrated = trace.reference.is_none();
    let mean = turn.iter().map(|row| deviations_mm[*row]).sum::<f64>() / turn.len().max(1) as f64;
    CrossCheck {
        recording: trace.recording,
        circularity_mm: circularity_mm(trace, deviations_mm, weights),
        mean_radial_deviation_mm: calibrated.then_some(mean),
        four_point_squareness_rad: across.map(|four| -sign * four / (2.0 * trace.radius_mm)),
        diameter_deviation_mm: diameters.map(|d| d.filter(|_| calibrated)),
        diameter_difference_mm: diameters[0].zip(diameters[1]).map(|(a, b)| a - b),
    }
}

/// Mean of (1) over both senses, each sense the mean of its recordings.
pub(super) fn squareness_rad(scene: &Scene, checks: &[CrossCheck]) -> Option<f64> {
    let of_sense = |sense: f64| {
        let own = scene
            .traces
            .iter()
            .zip(checks)
            .filter(|(t, _)| t.sense * sense > 0.0);
        let values: Option<Vec<f64>> = own.map(|(_, c)| c.four_point_squareness_rad).collect();
        values
            .filter(|v| !v.is_empty())
            .map(|v| v.iter().sum::<f64>() / v.len() as f64)
    };
    of_sense(1.0)
        .zip(of_sense(-1.0))
        .map(|(a, b)| 0.5 * (a + b))
}
