//! Block measurements as a table.

use std::fmt::Write as _;

use maud::{Markup, html};
use metrology::Axis;

use super::page::{fold, table};
use super::section::{Rows, head};
use super::terminal::Part;
use crate::evidence::Evidence;

const BLOCK_COLUMNS: [&str; 6] = ["block", "run", "cold", "X / mm", "Y / mm", "Z / mm"];

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

/// The condition of blocks whose heights differ too little or too much.
const BLOCK_HEIGHTS: &str = "block_heights";

/// What the thermal model remarked of the blocks' heights.
pub fn remark(evidence: &Evidence) -> Option<String> {
    let mut conditions = evidence.conditions.iter().rev();
    let said = conditions.find(|condition| condition.diagnostic.name == BLOCK_HEIGHTS)?;
    Some(format!("Remark: {}.", said.diagnostic.message))
}

/// The table, where blocks were measured.
pub fn section(evidence: &Evidence) -> Markup {
    let rows = rows(evidence);
    html! {
        @if !rows.is_empty() {
            (fold("Blocks", None, false, &table(&BLOCK_COLUMNS, &rows)))
        }
    }
}

/// The same for a terminal.
pub fn part(evidence: &Evidence) -> Part {
    let rows = rows(evidence);
    let mut text = String::new();
    for row in &rows {
        for cell in row {
            let _ = write!(text, "{cell:>26}");
        }
        text.push('\n');
    }
    let rows = Rows {
        head: head(&BLOCK_COLUMNS),
        rows,
        note: String::new(),
    };
    Part::table("Blocks", text, rows)
}
