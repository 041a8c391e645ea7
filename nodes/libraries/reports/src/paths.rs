//! Lines, corners, spikes and arcs of a grid encoder: deviation from the commanded path.

use anyhow::Result;
use metrology::sample::TestKind;
use serde_json::json;

use super::plot::{self, Plot, Trace};
use super::section::{Drawing, Rows, Section, head, um};
use crate::evaluate::paths::PathRecording;

/// Kinds in the order of the page, with their names.
const NAMES: [(TestKind, &str); 6] = [
    (TestKind::Line, "line"),
    (TestKind::Corner, "corner"),
    (TestKind::Spike, "spike"),
    (TestKind::Arc, "arc"),
    (TestKind::ArcWithLine, "line into arc"),
    (TestKind::TwoArcs, "two arcs"),
];
/// Most paths of a drawing.
const MOST_PATHS_DRAWN: usize = 6;

fn name(kind: TestKind) -> &'static str {
    let found = NAMES.iter().find(|(known, _)| *known == kind);
    found.map_or("path", |(_, name)| name)
}

/// Greatest deviation to either side, and root mean square, mm.
fn sizes_mm(path: &PathRecording) -> [f64; 3] {
    let all = || path.points.iter().map(|point| point.deviation_mm);
    let squares: f64 = all().map(|deviation| deviation.powi(2)).sum();
    [
        all().fold(f64::NEG_INFINITY, f64::max),
        all().fold(f64::INFINITY, f64::min),
        (squares / path.points.len() as f64).sqrt(),
    ]
}

/// The part, where such a path was recorded.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn section(paths: &[PathRecording]) -> Result<Option<Section>> {
    if paths.is_empty() {
        return Ok(None);
    }
    let mut section = Section::new("Lines, corners and arcs over the grid encoder");
    let span_mm = |path: &PathRecording| {
        let [most, least, _] = sizes_mm(path);
        most - least
    };
    if let Some(worst) = paths
        .iter()
        .max_by(|a, b| span_mm(a).total_cmp(&span_mm(b)))
    {
        section.answer(format!(
            "Widest {} of run {}: {} µm between the greatest deviations to either side of the path.",
            name(worst.segment.kind),
            worst.segment.run,
            um(span_mm(worst))
        ));
    }
    let left_out: usize = paths.iter().map(|path| path.left_out).sum();
    if left_out > 0 {
        section.warn(
            "Left out",
            format!("Left out: {left_out} readings beyond the most that a path keeps."),
        );
    }
    section.lines.push(evaluated(paths));
    section.tables.push(table(paths));
    for (kind, name) in NAMES {
        let own: Vec<&PathRecording> = paths
            .iter()
            .filter(|path| path.segment.kind == kind)
            .collect();
        if !own.is_empty() {
            section.drawings.push(drawing(name, &own)?);
        }
    }
    section.figures =
        json!({ "test": section.title, "paths": paths.iter().map(figures).collect::<Vec<_>>() });
    Ok(Some(section))
}

/// Which readings are evaluated.
fn evaluated(paths: &[PathRecording]) -> String {
    let n: usize = paths.iter().filter_map(|path| path.run_in).sum();
    let whole: Vec<String> = { paths.iter() }
        .filter(|path| path.run_in.is_none())
        .map(|path| path.segment.run.to_string())
        .collect();
    let marked = format!(
        "Evaluated is the part that the control recorded at its full rate, as (rate: full) of the program asks; {n} readings of run-in and run-out are left out."
    );
    match whole.len() {
        0 => marked,
        all if all == paths.len() => {
            "No recording marks its evaluated part by (rate: full): run-in and run-out are part of the figures.".to_owned()
        }
        _ => format!(
            "{marked} Runs {} mark no evaluated part: run-in and run-out are part of their figures.",
            whole.join(", ")
        ),
    }
}

fn table(paths: &[PathRecording]) -> Rows {
    let row = |path: &PathRecording| {
        let [most, least, rms] = sizes_mm(path);
        vec![
            format!("run {}: {}", path.segment.run, name(path.segment.kind)),
            format!("{:.0}", path.segment.feed_mm_s * 60.0),
            path.points.len().to_string(),
            um(most),
            um(least),
            um(rms),
        ]
    };
    Rows {
        head: head(&["path", "feed / mm/min", "readings", "greatest to the left / µm", "greatest to the right / µm", "rms / µm"]),
        rows: paths.iter().map(row).collect(),
        note: "Deviation from the nearest place of the commanded path; the place of the plate is that at which the squares of all paths under one zero are least. A lag along the path is not in it.".to_owned(),
    }
}

fn figures(path: &PathRecording) -> serde_json::Value {
    let [most, least, rms] = sizes_mm(path);
    json!({
        "run": path.segment.run,
        "kind": name(path.segment.kind),
        "feed_mm_min": path.segment.feed_mm_s * 60.0,
        "readings": path.points.len(),
        "run_in_readings_left_out": path.run_in,
        "greatest_deviation_mm": most,
        "least_deviation_mm": least,
        "rms_mm": rms,
    })
}

fn drawing(name: &str, paths: &[&PathRecording]) -> Result<Drawing> {
    let trace = |path: &&PathRecording| Trace {
        name: format!(
            "run {}, {:.0} mm/min",
            path.segment.run,
            path.segment.feed_mm_s * 60.0
        ),
        points: { path.points.iter() }
            .map(|point| (point.along_mm, point.deviation_mm * 1e3))
            .collect(),
        marks: false,
    };
    let more = match paths.len().saturating_sub(MOST_PATHS_DRAWN) {
        0 => String::new(),
        n => format!(" {n} more are in the table alone."),
    };
    Ok(Drawing {
        svg: plot::svg(&Plot {
            x: "way along the path / mm".to_owned(),
            y: format!("{name}: deviation from the path / µm"),
            traces: paths.iter().take(MOST_PATHS_DRAWN).map(trace).collect(),
        })?,
        caption: format!("Positive to the left of the motion.{more}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::paths::PathPoint;
    use metrology::sample::TestSegment;
    use metrology::stamp::Stamp;

    #[test]
    fn each_kind_has_a_drawing_and_the_widest_is_the_answer() {
        let path = |kind, run, size_mm: f64| PathRecording {
            segment: TestSegment::of_kind(kind, run, Stamp::default()),
            points: [-1.0, 0.0, 1.0]
                .map(|k| PathPoint {
                    along_mm: k + 1.0,
                    deviation_mm: k * size_mm,
                })
                .to_vec(),
            left_out: 0,
            run_in: (run == 3).then_some(120),
        };
        let paths = [
            path(TestKind::Line, 3, 0.001),
            path(TestKind::Corner, 5, 0.004),
        ];
        let section = section(&paths).unwrap().unwrap();
        assert_eq!(section.drawings.len(), 2);
        assert!(
            section.answers[0].contains("corner of run 5: 8.00 µm"),
            "{:?}",
            section.answers
        );
        assert_eq!(section.figures["paths"][0]["kind"], "line");
        let line = section.lines.last().unwrap();
        assert!(
            line.contains("120 readings of run-in") && line.contains("Runs 5 mark"),
            "{line}"
        );
        assert!(super::section(&[]).unwrap().is_none());
    }
}
