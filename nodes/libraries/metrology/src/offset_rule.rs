//! Which offsets of `compensation` a controller follows: those that are sound, within its limits, and of now.
//!
//! For each axis with total o, N pulses of δ, remainder ρ and size limit S, a message stamped t that comes at t′:
//!
//! ```text
//!   |o| ≤ S                                                                       (1)
//!   o = 0                         where the state is OFF                          (2)
//!   |o − (N δ + ρ)| ≤ δ           a linear axis, which has a pulse equivalent     (3)
//!   |t′ − t| ≤ T                  T: an offset is held as long, and at least 0.5 s (4)
//! ```
//!
//! (1) to (3) are of the controller's own axes. (4) bounds delay and the difference of clocks, not silence: a busy network
//! may be late by more than a short hold. A message that breaks one of them is refused whole. The controller then does as if none had come: it holds what it
//! has, and lets it fade when none has come for T. Both stamps of (4) are by the reference's clock, where clocks of
//! hosts are related to it, or by simulated time.

use crate::axis::{Axis, AxisSet, PerAxis};
use crate::number::{along, number};
use crate::sample::{AxisCompensation, CompensationState};
use crate::stamp::{Host, Span, Stamp};

/// The limits of one controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffsetRule {
    /// Its axes; others of a message are neither checked nor followed.
    pub axes: AxisSet,
    /// S, mm or rad.
    pub size_limit: PerAxis<f64>,
    /// δ, mm.
    pub pulse_mm: f64,
    /// T.
    pub age_limit: Span,
}

/// Why a message is not followed; offsets mm or rad.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum OffsetFault {
    /// Not a finite number.
    #[error("compensation of axis {axis} is {value}: must be a number: refused; stop the node that publishes it", value = number(*value))]
    NotFinite {
        /// Axis.
        axis: Axis,
        /// What was sent.
        value: f64,
    },
    /// Breaks (1).
    #[error(
        "compensation of axis {axis} is {}, limit {}: refused; compare the limits of its publisher with the controller's",
        along(*axis, *value), along(*axis, *limit)
    )]
    TooLarge {
        /// Axis.
        axis: Axis,
        /// What was sent, mm or rad.
        value: f64,
        /// The limit, mm or rad.
        limit: f64,
    },
    /// Breaks (2).
    #[error(
        "compensation of axis {axis} is {} with STATE_OFF, which adds nothing: limit 0: refused; stop the node that publishes it",
        along(*axis, *value)
    )]
    Off {
        /// Axis.
        axis: Axis,
        /// What was sent, mm or rad.
        value: f64,
    },
    /// Breaks (3).
    #[error(
        "compensation of axis {axis} is {}, its pulses and remainder are {}, limit of the difference one pulse of {pulse_mm} mm: refused; compare control.pulse_equivalent_um of its publisher's machine file, or stop that node",
        along(*axis, *value), along(*axis, *split), pulse_mm = number(*pulse_mm)
    )]
    Split {
        /// Axis.
        axis: Axis,
        /// The total, mm.
        value: f64,
        /// Pulses and remainder together, mm.
        split: f64,
        /// One pulse, mm.
        pulse_mm: f64,
    },
    /// Breaks (4), from the past.
    #[error(
        "compensation is stamped {age_s} s ago, limit {limit_s} s: refused; stop the node that publishes what was recorded, or relate the clocks of the hosts (clock_host)",
        age_s = number(*age_s), limit_s = number(*limit_s)
    )]
    Old {
        /// How old, s.
        age_s: f64,
        /// The limit, s.
        limit_s: f64,
    },
    /// Breaks (4), from the future.
    #[error(
        "compensation is stamped {ahead_s} s in the future, limit {limit_s} s: refused; stop the node that publishes it, or relate the clocks of the hosts (clock_host)",
        ahead_s = number(*ahead_s), limit_s = number(*limit_s)
    )]
    Early {
        /// How far ahead, s.
        ahead_s: f64,
        /// The limit, s.
        limit_s: f64,
    },
}

/// What messages of one reason count as, in words.
const REASONS: [&str; 6] = [
    "not finite",
    "too large",
    "off with an offset",
    "pulses of another offset",
    "old",
    "in the future",
];

impl OffsetFault {
    const fn place(&self) -> usize {
        match self {
            Self::NotFinite { .. } => 0,
            Self::TooLarge { .. } => 1,
            Self::Off { .. } => 2,
            Self::Split { .. } => 3,
            Self::Old { .. } => 4,
            Self::Early { .. } => 5,
        }
    }

    /// The kind of fault, by which refused messages are counted.
    #[must_use]
    pub const fn reason(&self) -> &'static str {
        REASONS[self.place()]
    }

    /// Whether only the stamp is wrong: the clocks of the hosts may not be related yet.
    #[must_use]
    pub const fn is_of_time(&self) -> bool {
        matches!(self, Self::Old { .. } | Self::Early { .. })
    }
}

/// Messages that were refused since the start, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OffsetsRefused([u64; REASONS.len()]);

impl OffsetsRefused {
    /// Counts one; how many there are for this reason.
    pub fn count(&mut self, fault: &OffsetFault) -> u64 {
        let of_reason = &mut self.0[fault.place()];
        *of_reason = of_reason.saturating_add(1);
        *of_reason
    }
}

/// Delays and differences of clocks that are no fault, however short an offset is held.
const LEAST_AGE_LIMIT: Span = Span::from_nanos(500_000_000);

impl OffsetRule {
    /// T of a controller that holds an offset so long without a new one.
    #[must_use]
    pub fn age_limit_of(hold: Span) -> Span {
        hold.max(LEAST_AGE_LIMIT)
    }

    /// Whether a message that comes `at` may be followed.
    ///
    /// # Errors
    /// The first of (1) to (4) that it breaks.
    pub fn check(&self, at: Stamp<Host>, message: &AxisCompensation) -> Result<(), OffsetFault> {
        for axis in message.axes.iter() {
            let value = message.total[axis];
            if !self.axes.contains(axis) {
                continue;
            }
            self.check_size(axis, value)?;
            if message.state[axis] == CompensationState::Off && value != 0.0 {
                return Err(OffsetFault::Off { axis, value });
            }
            self.check_split(axis, message)?;
        }
        self.check_stamp(at, message.at)
    }

    fn check_size(&self, axis: Axis, value: f64) -> Result<(), OffsetFault> {
        let limit = self.size_limit[axis];
        if !value.is_finite() {
            return Err(OffsetFault::NotFinite { axis, value });
        }
        if value.abs() > limit {
            return Err(OffsetFault::TooLarge { axis, value, limit });
        }
        Ok(())
    }

    fn check_split(&self, axis: Axis, message: &AxisCompensation) -> Result<(), OffsetFault> {
        let pulse_mm = self.pulse_mm;
        let value = message.total[axis];
        let split = message.pulses[axis] as f64 * pulse_mm + message.remainder[axis];
        // False for NaN.
        let is_whole = (value - split).abs() <= pulse_mm;
        if axis.is_linear() && !is_whole {
            return Err(OffsetFault::Split {
                axis,
                value,
                split,
                pulse_mm,
            });
        }
        Ok(())
    }

    fn check_stamp(&self, at: Stamp<Host>, stamped: Stamp<Host>) -> Result<(), OffsetFault> {
        let limit_s = self.age_limit.as_secs_f64();
        let (age, ahead) = (at - stamped, stamped - at);
        if age > self.age_limit {
            let age_s = age.as_secs_f64();
            return Err(OffsetFault::Old { age_s, limit_s });
        }
        if ahead > self.age_limit {
            let ahead_s = ahead.as_secs_f64();
            return Err(OffsetFault::Early { ahead_s, limit_s });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: OffsetRule = OffsetRule {
        axes: AxisSet::XYZ,
        size_limit: PerAxis([0.5; 6]),
        pulse_mm: 1e-4,
        age_limit: Span::from_nanos(1_000_000_000),
    };

    fn now() -> Stamp<Host> {
        Stamp::from_nanos(1_700_000_000_000_000_000)
    }

    /// Offsets of X in pulses, as `axis_compensation` splits them.
    fn message(x_mm: f64) -> AxisCompensation {
        let mut message = AxisCompensation {
            at: now(),
            axes: AxisSet::XYZ,
            total: PerAxis::default(),
            thermal: PerAxis::default(),
            geometric: PerAxis::default(),
            positioning: PerAxis::default(),
            pulses: PerAxis::default(),
            remainder: PerAxis::default(),
            state: PerAxis([CompensationState::Active; 6]),
        };
        message.total[Axis::X] = x_mm;
        let pulses = (x_mm / RULE.pulse_mm).trunc();
        message.pulses[Axis::X] = pulses as i64;
        message.remainder[Axis::X] = x_mm - pulses * RULE.pulse_mm;
        message
    }

    fn reason(at: Stamp<Host>, message: &AxisCompensation) -> Option<&'static str> {
        RULE.check(at, message).err().map(|fault| fault.reason())
    }

    #[test]
    fn sound_messages_of_now_are_followed() {
        for x_mm in [0.0, -0.0, 1e-5, -3.7e-4, 0.123_456_7, -0.5, 0.5] {
            let mut sent = message(x_mm);
            assert_eq!(reason(now(), &sent), None, "{x_mm}");
            // Split to the nearest pulse, and not split at all.
            sent.pulses[Axis::X] = (x_mm / RULE.pulse_mm).round() as i64;
            sent.remainder[Axis::X] = 0.0;
            assert_eq!(reason(now(), &sent), None, "{x_mm}");
            sent.pulses[Axis::X] = 0;
            sent.remainder[Axis::X] = x_mm;
            assert_eq!(reason(now(), &sent), None, "{x_mm}");
        }
        let mut off = message(0.0);
        off.state = PerAxis([CompensationState::Off; 6]);
        assert_eq!(reason(now(), &off), None);
    }

    #[test]
    fn eq1_offsets_beyond_the_limit_of_an_own_axis_are_refused() {
        for x_mm in [0.500_1, -0.6, 1e300, -1e6] {
            assert_eq!(reason(now(), &message(x_mm)), Some("too large"), "{x_mm}");
        }
        for x_mm in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(reason(now(), &message(x_mm)), Some("not finite"), "{x_mm}");
        }
        let mut other = message(0.0);
        other.axes = other.axes.with(Axis::A);
        other.total[Axis::A] = 2.0;
        other.state[Axis::A] = CompensationState::Off;
        assert_eq!(reason(now(), &other), None, "an axis of another machine");
    }

    #[test]
    fn eq2_an_axis_that_is_off_has_no_offset() {
        for axis in Axis::LINEAR {
            for offset in [0.4, -1e-9, 1e-3] {
                let mut sent = message(0.0);
                sent.axes = sent.axes.with(axis);
                sent.total[axis] = offset;
                sent.remainder[axis] = offset;
                assert_eq!(reason(now(), &sent), None, "{axis} {offset}");
                sent.state[axis] = CompensationState::Off;
                assert_eq!(
                    reason(now(), &sent),
                    Some("off with an offset"),
                    "{axis} {offset}"
                );
                sent.state[axis] = CompensationState::Fading;
                assert_eq!(reason(now(), &sent), None, "{axis} {offset}");
            }
        }
    }

    #[test]
    fn eq3_pulses_and_remainder_are_the_total_to_one_pulse() {
        for (x_mm, pulses, remainder_mm, is_refused) in [
            (0.01, 100, 0.0, false),
            (0.01, 99, 0.0, false),
            (0.01, 102, 0.0, true),
            (0.01, 4_900, 0.0, true),
            (0.01, 0, 0.0, true),
            (0.01, -100, 0.0, true),
            (0.0, i64::MAX, 0.0, true),
            (0.0, i64::MIN, 0.0, true),
            (0.0, 0, 0.4, true),
            (0.0, 0, f64::NAN, true),
            (-0.4, -4_000, 0.0, false),
            (-0.4, 4_000, 0.0, true),
        ] {
            let mut sent = message(x_mm);
            sent.pulses[Axis::X] = pulses;
            sent.remainder[Axis::X] = remainder_mm;
            let seen = reason(now(), &sent);
            let expected = is_refused.then_some("pulses of another offset");
            assert_eq!(seen, expected, "{x_mm} {pulses} {remainder_mm}");
        }
        // A rotary axis has no pulse equivalent.
        let mut rotary = message(0.0);
        rotary.axes = rotary.axes.with(Axis::C);
        (rotary.total[Axis::C], rotary.pulses[Axis::C]) = (1e-4, 7);
        assert_eq!(reason(now(), &rotary), None);
    }

    #[test]
    fn eq4_what_is_not_of_now_is_refused() {
        for (age_s, expected) in [
            (0.0, None),
            (0.005, None),
            (-0.005, None),
            (1.0, None),
            (-1.0, None),
            (1.001, Some("old")),
            (3e7, Some("old")),
            (-1.001, Some("in the future")),
            (-3e8, Some("in the future")),
        ] {
            let at = now() + Span::from_secs_f64(age_s);
            assert_eq!(reason(at, &message(0.4)), expected, "{age_s} s");
        }
        for nanos in [0, i64::MIN, i64::MAX] {
            let mut sent = message(0.0);
            sent.at = Stamp::from_nanos(nanos);
            let fault = RULE.check(now(), &sent).unwrap_err();
            assert!(fault.is_of_time(), "{nanos}");
        }
    }

    #[test]
    fn a_short_hold_leaves_delays_of_half_a_second() {
        for (hold_s, limit_s) in [
            (0.001, 0.5),
            (0.2, 0.5),
            (0.5, 0.5),
            (1.0, 1.0),
            (60.0, 60.0),
        ] {
            let limit = OffsetRule::age_limit_of(Span::from_secs_f64(hold_s));
            assert_eq!(limit, Span::from_secs_f64(limit_s), "{hold_s}");
        }
    }

    #[test]
    fn a_refusal_names_axis_value_limit_and_remedy_and_is_counted_by_reason() {
        let mut off = message(0.4);
        off.state[Axis::X] = CompensationState::Off;
        let mut split = message(0.01);
        split.pulses[Axis::X] = 4_900;
        let late = now() + Span::from_secs_f64(30.5);
        let early = now() - Span::from_secs_f64(2.0);
        let mut counts = OffsetsRefused::default();
        for (at, sent, words) in [
            (
                now(),
                &off,
                ["axis X is 0.4 mm", "limit 0", "stop the node"],
            ),
            (
                now(),
                &split,
                ["axis X is 0.01 mm", "0.49", "one pulse of 0.0001 mm"],
            ),
            (
                late,
                &message(0.4),
                ["30.5 s ago", "limit 1 s", "clock_host"],
            ),
            (
                early,
                &message(0.4),
                ["2 s in the future", "limit 1 s", "clock_host"],
            ),
        ] {
            let fault = RULE.check(at, sent).unwrap_err();
            let message = fault.to_string();
            assert!(words.iter().all(|word| message.contains(word)), "{message}");
            assert_eq!((counts.count(&fault), counts.count(&fault)), (1, 2));
        }
    }
}
