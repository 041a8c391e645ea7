//! Certificates of artefacts among the conditions.

use machine::file::CertificateEntry;

use super::Condition;
use crate::evaluate::Tests;

/// Certificates of the round artefacts that were touched, as the machine file states them.
pub(super) fn certificates(tests: Option<&Tests>) -> Vec<&CertificateEntry> {
    let Some(machine) = tests.and_then(|tests| tests.machine.as_ref()) else {
        return vec![];
    };
    let is_touched = |one: &&CertificateEntry| {
        let mut features = tests.iter().flat_map(|tests| &tests.features);
        features.any(|feature| feature.feature_id == one.artefact)
    };
    machine.certificates.iter().filter(is_touched).collect()
}

pub(super) fn conditions(tests: Option<&Tests>) -> Vec<Condition> {
    let of = |one: &CertificateEntry| {
        let words = format!(
            "{}: diameter {:.4} mm ± {:.2} µm, form {:.2} ± {:.2} µm (k = {})",
            one.number.as_deref().unwrap_or("without number"),
            one.diameter_mm,
            one.expanded_uncertainty_um,
            one.form_um,
            one.form_expanded_uncertainty_um,
            one.coverage_factor
        );
        Condition::new(
            format!("artefact {}, certificate", one.artefact),
            Some(words),
            "",
        )
    };
    certificates(tests).into_iter().map(of).collect()
}
