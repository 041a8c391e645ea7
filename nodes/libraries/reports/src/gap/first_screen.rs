//! The first screen of a diagnosis: verdict, gap closed, largest cause, what is open, what to measure next.

use gap_diagnosis::report::{Cause, GapReport, Interval, NextExperiment, Status};

use super::logs;
use super::sentences::since;
use super::words::{in_units, name};
use super::{NOT_DETERMINED, separated, spoken_key, three, told};
use crate::screen::{Screen, Tile, Tone};
use crate::section::{capitalised, rounded};

/// Share of the gap that is closed from which on a diagnosis is done.
const MOSTLY_CLOSED: f64 = 0.5;

/// Width of an interval of a share below which whole percents hide it.
const NARROW: f64 = 0.02;

/// The screen without its picture.
pub(super) fn of(report: &GapReport, losses: &[String]) -> Screen {
    Screen {
        verdict: Some(verdict(report)),
        tiles: [logs::tile(report), closed(report), Some(largest(report))]
            .into_iter()
            .flatten()
            .collect(),
        lacks: lacks(report, losses),
        next: report.next_experiments.first().map(next),
        ..Screen::default()
    }
}

/// The named cause without which most of the gap comes back, or the surest one.
fn main_cause(report: &GapReport) -> Option<&Cause> {
    let named = || {
        report
            .causes
            .iter()
            .filter(|cause| cause.status != Status::Surrogate)
    };
    let without = |cause: &Cause| {
        let mut all = report.shrink.leave_one_out.iter();
        let own = all.find(|out| out.effect == cause.effect && out.axis == cause.axis);
        own.map_or(0.0, |out| out.rms_um_without)
    };
    let largest = named().max_by(|a, b| without(a).total_cmp(&without(b)));
    if report.shrink.leave_one_out.is_empty() {
        return named().next();
    }
    largest
}

/// The first parameter of a cause: what it is, and its value with the half of its interval, such as `6.36 ± 0.09 µm`.
fn size(cause: &Cause) -> Option<(String, String)> {
    let first = told(cause).next()?;
    let (label, factor, unit) = in_units(spoken_key(&first.name), first.value);
    if first.determined == Some(false) {
        return Some((label, NOT_DETERMINED.to_owned()));
    }
    let half = (first.high - first.low) / 2.0;
    let (value, half) = rounded(first.value * factor, half * factor);
    Some((
        label,
        format!("{value} ± {half} {unit}").trim_end().to_owned(),
    ))
}

/// A cause with its size where it is one number.
fn sized(cause: &Cause) -> String {
    let title = name(&cause.effect, &cause.axis);
    match size(cause) {
        Some((_, value)) if told(cause).count() == 1 => format!("{title} {value}"),
        _ => title,
    }
}

fn verdict(report: &GapReport) -> (String, Tone) {
    let gap = &report.gap;
    if !gap.above_floor {
        let line = format!(
            "Machine and simulator agree within noise: {} µm rms, noise alone gives {} µm.",
            three(gap.rms_um),
            three(gap.floor_um)
        );
        return (line, Tone::Good);
    }
    let share = report.shrink.gap_closed;
    let Some(cause) = main_cause(report) else {
        let line = format!(
            "Machine and simulator differ by {} µm rms (noise {} µm), and no cause is named.",
            three(gap.rms_um),
            three(gap.floor_um)
        );
        return (line, Tone::Bad);
    };
    let title = format!("{}{}", sized(cause), since(report, cause));
    let others = report.causes.iter();
    let others: Vec<&Cause> = others
        .filter(|other| other.status != Status::Surrogate && !std::ptr::eq(*other, cause))
        .collect();
    let (rest, closes) = match others[..] {
        [] => (String::new(), "closes"),
        [other] => (format!(" and {}", sized(other)), "close"),
        _ => (format!(" and {} more causes", others.len()), "close"),
    };
    let Some(share) = share else {
        let is_sure = cause.status == Status::Named;
        let doubt = if is_sure { "" } else { ", or what looks alike" };
        let line = format!(
            "Machine and simulator differ by {} µm rms; the cause is {title}{rest}{doubt}.",
            three(gap.rms_um)
        );
        return (line, Tone::Plain);
    };
    let line = format!(
        "{title}{rest} {closes} {} % of the gap between machine and simulator (mean square above noise), from {} to {} µm rms.",
        percent(share)[0],
        super::maybe(report.shrink.rms_um.before),
        super::maybe(report.shrink.rms_um.after)
    );
    let tone = if share.low > MOSTLY_CLOSED {
        Tone::Good
    } else {
        Tone::Plain
    };
    (capitalised(&line), tone)
}

/// Value, low and high end of a share in %, with a decimal where its interval is narrow.
fn percent(share: Interval) -> [String; 3] {
    let decimals = usize::from(share.high - share.low < NARROW);
    [share.value, share.low, share.high].map(|part| format!("{:.decimals$}", 100.0 * part))
}

fn closed(report: &GapReport) -> Option<Tile> {
    let rms = &report.shrink.rms_um;
    let (before, after) = (rms.before?, rms.after?);
    let more = format!(
        "{} → {} µm rms on held-out runs, floor {} µm",
        three(before),
        three(after),
        three(report.gap.floor_um)
    );
    Some(match report.shrink.gap_closed {
        Some(share) => {
            let [value, low, high] = percent(share);
            let value = format!("{value} %");
            let interval =
                format!("of its mean square above noise; 95 %: {low} to {high} %. {more}");
            let is_good = share.low > MOSTLY_CLOSED;
            Tile::new("gap closed", value, interval).toned(if is_good {
                Tone::Good
            } else {
                Tone::Plain
            })
        }
        None => Tile::new("gap closed", "not known", more),
    })
}

fn largest(report: &GapReport) -> Tile {
    match main_cause(report) {
        Some(cause) => {
            let doubt = match cause.status {
                Status::Set => ", or one that looks alike",
                _ => "",
            };
            let size = match size(cause) {
                Some((label, _)) if told(cause).count() == 1 => format!("{label}; 95 %; "),
                Some((label, value)) => format!("{label} {value}; 95 %; "),
                None => String::new(),
            };
            let since = since(report, cause);
            let since = match since.trim_start() {
                "" => String::new(),
                since => format!("{since}; "),
            };
            let more = format!("{size}{since}confidence {:.2}{doubt}", cause.confidence);
            Tile::new("largest cause", sized(cause), more)
        }
        None => Tile::new("largest cause", "none named", "see what to measure next"),
    }
}

fn lacks(report: &GapReport, losses: &[String]) -> Vec<String> {
    let mut lacks = losses.to_vec();
    if report.unknown.flagged {
        lacks.push(format!(
            "A rest that no known effect explains (score {} over {}).",
            three(report.unknown.score),
            three(report.unknown.threshold)
        ));
    }
    let surrogates = report
        .causes
        .iter()
        .filter(|cause| cause.status == Status::Surrogate);
    lacks.extend(surrogates.map(|cause| {
        format!(
            "Something looks like {} but fails a check of it.",
            name(&cause.effect, &cause.axis)
        )
    }));
    if !report.not_excited.is_empty() {
        lacks.push(format!(
            "{} effects could not show in this recording.",
            report.not_excited.len()
        ));
    }
    lacks
}

fn next(experiment: &NextExperiment) -> Tile {
    let more = format!("{}; separates {}", experiment.run, separated(experiment));
    Tile::new(
        "next step",
        format!("{:.0} min", experiment.minutes.ceil()),
        more,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn cause(effect: &str, axis: &str, key: &str, value: f64) -> Value {
        json!({
            "effect": effect, "axis": axis, "status": "named", "confidence": 0.97, "D": 40.0,
            "parameters": [{"name": key, "value": value, "low": 0.95 * value, "high": 1.05 * value, "at_bound": false}],
            "constancy": {"passed": true, "worst_z": 0.0, "split_by": ""},
            "confusable_with": [],
        })
    }

    fn report(above_floor: bool, causes: Value, shrink: Value) -> GapReport {
        let value = json!({
            "schema": "abbe.gap/1",
            "inputs": {"bags": [], "machine_sha256": ""},
            "noise_floor": [],
            "gap": {"rms_um": 3.0, "p95_um": 6.0, "floor_um": 0.4, "above_floor": above_floor, "per_channel": []},
            "where": [],
            "causes": causes,
            "unknown": {"flagged": false, "score": 0.0, "threshold": 1.0, "description": {
                "covariate": "", "parity": "", "period": "", "feed_exponent": null, "time_constant_s": null}},
            "shrink": shrink,
            "not_excited": [],
            "next_experiments": [{"run": "circle XY", "separates": ["a", "b"], "delta": 12.0, "minutes": 4.0}],
            "runtime_s": 0.0,
        });
        serde_json::from_value(value).unwrap()
    }

    fn shrink(gap_closed: Value, leave_one_out: Value) -> Value {
        json!({
            "fit_runs": [1], "held_out_runs": [2], "rms_um": {"before": 3.0, "after": 0.8},
            "p95_um": {"before": 6.0, "after": 1.6}, "gap_closed": gap_closed, "leave_one_out": leave_one_out,
        })
    }

    #[test]
    fn the_largest_cause_is_the_one_that_the_gap_misses_most() {
        let causes = json!([
            cause("backlash", "X", "width_mm", 0.004),
            cause("squareness", "XY", "angle_urad", 40.0),
        ]);
        let without = json!([
            {"effect": "backlash", "axis": "X", "rms_um_without": 1.0},
            {"effect": "squareness", "axis": "XY", "rms_um_without": 2.5},
        ]);
        let closed = json!({"value": 0.93, "low": 0.9, "high": 0.95});
        let report = report(true, causes, shrink(closed, without));
        let screen = of(&report, &[]);
        let (verdict, tone) = screen.verdict.unwrap();
        assert!(
            verdict.contains("Squareness XY (EC0Y) 40.0 ± 2.0 µrad and backlash X"),
            "{verdict}"
        );
        assert_eq!(tone, Tone::Good);
        assert_eq!(sized(&report.causes[0]), "backlash X 4.00 ± 0.20 µm");
        assert_eq!(
            screen.tiles[1].value,
            "squareness XY (EC0Y) 40.0 ± 2.0 µrad"
        );
        assert_eq!(screen.tiles[0].value, "93 %");
        assert_eq!(screen.next.unwrap().value, "4 min");
    }

    #[test]
    fn one_cause_closes_the_gap() {
        let closed = json!({"value": 0.95, "low": 0.9, "high": 0.97});
        let causes = json!([cause("backlash", "X", "width_um", 5.58)]);
        let report = report(true, causes, shrink(closed, json!([])));
        let (verdict, _) = of(&report, &[]).verdict.unwrap();
        assert_eq!(
            verdict,
            "Backlash X 5.58 ± 0.28 µm closes 95 % of the gap between machine and simulator (mean square above noise), from 3.00 to 0.800 µm rms."
        );
    }

    #[test]
    fn a_narrow_interval_of_a_share_has_two_ends() {
        let of = |low: f64, value: f64, high: f64| {
            let closed = json!({"value": value, "low": low, "high": high});
            let causes = json!([cause("backlash", "X", "width_um", 5.58)]);
            let screen = super::of(&report(true, causes, shrink(closed, json!([]))), &[]);
            (screen.tiles[0].value.clone(), screen.tiles[0].more.clone())
        };
        let (value, more) = of(0.991, 0.992, 0.994);
        assert_eq!(value, "99.2 %");
        assert!(more.contains("99.1 to 99.4 %"), "{more}");
        assert_eq!(of(0.9, 0.95, 0.97).0, "95 %");
    }

    #[test]
    fn no_gap_is_good_and_a_loss_is_lacking() {
        let report = report(false, json!([]), shrink(Value::Null, json!([])));
        let screen = of(&report, &["file cut".to_owned()]);
        let (verdict, tone) = screen.verdict.unwrap();
        assert!(verdict.contains("agree within noise"), "{verdict}");
        assert_eq!(
            (tone, screen.lacks),
            (Tone::Good, vec!["file cut".to_owned()])
        );
    }

    #[test]
    fn a_gap_without_a_named_cause_is_no_success() {
        let report = report(true, json!([]), shrink(Value::Null, json!([])));
        let (verdict, tone) = of(&report, &[]).verdict.unwrap();
        assert!(verdict.contains("no cause is named"), "{verdict}");
        assert_eq!(tone, Tone::Bad);
    }
}
