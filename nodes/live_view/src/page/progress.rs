//! Progress of the plan.
//!
//! ```text
//!   time left of the step = time since it began * (1 - progress) / progress    (1)
//! ```

use metrology::Stamp;
use metrology::sample::{PlanState, PlanStatus};
use metrology::stamp::Host;
use serde_json::{Value, json};

use super::{Latest, Page, ms, short};

/// Below this share of a step (1) is too uncertain.
const LEAST_PROGRESS: f64 = 0.02;

/// First message of a step, by the time of its messages.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepBegin {
    step: u32,
    at: Stamp<Host>,
}

const fn word(state: PlanState) -> &'static str {
    match state {
        PlanState::Waiting => "waiting",
        PlanState::Running => "running",
        PlanState::Done => "done",
        PlanState::Failed => "failed",
    }
}

impl Page {
    pub(super) fn take_plan(&mut self, at: Stamp<Host>, mut value: PlanStatus) {
        value.activity = short(&value.activity);
        value.message = short(&value.message);
        let is_new = |begin: StepBegin| begin.step != value.step || value.at < begin.at;
        if self.step.is_none_or(is_new) {
            self.step = Some(StepBegin {
                step: value.step,
                at: value.at,
            });
        }
        self.plan = Some(Latest { at, value });
    }

    /// (1) in seconds; `None`: unknown yet, or no step runs.
    fn step_left_s(&self) -> Option<f64> {
        let plan = &self.plan.as_ref()?.value;
        let begin = self.step?;
        let (done, is_running) = (plan.progress, plan.state == PlanState::Running);
        if !is_running || !(LEAST_PROGRESS..=1.0).contains(&done) {
            return None;
        }
        let since_s = (plan.at - begin.at).as_secs_f64();
        (since_s > 0.0).then(|| (since_s * (1.0 - done) / done).round())
    }

    pub(super) fn plan_part(&self) -> Option<Value> {
        let plan = &self.plan.as_ref()?.value;
        Some(json!({
            "at_ms": ms(plan.at),
            "state": word(plan.state),
            "step": plan.step,
            "steps": plan.steps,
            "activity": plan.activity,
            "run": plan.run,
            "progress": plan.progress,
            "step_left_s": self.step_left_s(),
            "message": plan.message,
        }))
    }

    pub(super) fn test_part(&self) -> Option<Value> {
        let test = &self.test.as_ref()?.value;
        Some(json!({
            "at_ms": ms(test.at),
            "run": test.run,
            "kind": format!("{:?}", test.kind),
            "is_running": test.begin,
            "completed": test.completed,
        }))
    }
}
