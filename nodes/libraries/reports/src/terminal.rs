//! What a report prints: the whole, or at most 40 lines that begin with the answer and say what else there is.
//!
//! The short text has every answer and every warning, many alike in one line; then three tables, by rank, with as many rows
//! as fit.

use std::path::Path;

use super::minus::with_minus_signs;
use super::section::{Rows, Section, Warning, laid_out};

/// Most lines of the short text.
pub const MOST_LINES: usize = 40;
/// Tables that the short text has.
const MOST_TABLES: usize = 3;
/// A table needs so many lines: an empty one, title, head, a row of two, what is left, a note.
const LEAST_LINES: usize = 7;
/// Answers of parts that the short text has; the rest is counted.
const MOST_ANSWERS: usize = 12;
/// Sentences of one kind that the short text has one by one.
const MOST_ALIKE: usize = 3;

/// How much of a part the short text has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rank {
    /// Verdicts: its table comes first.
    Answer,
    /// Results: its answers, and its table while there is room.
    #[default]
    Table,
    /// What results come from: its warnings, and its table where no other is there.
    Detail,
}

/// One part of a report's text.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// As it stands in the whole text.
    whole: String,
    title: String,
    rank: Rank,
    answers: Vec<String>,
    warnings: Vec<Warning>,
    tables: Vec<Rows>,
}

impl Part {
    /// A text that the whole alone has.
    #[must_use]
    pub fn plain(whole: impl Into<String>) -> Self {
        Self {
            whole: whole.into(),
            ..Self::default()
        }
    }

    /// Verdicts with their own text in the whole.
    #[must_use]
    pub fn answers(whole: String, answers: Vec<String>) -> Self {
        Self {
            rank: Rank::Answer,
            answers,
            ..Self::plain(whole)
        }
    }

    /// A table with its own text in the whole.
    #[must_use]
    pub fn table(title: &str, whole: String, rows: Rows) -> Self {
        Self {
            title: title.to_owned(),
            tables: vec![rows],
            ..Self::plain(whole)
        }
    }

    /// A section.
    #[must_use]
    pub fn of(section: &Section) -> Self {
        Self {
            whole: section.terminal(),
            title: section.title.clone(),
            rank: section.rank,
            answers: section.answers.clone(),
            warnings: section.warnings.clone(),
            tables: section.tables.clone(),
        }
    }

    /// A sentence of this part, with its title.
    fn titled(&self, line: &str) -> String {
        if self.title.is_empty() {
            line.to_owned()
        } else {
            format!("{}: {line}", self.title)
        }
    }
}

/// Parts one below the other, an empty line between them in the whole text.
pub fn apart(parts: impl IntoIterator<Item = Part>) -> Vec<Part> {
    let mut parts: Vec<Part> = parts.into_iter().collect();
    for part in parts.iter_mut().skip(1) {
        part.whole.insert(0, '\n');
    }
    parts
}

/// The whole text of parts.
#[must_use]
pub fn whole(parts: &[Part]) -> String {
    parts.iter().map(|part| part.whole.as_str()).collect()
}

/// The room of a short text, and what stands in it besides.
#[derive(Clone, Copy, Debug)]
pub struct Room<'a> {
    /// Most lines.
    pub lines: usize,
    /// Lines before the last one.
    pub tail: &'a [String],
    /// The page, where there is one.
    pub page: Option<&'a Path>,
}

impl<'a> Room<'a> {
    /// All of it, for a report with this page.
    #[must_use]
    pub const fn with_page(page: Option<&'a Path>) -> Self {
        Self {
            lines: MOST_LINES,
            tail: &[],
            page,
        }
    }
}

/// The short text of a report with these sentences at its head.
#[must_use]
pub fn short(lines: &[String], parts: &[Part], room: &Room<'_>) -> String {
    let mut text = list_answers(lines, parts);
    let tables = sort_by_rank(parts);
    // The empty line and the line of what is left.
    let taken = text.len() + room.tail.len() + 2;
    let left = room.lines.saturating_sub(taken);
    let most = MOST_TABLES.min((left / LEAST_LINES).max(1));
    let shown: Vec<Entry<'_>> = tables.iter().copied().take(most).collect();
    let rooms = share_lines(&shown, left);
    let (mut n_shown, mut rows_left) = (0, 0);
    for (entry, lines) in shown.iter().zip(rooms) {
        if let Some((block, left)) = entry.fit(lines) {
            text.extend(block);
            n_shown += 1;
            rows_left += left;
        }
    }
    text.push(String::new());
    text.extend(room.tail.iter().cloned());
    text.push(name_what_is_left(
        tables.len() - n_shown,
        rows_left,
        room.page,
    ));
    with_minus_signs(&text.join("\n")).into_owned()
}

fn name_what_is_left(tables: usize, rows: usize, page: Option<&Path>) -> String {
    let more = |n: usize, what: &str| {
        let plural = if n == 1 { "" } else { "s" };
        (n > 0).then(|| format!("{n} more {what}{plural}"))
    };
    let counts = [more(tables, "table"), more(rows, "row")];
    let mut left: Vec<String> = counts.into_iter().flatten().collect();
    let rest = if left.is_empty() {
        "Conditions and remarks"
    } else {
        "conditions and remarks"
    };
    left.push(rest.to_owned());
    let page = page.map_or_else(String::new, |page| {
        format!(", or the page {}", page.display())
    });
    format!("{}: --full{page}", left.join(", "))
}

/// A table with the part that it is of.
#[derive(Clone, Copy)]
struct Entry<'p> {
    title: &'p str,
    rows: &'p Rows,
}

impl Entry<'_> {
    /// The lines of the first `n` rows, an empty one before them.
    fn lines(&self, n: usize) -> Vec<String> {
        let rows = Rows {
            head: self.rows.head.clone(),
            rows: self.rows.rows.iter().take(n).cloned().collect(),
            note: String::new(),
        };
        let mut lines = vec![String::new()];
        if !self.title.is_empty() {
            lines.push(self.title.to_owned());
        }
        lines.extend(laid_out(&rows).lines().map(str::to_owned));
        let left = self.rows.rows.len().saturating_sub(n);
        if left > 0 {
            lines.push(format!(" and {left} more"));
        }
        if !self.rows.note.is_empty() {
            lines.push(self.rows.note.clone());
        }
        lines
    }

    /// As many rows as fit into so many lines, with the number of those left; none: not one does.
    fn fit(&self, room: usize) -> Option<(Vec<String>, usize)> {
        let all = self.rows.rows.len();
        let mut counts = (1..=all.min(room)).rev();
        counts.find_map(|n| {
            let lines = self.lines(n);
            (lines.len() <= room).then(|| (lines, all - n))
        })
    }

    /// Lines that the whole table takes, or more than there are.
    fn height(&self) -> usize {
        if self.rows.rows.len() > MOST_LINES {
            return self.rows.rows.len();
        }
        self.lines(self.rows.rows.len()).len()
    }
}

/// The tables that have rows: by rank, the first of each part before its others.
fn sort_by_rank(parts: &[Part]) -> Vec<Entry<'_>> {
    let mut tables: Vec<((Rank, usize), Entry<'_>)> = vec![];
    for part in parts {
        let filled = part.tables.iter().filter(|rows| !rows.rows.is_empty());
        tables.extend(filled.enumerate().map(|(place, rows)| {
            let title = part.title.as_str();
            ((part.rank, place), Entry { title, rows })
        }));
    }
    tables.sort_by_key(|(key, _)| *key);
    tables.into_iter().map(|(_, entry)| entry).collect()
}

/// Lines for each table: a short one takes what it needs, those that are longer share the rest alike.
fn share_lines(tables: &[Entry<'_>], mut left: usize) -> Vec<usize> {
    let heights: Vec<usize> = tables.iter().map(Entry::height).collect();
    let mut order: Vec<usize> = (0..tables.len()).collect();
    order.sort_by_key(|k| heights[*k]);
    let mut rooms = vec![0; tables.len()];
    for (done, k) in order.iter().enumerate() {
        let share = left / (tables.len() - done);
        rooms[*k] = heights[*k].min(share);
        left -= rooms[*k];
    }
    rooms
}

/// A sentence, what it has in common with others, and whose it is.
struct Sentence {
    kind: String,
    whose: String,
    line: String,
}

/// What comes first: the report's own sentences, the answers of its parts, what was not evaluated or not used.
fn list_answers(lines: &[String], parts: &[Part]) -> Vec<String> {
    let own = lines.iter().map(|line| Sentence {
        kind: line.split(": ").next().unwrap_or(line).to_owned(),
        whose: String::new(),
        line: line.clone(),
    });
    let mut text = condense(own);
    let mut results: Vec<&Part> = parts.iter().collect();
    results.retain(|part| part.rank < Rank::Detail);
    results.sort_by_key(|part| part.rank);
    let results: Vec<String> = results
        .into_iter()
        .flat_map(|part| part.answers.iter().map(move |line| part.titled(line)))
        .collect();
    let left = results.len().saturating_sub(MOST_ANSWERS);
    text.extend(results.into_iter().take(MOST_ANSWERS));
    if left > 0 {
        text.push(format!("And {left} more results."));
    }
    let warnings = parts.iter().flat_map(|part| {
        part.warnings.iter().map(move |warning| Sentence {
            kind: warning.kind.to_owned(),
            whose: part.title.clone(),
            line: part.titled(&warning.line),
        })
    });
    text.extend(condense(warnings));
    if text.is_empty() {
        let filled = parts.iter().filter(|part| !part.tables.is_empty());
        let titles: Vec<&str> = filled.map(|part| part.title.as_str()).collect();
        text.push(format!("Evaluated: {}.", titles.join("; ")));
    }
    text
}

/// Sentences in their order, many of one kind in one line.
fn condense(sentences: impl Iterator<Item = Sentence>) -> Vec<String> {
    let mut kinds: Vec<(String, Vec<Sentence>)> = vec![];
    for sentence in sentences {
        match kinds.iter_mut().find(|(kind, _)| *kind == sentence.kind) {
            Some((_, alike)) => alike.push(sentence),
            None => kinds.push((sentence.kind.clone(), vec![sentence])),
        }
    }
    let mut lines = vec![];
    for (kind, alike) in kinds {
        if alike.len() <= MOST_ALIKE {
            lines.extend(alike.into_iter().map(|sentence| sentence.line));
        } else {
            lines.push(count_alike(&kind, &alike));
        }
    }
    lines
}

/// Sentences of one kind as one line: how many, the first, and whose the others are.
fn count_alike(kind: &str, alike: &[Sentence]) -> String {
    let first = alike.first().map_or("", |sentence| sentence.line.as_str());
    // A sentence that begins with its kind does not repeat it.
    let rest = first
        .strip_prefix(kind)
        .and_then(|rest| rest.strip_prefix(": "));
    let first = rest.unwrap_or(first).trim_end_matches('.');
    let mut others: Vec<&str> = vec![];
    for sentence in alike.iter().skip(1) {
        if !sentence.whose.is_empty() && !others.contains(&sentence.whose.as_str()) {
            others.push(&sentence.whose);
        }
    }
    let others = if others.is_empty() {
        String::new()
    } else {
        format!(" ({})", others.join("; "))
    };
    format!(
        "{kind}, {} times: {first}. And {} more{others}.",
        alike.len(),
        alike.len() - 1
    )
}

#[cfg(test)]
mod tests;
