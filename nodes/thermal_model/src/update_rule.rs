//! When new block measurements are asked for.
//!
//! ```text
//!   tt ≥ ct                                 the published rule, ct = 10 to 20 min  (1)
//!   |d(t) − d(t_n)| > limit                 predicted drift since the last update  (2)
//!   the load changed                                                              (3)
//! ```
//!
//! (1) holds at equality. (2) and (3) wait for a least period, since a block cycle costs machining
//! time. An unanswered request is repeated; when the program never yields the tool, tt passes
//! ct + overrun and that is reported.

use metrology::sample::{UpdateReason, UpdateRequest};
use metrology::stamp::Span;
use metrology::{Host, Stamp};

use crate::config::ThermalModelConfig;

/// What the rule finds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Due {
    /// A request to send now.
    pub request: Option<UpdateRequest>,
    /// tt, s, when a missing update is to be reported now.
    pub overdue_s: Option<f64>,
}

/// The rule and what it has already asked.
#[derive(Clone, Debug)]
pub struct UpdateRule {
    period: Span,
    least_period: Span,
    repeat: Span,
    overrun: Span,
    drift_limit_mm: f64,
    asked: Option<(UpdateReason, Stamp<Host>)>,
    load_changed: bool,
    reported_at: Option<Stamp<Host>>,
}

impl UpdateRule {
    /// The rule for a checked configuration.
    #[must_use]
    pub fn new(config: &ThermalModelConfig) -> Self {
        let minutes = |min: f64| Span::from_secs_f64(min * 60.0);
        Self {
            period: minutes(config.update_period_min),
            least_period: minutes(config.cycle.least_period_min),
            repeat: minutes(config.cycle.repeat_min),
            overrun: minutes(config.cycle.overrun_min),
            drift_limit_mm: config.drift_limit_um * 1e-3,
            asked: None,
            load_changed: false,
            reported_at: None,
        }
    }

    /// An update came: nothing is asked any more.
    pub fn reset(&mut self) {
        self.asked = None;
        self.load_changed = false;
        self.reported_at = None;
    }

    /// Moves all instants after a step of the clock.
    pub fn shift(&mut self, by: Span) {
        self.asked = self.asked.map(|(reason, at)| (reason, at + by));
        self.reported_at = self.reported_at.map(|at| at + by);
    }

    /// The load changed: (3).
    pub fn load_changed(&mut self) {
        self.load_changed = true;
    }

    /// A quarantined jump wants its second measurement at once.
    pub fn confirm(&mut self, now: Stamp<Host>, last_update: Stamp<Host>) -> UpdateRequest {
        self.asked = Some((UpdateReason::Confirmation, now));
        UpdateRequest {
            at: now,
            reason: UpdateReason::Confirmation,
            elapsed_s: (now - last_update).as_secs_f64(),
        }
    }

    /// Judges (1) to (3) `now`.
    pub fn judge(
        &mut self,
        now: Stamp<Host>,
        last_update: Stamp<Host>,
        predicted_drift_mm: f64,
    ) -> Due {
        let elapsed = now - last_update;
        let early = elapsed < self.least_period;
        let reason = match self.asked {
            Some((UpdateReason::Confirmation, _)) => Some(UpdateReason::Confirmation),
            _ if elapsed >= self.period => Some(UpdateReason::Period),
            _ if early => None,
            _ if self.load_changed => Some(UpdateReason::LoadChange),
            _ if predicted_drift_mm > self.drift_limit_mm => Some(UpdateReason::PredictedDrift),
            _ => None,
        };
        let answered = |(_, at): (UpdateReason, Stamp<Host>)| now - at < self.repeat;
        let request = reason
            .filter(|_| !self.asked.is_some_and(answered))
            .map(|reason| UpdateRequest {
                at: now,
                reason,
                elapsed_s: elapsed.as_secs_f64(),
            });
        if let Some(request) = request {
            self.asked = Some((request.reason, now));
        }
        let missing = elapsed.nanos() >= self.period.nanos().saturating_add(self.overrun.nanos());
        let repeated = self.reported_at.is_none_or(|at| now - at >= self.period);
        let overdue_s = (missing && repeated).then(|| elapsed.as_secs_f64());
        if overdue_s.is_some() {
            self.reported_at = Some(now);
        }
        Due { request, overdue_s }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::tests::example;

    const MINUTE: i64 = 60_000_000_000;

    fn minutes(min: i64) -> Stamp<Host> {
        Stamp::from_nanos(min * MINUTE)
    }

    #[test]
    fn eq1_triggers_at_equality_and_not_a_nanosecond_before() {
        let mut rule = UpdateRule::new(&example());
        let before = Stamp::from_nanos(15 * MINUTE - 1);
        assert_eq!(rule.judge(before, minutes(0), 0.0), Due::default());
        let request = rule.judge(minutes(15), minutes(0), 0.0).request.unwrap();
        assert_eq!(request.reason, UpdateReason::Period);
        assert!((request.elapsed_s - 900.0).abs() < 1e-9);
    }

    #[test]
    fn a_request_is_repeated_only_after_its_time_and_forgotten_with_the_update() {
        let mut rule = UpdateRule::new(&example());
        assert!(rule.judge(minutes(15), minutes(0), 0.0).request.is_some());
        assert!(rule.judge(minutes(16), minutes(0), 0.0).request.is_none());
        assert!(rule.judge(minutes(17), minutes(0), 0.0).request.is_some());
        rule.reset();
        assert!(rule.judge(minutes(18), minutes(17), 0.0).request.is_none());
    }

    #[test]
    fn eq2_eq3_wait_for_the_least_period() {
        let mut rule = UpdateRule::new(&example());
        assert!(rule.judge(minutes(4), minutes(0), 0.02).request.is_none());
        let drift = rule.judge(minutes(5), minutes(0), 0.00801).request.unwrap();
        assert_eq!(drift.reason, UpdateReason::PredictedDrift);
        rule.reset();
        rule.load_changed();
        let load = rule.judge(minutes(6), minutes(0), 0.0).request.unwrap();
        assert_eq!(load.reason, UpdateReason::LoadChange);
    }

    #[test]
    fn a_program_that_never_yields_is_reported_once_per_period() {
        let mut rule = UpdateRule::new(&example());
        let reports: Vec<i64> = (0..60)
            .filter(|min| {
                rule.judge(minutes(*min), minutes(0), 0.0)
                    .overdue_s
                    .is_some()
            })
            .collect();
        assert_eq!(reports, [20, 35, 50]);
    }

    #[test]
    fn a_confirmation_is_asked_at_once_and_kept_up() {
        let mut rule = UpdateRule::new(&example());
        assert_eq!(
            rule.confirm(minutes(1), minutes(0)).reason,
            UpdateReason::Confirmation
        );
        assert!(rule.judge(minutes(2), minutes(0), 0.0).request.is_none());
        let again = rule.judge(minutes(3), minutes(0), 0.0).request.unwrap();
        assert_eq!(again.reason, UpdateReason::Confirmation);
    }
}
