//! A ballbar test as an ideal machine would record it: no node of the suite reads a ballbar, its table is imported.

use machine::MachineFile;
use metrology::PerAxis;
use metrology::sample::{Sense, TestPlane};
use nalgebra::Vector3;
use twin::{Channel, History, Instrument, Session};

use crate::experiment::Pass;
use crate::experiment::course::{self, Frame};

/// Between the two senses, s.
const PAUSE_S: f64 = 5.0;

/// A ballbar test in one plane: both senses at one feed.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// Plane.
    pub plane: TestPlane,
    /// Axis positions at the centre, mm.
    pub centre_mm: [f64; 3],
    /// Radius: the length of the bar, mm.
    pub radius_mm: f64,
    /// Feed, mm/s.
    pub feed_mm_s: f64,
}

/// What would be recorded, and how long it takes, min; none where the plane has no axes.
#[must_use]
pub fn ballbar(machine: &MachineFile, bar: &Bar) -> Option<(Session, f64)> {
    let frame = Frame {
        machine,
        rest: PerAxis::default(),
        beside: vec![],
        tool_offset_mm: Vector3::zeros(),
        setup: 1,
        servo_s: 1e-3 * machine.control.servo_period_ms,
    };
    let pass = |sense| Pass::Circle {
        instrument: Instrument::Radial,
        plane: bar.plane,
        centre_mm: bar.centre_mm,
        radius_mm: bar.radius_mm,
        feed_mm_s: bar.feed_mm_s,
        sense,
    };
    let mut at_s = 1.0;
    let mut session = Session {
        history: History::default(),
        runs: vec![],
        first_bag_ends: None,
    };
    for (number, sense) in (1..).zip([Sense::CounterClockwise, Sense::Clockwise]) {
        let run = course::run(&frame, &pass(sense), number, at_s)?;
        at_s = run.motion.time_s.last().copied()? + PAUSE_S;
        session.runs.push(run);
    }
    let is_radial = |session: &Session| {
        let mut readings = session.runs.iter().flat_map(|run| &run.readings);
        readings.all(|reading| reading.channel == Channel::Radial)
    };
    debug_assert!(is_radial(&session));
    Some((session, at_s / 60.0))
}
