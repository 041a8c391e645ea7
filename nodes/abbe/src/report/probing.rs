//! ISO 230-10 and 230-3 of a bag: how touches repeat, how round shapes come out, how readings drift.

use std::collections::BTreeMap;

use anyhow::Result;
use metrology::Axis;
use metrology::sample::{BlockMeasurement, FeatureKind, ProbedFeature, ProbedPoint, TestSegment};

use serde::Serialize;
use serde_json::{Value, json};

use super::plot::{self, Plot, Trace};
use super::section::{Drawing, Rows, Section, head, um};

mod repeatability;

/// Drift is told after this time, s: the hour of ISO 230-3.
const AN_HOUR_S: f64 = 3600.0;

/// The parts that the bag has something for.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn sections(
    touches: &[(TestSegment, ProbedPoint)],
    features: &[ProbedFeature],
    blocks: &[BlockMeasurement],
) -> Result<Vec<Section>> {
    let mut sections = Vec::new();
    sections.extend(repeatability::section(touches));
    sections.extend(shapes(features));
    sections.extend(drift(blocks)?);
    Ok(sections)
}

/// Greatest minus least.
fn range(values: impl Iterator<Item = f64>) -> f64 {
    let ends = (f64::INFINITY, f64::NEG_INFINITY);
    let (least, greatest) = values.fold(ends, |(l, g), v| (l.min(v), g.max(v)));
    greatest - least
}

fn kind(feature: &ProbedFeature) -> &'static str {
    match feature.kind {
        FeatureKind::Plane => "plane",
        FeatureKind::Bore => "bore",
        FeatureKind::Boss => "boss",
        FeatureKind::Sphere => "sphere",
    }
}

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
        let mut section = Section::new("Shapes, ISO 230-10");
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
            head: head(&["feature", "kind", "points", "form / µm", "radius / mm"]),
            rows,
            note: "Form: greatest minus least distance from the fitted shape; 25 points on a sphere are usual.".to_owned(),
        });
        section
    })
}

/// Readings of one face: time since the first of all (s), position (mm).
type Series = BTreeMap<(String, Axis), Vec<(f64, f64)>>;

/// Faces that were read twice or more.
fn faces(blocks: &[BlockMeasurement]) -> Series {
    let mut series = Series::new();
    for block in blocks {
        for axis in Axis::LINEAR {
            if let Some(face) = block.faces[axis] {
                let time_s = (block.at - blocks[0].at).as_secs_f64();
                series
                    .entry((block.block_id.clone(), axis))
                    .or_default()
                    .push((time_s, face.position_mm));
            }
        }
    }
    series.retain(|_, values| values.len() >= 2);
    series
}

/// How the readings of one face drift.
#[derive(Serialize)]
struct FaceDrift {
    face: String,
    recorded_h: f64,
    after_1_h_mm: Option<f64>,
    range_mm: f64,
}

impl FaceDrift {
    /// Of readings in time: s since the first of all, mm.
    fn new(face: String, values: &[(f64, f64)]) -> Self {
        let cold_mm = values.first().map_or(0.0, |(_, position_mm)| *position_mm);
        let after = values.iter().find(|(time_s, _)| *time_s >= AN_HOUR_S);
        Self {
            face,
            recorded_h: values.last().map_or(0.0, |(time_s, _)| time_s / 3600.0),
            after_1_h_mm: after.map(|(_, position_mm)| position_mm - cold_mm),
            range_mm: range(values.iter().map(|(_, position_mm)| *position_mm)),
        }
    }
}

fn drift(blocks: &[BlockMeasurement]) -> Result<Option<Section>> {
    let series = faces(blocks);
    if series.is_empty() {
        return Ok(None);
    }
    let mut section = Section::new("Drift of the readings, after ISO 230-3");
    let drifts: Vec<FaceDrift> = series
        .iter()
        .map(|((block, axis), values)| FaceDrift::new(format!("{block} {axis}"), values))
        .collect();
    let row = |drift: &FaceDrift| {
        vec![
            drift.face.clone(),
            format!("{:.2}", drift.recorded_h),
            drift.after_1_h_mm.map_or_else(|| "—".to_owned(), um),
            um(drift.range_mm),
        ]
    };
    let rows = drifts.iter().map(row).collect();
    section.figures = json!({ "test": section.title, "iso230_3": drifts });
    section.tables.push(Rows {
        head: head(&["face", "recorded / h", "after 1 h / µm", "range / µm"]),
        rows,
        note: "By the machine's own probe on its reference blocks, not by sensors on a spindle: drift of probe, machine and blocks together.".to_owned(),
    });
    for axis in Axis::LINEAR {
        let traces: Vec<Trace> = series
            .iter()
            .filter(|((_, of), _)| *of == axis)
            .map(|((block, _), values)| Trace {
                name: block.clone(),
                points: values
                    .iter()
                    .map(|(t, p)| (t / 3600.0, (p - values[0].1) * 1e3))
                    .collect(),
                marks: false,
            })
            .collect();
        if !traces.is_empty() {
            section.drawings.push(Drawing {
                svg: plot::svg(&Plot {
                    x: "time since the first reading / h".to_owned(),
                    y: format!("drift of the {axis} reading / µm"),
                    traces,
                })?,
                caption: format!("{axis} face of each block"),
            });
        }
    }
    Ok(Some(section))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drift_is_told_after_an_hour_and_over_all() {
        let values = [
            (0.0, 10.0),
            (1800.0, 9.999),
            (3700.0, 10.004),
            (7200.0, 10.002),
        ];
        let drift = FaceDrift::new("block_1 X".to_owned(), &values);
        assert!((drift.recorded_h - 2.0).abs() < 1e-12);
        assert!((drift.after_1_h_mm.unwrap() - 0.004).abs() < 1e-12);
        assert!((drift.range_mm - 0.005).abs() < 1e-12);
        let short = FaceDrift::new("block_1 X".to_owned(), &values[..2]);
        assert_eq!(short.after_1_h_mm, None);
    }
}
