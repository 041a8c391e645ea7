//! Tool error against the plant's truth at the poses of each verification, as a whole.

use super::section::{Rows, Section, head, um};
use crate::evidence::Verification;

/// Error that `share` of the poses do not exceed, mm; NaN without poses.
fn quantile_mm(verification: &Verification, share: f64) -> f64 {
    let mut sizes: Vec<f64> = verification
        .poses
        .iter()
        .map(|pose| pose.error_mm.norm())
        .collect();
    sizes.sort_by(f64::total_cmp);
    let place = (share * sizes.len() as f64).ceil() as usize;
    sizes
        .get(place.saturating_sub(1).min(sizes.len().saturating_sub(1)))
        .copied()
        .unwrap_or(f64::NAN)
}

/// The part, where a verification was seen.
#[must_use]
pub fn section(verifications: &[Verification]) -> Option<Section> {
    let seen: Vec<&Verification> = verifications
        .iter()
        .filter(|v| !v.poses.is_empty())
        .collect();
    if seen.is_empty() {
        return None;
    }
    let mut section = Section::new("Tool error at the poses of each verification");
    let find = |word: &str| seen.iter().rev().find(|v| v.label.contains(word));
    if let (Some(without), Some(with)) = (find("without"), find("with compensation")) {
        let (before_mm, after_mm) = (quantile_mm(without, 0.95), quantile_mm(with, 0.95));
        section.lines.push(format!(
            "p95 {} µm without compensation, {} µm with it ({:.1}-fold less), {} poses.",
            um(before_mm),
            um(after_mm),
            before_mm / after_mm,
            with.poses.len()
        ));
    }
    let rows = seen.iter().map(|verification| {
        vec![
            verification.label.clone(),
            verification.poses.len().to_string(),
            um(quantile_mm(verification, 0.5)),
            um(quantile_mm(verification, 0.95)),
            um(quantile_mm(verification, 1.0)),
        ]
    });
    section.tables.push(Rows {
        head: head(&[
            "verification",
            "poses",
            "median / µm",
            "p95 / µm",
            "max / µm",
        ]),
        rows: rows.collect(),
        note: "Size of the true error of the tool relative to the workpiece; no node sees it."
            .to_owned(),
    });
    let figures: Vec<serde_json::Value> = seen
        .iter()
        .map(|verification| {
            serde_json::json!({
                "label": verification.label,
                "poses": verification.poses.len(),
                "median_mm": quantile_mm(verification, 0.5),
                "p95_mm": quantile_mm(verification, 0.95),
                "max_mm": quantile_mm(verification, 1.0),
            })
        })
        .collect();
    section.figures = serde_json::json!({ "verifications": figures });
    Some(section)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::PoseError;
    use metrology::Stamp;
    use nalgebra::Vector3;

    fn verification(label: &str, error_um: f64) -> Verification {
        let pose = |k: u32| PoseError {
            commanded_mm: Vector3::zeros(),
            error_mm: Vector3::new(error_um * 1e-3 * f64::from(k) / 20.0, 0.0, 0.0),
        };
        Verification {
            label: label.to_owned(),
            at: Stamp::from_nanos(0),
            poses: (1..=20).map(pose).collect(),
        }
    }

    #[test]
    fn the_last_verifications_of_either_kind_are_compared() {
        let seen = [
            verification("without compensation", 40.0),
            verification("with compensation", 4.0),
        ];
        let section = section(&seen).unwrap();
        assert_eq!(
            section.lines,
            ["p95 38.00 µm without compensation, 3.80 µm with it (10.0-fold less), 20 poses."]
        );
        assert!(super::section(&[]).is_none());
    }
}
