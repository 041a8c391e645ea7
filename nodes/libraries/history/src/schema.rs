//! The schema of a store, and its migrations: one text a version, each applied once, in one transaction with its number.

use rusqlite::{Connection, TransactionBehavior};

/// `Abbe` as four bytes: the application id in the file's head.
pub const APPLICATION_ID: i64 = 0x4162_6265;

/// Migrations in their order; the first makes version 1. A released one never changes.
const MIGRATIONS: [&str; 1] = ["
CREATE TABLE entry (
    id INTEGER PRIMARY KEY,
    machine TEXT NOT NULL,
    at_s INTEGER NOT NULL,
    kind TEXT NOT NULL,
    sha256 TEXT NOT NULL,
    machine_sha256 TEXT,
    source TEXT NOT NULL,
    instruments TEXT NOT NULL,
    operator TEXT NOT NULL,
    software TEXT NOT NULL,
    UNIQUE (kind, sha256)
);
CREATE INDEX entry_of_machine ON entry (machine, at_s);
CREATE TABLE series (
    id INTEGER PRIMARY KEY,
    machine TEXT NOT NULL,
    test TEXT NOT NULL,
    name TEXT NOT NULL,
    axis TEXT NOT NULL,
    unit TEXT NOT NULL,
    UNIQUE (machine, name, axis, test, unit)
);
CREATE INDEX series_of_name ON series (name, axis);
CREATE TABLE figure (
    series INTEGER NOT NULL REFERENCES series (id),
    at_s INTEGER NOT NULL,
    entry INTEGER NOT NULL REFERENCES entry (id),
    value REAL NOT NULL,
    standard_uncertainty REAL,
    low REAL,
    high REAL,
    status TEXT NOT NULL,
    PRIMARY KEY (series, at_s, entry)
) WITHOUT ROWID;
CREATE INDEX figure_of_entry ON figure (entry);
"];

/// The steps after a version, with their numbers.
#[cfg(feature = "postgres")]
pub fn steps_after(version: i64) -> impl Iterator<Item = (i64, &'static str)> {
    let all = (1_i64..).zip(MIGRATIONS);
    all.filter(move |(number, _)| *number > version)
}

/// A text of SQL, as SQLite takes it, in the words of PostgreSQL: the same tables, numbers and order of texts.
#[cfg(feature = "postgres")]
pub fn of_postgres(sql: &str) -> String {
    const WORDS: [(&str, &str); 8] = [
        (
            "id INTEGER PRIMARY KEY",
            "id BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY",
        ),
        (" INTEGER", " BIGINT"),
        (" REAL", " DOUBLE PRECISION"),
        // Bytes are compared, as SQLite does.
        (" TEXT", " TEXT COLLATE \"C\""),
        (" WITHOUT ROWID", ""),
        ("instr(", "strpos("),
        // Columns have one type there.
        (" OR typeof(f.at_s) <> 'integer'", ""),
        ("?", "$"),
    ];
    let mut text = sql.to_owned();
    for (of_sqlite, of_postgres) in WORDS {
        text = text.replace(of_sqlite, of_postgres);
    }
    text
}

/// The newest version.
pub const VERSION: i64 = MIGRATIONS.len() as i64;

/// The version of a store; 0 of an empty file, `None` of a database of another program.
pub fn version(connection: &Connection) -> Result<Option<i64>, rusqlite::Error> {
    let tables: i64 =
        connection.query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0))?;
    if application_id(connection)? == APPLICATION_ID {
        let version =
            connection.query_row("SELECT max(version) FROM schema_version", [], |row| {
                row.get::<_, Option<i64>>(0)
            })?;
        return Ok(Some(version.unwrap_or(0)));
    }
    Ok((tables == 0).then_some(0))
}

/// The application id in the file's head.
pub fn application_id(connection: &Connection) -> Result<i64, rusqlite::Error> {
    connection.pragma_query_value(None, "application_id", |row| row.get(0))
}

/// Brings a store of a known version up to date.
pub fn migrate(connection: &mut Connection) -> Result<(), rusqlite::Error> {
    apply(connection, &MIGRATIONS)
}

fn apply(connection: &mut Connection, migrations: &[&str]) -> Result<(), rusqlite::Error> {
    // Immediate: two programs that open a new file at once make its tables one after the other.
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
    let done = version(&transaction)?.unwrap_or(0);
    if done == 0 {
        transaction.execute_batch(&format!(
            "PRAGMA application_id = {APPLICATION_ID};
             CREATE TABLE schema_version (version INTEGER PRIMARY KEY);"
        ))?;
    }
    for (number, text) in (1_i64..)
        .zip(migrations)
        .filter(|(number, _)| *number > done)
    {
        transaction.execute_batch(text)?;
        transaction.execute("INSERT INTO schema_version VALUES (?1)", [number])?;
    }
    transaction.commit()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_migration_is_applied_once_and_keeps_the_rows() {
        let mut connection = Connection::open_in_memory().unwrap();
        assert_eq!(version(&connection).unwrap(), Some(0));
        migrate(&mut connection).unwrap();
        assert_eq!(version(&connection).unwrap(), Some(VERSION));
        connection
            .execute(
                "INSERT INTO entry VALUES (1, 'm', 5, 'report', 'h', NULL, 's', '', '', 'v')",
                [],
            )
            .unwrap();
        let next = [MIGRATIONS[0], "ALTER TABLE entry ADD COLUMN place TEXT"];
        for _ in 0..2 {
            apply(&mut connection, &next).unwrap();
        }
        assert_eq!(version(&connection).unwrap(), Some(VERSION + 1));
        let row: (String, Option<String>) = connection
            .query_row("SELECT machine, place FROM entry", [], |row| {
                Ok((row.get(0)?, row.get(1)?))
            })
            .unwrap();
        assert_eq!(row, ("m".to_owned(), None));
    }

    #[test]
    fn a_migration_that_fails_leaves_the_version_before() {
        let mut connection = Connection::open_in_memory().unwrap();
        migrate(&mut connection).unwrap();
        let broken = [
            MIGRATIONS[0],
            "CREATE TABLE more (a); CREATE TABLE entry (b)",
        ];
        assert!(apply(&mut connection, &broken).is_err());
        assert_eq!(version(&connection).unwrap(), Some(VERSION));
        let more: i64 = connection
            .query_row(
                "SELECT count(*) FROM sqlite_schema WHERE name = 'more'",
                [],
                |row| row.get(0),
            )
            .unwrap();
        assert_eq!(more, 0);
    }

    #[test]
    fn a_database_of_another_program_has_no_version() {
        let connection = Connection::open_in_memory().unwrap();
        connection
            .execute_batch("CREATE TABLE songs (title TEXT)")
            .unwrap();
        assert_eq!(version(&connection).unwrap(), None);
    }
}
