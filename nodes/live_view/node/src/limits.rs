//! Limits of the offsets, from the parameters of axis_compensation.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use metrology::Axis;
use node_runtime::Setup;
use node_runtime::arguments::Arguments;
use node_runtime::parameter::Value;

/// Node with the parameters.
const NODE: &str = "axis_compensation";

/// Axis of a limit's parameter.
fn axis(parameter: &str) -> Option<Axis> {
    let name = parameter
        .strip_prefix("axes.")?
        .strip_suffix(".size_limit_um")?;
    name.parse().ok()
}

/// The greatest offset of each axis, µm, that the parameters of axis_compensation allow.
///
/// # Errors
/// When a parameter is of no type that ROS has.
pub fn limits_of(compensation: &Setup) -> Result<BTreeMap<Axis, f64>> {
    let mut limits_um = BTreeMap::new();
    for parameter in compensation.parameters(&[])? {
        let value_um = match parameter.value {
            Value::Double(value) => value,
            Value::Integer(value) => value as f64,
            _ => continue,
        };
        if let Some(axis) = axis(&parameter.name) {
            limits_um.insert(axis, value_um);
        }
    }
    Ok(limits_um)
}

/// The same from a parameter file.
///
/// # Errors
/// When it cannot be read or has no limit.
pub(crate) fn limits_in(path: &Path) -> Result<BTreeMap<Axis, f64>> {
    let file = path.display().to_string();
    let words = ["--ros-args", "--params-file", &file].map(str::to_owned);
    let limits_um = limits_of(&Setup::new(NODE, &Arguments::parse(words)?)?)?;
    anyhow::ensure!(
        !limits_um.is_empty(),
        "compensation_file: {file}: no axes.AXIS.size_limit_um of {NODE}"
    );
    Ok(limits_um)
}
