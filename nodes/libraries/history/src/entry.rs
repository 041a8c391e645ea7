//! What is kept: one report or diagnosis with its figures.

use crate::bound;
use crate::error::HistoryError;

/// The origin of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A report of tests, or of a run.
    Report,
    /// A diagnosis.
    Diagnosis,
}

impl Kind {
    /// Its name in the store.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Report => "report",
            Self::Diagnosis => "diagnosis",
        }
    }
}

/// A figure of an entry.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Title of its test, without the numbers of runs; empty for a figure of the whole report.
    pub test: String,
    /// Name, such as `iso230_2.accuracy` or `effect.backlash.width_um`.
    pub name: String,
    /// Axis, pair or component; empty where the test says it.
    pub axis: String,
    /// Value, in `unit`.
    pub value: f64,
    /// `mm`, `rad`, `s`, another unit as in `effect.*` names, or empty for a number alone.
    pub unit: String,
    /// Standard uncertainty; `None`: not known.
    pub standard_uncertainty: Option<f64>,
    /// 95 % interval, where the report has one.
    pub interval: Option<[f64; 2]>,
    /// Status of a cause: `named`, `surrogate` or `set`; empty for other figures.
    pub status: String,
}

/// One report or diagnosis.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Name of the machine.
    pub machine: String,
    /// Time of the measurement, s since 1970 (UTC).
    pub at_s: i64,
    /// Its origin.
    pub kind: Kind,
    /// SHA-256 by which it is recognised: of the bags, or of the report's text.
    pub sha256: String,
    /// SHA-256 of the machine file, where it is known.
    pub machine_sha256: Option<String>,
    /// Path of the bag or report, as it was given.
    pub source: String,
    /// Instruments with serial numbers and certificates, where they are stated.
    pub instruments: String,
    /// Operator, where one is stated.
    pub operator: String,
    /// Version of the software that made the figures.
    pub software: String,
    /// The figures; each test, name and axis once.
    pub figures: Vec<Figure>,
}

impl Entry {
    /// Refuses what no store takes.
    ///
    /// # Errors
    /// Names key, value and limit of the first text, hash, time or number out of bounds.
    pub fn check(&self) -> Result<(), HistoryError> {
        check_text("machine", &self.machine, bound::NAME_BYTES)?;
        check_text("source", &self.source, bound::TEXT_BYTES)?;
        check_text("software", &self.software, bound::NAME_BYTES)?;
        for (key, text) in [
            ("instruments", &self.instruments),
            ("operator", &self.operator),
        ] {
            check_optional(key, text, bound::TEXT_BYTES)?;
        }
        check_hash("sha256", &self.sha256)?;
        if let Some(hash) = &self.machine_sha256 {
            check_hash("machine_sha256", hash)?;
        }
        if !bound::TIMES_S.contains(&self.at_s) {
            return Err(HistoryError::BadTime {
                at_s: self.at_s,
                least: *bound::TIMES_S.start(),
                greatest: *bound::TIMES_S.end(),
            });
        }
        let n = self.figures.len();
        if !(1..=bound::FIGURES).contains(&n) {
            return Err(HistoryError::BadCount {
                source_name: self.source.clone(),
                n,
                most: bound::FIGURES,
            });
        }
        self.figures.iter().try_for_each(Figure::check)
    }
}

impl Figure {
    fn check(&self) -> Result<(), HistoryError> {
        check_text("figure", &self.name, bound::NAME_BYTES)?;
        for (key, text) in [
            ("test", &self.test),
            ("axis", &self.axis),
            ("unit", &self.unit),
            ("status", &self.status),
        ] {
            check_optional(key, text, bound::NAME_BYTES)?;
        }
        let interval = self.interval.iter().flatten();
        let all = std::iter::once(("value", self.value))
            .chain(
                self.standard_uncertainty
                    .map(|u| ("standard_uncertainty", u)),
            )
            .chain(interval.map(|end| ("interval", *end)));
        for (key, value) in all {
            if !(value.is_finite() && value.abs() <= bound::MAGNITUDE) {
                return Err(HistoryError::BadNumber {
                    figure: self.name.clone(),
                    key,
                    value,
                    greatest: bound::MAGNITUDE,
                });
            }
        }
        if let Some(value) = self.standard_uncertainty.filter(|u| *u < 0.0) {
            let figure = self.name.clone();
            return Err(HistoryError::BadUncertainty { figure, value });
        }
        self.check_error()
    }

    /// Refuses an error that no machine has, and a range below zero.
    fn check_error(&self) -> Result<(), HistoryError> {
        let mut bounds = bound::ERRORS.iter();
        let Some((_, greatest)) = bounds.find(|(unit, _)| *unit == self.unit) else {
            return Ok(());
        };
        let last = self.name.rsplit('.').next().unwrap_or_default();
        let is_range = bound::NEVER_NEGATIVE.contains(&last);
        let least = if is_range { 0.0 } else { -greatest };
        if (least..=*greatest).contains(&self.value) {
            return Ok(());
        }
        Err(HistoryError::NoFigure {
            test: self.test.clone(),
            figure: self.name.clone(),
            value: self.value,
            unit: self.unit.clone(),
            least,
            greatest: *greatest,
        })
    }
}

fn check_text(key: &'static str, text: &str, most_bytes: usize) -> Result<(), HistoryError> {
    if text.trim().is_empty() {
        return Err(bad_text(key, text, most_bytes));
    }
    check_optional(key, text, most_bytes)
}

fn check_optional(key: &'static str, text: &str, most_bytes: usize) -> Result<(), HistoryError> {
    if text.len() > most_bytes || text.chars().any(char::is_control) {
        return Err(bad_text(key, text, most_bytes));
    }
    Ok(())
}

fn bad_text(key: &'static str, text: &str, most_bytes: usize) -> HistoryError {
    HistoryError::BadText {
        key,
        text: text.chars().take(40).collect(),
        most_bytes,
    }
}

fn check_hash(key: &'static str, text: &str) -> Result<(), HistoryError> {
    if text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return Ok(());
    }
    Err(HistoryError::BadHash {
        key,
        text: text.chars().take(70).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(name: &str, value: f64, unit: &str) -> Figure {
        Figure {
            test: "Positioning X".to_owned(),
            name: name.to_owned(),
            value,
            unit: unit.to_owned(),
            ..crate::report_figures::empty()
        }
    }

    #[test]
    fn figures_that_no_machine_has_are_refused_with_key_value_and_limits() {
        for (name, value, unit, words) in [
            (
                "iso230_2.accuracy",
                -1.0,
                "mm",
                "= -1 mm: must be from 0 to 1000 mm",
            ),
            (
                "iso230_2.up.repeatability",
                -1e-6,
                "mm",
                "must be from 0 to 1000 mm",
            ),
            ("iso230_2.reversal", -0.002, "mm", "must be from 0 to"),
            (
                "iso230_3_log.figures.range",
                -0.01,
                "mm",
                "must be from 0 to",
            ),
            (
                "iso230_2.accuracy",
                24_510.0,
                "mm",
                "= 24510 mm: must be from 0 to 1000 mm",
            ),
            (
                "iso230_2.mean_reversal",
                -1_001.0,
                "mm",
                "must be from -1000 to 1000 mm",
            ),
            (
                "iso230_2_rotary.figures.both.accuracy",
                -1e-5,
                "rad",
                "must be from 0 to",
            ),
            (
                "iso230_2_rotary.figures.both.mean_reversal",
                7.0,
                "rad",
                "must be from -6.28",
            ),
        ] {
            let refused = figure(name, value, unit)
                .check()
                .expect_err(name)
                .to_string();
            assert!(
                refused.starts_with(&format!("Positioning X: {name} = ")),
                "{refused}"
            );
            assert!(refused.contains(words), "{refused}");
        }
    }

    #[test]
    fn figures_that_a_machine_has_are_kept() {
        for (name, value, unit) in [
            ("iso230_2.accuracy", 0.0, "mm"),
            ("iso230_2.mean_reversal", -0.005, "mm"),
            ("iso230_4.clockwise.least_radial_deviation", -0.003, "mm"),
            ("effect.lead.um_per_m", -5_000.0, "um/m"),
            ("latency_s", 0.002, "s"),
        ] {
            assert!(figure(name, value, unit).check().is_ok(), "{name}");
        }
    }
}
