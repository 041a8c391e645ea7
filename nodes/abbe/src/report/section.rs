//! A part of a page: sentences, tables and plots, laid out for a terminal and for HTML alike.

use comfy_table::{CellAlignment, Table, presets};
use maud::{Markup, html};

use super::page;

/// A table.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// Names of the columns.
    pub head: Vec<String>,
    /// Cells.
    pub rows: Vec<Vec<String>>,
    /// What a reader must know of it.
    pub note: String,
}

/// A plot as SVG with its caption.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// SVG text.
    pub svg: String,
    /// What it shows.
    pub caption: String,
}

/// One part of a page.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// Heading.
    pub title: String,
    /// Sentences.
    pub lines: Vec<String>,
    /// Tables.
    pub tables: Vec<Rows>,
    /// Plots.
    pub drawings: Vec<Drawing>,
    /// The figures, for machines.
    pub figures: serde_json::Value,
}

impl Section {
    /// An empty part.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            ..Self::default()
        }
    }

    /// For a terminal.
    #[must_use]
    pub fn terminal(&self) -> String {
        let mut text = format!("{}\n", self.title);
        for line in &self.lines {
            text.push_str(line);
            text.push('\n');
        }
        for rows in &self.tables {
            text.push('\n');
            text.push_str(&laid_out(rows));
            text.push('\n');
            if !rows.note.is_empty() {
                text.push_str(&rows.note);
                text.push('\n');
            }
        }
        text
    }

    /// For a page.
    #[must_use]
    pub fn html(&self) -> Markup {
        html! {
            h2 { (self.title) }
            @for line in &self.lines { p { (line) } }
            @for rows in &self.tables {
                (page::table(&rows.head.iter().map(String::as_str).collect::<Vec<_>>(), &rows.rows))
                @if !rows.note.is_empty() { p.note { (rows.note) } }
            }
            @for drawing in &self.drawings { (page::figure(&drawing.svg, &drawing.caption)) }
        }
    }
}

fn laid_out(rows: &Rows) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_header(&rows.head);
    for row in &rows.rows {
        table.add_row(row);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
        .lines()
        .map(|line| line.trim_end().to_owned())
        .collect::<Vec<_>>()
        .join("\n")
}

/// A length in µm with as many decimals as matter.
#[must_use]
pub fn um(length_mm: f64) -> String {
    if length_mm.is_nan() {
        return "—".to_owned();
    }
    format!("{:.2}", length_mm * 1e3)
}

/// Table head from names.
#[must_use]
pub fn head(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}
