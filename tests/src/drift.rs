//! A short cell that works at 1 kHz and is compensated by a drift that is the same everywhere.

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::msg::{AxisDrift, ThermalModel};

use crate::scenario::Scenario;

/// The drift, m.
pub const DRIFT_M: f64 = 20e-6;
/// What is left of it when it has faded, m: friction holds the motors so far from where they should be.
pub const FADED_M: f64 = 1.5e-6;
/// What counts as compensated again, m.
pub const COMPENSATED_M: f64 = 19e-6;
/// An offset is as old as the state that it answers; younger than this it is fresh, s.
pub const FRESH_S: f64 = 0.05;
/// The controller follows and fades at 40 um/s: 0.5 s for all of it.
const RATES: &str = "background_rate_hz: 1000.0\n    compensation_hold_s: 0.2\n    compensation_fade_um_s: 40.0\n    \
                     compensation_rate_limit_um_s: 40.0";

/// The cell's files.
#[must_use]
pub fn scenario() -> Scenario {
    let scenario = Scenario::copy_of("short_cell");
    scenario.replace("fake_cnc.yaml", "background_rate_hz: 10.0", RATES);
    scenario.replace("axis_compensation.yaml", "enabled: false", "enabled: true");
    for axis in ["X", "Y", "Z"] {
        let limits = format!("{axis}: {{size_limit_um: 150.0, rate_limit_um_per_s: 20.0");
        let faster = format!("{axis}: {{size_limit_um: 150.0, rate_limit_um_per_s: 60.0");
        scenario.replace("axis_compensation.yaml", &limits, &faster);
    }
    scenario
}

/// The drift as a model that holds for half an hour from `at`.
#[must_use]
pub fn model(at: &Time) -> ThermalModel {
    let until = Time {
        sec: at.sec + 1800,
        nanosec: at.nanosec,
    };
    let mut model = ThermalModel {
        n_blocks: 2,
        lack_of_fit_p: 1.0,
        sequence: 1,
        valid_from: at.clone(),
        valid_until: until,
        ..ThermalModel::default()
    };
    model.header.stamp = at.clone();
    model.axes = ["X", "Y", "Z"]
        .map(|axis| AxisDrift {
            axis: axis.to_owned(),
            k0_m: DRIFT_M,
            covariance: std::array::from_fn(|entry| if entry == 0 { 1e-14 } else { 0.0 }),
            span_m: [-0.3, 0.3],
            offset_identifiable: true,
            slope_identifiable: true,
            ..AxisDrift::default()
        })
        .into();
    model
}
