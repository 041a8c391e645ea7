//! Where keys belong that people put one level too high or too deep.

/// Key, and what it belongs under.
const HOMES: &[(&str, &str)] = &[
    ("travel_mm", AXIS),
    ("feed_limit_mm_min", AXIS),
    ("acceleration_limit_mm_s2", AXIS),
    ("lead_mm", AXIS),
    ("velocity_loop", "a letter of axes"),
    ("position_gain_per_s", "a letter of axes"),
    ("velocity_feedforward", "a letter of axes"),
    ("guide_friction", AXIS),
    ("encoder_resolution_um", AXIS),
    ("scale_resolution_um", AXIS),
    ("position_feedback", AXIS),
    ("travel_deg", ROTARY_AXIS),
    ("feed_limit_deg_min", ROTARY_AXIS),
    ("acceleration_limit_deg_s2", ROTARY_AXIS),
    ("encoder_resolution_arcsec", ROTARY_AXIS),
    ("origin_mm", "rotary"),
    ("servo_period_ms", "control"),
    ("pulse_equivalent_um", "control"),
    ("latch", "control"),
    ("max_speed_rpm", "spindle"),
    ("styli", "probe"),
    ("mounted", "probe"),
    ("standoff_mm", "probe"),
    ("overtravel_mm", "probe"),
    ("corner_mm", "an entry of blocks"),
    ("approach_sign", "an entry of blocks"),
    ("inset_mm", "an entry of blocks"),
    ("top_z_mm", "table"),
    ("nose_radius_mm", "table"),
    ("placements", "grid_encoder"),
    (
        "beams",
        "length_reference of a machine file, or a step `do: diagonals` of a plan",
    ),
    (
        "tool_offset_mm",
        "an entry of grid_encoder.placements or length_reference.beams",
    ),
    ("separator", "the map itself, beside test"),
    ("decimal", "the map itself, beside test"),
    ("start_s", "the map itself, beside test"),
    (
        "at_mm",
        "the map itself, beside test; in a plan under a step `do: positioning` or `do: scan`",
    ),
    ("target_mm", "test.positioning"),
    ("deviation_um", "test.positioning"),
    ("measured_mm", "test.positioning"),
    ("passes_um", "test.positioning"),
    ("same_target_um", "test.positioning"),
    ("units", "the map itself, beside test"),
    ("sheet", "the map itself, beside test"),
    ("direction", "test.positioning"),
    ("radial_um", "test.circle"),
    ("displacement_um", "test.log"),
    ("time_s", "test.log"),
    (
        "axis",
        "a step `do: positioning` or `do: scan` of a plan, test.positioning or test.log of an import map, or a value of a log's map",
    ),
    ("unit", "a value of the map: values.KEY.unit"),
    ("targets_mm", "a step `do: positioning` or `do: scan`"),
    ("spacing_mm", "a step `do: positioning` or `do: scan`"),
    (
        "overrun_mm",
        "a step `do: positioning`, `do: scan` or `do: diagonals`, or test.positioning of a map",
    ),
    (
        "feed_mm_min",
        "probe of a machine file, a measuring step of a plan, or the test of a map",
    ),
    ("feeds_mm_min", "a step `do: latency`"),
    (
        "runs",
        "a step `do: positioning`, `do: scan` or `do: diagonals`",
    ),
    ("stations", "a step `do: grid`"),
    ("minutes", "a step `do: produce`"),
    ("seconds", "a step `do: wait`"),
    ("serve_updates", "a step `do: produce`"),
    ("coverage_factor", "grid_encoder or length_reference"),
    ("rate_limit_per_s", "change of a value: values.KEY.change"),
    ("sample_period_s", "change of a value: values.KEY.change"),
    ("confirm_s", "change of a value: values.KEY.change"),
];
const AXIS: &str = "a letter of axes: axes.X, axes.Y or axes.Z";
const ROTARY_AXIS: &str = "a letter of axes: axes.A, axes.B or axes.C";

/// What a key belongs under, where it is a key of one of our files.
pub(super) fn home_of(key: &str) -> Option<&'static str> {
    let mut homes = HOMES.iter();
    homes
        .find(|(known, _)| *known == key)
        .map(|(_, home)| *home)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::yaml::known_keys;

    #[test]
    fn a_key_of_another_level_is_refused_with_the_level_that_it_belongs_to() {
        for (key, expected, words) in [
            (
                "lead_mm",
                &["name", "axes"][..],
                "it belongs under a letter of axes",
            ),
            ("axis", &["positioning", "circle"][..], "test.positioning"),
            ("unit", &["values"][..], "values.KEY.unit"),
            (
                "latch",
                &[][..],
                "it belongs under control; the keys here are none",
            ),
            (
                "start_s",
                &["run", "target_mm"][..],
                "the map itself, beside test",
            ),
        ] {
            let rule = known_keys(key, expected);
            assert!(rule.contains(words), "{key}: {rule}");
            assert!(
                rule.starts_with(&format!("the key {key} does not belong here")),
                "{rule}"
            );
        }
        assert!(known_keys("latch_", &["name"]).starts_with("unknown key"));
    }

    #[test]
    fn no_key_has_two_rows() {
        let mut keys: Vec<&str> = HOMES.iter().map(|(key, _)| *key).collect();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), HOMES.len());
    }
}
