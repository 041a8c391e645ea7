//! The compensation input: offsets added to the position commands, never as a step.
//!
//! # Model
//!
//! ```text
//!   o ← o + clamp(o* - o, ±ȯ_max T)          while messages come              (1)
//!   o ← o - sign(o) min(|o|, ȯ_fade T)       after `compensation_hold_s` without one     (2)
//! ```
//!
//! o* is the last offset that [`OffsetRule`] accepts. Until it is stale it is held. Before every axis is homed, o* counts as zero and
//! what is applied fades by (2): the machine's zero must not have an offset in it. Because (1) holds for the first
//! message as for any other, a compensation that starts, stops, restarts or jumps moves the axis at
//! ȯ_max and no faster.

use metrology::sample::AxisCompensation;
use metrology::stamp::Host;
use metrology::{GateNews, HomedGate, OffsetRule, OffsetsRefused, PerAxis, Stamp};

use crate::config::OffsetLimits;
use crate::diagnostic::Diagnostic;

/// State of the compensation input.
#[derive(Clone, Debug, PartialEq)]
pub struct OffsetInput {
    rule: OffsetRule,
    limits: PerAxis<OffsetLimits>,
    hold: u64,
    wanted: PerAxis<f64>,
    applied: PerAxis<f64>,
    silent: u64,
    stale: bool,
    resting: bool,
    complained: bool,
    refused: OffsetsRefused,
    gate: HomedGate,
    /// Whether it was reported that offsets are held back.
    told_held: bool,
}

impl OffsetInput {
    /// Nothing applied, and nothing held back; `hold` is in servo periods.
    #[must_use]
    pub fn new(rule: OffsetRule, limits: PerAxis<OffsetLimits>, hold: u64) -> Self {
        let mut gate = HomedGate::default();
        gate.step(true, false);
        Self {
            rule,
            limits,
            hold,
            wanted: PerAxis::default(),
            applied: PerAxis::default(),
            silent: 0,
            stale: true,
            resting: true,
            complained: false,
            refused: OffsetsRefused::default(),
            gate,
            told_held: false,
        }
    }

    /// Holds every offset back at zero, or lets it take effect again; tells each change once to who sends offsets.
    pub fn hold_back(&mut self, is_held: bool) -> Option<Diagnostic> {
        if self.gate.is_open() == is_held {
            self.resting = false;
        }
        let news = self.gate.step(!is_held, !self.stale);
        if news == Some(GateNews::HeldBack) {
            return (!std::mem::replace(&mut self.told_held, true))
                .then_some(Diagnostic::CompensationHeldBack);
        }
        let is_over = !is_held && std::mem::take(&mut self.told_held);
        is_over.then_some(Diagnostic::CompensationReleased)
    }

    /// Offsets in effect, mm or rad.
    #[must_use]
    pub const fn applied(&self) -> &PerAxis<f64> {
        &self.applied
    }

    /// Takes a message that comes `at`, or refuses it as a whole; returns what became worse, or well again.
    pub fn receive(&mut self, at: Stamp<Host>, message: &AxisCompensation) -> Option<Diagnostic> {
        if let Err(fault) = self.rule.check(at, message) {
            self.complained = true;
            let times = self.refused.count(&fault);
            return Some(Diagnostic::CompensationRefused { fault, times });
        }
        self.wanted = PerAxis::default();
        for axis in { self.rule.axes.iter() }.filter(|axis| message.axes.contains(*axis)) {
            self.wanted[axis] = message.total[axis];
        }
        self.silent = 0;
        self.stale = false;
        self.resting = false;
        std::mem::take(&mut self.complained).then_some(Diagnostic::CompensationFollowed)
    }

    /// Lets go of what is applied, as if it were stale; a new message takes it up again.
    pub fn release(&mut self) {
        self.stale = true;
        self.wanted = PerAxis::default();
    }

    /// One servo period; tells once when the compensation becomes stale.
    pub fn advance(&mut self) -> Option<Diagnostic> {
        if self.resting {
            return None;
        }
        let mut became_stale = None;
        if !self.stale {
            self.silent += 1;
            if self.silent > self.hold {
                self.stale = true;
                self.complained = true;
                self.wanted = PerAxis::default();
                became_stale = Some(Diagnostic::CompensationStale {
                    silent_periods: self.silent,
                });
            }
        }
        let mut moved = false;
        for axis in self.rule.axes.iter() {
            let limits = &self.limits[axis];
            let is_held = !self.gate.is_open();
            let step = if self.stale || is_held {
                limits.fade_step
            } else {
                limits.step
            };
            let wanted = if is_held { 0.0 } else { self.wanted[axis] };
            let gap = wanted - self.applied[axis];
            if gap.abs() <= step {
                self.applied[axis] = wanted;
            } else {
                self.applied[axis] += step.copysign(gap);
            }
            moved |= gap.abs() > 0.0;
        }
        self.resting = self.stale && !moved;
        became_stale
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::sample::CompensationState;
    use metrology::stamp::Span;
    use metrology::{Axis, AxisSet};
    use proptest::prelude::*;

    const LIMITS: OffsetLimits = OffsetLimits {
        size: 0.5,
        step: 1e-4,
        fade_step: 5e-6,
    };

    fn message(x_mm: f64) -> AxisCompensation {
        let mut total = PerAxis::default();
        total[Axis::X] = x_mm;
        AxisCompensation {
            at: now(),
            axes: AxisSet::XYZ,
            total,
            thermal: total,
            geometric: PerAxis::default(),
            positioning: PerAxis::default(),
            pulses: PerAxis::default(),
            remainder: total,
            state: PerAxis::from_fn(|_| CompensationState::Active),
        }
    }

    fn now() -> Stamp<Host> {
        Stamp::from_nanos(1_700_000_000_000_000_000)
    }

    fn input() -> OffsetInput {
        let rule = OffsetRule {
            axes: AxisSet::XYZ,
            size_limit: PerAxis::from_fn(|_| LIMITS.size),
            pulse_mm: 1e-4,
            age_limit: Span::from_secs_f64(0.1),
        };
        OffsetInput::new(rule, PerAxis::from_fn(|_| LIMITS), 100)
    }

    #[test]
    fn eq1_first_message_and_jump_are_followed_at_the_rate_limit() {
        let mut input = input();
        let mut last = 0.0;
        for target in [0.02, -0.02] {
            assert_eq!(input.receive(now(), &message(target)), None);
            for _ in 0..90 {
                assert_eq!(input.advance(), None);
                let now = input.applied()[Axis::X];
                assert!((now - last).abs() <= LIMITS.step + 1e-15);
                last = now;
            }
        }
        assert!((last - (0.009 - 0.009)).abs() < 1e-12);
    }

    #[test]
    fn eq2_stale_offset_is_held_then_fades_to_exactly_zero() {
        let mut input = input();
        assert_eq!(input.receive(now(), &message(0.001)), None);
        let mut stale_at = None;
        for period in 1..=400 {
            if input.advance().is_some() {
                assert_eq!(stale_at, None, "told once");
                stale_at = Some(period);
            }
            let now = input.applied()[Axis::X];
            if (11..=100).contains(&period) {
                assert!((now - 0.001).abs() < 1e-15, "held");
            }
        }
        assert_eq!(stale_at, Some(101));
        assert!(input.applied()[Axis::X].abs() <= 0.0);
        let again = input.receive(now(), &message(0.001));
        assert_eq!(again, Some(Diagnostic::CompensationFollowed));
        assert_eq!(input.receive(now(), &message(0.001)), None);
    }

    #[test]
    fn what_is_released_fades_without_a_step_and_is_taken_up_again_at_the_rate_limit() {
        let mut input = input();
        assert_eq!(input.receive(now(), &message(0.001)), None);
        (0..20).for_each(|_| assert_eq!(input.advance(), None));
        input.release();
        let mut last = 0.001;
        for _ in 0..150 {
            assert_eq!(input.advance(), None, "asked for, so nothing is stale");
            let now = input.applied()[Axis::X];
            assert!((last - now - LIMITS.fade_step).abs() < 1e-15);
            last = now;
        }
        assert_eq!(input.receive(now(), &message(0.001)), None);
        assert_eq!(input.advance(), None);
        assert!(input.applied()[Axis::X] - last <= LIMITS.step);
        input.release();
        (0..400).for_each(|_| assert_eq!(input.advance(), None));
        assert!(input.applied()[Axis::X].abs() <= 0.0);
    }

    #[test]
    fn what_is_held_back_fades_to_zero_and_rises_again_without_a_step() {
        let mut input = input();
        assert_eq!(input.receive(now(), &message(0.001)), None);
        (0..20).for_each(|_| assert_eq!(input.advance(), None));
        assert_eq!(
            input.hold_back(true),
            Some(Diagnostic::CompensationHeldBack)
        );
        let mut last = input.applied()[Axis::X];
        for _ in 0..400 {
            assert_eq!(input.receive(now(), &message(0.001)), None);
            assert_eq!(input.hold_back(true), None);
            input.advance();
            let now = input.applied()[Axis::X];
            assert!((0.0..=LIMITS.fade_step + 1e-15).contains(&(last - now)));
            last = now;
        }
        assert!(last.abs() <= 0.0);
        assert_eq!(
            input.hold_back(false),
            Some(Diagnostic::CompensationReleased)
        );
        for _ in 0..20 {
            input.advance();
            let now = input.applied()[Axis::X];
            assert!(now - last <= LIMITS.step + 1e-15);
            last = now;
        }
        assert!((last - 0.001).abs() < 1e-15);
        // A stream that ends while it is held back leaves no condition behind.
        assert!(input.hold_back(true).is_some());
        (0..400).for_each(|_| {
            input.advance();
            assert_eq!(input.hold_back(true), None);
        });
        assert_eq!(
            input.hold_back(false),
            Some(Diagnostic::CompensationReleased)
        );
    }

    #[derive(Clone, Debug)]
    enum Event {
        Told(f64),
        Passed(u32),
        Released,
        HeldBack(bool),
    }

    fn event() -> impl Strategy<Value = Event> {
        // Two publishers that contradict each other, and values that are none.
        let value = prop_oneof![
            10 => -0.6..0.6_f64,
            4 => prop_oneof![Just(0.45), Just(-0.45)],
            1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(-1e300)],
        ];
        prop_oneof![
            10 => value.prop_map(Event::Told),
            5 => (1..300_u32).prop_map(Event::Passed),
            1 => Just(Event::Released),
            1 => any::<bool>().prop_map(Event::HeldBack),
        ]
    }

    proptest! {
        #[test]
        fn prop_no_messages_of_any_number_of_publishers_make_a_step(
            events in prop::collection::vec(event(), 1..300),
        ) {
            let mut input = input();
            let mut last = 0.0_f64;
            for event in events {
                let periods = match event {
                    Event::Told(value) => {
                        input.receive(now(), &message(value));
                        1
                    }
                    Event::Released => {
                        input.release();
                        1
                    }
                    Event::HeldBack(is_held) => {
                        input.hold_back(is_held);
                        1
                    }
                    Event::Passed(periods) => periods,
                };
                for _ in 0..periods {
                    input.advance();
                    let now = input.applied()[Axis::X];
                    prop_assert!(now.abs() <= LIMITS.size, "{}", now);
                    prop_assert!((now - last).abs() <= LIMITS.step + 1e-15, "{} to {}", last, now);
                    last = now;
                }
            }
        }
    }

    #[test]
    fn refused_messages_change_nothing() {
        let mut input = input();
        assert_eq!(input.receive(now(), &message(0.001)), None);
        (0..20).for_each(|_| assert_eq!(input.advance(), None));
        let before = (input.wanted, input.silent);
        let nan = input.receive(now(), &message(f64::NAN)).unwrap();
        assert_eq!(
            nan.to_string(),
            "compensation of axis X is NaN: must be a number: refused; stop the node that publishes it"
        );
        assert!(input.receive(now(), &message(f64::INFINITY)).is_some());
        let large = input.receive(now(), &message(0.7)).unwrap();
        assert_eq!(
            large.to_string(),
            "compensation of axis X is 0.7 mm, limit 0.5 mm: refused; compare the limits of its publisher with the controller's"
        );
        assert_eq!((input.wanted, input.silent), before);
    }

    /// Messages that contradict themselves or are not of now, each with its reason.
    fn unsound() -> [(AxisCompensation, &'static str); 6] {
        let mut all = [(); 6].map(|()| (message(0.4), ""));
        all[0].0.state[Axis::X] = CompensationState::Off;
        all[1].0.pulses[Axis::X] = 4_900;
        all[2].0.remainder[Axis::X] = 0.0;
        all[3].0.remainder[Axis::Y] = 1e-3;
        all[4].0.at = now() - Span::from_secs_f64(3e7);
        all[5].0.at = now() + Span::from_secs_f64(0.2);
        let split = "pulses of another offset";
        let reasons = [
            "off with an offset",
            split,
            split,
            split,
            "old",
            "in the future",
        ];
        for ((_, of_this), reason) in all.iter_mut().zip(reasons) {
            *of_this = reason;
        }
        all
    }

    #[test]
    fn what_contradicts_itself_or_is_not_of_now_is_refused_and_the_offset_held_then_faded() {
        for (bad, reason) in unsound() {
            let mut input = input();
            assert_eq!(input.receive(now(), &message(0.001)), None);
            let (mut stale_at, mut refused) = (None, 0);
            for period in 1..=400 {
                match input.receive(now(), &bad) {
                    Some(Diagnostic::CompensationRefused { fault, times }) => {
                        refused += 1;
                        assert_eq!((fault.reason(), times), (reason, refused));
                    }
                    other => panic!("{other:?}"),
                }
                if input.advance().is_some() {
                    stale_at = Some(period);
                }
                let applied = input.applied()[Axis::X];
                assert!(applied <= 0.001 + 1e-15, "{reason}");
                if (11..=100).contains(&period) {
                    assert!((applied - 0.001).abs() < 1e-15, "{reason}: held");
                }
            }
            assert_eq!(stale_at, Some(101), "{reason}");
            assert!(input.applied()[Axis::X].abs() <= 0.0, "{reason}: faded");
            let again = input.receive(now(), &message(0.001));
            assert_eq!(again, Some(Diagnostic::CompensationFollowed));
        }
    }
}
