//! Circular traces as they have always been drawn: deviations magnified about the nominal circle.
//!
//! ```text
//!   drawn radius = 10 divisions + deviation / division            (1)
//! ```
//!
//! A division is 5 µm, or less where the drawing says so, and more by steps of 1, 2 and 5 where deviations would not
//! fit on the drawing.

use anyhow::{Result, anyhow};
use metrology::sample::TestPlane;
use plotters::prelude::*;

use crate::evaluate::circles::plane_axes;

const SIZE: u32 = 520;
/// Divisions from the centre to the nominal circle.
const NOMINAL: f64 = 10.0;
/// Most divisions that a trace may lie from the nominal circle.
const MAX_DIVISIONS: f64 = 8.0;
const INK: RGBColor = RGBColor(1, 2, 3);
const RUN_COLOURS: [RGBColor; 4] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
];

/// A drawing and what a division of it is.
pub struct Drawn {
    /// SVG text.
    pub svg: String,
    /// Such as `5 µm a division`.
    pub scale: String,
}

/// Least division of a circular test, µm.
const USUAL_UM: f64 = 5.0;
/// Least division that a drawing may have, µm.
const FINEST_UM: f64 = 0.1;

/// Draws named traces of (angle in rad, radial deviation in mm).
///
/// # Errors
/// When the drawing library fails.
pub fn svg(traces: &[(String, Vec<(f64, f64)>)], plane: TestPlane) -> Result<Drawn> {
    drawn(traces, plane, USUAL_UM)
}

/// The same with divisions as fine as the traces want.
///
/// # Errors
/// When the drawing library fails.
pub fn fine_svg(traces: &[(String, Vec<(f64, f64)>)], plane: TestPlane) -> Result<Drawn> {
    drawn(traces, plane, FINEST_UM)
}

fn drawn(traces: &[(String, Vec<(f64, f64)>)], plane: TestPlane, least_um: f64) -> Result<Drawn> {
    let deviations = traces.iter().flat_map(|(_, points)| points);
    let greatest_um = deviations.map(|(_, d)| d.abs() * 1e3).fold(0.0, f64::max);
    let division_um = division_um(greatest_um, least_um);
    let mut text = String::new();
    draw(traces, plane, division_um, &mut text)
        .map_err(|error| anyhow!("circular trace: {error}"))?;
    Ok(Drawn {
        svg: text.replace("#010203", "currentColor").replacen(
            "<svg ",
            "<svg class=\"plot\" style=\"max-width:34rem\" role=\"img\" ",
            1,
        ),
        scale: format!("{} µm a division", (division_um * 1e3).round() / 1e3),
    })
}

fn division_um(greatest_um: f64, least_um: f64) -> f64 {
    let steps = (-1..8).flat_map(|decade| [1.0, 2.0, 5.0].map(|step| step * 10_f64.powi(decade)));
    let mut last = least_um;
    for step in steps.filter(|step| *step >= 0.999 * least_um) {
        last = step;
        if greatest_um <= MAX_DIVISIONS * step {
            break;
        }
    }
    last
}

fn draw(
    traces: &[(String, Vec<(f64, f64)>)],
    plane: TestPlane,
    division_um: f64,
    text: &mut String,
) -> Result<(), Box<dyn std::error::Error>> {
    let reach = NOMINAL + MAX_DIVISIONS;
    let root = SVGBackend::with_string(text, (SIZE, SIZE)).into_drawing_area();
    let mut chart = ChartBuilder::on(&root)
        .margin(8)
        .build_cartesian_2d(-reach..reach, -reach..reach)?;
    let ring = |radius: f64| {
        (0..=180).map(move |step| {
            let angle = f64::from(step) * std::f64::consts::PI / 90.0;
            (radius * angle.cos(), radius * angle.sin())
        })
    };
    for step in [-8, -6, -4, -2, 2, 4, 6, 8] {
        chart.draw_series(LineSeries::new(
            ring(NOMINAL + f64::from(step)),
            INK.mix(0.15),
        ))?;
    }
    chart.draw_series(LineSeries::new(ring(NOMINAL), INK.mix(0.7)))?;
    for line in [[(-reach, 0.0), (reach, 0.0)], [(0.0, -reach), (0.0, reach)]] {
        chart.draw_series(LineSeries::new(line, INK.mix(0.3)))?;
    }
    let font = || ("sans-serif", 13).into_font().color(&INK);
    if let Some([u, v]) = plane_axes(plane) {
        let labels = [
            (format!("+{u}"), (reach - 1.8, -0.6)),
            (format!("+{v}"), (0.4, reach - 0.2)),
        ];
        chart.draw_series(labels.map(|(label, at)| Text::new(label, at, font())))?;
    }
    for ((name, points), colour) in traces.iter().zip(RUN_COLOURS.iter().cycle()) {
        let style = ShapeStyle {
            color: colour.to_rgba(),
            filled: false,
            stroke_width: 1,
        };
        // (1)
        let drawn = points.iter().map(|(angle, deviation_mm)| {
            let radius = NOMINAL + deviation_mm * 1e3 / division_um;
            (radius * angle.cos(), radius * angle.sin())
        });
        chart
            .draw_series(LineSeries::new(drawn, style))?
            .label(name.as_str())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], style));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::MiddleMiddle)
        .label_font(font())
        .border_style(INK.mix(0.0))
        .draw()?;
    drop(chart);
    root.present()?;
    drop(root);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_division_is_five_micrometres_unless_the_trace_would_not_fit() {
        for (greatest_um, wanted_um) in [
            (0.0, 5.0),
            (39.0, 5.0),
            (41.0, 10.0),
            (150.0, 20.0),
            (161.0, 50.0),
        ] {
            assert!(
                (division_um(greatest_um, USUAL_UM) - wanted_um).abs() < 1e-9,
                "{greatest_um}"
            );
        }
        assert!((division_um(1.5, FINEST_UM) - 0.2).abs() < 1e-9);
    }

    #[test]
    fn eq1_a_trace_is_drawn_with_its_axes_and_names() {
        let round = (0..90).map(|k| (f64::from(k) * 0.07, 0.005)).collect();
        let drawn = svg(&[("clockwise".to_owned(), round)], TestPlane::Zx).unwrap();
        for word in ["+Z", "+X", "clockwise", "currentColor"] {
            assert!(drawn.svg.contains(word), "{word}");
        }
        assert_eq!(drawn.scale, "5 µm a division");
    }
}
