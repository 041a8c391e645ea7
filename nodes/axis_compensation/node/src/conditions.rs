//! The conditions of axis compensation on `/diagnostics`.

use axis_compensation::{Output, Severity};
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
        condition.condition(),
        condition.to_string(),
    ))
}
