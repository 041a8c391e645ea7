//! Stores that cannot be used: the error names the file, the fault and the remedy.

use std::path::Path;

use history::{Added, HistoryError, Options, SeriesKey, Store, VERSION, Window};
use rusqlite::Connection;

use crate::example::{entry, figure};

/// Waits for no lock.
const IMPATIENT: Options = Options {
    busy_ms: 1,
    most_pages: 4_194_304,
};

fn made(path: &Path) {
    let mut store = Store::open(path, IMPATIENT).unwrap();
    store.add(&entry("m", 1, 100, 1.0)).unwrap();
}

fn names(error: &HistoryError, path: &Path, remedy: &str) {
    let text = error.to_string();
    assert!(text.contains(&path.display().to_string()), "{text}");
    assert!(text.contains(remedy), "{text}");
}

#[test]
fn a_file_that_is_no_database_is_refused() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("notes.txt");
    std::fs::write(&path, "no database ".repeat(1_000)).unwrap();
    for opened in [
        Store::open(&path, IMPATIENT),
        Store::open_to_read(&path, IMPATIENT),
    ] {
        let error = opened.unwrap_err();
        assert!(
            matches!(error, HistoryError::NoDatabase { .. }),
            "{error:?}"
        );
        names(&error, &path, "--store");
    }
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.starts_with("no database "));
}

#[test]
fn a_device_is_refused_by_its_kind() {
    let path = Path::new("/dev/zero");
    for opened in [
        Store::open(path, IMPATIENT),
        Store::open_to_read(path, IMPATIENT),
    ] {
        let error = opened.unwrap_err();
        assert!(
            matches!(error, HistoryError::NotRegular { .. }),
            "{error:?}"
        );
        names(&error, path, "--store");
    }
}

#[test]
fn a_database_of_another_program_is_left_alone() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("songs.sqlite");
    let other = Connection::open(&path).unwrap();
    other
        .execute_batch("CREATE TABLE songs (title TEXT)")
        .unwrap();
    let error = Store::open(&path, IMPATIENT).unwrap_err();
    assert!(
        matches!(error, HistoryError::Foreign { found: 0, .. }),
        "{error:?}"
    );
    names(&error, &path, "another program");
    let n: i64 = other
        .query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0))
        .unwrap();
    assert_eq!(n, 1);
}

#[test]
fn a_newer_schema_is_refused_with_both_versions() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("history.sqlite");
    made(&path);
    let other = Connection::open(&path).unwrap();
    other
        .execute("INSERT INTO schema_version VALUES (?1)", [VERSION + 7])
        .unwrap();
    drop(other);
    for opened in [
        Store::open(&path, IMPATIENT),
        Store::open_to_read(&path, IMPATIENT),
    ] {
        let error = opened.unwrap_err();
        assert!(
            matches!(error, HistoryError::Newer { found, known, .. } if found == VERSION + 7 && known == VERSION),
            "{error:?}"
        );
        names(&error, &path, "install the newer abbe");
    }
}

#[test]
fn a_locked_store_is_given_up_after_the_timeout() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("history.sqlite");
    made(&path);
    let mut store = Store::open(&path, IMPATIENT).unwrap();
    let other = Connection::open(&path).unwrap();
    other.execute_batch("BEGIN IMMEDIATE").unwrap();
    let error = store.add(&entry("m", 2, 200, 2.0)).unwrap_err();
    assert!(
        matches!(error, HistoryError::Locked { waited_ms: 1, .. }),
        "{error:?}"
    );
    names(&error, &path, "end that program");
    // Reading goes on meanwhile, and writing afterwards.
    assert_eq!(store.machines().unwrap()[0].entries, 1);
    other.execute_batch("ROLLBACK").unwrap();
    assert_eq!(store.add(&entry("m", 2, 200, 2.0)).unwrap(), Added::New);
}

#[test]
fn a_full_store_keeps_nothing_of_the_entry() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("history.sqlite");
    made(&path);
    let small = Options {
        most_pages: 40,
        ..IMPATIENT
    };
    let mut store = Store::open(&path, small).unwrap();
    let mut large = entry("m", 2, 200, 2.0);
    let many = (0..5_000).map(|i| figure(&format!("figure_{i}"), 1.0));
    large.figures.extend(many);
    let error = store.add(&large).unwrap_err();
    assert!(matches!(error, HistoryError::Full { .. }), "{error:?}");
    names(&error, &path, "make space");
    assert_eq!(store.machines().unwrap()[0].entries, 1);
    assert_eq!(store.add(&entry("m", 3, 300, 3.0)).unwrap(), Added::New);
}

#[test]
fn a_store_opened_to_read_is_not_written() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("history.sqlite");
    made(&path);
    let mut store = Store::open_to_read(&path, IMPATIENT).unwrap();
    let error = store.add(&entry("m", 2, 200, 2.0)).unwrap_err();
    assert!(matches!(error, HistoryError::ReadOnly { .. }), "{error:?}");
    names(&error, &path, "read-only");
}

#[test]
fn a_store_that_is_absent_or_has_no_folder_is_refused() {
    let home = tempfile::tempdir().unwrap();
    let absent = home.path().join("absent.sqlite");
    let error = Store::open_to_read(&absent, IMPATIENT).unwrap_err();
    assert!(matches!(error, HistoryError::Absent { .. }), "{error:?}");
    assert!(!absent.exists());
    let lost = home.path().join("no/such/history.sqlite");
    let error = Store::open(&lost, IMPATIENT).unwrap_err();
    assert!(matches!(error, HistoryError::Unopened { .. }), "{error:?}");
    names(&error, &lost, "folder");
}

#[test]
fn a_damaged_store_is_an_error_and_no_panic() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("history.sqlite");
    made(&path);
    let whole = std::fs::read(&path).unwrap();
    for at in (100..whole.len()).step_by(997) {
        let mut bytes = whole.clone();
        bytes[at..]
            .iter_mut()
            .take(64)
            .for_each(|byte| *byte ^= 0xa5);
        let damaged = home.path().join(format!("damaged_{at}.sqlite"));
        std::fs::write(&damaged, &bytes).unwrap();
        if let Ok(mut store) = Store::open(&damaged, IMPATIENT) {
            let _ = store.add(&entry("m", 5, 500, 5.0));
            let _ = store.last_values(&history::SeriesKey::default());
        }
    }
}

/// Everything that is read of a store, or the first error.
fn all_read(path: &Path) -> Result<usize, HistoryError> {
    let store = Store::open_to_read(path, IMPATIENT)?;
    store.machines()?;
    store.test_times("m")?;
    store.last_values(&SeriesKey::default())?;
    let mut n = 0;
    for series in store.series(&SeriesKey::default())? {
        n += store.points(series.id, Window::ALL)?.len();
    }
    Ok(n)
}

/// What another program did to a store, and words of the refusal.
const DAMAGES: [(&str, &str); 14] = [
    (
        "UPDATE entry SET machine = hex(zeroblob(50000))",
        "machine = \"0000",
    ),
    (
        "UPDATE entry SET source = hex(zeroblob(50000))",
        "100000 bytes",
    ),
    ("UPDATE entry SET machine = 'm' || char(27)", "control"),
    (
        "UPDATE entry SET machine = x'ff'",
        "1 bytes that are no text",
    ),
    (
        "UPDATE entry SET at_s = 9223372036854775807",
        "at_s = 9223372036854775807",
    ),
    (
        "UPDATE series SET name = hex(zeroblob(200))",
        "name = \"0000",
    ),
    (
        "UPDATE figure SET value = 1e999 WHERE entry = 1",
        "series 1: value = inf",
    ),
    (
        "UPDATE figure SET value = 1e305 WHERE entry = 2",
        "value = 1",
    ),
    (
        "UPDATE figure SET value = 'abc' WHERE entry = 2",
        "value = \"abc\" (3 bytes)",
    ),
    (
        "UPDATE figure SET at_s = 'x' WHERE entry = 1",
        "at_s = \"x\"",
    ),
    ("UPDATE figure SET at_s = -1", "at_s = -1"),
    (
        "UPDATE figure SET standard_uncertainty = -1e-6",
        "must be 0 or more",
    ),
    (
        "UPDATE figure SET standard_uncertainty = 'x'",
        "standard_uncertainty = \"x\"",
    ),
    (
        "DELETE FROM entry WHERE id = 2",
        "entry 2: source of its entry = nothing",
    ),
];

#[test]
fn a_row_that_this_program_never_writes_is_refused_with_table_column_and_remedy() {
    let home = tempfile::tempdir().unwrap();
    for (n, (sql, words)) in DAMAGES.into_iter().enumerate() {
        let path = home.path().join(format!("{n}.sqlite"));
        let mut store = Store::open(&path, IMPATIENT).unwrap();
        for (number, at_s) in [(1, 200), (2, 100)] {
            store.add(&entry("m", number, at_s, 1.0)).unwrap();
        }
        drop(store);
        assert_eq!(all_read(&path).unwrap(), 2);
        let other = Connection::open(&path).unwrap();
        other.execute_batch("PRAGMA foreign_keys = OFF").unwrap();
        other.execute_batch(sql).unwrap();
        drop(other);
        let error = all_read(&path).expect_err(sql);
        assert!(
            matches!(error, HistoryError::BadRow { .. }),
            "{sql}: {error:?}"
        );
        names(&error, &path, "restore a copy");
        let text = error.to_string();
        assert!(text.contains(words), "{sql}: {text}");
        assert!(text.len() < 500, "{sql}: {text}");
    }
}

#[test]
fn a_store_without_a_table_or_a_column_is_a_damaged_one() {
    let home = tempfile::tempdir().unwrap();
    for (n, sql) in [
        "DROP TABLE figure",
        "DROP TABLE schema_version",
        "ALTER TABLE series RENAME COLUMN axis TO axes",
        "UPDATE figure SET entry = 'x'",
    ]
    .into_iter()
    .enumerate()
    {
        let path = home.path().join(format!("{n}.sqlite"));
        made(&path);
        let other = Connection::open(&path).unwrap();
        other.execute_batch("PRAGMA foreign_keys = OFF").unwrap();
        other.execute_batch(sql).unwrap();
        drop(other);
        let error = all_read(&path).expect_err(sql);
        names(&error, &path, "restore a copy");
    }
}
