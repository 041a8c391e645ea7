//! Whether the lengths of a positioning test, or the radii of a circle, are those at 20 °C, what corrects them, and their uncertainty.

use iso230::budget::{DeviceUncertainty, differential_expansion};
use iso230::circular::CircularBudget;
use iso230::positioning::PositioningRuns;
use iso230::positioning::budget::PositioningBudget;
use machine::MachineFile;
use machine::file::PositionFeedback;
use metrology::Axis;
use metrology::number::number;
use serde_json::{Value, json};

use super::Tests;
use super::budget::{BodyTemperature, Budget};
use super::linear::{LinearTest, Reference};
use super::test_conditions::Thermometers;
use crate::section::Section;

/// What makes the lengths of a test those at 20 °C.
#[derive(Clone, Debug, PartialEq)]
pub enum Correction {
    /// The nominal differential expansion is taken out here.
    Here {
        /// ε of machine against device, mm/mm.
        differential_expansion: f64,
        /// What carries the positions of the machine: the machine as a whole, or the ball screw of an axis.
        carrier: Carrier,
        /// That carrier: temperature, and coefficient in 1/K.
        machine: (BodyTemperature, f64),
        /// The device, alike.
        device: (BodyTemperature, f64),
    },
    /// The instrument did, as the budget states.
    ByInstrument,
    /// Nothing does.
    Missing {
        /// Why not, and what to state.
        reason: String,
    },
}

/// What carries the positions that a test is of.
///
/// A motor encoder counts turns, so the ball screw carries the positions between its fixed bearing and the nut. With a scale in
/// the position loop, or a table of the axis that acts on the command, it is the scale or whatever the table refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carrier {
    /// `machine` of the budget.
    Machine,
    /// `screws` of the budget.
    Screw(Axis),
}

impl Carrier {
    /// Key in the budget file.
    fn key(self) -> String {
        match self {
            Self::Machine => "machine".to_owned(),
            Self::Screw(axis) => format!("screws.{axis}"),
        }
    }

    fn in_words(self) -> String {
        match self {
            Self::Machine => "machine".to_owned(),
            Self::Screw(axis) => format!("ball screw of {axis}"),
        }
    }
}

/// Which lengths were measured.
#[derive(Clone, Copy, Debug)]
pub struct About<'a> {
    /// Numbers of the runs.
    pub runs: &'a [u32],
    /// By what they were read.
    pub reference: Reference,
    /// Along which axis; none: along a line of several, or of a feature.
    pub axis: Option<Axis>,
    /// Whether a compensation acted.
    pub is_compensated: bool,
}

impl<'a> About<'a> {
    /// A test of stops on a line.
    #[must_use]
    pub fn line(test: &'a LinearTest) -> Self {
        Self {
            runs: &test.runs,
            reference: test.reference,
            axis: test.axis,
            is_compensated: test.compensated,
        }
    }

    /// Lengths along no single axis.
    #[must_use]
    pub const fn lengths(runs: &'a [u32]) -> Self {
        Self {
            runs,
            reference: Reference::Length,
            axis: None,
            is_compensated: false,
        }
    }

    /// The axis whose motor encoder alone led.
    pub(super) fn led_by_motor(&self, tests: &Tests) -> Option<Axis> {
        let axis = self.axis.filter(|_| !self.is_compensated)?;
        let machine = tests.machine.as_ref();
        let feedback = machine.and_then(|file| file.linear(axis));
        let by_scale = feedback.is_some_and(|one| one.position_feedback == PositionFeedback::Scale);
        (!by_scale).then_some(axis)
    }
}

/// How a test was measured, as far as it is stated.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Uncertainties; all zero where nothing is stated.
    pub budget: PositioningBudget,
    /// Whether expanded uncertainties can be stated.
    pub is_stated: bool,
    /// Whether those of lengths can be, too: not where the lengths should be those at 20 °C and are not.
    pub are_lengths_stated: bool,
    /// Whether the machine's own scale was read.
    pub is_by_own_scale: bool,
    /// What makes its lengths those at 20 °C.
    pub correction: Correction,
}

/// Growth during a test from which on it is stated, µm.
const LEAST_GROWTH_UM: f64 = 0.1;

/// Why no conformance is decided of what the machine read itself.
pub const BY_OWN_SCALE: &str = "not ISO 230-2: read by the machine's scale";
/// The same of what the motor encoder read.
pub const BY_MOTOR: &str = "not ISO 230-2: read by the motor encoder";

impl Measured {
    /// How these lengths were measured.
    #[must_use]
    pub fn of(tests: &Tests, budget: Option<&Budget>, about: About) -> Self {
        let screw = about.led_by_motor(tests);
        let on_screw = screw.and_then(|axis| Some((axis, budget?.of_screw(axis)?)));
        let carrier = on_screw
            .as_ref()
            .map_or(Carrier::Machine, |(axis, _)| Carrier::Screw(*axis));
        let budget = on_screw.as_ref().map(|(_, own)| own).or(budget);
        let nothing = Budget::nothing();
        let used = budget.unwrap_or(&nothing);
        if about.reference == Reference::Scale {
            let scale = about
                .axis
                .and_then(|axis| scale(tests.machine.as_ref()?, axis));
            return Self {
                budget: used.of_scale(scale),
                is_stated: budget.is_some() && scale.is_some(),
                are_lengths_stated: budget.is_some() && scale.is_some(),
                is_by_own_scale: true,
                correction: Correction::Missing {
                    reason: "the machine's own scale was read".to_owned(),
                },
            };
        }
        let known = Known::of(budget, &tests.conditions.during(about.runs), carrier);
        let corrects_itself = used.length_corrected_by_instrument;
        let uncertainties =
            used.positioning(known.machine.as_ref().ok(), known.device.as_ref().ok());
        let correction = known.correction(budget, corrects_itself);
        Self {
            budget: uncertainties,
            is_stated: budget.is_some(),
            are_lengths_stated: budget.is_some() && correction.lacks().is_none(),
            is_by_own_scale: false,
            correction,
        }
    }
}

/// A stated temperature farther from 20 °C may be the temperature itself, K.
const FAR_FROM_20_DEGC_K: f64 = 10.0;
/// What warnings of such temperatures have in common.
const FAR_FROM_20_DEGC: &str = "Far from 20 °C";

/// What warnings of lengths that are not those at 20 °C have in common.
pub const NOT_AT_20_DEGC: &str = "Not corrected to 20 °C";

impl Measured {
    /// What must be known of its figures before any of them, for the begin of a sentence; empty: nothing.
    #[must_use]
    pub fn reservation(&self) -> &'static str {
        match (self.is_by_own_scale, &self.correction) {
            (true, _) => "not ISO 230-2, read by the machine's scale: ",
            (false, Correction::Missing { .. }) => "as measured, not at 20 °C: ",
            (false, Correction::Here { .. } | Correction::ByInstrument) => "",
        }
    }

    /// The uncertainties of a sentence; empty where none is stated.
    #[must_use]
    pub fn coverage(&self) -> &'static str {
        if self.is_stated { " (± U, k = 2)" } else { "" }
    }

    /// Says what corrects the lengths of a test over `span_mm`, as a warning where nothing does.
    pub fn state_correction(&self, section: &mut Section, span_mm: f64) {
        self.correction.name_far(section);
        let line = self.correction.in_words(span_mm);
        if self.is_by_own_scale || self.correction.lacks().is_none() {
            section.lines.push(line);
        } else {
            section.warn(NOT_AT_20_DEGC, line);
        }
    }

    /// What a reader of a table must know of its uncertainties.
    #[must_use]
    pub fn uncertainty_note(&self) -> &'static str {
        match (self.is_stated, self.are_lengths_stated) {
            (true, true) => "± expanded uncertainty, k = 2.",
            (true, false) => {
                "± expanded uncertainty, k = 2. A, E and M have none: the lengths are not those at 20 °C."
            }
            (false, _) => {
                "No uncertainty is stated: without --budget, or without the scale's certificate."
            }
        }
    }
}

/// How a circle was measured, as far as it is stated.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredCircle {
    /// Uncertainties; all zero where nothing is stated.
    pub budget: CircularBudget,
    /// What makes its radii those at 20 °C.
    pub correction: Correction,
}

impl MeasuredCircle {
    /// How circles were measured while `read` was the temperature, by what has the places of `grid_encoder` and `device` in a
    /// budget: it corrects nothing itself.
    #[must_use]
    pub fn of(budget: Option<&Budget>, read: &Thermometers) -> Self {
        let nothing = Budget::nothing();
        let used = budget.unwrap_or(&nothing);
        let known = Known::of(budget, read, Carrier::Machine);
        Self {
            budget: used.circular(known.machine.as_ref().ok(), known.device.as_ref().ok()),
            correction: known.correction(budget, false),
        }
    }

    /// By the plate of a grid encoder.
    #[must_use]
    pub fn by_plate(budget: Option<&Budget>, read: &Thermometers) -> Self {
        let own = budget.map(Budget::of_plate);
        let mut measured = Self::of(own.as_ref(), read);
        if own.is_some_and(|budget| !budget.has_plate()) {
            measured.correction = Correction::Missing {
                reason: "the budget file states no plate (temperature and expansion of the grid encoder's plate)".to_owned(),
            };
        }
        measured
    }
}

/// Temperatures of machine and device during a test, or why they are unknown.
struct Known {
    carrier: Carrier,
    machine: Result<BodyTemperature, String>,
    device: Result<BodyTemperature, String>,
}

impl Known {
    /// `carrier` stands as `machine` in the budget.
    fn of(budget: Option<&Budget>, read: &Thermometers, carrier: Carrier) -> Self {
        let nothing = Budget::nothing();
        let (machine, device) = budget.unwrap_or(&nothing).bodies();
        Self {
            carrier,
            machine: machine.temperature(read),
            device: device.temperature(read),
        }
    }

    fn correction(self, budget: Option<&Budget>, corrects_itself: bool) -> Correction {
        let missing = |reason: String| Correction::Missing { reason };
        let Some(budget) = budget else {
            return missing("no budget was given (--budget)".to_owned());
        };
        if corrects_itself {
            return Correction::ByInstrument;
        }
        let key = self.carrier.key();
        let (of_machine, of_device) = match (self.machine, self.device) {
            (Err(why), _) => return missing(format!("the budget file's `{key}` {why}")),
            (_, Err(why)) => return missing(format!("the budget file's `device` {why}")),
            (Ok(of_machine), Ok(of_device)) => (of_machine, of_device),
        };
        let (machine, device) = budget.bodies();
        Correction::Here {
            differential_expansion: differential_expansion(
                &machine.at(Some(&of_machine)),
                &device.at(Some(&of_device)),
            ),
            carrier: self.carrier,
            machine: (of_machine, machine.expansion_per_k()),
            device: (of_device, device.expansion_per_k()),
        }
    }
}

/// What the machine file states about the scale of an axis.
pub(crate) fn scale(machine: &MachineFile, axis: Axis) -> Option<DeviceUncertainty> {
    let linear = machine.linear(axis)?;
    Some(DeviceUncertainty {
        expanded_uncertainty_mm: linear.scale_expanded_uncertainty_um? * 1e-3,
        expanded_uncertainty_per_length: linear.scale_expanded_uncertainty_um_per_m? * 1e-6,
        coverage_factor: 2.0,
    })
}

impl Correction {
    /// What is taken out of each length here, mm/mm.
    #[must_use]
    pub fn differential_expansion(&self) -> f64 {
        match self {
            Self::Here {
                differential_expansion,
                ..
            } => *differential_expansion,
            Self::ByInstrument | Self::Missing { .. } => 0.0,
        }
    }

    /// The runs of a test along one line, at 20 °C where they are corrected here; 0 is taken out at the first target.
    #[must_use]
    pub fn runs_at_20_degc(&self, test: &LinearTest, periods_mm: Vec<f64>) -> PositioningRuns {
        let as_read = PositioningRuns {
            targets_mm: test.targets_mm.clone(),
            up_mm: test.up_mm.clone(),
            down_mm: test.down_mm.clone(),
            zero_mm: test.targets_mm.first().copied().unwrap_or(0.0),
            periods_mm,
        };
        as_read.corrected_to_20_degc(self.differential_expansion())
    }

    /// Why no conformance is decided; none: the lengths are those at 20 °C.
    #[must_use]
    pub fn lacks(&self) -> Option<String> {
        match self {
            Self::Missing { reason } => Some(format!("not corrected to 20 °C: {reason}")),
            Self::Here { .. } | Self::ByInstrument => None,
        }
    }

    /// Names temperatures of the budget that are so far from 20 °C that they may be no deviations from it.
    pub fn name_far(&self, section: &mut Section) {
        let Self::Here {
            carrier,
            machine,
            device,
            ..
        } = self
        else {
            return;
        };
        let device_key = "device".to_owned();
        for (key, (temperature, expansion_per_k)) in
            [(carrier.key(), machine), (device_key, device)]
        {
            let is_stated = temperature.range_k.is_none() && *expansion_per_k > 0.0;
            if is_stated && temperature.deviation_k.abs() > FAR_FROM_20_DEGC_K {
                section.warn(
                    FAR_FROM_20_DEGC,
                    format!(
                        "{key}.temperature_deviation_k = {} K of the budget file is a temperature of {} °C: it is counted from 20 °C; correct it where it is the temperature itself.",
                        number(temperature.deviation_k),
                        number(20.0 + temperature.deviation_k)
                    ),
                );
            }
        }
    }

    /// A sentence, for a test over `span_mm`.
    #[must_use]
    pub fn in_words(&self, span_mm: f64) -> String {
        match self {
            Self::Here {
                differential_expansion,
                carrier,
                machine,
                device,
            } => format!(
                "Corrected to 20 °C: {:.2} µm taken out over {span_mm:.0} mm; {} {}, device {}.{}",
                differential_expansion * span_mm * 1e3,
                carrier.in_words(),
                body_in_words(machine),
                body_in_words(device),
                change_in_words(machine, span_mm)
            ),
            Self::ByInstrument => {
                "Corrected to 20 °C by the instrument, as the budget states; nothing is taken out here."
                    .to_owned()
            }
            Self::Missing { reason } => format!("Not corrected to 20 °C: {reason}. No conformance is decided."),
        }
    }

    /// The same for machines.
    #[must_use]
    pub fn as_json(&self) -> Value {
        let body = |(temperature, expansion_per_k): &(BodyTemperature, f64)| {
            json!({
                "temperature_degc": 20.0 + temperature.deviation_k,
                "temperature_half_width_k": temperature.half_width_k,
                "temperature_range_k": temperature.range_k,
                "expansion_per_k": expansion_per_k,
                "source": temperature.source,
            })
        };
        match self {
            Self::Here {
                differential_expansion,
                carrier,
                machine,
                device,
            } => json!({
                "done": true,
                "by": "nominal differential expansion",
                "carrier": carrier.in_words(),
                "differential_expansion": differential_expansion,
                "machine": body(machine),
                "device": body(device),
            }),
            Self::ByInstrument => json!({ "done": true, "by": "instrument" }),
            Self::Missing { reason } => json!({ "done": false, "reason": reason }),
        }
    }
}

fn body_in_words((temperature, expansion_per_k): &(BodyTemperature, f64)) -> String {
    if *expansion_per_k > 0.0 {
        // What a temperature is of: the bag as a whole, or the test, in which it may have changed.
        let of = temperature.range_k.map_or_else(
            || "for every test".to_owned(),
            |range_k| format!("mean of the test for all its runs, range {range_k:.2} K"),
        );
        format!(
            "{:.2} °C ({}: {of}), {:.1} µm/(m K)",
            20.0 + temperature.deviation_k,
            temperature.source,
            expansion_per_k * 1e6
        )
    } else {
        "without expansion".to_owned()
    }
}

/// By how much the machine may have grown or shrunk while the test lasted, where that is a tenth of a micrometre or more: the
/// range of single readings holds the thermometer's noise too.
fn change_in_words(
    (temperature, expansion_per_k): &(BodyTemperature, f64),
    span_mm: f64,
) -> String {
    let grown_um = temperature.range_k.unwrap_or(0.0) * expansion_per_k * span_mm * 1e3;
    if grown_um < LEAST_GROWTH_UM {
        return String::new();
    }
    format!(
        " By the range of its thermometer the machine changed by {grown_um:.2} µm over {span_mm:.0} mm at most during the test. That is not taken out: the part that is not noise of the thermometer is in the scatter of the runs."
    )
}

#[cfg(test)]
mod tests;
