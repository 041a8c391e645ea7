//! What a budget states for tests of thermal drift, ISO 230-3: the test mandrel, and how the instrument's error repeats.

use std::collections::BTreeMap;

use iso230::thermal::{Artefact, ArtefactTemperature, GrowthReads};
use metrology::number::quantity;
use metrology::stamp::{Host, Span, Stamp};
use schemars::JsonSchema;
use serde::Deserialize;

use super::super::drift::Series;
use super::super::test_conditions::Thermometers;
use super::{Budget, check_range, silent, statement};

/// Longest time at either end of a log for which the nearest reading of a thermometer counts.
const LONGEST_AT_END: Span = Span::from_nanos(600_000_000_000);
/// Longest pause between readings of a thermometer across which a straight line is taken.
const LONGEST_PAUSE: Span = Span::from_nanos(3_600_000_000_000);

/// Test mandrel of ISO 230-3, between its seat in the spindle and the sensors.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mandrel {
    /// Length between its seat and the sensor along Z, which a displacement along Z has in it.
    length_mm: f64,
    /// Coefficient of expansion.
    expansion_um_per_m_k: f64,
    /// Greatest minus least temperature of it during a test, where it is stated: its growth widens U as a bound.
    #[serde(default)]
    temperature_range_k: Option<f64>,
    /// Thermometers of the bag whose mean is its temperature, where it is read: its growth is taken out.
    #[serde(default)]
    thermometers: Vec<String>,
    /// Half of the interval in which the error of that mean lies, but for what stays the same; with `thermometers`.
    #[serde(default)]
    temperature_half_width_k: Option<f64>,
    /// Half of the interval in which the coefficient lies; with `thermometers`.
    #[serde(default)]
    expansion_half_width_um_per_m_k: Option<f64>,
    /// Whether the displacement along Z reads less (as along Z+) or more while the mandrel grows; with `thermometers`.
    #[serde(default)]
    growth_reads: Option<GrowthReads>,
}

/// What the thermometers of a bag read while displacements were logged.
#[derive(Clone, Copy, Debug)]
pub struct Meanwhile<'a> {
    /// Instants of the displacements, in their order.
    pub at: &'a [Stamp<Host>],
    /// What is known of each thermometer during the run.
    pub during: &'a Thermometers,
    /// Their readings, °C.
    pub temperatures: &'a BTreeMap<String, Series>,
}

impl Meanwhile<'_> {
    /// Readings of one thermometer at the instants, by straight lines between its own, °C.
    ///
    /// # Errors
    /// Why they do not cover the instants.
    fn degc(&self, name: &str) -> Result<Vec<f64>, String> {
        let silent = || silent(name, self.during);
        let known = self.during.get(name).ok_or_else(silent)?;
        check_range(name, known, "temperature_range_k")?;
        let (Some(from), Some(to)) = (self.at.first(), self.at.last()) else {
            return Ok(Vec::new());
        };
        let series = self.temperatures.get(name).ok_or_else(silent)?;
        let readings = series.between(*from - LONGEST_PAUSE, *to + LONGEST_PAUSE);
        let (Some((first, _)), Some((last, _))) = (readings.first(), readings.last()) else {
            return Err(silent());
        };
        let begins_late = *first > *from + LONGEST_AT_END;
        if begins_late || *last < *to - LONGEST_AT_END {
            let (which, end, far) = if begins_late {
                ("first", "begin", *first - *from)
            } else {
                ("last", "end", *to - *last)
            };
            return Err(format!(
                "names the thermometer {name}, whose {which} reading is {:.0} min from the {end} of the log: must be at most 10 min; read it during the whole test",
                far.as_secs_f64() / 60.0
            ));
        }
        let is_within = |pair: &&[(Stamp<Host>, f64)]| {
            pair[1].0 > *from + LONGEST_AT_END && pair[0].0 < *to - LONGEST_AT_END
        };
        let pauses = { readings.windows(2).filter(is_within) }.map(|pair| pair[1].0 - pair[0].0);
        if let Some(pause) = pauses.max().filter(|pause| *pause > LONGEST_PAUSE) {
            return Err(format!(
                "names the thermometer {name}, which was not read for {:.0} min: must be at most 60 min; read it during the whole test",
                pause.as_secs_f64() / 60.0
            ));
        }
        Ok(self.at.iter().map(|at| between(readings, *at)).collect())
    }
}

/// By the straight line between the readings beside an instant; the nearest one before the first and behind the last.
fn between(readings: &[(Stamp<Host>, f64)], at: Stamp<Host>) -> f64 {
    let after = readings.partition_point(|(time, _)| *time < at);
    let later = readings.get(after);
    let earlier = after.checked_sub(1).and_then(|before| readings.get(before));
    match (earlier, later) {
        (Some((t0, degc0)), Some((t1, degc1))) => {
            let share = (at - *t0).as_secs_f64() / (*t1 - *t0).as_secs_f64();
            degc0 + share * (degc1 - degc0)
        }
        (Some((_, degc)), None) | (None, Some((_, degc))) => *degc,
        (None, None) => f64::NAN,
    }
}

impl Mandrel {
    /// Its growth while displacements were logged.
    ///
    /// # Errors
    /// Why its temperature is unknown.
    fn during(&self, meanwhile: Meanwhile) -> Result<Artefact, String> {
        let known = |half_width: Option<f64>| half_width.unwrap_or(0.0);
        Ok(Artefact {
            length_mm: self.length_mm,
            expansion_per_k: self.expansion_um_per_m_k * 1e-6,
            expansion_half_width_per_k: known(self.expansion_half_width_um_per_m_k) * 1e-6,
            temperature: match self.temperature_range_k {
                Some(range_k) => ArtefactTemperature::Range { range_k },
                None => ArtefactTemperature::Read {
                    degc: self.mean_degc(meanwhile)?,
                    half_width_k: known(self.temperature_half_width_k),
                    growth_reads: self.growth_reads.unwrap_or(GrowthReads::Less),
                },
            },
        })
    }

    /// Mean of its thermometers at every displacement, °C.
    fn mean_degc(&self, meanwhile: Meanwhile) -> Result<Vec<f64>, String> {
        let mut mean_degc = vec![0.0; meanwhile.at.len()];
        for name in &self.thermometers {
            let degc = meanwhile.degc(name)?;
            let share = 1.0 / self.thermometers.len() as f64;
            let sums = mean_degc.iter_mut().zip(degc);
            sums.for_each(|(sum, degc)| *sum += share * degc);
        }
        Ok(mean_degc)
    }

    /// The numbers by their keys.
    fn numbers(&self) -> impl Iterator<Item = (&'static str, f64)> {
        let all = [
            ("mandrel.length_mm", Some(self.length_mm)),
            (
                "mandrel.expansion_um_per_m_k",
                Some(self.expansion_um_per_m_k),
            ),
            ("mandrel.temperature_range_k", self.temperature_range_k),
            (
                "mandrel.temperature_half_width_k",
                self.temperature_half_width_k,
            ),
            (
                "mandrel.expansion_half_width_um_per_m_k",
                self.expansion_half_width_um_per_m_k,
            ),
        ];
        all.into_iter()
            .filter_map(|(key, value)| Some((key, value?)))
    }

    /// Refuses a temperature that has two sources or none, and what does not belong to its source.
    fn check(&self) -> Result<(), String> {
        if let Some(reason) = statement::unit_slip(self.expansion_um_per_m_k) {
            return Err(format!("mandrel.expansion_um_per_m_k{reason}"));
        }
        let of_readings = [
            (
                "temperature_half_width_k",
                self.temperature_half_width_k.is_some(),
                "half of the interval in which the error of the thermometers' mean lies",
            ),
            (
                "expansion_half_width_um_per_m_k",
                self.expansion_half_width_um_per_m_k.is_some(),
                "half of the interval in which the coefficient lies",
            ),
            (
                "growth_reads",
                self.growth_reads.is_some(),
                "less where the displacement counts along Z+, more where the sensor counts what approaches it",
            ),
        ];
        match (self.temperature_range_k, self.thermometers.is_empty()) {
            (Some(_), false) => Err(
                "mandrel.temperature_range_k: leave it out where thermometers are named, they read it".to_owned(),
            ),
            (None, true) => {
                Err("mandrel has neither temperature_range_k nor thermometers".to_owned())
            }
            (None, false) => match of_readings.iter().find(|(_, is_stated, _)| !is_stated) {
                Some((key, _, meaning)) => Err(format!(
                    "mandrel.{key} is not stated: thermometers need it to take the growth out; state {meaning}"
                )),
                None => Ok(()),
            },
            (Some(_), true) => match of_readings.iter().find(|(_, is_stated, _)| *is_stated) {
                Some((key, ..)) => Err(format!(
                    "mandrel.{key}: leave it out beside temperature_range_k, or name thermometers instead of the range"
                )),
                None => Ok(()),
            },
        }
    }
}

impl Budget {
    /// The mandrel while displacements were logged; none where the budget states none.
    ///
    /// # Errors
    /// Why its temperature is unknown.
    pub fn mandrel(&self, meanwhile: Meanwhile) -> Result<Option<Artefact>, String> {
        self.mandrel
            .as_ref()
            .map(|one| one.during(meanwhile))
            .transpose()
    }

    /// Names of the thermometers that read the mandrel.
    #[must_use]
    pub fn thermometers_of_mandrel(&self) -> &[String] {
        { self.mandrel.as_ref() }.map_or(&[], |mandrel| &mandrel.thermometers)
    }

    /// Period of the length reference's error over the displacement, where it is stated, mm.
    #[must_use]
    pub fn length_error_period_mm(&self) -> Option<f64> {
        self.length_error_period_um.map(|um| um * 1e-3)
    }

    /// The numbers for drift tests by their keys.
    pub(super) fn numbers_of_drift_test(&self) -> Vec<(&'static str, f64)> {
        let period = self.length_error_period_um;
        { period.into_iter() }
            .map(|um| ("length_error_period_um", um))
            .chain(self.mandrel.iter().flat_map(Mandrel::numbers))
            .collect()
    }

    /// Refuses a period of 0, and a mandrel whose growth cannot be known so.
    pub(super) fn check_drift_test(&self) -> Result<(), String> {
        if let Some(period_um) = self.length_error_period_um.filter(|um| *um <= 0.0) {
            let period = quantity("_um", period_um);
            return Err(format!(
                "length_error_period_um = {period}: must be above 0"
            ));
        }
        self.mandrel.as_ref().map_or(Ok(()), Mandrel::check)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::super::test_conditions::Readings;
    use super::super::tests::WHOLE;
    use super::*;

    fn read(more: &str) -> anyhow::Result<Budget> {
        Budget::read(&format!("{WHOLE}{more}\n"), Path::new("budget.yaml"))
    }

    /// A reading every 10 min, of a run that lasts this long.
    fn instants(minutes: i64) -> Vec<Stamp<Host>> {
        (0..=minutes / 10).map(|k| minute(10 * k)).collect()
    }

    fn minute(minute: i64) -> Stamp<Host> {
        Stamp::from_nanos(60_000_000_000 * minute)
    }

    /// Thermometers by their readings (min, °C).
    fn thermometers(of: &[(&str, &[(i64, f64)])]) -> (Thermometers, BTreeMap<String, Series>) {
        let (mut during, mut temperatures) = (Thermometers::new(), BTreeMap::new());
        for (name, readings) in of {
            let mut series = Series::default();
            let mut known = Readings::new(readings[0].1);
            for (at, degc) in *readings {
                series.push(minute(*at), *degc);
                known.add(*degc);
            }
            during.insert((*name).to_owned(), known);
            temperatures.insert((*name).to_owned(), series);
        }
        (during, temperatures)
    }

    const READ: &str = "mandrel: {length_mm: 250.0, expansion_um_per_m_k: 11.5, thermometers: [top, end], temperature_half_width_k: 0.2, expansion_half_width_um_per_m_k: 1.0, growth_reads: less}";

    fn mandrel(
        text: &str,
        minutes: i64,
        of: &[(&str, &[(i64, f64)])],
    ) -> Result<Option<Artefact>, String> {
        let (during, temperatures) = thermometers(of);
        read(text).unwrap().mandrel(Meanwhile {
            at: &instants(minutes),
            during: &during,
            temperatures: &temperatures,
        })
    }

    #[test]
    fn a_mandrel_is_as_warm_as_it_is_stated_or_read_by_hand() {
        assert_eq!(mandrel("", 60, &[]), Ok(None));
        let stated =
            "mandrel: {length_mm: 250.0, expansion_um_per_m_k: 1.5, temperature_range_k: 2.0}";
        let found = mandrel(stated, 60, &[]).unwrap().unwrap();
        assert_eq!(
            found,
            Artefact {
                length_mm: 250.0,
                expansion_per_k: 1.5 * 1e-6,
                expansion_half_width_per_k: 0.0,
                temperature: ArtefactTemperature::Range { range_k: 2.0 },
            }
        );
        // Lines from 20 to 23 and from 20 to 21 °C over an hour, the second one from 6 min before to 6 min behind.
        let (top, end) = (
            [(0, 20.0), (30, 21.5), (60, 23.0)],
            [(-6, 20.0), (30, 20.6), (66, 21.2)],
        );
        let found = mandrel(READ, 60, &[("top", &top), ("end", &end)]);
        let found = found.unwrap().unwrap();
        assert!((found.expansion_half_width_per_k - 1e-6).abs() < 1e-18);
        let ArtefactTemperature::Read {
            degc,
            half_width_k,
            growth_reads,
        } = found.temperature
        else {
            panic!("{found:?}")
        };
        assert_eq!((half_width_k, growth_reads), (0.2, GrowthReads::Less));
        assert_eq!(degc.len(), 7);
        for (k, degc) in degc.iter().enumerate() {
            let minute = 10.0 * k as f64;
            let by_hand = f64::midpoint(20.0 + minute / 20.0, 20.1 + minute / 60.0);
            assert!((degc - by_hand).abs() < 1e-9, "{k}: {degc} {by_hand}");
        }
    }

    #[test]
    fn a_thermometer_that_does_not_cover_the_log_is_named_with_the_pause() {
        let whole: &[(i64, f64)] = &[(0, 20.0), (60, 20.1), (120, 20.2), (180, 20.3)];
        for (end, words) in [
            (&[][..], "thermometer end, which has no reading"),
            (
                &[(11, 20.0), (180, 21.0)],
                "first reading is 11 min from the begin",
            ),
            (
                &[(0, 20.0), (169, 21.0)],
                "last reading is 11 min from the end",
            ),
            (&[(0, 20.0), (90, 20.5), (180, 21.0)], "not read for 90 min"),
            (
                &[(0, 20.0), (90, 90.0), (180, 21.0)],
                "state temperature_range_k instead",
            ),
            (&[(-300, 20.0), (181, 21.0)], "first reading is 181 min"),
        ] {
            let mut all = vec![("top", whole)];
            all.extend((!end.is_empty()).then_some(("end", end)));
            let error = mandrel(READ, 180, &all).unwrap_err();
            assert!(error.contains(words), "{error}: {words}");
        }
        // The nearest reading counts for 10 min, and what was read long before the log does no harm.
        let late: &[(i64, f64)] = &[
            (-59, 25.0),
            (10, 20.0),
            (60, 20.0),
            (115, 20.0),
            (170, 20.0),
        ];
        let all = [("top", whole), ("end", late)];
        assert!(mandrel(READ, 180, &all).is_ok());
    }

    #[test]
    fn what_cannot_be_of_a_mandrel_or_a_period_is_refused_with_the_key() {
        for (more, words) in [
            ("length_error_period_um: 0.0", "length_error_period_um = 0"),
            (
                "mandrel: {length_mm: 250.0, expansion_um_per_m_k: 1.5}",
                "neither",
            ),
            (
                "mandrel: {length_mm: 250.0, expansion_um_per_m_k: 1.5, temperature_range_k: 1.0, thermometers: [a]}",
                "leave it out",
            ),
            (
                "mandrel: {length_mm: 250.0, expansion_um_per_m_k: 11.5, thermometers: [a]}",
                "mandrel.temperature_half_width_k is not stated",
            ),
            (
                "mandrel: {length_mm: 250.0, expansion_um_per_m_k: 11.5, thermometers: [a], temperature_half_width_k: 0.2, growth_reads: more}",
                "mandrel.expansion_half_width_um_per_m_k is not stated",
            ),
            (
                "mandrel: {length_mm: 250.0, expansion_um_per_m_k: 11.5, thermometers: [a], temperature_half_width_k: 0.2, expansion_half_width_um_per_m_k: 1.0}",
                "mandrel.growth_reads is not stated",
            ),
            (
                "mandrel: {length_mm: 250.0, expansion_um_per_m_k: 11.5, temperature_range_k: 1.0, temperature_half_width_k: 0.2}",
                "mandrel.temperature_half_width_k: leave it out beside temperature_range_k",
            ),
            (
                "mandrel: {length_mm: 250.0, expansion_um_per_m_k: 11.5, temperature_range_k: 1.0, expansion_half_width_um_per_m_k: 1.0}",
                "mandrel.expansion_half_width_um_per_m_k: leave it out",
            ),
            (
                "mandrel: {length_mm: 250.0, expansion_um_per_m_k: 11.5, temperature_range_k: 1.0, growth_reads: less}",
                "mandrel.growth_reads: leave it out",
            ),
            (
                "mandrel: {length_mm: 250.0, expansion_um_per_m_k: 11.5, thermometers: [a], temperature_half_width_k: -0.2, expansion_half_width_um_per_m_k: 1.0, growth_reads: less}",
                "mandrel.temperature_half_width_k = -0.2 K: must be from 0 to 100 K",
            ),
            (
                "mandrel: {length_mm: 250.0, expansion_um_per_m_k: 11.5e-6, temperature_range_k: 1.0}",
                "mandrel.expansion_um_per_m_k = 0.0000115: must be 0, or from 0.02",
            ),
            (
                "mandrel: {length_mm: 1250.0, expansion_um_per_m_k: 1.5, temperature_range_k: 1.0}",
                "mandrel.length_mm = 1250 mm: must be from 0 to 1000 mm",
            ),
            (
                "screws: {A: {temperature_deviation_k: 0.0, temperature_half_width_k: 0.5, expansion_um_per_m_k: 11.0, expansion_half_width_um_per_m_k: 1.0}}",
                "screws.A: must be a linear axis",
            ),
            (
                "screws: {X: {temperature_deviation_k: 0.0, temperature_half_width_k: 500.0, expansion_um_per_m_k: 11.0, expansion_half_width_um_per_m_k: 1.0}}",
                "screws.X.temperature_half_width_k = 500 K: must be from 0 to 100 K",
            ),
        ] {
            let error = format!("{:#}", read(more).unwrap_err());
            assert!(error.contains(words), "{more}: {error}");
        }
    }
}
