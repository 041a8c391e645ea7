//! ISO 230-10 of a bag: how touches repeat, how round shapes and their sizes come out.

use metrology::sample::{FeatureKind, ProbedFeature};

use serde_json::{Value, json};

use super::section::{Rows, Section, head, um};
use super::terminal::Rank;
use crate::evaluate::Tests;
use crate::evaluate::budget::Budget;

mod errors;
mod lists;
mod location;
mod repeatability;
mod slips;

/// The parts that the bag has something for.
pub fn sections(tests: &Tests, budget: Option<&Budget>) -> Vec<Section> {
    let mut sections = Vec::new();
    sections.extend(repeatability::section(tests, budget));
    sections.extend(match is_list(tests) {
        true => lists::shapes(&tests.features),
        false => shapes(&tests.features),
    });
    sections.extend(errors::section(tests, budget));
    sections.extend(location::section(tests, budget));
    sections
}

/// Whether touches are those of a table: positions of the ball's centre, with pretravel.
fn is_list(tests: &Tests) -> bool {
    tests.conditions.imported.is_some()
}

/// Range of a reading with everything at rest, by the budget, mm.
fn drift_mm(budget: Option<&Budget>) -> f64 {
    budget.map_or(0.0, |budget| {
        budget.positioning(None, None).environmental_drift_mm
    })
}

fn kind(feature: &ProbedFeature) -> &'static str {
    match feature.kind {
        FeatureKind::Plane => "plane",
        FeatureKind::Bore => "bore",
        FeatureKind::Boss => "boss",
        FeatureKind::Sphere => "sphere",
    }
}

/// Where the rotary axes stood, for a name; empty without any.
fn pose(feature: &ProbedFeature) -> String {
    let axes = feature.rotary_axes.iter().filter(|axis| !axis.is_linear());
    let stood = |axis: metrology::Axis| {
        let deg = feature.rotary_rad[axis].to_degrees();
        // A zero without a sign.
        format!(" {axis} {:.1}°", (deg * 10.0).round() / 10.0 + 0.0)
    };
    let all: String = axes.map(stood).collect();
    if all.is_empty() {
        all
    } else {
        format!(" at{all}")
    }
}

/// What the form of the probe's fit is, beside P_FTU.
const FIT_OF_PROBE: &str = "The probe's own fit, from which centres and radii are: each touch counts by its uncertainty. Its range is greatest minus least distance from that shape, no figure of ISO 230-10: P_FTU, where all touches have one weight, stands under Probing errors.";

fn shapes(features: &[ProbedFeature]) -> Option<Section> {
    let rows: Vec<Vec<String>> = features
        .iter()
        .map(|feature| {
            let radius = if feature.radius_mm.is_nan() {
                "—".to_owned()
            } else {
                format!("{:.4}", feature.radius_mm)
            };
            vec![
                format!("{}, run {}", feature.feature_id, feature.run),
                kind(feature).to_owned(),
                feature.n.to_string(),
                um(feature.form_mm),
                radius,
            ]
        })
        .collect();
    (!rows.is_empty()).then(|| {
        let mut section = Section::new("Shapes, ISO 230-10").ranked(Rank::Detail);
        let shape = |feature: &ProbedFeature| {
            json!({
                "feature": feature.feature_id,
                "run": feature.run,
                "kind": kind(feature),
                "points": feature.n,
                "form_mm": feature.form_mm,
                "radius_mm": (!feature.radius_mm.is_nan()).then_some(feature.radius_mm),
            })
        };
        let shapes: Vec<Value> = features.iter().map(shape).collect();
        section.figures = json!({ "test": section.title, "iso230_10_shapes": shapes });
        section.tables.push(Rows {
            head: head(&[
                "feature",
                "kind",
                "points",
                "range of the weighted fit / µm",
                "radius / mm",
            ]),
            rows,
            note: FIT_OF_PROBE.to_owned(),
        });
        section
    })
}
