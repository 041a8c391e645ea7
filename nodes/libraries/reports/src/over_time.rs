//! A warm-up over time: drift at the blocks, tool error without and with compensation, offsets of the axes.

use std::collections::BTreeMap;

use anyhow::Result;
use maud::{Markup, html};
use metrology::Axis;
use metrology::stamp::{Host, Stamp};

use super::page::{figure, fold};
use super::plot::{Plot, Trace, svg};
use super::screen::Tile;
use super::svg::short;
use super::tool_error::ToolError;
use crate::evidence::Evidence;

/// Seconds of an hour.
const HOUR_S: f64 = 3600.0;
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

/// The greatest drift of a face, as a tile.
pub fn greatest_drift(evidence: &Evidence) -> Option<Tile> {
    let (axis, trace, size_um) = most(evidence)?;
    let value = format!("{} µm in {axis}", short(size_um));
    Some(Tile::new("greatest drift at a block", value, trace.name))
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
    let caption = "What compensation added to each axis.";
    let drawn = figure(&svg(&plot)?, caption);
    Ok(fold(
        "Offsets that compensation applied",
        None,
        false,
        &drawn,
    ))
}
