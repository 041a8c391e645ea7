//! What a map and the numbers of its table may be on the machine that was measured.

use std::fmt;

use anyhow::{Result, anyhow, bail};
use iso230::breakdown::{GREATEST_DEVIATION, outliers};
use machine::MachineFile;
use metrology::leaves::{Row, check_number};
use metrology::number::number;
use metrology::{Axis, Host, epoch};

use super::map::{Column, Map, Plane, Test, What, units};
use super::runs::Runs;
use super::times;

/// Greatest deviation or displacement that an instrument reads, µm.
const DEVIATION_UM: f64 = 1e5;
/// Greatest deviation of a rotary axis, arcsec: a degree.
const DEVIATION_ARCSEC: f64 = 3600.0;
/// Least and greatest temperature of a machine, degC.
const TEMPERATURE_RANGE_DEGC: [f64; 2] = [-50.0, 200.0];

/// Rests shorter than this, s, are taken for the slowing down of an axis.
pub const SETTLE_S: f64 = 0.4;
/// Angles of a column: ten thousand turns either way, deg.
const ANGLE_DEG: f64 = 3.6e6;
/// Numbers of a map, by their keys.
const ROWS: &[Row] = &[
    ("feed_mm_min", 0.01, 1e7),
    ("dwell_s", 0.5, 3600.0),
    ("overrun_mm", 1e-3, 1e4),
    ("feed_deg_min", 0.01, 1e7),
    ("overrun_deg", 1e-3, 360.0),
    ("resolution_um", 1e-6, 1e4),
    ("resolution_arcsec", 1e-6, 3600.0),
    ("same_target_um", 0.0, 1e4),
    ("same_target_arcsec", 0.0, 3600.0),
    ("radius_mm", 0.1, 1e5),
    ("centre_mm", -1e5, 1e5),
    ("at_mm", -1e5, 1e5),
];

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
        write!(
            f,
            "from {} to {} {}",
            number(self.low),
            number(self.high),
            self.what
        )
    }
}

/// Range of a column of times.
const TIME_RANGE: Range = Range::new(
    -(epoch::END_S as f64) + 1.0,
    epoch::END_S as f64 - 1.0,
    SECONDS,
);
const SECONDS: &str = "s";

impl Range {
    /// What is to be done about a number that is not in the range; empty where nothing is known.
    pub fn remedy(&self, number: f64) -> String {
        if self.what != SECONDS {
            return String::new();
        }
        match epoch::likely_unit(number) {
            Some((unit, scale)) => format!("; it looks like {unit}: divide the column by {scale}"),
            None => "; the column is in seconds: divide it where its unit is another".to_owned(),
        }
    }
}

fn travel(machine: &MachineFile, axis: Axis) -> Option<Range> {
    let [low, high] = machine.linear(axis)?.travel_mm;
    Some(Range::new(low, high, "mm, the axis' travel"))
}

/// The same of any axis, in the unit of its targets.
pub fn targets(machine: &MachineFile, axis: Axis) -> Option<Range> {
    if axis.is_linear() {
        return travel(machine, axis);
    }
    let [low, high] = machine.rotary_axis(axis)?.travel_deg;
    Some(Range::new(low, high, "deg, the axis' travel"))
}

/// Ranges of a test's columns, in their order; that of a measured position is of its deviation from the target.
pub fn ranges(test: &Test, machine: &MachineFile) -> Vec<Option<Range>> {
    let [low, high] = TEMPERATURE_RANGE_DEGC;
    let range = |column: &Column<'_>| match (column.what, test) {
        (What::Run | What::Direction | What::Feature, _) => None,
        (What::Place(_), Test::Touches { .. }) => Some(Range::new(-1e5, 1e5, "mm")),
        (What::Place(_), Test::Positioning { axis, .. }) => targets(machine, *axis),
        (What::Place(_), _) => Some(Range::new(-ANGLE_DEG, ANGLE_DEG, "deg")),
        (What::Deviation(_) | What::Measured(_), Test::Positioning { axis, .. })
            if !axis.is_linear() =>
        {
            Some(Range::new(-DEVIATION_ARCSEC, DEVIATION_ARCSEC, "arcsec"))
        }
        (What::Deviation(_) | What::Measured(_), _) => {
            Some(Range::new(-DEVIATION_UM, DEVIATION_UM, "µm"))
        }
        (What::Time, _) => Some(TIME_RANGE),
        (What::Temperature, _) => Some(Range::new(low, high, "degC")),
    };
    test.columns().iter().map(range).collect()
}

/// Checks what of a map needs no machine: its start and its numbers.
///
/// # Errors
/// Names the key, its value and the limit.
pub fn check_alone(map: &Map) -> Result<()> {
    epoch::whole_seconds::<Host>(map.start_s, times::LONGEST_LOG_S as i64)
        .map_err(|error| anyhow!("start_s = {error}"))?;
    numbers(map)
}

/// Checks a map against the machine: axes, travels and feeds.
///
/// # Errors
/// Names the key, its value and the limit.
pub fn check(map: &Map, machine: &MachineFile) -> Result<()> {
    check_alone(map)?;
    for (axis, at_mm) in &map.at_mm {
        within(machine, &format!("at_mm.{axis}"), *axis, *at_mm)?;
        if map.test.moved().contains(axis) {
            bail!(
                "at_mm.{axis} = {at_mm} mm: does nothing, the test says where {axis} is: remove it"
            );
        }
    }
    map.check_columns()?;
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
        Test::Touches { .. } => Ok(()),
        Test::Log {
            axis,
            second_displacement_um,
            heights_mm,
            temperature_degc,
            ..
        } => {
            if !axis.is_linear() {
                bail!("test.log.axis = {axis}: must be one of X, Y, Z: displacements are lengths");
            }
            heights(*axis, second_displacement_um.is_some(), heights_mm)?;
            feed(machine, &[*axis], 0.0)?;
            temperature_degc
                .keys()
                .try_for_each(|id| sensor(machine, id))
        }
    }
}

/// Checks every number of a map by itself.
fn numbers(map: &Map) -> Result<()> {
    let at_mm = map.at_mm.iter();
    let mut numbers: Vec<(String, f64)> = at_mm
        .map(|(axis, at_mm)| (format!("at_mm.{axis}"), *at_mm))
        .collect();
    let resolution = map.resolution().into_iter();
    numbers.extend(resolution.map(|(key, value)| (key.to_owned(), value)));
    match &map.test {
        Test::Positioning {
            axis,
            feed_mm_min,
            dwell_s,
            overrun_mm,
            same_target_um,
            ..
        } => {
            let [feed, overrun] = units(*axis).keys;
            let same = if axis.is_linear() {
                "same_target_um"
            } else {
                "same_target_arcsec"
            };
            let same_target = same_target_um.iter();
            numbers.extend(same_target.map(|value| (format!("test.positioning.{same}"), *value)));
            let fields = [
                (feed, feed_mm_min),
                ("dwell_s", dwell_s),
                (overrun, overrun_mm),
            ];
            numbers.extend(fields.map(|(key, value)| (format!("test.positioning.{key}"), *value)));
        }
        Test::Circle {
            centre_mm,
            radius_mm,
            feed_mm_min,
            ..
        } => {
            let fields = [("radius_mm", radius_mm), ("feed_mm_min", feed_mm_min)];
            numbers.extend(fields.map(|(key, value)| (format!("test.circle.{key}"), *value)));
            let centre = centre_mm.iter().enumerate();
            numbers.extend(centre.map(|(k, mm)| (format!("test.circle.centre_mm[{k}]"), *mm)));
        }
        Test::Log { .. } | Test::Touches { .. } => {}
    }
    for (key, value) in numbers {
        check_number(ROWS, &key, value)?;
    }
    Ok(())
}

/// A line for each reading of a circle that lies far from the others of its run: no figure of that run is evaluated.
pub fn outliers_of_circles(runs: &Runs, radius_mm: f64, column: &str) -> Vec<String> {
    let limit_um = number(1e3 * GREATEST_DEVIATION * radius_mm);
    let of_run = |rows: &Vec<super::table::Row>| -> Vec<String> {
        let read: Vec<_> = rows.iter().filter(|row| row.cells[2].is_finite()).collect();
        let deviations_mm: Vec<f64> = read.iter().map(|row| 1e-3 * row.cells[2]).collect();
        let found = outliers(&deviations_mm, radius_mm)
            .into_iter()
            .map(|at| read[at]);
        let in_words = |row: &super::table::Row| {
            format!(
                "warning, line {}, column \"{column}\": {} µm lies further than {limit_um} µm (5 % of radius_mm) from the others of run {}, which is not evaluated: mend the reading or repeat the run",
                row.line,
                number(row.cells[2]),
                number(row.cells[0]),
            )
        };
        found.map(in_words).collect()
    };
    runs.runs.iter().flat_map(of_run).collect()
}

/// Farthest that a sensor of a drift test stands from the common level, mm.
const FARTHEST_HEIGHT_MM: f64 = 10_000.0;

/// Heights of the sensors of a log: two where there are two columns, one or none else.
fn heights(axis: Axis, has_second: bool, heights_mm: &[f64]) -> Result<()> {
    let key = "test.log.heights_mm";
    for (k, height_mm) in heights_mm.iter().enumerate() {
        if height_mm.is_nan() || height_mm.abs() > FARTHEST_HEIGHT_MM {
            bail!(
                "{key}[{k}] = {} mm: must be from -{FARTHEST_HEIGHT_MM} to {FARTHEST_HEIGHT_MM} mm",
                number(*height_mm)
            );
        }
    }
    match (has_second, heights_mm) {
        (false, [] | [_]) => Ok(()),
        (false, _) => bail!(
            "{key} has {} heights: must be one for one displacement, or two with second_displacement_um",
            heights_mm.len()
        ),
        (true, _) if axis == Axis::Z => bail!(
            "test.log.second_displacement_um: two heights of displacements along Z make no tilt: measure along X or Y, or import each as a log of its own"
        ),
        (true, [first, second]) if first.total_cmp(second).is_ne() => Ok(()),
        (true, [..]) => bail!(
            "{key} = {heights_mm:?}: must be two different heights, of displacement_um and of second_displacement_um"
        ),
    }
}

/// A thermometer of the machine file.
fn sensor(machine: &MachineFile, id: &str) -> Result<()> {
    let sensors = &machine.temperature_sensors;
    if sensors.iter().any(|sensor| sensor.id == id) {
        return Ok(());
    }
    let known: Vec<&str> = sensors.iter().map(|sensor| sensor.id.as_str()).collect();
    let known = match known.as_slice() {
        [] => "none; add it to temperature_sensors there".to_owned(),
        several => several.join(", "),
    };
    bail!(
        "temperature_degc.{id}: the machine file has no thermometer of this name, it has {known}"
    );
}

fn within(machine: &MachineFile, key: &str, axis: Axis, at_mm: f64) -> Result<()> {
    let Some(range) = travel(machine, axis) else {
        bail!("{key}: the machine has no axis {axis}");
    };
    if !range.holds(at_mm) {
        bail!("{key}: {axis} = {} mm: must be {range}", number(at_mm));
    }
    Ok(())
}

fn feed(machine: &MachineFile, axes: &[Axis], feed_mm_min: f64) -> Result<()> {
    for axis in axes {
        let linear = machine.linear(*axis).map(|entry| entry.feed_limit_mm_min);
        let rotary = machine.rotary_axis(*axis);
        let limit = linear.or_else(|| rotary.map(|entry| entry.feed_limit_deg_min));
        let Some(limit) = limit else {
            bail!("test: the machine has no axis {axis}");
        };
        if feed_mm_min > limit {
            let units = units(*axis);
            bail!(
                "{} = {} {unit}: must be at most {} {unit}, the limit of {axis}",
                units.keys[0],
                number(feed_mm_min),
                number(limit),
                unit = units.feed
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
    #[expect(clippy::too_many_lines, reason = "a table of cases")]
    fn a_number_of_the_map_that_no_test_has_is_refused_by_its_key() {
        const CIRCLE: &str = "circle: {plane: XY, centre_mm: [0.0, 0.0, 0.0], radius_mm: RADIUS, feed_mm_min: FEED, run: n, angle_deg: w, radial_um: r}";
        const STOPS: &str = "positioning: {axis: X, feed_mm_min: FEED, dwell_s: DWELL, overrun_mm: OVERRUN, run: n, target_mm: t, deviation_um: d}";
        let good = [
            ("RADIUS", "50.0"),
            ("FEED", "1000.0"),
            ("DWELL", "2.0"),
            ("OVERRUN", "5.0"),
        ];
        for (test, name, bad, words) in [
            (
                CIRCLE,
                "RADIUS",
                "1e-9",
                "test.circle.radius_mm = 1e-9 mm: must be from 0.1 to 100000 mm",
            ),
            (
                CIRCLE,
                "RADIUS",
                "-50",
                "test.circle.radius_mm = -50 mm: must be from 0.1 to",
            ),
            (
                CIRCLE,
                "RADIUS",
                "1e300",
                "test.circle.radius_mm = 1e300 mm: must be from 0.1 to",
            ),
            (
                CIRCLE,
                "FEED",
                "1e-300",
                "test.circle.feed_mm_min = 1e-300 mm/min: must be from 0.01 to",
            ),
            (
                CIRCLE,
                "FEED",
                "0.0",
                "test.circle.feed_mm_min = 0 mm/min: must be from 0.01 to",
            ),
            (
                STOPS,
                "FEED",
                "1e-9",
                "test.positioning.feed_mm_min = 1e-9 mm/min: must be from 0.01 to",
            ),
            (
                STOPS,
                "DWELL",
                "0.0",
                "test.positioning.dwell_s = 0 s: must be from 0.5 to 3600 s",
            ),
            (
                STOPS,
                "DWELL",
                "1e9",
                "test.positioning.dwell_s = 1000000000 s: must be from 0.5 to 3600 s",
            ),
            (
                STOPS,
                "OVERRUN",
                "0.0",
                "test.positioning.overrun_mm = 0 mm: must be from 0.001 to",
            ),
            (
                STOPS,
                "OVERRUN",
                "1e12",
                "test.positioning.overrun_mm = 1000000000000 mm: must be from 0.001 to",
            ),
        ] {
            let bad_first = [(name, bad)].into_iter().chain(good);
            let test = bad_first.fold(test.to_owned(), |test, (name, value)| {
                test.replace(name, value)
            });
            let shown = refused(&test);
            assert!(shown.starts_with(words), "{words}: {shown}");
        }
    }

    #[test]
    fn a_reading_far_from_the_others_of_its_circle_is_named_by_its_line() {
        let row = |k: u32, um: f64| super::super::table::Row {
            line: u64::from(k) + 2,
            cells: vec![3.0, f64::from(k), um],
        };
        for (at, um, radius_mm) in [
            (7, 90_000.0, 100.0),
            (0, -5_100.0, 100.0),
            (89, 600.0, 10.0),
        ] {
            let rows = (0..90)
                .map(|k| row(k, if k == at { um } else { 1.5 }))
                .collect();
            let runs = Runs {
                runs: vec![rows, (0..90).map(|k| row(k, f64::NAN)).collect()],
                remarks: vec![],
                is_order_known: true,
            };
            let found = outliers_of_circles(&runs, radius_mm, "radial_um");
            assert_eq!(found.len(), 1, "{found:?}");
            let words = format!(
                "warning, line {}, column \"radial_um\": {} µm",
                at + 2,
                number(um)
            );
            assert!(
                found[0].starts_with(&words) && found[0].contains("run 3"),
                "{found:?}"
            );
            assert_eq!(
                outliers_of_circles(&runs, 2_000.0, "r"),
                Vec::<String>::new()
            );
        }
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
            said.contains("feed_mm_min = 600000 mm/min: must be at most"),
            "{said}"
        );
        let log =
            "log: {axis: Z, time_s: t, displacement_um: d, temperature_degc: {spindle_frnt: s}}";
        let said = refused(log);
        assert!(
            said.contains("temperature_degc.spindle_frnt: the machine file has no thermometer of this name, it has nut_x, nut_y"),
            "{said}"
        );
        let twice = fast
            .replace("600000", "6000")
            .replace("target_mm: t", "target_mm: d");
        let said = refused(&twice);
        assert!(said.contains("two keys name the column \"d\""), "{said}");
        let said = refused(&fast.replace("axis: X", "axis: A"));
        assert!(said.contains("the machine has no axis A"), "{said}");
    }
}
