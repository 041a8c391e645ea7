//! Every parameter of the node with its unit, limits and meaning.

use metrology::ParameterDoc;

use crate::geometric::JUMP_LIMIT_UM;
use crate::positioning::config;

pub(crate) const SIZE_UM: (f64, f64) = (0.1, 5000.0);
pub(crate) const RATE_UM_PER_S: (f64, f64) = (0.001, 10000.0);
pub(crate) const ACCELERATION_UM_PER_S2: (f64, f64) = (0.001, 1e6);

const fn row(
    name: &'static str,
    unit: &'static str,
    range: (f64, f64),
    description: &'static str,
) -> ParameterDoc {
    ParameterDoc {
        name,
        unit,
        description,
        range: Some(range),
    }
}

const fn word(name: &'static str, description: &'static str) -> ParameterDoc {
    ParameterDoc {
        name,
        unit: "",
        description,
        range: None,
    }
}

const fn list(name: &'static str, unit: &'static str, description: &'static str) -> ParameterDoc {
    ParameterDoc {
        name,
        unit,
        description,
        range: None,
    }
}

/// Every parameter with its unit, limits and meaning.
pub const PARAMETERS: &[ParameterDoc] = &[
    row(
        "axes.X.size_limit_um",
        "µm",
        SIZE_UM,
        "greatest offset of the axis; the same key exists for Y and Z",
    ),
    row(
        "axes.X.rate_limit_um_per_s",
        "µm/s",
        RATE_UM_PER_S,
        "greatest rate of the offset; the same key exists for Y and Z",
    ),
    row(
        "axes.X.acceleration_limit_um_per_s2",
        "µm/s²",
        ACCELERATION_UM_PER_S2,
        "greatest acceleration of the offset; the same key exists for Y and Z",
    ),
    row("axes.Y.size_limit_um", "µm", SIZE_UM, "as for X"),
    row(
        "axes.Y.rate_limit_um_per_s",
        "µm/s",
        RATE_UM_PER_S,
        "as for X",
    ),
    row(
        "axes.Y.acceleration_limit_um_per_s2",
        "µm/s²",
        ACCELERATION_UM_PER_S2,
        "as for X",
    ),
    row("axes.Z.size_limit_um", "µm", SIZE_UM, "as for X"),
    row(
        "axes.Z.rate_limit_um_per_s",
        "µm/s",
        RATE_UM_PER_S,
        "as for X",
    ),
    row(
        "axes.Z.acceleration_limit_um_per_s2",
        "µm/s²",
        ACCELERATION_UM_PER_S2,
        "as for X",
    ),
    word(
        "extrapolate",
        "linear, hold or refuse: what happens outside the blocks' span",
    ),
    row(
        "physical_rate_um_per_min",
        "µm/min",
        (0.01, 1000.0),
        "fastest drift that heat can make; a model that changes faster is kept back",
    ),
    row(
        "jump_margin_um",
        "µm",
        (0.0, 1000.0),
        "change between models that is never a jump",
    ),
    row(
        "expanded_uncertainty_limit_um",
        "µm",
        (0.1, 1000.0),
        "greatest expanded uncertainty (k = 2) of a drift at the travel's corners; beyond it the axis is refused",
    ),
    row(
        "hold_s",
        "s",
        (0.0, 3600.0),
        "how long the last good value is held once the model is refused",
    ),
    row(
        "fade_s",
        "s",
        (0.01, 3600.0),
        "time in which an offset is faded to zero",
    ),
    row(
        "shutdown_fade_s",
        "s",
        (0.01, 60.0),
        "the same when the node is told to end, where that is shorter; the axes' limits of rate and acceleration hold all the same",
    ),
    row(
        "gap_s",
        "s",
        (0.001, 60.0),
        "silence of the axes' state after which it counts as stale",
    ),
    word("enabled", "whether compensation is on from the start"),
    word(
        "autostart",
        "whether the node configures and activates itself at its start; otherwise somebody does so (`ros2 lifecycle set`)",
    ),
    word(
        "positioning.X.reading",
        "refreshed_table or weighted_increments: which reading of the dual loop compensates; the same keys exist for Y and Z",
    ),
    row(
        "positioning.X.weight",
        "",
        config::WEIGHT,
        "of a new measurement in the table (refreshed_table; 0: never), or of the table beside what is measured at once",
    ),
    word(
        "positioning.X.directions",
        "together: one table as the mean of both directions; apart: one for each",
    ),
    word(
        "positioning.X.thermal_part",
        "whether the thermal part is added too; a table that is measured again holds the screw's growth already",
    ),
    row(
        "positioning.X.measured_limit_um",
        "µm",
        config::MEASURED_LIMIT_UM,
        "greatest difference between a measurement and what is known that is believed",
    ),
    row(
        "positioning.X.runs",
        "",
        config::RUN_LIMITS,
        "runs after which a test gives a table",
    ),
    row(
        "positioning.X.settle_s",
        "s",
        config::SETTLE_S,
        "what is left out of a dwell at its begin",
    ),
    row(
        "positioning.X.dwell_s",
        "s",
        config::DWELL_S,
        "least time averaged at a point",
    ),
    row(
        "positioning.X.measuring_feed_limit_mm_min",
        "mm/min",
        config::FEED_MM_MIN,
        "greatest feed at which is measured while the machine works",
    ),
    row(
        "positioning.X.steady_s",
        "s",
        config::STEADY_S,
        "for how long the speed must have been one before a pass counts, 0: any below the feed limit",
    ),
    word(
        "positioning.X.unpassed_follow",
        "whether points that are not passed while the machine works move with those beside them that are",
    ),
    word(
        "positioning.X.ends_follow",
        "the rule of before unpassed_follow: whether the ends move with the outermost point from its sixth pass on",
    ),
    row(
        "positioning.X.loop_cycle_s",
        "s",
        config::CYCLE_S,
        "cycle of the measured loop of weighted_increments",
    ),
    row(
        "positioning.X.loop_delay_cycles",
        "",
        config::DELAY_CYCLES,
        "cycles until the scale shows what the loop asked for",
    ),
    list(
        "positioning.X.start_points_mm",
        "mm",
        "points of a table to begin with; empty: none until a test gives one",
    ),
    list(
        "positioning.X.start_deviations_um",
        "µm",
        "deviations scale minus motor at these points, upwards where directions are apart",
    ),
    list(
        "positioning.X.start_deviations_down_um",
        "µm",
        "the same downwards; empty: as upwards",
    ),
    word("positioning.Y.reading", "as for X"),
    row("positioning.Y.weight", "", config::WEIGHT, "as for X"),
    word("positioning.Y.directions", "as for X"),
    word("positioning.Y.thermal_part", "as for X"),
    row(
        "positioning.Y.measured_limit_um",
        "µm",
        config::MEASURED_LIMIT_UM,
        "as for X",
    ),
    row("positioning.Y.runs", "", config::RUN_LIMITS, "as for X"),
    row("positioning.Y.settle_s", "s", config::SETTLE_S, "as for X"),
    row("positioning.Y.dwell_s", "s", config::DWELL_S, "as for X"),
    row(
        "positioning.Y.measuring_feed_limit_mm_min",
        "mm/min",
        config::FEED_MM_MIN,
        "as for X",
    ),
    row("positioning.Y.steady_s", "s", config::STEADY_S, "as for X"),
    word("positioning.Y.unpassed_follow", "as for X"),
    word("positioning.Y.ends_follow", "as for X"),
    row(
        "positioning.Y.loop_cycle_s",
        "s",
        config::CYCLE_S,
        "as for X",
    ),
    row(
        "positioning.Y.loop_delay_cycles",
        "",
        config::DELAY_CYCLES,
        "as for X",
    ),
    list("positioning.Y.start_points_mm", "mm", "as for X"),
    list("positioning.Y.start_deviations_um", "µm", "as for X"),
    list("positioning.Y.start_deviations_down_um", "µm", "as for X"),
    word("positioning.Z.reading", "as for X"),
    row("positioning.Z.weight", "", config::WEIGHT, "as for X"),
    word("positioning.Z.directions", "as for X"),
    word("positioning.Z.thermal_part", "as for X"),
    row(
        "positioning.Z.measured_limit_um",
        "µm",
        config::MEASURED_LIMIT_UM,
        "as for X",
    ),
    row("positioning.Z.runs", "", config::RUN_LIMITS, "as for X"),
    row("positioning.Z.settle_s", "s", config::SETTLE_S, "as for X"),
    row("positioning.Z.dwell_s", "s", config::DWELL_S, "as for X"),
    row(
        "positioning.Z.measuring_feed_limit_mm_min",
        "mm/min",
        config::FEED_MM_MIN,
        "as for X",
    ),
    row("positioning.Z.steady_s", "s", config::STEADY_S, "as for X"),
    word("positioning.Z.unpassed_follow", "as for X"),
    word("positioning.Z.ends_follow", "as for X"),
    row(
        "positioning.Z.loop_cycle_s",
        "s",
        config::CYCLE_S,
        "as for X",
    ),
    row(
        "positioning.Z.loop_delay_cycles",
        "",
        config::DELAY_CYCLES,
        "as for X",
    ),
    list("positioning.Z.start_points_mm", "mm", "as for X"),
    list("positioning.Z.start_deviations_um", "µm", "as for X"),
    list("positioning.Z.start_deviations_down_um", "µm", "as for X"),
    list(
        "geometry.tool_offset_mm",
        "mm",
        "from the machine file's functional point to the tip that works, X Y Z; without geometry no geometry model is used",
    ),
    row(
        "geometry.jump_limit_um",
        "µm",
        JUMP_LIMIT_UM,
        "greatest change of the tip's error between two geometry models that is not a jump",
    ),
    ParameterDoc {
        name: "machine_file",
        unit: "",
        description: "Machine file, relative to the parameter file.",
        range: None,
    },
];
