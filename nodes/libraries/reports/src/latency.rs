//! Latency: headline, table and plot of touches over feed.

use anyhow::Result;
use maud::{Markup, html};
use metrology::sample::{LatencyMethod, ProbeLatency, ProbedPoint, Rejection, TestKind};

use super::page::{figure, fold, table};
use super::plot::{Plot, Trace, svg};
use super::screen::{Screen, Tile, Tone};
use super::section::rounded;
use super::svg::short;
use super::{Report, conditions};
use crate::evidence::Evidence;

fn ms(seconds_s: f64) -> String {
    if seconds_s.is_finite() {
        format!("{:.3}", seconds_s * 1e3)
    } else {
        "—".to_owned()
    }
}

fn method(method: LatencyMethod) -> &'static str {
    match method {
        LatencyMethod::TwoFeedSingle => "two feeds, one touch each",
        LatencyMethod::TwoFeedMulti => "two feeds, several touches",
        LatencyMethod::WeightedLeastSquares => "weighted least squares",
    }
}

/// The last estimate for machines.
pub fn figures(evidence: &Evidence) -> serde_json::Value {
    let Some(latency) = evidence.latencies.last() else {
        return serde_json::json!({});
    };
    serde_json::json!({
        "latency_s": latency.latency_s,
        "latency_standard_uncertainty_s": latency.standard_uncertainty_s,
        "two_feed_latency_s": latency.two_feed_latency_s,
        "touches": latency.n,
        "true_latency_s": evidence.true_latency_s,
    })
}

/// One sentence on the latency.
pub fn headline(evidence: &Evidence) -> Vec<String> {
    let Some(latency) = evidence.latencies.last() else {
        return vec!["Latency: no estimate was made.".to_owned()];
    };
    let mut line = format!(
        "Probe latency {} ms, standard uncertainty {} ms ({}, {} touches at {} feeds)",
        ms(latency.latency_s),
        ms(latency.standard_uncertainty_s),
        method(latency.method),
        latency.n,
        latency.feeds_mm_s.len()
    );
    match evidence.true_latency_s {
        Some(truth_s) => {
            let off_s = latency.latency_s - truth_s;
            line.push_str(&format!(
                "; the plant's is {} ms: {} ms or {:.1} standard uncertainties away.",
                ms(truth_s),
                ms(off_s),
                off_s.abs() / latency.standard_uncertainty_s
            ));
        }
        None => line.push('.'),
    }
    vec![line]
}

fn rows(latencies: &[ProbeLatency]) -> Vec<Vec<String>> {
    latencies
        .iter()
        .map(|latency| {
            vec![
                method(latency.method).to_owned(),
                ms(latency.latency_s),
                ms(latency.standard_uncertainty_s),
                ms(latency.two_feed_latency_s),
                ms(latency.least_squares_latency_s),
                latency.n.to_string(),
                format!("{:.3}", latency.lack_of_fit_p),
                if latency.negative { "negative" } else { "" }.to_owned(),
            ]
        })
        .collect()
}

const LATENCY_COLUMNS: [&str; 8] = [
    "method in use",
    "T / ms",
    "u(T) / ms",
    "two-feed T / ms",
    "least-squares T / ms",
    "touches",
    "lack of fit p",
    "flag",
];

/// Corrected touches of the latency runs: position along the approach over feed, per feature.
fn touches(evidence: &Evidence) -> Vec<(&ProbedPoint, f64)> {
    let runs: Vec<u32> = evidence
        .segments
        .iter()
        .filter(|segment| segment.kind == TestKind::Latency && segment.begin)
        .map(|segment| segment.run)
        .collect();
    evidence
        .points
        .iter()
        .filter(|(run, _)| runs.contains(run))
        .map(|(_, point)| (point, point.point_in_machine_mm.dot(&point.approach)))
        .collect()
}

/// What of a latency is the control's own, and what repeated touches do to the rest.
const TICKS_SHARE: &str = "A control that polls its probe input sees a touch up to one servo period late, on average half a \
    period. The latency above includes that half. The rest scatters between single touches, with a standard deviation of a \
    period over the square root of 12. The mean of n touches scatters less by the square root of n. A control that latches \
    the probe in hardware has no such scatter.";

/// Table and plot.
///
/// # Errors
/// When the plot cannot be drawn.
pub fn section(evidence: &Evidence) -> Result<Markup> {
    let picture = picture(evidence)?;
    let rows = rows(&evidence.latencies);
    Ok(html! {
        @if !rows.is_empty() || picture.is_some() {
            (fold("Probe latency", headline(evidence).first().map(String::as_str), false, &html! {
                @if let Some(picture) = &picture { (picture) }
                (table(&LATENCY_COLUMNS, &rows))
            }))
        }
    })
}

/// Corrected touches over feed, from their mean: (mm/min, µm). A touch that was rejected has no place.
fn corrected(evidence: &Evidence) -> Vec<(f64, f64)> {
    let used: Vec<(f64, f64)> = { touches(evidence).into_iter() }
        .filter(|(point, along_mm)| point.rejection == Rejection::None && along_mm.is_finite())
        .map(|(point, along_mm)| (point.feed_mm_s * 60.0, along_mm))
        .collect();
    let mean_mm = used.iter().map(|touch| touch.1).sum::<f64>() / used.len().max(1) as f64;
    let from_mean = |(feed, along_mm): (f64, f64)| (feed, (along_mm - mean_mm) * 1e3);
    used.into_iter().map(from_mean).collect()
}

/// Touches over feed; `None` where none was corrected.
///
/// # Errors
/// When the plot cannot be drawn.
fn picture(evidence: &Evidence) -> Result<Option<Markup>> {
    let points = corrected(evidence);
    if points.is_empty() {
        return Ok(None);
    }
    let plot = Plot {
        x: "feed at contact / mm/min".to_owned(),
        y: "corrected surface, from the mean / µm".to_owned(),
        traces: vec![Trace {
            name: "touch".to_owned(),
            points,
            marks: true,
        }],
    };
    let caption = "Touches of the latency run after correction, along the approach: a slope that is left would be latency that was not taken out";
    Ok(Some(figure(&svg(&plot)?, caption)))
}

/// Expanded uncertainty: coverage factor.
const COVERAGE: f64 = 2.0;
/// Standard uncertainties beyond which an estimate and the true value do not agree.
const AGREES: f64 = 3.0;

/// The first screen: latency with U, and the true value where it is known.
///
/// # Errors
/// When the plot cannot be drawn.
pub fn screen(evidence: &Evidence) -> Result<Screen> {
    let Some(latency) = evidence.latencies.last() else {
        return Ok(Screen {
            lacks: vec!["Latency: no estimate was made.".to_owned()],
            ..Screen::default()
        });
    };
    let expanded_s = COVERAGE * latency.standard_uncertainty_s;
    let value = format!("{} ± {} ms", ms(latency.latency_s), ms(expanded_s));
    let mut more = format!(
        "k = 2; {} touches at {} feeds",
        latency.n,
        latency.feeds_mm_s.len()
    );
    if let Some(feed_mm_s) = latency.feeds_mm_s.iter().copied().reduce(f64::max) {
        more.push_str(&format!(
            "; at {:.0} mm/min it moves a touch by {} µm",
            feed_mm_s * 60.0,
            with_u_um(latency.latency_s, expanded_s, feed_mm_s)
        ));
    }
    let (sentence, tone) = match evidence.true_latency_s {
        Some(truth_s) => {
            let off = (latency.latency_s - truth_s).abs() / latency.standard_uncertainty_s;
            let tone = if off <= AGREES { Tone::Good } else { Tone::Bad };
            let sentence = format!(
                "Probe latency {value} (k = 2); the plant's is {} ms, {} standard uncertainties away.",
                ms(truth_s),
                short(off)
            );
            (sentence, tone)
        }
        None => (format!("Probe latency {value} (k = 2)."), Tone::Plain),
    };
    Ok(Screen {
        verdict: Some((sentence, tone)),
        tiles: vec![Tile::new("probe latency", value, more)],
        picture: picture(evidence)?,
        ..Screen::default()
    })
}

/// The way at a feed during the latency with its U, µm.
fn with_u_um(latency_s: f64, expanded_s: f64, feed_mm_s: f64) -> String {
    let um = |seconds_s: f64| seconds_s * feed_mm_s * 1e3;
    let (way, u) = rounded(um(latency_s), um(expanded_s));
    format!("{way} ± {u}")
}

/// The page of a latency scenario.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn write(title: &str, evidence: &Evidence) -> Result<Report> {
    let mut lines = headline(evidence);
    if !evidence.latencies.is_empty() {
        lines.push(TICKS_SHARE.to_owned());
    }
    let body = html! {
        @for line in &lines { p { (line) } }
        (super::feeds::section(evidence))
        (section(evidence)?)
        (super::blocks::section(evidence))
    };
    let mut screen = screen(evidence)?;
    screen.behind.push(conditions::section(evidence));
    Ok(Report {
        screen,
        title: title.to_owned(),
        lines,
        parts: vec![super::feeds::part(evidence), super::blocks::part(evidence)],
        body,
        figures: figures(evidence),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::Evidence;
    use metrology::sample::{Correction, TestSegment};
    use metrology::stamp::Stamp;
    use metrology::{AxisSet, PerAxis};
    use nalgebra::Vector3;

    fn touch(along_mm: f64, rejection: Rejection) -> (u32, ProbedPoint) {
        let point = ProbedPoint {
            received_at: Stamp::default(),
            feature_id: "block".to_owned(),
            axes_at_contact: PerAxis::default(),
            axes: AxisSet::default(),
            point_in_machine_mm: Vector3::new(along_mm, 0.0, 0.0),
            point_in_workpiece_mm: Vector3::zeros(),
            applied_latency_s: 0.004,
            correction: Correction::Queue,
            standard_uncertainty_mm: 1e-4,
            approach: Vector3::x(),
            feed_mm_s: 1.0,
            rejection,
            sequence: 1,
        };
        (1, point)
    }

    #[test]
    fn u_of_the_latency_is_a_length_at_a_feed() {
        assert_eq!(with_u_um(0.0037, 0.000_098, 2.0), "7.40 ± 0.20");
    }

    #[test]
    fn a_first_touch_that_was_rejected_moves_no_other_to_zero() {
        let evidence = Evidence {
            segments: vec![TestSegment::of_kind(TestKind::Latency, 1, Stamp::default())],
            points: vec![
                touch(f64::NAN, Rejection::NoLatency),
                touch(10.0, Rejection::None),
                touch(10.004, Rejection::None),
            ],
            ..Evidence::default()
        };
        let found = corrected(&evidence);
        assert_eq!(found.len(), 2);
        assert!(
            (found[0].1 + 2.0).abs() < 1e-6 && (found[1].1 - 2.0).abs() < 1e-6,
            "{found:?}"
        );
        let svg = picture(&evidence).unwrap().unwrap().into_string();
        assert_eq!(svg.matches("<circle").count(), 2, "{svg}");
        assert!(!svg.contains("NaN"));
    }
}
