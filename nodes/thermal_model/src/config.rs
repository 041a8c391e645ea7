//! Parameters of the thermal model; keys carry their units, limits are checked once.

use metrology::{check_between, check_parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ThermalModelError;

/// Limits of the update period ct of the published method, min.
pub const UPDATE_PERIOD_LIMITS_MIN: (f64, f64) = (10.0, 20.0);
/// Limits of the time for which a model may be used, min.
const VALIDITY_LIMITS_MIN: (f64, f64) = (10.0, 240.0);
/// Limits of the longest time constant, min.
const LONGEST_LIMITS_MIN: (f64, f64) = (1.0, 14_400.0);

/// Which fit turns the drifts at the blocks into a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The published line per axis through exactly two blocks.
    TwoBlock,
    /// Weighted least squares over two blocks or more.
    NBlock,
}

/// What a confirmed jump of one block alone means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SingleBlockJump {
    /// Drift of the machine: it enters the model.
    #[default]
    Accept,
    /// The block was pushed: its cold reference moves along, the model does not.
    Rebase,
}

/// All parameters. Physical ones have no default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThermalModelConfig {
    /// two_block (published line through two blocks) or n_block (least squares).
    pub method: Method,
    /// Greatest time between updates (ct).
    #[schemars(range(min = UPDATE_PERIOD_LIMITS_MIN.0, max = UPDATE_PERIOD_LIMITS_MIN.1))]
    pub update_period_min: f64,
    /// How long a model may be used after its blocks were touched.
    #[schemars(range(min = VALIDITY_LIMITS_MIN.0, max = VALIDITY_LIMITS_MIN.1))]
    pub validity_min: f64,
    /// Error over the travel that an uncertain slope or rotation may make before it is left out.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub slope_error_limit_um: f64,
    /// Fastest drift that heat can make; a faster change is quarantined.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub physical_rate_um_per_min: f64,
    /// Predicted drift since the last update that asks for the next.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub drift_limit_um: f64,
    /// accept or rebase: what a confirmed jump of one block alone means.
    #[serde(default)]
    pub single_block_jump: SingleBlockJump,
    /// Operation of the block cycles.
    #[serde(default)]
    pub cycle: CycleConfig,
    /// Extrapolation with a time constant.
    #[serde(default)]
    pub relaxation: RelaxationConfig,
    /// Extrapolation with temperatures.
    #[serde(default)]
    pub temperature: TemperatureConfig,
    /// Detection of load changes.
    #[serde(default)]
    pub load: LoadConfig,
    /// Machine file, relative to the parameter file.
    #[serde(default)]
    pub machine_file: String,
}

/// Operation of the block cycles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CycleConfig {
    /// Least time between updates that a rule other than the period may ask for.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub least_period_min: f64,
    /// Time after which an unanswered request is repeated.
    #[schemars(range(min = 0.1, max = 60.0))]
    pub repeat_min: f64,
    /// Time beyond the period after which a missing update is reported.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub overrun_min: f64,
    /// Time after the last touch at which a cycle with blocks missing is closed.
    #[schemars(range(min = 1.0, max = 3600.0))]
    pub window_s: f64,
    /// Time after the end of a block segment for which late measurements are awaited.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub late_s: f64,
    /// Whether faces touched one after another are brought to one instant.
    pub align_faces: bool,
    /// Backward steps of time up to this are disorder, beyond it a changed clock.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub clock_tolerance_s: f64,
}

impl Default for CycleConfig {
    fn default() -> Self {
        Self {
            least_period_min: 5.0,
            repeat_min: 2.0,
            overrun_min: 5.0,
            window_s: 300.0,
            late_s: 5.0,
            align_faces: true,
            clock_tolerance_s: 1.0,
        }
    }
}

/// Extrapolation between updates with a time constant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RelaxationConfig {
    /// Whether drift is extrapolated with a time constant.
    pub enabled: bool,
    /// Updates that are fitted, the latest.
    #[schemars(range(min = 3.0, max = 24.0))]
    pub updates: usize,
    /// Shortest time constant that is looked for.
    #[schemars(range(min = 0.1, max = 1440.0))]
    pub shortest_min: f64,
    /// Longest time constant that is looked for.
    #[schemars(range(min = LONGEST_LIMITS_MIN.0, max = LONGEST_LIMITS_MIN.1))]
    pub longest_min: f64,
    /// Ratio of the ends of the 95 % interval above which a time constant is not identifiable.
    #[schemars(range(min = 1.1, max = 100.0))]
    pub interval_ratio_limit: f64,
}

impl Default for RelaxationConfig {
    fn default() -> Self {
        Self {
            enabled: true,
            updates: 5,
            shortest_min: 4.0,
            longest_min: 720.0,
            interval_ratio_limit: 4.0,
        }
    }
}

/// Extrapolation between updates with temperatures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TemperatureConfig {
    /// Whether drift is extrapolated with temperatures.
    pub enabled: bool,
    /// Time over which readings are averaged.
    #[schemars(range(min = 1.0, max = 600.0))]
    pub window_s: f64,
    /// Age at which a sensor's last reading no longer counts.
    #[schemars(range(min = 1.0, max = 3600.0))]
    pub stale_s: f64,
    /// Updates that are used, the latest.
    #[schemars(range(min = 5.0, max = 200.0))]
    pub updates: usize,
    /// Share of the residual of holding that the left-out residual must stay under.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub proof_ratio: f64,
    /// Time between models that temperatures renew between block cycles.
    #[schemars(range(min = 0.1, max = 600.0))]
    pub publish_period_s: f64,
}

impl Default for TemperatureConfig {
    fn default() -> Self {
        Self {
            enabled: true,
            window_s: 60.0,
            stale_s: 60.0,
            updates: 24,
            proof_ratio: 0.7,
            publish_period_s: 10.0,
        }
    }
}

/// Detection of load changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LoadConfig {
    /// Sensor whose slope shows the spindle's load; empty for none.
    pub sensor: String,
    /// Change of that slope between two windows that is a change of load.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub slope_change_k_per_min: f64,
    /// Length of each window.
    #[schemars(range(min = 10.0, max = 3600.0))]
    pub window_s: f64,
    /// Pause of production that is a change of load; longer than a block cycle.
    #[schemars(range(min = 0.1, max = 240.0))]
    pub idle_min: f64,
}

impl Default for LoadConfig {
    fn default() -> Self {
        Self {
            sensor: String::new(),
            slope_change_k_per_min: 0.3,
            window_s: 120.0,
            idle_min: 5.0,
        }
    }
}

impl ThermalModelConfig {
    /// Checks every number against its limits.
    ///
    /// # Errors
    /// Names the first parameter outside its limits, with value and limits.
    pub fn check(&self) -> Result<(), ThermalModelError> {
        check_parameters(self)?;
        let of_validity = (self.update_period_min, VALIDITY_LIMITS_MIN.1);
        check_between("validity_min", self.validity_min, of_validity)?;
        let shortest_min = self.relaxation.shortest_min.next_up();
        let of_longest = (shortest_min, LONGEST_LIMITS_MIN.1);
        check_between(
            "relaxation.longest_min",
            self.relaxation.longest_min,
            of_longest,
        )?;
        Ok(())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn example() -> ThermalModelConfig {
        serde_saphyr::from_str(
            "{method: two_block, update_period_min: 15.0, validity_min: 40.0, slope_error_limit_um: 3.0, \
             physical_rate_um_per_min: 3.0, drift_limit_um: 8.0}",
        )
        .unwrap()
    }
    #[test]
    fn the_update_period_is_refused_outside_ten_to_twenty_minutes() {
        for (period_min, accepted) in [
            (9.99, false),
            (10.0, true),
            (20.0, true),
            (20.01, false),
            (f64::NAN, false),
        ] {
            let config = ThermalModelConfig {
                update_period_min: period_min,
                ..example()
            };
            assert_eq!(config.check().is_ok(), accepted, "{period_min}");
        }
        let config = ThermalModelConfig {
            update_period_min: 25.0,
            ..example()
        };
        assert_eq!(
            config.check().unwrap_err().to_string(),
            "update_period_min = 25 min: must be from 10 to 20 min"
        );
    }

    #[test]
    fn a_model_must_live_longer_than_the_period() {
        let config = ThermalModelConfig {
            validity_min: 12.0,
            ..example()
        };
        assert_eq!(
            config.check().unwrap_err().to_string(),
            "validity_min = 12 min: must be from 15 to 240 min"
        );
    }

    #[test]
    fn an_unknown_key_or_a_missing_physical_value_is_refused_by_name() {
        let unknown = serde_saphyr::from_str::<ThermalModelConfig>(
            "{method: n_block, update_period_s: 900.0, validity_min: 40.0, slope_error_limit_um: 3.0, \
             physical_rate_um_per_min: 3.0, drift_limit_um: 8.0}",
        );
        assert!(unknown.unwrap_err().to_string().contains("update_period_s"));
        let missing = serde_saphyr::from_str::<ThermalModelConfig>(
            "{method: n_block, update_period_min: 15.0}",
        );
        assert!(missing.unwrap_err().to_string().contains("validity_min"));
    }
}
