//! Touches along given directions of the probe's axis: the angles that follow from each, and those at contact.

use maud::{Markup, html};
use metrology::Axis;
use metrology::sample::{ProbedPoint, Rejection};
use node_runtime::Diagnostic;
use serde_json::{Value, json};

use super::page::{fold, table};
use super::svg::unsigned_zero;
use crate::evidence::Evidence;

/// Head of the table.
pub const TOUCH_COLUMNS: [&str; 5] = [
    "touch",
    "probe axis",
    "A, C / deg",
    "other solution / deg",
    "at contact off by A, C / arcsec",
];
/// Arc seconds in a degree.
const ARCSEC: f64 = 3600.0;

/// The section; empty where there was no such touch.
pub fn section(evidence: &Evidence) -> Markup {
    let rows = rows(evidence);
    html! {
        @if !rows.is_empty() {
            (fold("Touches along given directions", None, false, &html! {
            (table(&TOUCH_COLUMNS, &rows))
            p.note { "The probe axis points from the ball to the spindle, in the workpiece frame. A and C follow from it; of the two solutions the nearest inside the travel is taken. At contact: by how much the rotary encoders were off these angles, from the positions of probe/point, which report.json has." }
            }))
        }
    }
}

/// A row for each touch.
pub fn rows(evidence: &Evidence) -> Vec<Vec<String>> {
    let of_pointing = |pointing: &Diagnostic| {
        let (a_deg, c_deg) = (number(pointing, "a_deg"), number(pointing, "c_deg"));
        let axis =
            ["axis_x", "axis_y", "axis_z"].map(|key| format!("{:.4}", number(pointing, key)));
        let touches = touches(evidence, pointing).map(|point| {
            let at = at_contact_deg(point);
            vec![
                value(pointing, "feature").to_owned(),
                axis.join(", "),
                pair([a_deg, c_deg]),
                other(pointing),
                [at[0] - a_deg, at[1] - c_deg]
                    .map(|off_deg| signed(off_deg * ARCSEC))
                    .join(", "),
            ]
        });
        touches.collect::<Vec<_>>()
    };
    evidence.pointings.iter().flat_map(of_pointing).collect()
}

/// The same for machines.
pub fn figures(evidence: &Evidence) -> Value {
    let of_pointing = |pointing: &Diagnostic| {
        let touch = |point: &ProbedPoint| {
            let [a_deg, c_deg] = at_contact_deg(point);
            let mm = point.point_in_workpiece_mm;
            json!({"a_deg": a_deg, "c_deg": c_deg, "point_in_workpiece_mm": [mm.x, mm.y, mm.z]})
        };
        let axis = ["axis_x", "axis_y", "axis_z"].map(|key| number(pointing, key));
        json!({
            "feature": value(pointing, "feature"),
            "probe_axis": axis,
            "a_deg": number(pointing, "a_deg"),
            "c_deg": number(pointing, "c_deg"),
            "other_a_deg": number(pointing, "other_a_deg"),
            "other_c_deg": number(pointing, "other_c_deg"),
            "other_is_inside_travel": value(pointing, "other_is_inside_travel") == "true",
            "c_is_free": value(pointing, "singular") == "true",
            "touches": touches(evidence, pointing).map(touch).collect::<Vec<_>>(),
        })
    };
    evidence.pointings.iter().map(of_pointing).collect()
}

/// Touches of a direction that can be used.
fn touches<'a>(
    evidence: &'a Evidence,
    pointing: &'a Diagnostic,
) -> impl Iterator<Item = &'a ProbedPoint> {
    let (run, feature) = (value(pointing, "run"), value(pointing, "feature"));
    let points = evidence.points.iter();
    points
        .filter(move |(of, point)| {
            of.to_string() == run
                && point.feature_id == feature
                && point.rejection == Rejection::None
        })
        .map(|(_, point)| point)
}

fn at_contact_deg(point: &ProbedPoint) -> [f64; 2] {
    [Axis::A, Axis::C].map(|axis| point.axes_at_contact[axis].to_degrees())
}

fn other(pointing: &Diagnostic) -> String {
    if value(pointing, "singular") == "true" {
        return "C is free".to_owned();
    }
    let angles = pair(["other_a_deg", "other_c_deg"].map(|key| number(pointing, key)));
    if value(pointing, "other_is_inside_travel") == "true" {
        angles
    } else {
        format!("{angles}, outside the travel")
    }
}

fn pair(angles_deg: [f64; 2]) -> String {
    let text = angles_deg.map(|angle_deg| unsigned_zero(format!("{angle_deg:.4}")));
    text.join(", ")
}

/// A difference with its sign; a zero has that of a sum.
fn signed(value: f64) -> String {
    let number = unsigned_zero(format!("{value:.2}"));
    if number.starts_with('-') {
        number
    } else {
        format!("+{number}")
    }
}

fn value<'a>(pointing: &'a Diagnostic, key: &str) -> &'a str {
    let found = pointing.values.iter().find(|(name, _)| *name == key);
    found.map_or("", |(_, value)| value.as_str())
}

fn number(pointing: &Diagnostic, key: &str) -> f64 {
    value(pointing, key).parse().unwrap_or(f64::NAN)
}
