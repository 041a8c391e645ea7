//! Stores that cannot be used: the error names the file, the fault and the remedy.

use std::path::Path;

use history::{Added, HistoryError, Options, Store, VERSION};
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
