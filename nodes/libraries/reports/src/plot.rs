//! Line plots as inline SVG whose colours follow the page's light or dark scheme.
//!
//! The title of the vertical axis and the legend stand above the drawing, so that no line runs below them and both are legible on
//! a phone. A point shows its value while the pointer rests on it.

use std::fmt::Write as _;

use anyhow::{Result, anyhow};

use super::svg::{Scale, escaped, short, stretches};

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

/// A band around a line.
#[derive(Clone, Debug)]
pub struct Band {
    /// Name in the legend.
    pub name: String,
    /// Place of the line in [`Plot::traces`], whose colour it has.
    pub of: usize,
    /// Horizontal place, lower and upper end, in axis units.
    pub points: Vec<(f64, f64, f64)>,
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

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 330.0;
/// Frame of the drawing: left, right, top, bottom, px.
const FRAME: [f64; 4] = [84.0, 704.0, 14.0, 262.0];
/// Colours that the page's style has.
pub const COLOURS: usize = 6;
/// Most points of a trace that show their values.
const MOST_HOVERED: usize = 120;
/// Most points of a line that are drawn as dots on it, so that what was read differs from what lies between.
const MOST_DOTTED: usize = 24;
/// More marks of a trace are drawn small and translucent, so that those below them are seen.
const MOST_LARGE: usize = 60;
/// Margin above and below the lines, as a share of their range.
const MARGIN: f64 = 0.06;
/// A range that begins so close to zero begins at zero, as a share of its end.
const NEAR_ZERO: f64 = 0.1;

fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let finite = values.filter(|value| value.is_finite());
    let ends = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| {
        (a.min(value), b.max(value))
    });
    (ends.0 <= ends.1).then_some(ends)
}

/// The same with room about it.
fn with_margin((least, greatest): (f64, f64)) -> (f64, f64) {
    let span = greatest - least;
    if span > 1e-12 * greatest.abs().max(least.abs()) {
        return (least - MARGIN * span, greatest + MARGIN * span);
    }
    let margin = if greatest == 0.0 {
        0.5
    } else {
        0.1 * greatest.abs()
    };
    (least - margin, greatest + margin)
}

/// The scale of the horizontal axis.
fn across(plot: &Plot) -> Scale {
    let marks_only = plot.traces.iter().all(|trace| trace.marks);
    let all = plot.traces.iter().flat_map(|trace| &trace.points);
    let (low, high) = range(all.map(|point| point.0)).unwrap_or((0.0, 1.0));
    let low = if low > 0.0 && low < NEAR_ZERO * high {
        0.0
    } else {
        low
    };
    let (low, high) = if marks_only || high <= low {
        with_margin((low, high))
    } else {
        (low, high)
    };
    Scale {
        low,
        high,
        low_px: FRAME[0],
        high_px: FRAME[1],
    }
}

/// The scale of the vertical axis.
fn upwards(plot: &Plot, bands: &[Band]) -> Scale {
    let lines = plot.traces.iter().flat_map(|trace| &trace.points);
    let ends = bands.iter().flat_map(|band| &band.points);
    let all = lines.map(|point| point.1);
    let all = all.chain(ends.flat_map(|(_, low, high)| [*low, *high]));
    let (low, high) = with_margin(range(all).unwrap_or((0.0, 1.0)));
    Scale {
        low,
        high,
        low_px: FRAME[3],
        high_px: FRAME[2],
    }
}

/// Draws a plot.
///
/// # Errors
/// When its text cannot be written.
pub fn svg(plot: &Plot) -> Result<String> {
    banded_svg(plot, &[])
}

/// Draws a plot with bands behind its lines.
///
/// # Errors
/// As [`svg`].
pub fn banded_svg(plot: &Plot, bands: &[Band]) -> Result<String> {
    paired_svg(plot, bands, &[])
}

/// The same with traces that share colours; `colours`: the number of each trace's colour, or its place without one.
///
/// # Errors
/// As [`svg`].
pub fn paired_svg(plot: &Plot, bands: &[Band], colours: &[usize]) -> Result<String> {
    drawn(plot, bands, colours).map_err(|error| anyhow!("plot \"{}\": {error}", plot.y))
}

fn drawn(plot: &Plot, bands: &[Band], colours: &[usize]) -> Result<String, std::fmt::Error> {
    let scales = (across(plot), upwards(plot, bands));
    let colour = |place: usize| colours.get(place).copied().unwrap_or(place);
    let mut text = head(plot, bands, &colour);
    write!(
        text,
        "<svg class=\"plot\" role=\"img\" aria-label=\"{} over {}\" viewBox=\"0 0 {WIDTH} {HEIGHT}\">",
        escaped(&plot.y),
        escaped(&plot.x)
    )?;
    axes(&mut text, plot, &scales)?;
    for band in bands {
        draw_band(&mut text, band, colour(band.of), &scales)?;
    }
    for (place, trace) in plot.traces.iter().enumerate() {
        draw_trace(&mut text, plot, (trace, colour(place)), &scales)?;
    }
    text.push_str("</svg>");
    Ok(text)
}

/// What stands above the drawing: the title of the vertical axis, and what each colour is.
fn head(plot: &Plot, bands: &[Band], colour: &impl Fn(usize) -> usize) -> String {
    let lines = plot.traces.iter().enumerate();
    let lines: Vec<(usize, &str, &str)> = lines
        .map(|(place, trace)| {
            let kind = match () {
                () if trace.marks => "dot",
                () if is_dashed(colour(place)) => "line dashed",
                () => "line",
            };
            (colour(place), kind, trace.name.as_str())
        })
        .collect();
    let bands = bands
        .iter()
        .map(|band| (colour(band.of), "band", band.name.as_str()));
    let named: Vec<(usize, &str, &str)> = lines.into_iter().chain(bands).collect();
    legend(&plot.y, &named)
}

/// Whether a line is dashed, since a line before it has its colour.
const fn is_dashed(colour: usize) -> bool {
    colour / COLOURS % 2 == 1
}

/// A title, and colour, kind (`line`, `line dashed`, `dot` or `band`) and name of everything that is drawn.
#[must_use]
pub fn legend(title: &str, named: &[(usize, &str, &str)]) -> String {
    maud::html! {
        div.legend {
            span.of { (title) }
            @for (place, kind, name) in named {
                @if !name.is_empty() {
                    span class=(format!("{kind} c{}", place % COLOURS)) { i {} (name) }
                }
            }
        }
    }
    .into_string()
}

fn axes(text: &mut String, plot: &Plot, (x, y): &(Scale, Scale)) -> std::fmt::Result {
    let [left, right, top, bottom] = FRAME;
    for (value, label) in y.ticks() {
        let at = y.px(value);
        let strength = if value.abs() < 1e-12 { 0.6 } else { 0.16 };
        write!(
            text,
            "<path stroke=\"currentColor\" stroke-opacity=\"{strength}\" d=\"M{left} {at:.1}H{right}\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
            left - 8.0,
            at + 5.0
        )?;
    }
    for (value, label) in x.ticks() {
        let at = x.px(value);
        write!(
            text,
            "<path stroke=\"currentColor\" stroke-opacity=\"0.16\" d=\"M{at:.1} {top}V{bottom}\"/><text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{label}</text>",
            bottom + 26.0
        )?;
    }
    write!(
        text,
        "<path fill=\"none\" stroke=\"currentColor\" stroke-opacity=\"0.6\" d=\"M{left} {top}V{bottom}H{right}\"/><text x=\"{right}\" y=\"{}\" text-anchor=\"end\">{}</text>",
        HEIGHT - 8.0,
        escaped(&plot.x)
    )
}

fn draw_band(
    text: &mut String,
    band: &Band,
    colour: usize,
    (x, y): &(Scale, Scale),
) -> std::fmt::Result {
    let is_finite = |p: &&(f64, f64, f64)| p.0.is_finite() && p.1.is_finite() && p.2.is_finite();
    let points = || band.points.iter().filter(is_finite);
    if points().next().is_none() {
        return Ok(());
    }
    write!(
        text,
        "<g class=\"c{}\"><polygon fill=\"currentColor\" fill-opacity=\"0.18\" points=\"",
        colour % COLOURS
    )?;
    for (at, low, _) in points() {
        write!(text, "{:.1},{:.1} ", x.px(*at), y.px(*low))?;
    }
    for (at, _, high) in band.points.iter().rev().filter(is_finite) {
        write!(text, "{:.1},{:.1} ", x.px(*at), y.px(*high))?;
    }
    text.push_str("\"/></g>");
    Ok(())
}

fn draw_trace(
    text: &mut String,
    plot: &Plot,
    (trace, colour): (&Trace, usize),
    (x, y): &(Scale, Scale),
) -> std::fmt::Result {
    let stretches = stretches(&trace.points);
    write!(text, "<g class=\"c{}\">", colour % COLOURS)?;
    if !trace.marks {
        let dashes = if is_dashed(colour) {
            " stroke-dasharray=\"7 4\""
        } else {
            ""
        };
        for stretch in &stretches {
            write!(
                text,
                "<polyline fill=\"none\" stroke=\"currentColor\" stroke-width=\"2\"{dashes} points=\""
            )?;
            for (at, value) in stretch {
                write!(text, "{:.1},{:.1} ", x.px(*at), y.px(*value))?;
            }
            text.push_str("\"/>");
        }
    }
    let points = stretches.concat();
    draw_marks(text, plot, trace, &points, (x, y))?;
    text.push_str("</g>");
    Ok(())
}

/// The marks of a trace, or the dots of a line with few points; with values under the pointer where there are not too many.
fn draw_marks(
    text: &mut String,
    plot: &Plot,
    trace: &Trace,
    points: &[(f64, f64)],
    (x, y): (&Scale, &Scale),
) -> std::fmt::Result {
    let n = points.len();
    // Around a dot, the pointer finds its value within some px.
    let reach = "stroke=\"currentColor\" stroke-opacity=\"0\" stroke-width=\"9\"";
    let (radius, opacity) = match () {
        () if trace.marks && n > MOST_LARGE => (2.2, 0.6),
        () if trace.marks || n <= MOST_DOTTED => (3.5, 1.0),
        () if n <= MOST_HOVERED => (3.5, 0.0),
        () => return Ok(()),
    };
    for (at, value) in points {
        write!(
            text,
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius}\" fill=\"currentColor\" fill-opacity=\"{opacity}\"",
            x.px(*at),
            y.px(*value)
        )?;
        if n <= MOST_HOVERED {
            write!(
                text,
                " {reach}><title>{}: {} {}, {} {}</title></circle>",
                escaped(&trace.name),
                escaped(&plot.x),
                short(*at),
                escaped(&plot.y),
                short(*value)
            )?;
        } else {
            text.push_str("/>");
        }
    }
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
        let text = svg(&plot(vec![(0.0, 0.9), (1.0, 0.9), (1.0, 0.0)])).unwrap();
        let (before, drawing) = text.split_once("<svg").unwrap();
        for word in ["drift / µm", "block_1", "block_2"] {
            assert!(before.contains(word), "{before}");
        }
        assert!(!drawing.contains("<text x=\"84\">block_1"), "{drawing}");
        assert!(drawing.contains("t / h"));
    }

    #[test]
    fn values_that_are_missing_are_no_zero_and_the_rest_is_drawn() {
        let text = svg(&plot(vec![(0.0, f64::NAN), (0.5, 2.0), (1.0, 3.0)])).unwrap();
        assert!(!text.contains("NaN"), "{text}");
        assert_eq!(text.matches("<polyline").count(), 2);
        assert!(text.contains("drift / µm 3.00</title>"), "{text}");
    }

    #[test]
    fn a_time_that_begins_near_zero_begins_at_zero() {
        let scale = across(&plot(vec![(0.004, 1.0), (0.4, 2.0)]));
        assert!(scale.low.abs() < 1e-12 && (scale.high - 0.4).abs() < 1e-12);
        let far = across(&plot(vec![(40.0, 1.0), (50.0, 2.0)]));
        assert!((far.low - 40.0).abs() < 1e-12);
    }

    #[test]
    fn a_band_lies_within_the_frame_and_has_its_lines_colour() {
        let band = Band {
            name: "±2s".to_owned(),
            of: 1,
            points: vec![(0.0, -9.0, 9.0), (1.0, -9.0, 9.0)],
        };
        let text = banded_svg(&plot(vec![(0.0, 1.0), (1.0, 2.0)]), &[band]).unwrap();
        assert!(text.contains("class=\"band c1\""), "{text}");
        let polygon = text.split("<polygon").nth(1).unwrap();
        let points = polygon.split("points=\"").nth(1).unwrap();
        for pair in points.split('"').next().unwrap().split_whitespace() {
            let y: f64 = pair.split(',').nth(1).unwrap().parse().unwrap();
            assert!((FRAME[2]..=FRAME[3]).contains(&y), "{pair}");
        }
    }

    #[test]
    fn no_two_of_twelve_lines_look_alike() {
        let mut many = plot((0..40).map(|k| (f64::from(k), 1.0)).collect());
        many.traces = vec![many.traces[0].clone(); 12];
        let text = svg(&many).unwrap();
        assert_eq!(text.matches("stroke-dasharray").count(), 6, "{text}");
        assert_eq!(text.matches("class=\"line dashed c0\"").count(), 1);
    }

    #[test]
    fn a_line_of_few_readings_shows_them_and_pairs_share_a_colour() {
        let few = plot(vec![(0.0, 1.0), (1.0, 2.0)]);
        let text = paired_svg(&few, &[], &[0, 0]).unwrap();
        assert_eq!(text.matches("fill-opacity=\"1\"").count(), 4, "{text}");
        assert_eq!(text.matches("<g class=\"c0\">").count(), 2);
        let many = plot((0..90).map(|k| (f64::from(k), 1.0)).collect());
        assert!(!svg(&many).unwrap().contains("fill-opacity=\"1\""));
    }

    #[test]
    fn a_name_from_outside_leaves_no_text() {
        let mut one = plot(vec![(0.0, 1.0)]);
        one.traces[0].name = "<script>\"".to_owned();
        assert!(!svg(&one).unwrap().contains("<script>"));
    }
}
