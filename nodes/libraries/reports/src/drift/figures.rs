//! The figures of ISO 230-3 of one displacement over time.

use iso230::budget::DeviceUncertainty;
use iso230::thermal::{
    self, Artefact, DisplacementDrift, DriftBudget, DriftCause, DriftChannel, DriftContributions,
    DriftTest,
};
use iso230::{ExpandedLength, ExpandedRate, Iso230Error};
use metrology::Axis;
use serde::Serialize;

use super::HOUR_S;
use crate::positioning::{figure, with_u};
use crate::section::um;

/// Hours after which the drift is stated.
pub(super) const AFTER_H: [f64; 2] = [1.0, 3.0];
/// Longest pause between readings across which a straight line is taken, s.
pub(super) const LONGEST_PAUSE_S: f64 = HOUR_S;
/// Readings without which a rate has no uncertainty.
const LEAST_OF_RATE: usize = 3;

/// One displacement, evaluated.
#[derive(Debug, Serialize)]
pub(super) struct Figures {
    /// Drift after one hour; `None`: not recorded so long.
    pub after_1_h: Option<ExpandedLength>,
    /// Drift after three hours; `None`: not recorded so long.
    pub after_3_h: Option<ExpandedLength>,
    /// Drift at the end of the test.
    pub at_end: ExpandedLength,
    /// Greatest minus least displacement of the last hour; `None`: not recorded so long.
    pub range_last_hour: Option<ExpandedLength>,
    /// Greatest minus least displacement of the whole test.
    pub range: ExpandedLength,
    /// Slope of the line through the end of the test.
    pub final_rate: ExpandedRate,
    /// Length of that end, s.
    pub rate_window_s: f64,
    /// What the uncertainty of the range consists of, where it is stated by causes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contributions: Option<DriftContributions>,
    /// k of each U, where a mandrel grows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coverage_factors: Option<CoverageFactors>,
}

/// k of U of the figures of the same name.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct CoverageFactors {
    pub after_1_h: Option<f64>,
    pub after_3_h: Option<f64>,
    pub at_end: f64,
    pub range_last_hour: Option<f64>,
    pub range: f64,
    pub final_rate: f64,
}

impl CoverageFactors {
    /// Such as `k = 1.97 after 1 h, 1.92 of the range, 1.88 of the last rate`: those of the cells.
    pub(super) fn in_words(&self) -> String {
        let all = [
            (self.after_1_h, "after 1 h"),
            (self.after_3_h, "after 3 h"),
            (Some(self.range), "of the range"),
            (Some(self.final_rate), "of the last rate"),
        ];
        let stated = all.into_iter().filter_map(|(k, of)| Some((k?, of)));
        let each: Vec<String> = stated.map(|(k, of)| format!("{k:.2} {of}")).collect();
        format!("k = {}", each.join(", "))
    }
}

/// Standard deviation of one of these readings (s since the first, mm) by scatter, mm; zero where they are too few.
pub(super) fn scatter_mm(values: &[(f64, f64)]) -> f64 {
    let (times_s, displacements_mm): (Vec<f64>, Vec<f64>) = values.iter().copied().unzip();
    thermal::scatter_mm(&times_s, &displacements_mm).unwrap_or(0.0)
}

/// What read displacements, and on what.
#[derive(Clone, Debug)]
pub(super) struct Reader {
    /// Certificate of the instrument.
    pub sensor: DeviceUncertainty,
    /// Standard deviation of one of its readings by scatter, mm.
    pub reading_scatter_mm: f64,
    /// Period of its error along the displacement, where it is stated, mm.
    pub error_period_mm: Option<f64>,
    /// The mandrel, as far as its growth is in the displacement, with a temperature at each of them where it is read.
    pub mandrel: Option<Artefact>,
}

impl Reader {
    /// One of which the certificate alone is known.
    pub(super) const fn certified(sensor: DeviceUncertainty) -> Self {
        Self {
            sensor,
            reading_scatter_mm: 0.0,
            error_period_mm: None,
            mandrel: None,
        }
    }

    /// For the evaluation of ISO 230-3 of the readings from the `first` on.
    pub(super) fn budget(&self, first: usize) -> DriftBudget {
        DriftBudget {
            sensor: self.sensor,
            reading_scatter_mm: self.reading_scatter_mm,
            sensor_error_period_mm: self.error_period_mm,
            artefact: { self.mandrel.clone() }.map(|mandrel| mandrel.since_reading(first)),
        }
    }
}

/// Length of the window of the last rate, s: an hour, or the whole where an hour has too few readings. Times are s since the
/// first one.
pub(super) fn rate_window_s(times_s: &[f64]) -> f64 {
    let recorded_s = times_s.last().copied().unwrap_or(0.0);
    let in_last_hour = times_s.iter().rev();
    let in_last_hour = in_last_hour.take_while(|time_s| **time_s >= recorded_s - HOUR_S);
    if recorded_s >= HOUR_S && in_last_hour.count() >= LEAST_OF_RATE {
        HOUR_S
    } else {
        recorded_s
    }
}

/// A log of which parts are evaluated.
struct Log<'a> {
    axis: Axis,
    cause: DriftCause,
    /// Times (s since the first) and displacements (mm).
    values: &'a [(f64, f64)],
    reader: &'a Reader,
}

impl Log<'_> {
    /// Drift, range and rate of the readings from the `first` on.
    fn part(
        &self,
        first: usize,
        (drift_after_s, rate_window_s): (f64, f64),
    ) -> Result<DisplacementDrift, Iso230Error> {
        let values = self.values.get(first..).unwrap_or_default();
        let first_s = values.first().map_or(0.0, |(time_s, _)| *time_s);
        let test = DriftTest {
            cause: self.cause,
            times_s: values.iter().map(|(time_s, _)| time_s - first_s).collect(),
            channels: vec![DriftChannel {
                axis: self.axis,
                height_mm: 0.0,
                displacements_mm: values.iter().map(|(_, mm)| *mm).collect(),
            }],
            drift_after_s,
            rate_window_s,
            longest_gap_s: LONGEST_PAUSE_S,
        };
        let result = thermal::evaluate(&test, &self.reader.budget(first))?;
        let one = result.displacements.first().copied();
        one.ok_or(Iso230Error::TooFewPoints {
            place: "displacements",
            n: 0,
            least: 1,
        })
    }
}

/// Evaluates displacements (s since the first, mm).
///
/// # Errors
/// As [`thermal::evaluate`].
pub(super) fn of(
    axis: Axis,
    cause: DriftCause,
    values: &[(f64, f64)],
    reader: &Reader,
) -> Result<Figures, Iso230Error> {
    let times_s: Vec<f64> = values.iter().map(|(time_s, _)| *time_s).collect();
    let recorded_s = times_s.last().copied().unwrap_or(0.0);
    let rate_window_s = rate_window_s(&times_s);
    let log = Log {
        axis,
        cause,
        values,
        reader,
    };
    let evaluated = |drift_after_s: f64| log.part(0, (drift_after_s, rate_window_s));
    let whole = evaluated(recorded_s.max(f64::MIN_POSITIVE))?;
    let in_last_hour = times_s.partition_point(|time_s| *time_s < recorded_s - HOUR_S);
    let has_last_hour = recorded_s >= HOUR_S && times_s.len() - in_last_hour >= LEAST_OF_RATE;
    let last_s = { times_s.get(in_last_hour) }.map_or(0.0, |time_s| recorded_s - time_s);
    let last_hour = has_last_hour.then(|| log.part(in_last_hour, (last_s, last_s)));
    let last_hour = last_hour.transpose()?;
    let after = |hours: f64| {
        let reaches = recorded_s >= hours * HOUR_S;
        reaches.then(|| evaluated(hours * HOUR_S)).transpose()
    };
    let [one, three] = AFTER_H;
    let (after_1_h, after_3_h) = (after(one)?, after(three)?);
    let factor = |one: DisplacementDrift| one.drift_after_coverage_factor;
    Ok(Figures {
        after_1_h: after_1_h.map(|one| one.drift_after),
        after_3_h: after_3_h.map(|one| one.drift_after),
        at_end: whole.drift_after,
        range_last_hour: last_hour.map(|one| one.range),
        range: whole.range,
        final_rate: whole.final_rate,
        rate_window_s,
        contributions: Some(whole.contributions),
        coverage_factors: reader.mandrel.is_some().then(|| CoverageFactors {
            after_1_h: after_1_h.map(factor),
            after_3_h: after_3_h.map(factor),
            at_end: whole.drift_after_coverage_factor,
            range_last_hour: last_hour.map(|one| one.range_coverage_factor),
            range: whole.range_coverage_factor,
            final_rate: whole.final_rate_coverage_factor,
        }),
    })
}

impl Figures {
    /// Cells of a table: drift after one and three hours, range, rate in the last hour.
    pub(super) fn cells(&self, stated: bool) -> [String; 4] {
        let or_dash = |value: &Option<ExpandedLength>| {
            value
                .as_ref()
                .map_or_else(|| um(f64::NAN), |value| figure(value, stated))
        };
        [
            or_dash(&self.after_1_h),
            or_dash(&self.after_3_h),
            figure(&self.range, stated),
            rate_cell(self.final_rate, stated),
        ]
    }
}

impl Figures {
    /// Drift at the end, and range of the last hour, in a sentence.
    pub(super) fn at_end_in_words(&self, stated: bool) -> String {
        let at_end = figure(&self.at_end, stated);
        let last_hour = match &self.range_last_hour {
            Some(range) => format!("range of the last hour {} µm", figure(range, stated)),
            None => "recorded too briefly for the range of the last hour".to_owned(),
        };
        format!("Drift at the end {at_end} µm; {last_hour}.")
    }
}

/// A rate and, where it is stated, its expanded uncertainty, µm/h.
fn rate_cell(rate: ExpandedRate, stated: bool) -> String {
    let um_h = |mm_s: f64| mm_s * HOUR_S * 1e3;
    let value_um_h = um_h(rate.value_mm_s);
    if stated {
        with_u(value_um_h, um_h(rate.expanded_uncertainty_mm_s))
    } else {
        format!("{value_um_h:.2}")
    }
}

/// Names of those cells.
pub(super) const FIGURE_NAMES: [&str; 4] = [
    "after 1 h / µm",
    "after 3 h / µm",
    "range / µm",
    "last rate / µm/h",
];

#[cfg(test)]
mod tests {
    use super::*;

    const EXACT: DeviceUncertainty = DeviceUncertainty {
        expanded_uncertainty_mm: 0.0,
        expanded_uncertainty_per_length: 0.0,
        coverage_factor: 2.0,
    };

    fn found(values: &[(f64, f64)]) -> Result<Figures, Iso230Error> {
        of(
            Axis::Z,
            DriftCause::NotStated,
            values,
            &Reader::certified(EXACT),
        )
    }

    #[test]
    fn drift_is_told_after_an_hour_and_after_three_and_over_all_by_hand() {
        let values = [
            (0.0, 10.0),
            (1800.0, 9.999),
            (3700.0, 10.0085),
            (7200.0, 10.002),
            (10_800.0, 10.004),
        ];
        let found = found(&values).unwrap();
        // 3600 s lies 1800/1900 of the way from 9.999 to 10.0085.
        let after = found.after_1_h.unwrap().value_mm;
        assert!((after - 0.008).abs() < 1e-12, "{after}");
        assert!((found.after_3_h.unwrap().value_mm - 0.004).abs() < 1e-12);
        assert!((found.range.value_mm - 0.0095).abs() < 1e-12);
        assert!((found.at_end.value_mm - 0.004).abs() < 1e-12);
        // Of the last hour two readings are too few; with one between, 10.002 to 10.0055.
        assert!(found.range_last_hour.is_none());
        let values = [&values[..4], &[(9000.0, 10.005_5)], &values[4..]].concat();
        let last_hour = self::found(&values).unwrap().range_last_hour.unwrap();
        assert!((last_hour.value_mm - 0.0035).abs() < 1e-12);
        // Two readings lie in the last hour: the rate is that of the whole.
        assert!((found.rate_window_s - 10_800.0).abs() < 1e-9);
        let short = self::found(&values[..3]).unwrap();
        assert!(short.after_1_h.is_some() && short.after_3_h.is_none());
    }

    #[test]
    fn a_rate_has_its_uncertainty_where_one_is_stated() {
        let rate = ExpandedRate {
            value_mm_s: 1e-3 / HOUR_S,
            expanded_uncertainty_mm_s: 0.25e-3 / HOUR_S,
        };
        assert_eq!(rate_cell(rate, true), "1.00 ± 0.25");
        let slow = ExpandedRate {
            value_mm_s: 4e-6 / HOUR_S,
            expanded_uncertainty_mm_s: 1.2e-6 / HOUR_S,
        };
        assert_eq!(rate_cell(slow, true), "0.0040 ± 0.0012");
        assert_eq!(rate_cell(rate, false), "1.00");
    }

    #[test]
    fn what_says_nothing_is_refused_with_the_reason() {
        let two = found(&[(0.0, 1.0), (60.0, 1.001)]).unwrap_err().to_string();
        assert!(two.contains("2 points"), "{two}");
        let pause = found(&[(0.0, 1.0), (60.0, 1.0), (4000.0, 1.0)]).unwrap_err();
        assert!(matches!(pause, Iso230Error::Gap { .. }), "{pause}");
    }
}
