//! A warm-up over time: drift at the blocks, tool error without and with compensation, offsets of the axes.

use std::collections::BTreeMap;

use anyhow::Result;
use maud::{Markup, html};
use metrology::Axis;
use metrology::sample::FacePosition;
use metrology::stamp::{Host, Stamp};

use super::page::{figure, fold};
use super::plot::{Plot, Trace, svg};
use super::screen::Tile;
use super::section::rounded;
use super::tool_error::ToolError;
use crate::evidence::Evidence;

/// Seconds of an hour.
const HOUR_S: f64 = 3600.0;
/// Coverage factor of what is printed.
const COVERAGE: f64 = 2.0;
/// Length below which times of a run are shown in minutes, h.
const SHORT_H: f64 = 1.0;

/// Begin of the first test.
pub fn start(evidence: &Evidence) -> Stamp<Host> {
    evidence
        .segments
        .first()
        .map_or_else(Stamp::default, |first| first.at)
}

/// Unit of the time axis and its seconds.
fn unit(evidence: &Evidence) -> (&'static str, f64) {
    let begin = start(evidence);
    let last = evidence.segments.last().map_or(begin, |last| last.at);
    if (last - begin).as_secs_f64() < SHORT_H * HOUR_S {
        ("min", 60.0)
    } else {
        ("h", HOUR_S)
    }
}

/// Drift of each block's face over time by axis, µm, and the unit of the time.
pub fn drift(evidence: &Evidence) -> (BTreeMap<Axis, Vec<Trace>>, &'static str) {
    let (unit, unit_s) = unit(evidence);
    let mut cold = BTreeMap::new();
    let mut traces: BTreeMap<Axis, BTreeMap<String, Vec<(f64, f64)>>> = BTreeMap::new();
    let start = start(evidence);
    for block in &evidence.blocks {
        for axis in Axis::LINEAR {
            let Some(face) = block.faces[axis] else {
                continue;
            };
            let key = (block.block_id.clone(), axis);
            if block.cold {
                cold.insert(key.clone(), face.position_mm);
            }
            if let Some(cold_mm) = cold.get(&key) {
                let at = (face.at - start).as_secs_f64() / unit_s;
                let point = (at, (face.position_mm - cold_mm) * 1e3);
                let of_axis = traces.entry(axis).or_default();
                of_axis.entry(key.0).or_default().push(point);
            }
        }
    }
    let named = |(name, points)| Trace {
        name,
        points,
        marks: false,
    };
    let mut drift: BTreeMap<Axis, Vec<Trace>> = BTreeMap::new();
    for (axis, blocks) in traces {
        let seen = blocks
            .into_iter()
            .map(named)
            .filter(|trace| trace.points.len() > 1);
        let seen: Vec<Trace> = seen.collect();
        if !seen.is_empty() {
            drift.insert(axis, seen);
        }
    }
    (drift, unit)
}

/// The face that drifted most: its axis, and its line, µm.
fn most(evidence: &Evidence) -> Option<(Axis, Trace, f64)> {
    let (drift, _) = drift(evidence);
    let all = drift.into_iter().flat_map(|(axis, traces)| {
        traces.into_iter().map(move |trace| {
            let sizes = trace.points.iter().map(|point| point.1.abs());
            let size_um = sizes.fold(0.0, f64::max);
            (axis, trace, size_um)
        })
    });
    all.max_by(|a, b| a.2.total_cmp(&b.2))
}

/// The reading that is farthest from the cold one of its face.
struct Farthest {
    axis: Axis,
    block: String,
    drift_um: f64,
    /// Of the difference of two readings, without the latency that both share, k = 2, µm.
    expanded_uncertainty_um: f64,
    at: Stamp<Host>,
}

fn farthest(evidence: &Evidence) -> Option<Farthest> {
    let mut cold = BTreeMap::new();
    let mut found: Option<Farthest> = None;
    for block in &evidence.blocks {
        for axis in Axis::LINEAR {
            let Some(face) = block.faces[axis] else {
                continue;
            };
            let key = (block.block_id.as_str(), axis);
            if block.cold {
                cold.insert(key, face);
            }
            let Some(first) = cold.get(&key) else {
                continue;
            };
            let drift_um = (face.position_mm - first.position_mm) * 1e3;
            let u_mm = [first, &face].map(FacePosition::independent_uncertainty_mm);
            if found
                .as_ref()
                .is_none_or(|most| drift_um.abs() > most.drift_um.abs())
            {
                found = Some(Farthest {
                    axis,
                    block: block.block_id.clone(),
                    drift_um,
                    expanded_uncertainty_um: COVERAGE * u_mm[0].hypot(u_mm[1]) * 1e3,
                    at: face.at,
                });
            }
        }
    }
    found.filter(|most| most.drift_um.abs() > 0.0)
}

impl Farthest {
    fn value(&self) -> String {
        let (value, u) = rounded(self.drift_um, self.expanded_uncertainty_um);
        format!("{value} ± {u} µm in {}", self.axis)
    }

    fn when(&self, evidence: &Evidence) -> String {
        let (unit, unit_s) = unit(evidence);
        let at = (self.at - start(evidence)).as_secs_f64() / unit_s;
        format!("{}, {at:.1} {unit} after the start", self.block)
    }
}

/// The greatest drift of a face, as a tile.
pub fn greatest_drift(evidence: &Evidence) -> Option<Tile> {
    let most = farthest(evidence)?;
    let more = format!("{}; k = 2", most.when(evidence));
    Some(Tile::new("greatest drift at a block", most.value(), more))
}

/// The same as a sentence.
pub fn most_in_words(evidence: &Evidence) -> Option<String> {
    let most = farthest(evidence)?;
    let when = most.when(evidence);
    Some(format!("Greatest: {}, {when} (k = 2).", most.value()))
}

/// The greatest drift with the tool error without and with compensation beside it.
///
/// # Errors
/// When the plot cannot be drawn.
pub fn picture(evidence: &Evidence, errors: &[ToolError]) -> Result<Option<Markup>> {
    let (unit, unit_s) = unit(evidence);
    let mut traces = Vec::new();
    if let Some((axis, trace, _)) = most(evidence) {
        let name = format!("drift of {axis} at {}", trace.name);
        traces.push(Trace { name, ..trace });
    }
    let begin = start(evidence);
    for (word, name) in [
        ("without", "tool error without compensation, p95"),
        ("with compensation", "tool error with compensation, p95"),
    ] {
        let at = |error: &ToolError| {
            let mut all = evidence.verifications.iter();
            let own = all.find(|one| one.label == error.label)?;
            let time = (own.at - begin).as_secs_f64() / unit_s;
            Some((time, error.change_p95_mm * 1e3))
        };
        let of = errors.iter().filter(|error| error.label.contains(word));
        let points: Vec<(f64, f64)> = of.filter_map(at).collect();
        if !points.is_empty() {
            traces.push(Trace {
                name: name.to_owned(),
                marks: points.len() == 1,
                points,
            });
        }
    }
    if traces.is_empty() {
        return Ok(None);
    }
    let plot = Plot {
        x: format!("time since start / {unit}"),
        y: "change since cold / µm".to_owned(),
        traces,
    };
    let caption =
        "The face that drifted most, and the size of the tool error at the verifications.";
    Ok(Some(figure(&svg(&plot)?, caption)))
}

/// The offsets that compensation applied, over time; nothing without offsets.
///
/// # Errors
/// When the plot cannot be drawn.
pub fn section(evidence: &Evidence) -> Result<Markup> {
    let (unit, unit_s) = unit(evidence);
    let begin = start(evidence);
    let of_axis = |axis: Axis| {
        let points = evidence.offsets.points().iter().map(|(at, offsets_mm)| {
            let time = (*at - begin).as_secs_f64() / unit_s;
            (time, offsets_mm[axis.index()] * 1e3)
        });
        Trace {
            name: axis.letter().to_owned(),
            points: points.collect(),
            marks: false,
        }
    };
    let traces: Vec<Trace> = Axis::LINEAR.into_iter().map(of_axis).collect();
    let is_zero = |trace: &Trace| trace.points.iter().all(|point| point.1.abs() < 1e-9);
    if traces.iter().all(is_zero) {
        return Ok(html! {});
    }
    let plot = Plot {
        x: format!("time since start / {unit}"),
        y: "offset of the axis / µm".to_owned(),
        traces,
    };
    let caption = "Offset that compensation added to each axis.";
    let drawn = figure(&svg(&plot)?, caption);
    let all = traces_of(&plot);
    let greatest = all.max_by(|a, b| a.1.total_cmp(&b.1));
    let answer = greatest.map(|(name, um)| format!("At most {um:.1} µm, in {name}."));
    Ok(fold(
        "Offsets that compensation applied",
        answer.as_deref(),
        false,
        &drawn,
    ))
}

/// Name and greatest size of each line, µm.
fn traces_of(plot: &Plot) -> impl Iterator<Item = (&str, f64)> {
    plot.traces.iter().map(|trace| {
        let sizes = trace.points.iter().map(|point| point.1.abs());
        (trace.name.as_str(), sizes.fold(0.0, f64::max))
    })
}

#[cfg(test)]
mod tests {
    use metrology::PerAxis;
    use metrology::sample::{BlockMeasurement, LatencyShare};

    use super::*;

    fn block(z_mm: f64, cold: bool) -> BlockMeasurement {
        let mut faces = PerAxis::default();
        faces[Axis::Z] = Some(FacePosition {
            position_mm: z_mm,
            standard_uncertainty_mm: 0.0005,
            at: Stamp::from_nanos(90_000_000_000),
            latency: LatencyShare::default(),
        });
        BlockMeasurement {
            at: Stamp::from_nanos(90_000_000_000),
            block_id: "block_1".to_owned(),
            faces,
            cold,
            run: 1,
        }
    }

    #[test]
    fn the_greatest_drift_has_the_uncertainty_of_a_difference() {
        let evidence = Evidence {
            blocks: vec![block(20.0, true), block(20.0007, false)],
            ..Evidence::default()
        };
        // 2 sqrt(0.5^2 + 0.5^2) = 1.41.
        let tile = greatest_drift(&evidence).unwrap();
        assert_eq!(tile.value, "0.7 ± 1.4 µm in Z");
        assert_eq!(tile.more, "block_1, 1.5 min after the start; k = 2");
        assert!(greatest_drift(&Evidence::default()).is_none());
    }
}
