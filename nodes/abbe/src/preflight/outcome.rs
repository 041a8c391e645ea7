//! What planned recordings will determine: single errors with their uncertainty, sums, and what stays open.

use anyhow::Result;
use grid_encoder::geometry::geometry_model;
use grid_encoder::identify::Identification;
use grid_encoder::preflight::preflight_of;
use grid_encoder::spectrum::Visibility;
use metrology::sample::GeometryModel;
use metrology::stamp::Stamp;
use reports::geometry::{COVERAGE, MAX_READABLE_MEMBERS, coefficients, sums};
use reports::section::{Rows, Section, head, rounded};

use super::programme::Programme;

/// The verdict on a plan.
pub struct Seen {
    identification: Identification,
    model: GeometryModel,
}

impl Seen {
    /// Judges the recordings of a programme.
    ///
    /// # Errors
    /// When the recordings contradict each other.
    pub fn of(programme: &Programme) -> Result<Self> {
        let (kinematics, options) = (&programme.kinematics, &programme.options);
        let identification = preflight_of(kinematics, &programme.recordings, options)?;
        let chain = kinematics.chain().to_string();
        Ok(Self {
            model: geometry_model(&identification, &chain, Stamp::from_nanos(0), 1),
            identification,
        })
    }

    fn names(&self, wanted: Visibility) -> Vec<String> {
        let pairs = self
            .identification
            .unknowns
            .iter()
            .zip(&self.identification.visibility);
        pairs
            .take(self.identification.n_coefficients)
            .filter(|(_, visibility)| **visibility == wanted)
            .map(|(unknown, _)| unknown.to_string())
            .collect()
    }

    /// For a terminal.
    pub fn section(&self, programme: &Programme) -> Section {
        let found = &self.identification;
        let mut section = Section::new("What the recordings over the plate determine");
        section.answer(format!(
            "Chain {}: {} recordings, {} unknowns of which {} are set-up, rank {}.",
            self.model.chain,
            programme.recordings.len(),
            found.unknowns.len(),
            found.unknowns.len() - found.n_coefficients,
            found.rank
        ));
        for (visibility, words) in [
            (Visibility::Mixed, "Determined only together with others"),
            (Visibility::Unseen, "Not touched by any recording"),
        ] {
            let names = self.names(visibility);
            if !names.is_empty() {
                section.answer(format!("{words}: {}.", names.join(", ")));
            }
        }
        let known = coefficients(&self.model);
        let known = known.iter().filter(|coefficient| coefficient.is_known());
        section.tables.push(Rows {
            head: head(&["determined", "U (k = 2)", "over"]),
            rows: known.map(|coefficient| coefficient.planned_row()).collect(),
            note: format!(
                "U at the end of the recorded span, for {} µm standard uncertainty of a station.",
                programme.station_uncertainty_mm * 1e3
            ),
        });
        self.add_sums(&mut section);
        section
    }

    fn add_sums(&self, section: &mut Section) {
        let (short, long): (Vec<_>, Vec<_>) = sums(&self.model)
            .into_iter()
            .partition(|sum| sum.members.len() <= MAX_READABLE_MEMBERS);
        if short.is_empty() && long.is_empty() {
            return;
        }
        let row = |sum: &reports::geometry::Sum| {
            let u = COVERAGE * sum.standard_uncertainty_mm * 1e3;
            let (_, u) = rounded(0.0, u);
            vec![
                sum.in_words(),
                format!("{u} µm"),
                format!("{:.0} mm", sum.at_mm),
            ]
        };
        section.tables.push(Rows {
            head: head(&["determined together", "U (k = 2)", "at"]),
            rows: short.iter().map(row).collect(),
            note: match long.len() {
                0 => String::new(),
                n => format!("And {n} sums of more than {MAX_READABLE_MEMBERS} members: --json."),
            },
        });
    }

    /// For machines; lengths in mm.
    pub fn figures(&self) -> serde_json::Value {
        let found = &self.identification;
        let coefficient = |idx: usize| {
            serde_json::json!({
                "name": found.unknowns[idx].to_string(),
                "verdict": match found.visibility[idx] {
                    Visibility::Estimable => "determined",
                    Visibility::Mixed => "only_together",
                    Visibility::Unseen => "unseen",
                },
                "standard_uncertainty": found.estimate(idx).map(|(_, u)| u),
            })
        };
        let sum = |sum: &reports::geometry::Sum| {
            serde_json::json!({
                "sum": sum.in_words(),
                "members": sum.members,
                "standard_uncertainty_mm": sum.standard_uncertainty_mm,
                "at_mm": sum.at_mm,
            })
        };
        serde_json::json!({
            "unknowns": found.unknowns.len(),
            "rank": found.rank,
            "condition": found.condition,
            "coefficients": (0..found.n_coefficients).map(coefficient).collect::<Vec<_>>(),
            "sums": sums(&self.model).iter().map(sum).collect::<Vec<_>>(),
        })
    }
}
