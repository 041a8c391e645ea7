//! The store: one SQLite file, or a PostgreSQL server with the feature `postgres`. Both have the same tables.
//!
//! An entry is written in one transaction: whole or not at all.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::entry::{Entry, Figure};
use crate::error::HistoryError;

mod cells;
mod reading;
mod row;
#[cfg(feature = "postgres")]
mod server;
mod sqlite;
mod url;

use cells::Fault;
pub use reading::{Kept, Last, MachineSummary, Series, SeriesKey, Window};
use row::{Key, TableRow};
use sqlite::Sqlite;
pub use url::{is_server, shown};

/// How a store is opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// How long a lock of another program, or a server, is waited for, ms.
    pub busy_ms: u32,
    /// Most pages of 4,096 bytes that a file grows to.
    pub most_pages: u32,
}

impl Default for Options {
    /// 10 s, and 16 GiB.
    fn default() -> Self {
        Self {
            busy_ms: 10_000,
            most_pages: 4_194_304,
        }
    }
}

/// What became of an entry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Added {
    /// It was added.
    New,
    /// The store has it already: the same kind and hash. Nothing was changed.
    Known,
    /// The store has it already, and other figures of it. Nothing was changed.
    KnownOtherwise,
    /// The store has it under another machine or time. Nothing was changed.
    Otherwise {
        /// The machine that it stands under.
        machine: String,
        /// Its time there, s since 1970.
        at_s: i64,
    },
}

/// Seconds of a day.
const DAY_S: i64 = 86_400;

/// A store of entries.
#[derive(Debug)]
pub struct Store {
    backend: Backend,
    /// The file, or the server's URL without its password.
    path: PathBuf,
}

#[derive(Debug)]
enum Backend {
    Sqlite(Sqlite),
    #[cfg(feature = "postgres")]
    Server(Box<server::Server>),
}

impl Store {
    /// Opens a store for reading and writing: a file, or `postgres://USER@HOST/DATABASE`. One that is not there is made, an
    /// older one is brought up to date.
    ///
    /// # Errors
    /// When it cannot be opened or written, is locked, no store, or a newer version's.
    pub fn open(path: &Path, options: Options) -> Result<Self, HistoryError> {
        Ok(Self {
            backend: match url::of(path) {
                Some(url) => Backend::of_server(url, options, false)?,
                None => Backend::Sqlite(Sqlite::open(path, options)?),
            },
            path: url::shown(path),
        })
    }

    /// Opens a store for reading alone; nothing is made or changed.
    ///
    /// # Errors
    /// When it is not there, cannot be opened, is no store, or another version's.
    pub fn open_to_read(path: &Path, options: Options) -> Result<Self, HistoryError> {
        Ok(Self {
            backend: match url::of(path) {
                Some(url) => Backend::of_server(url, options, true)?,
                None => Backend::Sqlite(Sqlite::open_to_read(path, options)?),
            },
            path: url::shown(path),
        })
    }

    /// Adds an entry, unless one of its kind and hash is there. A time at midnight is that of a date alone: it agrees with
    /// every time of its day.
    ///
    /// # Errors
    /// When the entry is out of bounds, or the store cannot be written; nothing of it is kept then.
    pub fn add(&mut self, entry: &Entry) -> Result<Added, HistoryError> {
        entry.check()?;
        match &mut self.backend {
            Backend::Sqlite(file) => file.add(entry),
            #[cfg(feature = "postgres")]
            Backend::Server(server) => server.add(entry),
        }
    }

    /// Hands the rows of a question to `take` until it has enough; a server gives `most` and one.
    fn each(
        &self,
        sql: &str,
        keys: &[Key<'_>],
        most: usize,
        take: &mut dyn FnMut(&dyn TableRow) -> Result<bool, Fault>,
    ) -> Result<(), HistoryError> {
        let (path, of_file) = match &self.backend {
            Backend::Sqlite(file) => (&self.path, file.each(sql, keys, take)),
            #[cfg(feature = "postgres")]
            Backend::Server(server) => (&self.path, server.each(sql, keys, most, take)),
        };
        // A file is read row by row.
        let _ = most;
        of_file.map_err(|fault| match fault {
            Fault::Sqlite(error) => match &self.backend {
                Backend::Sqlite(file) => file.wrong(error),
                #[cfg(feature = "postgres")]
                Backend::Server(_) => HistoryError::NoDatabase {
                    path: path.clone(),
                    reason: error.to_string(),
                },
            },
            #[cfg(feature = "postgres")]
            Fault::Store(error) => error,
            #[cfg(feature = "postgres")]
            Fault::Cell(reason) => HistoryError::NoDatabase {
                path: path.clone(),
                reason,
            },
            Fault::Row(bad) => HistoryError::BadRow {
                path: path.clone(),
                table: bad.table,
                row: bad.row,
                column: bad.column,
                found: bad.found,
                must: bad.must,
            },
        })
    }
}

impl Backend {
    #[cfg(feature = "postgres")]
    fn of_server(url: &str, options: Options, is_to_read: bool) -> Result<Self, HistoryError> {
        let shown = url::shown(Path::new(url));
        let server = server::Server::open(url, &shown, options, is_to_read)?;
        Ok(Self::Server(Box::new(server)))
    }

    #[cfg(not(feature = "postgres"))]
    fn of_server(url: &str, _options: Options, _is_to_read: bool) -> Result<Self, HistoryError> {
        Err(HistoryError::NoFeature {
            path: url::shown(Path::new(url)),
        })
    }
}

/// Figures of an entry: test, name and axis, and the value.
type KeptFigures = BTreeMap<(String, String, String), f64>;

/// What an entry that is there, with its machine, time and figures, means for the one to add.
fn of_known(entry: &Entry, (machine, at_s): (String, i64), kept: &KeptFigures) -> Added {
    let is_date = at_s % DAY_S == 0 || entry.at_s % DAY_S == 0;
    let is_day = is_date && at_s.div_euclid(DAY_S) == entry.at_s.div_euclid(DAY_S);
    let is_same = machine == entry.machine && (at_s == entry.at_s || is_day);
    if !is_same {
        Added::Otherwise { machine, at_s }
    } else if has_figures(entry, kept) {
        Added::Known
    } else {
        Added::KnownOtherwise
    }
}

/// Figures that differ by a smaller share are the same.
const SAME_SHARE: f64 = 1e-9;

/// Whether the figures of an entry are those that are kept.
fn has_figures(entry: &Entry, kept: &KeptFigures) -> bool {
    let is_kept = |figure: &Figure| {
        let key = (
            figure.test.clone(),
            figure.name.clone(),
            figure.axis.clone(),
        );
        kept.get(&key)
            .is_some_and(|value| (value - figure.value).abs() <= SAME_SHARE * value.abs())
    };
    kept.len() == entry.figures.len() && entry.figures.iter().all(is_kept)
}
