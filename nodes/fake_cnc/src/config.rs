//! Parameters of the control; the machine and its plant are described in their own files.

use std::collections::BTreeMap;

use machine::MachineFile;
use machine::file::{AxisEntry, Latch};
use metrology::stamp::Span;
use metrology::{Axis, OffsetRule, PerAxis, check_parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::CncError;
use crate::path::AxisLimits;
use crate::rs274::Envelope;
use crate::servo::Gains;

/// Tools that the table may have.
const TOOLS: usize = 1000;

/// Operational parameters; none of them is physics, so each has a default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Machine file, relative to the parameter file.
    pub machine_file: String,
    /// Plant file, relative to the parameter file.
    pub plant_file: String,
    /// Rate of axis states during touches and full-rate contours; a whole part of the servo rate.
    #[schemars(range(min = 1.0, max = 20_000.0))]
    pub state_rate_hz: f64,
    /// Rate of axis states otherwise, 0.001 or above; 0 means state_rate_hz.
    #[schemars(range(min = 0.0, max = 20_000.0))]
    pub background_rate_hz: f64,
    /// Rate of program feedback.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub feedback_rate_hz: f64,
    /// Rest before a touch, and time for which the full rate goes on after it.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub touch_margin_s: f64,
    /// Rest after every exact stop.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub settle_s: f64,
    /// Gain of the velocity loops.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub velocity_gain_per_s: f64,
    /// Integral time of the velocity loops.
    #[schemars(range(min = 1e-4, max = 100.0))]
    pub velocity_integral_time_s: f64,
    /// Greatest acceleration demand over the acceleration limit of the axis.
    #[schemars(range(min = 1.0, max = 100.0))]
    pub drive_peak_ratio: f64,
    /// Following error at which a linear axis stops.
    #[schemars(range(min = 1e-3, max = 100.0))]
    pub following_error_limit_mm: f64,
    /// Following error at which a rotary axis stops.
    #[schemars(range(min = 1e-3, max = 100.0))]
    pub following_error_limit_deg: f64,
    /// Silence after which a compensation is held no longer but fades; one that is stamped earlier or later than now by
    /// more, and by more than 0.5 s, is refused.
    #[schemars(range(min = 1e-3, max = 3600.0))]
    pub compensation_hold_s: f64,
    /// Rate at which a stale compensation of a linear axis goes to zero.
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub compensation_fade_um_s: f64,
    /// Rate at which a stale compensation of a rotary axis goes to zero.
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub compensation_fade_arcsec_s: f64,
    /// Rate at which a compensation of a linear axis is followed at most.
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub compensation_rate_limit_um_s: f64,
    /// Rate at which a compensation of a rotary axis is followed at most.
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub compensation_rate_limit_arcsec_s: f64,
    /// Greatest compensation of a linear axis that is accepted.
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub compensation_limit_um: f64,
    /// Greatest compensation of a rotary axis that is accepted.
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub compensation_limit_arcsec: f64,
    /// Controller clock minus host clock at the first tick.
    #[schemars(range(min = -1e9, max = 1e9))]
    pub clock_offset_s: f64,
    /// Rate of the controller clock against the host's, minus one.
    #[schemars(range(min = -1000.0, max = 1000.0))]
    pub clock_drift_ppm: f64,
    /// Jump of the host clock beyond which time is skipped rather than simulated.
    #[schemars(range(min = 1e-3, max = 1e6))]
    pub longest_catch_up_s: f64,
    /// Whether the node configures and activates itself at its start; otherwise somebody does so (`ros2 lifecycle
    /// set`).
    pub autostart: bool,
    /// Time that homing takes, at the start and when it is asked for; 0: the axes know their zeros.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub homing_s: f64,
    /// Whether M1 waits.
    pub optional_stop: bool,
    /// Whether every block waits for the next to be asked for.
    pub single_block: bool,
    /// Lengths of tools H1, H2 and so on, for G43.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub tool_lengths_mm: Vec<f64>,
    /// What closes the position loop: motor (semi-closed, also without an entry) or scale (full-closed).
    #[schemars(extend("keys" = ["X", "Y", "Z"]))]
    pub feedback: BTreeMap<Axis, FeedbackSource>,
    /// Position at the start, within travel; 0 without an entry.
    #[schemars(extend("keys" = ["X", "Y", "Z"]))]
    pub start_mm: BTreeMap<Axis, f64>,
    /// Position at the start, within travel; 0 without an entry.
    #[schemars(extend("keys" = ["A", "B", "C"]))]
    pub start_deg: BTreeMap<Axis, f64>,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            machine_file: String::new(),
            plant_file: String::new(),
            state_rate_hz: 1000.0,
            background_rate_hz: 0.0,
            feedback_rate_hz: 10.0,
            touch_margin_s: 0.05,
            settle_s: 0.02,
            velocity_gain_per_s: 500.0,
            velocity_integral_time_s: 0.01,
            drive_peak_ratio: 3.0,
            following_error_limit_mm: 1.0,
            following_error_limit_deg: 0.5,
            compensation_hold_s: 1.0,
            compensation_fade_um_s: 5.0,
            compensation_fade_arcsec_s: 5.0,
            compensation_rate_limit_um_s: 100.0,
            compensation_rate_limit_arcsec_s: 100.0,
            compensation_limit_um: 500.0,
            compensation_limit_arcsec: 500.0,
            clock_offset_s: 0.0,
            clock_drift_ppm: 0.0,
            longest_catch_up_s: 60.0,
            autostart: true,
            homing_s: 0.0,
            optional_stop: false,
            single_block: false,
            tool_lengths_mm: Vec::new(),
            feedback: BTreeMap::new(),
            start_mm: BTreeMap::new(),
            start_deg: BTreeMap::new(),
        }
    }
}

/// What closes a position loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FeedbackSource {
    /// The motor's encoder: semi-closed.
    #[default]
    Motor,
    /// The linear scale: full-closed.
    Scale,
}

/// Limits of a compensation on one axis, per servo period where it is a rate; mm or rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OffsetLimits {
    /// Greatest size.
    pub size: f64,
    /// Greatest step in one period while following.
    pub step: f64,
    /// Step in one period while fading.
    pub fade_step: f64,
}

/// What the control needs of configuration and machine file, in inner units, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    pub(crate) limits: AxisLimits,
    pub(crate) envelope: Envelope,
    pub(crate) gains: PerAxis<Gains>,
    pub(crate) feedback: PerAxis<FeedbackSource>,
    pub(crate) following_error_limit: PerAxis<f64>,
    pub(crate) offset: PerAxis<OffsetLimits>,
    pub(crate) latch: Latch,
    pub(crate) period: Span,
    pub(crate) state_every: u64,
    pub(crate) background_every: u64,
    pub(crate) feedback_every: u64,
    pub(crate) touch_margin: u64,
    pub(crate) settle: u64,
    pub(crate) compensation_hold: u64,
    pub(crate) compensation_age: Span,
    pub(crate) pulse_mm: f64,
    pub(crate) homing: u64,
    pub(crate) optional_stop: bool,
    pub(crate) single_block: bool,
    pub(crate) clock_offset: Span,
    pub(crate) clock_drift: f64,
    pub(crate) longest_catch_up: Span,
    pub(crate) start: PerAxis<f64>,
}

impl Settings {
    /// Checks `config` and the control's part of `machine`.
    ///
    /// # Errors
    /// The first value that is out of range, by name.
    pub fn new(config: &Config, machine: &MachineFile) -> Result<Self, CncError> {
        config.check()?;
        let period_ms = machine.control.servo_period_ms;
        if !(0.05..=20.0).contains(&period_ms) {
            return Err(CncError::Parameter {
                name: "control.servo_period_ms",
                value: period_ms,
                rule: "from 0.05 to 20 ms",
            });
        }
        if machine.axes.is_empty() {
            return Err(CncError::NoAxes);
        }
        let period_s = period_ms / 1e3;
        let mut settings = config.without_axes(machine, period_s)?;
        for (&axis, entry) in &machine.axes {
            settings.axis(axis, &AxisNumbers::read(axis, entry)?, config);
        }
        settings.start(config)?;
        for (&axis, &source) in &config.feedback {
            let has_scale = machine
                .linear(axis)
                .is_some_and(|linear| linear.scale_resolution_um.is_some());
            if source == FeedbackSource::Scale && !has_scale {
                return Err(CncError::NoScale { axis });
            }
            settings.feedback[axis] = source;
        }
        Ok(settings)
    }

    /// What programs are checked against.
    #[must_use]
    pub const fn envelope(&self) -> &Envelope {
        &self.envelope
    }

    /// Which offsets are followed.
    pub(crate) fn offset_rule(&self) -> OffsetRule {
        OffsetRule {
            axes: self.limits.axes,
            size_limit: PerAxis::from_fn(|axis| self.offset[axis].size),
            pulse_mm: self.pulse_mm,
            age_limit: self.compensation_age,
        }
    }

    /// Servo periods in `time_s`, rounded up.
    pub(crate) fn periods(&self, time_s: f64) -> u64 {
        periods(time_s, self.limits.period_s)
    }

    fn axis(&mut self, axis: Axis, numbers: &AxisNumbers, config: &Config) {
        let period_s = self.limits.period_s;
        self.limits.axes = self.limits.axes.with(axis);
        self.envelope.axes = self.limits.axes;
        self.limits.speed[axis] = numbers.speed;
        self.limits.acceleration[axis] = numbers.acceleration;
        self.envelope.travel[axis] = numbers.travel;
        self.envelope.speed[axis] = numbers.speed;
        self.gains[axis] = Gains {
            position_per_s: numbers.position_gain_per_s,
            feedforward: numbers.feedforward,
            velocity_per_s: config.velocity_gain_per_s,
            integral_time_s: config.velocity_integral_time_s,
            demand_limit: config.drive_peak_ratio * numbers.acceleration,
        };
        let arcsec = (1.0_f64 / 3600.0).to_radians();
        let (following, unit, size, rate, fade) = if axis.is_linear() {
            (
                config.following_error_limit_mm,
                1e-3,
                config.compensation_limit_um,
                config.compensation_rate_limit_um_s,
                config.compensation_fade_um_s,
            )
        } else {
            (
                config.following_error_limit_deg.to_radians(),
                arcsec,
                config.compensation_limit_arcsec,
                config.compensation_rate_limit_arcsec_s,
                config.compensation_fade_arcsec_s,
            )
        };
        self.following_error_limit[axis] = following;
        self.offset[axis] = OffsetLimits {
            size: size * unit,
            step: rate * unit * period_s,
            fade_step: fade * unit * period_s,
        };
    }

    fn start(&mut self, config: &Config) -> Result<(), CncError> {
        let linear = config.start_mm.iter().map(|entry| ("start_mm", entry));
        let rotary = config.start_deg.iter().map(|entry| ("start_deg", entry));
        for (name, (&axis, &value)) in linear.chain(rotary) {
            let is_of_kind = axis.is_linear() == (name == "start_mm");
            if !is_of_kind || !self.envelope.axes.contains(axis) {
                return Err(CncError::StartOfNoAxis { name, axis, value });
            }
            let (position, as_given): (f64, fn(f64) -> f64) = if axis.is_linear() {
                (value, |mm| mm)
            } else {
                (value.to_radians(), f64::to_degrees)
            };
            let [least, greatest] = self.envelope.travel[axis];
            if !(least..=greatest).contains(&position) {
                return Err(CncError::StartOutsideTravel {
                    name,
                    axis,
                    value,
                    least: as_given(least),
                    greatest: as_given(greatest),
                });
            }
            self.start[axis] = position;
        }
        Ok(())
    }
}

impl Config {
    /// Longest time from the call to come to rest until no offset is in effect and no program runs, s.
    ///
    /// The greatest offset goes to zero at the rate of fading; a program that is called off slows down, which no axis needs a
    /// minute for.
    #[must_use]
    pub fn rest_s(&self) -> f64 {
        const SLOWING_DOWN_S: f64 = 60.0;
        let linear_s = self.compensation_limit_um / self.compensation_fade_um_s;
        let rotary_s = self.compensation_limit_arcsec / self.compensation_fade_arcsec_s;
        linear_s.max(rotary_s) + SLOWING_DOWN_S
    }

    /// Checks every number against its limits.
    fn check(&self) -> Result<(), CncError> {
        check_parameters(self)?;
        if self.tool_lengths_mm.len() > TOOLS {
            return Err(CncError::TooManyTools {
                count: self.tool_lengths_mm.len(),
                limit: TOOLS,
            });
        }
        Ok(())
    }

    fn without_axes(&self, machine: &MachineFile, period_s: f64) -> Result<Settings, CncError> {
        require(
            "background_rate_hz",
            self.background_rate_hz,
            self.background_rate_hz <= 0.0 || self.background_rate_hz >= LEAST_RATE_HZ,
            "0 (as state_rate_hz) or at least 0.001 Hz",
        )?;
        let background_hz = if self.background_rate_hz > 0.0 {
            self.background_rate_hz
        } else {
            self.state_rate_hz
        };
        Ok(Settings {
            limits: AxisLimits {
                axes: metrology::AxisSet::EMPTY,
                speed: PerAxis::default(),
                acceleration: PerAxis::default(),
                period_s,
            },
            envelope: Envelope {
                axes: metrology::AxisSet::EMPTY,
                travel: PerAxis::default(),
                speed: PerAxis::default(),
                spindle_limit_rpm: machine.spindle.map(|spindle| spindle.max_speed_rpm),
                tool_lengths_mm: self.tool_lengths_mm.clone(),
            },
            gains: PerAxis::default(),
            feedback: PerAxis::default(),
            following_error_limit: PerAxis::default(),
            offset: PerAxis::default(),
            latch: machine.control.latch,
            period: Span::from_secs_f64(period_s),
            state_every: every("state_rate_hz", self.state_rate_hz, period_s)?,
            background_every: every("background_rate_hz", background_hz, period_s)?,
            feedback_every: periods(1.0 / self.feedback_rate_hz, period_s).max(1),
            touch_margin: periods(self.touch_margin_s, period_s),
            settle: periods(self.settle_s, period_s),
            compensation_hold: periods(self.compensation_hold_s, period_s),
            compensation_age: OffsetRule::age_limit_of(Span::from_secs_f64(
                self.compensation_hold_s,
            )),
            pulse_mm: machine.control.pulse_equivalent_um * 1e-3,
            homing: periods(self.homing_s, period_s),
            optional_stop: self.optional_stop,
            single_block: self.single_block,
            clock_offset: Span::from_secs_f64(self.clock_offset_s),
            clock_drift: self.clock_drift_ppm * 1e-6,
            longest_catch_up: Span::from_secs_f64(self.longest_catch_up_s),
            start: PerAxis::default(),
        })
    }
}

fn require(
    name: &'static str,
    value: f64,
    holds: bool,
    rule: &'static str,
) -> Result<(), CncError> {
    if holds && value.is_finite() {
        Ok(())
    } else {
        Err(CncError::Parameter { name, value, rule })
    }
}

/// Whole servo periods in a time, rounded up.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "times are checked to be finite and not negative; the cast saturates"
)]
fn periods(time_s: f64, period_s: f64) -> u64 {
    (time_s / period_s - 1e-9).ceil() as u64
}

/// Least rate that is one, Hz: a state in a quarter of an hour.
const LEAST_RATE_HZ: f64 = 1e-3;

/// Servo periods from one sample to the next.
fn every(name: &'static str, rate_hz: f64, period_s: f64) -> Result<u64, CncError> {
    let ratio = 1.0 / (rate_hz * period_s);
    let whole = ratio.round();
    require(
        name,
        rate_hz,
        whole >= 1.0 && (ratio - whole).abs() < 1e-6 * whole,
        "a whole part of the servo rate",
    )?;
    Ok(periods(whole * period_s, period_s).max(1))
}

/// An axis of the machine file in inner units.
struct AxisNumbers {
    travel: [f64; 2],
    speed: f64,
    acceleration: f64,
    position_gain_per_s: f64,
    feedforward: f64,
}

impl AxisNumbers {
    fn read(axis: Axis, entry: &AxisEntry) -> Result<Self, CncError> {
        let numbers = match entry {
            AxisEntry::Linear(linear) if axis.is_linear() => Self {
                travel: linear.travel_mm,
                speed: linear.feed_limit_mm_min / 60.0,
                acceleration: linear.acceleration_limit_mm_s2,
                position_gain_per_s: linear.position_gain_per_s,
                feedforward: linear.velocity_feedforward,
            },
            AxisEntry::Rotary(rotary) if !axis.is_linear() => Self {
                travel: rotary.travel_deg.map(f64::to_radians),
                speed: rotary.feed_limit_deg_min.to_radians() / 60.0,
                acceleration: rotary.acceleration_limit_deg_s2.to_radians(),
                position_gain_per_s: rotary.position_gain_per_s,
                feedforward: rotary.velocity_feedforward,
            },
            _ => return Err(CncError::AxisKind { axis }),
        };
        numbers.check(axis)?;
        Ok(numbers)
    }

    fn check(&self, axis: Axis) -> Result<(), CncError> {
        let positive = [
            ("feed_limit", self.speed),
            ("acceleration_limit", self.acceleration),
            ("position_gain_per_s", self.position_gain_per_s),
            ("travel", self.travel[1] - self.travel[0]),
        ];
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(CncError::MachineAxis {
                    axis,
                    name,
                    value,
                    rule: "above 0",
                });
            }
        }
        if !(0.0..=1.0).contains(&self.feedforward) {
            return Err(CncError::MachineAxis {
                axis,
                name: "velocity_feedforward",
                value: self.feedforward,
                rule: "from 0 to 1",
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = include_str!("../../../launch_configs/gap_first/machine.yaml");

    #[test]
    fn a_background_rate_that_is_almost_none_is_refused() {
        let machine = MachineFile::parse(MACHINE, "m").unwrap();
        let of = |background_rate_hz| {
            let config = Config {
                background_rate_hz,
                ..Config::default()
            };
            Settings::new(&config, &machine)
        };
        for rate_hz in [0.0, 1e-3, 10.0] {
            assert!(of(rate_hz).is_ok(), "{rate_hz}");
        }
        for rate_hz in [1e-300, f64::MIN_POSITIVE, 1e-9, 1e-4, f64::NAN, -1.0] {
            let said = of(rate_hz).err().map(|error| error.to_string());
            let said = said.unwrap_or_default();
            assert!(said.contains("background_rate_hz = "), "{rate_hz}: {said}");
        }
    }
}
