//! The self-contained HTML page around a report.

use maud::{DOCTYPE, Markup, PreEscaped, html};
use metrology::visible::visible;

use super::minus::page_with_minus_signs;

const STYLE: &str = "
:root { color-scheme: light dark; --ink: #1b1f24; --paper: #ffffff; --rule: #d0d7de; --soft: #57606a; --good: #116329; --bad: #a40e26; --c0: #0072b2; --c1: #d55e00; --c2: #009e73; --c3: #cc79a7; --c4: #4aa3d8; --c5: #b07a00; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6edf3; --paper: #0d1117; --rule: #30363d; --soft: #9198a1; --good: #56d364; --bad: #ff7b72; --c0: #56b4e9; --c1: #f0873a; --c2: #2dc497; --c3: #e3a1c6; --c4: #9bd3f5; --c5: #e6b94f; } }
body { color: var(--ink); background: var(--paper); font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 0 auto; padding: 1rem; overflow-wrap: break-word; }
h1 { font-size: 1.5rem; line-height: 1.25; margin: .5rem 0; } h2 { font-size: 1.15rem; margin: 1.8rem 0 .4rem; }
table { border-collapse: collapse; margin: .6rem 0; font-variant-numeric: tabular-nums; display: block; overflow-x: auto; }
th, td { padding: .25rem .8rem .25rem 0; border-bottom: 1px solid var(--rule); text-align: right; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; } th { color: var(--soft); font-weight: 600; white-space: normal; }
th.prose, td.prose { text-align: left; white-space: normal; min-width: 10rem; }
.plot { width: 100%; height: auto; fill: currentColor; overflow: visible; } .polar { max-width: 34rem; display: block; } .plot text { font: 15px system-ui, sans-serif; stroke: none; } .plot .ring { font-size: 13px; paint-order: stroke; stroke: var(--paper); stroke-width: 4px; }
.three .plot text { font-size: 13px; } .bars .ring { font-size: 15px; stroke: none; } .note { color: var(--soft); font-size: .9rem; } .good { color: var(--good); } .bad { color: var(--bad); }
.c0 { color: var(--c0); } .c1 { color: var(--c1); } .c2 { color: var(--c2); } .c3 { color: var(--c3); } .c4 { color: var(--c4); } .c5 { color: var(--c5); }
.three { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 16rem), 1fr)); gap: 0 .8rem; } .pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 24rem), 1fr)); gap: 0 1.2rem; align-items: start; } .bars { max-width: 36rem; display: block; }
figure { margin: .8rem 0; break-inside: avoid; } .legend { display: flex; flex-wrap: wrap; gap: 0 1rem; font-size: .9rem; } .legend .of { font-weight: 600; }
.legend i { display: inline-block; width: 1.3rem; margin-right: .35rem; vertical-align: middle; border-top: 3px solid currentColor; print-color-adjust: exact; -webkit-print-color-adjust: exact; }
.legend .dashed i { border-top-style: dashed; } .legend .dot i { width: .5rem; height: .5rem; border: 0; border-radius: 50%; background: currentColor; } .legend .band i { height: .7rem; border: 0; background: currentColor; opacity: .3; }
.facts { display: grid; grid-template-columns: max-content 1fr; gap: 0 1rem; margin: .4rem 0; font-size: .95rem; } .facts dt { color: var(--soft); } .facts dd { margin: 0; min-width: 0; overflow-wrap: anywhere; }
.verdict { font-size: 1.25rem; line-height: 1.35; font-weight: 600; margin: .8rem 0; padding-left: .8rem; border-left: .35rem solid var(--soft); } .verdict.good { border-color: var(--good); } .verdict.bad { border-color: var(--bad); }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 10.5rem), 1fr)); gap: .6rem; margin: .8rem 0; } .tile { border: 1px solid var(--rule); border-radius: .4rem; padding: .5rem .7rem; min-width: 0; break-inside: avoid; }
.tile b { display: block; font-size: 1.3rem; line-height: 1.25; overflow-wrap: anywhere; } .tile .name { color: var(--soft); font-size: .85rem; } .tile .more { font-size: .85rem; }
.part { border-top: 1px solid var(--rule); } .part > summary, .part > .summary { padding: .45rem 0; } summary { cursor: pointer; } .part > summary h2, .summary h2 { display: inline; margin: 0; } .answer { display: block; color: var(--soft); font-size: .95rem; padding-left: 1.1rem; } .figures > summary, .figures > .summary { color: var(--soft); }
@media (max-width: 40rem) { h1 { font-size: 1.25rem; } .verdict { font-size: 1.1rem; } .tiles { grid-template-columns: 1fr 1fr; } .tile b { font-size: 1.1rem; } .plot text { font-size: 26px; } .polar text { font-size: 20px; } .plot .ring { font-size: 18px; } .bars text, .bars .ring, .look_alikes text { font-size: 20px; } .bars .ring.long { font-size: 16px; } .three .plot text { font-size: 17px; } table { font-size: .85rem; } th, td { padding-right: .6rem; }
  th:first-child, td:first-child { position: sticky; left: 0; background: var(--paper); min-width: 6.5rem; max-width: 9rem; white-space: normal; } }
.on-paper { display: none; } th, td { vertical-align: top; } code { font-size: .9em; } @media print { html { font-size: 11px; } .three { grid-template-columns: 1fr 1fr 1fr; } .pair { grid-template-columns: 1fr 1fr; } body { max-width: none; font-size: 1rem; padding: 0; } table { font-size: 9px; overflow: visible; } th, td { white-space: normal; } h2, h3, summary, .summary, .legend { break-after: avoid; } .summary { break-inside: avoid; } .plot, tr { break-inside: avoid; } thead { display: table-header-group; } .plot { max-height: 7.5cm; } .polar { max-height: 10cm; } .look_alikes { max-height: 22cm; } .three .plot { max-height: 6cm; } details::details-content { content-visibility: visible; display: block; block-size: auto; } .tiles { grid-template-columns: repeat(auto-fit, minmax(3cm, 1fr)); } .detail > .content { display: none; } .detail > .on-paper { display: block; } }
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
    page_with_minus_signs(&visible(&page))
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

/// A table from texts; the first column and sentences are left aligned. A column without a value is left out, and a table
/// without a row.
pub fn table(head: &[&str], rows: &[Vec<String>]) -> Markup {
    let class = |column: usize| is_prose(rows, column).then_some("prose");
    let columns = filled(rows, head.len());
    html! {
        @if !rows.is_empty() {
            table {
                thead { tr { @for column in &columns { th class=[class(*column)] { (head[*column]) } } } }
                tbody { @for row in rows { tr {
                    @for column in &columns {
                        td class=[class(*column)] { (row.get(*column).map_or("", String::as_str)) }
                    }
                } } }
            }
        }
    }
}

/// Text of a cell without a value.
const EMPTY: [&str; 2] = ["", "—"];

/// Columns in which any row has a value, and the first; a table of none has all.
fn filled(rows: &[Vec<String>], n: usize) -> Vec<usize> {
    let has_value = |column: usize| {
        let mut cells = rows.iter().filter_map(|row| row.get(column));
        cells.any(|cell| !EMPTY.contains(&cell.as_str()))
    };
    let kept = (0..n).filter(|column| *column == 0 || rows.is_empty() || has_value(*column));
    kept.collect()
}

/// A part that folds, with its answer beside the title.
pub fn fold(title: &str, answer: Option<&str>, is_open: bool, content: &Markup) -> Markup {
    html! {
        details.part open[is_open] {
            summary {
                h2 { (title) }
                @if let Some(answer) = answer { span.answer { (answer) } }
            }
            (content)
        }
    }
}

/// Many parts of detail behind one title. On paper the title stands alone: hundreds of tables make no certificate.
pub fn fold_details(n: usize, content: &Markup) -> Markup {
    html! {
        details.part.detail {
            summary { h2 { (n) " parts of detail" } }
            div.content { (content) }
            p.note.on-paper { "These parts stand in the HTML page." }
        }
    }
}

/// Tables that stand behind a picture.
pub fn all_figures(content: &Markup) -> Markup {
    html! { details.figures { summary { "All figures" } (content) } }
}

/// An SVG text as it is.
pub fn figure(svg: &str, caption: &str) -> Markup {
    html! { figure { (PreEscaped(svg)) figcaption.note { (caption) } } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_columns_and_tables_are_left_out() {
        let rows = [
            vec![
                "cw".to_owned(),
                "1.00".to_owned(),
                "—".to_owned(),
                String::new(),
            ],
            vec![
                "ccw".to_owned(),
                "—".to_owned(),
                "—".to_owned(),
                String::new(),
            ],
        ];
        let text = table(&["sense", "G", "D", "flag"], &rows).into_string();
        assert!(text.contains(">G<") && !text.contains(">D<") && !text.contains("flag"));
        assert_eq!(text.matches("<td").count(), 4);
        assert_eq!(table(&["sense", "G"], &[]).into_string(), "");
    }

    #[test]
    fn a_part_folds_and_is_open_on_paper() {
        let part = fold("Causes", Some("backlash X"), false, &html! { p { "text" } }).into_string();
        assert!(
            part.starts_with("<details class=\"part\"><summary><h2>Causes</h2>"),
            "{part}"
        );
        assert!(STYLE.contains("@media print") && STYLE.contains("details::details-content"));
    }

    #[test]
    fn a_name_from_outside_turns_no_text_of_the_page_around() {
        let name = "block\u{202e}1\u{9b}2J";
        let page = page(name, &html! { p { (name) } });
        assert_eq!(page.matches("block\\u202e1\\u009b2J").count(), 2, "{page}");
        assert!(!page.contains(metrology::visible::is_unseen));
    }
}
