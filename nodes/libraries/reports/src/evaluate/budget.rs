//! What is stated about the measurements of a bag: `budget.yaml`, in the units of data sheets.
//!
//! Nothing uncertain in it has a default: a term that is left out would be an uncertainty of zero. What the tests of a bag do
//! not use may be absent; [`Budget::check_tests`] names what they lack. Temperatures may be stated or read from thermometers of
//! the bag; without them lengths are not corrected to 20 °C.

use std::collections::BTreeMap;
use std::path::Path;

use abbe_msgs::topics;
use anyhow::{Context, Result, anyhow};
use iso230::budget::{DeviceUncertainty, Expansion};
use iso230::circular::CircularBudget;
use iso230::positioning::budget::PositioningBudget;
use iso230::positioning::rotary::RotaryBudget;
use metrology::Axis;
use metrology::number::{number, quantity};
use metrology::yaml;
use node_runtime::text_file;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Value;

mod ballbar;
mod mandrel;
mod needs;
mod nothing;
mod numbers;
mod screw;
mod statement;
#[cfg(test)]
mod tests;

use super::test_conditions::{Readings, Thermometers};
pub use ballbar::Ballbar;
pub use mandrel::{Mandrel, Meanwhile};
use nothing::{NO_BODY, NO_DEVICE};
pub use statement::{Instrument, Instruments, NOT_STATED};

/// Figures that had no budget to be computed from have no expanded uncertainty, not one of zero.
pub fn unstate(figures: &mut Value) {
    match figures {
        Value::Object(entries) => {
            for (key, value) in entries {
                if key.starts_with("expanded_uncertainty") {
                    *value = Value::Null;
                } else {
                    unstate(value);
                }
            }
        }
        Value::Array(values) => values.iter_mut().for_each(unstate),
        _ => {}
    }
}

/// The same for the figures of these names alone.
pub fn unstate_named(figures: &mut Value, names: &[&str]) {
    match figures {
        Value::Object(entries) => {
            for (key, value) in entries {
                if names.contains(&key.as_str()) {
                    unstate(value);
                } else {
                    unstate_named(value, names);
                }
            }
        }
        Value::Array(values) => {
            for value in values {
                unstate_named(value, names);
            }
        }
        _ => {}
    }
}

/// Temperature at which lengths are defined, °C.
const REFERENCE_DEGC: f64 = 20.0;
/// Farthest from it that a machine is measured, K.
const FARTHEST_K: f64 = 100.0;
/// The same of a thermometer during a test, K: further off it reads another unit, or something else than the body.
const FARTHEST_READ_K: f64 = 30.0;
/// The largest that can be stated, by the unit that a key ends with: the longest first. Beyond it the unit is mistaken.
const GREATEST: [(&str, f64); 8] = [
    (".length_mm", 1000.0),
    ("_um_per_m_k", 100.0),
    ("_um_per_m", 1e4),
    ("_um", 1e4),
    ("_mm", 100.0),
    ("_arcsec", 3600.0),
    ("_urad", 1000.0),
    ("_k", FARTHEST_K),
];
/// Coverage factors: 1 of a standard uncertainty, 12.7 of one degree of freedom at 95 % (GUM, table G.2).
const FACTORS: [f64; 2] = [1.0, 13.0];

/// Uncertainty of a measuring device, as its certificate states it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Device {
    /// Constant part.
    expanded_uncertainty_um: f64,
    /// Part that grows with the length.
    expanded_uncertainty_um_per_m: f64,
    /// Coverage factor of both.
    coverage_factor: f64,
}

/// Temperature and expansion of a body.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Temperature minus 20 °C, where it is stated.
    #[serde(default)]
    temperature_deviation_k: Option<f64>,
    /// Thermometers of the bag whose mean is its temperature, where it is read.
    #[serde(default)]
    thermometers: Vec<String>,
    /// Half of the interval in which the temperature lies.
    temperature_half_width_k: f64,
    /// Coefficient of expansion.
    expansion_um_per_m_k: f64,
    /// Half of the interval in which the coefficient lies.
    expansion_half_width_um_per_m_k: f64,
}

/// Angular reference of rotary axes, as its certificate states it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Angular {
    /// Expanded uncertainty.
    expanded_uncertainty_arcsec: f64,
    /// Its coverage factor.
    coverage_factor: f64,
    /// Range of a reading with the axis at rest, as long as a test takes.
    environmental_drift_arcsec: f64,
    /// Standard deviation of such readings from one to the next; without it all drift counts as new at every reading.
    #[serde(default)]
    environmental_unrest_arcsec: Option<f64>,
}

/// `budget.yaml`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Budget {
    /// Plate and head; circles by them need it.
    #[serde(default)]
    grid_encoder: Option<Device>,
    /// Interferometer, tracker or step gauge; tests of positioning, diagonals and logs by them need it.
    #[serde(default)]
    length_reference: Option<Device>,
    /// Ballbar, for circles; where absent, what it read has no uncertainty.
    #[serde(default)]
    ballbar: Option<Ballbar>,
    /// The machine, or the workpiece that lengths are corrected to; lengths, circles and artefacts with a certificate need it.
    #[serde(default)]
    machine: Option<Body>,
    /// Ball screws of axes: they carry the positions where the motor encoder leads alone, in place of the machine.
    #[serde(default)]
    screws: BTreeMap<Axis, Body>,
    /// The device's own body, coefficient 0 for an interferometer; lengths need it.
    #[serde(default)]
    device: Option<Body>,
    /// The plate of the grid encoder; where absent, radii of its circles are not corrected to 20 °C.
    #[serde(default)]
    plate: Option<Body>,
    /// Expanded uncertainty (k = 2) of the angle between the plate's axes; where absent, U of a squareness lacks it.
    #[serde(default)]
    plate_squareness_urad: Option<f64>,
    /// By how much beam and axis can part sideways over the measured length; lengths need it.
    #[serde(default)]
    misalignment_mm: Option<f64>,
    /// Range of a reading with the axes at rest, as long as a test takes; all but logs and rotary axes need it.
    #[serde(default)]
    environmental_drift_um: Option<f64>,
    /// Standard deviation of such readings from one to the next; without it all drift counts as new at every reading.
    #[serde(default)]
    environmental_unrest_um: Option<f64>,
    /// Period of the length reference's error over the displacement, for rates of ISO 230-3; without it the errors at both ends of
    /// the window count as independent.
    #[serde(default)]
    length_error_period_um: Option<f64>,
    /// Test mandrel of ISO 230-3; where absent, its growth counts as drift of the machine.
    #[serde(default)]
    mandrel: Option<Mandrel>,
    /// For rotary axes; where absent, their figures have no uncertainty.
    #[serde(default)]
    angular_reference: Option<Angular>,
    /// Whether the length reference corrects its own readings to 20 °C: material compensation on.
    #[serde(default)]
    pub length_corrected_by_instrument: bool,
    /// The instruments and their certificates.
    #[serde(default)]
    pub instruments: Instruments,
    /// Who measured.
    #[serde(default)]
    pub operator: Option<String>,
    /// What the machine did before.
    #[serde(default)]
    pub warm_up: Option<String>,
}

impl Device {
    fn inner(&self) -> DeviceUncertainty {
        DeviceUncertainty {
            expanded_uncertainty_mm: self.expanded_uncertainty_um * 1e-3,
            expanded_uncertainty_per_length: self.expanded_uncertainty_um_per_m * 1e-6,
            coverage_factor: self.coverage_factor,
        }
    }
}

/// Temperature of a body during a test.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyTemperature {
    /// Temperature minus 20 °C, K.
    pub deviation_k: f64,
    /// Half of the interval in which it lies, K.
    pub half_width_k: f64,
    /// Greatest minus least reading during the test, K; none where it is stated.
    pub range_k: Option<f64>,
    /// Where it is from.
    pub source: String,
}

impl Body {
    /// What stands under `temperature_deviation_k`, or the mean of the thermometers over a test; the half width grows by half
    /// the range of their mean, as a root of squares.
    ///
    /// All runs of a test have this one temperature: a run of its own would bring the scatter of its thermometers into the
    /// repeatability of the axis.
    ///
    /// # Errors
    /// Why it is unknown.
    pub fn temperature(&self, read: &Thermometers) -> Result<BodyTemperature, String> {
        let stated = |source: &str, deviation_k| BodyTemperature {
            deviation_k,
            half_width_k: self.temperature_half_width_k,
            range_k: None,
            source: source.to_owned(),
        };
        if let Some(deviation_k) = self.temperature_deviation_k {
            return Ok(stated("stated in the budget", deviation_k));
        }
        if !self.expands() {
            return Ok(stated("does not expand", 0.0));
        }
        if self.thermometers.is_empty() {
            return Err("has neither temperature_deviation_k nor thermometers".to_owned());
        }
        let mut all = Vec::new();
        for name in &self.thermometers {
            let readings = read.get(name).ok_or_else(|| silent(name, read))?;
            check_range(name, readings, "temperature_deviation_k")?;
            all.push(readings);
        }
        let n = all.len() as f64;
        let mean = |of: fn(&Readings) -> f64| all.iter().map(|one| of(one)).sum::<f64>() / n;
        let range_k = mean(|one| one.range_k());
        Ok(BodyTemperature {
            deviation_k: mean(|one| one.mean_degc()) - REFERENCE_DEGC,
            half_width_k: self.temperature_half_width_k.hypot(range_k / 2.0),
            range_k: Some(range_k),
            source: format!("read by {}", self.thermometers.join(", ")),
        })
    }

    fn expands(&self) -> bool {
        self.expansion_um_per_m_k > 0.0 || self.expansion_half_width_um_per_m_k > 0.0
    }

    /// Refuses a temperature out of range, or one from two sources: key and rule.
    fn check(&self) -> Result<(), (&'static str, String)> {
        if let Some(reason) = statement::unit_slip(self.expansion_um_per_m_k) {
            return Err(("expansion_um_per_m_k", reason));
        }
        let Some(deviation_k) = self.temperature_deviation_k else {
            return Ok(());
        };
        let key = "temperature_deviation_k";
        if !deviation_k.is_finite() || deviation_k.abs() > FARTHEST_K {
            let value = quantity(key, deviation_k);
            return Err((
                key,
                format!(" = {value}: must be from -{FARTHEST_K} to {FARTHEST_K} K"),
            ));
        }
        if !self.thermometers.is_empty() {
            let rule = ": leave it out where thermometers are named, they read it".to_owned();
            return Err((key, rule));
        }
        Ok(())
    }

    /// Coefficient of expansion, 1/K.
    pub fn expansion_per_k(&self) -> f64 {
        self.expansion_um_per_m_k * 1e-6
    }

    /// With its temperature, where that is known.
    pub fn at(&self, temperature: Option<&BodyTemperature>) -> Expansion {
        let inner = self.inner();
        temperature.map_or(inner, |known| Expansion {
            temperature_deviation_k: known.deviation_k,
            temperature_half_width_k: known.half_width_k,
            ..inner
        })
    }

    fn inner(&self) -> Expansion {
        Expansion {
            temperature_deviation_k: self.temperature_deviation_k.unwrap_or(0.0),
            temperature_half_width_k: self.temperature_half_width_k,
            expansion_per_k: self.expansion_um_per_m_k * 1e-6,
            expansion_half_width_per_k: self.expansion_half_width_um_per_m_k * 1e-6,
        }
    }
}

/// Why a thermometer that a budget names tells nothing of a test.
fn silent(name: &str, read: &Thermometers) -> String {
    let names: Vec<&str> = read.keys().map(String::as_str).collect();
    let read = if names.is_empty() {
        "no thermometer was read".to_owned()
    } else {
        format!("read were {}", names.join(", "))
    };
    format!("names the thermometer {name}, which has no reading during this test; {read}")
}

/// Refuses a thermometer that stopped to measure, or reads what no budget may state; `key` would state its body's temperature.
fn check_range(name: &str, readings: &Readings, key: &str) -> Result<(), String> {
    if let Some(dead) = readings.dead {
        return Err(format!("names a dead thermometer: {}", dead.in_words(name)));
    }
    let [low, high] = [-FARTHEST_READ_K, FARTHEST_READ_K].map(|off_k| REFERENCE_DEGC + off_k);
    let both = [readings.least_degc, readings.greatest_degc];
    let wrong = both.into_iter().find(|degc| !(low..=high).contains(degc));
    wrong.map_or(Ok(()), |degc| {
        Err(format!(
            "names the thermometer {name}, and {}{name} read {} °C during this test: must be from {low} to {high} °C; is it in K or °F? Where the body was as warm, state {key} instead",
            topics::TEMPERATURE.base,
            number(degc),
        ))
    })
}

/// The largest value of a key; none where its unit has no limit.
fn greatest(key: &str) -> f64 {
    let of_unit = GREATEST.iter().find(|(unit, _)| key.ends_with(unit));
    of_unit.map_or(f64::MAX, |(_, greatest)| *greatest)
}

impl Budget {
    /// Reads a budget file.
    ///
    /// # Errors
    /// When it cannot be opened, or as [`Self::read`].
    pub fn open(path: &Path) -> Result<Self> {
        let text = text_file::yaml(path).context("budget file")?;
        Self::read(&text, path)
    }

    /// Reads the text of a budget file; `place` names it in errors.
    ///
    /// # Errors
    /// With key and value where one is missing, unknown or no number above zero where it must be.
    pub fn read(text: &str, place: &Path) -> Result<Self> {
        let file = place.display().to_string();
        let wrong = |message: &str| anyhow!("budget file {}", yaml::placed(&file, text, message));
        let budget: Self = yaml::read(text).map_err(|error| wrong(&error.to_string()))?;
        let angular = budget.angular_reference.as_ref();
        let factor_of = |device: Option<Device>| device.map(|device| device.coverage_factor);
        let factors = [
            ("grid_encoder", factor_of(budget.grid_encoder)),
            ("length_reference", factor_of(budget.length_reference)),
            ("angular_reference", angular.map(|one| one.coverage_factor)),
        ];
        let of_ballbar = budget.ballbar.iter().flat_map(Ballbar::factors);
        for (key, factor) in factors.into_iter().chain(of_ballbar) {
            let factor = factor.unwrap_or(1.0);
            let [least, greatest] = FACTORS;
            if !(least..=greatest).contains(&factor) {
                let factor = number(factor);
                let key = format!("{key}.coverage_factor");
                return Err(wrong(&format!(
                    "{key} = {factor}: must be from {least} to {greatest}"
                )));
            }
        }
        for (key, value) in budget.numbers() {
            let greatest = greatest(key);
            if !(0.0..=greatest).contains(&value) {
                let [value, greatest] = [value, greatest].map(|one| quantity(key, one));
                return Err(wrong(&format!(
                    "{key} = {value}: must be from 0 to {greatest}"
                )));
            }
        }
        let plate = budget.plate.as_ref().map(|plate| ("plate", plate));
        let bodies = [
            ("machine", budget.machine.as_ref()),
            ("device", budget.device.as_ref()),
        ];
        let bodies = bodies
            .into_iter()
            .filter_map(|(key, body)| Some((key, body?)));
        let ballbar = budget.ballbar.as_ref().and_then(Ballbar::body);
        let own = ballbar.map(|body| ("ballbar.body", body));
        for (key, body) in bodies.chain(plate).chain(own) {
            body.check()
                .map_err(|(name, rule)| wrong(&format!("{key}.{name}{rule}")))?;
        }
        budget.check_screws().map_err(|rule| wrong(&rule))?;
        budget.check_drift_test().map_err(|rule| wrong(&rule))?;
        for (key, text) in budget.texts() {
            statement::check(&key, text).map_err(|message| wrong(&message))?;
        }
        Ok(budget)
    }

    fn texts(&self) -> Vec<(String, &str)> {
        let own = [("operator", &self.operator), ("warm_up", &self.warm_up)];
        let own = own.map(|(key, text)| (key.to_owned(), text.as_deref()));
        let all = own.into_iter().chain(self.instruments.texts());
        all.filter_map(|(key, text)| Some((key, text?))).collect()
    }

    /// For rotary axes by ISO 230-2; `None` where the budget says nothing of an angular reference.
    #[must_use]
    pub fn rotary(&self) -> Option<RotaryBudget> {
        let arcsec_rad = |arcsec: f64| (arcsec / 3600.0).to_radians();
        self.angular_reference.map(|one| RotaryBudget {
            expanded_uncertainty_rad: arcsec_rad(one.expanded_uncertainty_arcsec),
            coverage_factor: one.coverage_factor,
            environmental_drift_rad: arcsec_rad(one.environmental_drift_arcsec),
            environmental_unrest_rad: one.environmental_unrest_arcsec.map(arcsec_rad),
        })
    }

    /// For ISO 230-2 and 230-6, with the temperatures of machine and device where they are known.
    #[must_use]
    pub fn positioning(
        &self,
        machine: Option<&BodyTemperature>,
        device: Option<&BodyTemperature>,
    ) -> PositioningBudget {
        PositioningBudget {
            device: self.length_reference.unwrap_or(NO_DEVICE).inner(),
            misalignment_mm: self.misalignment_mm.unwrap_or(0.0),
            machine: self.machine_body().at(machine),
            device_expansion: self.device_body().at(device),
            environmental_drift_mm: self.drift_mm(),
            environmental_unrest_mm: self.environmental_unrest_um.map(|um| um * 1e-3),
        }
    }

    /// For what the machine's own scale read, with the scale's uncertainty where it is known: nothing is aligned, and nothing
    /// is corrected to another temperature.
    #[must_use]
    pub fn of_scale(&self, scale: Option<DeviceUncertainty>) -> PositioningBudget {
        let nothing = Self::nothing();
        PositioningBudget {
            device: scale.unwrap_or(NO_DEVICE.inner()),
            environmental_drift_mm: self.drift_mm(),
            environmental_unrest_mm: self.environmental_unrest_um.map(|um| um * 1e-3),
            ..nothing.positioning(None, None)
        }
    }

    /// The machine, and the device's own body.
    pub fn bodies(&self) -> (&Body, &Body) {
        (self.machine_body(), self.device_body())
    }

    fn machine_body(&self) -> &Body {
        self.machine.as_ref().unwrap_or(&NO_BODY)
    }

    fn device_body(&self) -> &Body {
        self.device.as_ref().unwrap_or(&NO_BODY)
    }

    /// Range of a reading at rest, mm; 0 where no test needs it.
    fn drift_mm(&self) -> f64 {
        self.environmental_drift_um.unwrap_or(0.0) * 1e-3
    }

    /// Temperatures that are stated and not read, in words: body, °C, half of its interval.
    #[must_use]
    pub fn stated_temperatures(&self) -> Vec<String> {
        let bodies = [
            ("machine", self.machine.as_ref()),
            ("device", self.device.as_ref()),
            ("plate", self.plate.as_ref()),
        ];
        let words = |(name, body): (&str, Option<&Body>)| {
            let body = body?;
            let degc = 20.0 + body.temperature_deviation_k?;
            let half_width_k = body.temperature_half_width_k;
            Some(format!("{name} {degc:.2} ± {half_width_k:.2} °C"))
        };
        bodies.into_iter().filter_map(words).collect()
    }

    /// Whether temperature and expansion of the plate are stated.
    #[must_use]
    pub const fn has_plate(&self) -> bool {
        self.plate.is_some()
    }

    /// With the body of the plate, where it is stated, in place of the device's.
    #[must_use]
    pub fn of_plate(&self) -> Self {
        let mut own = self.clone();
        if let Some(plate) = &self.plate {
            own.device = Some(plate.clone());
        }
        own
    }

    /// For ISO 230-4: one device, plate and head, reads deviations and radius; with the temperatures of machine and device
    /// where they are known.
    #[must_use]
    pub fn circular(
        &self,
        machine: Option<&BodyTemperature>,
        device: Option<&BodyTemperature>,
    ) -> CircularBudget {
        CircularBudget {
            displacement: self.grid_encoder.unwrap_or(NO_DEVICE).inner(),
            length: None,
            machine: self.machine_body().at(machine),
            device_expansion: self.device_body().at(device),
            environmental_drift_mm: self.drift_mm(),
            environmental_unrest_mm: self.environmental_unrest_um.map(|um| um * 1e-3),
        }
    }

    /// Standard uncertainty of a radius as the plate's certificate states it, mm.
    #[must_use]
    pub fn radius_standard_mm(&self, radius_mm: f64) -> f64 {
        let plate = self.grid_encoder.unwrap_or(NO_DEVICE);
        plate.inner().standard_mm(radius_mm)
    }
}
