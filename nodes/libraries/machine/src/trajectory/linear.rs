//! Positioning runs and scans along one axis.
//!
//! A positioning run goes up through every target and down again; before the first and after the
//! last target the axis overruns, so that each target is approached from one side in one run and
//! from the other in the next \[ISO 230-2, standard test cycle\]. Targets lie unevenly, so that no
//! periodic error of the drive is met at one phase only.

use metrology::Axis;
use metrology::sample::{Sense, TestKind, TestPlane};
use nalgebra::Vector3;

use super::error::TrajectoryError;
use super::shape::{finite, positive};
use super::writer::{Writer, check_feed, run_in_mm};
use super::{Arrival, Trajectory};
use crate::file::{BeamEntry, MachineFile};

/// Least overrun beyond the first and last target, mm: more than any play.
const LEAST_OVERRUN_MM: f64 = 1.0;
/// Least number of targets of a run.
const MIN_TARGETS_OF_RUN: usize = 2;
/// Most stops of one program.
const MOST_STOPS: usize = 100_000;
/// Share of the spacing over which targets are scattered.
const SCATTER: f64 = 0.5;
/// Fractional part of the golden ratio: its multiples fill the unit interval most evenly.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// A run along one axis while the others rest.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisRun<'a> {
    /// The axis.
    pub axis: Axis,
    /// Beam of the length reference along it; `None`: only scales and encoders are read.
    pub beam: Option<&'a str>,
    /// Where the other axes rest; of a beam: ignored, its own positions hold, mm.
    pub at_mm: Vector3<f64>,
    /// Targets by ascending position (first and last bound a scan), mm.
    pub targets_mm: Vec<f64>,
    /// Runs, each up and down.
    pub runs: u32,
    /// Rest at each target, s; unused by a scan.
    pub dwell_s: f64,
    /// Feed.
    pub feed_mm_min: f64,
    /// How far the axis overruns the first and last target, mm.
    pub overrun_mm: f64,
    /// How the reflector comes to the beginning.
    pub arrival: Arrival,
}

/// Targets from `from_mm` to `to_mm` about every `spacing_mm`, scattered over half of it.
///
/// # Errors
/// When there is no room for two targets.
pub fn uneven_targets_mm(
    from_mm: f64,
    to_mm: f64,
    spacing_mm: f64,
) -> Result<Vec<f64>, TrajectoryError> {
    finite("from_mm", from_mm)?;
    finite("to_mm", to_mm)?;
    positive("spacing_mm", spacing_mm)?;
    positive("to_mm - from_mm", to_mm - from_mm)?;
    let parts = ((to_mm - from_mm) / spacing_mm).round().max(1.0);
    if parts > MOST_STOPS as f64 {
        return Err(TrajectoryError::Number {
            key: "spacing_mm",
            value: spacing_mm,
            rule: "gives more than 100000 targets",
        });
    }
    let even_mm = (to_mm - from_mm) / parts;
    let mut targets = vec![from_mm];
    let mut index = 1.0;
    while index < parts {
        let scatter = ((index * GOLDEN).fract() - 0.5) * SCATTER;
        targets.push(from_mm + (index + scatter) * even_mm);
        index += 1.0;
    }
    targets.push(to_mm);
    Ok(targets)
}

/// Stops at every target, up and down, `runs` times.
///
/// # Errors
/// Targets that are no ascending list, feeds, dwells and places that the machine does not allow.
pub fn positioning(file: &MachineFile, order: &AxisRun<'_>) -> Result<Trajectory, TrajectoryError> {
    let line = Line::new(file, order)?;
    positive("dwell_s", order.dwell_s)?;
    let stops = 2 * order.targets_mm.len() * order.runs as usize;
    if stops > MOST_STOPS {
        return Err(TrajectoryError::TooMany {
            what: "stops",
            n: stops,
            greatest: MOST_STOPS,
        });
    }
    let mut writer = line.begin(file)?;
    let mut stops_mm = Vec::with_capacity(stops);
    let mut stop = |writer: &mut Writer<'_>, target_mm: f64| {
        let point = line.at(target_mm);
        writer.feed(&point, order.feed_mm_min);
        writer.dwell(order.dwell_s);
        stops_mm.push(point);
    };
    for _ in 0..order.runs {
        writer.feed(&line.low(), order.feed_mm_min);
        for &target_mm in &order.targets_mm {
            stop(&mut writer, target_mm);
        }
        writer.feed(&line.high(), order.feed_mm_min);
        for &target_mm in order.targets_mm.iter().rev() {
            stop(&mut writer, target_mm);
        }
    }
    writer.feed(&line.low(), order.feed_mm_min);
    let stations = u32::try_from(stops).unwrap_or(u32::MAX);
    Ok(line.trajectory(
        order,
        line.setup(file, order.arrival)?,
        writer.finish(),
        TestKind::Positioning,
        stations,
        stops_mm,
    ))
}

/// Runs through between the first and the last target, up and down, `runs` times, recorded while moving.
///
/// # Errors
/// As [`positioning`]; the overrun must be long enough to reach the feed.
pub fn scan(file: &MachineFile, order: &AxisRun<'_>) -> Result<Trajectory, TrajectoryError> {
    linear_axis(order.axis)?;
    let needed_mm = run_in_mm(file, &[order.axis], order.feed_mm_min)?;
    if order.overrun_mm < needed_mm {
        return Err(TrajectoryError::OverrunTooShort {
            overrun_mm: order.overrun_mm,
            needed_mm,
            feed_mm_min: order.feed_mm_min,
        });
    }
    let line = Line::new(file, order)?;
    let mut writer = line.begin(file)?;
    let (first, last) = (line.at(line.first_mm), line.at(line.last_mm));
    for _ in 0..order.runs {
        for (from, to, beyond) in [(first, last, line.high()), (last, first, line.low())] {
            writer.feed(&from, order.feed_mm_min);
            writer.comment("rate", "full");
            writer.feed(&to, order.feed_mm_min);
            writer.comment("rate", "background");
            writer.feed(&beyond, order.feed_mm_min);
            writer.dwell(0.1);
        }
    }
    Ok(line.trajectory(
        order,
        line.setup(file, order.arrival)?,
        writer.finish(),
        TestKind::Line,
        0,
        vec![first, last],
    ))
}

fn linear_axis(axis: Axis) -> Result<(), TrajectoryError> {
    if axis.is_linear() {
        return Ok(());
    }
    Err(TrajectoryError::NotLinear { axis })
}

/// Where the axis runs.
struct Line<'a> {
    axis: Axis,
    base: Vector3<f64>,
    beam: Option<&'a BeamEntry>,
    first_mm: f64,
    last_mm: f64,
    overrun_mm: f64,
}

impl<'a> Line<'a> {
    fn new(file: &'a MachineFile, order: &AxisRun<'_>) -> Result<Self, TrajectoryError> {
        linear_axis(order.axis)?;
        let beam = match order.beam {
            Some(id) => Some(beam(file, id)?),
            None => None,
        };
        if let Some(beam) = beam.filter(|beam| beam.axis() != Some(order.axis)) {
            return Err(TrajectoryError::BeamOffAxis {
                beam: beam.id.clone(),
                axis: order.axis,
            });
        }
        let (first_mm, last_mm) = check_targets(&order.targets_mm)?;
        if order.overrun_mm.is_nan() || order.overrun_mm < LEAST_OVERRUN_MM {
            return Err(TrajectoryError::Number {
                key: "overrun_mm",
                value: order.overrun_mm,
                rule: "must be at least 1 mm, more than any play",
            });
        }
        if order.runs == 0 {
            return Err(TrajectoryError::TooFew {
                what: "runs",
                n: 0,
                least: 1,
            });
        }
        let mut direction = Vector3::zeros();
        direction[order.axis.index()] = 1.0;
        check_feed(file, &direction, order.feed_mm_min)?;
        Ok(Self {
            axis: order.axis,
            base: beam.map_or(order.at_mm, |beam| Vector3::from(beam.from_mm)),
            beam,
            first_mm,
            last_mm,
            overrun_mm: order.overrun_mm,
        })
    }

    fn at(&self, position_mm: f64) -> Vector3<f64> {
        let mut point = self.base;
        point[self.axis.index()] = position_mm;
        point
    }

    fn low(&self) -> Vector3<f64> {
        self.at(self.first_mm - self.overrun_mm)
    }

    fn high(&self) -> Vector3<f64> {
        self.at(self.last_mm + self.overrun_mm)
    }

    /// The program that puts the beam up and zeroes it, where there is one.
    fn setup(
        &self,
        file: &MachineFile,
        arrival: Arrival,
    ) -> Result<Option<String>, TrajectoryError> {
        let Some(beam) = self.beam else {
            return Ok(None);
        };
        let zero_at = Vector3::from(beam.from_mm);
        Writer::setup(file, arrival, &zero_at, &beam.id, "length")
    }

    fn begin<'f>(&self, file: &'f MachineFile) -> Result<Writer<'f>, TrajectoryError> {
        let mut writer = Writer::new(file);
        writer.check_travel("overrun", &self.low())?;
        writer.check_travel("overrun", &self.high())?;
        if self.beam.is_none() {
            writer.over_the_top(&self.low())?;
        }
        writer.rapid(&self.low());
        Ok(writer)
    }

    fn trajectory(
        &self,
        order: &AxisRun<'_>,
        setup: Option<String>,
        program: String,
        kind: TestKind,
        stations: u32,
        stops_mm: Vec<Vector3<f64>>,
    ) -> Trajectory {
        Trajectory {
            setup,
            program,
            kind,
            plane: TestPlane::None,
            centre_mm: (self.at(self.first_mm) + self.at(self.last_mm)) / 2.0,
            radius_mm: 0.0,
            feed_mm_s: order.feed_mm_min / 60.0,
            sense: Sense::None,
            stations,
            tool_offset_mm: self
                .beam
                .map_or_else(Vector3::zeros, |beam| Vector3::from(beam.tool_offset_mm)),
            stops_mm,
        }
    }
}

/// The beam `id`.
pub(super) fn beam<'a>(file: &'a MachineFile, id: &str) -> Result<&'a BeamEntry, TrajectoryError> {
    file.beam(id).ok_or_else(|| TrajectoryError::Unknown {
        what: "beam of a length reference",
        name: id.to_owned(),
        known: file
            .length_reference
            .iter()
            .flat_map(|length| &length.beams)
            .map(|beam| beam.id.as_str())
            .collect::<Vec<_>>()
            .join(", "),
    })
}

fn check_targets(targets_mm: &[f64]) -> Result<(f64, f64), TrajectoryError> {
    let (Some(&first), Some(&last)) = (targets_mm.first(), targets_mm.last()) else {
        return Err(too_few(0));
    };
    if targets_mm.len() < MIN_TARGETS_OF_RUN {
        return Err(too_few(targets_mm.len()));
    }
    for (before, pair) in targets_mm.windows(2).enumerate() {
        // Also true where one of them is not a number.
        if pair[1].is_nan() || pair[1] <= pair[0] || pair[0].is_nan() {
            return Err(TrajectoryError::TargetsNotAscending {
                index: before + 1,
                position_mm: pair[1],
                before_mm: pair[0],
            });
        }
    }
    Ok((first, last))
}

const fn too_few(n: usize) -> TrajectoryError {
    TrajectoryError::TooFew {
        what: "targets",
        n,
        least: MIN_TARGETS_OF_RUN,
    }
}
