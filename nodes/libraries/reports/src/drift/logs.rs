//! A log of one displacement and temperatures while the axes stood.

use anyhow::Result;
use iso230::thermal::{DriftCause, DriftContributions};
use metrology::stamp::{Host, Stamp};
use serde_json::json;

use super::figures::{self, FIGURE_NAMES, Figures};
use super::{HOUR_S, in_words, show_temperatures, temperatures};
use crate::evaluate::budget::Budget;
use crate::evaluate::drift::{Drift, DriftLog};
use crate::plot::{self, Plot, Trace};
use crate::section::{Drawing, Rows, Section, head, um};

/// The part of one log; a log that cannot be evaluated says why.
///
/// # Errors
/// When a plot cannot be drawn.
pub(super) fn section(log: &DriftLog, drift: &Drift, budget: Option<&Budget>) -> Result<Section> {
    let mut section = Section::new(format!(
        "Thermal drift of {}, run {}, ISO 230-3: {}",
        log.axis,
        log.run,
        in_words(log.cause)
    ));
    let points = &log.displacements.points;
    let (Some((from, first_mm)), Some((to, _))) = (points.first(), points.last()) else {
        section.not_evaluated("no displacement was read");
        return Ok(section);
    };
    let values: Vec<(f64, f64)> = points
        .iter()
        .map(|(at, mm)| ((*at - *from).as_secs_f64(), mm - first_mm))
        .collect();
    let recorded_s = (*to - *from).as_secs_f64();
    section
        .lines
        .push(extent(values.len(), recorded_s, log.cause));
    let found = evaluated(log, &values, budget);
    let beside = temperatures(drift, *from, *to);
    let figures = match found {
        Ok(found) => {
            let cells = found.cells(budget.is_some());
            let [after_1_h, after_3_h, range, _] = &cells;
            section.answers.push(format!(
                "range {range} µm; {after_1_h} µm after an hour, {after_3_h} µm after three."
            ));
            section.tables.push(table(log, &cells, budget.is_some()));
            section
                .lines
                .extend(found.contributions.as_ref().map(parts));
            if found.after_3_h.is_none() {
                section.warn("Recorded too briefly", too_short(recorded_s));
            }
            Some(found)
        }
        Err(why) => {
            section.not_evaluated(why);
            None
        }
    };
    show_temperatures(&mut section, drift, &beside);
    section.drawings = drawings(log, drift, &values, (*from, *to))?;
    section.figures = json!({
        "test": section.title,
        "iso230_3_log": {
            "run": log.run,
            "axis": log.axis.letter(),
            "cause": log.cause,
            "recorded_h": recorded_s / HOUR_S,
            "readings": values.len(),
            "figures": figures,
            "temperatures": beside,
        },
    });
    Ok(section)
}

/// How much was recorded, and what nobody stated about it.
fn extent(n: usize, recorded_s: f64, cause: DriftCause) -> String {
    let lacking = match cause {
        DriftCause::NotStated => {
            " What made the machine drift was not stated: the range is E_TVE where the surroundings alone did (key cause of the map)."
        }
        _ => "",
    };
    format!("{n} readings in {:.2} h.{lacking}", recorded_s / HOUR_S)
}

fn too_short(recorded_s: f64) -> String {
    let lacking = if recorded_s < HOUR_S {
        "the drift of the first hour and that of three hours are"
    } else {
        "the drift of three hours is"
    };
    format!(
        "Recorded for {:.2} h: {lacking} not known.",
        recorded_s / HOUR_S
    )
}

/// The figures of displacements (s since the first, mm), or the reason why they cannot be computed.
///
/// The parts of U need a budget.
fn evaluated(
    log: &DriftLog,
    values: &[(f64, f64)],
    budget: Option<&Budget>,
) -> Result<Figures, String> {
    if log.zeroed_anew {
        return Err("the instrument was zeroed anew while it went on".to_owned());
    }
    let nothing = Budget::nothing();
    let certificate = budget.unwrap_or(&nothing).positioning(None, None).device;
    let scatter_mm = figures::scatter_mm(values);
    let found = figures::of(log.axis, log.cause, values, certificate, scatter_mm);
    let found = found.map_err(|error| error.to_string())?;
    Ok(Figures {
        contributions: found.contributions.filter(|_| budget.is_some()),
        ..found
    })
}

/// The parts of the uncertainty of the range.
fn parts(of: &DriftContributions) -> String {
    format!(
        "Standard uncertainty of the range: {} µm by the certificate of length_reference, {} µm by the scatter of two readings (each against the line between its neighbours); {} µm combined.",
        um(of.certificate_mm),
        um(of.scatter_mm),
        um(of.combined_mm())
    )
}

fn table(log: &DriftLog, cells: &[String; 4], stated: bool) -> Rows {
    let names: Vec<&str> = std::iter::once("displacement along")
        .chain(FIGURE_NAMES)
        .collect();
    let note = if stated {
        "± expanded uncertainty, k = 2: certificate of length_reference in the budget and scatter of the readings; what the artefact and its holder grow is part of the drift."
    } else {
        "Without --budget no uncertainty is stated."
    };
    let axis = std::iter::once(log.axis.letter().to_owned());
    Rows {
        head: head(&names),
        rows: vec![axis.chain(cells.iter().cloned()).collect()],
        note: format!("Drift: reading then minus first reading. {note}"),
    }
}

fn drawings(
    log: &DriftLog,
    drift: &Drift,
    values: &[(f64, f64)],
    (from, to): (Stamp<Host>, Stamp<Host>),
) -> Result<Vec<Drawing>> {
    const TIME_LABEL: &str = "time since the first reading / h";
    let trace = |name: &str, points: Vec<(f64, f64)>| Trace {
        name: name.to_owned(),
        points,
        marks: false,
    };
    let points = values.iter().map(|(s, mm)| (s / HOUR_S, mm * 1e3));
    let mut drawings = vec![Drawing {
        svg: plot::svg(&Plot {
            x: TIME_LABEL.to_owned(),
            y: format!("displacement along {} / µm", log.axis),
            traces: vec![trace(log.axis.letter(), points.collect())],
        })?,
        caption: "Displacement since the first reading.".to_owned(),
    }];
    let traces: Vec<Trace> = drift
        .temperatures
        .iter()
        .map(|(sensor, series)| {
            let points = series.between(from, to).iter();
            let points = points.map(|(at, degc)| ((*at - from).as_secs_f64() / HOUR_S, *degc));
            trace(sensor, points.collect())
        })
        .filter(|trace| !trace.points.is_empty())
        .collect();
    if !traces.is_empty() {
        drawings.push(Drawing {
            svg: plot::svg(&Plot {
                x: TIME_LABEL.to_owned(),
                y: "temperature / °C".to_owned(),
                traces,
            })?,
            caption: "Temperatures meanwhile.".to_owned(),
        });
    }
    Ok(drawings)
}
