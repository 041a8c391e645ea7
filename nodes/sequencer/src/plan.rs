//! The plan: what a scenario does, step by step.

mod grid;
mod linear;

use metrology::BoundError;
use metrology::yaml::{self, Places, YamlError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bounds;
use crate::rotary::RotaryStep;
use crate::touch_along::TouchAlongStep;

pub use grid::{GridStep, GridTrajectory, Senses};
pub use linear::{DiagonalStep, PositioningStep};

/// A whole plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// One line for displays.
    pub title: String,
    /// The steps in order.
    pub steps: Vec<Step>,
}

/// One step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Step {
    /// Touches the three faces of each block.
    Blocks {
        /// Block names; empty: all.
        #[serde(default)]
        blocks: Vec<String>,
        /// Whether this is the cold reference.
        #[serde(default)]
        cold: bool,
    },
    /// Touches one face of one block at several feeds.
    Latency {
        /// Feature to touch, e.g. `block_1.z`.
        feature: String,
        /// Feeds.
        feeds_mm_min: Vec<f64>,
        /// Touches at each feed.
        repeats: u32,
    },
    /// Touches a plane, bore, boss or sphere of the machine file.
    Artefact {
        /// Its name.
        id: String,
        /// Touches.
        points: u32,
    },
    /// Touches a sphere at several poses of the rotary axes.
    Rotary(RotaryStep),
    /// Touches a sphere along given directions of the probe's axis.
    TouchAlong(TouchAlongStep),
    /// Switches the compensation.
    Compensation {
        /// On or off.
        enable: bool,
    },
    /// Repeats a part program for a while, with block cycles in between when they are asked for.
    Produce {
        /// Name of the program.
        program: String,
        /// How long.
        minutes: f64,
        /// Whether update requests of the thermal model are served.
        serve_updates: bool,
    },
    /// Runs a program once, as poses at which the tool error is checked.
    Verify {
        /// Name of the program.
        program: String,
        /// Which check this is, for reports.
        label: String,
    },
    /// Lets time pass, e.g. until a compensation has faded.
    Wait {
        /// How long.
        seconds: f64,
    },
    /// Runs a program once.
    Run {
        /// Name of the program.
        program: String,
    },
    /// Runs a trajectory over the plate of a grid encoder.
    Grid(GridStep),
    /// Stops at targets along one axis, up and down.
    Positioning(PositioningStep),
    /// Runs through along one axis, up and down.
    Scan(PositioningStep),
    /// Stops at targets along beams, up and down.
    Diagonals(DiagonalStep),
}

/// Why a text is no plan.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// It is no YAML, or a key is unknown, missing or of the wrong type; the message has line and column.
    #[error(transparent)]
    Syntax(#[from] YamlError),
    /// A number is out of its bound.
    #[error("{line}:{column}: {source}")]
    Bound {
        /// Line of the number.
        line: usize,
        /// Column of the number.
        column: usize,
        /// Place, value and bound.
        source: BoundError,
    },
}

impl Plan {
    /// Reads a plan from its text.
    ///
    /// # Errors
    /// When a key is unknown, missing or of the wrong type, or a number is out of its bound; the message begins with the line.
    pub fn from_yaml(text: &str) -> Result<Self, PlanError> {
        let plan: Self = yaml::read_letters(text)?;
        bounds::of_plan(&plan).map_err(|source| {
            let place = Places::of(text).known(source.place());
            PlanError::Bound {
                line: place.map_or(1, |at| at.line),
                column: place.map_or(1, |at| at.column),
                source,
            }
        })?;
        Ok(plan)
    }
}

impl Step {
    /// In words, for displays.
    #[must_use]
    pub fn activity(&self) -> String {
        match self {
            Self::Blocks { cold: true, .. } => {
                "measuring the blocks as the cold reference".to_owned()
            }
            Self::Blocks { .. } => "measuring the blocks".to_owned(),
            Self::Latency { feature, .. } => {
                format!("calibrating the probe's latency on {feature}")
            }
            Self::Artefact { id, .. } => format!("touching {id}"),
            Self::Rotary(step) => step.activity(),
            Self::TouchAlong(step) => step.activity(),
            Self::Compensation { enable } => {
                format!(
                    "switching compensation {}",
                    if *enable { "on" } else { "off" }
                )
            }
            Self::Produce {
                program, minutes, ..
            } => format!("production with {program} for {minutes} min"),
            Self::Verify { label, .. } => format!("verification of the tool error, {label}"),
            Self::Wait { seconds } => format!("waiting for {seconds} s"),
            Self::Run { program } => format!("running {program} once"),
            Self::Grid(step) => step.activity(),
            Self::Positioning(step) => format!("positioning test of axis {}", step.axis),
            Self::Scan(step) => format!("scan along axis {}", step.axis),
            Self::Diagonals(step) => format!("diagonal test along {}", step.beams.join(", ")),
        }
    }
}
