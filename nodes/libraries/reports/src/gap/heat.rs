//! Where the residual lies: channel against what it goes with, before and after, shaded.

use gap_diagnosis::figures::HeatMap;
use maud::{Markup, PreEscaped, html};

use super::three;
use super::words::covariate;
use crate::page::fold;

/// Standard score at which a cell begins to be shaded, and how many times that it is fully: scores run over decades.
const FIRST_Z: f64 = 4.0;
const FULL_RATIO: f64 = 100.0;

/// Style of shaded cells and of drawings side by side, on the screen and in print, light and dark.
pub(super) fn style() -> Markup {
    html! {
        style { (PreEscaped("
.shaded td, .shaded th { padding: .15rem .45rem; font-size: .85rem; text-align: center; }
.shaded td:first-child { text-align: left; white-space: normal; }
.shaded td { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
.traces { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 22rem), 1fr)); gap: 0 1rem; } .traces .plot text { font-size: 22px; } .traces .polar text { font-size: 15px; }
@media print { .shaded td, .shaded th { font-size: 7.5px; padding: 1px 2px; } }
")) }
    }
}

fn cell(score: Option<f64>) -> Markup {
    let Some(z) = score else {
        return html! { td { "" } };
    };
    let share = (z / FIRST_Z).max(1.0).ln() / FULL_RATIO.ln();
    let percent = 75.0 * share.clamp(0.0, 1.0);
    let style = format!("background: color-mix(in srgb, #d55e00 {percent:.0}%, transparent)");
    // A score below 0 is as much noise as one of 0.
    html! { td style=(style) { (three(z)) } }
}

/// Covariates, those that most goes with before first.
fn ordered(map: &HeatMap) -> Vec<usize> {
    let most = |k: &usize| {
        let own = map.z.iter().filter_map(|cells| score(cells, *k));
        own.fold(f64::NEG_INFINITY, f64::max)
    };
    let mut order: Vec<usize> = (0..map.columns.len()).collect();
    order.sort_by(|a, b| most(b).total_cmp(&most(a)));
    order
}

fn score(cells: &[Option<f64>], k: usize) -> Option<f64> {
    cells.get(k).copied().flatten()
}

/// The heat map: a row for each covariate, so that its words stand level; columns for each channel before and after.
pub(super) fn heat(map: &HeatMap) -> Markup {
    let has_after = !map.z_after.is_empty();
    let width = if has_after { "2" } else { "1" };
    let none: Vec<Option<f64>> = Vec::new();
    let content = html! {
        table.shaded.heat {
            thead {
                tr { th { "goes with" } @for channel in &map.rows { th colspan=(width) { (channel) } } }
                @if has_after { tr { th { "" } @for _ in &map.rows { th { "before" } th { "after" } } } }
            }
            tbody {
                @for k in ordered(map) {
                    tr {
                        td { (covariate(&map.columns[k])) }
                        @for (row, before) in map.z.iter().enumerate() {
                            (cell(score(before, k)))
                            @if has_after { (cell(score(map.z_after.get(row).unwrap_or(&none), k))) }
                        }
                    }
                }
            }
        }
        p.note { "Standard score; noise alone stays below about 4. Shaded by its logarithm." }
    };
    html! {
        @if !map.rows.is_empty() {
            (fold("Residual by channel and what it goes with", None, false, &content))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_of_a_covariate_stand_level_and_both_scores_beside_each_other() {
        let map = HeatMap {
            rows: vec!["grid.u X".to_owned(), "touch approach".to_owned()],
            columns: vec!["time".to_owned(), "velocity_x".to_owned()],
            z: vec![vec![Some(2.0), Some(70.0)], vec![None, Some(5.0)]],
            z_after: vec![vec![Some(1.0), Some(-1.0)], vec![None, Some(3.0)]],
        };
        let text = heat(&map).into_string();
        let body = text.split("<tbody>").nth(1).unwrap();
        assert!(body.starts_with("<tr><td>the velocity of X</td>"), "{text}");
        assert_eq!(text.matches("<th>before</th><th>after</th>").count(), 2);
        assert!(text.contains("color-mix(in srgb, #d55e00 47%"), "{text}");
    }
}
