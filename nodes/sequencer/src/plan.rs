//! The plan: what a scenario does, step by step.

use serde::{Deserialize, Serialize};

/// A whole plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// One line for displays.
    pub title: String,
    /// The steps in order.
    pub steps: Vec<Step>,
}

/// One step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
}

impl Step {
    /// In words, for displays.
    #[must_use]
    pub fn activity(&self) -> String {
        match self {
            Self::Blocks { cold: true, .. } => "cold reference of the blocks".to_owned(),
            Self::Blocks { .. } => "block cycle".to_owned(),
            Self::Latency { feature, .. } => format!("latency calibration on {feature}"),
            Self::Artefact { id, .. } => format!("touching {id}"),
            Self::Compensation { enable } => {
                format!("compensation {}", if *enable { "on" } else { "off" })
            }
            Self::Produce {
                program, minutes, ..
            } => format!("{program} for {minutes} min"),
            Self::Verify { label, .. } => format!("verification: {label}"),
            Self::Wait { seconds } => format!("waiting {seconds} s"),
            Self::Run { program } => format!("running {program}"),
        }
    }
}
