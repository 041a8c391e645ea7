//! The part of the faces' errors that they share: the latency that was taken out of their touches.
//!
//! # Model
//!
//! A touch along n at feed f, corrected by the latency T, is wrong by −n f δT where T is wrong by δT.
//! With s = −n f (mm/s) of the mean touch of a face, the drift, hot minus cold, is wrong by
//!
//! ```text
//!   δd = s_hot δT_hot − s_cold δT_cold                                            (1)
//!   T_hot = T_cold:   δd = (s_hot − s_cold) δT                                    (2)
//!   cov(d_f, d_g) = Σ_T s_fT s_gT u²(T)                                           (3)
//! ```
//!
//! With one latency for both, equal feeds cancel it. After a new calibration it does not cancel: every
//! face is wrong by f times the error of both latencies, with the sign of its approach, so that blocks
//! touched from opposite sides look farther apart. Two latencies are the same where value and
//! uncertainty are; different ones were calibrated independently.
//!
//! # Agreement
//! `eq3_blocks_touched_from_opposite_sides_look_farther_apart` in `two_block`.

use metrology::sample::LatencyShare;

use crate::reference::FaceDrift;

/// How a drift depends on the latencies behind it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LatencyShares([LatencyShare; 2]);

/// Whether both name the same latency.
#[must_use]
pub fn is_same(one: &LatencyShare, other: &LatencyShare) -> bool {
    one.latency_s.to_bits() == other.latency_s.to_bits()
        && one.standard_uncertainty_s.to_bits() == other.standard_uncertainty_s.to_bits()
}

impl LatencyShares {
    /// Of a hot reading minus a cold one: (1), (2).
    #[must_use]
    pub fn of_difference(hot: &LatencyShare, cold: &LatencyShare) -> Self {
        let cold = LatencyShare {
            sensitivity_mm_s: -cold.sensitivity_mm_s,
            ..*cold
        };
        if is_same(hot, &cold) {
            let sensitivity_mm_s = hot.sensitivity_mm_s + cold.sensitivity_mm_s;
            let both = LatencyShare {
                sensitivity_mm_s,
                ..*hot
            };
            return Self([both, LatencyShare::default()]);
        }
        Self([*hot, cold])
    }

    /// s of one latency, mm/s.
    #[must_use]
    pub fn sensitivity_mm_s(&self, latency: &LatencyShare) -> f64 {
        let own = self.0.iter().filter(|share| is_same(share, latency));
        own.map(|share| share.sensitivity_mm_s).sum()
    }

    /// Variance of one drift, mm².
    #[must_use]
    pub fn variance_mm2(&self) -> f64 {
        let squares = self.0.iter().map(|s| s.standard_uncertainty_mm().powi(2));
        squares.sum()
    }

    /// Of (1 + f) this drift − f the previous one; with it the variance (mm²) that latencies of the
    /// previous drift alone leave.
    #[must_use]
    pub fn moved_on(&self, previous: &Self, share: f64) -> (Self, f64) {
        let moved = self.0.map(|own| LatencyShare {
            sensitivity_mm_s: (1.0 + share) * own.sensitivity_mm_s
                - share * previous.sensitivity_mm_s(&own),
            ..own
        });
        let foreign = previous
            .0
            .iter()
            .filter(|old| !self.0.iter().any(|own| is_same(own, old)));
        let left_mm2 = foreign
            .map(|old| (share * old.standard_uncertainty_mm()).powi(2))
            .sum();
        (Self(moved), left_mm2)
    }
}

/// The uncertain latencies behind any of `faces`, each once.
#[must_use]
pub fn latencies<'a>(faces: impl IntoIterator<Item = &'a FaceDrift>) -> Vec<LatencyShare> {
    let mut found: Vec<LatencyShare> = Vec::new();
    for share in faces.into_iter().flat_map(|face| face.latency.0) {
        let is_new = !found.iter().any(|known| is_same(known, &share));
        if share.standard_uncertainty_s > 0.0 && is_new {
            found.push(share);
        }
    }
    found
}

/// Variance of the difference of two drifts that their latencies leave, mm².
#[must_use]
pub fn difference_variance_mm2(one: &FaceDrift, other: &FaceDrift) -> f64 {
    let left = |latency: &LatencyShare| {
        let sensitivity_mm_s =
            one.latency.sensitivity_mm_s(latency) - other.latency.sensitivity_mm_s(latency);
        (sensitivity_mm_s * latency.standard_uncertainty_s).powi(2)
    };
    latencies([one, other]).iter().map(left).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share(latency_s: f64, sensitivity_mm_s: f64) -> LatencyShare {
        LatencyShare {
            latency_s,
            standard_uncertainty_s: 25e-6,
            sensitivity_mm_s,
        }
    }

    #[test]
    fn eq2_one_latency_cancels_at_equal_feeds_and_eq1_two_do_not() {
        let cold = share(0.008, -2.0);
        let same = LatencyShares::of_difference(&share(0.008, -2.0), &cold);
        assert!(same.variance_mm2() == 0.0);
        let faster = LatencyShares::of_difference(&share(0.008, -5.0), &cold);
        assert!((faster.variance_mm2().sqrt() - 3.0 * 25e-6).abs() < 1e-12);
        let other = LatencyShares::of_difference(&share(0.009, -2.0), &cold);
        assert!((other.variance_mm2().sqrt() - 2.0 * 25e-6 * 2_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn moving_on_by_a_previous_drift_keeps_what_both_share() {
        let cold = share(0.008, -2.0);
        let now = LatencyShares::of_difference(&share(0.009, -2.0), &cold);
        let (same, left_mm2) = now.moved_on(&now, 0.3);
        assert!((same.variance_mm2() - now.variance_mm2()).abs() < 1e-20 && left_mm2 == 0.0);
        let before = LatencyShares::of_difference(&cold, &cold);
        let (moved, left_mm2) = now.moved_on(&before, 0.5);
        assert!((moved.sensitivity_mm_s(&share(0.009, 0.0)) + 3.0).abs() < 1e-12);
        assert!(left_mm2 == 0.0);
    }
}
