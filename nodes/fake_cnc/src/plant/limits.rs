//! Ranges of the physical numbers of a plant file: from machines for watch parts to gantries of 30 m, with room on both
//! sides. Outside, a number is a wrong unit or a slip, and what follows from it is no physics.

use metrology::leaves::{self, Row};

use super::error::PlantError;
use super::file::PlantFile;

/// Coordinates and dimensions: a gantry of 30 m stands anywhere in a hall.
const HALL_MM: f64 = 1e5;
/// Errors of a machine that still works: a centimetre.
const CENTIMETRE_UM: f64 = 1e4;
/// Errors of angle: six degrees.
const DEGREES_URAD: f64 = 1e5;
/// Air of a shop and the temperature at which a machine was measured, °C.
const COLDEST_SHOP_DEGC: f64 = -60.0;
const HOTTEST_SHOP_DEGC: f64 = 100.0;
/// Expansion of any solid, µm/(m K); glass ceramics are slightly negative.
const EXPANSION: (f64, f64) = (-50.0, 500.0);
/// Years in seconds.
const LONGEST_S: f64 = 1e9;

/// One row for each key; a key has one meaning in the whole file.
const ROWS: &[Row] = &[
    // Drives.
    ("motor_inertia_kg", 1e-4, 1e6),
    ("slide_mass_kg", 1e-3, 1e6),
    ("force_limit_n", 1e-3, 1e8),
    ("screw_stiffness_n_per_um", 1e-4, 1e6),
    ("screw_damping_ratio", 0.0, 10.0),
    ("gear_damping_ratio", 0.0, 10.0),
    ("backlash_um", 0.0, CENTIMETRE_UM),
    ("backlash_softness_um", 1e-6, 1e3),
    ("after_s", 0.0, LONGEST_S),
    ("friction_ratio", 0.01, 1e3),
    ("coulomb_n", 1e-6, 1e7),
    ("breakaway_n", 1e-6, 1e7),
    ("stribeck_velocity_mm_s", 1e-6, 1e5),
    ("viscous_n_s_per_mm", 0.0, 1e6),
    ("presliding_um", 1e-6, CENTIMETRE_UM),
    ("memory_ms", 0.0, 1e4),
    ("once_um", -CENTIMETRE_UM, CENTIMETRE_UM),
    ("twice_um", -CENTIMETRE_UM, CENTIMETRE_UM),
    ("phase_deg", -1e4, 1e4),
    ("per_turn", 1e-3, 1e4),
    ("growth", -100.0, 100.0),
    ("motor_inertia_kg_m2", 1e-9, 1e7),
    ("table_inertia_kg_m2", 1e-9, 1e7),
    ("torque_limit_n_m", 1e-6, 1e8),
    ("gear_stiffness_n_m_per_arcsec", 1e-6, 1e8),
    ("backlash_arcsec", 0.0, 36_000.0),
    ("backlash_softness_arcsec", 1e-6, 3_600.0),
    ("coulomb_n_m", 1e-9, 1e7),
    ("breakaway_n_m", 1e-9, 1e7),
    ("stribeck_velocity_rad_s", 1e-9, 1e4),
    ("viscous_n_m_s_per_rad", 0.0, 1e8),
    ("presliding_arcsec", 1e-6, 36_000.0),
    // Heat.
    ("reference_temp_degc", COLDEST_SHOP_DEGC, HOTTEST_SHOP_DEGC),
    ("start_temp_degc", COLDEST_SHOP_DEGC, HOTTEST_SHOP_DEGC),
    ("day_amplitude_k", -100.0, 100.0),
    ("day_phase_deg", -1e4, 1e4),
    ("draught_k", 0.0, 100.0),
    ("draught_time_s", 1e-3, LONGEST_S),
    ("heat_capacity_j_per_k", 0.01, 1e10),
    ("to_air_w_per_k", 0.0, 1e6),
    ("conductance_w_per_k", 1e-9, 1e7),
    ("standing_heat_w", 0.0, 1e6),
    ("front_bearing_w_at_1000_rpm", 0.0, 1e5),
    ("rear_bearing_w_at_1000_rpm", 0.0, 1e5),
    ("bearing_exponent", 1e-6, 5.0),
    ("motor_w_at_1000_rpm", 0.0, 1e5),
    ("motor_exponent", 1e-6, 5.0),
    ("ends_mm", -HALL_MM, HALL_MM),
    ("diameter_mm", 0.1, 1e4),
    ("conductivity_w_per_m_k", 1e-3, 1e5),
    ("heat_capacity_mj_per_m3_k", 1e-3, 100.0),
    ("expansion_um_per_m_k", EXPANSION.0, EXPANSION.1),
    ("convection_w_per_m2_k", 0.0, 1e5),
    ("pretension_um", 0.0, CENTIMETRE_UM),
    ("nut_length_mm", 0.1, 1e4),
    ("nut_torque_n_m", 0.0, 1e4),
    ("nut_heat_share_to_screw", 0.0, 1.0),
    ("nut_heat_capacity_j_per_k", 0.01, 1e8),
    ("nut_to_screw_w_per_k", 0.0, 1e6),
    ("nut_to_place_w_per_k", 0.0, 1e6),
    ("bearing_torque_n_m", 0.0, 1e4),
    ("bearing_heat_capacity_j_per_k", 0.01, 1e8),
    ("bearing_to_screw_w_per_k", 0.0, 1e6),
    ("bearing_to_place_w_per_k", 0.0, 1e6),
    ("motor_loss_w_per_kn2", 0.0, 1e8),
    // Structure and geometry.
    ("casting_expansion_um_per_m_k", EXPANSION.0, EXPANSION.1),
    ("shaft_expansion_um_per_m_k", EXPANSION.0, EXPANSION.1),
    ("table_expansion_um_per_m_k", EXPANSION.0, EXPANSION.1),
    ("workpiece_expansion_um_per_m_k", EXPANSION.0, EXPANSION.1),
    ("post_expansion_um_per_m_k", EXPANSION.0, EXPANSION.1),
    ("scale_expansion_um_per_m_k", EXPANSION.0, EXPANSION.1),
    ("carriage_height_mm", -HALL_MM, HALL_MM),
    ("column_depth_mm", 0.1, HALL_MM),
    ("column_width_mm", 0.1, HALL_MM),
    ("overhang_mm", -HALL_MM, HALL_MM),
    ("head_drop_mm", -HALL_MM, HALL_MM),
    ("shaft_between_bearings_mm", 0.1, HALL_MM),
    ("shaft_nose_mm", 0.01, HALL_MM),
    ("bed_length_mm", 0.1, HALL_MM),
    ("bed_depth_mm", 0.1, HALL_MM),
    ("table_height_mm", 0.01, HALL_MM),
    ("table_radius_mm", 0.1, HALL_MM),
    ("table_top_mm", -HALL_MM, HALL_MM),
    ("positioning_um", 0.0, CENTIMETRE_UM),
    ("straightness_um", 0.0, CENTIMETRE_UM),
    ("angular_urad", 0.0, DEGREES_URAD),
    ("lead_um_per_m", -DEGREES_URAD, DEGREES_URAD),
    ("carriage_mm", -HALL_MM, HALL_MM),
    ("bow_um_urad", -DEGREES_URAD, DEGREES_URAD),
    ("wave_um_urad", -DEGREES_URAD, DEGREES_URAD),
    ("dent_um_urad", -DEGREES_URAD, DEGREES_URAD),
    ("dent_at_mm", -HALL_MM, HALL_MM),
    ("dent_width_mm", 1e-3, HALL_MM),
    ("run_out_um", 0.0, CENTIMETRE_UM),
    ("wobble_urad", 0.0, DEGREES_URAD),
    ("positioning_urad", 0.0, DEGREES_URAD),
    ("location_um", -DEGREES_URAD, DEGREES_URAD),
    ("tilt_urad", -DEGREES_URAD, DEGREES_URAD),
    ("squareness_urad", -DEGREES_URAD, DEGREES_URAD),
    ("along_um", 0.0, CENTIMETRE_UM),
    ("across_um", 0.0, CENTIMETRE_UM),
    ("length_mm", 1e-3, HALL_MM),
    ("time_s", 1e-3, LONGEST_S),
    ("amplitude_um", 0.0, CENTIMETRE_UM),
    ("frequency_hz", 1e-3, 1e5),
    ("wander_hz", 0.0, 1e5),
    ("wander_time_s", 1e-3, LONGEST_S),
    // Probe and artefacts.
    ("latency_ms", 0.0, 1e3),
    ("jitter_ms", 0.0, 1e3),
    ("repeatability_um", 0.0, 1e3),
    ("ball_radius_deviation_um", -1e3, 1e3),
    ("stylus_length_mm", 0.01, 1e4),
    ("stem_diameter_mm", 1e-3, 1e3),
    ("stem_modulus_gpa", 1e-2, 1e4),
    ("spring_force_n", 1e-6, 1e3),
    ("support_radius_mm", 1e-3, 1e3),
    ("support_angle_deg", -1e4, 1e4),
    ("contact_share", 0.0, 1.0),
    ("force_growth_s_per_m", 0.0, 1e4),
    ("release_hysteresis_um", 0.0, CENTIMETRE_UM),
    ("block_edge_mm", 1e-3, HALL_MM),
    ("ring_wall_mm", 1e-3, HALL_MM),
    ("height_mm", 1e-3, HALL_MM),
    ("plane_thickness_mm", 1e-3, HALL_MM),
    ("placement_um", 0.0, DEGREES_URAD),
    ("from_s", 0.0, LONGEST_S),
    ("spacing_us", 0.0, 1e9),
    ("at_s", 0.0, LONGEST_S),
    ("shift_um", -1e6, 1e6),
    // Sensors and instruments.
    ("time_constant_s", 0.0, LONGEST_S),
    ("offset_k", -100.0, 100.0),
    ("noise_k", 0.0, 100.0),
    ("graduation_um", 0.0, CENTIMETRE_UM),
    ("graduation_length_mm", 1e-3, HALL_MM),
    ("signal_period_um", 1e-3, 1e6),
    ("interpolation_um", 0.0, 1e3),
    ("gap_tolerance_mm", 1e-6, 1e3),
    ("rotation_urad", 0.0, 1e6),
    ("plate_error_um", 0.0, CENTIMETRE_UM),
    ("plate_error_length_mm", 1e-3, HALL_MM),
    ("plate_scale_um_per_m", -DEGREES_URAD, DEGREES_URAD),
    ("plate_squareness_urad", -DEGREES_URAD, DEGREES_URAD),
    ("head_noise_um", 0.0, 1e3),
    ("dead_path_mm", 0.0, HALL_MM),
    ("wavelength_error_ppm", -1e5, 1e5),
    ("wavelength_drift_ppm_per_h", -1e5, 1e5),
    ("misalignment_urad", 0.0, DEGREES_URAD),
    ("noise_um", 0.0, 1e3),
    ("beam_radius_mm", 1e-6, 1e4),
];

/// Refuses numbers that no machine has.
pub(super) fn check(file: &PlantFile) -> Result<(), PlantError> {
    Ok(leaves::check(ROWS, file)?)
}

#[cfg(test)]
mod tests {
    use metrology::number::unit_of;

    use super::*;

    /// Ratios, exponents and shares, which have no unit.
    const PLAIN: [&str; 7] = [
        "screw_damping_ratio",
        "gear_damping_ratio",
        "growth",
        "bearing_exponent",
        "motor_exponent",
        "nut_heat_share_to_screw",
        "contact_share",
    ];

    #[test]
    fn every_number_out_of_its_range_is_told_with_its_unit() {
        for (key, least, greatest) in ROWS {
            assert_eq!(unit_of(key).is_none(), PLAIN.contains(key), "{key}");
            let beyond = greatest + (greatest - least);
            let said = leaves::check_number(ROWS, key, beyond)
                .unwrap_err()
                .to_string();
            let unit = unit_of(key).unwrap_or_default();
            assert!(said.ends_with(&unit), "{said}");
        }
        // By hand: a torque is no length, a power at a speed no speed.
        for (key, words) in [
            (
                "torque_limit_n_m",
                "torque_limit_n_m = 10000000000 N m: must be from 1e-6 to 100000000 N m",
            ),
            (
                "front_bearing_w_at_1000_rpm",
                "= 10000000000 W: must be from 0 to 100000 W",
            ),
            (
                "per_turn",
                "= 10000000000 1/turn: must be from 0.001 to 10000 1/turn",
            ),
            (
                "standing_heat_w.bed",
                "standing_heat_w.bed = 10000000000 W: must be from 0 to 1000000 W",
            ),
        ] {
            let said = leaves::check_number(ROWS, key, 1e10)
                .unwrap_err()
                .to_string();
            assert!(said.ends_with(words), "{said}");
        }
    }

    #[test]
    fn every_range_holds_something_and_no_key_has_two() {
        let mut keys: Vec<&str> = ROWS.iter().map(|(key, ..)| *key).collect();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), ROWS.len());
        for (key, least, greatest) in ROWS {
            assert!(
                least < greatest && least.is_finite() && greatest.is_finite(),
                "{key}"
            );
        }
    }
}
