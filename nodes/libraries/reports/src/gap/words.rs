//! What the report calls by ids, in a metrologist's words.

use gap_diagnosis::report::GapReport;
use metrology::{ErrorComponent, squareness};
use twin::effects::{self, Targets};

use crate::geometry;

/// Name of an effect with what it acts on, components by their symbols of ISO 230-1.
pub(super) fn name(effect: &str, axis: &str) -> String {
    let Some(kind) = effects::kind(effect) else {
        return format!("{effect} {axis}").trim_end().to_owned();
    };
    if axis.is_empty() {
        return kind.title.to_owned();
    }
    let place = match kind.targets {
        Targets::Across
        | Targets::Turning
        | Targets::Sagging
        | Targets::RotaryLocations
        | Targets::RotaryMotions => format!("E{axis}"),
        Targets::LinearPairs => {
            between(axis).map_or_else(|| axis.to_owned(), |symbol| format!("{axis} ({symbol})"))
        }
        _ => axis.to_owned(),
    };
    format!("{} {place}", kind.title)
}

/// The same of an effect as figures call it, such as `backlash X`.
pub(super) fn name_of(id: &str) -> String {
    let (effect, axis) = id.split_once(' ').unwrap_or((id, ""));
    name(effect, axis)
}

/// Ends of the names of amplitudes, the longer before those that they end in, each with its unit.
const UNITS: [(&str, &str); 14] = [
    ("_um_per_m_k", "µm/(m K)"),
    ("_um_per_m", "µm/m"),
    ("_um_per_h", "µm/h"),
    ("_um_per_k", "µm/K"),
    ("_um", "µm"),
    ("_mm2", "mm²"),
    ("_mm", "mm"),
    ("_urad", "µrad"),
    ("_ppm", "ppm"),
    ("_ms", "ms"),
    ("_min", "min"),
    ("_hz", "Hz"),
    ("_k", "K"),
    ("_s", "s"),
];
/// Lengths below this are in µm for people, mm.
const SHORT_MM: f64 = 0.1;

/// An amplitude of a size in words: what it is, the factor to its unit, and the unit; such as `width`, 1, `µm`.
pub(super) fn in_units(key: &str, value: f64) -> (String, f64, &'static str) {
    let found = UNITS
        .into_iter()
        .find_map(|(end, unit)| Some((key.strip_suffix(end)?, unit)));
    let (label, unit) = found.unwrap_or((key, ""));
    let (factor, unit) = match unit {
        "mm" if value.abs() < SHORT_MM => (1e3, "µm"),
        unit => (1.0, unit),
    };
    (part_of_curve(label), factor, unit)
}

/// An amplitude of a curve by its power or its wave, and any other without underscores.
fn part_of_curve(label: &str) -> String {
    let part = match label.strip_prefix("free_").unwrap_or(label) {
        "p1" => "linear part",
        "p2" => "quadratic part",
        "p3" => "cubic part",
        "p4" => "part of degree 4",
        "sin" => "sine part",
        "cos" => "cosine part",
        other => return other.replace('_', " "),
    };
    part.to_owned()
}

/// An amplitude and the unit in which its sizes about `typical` are written, such as `width / µm`, and the factor to it.
pub(super) fn with_unit(key: &str, typical: f64) -> (String, f64) {
    let (label, factor, unit) = in_units(key, typical);
    match unit {
        "" => (label, factor),
        unit => (format!("{label} / {unit}"), factor),
    }
}

/// The angle between two linear axes such as `XY`.
fn between(pair: &str) -> Option<ErrorComponent> {
    let one = pair.get(..1)?.parse().ok()?;
    squareness::between(one, pair.get(1..)?.parse().ok()?)
}

/// The sign of every squareness among effects and what they act on.
pub(super) fn signs<'a>(effects: impl Iterator<Item = (&'a str, &'a str)>) -> Option<String> {
    let is_pair = |effect: &str| {
        let kind = effects::kind(effect);
        kind.is_some_and(|kind| matches!(kind.targets, Targets::LinearPairs))
    };
    let pairs = effects.filter(|(effect, _)| is_pair(effect));
    geometry::signs(pairs.filter_map(|(_, axis)| between(axis)))
}

/// A covariate of a report.
pub(super) fn covariate(id: &str) -> String {
    let axis = |letter: &str| letter.to_uppercase();
    if let Some(letter) = id.strip_prefix("position_") {
        return format!("the position of {}", axis(letter));
    }
    if let Some(letter) = id.strip_prefix("velocity_") {
        return format!("the velocity of {}", axis(letter));
    }
    if let Some(letter) = id.strip_prefix("sense*log_distance_since_reversal_") {
        return format!(
            "the distance since {} reversed, with the sign of the motion",
            axis(letter)
        );
    }
    if let Some(thermometer) = id.strip_prefix("temperature_") {
        return format!("thermometer {thermometer}");
    }
    match id {
        "angle" => "the angle on the circle".to_owned(),
        "sense*angle" => "the angle on the circle, with the sign of the sense".to_owned(),
        "approach_angle" => "the direction of approach".to_owned(),
        "feed" => "the feed of the touch".to_owned(),
        "stylus" => "the stylus".to_owned(),
        other => other.to_owned(),
    }
}

/// Where most of the gap is.
pub(super) fn place(report: &GapReport) -> Option<String> {
    let place = report.r#where.first()?;
    let share = |part: f64| {
        if part < 0.005 {
            "hardly any".to_owned()
        } else {
            format!("{:.0} %", 100.0 * part)
        }
    };
    Some(format!(
        "most of it is in {} (direction {}) and changes with {}; that alone explains {} of the gap's structure, and {} more is shared with other quantities",
        place.channel,
        place.direction,
        covariate(&place.covariate),
        share(place.share_unique),
        share(place.share_shared)
    ))
}

/// A power of the feed.
pub(super) fn feed_exponent(exponent: f64) -> String {
    let rounded = (exponent * 10.0).round() / 10.0;
    if rounded.abs() < 0.25 {
        "does not depend on feed".to_owned()
    } else {
        format!("changes with feed to the power {rounded:.1}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_amplitude_has_its_unit_and_no_underscore() {
        for (key, value, wanted) in [
            ("width_um", 6.4, ("width", 1.0, "µm")),
            ("rate_um_per_h", -5.5, ("rate", 1.0, "µm/h")),
            ("growth_um_per_m", 20.0, ("growth", 1.0, "µm/m")),
            ("width_mm", 0.004, ("width", 1e3, "µm")),
            ("period_mm", 10.0, ("period", 1.0, "mm")),
            ("fixed_end", 1.0, ("fixed end", 1.0, "")),
            ("p1_urad", 10.0, ("linear part", 1.0, "µrad")),
            ("free_p3_um", 1.0, ("cubic part", 1.0, "µm")),
        ] {
            let (label, factor, unit) = in_units(key, value);
            assert_eq!((label.as_str(), factor, unit), wanted, "{key}");
        }
        let (label, factor) = with_unit("width_mm", 0.004);
        assert_eq!(label, "width / µm");
        assert!((factor - 1e3).abs() < 1e-9);
        assert_eq!(with_unit("fixed_end", 1.0).0, "fixed end");
    }

    #[test]
    fn components_have_their_symbols_and_covariates_are_words() {
        assert_eq!(name("straightness", "YX"), "straightness EYX");
        assert_eq!(name("squareness", "XY"), "squareness XY (EC0Y)");
        assert_eq!(name("backlash", "X"), "backlash X");
        assert_eq!(name("straightness", ""), "straightness");
        assert_eq!(name_of("squareness XY"), "squareness XY (EC0Y)");
        assert_eq!(signs([("backlash", "X")].into_iter()), None);
        let pairs = [
            ("squareness", "XZ"),
            ("squareness", "XY"),
            ("backlash", "X"),
        ];
        assert_eq!(
            signs(pairs.into_iter()).as_deref(),
            Some(
                "EB0Z above 0: X+ and Z+ enclose less than 90° (ISO 230-1). EC0Y above 0: X+ and Y+ enclose more than 90° (ISO 230-1)."
            )
        );
        assert_eq!(name("probe_latency", ""), "latency of the probe signal");
        assert_eq!(covariate("position_y"), "the position of Y");
        assert!(covariate("sense*log_distance_since_reversal_x").contains("since X reversed"));
        assert_eq!(covariate("time"), "time");
        assert_eq!(feed_exponent(-0.04), "does not depend on feed");
        assert!(feed_exponent(0.96).contains("1.0"));
    }
}
