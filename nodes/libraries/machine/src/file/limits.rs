//! Ranges of the physical numbers of a machine file: from machines for watch parts to gantries of 30 m, with room on both
//! sides. Outside, a number is a wrong unit or a slip.

use metrology::leaves::Row;

/// Coordinates and travels: a gantry of 30 m stands anywhere in a hall.
const HALL_MM: f64 = 1e5;
/// Finest resolution: a picometre.
const FINEST_UM: f64 = 1e-6;
/// Scatter of a touch, 1 standard deviation, µm: from a nanometre, below what any probe repeats. Touches are weighted by its
/// inverse square, which would overflow for far less.
pub const REPEATABILITY_UM: std::ops::RangeInclusive<f64> = 1e-3..=1e3;

/// Lead of a screw, or way of a rack for a turn of its motor: from watch parts to gantries of 30 m. A slip of m or µm lies outside.
pub(super) const LEAD_MM: std::ops::RangeInclusive<f64> = 0.2..=500.0;
/// Radius of a ball that touches: from micro styli and nozzles to probes of large castings.
pub(super) const BALL_RADIUS_MM: std::ops::RangeInclusive<f64> = 0.02..=30.0;
/// Length of a stylus, from its seat and from the spindle nose.
pub(super) const STYLUS_LENGTH_MM: std::ops::RangeInclusive<f64> = 1.0..=3000.0;

/// One row for each key; a key has one meaning in the whole file.
pub(super) const ROWS: &[Row] = &[
    ("travel_mm", -HALL_MM, HALL_MM),
    ("feed_limit_mm_min", 0.1, 1e7),
    ("acceleration_limit_mm_s2", 0.1, 1e6),
    ("lead_mm", *LEAD_MM.start(), *LEAD_MM.end()),
    ("position_gain_per_s", 0.1, 1e5),
    ("velocity_feedforward", 0.0, 1.0),
    ("frequency_hz", 0.1, 1e5),
    ("damping", 0.01, 100.0),
    ("filter_ms", 0.0, 1e4),
    ("coulomb_mm_s2", 1e-6, 1e6),
    ("viscous_per_s", 0.0, 1e6),
    ("encoder_resolution_um", FINEST_UM, 1e3),
    ("scale_resolution_um", FINEST_UM, 1e3),
    ("scale_expanded_uncertainty_um", 0.0, 1e3),
    ("scale_expanded_uncertainty_um_per_m", 0.0, 1e3),
    ("scale_signal_period_um", 1e-3, 1e5),
    ("periods_mm", 1e-3, HALL_MM),
    ("travel_deg", -1e8, 1e8),
    ("feed_limit_deg_min", 0.1, 1e9),
    ("acceleration_limit_deg_s2", 0.1, 1e9),
    ("encoder_resolution_arcsec", 1e-6, 36_000.0),
    ("origin_mm", -HALL_MM, HALL_MM),
    ("servo_period_ms", 0.05, 100.0),
    ("pulse_equivalent_um", FINEST_UM, 1e3),
    ("max_speed_rpm", 0.01, 500_000.0),
    ("radius_mm", 1e-3, HALL_MM),
    ("nose_radius_mm", 0.01, 1e4),
    ("length_mm", 0.01, 1e4),
    ("stem_length_mm", 0.01, 1e4),
    ("standoff_mm", 1e-3, 1e3),
    ("overtravel_mm", 1e-3, 1e3),
    ("feed_mm_min", 0.01, 1e5),
    (
        "repeatability_um",
        *REPEATABILITY_UM.start(),
        *REPEATABILITY_UM.end(),
    ),
    ("latency_ms", 0.0, 1e3),
    ("corner_mm", -HALL_MM, HALL_MM),
    ("inset_mm", 1e-3, 1e4),
    ("centre_mm", -HALL_MM, HALL_MM),
    ("point_mm", -HALL_MM, HALL_MM),
    ("normal", -1e6, 1e6),
    ("half_side_mm", 1e-3, HALL_MM),
    ("top_z_mm", -HALL_MM, HALL_MM),
    ("period_s", 1e-3, 86_400.0),
    ("resolution_um", FINEST_UM, 1e3),
    ("tool_offset_mm", -HALL_MM, HALL_MM),
    ("diameter_mm", 2e-3, 2.0 * HALL_MM),
    ("expanded_uncertainty_um", 0.0, 1e3),
    ("form_um", 0.0, 1e3),
    ("form_expanded_uncertainty_um", 0.0, 1e3),
    ("coverage_factor", 1.0, 10.0),
    ("from_mm", -HALL_MM, HALL_MM),
    ("to_mm", -HALL_MM, HALL_MM),
];
