//! Why each cause has its status: its checks with value, limit and verdict.

use gap_diagnosis::report::{Cause, Check, GapReport, Side, Verdict};
use maud::{Markup, html};

use super::{name, status, three};
use crate::page;
use crate::section::{Rows, Section, head};

const WHY_TITLE: &str = "Why each cause has its status";

/// For a terminal: a sentence and a table for each cause.
pub(super) fn section(report: &GapReport) -> Section {
    let mut section = Section::new(WHY_TITLE);
    if report.causes.is_empty() {
        let none = "No effect of the catalogue was found in the gap, so that none was checked.";
        section.lines.push(none.to_owned());
    }
    section.lines.extend(report.causes.iter().map(sentence));
    section.tables = report.causes.iter().map(table).collect();
    section
}

/// For a page: folded, one part for each cause.
pub(super) fn folded(report: &GapReport) -> Markup {
    let causes = report.causes.iter().map(|cause| {
        let table = table(cause);
        let names: Vec<&str> = table.head.iter().map(String::as_str).collect();
        html! {
            details {
                summary { (sentence(cause)) }
                (page::table(&names, &table.rows))
            }
        }
    });
    html! {
        @if !report.causes.is_empty() {
            (page::fold(WHY_TITLE, None, false, &html! { @for cause in causes { (cause) } }))
        }
    }
}

/// The status of a cause, and which checks decide it.
fn sentence(cause: &Cause) -> String {
    let failed: Vec<&str> = cause
        .why
        .iter()
        .filter(|check| check.has_failed())
        .map(|check| check.name.as_str())
        .collect();
    let tried = |check: &&Check| check.verdict != Verdict::NotTried;
    let tried = cause.why.iter().filter(tried).count();
    let title = name(&cause.effect, &cause.axis);
    let status = status(cause.status);
    if failed.is_empty() {
        return format!("{title}, {status}: it passes all of {tried} checks.");
    }
    format!(
        "{title}, {status}: it fails {} of {tried} checks: {}.",
        failed.len(),
        failed.join("; ")
    )
}

fn table(cause: &Cause) -> Rows {
    let row = |check: &Check| {
        vec![
            check.name.clone(),
            with_unit(check.value, &check.unit),
            limit(check),
            verdict(check.verdict).to_owned(),
        ]
    };
    let title = name(&cause.effect, &cause.axis);
    Rows {
        head: head(&[&format!("check of {title}"), "value", "limit", "verdict"]),
        rows: cause.why.iter().map(row).collect(),
        note: String::new(),
    }
}

fn with_unit(number: Option<f64>, unit: &str) -> String {
    let text = number.map_or_else(|| "—".to_owned(), three);
    format!("{text} {unit}").trim_end().to_owned()
}

fn limit(check: &Check) -> String {
    let Some(limit) = check.limit else {
        return "—".to_owned();
    };
    let side = match check.passes {
        Side::AtLeast => "at least",
        Side::Above => "above",
        Side::AtMost => "at most",
        Side::Below => "below",
    };
    format!("{side} {}", with_unit(Some(limit), &check.unit))
}

const fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Passed => "passed",
        Verdict::Failed => "FAILED",
        Verdict::NotTried => "not tried",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cause as a report holds it, one of whose checks has this D.
    fn cause(status: &str, d: f64, verdict: &str) -> Cause {
        let value = serde_json::json!({
            "effect": "backlash", "axis": "X", "status": status, "confidence": 0.97, "parameters": [], "D": d,
            "confusable_with": [], "constancy": {"passed": true, "worst_z": 1.2, "split_by": "feed"},
            "why": [
                {"check": "above_noise", "name": "size over noise, D", "value": d, "limit": 6.5,
                 "passes": "at_least", "unit": "", "verdict": verdict},
                {"check": "above_form", "name": "height above the simulator's own error of form", "value": 2.95,
                 "limit": 0.2, "passes": "above", "unit": "µm", "verdict": "passed"},
                {"check": "held_out_gain", "name": "gain on runs left out", "value": null, "limit": null,
                 "passes": "above", "unit": "", "verdict": "not_tried"}]
        });
        serde_json::from_value(value).unwrap()
    }

    fn words(text: &str) -> Vec<String> {
        let lines = text.lines();
        lines
            .map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "))
            .collect()
    }

    #[test]
    fn a_named_cause_shows_each_check_that_it_passed_with_value_and_limit() {
        let cause = cause("named", 88.0, "passed");
        let title = sentence(&cause);
        assert_eq!(title, "backlash X, named: it passes all of 2 checks.");
        let section = Section {
            tables: vec![table(&cause)],
            ..Section::new(WHY_TITLE)
        };
        let lines = words(&section.terminal());
        for line in [
            "size over noise, D 88.0 at least 6.50 passed",
            "gain on runs left out — — not tried",
        ] {
            assert!(lines.iter().any(|own| own == line), "{lines:#?}");
        }
        let form = table(&cause).rows[1].clone();
        assert_eq!(form[1..], ["2.95 µm", "above 0.200 µm", "passed"]);
    }

    #[test]
    fn one_that_is_not_named_shows_the_check_that_it_fails() {
        let cause = cause("surrogate", 5.1, "failed");
        let title = sentence(&cause);
        assert_eq!(
            title,
            "backlash X, looks like it: it fails 1 of 2 checks: size over noise, D."
        );
        let row = ["size over noise, D", "5.10", "at least 6.50", "FAILED"];
        assert_eq!(table(&cause).rows[0], row);
    }
}
