//! What a map and the numbers of its table may be on the machine that was measured.

use std::fmt;

use anyhow::{Result, bail};
use machine::MachineFile;
use metrology::Axis;

use super::map::{Map, Plane, Test};

/// Greatest deviation or displacement that an instrument reads, µm.
const DEVIATION_UM: f64 = 1e5;
/// Least and greatest temperature of a machine, degC.
const TEMPERATURE_DEGC: [f64; 2] = [-50.0, 200.0];

/// From where to where a number may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    low: f64,
    high: f64,
    what: &'static str,
}

impl Range {
    pub const fn new(low: f64, high: f64, what: &'static str) -> Self {
        Self { low, high, what }
    }

    pub fn holds(&self, number: f64) -> bool {
        (self.low..=self.high).contains(&number)
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "from {} to {} {}", self.low, self.high, self.what)
    }
}

fn travel(machine: &MachineFile, axis: Axis) -> Option<Range> {
    let [low, high] = machine.linear(axis)?.travel_mm;
    Some(Range::new(low, high, "mm, the axis' travel"))
}

/// Ranges of a test's columns, in their order.
pub fn ranges(test: &Test, machine: &MachineFile) -> Vec<Option<Range>> {
    let deviation = Some(Range::new(-DEVIATION_UM, DEVIATION_UM, "µm"));
    match test {
        Test::Positioning {
            axis, direction, ..
        } => {
            let direction = direction.iter().map(|_| None);
            let fixed = [None, travel(machine, *axis), deviation];
            fixed.into_iter().chain(direction).collect()
        }
        Test::Circle { .. } => vec![None, None, deviation],
        Test::Log {
            run,
            temperature_degc,
            ..
        } => {
            let [low, high] = TEMPERATURE_DEGC;
            let degc = Some(Range::new(low, high, "degC"));
            let run = run.iter().map(|_| None);
            let sensors = temperature_degc.iter().map(|_| degc);
            run.chain([None, deviation]).chain(sensors).collect()
        }
    }
}

/// Checks a map against the machine: axes, travels and feeds.
///
/// # Errors
/// Names the key, its value and the limit.
pub fn check(map: &Map, machine: &MachineFile) -> Result<()> {
    for (axis, at_mm) in &map.at_mm {
        within(machine, "at_mm", *axis, *at_mm)?;
    }
    match &map.test {
        Test::Positioning {
            axis, feed_mm_min, ..
        } => feed(machine, &[*axis], *feed_mm_min),
        Test::Circle {
            plane,
            centre_mm,
            radius_mm,
            feed_mm_min,
            ..
        } => {
            let axes = match plane {
                Plane::Xy => [Axis::X, Axis::Y],
                Plane::Yz => [Axis::Y, Axis::Z],
                Plane::Zx => [Axis::Z, Axis::X],
            };
            for axis in axes {
                for end in [-radius_mm, *radius_mm] {
                    let key = "centre_mm and radius_mm";
                    within(machine, key, axis, centre_mm[axis.index()] + end)?;
                }
            }
            feed(machine, &axes, *feed_mm_min)
        }
        Test::Log { axis, .. } => feed(machine, &[*axis], 0.0),
    }
}

fn within(machine: &MachineFile, key: &str, axis: Axis, at_mm: f64) -> Result<()> {
    let Some(range) = travel(machine, axis) else {
        bail!("{key}: the machine has no axis {axis}");
    };
    if !range.holds(at_mm) {
        bail!("{key}: {axis} = {at_mm} mm: must be {range}");
    }
    Ok(())
}

fn feed(machine: &MachineFile, axes: &[Axis], feed_mm_min: f64) -> Result<()> {
    for axis in axes {
        let Some(entry) = machine.linear(*axis) else {
            bail!("test: the machine has no axis {axis}");
        };
        if feed_mm_min > entry.feed_limit_mm_min {
            bail!(
                "feed_mm_min = {feed_mm_min}: must be at most {}, the limit of {axis}",
                entry.feed_limit_mm_min
            );
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = include_str!("../../../../launch_configs/gap_first/machine.yaml");

    fn refused(test: &str) -> String {
        let machine = MachineFile::parse(MACHINE, "machine.yaml").expect("a machine");
        let map = format!("start_s: 1767600000\ntest:\n  {test}\n");
        let map: Map = serde_saphyr::from_str(&map).expect("a map");
        format!("{:#}", check(&map, &machine).expect_err("out of range"))
    }

    #[test]
    fn what_the_machine_cannot_do_was_not_measured_on_it() {
        let circle = "circle: {plane: XY, centre_mm: [0.0, 0.0, 0.0], radius_mm: 1000.0, feed_mm_min: 1000.0, run: n, angle_deg: w, radial_um: r}";
        let said = refused(circle);
        assert!(
            said.contains("radius_mm: X = -1000 mm: must be from -"),
            "{said}"
        );
        let fast = "positioning: {axis: X, feed_mm_min: 600000.0, dwell_s: 2.0, overrun_mm: 5.0, run: n, target_mm: t, deviation_um: d}";
        let said = refused(fast);
        assert!(
            said.contains("feed_mm_min = 600000: must be at most"),
            "{said}"
        );
        let said = refused(&fast.replace("axis: X", "axis: A"));
        assert!(said.contains("the machine has no axis A"), "{said}");
    }
}
