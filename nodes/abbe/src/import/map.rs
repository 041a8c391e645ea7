//! What a table holds: the map file.

use std::collections::BTreeMap;
use std::fmt;

use anyhow::{Result, bail};
use iso230::thermal::DriftCause;
use metrology::Axis;
use schemars::JsonSchema;
use serde::Deserialize;

use super::map_schema::{with_arcsec, with_other_names};
use super::stated;
use super::touches;
use super::units::Unit;

/// A map file.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = with_arcsec)]
pub struct Map {
    /// Between cells; a comma by default.
    #[serde(default = "comma")]
    pub separator: char,
    /// Before the decimals; a point by default.
    #[serde(default = "point")]
    pub decimal: char,
    /// Worksheet of an xlsx file; without it the one that is shown and has the columns.
    #[serde(default)]
    pub sheet: Option<String>,
    /// When the measurement began, s since the epoch.
    pub start_s: i64,
    /// Where the axes stand that the test does not move, mm; of a positioning test half-way to the farther end of the travel where
    /// nobody stated it, at most 250 mm from zero, otherwise zero.
    #[serde(default)]
    pub at_mm: BTreeMap<Axis, f64>,
    /// Units of the columns that are not in the unit that their key ends with.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, String>")]
    pub units: BTreeMap<String, Unit>,
    /// Least step of what the instrument shows, µm; of an angular reference arcsec.
    #[serde(default, alias = "resolution_arcsec")]
    pub resolution_um: Option<f64>,
    /// What was measured.
    pub test: Test,
}

const fn comma() -> char {
    ','
}

const fn point() -> char {
    '.'
}

/// One kind of measurement.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[schemars(transform = with_other_names)]
pub enum Test {
    /// Stops along an axis, rows in the order of measurement. Of a rotary axis lengths are in deg, deviations in arcsec,
    /// under the names that end so.
    Positioning {
        /// The axis.
        axis: Axis,
        /// Feed between the stops.
        #[serde(alias = "feed_deg_min")]
        feed_mm_min: f64,
        /// Rest at each stop.
        dwell_s: f64,
        /// How far beyond an end the axis turned round.
        #[serde(alias = "overrun_deg")]
        overrun_mm: f64,
        /// Column of the run's number; without it every repetition of a target from one side is a run of its own.
        #[serde(default)]
        run: Option<String>,
        /// Column of the target, mm.
        #[serde(alias = "target_deg")]
        target_mm: String,
        /// Column of measured minus target, µm.
        #[serde(default, alias = "deviation_arcsec")]
        deviation_um: Option<String>,
        /// Column of the measured position, mm, in place of the deviation.
        #[serde(default, alias = "measured_deg")]
        measured_mm: Option<String>,
        /// Columns of deviations, µm, one for each pass in the order of the measurement, in place of `run`, `deviation_um` and
        /// `direction`.
        #[serde(default, alias = "passes_arcsec")]
        passes_um: Vec<Pass>,
        /// Column of the direction of approach, `up` or `down`, against which the order of the rows is checked.
        #[serde(default)]
        direction: Option<String>,
        /// Targets of several runs that differ by no more are one, µm; without it a hundredth of their least spacing.
        #[serde(default, alias = "same_target_arcsec")]
        same_target_um: Option<f64>,
    },
    /// A ballbar's radius round a circle, rows in the order of measurement.
    Circle {
        /// `XY`, `YZ` or `ZX`.
        plane: Plane,
        /// Centre, mm.
        centre_mm: [f64; 3],
        /// Nominal radius.
        radius_mm: f64,
        /// Feed.
        feed_mm_min: f64,
        /// Column of the run's number.
        run: String,
        /// Column of the angle from the plane's first axis towards its second, deg.
        angle_deg: String,
        /// Column of measured minus nominal radius, µm.
        radial_um: String,
    },
    /// Touches of a probe, a row each: one place again and again, spheres, rings or bores. Positions are of the ball's centre.
    Touches {
        /// Column of X, mm.
        x_mm: String,
        /// Column of Y, mm.
        y_mm: String,
        /// Column of Z, mm.
        z_mm: String,
        /// Column of the run's number; without it a run begins where the list comes back to its first places, or pauses.
        #[serde(default)]
        run: Option<String>,
        /// Column of the name of what was touched.
        #[serde(default)]
        feature: Option<String>,
        /// Column of the time, s.
        #[serde(default)]
        time_s: Option<String>,
    },
    /// Temperatures and one displacement, or two at two heights, while the axes stand.
    Log {
        /// The axis along which the displacement is measured.
        axis: Axis,
        /// What made the machine drift, for ISO 230-3; not stated by default.
        #[serde(default)]
        cause: Option<DriftCause>,
        /// Column of the run's number, where the log was made several times; times go on from run to run.
        #[serde(default)]
        run: Option<String>,
        /// Column of the time, s.
        time_s: String,
        /// Time between two samples, ms, where that column numbers the samples.
        #[serde(default)]
        period_ms: Option<f64>,
        /// Column of the displacement, µm; of two heights that of the first.
        displacement_um: String,
        /// Column of the displacement at the second of two heights, µm, for the tilt of ISO 230-3.
        #[serde(default)]
        second_displacement_um: Option<String>,
        /// Heights of the sensor, or of both, above any common level along Z, mm.
        #[serde(default)]
        heights_mm: Vec<f64>,
        /// Column of each temperature by the sensor's name in the machine file, degC.
        #[serde(default)]
        temperature_degc: BTreeMap<String, String>,
    },
}

/// A column of a table with a column for each pass.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pass {
    /// Its name.
    pub column: String,
    /// From which side its targets were approached.
    pub direction: Direction,
}

/// A side of approach.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Towards greater positions.
    Up,
    /// Towards smaller positions.
    Down,
}

impl Direction {
    /// Its sign.
    pub const fn sign(self) -> f64 {
        match self {
            Self::Up => 1.0,
            Self::Down => -1.0,
        }
    }

    /// The side that a cell names.
    pub fn of_word(word: &str) -> Option<Self> {
        match word.trim().to_lowercase().as_str() {
            "up" | "+" | "1" | "+1" | "1.0" | "forward" | "fwd" | "positive" | "pos" | "↑"
            | "→" => Some(Self::Up),
            "down" | "-" | "\u{2212}" | "\u{2013}" | "-1" | "\u{2212}1" | "-1.0" | "reverse"
            | "rev" | "backward" | "backwards" | "bwd" | "negative" | "neg" | "↓" | "←" => {
                Some(Self::Down)
            }
            _ => None,
        }
    }
}

/// A column that a map names, and what its cells are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column<'t> {
    /// Its name.
    pub name: &'t str,
    /// What its cells are.
    pub what: What,
}

/// What the cells of a column are, with the unit that they are wanted in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// The number of a run.
    Run,
    /// A name of what was touched.
    Feature,
    /// A side of approach.
    Direction,
    /// A place: a target, or an angle of a circle.
    Place(Unit),
    /// A time.
    Time,
    /// A deviation, or a displacement.
    Deviation(Unit),
    /// A position that was measured.
    Measured(Unit),
    /// A temperature.
    Temperature,
}

impl What {
    /// The unit that its cells are wanted in.
    pub const fn unit(self) -> Option<Unit> {
        match self {
            Self::Place(unit) | Self::Deviation(unit) | Self::Measured(unit) => Some(unit),
            Self::Time => Some(Unit::Second),
            Self::Temperature => Some(Unit::Degc),
            Self::Run | Self::Direction | Self::Feature => None,
        }
    }

    /// Whether its cells were read from an instrument, so that one may be empty.
    pub const fn is_reading(self) -> bool {
        matches!(
            self,
            Self::Deviation(_) | Self::Measured(_) | Self::Temperature
        )
    }
}

/// Units of a positioning test along an axis: of lengths and of deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// Of targets.
    pub target: &'static str,
    /// Of feeds.
    pub feed: &'static str,
    /// Name of the key of a feed, and of an overrun.
    pub keys: [&'static str; 2],
    /// Inner unit (mm, rad) of one of the targets'.
    pub target_inner: f64,
    /// Inner unit of one of the deviations'.
    pub deviation_inner: f64,
    /// A whole turn in the unit of targets; none of a linear axis.
    pub turn: Option<f64>,
    /// Of targets and of deviations.
    pub of_cells: [Unit; 2],
}

impl Units {
    /// One of the unit of deviations in that of targets.
    pub fn deviation_in_targets(&self) -> f64 {
        self.deviation_inner / self.target_inner
    }
}

/// Of a linear axis mm and µm, of a rotary one deg and arcsec.
pub const fn units(axis: Axis) -> Units {
    const RAD_PER_DEG: f64 = std::f64::consts::PI / 180.0;
    if axis.is_linear() {
        Units {
            target: "mm",
            feed: "mm/min",
            keys: ["feed_mm_min", "overrun_mm"],
            target_inner: 1.0,
            deviation_inner: 1e-3,
            turn: None,
            of_cells: [Unit::Mm, Unit::Um],
        }
    } else {
        Units {
            target: "deg",
            feed: "deg/min",
            keys: ["feed_deg_min", "overrun_deg"],
            target_inner: RAD_PER_DEG,
            deviation_inner: RAD_PER_DEG / 3600.0,
            turn: Some(360.0),
            of_cells: [Unit::Deg, Unit::Arcsec],
        }
    }
}

/// Plane of a circle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
pub enum Plane {
    #[serde(rename = "XY")]
    Xy,
    #[serde(rename = "YZ")]
    Yz,
    #[serde(rename = "ZX")]
    Zx,
}

impl fmt::Display for Plane {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Xy => "XY",
            Self::Yz => "YZ",
            Self::Zx => "ZX",
        })
    }
}

impl Test {
    /// The column that tells directions, if there is one.
    pub fn direction(&self) -> Option<&str> {
        match self {
            Self::Positioning { direction, .. } => direction.as_deref(),
            _ => None,
        }
    }

    /// The column that numbers the runs, if there is one.
    pub fn run(&self) -> Option<&str> {
        match self {
            Self::Circle { run, .. } => Some(run),
            Self::Positioning { run, .. } | Self::Log { run, .. } | Self::Touches { run, .. } => {
                run.as_deref()
            }
        }
    }

    /// The columns of passes of a table that has one for each; empty for every other one.
    pub fn passes(&self) -> &[Pass] {
        match self {
            Self::Positioning { passes_um, .. } => passes_um,
            _ => &[],
        }
    }

    /// Axes that the test moves.
    pub fn moved(&self) -> Vec<Axis> {
        match self {
            Self::Positioning { axis, .. } => vec![*axis],
            Self::Circle { .. } | Self::Touches { .. } => Axis::LINEAR.to_vec(),
            Self::Log { .. } => vec![],
        }
    }
}

impl Map {
    /// Checks the columns against each other, and their units.
    ///
    /// # Errors
    /// Names the keys that contradict each other or are missing, or the column with a unit that it cannot have.
    pub fn check_columns(&self) -> Result<()> {
        let columns = self.test.columns();
        for (k, column) in columns.iter().enumerate() {
            let name = column.name;
            if columns[..k].iter().any(|before| before.name == name) {
                bail!("test: two keys name the column \"{name}\": each needs a column of its own");
            }
        }
        for (name, unit) in &self.units {
            let Some(column) = columns.iter().find(|column| column.name == name) else {
                bail!("units: no key of the test names the column \"{name}\"");
            };
            match column.what.unit() {
                Some(wanted) if wanted.kind() == unit.kind() => {}
                Some(wanted) => bail!(
                    "units: the column \"{name}\" cannot be in {}: it is read in {}",
                    unit.name(),
                    wanted.name()
                ),
                None => bail!("units: the column \"{name}\" has no unit that could be another"),
            }
        }
        touches::check_units(self)?;
        stated::check_names(self)?;
        self.check_readings()
    }

    /// A positioning test has its readings in one way.
    fn check_readings(&self) -> Result<()> {
        let Test::Positioning {
            run,
            deviation_um,
            measured_mm,
            passes_um,
            direction,
            ..
        } = &self.test
        else {
            return self.check_period();
        };
        let ways = [
            deviation_um.is_some(),
            measured_mm.is_some(),
            !passes_um.is_empty(),
        ];
        if ways.into_iter().filter(|has| *has).count() != 1 {
            bail!(
                "test.positioning: must have one of deviation_um, measured_mm (the position that was measured) and passes_um (a column for each pass)"
            );
        }
        // A row may be one of a run with a column for each direction.
        let is_of_rows = match passes_um.as_slice() {
            [up, down] => up.direction != down.direction,
            _ => false,
        };
        let has_run = run.is_some() && !is_of_rows;
        if !passes_um.is_empty() && (has_run || direction.is_some()) {
            bail!(
                "test.positioning: passes_um names runs and directions: remove the keys run and direction (run may stand beside one pass up \
                 and one down)"
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(text: &str) -> Result<()> {
        let map: Map = serde_saphyr::from_str(&format!("start_s: 1767600000\n{text}")).unwrap();
        map.check_columns()
    }

    /// The message of a map whose `test` is this.
    fn said(test: &str) -> String {
        let text = format!("start_s: 1767600000\ntest:\n{test}");
        let map: Result<Map, _> = metrology::yaml::read_letters(&text);
        map.expect_err("a wrong level").to_string()
    }

    #[test]
    fn an_axis_beside_the_test_that_it_belongs_to_is_told_with_where_to_move_it() {
        let rest = "feed_mm_min: 6000.0, dwell_s: 2.0, overrun_mm: 5.0, run: n, target_mm: t, deviation_um: d";
        let behind = said(&format!("  positioning: {{{rest}}}\n  axis: X\n"));
        let words = "the key axis is missing in test.positioning: move it there from line 4";
        assert!(behind.contains(words), "{behind}");
        let before = said(&format!("  axis: X\n  positioning: {{{rest}}}\n"));
        for words in [
            "must be one of positioning, circle, touches, log",
            "the key axis belongs under a step",
            "test.positioning or test.log",
        ] {
            assert!(before.contains(words), "{before}");
        }
        let level = said("  positioning:\n  axis: X\n  feed_mm_min: 6000.0\n");
        assert!(level.contains("test.axis in line 4"), "{level}");
        // A key that stands nowhere is to be added.
        let nowhere = said(&format!("  positioning: {{{rest}}}\n"));
        assert!(
            nowhere.contains("missing in test.positioning: add it"),
            "{nowhere}"
        );
    }

    #[test]
    fn words_of_directions_are_those_of_the_trade() {
        for word in [
            "up", "UP", "+", "1", "+1", "forward", "Fwd", "positive", "↑",
        ] {
            assert_eq!(Direction::of_word(word), Some(Direction::Up), "{word}");
        }
        for word in [
            "down", "-", "−", "–", "-1", "−1", "Reverse", "rev", "backward", "neg", "↓",
        ] {
            assert_eq!(Direction::of_word(word), Some(Direction::Down), "{word}");
        }
        for word in ["", "0", "2", "north", "u p"] {
            assert_eq!(Direction::of_word(word), None, "{word}");
        }
    }

    #[test]
    fn readings_are_named_in_one_way_and_units_are_of_their_kind() {
        let positioning = |keys: &str| {
            format!(
                "test:\n  positioning: {{axis: X, feed_mm_min: 1000.0, dwell_s: 2.0, overrun_mm: 5.0, target_mm: t, {keys}}}\n"
            )
        };
        for keys in [
            "deviation_um: d",
            "measured_mm: m, direction: w",
            "passes_um: [{column: 1 up, direction: up}]",
        ] {
            assert!(checked(&positioning(keys)).is_ok(), "{keys}");
        }
        for (keys, words) in [
            ("run: r", "must have one of deviation_um"),
            ("deviation_um: d, measured_mm: m", "must have one of"),
            (
                "direction: w, passes_um: [{column: a, direction: up}]",
                "remove the keys run and direction",
            ),
            (
                "run: n, passes_um: [{column: a, direction: up}]",
                "remove the keys run and direction",
            ),
            ("deviation_um: t", "two keys name the column \"t\""),
        ] {
            let said = checked(&positioning(keys)).unwrap_err().to_string();
            assert!(said.contains(words), "{keys}: {said}");
        }
        let with = |units: &str| {
            checked(&format!(
                "units: {units}\n{}",
                positioning("deviation_um: d, direction: w")
            ))
        };
        assert!(with("{t: inch, d: mm}").is_ok());
        for (units, words) in [
            ("{x: mm}", "no key of the test names the column \"x\""),
            ("{d: arcsec}", "cannot be in arcsec: it is read in um"),
            ("{w: mm}", "has no unit that could be another"),
        ] {
            let said = with(units).unwrap_err().to_string();
            assert!(said.contains(words), "{units}: {said}");
        }
    }
}
