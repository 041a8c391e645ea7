//! Parameters of the sequencer.

use metrology::ParameterDoc;
use serde::{Deserialize, Serialize};

/// Parameters; see the README's table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Machine file, relative to the parameter file.
    pub machine_file: String,
    /// Plan file, relative to the parameter file; empty: wait for goals.
    pub plan_file: String,
    /// Wait before the first step, so that a live graph has found itself.
    pub start_delay_s: f64,
    /// Wait before a goal that no controller took is proposed again.
    pub retry_delay_s: f64,
    /// How often a goal is proposed before the step has failed.
    pub attempts: u32,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            machine_file: String::new(),
            plan_file: String::new(),
            start_delay_s: 0.5,
            retry_delay_s: 1.0,
            attempts: 30,
        }
    }
}

/// What the parameters mean.
pub const PARAMETERS: &[ParameterDoc] = &[
    ParameterDoc {
        name: "machine_file",
        unit: "",
        description: "Machine file, relative to the parameter file.",
        range: None,
    },
    ParameterDoc {
        name: "plan_file",
        unit: "",
        description: "Plan of steps, relative to the parameter file; empty: wait for goals.",
        range: None,
    },
    ParameterDoc {
        name: "start_delay_s",
        unit: "s",
        description: "Wait before the first step, so that a live graph has found itself.",
        range: Some((0.0, 3600.0)),
    },
    ParameterDoc {
        name: "retry_delay_s",
        unit: "s",
        description: "Wait before a program that no controller took is proposed again.",
        range: Some((0.01, 3600.0)),
    },
    ParameterDoc {
        name: "attempts",
        unit: "",
        description: "How often a program is proposed before its step has failed.",
        range: Some((1.0, 10_000.0)),
    },
];
