//! ISO 230-3 of a bag: how displacements and the faces of blocks drift, with the temperatures beside them.

use anyhow::Result;
use iso230::thermal::DriftCause;
use metrology::sample::BlockMeasurement;
use metrology::stamp::{Host, Stamp};
use serde::Serialize;

use super::section::{Rows, Section, head};
use crate::evaluate::budget::Budget;
use crate::evaluate::drift::{Drift, Series};
use crate::evaluate::test_conditions::TestConditions;

mod faces;
mod figures;
mod logs;
mod slips;
mod tilt;

/// Seconds of an hour.
const HOUR_S: f64 = 3600.0;

/// One part for the faces of blocks, one for each log, one for each axis with sensors at two heights.
///
/// # Errors
/// When a plot cannot be drawn.
pub fn sections(
    blocks: &[BlockMeasurement],
    (drift, conditions): (&Drift, &TestConditions),
    budget: Option<&Budget>,
) -> Result<Vec<Section>> {
    let mut sections = Vec::new();
    sections.extend(faces::section(blocks, drift, budget)?);
    for log in &drift.logs {
        let during = conditions.during(&[log.run]);
        sections.push(logs::section(log, drift, (budget, &during))?);
    }
    sections.extend(tilt::sections(drift, budget)?);
    Ok(sections)
}

/// What the standard calls a test with this cause.
const fn in_words(cause: DriftCause) -> &'static str {
    match cause {
        DriftCause::Environment => "environmental temperature variation error, E_TVE",
        DriftCause::Spindle => "distortion by the turning spindle",
        DriftCause::LinearAxis => "distortion by moving linear axes",
        DriftCause::RotaryAxis => "distortion by a moving rotary axis",
        DriftCause::NotStated => "cause not stated",
    }
}

/// A thermometer while displacements were read.
#[derive(Serialize)]
struct Temperature {
    sensor: String,
    first_degc: f64,
    last_degc: f64,
    least_degc: f64,
    greatest_degc: f64,
    range_k: f64,
}

impl Temperature {
    fn of(sensor: &str, series: &Series, from: Stamp<Host>, to: Stamp<Host>) -> Option<Self> {
        let within = series.between(from, to);
        let (first, last) = (within.first()?, within.last()?);
        let values = || within.iter().map(|(_, degc)| *degc);
        let least_degc = values().fold(f64::INFINITY, f64::min);
        let greatest_degc = values().fold(f64::NEG_INFINITY, f64::max);
        Some(Self {
            sensor: sensor.to_owned(),
            first_degc: first.1,
            last_degc: last.1,
            least_degc,
            greatest_degc,
            range_k: greatest_degc - least_degc,
        })
    }
}

/// Every thermometer that was read between two instants.
fn temperatures(drift: &Drift, from: Stamp<Host>, to: Stamp<Host>) -> Vec<Temperature> {
    let known = drift.temperatures.iter();
    known
        .filter_map(|(sensor, series)| Temperature::of(sensor, series, from, to))
        .collect()
}

/// Why there is no temperature beside a drift.
fn without_temperatures(drift: &Drift) -> String {
    let why = match drift.temperatures_left_out {
        0 => "No temperature was recorded meanwhile".to_owned(),
        n => format!("No temperature can be used ({n} readings of thermometers were left out)"),
    };
    format!("{why}: ISO 230-3 asks for those of air, spindle nose and machine.")
}

/// The table of temperatures, or a sentence that no thermometer was read.
fn show_temperatures(section: &mut Section, drift: &Drift, found: &[Temperature]) {
    if found.is_empty() {
        section.lines.push(without_temperatures(drift));
        return;
    }
    let row = |one: &Temperature| {
        let numbers = [
            one.first_degc,
            one.last_degc,
            one.least_degc,
            one.greatest_degc,
            one.range_k,
        ];
        let cells = numbers.map(|number| format!("{number:.2}"));
        std::iter::once(one.sensor.clone()).chain(cells).collect()
    };
    section.tables.push(Rows {
        head: head(&[
            "thermometer",
            "first / °C",
            "last / °C",
            "least / °C",
            "greatest / °C",
            "range / K",
        ]),
        rows: found.iter().map(row).collect(),
        note: "While the displacements were read.".to_owned(),
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thermometers_that_were_left_out_are_not_called_unrecorded() {
        let mut drift = Drift::default();
        let none = without_temperatures(&drift);
        assert!(none.starts_with("No temperature was recorded"), "{none}");
        drift.temperatures_left_out = 28;
        let left_out = without_temperatures(&drift);
        assert!(left_out.contains("(28 readings"), "{left_out}");
        assert!(!left_out.contains("was recorded"), "{left_out}");
    }
}
