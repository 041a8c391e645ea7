//! Cells that hold no value of their column: one of them costs its row or its reading, and is named; many are another table.

use anyhow::{Result, anyhow};

/// One row in so many may have such a cell; with more the map or the table is wrong.
const ONE_IN: usize = 10;
/// Cells that are named one by one.
const ODD_CELLS_NAMED: usize = 20;

/// Such cells of a table.
#[derive(Debug, Default)]
pub struct Odd {
    n: usize,
    named: Vec<String>,
}

/// What a cell holds.
pub enum Read {
    Number(f64),
    /// A time of the day or a date, s.
    Clock(f64),
    /// No value of its column: why.
    Odd(String),
}

/// Whether a cell stands for a missing reading.
pub fn is_missing(cell: &str) -> bool {
    let words = [
        "", "nan", "n/a", "na", "#n/a", "null", "none", "-", "--", "---",
    ];
    words.contains(&cell.to_lowercase().as_str())
}

/// What a cell costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cost {
    /// Its row.
    Row,
    /// Its reading; the stop stays.
    Reading,
}

impl Odd {
    /// Notes a cell: line, column, and why it holds no value.
    pub fn note(&mut self, (line, column): (u64, &str), why: &str, cost: Cost) {
        self.n += 1;
        if self.named.len() < ODD_CELLS_NAMED {
            let what = match cost {
                Cost::Row => "row",
                Cost::Reading => "reading",
            };
            self.named.push(format!(
                "line {line}, column \"{column}\": {why}: the {what} is left out"
            ));
        }
    }

    /// A sentence for each of the first cells; empty without odd cells. `rows`: rows of the table.
    ///
    /// # Errors
    /// The first cell, where more than a tenth of the rows have one.
    pub fn lines(self, rows: usize) -> Result<Vec<String>> {
        let Self { n, named } = self;
        if n * ONE_IN > rows {
            let first = named.into_iter().next().unwrap_or_default();
            let first = first.rsplit_once(": the ").map_or("", |(cell, _)| cell);
            let others = match n {
                1 => String::new(),
                _ => format!(" ({n} such cells in {rows} rows)"),
            };
            return Err(anyhow!("{first}{others}"));
        }
        let mut lines = named;
        if n > lines.len() {
            lines.push(format!(
                "{} more cells that hold no value of their column",
                n - lines.len()
            ));
        }
        Ok(lines)
    }
}
