//! What else could be changed where no run that a machine can make tells two effects apart.

use twin::effects;

/// Levers outside the program, by what the effect is made of.
const LEVERS: [(&[&str], &str); 7] = [
    (
        &["gravity_sag", "load_deflection"],
        "another load or overhang",
    ),
    (
        &["squareness", "straightness", "angular_error", "guide_bow"],
        "another length of tool or stylus, or another height of the instrument",
    ),
    (
        &[
            "probe_pretravel",
            "probe_lobing",
            "stylus_jump",
            "probe_repeatability",
        ],
        "another stylus, or an artefact of known form",
    ),
    (
        &[
            "screw_elongation",
            "spindle_growth",
            "column_bend",
            "ambient_drift",
            "coolant",
            "thermal_shift",
            "workpiece_expansion",
        ],
        "a thermometer on the part in question, or heating it alone",
    ),
    (
        &["thermometer_lag", "thermometer_offset", "thermometer_noise"],
        "a second thermometer beside it",
    ),
    (
        &[
            "plate_error",
            "length_wavelength",
            "length_misalignment",
            "clock_offset",
            "clock_drift",
        ],
        "another instrument, or the same one put up anew and turned",
    ),
    (
        &[
            "latency_modes",
            "latency_jitter",
            "latency_drift",
            "probe_latency",
        ],
        "a second receiver of the trigger",
    ),
];

/// What to change for two effects, by their ids.
pub fn lever(ids: &[&str]) -> String {
    let mut found: Vec<String> = Vec::new();
    for id in ids {
        let known = LEVERS.iter().find(|(of, _)| of.contains(id));
        let words = known.map_or_else(
            || effects::kind(id).map_or_else(String::new, |kind| kind.needs.to_owned()),
            |(_, words)| (*words).to_owned(),
        );
        if !words.is_empty() && !found.contains(&words) {
            found.push(words);
        }
    }
    found.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_of_the_catalogue_has_a_lever_and_every_lever_an_effect() {
        for kind in effects::CATALOGUE {
            assert!(!lever(&[kind.id]).is_empty(), "{}", kind.id);
        }
        for id in LEVERS.iter().flat_map(|(ids, _)| *ids) {
            assert!(effects::kind(id).is_some(), "{id}");
        }
        assert_eq!(
            lever(&["gravity_sag", "load_deflection"]),
            "another load or overhang"
        );
    }
}
