//! Runs before and after on one scale: circles in polar form, the others along their abscissa.

use anyhow::Result;
use gap_diagnosis::figures::{Abscissa, Trace};
use maud::Markup;
use metrology::sample::TestPlane;

use crate::{page, plot, trace};

/// Most runs that are drawn of each form.
const MOST_DRAWN: usize = 4;

/// Drawings of the runs with the largest gap.
pub(super) fn traces(traces: &[Trace]) -> Result<Vec<Markup>> {
    let mut drawn = vec![];
    for circle in largest(circles(traces)) {
        let pair = |values: &[f64]| -> Vec<(f64, f64)> {
            let at = circle.at.iter().copied();
            at.zip(values.iter().map(|um| um * 1e-3)).collect()
        };
        let lines = [
            ("before".to_owned(), pair(&circle.before_um)),
            ("after".to_owned(), pair(&circle.after_um)),
        ];
        let drawing = trace::svg(&lines, plane(&circle.title))?;
        let caption = format!(
            "Run {}, {}, {}: machine minus simulator, {}; noise {:.2} µm",
            circle.run, circle.title, circle.channel, drawing.scale, circle.floor_um
        );
        drawn.push(page::figure(&drawing.svg, &caption));
    }
    let straight = traces.iter().filter(|t| t.abscissa != Abscissa::Angle);
    for line in largest(straight.cloned().collect()) {
        drawn.push(along(&line)?);
    }
    Ok(drawn)
}

fn along(line: &Trace) -> Result<Markup> {
    let points = |values: &[f64]| {
        line.at
            .iter()
            .copied()
            .zip(values.iter().copied())
            .collect()
    };
    let marks = matches!(line.abscissa, Abscissa::Touch | Abscissa::SessionTime);
    let x = match line.abscissa {
        Abscissa::Angle => "angle in rad",
        Abscissa::Position => "position in mm",
        Abscissa::Time => "time in s",
        Abscissa::Touch => "touch",
        Abscissa::SessionTime => "time of the session in min",
    };
    let svg = plot::svg(&plot::Plot {
        x: x.to_owned(),
        y: "machine minus simulator in µm".to_owned(),
        traces: [("before", &line.before_um), ("after", &line.after_um)]
            .map(|(name, values)| plot::Trace {
                name: name.to_owned(),
                points: points(values),
                marks,
            })
            .to_vec(),
    })?;
    let caption = format!(
        "Run {}, {}, {}; noise {:.2} µm",
        line.run, line.title, line.channel, line.floor_um
    );
    Ok(page::figure(&svg, &caption))
}

fn plane(title: &str) -> TestPlane {
    [
        ("XY", TestPlane::Xy),
        ("YZ", TestPlane::Yz),
        ("ZX", TestPlane::Zx),
    ]
    .into_iter()
    .find(|(name, _)| title.contains(name))
    .map_or(TestPlane::None, |(_, plane)| plane)
}

/// One run of each test and channel, those with the largest gap.
fn largest(mut traces: Vec<Trace>) -> Vec<Trace> {
    let size = |t: &Trace| {
        t.before_um
            .iter()
            .fold(0.0_f64, |most, v| most.max(v.abs()))
    };
    traces.sort_by(|a, b| size(b).total_cmp(&size(a)));
    let mut drawn: Vec<Trace> = vec![];
    for trace in traces {
        let is_same = |one: &Trace| one.title == trace.title && one.channel == trace.channel;
        if drawn.len() < MOST_DRAWN && !drawn.iter().any(is_same) {
            drawn.push(trace);
        }
    }
    drawn.sort_by_key(|t| t.run);
    drawn
}

/// Circles as a ballbar shows them: the radial part of both coordinates of the plate where both are there,
/// else each channel by itself.
fn circles(traces: &[Trace]) -> Vec<Trace> {
    let round = || traces.iter().filter(|t| t.abscissa == Abscissa::Angle);
    let mut all = vec![];
    for first in round().filter(|t| t.channel == "grid.u") {
        let second = round()
            .find(|t| t.run == first.run && t.channel == "grid.v" && t.at.len() == first.at.len());
        let Some(second) = second else { continue };
        let radial = |u: &[f64], v: &[f64]| {
            let both = u.iter().zip(v).zip(&first.at);
            both.map(|((u, v), at)| u * at.cos() + v * at.sin())
                .collect()
        };
        all.push(Trace {
            channel: "radial".to_owned(),
            before_um: radial(&first.before_um, &second.before_um),
            after_um: radial(&first.after_um, &second.after_um),
            ..first.clone()
        });
    }
    if all.is_empty() {
        all.extend(round().cloned());
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(channel: &str, before_um: Vec<f64>) -> Trace {
        let at: Vec<f64> = (0..before_um.len()).map(|k| k as f64 * 0.5).collect();
        Trace {
            run: 3,
            channel: channel.to_owned(),
            title: "circle XY R50 F1500 ccw".to_owned(),
            abscissa: Abscissa::Angle,
            after_um: vec![0.0; at.len()],
            at,
            before_um,
            floor_um: 0.1,
        }
    }

    #[test]
    fn both_coordinates_of_a_circle_make_its_radial_deviation() {
        let angle = |k: usize| k as f64 * 0.5;
        let u = (0..12).map(|k| 4.0 * angle(k).cos()).collect();
        let v = (0..12).map(|k| 4.0 * angle(k).sin()).collect();
        let radial = circles(&[of("grid.u", u), of("grid.v", v)]);
        assert_eq!(radial.len(), 1);
        assert!(radial[0].before_um.iter().all(|r| (r - 4.0).abs() < 1e-12));
    }

    #[test]
    fn every_form_of_trace_is_drawn() {
        let mut line = of("length.X", vec![1.0, 2.0, -1.0]);
        line.abscissa = Abscissa::Position;
        let drawn = traces(&[of("grid.u", vec![1.0, 2.0]), line]).expect("drawings");
        let text: String = drawn.iter().map(|d| d.0.as_str()).collect();
        assert!(text.contains("position in mm") && text.contains("µm a division"));
    }
}
