//! ISO 230-4 of a bag, and the breakdown of its circles into causes.

use anyhow::Result;
use iso230::breakdown::{
    self, BreakdownConfig, CircularPlane, CircularRecording, CircularSample, CircularSense,
};
use iso230::circular::{CircularResult, CircularTest, CircularTrace, evaluate};
use metrology::Axis;
use metrology::sample::{Sense, TestPlane};

use super::positioning::figure;
use super::section::{Drawing, Rows, Section, head};
use super::trace;
use crate::evaluate::budget::{Budget, unstate};
use crate::evaluate::circle_reading::CircleReading;
use crate::evaluate::circles::{CircleRecording, Instrument, plane_axes};
use crate::evaluate::correction::Correction;
use crate::evaluate::test_conditions::TestConditions;
use causes::Read;
pub use refused::refused;
use scale::Expansion;

mod causes;
mod refused;
mod scale;
mod turn;

/// What a ballbar cannot tell.
const BY_BALLBAR: &str =
    "Read by a ballbar, radially alone: F and D need the calibrated length of the ballbar.";
/// Warnings of a circle, by what they have in common.
const NOT_CORRECTED: &str = "Not corrected to 20 °C";
const NO_UNCERTAINTY: &str = "No uncertainty";
/// What U of H lacks without a figure of the unrest at rest.
const NO_UNREST: &str =
    "U of H has nothing for the unrest of readings: the budget states no environmental_unrest_um.";
/// About which centre each figure is.
const CENTRES: &str = "G of a sense: about the least-squares centre of that sense. G of both, F, D and H: about that of both senses together, in one frame. F is not about the centre to which the instrument was set up, the standard's other choice: a recording does not hold how far that is from the programmed one.";

/// One part for each circle (both senses together), then one for the breakdown.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn sections(
    circles: &[CircleRecording],
    budget: Option<&Budget>,
    conditions: &TestConditions,
) -> Result<Vec<Section>> {
    let mut sections = Vec::new();
    let mut errors = Vec::new();
    for group in groups(circles) {
        let runs: Vec<u32> = group.iter().map(|circle| circle.segment.run).collect();
        let read = conditions.during(&runs);
        let reading = CircleReading::of(budget, &read, group[0].instrument);
        let (section, result) = section(&group, &reading)?;
        sections.push(section);
        errors.extend(result.map(|result| Evaluated::of(group[0], &result)));
    }
    if !circles.is_empty() {
        sections.extend(breakdowns(circles, budget, conditions, &errors));
    }
    Ok(sections)
}

/// Recordings of one circle under one zero, which is one frame: each sense once.
fn groups(circles: &[CircleRecording]) -> Vec<Vec<&CircleRecording>> {
    let mut groups: Vec<Vec<&CircleRecording>> = Vec::new();
    for circle in circles {
        let fits = |group: &&mut Vec<&CircleRecording>| {
            let first = &group[0];
            let (a, b) = (&first.segment, &circle.segment);
            a.plane == b.plane
                && (a.centre_mm - b.centre_mm).norm() < 1e-6
                && (a.radius_mm - b.radius_mm).abs() < 1e-6
                && (a.feed_mm_s - b.feed_mm_s).abs() < 1e-6
                && (a.setup_id, a.zero_id) == (b.setup_id, b.zero_id)
                && (first.compensated, first.instrument) == (circle.compensated, circle.instrument)
                && group.iter().all(|other| other.segment.sense != b.sense)
        };
        match groups.iter_mut().find(fits) {
            Some(group) => group.push(circle),
            None => groups.push(vec![circle]),
        }
    }
    groups
}

/// The greatest circular error of one circle's senses.
struct Evaluated {
    plane: TestPlane,
    compensated: bool,
    error_mm: f64,
}

impl Evaluated {
    fn of(circle: &CircleRecording, result: &CircularResult) -> Self {
        let senses = [result.clockwise, result.counter_clockwise];
        let errors = senses.into_iter().flatten();
        let errors_mm = errors.map(|sense| sense.circular_error.value_mm);
        Self {
            plane: circle.segment.plane,
            compensated: circle.compensated,
            error_mm: errors_mm.fold(0.0, f64::max),
        }
    }
}

fn section(
    all: &[&CircleRecording],
    reading: &CircleReading,
) -> Result<(Section, Option<CircularResult>)> {
    // A slip of the instrument makes every figure of its run, and no figure leaves a reading out.
    let sound: Vec<&CircleRecording> = all.iter().copied().filter(|one| is_sound(one)).collect();
    let is_empty = sound.is_empty();
    let group = if is_empty { all } else { &sound };
    let mut section = headed(group, reading);
    let refused: Vec<String> = { all.iter() }
        .filter_map(|circle| refused::outlier(circle))
        .collect();
    for line in &refused {
        section.not_evaluated(line);
    }
    if is_empty {
        section.figures = serde_json::json!({ "test": section.title, "not_evaluated": refused });
        return Ok((section, None));
    }
    section.lines.extend(turn::lines(group));
    let far: Vec<String> = { group.iter() }
        .filter_map(|circle| refused::far(circle))
        .collect();
    section.name_far(&far);
    let test = at_20_degc(group, &reading.measured.correction);
    let evaluated = evaluate(&test, &reading.measured.budget);
    match &evaluated {
        Ok(result) => state_figures(&mut section, (group, reading), &test, result)?,
        Err(error) => section.without_figures(error),
    }
    if !refused.is_empty() {
        section.figures["not_evaluated"] = serde_json::json!(refused);
    }
    let result = evaluated.ok();
    let centre_mm = result.as_ref().map_or([0.0; 2], centre);
    let drawn = trace::svg(&traces(group, &test, centre_mm), group[0].segment.plane)?;
    section.drawings.push(Drawing {
        svg: drawn.svg,
        caption: format!(
            "Deviations from the circle about its least-squares centre, {}",
            drawn.scale
        ),
    });
    Ok((section, result))
}

/// Whether a circle has no outlier and its radius.
fn is_sound(circle: &CircleRecording) -> bool {
    refused::outlier(circle).is_none()
}

/// The head of a circle's part.
fn headed(group: &[&CircleRecording], reading: &CircleReading) -> Section {
    let segment = &group[0].segment;
    let state = if group[0].compensated {
        "compensated"
    } else {
        "not compensated"
    };
    let letters = plane_axes(segment.plane).map_or_else(String::new, |[u, v]| format!("{u}{v}"));
    let runs = runs_of(group);
    let mut section = Section::new(format!(
        "Circle {letters}, R {:.3} mm, {:.0} mm/min about ({:.1}, {:.1}, {:.1}), {runs}: {state}",
        segment.radius_mm,
        segment.feed_mm_s * 60.0,
        segment.centre_mm.x,
        segment.centre_mm.y,
        segment.centre_mm.z
    ));
    if reading.instrument == Instrument::Ballbar {
        section.lines.push(BY_BALLBAR.to_owned());
    }
    section
}

/// The figures of a circle: answer, table, what they lack, and for machines.
fn state_figures(
    section: &mut Section,
    (group, reading): (&[&CircleRecording], &CircleReading),
    test: &CircularTest,
    result: &CircularResult,
) -> Result<()> {
    section.answers.push(in_short(result, reading.is_stated()));
    section.tables.push(figures(result, reading));
    let correction = &reading.measured.correction;
    correction.name_far(section);
    let line = format!("F and D: {}", correction.in_words(test.nominal_radius_mm));
    if correction.lacks().is_some() {
        section.warn(NOT_CORRECTED, line);
    } else {
        section.lines.push(line);
    }
    // That there is no budget is stated once for the whole page.
    let is_of_ballbar = reading.instrument == Instrument::Ballbar && !reading.has_no_budget();
    if let Some(why) = reading.unstated.filter(|_| is_of_ballbar) {
        section.warn(NO_UNCERTAINTY, format!("No figure has a U: {why}."));
    }
    section.figures = serde_json::json!({
        "test": section.title,
        "iso230_4": as_json(result, reading)?,
        "turns": turn::figures(group),
        "correction_to_20_degc": correction.as_json(),
        "no_verdict": reading.unstated,
        "no_verdict_on_radii": reading.no_verdict_on_radii(),
    });
    Ok(())
}

/// Figures that are lengths from the nominal radius.
const RADIAL_POINTERS: [&str; 3] = [
    "/clockwise/greatest_radial_deviation",
    "/clockwise/least_radial_deviation",
    "/both/mean_radial_deviation",
];

/// The figures for machines; those without an uncertainty have null for it.
fn as_json(result: &CircularResult, reading: &CircleReading) -> Result<serde_json::Value> {
    let mut all = serde_json::to_value(result)?;
    if !reading.is_stated() {
        unstate(&mut all);
    } else if !reading.are_radii_stated() {
        let other = RADIAL_POINTERS.map(|name| name.replace("/clockwise", "/counter_clockwise"));
        let names = RADIAL_POINTERS
            .iter()
            .copied()
            .chain(other.iter().map(String::as_str));
        for name in names {
            all.pointer_mut(name).into_iter().for_each(unstate);
        }
    }
    Ok(all)
}

/// The recordings of a circle, with its radii at 20 °C where they are corrected here.
fn at_20_degc(group: &[&CircleRecording], correction: &Correction) -> CircularTest {
    let of = |sense| {
        let found = group.iter().find(|circle| circle.segment.sense == sense);
        found.map(|circle| {
            CircularTrace::PointsMm(circle.points.iter().map(|point| point.at_mm).collect())
        })
    };
    let as_read = CircularTest {
        nominal_radius_mm: group[0].segment.radius_mm,
        clockwise: of(Sense::Clockwise),
        counter_clockwise: of(Sense::CounterClockwise),
    };
    as_read.corrected_to_20_degc(correction.differential_expansion())
}

/// Angle and radial deviation of every reading about a centre, of each sense as it was recorded, rad and mm.
fn traces(
    group: &[&CircleRecording],
    test: &CircularTest,
    centre_mm: [f64; 2],
) -> Vec<(String, Vec<(f64, f64)>)> {
    let about = |[u, v]: &[f64; 2]| {
        let (u, v) = (u - centre_mm[0], v - centre_mm[1]);
        (v.atan2(u), u.hypot(v) - test.nominal_radius_mm)
    };
    let of = |circle: &&CircleRecording| {
        let sense = circle.segment.sense;
        let trace = match sense {
            Sense::Clockwise => test.clockwise.as_ref(),
            _ => test.counter_clockwise.as_ref(),
        };
        let points = match trace {
            Some(CircularTrace::PointsMm(points)) => points.iter().map(about).collect(),
            _ => Vec::new(),
        };
        (sense_name(sense).to_owned(), points)
    };
    group.iter().map(of).collect()
}

/// Which runs these are, in words.
fn runs_of(group: &[&CircleRecording]) -> String {
    let runs: Vec<String> = group.iter().map(|c| c.segment.run.to_string()).collect();
    match runs.as_slice() {
        [one] => format!("run {one}"),
        several => format!("runs {}", several.join(" and ")),
    }
}

fn sense_name(sense: Sense) -> &'static str {
    match sense {
        Sense::Clockwise => "clockwise",
        Sense::CounterClockwise => "counter-clockwise",
        Sense::None => "no sense",
    }
}

/// Least-squares centre of both senses, or of the one that was recorded, mm.
fn centre(result: &CircularResult) -> [f64; 2] {
    let one = result.clockwise.or(result.counter_clockwise);
    let both = result.both.map(|both| both.centre_mm);
    both.or(one.map(|one| one.centre_mm)).unwrap_or_default()
}

/// The circular error of both senses, or of each that was recorded.
fn in_short(result: &CircularResult, stated: bool) -> String {
    let coverage = if stated { " (k = 2)" } else { "" };
    if let Some(both) = &result.both {
        let error = figure(&both.circular_error, stated);
        return format!("circular error G of both senses {error} µm{coverage}.");
    }
    let senses = [
        ("clockwise", &result.clockwise),
        ("counter-clockwise", &result.counter_clockwise),
    ];
    let mut errors = vec![];
    for (name, sense) in senses {
        if let Some(sense) = sense {
            let error = figure(&sense.circular_error, stated);
            errors.push(format!("{name} {error} µm"));
        }
    }
    format!("circular error G, {}{coverage}.", errors.join(", "))
}

fn figures(result: &CircularResult, reading: &CircleReading) -> Rows {
    let (stated, radial) = (reading.is_stated(), reading.are_radii_stated());
    let mut rows = Vec::new();
    for (name, sense) in [
        ("clockwise", &result.clockwise),
        ("counter-clockwise", &result.counter_clockwise),
    ] {
        if let Some(sense) = sense {
            rows.push(vec![
                name.to_owned(),
                figure(&sense.circular_error, stated),
                figure(&sense.greatest_radial_deviation, radial),
                figure(&sense.least_radial_deviation, radial),
                "—".to_owned(),
                "—".to_owned(),
            ]);
        }
    }
    if let Some(both) = &result.both {
        rows.push(vec![
            "both".to_owned(),
            figure(&both.circular_error, stated),
            "—".to_owned(),
            "—".to_owned(),
            figure(&both.mean_radial_deviation, radial),
            figure(&both.hysteresis_1996, stated),
        ]);
    }
    Rows {
        head: head(&["ISO 230-4 / µm", "G", "F max", "F min", "D", "H (1996)"]),
        rows,
        note: note(result, reading),
    }
}

/// What the uncertainties of the figures are, and what they lack.
fn note(result: &CircularResult, reading: &CircleReading) -> String {
    let mut sentences = vec![];
    match reading.unstated {
        None => sentences.push("± expanded uncertainty, k = 2."),
        Some(_) if reading.has_no_budget() => {
            sentences.push("Without --budget no uncertainty is stated.");
        }
        Some(_) => sentences.push("The budget states no ballbar: no uncertainty is stated."),
    }
    if reading.is_stated() && !reading.are_radii_stated() {
        sentences.push("F and D have no uncertainty: the budget states no ballbar.length.");
    }
    let unrest = reading.measured.budget.environmental_unrest_mm;
    if reading.is_stated() && result.both.is_some() && unrest.is_none() {
        sentences.push(NO_UNREST);
    }
    sentences.push(CENTRES);
    sentences.join(" ")
}

fn breakdowns(
    circles: &[CircleRecording],
    budget: Option<&Budget>,
    conditions: &TestConditions,
    evaluated: &[Evaluated],
) -> Vec<Section> {
    let mut sections = Vec::new();
    for compensated in [false, true] {
        let state = if compensated {
            "compensated"
        } else {
            "not compensated"
        };
        let own = circles.iter().filter(|one| one.compensated == compensated);
        let mut recordings = Vec::new();
        let mut readings = Vec::new();
        let mut left_out = Vec::new();
        for circle in own {
            let reading = reading_of(circle, budget, conditions);
            let Some(recording) = recording(circle, &reading) else {
                continue;
            };
            if let Some(why) = refused::of_causes(circle, &recording) {
                left_out.push(why);
                continue;
            }
            recordings.push(recording);
            readings.push((circle.segment.plane, reading));
        }
        if recordings.is_empty() && left_out.is_empty() {
            continue;
        }
        let read = Read::of(readings.into_iter());
        let config = BreakdownConfig::default();
        let found = if recordings.is_empty() {
            Err("no circle can be broken down".to_owned())
        } else {
            breakdown::evaluate_with(&recordings, read.errors(), &config)
                .map_err(|it| it.to_string())
        };
        let mut of_state = match found {
            Ok(found) => {
                let of_plane = |plane| {
                    let own = (circles, compensated);
                    let expansion = Expansion::of(plane, own, budget, conditions);
                    let greatest_mm = greatest_mm(evaluated, plane.axes, compensated);
                    causes::section(plane, (state, greatest_mm), &expansion, &read)
                };
                found.planes.iter().map(of_plane).collect()
            }
            Err(error) => {
                let mut section = Section::new(format!("Causes, {state}"));
                section.not_evaluated(error);
                vec![section]
            }
        };
        if let Some(first) = of_state.first_mut() {
            first.tell_left_out(&left_out);
        }
        sections.extend(of_state);
    }
    sections
}

/// The greatest circular error of a sense among the circles of a plane, mm.
fn greatest_mm(evaluated: &[Evaluated], axes: [Axis; 2], compensated: bool) -> Option<f64> {
    let of_plane =
        |one: &&Evaluated| one.compensated == compensated && plane_axes(one.plane) == Some(axes);
    let own = evaluated.iter().filter(of_plane);
    own.map(|one| one.error_mm).reduce(f64::max)
}

fn reading_of(
    circle: &CircleRecording,
    budget: Option<&Budget>,
    conditions: &TestConditions,
) -> CircleReading {
    let read = conditions.during(&[circle.segment.run]);
    CircleReading::of(budget, &read, circle.instrument)
}

fn recording(circle: &CircleRecording, reading: &CircleReading) -> Option<CircularRecording> {
    let segment = &circle.segment;
    let plane = match segment.plane {
        TestPlane::Xy => CircularPlane::Xy,
        TestPlane::Yz => CircularPlane::Yz,
        TestPlane::Zx => CircularPlane::Zx,
        TestPlane::None => return None,
    };
    let sense = match segment.sense {
        Sense::Clockwise => CircularSense::Clockwise,
        Sense::CounterClockwise => CircularSense::CounterClockwise,
        Sense::None => return None,
    };
    let [u, v] = plane_axes(segment.plane)?;
    let samples = circle
        .points
        .iter()
        .map(|point| CircularSample::from_point(point.at_mm, segment.radius_mm, point.time_s));
    Some(CircularRecording {
        plane,
        centre_mm: [segment.centre_mm[u.index()], segment.centre_mm[v.index()]],
        radius_mm: segment.radius_mm,
        feed_mm_s: segment.feed_mm_s,
        sense,
        setup_id: segment.setup_id,
        zero_id: segment.zero_id,
        reference: reading.reference(segment.radius_mm),
        samples: samples.collect(),
    })
}

#[cfg(test)]
mod tests;
