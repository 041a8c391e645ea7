//! Latency: headline, table and plot of touches over feed.

use anyhow::Result;
use maud::{Markup, html};
use metrology::sample::{LatencyMethod, ProbeLatency, ProbedPoint, Rejection, TestKind};

use super::page::{figure, table};
use super::plot::{Plot, Trace, svg};
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
const TICKS_SHARE: &str = "A control that polls its probe input sees a touch up to one servo period late, half of one on \
    average. That half is part of the latency above, rightly, since every touch waits so; what is left is between \
    none and one period for a single touch, with a standard deviation of a period over the square root of 12, and \
    the mean of n touches in spread phases of the period is better by the square root of n. A control that latches \
    in hardware has no such share.";

/// Table and plot.
///
/// # Errors
/// When the plot cannot be drawn.
pub fn section(evidence: &Evidence) -> Result<Markup> {
    let touches = touches(evidence);
    let first_mm = touches.first().map_or(0.0, |touch| touch.1);
    let corrected: Vec<(f64, f64)> = touches
        .iter()
        .filter(|(point, _)| point.rejection == Rejection::None)
        .map(|(point, along_mm)| (point.feed_mm_s * 60.0, (along_mm - first_mm) * 1e3))
        .collect();
    let any_corrected = !corrected.is_empty();
    let plot = Plot {
        x: "feed at contact / mm/min".to_owned(),
        y: "corrected surface / µm".to_owned(),
        traces: vec![Trace {
            name: "touch".to_owned(),
            points: corrected,
            marks: true,
        }],
    };
    Ok(html! {
        h2 { "Probe latency" }
        (table(&LATENCY_COLUMNS, &rows(&evidence.latencies)))
        @if any_corrected {
            (figure(&svg(&plot)?, "Touches of the latency run after correction, along the approach: a slope that is left would be latency that was not taken out"))
        }
    })
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
        h1 { (title) }
        @for line in &lines { p { (line) } }
        (section(evidence)?)
        (super::feeds::section(evidence))
        (super::blocks::section(evidence))
        (conditions::section(evidence))
    };
    Ok(Report {
        title: title.to_owned(),
        lines,
        parts: vec![super::feeds::part(evidence), super::blocks::part(evidence)],
        body,
        figures: figures(evidence),
    })
}
