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
const CURVE_COLOURS: [RGBColor; 6] = [
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

/// Width of the legend, as a share of the plot's.
const LEGEND_WIDTH: f64 = 0.25;
/// Height of a line of the legend, as a share of the plot's.
const LEGEND_LINE: f64 = 0.08;
/// Places between two points of a line that are looked at.
const BETWEEN: u32 = 8;

/// The corner in which the fewest points of the traces lie under the legend.
fn emptiest_corner(plot: &Plot, x: (f64, f64), y: (f64, f64)) -> SeriesLabelPosition {
    let share = |at: f64, (low, high): (f64, f64)| (at - low) / (high - low);
    let height = LEGEND_LINE * (plot.traces.len() as f64 + 0.5);
    let places = || plot.traces.iter().flat_map(places);
    let under = |(is_left, is_upper): (bool, bool)| {
        let covered = |(at_x, at_y): &(f64, f64)| {
            let (from_left, from_below) = (share(*at_x, x), share(*at_y, y));
            let across = if is_left { from_left } else { 1.0 - from_left };
            let down = if is_upper {
                1.0 - from_below
            } else {
                from_below
            };
            across < LEGEND_WIDTH && down < height
        };
        places().filter(covered).count()
    };
    let corners = [
        ((true, true), SeriesLabelPosition::UpperLeft),
        ((false, true), SeriesLabelPosition::UpperRight),
        ((false, false), SeriesLabelPosition::LowerRight),
        ((true, false), SeriesLabelPosition::LowerLeft),
    ];
    let emptiest = corners.into_iter().min_by_key(|(corner, _)| under(*corner));
    emptiest.map_or(SeriesLabelPosition::UpperLeft, |(_, position)| position)
}

/// Places that a trace covers.
fn places(trace: &Trace) -> Vec<(f64, f64)> {
    let mut all = trace.points.clone();
    if !trace.marks {
        for pair in trace.points.windows(2) {
            let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
            all.extend((1..BETWEEN).map(|k| {
                let share = f64::from(k) / f64::from(BETWEEN);
                (x0 + share * (x1 - x0), y0 + share * (y1 - y0))
            }));
        }
    }
    all
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
    for (trace, colour) in plot.traces.iter().zip(CURVE_COLOURS.iter().cycle()) {
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
        .position(emptiest_corner(plot, (x0, x1), (y0, y1)))
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

    fn plot(points: Vec<(f64, f64)>) -> Plot {
        let trace = |name: &str| Trace {
            name: name.to_owned(),
            points: points.clone(),
            marks: false,
        };
        Plot {
            x: "t / h".to_owned(),
            y: "drift / µm".to_owned(),
            traces: vec![trace("block_1"), trace("block_2")],
        }
    }

    #[test]
    fn the_legend_stands_where_no_line_goes() {
        let unit = (0.0, 1.0);
        let corner = |points| emptiest_corner(&plot(points), unit, unit);
        let rising = corner(vec![(0.0, 0.0), (1.0, 1.0)]);
        assert!(matches!(rising, SeriesLabelPosition::UpperLeft));
        let falling = corner(vec![(0.0, 1.0), (1.0, 0.0)]);
        assert!(matches!(falling, SeriesLabelPosition::UpperRight));
        // Across the whole top, and down on the right.
        let over = corner(vec![(0.0, 0.9), (1.0, 0.9), (1.0, 0.0)]);
        assert!(matches!(over, SeriesLabelPosition::LowerLeft));
    }
}
