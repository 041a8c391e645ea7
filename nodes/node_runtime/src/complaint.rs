//! An error as a person reads it: what was done, where, why, and each of it once.
//!
//! An error that shows its source in its own sentence, as those of the pure crates do, and has it as
//! a source as well would say it twice when the chain is printed. Here a cause that stands in what was
//! said already is left out. The reader of YAML draws the place that it complains of over several lines,
//! with its reason once more; that becomes one line.

use std::fmt::Arguments;
use std::io::Write;

/// A line on standard error, as `eprintln!` takes it, written by [`line()`].
#[macro_export]
macro_rules! complain {
    ($($text:tt)*) => {
        $crate::complaint::line(format_args!($($text)*))
    };
}

/// Writes a line to standard error. Where nobody reads it any more (`2>&1 | head`, or `tee` that Ctrl-C has ended first), what
/// is being done goes on: a machine is wound down the same.
pub fn line(text: Arguments<'_>) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

/// The whole chain of `error` in one text.
#[must_use]
pub fn in_words(error: &anyhow::Error) -> String {
    let of_yaml = error
        .chain()
        .find_map(|cause| cause.downcast_ref::<serde_saphyr::Error>());
    let mut said = String::new();
    for cause in error.chain() {
        let is_yaml = cause.is::<serde_saphyr::Error>();
        let mut words = cause.to_string();
        if let Some(yaml) = of_yaml {
            words = words.replace(&yaml.to_string(), &reason(yaml));
        }
        if said.is_empty() {
            said = words;
        } else if words.starts_with(&said) {
            // A context that only repeats the begin of its cause adds nothing.
            said = words;
        } else if !said.contains(words.trim_end()) {
            said = format!("{said}: {words}");
        }
        // What it has as a source is itself once more, without the drawing.
        if is_yaml {
            break;
        }
    }
    said
}

/// Line, column and reason of an error in a YAML text.
fn reason(error: &serde_saphyr::Error) -> String {
    let text = error.without_snippet().to_string();
    let line = text.lines().next().unwrap_or_default();
    match (error.location(), line.split_once(" at line ")) {
        (Some(at), Some((reason, _))) => {
            format!("line {}, column {}: {reason}", at.line(), at.column())
        }
        _ => line.to_owned(),
    }
}

/// The same with what stands in that line of `text`.
#[must_use]
pub fn of_yaml(error: &serde_saphyr::Error, text: &str) -> String {
    let reason = reason(error);
    let line = error
        .location()
        .and_then(|at| usize::try_from(at.line()).ok()?.checked_sub(1))
        .and_then(|above| text.lines().nth(above));
    match line.map(str::trim) {
        Some(line) if !line.is_empty() => format!("{reason}, in `{line}`"),
        _ => reason,
    }
}

#[cfg(test)]
mod tests {
    use anyhow::{Context as _, anyhow};

    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("cannot open {path}: {source}")]
    struct Open {
        path: &'static str,
        source: std::io::Error,
    }

    #[test]
    fn what_an_error_shows_of_its_source_is_not_said_again() {
        let source = std::io::Error::from(std::io::ErrorKind::NotFound);
        let reason = source.to_string();
        let error = anyhow::Error::new(Open {
            path: "bag",
            source,
        });
        let chained = format!("{error:#}");
        assert_eq!(chained.matches(&reason).count(), 2, "{chained}");
        assert_eq!(in_words(&error), format!("cannot open bag: {reason}"));
        let placed = error.context("node probe");
        assert_eq!(
            in_words(&placed),
            format!("node probe: cannot open bag: {reason}")
        );
    }

    #[derive(Debug, thiserror::Error)]
    #[error("plan: {0}")]
    struct Plan(#[source] serde_saphyr::Error);

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Step {
        _minutes: f64,
    }

    #[test]
    fn an_error_in_yaml_is_one_line_with_place_reason_and_what_stands_there() {
        let text = "# steps\nminuets: 3.0\n";
        let error = serde_saphyr::from_str::<Step>(text).unwrap_err();
        assert!(error.to_string().lines().count() > 1, "it draws no place");
        let shown = of_yaml(&error, text);
        assert!(shown.starts_with("line 2, column 1: "), "{shown}");
        assert!(shown.ends_with(", in `minuets: 3.0`"), "{shown}");
        let chained = in_words(&anyhow::Error::new(Plan(error)).context("plan p.yaml"));
        assert!(
            chained.starts_with("plan p.yaml: plan: line 2, column 1: "),
            "{chained}"
        );
        assert_eq!(chained.lines().count(), 1, "{chained}");
        assert_eq!(chained.matches("unknown field").count(), 1, "{chained}");
    }

    #[test]
    fn a_context_that_its_cause_begins_with_is_said_once() {
        let error = anyhow!("plan p.yaml, step 3: unknown key").context("plan p.yaml");
        assert_eq!(in_words(&error), "plan p.yaml, step 3: unknown key");
        let other = Err::<(), _>(anyhow!("no number")).context("line 3");
        assert_eq!(in_words(&other.unwrap_err()), "line 3: no number");
    }
}
