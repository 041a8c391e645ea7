//! Touches out of the stream of records: the latch of a polled probe input.
//!
//! The record in which the probe input changes while a G38 moves is the period in which LinuxCNC
//! ends the move and keeps its own probed position; the motor positions of that record are published
//! as latched. Approach and feed are what the machine did, not what the program says:
//!
//! ```text
//!   n = (c[k] - c[k-1]) / |c[k] - c[k-1]|,  c commanded X Y Z                         (1)
//!   f = n · (m[k] - m[k-1]) / Δ,            m motors X Y Z                            (2)
//! ```
//!
//! # The phase of the servo period
//!
//! The latch rounds the instant of contact up to a servo period. When the move starts at rest at a
//! whole period, as LinuxCNC's do, the phase of contact within the period is a function of stand-off
//! and feed alone: repeats land on one and the same rounding error, between 0 and Δ, and their mean keeps
//! it. Shift the start of repeat `i` of `N` by `f Δ i / N` and the errors spread evenly over the
//! period: their mean is Δ/2 to within Δ/(2 N).
//!
//! # References
//! LinuxCNC 2.9 `process_probe_inputs` (motion/control.c): the probed position is the position
//! fed back in the period in which the input is seen.

use metrology::stamp::Span;
use metrology::{AxisSet, PerAxis};
use nalgebra::Vector3;

use crate::samples::{PROBING, Record};

/// A latched touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// Program line of the G38.
    pub line: u32,
    /// Unit vector of the approach (1).
    pub approach: Vector3<f64>,
    /// Feed along it (2), mm/s.
    pub feed_mm_s: f64,
    /// Motor positions, compensation included; mm or rad.
    pub latched: PerAxis<f64>,
}

/// A change of the probe input that is no usable touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoTouch {
    /// The record before it is missing, so that approach and feed are unknown.
    AfterGap,
    /// Nothing was commanded to move.
    AtRest,
}

/// Watches the probe input.
#[derive(Clone, Debug)]
pub struct TouchDetector {
    period_s: f64,
    axes: AxisSet,
    previous: Option<Record>,
    /// Line of the G38 that has already latched.
    latched_line: Option<u32>,
}

impl TouchDetector {
    /// For records every `period` of a machine with `axes`.
    #[must_use]
    pub fn new(period: Span, axes: AxisSet) -> Self {
        Self {
            period_s: period.as_secs_f64(),
            axes,
            previous: None,
            latched_line: None,
        }
    }

    /// Motor velocities between the last record and this one, per second; zero after a gap.
    #[must_use]
    pub fn velocity(&self, record: &Record) -> PerAxis<f64> {
        let mut velocity = PerAxis::default();
        if let Some(previous) = &self.previous {
            for axis in self.axes.iter() {
                velocity[axis] = (record.motor[axis] - previous.motor[axis]) / self.period_s;
            }
        }
        velocity
    }

    /// Forgets the last record: what comes next does not follow it.
    pub fn gap(&mut self) {
        self.previous = None;
    }

    /// Takes the next record; a probing move latches once, at its first change of the input.
    pub fn step(&mut self, record: &Record) -> Option<Result<Touch, NoTouch>> {
        let probing = record.motion_type == PROBING;
        if !probing || self.latched_line.is_some_and(|line| line != record.line) {
            self.latched_line = None;
        }
        let previous = self.previous.replace(*record);
        if !probing || self.latched_line.is_some() {
            return None;
        }
        match previous {
            None if record.probe_closed => {
                self.latched_line = Some(record.line);
                Some(Err(NoTouch::AfterGap))
            }
            Some(before) if before.probe_closed != record.probe_closed => {
                self.latched_line = Some(record.line);
                Some(self.touch(&before, record))
            }
            _ => None,
        }
    }

    fn touch(&self, before: &Record, record: &Record) -> Result<Touch, NoTouch> {
        let step_mm = record.commanded.xyz() - before.commanded.xyz();
        let approach = step_mm.try_normalize(1e-9).ok_or(NoTouch::AtRest)?;
        let travel_mm = record.motor.xyz() - before.motor.xyz();
        Ok(Touch {
            line: record.line,
            approach,
            feed_mm_s: approach.dot(&travel_mm) / self.period_s,
            latched: record.motor,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::Axis;

    fn record(number: i32, x_mm: f64, closed: bool, motion_type: i32, line: u32) -> Record {
        let mut record = Record {
            number,
            probe_closed: closed,
            motion_type,
            line,
            ..Record::default()
        };
        record.commanded[Axis::X] = x_mm;
        record.motor[Axis::X] = x_mm - 0.1;
        record
    }

    fn run(records: &[Record]) -> Vec<Result<Touch, NoTouch>> {
        let mut detector = TouchDetector::new(Span::from_nanos(1_000_000), AxisSet::XYZ);
        records
            .iter()
            .filter_map(|record| detector.step(record))
            .collect()
    }

    #[test]
    fn eq1_eq2_approach_and_feed_are_those_of_the_motion() {
        let touches = run(&[
            record(0, 1.00, false, 5, 4),
            record(1, 0.99, false, 5, 4),
            record(2, 0.98, true, 5, 4),
        ]);
        let touch = touches[0].unwrap();
        assert!((touch.approach - Vector3::new(-1.0, 0.0, 0.0)).norm() < 1e-12);
        assert!((touch.feed_mm_s - 10.0).abs() < 1e-9);
        assert!((touch.latched[Axis::X] - 0.88).abs() < 1e-12);
        assert_eq!((touches.len(), touch.line), (1, 4));
    }

    #[test]
    fn a_bouncing_contact_latches_once_per_move() {
        let touches = run(&[
            record(0, 0.0, false, 5, 4),
            record(1, 0.1, true, 5, 4),
            record(2, 0.2, false, 5, 4),
            record(3, 0.3, true, 5, 4),
            record(4, 0.3, false, 0, 4),
            record(5, 0.3, false, 5, 9),
            record(6, 0.4, true, 5, 9),
        ]);
        assert_eq!(
            touches
                .iter()
                .map(|touch| touch.unwrap().line)
                .collect::<Vec<_>>(),
            [4, 9]
        );
    }

    #[test]
    fn contact_outside_a_probing_move_is_no_touch() {
        assert_eq!(
            run(&[record(0, 0.0, false, 2, 4), record(1, 0.1, true, 2, 4)]),
            []
        );
    }

    #[test]
    fn the_motion_before_a_gap_is_not_used() {
        let mut detector = TouchDetector::new(Span::from_nanos(1_000_000), AxisSet::XYZ);
        assert_eq!(detector.step(&record(0, 0.0, false, 5, 4)), None);
        detector.gap();
        assert_eq!(
            detector.step(&record(9, 0.9, true, 5, 4)),
            Some(Err(NoTouch::AfterGap))
        );
        assert_eq!(detector.step(&record(10, 1.0, true, 5, 4)), None);
    }

    #[test]
    fn a_change_at_rest_has_no_approach() {
        let touches = run(&[record(0, 0.0, false, 5, 4), record(1, 0.0, true, 5, 4)]);
        assert_eq!(touches, [Err(NoTouch::AtRest)]);
    }
}
