//! What the plate's certificate leaves open: its length and its right angle, which no recording can tell.
//!
//! # Model
//!
//! ```text
//!   reading = true + ε w + κ/2 (w_v, w_u)                                                (1)
//!   β moves by X⁺ y_ε ε + X⁺ y_κ κ,   y_ε, y_κ the right-hand sides of (1) for ε, κ = 1  (2)
//!   cov(β) += u²(ε) X⁺y_ε (X⁺y_ε)ᵀ + u²(κ) X⁺y_κ (X⁺y_κ)ᵀ                                (3)
//! ```
//!
//! A plate that is too long makes every axis too long by the same share: the three positioning errors are wrong together,
//! and their differences are not. (3) says so by its covariances.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | w | reading, along u and v | mm |
//! | ε, u(ε) | `scale`, standard uncertainty | 1 |
//! | κ, u(κ) | `squareness_rad`, standard uncertainty | rad |
//!
//! # Holds when
//! Linear terms of positioning errors and squareness are among the unknowns: then (2) is exact for any weights, with disturbances
//! taken out or not. One plate was used for all recordings.
//!
//! # Agreement
//! `val_a_plate_that_is_too_long_is_held_by_the_interval`: an estimate from the readings of a stretched plate moves by what (2) says, within 1e-6 mm.
//! `intervals_hold_the_truth_for_plates_of_the_certificate`: 95.3 % of 5,100, 86.9 % without (3).
//!
//! # References
//! \[1\] JCGM 100:2008 (GUM), 5.2.2 and F.1.2.3: what several quantities have in common correlates them.

use nalgebra::{DMatrix, DVector};

use super::solved::{Weighting, for_each_row};
use crate::equations::Equations;

/// What one error of the plate, of size 1, makes of a reading, mm.
type Change = fn([f64; 2]) -> [f64; 2];

/// Standard uncertainties of the plate as a whole.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlateCertificate {
    /// Of its length, per length.
    pub scale: f64,
    /// Of the angle between its u and v, rad.
    pub squareness_rad: f64,
}

impl PlateCertificate {
    /// A plate without errors as a whole.
    pub const EXACT: Self = Self {
        scale: 0.0,
        squareness_rad: 0.0,
    };

    /// Adds (3), in units of the span. `whitener` leads from the orthonormal basis of what is seen to the unknowns.
    pub(super) fn widen(
        &self,
        equations: &Equations,
        weighting: &Weighting,
        whitener: &DMatrix<f64>,
        covariance: &mut DMatrix<f64>,
    ) {
        let whole: [(f64, Change); 2] = [
            (self.scale, |w| w),
            (self.squareness_rad, |[u, v]| [0.5 * v, 0.5 * u]),
        ];
        for (standard_uncertainty, change) in whole {
            if standard_uncertainty > 0.0 {
                let moved = moved(equations, weighting, whitener, change) * standard_uncertainty;
                *covariance += &moved * moved.transpose();
            }
        }
    }
}

/// (2) for a unit of one error of the plate.
fn moved(
    equations: &Equations,
    weighting: &Weighting,
    whitener: &DMatrix<f64>,
    change: Change,
) -> DVector<f64> {
    let mut with_x = DVector::zeros(equations.scale.len());
    for_each_row(equations, |place, row, _, u| {
        let (recording, point, k) = place;
        let reading_mm = equations.recordings[recording].points[point].reading_mm;
        let right_mm = equations.right_side_of(recording, point, change(reading_mm));
        let share = weighting.of(place) / (u * u) * right_mm[k];
        for (sum, entry) in with_x.iter_mut().zip(row) {
            *sum += share * entry;
        }
    });
    whitener * whitener.tr_mul(&with_x)
}
