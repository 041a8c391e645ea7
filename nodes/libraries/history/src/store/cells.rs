//! Cells of a row, each within the bounds of what is written: another program may have changed the file.

use rusqlite::types::ValueRef;

use super::row::TableRow;
use crate::bound;
#[cfg(feature = "postgres")]
use crate::error::HistoryError;

/// Bytes of a value that an error shows.
const SHOWN_BYTES: usize = 40;

/// Why a row cannot be read.
#[derive(Debug)]
pub(super) enum Fault {
    /// As SQLite reports it.
    Sqlite(rusqlite::Error),
    /// As the store reports it.
    #[cfg(feature = "postgres")]
    Store(HistoryError),
    /// A cell of another type than its column's.
    #[cfg(feature = "postgres")]
    Cell(String),
    /// A cell is out of bounds.
    Row(Box<BadCell>),
}

impl From<rusqlite::Error> for Fault {
    fn from(error: rusqlite::Error) -> Self {
        Self::Sqlite(error)
    }
}

/// A cell that is out of bounds.
#[derive(Debug)]
pub(super) struct BadCell {
    pub table: &'static str,
    pub row: String,
    pub column: &'static str,
    pub found: String,
    pub must: String,
}

/// The cells of a row.
#[derive(Clone, Copy)]
pub(super) struct Cells<'r> {
    row: &'r dyn TableRow,
    table: &'static str,
    series: Option<i64>,
    entry: Option<i64>,
}

impl<'r> Cells<'r> {
    pub const fn new(row: &'r dyn TableRow, table: &'static str) -> Self {
        Self {
            row,
            table,
            series: None,
            entry: None,
        }
    }

    /// The same, by the numbers of their series and entry.
    pub const fn of(self, series: i64, entry: Option<i64>) -> Self {
        Self {
            series: Some(series),
            entry,
            ..self
        }
    }

    /// A text of at most so many bytes without control characters.
    pub fn text(
        &self,
        place: usize,
        column: &'static str,
        most_bytes: usize,
    ) -> Result<String, Fault> {
        let value = self.row.cell(place)?;
        if let ValueRef::Text(bytes) = value
            && bytes.len() <= most_bytes
            && let Ok(text) = std::str::from_utf8(bytes)
            && !text.chars().any(char::is_control)
        {
            return Ok(text.to_owned());
        }
        let must = format!("a text of at most {most_bytes} bytes without control characters");
        Err(self.bad(column, value, must))
    }

    /// A whole number.
    pub fn whole(&self, place: usize, column: &'static str) -> Result<i64, Fault> {
        match self.row.cell(place)? {
            ValueRef::Integer(number) => Ok(number),
            value => Err(self.bad(column, value, "a whole number".to_owned())),
        }
    }

    /// A time of an entry, s since 1970.
    pub fn time(&self, place: usize, column: &'static str) -> Result<i64, Fault> {
        match self.row.cell(place)? {
            ValueRef::Integer(at_s) if bound::TIMES_S.contains(&at_s) => Ok(at_s),
            value => {
                let (least, greatest) = (bound::TIMES_S.start(), bound::TIMES_S.end());
                let must = format!("a whole number of seconds from {least} to {greatest}");
                Err(self.bad(column, value, must))
            }
        }
    }

    /// A number of a figure.
    pub fn number(&self, place: usize, column: &'static str) -> Result<f64, Fault> {
        let value = self.row.cell(place)?;
        let number = match value {
            ValueRef::Real(number) => number,
            ValueRef::Integer(number) => number as f64,
            _ => f64::NAN,
        };
        if number.abs() <= bound::MAGNITUDE {
            return Ok(number);
        }
        let must = format!("a number of at most {:e} in magnitude", bound::MAGNITUDE);
        Err(self.bad(column, value, must))
    }

    /// A standard uncertainty; `None`: not known.
    pub fn uncertainty(&self, place: usize, column: &'static str) -> Result<Option<f64>, Fault> {
        let value = self.row.cell(place)?;
        if matches!(value, ValueRef::Null) {
            return Ok(None);
        }
        let number = self.number(place, column)?;
        if number >= 0.0 {
            return Ok(Some(number));
        }
        Err(self.bad(column, value, "0 or more, or nothing".to_owned()))
    }

    fn bad(&self, column: &'static str, value: ValueRef<'_>, must: String) -> Fault {
        let row = match (self.series, self.entry) {
            (Some(series), Some(entry)) => format!("series {series}, entry {entry}"),
            (Some(series), None) => format!("series {series}"),
            _ => "a row".to_owned(),
        };
        Fault::Row(Box::new(BadCell {
            table: self.table,
            row,
            column,
            found: shown(value),
            must,
        }))
    }
}

/// A value, or the begin of it, on one line.
fn shown(value: ValueRef<'_>) -> String {
    match value {
        ValueRef::Null => "nothing".to_owned(),
        ValueRef::Integer(number) => number.to_string(),
        ValueRef::Real(number) => metrology::number::number(number),
        ValueRef::Blob(bytes) => format!("{} bytes that are no text", bytes.len()),
        ValueRef::Text(bytes) => {
            let begin = bytes.get(..SHOWN_BYTES).unwrap_or(bytes);
            let begin = String::from_utf8_lossy(begin);
            format!("{begin:?} ({} bytes)", bytes.len())
        }
    }
}
