//! The conditions of axis compensation on `/diagnostics`.

use axis_compensation::{Diagnostic as Condition, Output, Severity};
use node_runtime::{Diagnostic, Level};

pub(crate) fn condition(output: &Output) -> Option<Diagnostic> {
    let Output::Diagnostic(condition) = output else {
        return None;
    };
    let level = match condition.severity() {
        Severity::Info => Level::Ok,
        Severity::Warn => Level::Warn,
        Severity::Error => Level::Error,
    };
    Some(Diagnostic::new(
        level,
        name(condition),
        condition.to_string(),
    ))
}

/// What it is about; a good end has the name of the condition that it ends.
fn name(condition: &Condition) -> String {
    match condition {
        Condition::StateChanged { axis, .. } => format!("state/{axis}"),
        Condition::SizeExceeded { axis, .. } | Condition::SizeKept { axis } => {
            format!("size/{axis}")
        }
        Condition::ModelRefused { axis, .. } => format!("model_refused/{axis}"),
        Condition::ModelQuarantined { .. } | Condition::ModelConfirmed { .. } => {
            "model_jump".to_owned()
        }
        Condition::ModelNotFinite { axis, .. } => format!("model_not_finite/{axis}"),
        Condition::ModelDoubtful { .. } => "model_doubtful".to_owned(),
        Condition::StatesStale { .. } => "states_stale".to_owned(),
        Condition::Gap { .. } => "gap".to_owned(),
        Condition::ClockWentBack { .. } => "clock_went_back".to_owned(),
        Condition::Enabled { .. } => "enabled".to_owned(),
        Condition::ShuttingDown => "shutting_down".to_owned(),
    }
}
