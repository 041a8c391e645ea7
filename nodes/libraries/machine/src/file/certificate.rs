//! Certificates of calibrated artefacts in the machine file.

use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::check::Check;
use super::{ArtefactEntry, MachineFile};
use crate::cycle::artefact_id;
use crate::error::MachineFileError;

/// Share of the nominal diameter by which a calibrated one may differ; a radius in its place differs by a half.
const GREATEST_DIFFERENCE: f64 = 0.01;

/// What the certificate of a sphere, ring gauge or boss states.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CertificateEntry {
    /// Name of the artefact.
    pub artefact: String,
    /// Calibrated diameter at 20 °C.
    pub diameter_mm: f64,
    /// Its expanded uncertainty.
    pub expanded_uncertainty_um: f64,
    /// Departure from roundness or sphericity.
    pub form_um: f64,
    /// Its expanded uncertainty.
    pub form_expanded_uncertainty_um: f64,
    /// Coverage factor of both.
    pub coverage_factor: f64,
    /// Number of the certificate, for the page.
    #[serde(default)]
    pub number: Option<String>,
}

impl MachineFile {
    /// The certificate of an artefact, where the file has one.
    #[must_use]
    pub fn certificate(&self, artefact: &str) -> Option<&CertificateEntry> {
        self.certificates
            .iter()
            .find(|certificate| certificate.artefact == artefact)
    }
}

impl Check<'_> {
    /// Each certificate is of one round artefact, whose diameter it states.
    pub(super) fn certificates(&self, file: &MachineFile) -> Result<(), MachineFileError> {
        let mut known = BTreeSet::new();
        for (index, certificate) in file.certificates.iter().enumerate() {
            let key = format!("certificates[{index}]");
            let id = certificate.artefact.as_str();
            let of = format!("{key}.artefact");
            let entry = { file.artefacts.iter() }.find(|entry| artefact_id(entry) == id);
            let radius_mm = match entry {
                Some(
                    ArtefactEntry::Sphere { radius_mm, .. }
                    | ArtefactEntry::Bore { radius_mm, .. }
                    | ArtefactEntry::Boss { radius_mm, .. },
                ) => Some(*radius_mm),
                Some(ArtefactEntry::Plane { .. }) | None => None,
            };
            let rule = "must be the id of a sphere, bore or boss of artefacts";
            self.name(&of, id, radius_mm.is_some(), rule)?;
            self.name(&of, id, known.insert(id), "has two certificates")?;
            let nominal_mm = 2.0 * radius_mm.unwrap_or(f64::NAN);
            let apart = (certificate.diameter_mm / nominal_mm - 1.0).abs();
            self.number(
                &format!("{key}.diameter_mm"),
                certificate.diameter_mm,
                apart <= GREATEST_DIFFERENCE,
                "must be within 1 % of twice the radius_mm of its artefact",
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = include_str!("../../../../../launch_configs/five_axis/machine.yaml");

    fn with(certificates: &str) -> Result<MachineFile, MachineFileError> {
        let before = MACHINE.split("certificates:").next().unwrap_or(MACHINE);
        let text = format!("{before}certificates:\n{certificates}");
        MachineFile::parse(&text, "machine.yaml")
    }

    fn entry(artefact: &str, diameter_mm: f64) -> String {
        format!(
            "  - {{artefact: {artefact}, diameter_mm: {diameter_mm}, expanded_uncertainty_um: 0.3, form_um: 0.1, form_expanded_uncertainty_um: 0.1, coverage_factor: 2.0}}\n"
        )
    }

    #[test]
    fn a_certificate_is_found_by_its_artefact() {
        let file = with(&entry("high", 25.0012)).unwrap();
        let found = file.certificate("high").unwrap();
        assert!((found.diameter_mm - 25.0012).abs() < 1e-12);
        assert!(file.certificate("low").is_none());
    }

    #[test]
    fn a_certificate_of_nothing_or_of_a_radius_is_refused_by_its_key() {
        for (certificates, words) in [
            (entry("hihg", 25.0), "must be the id of a sphere"),
            (entry("top", 25.0), "must be the id of a sphere"),
            (entry("high", 12.5), "certificates[0].diameter_mm = 12.5 mm"),
            (
                entry("high", 25.0) + &entry("high", 25.0),
                "has two certificates",
            ),
        ] {
            let said = with(&certificates).unwrap_err().to_string();
            assert!(said.contains(words), "{said}");
        }
    }
}
