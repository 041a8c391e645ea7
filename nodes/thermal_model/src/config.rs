//! Parameters of the thermal model; keys carry their units, limits are checked once.

use metrology::ParameterDoc;
use serde::{Deserialize, Serialize};

use crate::error::ThermalModelError;

/// Limits of the update period ct of the published method, min.
pub const UPDATE_PERIOD_LIMITS_MIN: (f64, f64) = (10.0, 20.0);

/// Which fit turns the drifts at the blocks into a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The published line per axis through exactly two blocks.
    TwoBlock,
    /// Weighted least squares over two blocks or more.
    NBlock,
}

/// What a confirmed jump of one block alone means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SingleBlockJump {
    /// Drift of the machine: it enters the model.
    #[default]
    Accept,
    /// The block was pushed: its cold reference moves along, the model does not.
    Rebase,
}

/// All parameters. Physical ones have no default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThermalModelConfig {
    /// Which fit.
    pub method: Method,
    /// Greatest time between updates (ct).
    pub update_period_min: f64,
    /// How long a model may be used after its blocks were touched.
    pub validity_min: f64,
    /// Error over the travel that an uncertain slope or rotation may make before it is left out.
    pub slope_error_limit_um: f64,
    /// Fastest drift that heat can make; a faster change is quarantined.
    pub physical_rate_um_per_min: f64,
    /// Predicted drift since the last update that asks for the next.
    pub drift_limit_um: f64,
    /// What a confirmed jump of one block alone means.
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
    /// Machine file, relative to the parameter file; read by whoever builds the node.
    #[serde(default)]
    pub machine_file: String,
}

/// Operation of the block cycles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CycleConfig {
    /// Least time between updates that a rule other than the period may ask for.
    pub least_period_min: f64,
    /// Time after which an unanswered request is repeated.
    pub repeat_min: f64,
    /// Time beyond the period after which a missing update is reported.
    pub overrun_min: f64,
    /// Time after the last touch at which a cycle with blocks missing is closed.
    pub window_s: f64,
    /// Time after the end of a block segment for which late measurements are awaited.
    pub late_s: f64,
    /// Whether faces touched one after another are brought to one instant.
    pub align_faces: bool,
    /// Backward steps of time up to this are disorder, beyond it a changed clock.
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RelaxationConfig {
    /// Whether it is tried.
    pub enabled: bool,
    /// Updates that are fitted, the latest.
    pub updates: usize,
    /// Shortest time constant that is looked for.
    pub shortest_min: f64,
    /// Longest time constant that is looked for.
    pub longest_min: f64,
    /// Ratio of the ends of the 95 % interval above which a time constant is not identifiable.
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TemperatureConfig {
    /// Whether it is tried.
    pub enabled: bool,
    /// Time over which readings are averaged.
    pub window_s: f64,
    /// Age at which a sensor's last reading no longer counts.
    pub stale_s: f64,
    /// Updates that are used, the latest.
    pub updates: usize,
    /// Share of the residual of holding that the left-out residual must stay under.
    pub proof_ratio: f64,
    /// Time between models that temperatures renew between block cycles.
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LoadConfig {
    /// Sensor whose slope shows the spindle's load; empty: none.
    pub sensor: String,
    /// Change of that slope between two windows that is a change of load.
    pub slope_change_k_per_min: f64,
    /// Length of each window.
    pub window_s: f64,
    /// Pause of production that is a change of load; longer than a block cycle.
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

const fn row(
    name: &'static str,
    unit: &'static str,
    range: (f64, f64),
    description: &'static str,
) -> ParameterDoc {
    ParameterDoc {
        name,
        unit,
        description,
        range: Some(range),
    }
}

const fn word(name: &'static str, description: &'static str) -> ParameterDoc {
    ParameterDoc {
        name,
        unit: "",
        description,
        range: None,
    }
}

/// Every parameter with its unit, limits and meaning.
pub const PARAMETERS: &[ParameterDoc] = &[
    word(
        "method",
        "two_block (published line through two blocks) or n_block (least squares)",
    ),
    row(
        "update_period_min",
        "min",
        UPDATE_PERIOD_LIMITS_MIN,
        "greatest time between updates (ct)",
    ),
    row(
        "validity_min",
        "min",
        (10.0, 240.0),
        "how long a model may be used after its blocks were touched",
    ),
    row(
        "slope_error_limit_um",
        "µm",
        (0.1, 1000.0),
        "error over the travel that an uncertain slope or rotation may make before it is left out",
    ),
    row(
        "physical_rate_um_per_min",
        "µm/min",
        (0.01, 1000.0),
        "fastest drift that heat can make; a faster change is quarantined",
    ),
    row(
        "drift_limit_um",
        "µm",
        (0.1, 1000.0),
        "predicted drift since the last update that asks for the next",
    ),
    word(
        "single_block_jump",
        "accept or rebase: what a confirmed jump of one block alone means",
    ),
    row(
        "cycle.least_period_min",
        "min",
        (0.0, 20.0),
        "least time between updates that a rule other than the period may ask for",
    ),
    row(
        "cycle.repeat_min",
        "min",
        (0.1, 60.0),
        "time after which an unanswered request is repeated",
    ),
    row(
        "cycle.overrun_min",
        "min",
        (0.0, 60.0),
        "time beyond the period after which a missing update is reported",
    ),
    row(
        "cycle.window_s",
        "s",
        (1.0, 3600.0),
        "time after the last touch at which a cycle with blocks missing is closed",
    ),
    row(
        "cycle.late_s",
        "s",
        (0.0, 600.0),
        "time after the end of a block segment for which late measurements are awaited",
    ),
    word(
        "cycle.align_faces",
        "whether faces touched one after another are brought to one instant",
    ),
    row(
        "cycle.clock_tolerance_s",
        "s",
        (0.0, 60.0),
        "backward steps of time up to this are disorder, beyond it a changed clock",
    ),
    word(
        "relaxation.enabled",
        "whether drift is extrapolated with a time constant",
    ),
    row(
        "relaxation.updates",
        "",
        (3.0, 24.0),
        "updates that are fitted, the latest",
    ),
    row(
        "relaxation.shortest_min",
        "min",
        (0.1, 1440.0),
        "shortest time constant that is looked for",
    ),
    row(
        "relaxation.longest_min",
        "min",
        (1.0, 14400.0),
        "longest time constant that is looked for",
    ),
    row(
        "relaxation.interval_ratio_limit",
        "",
        (1.1, 100.0),
        "ratio of the ends of the 95 % interval above which a time constant is not identifiable",
    ),
    word(
        "temperature.enabled",
        "whether drift is extrapolated with temperatures",
    ),
    row(
        "temperature.window_s",
        "s",
        (1.0, 600.0),
        "time over which readings are averaged",
    ),
    row(
        "temperature.stale_s",
        "s",
        (1.0, 3600.0),
        "age at which a sensor's last reading no longer counts",
    ),
    row(
        "temperature.updates",
        "",
        (5.0, 200.0),
        "updates that are used, the latest",
    ),
    row(
        "temperature.proof_ratio",
        "",
        (0.01, 1.0),
        "share of the residual of holding that the left-out residual must stay under",
    ),
    row(
        "temperature.publish_period_s",
        "s",
        (0.1, 600.0),
        "time between models that temperatures renew between block cycles",
    ),
    word(
        "load.sensor",
        "sensor whose slope shows the spindle's load; empty for none",
    ),
    row(
        "load.slope_change_k_per_min",
        "K/min",
        (0.01, 100.0),
        "change of that slope between two windows that is a change of load",
    ),
    row(
        "load.window_s",
        "s",
        (10.0, 3600.0),
        "length of each window",
    ),
    row(
        "load.idle_min",
        "min",
        (0.1, 240.0),
        "pause of production that is a change of load; longer than a block cycle",
    ),
    ParameterDoc {
        name: "machine_file",
        unit: "",
        description: "Machine file, relative to the parameter file.",
        range: None,
    },
];

impl ThermalModelConfig {
    /// The value of each numeric parameter, by name.
    fn numbers(&self) -> [(&'static str, f64); 23] {
        let (c, r, t, l) = (&self.cycle, &self.relaxation, &self.temperature, &self.load);
        [
            ("update_period_min", self.update_period_min),
            ("validity_min", self.validity_min),
            ("slope_error_limit_um", self.slope_error_limit_um),
            ("physical_rate_um_per_min", self.physical_rate_um_per_min),
            ("drift_limit_um", self.drift_limit_um),
            ("cycle.least_period_min", c.least_period_min),
            ("cycle.repeat_min", c.repeat_min),
            ("cycle.overrun_min", c.overrun_min),
            ("cycle.window_s", c.window_s),
            ("cycle.late_s", c.late_s),
            ("cycle.clock_tolerance_s", c.clock_tolerance_s),
            ("relaxation.updates", r.updates as f64),
            ("relaxation.shortest_min", r.shortest_min),
            ("relaxation.longest_min", r.longest_min),
            ("relaxation.interval_ratio_limit", r.interval_ratio_limit),
            ("temperature.window_s", t.window_s),
            ("temperature.stale_s", t.stale_s),
            ("temperature.updates", t.updates as f64),
            ("temperature.proof_ratio", t.proof_ratio),
            ("temperature.publish_period_s", t.publish_period_s),
            ("load.slope_change_k_per_min", l.slope_change_k_per_min),
            ("load.window_s", l.window_s),
            ("load.idle_min", l.idle_min),
        ]
    }

    /// Checks every number against its limits.
    ///
    /// # Errors
    /// Names the first parameter outside its limits, with value and limits.
    pub fn check(&self) -> Result<(), ThermalModelError> {
        let given = self.numbers();
        for doc in PARAMETERS {
            let Some((lower, upper)) = doc.range else {
                continue;
            };
            let value = given
                .iter()
                .find_map(|(key, value)| (*key == doc.name).then_some(*value))
                .expect("a test compares the two lists");
            within(doc, value, lower, upper)?;
        }
        if self.validity_min < self.update_period_min {
            return Err(ThermalModelError::ParameterOutOfRange {
                key: "validity_min",
                value: self.validity_min,
                lower: self.update_period_min,
                upper: 240.0,
                unit: "min",
            });
        }
        if self.relaxation.longest_min <= self.relaxation.shortest_min {
            return Err(ThermalModelError::ParameterOutOfRange {
                key: "relaxation.longest_min",
                value: self.relaxation.longest_min,
                lower: self.relaxation.shortest_min,
                upper: 14400.0,
                unit: "min",
            });
        }
        Ok(())
    }
}

fn within(doc: &ParameterDoc, value: f64, lower: f64, upper: f64) -> Result<(), ThermalModelError> {
    if value >= lower && value <= upper {
        return Ok(());
    }
    Err(ThermalModelError::ParameterOutOfRange {
        key: doc.name,
        value,
        lower,
        upper,
        unit: doc.unit,
    })
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
    fn every_ranged_parameter_has_a_number_and_the_other_way_round() {
        let config = example();
        let ranged: Vec<_> = PARAMETERS
            .iter()
            .filter(|d| d.range.is_some())
            .map(|d| d.name)
            .collect();
        let numbers: Vec<_> = config.numbers().iter().map(|(key, _)| *key).collect();
        assert_eq!(ranged, numbers);
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

    #[test]
    fn the_readme_lists_every_parameter_with_unit_and_meaning() {
        let readme = include_str!("../README.md");
        for doc in PARAMETERS {
            let line = readme
                .lines()
                .find(|l| l.starts_with(&format!("| `{}` |", doc.name)));
            let line = line.unwrap_or_else(|| panic!("{} is missing", doc.name));
            assert!(line.contains(doc.description), "{line}");
            assert!(
                line.contains(&format!("| {} |", doc.unit)) || doc.unit.is_empty(),
                "{line}"
            );
        }
    }
}
