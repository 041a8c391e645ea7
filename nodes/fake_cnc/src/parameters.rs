//! What the parameters of [`crate::Config`] mean, for `ros2 param describe` and the README.

use metrology::ParameterDoc;

/// Every parameter, in the order of [`crate::Config`].
pub const PARAMETERS: &[ParameterDoc] = &[
    text(
        "machine_file",
        "Machine file, relative to the parameter file.",
    ),
    text("plant_file", "Plant file, relative to the parameter file."),
    number(
        "state_rate_hz",
        "Hz",
        "Rate of axis states during touches and full-rate contours; a whole part of the servo rate.",
        (1.0, 20_000.0),
    ),
    number(
        "background_rate_hz",
        "Hz",
        "Rate of axis states otherwise; 0 means state_rate_hz.",
        (0.0, 20_000.0),
    ),
    number(
        "feedback_rate_hz",
        "Hz",
        "Rate of program feedback.",
        (0.01, 10.0),
    ),
    number(
        "touch_margin_s",
        "s",
        "Rest before a touch, and time for which the full rate goes on after it.",
        (0.0, 10.0),
    ),
    number("settle_s", "s", "Rest after every exact stop.", (0.0, 10.0)),
    number(
        "velocity_gain_per_s",
        "1/s",
        "Gain of the velocity loops.",
        (1.0, 10_000.0),
    ),
    number(
        "velocity_integral_time_s",
        "s",
        "Integral time of the velocity loops.",
        (1e-4, 100.0),
    ),
    number(
        "drive_peak_ratio",
        "",
        "Greatest acceleration demand over the acceleration limit of the axis.",
        (1.0, 100.0),
    ),
    number(
        "following_error_limit_mm",
        "mm",
        "Following error at which a linear axis stops.",
        (1e-3, 100.0),
    ),
    number(
        "following_error_limit_deg",
        "deg",
        "Following error at which a rotary axis stops.",
        (1e-3, 100.0),
    ),
    number(
        "compensation_hold_s",
        "s",
        "Silence after which a compensation is held no longer but fades.",
        (1e-3, 3600.0),
    ),
    number(
        "compensation_fade_um_s",
        "µm/s",
        "Rate at which a stale compensation of a linear axis goes to zero.",
        (1e-3, 1e4),
    ),
    number(
        "compensation_fade_arcsec_s",
        "arcsec/s",
        "Rate at which a stale compensation of a rotary axis goes to zero.",
        (1e-3, 1e4),
    ),
    number(
        "compensation_rate_limit_um_s",
        "µm/s",
        "Rate at which a compensation of a linear axis is followed at most.",
        (1e-3, 1e4),
    ),
    number(
        "compensation_rate_limit_arcsec_s",
        "arcsec/s",
        "Rate at which a compensation of a rotary axis is followed at most.",
        (1e-3, 1e4),
    ),
    number(
        "compensation_limit_um",
        "µm",
        "Greatest compensation of a linear axis that is accepted.",
        (1e-3, 1e4),
    ),
    number(
        "compensation_limit_arcsec",
        "arcsec",
        "Greatest compensation of a rotary axis that is accepted.",
        (1e-3, 1e4),
    ),
    number(
        "clock_offset_s",
        "s",
        "Controller clock minus host clock at the first tick.",
        (-1e9, 1e9),
    ),
    number(
        "clock_drift_ppm",
        "ppm",
        "Rate of the controller clock against the host's, minus one.",
        (-1000.0, 1000.0),
    ),
    number(
        "longest_catch_up_s",
        "s",
        "Jump of the host clock beyond which time is skipped rather than simulated.",
        (1e-3, 1e6),
    ),
    text(
        "autostart",
        "Whether the node configures and activates itself at its start; otherwise somebody does so (`ros2 lifecycle set`).",
    ),
    number(
        "homing_s",
        "s",
        "Time that homing takes, at the start and when it is asked for; 0: the axes know their zeros.",
        (0.0, 3600.0),
    ),
    text("optional_stop", "Whether M1 waits."),
    text(
        "single_block",
        "Whether every block waits for the next to be asked for.",
    ),
    number(
        "tool_lengths_mm",
        "mm",
        "Lengths of tools H1, H2 and so on, for G43.",
        (-1000.0, 1000.0),
    ),
    feedback("feedback.X"),
    feedback("feedback.Y"),
    feedback("feedback.Z"),
    start("start_mm.X", "mm"),
    start("start_mm.Y", "mm"),
    start("start_mm.Z", "mm"),
    start("start_deg.A", "deg"),
    start("start_deg.B", "deg"),
    start("start_deg.C", "deg"),
];

const fn text(name: &'static str, description: &'static str) -> ParameterDoc {
    ParameterDoc {
        name,
        unit: "",
        description,
        range: None,
    }
}

const fn number(
    name: &'static str,
    unit: &'static str,
    description: &'static str,
    range: (f64, f64),
) -> ParameterDoc {
    ParameterDoc {
        name,
        unit,
        description,
        range: Some(range),
    }
}

const fn feedback(name: &'static str) -> ParameterDoc {
    text(
        name,
        "What closes the position loop: motor (semi-closed) or scale (full-closed).",
    )
}

const fn start(name: &'static str, unit: &'static str) -> ParameterDoc {
    ParameterDoc {
        name,
        unit,
        description: "Position at the start, within travel.",
        range: None,
    }
}
