//! Latency: headline, table and plot of touches over feed.

use std::collections::BTreeMap;

use anyhow::Result;
use maud::{Markup, html};
use metrology::Axis;
use metrology::sample::{
    FacePosition, LatencyMethod, ProbeLatency, ProbedPoint, Rejection, TestKind,
};

use super::page::{figure, fold, table};
use super::plot::{Plot, Trace, svg};
use super::screen::{Screen, Tile, Tone};
use super::section::{rounded, um};
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
                "; the true one of the simulation is {} ms: {} ms or {:.1} standard uncertainties away.",
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

/// Touches as the control latched them over feed: (mm/min, µm), counted from where the estimated latency puts their surface.
/// A touch that was rejected for another reason than an unknown latency is left out.
fn latched(evidence: &Evidence, latency_s: f64) -> Vec<(f64, f64)> {
    let is_usable = |sequence: u32| {
        let mut points = evidence.points.iter().map(|(_, point)| point);
        points.any(|point| {
            let is_sound = [Rejection::None, Rejection::NoLatency].contains(&point.rejection);
            point.sequence == sequence && is_sound
        })
    };
    let mut surfaces: BTreeMap<(u32, &str), Vec<(f64, f64)>> = BTreeMap::new();
    let usable = evidence.latched.iter();
    for (run, touch) in usable.filter(|(_, touch)| is_usable(touch.sequence)) {
        let along_mm = touch.latched.xyz().dot(&touch.approach);
        let key = (*run, touch.feature_id.as_str());
        let of_surface = surfaces.entry(key).or_default();
        of_surface.push((touch.feed_mm_s, along_mm));
    }
    let from_surface = |touches: Vec<(f64, f64)>| {
        let surfaces_mm = touches.iter().map(|(feed, along)| along - feed * latency_s);
        let surface_mm = surfaces_mm.sum::<f64>() / touches.len() as f64;
        let shown = move |(feed, along): (f64, f64)| (feed * 60.0, (along - surface_mm) * 1e3);
        touches.into_iter().map(shown)
    };
    surfaces.into_values().flat_map(from_surface).collect()
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

/// Touches over feed, as latched and corrected; `None` where there are no touches.
///
/// # Errors
/// When the plot cannot be drawn.
fn picture(evidence: &Evidence) -> Result<Option<Markup>> {
    let latency_s = { evidence.latencies.last() }.map_or(f64::NAN, |latency| latency.latency_s);
    let latched = latched(evidence, latency_s);
    let fastest = latched.iter().map(|touch| touch.0).fold(0.0, f64::max);
    let estimate = [0.0, fastest].map(|feed| (feed, feed / 60.0 * latency_s * 1e3));
    let trace = |name: String, points: Vec<(f64, f64)>, marks| Trace {
        name,
        points,
        marks,
    };
    let mut traces = vec![
        trace("touch as latched".to_owned(), latched, true),
        trace(
            format!("estimate, {} ms", ms(latency_s)),
            estimate.to_vec(),
            false,
        ),
    ];
    if fastest == 0.0 || !latency_s.is_finite() {
        traces.clear();
    }
    let corrected = corrected(evidence);
    if !corrected.is_empty() {
        traces.push(trace("touch, corrected".to_owned(), corrected, true));
    }
    if traces.is_empty() {
        return Ok(None);
    }
    let plot = Plot {
        x: "feed at contact / mm/min".to_owned(),
        y: "touch beyond the surface / µm".to_owned(),
        traces,
    };
    let caption = "Touches of the latency runs along the approach. The slope of those as latched is the latency; corrected touches are counted from their mean, and a slope of theirs would be latency that was not taken out.";
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
                "Probe latency {value} (k = 2); the true one of the simulation is {} ms, {} standard uncertainties away.",
                ms(truth_s),
                short(off)
            );
            (sentence, tone)
        }
        None => (format!("Probe latency {value} (k = 2)."), Tone::Plain),
    };
    let tiles = [
        Some(Tile::new("probe latency", value, more)),
        truth(evidence),
        cold(evidence),
    ];
    Ok(Screen {
        verdict: Some((sentence, tone)),
        tiles: tiles.into_iter().flatten().collect(),
        picture: picture(evidence)?,
        ..Screen::default()
    })
}

/// The true latency, where a simulation states one.
fn truth(evidence: &Evidence) -> Option<Tile> {
    let truth_s = evidence.true_latency_s?;
    let source = evidence.true_latency_source.as_deref();
    let more = source.unwrap_or("as the simulated machine has it; no node knows it");
    Some(Tile::new(
        "true latency",
        format!("{} ms", ms(truth_s)),
        more,
    ))
}

/// The faces of blocks that were measured cold, and the greatest of their uncertainties.
fn cold(evidence: &Evidence) -> Option<Tile> {
    let cold = || evidence.blocks.iter().filter(|block| block.cold);
    let faces = cold().flat_map(|block| {
        let of_axis = |axis| Some((block.block_id.as_str(), axis, block.faces[axis]?));
        Axis::LINEAR.into_iter().filter_map(of_axis)
    });
    let faces: Vec<_> = faces.collect();
    let u = |(_, _, face): &&(&str, Axis, FacePosition)| face.standard_uncertainty_mm;
    let worst = faces.iter().max_by(|a, b| u(a).total_cmp(&u(b)))?;
    let more = format!(
        "measured cold, in {} cycles; U up to {} µm (k = 2), at {} in {}",
        cold().count(),
        um(COVERAGE * worst.2.standard_uncertainty_mm),
        worst.0,
        worst.1
    );
    let faces = match faces.len() {
        1 => "1 face".to_owned(),
        n => format!("{n} faces"),
    };
    Some(Tile::new("reference blocks", faces, more))
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
        (super::feeds::section(evidence))
        (section(evidence)?)
        @if !evidence.latencies.is_empty() { p.note { (TICKS_SHARE) } }
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
    use metrology::sample::{Correction, ProbeTrigger, TestSegment};
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
        assert!(latched(&evidence, 0.004).is_empty());
        let svg = picture(&evidence).unwrap().unwrap().into_string();
        assert_eq!(svg.matches("<circle").count(), 2, "{svg}");
        assert!(!svg.contains("NaN"));
    }

    /// A touch of a surface at 10 mm whose latch is late by 4 ms.
    fn latched_at(feed_mm_s: f64, sequence: u32) -> (u32, ProbeTrigger) {
        let mut latched = PerAxis::default();
        latched[Axis::X] = 10.0 + 0.004 * feed_mm_s;
        let touch = ProbeTrigger {
            received_at: Stamp::default(),
            controller_at: Stamp::default(),
            feature_id: "block".to_owned(),
            approach: Vector3::x(),
            feed_mm_s,
            axes: AxisSet::XYZ,
            latched,
            sequence,
        };
        (1, touch)
    }

    #[test]
    fn touches_that_no_latency_was_known_for_show_its_slope() {
        let (run, unknown) = touch(f64::NAN, Rejection::NoLatency);
        let bounced = ProbedPoint {
            sequence: 3,
            rejection: Rejection::StandoffTooShort,
            ..unknown.clone()
        };
        let second = ProbedPoint {
            sequence: 2,
            ..unknown.clone()
        };
        let evidence = Evidence {
            points: vec![(run, unknown), (run, second), (run, bounced)],
            latched: vec![latched_at(2.0, 1), latched_at(20.0, 2), latched_at(9.0, 3)],
            ..Evidence::default()
        };
        let found = latched(&evidence, 0.004);
        assert_eq!(found.len(), 2);
        // 4 ms at 2 and 20 mm/s are 8 and 80 µm.
        for ((feed, um), wanted) in found.iter().zip([(120.0, 8.0), (1200.0, 80.0)]) {
            assert!((feed - wanted.0).abs() < 1e-9 && (um - wanted.1).abs() < 1e-6);
        }
    }

    fn estimate() -> ProbeLatency {
        ProbeLatency {
            at: Stamp::default(),
            method: LatencyMethod::WeightedLeastSquares,
            latency_s: 0.004_51,
            standard_uncertainty_s: 0.000_02,
            two_feed_latency_s: 0.004_5,
            least_squares_latency_s: 0.004_51,
            feeds_mm_s: vec![2.0, 20.0],
            n: 2,
            intercept_mm: 10.0,
            intercept_uncertainty_mm: 1e-4,
            lack_of_fit_p: 0.5,
            negative: false,
        }
    }

    #[test]
    fn a_true_latency_that_a_simulation_states_stands_on_the_first_screen() {
        let evidence = Evidence {
            latencies: vec![estimate()],
            true_latency_s: Some(0.004_5),
            true_latency_source: Some("probe-latency.on-delay = 4.200 ms".to_owned()),
            ..Evidence::default()
        };
        let screen = screen(&evidence).unwrap();
        let (verdict, tone) = screen.verdict.clone().unwrap();
        assert!(
            verdict.ends_with(
                "the true one of the simulation is 4.500 ms, 0.500 standard uncertainties away."
            ),
            "{verdict}"
        );
        assert_eq!(tone, Tone::Good);
        assert_eq!(screen.tiles[1].value, "4.500 ms");
        assert_eq!(screen.tiles[1].more, "probe-latency.on-delay = 4.200 ms");
        let unknown = Evidence {
            latencies: vec![estimate()],
            ..Evidence::default()
        };
        assert_eq!(super::screen(&unknown).unwrap().tiles.len(), 1);
    }
}
