//! Programs of authors that set the count of a reference to zero before a step that measures with it.
//!
//! The sequencer counts the zeros of plate and beam, and the controller counts them too: readings of another zero than their
//! run's are left out. A `(zero: ...)` of an author's program would make the two differ for every later run.

use std::collections::BTreeMap;

use crate::error::SequencerError;
use crate::plan::{Plan, Step};

/// Refuses programs that set a zero before a step that measures by the same count.
pub(crate) fn check(
    plan: &Plan,
    programs: &BTreeMap<String, String>,
) -> Result<(), SequencerError> {
    for (at, step) in plan.steps.iter().enumerate() {
        let Some((name, text)) = program(step).and_then(|name| programs.get_key_value(name)) else {
            continue;
        };
        for (line, what) in zeros(text) {
            let later = plan.steps.iter().enumerate().skip(at + 1);
            let mut measuring = later.filter(|(_, step)| counted(step) == Some(what));
            if let Some((measured_by, _)) = measuring.next() {
                return Err(SequencerError::ZeroInProgram {
                    step: at,
                    program: name.clone(),
                    line,
                    what,
                    measured_by,
                });
            }
        }
    }
    Ok(())
}

/// The program of an author that a step runs.
const fn program(step: &Step) -> Option<&String> {
    match step {
        Step::Produce { program, .. } | Step::Verify { program, .. } | Step::Run { program } => {
            Some(program)
        }
        _ => None,
    }
}

/// Which count a step measures by.
fn counted(step: &Step) -> Option<&'static str> {
    match step {
        Step::Grid(_) => Some("grid"),
        Step::Positioning(step) | Step::Scan(step) => step.beam.as_ref().map(|_| "length"),
        Step::Diagonals(_) => Some("length"),
        _ => None,
    }
}

/// Lines of a program, from 1, that set a count to zero, and which.
fn zeros(text: &str) -> Vec<(usize, &'static str)> {
    let mut found = Vec::new();
    for (at, line) in text.lines().enumerate() {
        // Behind `;` the whole rest is a comment without a meaning.
        let code = line.split(';').next().unwrap_or_default();
        for comment in code.split('(').skip(1) {
            let inner = comment.split(')').next().unwrap_or_default();
            let Some((key, value)) = inner.split_once(':') else {
                continue;
            };
            let what = ["grid", "length"]
                .into_iter()
                .find(|it| *it == value.trim());
            found.extend(
                what.filter(|_| key.trim() == "zero")
                    .map(|what| (at + 1, what)),
            );
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_sets_a_zero_before_a_measuring_step_is_refused_with_its_line() {
        let plan = |steps: &str| Plan::from_yaml(&format!("title: t\nsteps:\n{steps}")).unwrap();
        let run = "  - {do: run, program: off.ngc}\n";
        let line = "  - {do: positioning, axis: X, targets_mm: [0.0, 10.0], runs: 2, dwell_s: 1.0, feed_mm_min: 600.0, overrun_mm: 5.0";
        let by_beam = format!("{line}, beam: along_x}}\n");
        let by_scale = format!("{line}}}\n");
        let programs = |text: &str| BTreeMap::from([("off.ngc".to_owned(), text.to_owned())]);
        let zero = "G21\n( zero : length )\nM2\n";
        for (steps, text, is_refused) in [
            (format!("{run}{by_beam}"), zero, true),
            (format!("{run}{by_scale}"), zero, false),
            (format!("{by_beam}{run}"), zero, false),
            (format!("{run}{by_beam}"), "(zero: grid)\nM2\n", false),
            (
                format!("{run}{by_beam}"),
                "G4 P1 ; (zero: length)\nM2\n",
                false,
            ),
            (format!("{run}{by_beam}"), "G4 P1\nM2\n", false),
        ] {
            let found = check(&plan(&steps), &programs(text));
            assert_eq!(found.is_err(), is_refused, "{steps}{text}");
            let said = found.err().map(|it| it.to_string()).unwrap_or_default();
            let words = "steps[0].program = \"off.ngc\", line 2: (zero: length)";
            assert!(!is_refused || said.starts_with(words), "{said}");
        }
    }
}
