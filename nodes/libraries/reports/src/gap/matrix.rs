//! Tables whose cells are shaded: where the residual lies, and what can be told from what.

use gap_diagnosis::figures::{HeatMap, Isolability};
use maud::{Markup, PreEscaped, html};

use super::three;
use super::words::covariate;
use crate::page::fold;
use crate::section::{Rows, Section, head};
use crate::terminal::Rank;

/// Standard score at which a cell begins to be shaded, and how many times that it is fully: scores run over decades.
const FIRST_Z: f64 = 4.0;
const FULL_RATIO: f64 = 100.0;
/// Most effects that the matrix on the page shows: those that others imitate best.
const MOST_EFFECTS: usize = 24;
/// Pairs below this cosine are not listed on a terminal.
const ALIKE: f64 = 0.7;

/// Style of shaded cells, on the screen and in print, light and dark.
pub(super) fn style() -> Markup {
    html! {
        style { (PreEscaped("
.shaded td, .shaded th { padding: .15rem .4rem; font-size: .8rem; text-align: center; }
.shaded td:first-child { text-align: left; }
.shaded th { vertical-align: bottom; }
.heat th:nth-child(n+2), .matrix th:nth-child(n+4) { writing-mode: vertical-rl; transform: rotate(180deg); text-align: left; white-space: nowrap; padding: .4rem .15rem; }
.shaded td { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
.traces { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 22rem), 1fr)); gap: 0 1rem; }
@media print { .shaded td, .shaded th { font-size: 7.5px; padding: 1px 2px; } }
")) }
    }
}

fn cell(text: &str, share: f64) -> Markup {
    let percent = 75.0 * share.clamp(0.0, 1.0);
    let style = format!("background: color-mix(in srgb, #d55e00 {percent:.0}%, transparent)");
    html! { td style=(style) { (text) } }
}

/// Covariates, those that most goes with before first.
fn columns(map: &HeatMap) -> Vec<usize> {
    let most = |k: &usize| {
        let scores = map
            .z
            .iter()
            .filter_map(|cells| cells.get(*k).copied().flatten());
        scores.fold(f64::NEG_INFINITY, f64::max)
    };
    let mut order: Vec<usize> = (0..map.columns.len()).collect();
    order.sort_by(|a, b| most(b).total_cmp(&most(a)));
    order
}

/// The heat map: channel against covariate, before and after.
pub(super) fn heat(map: &HeatMap) -> Markup {
    let order = columns(map);
    let one = |title: &str, values: &[Vec<Option<f64>>]| {
        html! {
            table.shaded.heat {
                thead { tr { th { (title) } @for k in &order { th { (covariate(&map.columns[*k])) } } } }
                tbody {
                    @for (row, cells) in map.rows.iter().zip(values) {
                        tr {
                            td { (row) }
                            @for k in &order {
                                @match cells.get(*k).copied().flatten() {
                                    Some(z) => { (cell(&three(z), (z / FIRST_Z).max(1.0).ln() / FULL_RATIO.ln())) }
                                    None => { td { "" } }
                                }
                            }
                        }
                    }
                }
            }
        }
    };
    let content = html! {
        (one("before", &map.z))
        @if !map.z_after.is_empty() { (one("after", &map.z_after)) }
        p.note { "Standard score; noise alone stays below about 4. Shaded by its logarithm." }
    };
    html! {
        @if !map.rows.is_empty() {
            (fold("Residual by channel and what it goes with", None, false, &content))
        }
    }
}

/// Names in the order of how badly they stand out from all others.
fn order(isolability: &Isolability) -> Vec<usize> {
    let mut order: Vec<usize> = (0..isolability.names.len()).collect();
    let sin = |k: &usize| isolability.sin_alone.get(*k).copied().unwrap_or(1.0);
    order.sort_by(|a, b| sin(a).total_cmp(&sin(b)));
    order
}

fn detectable(isolability: &Isolability, k: usize) -> String {
    let unit = isolability.unit.get(k).map_or("", String::as_str);
    let least = isolability.detectable.get(k).copied();
    format!("{unit} {}", three(least.unwrap_or(f64::NAN)))
}

/// The isolability matrix with the smallest sizes that would be found.
pub(super) fn isolability(isolability: &Isolability) -> Markup {
    let order: Vec<usize> = order(isolability).into_iter().take(MOST_EFFECTS).collect();
    let cos = |a: usize, b: usize| isolability.cos.get(a).and_then(|row| row.get(b)).copied();
    let content = html! {
            table.shaded.matrix {
                thead { tr {
                    th { "cosine" } th { "sine alone" } th { "found from" }
                    @for k in &order { th { (isolability.names[*k]) } }
                } }
                tbody {
                    @for a in &order {
                        tr {
                            td { (isolability.names[*a]) }
                            td { (three(isolability.sin_alone.get(*a).copied().unwrap_or(f64::NAN))) }
                            td { (detectable(isolability, *a)) }
                            @for b in &order {
                                @match cos(*a, *b) {
                                    Some(c) if a != b => { (cell(&format!("{:.2}", c.abs()), c.abs())) }
                                    _ => { td { "" } }
                                }
                            }
                        }
                    }
                }
            }
            p.note { "Cosine between two signatures on this recording: 1 cannot be told apart. Sine alone: what no combination of other effects imitates. Found from: the smallest size that 95 of 100 such recordings would show." }
            @if isolability.names.len() > order.len() {
                p.note { (isolability.names.len() - order.len()) " effects that stand out better are not shown." }
            }
    };
    html! {
        @if !order.is_empty() { (fold("What can be told from what", None, false, &content)) }
    }
}

/// Pairs that look alike, and the smallest sizes, for a terminal.
pub(super) fn section(isolability: &Isolability) -> Option<Section> {
    let order = order(isolability);
    let rows: Vec<Vec<String>> = order
        .iter()
        .map(|a| {
            let row = isolability.cos.get(*a);
            let cos = |b: &usize| row.and_then(|row| row.get(*b)).map_or(0.0, |c| c.abs());
            let mut alike: Vec<usize> = order.clone();
            alike.retain(|b| b != a && cos(b) >= ALIKE);
            alike.sort_by(|x, y| cos(y).total_cmp(&cos(x)));
            let named = alike.iter().take(3);
            let named: Vec<String> = named
                .map(|b| format!("{} {:.2}", isolability.names[*b], cos(b)))
                .collect();
            vec![
                isolability.names[*a].clone(),
                three(isolability.sin_alone.get(*a).copied().unwrap_or(f64::NAN)),
                detectable(isolability, *a),
                named.join(", "),
            ]
        })
        .collect();
    if rows.is_empty() {
        return None;
    }
    Some(Section {
        tables: vec![Rows {
            head: head(&["effect", "sine alone", "found from", "looks like (cosine)"]),
            rows,
            note: String::new(),
        }],
        rank: Rank::Detail,
        ..Section::new("What can be told from what")
    })
}
