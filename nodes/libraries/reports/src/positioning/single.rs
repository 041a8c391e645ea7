//! A positioning test of one run: the figures of ISO 230-2 that need no scatter.

use anyhow::Result;
use iso230::ExpandedLength;
use iso230::positioning::single_run::SingleRunResult;

use super::{figure, state_remarks, uncertainty};
use crate::evaluate::correction::Measured;
use crate::evaluate::linear::LinearTest;
use crate::section::{Rows, Section, head};

/// What a test of one run does not show.
const NO_SCATTER: &str = "Repeatability R and accuracy A need at least 2 runs, 5 by the standard; the scatter of single readings is in the figures of this test.";

/// Lines, table and figures of a test of one run.
///
/// # Errors
/// When the figures cannot be written as JSON.
pub(super) fn fill(
    section: &mut Section,
    test: &LinearTest,
    result: &SingleRunResult,
    measured: &Measured,
) -> Result<()> {
    let ways = match (&result.up, &result.down) {
        (Some(_), Some(_)) => "up and down",
        (Some(_), None) => "up only (one-way)",
        _ => "down only (one-way)",
    };
    section.lines.push(format!(
        "{} targets from {:.3} to {:.3} mm, 1 run {ways}: the values of ISO 230-2 that need no repetition. {NO_SCATTER}",
        test.targets_mm.len(),
        test.targets_mm.first().copied().unwrap_or(f64::NAN),
        test.targets_mm.last().copied().unwrap_or(f64::NAN),
    ));
    state_remarks(section, &result.remarks);
    section.answers.push(answer(result, measured));
    section.tables.push(table(result, measured));
    section
        .tables
        .extend(uncertainty::table(&result.contributions, measured));
    section.figures = serde_json::json!({
        "test": section.title, "iso230_2": serde_json::to_value(result)?, "left_out": test.left_out,
    });
    Ok(())
}

/// The figures in a sentence.
fn answer(result: &SingleRunResult, measured: &Measured) -> String {
    let length = |value: &ExpandedLength| figure(value, measured.are_lengths_stated);
    let sides = [("↑", &result.up), ("↓", &result.down)];
    let mut words: Vec<String> = { sides.into_iter() }
        .filter_map(|(arrow, side)| {
            let value = length(&side.as_ref()?.systematic_error);
            Some(format!("systematic deviation E{arrow} {value} µm"))
        })
        .collect();
    if let Some(both) = &result.both {
        words = vec![
            format!(
                "systematic deviation E {} µm",
                length(&both.systematic_error)
            ),
            format!(
                "range of means M {} µm",
                length(&both.mean_systematic_error)
            ),
            format!(
                "reversal B {} µm",
                figure(&both.reversal, measured.is_stated)
            ),
        ];
    }
    format!(
        "{}one run: {}; repeatability R and accuracy A need more runs{}.",
        measured.reservation(),
        words.join(", "),
        measured.coverage()
    )
}

fn table(result: &SingleRunResult, measured: &Measured) -> Rows {
    let cell = |value: Option<&ExpandedLength>, stated: bool| {
        value.map_or_else(|| "—".to_owned(), |value| figure(value, stated))
    };
    let both = result.both.as_ref();
    let side = |one: Option<_>| cell(one, measured.are_lengths_stated);
    let of_both = |name: &str, value: Option<&ExpandedLength>, stated: bool| {
        vec![
            name.to_owned(),
            cell(None, stated),
            cell(None, stated),
            cell(value, stated),
        ]
    };
    Rows {
        head: head(&["ISO 230-2, one run / µm", "up", "down", "both"]),
        rows: vec![
            vec![
                "systematic deviation E".to_owned(),
                side(result.up.as_ref().map(|up| &up.systematic_error)),
                side(result.down.as_ref().map(|down| &down.systematic_error)),
                side(both.map(|both| &both.systematic_error)),
            ],
            of_both("reversal B", both.map(|b| &b.reversal), measured.is_stated),
            of_both(
                "mean reversal",
                both.map(|b| &b.mean_reversal),
                measured.is_stated,
            ),
            of_both(
                "range of means M",
                both.map(|b| &b.mean_systematic_error),
                measured.are_lengths_stated,
            ),
        ],
        note: measured.uncertainty_note().to_owned(),
    }
}
