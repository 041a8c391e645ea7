//! ISO 230-10 and 230-3 of a bag: how touches repeat, how round shapes come out, how readings drift.

use std::collections::BTreeMap;

use anyhow::Result;
use metrology::Axis;
use metrology::sample::{
    BlockMeasurement, FeatureKind, ProbedFeature, ProbedPoint, Rejection, TestSegment,
};

use super::plot::{self, Plot, Trace};
use super::section::{Drawing, Rows, Section, head, um};

/// Fewest touches of one place whose spread says anything.
const LEAST_TOUCHES: usize = 5;
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
    sections.extend(repeatability(touches));
    sections.extend(shapes(features));
    sections.extend(drift(blocks)?);
    Ok(sections)
}

/// Spread of touches of one feature at one feed within one run.
fn repeatability(touches: &[(TestSegment, ProbedPoint)]) -> Option<Section> {
    let mut groups: BTreeMap<(u32, String, i64), Vec<f64>> = BTreeMap::new();
    for (segment, point) in touches {
        if point.rejection == Rejection::None {
            let feed = (point.feed_mm_s * 60.0).round() as i64;
            let along_mm = point.point_in_machine_mm.dot(&point.approach);
            groups
                .entry((segment.run, point.feature_id.clone(), feed))
                .or_default()
                .push(along_mm);
        }
    }
    let rows: Vec<Vec<String>> = groups
        .into_iter()
        .filter(|(_, values)| values.len() >= LEAST_TOUCHES)
        .map(|((run, feature, feed), values)| {
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            let squares = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
            let (least, greatest) = values
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, g), v| {
                    (l.min(*v), g.max(*v))
                });
            vec![
                format!("{feature}, run {run}"),
                feed.to_string(),
                values.len().to_string(),
                um(greatest - least),
                um((squares / (n - 1.0)).sqrt()),
            ]
        })
        .collect();
    (!rows.is_empty()).then(|| {
        let mut section = Section::new("Repeatability of touches, ISO 230-10");
        section.tables.push(Rows {
            head: head(&["feature", "feed / mm/min", "touches", "range / µm", "s / µm"]),
            rows,
            note: format!("Single-point repeatability along the approach; fewer than {LEAST_TOUCHES} touches are not shown."),
        });
        section
    })
}

fn shapes(features: &[ProbedFeature]) -> Option<Section> {
    let rows: Vec<Vec<String>> = features
        .iter()
        .map(|feature| {
            let kind = match feature.kind {
                FeatureKind::Plane => "plane",
                FeatureKind::Bore => "bore",
                FeatureKind::Boss => "boss",
                FeatureKind::Sphere => "sphere",
            };
            let radius = if feature.radius_mm.is_nan() {
                "—".to_owned()
            } else {
                format!("{:.4}", feature.radius_mm)
            };
            vec![
                format!("{}, run {}", feature.feature_id, feature.run),
                kind.to_owned(),
                feature.n.to_string(),
                um(feature.form_mm),
                radius,
            ]
        })
        .collect();
    (!rows.is_empty()).then(|| {
        let mut section = Section::new("Shapes, ISO 230-10");
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

fn drift(blocks: &[BlockMeasurement]) -> Result<Option<Section>> {
    let series = faces(blocks);
    if series.is_empty() {
        return Ok(None);
    }
    let mut section = Section::new("Drift of the readings, after ISO 230-3");
    let mut rows = Vec::new();
    for ((block, axis), values) in &series {
        let cold_mm = values[0].1;
        let after = values.iter().find(|(time_s, _)| *time_s >= AN_HOUR_S);
        let drifts = || values.iter().map(|(_, position_mm)| position_mm - cold_mm);
        let (least, greatest) =
            drifts().fold((0.0, 0.0), |(l, g), d| (f64::min(l, d), f64::max(g, d)));
        rows.push(vec![
            format!("{block} {axis}"),
            format!("{:.2}", values.last().map_or(0.0, |v| v.0) / 3600.0),
            after.map_or_else(
                || "—".to_owned(),
                |(_, position_mm)| um(position_mm - cold_mm),
            ),
            um(greatest - least),
        ]);
    }
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
