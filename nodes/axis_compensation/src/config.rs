//! Parameters of the compensation; keys carry their units, limits are checked once.

use std::collections::BTreeMap;

use machine::MachineFile;
use metrology::drift::Extrapolate;
use metrology::{Axis, check_between, check_parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::AxisCompensationError;
use crate::geometric::GeometricConfig;
use crate::positioning::config::PositioningConfig;

/// Limits of an offset's size, µm.
pub(crate) const SIZE_UM: (f64, f64) = (0.1, 5000.0);
/// Limits of its rate, µm/s.
pub(crate) const RATE_UM_PER_S: (f64, f64) = (0.001, 10000.0);
/// Limits of its acceleration, µm/s².
pub(crate) const ACCELERATION_UM_PER_S2: (f64, f64) = (0.001, 1e6);

/// All parameters. Those that protect the machine have no default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AxisCompensationConfig {
    /// The axes to compensate, with their limits.
    #[schemars(extend("keys" = ["X", "Y", "Z"]))]
    pub axes: BTreeMap<Axis, AxisLimitConfig>,
    /// linear, hold or refuse: what happens outside the blocks' span.
    pub extrapolate: Extrapolate,
    /// Fastest drift that heat can make; a model that changes faster is kept back.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub physical_rate_um_per_min: f64,
    /// Change between models that is never a jump.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub jump_margin_um: f64,
    /// Greatest expanded uncertainty (k = 2) of a drift at the travel's corners; beyond it the axis is refused.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub expanded_uncertainty_limit_um: f64,
    /// How long the last good value is held once the model is refused.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub hold_s: f64,
    /// Time in which an offset is faded to zero.
    #[schemars(range(min = 0.01, max = 3600.0))]
    pub fade_s: f64,
    /// The same at the end of the node, where that is shorter; the axes' limits of rate and acceleration hold
    /// all the same.
    #[serde(default = "default_shutdown_fade_s")]
    #[schemars(range(min = 0.01, max = 60.0))]
    pub shutdown_fade_s: f64,
    /// Silence of the axes' state after which it counts as stale.
    #[serde(default = "default_gap_s")]
    #[schemars(range(min = 0.001, max = 60.0))]
    pub gap_s: f64,
    /// Whether compensation is on from the start.
    #[serde(default = "default_enabled")]
    pub enabled: bool,
    /// Whether the node configures and activates itself at its start; otherwise somebody does so (`ros2 lifecycle
    /// set`).
    #[serde(default = "default_autostart")]
    pub autostart: bool,
    /// Dual loop of the axes that have a scale, or a table of their own.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schemars(extend("keys" = ["X", "Y", "Z"]))]
    pub positioning: BTreeMap<Axis, PositioningConfig>,
    /// What the geometric part needs; without it geometry models are not used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geometry: Option<GeometricConfig>,
    /// Machine file, relative to the parameter file.
    #[serde(default)]
    pub machine_file: String,
}

fn default_shutdown_fade_s() -> f64 {
    2.0
}

fn default_gap_s() -> f64 {
    0.5
}

fn default_enabled() -> bool {
    true
}

fn default_autostart() -> bool {
    true
}

/// Limits of one axis' offset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AxisLimitConfig {
    /// Greatest offset of the axis.
    #[schemars(range(min = SIZE_UM.0, max = SIZE_UM.1))]
    pub size_limit_um: f64,
    /// Greatest rate of the offset.
    #[schemars(range(min = RATE_UM_PER_S.0, max = RATE_UM_PER_S.1))]
    pub rate_limit_um_per_s: f64,
    /// Greatest acceleration of the offset.
    #[schemars(range(min = ACCELERATION_UM_PER_S2.0, max = ACCELERATION_UM_PER_S2.1))]
    pub acceleration_limit_um_per_s2: f64,
}

impl AxisCompensationConfig {
    /// Checks every number against its limits and the machine.
    ///
    /// # Errors
    /// Names the first parameter that is refused, with value and limits.
    pub fn check(&self, machine: &MachineFile) -> Result<(), AxisCompensationError> {
        check_parameters(self)?;
        if self.axes.is_empty() {
            return Err(AxisCompensationError::NoAxis);
        }
        for (&axis, limits) in &self.axes {
            if machine.linear(axis).is_none() {
                return Err(AxisCompensationError::NotALinearAxis { axis });
            }
            limits.check(axis, self.gap_s)?;
        }
        for (&axis, positioning) in &self.positioning {
            if !self.axes.contains_key(&axis) {
                return Err(AxisCompensationError::NotCompensated { axis });
            }
            positioning.check(axis, machine)?;
        }
        Ok(())
    }

    /// Longest time from the call to end until every offset is zero, s.
    ///
    /// The greatest offset S goes to zero in `shutdown_fade_s`, or at the rate limit R where that is
    /// slower. Each start and stop at the acceleration limit A costs R/A at most, and there are four:
    /// out of a motion, into the fade, out of it, and once more when the axes' states end meanwhile,
    /// which takes `gap_s` to be seen.
    #[must_use]
    pub fn wind_down_s(&self) -> f64 {
        let of_axis = |limits: &AxisLimitConfig| {
            let at_full_rate_s = limits.size_limit_um / limits.rate_limit_um_per_s;
            let start_s = limits.rate_limit_um_per_s / limits.acceleration_limit_um_per_s2;
            self.shutdown_fade_s.max(at_full_rate_s) + 4.0 * start_s
        };
        self.axes.values().map(of_axis).fold(0.0, f64::max) + self.gap_s
    }
}

impl AxisLimitConfig {
    fn check(&self, axis: Axis, gap_s: f64) -> Result<(), AxisCompensationError> {
        // A gap freezes the offset: at full rate it must be able to stop within the gap's own time.
        let least_acceleration = (self.rate_limit_um_per_s / gap_s).max(ACCELERATION_UM_PER_S2.0);
        let place = format!("axes.{axis}.acceleration_limit_um_per_s2");
        let limits = (least_acceleration, ACCELERATION_UM_PER_S2.1);
        check_between(&place, self.acceleration_limit_um_per_s2, limits)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = include_str!("../../../launch_configs/first_run/machine.yaml");

    fn check(config: &str) -> Result<(), AxisCompensationError> {
        let machine: MachineFile = serde_saphyr::from_str(MACHINE).unwrap();
        serde_saphyr::from_str::<AxisCompensationConfig>(config)
            .unwrap()
            .check(&machine)
    }

    fn config(axes: &str, rest: &str) -> String {
        format!(
            "{{axes: {{{axes}}}, extrapolate: hold, physical_rate_um_per_min: 3.0, jump_margin_um: 2.0, expanded_uncertainty_limit_um: 20.0, hold_s: 10.0, {rest}}}"
        )
    }

    const X: &str = "X: {size_limit_um: 200.0, rate_limit_um_per_s: 100.0, acceleration_limit_um_per_s2: 1000.0}";

    #[test]
    fn the_wind_down_is_the_slowest_axis_and_no_shorter_than_its_fade() {
        let of = |text: &str| {
            let config: AxisCompensationConfig = serde_saphyr::from_str(text).unwrap();
            config.wind_down_s()
        };
        let slow = "X: {size_limit_um: 150.0, rate_limit_um_per_s: 20.0, acceleration_limit_um_per_s2: 200.0}";
        assert!((of(&config(slow, "fade_s: 30.0")) - (7.5 + 0.4 + 0.5)).abs() < 1e-12);
        let quick = "X: {size_limit_um: 150.0, rate_limit_um_per_s: 400.0, acceleration_limit_um_per_s2: 4000.0}";
        let long = "fade_s: 30.0, shutdown_fade_s: 5.0, gap_s: 0.2";
        assert!((of(&config(quick, long)) - (5.0 + 0.4 + 0.2)).abs() < 1e-12);
    }

    #[test]
    fn values_outside_their_limits_are_refused_by_name_value_and_limit() {
        assert_eq!(check(&config(X, "fade_s: 5.0")), Ok(()));
        assert_eq!(
            check(&config(X, "fade_s: 0.0")).unwrap_err().to_string(),
            "fade_s = 0 s: must be from 0.01 to 3600 s"
        );
        let slow = "Y: {size_limit_um: 200.0, rate_limit_um_per_s: 100.0, acceleration_limit_um_per_s2: 50.0}";
        assert_eq!(
            check(&config(slow, "fade_s: 5.0")).unwrap_err().to_string(),
            "axes.Y.acceleration_limit_um_per_s2 = 50 µm/s²: must be from 200 to 1000000 µm/s²"
        );
        assert_eq!(
            check(&config("", "fade_s: 5.0")),
            Err(AxisCompensationError::NoAxis)
        );
        let rotary = X.replace('X', "C");
        assert_eq!(
            check(&config(&rotary, "fade_s: 5.0")),
            Err(AxisCompensationError::NotALinearAxis { axis: Axis::C })
        );
        assert!(check(&config(X, "fade_s: .nan")).is_err());
    }

    #[test]
    fn an_unknown_key_is_refused_by_name() {
        let wrong = serde_saphyr::from_str::<AxisCompensationConfig>(&config(X, "fade_ms: 5.0"));
        assert!(wrong.unwrap_err().to_string().contains("fade_ms"));
    }
}
