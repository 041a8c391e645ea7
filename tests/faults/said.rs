//! Messages as a good publisher says them.

use abbe_msgs::builtin_interfaces::msg::Time;
use abbe_msgs::msg::{AxisDrift, AxisState, ThermalModel};

/// An instant `nanos` later.
pub fn later(time: &Time, nanos: i64) -> Time {
    let all = i64::from(time.sec) * 1_000_000_000 + i64::from(time.nanosec) + nanos;
    Time {
        sec: i32::try_from(all.div_euclid(1_000_000_000)).unwrap(),
        nanosec: u32::try_from(all.rem_euclid(1_000_000_000)).unwrap(),
    }
}

/// Positions of a machine that stands at X = `x_m`.
pub fn state(at: &Time, x_m: f64) -> AxisState {
    let mut state = AxisState::default();
    state.header.stamp = at.clone();
    state.controller_stamp = at.clone();
    state.axis = ["X", "Y", "Z"].map(str::to_owned).into();
    state.commanded = vec![x_m, 0.0, 0.2];
    state.motor = vec![x_m, 0.0, 0.2];
    state.scale = vec![f64::NAN; 3];
    state.velocity = vec![0.0; 3];
    state
}

/// A model whose drift of X grows with the position by `slope`.
pub fn model(at: &Time, slope: f64) -> ThermalModel {
    let mut model = ThermalModel {
        n_blocks: 2,
        lack_of_fit_p: 1.0,
        sequence: 1,
        ..ThermalModel::default()
    };
    model.header.stamp = at.clone();
    model.valid_from = at.clone();
    model.valid_until = later(at, 1_800_000_000_000);
    let axis = |axis: &str, slope: f64| AxisDrift {
        axis: axis.to_owned(),
        slope,
        covariance: std::array::from_fn(|entry| if entry == 0 { 1e-14 } else { 0.0 }),
        span_m: [-0.3, 0.3],
        offset_identifiable: true,
        slope_identifiable: true,
        ..AxisDrift::default()
    };
    model.axes = vec![axis("X", slope), axis("Y", 0.0), axis("Z", 0.0)];
    model
}
