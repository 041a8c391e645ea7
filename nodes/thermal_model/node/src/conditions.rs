//! The conditions of the thermal model on `/diagnostics`.

use node_runtime::{Diagnostic, Level};
use thermal_model::{Diagnostic as Condition, Output};

pub(crate) fn condition(output: &Output) -> Option<Diagnostic> {
    let Output::Diagnostic(condition) = output else {
        return None;
    };
    let level = Level::from(condition.severity());
    let told = Diagnostic::new(level, condition.condition(), condition.to_string());
    let Condition::Scored { score, .. } = condition else {
        return Some(told);
    };
    let known =
        |residual_um: Option<f64>| residual_um.map_or_else(String::new, |um| um.to_string());
    Some(
        told.with("hold_um", score.hold_um)
            .with("relaxation_um", known(score.relaxation_um))
            .with("temperature_um", known(score.temperature_um)),
    )
}
