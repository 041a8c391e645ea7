//! What was commanded and read during the runs of a recorded session.

use std::fmt;

use metrology::sample::TestSegment;
use metrology::{Axis, PerAxis};
use nalgebra::Vector3;

use super::history::History;
use super::motion::Motion;

/// A recorded session: one bag, or several one after another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Session {
    /// What heated the machine.
    pub history: History,
    /// The runs, in time.
    pub runs: Vec<Run>,
    /// Of several bags: number of the last run of the first one. What came later was measured in addition.
    pub first_bag_ends: Option<u32>,
}

impl Session {
    /// Whether a run was measured in addition, in a later bag.
    #[must_use]
    pub fn is_addition(&self, run: usize) -> bool {
        let number = self.runs.get(run).map(|run| run.segment.run);
        self.first_bag_ends
            .is_some_and(|end| number.is_some_and(|n| n > end))
    }
}

/// One run: what was commanded, and what the instruments read.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// What it was for: number, kind, plane, feed, sense, repeat, stylus, zero, set-up.
    pub segment: TestSegment,
    /// Commanded motion.
    pub motion: Motion,
    /// Touches, in time.
    pub touches: Vec<Touch>,
    /// Readings of all channels, in time within each channel.
    pub readings: Vec<Reading>,
}

/// A touch of the probe.
#[derive(Clone, Debug, PartialEq)]
pub struct Touch {
    /// Seconds since the session's start.
    pub time_s: f64,
    /// What was touched.
    pub feature_id: String,
    /// Unit vector of the approach, of the tool relative to the workpiece, machine frame.
    pub approach: Vector3<f64>,
    /// Feed along it when the latch came, mm/s.
    pub feed_mm_s: f64,
    /// Where the axes were (mm, rad).
    pub position: PerAxis<f64>,
    /// Nearest tick of the run's motion; none where the motion was not recorded.
    pub tick: Option<usize>,
}

/// Which instrument, and which of its coordinates.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Channel {
    /// Motor encoder minus command.
    Motor(Axis),
    /// Linear scale minus command.
    Scale(Axis),
    /// First coordinate of the grid encoder.
    GridU,
    /// Second coordinate of the grid encoder.
    GridV,
    /// Ballbar or other radial instrument.
    Radial,
    /// Length reference along (or mostly along) an axis.
    Length(Axis),
    /// Touch, along its approach.
    Touch,
    /// A thermometer, by its name in the machine file.
    Thermometer(String),
}

/// What takes readings: the channels of one device together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Instrument {
    /// The motor encoders.
    Motor,
    /// The linear scales.
    Scale,
    /// The grid encoder.
    Grid,
    /// Ballbar or other radial instrument.
    Radial,
    /// The length reference.
    Length,
    /// The touch probe.
    Touch,
    /// The thermometers.
    Thermometer,
}

impl Channel {
    /// The device that it belongs to.
    #[must_use]
    pub const fn instrument(&self) -> Instrument {
        match self {
            Self::Motor(_) => Instrument::Motor,
            Self::Scale(_) => Instrument::Scale,
            Self::GridU | Self::GridV => Instrument::Grid,
            Self::Radial => Instrument::Radial,
            Self::Length(_) => Instrument::Length,
            Self::Touch => Instrument::Touch,
            Self::Thermometer(_) => Instrument::Thermometer,
        }
    }
}

impl Run {
    /// Instant of a reading, s since the session's start; none where it refers to nothing.
    #[must_use]
    pub fn time_of(&self, reading: &Reading) -> Option<f64> {
        if reading.channel == Channel::Touch {
            return self.touches.get(reading.at).map(|touch| touch.time_s);
        }
        let here_s = *self.motion.time_s.get(reading.at)?;
        let next_s = self.motion.time_s.get(reading.at + 1).unwrap_or(&here_s);
        Some(here_s + (next_s - here_s) * reading.fraction)
    }
}

/// One reading, as a deviation from what the commands say.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// Of what.
    pub channel: Channel,
    /// Tick of the motion (of [`Channel::Touch`]: the touch) at or before it.
    pub at: usize,
    /// How far towards the next tick it was read, 0 to 1.
    pub fraction: f64,
    /// Measured minus nominal, mm (K for a thermometer, rad for a rotary axis).
    pub deviation: f64,
}

impl fmt::Display for Instrument {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Motor => "motor",
            Self::Scale => "scale",
            Self::Grid => "grid",
            Self::Radial => "radial",
            Self::Length => "length",
            Self::Touch => "touch",
            Self::Thermometer => "thermometer",
        })
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Motor(axis) => write!(f, "motor.{axis}"),
            Self::Scale(axis) => write!(f, "scale.{axis}"),
            Self::GridU => f.write_str("grid.u"),
            Self::GridV => f.write_str("grid.v"),
            Self::Radial => f.write_str("radial"),
            Self::Length(axis) => write!(f, "length.{axis}"),
            Self::Touch => f.write_str("touch"),
            Self::Thermometer(id) => write!(f, "temperature.{id}"),
        }
    }
}
