//! Compensation on its way into HAL: the bridge's own limits and its heartbeat.
//!
//! Offsets go to the signals `abbe-compensation-AXIS` through one lasting `halcmd`, as they come. A
//! realtime stream (`streamer`) was decided against: it must be fed without a pause and repeats or
//! starves when its feeder dies, while a signal simply keeps its value. Between two settings, and
//! whatever arrives, HAL's `limit3` bounds size, rate and acceleration, so that neither a wrong
//! number nor the death of the bridge steps an axis.
//!
//! Before every axis is homed nothing is passed on but zero: see [`metrology::homed_gate`].
//!
//! The signal `abbe-heartbeat` changes as long as fresh compensation comes. When it stands still,
//! because compensation is stale or the bridge is dead, HAL turns the target to zero and fades the
//! offsets out at the rate that `limit3` allows.

use std::fmt::Write as _;

use metrology::sample::AxisCompensation;
use metrology::stamp::{Host, Span, Stamp};
use metrology::{Axis, OffsetFault, OffsetRule, PerAxis};

use crate::config::Settings;

/// Least change that is passed on: 10 nm, a tenth of the finest pulse in use; 0.002 arcsec.
const LEAST_CHANGE: f64 = 1e-5;
/// Least time between two settings: HAL's limiter interpolates.
const LEAST_PERIOD: Span = Span::from_nanos(10_000_000);
/// Time between two beats.
const BEAT: Span = Span::from_nanos(100_000_000);

/// What is to be said once, when it changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freshness {
    /// Compensation comes.
    Fresh,
    /// Compensation has stopped coming; HAL fades it out.
    Stale,
}

/// The way of the offsets into HAL.
#[derive(Clone, Debug)]
pub struct CompensationPath {
    joints: Vec<Axis>,
    rule: OffsetRule,
    stale_after: Span,
    received: Option<Stamp<Host>>,
    wanted: PerAxis<f64>,
    passed: PerAxis<Option<f64>>,
    passed_at: Option<Stamp<Host>>,
    beat: bool,
    beat_at: Option<Stamp<Host>>,
}

impl CompensationPath {
    /// With the limits of `settings`.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        Self {
            joints: settings.joints.clone(),
            rule: settings.offset_rule(),
            stale_after: settings.compensation_stale_after,
            received: None,
            wanted: PerAxis::default(),
            passed: PerAxis::default(),
            passed_at: None,
            beat: false,
            beat_at: None,
        }
    }

    /// HAL was started anew and knows nothing.
    pub fn forget_passed(&mut self) {
        self.passed = PerAxis::default();
        self.passed_at = None;
        self.beat_at = None;
    }

    /// Says nothing more to HAL, which fades out what it has; new offsets take it up again.
    pub fn release(&mut self) {
        self.received = None;
    }

    /// HAL is given zero, and its heart goes on beating: what it has fades at its own rate.
    pub fn want_zero(&mut self, at: Stamp<Host>) {
        self.wanted = PerAxis::default();
        self.received = Some(at);
    }

    /// Takes new offsets; the whole set is refused when one of them is, and the last good one stays. An axis that the set
    /// leaves out has none: otherwise who names other axes alone would keep the last offset of one that fell silent.
    ///
    /// # Errors
    /// Offsets that [`OffsetRule`] refuses: a condition to report, nothing else changes.
    pub fn receive(
        &mut self,
        at: Stamp<Host>,
        compensation: &AxisCompensation,
    ) -> Result<(), OffsetFault> {
        self.rule.check(at, compensation)?;
        for &axis in &self.joints {
            let is_named = compensation.axes.contains(axis);
            self.wanted[axis] = if is_named {
                compensation.total[axis]
            } else {
                0.0
            };
        }
        self.received = Some(at);
        Ok(())
    }

    /// Whether compensation is fresh; `None` before the first.
    #[must_use]
    pub fn freshness(&self, at: Stamp<Host>) -> Option<Freshness> {
        let age = at - self.received?;
        Some(if age > self.stale_after {
            Freshness::Stale
        } else {
            Freshness::Fresh
        })
    }

    /// Greatest of the offsets last sent to HAL for linear axes, mm.
    #[must_use]
    pub fn greatest_passed_mm(&self) -> f64 {
        let linear = self.joints.iter().filter(|axis| axis.is_linear());
        let passed = linear.filter_map(|axis| self.passed[*axis]);
        passed.fold(0.0, |greatest: f64, offset| greatest.max(offset.abs()))
    }

    /// Commands for HAL that are due, one a line; `None` when nothing is due. While the way is not `open`, HAL gets zero,
    /// towards which it fades what it has at its own rate.
    pub fn due(&mut self, at: Stamp<Host>, open: bool) -> Option<String> {
        // A host clock that went back must not make the heartbeat wait.
        for stamp in [&mut self.received, &mut self.passed_at, &mut self.beat_at] {
            *stamp = stamp.map(|stamp| stamp.min(at));
        }
        if self.freshness(at) != Some(Freshness::Fresh) {
            return None;
        }
        let mut lines = String::new();
        if self
            .passed_at
            .is_none_or(|passed_at| at - passed_at >= LEAST_PERIOD)
        {
            for &axis in &self.joints {
                let wanted = if open { self.wanted[axis] } else { 0.0 };
                let step = if axis.is_linear() {
                    LEAST_CHANGE
                } else {
                    LEAST_CHANGE * 1e-3
                };
                if self.passed[axis].is_none_or(|passed| (wanted - passed).abs() >= step) {
                    self.passed[axis] = Some(wanted);
                    self.passed_at = Some(at);
                    let value = if axis.is_linear() {
                        wanted
                    } else {
                        wanted.to_degrees()
                    };
                    let name = axis.letter().to_ascii_lowercase();
                    writeln!(lines, "sets abbe-compensation-{name} {value:.9}")
                        .expect("writing to a String cannot fail");
                }
            }
        }
        if self.beat_at.is_none_or(|beat_at| at - beat_at >= BEAT) {
            self.beat = !self.beat;
            self.beat_at = Some(at);
            writeln!(lines, "sets abbe-heartbeat {}", u8::from(self.beat))
                .expect("writing to a String cannot fail");
        }
        (!lines.is_empty()).then_some(lines)
    }
}

#[cfg(test)]
mod tests {
    use metrology::AxisSet;
    use metrology::sample::CompensationState;

    use super::*;
    use crate::config::Prepare;

    fn path() -> CompensationPath {
        let second = Span::from_secs_f64(1.0);
        CompensationPath::new(&Settings {
            joints: vec![Axis::X],
            scales: vec![],
            axes: AxisSet::XYZ,
            servo_period: Span::from_secs_f64(1e-3),
            prepare: Prepare::Observe,
            connect_password: String::new(),
            enable_password: String::new(),
            poll_period: second,
            reply_timeout: second,
            reconnect_period: second,
            homing_timeout: second,
            compensation_limit: PerAxis([0.2; 6]),
            compensation_stale_after: second,
            pulse_mm: 1e-4,
            mark: None,
        })
    }

    fn offsets(at: Stamp<Host>) -> AxisCompensation {
        AxisCompensation {
            at,
            axes: AxisSet::XYZ,
            total: PerAxis([0.01; 6]),
            thermal: PerAxis::default(),
            geometric: PerAxis::default(),
            positioning: PerAxis::default(),
            pulses: PerAxis::default(),
            remainder: PerAxis([0.01; 6]),
            state: PerAxis([CompensationState::Active; 6]),
        }
    }

    /// Heartbeats in the next 3 s, with offsets for the first of them.
    fn beats(path: &mut CompensationPath, from: Stamp<Host>) -> usize {
        let commands = (0..300).filter_map(|tick| {
            let at = from + Span::from_nanos(tick * 10_000_000);
            if tick < 100 {
                path.receive(at, &offsets(at)).unwrap();
            }
            path.due(at, true)
        });
        commands
            .filter(|lines| lines.contains("abbe-heartbeat"))
            .count()
    }

    #[test]
    fn the_heart_beats_on_under_a_clock_that_is_set_back_and_stops_in_time() {
        let mut path = path();
        let now = Stamp::from_nanos(1_700_000_000_000_000_000);
        assert!((19..=21).contains(&beats(&mut path, now)));
        let hour = Span::from_secs_f64(3600.0);
        assert!((19..=21).contains(&beats(&mut path, now - hour)));
        // Offsets break off, and the clock is set back once more.
        path.receive(now, &offsets(now)).unwrap();
        let silent = (0..300).filter_map(|tick| {
            let at = now - hour + Span::from_nanos(tick * 10_000_000);
            path.due(at, true)
        });
        assert!(silent.count() <= 11);
    }
}
