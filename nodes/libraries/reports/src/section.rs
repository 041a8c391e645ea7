//! A part of a page: sentences, tables and plots, laid out for a terminal and for HTML alike.

use std::fmt::Display;

use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Table, Width, presets};
use maud::{Markup, html};
use metrology::number::decimals_of;

use super::minus::with_minus_signs;
use super::page;
use super::screen::Tile;
use super::svg::unsigned_zero;
use super::terminal::Rank;

/// What warnings of tests without a result have in common.
pub const NOT_EVALUATED: &str = "Not evaluated";

/// Columns of a terminal that tables may take.
const TERMINAL_WIDTH: u16 = 160;
/// Columns of it for sentences.
const PROSE_WIDTH: u16 = 56;

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
    /// How much of it the short text has.
    pub rank: Rank,
    /// What it found, a sentence each, for the short text.
    pub answers: Vec<String>,
    /// What it could not find, for the short text; each is one of [`Self::lines`] as well.
    pub warnings: Vec<Warning>,
    /// What the first screen has of it, where that is not its first answer.
    pub tile: Option<Tile>,
    /// Why a test that was measured has no figure.
    pub unevaluated: Option<String>,
}

/// Kind of the warnings of readings that are far from the others and count.
pub const FAR: &str = "Far from the others";

/// A sentence on what was not evaluated or not used.
#[derive(Clone, Debug)]
pub struct Warning {
    /// What it has in common with others, such as `Not evaluated`.
    pub kind: &'static str,
    /// The sentence.
    pub line: String,
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

    /// The same with another rank.
    #[must_use]
    pub fn ranked(self, rank: Rank) -> Self {
        Self { rank, ..self }
    }

    /// A line that is an answer as well.
    pub fn answer(&mut self, line: String) {
        self.answers.push(line.clone());
        self.lines.push(line);
    }

    /// A line that is a warning of this kind.
    pub fn warn(&mut self, kind: &'static str, line: String) {
        self.lines.push(line.clone());
        self.warnings.push(Warning { kind, line });
    }

    /// A warning of this kind that is read before everything else of the part.
    pub fn warn_first(&mut self, kind: &'static str, line: String) {
        self.lines.insert(0, line.clone());
        self.warnings.push(Warning { kind, line });
    }

    /// The line of a test that has no result, with the reason.
    pub fn not_evaluated(&mut self, why: impl Display) {
        self.warn(NOT_EVALUATED, format!("Not evaluated: {why}."));
    }

    /// The same of a test that was measured and has no figure at all: the recording was not used as it should be.
    pub fn without_figures(&mut self, why: impl Display) {
        self.unevaluated = Some(why.to_string());
        self.not_evaluated(why);
    }

    /// A line for everything of a test that was left out.
    pub fn tell_left_out(&mut self, left_out: &[String]) {
        for line in left_out {
            self.warn("Left out", format!("Left out: {line}."));
        }
    }

    /// A line for every reading that is far from the others and counts.
    pub fn name_far(&mut self, far: &[String]) {
        for line in far {
            self.warn(FAR, format!("{}.", capitalised(line)));
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
        with_minus_signs(&text).into_owned()
    }

    /// For a page: folded, its pictures first; tables stand behind a picture where there is one.
    #[must_use]
    pub fn html(&self) -> Markup {
        let tables = html! {
            @for rows in self.tables.iter().filter(|table| !table.rows.is_empty()) {
                (page::table(&rows.head.iter().map(String::as_str).collect::<Vec<_>>(), &rows.rows))
                @if !rows.note.is_empty() { p.note { (rows.note) } }
            }
        };
        let has_tables = self.tables.iter().any(|table| !table.rows.is_empty());
        let answer = self.answers.first().map(String::as_str);
        let answer = answer.or_else(|| self.warnings.first().map(|warning| warning.line.as_str()));
        // The first answer stands beside the title.
        let is_below = |line: &&String| Some(line.as_str()) != answer;
        let content = html! {
            @for answer in self.answers.iter().filter(|line| !self.lines.contains(line)).filter(is_below) { p { (capitalised(answer)) } }
            @for line in self.lines.iter().filter(is_below) { p { (capitalised(line)) } }
            @for drawing in &self.drawings { (page::figure(&drawing.svg, &drawing.caption)) }
            @if has_tables && !self.drawings.is_empty() { (page::all_figures(&tables)) } @else { (tables) }
        };
        let answer = answer.map(capitalised);
        // A drawing of an answer stands on the first screen already.
        let is_open = self.rank == Rank::Answer && self.drawings.is_empty();
        page::fold(&self.title, answer.as_deref(), is_open, &content)
    }
}

/// A table for a terminal, without its note.
pub(super) fn laid_out(rows: &Rows) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_content_arrangement(ContentArrangement::Dynamic);
    table.set_width(TERMINAL_WIDTH);
    table.set_header(&rows.head);
    for row in &rows.rows {
        table.add_row(row);
    }
    for (place, column) in table.column_iter_mut().enumerate() {
        let sentences = page::is_prose(&rows.rows, place);
        if sentences {
            column.set_constraint(ColumnConstraint::UpperBoundary(Width::Fixed(PROSE_WIDTH)));
        } else if place > 0 {
            column.set_cell_alignment(CellAlignment::Right);
            column.set_constraint(ColumnConstraint::ContentWidth);
        }
    }
    table
        .lines()
        .map(|line| line.trim_end().to_owned())
        .collect::<Vec<_>>()
        .join("\n")
}

/// A value and its uncertainty with as many decimals as two digits of the uncertainty need.
#[must_use]
pub fn rounded(value: f64, uncertainty: f64) -> (String, String) {
    if !(value.is_finite() && uncertainty.is_finite() && uncertainty > 0.0) {
        return (unsigned_zero(format!("{value:.2}")), "—".to_owned());
    }
    let decimals = decimals_of(uncertainty);
    (
        unsigned_zero(format!("{value:.decimals$}")),
        format!("{uncertainty:.decimals$}"),
    )
}

/// A length in µm with as many decimals as matter.
#[must_use]
pub fn um(length_mm: f64) -> String {
    if length_mm.is_nan() {
        return "—".to_owned();
    }
    unsigned_zero(format!("{:.2}", length_mm * 1e3))
}

/// A sentence with a capital letter, unless it begins with a name such as `grid_encoder` or `nut_x`.
#[must_use]
pub fn capitalised(line: &str) -> String {
    let first = line.split(' ').next().unwrap_or_default();
    let is_word = first
        .chars()
        .all(|c| c.is_alphabetic() || ",:;-".contains(c));
    let mut letters = line.chars();
    match letters.next() {
        Some(letter) if is_word && letter.is_ascii_lowercase() => {
            letter.to_uppercase().chain(letters).collect()
        }
        _ => line.to_owned(),
    }
}

/// Table head from names.
#[must_use]
pub fn head(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_are_laid_out_from_the_left_and_wrapped() {
        let cause = "X+ and Y+ enclose less than 90°: guideway alignment, worn guides, foundation";
        let rows = Rows {
            head: head(&["row", "span / µm", "look at"]),
            rows: vec![vec![
                "squareness".to_owned(),
                "6.38".to_owned(),
                cause.to_owned(),
            ]],
            note: String::new(),
        };
        let text = laid_out(&rows);
        assert!(text.lines().count() > 2, "{text}");
        assert!(
            text.lines().all(|line| line.chars().count() < 100),
            "{text}"
        );
        let html = page::table(&["row", "span", "look at"], &rows.rows).into_string();
        assert!(html.contains("<td class=\"prose\">X+ and Y+"), "{html}");
    }

    #[test]
    fn the_answer_stands_beside_the_title_alone_and_begins_with_a_capital() {
        let mut section = Section::new("Circle XY");
        section.answer("circular error G 10.84 µm.".to_owned());
        section.lines.push("grid_encoder saw it.".to_owned());
        let html = section.html().into_string();
        assert_eq!(html.matches("ircular error G").count(), 1, "{html}");
        assert!(
            html.contains("<span class=\"answer\">Circular error"),
            "{html}"
        );
        assert!(html.contains("<p>grid_encoder saw it.</p>"), "{html}");
        assert_eq!(capitalised("12 runs."), "12 runs.");
    }

    #[test]
    fn two_digits_of_the_uncertainty_decide_the_decimals() {
        assert_eq!(
            rounded(12.3456, 0.123),
            ("12.35".to_owned(), "0.12".to_owned())
        );
        assert_eq!(rounded(12.3456, 23.4), ("12".to_owned(), "23".to_owned()));
        assert_eq!(rounded(-1e-4, 0.1).0, "0.00");
        assert_eq!(um(-1e-6), "0.00");
        assert_eq!(um(-1e-5), "-0.01");
        assert_eq!(rounded(1.0, f64::NAN), ("1.00".to_owned(), "—".to_owned()));
    }
}
