//! The page of a rotary-axis calibration: location errors, spheres at other poses, tool error before and
//! after compensation.

use std::fmt::Write as _;

use anyhow::Result;
use maud::html;
use metrology::sample::{CurveForm, ErrorCurve, GeometryModel};

use super::page::{figure, fold, table};
use super::plot::{self, Plot, Trace};
use super::screen::{Screen, Tile, Tone, compensated};
use super::section::{Rows, head, rounded};
use super::terminal::Part;
use super::tool_error::quantile;
use super::{Report, conditions, latency, pointed};
use crate::evidence::{Condition, Evidence, PoseError, Verification};

/// The condition of a verification that left more than expected.
const BEYOND_EXPECTED: &str = "beyond_expected";
/// Coverage factor of what is printed.
const COVERAGE: f64 = 2.0;

/// Writes the page.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn write(title: &str, evidence: &Evidence) -> Result<Report> {
    let model = evidence.rotary_models.last();
    let mut lines = latency::headline(evidence);
    lines.extend(judgements(evidence));
    lines.extend(tool_line(evidence));
    let locations = model.map_or_else(Vec::new, location_rows);
    let tools = tool_rows(evidence);
    let screen = screen(evidence)?;
    let locations_part = html! {
        (table(&LOCATION_HEAD, &locations))
        p.note { "ISO 230-1 components: EX0C is where the line of C lies along X, EA0C how it is tilted about X, with all axes at zero; above 0 it is turned about X by the right-hand rule. U is the expanded uncertainty, k = 2. What the poses cannot see has none." }
        @if let Some(motions) = model.map(motion_names).filter(|names| !names.is_empty()) {
            p { "Error motions that the readings needed besides: " (motions) "." }
        }
    };
    let tools_part = html! {
        (table(&TOOL_HEAD, &tools))
        p.note { "Truth of the plant at poses that the machine really went to, all five axes' errors included; no node sees it." }
    };
    let answer = pair(evidence).map(|(off, on)| {
        format!(
            "At most {:.2} µm without compensation, {:.2} µm with it.",
            off.max_mm * 1e3,
            on.max_mm * 1e3
        )
    });
    let body = html! {
        @for line in &lines { p { (line) } }
        @if !tools.is_empty() { (fold("Tool error at the verification poses", answer.as_deref(), false, &tools_part)) }
        @if !locations.is_empty() { (fold("Location errors", None, true, &locations_part)) }
        (pointed::section(evidence))
        (latency::section(evidence)?)
    };
    let pointed = pointed::rows(evidence);
    let tables = [
        ("Location errors", &LOCATION_HEAD[..], locations),
        (
            "Tool error at the verification poses",
            &TOOL_HEAD[..],
            tools,
        ),
        (
            "Touches along given directions",
            &pointed::TOUCH_COLUMNS[..],
            pointed,
        ),
    ];
    let filled = tables.into_iter().filter(|(.., rows)| !rows.is_empty());
    let parts = filled.map(|(title, names, rows)| part(title, names, rows));
    Ok(Report {
        title: title.to_owned(),
        lines,
        parts: parts.collect(),
        screen,
        body,
        figures: figures(evidence),
    })
}

/// The first screen: the tool error without and with compensation, pose by pose, and what is left beyond the expected.
fn screen(evidence: &Evidence) -> Result<Screen> {
    let last = |word: &str| {
        let mut all = evidence.verifications.iter().rev();
        all.find(|one| one.label.contains(word) && !one.poses.is_empty())
    };
    let mut screen = Screen::default();
    if let Some((off, on)) = pair(evidence) {
        let n = last("with compensation").map_or(0, |one| one.poses.len());
        screen = compensated(off.p95_mm, on.p95_mm, &format!("{n} verification poses"));
    }
    let trace = |word: &str, name: &str| {
        let sizes = last(word)?.poses.iter().enumerate();
        let size_um = |(k, pose): (usize, &PoseError)| (k as f64 + 1.0, pose.error_mm.norm() * 1e3);
        Some(Trace {
            name: name.to_owned(),
            points: sizes.map(size_um).collect(),
            marks: true,
        })
    };
    let traces = [
        trace("without", "without compensation"),
        trace("with compensation", "with compensation"),
    ];
    let traces: Vec<Trace> = traces.into_iter().flatten().collect();
    if !traces.is_empty() {
        let plot = Plot {
            x: "verification pose".to_owned(),
            y: "tool error / µm".to_owned(),
            traces,
        };
        let caption =
            "Size of the true error of the tool at each pose, in the order of the program.";
        screen.picture = Some(figure(&plot::svg(&plot)?, caption));
    }
    screen.tiles.extend(largest_location(evidence));
    state_beyond(&mut screen, evidence);
    let behind = vec![conditions::section(evidence)];
    screen.join(Screen {
        behind,
        ..latency::screen(evidence)?
    });
    Ok(screen)
}

/// States what is left beyond the expected, with the next step.
fn state_beyond(screen: &mut Screen, evidence: &Evidence) {
    let is_beyond = |condition: &&Condition| condition.diagnostic.name == BEYOND_EXPECTED;
    let beyond: Vec<&Condition> = evidence.conditions.iter().filter(is_beyond).collect();
    if let (Some(last), Some((sentence, tone))) = (beyond.last(), &mut screen.verdict) {
        let message = last
            .diagnostic
            .message
            .split(';')
            .next()
            .unwrap_or_default();
        sentence.push_str(&format!(" More is left than expected: {message}."));
        *tone = Tone::Bad;
        screen.next = Some(Tile::new(
            "next step",
            "calibrate again",
            "warm the machine up, check the seat of the probe, then repeat the calibration",
        ));
    }
    let lines = beyond
        .iter()
        .map(|one| format!("Beyond expected: {}.", one.diagnostic.message));
    screen.lacks.extend(lines);
}

/// The largest location error, and the largest tilt, with U.
fn largest_location(evidence: &Evidence) -> Option<Tile> {
    let model = evidence.rotary_models.last()?;
    let largest = |is_angular: bool| {
        let is_wanted = |curve: &&ErrorCurve| {
            curve.component.is_angular() == is_angular && curve.estimable.first() == Some(&true)
        };
        let size = |curve: &&ErrorCurve| curve.coefficient.first().map_or(0.0, |c| c.abs());
        let own = locations(model).filter(is_wanted);
        own.max_by(|a, b| size(a).total_cmp(&size(b)))
    };
    let in_words = |curve: &ErrorCurve| {
        let (scale, unit) = scale_and_unit(curve);
        let value = curve.coefficient.first()? * scale;
        let u = curve.standard_uncertainty.first()? * COVERAGE * scale;
        let (value, u) = rounded(value, u);
        Some(format!("{} {value} ± {u} {unit}", curve.component))
    };
    let tilt = largest(true).and_then(|curve| Some((in_words(curve)?, curve.component)));
    let tilt = tilt.map_or_else(String::new, |(tilt, component)| {
        format!("largest tilt {tilt}, {}; ", component.in_words())
    });
    let shift = largest(false)?;
    Some(Tile::new(
        "largest location error",
        in_words(shift)?,
        format!("{}; {tilt}k = 2", shift.component.in_words()),
    ))
}

fn scale_and_unit(curve: &ErrorCurve) -> (f64, &'static str) {
    if curve.component.is_angular() {
        (1e6, "µrad")
    } else {
        (1e3, "µm")
    }
}

/// A table, and how it stands in the whole text.
fn part(title: &str, names: &[&str], rows: Vec<Vec<String>>) -> Part {
    let head = head(names);
    let mut text = String::new();
    for row in std::iter::once(&head).chain(&rows) {
        let cells: Vec<String> = row.iter().map(|cell| format!("{cell:>16}")).collect();
        let _ = writeln!(text, "{}", cells.join("  "));
    }
    text.push('\n');
    let note = String::new();
    Part::table(title, text, Rows { head, rows, note })
}

const LOCATION_HEAD: [&str; 4] = ["component", "value", "± U (k = 2)", "unit"];

fn locations(model: &GeometryModel) -> impl Iterator<Item = &ErrorCurve> {
    let curves = model.curves.iter();
    curves.filter(|curve| curve.form == CurveForm::Constant && !curve.coefficient.is_empty())
}

fn location_rows(model: &GeometryModel) -> Vec<Vec<String>> {
    locations(model)
        .map(|curve| {
            let (scale, unit) = scale_and_unit(curve);
            let seen = curve.estimable.first().copied().unwrap_or(false);
            let u = curve
                .standard_uncertainty
                .first()
                .copied()
                .unwrap_or(f64::NAN);
            let (value, expanded) = if seen {
                rounded(curve.coefficient[0] * scale, COVERAGE * u * scale)
            } else {
                ("not estimable".to_owned(), "—".to_owned())
            };
            vec![
                curve.component.to_string(),
                value,
                expanded,
                unit.to_owned(),
            ]
        })
        .collect()
}

fn motion_names(model: &GeometryModel) -> String {
    let motions = model
        .curves
        .iter()
        .filter(|curve| curve.form == CurveForm::Table);
    let names: Vec<String> = motions.map(|curve| curve.component.to_string()).collect();
    names.join(", ")
}

/// What the calibration said of itself and of the verifications, and of residuals beyond what was expected.
fn judgements(evidence: &Evidence) -> Vec<String> {
    let is_beyond = |condition: &&Condition| condition.diagnostic.name == BEYOND_EXPECTED;
    let beyond = evidence.conditions.iter().filter(is_beyond);
    let judged = evidence.judgements.iter().map(|condition| {
        let name = &condition.diagnostic.name;
        format!("Rotary axes {name}: {}.", condition.diagnostic.message)
    });
    judged
        .chain(beyond.map(|condition| {
            format!(
                "Rotary axes, beyond expected: {}.",
                condition.diagnostic.message
            )
        }))
        .collect()
}

const TOOL_HEAD: [&str; 4] = ["verification", "rms / µm", "p95 / µm", "max / µm"];

struct Sizes {
    rms_mm: f64,
    p95_mm: f64,
    max_mm: f64,
}

fn sizes(verification: &Verification) -> Sizes {
    let sizes = || verification.poses.iter().map(|pose| pose.error_mm.norm());
    let n = verification.poses.len() as f64;
    Sizes {
        rms_mm: (sizes().map(|size| size * size).sum::<f64>() / n).sqrt(),
        p95_mm: quantile(sizes(), 0.95),
        max_mm: sizes().fold(0.0, f64::max),
    }
}

fn tool_rows(evidence: &Evidence) -> Vec<Vec<String>> {
    evidence
        .verifications
        .iter()
        .map(|verification| {
            let sizes = sizes(verification);
            vec![
                verification.label.clone(),
                format!("{:.2}", sizes.rms_mm * 1e3),
                format!("{:.2}", sizes.p95_mm * 1e3),
                format!("{:.2}", sizes.max_mm * 1e3),
            ]
        })
        .collect()
}

/// Verifications without and with compensation, the last of each.
fn pair(evidence: &Evidence) -> Option<(Sizes, Sizes)> {
    let last = |word: &str| {
        let mut all = evidence.verifications.iter().rev();
        all.find(|verification| verification.label.contains(word))
    };
    Some((sizes(last("without")?), sizes(last("with compensation")?)))
}

fn tool_line(evidence: &Evidence) -> Option<String> {
    let (off, on) = pair(evidence)?;
    Some(format!(
        "Tool error at the verification poses: p95 {:.2} µm without compensation, {:.2} µm with it ({:.1}-fold less).",
        off.p95_mm * 1e3,
        on.p95_mm * 1e3,
        off.p95_mm / on.p95_mm
    ))
}

fn figures(evidence: &Evidence) -> serde_json::Value {
    let mut figures = latency::figures(evidence);
    if !evidence.pointings.is_empty() {
        figures["touched_along"] = pointed::figures(evidence);
    }
    if let Some(model) = evidence.rotary_models.last() {
        for curve in locations(model) {
            figures["location_errors"][curve.component.to_string()] = serde_json::json!({
                "value": curve.coefficient[0],
                "standard_uncertainty": curve.standard_uncertainty.first(),
                "estimable": curve.estimable.first(),
            });
        }
    }
    for condition in &evidence.judgements {
        let name = condition.diagnostic.name.as_ref();
        let mut values = serde_json::json!({});
        for (key, value) in &condition.diagnostic.values {
            values[*key] = value.as_str().into();
        }
        if let Some(list) = figures[name].as_array_mut() {
            list.push(values);
        } else {
            figures[name] = serde_json::json!([values]);
        }
    }
    if let Some((off, on)) = pair(evidence) {
        for (key, value_mm) in [
            ("rms_without_mm", off.rms_mm),
            ("rms_with_mm", on.rms_mm),
            ("p95_without_mm", off.p95_mm),
            ("p95_with_mm", on.p95_mm),
            ("max_with_mm", on.max_mm),
        ] {
            figures[key] = value_mm.into();
        }
    }
    figures
}
