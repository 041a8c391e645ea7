//! Stops that were read twice, without a column of the direction.
//!
//! A target that follows itself was approached from its other side, at a turning point and in a step cycle; a display that was
//! read twice at one stop gives the same rows. Where nothing says which of both it was, the reversal would be made up.

use anyhow::{Result, bail};

use super::map::Units;
use super::runs::SAME_TARGET_MM;
use super::table::Row;

/// Stops of a run that follow themselves while the axis goes on: fewer may be a repetition.
const LEAST_DOUBLED: usize = 2;

/// Refuses runs without directions whose targets follow themselves on the way from end to end.
///
/// # Errors
/// With the lines of the first pair, and the remedies.
pub fn check(runs: &[Vec<Row>], units: Units) -> Result<()> {
    for rows in runs {
        let has_way = |row: &Row| row.cells.get(3).is_some();
        if rows.iter().any(has_way) {
            continue;
        }
        let doubled: Vec<&[Row]> = pairs_on_the_way(rows);
        let (true, Some([first, second])) =
            (doubled.len() >= LEAST_DOUBLED, doubled.first().copied())
        else {
            continue;
        };
        bail!(
            "line {}: run {}: target {} {} is that of line {} too, as {} targets on one way are twice: two readings of one stop, or a step \
             cycle from both sides? Keep one reading of each stop, or name a column of the direction in the map",
            second.line,
            second.cells[0],
            second.cells[1],
            units.target,
            first.line,
            doubled.len()
        );
    }
    Ok(())
}

/// Rows of one target, one behind the other, before and behind which the axis moves the same way; at an end one side is enough.
fn pairs_on_the_way(rows: &[Row]) -> Vec<&[Row]> {
    let target = |row: &Row| row.cells[1];
    let stops: Vec<&[Row]> = rows
        .chunk_by(|a, b| (target(a) - target(b)).abs() <= SAME_TARGET_MM)
        .collect();
    let at = |stop: &[Row]| stop.first().map_or(0.0, target);
    let between = stops.windows(3).filter_map(|three| {
        let [before, stop, behind] = three else {
            return None;
        };
        let goes_on = (at(stop) - at(before)) * (at(behind) - at(stop)) > 0.0;
        (goes_on && stop.len() == 2).then_some(*stop)
    });
    between.collect()
}

#[cfg(test)]
mod tests {
    use super::super::map::units;
    use super::*;
    use metrology::Axis;

    fn said(targets: &[f64], way: Option<f64>) -> String {
        let row = |(k, target): (usize, &f64)| Row {
            line: k as u64 + 2,
            cells: [1.0, *target, 0.5].into_iter().chain(way).collect(),
        };
        let rows: Vec<Row> = targets.iter().enumerate().map(row).collect();
        match check(&[rows], units(Axis::X)) {
            Ok(()) => String::new(),
            Err(error) => format!("{error:#}"),
        }
    }

    #[test]
    fn two_readings_of_each_stop_are_no_reversal() {
        let up = [0.0, 0.0, 50.0, 50.0, 100.0, 100.0, 150.0, 150.0];
        let said_of_up = said(&up, None);
        assert!(
            said_of_up.starts_with("line 5: run 1: target 50 mm is that of line 4 too"),
            "{said_of_up}"
        );
        assert!(said_of_up.contains("Keep one reading of each stop"));
        let down: Vec<f64> = up.iter().rev().copied().collect();
        assert!(!said(&[&up[..], &down].concat(), None).is_empty());
        // With directions they are what these say.
        assert_eq!(said(&up, Some(1.0)), "");
    }

    #[test]
    fn turning_points_and_one_repetition_are_as_before() {
        let both = [0.0, 50.0, 100.0, 100.0, 50.0, 0.0, 0.0, 50.0, 100.0];
        assert_eq!(said(&both, None), "");
        assert_eq!(said(&[0.0, 50.0, 50.0, 100.0, 150.0], None), "");
    }
}
