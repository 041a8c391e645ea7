//! What the node publishes of a diagnosis: the report as a message, and new effects in words.

use metrology::sample::{GapCause, GapParameter, GapStatus, GapSummary};
use metrology::{Host, Stamp};

use super::Output;
use crate::report::{Cause, GapReport, Status};

/// Interval of the first parameter of a cause.
pub(super) fn interval(cause: &Cause) -> [f64; 2] {
    let parameter = cause.parameters.first();
    parameter.map_or([0.0; 2], |p| [p.low, p.high])
}

pub(super) fn sizes_meet(a: &Cause, b: &Cause) -> bool {
    let (a, b) = (interval(a), interval(b));
    a[0] <= b[1] && b[0] <= a[1]
}

pub(super) fn is_same(a: &Cause, b: &Cause) -> bool {
    (&a.effect, &a.axis) == (&b.effect, &b.axis)
}

pub(super) fn new_effect(cause: &Cause) -> Output {
    Output::NewEffect {
        effect: named(cause),
        besides: rivals(cause),
        size: size(cause),
        confidence: cause.confidence,
    }
}

/// An effect with what it acts on.
pub(super) fn named(cause: &Cause) -> String {
    let name = format!("{} {}", cause.effect, cause.axis);
    name.trim_end().to_owned()
}

/// What these runs cannot tell from a cause, in words behind its name.
fn rivals(cause: &Cause) -> String {
    let open = { cause.confusable_with.iter() }.filter(|other| !other.excluded);
    let names: Vec<String> = open
        .map(|other| {
            format!("{} {}", other.effect, other.axis)
                .trim_end()
                .to_owned()
        })
        .collect();
    if cause.status != Status::Set || names.is_empty() {
        return String::new();
    }
    format!(
        " (or {}, which these runs cannot tell from it)",
        names.join(", ")
    )
}

fn size(cause: &Cause) -> String {
    let parameters = cause.parameters.iter();
    let words = parameters.map(|p| {
        format!(
            "{} = {:.2} ({:.2} to {:.2})",
            p.name, p.value, p.low, p.high
        )
    });
    words.collect::<Vec<_>>().join(", ")
}

/// The report as it is published.
#[must_use]
pub fn summary(at: Stamp<Host>, runs: Vec<u32>, report: &GapReport) -> GapSummary {
    let mm = |um: f64| um * 1e-3;
    let or_nan = |um: Option<f64>| um.map_or(f64::NAN, mm);
    GapSummary {
        at,
        runs,
        rms_mm: mm(report.gap.rms_um),
        p95_mm: mm(report.gap.p95_um),
        floor_mm: mm(report.gap.floor_um),
        above_floor: report.gap.above_floor,
        causes: report.causes.iter().map(cause).collect(),
        has_unknown: report.unknown.flagged,
        unknown_covariate: report.unknown.description.covariate.clone(),
        held_out_runs: report.shrink.held_out_runs.clone(),
        rms_before_mm: or_nan(report.shrink.rms_um.before),
        rms_after_mm: or_nan(report.shrink.rms_um.after),
        gap_closed: report
            .shrink
            .gap_closed
            .map_or(f64::NAN, |closed| closed.value),
        next_experiment: report
            .next_experiments
            .first()
            .map_or_else(String::new, |next| next.run.clone()),
        json: serde_json::to_string(report)
            .expect("a report has no map with keys that are no text"),
    }
}

fn cause(cause: &Cause) -> GapCause {
    let parameters = cause.parameters.iter().map(|p| GapParameter {
        name: p.name.clone(),
        value: p.value,
        low: p.low,
        high: p.high,
    });
    GapCause {
        effect: cause.effect.clone(),
        axis: cause.axis.clone(),
        status: match cause.status {
            Status::Named => GapStatus::Named,
            Status::Surrogate => GapStatus::Surrogate,
            Status::Set => GapStatus::Set,
        },
        confidence: cause.confidence,
        whitened_size: cause.d,
        parameters: parameters.collect(),
    }
}
