//! The self-contained HTML page around a report.

use maud::{DOCTYPE, Markup, PreEscaped, html};
use metrology::visible::visible;

const STYLE: &str = "
:root { color-scheme: light dark; --ink: #1b1f24; --paper: #ffffff; --rule: #d0d7de; --soft: #57606a; --good: #116329; --bad: #a40e26; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6edf3; --paper: #0d1117; --rule: #30363d; --soft: #9198a1; --good: #56d364; --bad: #ff7b72; } }
body { color: var(--ink); background: var(--paper); font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.5rem; margin: .5rem 0; } h2 { font-size: 1.15rem; margin: 1.8rem 0 .4rem; }
table { border-collapse: collapse; margin: .6rem 0; font-variant-numeric: tabular-nums; display: block; overflow-x: auto; }
th, td { padding: .25rem .8rem .25rem 0; border-bottom: 1px solid var(--rule); text-align: right; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; } th { color: var(--soft); font-weight: 600; white-space: normal; }
th.prose, td.prose { text-align: left; white-space: normal; min-width: 10rem; }
.plot { width: 100%; height: auto; } .note { color: var(--soft); font-size: .9rem; } .good { color: var(--good); } .bad { color: var(--bad); }
@media (prefers-color-scheme: dark) { .plot [stroke=\"#0072B2\"] { stroke: #56b4e9; } .plot [fill=\"#0072B2\"] { fill: #56b4e9; } }
@media (max-width: 40rem) { h1 { font-size: 1.25rem; } .plot text { font-size: 17px; } table { font-size: .85rem; } th, td { padding-right: .6rem; }
  th:first-child, td:first-child { position: sticky; left: 0; background: var(--paper); min-width: 6.5rem; max-width: 9rem; white-space: normal; } }
th, td { vertical-align: top; } code { font-size: .9em; } @media print { html { font-size: 11px; } body { max-width: none; font-size: 1rem; } table { font-size: 9px; overflow: visible; } th, td { white-space: normal; } h2 { break-after: avoid; } .plot, table { break-inside: avoid; } }
";

/// Puts `body` on a page.
pub fn page(title: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body { (body) }
        }
    }
    .into_string();
    // Marks of direction and control characters of names and texts from outside would show another page.
    visible(&page).into_owned()
}

/// Characters beyond which a cell is a sentence.
const SENTENCE: usize = 36;

/// Whether a column holds sentences, which are read from the left and may take several lines.
pub fn is_prose(rows: &[Vec<String>], column: usize) -> bool {
    let cells = rows.iter().filter_map(|row| row.get(column));
    cells
        .into_iter()
        .any(|cell| cell.chars().count() > SENTENCE)
}

/// A table from texts; the first column and sentences are left aligned.
pub fn table(head: &[&str], rows: &[Vec<String>]) -> Markup {
    let class = |column: usize| is_prose(rows, column).then_some("prose");
    let classes: Vec<Option<&str>> = (0..head.len()).map(class).collect();
    let of = |column: usize| classes.get(column).copied().flatten();
    html! {
        table {
            thead { tr { @for (column, cell) in head.iter().enumerate() { th class=[of(column)] { (cell) } } } }
            tbody { @for row in rows { tr { @for (column, cell) in row.iter().enumerate() { td class=[of(column)] { (cell) } } } } }
        }
    }
}

/// An SVG text as it is.
pub fn figure(svg: &str, caption: &str) -> Markup {
    html! { figure { (PreEscaped(svg)) figcaption.note { (caption) } } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_from_outside_turns_no_text_of_the_page_around() {
        let name = "block\u{202e}1\u{9b}2J";
        let page = page(name, &html! { p { (name) } });
        assert_eq!(page.matches("block\\u202e1\\u009b2J").count(), 2, "{page}");
        assert!(!page.contains(metrology::visible::is_unseen));
    }
}
