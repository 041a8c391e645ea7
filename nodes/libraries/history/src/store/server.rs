//! A store on a PostgreSQL server: the same tables as those of a file, in the schema `abbe` of a database.
//!
//! Every wait has an end: [`Options::busy_ms`] for opening, for each question, and for adding an entry with all attempts. An
//! entry is written in one transaction, and recognised by kind and hash: an attempt after one whose end is not known adds
//! nothing twice.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::time::Duration;

use postgres_openssl::MakeTlsConnector;
use tokio::runtime::Runtime;
use tokio::time::{sleep, timeout};
use tokio_postgres::error::SqlState;
use tokio_postgres::types::{ToSql, Type};
use tokio_postgres::{Client, Config};

use super::cells::Fault;
use super::row::{Key, TableRow};
use super::{Added, Options};
use crate::entry::Entry;
use crate::error::HistoryError;
use crate::schema;

mod adding;
mod parameters;
mod row;
mod tls;

use parameters::TlsParameters;

/// First pause between two attempts; each further one is twice as long, up to [`LONGEST_PAUSE`].
const FIRST_PAUSE: Duration = Duration::from_millis(50);
/// Longest pause between two attempts.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);
/// Greatest name of a lock: programs that make the tables do it one after the other.
const LOCK: i64 = schema::APPLICATION_ID;

/// A connection to a server.
pub struct Server {
    runtime: Runtime,
    client: Client,
    way: Way,
    shown: PathBuf,
    options: Options,
}

/// How the server is reached.
struct Way {
    config: Config,
    tls: MakeTlsConnector,
}

impl std::fmt::Debug for Server {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Server").field(&self.shown).finish()
    }
}

impl Server {
    /// Connects to the database of a URL; `shown` is the URL without its password. Tables are made or brought up to date,
    /// unless it `is_to_read`.
    pub fn open(
        url: &str,
        shown: &Path,
        options: Options,
        is_to_read: bool,
    ) -> Result<Self, HistoryError> {
        let unopened = |reason: String| HistoryError::Unopened {
            path: shown.to_owned(),
            reason,
        };
        let (url, parameters) = TlsParameters::split(url, shown)?;
        let mut config: Config = url
            .parse()
            .map_err(|error: tokio_postgres::Error| unopened(in_words(&error)))?;
        let busy_ms = options.busy_ms;
        let mode = if is_to_read { "on" } else { "off" };
        let given = config.get_options().unwrap_or_default().to_owned();
        config.options(format!(
            "{given} -c search_path=abbe -c statement_timeout={busy_ms} -c lock_timeout={busy_ms} -c default_transaction_read_only={mode}"
        ));
        config.application_name("abbe");
        let tls = tls::prepare(&mut config, &parameters, shown)?;
        let way = Way { config, tls };
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(|error| unopened(error.to_string()))?;
        let limit = Duration::from_millis(busy_ms.into());
        let client = within(&runtime, limit, connect(&way))
            .ok_or_else(|| late(shown, options, "no connection"))?
            .map_err(|error| wrong(shown, options, &error))?;
        let mut server = Self {
            runtime,
            client,
            way,
            shown: shown.to_owned(),
            options,
        };
        server.prepare(is_to_read)?;
        Ok(server)
    }

    /// Makes the tables, or brings them up to date; to read, refuses those that are not.
    fn prepare(&mut self, is_to_read: bool) -> Result<(), HistoryError> {
        let path = self.shown.clone();
        let known = schema::VERSION;
        let limit = self.limit();
        let late = self.late("no answer");
        let client = &mut self.client;
        let work = async {
            let found = version(client).await?;
            if !is_to_read && found.is_some_and(|found| found < known) {
                migrate(client).await?;
            }
            Ok::<_, tokio_postgres::Error>(found)
        };
        let found = within(&self.runtime, limit, work).ok_or(late)?;
        match found.map_err(|error| self.wrong(&error))? {
            None => Err(HistoryError::Foreign {
                path,
                found: 0,
                wanted: schema::APPLICATION_ID,
            }),
            Some(found) if found > known => Err(HistoryError::Newer { path, found, known }),
            Some(0) if is_to_read => Err(HistoryError::Absent { path }),
            Some(found) if is_to_read && found < known => {
                Err(HistoryError::Older { path, found, known })
            }
            Some(_) => Ok(()),
        }
    }

    /// Adds an entry; an attempt that a broken connection, a deadlock or a server that starts ended is made again.
    pub fn add(&mut self, entry: &Entry) -> Result<Added, HistoryError> {
        let last = RefCell::new(String::from("no answer"));
        let limit = self.limit();
        let (client, way) = (&mut self.client, &self.way);
        let work = async {
            let mut pause = FIRST_PAUSE;
            // Whether an attempt may have come to its end without an answer.
            let mut is_unknown = false;
            loop {
                let error = match adding::add(client, entry, &mut is_unknown).await {
                    Ok(added) => return Ok(added),
                    Err(error) => error,
                };
                if !is_passing(&error) {
                    return Err(error);
                }
                *last.borrow_mut() = in_words(&error);
                sleep(pause).await;
                pause = (pause * 2).min(LONGEST_PAUSE);
                if client.is_closed() {
                    *client = connect(way).await?;
                }
            }
        };
        match within(&self.runtime, limit, work) {
            Some(added) => added.map_err(|error| self.wrong(&error)),
            None => Err(self.late(&last.borrow())),
        }
    }

    /// Hands the rows of a question to `take` until it has enough; at most `most` and one.
    pub fn each(
        &self,
        sql: &str,
        keys: &[Key<'_>],
        most: usize,
        take: &mut dyn FnMut(&dyn TableRow) -> Result<bool, Fault>,
    ) -> Result<(), Fault> {
        let sql = format!(
            "{} LIMIT {}",
            schema::of_postgres(sql),
            most.saturating_add(1)
        );
        let types: Vec<Type> = keys.iter().map(row::type_of).collect();
        let values: Vec<&(dyn ToSql + Sync)> = keys.iter().map(row::parameter).collect();
        let work = async {
            let statement = self.client.prepare_typed(&sql, &types).await?;
            self.client.query(&statement, &values).await
        };
        let rows = within(&self.runtime, self.limit(), work)
            .ok_or_else(|| Fault::Store(self.late("no answer")))?
            .map_err(|error| Fault::Store(self.wrong(&error)))?;
        for row in &rows {
            if !take(row)? {
                break;
            }
        }
        Ok(())
    }

    const fn limit(&self) -> Duration {
        Duration::from_millis(self.options.busy_ms as u64)
    }

    fn late(&self, reason: &str) -> HistoryError {
        late(&self.shown, self.options, reason)
    }

    fn wrong(&self, error: &tokio_postgres::Error) -> HistoryError {
        wrong(&self.shown, self.options, error)
    }
}

fn late(path: &Path, options: Options, reason: &str) -> HistoryError {
    HistoryError::Unreachable {
        path: path.to_owned(),
        waited_ms: options.busy_ms,
        reason: reason.to_owned(),
    }
}

/// Waits for work until its limit; `None`: it did not end.
fn within<T>(runtime: &Runtime, limit: Duration, work: impl Future<Output = T>) -> Option<T> {
    runtime.block_on(async { timeout(limit, work).await.ok() })
}

/// Connects; while the server is away or starts, again and again. The caller has the limit.
async fn connect(way: &Way) -> Result<Client, tokio_postgres::Error> {
    let mut pause = FIRST_PAUSE;
    loop {
        match way.config.connect(way.tls.clone()).await {
            Ok((client, connection)) => {
                // It ends with the client; what it reports, the client's questions do too.
                tokio::spawn(async move {
                    let _ = connection.await;
                });
                return Ok(client);
            }
            Err(error) if is_passing(&error) => {}
            Err(error) => return Err(error),
        }
        sleep(pause).await;
        pause = (pause * 2).min(LONGEST_PAUSE);
    }
}

/// The version of the tables; 0 before they are made, `None` where another program has that schema.
async fn version(client: &Client) -> Result<Option<i64>, tokio_postgres::Error> {
    let sql = "SELECT to_regclass('abbe.schema_version') IS NOT NULL,
                      EXISTS (SELECT 1 FROM pg_catalog.pg_tables WHERE schemaname = 'abbe')";
    let row = client.query_one(sql, &[]).await?;
    if !row.try_get::<_, bool>(0)? {
        return Ok((!row.try_get::<_, bool>(1)?).then_some(0));
    }
    let row = client
        .query_one("SELECT max(version) FROM abbe.schema_version", &[])
        .await?;
    Ok(Some(row.try_get::<_, Option<i64>>(0)?.unwrap_or(0)))
}

/// Applies the steps that are missing, in one transaction with their numbers.
async fn migrate(client: &mut Client) -> Result<(), tokio_postgres::Error> {
    let transaction = client.transaction().await?;
    let lock = "SELECT pg_advisory_xact_lock($1)";
    transaction.query_one(lock, &[&LOCK]).await?;
    let is_there = "SELECT to_regnamespace('abbe') IS NOT NULL";
    let row = transaction.query_one(is_there, &[]).await?;
    if !row.try_get::<_, bool>(0)? {
        transaction.batch_execute("CREATE SCHEMA abbe").await?;
    }
    transaction
        .batch_execute("CREATE TABLE IF NOT EXISTS schema_version (version BIGINT PRIMARY KEY)")
        .await?;
    let row = transaction
        .query_one("SELECT max(version) FROM schema_version", &[])
        .await?;
    let done = row.try_get::<_, Option<i64>>(0)?.unwrap_or(0);
    for (number, text) in schema::steps_after(done) {
        transaction
            .batch_execute(&schema::of_postgres(text))
            .await?;
        let insert = "INSERT INTO schema_version VALUES ($1)";
        transaction.execute(insert, &[&number]).await?;
    }
    transaction.commit().await
}

/// Whether a further attempt may succeed: the connection broke, the server is away, starts or ends, or two writers met.
fn is_passing(error: &tokio_postgres::Error) -> bool {
    const PASSING: [SqlState; 8] = [
        SqlState::ADMIN_SHUTDOWN,
        SqlState::CRASH_SHUTDOWN,
        SqlState::CANNOT_CONNECT_NOW,
        SqlState::TOO_MANY_CONNECTIONS,
        SqlState::T_R_SERIALIZATION_FAILURE,
        SqlState::T_R_DEADLOCK_DETECTED,
        SqlState::CONNECTION_FAILURE,
        SqlState::CONNECTION_EXCEPTION,
    ];
    match error.code() {
        Some(code) => PASSING.contains(code),
        None => error.is_closed() || is_broken(error),
    }
}

/// Whether the link broke: while it was used, or while TLS began.
fn is_broken(error: &tokio_postgres::Error) -> bool {
    let source = std::error::Error::source(error);
    source.is_some_and(|it| it.is::<std::io::Error>() || tls::is_of_tls(it))
        && tls::fault(error).is_none()
}

/// The server's own words, or those of the connection with their cause.
fn in_words(error: &tokio_postgres::Error) -> String {
    if let Some(database) = error.as_db_error() {
        return format!("{} ({})", database.message(), database.code().code());
    }
    match std::error::Error::source(error) {
        Some(source) => format!("{error}: {source}"),
        None => error.to_string(),
    }
}

/// What a server reports, in words that name the remedy.
fn wrong(path: &Path, options: Options, error: &tokio_postgres::Error) -> HistoryError {
    const REFUSED: [SqlState; 2] = [
        SqlState::INSUFFICIENT_PRIVILEGE,
        SqlState::READ_ONLY_SQL_TRANSACTION,
    ];
    const DAMAGED: [SqlState; 2] = [SqlState::UNDEFINED_TABLE, SqlState::UNDEFINED_COLUMN];
    const LOCKED: [SqlState; 2] = [SqlState::LOCK_NOT_AVAILABLE, SqlState::QUERY_CANCELED];
    const UNOPENED: [SqlState; 3] = [
        SqlState::INVALID_PASSWORD,
        SqlState::INVALID_AUTHORIZATION_SPECIFICATION,
        SqlState::INVALID_CATALOG_NAME,
    ];
    let path = path.to_owned();
    match tls::fault(error) {
        Some(tls::Fault::NotOffered) => return HistoryError::NoTls { path },
        Some(tls::Fault::Untrusted(reason)) => return HistoryError::Untrusted { path, reason },
        None => {}
    }
    let reason = in_words(error);
    let is_of = |states: &[SqlState]| error.code().is_some_and(|code| states.contains(code));
    if is_of(&REFUSED) {
        HistoryError::Refused { path, reason }
    } else if is_of(&DAMAGED) {
        HistoryError::NoDatabase { path, reason }
    } else if is_of(&LOCKED) {
        HistoryError::Locked {
            path,
            waited_ms: options.busy_ms,
        }
    } else if is_of(&UNOPENED) {
        HistoryError::Unopened { path, reason }
    } else if error.code() == Some(&SqlState::DISK_FULL) {
        HistoryError::Full { path }
    } else if is_passing(error) {
        late(&path, options, &reason)
    } else {
        HistoryError::Server { path, reason }
    }
}
