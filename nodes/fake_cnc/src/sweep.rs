//! The circular part of an arc: angles, radii and how far it reaches.
//!
//! ```text
//!   (a, b)(u) = c + r(u) (cos φ(u), sin φ(u)),  φ = φ₀ + u Δφ,  r = r₀ + u Δr,  0 ≤ u ≤ 1     (1)
//! ```
//!
//! Δr is zero but for an arc whose end does not lie on the circle of its start within rounding; such
//! an arc is accepted up to the limits of `rs274::arc` and then is this spiral, so that it ends
//! exactly where the program says.

use std::f64::consts::{FRAC_PI_2, TAU};

use crate::rs274::program::Arc;

/// Angle below which an arc counts as a full circle, rad.
const FULL_CIRCLE_RAD: f64 = 1e-9;

/// The circular part of an arc, from its start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Centre from the start, mm.
    pub centre_mm: [f64; 2],
    /// Radius at the start, mm.
    pub radius_mm: f64,
    /// Radius at the end minus radius at the start, mm.
    pub widening_mm: f64,
    /// Angle of the start seen from the centre, rad.
    pub from_rad: f64,
    /// Angle swept, counter-clockwise positive, rad.
    pub swept_rad: f64,
}

impl Sweep {
    /// The sweep of `arc`, whose end lies at `end_mm` from its start.
    #[must_use]
    pub fn new(arc: &Arc, end_mm: [f64; 2]) -> Self {
        let centre_mm = arc.centre_from_start_mm;
        let end_from_centre = [end_mm[0] - centre_mm[0], end_mm[1] - centre_mm[1]];
        let from_rad = (-centre_mm[1]).atan2(-centre_mm[0]);
        let to_rad = end_from_centre[1].atan2(end_from_centre[0]);
        let more_turns = f64::from(arc.turns - 1) * TAU;
        let mut swept_rad = (to_rad - from_rad).rem_euclid(TAU);
        if !(FULL_CIRCLE_RAD..=TAU - FULL_CIRCLE_RAD).contains(&swept_rad) {
            swept_rad = 0.0;
        }
        // Counter-clockwise sweeps lie in (0, 2π], clockwise ones in [-2π, 0).
        swept_rad = match (arc.clockwise, swept_rad > 0.0) {
            (false, true) => swept_rad + more_turns,
            (false, false) => TAU + more_turns,
            (true, _) => swept_rad - TAU - more_turns,
        };
        let radius_mm = centre_mm[0].hypot(centre_mm[1]);
        Self {
            centre_mm,
            radius_mm,
            widening_mm: end_from_centre[0].hypot(end_from_centre[1]) - radius_mm,
            from_rad,
            swept_rad,
        }
    }

    /// The larger of its radii, mm.
    #[must_use]
    pub fn greatest_radius_mm(&self) -> f64 {
        self.radius_mm.max(self.radius_mm + self.widening_mm)
    }

    /// Point (1) at the share `u` of the way, from the start, mm.
    #[must_use]
    pub fn point(&self, u: f64) -> [f64; 2] {
        let (sin, cos) = (self.from_rad + u * self.swept_rad).sin_cos();
        let radius = self.radius_mm + u * self.widening_mm;
        [
            self.centre_mm[0] + radius * cos,
            self.centre_mm[1] + radius * sin,
        ]
    }

    /// Least and greatest coordinate that it reaches, from its start, mm.
    #[must_use]
    pub fn extremes_from_start(&self) -> [[f64; 2]; 2] {
        let mut reach = [[0.0_f64; 2]; 2];
        let mut include = |point: [f64; 2]| {
            for (range, value) in reach.iter_mut().zip(point) {
                range[0] = range[0].min(value);
                range[1] = range[1].max(value);
            }
        };
        include(self.point(1.0));
        let (low, high) = if self.swept_rad > 0.0 {
            (self.from_rad, self.from_rad + self.swept_rad)
        } else {
            (self.from_rad + self.swept_rad, self.from_rad)
        };
        let first = (low / FRAC_PI_2).ceil();
        for quarter in 0..4 {
            let angle = (first + f64::from(quarter)) * FRAC_PI_2;
            if angle <= high {
                let radius = self.greatest_radius_mm();
                let (sin, cos) = angle.sin_cos();
                include([
                    self.centre_mm[0] + radius * cos,
                    self.centre_mm[1] + radius * sin,
                ]);
            }
        }
        reach
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rs274::program::Plane;

    fn arc(clockwise: bool, centre: [f64; 2], turns: u32) -> Arc {
        Arc {
            plane: Plane::Xy,
            clockwise,
            centre_from_start_mm: centre,
            turns,
            turn: None,
        }
    }

    #[test]
    fn full_circle_sweeps_a_turn_in_its_sense() {
        let sweep = |clockwise, turns| Sweep::new(&arc(clockwise, [5.0, 0.0], turns), [0.0, 0.0]);
        assert!((sweep(false, 1).swept_rad - TAU).abs() < 1e-12);
        assert!((sweep(true, 1).swept_rad + TAU).abs() < 1e-12);
        assert!((sweep(true, 3).swept_rad + 3.0 * TAU).abs() < 1e-12);
    }

    #[test]
    fn half_circles_reach_to_their_own_side() {
        // From (0, 0) about (5, 0) to (10, 0): clockwise goes over the top.
        let up = Sweep::new(&arc(true, [5.0, 0.0], 1), [10.0, 0.0]).extremes_from_start();
        assert!((up[1][1] - 5.0).abs() < 1e-12 && up[1][0].abs() < 1e-12);
        let down = Sweep::new(&arc(false, [5.0, 0.0], 1), [10.0, 0.0]).extremes_from_start();
        assert!((down[1][0] + 5.0).abs() < 1e-12 && down[1][1].abs() < 1e-12);
    }

    #[test]
    fn eq1_extremes_hold_every_point_of_many_arcs() {
        for step in 1..200 {
            let angle = f64::from(step) * 0.37;
            let end = [4.0 + 4.0 * angle.cos(), 4.0 * angle.sin()];
            for clockwise in [false, true] {
                let sweep = Sweep::new(&arc(clockwise, [4.0, 0.0], 1), end);
                let [a, b] = sweep.extremes_from_start();
                for share in 0..=1000 {
                    let point = sweep.point(f64::from(share) / 1000.0);
                    assert!(point[0] >= a[0] - 1e-9 && point[0] <= a[1] + 1e-9);
                    assert!(point[1] >= b[0] - 1e-9 && point[1] <= b[1] + 1e-9);
                }
                assert!((sweep.point(1.0)[0] - end[0]).abs() < 1e-12);
                assert!((sweep.point(1.0)[1] - end[1]).abs() < 1e-12);
            }
        }
    }
}
