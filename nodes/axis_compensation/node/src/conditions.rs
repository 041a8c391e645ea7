//! The conditions of axis compensation on `/diagnostics`.

use axis_compensation::Output;
use node_runtime::{Diagnostic, Level};

pub(crate) fn condition(output: &Output) -> Option<Diagnostic> {
    let Output::Diagnostic(condition) = output else {
        return None;
    };
    let level = Level::from(condition.severity());
    Some(Diagnostic::new(
        level,
        condition.condition(),
        condition.to_string(),
    ))
}
