//! Runs along the diagonals of a box, up and down, with stops \[ISO 230-6\].

use metrology::sample::{Sense, TestKind, TestPlane};
use nalgebra::Vector3;

use super::error::TrajectoryError;
use super::linear::beam;
use super::shape::{positive, require};
use super::writer::{Writer, check_feed};
use super::{Arrival, Trajectory};
use crate::file::MachineFile;

/// Least number of targets on a diagonal.
const MIN_TARGETS_OF_DIAGONAL: u32 = 5;
/// Most targets on a diagonal.
const MOST_TARGETS: u32 = 10_000;

/// Runs along one beam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diagonal<'a> {
    /// Beam of the length reference, from one corner to the opposite one.
    pub beam: &'a str,
    /// Targets, evenly from beginning to end less the overruns.
    pub targets: u32,
    /// Runs, each up and down.
    pub runs: u32,
    /// Rest at each target, s.
    pub dwell_s: f64,
    /// Feed.
    pub feed_mm_min: f64,
    /// Way beyond the first and last target, inside the beam, mm.
    pub overrun_mm: f64,
    /// How the reflector comes to the beginning.
    pub arrival: Arrival,
}

/// Stops at every target along a beam, up and down, `runs` times.
///
/// # Errors
/// Unknown beams, too few targets or runs, feeds, dwells and places that the machine does not allow.
pub fn diagonal(file: &MachineFile, order: &Diagonal<'_>) -> Result<Trajectory, TrajectoryError> {
    let beam = beam(file, order.beam)?;
    let (from, to) = (Vector3::from(beam.from_mm), Vector3::from(beam.to_mm));
    let length_mm = (to - from).norm();
    positive("dwell_s", order.dwell_s)?;
    require(
        "targets",
        f64::from(order.targets),
        (MIN_TARGETS_OF_DIAGONAL..=MOST_TARGETS).contains(&order.targets),
        "must be from 5 to 10000",
    )?;
    require(
        "runs",
        f64::from(order.runs),
        (1..=100).contains(&order.runs),
        "must be from 1 to 100",
    )?;
    require(
        "overrun_mm",
        order.overrun_mm,
        order.overrun_mm >= 1.0 && 2.0 * order.overrun_mm < length_mm,
        "must be at least 1 mm and less than half of the beam",
    )?;
    let direction = beam.direction();
    check_feed(file, &direction, order.feed_mm_min)?;
    let mut writer = Writer::new(file);
    writer.check_travel("beam's beginning", &from)?;
    writer.check_travel("beam's end", &to)?;
    let setup = Writer::setup(file, order.arrival, &from, &beam.id, "length")?;
    let span_mm = length_mm - 2.0 * order.overrun_mm;
    let step_mm = span_mm / f64::from(order.targets - 1);
    let at = |k: u32| from + direction * (order.overrun_mm + f64::from(k) * step_mm);
    let mut stops_mm = Vec::new();
    for _ in 0..order.runs {
        let up: Vec<u32> = (0..order.targets).collect();
        let down: Vec<u32> = up.iter().rev().copied().collect();
        writer.feed(&from, order.feed_mm_min);
        for (leg, beyond) in [(up, to), (down, from)] {
            for k in leg {
                writer.feed(&at(k), order.feed_mm_min);
                writer.dwell(order.dwell_s);
                stops_mm.push(at(k));
            }
            writer.feed(&beyond, order.feed_mm_min);
        }
    }
    Ok(Trajectory {
        setup,
        program: writer.finish(),
        kind: TestKind::Diagonal,
        plane: TestPlane::None,
        centre_mm: (from + to) / 2.0,
        radius_mm: 0.0,
        feed_mm_s: order.feed_mm_min / 60.0,
        sense: Sense::None,
        stations: u32::try_from(stops_mm.len()).unwrap_or(u32::MAX),
        tool_offset_mm: Vector3::from(beam.tool_offset_mm),
        stops_mm,
    })
}
