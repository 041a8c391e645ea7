//! ISO 230-4 of a bag, and the breakdown of its circles into causes.

use anyhow::Result;
use iso230::breakdown::{
    self, Alias, BreakdownConfig, CircularPlane, CircularRecording, CircularSample, CircularSense,
    Needed, PlaneBreakdown, ReferenceLength, RowKey, Unit,
};
use iso230::circular::{CircularResult, CircularTest, CircularTrace, evaluate};
use metrology::sample::{Sense, TestPlane};
use metrology::squareness::{between, in_words};

use super::positioning::figure;
use super::section::{Drawing, Rows, Section, head, rounded, um};
use super::trace;
use crate::evaluate::budget::Budget;
use crate::evaluate::circles::{CircleRecording, Instrument, plane_axes};
use crate::evaluate::correction::{Correction, MeasuredCircle};
use crate::evaluate::test_conditions::TestConditions;
use scale::Expansion;

mod scale;
mod turn;

/// Coverage factor of what is printed.
const COVERAGE: f64 = 2.0;
/// Probability above which a row may be chance.
const BY_CHANCE: f64 = 0.01;

/// What a ballbar cannot tell.
const BY_BALLBAR: &str =
    "Read by a ballbar, radially alone: F and D need the calibrated length of the ballbar.";
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
    for group in groups(circles) {
        let runs: Vec<u32> = group.iter().map(|circle| circle.segment.run).collect();
        let read = conditions.during(&runs);
        let measured = MeasuredCircle::of(budget, &read, group[0].instrument);
        sections.push(section(&group, &measured, budget.is_some())?);
    }
    if !circles.is_empty() {
        sections.extend(breakdowns(circles, budget, conditions));
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

fn section(group: &[&CircleRecording], measured: &MeasuredCircle, stated: bool) -> Result<Section> {
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
    if group[0].instrument == Instrument::Ballbar {
        section.lines.push(BY_BALLBAR.to_owned());
    }
    section.lines.extend(turn::lines(group));
    let test = at_20_degc(group, &measured.correction);
    let mut centre_mm = [0.0; 2];
    match evaluate(&test, &measured.budget) {
        Ok(result) => {
            section.answers.push(in_short(&result, stated));
            section.tables.push(figures(&result, stated));
            section.lines.push(radii_in_words(measured, &test));
            section.figures = serde_json::json!({
                "test": section.title,
                "iso230_4": result,
                "turns": turn::figures(group),
                "correction_to_20_degc": measured.correction.as_json(),
                "no_verdict_on_radii": no_verdict(group[0].instrument, &measured.correction),
            });
            centre_mm = centre(&result);
        }
        Err(error) => section.not_evaluated(error),
    }
    let drawn = trace::svg(&traces(group, &test, centre_mm), segment.plane)?;
    section.drawings.push(Drawing {
        svg: drawn.svg,
        caption: format!(
            "Deviations from the circle about its least-squares centre, {}",
            drawn.scale
        ),
    });
    Ok(section)
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

/// At which temperature the radii of F and D are.
fn radii_in_words(measured: &MeasuredCircle, test: &CircularTest) -> String {
    let words = measured.correction.in_words(test.nominal_radius_mm);
    format!("F and D: {words}")
}

/// Why nothing is decided of F and D; none: they are the radii at 20 °C.
fn no_verdict(instrument: Instrument, correction: &Correction) -> Option<String> {
    let without_length = "the calibrated length of the ballbar is not stated";
    let by_ballbar = (instrument == Instrument::Ballbar).then(|| without_length.to_owned());
    by_ballbar.or_else(|| correction.lacks())
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
    if let Some(both) = &result.both {
        let error = figure(&both.circular_error, stated);
        return format!("circular error G of both senses {error} µm.");
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
    format!("circular error G, {}.", errors.join(", "))
}

fn figures(result: &CircularResult, stated: bool) -> Rows {
    let mut rows = Vec::new();
    for (name, sense) in [
        ("clockwise", &result.clockwise),
        ("counter-clockwise", &result.counter_clockwise),
    ] {
        if let Some(sense) = sense {
            rows.push(vec![
                name.to_owned(),
                figure(&sense.circular_error, stated),
                figure(&sense.greatest_radial_deviation, stated),
                figure(&sense.least_radial_deviation, stated),
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
            figure(&both.mean_radial_deviation, stated),
            figure(&both.hysteresis_1996, stated),
        ]);
    }
    Rows {
        head: head(&["ISO 230-4 / µm", "G", "F max", "F min", "D", "H (1996)"]),
        rows,
        note: if stated {
            format!("± expanded uncertainty, k = 2. {CENTRES}")
        } else {
            format!("Without --budget no uncertainty is stated. {CENTRES}")
        },
    }
}

fn breakdowns(
    circles: &[CircleRecording],
    budget: Option<&Budget>,
    conditions: &TestConditions,
) -> Vec<Section> {
    let mut sections = Vec::new();
    for compensated in [false, true] {
        let recordings: Vec<CircularRecording> = circles
            .iter()
            .filter(|circle| circle.compensated == compensated)
            .filter_map(|circle| recording(circle, budget))
            .collect();
        if recordings.is_empty() {
            continue;
        }
        let state = if compensated {
            "compensated"
        } else {
            "not compensated"
        };
        match breakdown::evaluate(&recordings, &BreakdownConfig::default()) {
            Ok(found) => {
                sections.extend(found.planes.iter().map(|plane| {
                    let own = (circles, compensated);
                    let expansion = Expansion::of(plane, own, budget, conditions);
                    plane_section(plane, state, &expansion)
                }));
            }
            Err(error) => {
                let mut section = Section::new(format!("Causes, {state}"));
                section.not_evaluated(error);
                sections.push(section);
            }
        }
    }
    sections
}

fn recording(circle: &CircleRecording, budget: Option<&Budget>) -> Option<CircularRecording> {
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
        reference: match (circle.instrument, budget) {
            (Instrument::GridEncoder, Some(budget)) => ReferenceLength::Calibrated {
                standard_uncertainty_mm: budget.radius_standard_mm(segment.radius_mm),
            },
            _ => ReferenceLength::Free,
        },
        samples: samples.collect(),
    })
}

fn plane_section(plane: &PlaneBreakdown, state: &str, expansion: &Expansion) -> Section {
    let [u, v] = plane.axes;
    let mut section = Section::new(format!("Causes in {u}{v}, {state}"));
    section.answer(format!(
        "{} recordings, worst circularity {} µm; what no row explains has {:.2} µm standard deviation.",
        plane.recordings.len(),
        um(plane.worst_circularity_mm),
        plane.noise.residual_mm * 1e3
    ));
    let (lines, scale_at_20_degc) = expansion.state(plane);
    section.lines.extend(lines);
    let rows = plane.rows.iter().map(|row| {
        vec![
            row.name.clone(),
            with_unit(row.value, row.standard_uncertainty, row.unit),
            um(row.peak_to_peak_mm),
            format!("{:.1}", row.share_percent),
            format!("{:.1}", row.variance_share_percent),
            um(row.worst_circularity_without_mm),
        ]
    });
    section.tables.push(Rows {
        head: head(&[
            "cause",
            "value ± U (k = 2)",
            "span / µm",
            "share / %",
            "of variance / %",
            "G without / µm",
        ]),
        rows: rows.collect(),
        note: format!(
            "Span: greatest minus least deviation that the cause alone makes on one circle. G without: the greatest circular error that would be left. {}{}",
            squareness(plane),
            needed(plane)
        ),
    });
    section.tables.extend(where_to_look(plane));
    section.figures = serde_json::json!({
        "test": section.title,
        "breakdown": plane,
        "scale_at_20_degc": scale_at_20_degc,
    });
    section
}

/// The sign of the squareness, where there is a row of it.
fn squareness(plane: &PlaneBreakdown) -> String {
    let [u, v] = plane.axes;
    let row = plane.row(&RowKey::Squareness);
    let words = row.and_then(|_| in_words(between(u, v)?));
    words.map_or_else(String::new, |words| format!("{words} "))
}

/// Where to look, for the causes that chance does not explain.
fn where_to_look(plane: &PlaneBreakdown) -> Option<Rows> {
    let (seen, not_seen): (Vec<_>, Vec<_>) =
        plane.rows.iter().partition(|row| row.chance < BY_CHANCE);
    let note = match not_seen.as_slice() {
        [] => String::new(),
        rows => {
            let names: Vec<&str> = rows.iter().map(|row| row.name.as_str()).collect();
            format!("Not beyond chance: {}.", names.join(", "))
        }
    };
    (!seen.is_empty()).then(|| Rows {
        head: head(&["cause", "look at"]),
        rows: seen
            .iter()
            .map(|row| vec![row.name.clone(), row.cause.clone()])
            .collect(),
        note,
    })
}

fn needed(plane: &PlaneBreakdown) -> String {
    let tied = plane
        .rows
        .iter()
        .flat_map(|row| &row.aliases)
        .chain(&plane.unseen);
    let words: Vec<String> = tied.map(asks).collect();
    if words.is_empty() {
        "Every row is told apart from the others.".to_owned()
    } else {
        words.join(" ")
    }
}

fn asks(alias: &Alias) -> String {
    let word = |needed: &Needed| match needed {
        Needed::OtherSense => "the other sense",
        Needed::OtherFeed => "another feed",
        Needed::OtherRadius => "another radius",
        Needed::OtherRadiusSameZero => "another radius under the same zero",
        Needed::FullCircle => "a full circle",
        Needed::CalibratedReference => "a calibrated reference length",
    };
    let ways = alias.needed.iter().map(|way| {
        let words: Vec<&str> = way.iter().map(word).collect();
        words.join(" and ")
    });
    format!(
        "{} is told apart by {}.",
        alias.name,
        ways.collect::<Vec<_>>().join(", or by ")
    )
}

fn with_unit(value: f64, standard_uncertainty: f64, unit: Unit) -> String {
    let (factor, name) = match unit {
        Unit::Mm => (1e3, "µm"),
        Unit::MmPerMm => (1e6, "µm/m"),
        Unit::Rad => (1e6, "µrad"),
        Unit::S => (1e3, "ms"),
        Unit::S2 => (1e6, "ms²"),
        Unit::PerMm => (1e6, "µm/(m mm)"),
        Unit::MmPerS => (1e3, "µm/s"),
        Unit::Hz => (1.0, "Hz"),
        Unit::LobesPerTurn => (1.0, "per turn"),
    };
    let (value, u) = rounded(value * factor, COVERAGE * standard_uncertainty * factor);
    format!("{value} ± {u} {name}")
}
