//! The conditions of the thermal model on `/diagnostics`.

use node_runtime::{Diagnostic, Level};
use thermal_model::Output;
use thermal_model::diagnostic::Severity;

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
        condition.condition(),
        condition.to_string(),
    ))
}
