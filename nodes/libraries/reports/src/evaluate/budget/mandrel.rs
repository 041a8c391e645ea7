//! What a budget states for tests of thermal drift, ISO 230-3: the test mandrel, and how the instrument's error repeats.

use metrology::number::quantity;
use schemars::JsonSchema;
use serde::Deserialize;

use super::super::test_conditions::Thermometers;
use super::Budget;

/// Test mandrel of ISO 230-3, between its seat in the spindle and the sensors.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mandrel {
    /// Length between its seat and the sensor along Z, which a displacement along Z has in it.
    length_mm: f64,
    /// Coefficient of expansion.
    expansion_um_per_m_k: f64,
    /// Greatest minus least temperature of it during a test, where it is stated.
    #[serde(default)]
    temperature_range_k: Option<f64>,
    /// Thermometers of the bag whose mean range is that of its temperature, where it is read.
    #[serde(default)]
    thermometers: Vec<String>,
}

/// A mandrel during one test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MandrelGrowth {
    /// Length, mm.
    pub length_mm: f64,
    /// Coefficient of expansion, 1/K.
    pub expansion_per_k: f64,
    /// Range of its temperature, K.
    pub temperature_range_k: f64,
}

impl MandrelGrowth {
    /// One that does not grow.
    pub const NONE: Self = Self {
        length_mm: 0.0,
        expansion_per_k: 0.0,
        temperature_range_k: 0.0,
    };
}

impl Mandrel {
    /// As `read` has its temperature during a test.
    ///
    /// # Errors
    /// Why it is unknown.
    fn during(&self, read: &Thermometers) -> Result<MandrelGrowth, String> {
        let mut range_k = self.temperature_range_k.unwrap_or(0.0);
        for name in &self.thermometers {
            let silent = || {
                format!(
                    "`mandrel` names the thermometer {name}, which has no reading during this test"
                )
            };
            let readings = read.get(name).ok_or_else(silent)?;
            range_k += readings.range_k() / self.thermometers.len() as f64;
        }
        Ok(MandrelGrowth {
            length_mm: self.length_mm,
            expansion_per_k: self.expansion_um_per_m_k * 1e-6,
            temperature_range_k: range_k,
        })
    }
}

impl Budget {
    /// The mandrel while `read` was the temperature; none where the budget states none.
    ///
    /// # Errors
    /// Why its temperature is unknown.
    pub fn mandrel(&self, read: &Thermometers) -> Result<Option<MandrelGrowth>, String> {
        self.mandrel
            .as_ref()
            .map(|one| one.during(read))
            .transpose()
    }

    /// Period of the length reference's error over the displacement, where it is stated, mm.
    #[must_use]
    pub fn length_error_period_mm(&self) -> Option<f64> {
        self.length_error_period_um.map(|um| um * 1e-3)
    }

    /// The numbers for drift tests by their keys.
    pub(super) fn numbers_of_drift_test(&self) -> Vec<(&'static str, f64)> {
        let period = self.length_error_period_um;
        let mut numbers: Vec<_> = period
            .map(|um| ("length_error_period_um", um))
            .into_iter()
            .collect();
        if let Some(mandrel) = &self.mandrel {
            numbers.push(("mandrel.length_mm", mandrel.length_mm));
            numbers.push(("mandrel.expansion_um_per_m_k", mandrel.expansion_um_per_m_k));
            let range_k = mandrel.temperature_range_k;
            numbers.extend(range_k.map(|k| ("mandrel.temperature_range_k", k)));
        }
        numbers
    }

    /// Refuses a period of 0, and a mandrel whose temperature has two sources or none.
    pub(super) fn check_drift_test(&self) -> Result<(), String> {
        if let Some(period_um) = self.length_error_period_um.filter(|um| *um <= 0.0) {
            let period = quantity("_um", period_um);
            return Err(format!(
                "length_error_period_um = {period}: must be above 0"
            ));
        }
        let Some(mandrel) = &self.mandrel else {
            return Ok(());
        };
        match (mandrel.temperature_range_k, mandrel.thermometers.is_empty()) {
            (Some(_), false) => Err(
                "mandrel.temperature_range_k: leave it out where thermometers are named, they read it".to_owned(),
            ),
            (None, true) => {
                Err("mandrel has neither temperature_range_k nor thermometers".to_owned())
            }
            _ => Ok(()),
        }
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

    #[test]
    fn a_mandrel_is_as_warm_as_it_is_stated_or_read() {
        let none = Thermometers::new();
        assert_eq!(read("").unwrap().mandrel(&none), Ok(None));
        let stated =
            "mandrel: {length_mm: 250.0, expansion_um_per_m_k: 1.5, temperature_range_k: 2.0}";
        let found = read(stated).unwrap().mandrel(&none).unwrap().unwrap();
        assert_eq!((found.length_mm, found.temperature_range_k), (250.0, 2.0));
        assert!((found.expansion_per_k - 1.5e-6).abs() < 1e-18);
        let by_two =
            "mandrel: {length_mm: 250.0, expansion_um_per_m_k: 1.5, thermometers: [top, end]}";
        let budget = read(by_two).unwrap();
        assert!(
            budget
                .mandrel(&none)
                .unwrap_err()
                .contains("thermometer top")
        );
        let mut all = Thermometers::new();
        for (name, last_degc) in [("top", 23.0), ("end", 21.0)] {
            let mut readings = Readings::new(20.0);
            readings.add(last_degc);
            all.insert(name.to_owned(), readings);
        }
        // Ranges of 3 and 1 K: 2 K.
        let found = budget.mandrel(&all).unwrap().unwrap();
        assert!((found.temperature_range_k - 2.0).abs() < 1e-12);
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
