//! The cells of a table as words, whatever kind of file they stood in.

use std::collections::BTreeMap;

use anyhow::{Context, Result, bail};

use super::dates;
use super::spaced;

/// Most columns of a table that are read.
pub const MOST_COLUMNS: u32 = 1_000;

/// Most cells of a table that are read: a table of 400,000 rows and ten columns.
pub const MOST_CELLS: usize = 4_000_000;

/// Lines of cells, with the number of each line in its file, from 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sheet {
    /// Lines that hold anything.
    pub lines: Vec<(u64, Vec<String>)>,
    /// Separator of a text, which messages quote.
    pub separator: Option<char>,
    /// Place of a column of dates that stand before the times of the day of their rows by now.
    pub dates: Option<usize>,
    /// Comments of a text with their lines, without the sign that begins them.
    pub comments: Vec<(u64, String)>,
    /// Words for units that the number formats of columns show, by the places of the columns.
    pub shown_units: BTreeMap<usize, String>,
    /// Lines at which a sampler lost samples.
    pub overruns: Vec<u64>,
    /// What was done with a table whose targets are across; empty of every other one.
    pub turned: Vec<String>,
}

/// The cells of a file, and which of its worksheets they are.
#[derive(Debug, Default)]
pub struct Cells {
    /// The cells.
    pub sheet: Sheet,
    /// Name of the worksheet, where the file has several that hold anything.
    pub name: Option<String>,
    /// Which worksheet was read and which were not; nothing of a file with one.
    pub note: Option<String>,
    /// The instrument's own form that it is of, where it is of one.
    pub form: Option<&'static str>,
    /// What an instrument's file says beside its readings.
    pub remarks: Vec<String>,
    /// Runs of a measurement that an instrument's file lacks or that were broken off.
    pub n_lost_runs: usize,
    /// When its measurement began, s since 1970, where it says so.
    pub start_s: Option<f64>,
}

impl Sheet {
    /// The cells of a text; lines that begin with `#` are comments.
    ///
    /// # Errors
    /// When the separator is no byte, or the file holds no line.
    pub fn of_text(text: &str, separator: char) -> Result<Self> {
        // DOS programs end a file with ^Z, some loggers with NUL.
        let whole = text.trim_end_matches(['\u{1a}', '\0', '\r', '\n']);
        // A comment on a last line without an end would be a row.
        let text = &format!("{whole}\n");
        if separator == ' ' {
            let mut spaced = spaced::cut(text)?;
            let dates = dates::join(&mut spaced.lines);
            return Ok(Self {
                lines: spaced.lines,
                separator: Some(separator),
                dates,
                comments: comments(text),
                overruns: spaced.overruns,
                ..Self::default()
            });
        }
        let byte = u8::try_from(separator).context("separator: must be one byte")?;
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(byte)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .flexible(true)
            .has_headers(false)
            .from_reader(text.as_bytes());
        let mut lines = vec![];
        let mut n_cells = 0;
        for record in reader.records() {
            let record = record?;
            let line = record.position().map_or(0, |at| line_of(text, at));
            if record.len() > MOST_COLUMNS as usize {
                bail!(
                    "line {line}: {} columns: must be at most {MOST_COLUMNS}: take away those that hold no test",
                    record.len()
                );
            }
            n_cells += record.len();
            if n_cells > MOST_CELLS {
                bail!(
                    "line {line}: more than {MOST_CELLS} cells up to here, the most that is read: split the table, or take away columns that hold no test"
                );
            }
            lines.push((line, record.iter().map(str::to_owned).collect()));
        }
        if lines.is_empty() {
            bail!(
                "the file has no line with the names of columns: it is empty, or holds comments alone"
            );
        }
        let dates = dates::join(&mut lines);
        Ok(Self {
            lines,
            separator: Some(separator),
            dates,
            comments: comments(text),
            ..Self::default()
        })
    }

    /// Whether a line has a cell with a name.
    pub fn has(&self, name: &str) -> bool {
        self.lines.iter().any(|(_, cells)| holds(cells, name))
    }

    /// The first line that holds every one of some names; otherwise the first of those that hold most of them.
    pub fn head(&self, names: &[&str]) -> Option<usize> {
        let held = |cells: &[String]| names.iter().filter(|name| holds(cells, name)).count();
        let mut best: Option<(usize, usize)> = None;
        for (k, (_, cells)) in self.lines.iter().enumerate() {
            let n = held(cells);
            if n == names.len() {
                return Some(k);
            }
            if best.is_none_or(|(_, most)| n > most) {
                best = Some((k, n));
            }
        }
        best.map(|(k, _)| k)
    }
}

/// Lines that begin with `#`, with their numbers.
fn comments(text: &str) -> Vec<(u64, String)> {
    let lines = (1..).zip(text.lines());
    let comments = lines.filter_map(|(n, line)| Some((n, line.strip_prefix('#')?)));
    comments
        .map(|(n, comment)| (n, comment.trim_matches(['#', ' ', '\t']).to_owned()))
        .collect()
}

/// The line of a record; where it was begun to be read, comments and empty lines may stand before it.
fn line_of(text: &str, at: &csv::Position) -> u64 {
    let begin = usize::try_from(at.byte()).unwrap_or(usize::MAX);
    let rest = text.get(begin..).unwrap_or_default();
    let is_passed_over = |line: &&str| line.is_empty() || line.starts_with('#');
    at.line() + rest.lines().take_while(is_passed_over).count() as u64
}

fn holds(cells: &[String], name: &str) -> bool {
    cells.iter().any(|cell| cell == name)
}
