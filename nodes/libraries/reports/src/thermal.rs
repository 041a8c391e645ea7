//! The page of a warm-up: latency, drift at the blocks, tool error before and after compensation.

use std::fmt::Write as _;

use anyhow::Result;
use maud::{Markup, html};
use nalgebra::Vector3;

use super::page::{figure, fold, table};
use super::plot::{Plot, svg};
use super::screen::{Screen, compensated};
use super::section::{Rows, head};
use super::svg::unsigned_zero;
use super::terminal::Part;
use super::tool_error::{self, BlocksSpan, Places, ToolError};
use super::vectors::{self, Field};
use super::{Report, blocks, conditions, latency, over_time, predictions};
use crate::evidence::{Evidence, Verification};

/// Label prefix of the cold verification in a plan.
const COLD: &str = "cold";

/// Writes the page.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn write(title: &str, evidence: &Evidence) -> Result<Report> {
    let span = BlocksSpan::of(&evidence.blocks);
    let errors = span.map_or_else(Vec::new, |span| tool_errors(&evidence.verifications, &span));
    let mut lines = latency::headline(evidence);
    lines.extend(headline(&errors, span.as_ref()));
    let remark = blocks::remark(evidence);
    lines.extend(remark.clone());
    let mut figures = latency::figures(evidence);
    figures["tool_error_in_blocks_span"] = figures_of(&errors, span.as_ref());
    // The verdict and the parts have the other sentences.
    let body = html! {
        @if let Some(remark) = &remark { p { (remark) } }
        (over_time::section(evidence)?)
        (errors_section(&errors, span.as_ref()))
        (drift_section(evidence)?)
        (predictions::section(evidence)?)
        (latency::section(evidence)?)
    };
    figures["block_heights"] = remark.into();
    Ok(Report {
        title: title.to_owned(),
        screen: screen(evidence, &errors)?,
        lines,
        parts: parts(&errors, span.as_ref()),
        body,
        figures,
    })
}

/// The first screen: the tool error without and with compensation, and its course beside the drift.
fn screen(evidence: &Evidence, errors: &[ToolError]) -> Result<Screen> {
    let mut screen = match last_pair(errors) {
        Some((off, on)) => {
            let what = format!(
                "change since cold at {} poses in the blocks' span",
                on.n_inside
            );
            compensated(off.change_p95_mm, on.change_p95_mm, &what)
        }
        None => Screen {
            lacks: vec![
                "Tool error: no pair of verifications with and without compensation.".to_owned(),
            ],
            ..Screen::default()
        },
    };
    screen.picture = over_time::picture(evidence, errors)?;
    screen.tiles.extend(over_time::greatest_drift(evidence));
    let behind = vec![conditions::section(evidence)];
    screen.join(Screen {
        behind,
        ..latency::screen(evidence)?
    });
    Ok(screen)
}

/// The tables of the tool error, where there is one.
fn errors_section(errors: &[ToolError], span: Option<&BlocksSpan>) -> Markup {
    let content = html! {
        @if let Some(picture) = change_picture(errors) { (picture) }
        (error_table(errors))
        p.note { "All in µm. Truth of the plant at poses that the machine really went to; no node sees it." }
        ul.note { @for line in EXPLAINED { li { (line) } } }
        @if let Some(places) = places(errors) {
            h3 { "Corners and centre at Z " (places.z_mm) " mm" }
            (places_table(errors, &places))
            p.note { (of_places(&places, span)) }
        }
    };
    html! {
        @if !errors.is_empty() {
            (fold("Change of the tool error since cold, in the blocks' span", answer(errors).as_deref(), false, &content))
        }
    }
}

/// The last verification with compensation, and the largest part of what it left.
fn answer(errors: &[ToolError]) -> Option<String> {
    let (_, on) = last_pair(errors)?;
    let parts = [
        ("a shift of all poses", on.parts.shift_mm),
        ("stretch along the axes", on.parts.stretch_mm),
        ("rotation", on.parts.rotation_mm),
        ("curved errors", on.parts.curved_mm),
    ];
    let (name, size_mm) = parts.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(format!(
        "With compensation p95 {} µm, {} µm at most; the largest part is {name}, {} µm.",
        um(on.change_p95_mm),
        um(on.change_max_mm),
        um(size_mm)
    ))
}

/// The change since cold over the volume, at the last verification without and with compensation.
fn change_picture(errors: &[ToolError]) -> Option<Markup> {
    let (off, on) = last_pair(errors)?;
    let field = |error: &ToolError| Field {
        name: error.label.clone(),
        arrows: { error.change.iter() }
            .map(|pose| (pose.commanded_mm, pose.error_mm))
            .collect(),
    };
    let of = "Change of the tool error since cold, inside and outside of the blocks' span";
    vectors::picture(&[field(off), field(on)], of)
}

/// Drift of each face of the blocks, where any was measured twice.
fn drift_section(evidence: &Evidence) -> Result<Markup> {
    let (drift, unit) = over_time::drift(evidence);
    let mut figures = Vec::new();
    for (axis, traces) in drift {
        let plot = Plot {
            x: format!("time since start / {unit}"),
            y: format!("drift of the {axis} reading / µm"),
            traces,
        };
        figures.push(figure(&svg(&plot)?, &format!("{axis} face of each block")));
    }
    Ok(html! {
        @if !figures.is_empty() {
            (fold("Drift at the blocks", over_time::most_in_words(evidence).as_deref(), false, &html! { @for figure in &figures { (figure) } }))
        }
    })
}

fn tool_errors(verifications: &[Verification], span: &BlocksSpan) -> Vec<ToolError> {
    let Some(cold) = verifications
        .iter()
        .find(|check| check.label.starts_with(COLD))
    else {
        return Vec::new();
    };
    verifications
        .iter()
        .filter(|check| !check.label.starts_with(COLD))
        .filter_map(|check| tool_error::judge(cold, check, span))
        .collect()
}

/// The last verification without and with compensation.
pub fn last_pair(errors: &[ToolError]) -> Option<(&ToolError, &ToolError)> {
    let last = |word: &str| errors.iter().rev().find(|error| error.label.contains(word));
    Some((last("without")?, last("with compensation")?))
}

fn um(length_mm: f64) -> String {
    unsigned_zero(format!("{:.1}", length_mm * 1e3))
}

fn headline(errors: &[ToolError], span: Option<&BlocksSpan>) -> Vec<String> {
    if span.is_none() {
        return vec!["Tool error: not judged, since no two blocks were measured.".to_owned()];
    }
    let Some((off, on)) = last_pair(errors) else {
        return vec![
            "Tool error: no pair of verifications with and without compensation.".to_owned(),
        ];
    };
    vec![format!(
        "Tool error at the end of warm-up, change since cold, at {} poses in the blocks' span: p95 {} µm without compensation, {} µm with it ({:.1}-fold less).",
        on.n_inside,
        um(off.change_p95_mm),
        um(on.change_p95_mm),
        off.change_p95_mm / on.change_p95_mm
    )]
}

/// The same for machines, mm.
fn figures_of(errors: &[ToolError], span: Option<&BlocksSpan>) -> serde_json::Value {
    let Some(span) = span else {
        return serde_json::Value::Null;
    };
    let row = |error: &ToolError| {
        serde_json::json!({
            "label": error.label,
            "poses": error.n_inside,
            "change_since_cold_p95_mm": error.change_p95_mm,
            "change_since_cold_max_mm": error.change_max_mm,
            "change_since_cold_shift_mm": error.parts.shift_mm,
            "change_since_cold_stretch_rms_mm": error.parts.stretch_mm,
            "change_since_cold_rotation_rms_mm": error.parts.rotation_mm,
            "change_since_cold_curved_rms_mm": error.parts.curved_mm,
            "whole_error_cold_included_p95_mm": error.whole_p95_mm,
        })
    };
    let (off, on) = match last_pair(errors) {
        Some((off, on)) => (row(off), row(on)),
        None => Default::default(),
    };
    serde_json::json!({
        "span_low_mm": [span.low_mm.x, span.low_mm.y, span.low_mm.z],
        "span_high_mm": [span.high_mm.x, span.high_mm.y, span.high_mm.z],
        "without_compensation": off,
        "with_compensation": on,
        "verifications": errors.iter().map(row).collect::<Vec<_>>(),
    })
}

const VERIFICATION_COLUMNS: [&str; 8] = [
    "verification",
    "p95",
    "max",
    "shift",
    "stretch",
    "rotation",
    "curved",
    "whole p95",
];

/// What each column says, a line each.
const EXPLAINED: [&str; 7] = [
    "p95, max: size of the change since cold that 95 % of the poses do not exceed, and the greatest.",
    "shift: what all poses share; what compensation leaves of it is drift since the last block cycle, and probing.",
    "stretch: growth along each axis itself (rms), all that two blocks can see besides the shift.",
    "rotation: turns and shears between axes (rms); two blocks on one diagonal take a part of them for stretch.",
    "curved: the rest (rms), from hot zones and bending, which no linear model follows.",
    "whole p95: 95 % of the whole error, with the geometric error that is there when cold and that thermal compensation leaves alone.",
    "in the blocks' span: at poses between the outermost faces of the blocks in X, Y and Z.",
];

fn error_rows(errors: &[ToolError]) -> Vec<Vec<String>> {
    errors
        .iter()
        .map(|error| {
            vec![
                error.label.clone(),
                um(error.change_p95_mm),
                um(error.change_max_mm),
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
    table(&VERIFICATION_COLUMNS, &error_rows(errors))
}

/// Corners and centre of what every verification visited.
fn places(errors: &[ToolError]) -> Option<Places> {
    Places::of(&errors.first()?.change)
}

fn of_places(places: &Places, span: Option<&BlocksSpan>) -> String {
    let z_mm = places.z_mm;
    let inside = span.is_some_and(|span| places.at_mm.iter().all(|place| span.holds(place)));
    let span = if inside {
        "inside the blocks' span"
    } else {
        "outside of the blocks' span, where drift is extrapolated"
    };
    format!(
        "Corners and centre of the visited area at Z {z_mm} mm, the lowest height at which all five were visited; {span}."
    )
}

fn place_rows(errors: &[ToolError], places: &Places) -> Vec<Vec<String>> {
    let row = |(name, place_mm): (&&str, &Vector3<f64>)| {
        let mut row = vec![(*name).to_owned()];
        for error in errors {
            let e = tool_error::at(&error.change, place_mm);
            row.push(e.map_or_else(String::new, |e| {
                format!("{} ({}, {}, {})", um(e.norm()), um(e.x), um(e.y), um(e.z))
            }));
        }
        row
    };
    tool_error::PLACE_NAMES
        .iter()
        .zip(&places.at_mm)
        .map(row)
        .collect()
}

fn places_table(errors: &[ToolError], places: &Places) -> Markup {
    let mut head = vec!["size (x, y, z) / µm"];
    head.extend(errors.iter().map(|error| error.label.as_str()));
    table(&head, &place_rows(errors, places))
}

/// The tables: laid out by hand in the whole text, and once more for the short one.
fn parts(errors: &[ToolError], span: Option<&BlocksSpan>) -> Vec<Part> {
    let of = |title: &str, head: Vec<String>, rows: Vec<Vec<String>>, whole: String| {
        let note = String::new();
        Part::table(title, whole, Rows { head, rows, note })
    };
    let mut parts = vec![of(
        "Change of the tool error since cold, in the blocks' span, µm",
        head(&VERIFICATION_COLUMNS),
        error_rows(errors),
        text(errors, span),
    )];
    parts.extend(places(errors).map(|places| {
        of(
            "Change of the tool error since cold at five places, µm",
            places_head(errors),
            place_rows(errors, &places),
            String::new(),
        )
    }));
    parts
}

fn places_head(errors: &[ToolError]) -> Vec<String> {
    let mut head = vec!["size (x, y, z)".to_owned()];
    head.extend(errors.iter().map(|error| error.label.clone()));
    head
}

/// The tables as they stand on a terminal.
fn text(errors: &[ToolError], span: Option<&BlocksSpan>) -> String {
    let mut text = String::new();
    if errors.is_empty() {
        return text;
    }
    text.push_str("Change of the tool error since cold, in the blocks' span, µm\n");
    for row in
        std::iter::once(VERIFICATION_COLUMNS.map(str::to_owned).to_vec()).chain(error_rows(errors))
    {
        let _ = writeln!(
            text,
            "  {:<28}{:>8}{:>8}{:>8}{:>9}{:>10}{:>8}{:>11}",
            row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7]
        );
    }
    for line in EXPLAINED {
        let _ = writeln!(text, "  {line}");
    }
    let Some(places) = places(errors) else {
        return text;
    };
    let _ = writeln!(
        text,
        "\nChange of the tool error since cold at five places, µm"
    );
    for row in std::iter::once(places_head(errors)).chain(place_rows(errors, &places)) {
        let _ = write!(text, "  {:<20}", row[0]);
        for cell in &row[1..] {
            let _ = write!(text, "{cell:>30}");
        }
        text.push('\n');
    }
    let _ = writeln!(text, "  {}", of_places(&places, span));
    text
}
