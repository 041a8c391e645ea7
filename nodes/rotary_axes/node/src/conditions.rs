//! The conditions of the rotary-axis calibration on `/diagnostics`; lengths in µm.

use node_runtime::{Diagnostic, Level};
use rotary_axes::{Diagnostic as Condition, Output};

pub(crate) fn condition(output: &Output) -> Option<Diagnostic> {
    let Output::Diagnostic(condition) = output else {
        return None;
    };
    let level = Level::from(condition.severity());
    let told = Diagnostic::new(level, condition.condition(), condition.to_string());
    Some(match condition {
        Condition::Calibrated {
            merit,
            before_mm,
            after_mm,
            harmonics,
            lack_of_fit_p,
            ..
        } => told
            .with("merit", merit)
            .with("spatial_before_um", before_mm * 1e3)
            .with("spatial_after_um", after_mm * 1e3)
            .with("harmonics", harmonics)
            .with("lack_of_fit_p", lack_of_fit_p),
        Condition::Verified {
            before_mm,
            after_mm,
            greatest_mm,
            expected_mm,
            allowed_mm,
            allowed_p,
            same_places,
            ..
        } => told
            .with("rms_before_um", before_mm * 1e3)
            .with("rms_after_um", after_mm * 1e3)
            .with("greatest_after_um", greatest_mm * 1e3)
            .with("noise_alone_um", expected_mm * 1e3)
            .with("expected_um", allowed_mm * 1e3)
            .with("expected_p", allowed_p)
            .with("same_places", same_places),
        Condition::BeyondExpected {
            after_mm,
            allowed_mm,
            p,
            ..
        } => told
            .with("rms_after_um", after_mm * 1e3)
            .with("expected_um", allowed_mm * 1e3)
            .with("expected_p", p),
        _ => told,
    })
}
