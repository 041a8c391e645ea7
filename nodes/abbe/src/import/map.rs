//! What a table holds: the map file.

use std::collections::BTreeMap;

use metrology::Axis;
use serde::Deserialize;

/// A map file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Map {
    /// Between cells; a comma where it is not said.
    #[serde(default = "comma")]
    pub separator: char,
    /// Before the decimals; a point where it is not said.
    #[serde(default = "point")]
    pub decimal: char,
    /// When the measurement began, s since the epoch.
    pub start_s: i64,
    /// Where the axes stand that the test does not move, mm.
    #[serde(default)]
    pub at_mm: BTreeMap<Axis, f64>,
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
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Test {
    /// Stops along an axis, rows in the order of measurement.
    Positioning {
        /// The axis.
        axis: Axis,
        /// Feed between the stops.
        feed_mm_min: f64,
        /// Rest at each stop.
        dwell_s: f64,
        /// How far beyond an end the axis turned round.
        overrun_mm: f64,
        /// Column of the run's number.
        run: String,
        /// Column of the target, mm.
        target_mm: String,
        /// Column of measured minus target, µm.
        deviation_um: String,
        /// Column of the direction of approach, `up` or `down`, against which the order of the rows is checked.
        #[serde(default)]
        direction: Option<String>,
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
    /// Temperatures and one displacement while the axes stand.
    Log {
        /// The axis along which the displacement is measured.
        axis: Axis,
        /// Column of the run's number, where the log was made several times; times go on from run to run.
        #[serde(default)]
        run: Option<String>,
        /// Column of the time, s.
        time_s: String,
        /// Column of the displacement, µm.
        displacement_um: String,
        /// Column of each temperature by the sensor's name in the machine file, degC.
        #[serde(default)]
        temperature_degc: BTreeMap<String, String>,
    },
}

/// Plane of a circle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum Plane {
    #[serde(rename = "XY")]
    Xy,
    #[serde(rename = "YZ")]
    Yz,
    #[serde(rename = "ZX")]
    Zx,
}

impl Test {
    /// The column that tells directions, if there is one.
    pub fn direction(&self) -> Option<&str> {
        match self {
            Self::Positioning { direction, .. } => direction.as_deref(),
            _ => None,
        }
    }

    /// Names of the columns that the test needs.
    pub fn columns(&self) -> Vec<&str> {
        match self {
            Self::Positioning {
                run,
                target_mm,
                deviation_um,
                direction,
                ..
            } => {
                let direction = direction.iter().map(String::as_str);
                let fixed = [run.as_str(), target_mm, deviation_um];
                fixed.into_iter().chain(direction).collect()
            }
            Self::Circle {
                run,
                angle_deg,
                radial_um,
                ..
            } => vec![run.as_str(), angle_deg, radial_um],
            Self::Log {
                run,
                time_s,
                displacement_um,
                temperature_degc,
                ..
            } => {
                let run = run.iter().map(String::as_str);
                let fixed = [time_s.as_str(), displacement_um.as_str()];
                let sensors = temperature_degc.values().map(String::as_str);
                run.chain(fixed).chain(sensors).collect()
            }
        }
    }
}
