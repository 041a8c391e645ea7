//! A step that runs a trajectory over the plate of a grid encoder.

use machine::trajectory::{Arrival, Pace, PlanarOrder, Shape, Trajectory, planar};
use machine::{MachineFile, TrajectoryError};
use metrology::sample::Sense;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::SequencerError;

/// A planar trajectory; which of the lengths and angles it has follows from `trajectory`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridStep {
    /// Which shape.
    pub trajectory: GridTrajectory,
    /// Placement of the plate in the machine file.
    pub placement: String,
    /// Centre of the shape from the plate's centre, along the plane's axes.
    #[serde(default)]
    pub offset_mm: [f64; 2],
    /// Radius of a circle, an arc, or the first of two.
    #[serde(default)]
    pub radius_mm: Option<f64>,
    /// Radius of the second of two arcs.
    #[serde(default)]
    pub second_radius_mm: Option<f64>,
    /// Direction in which a circle or an arc begins.
    #[serde(default)]
    pub from_deg: Option<f64>,
    /// Angle that an arc sweeps.
    #[serde(default)]
    pub swept_deg: Option<f64>,
    /// Direction of a line.
    #[serde(default)]
    pub angle_deg: Option<f64>,
    /// Angle between the lines of a corner.
    #[serde(default)]
    pub between_deg: Option<f64>,
    /// Length of a line, or of each line.
    #[serde(default)]
    pub length_mm: Option<f64>,
    /// Feed.
    pub feed_mm_min: f64,
    /// Sense or senses in which it is run.
    #[serde(default)]
    pub sense: Senses,
    /// Stops; with `dwell_s`.
    #[serde(default)]
    pub stations: Option<u32>,
    /// Rest at each stop.
    #[serde(default)]
    pub dwell_s: Option<f64>,
    /// Run through instead of stopping.
    #[serde(default)]
    pub on_the_fly: bool,
    /// How often, in each sense.
    #[serde(default = "once")]
    pub repeats: u32,
    /// Whether the count is set to zero anew before each run; otherwise only where it must be.
    #[serde(default)]
    pub rezero: bool,
}

const fn once() -> u32 {
    1
}

/// Name of a shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "as in machine::trajectory::Shape")]
pub enum GridTrajectory {
    Circle,
    Arc,
    Line,
    Spike,
    Corner,
    ArcWithLine,
    TwoArcs,
}

/// Sense or senses of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Senses {
    /// Clockwise, or backwards.
    Cw,
    /// Counter-clockwise, or forwards.
    #[default]
    Ccw,
    /// Counter-clockwise, then clockwise.
    Both,
}

impl Senses {
    /// The senses in the order in which they are run.
    #[must_use]
    pub const fn list(self) -> &'static [Sense] {
        match self {
            Self::Cw => &[Sense::Clockwise],
            Self::Ccw => &[Sense::CounterClockwise],
            Self::Both => &[Sense::CounterClockwise, Sense::Clockwise],
        }
    }
}

impl GridTrajectory {
    /// In words, for displays.
    const fn in_words(self) -> &'static str {
        match self {
            Self::Circle => "circle",
            Self::Arc => "arc",
            Self::Line => "line",
            Self::Spike => "line there and back",
            Self::Corner => "corner of two lines",
            Self::ArcWithLine => "arc that runs into a line",
            Self::TwoArcs => "two arcs in a row",
        }
    }
}

impl GridStep {
    /// In words, for displays.
    pub(crate) fn activity(&self) -> String {
        let stops = match (self.on_the_fly, self.stations) {
            (false, Some(stations)) => format!(" with {stations} stops"),
            _ => String::new(),
        };
        let (shape, plate) = (self.trajectory.in_words(), &self.placement);
        format!(
            "grid encoder {plate}: {shape}{stops} at {} mm/min",
            self.feed_mm_min
        )
    }

    /// The program of one run.
    ///
    /// # Errors
    /// As [`planar`].
    pub(crate) fn program(
        &self,
        step: usize,
        machine: &MachineFile,
        sense: Sense,
        arrival: Arrival,
    ) -> Result<Trajectory, SequencerError> {
        self.paced(step, machine, sense, arrival, self.pace(step)?)
    }

    /// The program of one run at another pace.
    ///
    /// # Errors
    /// As [`planar`].
    pub(crate) fn paced(
        &self,
        step: usize,
        machine: &MachineFile,
        sense: Sense,
        arrival: Arrival,
        pace: Pace,
    ) -> Result<Trajectory, SequencerError> {
        let order = PlanarOrder {
            placement: &self.placement,
            shape: self.shape(step)?,
            offset_mm: self.offset_mm,
            feed_mm_min: self.feed_mm_min,
            sense,
            pace,
            arrival,
        };
        planar(machine, &order).map_err(|source| in_step(step, source))
    }

    fn pace(&self, step: usize) -> Result<Pace, SequencerError> {
        match (self.on_the_fly, self.stations, self.dwell_s) {
            (true, None, None) => Ok(Pace::OnTheFly),
            (true, Some(_), _) => Err(superfluous(step, "stations", "on_the_fly")),
            (true, None, Some(_)) => Err(superfluous(step, "dwell_s", "on_the_fly")),
            (false, Some(stations), Some(dwell_s)) => Ok(Pace::Stationwise { stations, dwell_s }),
            (false, None, _) => Err(missing(step, "stations", "a trajectory with stops")),
            (false, Some(_), None) => Err(missing(step, "dwell_s", "a trajectory with stops")),
        }
    }

    /// What the shape is called and which lengths and angles it has.
    const fn keys(&self) -> (&'static str, &'static [&'static str]) {
        match self.trajectory {
            GridTrajectory::Circle => ("a circle", &["radius_mm", "from_deg"]),
            GridTrajectory::Arc => ("an arc", &["radius_mm", "from_deg", "swept_deg"]),
            GridTrajectory::Line => ("a line", &["angle_deg", "length_mm"]),
            GridTrajectory::Spike => ("a spike", &["angle_deg", "length_mm"]),
            GridTrajectory::Corner => ("a corner", &["angle_deg", "between_deg", "length_mm"]),
            GridTrajectory::ArcWithLine => (
                "an arc with line",
                &["angle_deg", "length_mm", "radius_mm", "swept_deg"],
            ),
            GridTrajectory::TwoArcs => (
                "two arcs",
                &["angle_deg", "radius_mm", "second_radius_mm", "swept_deg"],
            ),
        }
    }

    fn shape(&self, step: usize) -> Result<Shape, SequencerError> {
        let (name, keys) = self.keys();
        let given = self.given();
        if let Some((key, _)) = given
            .iter()
            .find(|(key, value)| value.is_some() && !keys.contains(key))
        {
            return Err(superfluous(step, key, name));
        }
        let value = |key: &'static str| {
            let found = given.iter().find(|(known, _)| *known == key);
            match (found.and_then(|(_, value)| *value), key) {
                (Some(value), _) => Ok(value),
                // A circle begins on the plane's first axis unless it says otherwise.
                (None, "from_deg") if self.trajectory == GridTrajectory::Circle => Ok(0.0),
                (None, _) => Err(missing(step, key, name)),
            }
        };
        let angle = |key| Ok::<_, SequencerError>(value(key)?.to_radians());
        Ok(match self.trajectory {
            GridTrajectory::Circle => Shape::Circle {
                radius_mm: value("radius_mm")?,
                from_rad: angle("from_deg")?,
            },
            GridTrajectory::Arc => Shape::Arc {
                radius_mm: value("radius_mm")?,
                from_rad: angle("from_deg")?,
                swept_rad: angle("swept_deg")?,
            },
            GridTrajectory::Line => Shape::Line {
                angle_rad: angle("angle_deg")?,
                length_mm: value("length_mm")?,
            },
            GridTrajectory::Spike => Shape::Spike {
                angle_rad: angle("angle_deg")?,
                length_mm: value("length_mm")?,
            },
            GridTrajectory::Corner => Shape::Corner {
                angle_rad: angle("angle_deg")?,
                between_rad: angle("between_deg")?,
                leg_mm: value("length_mm")?,
            },
            GridTrajectory::ArcWithLine => Shape::ArcWithLine {
                angle_rad: angle("angle_deg")?,
                line_mm: value("length_mm")?,
                radius_mm: value("radius_mm")?,
                swept_rad: angle("swept_deg")?,
            },
            GridTrajectory::TwoArcs => Shape::TwoArcs {
                angle_rad: angle("angle_deg")?,
                radii_mm: [value("radius_mm")?, value("second_radius_mm")?],
                swept_rad: angle("swept_deg")?,
            },
        })
    }

    fn given(&self) -> [(&'static str, Option<f64>); 7] {
        [
            ("radius_mm", self.radius_mm),
            ("second_radius_mm", self.second_radius_mm),
            ("from_deg", self.from_deg),
            ("swept_deg", self.swept_deg),
            ("angle_deg", self.angle_deg),
            ("between_deg", self.between_deg),
            ("length_mm", self.length_mm),
        ]
    }
}

fn missing(step: usize, key: &'static str, of: &'static str) -> SequencerError {
    SequencerError::KeyMissing { step, key, of }
}

fn superfluous(step: usize, key: &'static str, of: &'static str) -> SequencerError {
    SequencerError::KeySuperfluous { step, key, of }
}

pub(crate) fn in_step(step: usize, source: TrajectoryError) -> SequencerError {
    SequencerError::Trajectory { step, source }
}
