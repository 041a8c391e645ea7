//! Block measurements as a table.

use std::fmt::Write as _;

use maud::{Markup, html};
use metrology::Axis;

use super::page::table;
use crate::evidence::Evidence;

const HEAD: [&str; 6] = ["block", "run", "cold", "X / mm", "Y / mm", "Z / mm"];

fn rows(evidence: &Evidence) -> Vec<Vec<String>> {
    evidence
        .blocks
        .iter()
        .map(|block| {
            let mut row = vec![
                block.block_id.clone(),
                block.run.to_string(),
                if block.cold { "cold" } else { "" }.to_owned(),
            ];
            row.extend(Axis::LINEAR.map(|axis| {
                block.faces[axis].map_or_else(
                    || "not measured".to_owned(),
                    |face| {
                        let u_um = face.standard_uncertainty_mm * 1e3;
                        format!("{:.4} (u {u_um:.1} µm)", face.position_mm)
                    },
                )
            }));
            row
        })
        .collect()
}

/// The table, where blocks were measured.
pub fn section(evidence: &Evidence) -> Markup {
    let rows = rows(evidence);
    html! {
        @if !rows.is_empty() {
            h2 { "Blocks" }
            (table(&HEAD, &rows))
        }
    }
}

/// The same for a terminal.
pub fn text(evidence: &Evidence) -> String {
    let mut text = String::new();
    for row in rows(evidence) {
        for cell in row {
            let _ = write!(text, "{cell:>26}");
        }
        text.push('\n');
    }
    text
}
