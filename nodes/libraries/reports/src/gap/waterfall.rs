//! The waterfall of a gap: before, minus each cause, the rest, the floor.
//!
//! Squares of causes add up where their sizes do not. What all effects close together is therefore divided by the shares s_k of
//! the squares, and a bar ends where the root mean square stands once the causes before it are in the simulator:
//!
//! ```text
//!   r_0 = before,   r_k^2 = r_(k-1)^2 - s_k (before^2 - after^2)            (1)
//! ```

use std::fmt::Write as _;

use anyhow::{Result, anyhow};
use gap_diagnosis::figures::Apart;
use gap_diagnosis::report::GapReport;
use maud::Markup;

use super::words::name;
use crate::page;
use crate::plot::legend;
use crate::svg::{Scale, escaped, unsigned_zero};

/// Most causes with a bar of their own; the others share one.
const MOST_BARS: usize = 6;
const WATERFALL_WIDTH: f64 = 720.0;
/// Height of a bar with its text, px.
const ROW_PX: f64 = 60.0;
/// Most decimals of a size, µm: more are not measured.
const MOST_DECIMALS: f64 = 3.0;
/// Left and right end of the bars, px.
const BARS_PX: [f64; 2] = [8.0, 700.0];
/// Where a row's name has its foot, and its bar its top and its bottom, px.
const NAME_FOOT_PX: f64 = 26.0;
const BAR_EDGES_PX: [f64; 2] = [34.0, 52.0];
/// Colour of the floor.
const FLOOR_COLOUR: usize = 3;

/// One bar: name, where it begins and where it ends, µm.
#[derive(Clone, Debug, PartialEq)]
struct Bar {
    name: String,
    from_um: f64,
    to_um: f64,
    colour: usize,
}

/// The bars from top to bottom; none without two numbers to go between.
fn bars(before_um: f64, after_um: f64, causes: &[(String, f64)]) -> Vec<Bar> {
    let whole = |name: &str, um: f64, colour| Bar {
        name: name.to_owned(),
        from_um: 0.0,
        to_um: um,
        colour,
    };
    let mut bars = vec![whole("before, machine minus simulator", before_um, 0)];
    let closed = before_um.powi(2) - after_um.powi(2);
    let mut sorted = causes.to_vec();
    sorted.sort_by(|a, b| b.1.total_cmp(&a.1));
    if sorted.len() > MOST_BARS {
        let rest = sorted.split_off(MOST_BARS - 1);
        let share = rest.iter().map(|(_, share)| share).sum();
        sorted.push((format!("{} more causes", rest.len()), share));
    }
    let mut left_um = before_um;
    for (name, share) in sorted {
        // (1)
        let next_um = (left_um.powi(2) - share * closed).max(0.0).sqrt();
        bars.push(Bar {
            name,
            from_um: left_um,
            to_um: next_um,
            colour: if next_um <= left_um { 2 } else { 1 },
        });
        left_um = next_um;
    }
    bars.push(whole("rest, not explained", after_um, 1));
    bars
}

/// Shares of the causes that were added, which sum to 1; a single one closes all.
fn shares(report: &GapReport, apart: &[Apart]) -> Vec<(String, f64)> {
    let of = |one: &Apart| Some((name(&one.effect, &one.axis), one.share?));
    let known: Vec<(String, f64)> = apart.iter().filter_map(of).collect();
    if !known.is_empty() {
        return known;
    }
    let without = &report.shrink.leave_one_out;
    match without.as_slice() {
        [one] => vec![(name(&one.effect, &one.axis), 1.0)],
        [] => vec![],
        several => vec![(format!("{} causes together", several.len()), 1.0)],
    }
}

/// The picture of a diagnosis; `None` without held-out runs.
///
/// # Errors
/// When its text cannot be written.
pub(super) fn picture(report: &GapReport, apart: &[Apart]) -> Result<Option<Markup>> {
    let rms = &report.shrink.rms_um;
    let (Some(before_um), Some(after_um)) = (rms.before, rms.after) else {
        return Ok(None);
    };
    let bars = bars(before_um, after_um, &shares(report, apart));
    let svg = drawn(&bars, report.gap.floor_um)
        .map_err(|error| anyhow!("waterfall of the gap: {error}"))?;
    let caption = "Root mean square of machine minus simulator on the held-out runs, as each cause is added to the simulator. Dashed: noise floor of the whole recording.";
    Ok(Some(page::figure(&svg, caption)))
}

/// Decimals of two digits of a floor, µm.
fn decimals(floor_um: f64) -> usize {
    if floor_um > 0.0 && floor_um.is_finite() {
        (1.0 - floor_um.log10().floor()).clamp(0.0, MOST_DECIMALS) as usize
    } else {
        MOST_DECIMALS as usize
    }
}

fn drawn(bars: &[Bar], floor_um: f64) -> Result<String, std::fmt::Error> {
    let height = ROW_PX * bars.len() as f64 + 36.0;
    // All bars have the decimals that the floor needs: smaller parts are noise.
    let decimals = decimals(floor_um);
    let size = |um: f64| unsigned_zero(format!("{um:.decimals$}"));
    let greatest = bars
        .iter()
        .fold(floor_um, |most, bar| most.max(bar.to_um).max(bar.from_um));
    let scale = Scale {
        low: 0.0,
        high: greatest.max(1e-9),
        low_px: BARS_PX[0],
        high_px: BARS_PX[1],
    };
    let floor = format!("noise floor {} µm", size(floor_um));
    let title = "rms of machine minus simulator / µm";
    let mut text = legend(title, &[(FLOOR_COLOUR, "line dashed", floor.as_str())]);
    write!(
        text,
        "<svg class=\"plot\" role=\"img\" aria-label=\"waterfall of the gap\" viewBox=\"0 0 {WATERFALL_WIDTH} {height}\">"
    )?;
    axis(&mut text, &scale, ROW_PX * bars.len() as f64)?;
    for (row, bar) in bars.iter().enumerate() {
        let (a, b) = (scale.px(bar.from_um), scale.px(bar.to_um));
        let (left, width) = (a.min(b), (a - b).abs().max(2.0));
        write!(
            text,
            "<g class=\"c{}\"><rect x=\"{left:.1}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"{}\" fill=\"currentColor\"/></g>",
            bar.colour,
            row as f64 * ROW_PX + BAR_EDGES_PX[0],
            BAR_EDGES_PX[1] - BAR_EDGES_PX[0],
        )?;
    }
    for (row, bar) in bars.iter().enumerate() {
        let change = bar.to_um - bar.from_um;
        let size = size(change.abs());
        let is_zero = size.chars().all(|c| c == '0' || c == '.');
        let sign = match bar.from_um > 0.0 && !is_zero {
            true if change <= 0.0 => "−",
            true => "+",
            false => "",
        };
        write!(
            text,
            "<text x=\"{}\" y=\"{:.1}\">{}: {sign}{size} µm</text>",
            BARS_PX[0],
            row as f64 * ROW_PX + NAME_FOOT_PX,
            escaped(&bar.name),
        )?;
    }
    floor_line(&mut text, scale.px(floor_um), bars.len())?;
    text.push_str("</svg>");
    Ok(text)
}

/// Round sizes below the bars, with lines between the names alone.
fn axis(text: &mut String, scale: &Scale, bottom: f64) -> std::fmt::Result {
    for (value, label) in scale.ticks() {
        let at = scale.px(value);
        write!(
            text,
            "<path stroke=\"currentColor\" stroke-opacity=\"0.4\" d=\"M{at:.1} {:.1}V{bottom}\"/><text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
            bottom - 6.0,
            bottom + 24.0
        )?;
    }
    let [left, right] = BARS_PX;
    write!(
        text,
        "<path stroke=\"currentColor\" stroke-opacity=\"0.4\" d=\"M{left} {bottom}H{right}\"/>"
    )
}

/// The floor across each bar; the names between the bars stay free.
fn floor_line(text: &mut String, at: f64, rows: usize) -> std::fmt::Result {
    write!(
        text,
        "<g class=\"c{FLOOR_COLOUR}\"><path stroke=\"currentColor\" stroke-width=\"2\" stroke-dasharray=\"5 4\" d=\""
    )?;
    let [top, bottom] = BAR_EDGES_PX;
    for row in 0..rows {
        let y = row as f64 * ROW_PX;
        write!(
            text,
            "M{at:.1} {:.1}V{:.1}",
            y + top - 2.0,
            y + bottom + 4.0
        )?;
    }
    text.push_str("\"/></g>");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq1_the_causes_lead_from_before_to_the_rest() {
        let causes = [("b".to_owned(), 0.25), ("a".to_owned(), 0.75)];
        let bars = bars(5.0, 3.0, &causes);
        let names: Vec<&str> = bars.iter().map(|bar| bar.name.as_str()).collect();
        assert_eq!(names[1..3], ["a", "b"]);
        // 25 - 0.75 * 16 = 13, 13 - 0.25 * 16 = 9.
        assert!((bars[1].to_um - 13.0_f64.sqrt()).abs() < 1e-12);
        assert!((bars[2].to_um - 3.0).abs() < 1e-12);
        assert!((bars[3].to_um - 3.0).abs() < 1e-12);
        let text = drawn(&bars, 0.4).unwrap();
        for words in ["−1.39 µm", "5.00 µm", "3.00 µm", "floor 0.40 µm"] {
            assert!(text.contains(words), "{words}: {text}");
        }
    }

    #[test]
    fn every_bar_has_the_decimals_of_the_floor() {
        let causes = [("a".to_owned(), 0.9999), ("b".to_owned(), 0.0001)];
        let text = drawn(&bars(1.58, 0.153, &causes), 0.0804).unwrap();
        for words in ["b: −0.001 µm", "1.580 µm", "0.153 µm", "floor 0.080 µm"] {
            assert!(text.contains(words), "{words}: {text}");
        }
        let text = drawn(&bars(14.2, 2.46, &[("a".to_owned(), 1.0)]), 1.32).unwrap();
        assert!(
            text.contains("a: −11.7 µm") && text.contains("floor 1.3 µm"),
            "{text}"
        );
        let text = drawn(&bars(1.0, 1.0, &[("a".to_owned(), 1.0)]), 0.5).unwrap();
        assert!(text.contains("a: 0.00 µm"), "{text}");
    }

    #[test]
    fn the_floor_crosses_bars_and_no_name() {
        let text = drawn(&bars(5.0, 3.0, &[("a".to_owned(), 1.0)]), 0.4).unwrap();
        let dashed = text.split("stroke-dasharray").nth(1).unwrap();
        let path = dashed
            .split("d=\"")
            .nth(1)
            .unwrap()
            .split('"')
            .next()
            .unwrap();
        let stretches: Vec<(f64, f64)> = { path.split('M').skip(1) }
            .map(|one| {
                let (top, bottom) = one.split_once(' ').unwrap().1.split_once('V').unwrap();
                (top.parse().unwrap(), bottom.parse().unwrap())
            })
            .collect();
        assert_eq!(stretches.len(), 3, "{path}");
        // A name of 26 px on a phone stands from 22 px above its foot to 6 px below it.
        for row in 0..3 {
            let foot = f64::from(row) * ROW_PX + NAME_FOOT_PX;
            let is_free = |(top, bottom): &(f64, f64)| *bottom < foot - 22.0 || *top >= foot + 6.0;
            assert!(stretches.iter().all(is_free), "{path}");
        }
        assert!(text.contains("rms of machine minus simulator / µm"));
    }

    #[test]
    fn many_causes_share_the_last_bar() {
        let causes: Vec<(String, f64)> = (0..10).map(|k| (format!("c{k}"), 0.1)).collect();
        let bars = bars(4.0, 1.0, &causes);
        assert_eq!(bars.len(), MOST_BARS + 2);
        assert_eq!(bars[MOST_BARS].name, "5 more causes");
        assert!((bars[MOST_BARS].to_um - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_gap_that_grew_is_drawn_as_one() {
        let bars = bars(2.0, 3.0, &[("a".to_owned(), 1.0)]);
        assert!((bars[1].to_um - 3.0).abs() < 1e-12);
        assert!(drawn(&bars, 0.1).unwrap().contains("+1.00 µm"));
    }
}
