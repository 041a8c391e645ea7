//! Ranges of the parameters of known effects, as the machine file gives them: checked when the file is read, before anyone
//! simulates an effect.
//!
//! The library `twin` has the effects themselves; its tests hold this table equal to its catalogue. A kind or parameter that
//! is not here is checked for being finite alone: whoever simulates it refuses it by name.

use metrology::leaves::Row;

/// One row for each kind of effect, with the range of each of its parameters in the unit that its name ends in.
pub const RANGES: &[(&str, &[Row])] = &[
    (
        "acceleration_lag",
        &[
            ("time_squared_ms2", -1000.0, 1000.0),
            ("free_time_cubed_ms3", -100_000.0, 100_000.0),
            ("free_square_um", -200.0, 200.0),
        ],
    ),
    (
        "ambient_drift",
        &[
            ("rate_um_per_h", -200.0, 200.0),
            ("free_square_um_per_h2", -200.0, 200.0),
            ("free_cube_um_per_h3", -200.0, 200.0),
            ("free_air_um_per_k", -50.0, 50.0),
        ],
    ),
    (
        "angular_error",
        &[
            ("p1_urad", -300.0, 300.0),
            ("p2_urad", -300.0, 300.0),
            ("free_p3_urad", -300.0, 300.0),
            ("free_p4_urad", -300.0, 300.0),
            ("free_1_of_8_urad", -300.0, 300.0),
            ("free_2_of_8_urad", -300.0, 300.0),
            ("free_3_of_8_urad", -300.0, 300.0),
            ("free_4_of_8_urad", -300.0, 300.0),
            ("free_5_of_8_urad", -300.0, 300.0),
            ("free_6_of_8_urad", -300.0, 300.0),
            ("free_7_of_8_urad", -300.0, 300.0),
            ("free_1_of_16_urad", -300.0, 300.0),
            ("free_3_of_16_urad", -300.0, 300.0),
            ("free_5_of_16_urad", -300.0, 300.0),
            ("free_7_of_16_urad", -300.0, 300.0),
            ("free_9_of_16_urad", -300.0, 300.0),
            ("free_11_of_16_urad", -300.0, 300.0),
            ("free_13_of_16_urad", -300.0, 300.0),
            ("free_15_of_16_urad", -300.0, 300.0),
        ],
    ),
    (
        "backlash",
        &[
            ("width_um", -300.0, 300.0),
            ("free_0p01mm_um", -300.0, 300.0),
            ("free_0p03mm_um", -300.0, 300.0),
            ("free_0p1mm_um", -300.0, 300.0),
            ("free_0p3mm_um", -300.0, 300.0),
            ("free_1mm_um", -300.0, 300.0),
            ("free_3mm_um", -300.0, 300.0),
            ("free_soft_3mm_s2_um", -300.0, 300.0),
            ("free_soft_10mm_s2_um", -300.0, 300.0),
            ("free_soft_30mm_s2_um", -300.0, 300.0),
            ("free_soft_100mm_s2_um", -300.0, 300.0),
            ("free_by_place_um", -300.0, 300.0),
            ("free_by_place2_um", -300.0, 300.0),
            ("free_by_place3_um", -300.0, 300.0),
            ("free_by_place4_um", -300.0, 300.0),
            ("free_by_place5_um", -300.0, 300.0),
            ("free_by_place6_um", -300.0, 300.0),
            ("free_from_mm", -100_000.0, 100_000.0),
            ("free_to_mm", -100_000.0, 100_000.0),
        ],
    ),
    (
        "clock_drift",
        &[
            ("drift_ppm", -500.0, 500.0),
            ("free_ppm_per_h", -500.0, 500.0),
        ],
    ),
    ("clock_offset", &[("offset_ms", -200.0, 200.0)]),
    (
        "column_bend",
        &[
            ("y_um_per_k", -100.0, 100.0),
            ("z_um_per_k", -100.0, 100.0),
            ("tilt_x_urad_per_k", -100.0, 100.0),
            ("lag_min", 0.05, 480.0),
            ("free_x_um_per_k", -100.0, 100.0),
            ("free_tilt_y_urad_per_k", -100.0, 100.0),
            ("free_tilt_z_urad_per_k", -100.0, 100.0),
        ],
    ),
    (
        "coolant",
        &[
            ("step_um", -100.0, 100.0),
            ("at_min", 0.0, 1440.0),
            ("lag_min", 0.1, 30.0),
            ("free_growth_um_per_m", -100.0, 100.0),
        ],
    ),
    (
        "cyclic_error",
        &[
            ("sin_um", -20.0, 20.0),
            ("cos_um", -20.0, 20.0),
            ("per_turn", 0.3, 10.0),
            ("free_sin2_um", -20.0, 20.0),
            ("free_cos2_um", -20.0, 20.0),
            ("free_sin_by_place_um", -20.0, 20.0),
            ("free_cos_by_place_um", -20.0, 20.0),
        ],
    ),
    (
        "drive_windup",
        &[
            ("windup_um", -100.0, 100.0),
            ("free_by_place_um", -100.0, 100.0),
        ],
    ),
    (
        "feed_lost_motion",
        &[
            ("width_um", -300.0, 300.0),
            ("speed_mm_s", 0.1, 100.0),
            ("free_viscous_um", -300.0, 300.0),
        ],
    ),
    (
        "friction_windup",
        &[
            ("windup_um_per_m", -100.0, 100.0),
            ("presliding_mm", 0.001, 10.0),
            ("bearing_half_travels", -1.6, 1.6),
        ],
    ),
    (
        "gravity_sag",
        &[
            ("sag_um", -100.0, 100.0),
            ("power", 1.5, 4.0),
            ("free_from_high_um", -100.0, 100.0),
        ],
    ),
    ("guide_bow", &[("sagitta_um", -60.0, 60.0)]),
    (
        "homing_shift",
        &[("shift_um", -500.0, 500.0), ("at_min", 0.0, 1440.0)],
    ),
    (
        "interpolation_error",
        &[
            ("sin_um", -5.0, 5.0),
            ("cos_um", -5.0, 5.0),
            ("period_um", 0.5, 2000.0),
            ("free_sin2_um", -5.0, 5.0),
            ("free_cos2_um", -5.0, 5.0),
        ],
    ),
    (
        "latency_drift",
        &[
            ("step_ms", -20.0, 20.0),
            ("at_min", 0.0, 1440.0),
            ("free_rate_ms_per_h", -20.0, 20.0),
        ],
    ),
    ("latency_jitter", &[("jitter_ms", 0.0, 10.0)]),
    (
        "latency_modes",
        &[("apart_ms", 0.0, 20.0), ("late_share", 0.02, 0.98)],
    ),
    (
        "lateral_play",
        &[("width_um", -60.0, 60.0), ("settle_mm", 0.01, 100.0)],
    ),
    (
        "length_misalignment",
        &[
            ("stray_mm2", 0.0, 9.0),
            ("free_curve_um_per_m2", -100.0, 100.0),
        ],
    ),
    (
        "length_wavelength",
        &[
            ("scale_ppm", -100.0, 100.0),
            ("free_air_share", -2.0, 2.0),
            ("free_rate_ppm_per_h", -20.0, 20.0),
        ],
    ),
    (
        "load_deflection",
        &[
            ("along_um", -100.0, 100.0),
            ("free_next_um", -100.0, 100.0),
            ("free_after_um", -100.0, 100.0),
        ],
    ),
    (
        "pitch_error",
        &[
            ("p2_um", -500.0, 500.0),
            ("p3_um", -500.0, 500.0),
            ("free_p4_um", -500.0, 500.0),
            ("free_p5_um", -500.0, 500.0),
            ("free_1_of_8_um", -500.0, 500.0),
            ("free_2_of_8_um", -500.0, 500.0),
            ("free_3_of_8_um", -500.0, 500.0),
            ("free_4_of_8_um", -500.0, 500.0),
            ("free_5_of_8_um", -500.0, 500.0),
            ("free_6_of_8_um", -500.0, 500.0),
            ("free_7_of_8_um", -500.0, 500.0),
            ("free_1_of_16_um", -500.0, 500.0),
            ("free_3_of_16_um", -500.0, 500.0),
            ("free_5_of_16_um", -500.0, 500.0),
            ("free_7_of_16_um", -500.0, 500.0),
            ("free_9_of_16_um", -500.0, 500.0),
            ("free_11_of_16_um", -500.0, 500.0),
            ("free_13_of_16_um", -500.0, 500.0),
            ("free_15_of_16_um", -500.0, 500.0),
            ("free_from_mm", -100_000.0, 100_000.0),
            ("free_to_mm", -100_000.0, 100_000.0),
        ],
    ),
    (
        "plate_error",
        &[
            ("scale_u_um_per_m", -100.0, 100.0),
            ("scale_v_um_per_m", -100.0, 100.0),
            ("squareness_um_per_m", -100.0, 100.0),
            ("free_u_uu_um_per_m", -100.0, 100.0),
            ("free_u_uv_um_per_m", -100.0, 100.0),
            ("free_u_vv_um_per_m", -100.0, 100.0),
            ("free_v_uu_um_per_m", -100.0, 100.0),
            ("free_v_uv_um_per_m", -100.0, 100.0),
            ("free_v_vv_um_per_m", -100.0, 100.0),
        ],
    ),
    (
        "probe_latency",
        &[
            ("latency_ms", -50.0, 50.0),
            ("free_square_um", -100.0, 100.0),
        ],
    ),
    (
        "probe_lobing",
        &[
            ("three_cos_um", -15.0, 15.0),
            ("three_sin_um", -15.0, 15.0),
            ("free_2_cos_um", -15.0, 15.0),
            ("free_2_sin_um", -15.0, 15.0),
            ("free_4_cos_um", -15.0, 15.0),
            ("free_4_sin_um", -15.0, 15.0),
            ("free_5_cos_um", -15.0, 15.0),
            ("free_5_sin_um", -15.0, 15.0),
            ("free_6_cos_um", -15.0, 15.0),
            ("free_6_sin_um", -15.0, 15.0),
        ],
    ),
    (
        "probe_pretravel",
        &[
            ("lateral_um", -50.0, 50.0),
            ("axial_um", -50.0, 50.0),
            ("length_exponent", 0.0, 4.0),
            ("free_x_um", -50.0, 50.0),
            ("free_y_um", -50.0, 50.0),
            ("free_z_um", -50.0, 50.0),
            ("free_slant_um", -50.0, 50.0),
        ],
    ),
    (
        "probe_repeatability",
        &[("sigma_um", 0.0, 20.0), ("free_lateral_um", 0.0, 20.0)],
    ),
    ("quantisation", &[("step_um", 0.0, 20.0)]),
    (
        "reversal_spike",
        &[
            ("height_um", -30.0, 30.0),
            ("width_ms", 0.5, 200.0),
            ("length_mm", 0.0001, 3.0),
            ("free_at_100mm_s2_um", -30.0, 30.0),
            ("free_0p01mm_um", -30.0, 30.0),
            ("free_0p03mm_um", -30.0, 30.0),
            ("free_0p1mm_um", -30.0, 30.0),
            ("free_0p3mm_um", -30.0, 30.0),
            ("free_1mm_um", -30.0, 30.0),
            ("free_3mm_um", -30.0, 30.0),
            ("free_below_2mm_s_um", -30.0, 30.0),
            ("free_below_8mm_s_um", -30.0, 30.0),
        ],
    ),
    ("rotary_backlash", &[("width_urad", -500.0, 500.0)]),
    ("rotary_location", &[("size_um_urad", -200.0, 200.0)]),
    (
        "rotary_motion",
        &[
            ("cos_um_urad", -200.0, 200.0),
            ("sin_um_urad", -200.0, 200.0),
            ("free_cos2_um_urad", -200.0, 200.0),
            ("free_sin2_um_urad", -200.0, 200.0),
            ("free_cos3_um_urad", -200.0, 200.0),
            ("free_sin3_um_urad", -200.0, 200.0),
            ("free_cos4_um_urad", -200.0, 200.0),
            ("free_sin4_um_urad", -200.0, 200.0),
            ("free_cos5_um_urad", -200.0, 200.0),
            ("free_sin5_um_urad", -200.0, 200.0),
        ],
    ),
    (
        "scale_error",
        &[
            ("scale_um_per_m", -200.0, 200.0),
            ("free_expansion_um_per_m_k", -30.0, 30.0),
        ],
    ),
    (
        "screw_elongation",
        &[
            ("growth_um_per_m", -10_000.0, 10_000.0),
            ("lag_min", 1.0, 120.0),
            ("fixed_end", -1.5, 1.5),
            ("free_fast_um_per_m", -10_000.0, 10_000.0),
            ("free_slow_um_per_m", -10_000.0, 10_000.0),
            ("free_viscous_um_per_m", -10_000.0, 10_000.0),
            ("free_nut_um_per_m_k", -30.0, 30.0),
            ("free_square_fast_um_per_m", -10_000.0, 10_000.0),
            ("free_square_um_per_m", -10_000.0, 10_000.0),
            ("free_square_slow_um_per_m", -10_000.0, 10_000.0),
        ],
    ),
    (
        "servo_lag",
        &[
            ("time_ms", -60.0, 60.0),
            ("free_square_um", -200.0, 200.0),
            ("free_cube_um", -200.0, 200.0),
            ("free_worked_off_ms", -60.0, 60.0),
        ],
    ),
    (
        "spindle_growth",
        &[
            ("fast_um", -200.0, 200.0),
            ("slow_um", -200.0, 200.0),
            ("fast_min", 0.2, 15.0),
            ("slow_min", 10.0, 240.0),
            ("free_x_um", -200.0, 200.0),
            ("free_y_um", -200.0, 200.0),
        ],
    ),
    ("squareness", &[("angle_urad", -500.0, 500.0)]),
    (
        "stick_slip",
        &[
            ("height_um", 0.0, 50.0),
            ("critical_mm_s", 0.05, 50.0),
            ("free_even_um", 0.0, 50.0),
            ("free_hysteresis", 0.0, 0.8),
        ],
    ),
    (
        "straightness",
        &[
            ("p2_um", -60.0, 60.0),
            ("p3_um", -60.0, 60.0),
            ("free_p4_um", -500.0, 500.0),
            ("free_p5_um", -500.0, 500.0),
            ("free_1_of_8_um", -500.0, 500.0),
            ("free_2_of_8_um", -500.0, 500.0),
            ("free_3_of_8_um", -500.0, 500.0),
            ("free_4_of_8_um", -500.0, 500.0),
            ("free_5_of_8_um", -500.0, 500.0),
            ("free_6_of_8_um", -500.0, 500.0),
            ("free_7_of_8_um", -500.0, 500.0),
            ("free_1_of_16_um", -500.0, 500.0),
            ("free_3_of_16_um", -500.0, 500.0),
            ("free_5_of_16_um", -500.0, 500.0),
            ("free_7_of_16_um", -500.0, 500.0),
            ("free_9_of_16_um", -500.0, 500.0),
            ("free_11_of_16_um", -500.0, 500.0),
            ("free_13_of_16_um", -500.0, 500.0),
            ("free_15_of_16_um", -500.0, 500.0),
        ],
    ),
    (
        "structural_ringing",
        &[
            ("share", -1.6, 1.6),
            ("frequency_hz", 3.0, 400.0),
            ("damping", 0.002, 0.5),
        ],
    ),
    (
        "stylus_jump",
        &[
            ("radius_um", -200.0, 200.0),
            ("at_min", 0.0, 1440.0),
            ("free_x_um", -200.0, 200.0),
            ("free_y_um", -200.0, 200.0),
            ("free_z_um", -200.0, 200.0),
        ],
    ),
    (
        "thermometer_lag",
        &[
            ("lag_s", 0.0, 600.0),
            ("free_square_s2", -90_000.0, 90_000.0),
        ],
    ),
    (
        "thermometer_noise",
        &[("sigma_k", 0.0, 2.0), ("free_draught_percent", 0.0, 20.0)],
    ),
    (
        "thermometer_offset",
        &[
            ("offset_k", -10.0, 10.0),
            ("free_slope_percent", -20.0, 20.0),
        ],
    ),
    (
        "vibration_random",
        &[
            ("amplitude_um", 0.0, 20.0),
            ("free_with_speed_um", 0.0, 20.0),
        ],
    ),
    (
        "workpiece_expansion",
        &[
            ("difference_um_per_m_k", -30.0, 30.0),
            ("lag_min", 0.1, 480.0),
            ("free_y_um_per_m_k", -30.0, 30.0),
            ("free_z_um_per_m_k", -30.0, 30.0),
        ],
    ),
];
