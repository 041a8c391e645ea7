//! Circular traces as they have always been drawn: deviations magnified about the nominal circle.
//!
//! ```text
//!   drawn radius = 10 divisions + deviation / division            (1)
//! ```
//!
//! A division is the finest of 1, 2 and 5 times a power of ten µm, 0.1 µm at least, with which every deviation lies within
//! eight divisions of the nominal circle. There is a ring at every division; every fourth has its deviation beside it.

use std::fmt::Write as _;

use anyhow::{Result, anyhow};
use metrology::sample::TestPlane;

use super::plot::{COLOURS, legend};
use super::svg::{short, stretches};
use crate::evaluate::circles::plane_axes;

const SIZE: f64 = 560.0;
/// Divisions from the centre to the nominal circle.
const NOMINAL: f64 = 10.0;
/// Most divisions that a trace may lie from the nominal circle.
const MAX_DIVISIONS: f64 = 8.0;
/// Rings on either side of the nominal circle, one at each division.
const RINGS: i32 = 8;
/// Px from the centre to the outermost ring.
const REACH_PX: f64 = 262.0;
/// Points of a trace that show their values.
const HOVERED: usize = 48;

/// A drawing and what a division of it is.
pub struct Drawn {
    /// Legend and SVG text.
    pub svg: String,
    /// Such as `5 µm a division`.
    pub scale: String,
}

/// Least division that a drawing may have, µm.
const FINEST_UM: f64 = 0.1;

/// Draws named traces of (angle in rad, radial deviation in mm).
///
/// # Errors
/// When its text cannot be written.
pub fn svg(traces: &[(String, Vec<(f64, f64)>)], plane: TestPlane) -> Result<Drawn> {
    let deviations = traces.iter().flat_map(|(_, points)| points);
    let finite = deviations
        .map(|(_, d)| d.abs() * 1e3)
        .filter(|d| d.is_finite());
    let division_um = division_um(finite.fold(0.0, f64::max), FINEST_UM);
    let scale = format!("{} µm a division", (division_um * 1e3).round() / 1e3);
    let named: Vec<(usize, &str, &str)> = { traces.iter().enumerate() }
        .map(|(place, (name, _))| (place, "line", name.as_str()))
        .collect();
    let mut text = legend(&format!("radial deviation, {scale}"), &named);
    draw(traces, plane, division_um, &mut text)
        .map_err(|error| anyhow!("circular trace: {error}"))?;
    Ok(Drawn { svg: text, scale })
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

/// Place on the drawing at an angle (rad) and so many divisions from the centre, px.
fn place(angle: f64, divisions: f64) -> (f64, f64) {
    let radius = divisions * REACH_PX / (NOMINAL + MAX_DIVISIONS);
    let middle = SIZE / 2.0;
    (middle + radius * angle.cos(), middle - radius * angle.sin())
}

fn draw(
    traces: &[(String, Vec<(f64, f64)>)],
    plane: TestPlane,
    division_um: f64,
    text: &mut String,
) -> std::fmt::Result {
    write!(
        text,
        "<svg class=\"plot polar\" role=\"img\" aria-label=\"circular traces\" viewBox=\"0 0 {SIZE} {SIZE}\">"
    )?;
    rings(text)?;
    if let Some([u, v]) = plane_axes(plane) {
        let (right, up) = (SIZE - 6.0, 20.0);
        let middle = SIZE / 2.0;
        write!(
            text,
            "<text x=\"{right}\" y=\"{}\" text-anchor=\"end\">+{u}</text><text x=\"{}\" y=\"{up}\">+{v}</text>",
            middle + 22.0,
            middle + 8.0
        )?;
    }
    for (number, (name, points)) in traces.iter().enumerate() {
        // (1)
        let at = |(angle, deviation_mm): (f64, f64)| {
            place(angle, NOMINAL + deviation_mm * 1e3 / division_um)
        };
        write!(text, "<g class=\"c{}\">", number % COLOURS)?;
        for stretch in stretches_of_turn(points) {
            text.push_str(
                "<polyline fill=\"none\" stroke=\"currentColor\" stroke-width=\"1.5\" points=\"",
            );
            for point in stretch {
                let (x, y) = at(point);
                write!(text, "{x:.1},{y:.1} ")?;
            }
            text.push_str("\"/>");
        }
        let every = points.len().div_ceil(HOVERED).max(1);
        for point in points.iter().step_by(every).filter(|p| p.1.is_finite()) {
            let (x, y) = at(*point);
            write!(
                text,
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"7\" fill-opacity=\"0\"><title>{}: {}°, {} µm</title></circle>",
                super::svg::escaped(name),
                short(point.0.to_degrees().rem_euclid(360.0)),
                short(point.1 * 1e3)
            )?;
        }
        text.push_str("</g>");
    }
    ring_labels(text, division_um)?;
    text.push_str("</svg>");
    Ok(())
}

/// Stretches of a trace by the place of its readings: their angles go round and are in no order.
fn stretches_of_turn(points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
    let by_number: Vec<(f64, f64)> = { points.iter().enumerate() }
        .map(|(k, (_, deviation))| (k as f64, *deviation))
        .collect();
    let angle = |k: f64| points.get(k as usize).map_or(f64::NAN, |point| point.0);
    let of = |stretch: Vec<(f64, f64)>| {
        let all = stretch.into_iter().map(|(k, d)| (angle(k), d));
        all.collect()
    };
    stretches(&by_number).into_iter().map(of).collect()
}

fn rings(text: &mut String) -> std::fmt::Result {
    let middle = SIZE / 2.0;
    for step in -RINGS..=RINGS {
        let divisions = NOMINAL + f64::from(step);
        let radius = divisions * REACH_PX / (NOMINAL + MAX_DIVISIONS);
        let strength = match step {
            0 => 0.8,
            labelled if labelled % 4 == 0 => 0.24,
            _ => 0.12,
        };
        write!(
            text,
            "<circle cx=\"{middle}\" cy=\"{middle}\" r=\"{radius:.1}\" fill=\"none\" stroke=\"currentColor\" stroke-opacity=\"{strength}\"/>"
        )?;
    }
    write!(
        text,
        "<path stroke=\"currentColor\" stroke-opacity=\"0.3\" d=\"M{} {middle}H{}M{middle} {}V{}\"/>",
        middle - REACH_PX,
        middle + REACH_PX,
        middle - REACH_PX,
        middle + REACH_PX
    )
}

/// The deviation of every fourth ring, above the traces.
fn ring_labels(text: &mut String, division_um: f64) -> std::fmt::Result {
    for step in (-RINGS..=RINGS).step_by(4) {
        // Between the axes, where traces of both senses seldom leap.
        let (x, y) = place(std::f64::consts::FRAC_PI_4, NOMINAL + f64::from(step));
        let deviation_um = f64::from(step) * division_um;
        let sign = if step > 0 { "+" } else { "" };
        write!(
            text,
            "<text class=\"ring\" x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{sign}{}</text>",
            y + 5.0,
            short_of_ring(deviation_um)
        )?;
    }
    Ok(())
}

/// A multiple of four divisions without needless zeros, µm.
fn short_of_ring(deviation_um: f64) -> String {
    let rounded = (deviation_um * 1e3).round() / 1e3;
    if rounded == 0.0 {
        "0 µm".to_owned()
    } else {
        format!("{rounded}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_division_is_as_fine_as_the_trace_allows() {
        for (greatest_um, wanted_um) in [
            (0.0, 0.1),
            (2.0, 0.5),
            (39.0, 5.0),
            (41.0, 10.0),
            (150.0, 20.0),
            (161.0, 50.0),
        ] {
            assert!(
                (division_um(greatest_um, FINEST_UM) - wanted_um).abs() < 1e-9,
                "{greatest_um}"
            );
        }
    }

    #[test]
    fn eq1_a_trace_is_drawn_with_its_axes_and_names() {
        let round = (0..90).map(|k| (f64::from(k) * 0.07, 0.005)).collect();
        let drawn = svg(&[("clockwise".to_owned(), round)], TestPlane::Zx).unwrap();
        for word in ["+Z", "+X", "clockwise", "currentColor"] {
            assert!(drawn.svg.contains(word), "{word}");
        }
        assert_eq!(drawn.scale, "1 µm a division");
        // (1): five divisions beyond the nominal circle, to the right of the centre.
        let first = drawn.svg.split("points=\"").nth(1).unwrap();
        let x: f64 = first.split(',').next().unwrap().parse().unwrap();
        let wanted = 280.0 + 15.0 / 18.0 * REACH_PX;
        assert!((x - wanted).abs() < 0.06, "{x} {wanted}");
    }

    #[test]
    fn rings_have_their_deviation_beside_them() {
        let round = (0..9).map(|k| (f64::from(k) * 0.7, 0.002)).collect();
        let drawn = svg(&[("clockwise".to_owned(), round)], TestPlane::Xy).unwrap();
        for label in [">-4<", ">-2<", ">0 µm<", ">+2<", ">+4<"] {
            assert!(drawn.svg.contains(label), "{label}");
        }
        assert!(drawn.svg.contains("0.5 µm a division"));
    }

    #[test]
    fn rings_are_one_division_apart_as_the_caption_says() {
        let round = (0..9).map(|k| (f64::from(k) * 0.7, 0.005)).collect();
        let drawn = svg(&[("clockwise".to_owned(), round)], TestPlane::Xy).unwrap();
        assert_eq!(drawn.scale, "1 µm a division");
        let rings = drawn
            .svg
            .split("<circle cx=\"280\" cy=\"280\" r=\"")
            .skip(1);
        let mut radii: Vec<f64> = rings
            .map(|rest| rest.split('"').next().unwrap().parse().unwrap())
            .collect();
        radii.sort_by(f64::total_cmp);
        // From 2 to 18 divisions of 262/18 px.
        assert_eq!(radii.len(), 17, "{radii:?}");
        for pair in radii.windows(2) {
            assert!((pair[1] - pair[0] - 262.0 / 18.0).abs() < 0.11, "{radii:?}");
        }
    }
}
