//! Whether a reading can be, by what is known of how fast its quantity changes.
//!
//! A machine tells a value when it has changed since it last looked, so a change took one look at most:
//!
//! ```text
//!   d_max(i, j) = s + r · min(t_j − t_i, T)                                               (1)
//!   reading j leaves i   when  |v_j − v_i| > d_max(i, j)                                  (2)
//!   reading k is back    when  |v_k − v_i| ≤ s + r · (min(t_j − t_i, T) + t_k − t_j)      (3)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | s | `step`: resolution of the reading | that of the value |
//! | r | `rate_limit_per_s`: fastest change of the quantity | that of the value, 1/s |
//! | T | `sample_period_s`: the machine looks this often | s |
//!
//! A reading that leaves its neighbour before it (2) waits. When the next ones leave it too and are back (3), it
//! cannot have been: *impossible*. When the next ones agree with it for `confirm_s`, or come between both, it
//! was a true step: *good*. When no next one comes (the value becomes unavailable), nothing can be said:
//! *unconfirmed*. The first reading after an absence has no neighbour before it: it is good once it has held for
//! T or the next one agrees with it, and unconfirmed when the next one leaves it sooner.
//!
//! # Holds when
//! A wrong reading is over within `confirm_s`. A sensor that is wrong for longer, or by less than (1), is not
//! found.
//!
//! # Agreement
//! `val_nist_a_day_of_a_mill_turn_centre_is_in_the_bag`: of 2,207 readings of 0 °C of two spindles in a day 2,206 are
//! found impossible and one, before an absence, unconfirmed; none of the 7,111 others is.

use metrology::sample::Verdict;
use metrology::stamp::{Host, Machine, Span, Stamp};

/// A reading.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// When, by the machine.
    pub machine_at: Stamp<Machine>,
    /// When it came.
    pub received_at: Stamp<Host>,
    /// The number in its inner unit; NaN where it is none.
    pub value: f64,
    /// The machine's words.
    pub text: String,
}

/// What is known of how a quantity changes, in its inner unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rule {
    /// Resolution of the reading.
    pub step: f64,
    /// Fastest change, 1/s.
    pub rate_limit_per_s: f64,
    /// The machine looks this often.
    pub sample_period: Span,
    /// A step that has held this long is true.
    pub confirm: Span,
}

/// Judges the readings of one value.
#[derive(Clone, Debug)]
pub struct Judge {
    rule: Rule,
    base: Option<Reading>,
    first: Option<Reading>,
    waiting: Vec<Reading>,
}

/// Readings that may wait; more are judged as they stand.
const WAITING_LIMIT: usize = 1000;

impl Judge {
    /// A judge who has seen nothing.
    #[must_use]
    pub const fn new(rule: Rule) -> Self {
        Self {
            rule,
            base: None,
            first: None,
            waiting: Vec::new(),
        }
    }

    fn span_s(later: &Reading, earlier: &Reading) -> f64 {
        (later.machine_at - earlier.machine_at)
            .as_secs_f64()
            .max(0.0)
    }

    /// (1).
    #[must_use]
    pub fn allowed(&self, earlier: &Reading, later: &Reading) -> f64 {
        let looked_s = Self::span_s(later, earlier).min(self.rule.sample_period.as_secs_f64());
        self.rule.step + self.rule.rate_limit_per_s * looked_s
    }

    /// Not (2).
    fn agree(&self, earlier: &Reading, later: &Reading) -> bool {
        (later.value - earlier.value).abs() <= self.allowed(earlier, later)
    }

    /// (3) with the first that waits as j.
    fn is_back(&self, base: &Reading, left: &Reading, now: &Reading) -> bool {
        let since_left = self.rule.rate_limit_per_s * Self::span_s(now, left);
        (now.value - base.value).abs() <= self.allowed(base, left) + since_left
    }

    fn release(&mut self, verdict: Verdict, out: &mut Vec<(Reading, Verdict)>) {
        out.extend(self.waiting.drain(..).map(|reading| (reading, verdict)));
    }

    /// Takes a reading, and appends those that can be judged by it.
    pub fn hear(&mut self, reading: Reading, out: &mut Vec<(Reading, Verdict)>) {
        let Some(base) = &self.base else {
            return self.hear_early(reading, out);
        };
        let Some(left) = self.waiting.first() else {
            if self.agree(base, &reading) {
                self.accept(reading, out);
            } else {
                self.waiting.push(reading);
            }
            return;
        };
        let last = self.waiting.last().unwrap_or(left);
        let (goes_on, is_back) = (
            self.agree(last, &reading),
            self.is_back(base, left, &reading),
        );
        let has_held = reading.machine_at - left.machine_at >= self.rule.confirm;
        match (goes_on, is_back) {
            (false, true) => {
                self.release(Verdict::Impossible, out);
                self.accept(reading, out);
            }
            (true, true) => {
                self.release(Verdict::Good, out);
                self.accept(reading, out);
            }
            (true, false) if has_held => {
                self.release(Verdict::Good, out);
                self.accept(reading, out);
            }
            (false, false) if has_held || self.waiting.len() >= WAITING_LIMIT => {
                self.release(Verdict::Unconfirmed, out);
                self.base = None;
                self.first = Some(reading);
            }
            _ => self.waiting.push(reading),
        }
    }

    fn hear_early(&mut self, reading: Reading, out: &mut Vec<(Reading, Verdict)>) {
        let Some(first) = self.first.take() else {
            self.first = Some(reading);
            return;
        };
        let has_held = reading.machine_at - first.machine_at >= self.rule.sample_period;
        if self.agree(&first, &reading) {
            out.push((first, Verdict::Good));
            self.accept(reading, out);
        } else if has_held {
            self.accept(first, out);
            self.waiting.push(reading);
        } else {
            out.push((first, Verdict::Unconfirmed));
            self.first = Some(reading);
        }
    }

    fn accept(&mut self, reading: Reading, out: &mut Vec<(Reading, Verdict)>) {
        self.base = Some(reading.clone());
        out.push((reading, Verdict::Good));
    }

    /// Time has passed on the host: what nobody contradicted for long enough is good.
    pub fn wait(&mut self, now: Stamp<Host>, out: &mut Vec<(Reading, Verdict)>) {
        if let Some(first) = &self.first
            && now - first.received_at >= self.rule.sample_period
        {
            let first = self.first.take().expect("it was there a line ago");
            self.accept(first, out);
        }
        let has_held = |left: &Reading| now - left.received_at >= self.rule.confirm;
        if self.waiting.first().is_some_and(has_held) {
            self.base = self.waiting.last().cloned();
            self.release(Verdict::Good, out);
        }
    }

    /// The value is not known any more.
    pub fn absent(&mut self, out: &mut Vec<(Reading, Verdict)>) {
        out.extend(self.first.take().map(|first| (first, Verdict::Good)));
        self.release(Verdict::Unconfirmed, out);
        self.base = None;
    }

    /// The last good reading.
    #[must_use]
    pub fn base(&self) -> Option<&Reading> {
        self.base.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rule() -> Rule {
        Rule {
            step: 1.0,
            rate_limit_per_s: 1.0,
            sample_period: Span::from_secs_f64(1.5),
            confirm: Span::from_secs_f64(60.0),
        }
    }

    fn reading(at_s: f64, value: f64) -> Reading {
        let nanos = Span::from_secs_f64(at_s).nanos();
        Reading {
            machine_at: Stamp::from_nanos(nanos),
            received_at: Stamp::from_nanos(nanos),
            value,
            text: value.to_string(),
        }
    }

    /// One letter per verdict (G, I, U) in the order in which they were given, with the value.
    fn judged(readings: &[(f64, f64)], then_absent: bool) -> String {
        let mut judge = Judge::new(rule());
        let mut out = Vec::new();
        for (at_s, value) in readings {
            judge.hear(reading(*at_s, *value), &mut out);
        }
        if then_absent {
            judge.absent(&mut out);
        }
        let letter = |verdict| match verdict {
            Verdict::Good => 'G',
            Verdict::Impossible => 'I',
            Verdict::Unconfirmed => 'U',
        };
        let words = out
            .iter()
            .map(|(r, v)| format!("{}{}", letter(*v), r.value));
        words.collect::<Vec<_>>().join(" ")
    }

    /// The first lines of `Stemp` in the log of 2016-11-29, seconds after 09:28:49.444.
    #[test]
    fn val_nist_a_zero_between_two_readings_of_43_cannot_be() {
        let lines = [
            (0.0, 43.0),
            (12.628, 0.0),
            (13.68, 43.0),
            (55.78, 0.0),
            (56.832, 43.0),
        ];
        assert_eq!(judged(&lines, false), "G43 I0 G43 I0 G43");
    }

    #[test]
    fn eq2_a_long_silence_before_a_wrong_reading_hides_it_not() {
        let lines = [(0.0, 43.0), (1.0, 43.5), (3600.0, 0.0), (3601.0, 44.0)];
        assert_eq!(judged(&lines, false), "G43 G43.5 I0 G44");
    }

    #[test]
    fn eq3_a_step_that_lasts_and_one_that_comes_half_back_are_true() {
        let lines = [
            (0.0, 20.0),
            (2.0, 20.5),
            (10.0, 40.0),
            (40.0, 40.5),
            (71.0, 41.0),
        ];
        assert_eq!(judged(&lines, false), "G20 G20.5 G40 G40.5 G41");
        let lines = [(0.0, 20.0), (2.0, 20.5), (10.0, 24.0), (11.0, 22.5)];
        assert_eq!(judged(&lines, false), "G20 G20.5 G24 G22.5");
    }

    #[test]
    fn a_reading_without_a_neighbour_is_not_judged() {
        let lines = [(0.0, 43.0), (9.0, 43.0), (12.0, 0.0)];
        assert_eq!(judged(&lines, true), "G43 G43 U0");
        let lines = [(0.0, 0.0), (1.0, 43.0), (5.0, 0.0), (6.0, 43.0)];
        assert_eq!(judged(&lines, false), "U0 G43 I0 G43");
        assert_eq!(judged(&[(0.0, 43.0)], true), "G43");
    }

    #[test]
    fn what_nobody_contradicts_is_good_after_its_time() {
        let mut judge = Judge::new(rule());
        let mut out = Vec::new();
        judge.hear(reading(0.0, 20.0), &mut out);
        judge.wait(reading(1.0, 0.0).received_at, &mut out);
        assert!(out.is_empty());
        judge.wait(reading(2.0, 0.0).received_at, &mut out);
        judge.hear(reading(5.0, 60.0), &mut out);
        judge.wait(reading(64.0, 0.0).received_at, &mut out);
        assert_eq!(out.len(), 1);
        judge.wait(reading(65.0, 0.0).received_at, &mut out);
        assert_eq!((out.len(), out[1].1), (2, Verdict::Good));
    }

    proptest! {
        #[test]
        fn prop_every_reading_is_judged_once_and_in_order(
            steps in proptest::collection::vec((-1.0..90.0_f64, prop_oneof![Just(0.0), 0.0..60.0_f64]), 0..60),
        ) {
            let mut judge = Judge::new(rule());
            let (mut out, mut at_s) = (Vec::new(), 100.0);
            for (step_s, value) in &steps {
                at_s += step_s;
                judge.hear(reading(at_s, *value), &mut out);
            }
            judge.absent(&mut out);
            let values: Vec<f64> = out.iter().map(|(r, _)| r.value).collect();
            let told: Vec<f64> = steps.iter().map(|(_, value)| *value).collect();
            prop_assert_eq!(values, told);
        }
    }
}
