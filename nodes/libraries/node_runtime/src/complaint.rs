//! An error as a person reads it: what was done, where, why, and each of it once.
//!
//! An error that shows its source in its own sentence, as those of the pure crates do, and has it as
//! a source as well would say it twice when the chain is printed. Here a cause that stands in what was
//! said already is left out.

use std::fmt::Arguments;
use std::io::Write;

use metrology::visible::visible;

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
    let _ = to(&mut std::io::stderr().lock(), text);
}

/// A line in which nothing of what comes from outside commands the terminal.
fn to(out: &mut impl Write, text: Arguments<'_>) -> std::io::Result<()> {
    writeln!(out, "{}", visible(&text.to_string()))
}

/// The whole chain of `error` in one text.
#[must_use]
pub fn in_words(error: &anyhow::Error) -> String {
    let mut said = String::new();
    for cause in error.chain() {
        let words = cause.to_string();
        if said.is_empty() {
            said = words;
        } else if words.starts_with(&said) {
            // A context that only repeats the begin of its cause adds nothing.
            said = words;
        } else if !said.contains(words.trim_end()) {
            said = format!("{said}: {words}");
        }
    }
    said
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

    #[test]
    fn a_name_from_outside_commands_no_terminal() {
        let mut out = Vec::new();
        to(
            &mut out,
            format_args!("bag \u{1b}[2J\u{202e}: no such file"),
        )
        .unwrap();
        let shown = String::from_utf8(out).unwrap();
        assert_eq!(shown, "bag \\u001b[2J\\u202e: no such file\n");
    }

    #[test]
    fn a_context_that_its_cause_begins_with_is_said_once() {
        let error = anyhow!("plan p.yaml, step 3: unknown key").context("plan p.yaml");
        assert_eq!(in_words(&error), "plan p.yaml, step 3: unknown key");
        let other = Err::<(), _>(anyhow!("no number")).context("line 3");
        assert_eq!(in_words(&other.unwrap_err()), "line 3: no number");
    }
}
