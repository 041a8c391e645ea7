//! Brings faces that were touched one after another to one instant.
//!
//! A cycle takes minutes in which the machine goes on drifting. Each face's drift is moved along the
//! line through its previous and its present value to the instant of the latest touch:
//!
//! ```text
//!   d(t_c) = d + f (d − d_prev),   f = (t_c − t) / (t − t_prev)                  (1)
//!   u²(d(t_c)) = u_cold² + (1 + f)² u_hot² + f² u_hot,prev²                      (2)
//! ```
//!
//! # Holds when
//! f is well below 1, that is the cycle is short against the update period; above [`SHARE_LIMIT`]
//! the face is left as touched, with the instant at which it was. The cold touch is common to both values and cancels in their
//! difference, hence its plain share in (2).

use crate::reference::FaceDrift;

/// Greatest f of (1).
pub const SHARE_LIMIT: f64 = 0.5;

/// Moves `faces` to the instant of the latest touch, by their previous values where they have one.
pub fn to_latest(faces: &mut [FaceDrift], previous: &[FaceDrift]) {
    let Some(common_at) = faces.iter().map(|f| f.at).max() else {
        return;
    };
    for face in faces {
        let before = previous.iter().find(|p| p.same_face(face));
        let share = before.map_or(0.0, |before| {
            let base_s = (face.at - before.at).as_secs_f64();
            if base_s > 0.0 {
                (common_at - face.at).as_secs_f64() / base_s
            } else {
                f64::INFINITY
            }
        });
        if let (Some(before), true) = (before, share <= SHARE_LIMIT) {
            let cold2 = face.standard_uncertainty_mm.powi(2) - face.hot_uncertainty_mm.powi(2);
            let (latency, left_mm2) = face.latency.moved_on(&before.latency, share);
            let hot2 = ((1.0 + share) * face.hot_uncertainty_mm).powi(2)
                + (share * before.hot_uncertainty_mm).powi(2)
                + left_mm2;
            face.drift_mm += share * (face.drift_mm - before.drift_mm);
            face.hot_uncertainty_mm = hot2.sqrt();
            face.standard_uncertainty_mm = (cold2.max(0.0) + hot2).sqrt();
            face.latency = latency;
            face.at = common_at;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::latency_share::LatencyShares;
    use metrology::{Axis, Stamp};
    use nalgebra::Vector3;

    fn face(block: usize, at_s: f64, drift_mm: f64) -> FaceDrift {
        FaceDrift {
            block,
            axis: Axis::X,
            point_mm: Vector3::zeros(),
            drift_mm,
            standard_uncertainty_mm: 5e-4,
            hot_uncertainty_mm: 3e-4,
            latency: LatencyShares::default(),
            at: Stamp::from_nanos((at_s * 1e9) as i64),
        }
    }

    #[test]
    fn eq1_blocks_touched_five_minutes_apart_agree_on_a_steady_drift() {
        let drift_mm = |t_s: f64| 1e-5 * t_s;
        let previous = [face(0, 0.0, drift_mm(0.0)), face(1, 300.0, drift_mm(300.0))];
        let mut now = [
            face(0, 900.0, drift_mm(900.0)),
            face(1, 1200.0, drift_mm(1200.0)),
        ];
        to_latest(&mut now, &previous);
        assert!((now[0].drift_mm - drift_mm(1200.0)).abs() < 1e-12);
        assert_eq!(now[0].at, now[1].at);
        let hot = 3e-4 * (4.0_f64 / 3.0).hypot(1.0 / 3.0);
        assert!((now[0].hot_uncertainty_mm - hot).abs() < 1e-12);
        assert!((now[0].standard_uncertainty_mm - hot.hypot(4e-4)).abs() < 1e-12);
        assert!((now[1].standard_uncertainty_mm - 5e-4).abs() < 1e-12);
    }

    #[test]
    fn a_cycle_as_long_as_the_period_is_left_as_touched() {
        let previous = [face(0, 0.0, 0.0)];
        let mut now = [face(0, 600.0, 0.006), face(1, 1200.0, 0.012)];
        to_latest(&mut now, &previous);
        assert!((now[0].drift_mm - 0.006).abs() < 1e-15);
        // Nor does it claim to be of a later instant than it is.
        assert_eq!(now[0].at, face(0, 600.0, 0.0).at);
    }
}
