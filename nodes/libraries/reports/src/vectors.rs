//! Errors of the tool over the volume as arrows, in three projections.
//!
//! ```text
//!   arrow of a pose in a plane (u, v): from (u, v) to (u, v) + m (e_u, e_v)            (1)
//! ```
//!
//! m is one of 1, 2 and 5 times a power of ten, the greatest with which no arrow is longer than a sixth of the drawing. Of many
//! poses those are drawn that are nearest to the middles of equal boxes, the same before and after. A bar below each projection
//! is as long as an error of a round size there.

use std::fmt::Write as _;

use maud::{Markup, PreEscaped, html};
use metrology::Axis;
use nalgebra::Vector3;

use super::plot::legend;
use super::svg::{Scale, round_step, short};

/// A place and the error there, mm.
pub type Arrow = (Vector3<f64>, Vector3<f64>);

/// Arrows of one colour.
#[derive(Clone, Debug)]
pub struct Field {
    /// Name in the legend.
    pub name: String,
    /// Arrows.
    pub arrows: Vec<Arrow>,
}

/// Boxes along each axis, of which each has one arrow at most.
const BOXES: [f64; 3] = [6.0, 5.0, 4.0];
const VECTORS_WIDTH: f64 = 360.0;
/// Left, right and top end of the drawing, px; its height follows from the volume.
const VECTOR_FRAME: [f64; 3] = [58.0, 340.0, 12.0];
/// Least and greatest height of the drawing, px.
const HEIGHTS_PX: [f64; 2] = [120.0, 300.0];
/// Longest arrow as a share of the greatest side of the volume.
const LONGEST: f64 = 1.0 / 6.0;
/// The three projections, by what is to the right and upwards.
const PLANES: [[Axis; 2]; 3] = [[Axis::X, Axis::Y], [Axis::X, Axis::Z], [Axis::Y, Axis::Z]];

/// Least and greatest place along each axis, mm.
fn bounds(fields: &[Field]) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let all = || fields.iter().flat_map(|field| &field.arrows);
    let low = all().map(|(at, _)| *at).reduce(|a, b| a.inf(&b))?;
    let high = all().map(|(at, _)| *at).reduce(|a, b| a.sup(&b))?;
    let is_volume = (high - low).iter().all(|side| *side > 0.0);
    is_volume.then_some((low, high))
}

/// The arrow nearest to the middle of each box.
fn thinned(field: &Field, low: &Vector3<f64>, high: &Vector3<f64>) -> Vec<Arrow> {
    let boxes = Vector3::from(BOXES);
    let place = |at: &Vector3<f64>| {
        (at - low)
            .component_div(&(high - low))
            .component_mul(&boxes)
    };
    let mut nearest: std::collections::BTreeMap<[u8; 3], (f64, Arrow)> =
        std::collections::BTreeMap::new();
    for arrow in &field.arrows {
        let at = place(&arrow.0);
        let own = at.zip_map(&boxes, |at, n| at.floor().clamp(0.0, n - 1.0));
        let key = [own.x as u8, own.y as u8, own.z as u8];
        let away = (at - own - Vector3::repeat(0.5)).norm();
        let kept = nearest.entry(key).or_insert((away, *arrow));
        if away < kept.0 {
            *kept = (away, *arrow);
        }
    }
    nearest.into_values().map(|(_, arrow)| arrow).collect()
}

/// m of (1).
fn magnification(greatest_error_mm: f64, greatest_side_mm: f64) -> f64 {
    let most = LONGEST * greatest_side_mm / greatest_error_mm.max(1e-9);
    round_below(most)
}

/// The greatest of 1, 2 and 5 times a power of ten that is not above `most`.
fn round_below(most: f64) -> f64 {
    // The inverse of a round number is one too.
    1.0 / round_step(1.0 / most)
}

/// The drawing; `None` where the poses fill no volume. `of`: what the arrows are.
#[must_use]
pub fn picture(fields: &[Field], of: &str) -> Option<Markup> {
    let (low, high) = bounds(fields)?;
    let thinned: Vec<Vec<Arrow>> = { fields.iter() }
        .map(|field| thinned(field, &low, &high))
        .collect();
    let errors = thinned.iter().flatten().map(|(_, error)| error.norm());
    let greatest_mm = errors.fold(0.0, f64::max);
    let side_mm = (high - low).max();
    let m = magnification(greatest_mm, side_mm);
    let n: usize = thinned.first().map_or(0, Vec::len);
    let named: Vec<(usize, &str, &str)> = { fields.iter().enumerate() }
        .map(|(place, field)| (place, "line", field.name.as_str()))
        .collect();
    let bar_mm = round_below(greatest_mm.max(1e-9));
    let panels = PLANES.map(|plane| panel(plane, &thinned, (&low, &high), (m, bar_mm)));
    let caption = format!(
        "{of}, {} times enlarged, at {n} of {} poses in three projections; the bar is {} µm of error, the longest arrow {} µm.",
        short(m),
        fields
            .iter()
            .map(|field| field.arrows.len())
            .max()
            .unwrap_or(0),
        length_um(bar_mm),
        short(greatest_mm * 1e3)
    );
    Some(html! {
        figure {
            (PreEscaped(legend("error vectors over the volume", &named)))
            div.three { @for panel in &panels { div { (PreEscaped(panel)) } } }
            figcaption.note { (caption) }
        }
    })
}

/// A round length without decimals that it does not need, µm.
fn length_um(bar_mm: f64) -> String {
    let um = bar_mm * 1e3;
    let decimals = (-(um.log10() + 1e-9).floor()).clamp(0.0, 6.0) as usize;
    format!("{um:.decimals$}")
}

fn panel(
    plane: [Axis; 2],
    fields: &[Vec<Arrow>],
    (low, high): (&Vector3<f64>, &Vector3<f64>),
    (m, bar_mm): (f64, f64),
) -> String {
    let [u, v] = plane.map(Axis::index);
    let [left, right, top] = VECTOR_FRAME;
    // Millimetres are as long upwards as to the right, as far as the height allows.
    let wanted = (right - left) * (high[v] - low[v]) / (high[u] - low[u]);
    let bottom = top + wanted.clamp(HEIGHTS_PX[0], HEIGHTS_PX[1]);
    let px_per_mm = ((right - left) / (high[u] - low[u])).min((bottom - top) / (high[v] - low[v]));
    let scale = |k: usize, ends: [f64; 2]| Scale {
        low: low[k],
        high: high[k],
        low_px: ends[0],
        high_px: ends[1],
    };
    let scales = (scale(u, [left, right]), scale(v, [bottom, top]));
    let mut text = format!(
        "<svg class=\"plot\" role=\"img\" aria-label=\"error vectors in {}{}\" viewBox=\"0 0 {VECTORS_WIDTH} {}\">",
        plane[0],
        plane[1],
        bottom + 78.0
    );
    // A text has no error of writing.
    let _ = frame(&mut text, plane, &scales);
    let _ = scale_bar(&mut text, (left, bottom + 66.0), (bar_mm, m * px_per_mm));
    for (colour, arrows) in fields.iter().enumerate() {
        let _ = draw(&mut text, colour, arrows, ([u, v], m * px_per_mm), &scales);
    }
    text.push_str("</svg>");
    text
}

fn frame(text: &mut String, plane: [Axis; 2], (x, y): &(Scale, Scale)) -> std::fmt::Result {
    let every = |ticks: Vec<(f64, String)>| {
        let step = ticks.len().div_ceil(4).max(1);
        ticks.into_iter().step_by(step)
    };
    let (left, right, bottom, top) = (x.low_px, x.high_px, y.low_px, y.high_px);
    for (value, label) in every(x.ticks()) {
        let at = x.px(value);
        write!(
            text,
            "<path stroke=\"currentColor\" stroke-opacity=\"0.16\" d=\"M{at:.1} {top}V{bottom}\"/><text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
            bottom + 20.0
        )?;
    }
    for (value, label) in every(y.ticks()) {
        let at = y.px(value);
        write!(
            text,
            "<path stroke=\"currentColor\" stroke-opacity=\"0.16\" d=\"M{left} {at:.1}H{right}\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
            left - 6.0,
            at + 5.0
        )?;
    }
    write!(
        text,
        "<path fill=\"none\" stroke=\"currentColor\" stroke-opacity=\"0.6\" d=\"M{left} {top}V{bottom}H{right}\"/><text x=\"{right}\" y=\"{:.1}\" text-anchor=\"end\">{} to the right, {} up / mm</text>",
        bottom + 44.0,
        plane[0],
        plane[1]
    )
}

/// A bar as long as an arrow of `bar_mm`, with its size.
fn scale_bar(
    text: &mut String,
    (left, y): (f64, f64),
    (bar_mm, px_per_mm): (f64, f64),
) -> std::fmt::Result {
    let right = left + bar_mm * px_per_mm;
    write!(
        text,
        "<path class=\"scale\" fill=\"none\" stroke=\"currentColor\" stroke-width=\"2\" d=\"M{left:.1} {:.1}v10m0 -5H{right:.1}m0 -5v10\"/><text x=\"{:.1}\" y=\"{:.1}\">{} µm of error</text>",
        y - 5.0,
        right + 8.0,
        y + 5.0,
        length_um(bar_mm)
    )
}

fn draw(
    text: &mut String,
    colour: usize,
    arrows: &[Arrow],
    ([u, v], px_per_mm): ([usize; 2], f64),
    (x, y): &(Scale, Scale),
) -> std::fmt::Result {
    write!(
        text,
        "<g class=\"c{colour}\" stroke=\"currentColor\" fill=\"currentColor\">"
    )?;
    for (at, error) in arrows {
        let (a, b) = (x.px(at[u]), y.px(at[v]));
        let (du, dv) = (error[u] * px_per_mm, -error[v] * px_per_mm);
        write!(
            text,
            "<path stroke-width=\"1.6\" d=\"M{a:.1} {b:.1}l{du:.1} {dv:.1}\"/><circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"1.8\" stroke=\"none\"/>",
            a + du,
            b + dv
        )?;
    }
    text.push_str("</g>");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(error_mm: Vector3<f64>) -> Field {
        let place = |k: i32| {
            let (x, y, z) = (k % 10, k / 10 % 10, k / 100);
            Vector3::new(f64::from(x), f64::from(y), f64::from(z)) * 20.0
        };
        Field {
            name: "without compensation".to_owned(),
            arrows: (0..1000).map(|k| (place(k), error_mm)).collect(),
        }
    }

    #[test]
    fn eq1_the_magnification_is_round_and_no_arrow_is_too_long() {
        for (error_mm, side_mm, wanted) in [
            (0.02, 500.0, 2000.0),
            (0.001, 100.0, 10_000.0),
            (0.1, 600.0, 1000.0),
            (0.5, 600.0, 200.0),
        ] {
            let m = magnification(error_mm, side_mm);
            assert!((m - wanted).abs() < 1e-6 * wanted, "{error_mm}: {m}");
            assert!(m * error_mm <= LONGEST * side_mm * (1.0 + 1e-5));
        }
    }

    #[test]
    fn a_thousand_poses_are_thinned_to_one_a_box_in_three_projections() {
        let text = picture(&[field(Vector3::new(0.01, 0.0, 0.0))], "Error")
            .unwrap()
            .into_string();
        assert_eq!(text.matches("<svg").count(), 3, "{text}");
        assert_eq!(text.matches("<circle").count(), 3 * 120);
        for words in [
            "X to the right, Y up / mm",
            "Y to the right, Z up",
            "120 of 1000 poses",
            "10.0 µm",
        ] {
            assert!(text.contains(words), "{words}: {text}");
        }
    }

    #[test]
    fn the_bar_is_as_long_as_an_arrow_of_its_size() {
        let text = picture(&[field(Vector3::new(0.012, 0.0, 0.0))], "Error")
            .unwrap()
            .into_string();
        assert_eq!(text.matches("10 µm of error</text>").count(), 3, "{text}");
        let number = |after: &str, mark: &str| -> f64 {
            let digits = after.split(mark).nth(1).unwrap();
            let mut digits = digits.split(|c: char| !"0123456789.-".contains(c));
            digits.next().unwrap().parse().unwrap()
        };
        let bar = text.split("class=\"scale\"").nth(1).unwrap();
        let bar = bar.split(" d=\"").nth(1).unwrap();
        let bar_px = number(bar, "H") - number(bar, "M");
        let arrow = text
            .split("<path stroke-width=\"1.6\" d=\"")
            .nth(1)
            .unwrap();
        // An arrow of 12 µm along X, of which the bar is 10.
        let wanted_px = number(arrow, "l") * 10.0 / 12.0;
        assert!((bar_px - wanted_px).abs() < 0.2, "{bar_px} {wanted_px}");
        for (mm, words) in [
            (0.02, "20"),
            (0.0005, "0.5"),
            (0.00002, "0.02"),
            (0.1, "100"),
        ] {
            assert_eq!(length_um(mm), words);
        }
    }

    #[test]
    fn poses_in_one_plane_fill_no_volume() {
        let mut flat = field(Vector3::x());
        for arrow in &mut flat.arrows {
            arrow.0.z = 5.0;
        }
        assert!(picture(&[flat], "Error").is_none());
        assert!(picture(&[], "Error").is_none());
    }
}
