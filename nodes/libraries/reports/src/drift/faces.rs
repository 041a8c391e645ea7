//! How the faces of reference blocks drift, and what grows between two blocks.

use std::collections::BTreeMap;

use anyhow::Result;
use iso230::budget::DeviceUncertainty;
use iso230::thermal::DriftCause;
use metrology::Axis;
use metrology::sample::BlockMeasurement;
use metrology::stamp::{Host, Stamp};
use serde::Serialize;
use serde_json::json;

use super::figures::{self, FIGURE_NAMES, Figures, Reader};
use super::{HOUR_S, in_words, show_temperatures, temperatures};
use crate::evaluate::budget::Budget;
use crate::evaluate::drift::{Drift, Work};
use crate::plot::{self, Plot, Trace};
use crate::section::{Drawing, NOT_EVALUATED, Rows, Section, head, um};

/// One reading of a face.
#[derive(Clone, Copy)]
struct Reading {
    at: Stamp<Host>,
    run: u32,
    position_mm: f64,
    /// Without what all readings share by the latency.
    standard_uncertainty_mm: f64,
}

/// Faces that were read twice or more, by block and axis.
type Faces = BTreeMap<(String, Axis), Vec<Reading>>;

fn faces(blocks: &[BlockMeasurement]) -> Faces {
    let mut faces = Faces::new();
    for block in blocks {
        for axis in Axis::LINEAR {
            if let Some(face) = block.faces[axis] {
                let key = (block.block_id.clone(), axis);
                faces.entry(key).or_default().push(Reading {
                    at: block.at,
                    run: block.run,
                    position_mm: face.position_mm,
                    standard_uncertainty_mm: face.independent_uncertainty_mm(),
                });
            }
        }
    }
    faces.retain(|_, readings| readings.len() >= 2);
    faces
}

/// How one face drifts, or the distance between two.
#[derive(Serialize)]
struct FaceDrift {
    face: String,
    #[serde(skip)]
    axis: Axis,
    recorded_h: f64,
    after_1_h_mm: Option<f64>,
    after_3_h_mm: Option<f64>,
    range_mm: f64,
    /// The same with uncertainties, and the rate at the end.
    figures: Option<Figures>,
    not_evaluated: Option<String>,
}

impl FaceDrift {
    fn new(face: String, axis: Axis, cause: DriftCause, readings: &[Reading]) -> Self {
        let values = since_first(readings);
        let worst_mm = { readings.iter() }.fold(0.0, |u: f64, r| u.max(r.standard_uncertainty_mm));
        let sensor = DeviceUncertainty {
            expanded_uncertainty_mm: worst_mm,
            expanded_uncertainty_per_length: 0.0,
            coverage_factor: 1.0,
        };
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        let (least, greatest) =
            { values.iter() }.fold(ends, |(l, g), (_, v)| (l.min(*v), g.max(*v)));
        let found = figures::of(axis, cause, &values, &Reader::certified(sensor));
        let why = found.as_ref().err().map(ToString::to_string);
        // The probe's uncertainty is one number for all its causes.
        let figures = found.ok().map(|found| Figures {
            contributions: None,
            ..found
        });
        let value = |of: fn(&Figures) -> Option<f64>| figures.as_ref().and_then(of);
        Self {
            face,
            axis,
            recorded_h: values.last().map_or(0.0, |(time_s, _)| time_s / HOUR_S),
            after_1_h_mm: value(|f| f.after_1_h.map(|d| d.value_mm)),
            after_3_h_mm: value(|f| f.after_3_h.map(|d| d.value_mm)),
            range_mm: greatest - least,
            figures,
            not_evaluated: why,
        }
    }

    /// Such as `greatest range 29.94 ± 0.85 µm, at block_1 Z, within 3.8 h.`
    fn in_short(&self, stated: bool) -> String {
        let [_, _, range, _] = self.cells(stated);
        format!(
            "greatest range {range} µm, at {}, within {:.1} h.",
            self.face, self.recorded_h
        )
    }

    fn cells(&self, stated: bool) -> [String; 4] {
        let dash = || um(f64::NAN);
        self.figures.as_ref().map_or_else(
            || [dash(), dash(), um(self.range_mm), dash()],
            |figures| figures.cells(stated),
        )
    }

    fn row(&self, stated: bool) -> Vec<String> {
        let cells = self.cells(stated);
        let first = [self.face.clone(), format!("{:.2}", self.recorded_h)];
        first.into_iter().chain(cells).collect()
    }
}

/// Time since the first reading (s), position less that of the first (mm).
fn since_first(readings: &[Reading]) -> Vec<(f64, f64)> {
    let Some(first) = readings.first() else {
        return vec![];
    };
    let value = |reading: &Reading| {
        let time_s = (reading.at - first.at).as_secs_f64();
        (time_s, reading.position_mm - first.position_mm)
    };
    readings.iter().map(value).collect()
}

/// What lies between the two faces of an axis that are farthest apart, run by run.
fn between(faces: &Faces, axis: Axis) -> Option<(String, Vec<Reading>)> {
    let of_axis = || faces.iter().filter(|((_, of), _)| *of == axis);
    let place_mm = |readings: &[Reading]| readings.first().map_or(f64::NAN, |r| r.position_mm);
    let by_place = |a: &(&(String, Axis), &Vec<Reading>), b: &(&(String, Axis), &Vec<Reading>)| {
        place_mm(a.1).total_cmp(&place_mm(b.1))
    };
    let ((low, _), lower) = of_axis().min_by(by_place)?;
    let ((high, _), upper) = of_axis().max_by(by_place)?;
    if low == high {
        return None;
    }
    let pair = |a: &Reading| {
        let b = upper.iter().find(|b| b.run == a.run)?;
        Some(Reading {
            at: a.at.max(b.at),
            run: a.run,
            position_mm: b.position_mm - a.position_mm,
            standard_uncertainty_mm: a.standard_uncertainty_mm.hypot(b.standard_uncertainty_mm),
        })
    };
    let pairs: Vec<Reading> = lower.iter().filter_map(pair).collect();
    let name = format!(
        "{axis}: {high} minus {low}, {:.0} mm apart",
        place_mm(&pairs)
    );
    (pairs.len() >= 2).then_some((name, pairs))
}

/// What drove the drift, where it was one thing.
fn cause(work: &Work) -> DriftCause {
    let spindle = work.spindle_rad_s.map(|rad_s| rad_s > 0.0);
    let has = |rotary: bool| work.moved.iter().any(|axis| axis.is_linear() != rotary);
    match (spindle, has(false), has(true)) {
        (Some(false), false, false) => DriftCause::Environment,
        (Some(true), false, false) => DriftCause::Spindle,
        (Some(false), true, false) => DriftCause::LinearAxis,
        (Some(false), false, true) => DriftCause::RotaryAxis,
        _ => DriftCause::NotStated,
    }
}

fn work_in_words(work: &Work) -> String {
    let names: Vec<&str> = work.moved.iter().map(|axis| axis.letter()).collect();
    let axes = if names.is_empty() {
        "No part was made".to_owned()
    } else {
        format!(
            "Between the readings parts were made with {}",
            names.join(", ")
        )
    };
    let spindle = match work.spindle_rad_s {
        Some(rad_s) => format!(
            "the spindle turned at up to {:.0} 1/min",
            rad_s * 60.0 / std::f64::consts::TAU
        ),
        None => "whether the spindle turned is not in the bag".to_owned(),
    };
    format!("{axes}; {spindle}.")
}

/// The part, where a face was read twice.
///
/// # Errors
/// When a plot cannot be drawn.
pub(super) fn section(
    blocks: &[BlockMeasurement],
    drift: &Drift,
    budget: Option<&Budget>,
) -> Result<Option<Section>> {
    let faces = faces(blocks);
    if faces.is_empty() {
        return Ok(None);
    }
    let stated = budget.is_some();
    let cause = cause(&drift.work);
    let of_face = |((block, axis), readings): (&(String, Axis), &Vec<Reading>)| {
        FaceDrift::new(format!("{block} {axis}"), *axis, cause, readings)
    };
    let drifts: Vec<FaceDrift> = faces.iter().map(of_face).collect();
    let growths: Vec<FaceDrift> = Axis::LINEAR
        .into_iter()
        .filter_map(|axis| {
            let (name, pairs) = between(&faces, axis)?;
            Some(FaceDrift::new(name, axis, cause, &pairs))
        })
        .collect();
    let mut section = Section::new("Drift of the readings, after ISO 230-3");
    let name = in_words(cause);
    section
        .lines
        .push(format!("{} ISO 230-3: {name}.", work_in_words(&drift.work)));
    let worst = { drifts.iter() }.max_by(|a, b| a.range_mm.total_cmp(&b.range_mm));
    section
        .answers
        .extend(worst.map(|worst| worst.in_short(stated)));
    for line in reasons(drifts.iter().chain(&growths)) {
        section.warn(NOT_EVALUATED, line);
    }
    section.tables.push(Rows {
        note: note(stated),
        ..table("face", &drifts, stated)
    });
    if !growths.is_empty() {
        section.tables.push(Rows {
            note: "What the distance of two faces drifts: distortion along the axis between two of its positions, as of moving linear axes.".to_owned(),
            ..table("between faces", &growths, stated)
        });
    }
    let at = || faces.values().flatten().map(|reading| reading.at);
    let beside = at().min().zip(at().max());
    let beside = beside.map_or_else(Vec::new, |(from, to)| temperatures(drift, from, to));
    show_temperatures(&mut section, drift, &beside);
    section.figures = json!({
        "test": section.title,
        "iso230_3": drifts,
        "iso230_3_between_faces": growths,
        "cause": cause,
        "temperatures": beside,
    });
    section.drawings = drawings(&faces, worst.map(|worst| worst.axis))?;
    Ok(Some(section))
}

/// Each reason once, with how many it is of.
fn reasons<'a>(drifts: impl Iterator<Item = &'a FaceDrift>) -> Vec<String> {
    let mut found: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for drift in drifts {
        if let Some(why) = &drift.not_evaluated {
            found.entry(why).or_default().push(&drift.face);
        }
    }
    let line = |(why, of): (&str, Vec<&str>)| match of[..] {
        [one] => format!("{one}: only the range is told: {why}."),
        _ => format!("{} faces: only the range is told: {why}.", of.len()),
    };
    found.into_iter().map(line).collect()
}

fn note(stated: bool) -> String {
    let uncertainty = if stated {
        " ± expanded uncertainty, k = 2: that of two readings by the probe."
    } else {
        ""
    };
    format!(
        "By the machine's own probe on its reference blocks, not by sensors on a spindle: drift of probe, machine and blocks together.{uncertainty}"
    )
}

fn table(first: &str, drifts: &[FaceDrift], stated: bool) -> Rows {
    let names: Vec<&str> = [first, "recorded / h"]
        .into_iter()
        .chain(FIGURE_NAMES)
        .collect();
    Rows {
        head: head(&names),
        rows: drifts.iter().map(|drift| drift.row(stated)).collect(),
        note: String::new(),
    }
}

/// One drawing for each axis, that of the greatest drift first.
fn drawings(faces: &Faces, worst: Option<Axis>) -> Result<Vec<Drawing>> {
    let first = faces.values().flatten().map(|reading| reading.at).min();
    let mut drawings = vec![];
    let mut axes = Axis::LINEAR;
    axes.sort_by_key(|axis| Some(*axis) != worst);
    for axis in axes {
        let traces: Vec<Trace> = faces
            .iter()
            .filter(|((_, of), _)| *of == axis)
            .map(|((block, _), readings)| {
                let begin = first.unwrap_or(readings[0].at);
                let late_h = (readings[0].at - begin).as_secs_f64() / HOUR_S;
                let points = since_first(readings).into_iter();
                Trace {
                    name: block.clone(),
                    points: points
                        .map(|(s, mm)| (s / HOUR_S + late_h, mm * 1e3))
                        .collect(),
                    marks: false,
                }
            })
            .collect();
        if !traces.is_empty() {
            drawings.push(Drawing {
                svg: plot::svg(&Plot {
                    x: "time since the first reading / h".to_owned(),
                    y: format!("drift of the {axis} reading / µm"),
                    traces,
                })?,
                caption: format!("{axis} face of each block"),
            });
        }
    }
    Ok(drawings)
}
