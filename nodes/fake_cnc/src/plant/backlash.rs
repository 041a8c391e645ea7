//! Soft two-sided backlash: a spring with a smooth dead zone, its flanks unequally stiff.
//!
//! ```text
//!   r(x) = (x + sqrt(x^2 + eps^2)) / 2                                 (1)  smooth ramp
//!   F(d) = k_up r(d - b/2) - k_down r(-d - b/2)                        (2)
//! ```
//!
//! `d` is how far the motor side is ahead of the slide. Far outside the gap (2) is a linear spring
//! that begins at half the width; inside it only the ramp's tail remains.

/// The elastic path from motor to slide; stiffnesses over total inertia, 1/s².
#[derive(Clone, Copy, Debug)]
pub(super) struct SoftBacklash {
    pub(super) half_width: f64,
    pub(super) softness: f64,
    pub(super) stiffness_up: f64,
    pub(super) stiffness_down: f64,
}

impl SoftBacklash {
    /// Force on the slide, and the stiffness that is engaged, at lead `d` of the motor side.
    pub(super) fn force_and_stiffness(&self, d: f64) -> (f64, f64) {
        let (up, up_slope) = self.ramp(d - self.half_width);
        let (down, down_slope) = self.ramp(-d - self.half_width);
        (
            self.stiffness_up * up - self.stiffness_down * down, // (2)
            self.stiffness_up * up_slope + self.stiffness_down * down_slope,
        )
    }

    fn ramp(&self, x: f64) -> (f64, f64) {
        let root = (x * x + self.softness * self.softness).sqrt();
        (0.5 * (x + root), 0.5 * (1.0 + x / root)) // (1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPRING: SoftBacklash = SoftBacklash {
        half_width: 1.5e-3,
        softness: 2e-4,
        stiffness_up: 2e5,
        stiffness_down: 1e5,
    };

    #[test]
    fn eq2_flanks_are_linear_springs_that_begin_at_half_the_width() {
        let (up, slope) = SPRING.force_and_stiffness(0.02);
        assert!((up / (2e5 * (0.02 - 1.5e-3)) - 1.0).abs() < 1e-3);
        assert!((slope / 2e5 - 1.0).abs() < 1e-3);
        let (down, _) = SPRING.force_and_stiffness(-0.02);
        assert!((down / (-1e5 * (0.02 - 1.5e-3)) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn eq2_the_gap_carries_next_to_nothing() {
        let (middle, slope) = SPRING.force_and_stiffness(0.0);
        assert!(middle.abs() < 2.0, "{middle}");
        assert!(slope < 0.02 * 2e5);
    }

    #[test]
    fn eq1_slope_is_the_derivative_of_the_force() {
        for d in [-4e-3, -1.6e-3, 0.0, 1.2e-3, 1.5e-3, 3e-3] {
            let step = 1e-8;
            let (ahead, _) = SPRING.force_and_stiffness(d + step);
            let (behind, _) = SPRING.force_and_stiffness(d - step);
            let (_, slope) = SPRING.force_and_stiffness(d);
            assert!(((ahead - behind) / (2.0 * step) - slope).abs() < 1.0);
        }
    }
}
