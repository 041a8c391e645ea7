//! Do the corrected points agree across feeds?

use std::collections::BTreeMap;

use maud::{Markup, html};
use metrology::sample::{Rejection, TestKind};

use super::page::{fold, table};
use super::section::{Rows, head, laid_out};
use super::terminal::Part;
use crate::evidence::Evidence;

/// Corrected touches of one feed in the last latency run that was corrected.
struct Feed {
    feed_mm_min: f64,
    n: usize,
    mean_um: f64,
    deviation_um: f64,
}

/// Programmed feeds are this far apart at least, mm/min; touches within it are one feed.
const SAME_FEED_MM_MIN: f64 = 5.0;

fn feeds(evidence: &Evidence) -> Vec<Feed> {
    let latency_runs = evidence
        .segments
        .iter()
        .filter(|segment| segment.kind == TestKind::Latency && segment.begin)
        .map(|segment| segment.run);
    let corrected = |run: u32| {
        evidence
            .points
            .iter()
            .filter(move |(of, point)| *of == run && point.rejection == Rejection::None)
            .map(|(_, point)| point)
    };
    let mut of_use = latency_runs.filter(|run| corrected(*run).count() > 1);
    let Some(run) = of_use.next_back() else {
        return Vec::new();
    };
    let mut by_feed: BTreeMap<i64, Vec<(f64, f64)>> = BTreeMap::new();
    for point in corrected(run) {
        #[expect(clippy::cast_possible_truncation, reason = "a bin number")]
        let bin = (point.feed_mm_s * 60.0 / SAME_FEED_MM_MIN).round() as i64;
        let along_um = point.point_in_machine_mm.dot(&point.approach) * 1e3;
        by_feed
            .entry(bin)
            .or_default()
            .push((point.feed_mm_s * 60.0, along_um));
    }
    by_feed
        .into_values()
        .map(|touches| summary(&touches))
        .collect()
}

fn summary(touches: &[(f64, f64)]) -> Feed {
    let n = touches.len();
    let mean = |pick: fn(&(f64, f64)) -> f64| touches.iter().map(pick).sum::<f64>() / n as f64;
    let mean_um = mean(|touch| touch.1);
    let square = touches
        .iter()
        .map(|touch| (touch.1 - mean_um).powi(2))
        .sum::<f64>();
    let deviation_um = if n > 1 {
        (square / (n as f64 - 1.0)).sqrt()
    } else {
        f64::NAN
    };
    Feed {
        feed_mm_min: mean(|touch| touch.0),
        n,
        mean_um,
        deviation_um,
    }
}

const FEED_COLUMNS: [&str; 6] = [
    "feed / mm/min",
    "touches",
    "corrected surface, from the mean / µm",
    "standard deviation / µm",
    "of the mean of n / µm",
    "travel in 1 ms / µm",
];

fn rows(evidence: &Evidence) -> Vec<Vec<String>> {
    let feeds = feeds(evidence);
    let mean_um = feeds.iter().map(|feed| feed.mean_um).sum::<f64>() / feeds.len().max(1) as f64;
    feeds
        .iter()
        .map(|feed| {
            vec![
                format!("{:.0}", feed.feed_mm_min),
                feed.n.to_string(),
                format!("{:+.2}", feed.mean_um - mean_um).replace("-0.00", "+0.00"),
                format!("{:.2}", feed.deviation_um),
                format!("{:.2}", feed.deviation_um / (feed.n as f64).sqrt()),
                format!("{:.2}", feed.feed_mm_min / 60.0),
            ]
        })
        .collect()
}

/// The table, where a corrected latency run exists.
pub fn section(evidence: &Evidence) -> Markup {
    let rows = rows(evidence);
    html! {
        @if !rows.is_empty() {
            (fold("Corrected points across feeds", None, true, &html! {
            (table(&FEED_COLUMNS, &rows))
            p.note { "A control that polls its probe input leaves each touch uncertain by up to one servo period's travel; the mean of n touches by that over the square root of 12 n." }
            }))
        }
    }
}

/// The same for a terminal.
pub fn part(evidence: &Evidence) -> Part {
    let rows = rows(evidence);
    if rows.is_empty() {
        return Part::default();
    }
    let rows = Rows {
        head: head(&FEED_COLUMNS),
        rows,
        note: String::new(),
    };
    // Long heads of columns take two lines, so that none runs into the next.
    let text = format!("{}\n", laid_out(&rows));
    Part::table("Corrected points across feeds", text, rows)
}
