//! ISO 230-4 of a bag, and the breakdown of its circles into causes.

use anyhow::Result;
use metrology::breakdown::{
    self, Alias, BreakdownConfig, CircularPlane, CircularRecording, CircularSample, CircularSense,
    Needed, PlaneBreakdown, ReferenceLength, Unit,
};
use metrology::iso230::circular::{CircularResult, CircularTest, CircularTrace, evaluate};
use metrology::sample::{Sense, TestPlane};

use super::positioning::figure;
use super::section::{Drawing, Rows, Section, head, rounded, um};
use super::trace;
use crate::evaluate::budget::Budget;
use crate::evaluate::circles::{CircleRecording, Instrument, plane_axes};

/// Coverage factor of what is printed.
const COVERAGE: f64 = 2.0;
/// Probability above which a row may be chance.
const BY_CHANCE: f64 = 0.01;

/// What a ballbar cannot tell.
const BY_BALLBAR: &str =
    "Read by a ballbar, radially alone: F and D count from the centre of its mount.";

/// One part for each circle (both senses together), then one for the breakdown.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn sections(circles: &[CircleRecording], budget: Option<&Budget>) -> Result<Vec<Section>> {
    let mut sections = Vec::new();
    for group in groups(circles) {
        sections.push(section(&group, budget)?);
    }
    if !circles.is_empty() {
        sections.extend(breakdowns(circles, budget));
    }
    Ok(sections)
}

/// Recordings of one circle: each sense once.
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

fn section(group: &[&CircleRecording], budget: Option<&Budget>) -> Result<Section> {
    let segment = &group[0].segment;
    let state = if group[0].compensated {
        "compensated"
    } else {
        "not compensated"
    };
    let letters = plane_axes(segment.plane).map_or_else(String::new, |[u, v]| format!("{u}{v}"));
    let runs: Vec<String> = group.iter().map(|c| c.segment.run.to_string()).collect();
    let runs = match runs.as_slice() {
        [one] => format!("run {one}"),
        several => format!("runs {}", several.join(" and ")),
    };
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
    let of = |sense| {
        let found = group.iter().find(|circle| circle.segment.sense == sense);
        found.map(|circle| {
            CircularTrace::PointsMm(circle.points.iter().map(|point| point.at_mm).collect())
        })
    };
    let test = CircularTest {
        nominal_radius_mm: segment.radius_mm,
        clockwise: of(Sense::Clockwise),
        counter_clockwise: of(Sense::CounterClockwise),
    };
    let used = budget.copied().unwrap_or(Budget::nothing()).circular();
    match evaluate(&test, &used) {
        Ok(result) => {
            section.tables.push(figures(&result, budget.is_some()));
            section.figures = serde_json::json!({ "test": section.title, "iso230_4": result });
        }
        Err(error) => section.lines.push(format!("Not evaluated: {error}.")),
    }
    let traces: Vec<(String, Vec<(f64, f64)>)> = group
        .iter()
        .map(|circle| (sense_name(circle.segment.sense).to_owned(), radial(circle)))
        .collect();
    let drawn = trace::svg(&traces, segment.plane)?;
    section.drawings.push(Drawing {
        svg: drawn.svg,
        caption: format!("Deviations from the circle, {}", drawn.scale),
    });
    Ok(section)
}

fn sense_name(sense: Sense) -> &'static str {
    match sense {
        Sense::Clockwise => "clockwise",
        Sense::CounterClockwise => "counter-clockwise",
        Sense::None => "no sense",
    }
}

/// Angle and radial deviation of every reading, rad and mm.
fn radial(circle: &CircleRecording) -> Vec<(f64, f64)> {
    let point = |[u, v]: [f64; 2]| (v.atan2(u), u.hypot(v) - circle.segment.radius_mm);
    circle.points.iter().map(|p| point(p.at_mm)).collect()
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
            "± expanded uncertainty, k = 2. G: about the least-squares centre; F: about the nominal one.".to_owned()
        } else {
            "Without --budget no uncertainty is stated.".to_owned()
        },
    }
}

fn breakdowns(circles: &[CircleRecording], budget: Option<&Budget>) -> Vec<Section> {
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
                sections.extend(found.planes.iter().map(|plane| plane_section(plane, state)));
            }
            Err(error) => {
                let mut section = Section::new(format!("Causes, {state}"));
                section.lines.push(format!("Not evaluated: {error}."));
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
        reference: budget.map_or(ReferenceLength::Free, |budget| {
            let length = budget.circular().length;
            ReferenceLength::Calibrated {
                standard_uncertainty_mm: length.standard_mm(segment.radius_mm),
            }
        }),
        samples: samples.collect(),
    })
}

fn plane_section(plane: &PlaneBreakdown, state: &str) -> Section {
    let [u, v] = plane.axes;
    let mut section = Section::new(format!("Causes in {u}{v}, {state}"));
    section.lines.push(format!(
        "{} recordings, worst circularity {} µm; what no row explains has {:.2} µm standard deviation.",
        plane.recordings.len(),
        um(plane.worst_circularity_mm),
        plane.noise.residual_mm * 1e3
    ));
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
            "Span: greatest minus least deviation that the cause alone makes on one circle. G without: the greatest circular error that would be left. {}",
            needed(plane)
        ),
    });
    section.tables.extend(where_to_look(plane));
    section.figures = serde_json::json!({ "test": section.title, "breakdown": plane });
    section
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
