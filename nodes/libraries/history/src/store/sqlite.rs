//! A store in one SQLite file, with a write-ahead log so that reading and writing do not wait for each other.
//!
//! Two programs that write at once wait for each other, up to [`Options::busy_ms`].

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::{
    Connection, ErrorCode, OpenFlags, Transaction, TransactionBehavior, params, params_from_iter,
};

use super::cells::Fault;
use super::row::{Key, TableRow};
use super::{Added, KeptFigures, Options, of_known};
use crate::entry::{Entry, Figure};
use crate::error::HistoryError;
use crate::schema;

/// A file of entries.
#[derive(Debug)]
pub struct Sqlite {
    connection: Connection,
    path: PathBuf,
    options: Options,
}

impl Sqlite {
    /// Opens a store for reading and writing; a file that is not there is made, an older one is brought up to date.
    ///
    /// # Errors
    /// When the file cannot be opened or written, is locked, no store, or a newer version's.
    pub fn open(path: &Path, options: Options) -> Result<Self, HistoryError> {
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_CREATE;
        let mut store = Self::connect(path, flags, options)?;
        let version = store.known_version()?;
        if version < schema::VERSION {
            schema::migrate(&mut store.connection).map_err(|error| store.wrong(error))?;
        }
        let connection = &store.connection;
        connection
            .pragma_update(None, "foreign_keys", true)
            .and_then(|()| {
                // Gives the limit back as a row.
                connection.pragma_update_and_check(
                    None,
                    "max_page_count",
                    options.most_pages,
                    |_| Ok(()),
                )
            })
            .map_err(|error| store.wrong(error))?;
        // The mode stays in the file. While another program holds it, its old mode does as well; whoever opens it next tries again.
        let _ = connection.pragma_update_and_check(None, "journal_mode", "WAL", |_| Ok(()));
        Ok(store)
    }

    /// Opens a store for reading alone; nothing is made or changed.
    ///
    /// # Errors
    /// When the file is not there, cannot be opened, is no store, or another version's.
    pub fn open_to_read(path: &Path, options: Options) -> Result<Self, HistoryError> {
        if !path.exists() {
            return Err(HistoryError::Absent {
                path: path.to_owned(),
            });
        }
        let store = Self::connect(path, OpenFlags::SQLITE_OPEN_READ_ONLY, options)?;
        let found = store.known_version()?;
        if found < schema::VERSION {
            return Err(HistoryError::Older {
                path: path.to_owned(),
                found,
                known: schema::VERSION,
            });
        }
        Ok(store)
    }

    fn connect(path: &Path, flags: OpenFlags, options: Options) -> Result<Self, HistoryError> {
        // Opening a pipe would wait, and a device has no end.
        if path.exists() && !path.is_file() && !path.is_dir() {
            return Err(HistoryError::NotRegular {
                path: path.to_owned(),
            });
        }
        let flags = flags | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let opened = Connection::open_with_flags(path, flags).and_then(|connection| {
            let busy = Duration::from_millis(options.busy_ms.into());
            connection.busy_timeout(busy)?;
            Ok(connection)
        });
        let connection = opened.map_err(|error| wrong(path, options, error))?;
        Ok(Self {
            connection,
            path: path.to_owned(),
            options,
        })
    }

    /// The version of a file that is ours, or empty.
    fn known_version(&self) -> Result<i64, HistoryError> {
        let version = schema::version(&self.connection).map_err(|error| self.wrong(error))?;
        let Some(found) = version else {
            let found = schema::application_id(&self.connection);
            return Err(HistoryError::Foreign {
                path: self.path.clone(),
                found: found.map_err(|error| self.wrong(error))?,
                wanted: schema::APPLICATION_ID,
            });
        };
        if found > schema::VERSION {
            return Err(HistoryError::Newer {
                path: self.path.clone(),
                found,
                known: schema::VERSION,
            });
        }
        Ok(found)
    }

    /// Adds an entry, unless one of its kind and hash is there. A time at midnight is that of a date alone: it agrees with
    /// every time of its day.
    ///
    /// # Errors
    /// When the entry is out of bounds, or the file cannot be written; nothing of it is kept then.
    pub fn add(&mut self, entry: &Entry) -> Result<Added, HistoryError> {
        let (path, options) = (self.path.clone(), self.options);
        let add = |connection: &mut Connection| -> Result<Added, rusqlite::Error> {
            let transaction =
                connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
            if let Some((id, machine, at_s)) = known(&transaction, entry)? {
                let kept = figures_of(&transaction, id)?;
                return Ok(of_known(entry, (machine, at_s), &kept));
            }
            insert(&transaction, entry)?;
            transaction.commit()?;
            Ok(Added::New)
        };
        add(&mut self.connection).map_err(|error| wrong(&path, options, error))
    }

    /// Hands the rows of a question to `take` until it has enough.
    pub fn each(
        &self,
        sql: &str,
        keys: &[Key<'_>],
        take: &mut dyn FnMut(&dyn TableRow) -> Result<bool, Fault>,
    ) -> Result<(), Fault> {
        let mut statement = self.connection.prepare(sql)?;
        let mut rows = statement.query(params_from_iter(keys))?;
        while let Some(row) = rows.next()? {
            if !take(row)? {
                break;
            }
        }
        Ok(())
    }

    pub fn wrong(&self, error: rusqlite::Error) -> HistoryError {
        wrong(&self.path, self.options, error)
    }
}

/// The figures of the entry `id`.
fn figures_of(transaction: &Transaction<'_>, id: i64) -> Result<KeptFigures, rusqlite::Error> {
    let sql = "SELECT s.test, s.name, s.axis, f.value FROM figure f JOIN series s ON s.id = f.series WHERE f.entry = ?1";
    let mut statement = transaction.prepare(sql)?;
    let rows = statement.query_map([id], |row| {
        let key: (String, String, String) = (row.get(0)?, row.get(1)?, row.get(2)?);
        Ok((key, row.get::<_, f64>(3)?))
    })?;
    let kept: Result<BTreeMap<_, _>, _> = rows.collect();
    kept
}

/// Row, machine and time of the entry of the same kind and hash, where there is one.
fn known(
    transaction: &Transaction<'_>,
    entry: &Entry,
) -> Result<Option<(i64, String, i64)>, rusqlite::Error> {
    let sql = "SELECT id, machine, at_s FROM entry WHERE kind = ?1 AND sha256 = ?2";
    let key = params![entry.kind.name(), entry.sha256];
    let mut statement = transaction.prepare(sql)?;
    let mut rows = statement.query_map(key, |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)))?;
    rows.next().transpose()
}

fn insert(transaction: &Transaction<'_>, entry: &Entry) -> Result<(), rusqlite::Error> {
    transaction.execute(
        "INSERT INTO entry (machine, at_s, kind, sha256, machine_sha256, source, instruments, operator, software)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)",
        params![
            entry.machine,
            entry.at_s,
            entry.kind.name(),
            entry.sha256,
            entry.machine_sha256,
            entry.source,
            entry.instruments,
            entry.operator,
            entry.software,
        ],
    )?;
    let id = transaction.last_insert_rowid();
    let mut place = transaction.prepare(
        "INSERT INTO series (machine, test, name, axis, unit) VALUES (?1, ?2, ?3, ?4, ?5)
         ON CONFLICT (machine, name, axis, test, unit) DO UPDATE SET axis = axis RETURNING id",
    )?;
    let mut insert = transaction.prepare(
        "INSERT INTO figure (series, at_s, entry, value, standard_uncertainty, low, high, status)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)",
    )?;
    for Figure {
        test,
        name,
        axis,
        value,
        unit,
        standard_uncertainty,
        interval,
        status,
    } in &entry.figures
    {
        let key = params![entry.machine, test, name, axis, unit];
        let series: i64 = place.query_row(key, |row| row.get(0))?;
        let [low, high] = interval.map_or([None, None], |ends| ends.map(Some));
        insert.execute(params![
            series,
            entry.at_s,
            id,
            value,
            standard_uncertainty,
            low,
            high,
            status,
        ])?;
    }
    Ok(())
}

/// What SQLite reports, in words that name the remedy.
fn wrong(path: &Path, options: Options, error: rusqlite::Error) -> HistoryError {
    let path = path.to_owned();
    // Tables or columns that are gone, and values of another type than the schema's.
    let is_schema = error.to_string().starts_with("no such ");
    let is_value = matches!(
        error,
        rusqlite::Error::InvalidColumnType(..)
            | rusqlite::Error::FromSqlConversionFailure(..)
            | rusqlite::Error::IntegralValueOutOfRange(..)
    );
    if is_schema || is_value {
        let reason = error.to_string();
        return HistoryError::NoDatabase { path, reason };
    }
    match error.sqlite_error_code() {
        Some(ErrorCode::CannotOpen | ErrorCode::PermissionDenied) => HistoryError::Unopened {
            path,
            reason: error.to_string(),
        },
        Some(ErrorCode::NotADatabase | ErrorCode::DatabaseCorrupt) => HistoryError::NoDatabase {
            path,
            reason: error.to_string(),
        },
        Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked) => HistoryError::Locked {
            path,
            waited_ms: options.busy_ms,
        },
        Some(ErrorCode::ReadOnly) => HistoryError::ReadOnly { path },
        Some(ErrorCode::DiskFull) => HistoryError::Full { path },
        _ => HistoryError::Database {
            path,
            source: error,
        },
    }
}
