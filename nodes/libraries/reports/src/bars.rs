//! Horizontal bars with their values as inline SVG: a ranking of sizes of one unit.
//!
//! Names stand above their bars, so that they are legible on a phone; the axis below has the unit.

use std::fmt::Write as _;

use super::plot::legend;
use super::svg::{Scale, escaped};

/// One size.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// Name with its value, such as `backlash Y+: 6.05 ± 0.12 µm`.
    pub name: String,
    /// Length of the bar, in the unit of the axis.
    pub size: f64,
    /// Whether it is beyond what chance or the instrument makes; drawn faint otherwise.
    pub is_beyond: bool,
}

const BARS_WIDTH: f64 = 560.0;
/// Height of a bar with its name, px.
const BAR_ROW_PX: f64 = 46.0;
/// Most letters of a name in the usual size on a phone.
const MOST_LETTERS_OF_NAME: usize = 44;
/// Left and right end of the bars, px.
const BAR_LENGTH_PX: [f64; 2] = [6.0, 536.0];

/// Draws bars from zero; `axis`: what their length is, with its unit.
#[must_use]
pub fn svg(axis: &str, bars: &[Bar]) -> String {
    let mut text = legend(axis, &[]);
    // A text has no error of writing.
    let _ = draw(&mut text, axis, bars);
    text
}

fn draw(text: &mut String, axis: &str, bars: &[Bar]) -> std::fmt::Result {
    let bottom = BAR_ROW_PX * bars.len() as f64 + 4.0;
    let height = bottom + 30.0;
    let sizes = bars.iter().map(|bar| bar.size);
    let scale = Scale {
        low: 0.0,
        high: sizes.filter(|size| size.is_finite()).fold(1e-9, f64::max),
        low_px: BAR_LENGTH_PX[0],
        high_px: BAR_LENGTH_PX[1],
    };
    write!(
        text,
        "<svg class=\"plot bars\" role=\"img\" aria-label=\"{}\" viewBox=\"0 0 {BARS_WIDTH} {height}\">",
        escaped(axis)
    )?;
    for (value, label) in scale.ticks() {
        let at = scale.px(value);
        write!(
            text,
            "<path stroke=\"currentColor\" stroke-opacity=\"0.16\" d=\"M{at:.1} 4V{bottom}\"/><text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
            bottom + 22.0
        )?;
    }
    for (row, bar) in bars.iter().enumerate() {
        let top = BAR_ROW_PX * row as f64;
        let opacity = if bar.is_beyond { 1.0 } else { 0.35 };
        let width = (scale.px(bar.size) - BAR_LENGTH_PX[0]).max(1.5);
        write!(
            text,
            "<text class=\"ring{}\" x=\"{}\" y=\"{:.1}\">{}</text><g class=\"c0\"><rect x=\"{}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"14\" fill=\"currentColor\" fill-opacity=\"{opacity}\"/></g>",
            if bar.name.chars().count() > MOST_LETTERS_OF_NAME {
                " long"
            } else {
                ""
            },
            BAR_LENGTH_PX[0],
            top + 20.0,
            escaped(&bar.name),
            BAR_LENGTH_PX[0],
            top + 26.0
        )?;
    }
    text.push_str("</svg>");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_bar_fills_the_width_and_chance_is_faint() {
        let bar = |size, is_beyond| Bar {
            name: format!("cause <{size}>"),
            size,
            is_beyond,
        };
        let text = svg("span / µm", &[bar(4.0, true), bar(1.0, false)]);
        assert!(text.contains("width=\"530.0\" height=\"14\""), "{text}");
        assert!(text.contains("width=\"132.5\""), "{text}");
        assert!(text.contains("fill-opacity=\"0.35\""));
        assert!(!text.contains("ring long"), "{text}");
        let long = Bar {
            name: "reversal spike X at 6000 mm/min, R 50 mm 3.42 ± 0.43 µm".to_owned(),
            ..bar(1.0, true)
        };
        assert!(svg("span / µm", &[long]).contains("class=\"ring long\""));
        assert!(text.contains("cause &lt;4&gt;") && text.contains("span / µm"));
    }
}
