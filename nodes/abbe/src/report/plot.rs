//! Line plots as inline SVG whose colours follow the page's light or dark scheme.

use anyhow::{Result, anyhow};
use plotters::prelude::*;

/// One line of a plot.
#[derive(Clone, Debug)]
pub struct Trace {
    /// Name in the legend.
    pub name: String,
    /// Points in axis units.
    pub points: Vec<(f64, f64)>,
    /// Drawn as separate marks rather than a line.
    pub marks: bool,
}

/// Axis titles and traces of one plot.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Title of the horizontal axis, with unit.
    pub x: String,
    /// Title of the vertical axis, with unit.
    pub y: String,
    /// The lines.
    pub traces: Vec<Trace>,
}

const WIDTH: u32 = 760;
const HEIGHT: u32 = 300;
/// Distinguishable with the common colour deficiencies (Okabe and Ito), on white and on dark grey.
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
];
/// Stands for the text colour; replaced by `currentColor` in the SVG text.
const INK: RGBColor = RGBColor(1, 2, 3);

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (least, greatest) = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| {
            (a.min(value), b.max(value))
        });
    if least > greatest {
        return (0.0, 1.0);
    }
    let margin = ((greatest - least) * 0.06).max(1e-9);
    (least - margin, greatest + margin)
}

/// Draws a plot.
///
/// # Errors
/// When the drawing library fails.
pub fn svg(plot: &Plot) -> Result<String> {
    let mut text = String::new();
    draw(plot, &mut text).map_err(|error| anyhow!("plot \"{}\": {error}", plot.y))?;
    Ok(text.replace("#010203", "currentColor").replacen(
        "<svg ",
        "<svg class=\"plot\" role=\"img\" ",
        1,
    ))
}

fn draw(plot: &Plot, text: &mut String) -> Result<(), Box<dyn std::error::Error>> {
    let (x0, x1) = range(
        plot.traces
            .iter()
            .flat_map(|t| t.points.iter().map(|p| p.0)),
    );
    let (y0, y1) = range(
        plot.traces
            .iter()
            .flat_map(|t| t.points.iter().map(|p| p.1)),
    );
    let root = SVGBackend::with_string(text, (WIDTH, HEIGHT)).into_drawing_area();
    let font = || ("sans-serif", 13).into_font().color(&INK);
    let mut chart = ChartBuilder::on(&root)
        .margin(8)
        .x_label_area_size(36)
        .y_label_area_size(76)
        .build_cartesian_2d(x0..x1, y0..y1)?;
    chart
        .configure_mesh()
        .x_desc(plot.x.as_str())
        .y_desc(plot.y.as_str())
        .axis_style(INK.mix(0.6))
        .bold_line_style(INK.mix(0.15))
        .light_line_style(INK.mix(0.0))
        .label_style(font())
        .axis_desc_style(font())
        .draw()?;
    for (trace, colour) in plot.traces.iter().zip(COLOURS.iter().cycle()) {
        let style = ShapeStyle {
            color: colour.to_rgba(),
            filled: true,
            stroke_width: 2,
        };
        let series = if trace.marks {
            chart.draw_series(trace.points.iter().map(|&at| Circle::new(at, 3, style)))?
        } else {
            chart.draw_series(LineSeries::new(trace.points.iter().copied(), style))?
        };
        series
            .label(trace.name.as_str())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], style));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .label_font(font())
        .border_style(INK.mix(0.0))
        .draw()?;
    drop(chart);
    root.present()?;
    drop(root);
    Ok(())
}
