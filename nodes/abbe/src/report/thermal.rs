//! The page of a warm-up: latency, drift at the blocks, tool error before and after compensation.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use anyhow::Result;
use maud::{Markup, html};
use metrology::Axis;
use metrology::stamp::{Host, Stamp};
use nalgebra::Vector3;

use super::page::{figure, table};
use super::plot::{Plot, Trace, svg};
use super::tool_error::{self, ToolError};
use super::{Report, conditions, latency};
use crate::evidence::{Evidence, Verification};

/// Label prefix of the cold verification in a plan.
const COLD: &str = "cold";

/// Writes the page.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn write(title: &str, evidence: &Evidence) -> Result<Report> {
    let errors = tool_errors(&evidence.verifications);
    let mut lines = latency::headline(evidence);
    lines.extend(headline(&errors));
    let mut figures = latency::figures(evidence);
    if let Some((off, on)) = last_pair(&errors) {
        figures["p95_without_mm"] = off.p95_mm.into();
        figures["p95_with_mm"] = on.p95_mm.into();
        figures["max_with_mm"] = on.max_mm.into();
    }
    let drift = drift_traces(evidence);
    let body = html! {
        h1 { (title) }
        @for line in &lines { p { (line) } }
        h2 { "Tool error in the blocks' span, change since cold" }
        (error_table(&errors))
        (places_table(&errors))
        p.note { "All in µm; parts are root mean squares; the whole error includes the geometric error that is there when cold. Truth of the plant at poses that the machine really went to; no node sees it. Shift: common to all poses. Stretch: along each axis itself, all that two blocks can see besides the shift. Rotation: between axes; two blocks on one diagonal take part of it for stretch. Curved: hot zones and bending, which no linear model follows. A shift that is left is the drift since the last block cycle and the probing error." }
        h2 { "Drift at the blocks" }
        @for axis in Axis::LINEAR {
            (figure(&svg(&Plot {
                x: "time since start / h".to_owned(),
                y: format!("drift of the {axis} reading / µm"),
                traces: drift.get(&axis).cloned().unwrap_or_default(),
            })?, &format!("{axis} face of each block")))
        }
        (predictions(evidence))
        (latency::section(evidence)?)
        (conditions::section(evidence))
    };
    Ok(Report {
        title: title.to_owned(),
        lines,
        text: text(&errors),
        body,
        figures,
    })
}

fn tool_errors(verifications: &[Verification]) -> Vec<ToolError> {
    let Some(cold) = verifications
        .iter()
        .find(|check| check.label.starts_with(COLD))
    else {
        return Vec::new();
    };
    verifications
        .iter()
        .filter(|check| !check.label.starts_with(COLD))
        .filter_map(|check| tool_error::judge(cold, check))
        .collect()
}

/// The last verification without and with compensation.
pub fn last_pair(errors: &[ToolError]) -> Option<(&ToolError, &ToolError)> {
    let last = |word: &str| errors.iter().rev().find(|error| error.label.contains(word));
    Some((last("without")?, last("with compensation")?))
}

fn um(length_mm: f64) -> String {
    format!("{:.1}", length_mm * 1e3)
}

fn headline(errors: &[ToolError]) -> Vec<String> {
    let Some((off, on)) = last_pair(errors) else {
        return vec![
            "Tool error: no pair of verifications with and without compensation.".to_owned(),
        ];
    };
    vec![format!(
        "Tool error at the end of warm-up: p95 {} µm without compensation, {} µm with it ({:.1}-fold less).",
        um(off.p95_mm),
        um(on.p95_mm),
        off.p95_mm / on.p95_mm
    )]
}

const HEAD: [&str; 8] = [
    "verification",
    "p95",
    "max",
    "shift",
    "stretch",
    "rotation",
    "curved",
    "whole p95",
];

fn error_rows(errors: &[ToolError]) -> Vec<Vec<String>> {
    errors
        .iter()
        .map(|error| {
            vec![
                error.label.clone(),
                um(error.p95_mm),
                um(error.max_mm),
                um(error.parts.shift_mm),
                um(error.parts.stretch_mm),
                um(error.parts.rotation_mm),
                um(error.parts.curved_mm),
                um(error.whole_p95_mm),
            ]
        })
        .collect()
}

fn error_table(errors: &[ToolError]) -> Markup {
    table(&HEAD, &error_rows(errors))
}

/// Corners of the table and its centre, at the lowest height that was visited everywhere.
fn places() -> [(&'static str, Vector3<f64>); 5] {
    [
        ("corner -X -Y", Vector3::new(-1e3, -1e3, 1e3)),
        ("corner +X -Y", Vector3::new(1e3, -1e3, 1e3)),
        ("corner -X +Y", Vector3::new(-1e3, 1e3, 1e3)),
        ("corner +X +Y", Vector3::new(1e3, 1e3, 1e3)),
        ("centre", Vector3::new(0.0, 0.0, 1e3)),
    ]
}

fn place_rows(errors: &[ToolError]) -> Vec<Vec<String>> {
    places()
        .iter()
        .map(|(name, wanted_mm)| {
            let mut row = vec![(*name).to_owned()];
            for error in errors {
                row.push(tool_error::nearest(&error.change, *wanted_mm).map_or_else(
                    String::new,
                    |pose| {
                        let e = pose.error_mm;
                        let size = um(e.norm());
                        format!("{size} ({}, {}, {})", um(e.x), um(e.y), um(e.z))
                    },
                ));
            }
            row
        })
        .collect()
}

fn places_table(errors: &[ToolError]) -> Markup {
    let mut head = vec!["size (x, y, z) / µm"];
    head.extend(errors.iter().map(|error| error.label.as_str()));
    table(&head, &place_rows(errors))
}

/// What was left at each update, had the drift been held since the last one or predicted.
fn predictions(evidence: &Evidence) -> Markup {
    let rows: Vec<Vec<String>> = evidence
        .predictions
        .iter()
        .map(|prediction| {
            let hours = (prediction.at - start(evidence)).as_secs_f64() / 3600.0;
            let mut row = vec![format!("{hours:.2}")];
            row.extend(PREDICTORS.map(|key| {
                let value = prediction
                    .residuals_um
                    .iter()
                    .find(|(name, _)| *name == key);
                value
                    .and_then(|(_, text)| text.parse::<f64>().ok())
                    .map_or_else(|| "—".to_owned(), |um| format!("{um:.2}"))
            }));
            row
        })
        .collect();
    html! {
        @if !rows.is_empty() {
            h2 { "Prediction between block cycles" }
            (table(&["time / h", "held", "time constant", "temperatures"], &rows))
            p.note { "Residual at the blocks at each update, root mean square in µm, had the last model been held, extrapolated with its time constant, or moved with the temperatures; a dash: that way was not identifiable or not proven yet." }
        }
    }
}

const PREDICTORS: [&str; 3] = ["hold_um", "relaxation_um", "temperature_um"];

fn start(evidence: &Evidence) -> Stamp<Host> {
    evidence
        .segments
        .first()
        .map_or_else(Stamp::default, |first| first.at)
}

/// Drift of each block's face over time, µm over h.
fn drift_traces(evidence: &Evidence) -> BTreeMap<Axis, Vec<Trace>> {
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
                let hours = (face.at - start).as_secs_f64() / 3600.0;
                traces
                    .entry(axis)
                    .or_default()
                    .entry(key.0)
                    .or_default()
                    .push((hours, (face.position_mm - cold_mm) * 1e3));
            }
        }
    }
    let named = |(name, points)| Trace {
        name,
        points,
        marks: false,
    };
    traces
        .into_iter()
        .map(|(axis, blocks)| (axis, blocks.into_iter().map(named).collect()))
        .collect()
}

/// The tables as they stand on a terminal.
fn text(errors: &[ToolError]) -> String {
    let mut text =
        "Tool error in the blocks' span, change since cold, µm; parts are root mean squares\n"
            .to_owned();
    for row in std::iter::once(HEAD.map(str::to_owned).to_vec()).chain(error_rows(errors)) {
        let _ = writeln!(
            text,
            "  {:<28}{:>8}{:>8}{:>8}{:>9}{:>10}{:>8}{:>11}",
            row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7]
        );
    }
    text.push('\n');
    let mut head = vec!["size (x, y, z) / µm".to_owned()];
    head.extend(errors.iter().map(|error| error.label.clone()));
    for row in std::iter::once(head).chain(place_rows(errors)) {
        let _ = write!(text, "  {:<20}", row[0]);
        for cell in &row[1..] {
            let _ = write!(text, "{cell:>30}");
        }
        text.push('\n');
    }
    text
}
