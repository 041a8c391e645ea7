//! Pretravel of a kinematic three-contact probe: how far the stylus bends before a contact opens.
//!
//! ```text
//!   rho(phi) = min over edges i with cos(phi - psi_i) > 0 of (r/2) / cos(phi - psi_i)         (1)
//!   F = s (1 + g v) F_s rho / (f_lat L + f_ax rho)                                            (2)
//!   p = F (f_lat^2 L^3/(3 E I) + f_ax^2 L/(E S))                                              (3)
//! ```
//!
//! A spring `F_s` seats the stylus carrier on three supports on a circle of radius `r`. A force `F` on
//! the ball in the direction `f` (lateral part `f_lat` at angle `phi`, upward part `f_ax`) lifts the
//! carrier when the resultant leaves the triangle of supports; (1) is the triangle's border, between
//! `r/2` over an edge and `r` over a support. The electrical contact opens at a share `s` of that
//! force, a little later at speed `v`. Until then the stem bends as a cantilever (3). A force that
//! pulls the ball out of its seat has a negative `f_ax` and tips the carrier all the same.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | L, I, S | stylus length, second moment and section of the stem | mm, mm⁴, mm² |
//! | psi_i | normals of the triangle's edges, 60° from the supports | rad |
//! | p | pretravel along the force, which is the surface normal | mm |
//!
//! # Holds when
//! Friction between ball and surface is small, deflection small against the stylus.
//!
//! # References
//! \[1\] F. Shen, S. Moon, on pretravel lobing of kinematic touch probes (mechanism from memory;
//! (1) to (3) derived here).

use std::f64::consts::{FRAC_PI_3, PI, TAU};

use nalgebra::Vector3;

use super::error::{PlantError, require_finite, require_not_negative, require_positive};
use super::file::TouchProbeEntry;

/// A seat with three supports and a slender stylus.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seat {
    /// Unit normals of the triangle's edges.
    edge: [(f64, f64); 3],
    half_radius_mm: f64,
    length_mm: f64,
    opening_force_n: f64,
    force_growth_s_per_mm: f64,
    bending_mm_per_n: f64,
    compression_mm_per_n: f64,
}

impl Seat {
    pub(super) fn new(entry: &TouchProbeEntry) -> Result<Self, PlantError> {
        let at = |key: &str| format!("touch_probe.{key}");
        for (key, value) in [
            ("stylus_length_mm", entry.stylus_length_mm),
            ("stem_diameter_mm", entry.stem_diameter_mm),
            ("stem_modulus_gpa", entry.stem_modulus_gpa),
            ("spring_force_n", entry.spring_force_n),
            ("support_radius_mm", entry.support_radius_mm),
            ("contact_share", entry.contact_share),
        ] {
            require_positive(at(key), value)?;
        }
        require_finite(at("support_angle_deg"), entry.support_angle_deg)?;
        require_not_negative(at("force_growth_s_per_m"), entry.force_growth_s_per_m)?;
        let modulus_n_per_mm2 = entry.stem_modulus_gpa * 1e3;
        let diameter_mm = entry.stem_diameter_mm;
        let second_moment_mm4 = PI / 64.0 * diameter_mm.powi(4);
        let section_mm2 = PI / 4.0 * diameter_mm.powi(2);
        let length_mm = entry.stylus_length_mm;
        let first = entry.support_angle_deg.to_radians() + FRAC_PI_3;
        let normal = |i: u32| {
            let (sin, cos) = (first + f64::from(i) * TAU / 3.0).sin_cos();
            (cos, sin)
        };
        Ok(Self {
            edge: [normal(0), normal(1), normal(2)],
            half_radius_mm: 0.5 * entry.support_radius_mm,
            length_mm,
            opening_force_n: entry.contact_share * entry.spring_force_n,
            force_growth_s_per_mm: entry.force_growth_s_per_m / 1e3,
            bending_mm_per_n: length_mm.powi(3) / (3.0 * modulus_n_per_mm2 * second_moment_mm4),
            compression_mm_per_n: length_mm / (modulus_n_per_mm2 * section_mm2),
        })
    }

    /// (3): pretravel under a force on the ball along the unit vector `force`, probe frame (Z towards
    /// the spindle), while the ball advances at `speed_mm_s`; mm.
    pub(super) fn pretravel_mm(&self, force: &Vector3<f64>, speed_mm_s: f64) -> f64 {
        let lateral = force.x.hypot(force.y);
        let growth = 1.0 + self.force_growth_s_per_mm * speed_mm_s.max(0.0);
        // Largest cos(phi - psi_i) times the lateral part: the edge that is reached first.
        let steepest = self
            .edge
            .iter()
            .map(|(cos, sin)| force.x * cos + force.y * sin)
            .fold(0.0, f64::max);
        // (2) with rho = r/2 lateral / steepest, written without the quotient that fails on the axis.
        let reach = if steepest > 0.0 {
            steepest * self.length_mm / self.half_radius_mm + force.z
        } else {
            force.z
        };
        let load_n = growth * self.opening_force_n / reach.abs();
        load_n
            * (lateral * lateral * self.bending_mm_per_n
                + force.z * force.z * self.compression_mm_per_n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry() -> TouchProbeEntry {
        TouchProbeEntry {
            latency_ms: 3.0,
            jitter_ms: 0.0,
            repeatability_um: 0.0,
            ball_radius_deviation_um: 0.0,
            stylus_length_mm: 50.0,
            stem_diameter_mm: 3.0,
            stem_modulus_gpa: 600.0,
            spring_force_n: 1.6,
            support_radius_mm: 8.0,
            support_angle_deg: 17.0,
            contact_share: 0.9,
            force_growth_s_per_m: 3.0,
            release_hysteresis_um: 2.0,
        }
    }

    fn lateral(seat: &Seat, degrees: f64) -> f64 {
        let (sin, cos) = degrees.to_radians().sin_cos();
        seat.pretravel_mm(&Vector3::new(cos, sin, 0.0), 0.0)
    }

    #[test]
    fn eq1_pretravel_has_three_equal_lobes() {
        let seat = Seat::new(&entry()).unwrap();
        for degrees in 0..120 {
            let here = lateral(&seat, f64::from(degrees));
            assert!((lateral(&seat, f64::from(degrees) + 120.0) / here - 1.0).abs() < 1e-12);
            assert!((lateral(&seat, f64::from(degrees) - 120.0) / here - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn eq1_a_push_over_a_support_needs_twice_the_force_of_one_over_an_edge() {
        let seat = Seat::new(&entry()).unwrap();
        let over_support = lateral(&seat, 17.0);
        let over_edge = lateral(&seat, 17.0 + 60.0);
        assert!((over_support / over_edge - 2.0).abs() < 1e-9);
    }

    #[test]
    fn val_cantilever_and_lever_by_hand() {
        let seat = Seat::new(&entry()).unwrap();
        // Over an edge: F = 0.9 * 1.6 N * 4 mm / 50 mm; I = pi/64 * 81 mm^4.
        let force_n = 0.9 * 1.6 * 4.0 / 50.0;
        let expected = force_n * 125_000.0 / (3.0 * 600_000.0 * (PI / 64.0 * 81.0));
        assert!((lateral(&seat, 77.0) / expected - 1.0).abs() < 1e-9);
        assert!((1.8e-3..2.1e-3).contains(&expected));
    }

    #[test]
    fn eq3_an_axial_touch_is_stiff_and_speed_adds_a_little() {
        let seat = Seat::new(&entry()).unwrap();
        let axial = seat.pretravel_mm(&Vector3::z(), 0.0);
        let expected = 0.9 * 1.6 * 50.0 / (600_000.0 * PI / 4.0 * 9.0);
        assert!((axial / expected - 1.0).abs() < 1e-9, "{axial}");
        let fast = seat.pretravel_mm(&Vector3::x(), 33.0);
        let slow = seat.pretravel_mm(&Vector3::x(), 0.0);
        assert!((fast / slow - (1.0 + 3.0 * 0.033)).abs() < 1e-9);
    }
}
