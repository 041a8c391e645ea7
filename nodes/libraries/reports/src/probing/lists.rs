//! Shapes of touches that a control wrote into a list: positions of the ball's centre.

use std::collections::BTreeMap;

use metrology::sample::{FeatureKind, ProbedFeature};
use serde_json::{Value, json};

use super::kind;
use crate::section::{Rows, Section, head, um};

/// What sizes of a list are.
const OF_LIST: &str = "Least squares with one weight for each touch. Positions are of the ball's centre, as the control latched them: a diameter is that of sphere and ball together, of a bore that of the bore less the ball, and pretravel is in it.";

/// The part, where a list has a sphere or a ring.
pub(super) fn shapes(features: &[ProbedFeature]) -> Option<Section> {
    let row = |feature: &ProbedFeature| {
        let mm = |value: f64| format!("{value:.4}");
        vec![
            format!("{}, run {}", feature.feature_id, feature.run),
            name(feature).to_owned(),
            feature.n.to_string(),
            mm(feature.centre_mm.x),
            mm(feature.centre_mm.y),
            mm(feature.centre_mm.z),
            mm(2.0 * feature.radius_mm),
            um(feature.form_mm),
        ]
    };
    let rows: Vec<Vec<String>> = features.iter().map(row).collect();
    (!rows.is_empty()).then(|| {
        let mut section = Section::new("Shapes of the list");
        let shape = |feature: &ProbedFeature| {
            json!({
                "feature": feature.feature_id,
                "run": feature.run,
                "kind": kind(feature),
                "points": feature.n,
                "centre_mm": feature.centre_mm.as_slice(),
                "diameter_mm": 2.0 * feature.radius_mm,
                "radius_mm": feature.radius_mm,
                "form_mm": feature.form_mm,
                "normal": (feature.kind != FeatureKind::Sphere).then(|| feature.normal.as_slice().to_vec()),
            })
        };
        let shapes: Vec<Value> = features.iter().map(shape).collect();
        section.figures = json!({ "test": section.title, "iso230_10_shapes": shapes });
        section.tables.push(Rows {
            head: head(&[
                "feature", "kind", "points", "X / mm", "Y / mm", "Z / mm", "diameter / mm", "form / µm",
            ]),
            rows,
            note: OF_LIST.to_owned(),
        });
        section
    })
}

/// A list does not say from which side a ring was touched.
const fn name(feature: &ProbedFeature) -> &'static str {
    match feature.kind {
        FeatureKind::Sphere => "sphere",
        FeatureKind::Plane => "plane",
        FeatureKind::Bore | FeatureKind::Boss => "ring or bore",
    }
}

/// Name and value in mm of each figure of a feature.
type Named<'f> = (&'f str, Vec<(&'static str, f64)>);

/// Figures of features by their names, as histories and limits take them; of a feature that was measured again those of the
/// measurement whose first figure is the greatest.
pub(super) fn by_feature<'f>(all: impl Iterator<Item = Named<'f>>) -> Value {
    let mut greatest: BTreeMap<String, Vec<(&str, f64)>> = BTreeMap::new();
    let first = |figures: &[(&str, f64)]| figures.first().map_or(f64::NAN, |(_, mm)| *mm);
    for (feature, figures) in all {
        // Points part the names of a path.
        let known = greatest.entry(feature.replace('.', "_")).or_default();
        if known.is_empty() || first(known) < first(&figures) {
            *known = figures;
        }
    }
    let object = |figures: Vec<(&str, f64)>| -> Value {
        let quantities = figures.into_iter();
        quantities
            .map(|(name, mm)| (name.to_owned(), quantity(mm)))
            .collect::<serde_json::Map<String, Value>>()
            .into()
    };
    let features = greatest.into_iter();
    features
        .map(|(name, figures)| (name, object(figures)))
        .collect::<serde_json::Map<String, Value>>()
        .into()
}

/// A quantity as a history takes it; without a certificate it has no uncertainty.
fn quantity(value_mm: f64) -> Value {
    json!({ "value_mm": value_mm, "expanded_uncertainty_mm": null })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_greatest_of_several_measurements_stands_for_its_feature() {
        let all = [
            ("a.1", vec![("range", 0.002), ("s", 0.001)]),
            ("b", vec![("range", 0.005)]),
            ("a.1", vec![("range", 0.003), ("s", 0.0005)]),
            ("a.1", vec![("range", 0.001), ("s", 0.009)]),
        ];
        let found = by_feature(all.into_iter());
        assert_eq!(found["a_1"]["range"]["value_mm"], 0.003);
        assert_eq!(found["a_1"]["s"]["value_mm"], 0.0005);
        assert_eq!(found["b"]["range"]["value_mm"], 0.005);
    }
}
