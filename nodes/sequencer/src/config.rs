//! Parameters of the sequencer.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters; see the README's table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Machine file, relative to the parameter file.
    pub machine_file: String,
    /// Plan of steps, relative to the parameter file; empty: wait for goals.
    pub plan_file: String,
    /// Wait before the first step, so that a live graph has found itself.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub start_delay_s: f64,
    /// Wait before a program that no controller took is proposed again.
    #[schemars(range(min = 0.01, max = 3600.0))]
    pub retry_delay_s: f64,
    /// How often a program is proposed before its step has failed.
    #[schemars(range(min = 1.0, max = 10_000.0))]
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
