//! What is added to a server is there once, whoever writes beside, and whatever becomes of the server.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use history::{Added, HistoryError, Kind, Options, SeriesKey, Store, VERSION, Window};

use crate::example::{entry, figure};
use crate::server::Server;

/// Waits long: the tests share few processors.
pub const PATIENT: Options = Options {
    busy_ms: 120_000,
    most_pages: 4_194_304,
};
/// Waits for almost nothing.
const HASTY: Options = Options {
    busy_ms: 300,
    ..PATIENT
};

fn n_kept(path: &Path) -> usize {
    let store = Store::open_to_read(path, PATIENT).unwrap();
    let series = store.series(&SeriesKey::default()).unwrap();
    let of = |id: i64| store.points(id, Window::ALL).unwrap().len();
    series.iter().map(|one| of(one.id)).sum()
}

/// Adds entries of these numbers, each by a store of its own; how many were new.
fn writer(path: PathBuf, numbers: std::ops::Range<u64>) -> usize {
    let add = |number: u64| {
        let mut store = Store::open(&path, PATIENT).unwrap();
        let at_s = 100 + i64::try_from(number).unwrap();
        let mut one = entry("m", number, at_s, 1.0);
        one.figures.push(figure("iso230_2.repeatability", 2.0));
        store.add(&one).unwrap() == Added::New
    };
    numbers.filter(|number| add(*number)).count()
}

#[test]
fn what_two_writers_add_is_there_once() {
    let Some(server) = Server::start("what_two_writers_add_is_there_once") else {
        return;
    };
    let path = server.database("fleet");
    // Both make the tables, and half of what each adds is the other's too.
    let numbers = [0..40_u64, 20..60];
    let writers = numbers.map(|numbers| {
        let path = path.clone();
        std::thread::spawn(move || writer(path, numbers))
    });
    let n_new: usize = writers.into_iter().map(|it| it.join().unwrap()).sum();
    assert_eq!(n_new, 60);
    assert_eq!(n_kept(&path), 120);
}

#[test]
fn a_server_that_is_killed_in_mid_write_and_comes_back_loses_and_doubles_nothing() {
    let name = "a_server_that_is_killed_in_mid_write_and_comes_back_loses_and_doubles_nothing";
    let Some(mut server) = Server::start(name) else {
        return;
    };
    const KILLED_ENTRIES: usize = 300;
    let path = server.database("fleet");
    let mut store = Store::open(&path, PATIENT).unwrap();
    let done = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            for number in 0..KILLED_ENTRIES {
                let mut one = entry("m", number as u64, number as i64, 1.0);
                let more = (0..50).map(|i| figure(&format!("figure_{i}"), 1.0));
                one.figures.extend(more);
                assert_eq!(store.add(&one).unwrap(), Added::New, "{number}");
                done.store(number + 1, Ordering::Relaxed);
            }
        });
        for at in [20, 120, 220] {
            while done.load(Ordering::Relaxed) < at {
                std::thread::sleep(Duration::from_millis(1));
            }
            server.kill();
            server.run();
        }
    });
    assert_eq!(n_kept(&path), 51 * KILLED_ENTRIES);
    let entries = server.execute("fleet", "SELECT count(*) FROM abbe.entry");
    assert_eq!(entries.trim(), KILLED_ENTRIES.to_string());
}

#[test]
fn a_server_that_is_away_is_given_up_after_the_stated_time() {
    let Some(mut server) = Server::start("a_server_that_is_away_is_given_up_after_the_stated_time")
    else {
        return;
    };
    let path = server.database("fleet");
    let mut store = Store::open(&path, PATIENT).unwrap();
    drop(store);
    store = Store::open(
        &path,
        Options {
            busy_ms: 3_000,
            ..PATIENT
        },
    )
    .unwrap();
    server.kill();
    let lost = store.add(&entry("m", 1, 100, 1.0)).unwrap_err();
    let opened = Store::open(&path, HASTY).unwrap_err();
    for (error, time) in [(lost, "3000 ms"), (opened, "300 ms")] {
        assert!(
            matches!(error, HistoryError::Unreachable { .. }),
            "{error:?}"
        );
        let text = error.to_string();
        for words in [time, "start the server", "postgres://owner@127.0.0.1"] {
            assert!(text.contains(words), "{text}");
        }
    }
    server.run();
    assert_eq!(n_kept(&path), 0);
}

#[test]
fn older_newer_and_foreign_tables_are_brought_up_to_date_or_refused() {
    let name = "older_newer_and_foreign_tables_are_brought_up_to_date_or_refused";
    let Some(server) = Server::start(name) else {
        return;
    };
    let path = server.database("older");
    let absent = Store::open_to_read(&path, PATIENT).unwrap_err();
    assert!(matches!(absent, HistoryError::Absent { .. }), "{absent:?}");
    // A program that was ended after it had made the first table alone.
    let begun = "CREATE SCHEMA abbe; CREATE TABLE abbe.schema_version (version BIGINT PRIMARY KEY)";
    server.execute("older", begun);
    let mut store = Store::open(&path, PATIENT).unwrap();
    assert_eq!(store.add(&entry("m", 1, 100, 1.0)).unwrap(), Added::New);
    assert_eq!(n_kept(&path), 1);
    let newer = "INSERT INTO abbe.schema_version VALUES (99)";
    server.execute("older", newer);
    for opened in [
        Store::open(&path, PATIENT),
        Store::open_to_read(&path, PATIENT),
    ] {
        let error = opened.unwrap_err();
        let is_newer =
            matches!(error, HistoryError::Newer { found: 99, known, .. } if known == VERSION);
        assert!(is_newer, "{error:?}");
    }
    let foreign = server.database("foreign_tables");
    let songs = "CREATE SCHEMA abbe; CREATE TABLE abbe.songs (title TEXT)";
    server.execute("foreign_tables", songs);
    let error = Store::open(&foreign, PATIENT).unwrap_err();
    assert!(matches!(error, HistoryError::Foreign { .. }), "{error:?}");
    let gone = server.url("owner", "gone");
    let error = Store::open(&gone, PATIENT).unwrap_err();
    assert!(matches!(error, HistoryError::Unopened { .. }), "{error:?}");
}

#[test]
fn a_user_who_may_only_read_reads_and_is_refused_to_write() {
    let Some(server) = Server::start("a_user_who_may_only_read_reads_and_is_refused_to_write")
    else {
        return;
    };
    let path = server.database("fleet");
    Store::open(&path, PATIENT)
        .unwrap()
        .add(&entry("m", 1, 100, 1.0))
        .unwrap();
    let rights = "CREATE ROLE reader LOGIN; GRANT USAGE ON SCHEMA abbe TO reader; GRANT SELECT ON ALL TABLES IN SCHEMA abbe TO reader; CREATE ROLE stranger LOGIN";
    server.execute("fleet", rights);
    let of_reader = server.url("reader", "fleet");
    assert_eq!(n_kept(&of_reader), 1);
    let mut store = Store::open(&of_reader, PATIENT).unwrap();
    let refused = store.add(&entry("m", 2, 100, 1.0)).unwrap_err();
    assert!(
        matches!(refused, HistoryError::Refused { .. }),
        "{refused:?}"
    );
    assert!(refused.to_string().contains("grant"), "{refused}");
    // What was opened to read writes nothing, whoever it is.
    let mut to_read = Store::open_to_read(&path, PATIENT).unwrap();
    let refused = to_read.add(&entry("m", 3, 100, 1.0)).unwrap_err();
    assert!(
        matches!(refused, HistoryError::Refused { .. }),
        "{refused:?}"
    );
    let stranger = Store::open_to_read(&server.url("stranger", "fleet"), PATIENT);
    let error = stranger.unwrap_err();
    assert!(matches!(error, HistoryError::Refused { .. }), "{error:?}");
    assert_eq!(n_kept(&path), 1);
}

/// Every answer of a store, as text.
fn all_read(path: &Path) -> Vec<String> {
    let store = Store::open_to_read(path, PATIENT).unwrap();
    let keys = [
        "effect.backlash",
        "iso230_2.accuracy",
        "effect",
        "iso230_2.acc%",
    ];
    let named = keys.map(|name| SeriesKey {
        name: Some(name.to_owned()),
        ..SeriesKey::default()
    });
    let of_test = SeriesKey {
        test: Some("diagnosis".to_owned()),
        axis: Some("X".to_owned()),
        ..SeriesKey::default()
    };
    let mut read = Vec::new();
    for key in named.iter().chain([&SeriesKey::default(), &of_test]) {
        for series in store.series(key).unwrap() {
            let window = Window {
                since_s: 86_400,
                until_s: 86_400 * 4,
            };
            let kept = store.points(series.id, window).unwrap();
            let name = (
                series.machine,
                series.test,
                series.name,
                series.axis,
                series.unit,
            );
            read.push(format!("{name:?} {kept:?}"));
        }
        let last = store.last_values(key).unwrap();
        let last = last
            .iter()
            .map(|it| format!("{} {:?} {}", it.series.machine, it.point, it.n));
        read.extend(last);
    }
    read.push(format!("{:?}", store.machines().unwrap()));
    read.push(format!("{:?}", store.test_times("a").unwrap()));
    read
}

#[test]
fn a_server_and_a_file_answer_the_same() {
    let Some(server) = Server::start("a_server_and_a_file_answer_the_same") else {
        return;
    };
    let home = tempfile::tempdir().unwrap();
    let both = [home.path().join("history.sqlite"), server.database("fleet")];
    let mut entries = Vec::new();
    for (number, machine) in (1_u64..).zip(["b", "a", "B", "ä", "a"]) {
        let mut one = entry(machine, number, 86_400 * number as i64 + 60, number as f64);
        let mut play = figure("effect.backlash.width_um", 6.5);
        (play.axis, play.unit) = ("X".to_owned(), "um".to_owned());
        (play.interval, play.standard_uncertainty) = (Some([6.0, 7.0]), None);
        play.test = "Diagnosis".to_owned();
        one.figures.push(play);
        entries.push(one);
    }
    let mut other = entries[0].clone();
    other.figures[0].value += 1.0;
    let mut elsewhere = entries[0].clone();
    elsewhere.machine = "elsewhere".to_owned();
    let mut twice = entries[0].clone();
    twice.kind = Kind::Diagnosis;
    twice.figures.push(twice.figures[0].clone());
    let again = [&entries[0].clone(), &other, &elsewhere];
    let answers = both.map(|path| {
        let mut store = Store::open(&path, PATIENT).unwrap();
        let all = entries.iter().chain(again);
        let added: Vec<Added> = all.map(|one| store.add(one).unwrap()).collect();
        // A figure that stands there twice fails within the transaction: nothing of the entry stays.
        assert!(store.add(&twice).is_err());
        drop(store);
        let read = all_read(&path);
        (added, read)
    });
    assert!(answers[0].1.len() > 20);
    assert_eq!(answers[0], answers[1]);
}
