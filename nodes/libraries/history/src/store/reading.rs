//! What a store gives back: machines, series, points, last values, times of tests.

use super::Store;
use super::cells::{Cells, Fault};
use super::row::Key;
use crate::bound;
use crate::conditions::has_words;
use crate::error::HistoryError;
use crate::point::Point;

/// A machine of a store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MachineSummary {
    /// Its name.
    pub machine: String,
    /// Entries.
    pub entries: i64,
    /// Time of the first, s since 1970.
    pub first_s: i64,
    /// Time of the last, s since 1970.
    pub last_s: i64,
}

/// Which series are read; `None` takes all.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SeriesKey {
    /// The machine's name.
    pub machine: Option<String>,
    /// A figure's name, or the begin of it before a dot.
    pub name: Option<String>,
    /// The axis.
    pub axis: Option<String>,
    /// Words of the test's title, from the begin of one on; a letter alone is one.
    pub test: Option<String>,
}

/// One figure of one machine over time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Series {
    /// Its number in the store.
    pub id: i64,
    /// The machine's name.
    pub machine: String,
    /// Title of the test.
    pub test: String,
    /// Name of the figure.
    pub name: String,
    /// Axis; empty: none.
    pub axis: String,
    /// Unit of its values.
    pub unit: String,
}

/// A span of time, both ends included; s since 1970.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Begin.
    pub since_s: i64,
    /// End.
    pub until_s: i64,
}

impl Window {
    /// All of time.
    pub const ALL: Self = Self {
        since_s: i64::MIN,
        until_s: i64::MAX,
    };
}

/// A value of a series.
#[derive(Clone, Debug, PartialEq)]
pub struct Kept {
    /// Time, value and uncertainty.
    pub point: Point,
    /// Status of a cause; empty for other figures.
    pub status: String,
    /// Path of the bag or report.
    pub source: String,
}

/// The last value of a series.
#[derive(Clone, Debug, PartialEq)]
pub struct Last {
    /// The series.
    pub series: Series,
    /// Its last value.
    pub point: Point,
    /// How many there are.
    pub n: i64,
}

/// Condition of a [`SeriesKey`], whose members are parameters 1 to 4.
const OF_KEY: &str = "(?1 IS NULL OR s.machine = ?1)
     AND (?2 IS NULL OR s.name = ?2 OR substr(s.name, 1, length(?2) + 1) = ?2 || '.')
     AND (?3 IS NULL OR s.axis = ?3)
     AND (?4 IS NULL OR instr(lower(s.test), lower(trim(?4))) > 0)";
const COLUMNS: &str = "s.id, s.machine, s.test, s.name, s.axis, s.unit";

impl Store {
    /// All machines by name.
    ///
    /// # Errors
    /// When the store cannot be read, or has too many.
    pub fn machines(&self) -> Result<Vec<MachineSummary>, HistoryError> {
        let sql = "SELECT machine, count(*), min(at_s), max(at_s) FROM entry GROUP BY machine ORDER BY machine";
        self.rows(sql, &[], ("entry", "machines", bound::ROWS), |cells| {
            Ok(MachineSummary {
                machine: cells.text(0, "machine", bound::NAME_BYTES)?,
                entries: cells.whole(1, "entries")?,
                first_s: cells.time(2, "at_s")?,
                last_s: cells.time(3, "at_s")?,
            })
        })
    }

    /// The series of a key, by machine, name, axis and test.
    ///
    /// # Errors
    /// When the store cannot be read, or has too many.
    pub fn series(&self, key: &SeriesKey) -> Result<Vec<Series>, HistoryError> {
        let sql = format!(
            "SELECT {COLUMNS} FROM series s WHERE {OF_KEY} ORDER BY s.machine, s.name, s.axis, s.test, s.unit"
        );
        let of = ("series", "series", bound::ROWS);
        let mut found = self.rows(&sql, &of_key(key), of, read_series)?;
        found.retain(|series| is_of_test(key, series));
        Ok(found)
    }

    /// The values of a series in order of time.
    ///
    /// # Errors
    /// When the store cannot be read, or has too many.
    pub fn points(&self, series: i64, window: Window) -> Result<Vec<Kept>, HistoryError> {
        // A time that is no number lies in no window, and an entry that is gone in no row: both are read, and refused.
        let sql = "SELECT f.at_s, f.value, f.standard_uncertainty, f.status, e.source, f.entry
             FROM figure f LEFT JOIN entry e ON e.id = f.entry
             WHERE f.series = ?1 AND (f.at_s BETWEEN ?2 AND ?3 OR typeof(f.at_s) <> 'integer')
             ORDER BY f.at_s, f.entry";
        let key = [series, window.since_s, window.until_s].map(Key::Whole);
        let of = ("figure", "values of one figure", bound::POINTS);
        self.rows(sql, &key, of, |cells| {
            let cells = cells.of(series, Some(cells.whole(5, "entry")?));
            Ok(Kept {
                point: read_point(&cells, 0)?,
                status: cells.text(3, "status", bound::NAME_BYTES)?,
                source: cells.text(4, "source of its entry", bound::TEXT_BYTES)?,
            })
        })
    }

    /// The last value of each series of a key.
    ///
    /// # Errors
    /// When the store cannot be read, or has too many.
    pub fn last_values(&self, key: &SeriesKey) -> Result<Vec<Last>, HistoryError> {
        let sql = format!(
            "SELECT {COLUMNS}, f.at_s, f.value, f.standard_uncertainty,
                    (SELECT count(*) FROM figure c WHERE c.series = s.id)
             FROM series s JOIN figure f ON f.series = s.id
             WHERE {OF_KEY} AND (f.at_s, f.entry) =
                   (SELECT l.at_s, l.entry FROM figure l WHERE l.series = s.id
                    ORDER BY l.at_s DESC, l.entry DESC LIMIT 1)
             ORDER BY s.machine, s.name, s.axis, s.test, s.unit"
        );
        let of = ("figure", "series", bound::ROWS);
        let mut found = self.rows(&sql, &of_key(key), of, |cells| {
            let series = read_series(cells)?;
            let cells = cells.of(series.id, None);
            Ok(Last {
                point: read_point(&cells, 6)?,
                n: cells.whole(9, "values")?,
                series,
            })
        })?;
        found.retain(|last| is_of_test(key, &last.series));
        Ok(found)
    }

    /// Times at which a machine's tests were made: title and s since 1970, in order.
    ///
    /// # Errors
    /// When the store cannot be read, or has too many.
    pub fn test_times(&self, machine: &str) -> Result<Vec<(String, i64)>, HistoryError> {
        let sql = "SELECT DISTINCT s.test, f.at_s FROM series s JOIN figure f ON f.series = s.id
             WHERE s.machine = ?1 AND s.test <> '' ORDER BY s.test, f.at_s";
        let of = ("figure", "times of tests", bound::POINTS);
        self.rows(sql, &[Key::Text(Some(machine))], of, |cells| {
            let test = cells.text(0, "test", bound::NAME_BYTES)?;
            Ok((test, cells.time(1, "at_s")?))
        })
    }

    /// Rows of a question, at most so many.
    fn rows<T>(
        &self,
        sql: &str,
        keys: &[Key<'_>],
        (table, name, most): (&'static str, &'static str, usize),
        read: impl Fn(&Cells<'_>) -> Result<T, Fault>,
    ) -> Result<Vec<T>, HistoryError> {
        let mut rows = Vec::new();
        self.each(sql, keys, most, &mut |row| {
            rows.push(read(&Cells::new(row, table))?);
            Ok(rows.len() <= most)
        })?;
        if rows.len() > most {
            return Err(HistoryError::TooMany {
                path: self.path.clone(),
                rows: name,
                most,
            });
        }
        Ok(rows)
    }
}

/// Whether a series that [`OF_KEY`] holds for is of the test by its words.
fn is_of_test(key: &SeriesKey, series: &Series) -> bool {
    let text = key.test.as_deref();
    text.is_none_or(|text| has_words(&series.test, text))
}

/// Parameters 1 to 4 of [`OF_KEY`].
fn of_key(key: &SeriesKey) -> [Key<'_>; 4] {
    [&key.machine, &key.name, &key.axis, &key.test].map(|text| Key::Text(text.as_deref()))
}

fn read_series(cells: &Cells<'_>) -> Result<Series, Fault> {
    let id = cells.whole(0, "id")?;
    let cells = cells.of(id, None);
    let text = |place, column| cells.text(place, column, bound::NAME_BYTES);
    Ok(Series {
        id,
        machine: text(1, "machine")?,
        test: text(2, "test")?,
        name: text(3, "name")?,
        axis: text(4, "axis")?,
        unit: text(5, "unit")?,
    })
}

/// Time, value and uncertainty in three columns from `first` on.
fn read_point(cells: &Cells<'_>, first: usize) -> Result<Point, Fault> {
    Ok(Point {
        at_s: cells.time(first, "at_s")? as f64,
        value: cells.number(first + 1, "value")?,
        standard_uncertainty: cells.uncertainty(first + 2, "standard_uncertainty")?,
    })
}
