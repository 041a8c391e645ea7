//! A log of one displacement and temperatures while the axes stood.

use anyhow::Result;
use iso230::thermal::{Artefact, ArtefactTemperature, DriftCause, DriftContributions};
use metrology::Axis;
use metrology::stamp::{Host, Stamp};
use serde_json::json;

use super::figures::{self, FIGURE_NAMES, Figures, Reader};
use super::{HOUR_S, in_words, show_temperatures, slips, temperatures};
use crate::evaluate::budget::{Budget, Meanwhile};
use crate::evaluate::drift::{Drift, DriftLog};
use crate::evaluate::test_conditions::Thermometers;
use crate::evaluate::thermometer::name_dead;
use crate::plot::{self, Plot, Trace};
use crate::section::{Drawing, Rows, Section, head, um};

fn title(log: &DriftLog) -> String {
    let (axis, height) = (log.axis, at_height(log.height_mm));
    let cause = in_words(log.cause);
    format!(
        "Thermal drift of {axis}{height}, run {}, ISO 230-3: {cause}",
        log.run
    )
}

/// The part of one log; a log that cannot be evaluated says why.
///
/// `during` has the thermometers of the run.
///
/// # Errors
/// When a plot cannot be drawn.
pub(super) fn section(
    log: &DriftLog,
    drift: &Drift,
    (budget, during): (Option<&Budget>, &Thermometers),
) -> Result<Section> {
    let mut section = Section::new(title(log));
    let points = &log.displacements.points;
    let (Some((from, first_mm)), Some((to, _))) = (points.first(), points.last()) else {
        section.without_figures("no displacement was read");
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
    let mandrel = mandrel_of(log, drift, (budget, during), &mut section);
    let growth_mm = mandrel.as_ref().and_then(Artefact::growth_mm);
    let found = evaluated(log, &values, (budget, mandrel.as_ref()));
    section.name_far(&slips::far(&values));
    name_dead(&mut section, during);
    let beside = temperatures(drift, *from, *to);
    let figures = match found {
        Ok(found) => {
            let mandrel = mandrel.as_ref();
            show(&mut section, (log, &values), &found, (budget, mandrel));
            if found.after_3_h.is_none() {
                section.warn("Recorded too briefly", too_short(recorded_s));
            }
            Some(found)
        }
        Err(why) => {
            section.without_figures(why);
            None
        }
    };
    show_temperatures(&mut section, drift, &beside);
    let growth_mm = growth_mm.as_deref().filter(|_| figures.is_some());
    section.drawings = drawings(log, drift, (&values, growth_mm), (*from, *to))?;
    section.figures = json!({
        "test": section.title,
        "iso230_3_log": {
            "run": log.run,
            "axis": log.axis.letter(),
            "height_mm": log.height_mm,
            "cause": log.cause,
            "recorded_h": recorded_s / HOUR_S,
            "readings": values.len(),
            "figures": figures,
            "growth_taken_out_mm": growth_mm.and_then(<[f64]>::last),
            "temperatures": beside,
        },
    });
    Ok(section)
}

/// Answer, table and sentences of the figures of a log.
fn show(
    section: &mut Section,
    (log, values): (&DriftLog, &[(f64, f64)]),
    found: &Figures,
    (budget, mandrel): (Option<&Budget>, Option<&Artefact>),
) {
    let cells = found.cells(budget.is_some());
    let [after_1_h, after_3_h, range, _] = &cells;
    section
        .answers
        .push(in_short(range, [after_1_h, after_3_h], found));
    let note = note(log, found, (budget, mandrel));
    section.tables.push(table(log, &cells, note));
    section.lines.push(found.at_end_in_words(budget.is_some()));
    let is_growth_read = mandrel.is_some_and(|it| it.growth_mm().is_some());
    let parts = { found.contributions.as_ref() }.map(|of| parts(of, is_growth_read));
    section.lines.extend(parts);
    if is_growth_read {
        check_sign(values, found, section);
    }
}

/// Range and drift in one sentence, without what was not recorded.
fn in_short(range: &str, [after_1_h, after_3_h]: [&String; 2], found: &Figures) -> String {
    match (found.after_1_h.is_some(), found.after_3_h.is_some()) {
        (false, _) => format!("range {range} µm."),
        (true, false) => format!("range {range} µm; {after_1_h} µm after an hour."),
        (true, true) => {
            format!(
                "range {range} µm; {after_1_h} µm after an hour, {after_3_h} µm after three hours."
            )
        }
    }
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
    (budget, mandrel): (Option<&Budget>, Option<&Artefact>),
) -> Result<Figures, String> {
    if log.zeroed_anew {
        return Err("the instrument was zeroed anew while it went on".to_owned());
    }
    if let Some(slip) = slips::slip(values) {
        return Err(slip);
    }
    let reader = Reader {
        mandrel: mandrel.cloned(),
        ..reader(budget, figures::scatter_mm(values))
    };
    let found = figures::of(log.axis, log.cause, values, &reader);
    let found = found.map_err(|error| error.to_string())?;
    Ok(Figures {
        contributions: found.contributions.filter(|_| budget.is_some()),
        ..found
    })
}

/// What read a log, with the scatter of its readings; the mandrel is not in it.
pub(super) fn reader(budget: Option<&Budget>, reading_scatter_mm: f64) -> Reader {
    let nothing = Budget::nothing();
    let used = budget.unwrap_or(&nothing);
    Reader {
        reading_scatter_mm,
        error_period_mm: used.length_error_period_mm(),
        ..Reader::certified(used.positioning(None, None).device)
    }
}

/// The mandrel as far as it is in displacements along an axis: with its length along Z, else not at all. A temperature that is
/// not known is a warning, and its growth then counts as drift.
fn mandrel_of(
    log: &DriftLog,
    drift: &Drift,
    (budget, during): (Option<&Budget>, &Thermometers),
    section: &mut Section,
) -> Option<Artefact> {
    let budget = budget.filter(|_| log.axis == Axis::Z)?;
    let at: Vec<Stamp<Host>> = { log.displacements.points.iter() }
        .map(|(at, _)| *at)
        .collect();
    let found = budget.mandrel(Meanwhile {
        at: &at,
        during,
        temperatures: &drift.temperatures,
    });
    match found {
        Ok(mandrel) => mandrel.filter(|it| it.length_mm > 0.0),
        Err(why) => {
            section.warn(
                "Growth of the mandrel not taken out",
                format!("The budget file's `mandrel` {why}. Its growth counts as drift."),
            );
            None
        }
    }
}

/// Asks about the sign of the sensor where the drift is greater without the growth of the mandrel.
fn check_sign(values: &[(f64, f64)], found: &Figures, section: &mut Section) {
    let read = || values.iter().map(|(_, mm)| *mm);
    let range_mm = read().fold(f64::NEG_INFINITY, f64::max) - read().fold(f64::INFINITY, f64::min);
    let without = &found.range;
    if without.value_mm > range_mm + without.expanded_uncertainty_mm {
        section.warn(
            "Sign of the mandrel's growth",
            format!(
                "The range is {} µm without the growth of the mandrel, and {} µm as read: check mandrel.growth_reads of the budget against the sign of the sensor.",
                um(without.value_mm),
                um(range_mm)
            ),
        );
    }
}

/// Where a sensor stands, behind the axis in a title.
pub(super) fn at_height(height_mm: Option<f64>) -> String {
    height_mm.map_or_else(String::new, |mm| format!(" at height {mm:.1} mm"))
}

/// The parts of the uncertainty of the range.
fn parts(of: &DriftContributions, is_growth_read: bool) -> String {
    let mandrel = if of.artefact_mm > 0.0 {
        let left = if is_growth_read { "rest of the " } else { "" };
        format!(
            ", {} µm by the {left}growth of the mandrel",
            um(of.artefact_mm)
        )
    } else {
        String::new()
    };
    format!(
        "Standard uncertainty of the range: {} µm by the certificate of length_reference, {} µm by the scatter of two readings (each against the line between its neighbours){mandrel}; {} µm combined.",
        um(of.certificate_mm),
        um(of.scatter_mm),
        um(of.combined_mm())
    )
}

/// What every U has in it.
const PARTS: &str = "certificate of length_reference in the budget and scatter of the readings";

/// What U of a table has in it, in words, where no mandrel grows.
pub(super) fn note_of(budget: Option<&Budget>) -> String {
    expanded(budget, &format!("k = 2: {PARTS}"))
}

/// The same with this coverage factor and these parts.
fn expanded(budget: Option<&Budget>, of: &str) -> String {
    let Some(budget) = budget else {
        return "Without --budget no uncertainty is stated.".to_owned();
    };
    let rate = if budget.length_error_period_mm().is_some() {
        ""
    } else {
        " U of the last rate takes the errors of the window's first and last reading as independent: length_error_period_um of the budget is not stated."
    };
    format!("± expanded uncertainty, {of}.{rate}")
}

/// What is in the figures of a log, and in their U.
fn note(
    log: &DriftLog,
    found: &Figures,
    (budget, mandrel): (Option<&Budget>, Option<&Artefact>),
) -> String {
    let names = budget.map_or(&[][..], Budget::thermometers_of_mandrel);
    let (expanded, growth) = match mandrel.map(|it| (&it.temperature, it.growth_mm())) {
        Some((ArtefactTemperature::Read { .. }, growth_mm)) => {
            let k = found
                .coverage_factors
                .map(|k| k.in_words())
                .unwrap_or_default();
            let of = format!(
                "{k} by their distributions: {PARTS}, temperature and expansion of the mandrel"
            );
            let at_end_mm = { growth_mm.iter().flatten().last() }.map_or(f64::NAN, |mm| *mm);
            let growth = format!(
                " The growth of the mandrel, read by {}, was taken out: {} µm at the end.",
                names.join(", "),
                um(at_end_mm)
            );
            (expanded(budget, &of), growth)
        }
        Some((ArtefactTemperature::Range { .. }, _)) => {
            let of = format!("a bound: k = 2 of {PARTS}, and all of the mandrel's growth");
            let growth = " The growth of the mandrel within the range of its temperature is in U, which holds in at least 95 %.";
            (expanded(budget, &of), growth.to_owned())
        }
        None => {
            let grows = match (budget, log.axis) {
                (None, _) => "",
                (Some(_), Axis::Z) => " What the mandrel and its holder grow is part of the drift.",
                _ => " What the sensor's holder grows is part of the drift.",
            };
            (note_of(budget), grows.to_owned())
        }
    };
    format!("Drift: reading then minus first reading. {expanded}{growth}")
}

fn table(log: &DriftLog, cells: &[String; 4], note: String) -> Rows {
    let names: Vec<&str> = std::iter::once("displacement along")
        .chain(FIGURE_NAMES)
        .collect();
    let axis = std::iter::once(log.axis.letter().to_owned());
    Rows {
        head: head(&names),
        rows: vec![axis.chain(cells.iter().cloned()).collect()],
        note,
    }
}

/// Label of the axis of time, and the seconds of its unit: minutes where all lasted less than an hour.
pub(super) fn time_axis(longest_s: f64) -> (String, f64) {
    let (unit, unit_s) = if longest_s < HOUR_S {
        ("min", 60.0)
    } else {
        ("h", HOUR_S)
    };
    (format!("time since the first reading / {unit}"), unit_s)
}

fn drawings(
    log: &DriftLog,
    drift: &Drift,
    (values, growth_mm): (&[(f64, f64)], Option<&[f64]>),
    (from, to): (Stamp<Host>, Stamp<Host>),
) -> Result<Vec<Drawing>> {
    let trace = |name: &str, points: Vec<(f64, f64)>| Trace {
        name: name.to_owned(),
        points,
        marks: false,
    };
    let (time, unit_s) = time_axis(values.last().map_or(0.0, |(s, _)| *s));
    let points = values.iter().map(|(s, mm)| (s / unit_s, mm * 1e3));
    let mut traces = vec![trace(log.axis.letter(), points.collect())];
    if let Some(growth_mm) = growth_mm {
        let points = { values.iter().zip(growth_mm) }
            .map(|((s, mm), growth_mm)| (s / unit_s, (mm - growth_mm) * 1e3));
        traces.push(trace("without growth of the mandrel", points.collect()));
    }
    let mut drawings = vec![Drawing {
        svg: plot::svg(&Plot {
            x: time.clone(),
            y: format!("displacement along {} / µm", log.axis),
            traces,
        })?,
        caption: "Displacement since the first reading.".to_owned(),
    }];
    let traces: Vec<Trace> = drift
        .temperatures
        .iter()
        .map(|(sensor, series)| {
            let points = series.between(from, to).iter();
            let points = points.map(|(at, degc)| ((*at - from).as_secs_f64() / unit_s, *degc));
            trace(sensor, points.collect())
        })
        .filter(|trace| !trace.points.is_empty())
        .collect();
    if !traces.is_empty() {
        drawings.push(Drawing {
            svg: plot::svg(&Plot {
                x: time,
                y: "temperature / °C".to_owned(),
                traces,
            })?,
            caption: "Temperatures meanwhile.".to_owned(),
        });
    }
    Ok(drawings)
}

#[cfg(test)]
mod tests;
