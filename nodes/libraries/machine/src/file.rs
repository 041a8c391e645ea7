//! The machine file: a machine as its maker would describe it.
//!
//! Keys carry their units; unknown keys are refused by name; nothing is clamped. Linear axes, and a control and a probe that
//! are left out as a whole, have the defaults of a common machining centre; other physics has no default. Units of the file
//! are those of a data sheet; [`MachineFile`] keeps them as written and offers inner units (mm, rad, s) through methods.
//! [`MachineFile::parse`] reads and checks a whole file; a value made otherwise is checked by [`MachineFile::check`].

mod axes;
mod certificate;
mod check;
mod defaults;
pub mod effect_ranges;
mod limits;
mod read;
mod reference;

use std::collections::BTreeMap;

use metrology::{Axis, AxisSet};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use certificate::CertificateEntry;
pub use limits::REPEATABILITY_UM;
pub use reference::{BeamEntry, GridEncoderEntry, GridPlacement, GridPlane, LengthReferenceEntry};

/// A whole machine file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MachineFile {
    /// Name of the machine.
    pub name: String,
    /// Kinematic chain from workpiece to tool, ISO 10791-6 style, e.g. `[w C' A' Y' b X Z t]`.
    pub chain: String,
    /// Axes by letter.
    #[serde(deserialize_with = "axes::deserialize")]
    #[schemars(schema_with = "axes::schema")]
    pub axes: BTreeMap<Axis, AxisEntry>,
    /// Where the rotary axes lie; required with rotary axes.
    #[serde(default)]
    pub rotary: Option<RotaryEntry>,
    /// The control; where it is left out, that of [`ControlEntry::default`].
    #[serde(default)]
    #[schemars(description = "The control; all its keys or none.")]
    pub control: ControlEntry,
    /// The spindle; where absent, programs turn none.
    #[serde(default)]
    pub spindle: Option<SpindleEntry>,
    /// The touch probe; where it is left out, that of [`ProbeEntry::default`].
    #[serde(default)]
    #[schemars(description = "The touch probe; all its keys or none.")]
    pub probe: ProbeEntry,
    /// Reference blocks on the table.
    #[serde(default)]
    pub blocks: Vec<BlockEntry>,
    /// Other probing artefacts on the table.
    #[serde(default)]
    pub artefacts: Vec<ArtefactEntry>,
    /// Certificates of those that are calibrated.
    #[serde(default)]
    pub certificates: Vec<CertificateEntry>,
    /// The table, where rotary axes turn it; poses are then planned clear of it.
    #[serde(default)]
    pub table: Option<TableEntry>,
    /// Temperature sensors.
    #[serde(default)]
    pub temperature_sensors: Vec<SensorEntry>,
    /// Grid encoder, where there is one.
    #[serde(default)]
    pub grid_encoder: Option<GridEncoderEntry>,
    /// Length reference, where there is one.
    #[serde(default)]
    pub length_reference: Option<LengthReferenceEntry>,
    /// The KNOWN effects.
    #[serde(default)]
    pub effects: Vec<EffectEntry>,
}

/// The spindle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpindleEntry {
    /// Greatest speed.
    pub max_speed_rpm: f64,
}

/// One axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum AxisEntry {
    /// A linear axis.
    Linear(LinearAxisEntry),
    /// A rotary axis.
    Rotary(RotaryAxisEntry),
}

/// A linear axis driven by a ball screw.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LinearAxisEntry {
    /// Least and greatest position.
    pub travel_mm: [f64; 2],
    /// Feed limit.
    #[serde(default = "defaults::feed_limit_mm_min")]
    pub feed_limit_mm_min: f64,
    /// Acceleration limit.
    #[serde(default = "defaults::acceleration_limit_mm_s2")]
    pub acceleration_limit_mm_s2: f64,
    /// Lead of the screw.
    #[serde(default = "defaults::lead_mm")]
    pub lead_mm: f64,
    /// Gain of the position loop.
    #[serde(default = "defaults::position_gain_per_s")]
    pub position_gain_per_s: f64,
    /// Share of velocity feed-forward, 0 to 1.
    #[serde(default = "defaults::velocity_feedforward")]
    pub velocity_feedforward: f64,
    /// The velocity loop inside the position loop; ideal where absent.
    #[serde(default)]
    pub velocity_loop: Option<VelocityLoopEntry>,
    /// Friction of the guides over the mass of the slide; where absent a slide stays where its drive lets go of it.
    #[serde(default)]
    pub guide_friction: Option<GuideFrictionEntry>,
    /// Resolution of the motor encoder, seen at the slide.
    #[serde(default = "defaults::encoder_resolution_um")]
    pub encoder_resolution_um: f64,
    /// Resolution of the linear scale, where there is one.
    #[serde(default)]
    pub scale_resolution_um: Option<f64>,
    /// Expanded uncertainty (k = 2) of the linear scale as its certificate states it: the part that every length has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale_expanded_uncertainty_um: Option<f64>,
    /// The part of it that grows with the length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale_expanded_uncertainty_um_per_m: Option<f64>,
    /// Signal period of the linear scale.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale_signal_period_um: Option<f64>,
    /// Travel over which another part of the drive repeats: a turn of a gear, a tooth of a rack or belt.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub periods_mm: Vec<f64>,
    /// What closes the position loop: `motor`, or `scale` where there is one.
    #[serde(default)]
    pub position_feedback: PositionFeedback,
}

impl LinearAxisEntry {
    /// Periods in which the axis repeats itself while it moves, mm: lead, further periods, and that of the scale where the
    /// scale closes the loop.
    #[must_use]
    pub fn repeats_mm(&self) -> Vec<f64> {
        let by_scale = self.position_feedback == PositionFeedback::Scale;
        let signal_um = self.scale_signal_period_um.filter(|_| by_scale);
        let mut periods_mm = vec![self.lead_mm];
        periods_mm.extend(&self.periods_mm);
        periods_mm.extend(signal_um.map(|period_um| period_um * 1e-3));
        periods_mm
    }
}

/// The encoder that closes a position loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PositionFeedback {
    /// The motor's: semi-closed.
    #[default]
    Motor,
    /// The linear scale: full-closed.
    Scale,
}

/// How a slide slows down by the friction of its guides alone: force over mass, from the drive's commissioning.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GuideFrictionEntry {
    /// Its part at every speed.
    pub coulomb_mm_s2: f64,
    /// Its part that grows with the speed.
    #[serde(default)]
    pub viscous_per_s: f64,
}

/// A velocity loop with proportional and integral action, as it is tuned.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VelocityLoopEntry {
    /// Natural frequency of the closed loop: root of its gain over its integral time, over 2 pi.
    pub frequency_hz: f64,
    /// Damping ratio of the closed loop: half the root of its gain times its integral time.
    pub damping: f64,
    /// Time constant of the filter of the measured velocity; 0: none.
    pub filter_ms: f64,
}

/// A rotary axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RotaryAxisEntry {
    /// Least and greatest position.
    pub travel_deg: [f64; 2],
    /// Feed limit.
    pub feed_limit_deg_min: f64,
    /// Acceleration limit.
    pub acceleration_limit_deg_s2: f64,
    /// Gain of the position loop.
    pub position_gain_per_s: f64,
    /// Share of velocity feed-forward, 0 to 1.
    pub velocity_feedforward: f64,
    /// The velocity loop inside the position loop; ideal where absent.
    #[serde(default)]
    pub velocity_loop: Option<VelocityLoopEntry>,
    /// Resolution of the encoder.
    pub encoder_resolution_arcsec: f64,
}

/// Nominal lines of the rotary axes, machine frame, all axes at zero.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RotaryEntry {
    /// A point on each rotary axis' line.
    pub origin_mm: BTreeMap<Axis, [f64; 3]>,
}

/// The control.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ControlEntry {
    /// Servo period.
    pub servo_period_ms: f64,
    /// Pulse equivalent of the linear axes.
    pub pulse_equivalent_um: f64,
    /// How a probe trigger is latched.
    pub latch: Latch,
}

/// How a control latches positions at a probe trigger.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Latch {
    /// A hardware latch at the instant the signal arrives.
    Hardware,
    /// The input is polled in the servo period.
    Polled,
}

/// The touch probe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProbeEntry {
    /// Styli by name.
    pub styli: BTreeMap<String, StylusEntry>,
    /// The stylus that is mounted.
    pub mounted: String,
    /// Clearance before a touch begins.
    pub standoff_mm: f64,
    /// How far behind the nominal surface a touch may go before it has failed.
    pub overtravel_mm: f64,
    /// Feed of an ordinary touch.
    pub feed_mm_min: f64,
    /// Repeatability of one touch (1 standard deviation), as the maker states it; 0.001 or above.
    pub repeatability_um: f64,
    /// Latency, where it is known; a calibration overrides it.
    #[serde(default)]
    pub latency_ms: Option<f64>,
}

/// A stylus.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StylusEntry {
    /// Effective radius of the ball.
    pub radius_mm: f64,
    /// Distance from the spindle nose to the ball centre.
    pub length_mm: f64,
    /// Length of the stylus itself, from its seat in the probe to the ball centre, by which it bends; where absent, `length_mm`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stem_length_mm: Option<f64>,
}

impl StylusEntry {
    /// The length that bends under the triggering force.
    #[must_use]
    pub fn bending_length_mm(&self) -> f64 {
        self.stem_length_mm.unwrap_or(self.length_mm)
    }
}

/// A reference block: three orthogonal faces that meet in a corner.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BlockEntry {
    /// Name.
    pub id: String,
    /// Nominal corner, machine frame with rotary axes at zero.
    pub corner_mm: [f64; 3],
    /// Sign of the tool's motion when the X, Y and Z face is touched: the block's body lies that way.
    pub approach_sign: [i8; 3],
    /// Distance from the corner at which each face is touched.
    pub inset_mm: f64,
}

/// Another artefact for probing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum ArtefactEntry {
    /// A sphere.
    Sphere {
        /// Name.
        id: String,
        /// Nominal centre, machine frame, rotary axes at zero.
        centre_mm: [f64; 3],
        /// Radius.
        radius_mm: f64,
    },
    /// A ring gauge whose axis is Z.
    Bore {
        /// Name.
        id: String,
        /// Nominal centre at probing height.
        centre_mm: [f64; 3],
        /// Radius.
        radius_mm: f64,
    },
    /// A boss whose axis is Z.
    Boss {
        /// Name.
        id: String,
        /// Nominal centre at probing height.
        centre_mm: [f64; 3],
        /// Radius.
        radius_mm: f64,
    },
    /// A flat face.
    Plane {
        /// Name.
        id: String,
        /// A point on it.
        point_mm: [f64; 3],
        /// Outward normal, one axis direction such as `[0, 0, 1]`.
        normal: [f64; 3],
        /// Half the side of the square that is probed.
        half_side_mm: f64,
    },
}

/// A round table and what may not touch it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TableEntry {
    /// Height of its top, machine frame, rotary axes at zero.
    pub top_z_mm: f64,
    /// Its radius.
    pub radius_mm: f64,
    /// Radius of the spindle's nose.
    pub nose_radius_mm: f64,
}

/// A temperature sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorEntry {
    /// Name; the topic is `temperature/<id>`.
    pub id: String,
    /// Where it sits.
    pub place: SensorPlace,
    /// Time between readings.
    pub period_s: f64,
}

/// Where a temperature sensor sits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "named places")]
pub enum SensorPlace {
    SpindleFront,
    SpindleRear,
    Column,
    Bed,
    NutX,
    NutY,
    NutZ,
    Ambient,
}

/// One known effect; its own keys are checked by the effect itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EffectEntry {
    /// Id: the file name of the effect in the catalogue.
    pub kind: String,
    /// The axis, or pair of axes, where there is one.
    #[serde(default)]
    pub axis: Option<String>,
    /// Parameters by name, unit in the name.
    #[serde(flatten)]
    pub parameters: BTreeMap<String, f64>,
}

impl MachineFile {
    /// The axes that the machine has.
    #[must_use]
    pub fn axis_set(&self) -> AxisSet {
        self.axes.keys().copied().collect()
    }

    /// Entry of a linear axis.
    #[must_use]
    pub fn linear(&self, axis: Axis) -> Option<&LinearAxisEntry> {
        match self.axes.get(&axis) {
            Some(AxisEntry::Linear(entry)) => Some(entry),
            _ => None,
        }
    }

    /// Entry of a rotary axis.
    #[must_use]
    pub fn rotary_axis(&self, axis: Axis) -> Option<&RotaryAxisEntry> {
        match self.axes.get(&axis) {
            Some(AxisEntry::Rotary(entry)) => Some(entry),
            _ => None,
        }
    }

    /// The stylus named by `probe.mounted`.
    #[must_use]
    pub fn mounted_stylus(&self) -> Option<&StylusEntry> {
        self.probe.styli.get(&self.probe.mounted)
    }

    /// Effective radius of the mounted stylus' ball, mm; zero where none is mounted.
    #[must_use]
    pub fn ball_radius_mm(&self) -> f64 {
        self.mounted_stylus().map_or(0.0, |stylus| stylus.radius_mm)
    }

    /// The grid encoder's placement `id`.
    #[must_use]
    pub fn grid_placement(&self, id: &str) -> Option<&GridPlacement> {
        let grid = self.grid_encoder.as_ref()?;
        grid.placements.iter().find(|placement| placement.id == id)
    }

    /// The length reference's beam `id`.
    #[must_use]
    pub fn beam(&self, id: &str) -> Option<&BeamEntry> {
        let length = self.length_reference.as_ref()?;
        length.beams.iter().find(|beam| beam.id == id)
    }
}
